"""Where the criteria are asked, which looks decide about a plan, and how the parts make one verdict."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from msgspec.structs import replace as changed

from made_cell import FLOATING, TWO_R, heard, made, two_r
from seerob.core.errors import InputError, Undecided
from seerob.core.samples import PoseSample, SignalSample
from seerob.core.snapshot import Result
from seerob.core.verdict import Verdict
from seerob.criteria.safety.velocity import Velocity
from seerob.recording.series import Series
from seerob.session.permissible import evaluation
from seerob.session.permissible.between_samples import motions_of
from seerob.session.permissible.ceilings import By, Ceiling, Method
from seerob.session.permissible.evaluation import PermissibleSpeed, Wish, either_permits, given_motion, mapped
from seerob.session.permissible.joint_limits import JointLimits, joint_limits
from seerob.session.permissible.path import GivenMotion, path_of
from seerob.session.permissible.rescaled import rescale
from seerob.session.permissible.speed_map import SpeedMap, Stations, reference_speed, segments
from seerob.session.permissible.survey import Survey, Verified, verify
from seerob.session.permissible.witness import Posed, Witness, _heard
from seerob.session.run import Summary
from seerob.twin.engine import Engine
from seerob.workstation.source import HOLD, Opened

SWING = '[[sources]]\nkind = "csv"\nrobot = "{name}"\nfile = "{name}.csv"\n'
ARMS = TWO_R + TWO_R.replace('"arm"', '"other"') + "base = { position = [0, 9, 0] }\n"
GATE = '[[parts]]\nname = "post"\nshape = { box = [0.1, 0.1, 0.1] }\nat = { position = [0, 20, 0] }\n'
LIFT = (
    '[[machines]]\nname = "lift"\nshape = { box = [0.1, 0.1, 0.1] }\nat = { position = [0, 20, 0] }\n'
    "mass = 1\nslide = { along = [0, 0, 1], lower = 0, upper = 1 }\n"
)
TEXT = FLOATING.replace("{ ", "{ physics = false, ") + ARMS + LIFT + "".join(
    SWING.format(name=name) for name in ("arm", "other")
)  # fmt: skip
ROWS = "t [s],J1 [rad],J2 [rad]\n"


@pytest.fixture(scope="module")
def station(tmp_path_factory):
    rows = {n: ROWS + "".join(f"{t},{q},0\n" for t, q in enumerate(way)) for n, way in WAYS.items()}
    files = {f"{name}.csv": text for name, text in rows.items()}
    return made(tmp_path_factory.mktemp("arms"), TEXT, {"arm.urdf": two_r(), **files})


WAYS = {"arm": (0.0, 0.2, 0.4), "other": (0.0, 0.1)}
STAND = 0.25


def there_and_back(name="arm"):
    """Joint 1 by 0.8 rad and 0.6 rad back, from rest to rest, with a stand before, between and after."""
    x = np.linspace(0, 1, 51)
    way = 10 * x**3 - 15 * x**4 + 6 * x**5
    speed = 30 * x**2 - 60 * x**3 + 30 * x**4
    t = np.concatenate([[0.0], STAND + x, 1 + 2 * STAND + x, [2 + 3 * STAND]])
    q = np.concatenate([[0.0], 0.8 * way, 0.8 - 0.6 * way, [0.2]])
    qd = np.concatenate([[0.0], 0.8 * speed, -0.6 * speed, [0.0]])
    rest = np.zeros_like(q)
    return GivenMotion(name, t, np.stack([q, rest], 1), np.stack([qd, rest], 1), np.ones(len(t), bool))


MOTION = there_and_back()


def limit(value, **more):
    """Of the speed of the tip, 2 m from the axis [m/s]."""
    return Velocity(name="V", at="arm", limit=value, **more)


def watched(model, *way):
    """A run in which the other arm goes so."""
    engine, witness = Engine(model, driven={"arm": 1.0, "other": 1.0}), Witness(lambda state: ())
    for k, q in enumerate(way):
        engine.take([heard("arm", 0.01 * k, (0, 0), (0, 0)), heard("other", 0.01 * k, (q, 0), (0, 0))])
        witness(engine.start() if k == 0 else engine.tick())
    return witness


@pytest.fixture(scope="module")
def surveyed(station):
    model, robot, path = station.model, station.model.robot("arm"), path_of(MOTION, tolerance=5e-4)
    limits = joint_limits(robot, acceleration=6.0, jerk=60.0)
    seen = watched(model, 0.0)

    def of(*criteria, motion=MOTION, by=By.ALL, witness=seen):
        return Survey(model, robot, motion, path, limits, witness, criteria=criteria, by=by)

    return of


@pytest.mark.parametrize("spacing", [0.3, 0.02, 0.0199])
def test_places_are_no_farther_apart_than_asked_and_say_what_is_there(surveyed, spacing):
    told = []
    found = surveyed(limit(0.5)).map(spacing=spacing, progress=told.append)
    assert [len(piece.s) for piece in found.stations] == [
        max(5, math.ceil(way / spacing - 1e-9) + 1) for way in (0.8, 0.6)
    ]
    for stations, piece in zip(found.stations, found.path.pieces, strict=True):
        np.testing.assert_allclose(stations.s, np.linspace(0, piece.length, len(stations.s)))
        np.testing.assert_allclose(stations.t, np.interp(stations.s, piece.s, piece.t))
        np.testing.assert_allclose(stations.given, np.interp(stations.s, piece.s, piece.speed))
        np.testing.assert_allclose(stations.permissible, 0.25, rtol=1e-6)
        np.testing.assert_allclose(stations.reference, 10.0)
        np.testing.assert_allclose(stations.lever, 2.0)
        q = stations.q[:, 0]
        tips = np.stack([2 * np.cos(q), 2 * np.sin(q), 0 * q], 1)
        np.testing.assert_allclose(stations.tool, tips, atol=1e-12)
    assert told == sorted(told)
    assert (told[0], told[-1]) == (0.0, pytest.approx(1.0))
    assert (found.asked, dict(found.methods), found.by) == (("V",), {}, By.ALL)


def test_stations_lie_as_densely_as_is_said_where_nobody_says(surveyed):
    ways = [np.diff(piece.s).max() for piece in surveyed(limit(0.5)).map().stations]
    assert 0.019 < max(ways) <= 0.02 + 1e-12


@pytest.mark.parametrize("spacing", [0.0, -1.0, math.nan, 2.7e-5])
def test_a_spacing_that_never_ends_is_refused(surveyed, spacing):
    """1.4 rad by 27 µrad are more than 50 000."""
    with pytest.raises(InputError, match="more than 50000 stations"):
        surveyed(limit(0.5)).map(spacing=spacing)


def test_without_a_criterion_that_counts_there_is_no_map(surveyed, station):
    for criteria in ((), (limit(None),), (Velocity(name="V", at="other", limit=1.0),)):
        with pytest.raises(InputError, match=r"limits the speed of arm \(asked for: all\)"):
            surveyed(*criteria)


def test_more_stations_are_what_a_denser_map_would_have_had(surveyed):
    survey = surveyed(limit(0.5), Bump(name="B", at="arm", limit=0.5))
    coarse = survey.map(spacing=0.3)
    more = [np.array([0.41, 0.05, 0.0]), np.array([])]
    found = survey.denser(coarse, more, lambda t: t)
    first, second = found.stations
    assert second is coarse.stations[1]
    np.testing.assert_allclose(first.s, np.sort(np.concatenate([coarse.stations[0].s, [0.05, 0.41]])))
    q = first.q[:, 0]
    np.testing.assert_allclose(q, first.s, atol=1e-9)
    np.testing.assert_allclose(first.share, np.where(bumpy(q), 0.0125, 0.025), rtol=1e-6)
    np.testing.assert_allclose(first.tool[:, 1], 2 * np.sin(q), atol=1e-9)
    assert [len(of) for of in first.ceilings] == [2] * len(q)


@pytest.mark.parametrize("bad", [10, 60])
def test_on_both_sides_of_a_sample_that_nobody_vouches_for_nothing_can_be_told(surveyed, bad):
    good = MOTION.good.copy()
    good[bad] = False
    found = surveyed(limit(0.5), motion=replace(MOTION, good=good)).map(spacing=0.01)
    t = np.concatenate([stations.t for stations in found.stations])
    share = np.concatenate([stations.share for stations in found.stations])
    beside = (MOTION.t[bad - 1] <= t) & (t < MOTION.t[bad + 1])
    assert beside.any()
    np.testing.assert_array_equal(np.isnan(share), beside)
    assert [where for where, _ in found.undecided] == t[beside].tolist()


class Bump(Velocity, frozen=True, kw_only=True):
    """Of the speed of the tip, twice as much on a narrow stretch."""

    def bind(self, model):
        def says(state):
            (q, _), (qd, _) = state.q(model.robot("arm")), state.qd(model.robot("arm"))
            value = 2 * abs(qd) * (2 if bumpy(q) else 1)
            return Result(name=self.name, unit="m/s", value=value, limit=self.limit, verdict=Verdict.WITHIN)

        return says


def bumpy(q):
    return np.abs(q - 0.41) < 0.012


@pytest.fixture(scope="module")
def plan(surveyed):
    """Along the path, at 0.25 rad/s where nothing else is slower."""
    return rescale(surveyed(limit(0.5)).map(spacing=0.1), not_faster=False, margin=0.0)


def moving(plan, period, rest=1e-3):
    """Instants of the plan at which it moves, of each piece."""
    found = []
    for piece, start in zip(plan.pieces, plan.starts, strict=True):
        t = np.union1d(np.arange(0, piece.duration, period), piece.duration / 2)
        found.append(start + t[piece.profile.at(t).speed > rest * 0.25 * (1 - 1e-6)])
    return found


@pytest.mark.parametrize(("allowed", "kept"), [(0.5, True), (0.51, True), (0.25, False)])
def test_a_plan_uses_the_largest_share_that_any_look_finds(surveyed, plan, allowed, kept):
    told = []
    found = verify(plan, surveyed(limit(allowed)), period=5e-3, progress=told.append)
    looks = np.concatenate(moving(plan, 5e-3))
    speeds = np.abs(plan.at(looks)[1][:, 0])
    assert (found.asked, found.undecided, found.period) == (len(looks), 0, 5e-3)
    assert found.use == pytest.approx(2 * speeds.max() / allowed, rel=1e-6)
    assert found.kept is kept
    assert found.at == pytest.approx(looks[speeds.argmax()], abs=0.15)
    assert np.abs(plan.at(np.array([found.at]))[1]).max() == pytest.approx(speeds.max(), rel=1e-7)
    assert found.what == "V: speed"
    np.testing.assert_allclose(told, looks / plan.duration)
    for piece, over, at in zip(plan.pieces, found.over, moving(plan, 5e-3), strict=True):
        fast = np.abs(plan.at(at)[1][:, 0]) * 2 > allowed * (1 + 1e-9)
        assert len(over) == (0 if kept else fast.sum())
        assert ((over >= 0) & (over <= piece.piece.length)).all()


class FirstLook(Exception):
    """At which share of the plan."""


def first_look(share):
    raise FirstLook(share)


def test_rest_is_a_thousandth_of_what_is_permitted(surveyed, plan):
    """The first look is where the plan has 1.05, and then 0.95, thousandths of the permissible speed."""
    profile = plan.pieces[0].profile
    t = np.linspace(0, 0.01, 100_001)
    for share, first in ((1.05e-3, 1), (0.95e-3, 2)):
        period = float(t[np.searchsorted(profile.at(t).speed, share * 0.25)])

        with pytest.raises(FirstLook) as told:
            verify(plan, surveyed(limit(0.5)), period=period, progress=first_look)
        assert told.value.args[0] * plan.duration == pytest.approx(plan.starts[0] + first * period, abs=1e-9)


def test_a_piece_that_is_shorter_than_the_period_is_looked_at_in_its_middle(surveyed, plan):
    told = []
    found = verify(plan, surveyed(limit(0.5)), period=99.0, progress=told.append)
    middles = [start + piece.duration / 2 for piece, start in zip(plan.pieces, plan.starts, strict=True)]
    np.testing.assert_allclose(np.array(told) * plan.duration, middles)
    assert found.asked == 2


def test_what_is_met_between_two_stations_is_found_and_so_is_what_permits_nothing(surveyed, plan):
    found = verify(plan, surveyed(Bump(name="B", at="arm", limit=0.5)), period=4e-3)
    assert found.use == pytest.approx(2.0, rel=1e-3)
    first, second = found.over
    assert bumpy(first).all()
    assert bumpy(0.8 - second).all()
    assert min(len(first), len(second)) > 10
    none = verify(plan, surveyed(Bump(name="B", at="arm", limit=1e-12)), period=0.05)
    assert (none.use, none.kept) == (math.inf, False)


def test_who_cannot_be_told_keeps_a_plan_from_being_kept(surveyed, plan):
    good = MOTION.good.copy()
    good[10] = False
    found = verify(plan, surveyed(limit(9.0), motion=replace(MOTION, good=good)), period=0.01)
    over, none = found.over
    assert found.undecided == len(over) > 3
    assert len(none) == 0
    assert found.use < 1
    assert not found.kept


@pytest.mark.parametrize("period", [0.0, -1.0, math.nan, 1e-6])
def test_a_period_that_never_ends_is_refused(surveyed, plan, period):
    with pytest.raises(InputError, match="looked at 400000 times"):
        verify(plan, surveyed(limit(0.5)), period=period)


@pytest.mark.parametrize(
    ("asked", "use", "undecided", "kept"),
    [
        (1, 0.5, 0, True),
        (1, 1.0, 0, True),
        (1, 1.5, 0, False),
        (1, 1 + 1e-6, 0, False),
        (0, 0.5, 0, False),
        (2, 0.5, 1, False),
        (2, math.inf, 0, False),
    ],
)
def test_a_plan_is_kept_where_every_look_knows_and_none_uses_more(asked, use, undecided, kept):
    assert Verified(1e-3, asked, use, 0.0, "", undecided, ()).kept is kept


# -- the map -------------------------------------------------------------------------------------


def test_the_reference_is_the_speed_at_which_the_first_joint_reaches_its_limit():
    """Along (1, −3)/√10 with 1 and 2 rad/s: the second, at 2√10/3."""
    t = np.linspace(0, 1, 51)
    given = GivenMotion("arm", t, np.stack([t, -3 * t], 1), np.full((51, 2), [1.0, -3.0]), np.ones(51, bool))
    (piece,) = path_of(given, tolerance=1e-3).pieces
    of = JointLimits(("a", "b"), ("rad",) * 2, np.array([1.0, 2.0]), np.ones(2), np.ones(2), ())
    speed, joint = reference_speed(piece, np.linspace(0, piece.length, 5), of)
    np.testing.assert_allclose(speed, 2 * np.sqrt(10) / 3, rtol=1e-6)
    assert joint.tolist() == [1] * 5


def mapped_as(shares, given, lever, ways=None, reference=4.0):
    """A map of one piece by hand: None is where only a joint limits."""
    n = len(shares)
    s = np.arange(float(n))
    x = np.concatenate([[0.0], np.cumsum(np.full(n - 1, 0.1) if ways is None else ways)])
    of = tuple(() if share is None else (Ceiling(f"S{k}", share),) for k, share in enumerate(shares))
    stations = Stations(
        s, 10 + s, np.full(n, reference), np.ones(n, int), np.array(given, float), of, By.ALL,
        np.zeros((n, 2)), np.stack([0 * x, x, 0 * x], 1), np.array(lever, float),
    )  # fmt: skip
    limits = JointLimits(("a", "b"), ("rad",) * 2, np.ones(2), np.ones(2), np.ones(2), ())
    return SpeedMap("arm", None, limits, (stations,), By.ALL, ("S",), {})


def test_a_segment_tells_the_slowest_place_of_the_tool_where_a_criterion_governs():
    #                     permissible 2, 1, 4, 4 rad/s; tool 2, 2, 4, 0.4 m/s
    found = mapped_as([0.5, 0.25, None, None], [1, 2, 0, 3], [1, 2, 1, 0.1])
    (one,) = segments(found, length=9.0)
    assert (one.piece, one.number, one.start, one.end) == (1, 1, 10.0, 13.0)
    assert one.way == pytest.approx(0.3)
    assert one.tool[0].tolist() == [0, 0, 0]
    assert one.tool[1] == pytest.approx([0, 0.3, 0])
    assert (one.permissible, one.tool_speed, one.at) == (2.0, 2.0, 10.0)
    assert one.governing.criterion == "S0"
    assert (one.given, one.joint) == (4.0, "b")
    assert one.share == pytest.approx(0.5)
    # Only joints limit: then the slowest of all places.
    free = segments(mapped_as([None] * 4, [0, 0, 0, 0], [1, 2, 1, 0.1]), length=9.0)
    assert [(of.governing, of.tool_speed, of.at, of.share) for of in free] == [
        (None, pytest.approx(0.4), 13.0, math.inf)
    ]
    # One place that cannot be told is what the whole segment tells.
    (open_,) = segments(mapped_as([0.1, math.nan, None, 0.2], [1, 1, 1, 1], [1, 2, 1, 3]), length=9.0)
    assert (math.isnan(open_.permissible), math.isnan(open_.share), open_.at) == (True, True, 11.0)
    assert open_.governing.criterion == "S1"
    (rests,) = segments(mapped_as([0.1, math.nan, 0.2], [1, 0, 1], [1, 2, 1]), length=9.0)
    assert math.isnan(rests.share)
    (slow,) = segments(mapped_as([0.05, 0.5], [0.5, 1.0], [1, 1]), length=9.0)
    assert slow.share == pytest.approx(0.4)


@pytest.mark.parametrize(
    ("length", "ends"),
    [
        (0.75, [(0, 3)]),
        (0.8, [(0, 3)]),
        (0.5, [(0, 2), (2, 3)]),
        (0.4, [(0, 2), (2, 3)]),
        (0.25, [(0, 1), (1, 2), (2, 3)]),
        (0.01, [(0, 1), (1, 2), (2, 3)]),
    ],
)
def test_a_path_is_cut_into_ways_of_the_tool_of_at_most_a_length(length, ends):
    found = segments(mapped_as([0.5] * 4, [1] * 4, [1] * 4, ways=[0.25] * 3), length=length)
    assert [(of.start - 10, of.end - 10) for of in found] == ends
    assert [of.number for of in found] == list(range(1, len(ends) + 1))
    np.testing.assert_allclose([of.way for of in found], [0.25 * (b - a) for a, b in ends])


def test_segments_are_a_quarter_of_a_metre_where_nobody_says_and_count_through_all_pieces():
    one = mapped_as([0.5] * 21, [1] * 21, [1] * 21)
    found = segments(replace(one, stations=one.stations * 2))
    assert [(of.piece, of.number) for of in found] == [(1 + k // 8, 1 + k) for k in range(16)]
    standing = segments(mapped_as([0.5] * 3, [1] * 3, [1] * 3, ways=[0.0, 0.0]))
    assert [of.way for of in standing] == [0.0]


@pytest.mark.parametrize("length", [0.0, -1.0, math.nan, 2.9e-5])
def test_segments_that_never_end_are_refused(length):
    with pytest.raises(InputError, match="more than 10000 segments"):
        segments(mapped_as([0.5] * 4, [1] * 4, [1] * 4), length=length)


def test_where_nothing_is_permitted_and_where_nobody_knows_are_told_apart():
    found = mapped_as([0.0, math.nan, None, 0.3, 0.0], [1] * 5, [1] * 5)
    assert [(t, of.criterion) for t, of in found.blocked] == [(10.0, "S0"), (14.0, "S4")]
    assert [(t, of.criterion) for t, of in found.undecided] == [(11.0, "S1")]


# -- the whole question --------------------------------------------------------------------------


def log_of(**said):
    verdicts = {"w": Verdict.WITHIN, "x": Verdict.EXCEEDED, "u": Verdict.UNDECIDED, "n": None}
    log = {}
    for name, letters in said.items():
        log[name] = Series(name=name, unit="m", at_most=False, between="accepted: looked at")
        for k, letter in enumerate(letters):
            if letter != " ":
                result = Result(name=name, verdict=verdicts[letter], nothing=letter == "n")
                log[name].pass_time(result, 0.01 * k)
                log[name].append(result, 0.01 * k)
    return log


@pytest.mark.parametrize(
    ("said", "expected"),
    [
        ({"S": "xw", "F": "xw"}, Verdict.EXCEEDED),
        ({"S": "ww", "F": "xx"}, Verdict.WITHIN),
        ({"S": "xx", "F": "uu"}, Verdict.UNDECIDED),
        # Who has said nothing yet is open.
        ({"S": "wx", "F": " w"}, Verdict.UNDECIDED),
        ({"S": "ww", "F": " x"}, Verdict.WITHIN),
        ({"S": "xw", "F": " w"}, Verdict.UNDECIDED),
        # Asked less often, what was said last counts.
        ({"S": "wwx", "F": "wx "}, Verdict.EXCEEDED),
        # Every criterion of a method has to permit it.
        ({"S": "ww", "T": "wx", "F": "xx"}, Verdict.EXCEEDED),
        ({"S": "ww", "T": "wx", "F": "xw"}, Verdict.WITHIN),
    ],
)
def test_of_two_methods_one_has_to_permit_every_tick_by_all_of_its_criteria(said, expected):
    methods = {name: Method.PFL if name == "F" else Method.SSM for name in said}
    assert either_permits(log_of(**said), methods) is expected


def answer(by, log, *, use=0.5, undecided=0, shares=(0.5,), ran=True):
    """What was found, by hand."""
    methods = {"S": Method.SSM, "F": Method.PFL}
    of = replace(mapped_as(shares, [1] * len(shares), [1] * len(shares)), by=by, methods=methods)
    after = Summary(log, None, 2, 0.01, 0.0, 0.0) if ran else None
    verified = Verified(1e-3, 9, use, 0.0, "", undecided, ()) if ran else None
    return PermissibleSpeed(of, MOTION, None, {}, None, None, "", None, verified, (), after, ()).verdict


def test_the_verdict_is_the_worst_of_the_plan_and_of_its_run():
    for by in By:
        assert answer(by, log_of(S="ww", F="ww", V="ww")) is Verdict.WITHIN
        assert answer(by, log_of(S="ww", F="ww", V="ww"), use=1.1) is Verdict.EXCEEDED
        assert answer(by, log_of(S="ww", F="ww", V="ww"), undecided=1) is Verdict.UNDECIDED
        assert answer(by, log_of(S="ww", F="ww", V="wx")) is Verdict.EXCEEDED
        assert answer(by, log_of(S="ww", F="ww", V="wu")) is Verdict.UNDECIDED
        together = Verdict.WITHIN if by is By.EITHER else Verdict.EXCEEDED
        assert answer(by, log_of(S="wx", F="xw", V="ww")) is together
        assert answer(by, log_of(S="xw", F="xw", V="ww")) is Verdict.EXCEEDED


def test_without_a_plan_the_map_says_why():
    for shares, expected in (((0.5, math.nan), Verdict.UNDECIDED), ((0.5, 0.0), Verdict.EXCEEDED)):
        assert answer(By.ALL, {}, shares=shares, ran=False) is expected


def sampled(station, *samples):
    (source, _), *_ = station.sources
    return [(source, Opened(samples=list(samples), duration=samples[-1].t))]


def test_one_source_gives_the_motion_of_a_robot_that_stands(station):
    model, sources = station.model, station.sources
    motion, findings = given_motion(model, sources, "arm")
    assert (motion.q[:, 0].tolist(), motion.target, findings) == ([0.0, 0.2, 0.4], "arm", ())
    assert given_motion(model, sources, "other")[0].q[:, 0].tolist() == [0.0, 0.1]
    for driving, count in ((sources[1:], 0), ([*sources, sources[0]], 2)):
        with pytest.raises(InputError, match=f"{count} sources drive arm"):
            given_motion(model, driving, "arm")
    pose = PoseSample(source="a", seq=1, target="arm/tip", t=1.0, position=(2.0, 0.0, 0.0), wxyz=(1, 0, 0, 0))
    mixed = sampled(station, heard("arm", 0.0, (0, 0)), pose)
    with pytest.raises(InputError, match="neither only joint positions nor only poses"):
        given_motion(model, mixed, "arm")


def asked(station, surveyed, criteria, wish, seen=None):
    """What `mapped` finds, and what it says that it does."""
    said = []
    witness = watched(station.model, 0.0) if seen is None else seen
    found = mapped(
        station.model, surveyed(*criteria, witness=witness), witness, MOTION, wish,
        lambda what, share: said.append(what),
    )  # fmt: skip
    return (*found, list(dict.fromkeys(said)))


COARSE = Wish(spacing=0.3, verify=4e-3, rounds=3)


def test_a_map_is_made_once_where_nobody_else_moves_and_plans_that_are_kept_are_not_made_again(
    station, surveyed
):
    found, _, verified, refused, said = asked(station, surveyed, (limit(0.5),), COARSE)
    assert said == ["the map", "the timing", "what lies between, round 1"]
    assert (verified.kept, refused) == (True, "")
    assert [len(of.ceilings[0]) for of in found.stations] == [1, 1]


def test_while_somebody_else_moves_a_map_keeps_to_every_round(station, surveyed):
    seen = watched(station.model, 0.0, 0.1)
    found, _, _, _, said = asked(station, surveyed, (limit(0.5),), COARSE, seen)
    rounds = [f"the map, round {k}" for k in (1, 2, 3)]
    assert said == [rounds[0], "the timing", *rounds[1:], "what lies between, round 1"]
    assert [len(of.ceilings[0]) for of in found.stations] == [3, 3]


def test_where_more_is_used_between_two_stations_the_map_gets_more_until_the_plan_is_kept(station, surveyed):
    bump = (Bump(name="B", at="arm", limit=0.5),)
    found, rescaled, verified, _, said = asked(station, surveyed, bump, COARSE)
    assert verified.kept
    assert "what lies between, round 2" in said
    assert rescaled.of is found
    assert [len(of.s) for of in found.stations] > [5, 5]
    # One round finds it, and that is that.
    once, _, verified, _, said = asked(station, surveyed, bump, replace(COARSE, rounds=1))
    assert (verified.kept, said[-1]) == (False, "what lies between, round 1")
    assert [len(of.s) for of in once.stations] == [5, 5]


def test_a_path_that_may_not_be_gone_is_told_and_a_mistake_of_whoever_asks_is_refused(station, surveyed):
    found, rescaled, verified, refused, _ = asked(station, surveyed, (limit(1e-12),), COARSE)
    assert (rescaled, verified) == (None, None)
    assert found.blocked
    assert refused.startswith("permissible speed is none at 10 places of the path")
    for wrong in ({"verify": 0.0}, {"spacing": 0.0}, {"margin": 1.0}):
        with pytest.raises(InputError):
            asked(station, surveyed, (limit(0.5),), replace(COARSE, **wrong))


def test_who_ends_early_stands_at_rest_to_the_end_and_who_repeats_goes_on(station, plan):
    """The other arm ends after 1 s, in motion: it is held where it is, at no speed, past the end."""
    arm, other = (source for source, _ in station.sources)
    ends = [heard("other", t, (t, 0.0), (1.0, 0.0)) for t in (0.0, 1.0)]
    opened = Opened(samples=ends, duration=1.0)
    given = [(changed(arm, loop=True), station.sources[0][1]), (other, opened)]
    (own, new), (_, held) = evaluation.played(given, plan, 0.01)[0]
    assert (own.loop, new.duration) == (False, pytest.approx(plan.duration))
    samples = list(held.samples)
    assert samples[:2] == ends
    assert held.duration == new.duration
    t = np.array([sample.t for sample in samples[1:]])
    np.testing.assert_allclose(np.diff(t), HOLD)
    assert plan.duration <= t[-1] < plan.duration + 2 * HOLD
    assert {sample.q for sample in samples[1:]} == {(1.0, 0.0)}
    assert {sample.qd for sample in samples[2:]} == {(0.0, 0.0)}
    assert [sample.seq for sample in samples[1:]] == list(range(len(t)))
    (finding,) = evaluation.played(given, plan, 0.01)[1]
    assert (finding.subject, finding.level) == ("other", "assumed")
    again = [given[0], (changed(other, loop=True), opened)]
    (_, kept), *_ = reversed(evaluation.played(again, plan, 0.01)[0])
    assert kept is opened


@pytest.mark.parametrize(
    "last",
    [
        heard("other", 1.0, (1.0, 0.0)),
        PoseSample(source="a", seq=0, target="other/tip", t=1.0, position=(2.0, 0, 0), wxyz=(1.0, 0, 0, 0)),
    ],
)
def test_what_has_no_speed_is_held_as_it_is(station, plan, last):
    given = [station.sources[0], (station.sources[1][0], Opened(samples=[last], duration=1.0))]
    first, *held = evaluation.played(given, plan, 0.01)[0][1][1].samples
    assert first is last
    assert [changed(sample, t=1.0, seq=0) for sample in held] == [last] * len(held) != []


@pytest.mark.parametrize(("short", "held"), [(0.0, False), (0.04, False), (0.06, True), (-0.06, False)])
def test_who_ends_within_what_is_held_anyway_is_left_alone(station, plan, short, held):
    given = [station.sources[0], (station.sources[1][0], Opened(samples=[], duration=plan.duration - short))]
    (_, found) = evaluation.played(given, plan, 0.01)[0][1]
    assert (found is not given[1][1]) is held
    assert list(found.samples) == []


def test_what_a_motion_and_its_path_leave_to_be_desired_is_a_finding(surveyed, plan):
    def told(motion, tolerance):
        found = evaluation._about(plan.of, motion, Wish(tolerance=tolerance))
        return [(finding.level, finding.text) for finding in found]

    off = float(plan.of.path.deviation.max())
    assert [level for level, _ in told(MOTION, off)] == ["note"]
    _, worse = told(MOTION, 0.9 * off)
    assert "off by more than the tolerance" in worse[1]
    qd = MOTION.qd.copy()
    qd[0], qd[-1] = (0.0, -0.0105), (9e-3, 0.0)
    derived = replace(MOTION, qd=qd, derived=True)
    assert [text for _, text in told(derived, off)[1:]] == [
        "velocities of the given motion are derived from its positions",
        "the given motion begins at 0.0105 rad/s or m/s; the rescaled one begins at rest",
    ]
    qd[-1] = (0.0, -0.02)
    assert "the given motion ends at 0.02 rad/s" in told(replace(MOTION, qd=qd), off)[-1][1]
    for use, undecided, what in ((0.9, 0, None), (1.5, 0, "uses 1.5"), (0.9, 2, "be judged at 2 of 9")):
        found = list(evaluation._between_stations(Verified(1e-3, 9, use, 0.0, "", undecided, ()), "arm"))
        assert len(found) == (what is not None)
        assert all(finding.level == "warning" and what in finding.text for finding in found)


def test_motions_between_samples_are_those_of_the_files_or_the_rescaled_one(station, plan):
    """None where a source gives anything but joint positions, fewer than two, or somebody has two sources."""
    found = PermissibleSpeed(plan.of, MOTION, None, {}, None, plan, "", None, None, (), None, ())
    given, anew = motions_of(station.sources), motions_of(station.sources, found)
    assert {name: motion.t.tolist() for name, motion in given.items()} == {"arm": [0, 1, 2], "other": [0, 1]}
    assert anew["other"].t.tolist() == [0, 1]
    assert anew["arm"].t[-1] == plan.duration
    assert np.diff(anew["arm"].t).max() == pytest.approx(0.008)
    np.testing.assert_array_equal(anew["arm"].q, plan.at(anew["arm"].t)[0])
    assert anew["arm"].good.all()
    refused = replace(found, rescaled=None)
    assert motions_of(station.sources, refused)["arm"].t.tolist() == [0, 1, 2]
    arm, other = station.sources
    assert motions_of([arm, other, other]) is None
    assert motions_of([arm, (other[0], Opened(samples=[heard("other", 0.0, (0, 0))], duration=0.0))]) is None
    pose = PoseSample(source="a", seq=0, target="other/tip", t=1.0, position=(2.0, 0, 0), wxyz=(1.0, 0, 0, 0))
    mixed = [heard("other", 0.0, (0, 0)), heard("other", 0.5, (0, 0)), pose]
    assert motions_of([arm, (other[0], Opened(samples=mixed, duration=1.0))]) is None
    nobody = changed(other[0], robot="")
    assert set(motions_of([arm, (nobody, other[1])])) == {"arm"}


# -- where everybody was -------------------------------------------------------------------------

VARIABLE = '[[variables]]\nname = "gate/open"\nsource = "plc"\naddress = "x"\ntype = "bool"\n'


@pytest.mark.parametrize(
    ("value", "late", "expected"),
    [
        (True, "", True),
        (False, "", False),
        (True, "nobody knows how late", True),
        (False, "nobody knows how late", "nobody knows how late"),
        (None, "", "gate/open: nothing heard yet"),
    ],
)
def test_what_mutes_a_criterion_nobody_knows_how_late_is_not_known(tmp_path, value, late, expected):
    """What is asked all the same was asked for: only False would take something off."""
    source = '[[sources]]\nkind = "signals_csv"\nname = "plc"\nfile = "s.csv"\ntime = "t"\ntime_unit = "s"\n'
    text = 'variables = "v.toml"\n' + FLOATING.replace("{ ", "{ physics = false, ") + TWO_R + source
    files = {"arm.urdf": two_r(), "v.toml": VARIABLE, "s.csv": "t,x\n0,1\n"}
    model = made(tmp_path, text, files).model
    engine = Engine(model, driven={}, untimed={"gate/open": late} if late else {})
    if value is not None:
        engine.take([SignalSample(source="plc", seq=0, t=0.0, values={"gate/open": value})])
    found = _heard(engine.start(), "gate/open")
    assert (str(found) if isinstance(found, Undecided) else found) == expected


def test_what_nothing_moves_rests_where_it_is_at_home_for_ever(station):
    model = station.model
    posed = Posed(model, model.robot("arm"), watched(model, 0.0))
    posed.place(0.0, 0.0, np.zeros(2), np.ones(2))
    q, qd, why = posed.foresee("lift", np.array([0.0, 1.0, 2.0]))
    assert (q.tolist(), qd.tolist(), why) == ([[0.0]] * 3, [[0.0]] * 3, "")
    assert posed.foresee("other", np.array([0.0])) is None


GRIPPED = """
[[machines]]
name = "hand"
on = "arm/tip"
shape = { box = [0.02, 0.02, 0.06] }
mass = 0.2
grip = { upper = 0.1 }
[[workpieces]]
name = "piece"
on = "hand"
shape = { box = [0.04, 0.04, 0.04] }
mass = 2.0
rest = { position = [2.0, 0, 0.01] }
"""
LOOSE = (
    '[[workpieces]]\nname = "piece"\nshape = { box = [0.1, 0.1, 0.1] }\nmass = 0.8\n'
    "at = { position = [0, 4, 0.05] }\n"
)


@pytest.mark.parametrize("piece", [GRIPPED, LOOSE])
def test_where_what_is_picked_up_is_no_map_knows(tmp_path, piece):
    """Where a run saw it last says nothing of where it is when the robot goes at another speed."""
    text = FLOATING.replace("0, 0]", "0, -9.81]") + TWO_R + piece
    model = made(tmp_path, text, {"arm.urdf": two_r()}).model
    engine, witness = Engine(model, driven={"arm": 1.0, "hand": 1.0}), Witness(lambda state: ())
    engine.take([heard("arm", 0.0, (0, 0), (0, 0))])
    if "hand" in model.mechanisms:
        engine.take([heard("hand", 0.0, (0.05,), (0.0,))])
    witness(engine.start())
    posed = Posed(model, model.robot("arm"), witness)
    posed.place(0.0, 0.0, np.zeros(2), np.ones(2))
    with pytest.raises(Undecided, match="only a run tells where it is"):
        posed.closest(model.gap(model.select("piece"), model.select("arm/l1")))
    # What moves by itself is known all the same.
    assert posed.closest(model.gap(model.select("arm/l1"), model.select("arm/l2"))).distance < 1
