"""The revised NIOSH equation: published examples, tables, limits of each variable, refusals."""

import math
from dataclasses import replace

import numpy as np
import pytest

from seerob.criteria.ergonomics.niosh import (
    Duration,
    End,
    Grip,
    Task,
    asymmetry_multiplier,
    composite_index,
    coupling_multiplier,
    distance_multiplier,
    duration,
    frequency_independent,
    frequency_multiplier,
    governing,
    horizontal_multiplier,
    recommended_weight,
    vertical_multiplier,
)

INCH, POUND = 0.025, 23 / 51
"""As the two forms of the equation pair them: 10 in with 25 cm, 51 lb with 23 kg."""
BEST = Task(
    average=23.0,
    heaviest=23.0,
    origin=End(H=0.25, V=0.75),
    destination=End(H=0.25, V=0.75),
    control=True,
    frequency=0.2,
    grip=Grip.GOOD,
)


def lift(**changes):
    return replace(BEST, **changes)


def test_the_best_lift_may_weigh_the_load_constant():
    assert recommended_weight(BEST, Duration.SHORT) == pytest.approx(23.0)
    assert composite_index([BEST], Duration.SHORT) == pytest.approx(1.0)


def test_package_inspection():
    """Example 4 of the manual: 34.9 lb at the origin and 15.2 lb at the destination, FM 0.88, printed with
    rounded multipliers. H at the destination, 20 in, follows from the printed weight."""
    task = lift(
        origin=End(H=10 * INCH, V=22 * INCH),
        destination=End(H=20 * INCH, V=59 * INCH),
        frequency=3,
        grip=Grip.FAIR,
    )
    FM = frequency_multiplier(task.frequency, task.origin.V, Duration.SHORT)
    assert FM == 0.88
    weights = [frequency_independent(task, end) * FM / POUND for end in (task.origin, task.destination)]
    assert weights == pytest.approx([34.9, 15.2], rel=0.02)
    assert governing(task)[1] == "destination"
    assert governing(replace(task, control=False))[1] == "origin"
    assert [round(w, 1) for w in weights] == [34.8, 15.3]  # the manual's own full-precision figures


def test_loading_supply_rolls():
    """Example 2 of the manual, figure 9: 35 lb, 28.0 lb and LI 1.3 at the origin, 18.1 lb and 1.9 at the
    destination; printed with multipliers of two digits, 0.67, 0.98, 0.93, 0.90 and 0.50, 0.85, 0.93, 0.90."""
    task = lift(
        average=35 * POUND,
        heaviest=35 * POUND,
        origin=End(H=15 * INCH, V=27 * INCH),
        destination=End(H=20 * INCH, V=10 * INCH),
        grip=Grip.POOR,
    )
    weights = [frequency_independent(task, end) / POUND for end in (task.origin, task.destination)]
    assert weights == pytest.approx([28.0, 18.1], rel=0.02)
    assert [round(35 / w, 1) for w in weights] == [1.3, 1.9]
    printed = [51 * 0.67 * 0.98 * 0.93 * 0.90, 51 * 0.50 * 0.85 * 0.93 * 0.90]
    assert printed == pytest.approx([28.0, 18.1], abs=0.05)
    assert governing(task)[1] == "destination"


@pytest.mark.parametrize(
    ("inches", "printed"), [(10, 1.0), (12, 0.83), (15, 0.67), (20, 0.5), (22, 0.46), (23, 0.44), (25, 0.40)]
)
def test_horizontal(inches, printed):
    """0.46 and 0.44 are printed where the formula gives 0.4545 and 0.4348."""
    assert float(horizontal_multiplier(inches * INCH)) == pytest.approx(printed, rel=0.02)


def test_each_multiplier_at_its_ends():
    assert horizontal_multiplier([0.1, 0.25, 0.5, 0.63, 0.64]) == pytest.approx([1, 1, 0.5, 0.25 / 0.63, 0])
    assert vertical_multiplier([0, 0.75, 1.75, 1.76]) == pytest.approx([0.775, 1, 0.7, 0])
    assert distance_multiplier([0, 0.25, 1.3, 1.75, 1.76]) == pytest.approx(
        [1, 1, 0.82 + 0.045 / 1.3, 0.82 + 0.045 / 1.75, 0]
    )
    assert asymmetry_multiplier(np.radians([0, 90, -90, 135, 136])) == pytest.approx(
        [1, 0.712, 0.712, 0.568, 0]
    )
    with pytest.raises(ValueError, match="hands above the floor"):
        vertical_multiplier(-0.1)


@pytest.mark.parametrize(
    ("F", "V", "spell", "expected"),
    [
        (0.0, 0.5, Duration.SHORT, 1.0),
        (0.2, 0.5, Duration.LONG, 0.85),
        (5, 0.5, Duration.MODERATE, 0.60),
        (2.4, 0.5, Duration.SHORT, 0.91 - 0.4 * 0.03),
        (10 * 8 / 15, 0.5, Duration.SHORT, 0.80 - (1 / 3) * 0.05),
        (9, 0.74, Duration.LONG, 0.0),
        (9, 0.75, Duration.LONG, 0.15),
        (8.5, 0.5, Duration.LONG, 0.0),
        (15, 1.0, Duration.SHORT, 0.28),
        (15.1, 1.0, Duration.SHORT, 0.0),
    ],
)
def test_frequency(F, V, spell, expected):
    """2.4 per minute is interpolated in example 7; 5.33 is the manual's mean over 15 minutes."""
    assert frequency_multiplier(F, V, spell) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("grip", "low", "high"), [(Grip.GOOD, 1, 1), (Grip.FAIR, 0.95, 1), (Grip.POOR, 0.9, 0.9)]
)
def test_coupling(grip, low, high):
    assert (coupling_multiplier(grip, 0.74), coupling_multiplier(grip, 0.75)) == (low, high)


@pytest.mark.parametrize(
    ("work", "recovery", "expected"),
    [
        (30, 30, Duration.SHORT),
        (60, 60, Duration.SHORT),
        (75, 25, Duration.MODERATE),  # 30 + 45 min with 10 min between
        (120, 36, Duration.MODERATE),
        (120, 35, Duration.LONG),
        (121, 400, Duration.LONG),
        (480, 0, Duration.LONG),
    ],
)
def test_durations_of_the_manual(work, recovery, expected):
    assert duration(60 * work, 60 * recovery) is expected


def test_more_than_eight_hours_are_refused():
    with pytest.raises(ValueError, match="0 to 8 h"):
        duration(8 * 3600 + 1, 0)


def test_the_composite_index_by_hand():
    """Three tasks that differ in load and frequency only: every term can be written down."""
    tasks = [
        lift(average=10, heaviest=12, frequency=1),
        lift(average=20, heaviest=21, frequency=2),
        lift(average=15, heaviest=15, frequency=5),
    ]
    # In the column "up to 2 h, V from 0.75 m on": FM 0.88, 0.84, 0.60 at 1, 2 and 5 per minute, so the
    # order is 15 kg (1.087), 20 kg (1.035), 10 kg; summed 5, 7, 8 per minute: 0.60, 0.42, 0.35.
    expected = 15 / 23 / 0.60 + 21 / 23 * (1 / 0.42 - 1 / 0.60) + 12 / 23 * (1 / 0.35 - 1 / 0.42)
    assert composite_index(tasks, Duration.MODERATE) == pytest.approx(expected)
    assert composite_index(tasks[::-1], Duration.MODERATE) == pytest.approx(expected)


def test_a_job_is_never_easier_than_its_hardest_task():
    rng = np.random.default_rng(0)
    for _ in range(200):
        tasks = [
            lift(
                average=kg,
                heaviest=kg * 1.2,
                origin=End(H=rng.uniform(0.2, 0.6), V=rng.uniform(0, 1.7)),
                destination=End(H=rng.uniform(0.2, 0.6), V=rng.uniform(0, 1.7)),
                frequency=rng.uniform(0.1, 2),
            )
            for kg in rng.uniform(1, 30, 3)
        ]
        single = max(composite_index([task], Duration.LONG) for task in tasks)
        assert composite_index(tasks, Duration.LONG) >= single - 1e-12


def test_beyond_the_tables_the_index_is_infinite():
    assert composite_index([lift(origin=End(H=0.7, V=0.75))], Duration.SHORT) == math.inf
    fast = lift(frequency=8)
    assert composite_index([fast], Duration.SHORT) < math.inf
    assert composite_index([fast, fast], Duration.SHORT) == math.inf
