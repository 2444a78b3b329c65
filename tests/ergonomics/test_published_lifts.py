"""Lifts that others worked out: the manual's examples as books and courses print them, and a public guide.

Printed weights are products of multipliers of two digits, sometimes of the table's nearest row: 2 %.
"""

import math

import pytest

from seerob.criteria.ergonomics.niosh import (
    Duration,
    End,
    Grip,
    Task,
    composite_index,
    frequency_independent,
    frequency_multiplier,
)

INCH, POUND = 0.025, 23 / 51
"""As the two forms of the equation pair them: 10 in with 25 cm, 51 lb with 23 kg."""
BAGS = "https://id.scribd.com/document/674781910/Tugas-NIOSH-91-siti-andan-dewi"
DISHES = "http://what-when-how.com/Tutorial/topic-53604/Fundamentals-and-Assessment-Tools-for-Occupational-Ergonomics-912.html"
BOXES = "https://homeworksource.com/p/1089113/compact-12-kg-loads-are-inspected-for-damage-and-lifted-with-1089113"
CANADA = "http://www.ccohs.ca/oshanswers/ergonomics/niosh/"
CONVEYOR = "https://wizedu.com/questions/203981/according-to-the-niosh-lifting-equation-the-best"
THREE_TASKS = "https://ingenieriametodos.blogspot.com/2015/01/lineamientos-para-el-levantamiento.html"


def weights(H, V, *, A=0.0, grip=Grip.FAIR, F=0.2, spell=Duration.SHORT):
    """RWL at both ends [kg] of H and V [m] there; A [deg] is the same at both."""
    origin, destination = (End(H=h, V=v, A=math.radians(A)) for h, v in zip(H, V, strict=True))
    task = Task(
        average=1,
        heaviest=1,
        origin=origin,
        destination=destination,
        control=True,
        frequency=F,
        grip=grip,
    )
    FM = frequency_multiplier(F, origin.V, spell)
    return [FM * frequency_independent(task, end) for end in (origin, destination)]


def test_loading_bags_into_a_hopper():
    """Example 3 of the manual, worked out in `BAGS` in metric: 18 in, 15 to 36 in, 45°, fair: 8.52 kg."""
    origin, _ = weights((18 * INCH, 10 * INCH), (15 * INCH, 36 * INCH), A=45)
    assert origin == pytest.approx(8.52, rel=0.02)
    assert 20 / origin == pytest.approx(2.35, rel=0.03)


def test_unloading_a_dish_washer():
    """Example 5 of the manual in `DISHES`: 14.4 lb at the origin and 13.3 lb at the destination, FM 0.80."""
    assert frequency_multiplier(5, 44 * INCH, Duration.SHORT) == 0.80
    found = weights((20 * INCH, 20 * INCH), (44 * INCH, 7 * INCH), A=30, grip=Grip.GOOD, F=5)
    assert [w / POUND for w in found] == pytest.approx([14.4, 13.3], rel=0.02)
    assert 20 / (found[0] / POUND) == pytest.approx(1.4, abs=0.05)


def test_inspecting_boxes():
    """Example 4 of the manual in metric, `BOXES`: RWL 15.72 kg, and 0.76 for 12 kg."""
    origin, _ = weights((0.25, 0.50), (0.55, 1.50), F=3)
    assert origin == pytest.approx(15.72, rel=0.01)
    assert 12 / origin == pytest.approx(0.76, abs=0.01)


@pytest.mark.parametrize(
    ("page", "H", "V", "more", "printed"),
    [
        ("vertical.html", 0.30, (0, 1.15), {"grip": Grip.POOR}, 11.4),
        ("horizontal.html", 0.50, (0.75, 1.15), {}, 10.9),
        ("frequency.html", 0.20, (0.75, 0.75), {"A": 90, "F": 10, "spell": Duration.LONG}, 2.1),
    ],
)
def test_the_guide_of_canada(page, H, V, more, printed):
    """`CANADA`: takes the multipliers of the nearest row of coarse tables, such as 0.80 for 0.833."""
    assert weights((H, H), V, **more)[0] == pytest.approx(printed, rel=0.02), page


def test_between_conveyors():
    """`CONVEYOR`: HM 0.50, VM 0.82, DM 0.93 over 16 in, CM 0.95: 18.4 lb before the frequency."""
    origin, _ = weights((20 * INCH, 16 * INCH), (6 * INCH, 22 * INCH))
    assert origin / POUND == pytest.approx(18.4, rel=0.02)


def test_three_tasks_together():
    """Section 2.4.5 of the manual, as `THREE_TASKS` has it after Niebel and Freivalds: the index is
    1.6 + 1 (1/0.88 - 1/0.94) + 0.67 (1/0.70 - 1/0.88) = 1.60 + 0.07 + 0.20. The multipliers are those of
    1, 3 and 7 lifts per minute for up to 1 h; loads of 30, 20 and 10 lb for weights of 20, 20 and 15 lb.
    """

    def task(load, weight, F):
        A = (1 - weight / (51 * 0.5)) / 0.0032  # at H = 20 in all else is 1
        end = End(H=20 * INCH, V=30 * INCH, A=math.radians(A))
        made = Task(
            average=load * POUND,
            heaviest=load * POUND,
            origin=end,
            destination=end,
            control=False,
            frequency=F,
            grip=Grip.GOOD,
        )
        assert frequency_independent(made, end) / POUND == pytest.approx(weight)
        return made

    tasks = [task(10, 15, 4), task(30, 20, 1), task(20, 20, 2)]
    found = composite_index(tasks, Duration.SHORT)
    assert found == pytest.approx(1.60 + 0.07 + 0.20, abs=0.01)
    assert found == pytest.approx(30 / 18.8 + 1 / 0.88 - 1 / 0.94 + 2 / 3 * (1 / 0.70 - 1 / 0.88))
