"""A table stops the twin and not what was captured: postures are the captured ones, distances bound both."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from made_capture import PERSON, captured, frames_of, source, workstation
from msgspec.structs import replace
from test_touching import desk, pressing

from seerob.core.errors import Undecided
from seerob.core.samples import JointSample
from seerob.core.snapshot import Verdict
from seerob.criteria.between_ticks import SpanResult
from seerob.criteria.safety.minimum_distance import MinimumDistance
from seerob.criteria.safety.separation import Separation, Stop
from seerob.criteria.safety.velocity import Velocity
from seerob.criteria.scoring.rule import bind_posture
from seerob.description.humans.angles import angles
from seerob.description.humans.skeleton import BONES, bone_poses
from seerob.session import run as road
from seerob.session.run import Judge
from seerob.session.station import Station
from seerob.twin.accuracy.tracking_error import TrackingError
from seerob.twin.engine import Engine
from seerob.twin.state import State
from seerob.twin.validity.hearing import Hearing
from worst_between import one_by_one

POST = {"name": "post", "at": {"position": [1.0, -0.2, 0.9]}, "shape": {"box": [0.05, 0.05, 0.05]}}


@pytest.fixture(scope="module")
def stopped():
    """Of every tick what a person who presses a hand through a desk is said to do."""
    t, q = pressing()
    tables = desk()
    tables["parts"] = [*tables["parts"], POST]
    station = workstation(source(captured(frames_of(t, q))), **tables)
    criteria = tuple(
        MinimumDistance(name=f"{limit:g}", between=("post", "operator/right_hand"), limit=limit)
        for limit in (0.02, 0.2, 0.6)
    )
    stage = Station(replace(station, safety=criteria))
    engine, judge = Engine(stage.model, driven={"operator": 0.2}), Judge(stage.bound)
    read = bind_posture(stage.model, "operator")
    hand = tuple(b.index for b in stage.model.bodies if b.name == "operator/right_hand")
    off = TrackingError(stage.model, hand)
    told = []
    for seq, samples in enumerate(road.pump(stage.sources, 0.01)):
        engine.take(samples)
        state = engine.tick() if seq else engine.start()
        place = state.positions[hand[0]].copy()
        stray = state.stray("operator")
        told.append((state.t, judge(state), read(state), stray, place, float(off.at(state)[0])))
    return t, q, told


def test_the_twin_is_stopped_and_the_posture_is_the_captured_one(stopped):
    t, q, told = stopped
    assert told[-1][3].startswith("operator: the twin is off by")
    for instant, _, found, *_ in told:
        now = np.array([np.interp(instant, t, joint) for joint in q.T])
        expected = angles(*bone_poses(PERSON, now))
        for name in ("shoulder_flexion", "elbow_flexion", "trunk_flexion", "wrist_flexion"):
            assert getattr(found, name) == pytest.approx(getattr(expected, name), abs=0.01), (instant, name)


def test_distances_of_a_stopped_hand_lie_between_the_worse_of_both(stopped):
    t, q, told = stopped
    late = [each for each in told if each[3]]
    assert len(late) > 50
    assert {far.verdict for _, (far, _, _), *_ in late} == {Verdict.WITHIN}
    assert Verdict.UNDECIDED in {near.verdict for _, (_, _, near), *_ in late}
    for instant, _, _, _, place, bound in late:
        now = np.array([np.interp(instant, t, joint) for joint in q.T])
        _, positions = bone_poses(PERSON, now)
        assert np.linalg.norm(positions[BONES.index("right_hand")] - place) <= bound + 2e-3
    assert max(each[5] for each in late) > 0.1


def test_between_two_ticks_a_stopped_hand_may_be_where_it_was_captured():
    """The capture, by its own course, is never nearer to a post than the bound."""
    t, q = pressing()
    tables = desk()
    tables["parts"] = [*tables["parts"], POST]
    station = workstation(source(captured(frames_of(t, q))), **tables)
    criterion = MinimumDistance(name="far", between=("post", "operator/right_hand"), limit=0.02)
    stage = Station(replace(station, safety=(criterion,)))
    engine, judge = Engine(stage.model, driven={"operator": 0.2}), Judge(stage.bound)
    between, room, ways, off = one_by_one(judge), [], [], []
    person, data = stage.model.mechanisms["operator"], mujoco.MjData(stage.model.mj)
    hand = next(b.index for b in stage.model.bodies if b.name == "operator/right_hand")
    gap = stage.model.gap(stage.model.select("post"), stage.model.select("operator/right_hand"))
    there = State(stage.model, data, {"operator": Hearing(given=True, driven=False)})

    def watching(i, watch, ends, state):
        if not (state.stray("operator") and ends[0].margin):
            return SpanResult()
        low, found = between._low(watch, between._way, ends, state), []
        for instant in np.linspace(ends[0].t, ends[1].t, 5).tolist():
            data.qpos[person.q_address] = engine._references["operator"].at(instant)[0]
            there.refresh(instant)
            room.append(there.closest(gap).distance - 0.02 - low)
            found.append(there.positions[hand].copy())
        _, _, looked = between._look(i, watch, between._way, (ends[0].t + ends[1].t) / 2, state)
        off.append(np.linalg.norm(looked.captured("operator", (hand,))[1][0] - found[2]))
        span = between._span(between._way, ends, state)
        ways.append((np.linalg.norm(found[-1] - found[0]), span.fast[hand] * span.T, between._way))
        return SpanResult()

    between._judge = watching
    for seq, samples in enumerate(road.pump(stage.sources, 0.01)):
        engine.take(samples)
        judge(engine.tick() if seq else engine.start())
    assert len(ways) > 50
    assert min(room) >= -1e-9
    assert max(off) < 1e-6
    assert all(way <= most + 1e-9 for way, most, _ in ways)
    # The twin, which lies on the desk, has gone less far.
    gone = max(np.linalg.norm(path.captured[0][-1] - path.captured[0][0]) for *_, path in ways)
    assert gone > 2 * min(np.linalg.norm(path.q[-1] - path.q[0]) for *_, path in ways)


def test_nothing_is_relieved_where_the_capture_itself_is_in_doubt(stopped):
    t, q = pressing()
    frames = frames_of(t, q)
    for frame in frames[50:]:
        frame.positions[:] = np.nan
        frame.orientations[:] = np.nan
    stage = Station(workstation(source(captured(frames)), **desk()))
    engine = Engine(stage.model, driven={"operator": 0.2})
    read = bind_posture(stage.model, "operator")
    for seq, samples in enumerate(road.pump(stage.sources, 0.01)):
        engine.take(samples)
        state = engine.tick() if seq else engine.start()
        if state.t > 49 / 60 + 0.21:
            assert state.stray("operator") == ""
            with pytest.raises(Undecided, match="not heard"):
                read(state)


def test_what_knows_no_bound_stays_undecided(stopped):
    t, q = pressing(seconds=1.2)
    stage = Station(workstation(source(captured(frames_of(t, q))), **desk()))
    engine = Engine(stage.model, driven={"operator": 0.2})
    for seq, samples in enumerate(road.pump(stage.sources, 0.01)):
        engine.take(samples)
        state = engine.tick() if seq else engine.start()
    hand = next(b.index for b in stage.model.bodies if b.name == "operator/right_hand")
    assert state.stray("operator")
    for ask in (
        lambda: state.require("operator"),
        lambda: state.fastest_point(hand),
        lambda: state.fastest_points((hand,), allow_estimated=True),
        lambda: state.placed((hand,), allow_estimated=True),
        lambda: state.mass_matrix(stage.model.mechanisms["operator"]),
    ):
        with pytest.raises(Undecided, match="the twin is off"):
            ask()


ROBOT = {"name": "arm", "model": "library:ur5", "base": {"position": [0.9, -0.6, 0.9]}}


def test_a_robot_too_near_a_stopped_hand_is_exceeded_and_never_within():
    """What is known is enough: the twin and the capture are both nearer than S_p of a person who walks."""
    t, q = pressing()
    tables = desk() | {"robots": [ROBOT]}
    station = workstation(source(captured(frames_of(t, q))), **tables)
    stop = Stop(model="bound", stopping=0.3, reaction=0.1, acceleration=1.0)
    near, far = (
        Separation(
            name=name, between=("arm", "operator"), stop=stop, human_uncertainty=0.0,
            robot_uncertainty=0.0, intrusion=intrusion,
        )
        for name, intrusion in (("near", 3.0), ("far", 0.0))
    )  # fmt: skip
    stage = Station(replace(station, safety=(near, far)))
    engine, judge = Engine(stage.model, driven={"operator": 0.2, "arm": 9.0}), Judge(stage.bound)
    home = tuple(stage.model.mechanisms["arm"].home.tolist())
    seen = set()
    for seq, samples in enumerate(road.pump(stage.sources, 0.01)):
        still = JointSample(source="arm", target="arm", seq=seq, t=0.01 * seq, q=home)
        engine.take((*samples, still))
        state = engine.tick() if seq else engine.start()
        results = judge(state)
        if state.stray("operator"):
            seen.add(tuple(r.verdict for r in results))
            assert results[1].verdict is not Verdict.WITHIN
    assert seen == {(Verdict.EXCEEDED, Verdict.UNDECIDED)} or seen == {(Verdict.EXCEEDED, Verdict.EXCEEDED)}


def test_who_is_touched_is_as_fast_as_was_captured_until_that_is_known_to_be_elsewhere():
    """Between the touch and the tracking limit the twin alone was asked: it stands, and the hand moves."""
    t, q = pressing()
    station = workstation(source(captured(frames_of(t, q))), **desk())
    hand, limit = "operator/right_hand", 0.25
    stage = Station(replace(station, safety=(Velocity(name="v", of=hand, limit=limit),)))
    engine, judge = Engine(stage.model, driven={"operator": 0.2}), Judge(stage.bound)
    index = next(body.index for body in stage.model.bodies if body.name == hand)
    met = 0
    for seq, samples in enumerate(road.pump(stage.sources, 0.01)):
        engine.take(samples)
        state = engine.tick() if seq else engine.start()
        (result,) = judge(state)
        a, b = (np.array([np.interp(state.t + d, t, joint) for joint in q.T]) for d in (-5e-3, 5e-3))
        (_, before), (_, after) = bone_poses(PERSON, a), bone_poses(PERSON, b)
        row = BONES.index("right_hand")
        moves = float(np.linalg.norm(after[row] - before[row])) / 0.01
        if moves < 1.1 * limit or not 0.3 < state.t < 0.8:
            continue
        assert result.verdict is not Verdict.WITHIN, state.t
        twin = (
            float(np.linalg.norm(state.body_velocities((index,))[0][index]))
            if not state.stray("operator")
            else 1
        )
        met += twin < 0.5 * moves
    assert met > 2
