"""Tables of angle zones: ranges, holds, counts, holding times, accuracy, what is not known."""

import math

import numpy as np
import pytest
from made_postures import PERSON, made_angles, random_q

from made_cell import made, person, results_at
from seerob.core.errors import InputError
from seerob.core.verdict import Verdict
from seerob.criteria.scoring.spans import published
from seerob.criteria.scoring.zones import MEASURES, ZoneMonitor, ZoneRow, mistakes, value_of, zones_of
from seerob.description.humans.angles import angles
from seerob.description.humans.skeleton import JOINTS, bone_poses, mirrored


def row(low=None, high=None, score=1.0, angle="trunk_flexion", **more):
    ends = {k: None if v is None else math.radians(v) for k, v in (("low", low), ("high", high))}
    return ZoneRow(angle=angle, score=score, **ends, **more)


def scores(rows, signal, duration, *, rate=10, accuracy=0.0, support=None, from_rest=True, angle=None):
    """(least, greatest) of the first angle at each instant; the signal is in degrees."""
    name = angle or rows[0].angle
    watch = ZoneMonitor(rows, from_rest=from_rest)
    found = []
    for k in range(round(duration * rate) + 1):
        posture = made_angles(**{name: signal(k / rate)})
        said = watch.add(k / rate, posture, math.radians(accuracy), {(name, 0): support, (name, 1): support})
        found.append(said[name, 0])
    return found


BANDS = [row(None, 20, 0), row(20, 60, 1), row(60, None, 2)]


@pytest.mark.parametrize(("angle", "expected"), [(-90, 0), (19.9, 0), (20, 1), (59.9, 1), (60, 2), (170, 2)])
def test_a_range_holds_its_begin_and_not_its_end(angle, expected):
    assert scores(BANDS, lambda _: angle, 0)[0] == (expected, expected)


def test_the_interval_is_exact_against_a_dense_search():
    rows = [row(-10, 5, 3), row(5, 20, 0), row(20, 22, 5), row(22, 60, 1), row(60, None, 2)]
    rng = np.random.default_rng(0)
    for angle, accuracy in zip(rng.uniform(-30, 90, 60), rng.uniform(0.01, 40, 60), strict=True):
        low, high = scores(rows, lambda _, x=angle: x, 0, accuracy=accuracy)[0]
        dense = [
            max((r.score for r in rows if r.within(math.radians(x))), default=0.0)
            for x in np.linspace(angle - accuracy, angle + accuracy, 4001)
        ]
        assert (low, high) == (min(dense), max(dense))


def test_either_way_is_of_the_size():
    rows = [row(10, None, 2, "trunk_twist", either_way=True)]
    found = [scores(rows, lambda _, x=x: x, 0)[0][0] for x in (-12, -9, 9, 12)]
    assert found == [2, 0, 0, 2]


def test_a_side_of_its_own():
    watch = ZoneMonitor([row(30, None, 4, "shoulder_elevation", side="left")], from_rest=True)
    found = watch.add(0.0, made_angles(shoulder_elevation=[50, 50]), 0.0, {})
    assert found == {("shoulder_elevation", 0): (0, 0), ("shoulder_elevation", 1): (4, 4)}


@pytest.mark.parametrize(("held", "expected"), [(4.1, 2), (3.8, 1)])
def test_a_row_with_a_hold_counts_once_it_is_held(held, expected):
    rows = [row(20, 60, 1), row(20, 60, 2, hold=4)]
    found = scores(rows, lambda t: 30 if 1 <= t < 1 + held else 0, 8)
    assert max(found) == (expected, expected)
    first = next((k for k, ends in enumerate(found) if ends == (2, 2)), None)
    assert first == (50 if expected == 2 else None)


@pytest.mark.parametrize(("away", "expected"), [(0.8, 2), (1.2, 1)])
def test_a_short_absence_does_not_end_a_hold(away, expected):
    rows = [row(20, 60, 1), row(20, 60, 2, hold=4)]
    found = scores(rows, lambda t: 0 if 3 <= t < 3 + away else 30, 6)
    assert found[-1] == (expected, expected)


@pytest.mark.parametrize(("cycles", "expected"), [(2, 2), (1, 1)])
def test_a_row_counts_once_it_was_entered_so_often(cycles, expected):
    rows = [row(60, None, 1), row(60, None, 2, per_minute=2)]
    found = scores(rows, lambda t: 70 if (t * cycles / 60) % 1 > 0.9 else 0, 120)
    assert max(found) == (expected, expected)


@pytest.mark.parametrize(("angle", "allowed"), [(20, 240), (40, 150), (59, 64.5)])
def test_holding_times_are_linear_between_the_ends_of_the_range(angle, allowed):
    rows = [row(20, 60, 1), row(20, 60, 2, allowed=240, allowed_at_end=60)]
    found = scores(rows, lambda _: angle, allowed + 3, rate=2)
    first = next(k for k, ends in enumerate(found) if ends == (2, 2)) / 2
    assert allowed < first <= allowed + 1


def test_the_largest_angle_of_a_stay_decides_how_long_it_may_last():
    rows = [row(20, 60, 2, allowed=240, allowed_at_end=60)]
    found = scores(rows, lambda t: 55 if 10 < t < 12 else 25, 100, rate=4)
    assert found[83 * 4] == (2, 2)
    assert found[80 * 4] == (0, 0)


def test_support_that_nobody_entered_leaves_both_open():
    rows = [row(20, None, 1, support="with"), row(20, None, 3, support="without")]
    found = {s: scores(rows, lambda _: 30, 0, support=s)[0] for s in (True, False, None)}
    assert found == {True: (1, 1), False: (3, 3), None: (0, 3)}


def test_what_is_not_measured_may_be_anything():
    assert scores(BANDS, lambda _: math.nan, 5)[-1] == (0, 2)


def test_what_lasts_since_the_first_instant_may_have_begun_before():
    rows = [row(20, None, 1), row(20, None, 2, hold=4)]
    found = scores(rows, lambda _: 30, 5, from_rest=False)
    assert (found[0], found[-1]) == ((1, 2), (2, 2))
    late = scores(rows, lambda t: 30 if t > 1 else 0, 3, from_rest=False)
    assert set(late) == {(0, 0), (1, 1)}
    often = [row(20, None, 1), row(20, None, 2, per_minute=2)]
    late = scores(often, lambda t: 30 if t > 1 else 0, 62, from_rest=False)
    assert (late[20], late[-1]) == ((1, 2), (1, 1))


def test_a_silence_forgets():
    watch = ZoneMonitor([row(20, None, 1), row(20, None, 2, hold=4)], from_rest=True)
    bent = made_angles(trunk_flexion=30)
    for t in (0, 1, 2, 3, 4):
        last = watch.add(t, bent, 0.0, {})
    assert last["trunk_flexion", 0] == (2, 2)
    assert watch.add(6.0, bent, 0.0, {})["trunk_flexion", 0] == (1, 2)
    # And an earlier instant begins anew.
    assert watch.add(0.0, bent, 0.0, {})["trunk_flexion", 0] == (1, 1)


def test_how_often_an_angle_was_entered_that_nobody_saw_is_not_known():
    """Half a minute out of sight may hold any number of entries; a minute later none counts any more."""
    rows = [row(20, None, 1), row(20, None, 2, per_minute=4)]
    found = scores(rows, lambda t: math.nan if 20 <= t < 50 else 30 if 60 <= t < 62 else 0, 130)
    assert (found[190], found[610], found[1090]) == ((0, 0), (1, 2), (0, 0))


def test_who_looks_seldom_does_not_know_how_often_an_angle_was_entered():
    rows = [row(20, None, 1), row(20, None, 2, per_minute=2)]
    assert scores(rows, lambda t: 30 if t > 62 else 0, 64, rate=1)[-1] == (1, 2)
    assert scores(rows, lambda t: 30 if t > 62 else 0, 64, rate=4)[-1] == (1, 1)


@pytest.mark.parametrize("accuracy", [0.0, 5.0, 12.0, 25.0, 40.0])
def test_the_accuracy_never_hides_how_often_an_angle_was_entered(accuracy):
    """A trunk that bends to 35° and back six times a minute may have done so with any accuracy."""
    rows = [row(20, 60, 0), row(20, 60, 2, per_minute=2)]
    found = scores(rows, lambda t: 35 if t % 10 < 3 else 5, 80, accuracy=accuracy)
    assert found[710][1] == 2
    if not accuracy:
        assert found[710] == (2, 2)


@pytest.mark.parametrize(("angle", "expected"), [(18, (0, 0)), (10, (0, 0)), (22, (0, 0))])
def test_an_angle_that_stands_was_entered_once_with_any_constant_error(angle, expected):
    rows = [row(20, 60, 0), row(20, 60, 2, per_minute=2)]
    assert scores(rows, lambda _: angle, 80, accuracy=8)[-1] == expected


def test_the_head_is_the_neck_on_the_trunk():
    bent = made_angles(trunk_flexion=30, neck_flexion=15)
    assert value_of("head_inclination", 0, bent, math.radians(3)) == (
        pytest.approx(math.radians(45)),
        pytest.approx(math.radians(6)),
    )


@pytest.mark.parametrize(
    ("wrong", "column"),
    [
        (row(10, 5), "high"),
        (row(angle="trunk_flexing"), "angle"),
        (row(side="left"), "side"),
        (row(-5, 5, either_way=True), "low"),
        (row(20, None, allowed=10, allowed_at_end=5), "allowed_at_end"),
        (row(20, 30, allowed=10, hold=5), "allowed"),
    ],
)
def test_what_cannot_be_in_a_row(wrong, column):
    assert [found[0] for found in mistakes(wrong)] == [column]


@pytest.mark.parametrize("name", ["iso_11226", "en_1005_4"])
def test_the_shipped_tables_can_be_read_and_say_how_sure_they_are(name):
    table = zones_of(published(name), name)
    assert {r.confidence for r in table.rows} <= {"1", "M", "2+"}
    assert {r.score for r in table.rows} == {0, 1, 2}
    assert {r.angle for r in table.rows} <= set(MEASURES)
    for angle in {r.angle for r in table.rows}:
        # No angle scores less than a smaller one, once it has been held.
        rows = [r for r in table.rows if r.angle == angle]
        held = [
            max((r.score for r in rows if r.within(math.radians(x)) and r.support != "with"), default=0)
            for x in range(0, 170)
        ]
        assert held == sorted(held)


def test_the_figures_of_iso_11226():
    """Trunk at 40° without support: 2.5 min; upper arm at 40°: 2 min; head at 55°: 4.5 min."""
    rows = zones_of(published("iso_11226"), "").rows
    for angle, x, expected in (
        ("trunk_flexion", 40, 150),
        ("shoulder_elevation", 40, 120),
        ("head_inclination", 55, 270),
    ):
        (timed,) = [r for r in rows if r.angle == angle and r.allowed is not None]
        assert timed.longest(math.radians(x)) == pytest.approx(expected)


def test_every_mistake_of_a_table_is_named():
    table = {
        "rows": [
            {"angle": "trunk_flexion", "low_deg": 20, "score": -1},
            {"angle": "knee", "score": 1},
            {"angle": "neck_twist", "score": 1, "colr": "red"},
        ]
    }
    with pytest.raises(InputError) as error:
        zones_of(table, "t.toml")
    assert [p.key for p in error.value.problems] == ["rows[0].score", "rows[1].angle", "rows[2].colr"]


@pytest.mark.parametrize("name", ["iso_11226", "en_1005_4"])
def test_zones_change_sides_in_a_mirror_and_not_with_heading_and_place(name):
    rows = zones_of(published(name), name).rows

    def said(q):
        support = dict.fromkeys(((n, s) for n in MEASURES for s in range(2)), False)
        watch = ZoneMonitor(rows, from_rest=True)
        posture = angles(*bone_poses(PERSON, q))
        for t in range(6):
            found = watch.add(float(t), posture, 0.0, support)
        return found

    differ = 0
    for q in random_q(40, seed=4):
        own, other = said(q), said(mirrored(q))
        for (angle, side), ends in own.items():
            assert other[angle, 1 - side if (angle, 1) in own else side] == ends
        differ += own["shoulder_elevation", 0] != own["shoulder_elevation", 1]
        turned = q.copy()
        turned[[JOINTS.index("pelvis_x"), JOINTS.index("pelvis_y")]] = 3.0, -2.0
        turned[JOINTS.index("pelvis_turn_left")] += 1.3
        assert said(turned) == own
    assert differ > 0


@pytest.mark.parametrize("kind", ["iso_11226", "en_1005_4"])
def test_what_is_open_without_an_accuracy_is_open_with_one(tmp_path, kind):
    """How long it was held before nobody knows; that angles are known less well is no relief."""
    bent = "[humans.joints_deg]\nneck_turn_left = 25\nhead_turn_left = 15\nright_shoulder_flexion = 30\n"
    text = person("op") + bent
    for name, more in (
        ("exact", ""),
        ("rough", "accuracy = 0.05\n"),
        ("rested", "accuracy = 0.05\nfrom_rest = true\n"),
    ):
        text += f'[[ergonomics]]\nkind = "{kind}"\nname = "{name}"\nhuman = "op"\n{more}'
    found = results_at(made(tmp_path, text))
    assert found["exact"].verdict is Verdict.UNDECIDED
    assert found["rough"].verdict is Verdict.UNDECIDED
    assert found["rested"].verdict is None
