"""The EAWS-style screening: lines, points over time, asymmetry, and no rating without sections 2 to 4."""

import re

import numpy as np
import pytest
from made_postures import PERSON, made_angles

from made_cell import judged, made, state_at
from seerob.core.snapshot import Snapshot, Verdict
from seerob.criteria.ergonomics.eaws_posture import (
    EawsThresholds,
    HeldTimes,
    Interpolation,
    Screening,
    asymmetry_points,
    lightest_first,
    line_points,
    lines,
    most_points,
    possible_lines,
)
from seerob.criteria.scoring.spans import published
from seerob.description.humans.posture import posture
from seerob.description.humans.skeleton import JOINTS
from seerob.recording.result_log import ResultLog

USUAL = EawsThresholds()
STILL = np.zeros(len(JOINTS))


def line(legs="standing", supported=False, accuracy=0.0, **angles):
    found = possible_lines(
        made_angles(**angles),
        legs=legs,
        supported=supported,
        thresholds=USUAL,
        accuracy=np.radians(accuracy),
    )
    return lightest_first(found)


@pytest.mark.parametrize(
    ("expected", "given"),
    [
        ("1", {"supported": True}),
        ("1", {"legs": "walking"}),
        ("2", {}),
        ("2", {"trunk_flexion": 19.9}),
        ("3a", {"trunk_flexion": 20}),
        ("3a", {"trunk_flexion": 59}),
        ("4a", {"trunk_flexion": 60}),
        ("3b", {"trunk_flexion": 40, "supported": True}),
        ("4a", {"trunk_flexion": 61}),
        ("4b", {"trunk_flexion": 61, "supported": True}),
        ("5", {"arm_rise": [0, -80]}),
        ("6", {"arm_rise": [-80, 60]}),
        ("6", {"arm_rise": 60, "trunk_flexion": 70}),
        ("7", {"legs": "sitting", "supported": True}),
        ("8", {"legs": "sitting"}),
        ("9", {"legs": "sitting", "trunk_flexion": 30, "supported": True}),
        ("10", {"legs": "sitting", "arm_rise": 10}),
        ("11", {"legs": "sitting", "arm_rise": 50}),
        ("12", {"legs": "kneeling"}),
        ("13", {"legs": "kneeling", "trunk_flexion": 30}),
        ("14", {"legs": "kneeling", "arm_rise": 10}),
        ("15", {"legs": "lying"}),
        ("16", {"legs": "climbing"}),
        ("12", {"legs": "posture", "knee_flexion": 90}),
        ("12", {"legs": "posture", "shank_tilt": [90, 0]}),
        ("2", {"legs": "posture", "knee_flexion": [90, 0]}),
    ],
)
def test_each_line_has_its_posture(expected, given):
    assert line(**given) == (expected,)


def test_what_is_not_known_may_be_several_lines_the_lightest_first():
    assert line(supported=None) == ("1", "2")
    assert set(line(legs=None)) == {"2", "8", "1", "12", "15", "16"}
    assert line(trunk_flexion=np.nan) == ("2", "3a", "4a")
    assert line(trunk_flexion=18, accuracy=5) == ("2", "3a")
    assert line(trunk_flexion=18, accuracy=1) == ("2",)


@pytest.mark.parametrize("name", list(lines()))
def test_points_grow_with_the_share_and_hit_the_columns(name):
    shares = published("eaws_posture")["shares"]
    points = lines()[name].points
    assert len(points) == (6 if name == "16" else 10)
    for share, expected in zip(shares, points, strict=False):
        for interpolation in Interpolation:
            assert line_points(name, share, interpolation) == pytest.approx(expected)
    grid = np.linspace(0, 1, 400)
    for interpolation in Interpolation:
        assert (np.diff([line_points(name, x, interpolation) for x in grid]) >= -1e-9).all()
    assert line_points(name, 0.025) == pytest.approx(points[0] / 2)
    assert line_points(name, 0.025, Interpolation.STEP) == 0
    assert line_points(name, 1.0) == points[-1]


def test_raised_arms_cost_more_than_bending_more_than_upright():
    for low, high in (
        ("12", "13"),
        ("13", "14"),
        ("2", "3a"),
        ("3a", "4a"),
        ("5", "6"),
        ("8", "9"),
        ("10", "11"),
    ):
        for share in published("eaws_posture")["shares"][:6]:
            assert line_points(low, share) <= line_points(high, share)


@pytest.mark.parametrize(
    ("shares", "expected"),
    [
        ((0, 0, 0), 0),
        ((0.05, 0.05, 0.05), 0),
        ((0.06, 0, 0), 1.5),
        ((0.15, 0, 0), 2.5),
        ((0.5, 0.2, 0.06), 9),
        ((1, 1, 1), 15),
    ],
)
def test_asymmetry_reaches_every_factor(shares, expected):
    assert asymmetry_points(shares) == expected


def test_a_posture_counts_from_its_begin_once_it_is_held():
    t = np.arange(201) / 10
    b = (t >= 5) & (t < 8)
    times = HeldTimes([4.0, 4.0])
    at_once = times.add(t, np.column_stack([~b, b]))
    assert at_once.heard[-1] == pytest.approx(20)
    assert at_once.seconds[-1].tolist() == [pytest.approx(5 + 12), 0]
    assert at_once.seconds[[30, 40], 0].tolist() == [0, pytest.approx(4)]
    later = times.add(np.array([30.0]), np.array([[True, False]]))
    assert (later.silent[-1], later.heard[-1]) == (pytest.approx(10), pytest.approx(20))


def station(folder, more="", cycle=20):
    phases = 'phases = [{ legs = "posture", back_supported = false }]\n'
    return made(
        folder,
        '[[humans]]\nname = "op"\nstature = 1.75\nmass = 75\nsex = "male"\n'
        f'[[ergonomics]]\nkind = "eaws_posture"\nname = "s"\nhuman = "op"\ncycle = {cycle}\n'
        f"{more if 'phases' in more else phases + more}\n",
    )


ENTERED = (
    "entered = { moving_objects = 0, accessibility = 0, impulses = 0, joint_position = 0, special = 0, "
    "far_reach = 0, forces = 10, loads = 5, upper_limbs = 30 }\n"
)


def run(stage, poses, duration, rate=5):
    """The result after every instant."""
    state = state_at(stage)
    angles = {}
    for k in range(round(duration * rate) + 1):
        t = k / rate
        name = poses(t)
        if name not in angles:
            q = posture(PERSON, {} if name == "up" else {"pelvis_tilt_forward": np.radians(45)})
            angles[name] = state_at(stage, op=(q, STILL))
        state = angles[name]
        state.t = t
        yield judged(stage.bound, state)[0]


def test_a_cycle_half_bent_has_the_points_of_both_halves(tmp_path):
    stage = station(tmp_path, ENTERED)
    *_, last = run(stage, lambda t: "bent" if t < 10 else "up", 20)
    by_line = {p.name: p.value for p in last.parts}
    assert by_line["line 3a"] == pytest.approx(line_points("3a", 0.5), rel=0.05)
    assert by_line["line 2"] == pytest.approx(line_points("2", 0.5), rel=0.05)
    assert last.value == pytest.approx(by_line["line 3a"] + by_line["line 2"] + 15)
    assert "points: above 25, up to 50" in last.reason


@pytest.mark.parametrize(("limit", "verdict"), [(1, Verdict.EXCEEDED), (45, Verdict.WITHIN)])
def test_a_verdict_says_where_its_figures_are_from(tmp_path, limit, verdict):
    *_, last = run(station(tmp_path, f"limit = {limit}\n{ENTERED}"), lambda _: "up", 20, rate=2)
    assert last.verdict is verdict
    assert "memory, not verified (1 + M)" in last.reason


def test_there_is_no_rating_without_sections_2_to_4(tmp_path):
    """Whatever the points, the limit and the cycle: undecided, and no band in any text."""
    band = re.compile(r"0 to 25|above 25|above 50|green|yellow|\bred\b", re.IGNORECASE)
    for limit in (1, 25, 50):
        *_, last = run(station(tmp_path, f"limit = {limit}\n"), lambda _: "bent", 20)
        assert last.verdict is Verdict.UNDECIDED
        assert last.value > 30
        assert last.reason.startswith("EAWS-style posture screening (sections 0-1 only), no rating")
        assert "not entered: moving objects" in last.reason
        assert not band.search(last.reason)
        assert last.rows[0].verdict is Verdict.UNDECIDED
    partly = ENTERED.replace(", upper_limbs = 30", "")
    *_, last = run(station(tmp_path, partly + "limit = 50\n"), lambda _: "up", 20)
    assert last.verdict is Verdict.UNDECIDED
    assert not band.search(last.reason)


def test_with_everything_entered_the_limit_is_judged_once_a_cycle_is_whole(tmp_path):
    found = list(run(station(tmp_path, ENTERED + "limit = 25\n"), lambda _: "bent", 20))
    assert {r.verdict for r in found[:-1]} <= {None, Verdict.EXCEEDED}
    assert found[10].reason.count("counting: 2.0 of 20 s, judged after a whole cycle")
    # The upper limbs alone are beyond the limit: no cycle makes that less.
    assert found[0].verdict is Verdict.EXCEEDED
    assert found[-1].verdict is Verdict.EXCEEDED
    values = [r.value for r in found]
    assert values == sorted(values)
    assert values[0] == 30  # the upper limbs, until the whole body has more
    assert values[-1] == pytest.approx(40 + 15)


@pytest.mark.parametrize(("seconds", "expected"), [(10, Verdict.UNDECIDED), (20, Verdict.WITHIN)])
def test_a_run_that_ends_before_its_cycle_is_undecided(tmp_path, seconds, expected):
    """Half a cycle upright may end in any way; the log of the run says so, and why."""
    found = list(run(station(tmp_path, ENTERED + "limit = 35\n"), lambda _: "up", seconds))
    assert {r.verdict for r in found[:-1]} == {None}
    log = ResultLog()
    for k, result in enumerate(found):
        log.add(Snapshot(seq=k, t=k / 5, poses=b"", results=(result,)))
    assert log.verdict is log["s"].verdict is log["s"].worst().verdict is expected
    assert ("judged after a whole cycle" in log["s"].worst().reason) == (seconds < 20)


def test_what_is_unknown_makes_an_interval(tmp_path):
    *_, last = run(station(tmp_path, ENTERED + 'phases = [{ legs = "posture" }]\n'), lambda _: "bent", 20)
    assert last.value is None
    # The body may have been supported for a sixth of the time only, in which more costs nothing.
    most = most_points({"3a": 1.0, "3b": 1.0}, 1.0)
    assert 40 < most < 46.5
    assert last.interval == (pytest.approx(25 + 15), pytest.approx(most + 15))


def test_no_share_of_the_time_has_more_points_than_the_most():
    """Random shares of lines of which each has no more than it may and all have the whole."""
    rng = np.random.default_rng(0)
    names = list(lines())
    for _ in range(300):
        own = rng.choice(names, rng.integers(1, 5), replace=False)
        may = dict(zip(own, rng.uniform(0, 1, len(own)), strict=True))
        whole = rng.uniform(0, 1)
        most = most_points(may, whole)
        for _ in range(40):
            shares = rng.dirichlet(np.full(len(own), 0.5)) * whole
            points = sum(line_points(n, min(x, may[n])) for n, x in zip(own, shares, strict=True))
            assert points <= most + 1e-9
    for name in names:
        assert most_points({name: 0.4}, 1.0) == pytest.approx(line_points(name, 0.4))


def test_a_posture_that_may_have_been_held_between_two_others_counts():
    """Bent by 15° and by 65° in turn, each for 3 s and known to ±10°: it may have been 25° and 55°, bent
    forward all the time, which is held; of the lightest lines and of the heaviest none is.
    """
    screening = Screening(30.0, 4.0, Interpolation.LINEAR)
    for k in range(301):
        posture = made_angles(trunk_flexion=15 if k // 30 % 2 else 65)[None]
        found = possible_lines(
            posture, legs="standing", supported=False, thresholds=USUAL, accuracy=np.radians(10)
        )
        _, low, high = screening.add(np.array([k / 10]), found, posture, np.radians(10))
    assert low.total == 0
    assert high.total >= line_points("3a", 1.0)


@pytest.mark.parametrize("limit", [25, 35])
def test_a_screening_with_an_accuracy_is_within_below_its_bound_only(tmp_path, limit):
    """The pelvis tilts to 15° and 65° in turn: with the accuracy it may have been bent all the time."""
    entered = ENTERED.replace("upper_limbs = 30", "upper_limbs = 0")
    more = (
        'phases = [{ legs = "standing", back_supported = false }]\n'
        f"{entered}limit = {limit}\naccuracy_deg = 10\n"
    )
    stage = station(tmp_path, more, cycle=24)
    states = [
        state_at(stage, op=(posture(PERSON, {"pelvis_tilt_forward": np.radians(x)}), STILL)) for x in (15, 65)
    ]
    for k in range(121):
        state = states[k // 15 % 2]
        state.t = k / 5
        last = judged(stage.bound, state)[0]
    assert last.verdict is Verdict.UNDECIDED
    assert last.interval[1] >= 40 + 15


def test_what_is_printed_says_where_the_figures_are_from(tmp_path):
    stage = station(tmp_path)
    basis = stage.bound[0].basis
    named = {i.name: i for i in basis.inputs}
    assert "conflict" in named["line 14"].source
    assert "1 + M" in basis.source
    assert any("sections 2 to 4" in text for text in basis.not_modelled)
    assert "EAWS" not in stage.scene().criteria[0].title.replace("EAWS-style", "").replace("not the EAWS", "")
