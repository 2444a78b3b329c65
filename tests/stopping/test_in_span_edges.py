"""What bounds a stop by table that begins within a span, in closed form."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path as File

import mujoco
import numpy as np
import pytest

from made_cell import FLOATING, TWO_R, made, two_r
from seerob.criteria.stopping.by_table import bind_in_span, grown, known_in_span, reach_of
from seerob.criteria.stopping.onset import KinematicChain, Onset
from seerob.criteria.stopping.terms import Course
from seerob.twin.spans import Path, Points, Span


@pytest.mark.parametrize(
    ("turns", "levers", "half", "expected"),
    [
        # Each lever but the last grows by what the joints farther out can move the part.
        ((True, True, True), (2.0, 1.0, 0.5), (0.3, 0.2, 0.1), (2.26, 1.05, 0.5)),
        ((True, False, True), (2.0, 9.0, 0.5), (0.3, 0.2, 0.1), (2.25, 9.05, 0.5)),
        ((True,), (0.7,), (0.4,), (0.7,)),
    ],
)
def test_levers_grow_by_what_joints_farther_out_can_move(turns, levers, half, expected):
    k = len(turns)
    chain = KinematicChain(np.array(turns), np.arange(k), np.array(levers))
    np.testing.assert_allclose(grown(chain, np.array(half)).levers, expected, rtol=1e-12)
    np.testing.assert_array_equal(chain.levers, levers)


def test_no_pose_within_the_span_has_a_longer_lever():
    """Planar arms of three joints, each anywhere within half its way; at least once nearly as long."""
    rng, tightest = np.random.default_rng(0), 0.0
    for _ in range(300):
        lengths, half = rng.uniform(0.2, 1.0, 3), rng.uniform(0.0, 0.4, 3)
        q = rng.uniform(-np.pi, np.pi, 3)

        def far(q, lengths=lengths):
            angles = np.cumsum(q)
            steps = lengths[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
            return np.linalg.norm(np.cumsum(steps[::-1], axis=0)[::-1], axis=1)

        bound = grown(KinematicChain(np.ones(3, bool), np.arange(3), far(q)), half).levers
        met = np.max([far(q + half * rng.uniform(-1, 1, 3)) for _ in range(60)], axis=0)
        assert (met <= bound + 1e-12).all()
        tightest = max(tightest, float((met[0] - far(q)[0]) / max(bound[0] - far(q)[0], 1e-9)))
    assert tightest > 0.6


def test_the_flange_is_as_far_from_an_axis_as_from_its_line_and_from_a_slide_as_from_its_anchor(tmp_path):
    """A second link that is lowered by 1 rad."""
    lowered = two_r()
    at = lowered.rindex('<axis xyz="0 0 1"/>')
    lowered = lowered[:at] + '<axis xyz="0 1 0"/>' + lowered[at + len('<axis xyz="0 0 1"/>') :]
    slides = lowered.replace('type="continuous"', 'type="prismatic"', 1).replace(
        "<limit", '<limit lower="-1" upper="1"', 1
    )
    expected = (1 + np.cos(1.0), np.hypot(1 + np.cos(1.0), np.sin(1.0)))
    for name, urdf, far in zip("ab", (lowered, slides), expected, strict=True):
        station = made(tmp_path / name, FLOATING + TWO_R, {"arm.urdf": urdf})
        robot, data = station.model.robot("arm"), mujoco.MjData(station.model.mj)
        data.qpos[robot.q_address] = (0.0, 1.0)
        mujoco.mj_kinematics(station.model.mj, data)
        assert reach_of(data, station.model, robot) == pytest.approx(far, abs=1e-9)


@pytest.mark.parametrize(
    ("q", "expected"), [((0.0, 0.0), 2.0), ((0.7, np.pi / 2), np.sqrt(2.0)), ((0.3, np.pi), 0.0)]
)
def test_the_flange_is_as_far_from_the_first_axis_as_the_arm_is_stretched(tmp_path, q, expected):
    text = f"{FLOATING}{TWO_R}base = {{ position = [0.5, -0.3, 0.2], rpy = [0.3, 0, 1] }}\n"
    station = made(tmp_path, text, {"arm.urdf": two_r()})
    robot, data = station.model.robot("arm"), mujoco.MjData(station.model.mj)
    data.qpos[robot.q_address] = q
    mujoco.mj_kinematics(station.model.mj, data)
    assert reach_of(data, station.model, robot) == pytest.approx(expected, abs=1e-9)


AXIS = '[[machines]]\nname = "axis"\nshape = { box = [0.6, 0.6, 0.1] }\nmass = 50\nslide = { }\n'
HAND = (
    '[[machines]]\nname = "hand"\non = "arm/tip"\nshape = { box = [0.02, 0.01, 0.1] }\nmass = 0.2\n'
    "grip = { upper = 0.1 }\n"
)
PERIOD = 0.01


class Asked:
    """What a stop is asked for that begins within a span of an arm of two links of 1 m."""

    def __init__(
        self, folder: File, text: str = FLOATING + TWO_R, *, mimic: str = "", **options: object
    ) -> None:
        text += '[[parts]]\nname = "wall"\nshape = { box = [0.1, 1, 1] }\nat = { position = [9, 0, 0] }\n'
        self.model = made(folder, text, {"arm.urdf": two_r(mimic=mimic)}).model
        self.robot = self.model.robot("arm")
        self.gap = self.model.gap(self.model.select("wall"), self.robot.moving)
        self.points = Points(self.model)
        self.unbounded_reason = ""
        bound = bind_in_span(
            self.model,
            self.robot,
            self.gap,
            self._after,
            **{"T_r": 0.1, "held": True, "limits": None, **options},
        )
        self.at_most = None if bound is None else bound(self.points)

    def _after(self, onset: Onset, extension: float, chains: Sequence[KinematicChain]) -> Course:
        self.onset, self.extension, self.chains = onset, extension, chains
        return Course(onset.v_r, onset.S_r, onset.S_r, 0.0, self.unbounded_reason)

    def span(self, q: Sequence[float], qd: Sequence[float], begin: float, end: float) -> Span:
        """Of joints at constant speeds, which are there at 0 s; the tick is that 10 ms later."""
        t = np.array([0.0, PERIOD])
        joints = self.robot.coupling @ (np.array(q) + t[:, None] * np.array(qd)).T
        path = Path(
            t,
            np.ascontiguousarray(joints.T) + self.robot.offset,
            np.array([self.robot.coupling @ np.array(qd)] * 2),
        )
        ids = np.array([body.mj for body in self.model.bodies], np.int64)
        return self.points.span(path, begin, end, ids, self.model.mj)


@pytest.mark.parametrize(
    ("text", "T_r", "bounded"),
    [
        (FLOATING + TWO_R, 0.1, True),
        (FLOATING + TWO_R, 2.0, True),
        (FLOATING + TWO_R, 2.0001, False),  # farther than a motion is looked at ahead
        (FLOATING + AXIS + TWO_R + 'on = "axis"\n', 0.1, False),
        (FLOATING + TWO_R + HAND, 0.1, False),
    ],
)
def test_nothing_bounds_the_stops_of_a_robot_that_others_move_or_that_moves_others(
    tmp_path, text, T_r, bounded
):
    assert (Asked(tmp_path, text, T_r=T_r).at_most is not None) is bounded


@pytest.mark.parametrize(("begin", "end"), [(0.0, 0.01), (0.002, 0.005)])
def test_a_bent_arm_reaches_as_far_as_it_can_within_a_span_and_its_levers_are_those_of_its_middle(
    tmp_path, begin, end
):
    asked, q, qd = Asked(tmp_path), np.array([0.3, 2.0]), np.array([1.5, -4.0])
    assert asked.at_most(asked.span(q, qd, begin, end)) is not None
    reach = [2 * np.cos((q[1] + t * qd[1]) / 2) for t in (begin, (begin + end) / 2, end)]
    fastest = abs(qd[0]) * 2 + abs(qd[1])
    assert asked.extension == pytest.approx(reach[1] + fastest * (end - begin), rel=1e-9)
    assert asked.extension >= max(reach)
    # Outermost of the second link from both axes, half a span before and after.
    half = np.abs(qd) * (end - begin) / 2
    for chain in asked.chains:
        if len(chain.rows) == 2:
            elbow = np.hypot(1, 0.05)
            middle = q + (begin + end) / 2 * qd
            corner = np.array([[1.0, 0.05], [1.0, -0.05]])
            c, s = np.cos(middle[1]), np.sin(middle[1])
            shoulder = np.linalg.norm([1, 0] + corner @ [[c, s], [-s, c]], axis=1).max()
            assert chain.levers[1] == pytest.approx(elbow, abs=1e-6)
            assert chain.levers[0] == pytest.approx(shoulder + half[1] * elbow, abs=1e-6)
    assert {len(chain.rows) for chain in asked.chains} == {1, 2}


def test_what_holds_its_speeds_goes_on_with_the_largest_of_the_span_and_their_noise(tmp_path):
    asked, qd = Asked(tmp_path, T_r=0.3), np.array([0.8, 0.5])
    still, noise = asked.span((0.3, 0.0), qd, 0.0, 0.01), np.array([0.02, 0.03])
    at_rest = asked.at_most(still)
    assert at_rest is not None
    np.testing.assert_allclose(asked.onset.speeds, qd, rtol=1e-9)
    np.testing.assert_allclose(asked.onset.ways, 0.3 * qd, rtol=1e-9)
    v = asked.onset.v_r
    corner = np.sqrt(1 + 2 * 0.05**2)  # of a link, from its axis
    farthest = np.array([0.8 * corner, 0.8 + 1.3 * corner])
    np.testing.assert_allclose(v, farthest, rtol=1e-6)
    np.testing.assert_allclose(asked.onset.S_r, 0.3 * v, rtol=1e-9)
    np.testing.assert_allclose(asked.onset.v_s, v, rtol=1e-9)
    shaken = asked.span((0.3, 0.0), qd, 0.0, 0.01)
    shaken.derived(np.full(len(asked.model.bodies), 0.1), noise)
    assert asked.at_most(shaken) is not None
    np.testing.assert_allclose(asked.onset.speeds, qd + noise, rtol=1e-9)
    np.testing.assert_allclose(asked.onset.ways, 0.3 * (qd + noise), rtol=1e-9)
    assert (asked.onset.v_r >= v + 0.1).all()
    assert (asked.onset.v_r <= v + 0.12).all()


def test_nothing_is_bounded_of_who_jumps_or_where_the_table_does_not_know(tmp_path):
    asked = Asked(tmp_path)
    for broken in (("arm",), ()):
        span = asked.span((0.3, 0.2), (0.1, 0.2), 0.0, 0.01)
        path = dataclasses.replace(span.path, broken=broken)
        ids = np.array([body.mj for body in asked.model.bodies], np.int64)
        assert (asked.at_most(asked.points.span(path, 0.0, 0.01, ids, asked.model.mj)) is None) is bool(
            broken
        )
    span = asked.span((0.3, 0.2), (0.1, 0.2), 0.0, 0.01)
    span.qd[asked.robot.v_address[1]] = np.inf
    assert asked.at_most(span) is None  # one joint is enough
    span = asked.span((0.3, 0.2), (0.1, 0.2), 0.0, 0.01)
    span.fast[asked.gap.b[-1]] = np.inf
    assert asked.at_most(span) is None  # and one part
    asked.unbounded_reason = "beyond the table"
    assert asked.at_most(asked.span((0.3, 0.2), (0.1, 0.2), 0.0, 0.01)) is None


def test_of_joints_that_may_accelerate_limits_bound_it_where_nothing_is_known_ahead(tmp_path):
    limits = np.array([3.0, 5.0]), np.array([10.0, 10.0])
    asked, qd, T_r = Asked(tmp_path, T_r=0.3, held=False, limits=limits), np.array([0.8, 0.5]), 0.3
    span = asked.span((0.3, 0.4), qd, 0.0, 0.01)
    assert asked.at_most(span) is not None
    np.testing.assert_allclose(asked.onset.speeds, qd + limits[0] * (T_r + PERIOD), rtol=1e-9)
    assert Asked(tmp_path, held=False).at_most(span) is None  # no limits
    # Who knows what it does ahead, but not until then, is not bounded by limits that it may not keep.
    span.foresee = lambda name, t: (np.zeros((len(t), 2)), np.zeros((len(t), 2)), "it may stop")
    assert asked.at_most(span) is None


def swing(t):
    """Joint 1 gets faster, joint 2 slower: cubics, so that what is between two instants is known exactly."""
    t = np.asarray(t)[..., None]
    a, b = np.array([0.3, 0.9]), np.array([0.8, -0.5])
    c, d = np.array([1.2, 0.4]), np.array([0.0, 0.1])
    return a + b * t + c * t**2 + d * t**3, b + 2 * c * t + 3 * d * t**2


@pytest.mark.parametrize(("begin", "end"), [(0.03, 0.04), (0.032, 0.037), (0.035, 0.0350001)])
@pytest.mark.parametrize("T_r", [0.1, 0.234])
@pytest.mark.parametrize("knots", [(), (0.0433, 0.171)])
def test_no_reaction_on_a_known_motion_within_a_span_is_faster_or_longer_than_its_bound(
    tmp_path, begin, end, T_r, knots
):
    """Nor one that begins until the next tick; largest speeds from tick to tick are near the true ones."""
    asked = Asked(tmp_path, T_r=T_r, held=False)
    t = np.array([0.03, 0.04])
    path = Path(t, *swing(t))
    ids = np.array([body.mj for body in asked.model.bodies], np.int64)
    span, told = asked.points.span(path, begin, end, ids, asked.model.mj), []

    def foresee(name, at):
        assert name == "arm"
        told.append(np.array(at))
        return (*swing(at), "")

    span.foresee, span.knots = foresee, lambda name, a, b: [x for x in knots if a < x < b]
    own = np.asarray(asked.robot.v_address)[asked.robot.own]
    speeds, ways, whole, q = known_in_span(span, "arm", T_r, PERIOD, own)
    (at,) = told
    # From the tick at which the span ends, until the last reaction is over; no farther than one tick.
    assert at[0] == pytest.approx(0.04)
    assert end + T_r + PERIOD - 1e-9 <= at[-1] < end + T_r + 2 * PERIOD
    assert {x for x in knots if x < at[-1]} <= {*at.tolist()}
    ticks = PERIOD * np.arange(4, 100)
    expected = sorted([*ticks[ticks <= at[-1] + 1e-9].tolist(), *(x for x in knots if x < at[-1])])
    np.testing.assert_allclose(at, expected, atol=1e-9)
    np.testing.assert_array_equal(q, swing(at)[0])
    fine = np.linspace(begin, end + T_r + PERIOD, 20_001)
    rate = np.abs(swing(fine)[1])
    step = fine[1] - fine[0]
    way = np.vstack([np.zeros(2), np.cumsum((rate[1:] + rate[:-1]) / 2 * step, axis=0)])

    def longest(last):
        starts = np.flatnonzero(fine <= last + 1e-12)
        ends = np.minimum(starts + round(T_r / step), len(fine) - 1)
        return (way[ends] - way[starts]).max(axis=0)

    top = rate.max(axis=0)
    rise = 2 * np.array([1.2, 0.4]) * PERIOD + 0.02 * PERIOD  # of a speed, from tick to tick
    assert (speeds >= top - 1e-9).all()
    assert (speeds <= top + rise).all()
    assert (whole >= way[-1] - 1e-9).all()
    assert (whole <= way[-1] + rise * (T_r + 3 * PERIOD)).all()
    assert (ways >= longest(end + PERIOD) - 2 * step).all()
    held = np.abs(swing(np.array([begin, end]))[1]).max(axis=0) * T_r
    near = longest(end + PERIOD) + rise * (T_r + 3 * PERIOD) + top * (end - begin)
    assert (ways <= np.maximum(near, held) + 1e-9).all()
    assert (ways >= held - 1e-9).all()  # as if nothing got slower


def test_a_motion_that_stops_at_once_bounds_no_less_than_the_speed_within_the_span(tmp_path):
    """What is foreseen stands from the tick on, and the joints were at speed until then."""
    asked = Asked(tmp_path, T_r=0.1, held=False)
    span = asked.span((0.3, 0.4), (0.8, -0.5), 0.0, 0.01)
    span.foresee = lambda name, t: (np.tile([0.308, 0.395], (len(t), 1)), np.zeros((len(t), 2)), "")
    own = np.asarray(asked.robot.v_address)[asked.robot.own]
    speeds, ways, whole, _ = known_in_span(span, "arm", 0.1, PERIOD, own)
    np.testing.assert_allclose(speeds, [0.8, 0.5], rtol=1e-9)
    np.testing.assert_allclose(ways, [0.08, 0.05], rtol=1e-9)
    # Within the span, and, as nobody knows better, until the next tick.
    np.testing.assert_allclose(whole, [0.016, 0.01], rtol=1e-9)
    for answer in (None, (np.zeros((1, 2)), np.zeros((1, 2)), "nobody knows its end")):
        span.foresee = lambda name, t, answer=answer: answer
        assert known_in_span(span, "arm", 0.1, PERIOD, own) is None


@pytest.mark.parametrize(("before", "after"), [(1.0, 0.0), (0.0, 1.0)])
def test_what_brakes_to_a_tick_or_begins_at_it_is_bounded_on_both_sides_of_it(tmp_path, before, after):
    """Within 10 ms from one speed to the other; before and after these it keeps them."""
    asked = Asked(tmp_path, T_r=0.1, held=False)
    t = np.array([0.03, 0.04])
    q, v = np.array([[0.0, 0.0], [0.005, 0.0]]), np.array([[before, 0.0], [after, 0.0]])
    ids = np.array([body.mj for body in asked.model.bodies], np.int64)
    span = asked.points.span(Path(t, q, v), 0.03, 0.04, ids, asked.model.mj)
    go = np.array([1.0, 0.0])
    span.foresee = lambda name, t: (
        0.005 * go + after * (t[:, None] - 0.04) * go,
        np.full((len(t), 1), after) * go,
        "",
    )
    own = np.asarray(asked.robot.v_address)[asked.robot.own]
    speeds, ways, whole, _ = known_in_span(span, "arm", 0.1, PERIOD, own)
    assert speeds[0] == pytest.approx(1.0)
    assert whole[0] == pytest.approx(0.01 + after * 0.11)
    assert ways[0] >= 0.1


def test_what_stands_for_a_tick_takes_nothing_off_the_way_after_it(tmp_path):
    """A reaction that begins at the next tick goes all the way."""
    asked = Asked(tmp_path, T_r=0.1, held=False)
    span = asked.span((0.0, 0.0), (0.0, 0.0), 0.01 - 1e-9, 0.01)

    def foresee(name, t):
        go = np.clip((t - 0.02) / 0.01, 0.0, 1.0)
        q = np.where(t < 0.03, 0.005 * go**2, t - 0.025)
        return np.outer(q, [1.0, 0.0]), np.outer(go, [1.0, 0.0]), ""

    span.foresee = foresee
    own = np.asarray(asked.robot.v_address)[asked.robot.own]
    _, ways, *_ = known_in_span(span, "arm", 0.1, PERIOD, own)
    assert 0.095 <= ways[0] <= 0.1001


def by_pieces(knots, rates):
    """What a joint does that has these speeds at these instants and ramps between; a second one stands."""
    way = np.concatenate([[0.0], np.cumsum(np.diff(knots) * (np.array(rates[1:]) + rates[:-1]) / 2)])

    def foresee(name, t):
        k = np.clip(np.searchsorted(knots, t, side="right") - 1, 0, len(knots) - 2)
        share = (t - np.array(knots)[k]) / np.diff(knots)[k]
        rate = np.array(rates)[k] + share * np.diff(rates)[k]
        q = way[k] + (t - np.array(knots)[k]) * (np.array(rates)[k] + rate) / 2
        return np.outer(q, [1.0, 0.0]), np.outer(rate, [1.0, 0.0]), ""

    return foresee


@pytest.mark.parametrize(
    ("knots", "rates", "bound"),
    [
        # Faster at once, and it stands just when the first reaction is over: all of that counts.
        ([0.0, 0.01, 0.0101, 0.1099, 0.11, 0.2], [0.5, 0.5, 1.0, 1.0, 0.0, 0.0], 0.0999),
        # It stands for a while meanwhile: no reason to take less off than a tick at the speed of its begin.
        (
            [0.0, 0.01, 0.0101, 0.0599, 0.06, 0.07, 0.0701, 0.2],
            [0.5, 0.5, 1.0, 1.0, 0.0, 0.0, 1.0, 1.0],
            0.1 - 0.005,
        ),
    ],
)
def test_of_the_way_until_the_last_reaction_ends_what_lies_outside_of_each_is_taken_off(
    tmp_path, knots, rates, bound
):
    asked = Asked(tmp_path, T_r=0.1, held=False)
    span = asked.span((0.0, 0.0), (rates[0], 0.0), 0.01 - 1e-9, 0.01)
    span.foresee = by_pieces(knots, rates)
    span.knots = lambda name, a, b: [x for x in knots if a < x < b]
    own = np.asarray(asked.robot.v_address)[asked.robot.own]
    _, ways, *_ = known_in_span(span, "arm", 0.1, PERIOD, own)
    assert ways[0] == pytest.approx(bound, abs=3e-4)


@pytest.mark.parametrize("shift", [0.7, -0.7])
def test_a_twin_that_lags_behind_what_is_known_is_as_far_from_it_as_it_is(tmp_path, shift):
    """Levers are those where it is; until it is where the motion has it, parts may be anywhere between."""
    asked = Asked(tmp_path, T_r=0.2, held=False)
    span = asked.span((0.0, 0.1), (0.01, 0.02), 0.0, 0.01)
    goes = np.array([0.01, 0.02])
    span.foresee = lambda name, t: (
        np.array([shift, 0.1]) + t[:, None] * goes,
        np.tile(goes, (len(t), 1)),
        "",
    )
    assert asked.at_most(span) is not None
    far = {len(chain.rows): S for chain, S in zip(asked.chains, asked.onset.S_r.tolist(), strict=True)}
    assert abs(shift) <= far[1] <= 1.02 * abs(shift)
    assert 2 * abs(shift) - 0.01 <= far[2] <= 2.1 * abs(shift)


@pytest.mark.parametrize("noise", [0.0, 0.05])
def test_the_onset_of_a_known_motion_carries_its_parts_by_the_ways_of_the_joints(tmp_path, noise):
    """A stretched arm of which the second joint follows the first, to the other side."""
    asked = Asked(tmp_path, mimic='<mimic joint="j1" multiplier="-2"/>', T_r=0.2, held=False)
    span = asked.span((0.0,), (0.5,), 0.0, 0.01)
    span.foresee = lambda name, t: (0.5 * t[:, None], np.full((len(t), 1), 0.5), "")
    span.derived(np.full(len(asked.model.bodies), noise), np.full(asked.model.mj.nv, noise))
    assert asked.at_most(span) is not None
    np.testing.assert_allclose(asked.onset.speeds, [0.5 + noise], rtol=1e-9)
    assert asked.onset.ways[0] == pytest.approx((0.5 + noise) * 0.2, rel=0.06)
    assert asked.onset.ways[0] >= (0.5 + noise) * 0.2
    # From the middle of the span to where it is at the end of the last reaction: both joints count.
    moved = max(0.5 * 0.23, 0.5 * 0.225) + noise * 0.2
    far = {len(chain.rows): S for chain, S in zip(asked.chains, asked.onset.S_r.tolist(), strict=True)}
    assert 0.9 * moved * (2 + 2) - 0.05 <= far[2] <= moved * (2.2 + 2.1) + 0.02
    assert 0.9 * moved <= far[1] <= moved * 1.1 + 0.01
