"""Captured motion becomes a person in physics; what cannot be is flagged and never followed."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from made_capture import PERSON, captured, frames_of, play, source, walking, workstation
from msgspec.structs import replace

from seerob.core.quantities import Pose
from seerob.core.samples import BodyPoint, BodySample, Quality
from seerob.core.transforms import rotation_from_axis_angle, rotation_from_wxyz, wxyz_from_rotation
from seerob.description.capture.following import Following
from seerob.description.capture.smoothing import POINT_SPEED
from seerob.description.humans.skeleton import BONES, JOINTS, bone_poses
from seerob.session.station import Station
from seerob.twin.accuracy.tracking_error import TrackingError
from seerob.twin.engine import Engine

HAND = BONES.index("right_hand")


def test_a_walk_is_followed_by_every_bone():
    told = play(source(captured(frames_of(*walking()))))
    assert {doubt for _, doubt, *_ in told} == {""}
    away = [e[0] for _, _, bones, *_ in told for e in bones.values()]
    turned = [e[1] for _, _, bones, *_ in told for e in bones.values()]
    assert set(told[-1][2]) == set(BONES)
    assert np.median(away) < 1e-3
    assert max(away) < 0.01
    assert np.median(turned) < 5e-3


def test_it_is_where_it_was_captured_and_the_capture_may_stand_elsewhere():
    t, q = walking(0.5)
    there = play(source(captured(frames_of(t, q)), at=turned_and_moved()))
    x, y = there[-1][4][:2]
    # Turned by a quarter and moved by (1, 2): forward in the capture is left in the cell.
    assert (x, y) == pytest.approx((1 - q[-1, 1], 2 + q[-1, 0]), abs=5e-3)


def turned_and_moved():
    return Pose(position=(1.0, 2.0, 0.0), rpy=(0.0, 0.0, np.pi / 2))


@pytest.mark.parametrize("leap", [4.0, 40.0])
def test_a_jump_of_a_whole_person_is_never_a_motion(leap):
    frames = frames_of(*walking())
    for frame in frames[40:50]:
        frame.positions[:] += leap
    told = play(source(captured(frames)))
    during = [doubt for t, doubt, *_ in told if 0.66 < t < 0.84]
    assert all("jumped" in doubt or "elsewhere" in doubt for doubt in during)
    assert max(speed for *_, speed, _ in told) < 15.0
    assert max(abs(q[:3]).max() for *_, q in told) < 3.0
    assert told[-1][1] == ""


def test_who_stays_elsewhere_is_believed_after_as_long_as_the_way_takes_and_put_there():
    frames = frames_of(*walking(2.0))
    for frame in frames[30:]:
        frame.positions[:, 1] += 4.0
    told = play(source(captured(frames)))
    assert all(doubt for t, doubt, *_ in told if 0.52 < t < 0.5 + 4.0 / POINT_SPEED)
    assert told[-1][1] == ""
    assert told[-1][4][1] == pytest.approx(4.0, abs=0.1)
    assert max(speed for *_, speed, _ in told) < 15.0


@pytest.mark.parametrize("seconds", [0.3, 0.4])
def test_a_capture_that_drifts_is_no_motion(seconds):
    """By 1.5 m, evenly: a person who stands would have to go at 4 and 5 m/s at once, and to stop."""
    t, q = walking(2.0)
    frames = frames_of(t, np.tile(q[0], (len(t), 1)))
    for frame, way in zip(frames, 1.5 * np.clip((t - 0.6) / seconds, 0.0, 1.0), strict=True):
        frame.positions[:, 1] += way
    told = play(source(captured(frames)))
    assert {doubt for t, doubt, *_ in told if t < 0.57} == {""}
    assert all("nobody can" in doubt for t, doubt, *_ in told if 0.69 < t < 0.6 + seconds + 0.45)


def test_a_person_who_runs_is_followed():
    """From standing to 4 m/s with 8 m/s², and slower with as much."""
    t, q = walking(2.0)
    frames = frames_of(t, np.tile(q[0], (len(t), 1)))
    speed = np.clip(8 * np.minimum(t - 0.2, 1.9 - t), 0.0, 4.0)
    for frame, way in zip(frames, np.cumsum(speed) * (t[1] - t[0]), strict=True):
        frame.positions[:, 1] += way
    assert {doubt for _, doubt, *_ in play(source(captured(frames)))} == {""}


def test_a_hand_that_jumps_is_left_out_and_named():
    frames = frames_of(*walking(), turned=False)
    for frame in frames[40:43]:
        frame.positions[HAND] += 2.0
    told = play(source(captured(frames)))
    doubts = {doubt for _, doubt, *_ in told if doubt}
    assert doubts == {"operator: right_hand jumped"}
    assert max(e[0] for _, _, bones, *_ in told for e in bones.values() if e[0] is not None) < 0.1


@pytest.mark.parametrize(("hold", "counts"), [(0.1, 0.1), (0.4, 0.2)])
def test_a_bone_that_is_lost_counts_for_the_hold_time_and_the_time_out_and_not_longer(hold, counts):
    frames = frames_of(*walking(), turned=False)
    for frame in frames[30:75]:
        frame.positions[HAND] = np.nan
    told = play(source(captured(frames), hold=hold))
    lost = [t for t, doubt, *_ in told if "not seen any more: right_hand" in doubt]
    assert min(lost) == pytest.approx(29 / 60 + counts, abs=0.03)
    assert max(lost) == pytest.approx(75 / 60, abs=0.03)
    assert "right_hand" not in told[60][2]


def test_a_person_that_is_lost_is_undecided_and_found_again():
    frames = frames_of(*walking())
    for frame in frames[20:60]:
        frame.positions[:] = np.nan
        frame.orientations[:] = np.nan
    told = play(source(captured(frames)))
    assert all(doubt for t, doubt, *_ in told if 19 / 60 + 0.21 < t < 0.98)
    assert told[-1][1] == ""
    assert max(speed for *_, speed, _ in told) < 15.0


def test_a_sensor_that_is_mounted_a_quarter_turn_off_is_never_silently_followed():
    frames = frames_of(*walking(0.5))
    wrong = rotation_from_axis_angle([1, 0, 0], np.pi / 2)
    for frame in frames:
        row = frame.orientations[BONES.index("right_shank")]
        row[:] = wxyz_from_rotation(rotation_from_wxyz(row) @ wrong)
    told = play(source(captured(frames)))
    assert all("right_shank" in doubt for _, doubt, *_ in told)


def test_a_sample_that_is_said_again_moves_nobody():
    """As a run that was held up does: a headset's three points leave the fit room to go on within them."""
    rng, person = np.random.default_rng(1), Following(PERSON, np.eye(4))
    seen = points(("head", "left_hand", "right_hand"), walking(0.1)[1][0])
    q = []
    for k in range(20):
        t = 0.9 * k
        shaken = tuple(
            replace(p, position=tuple(np.array(p.position) + rng.normal(0, 0.01, 3))) for p in seen
        )
        sample = BodySample(source="headset", seq=k, target="operator", t=t, points=shaken)
        for said in (sample, replace(sample, t=t + 1e-6, quality=Quality.LATE)):
            assert person.hear(said)
            q += [found.q for found in person.until(said.t)]
    assert len(q) == 40
    first, again = np.array(q[::2]), np.array(q[1::2])
    assert np.abs(np.diff(first, axis=0)).max(initial=0) > 1e-3
    assert np.array_equal(first, again)


def test_dropped_and_reordered_frames_change_little():
    t, q = walking()
    frames = frames_of(t, q)
    random = np.random.default_rng(1)
    mixed = [frame for frame in frames if random.random() > 0.2 or frame is frames[0]]
    mixed[20], mixed[21] = mixed[21], mixed[20]
    told = play(source(captured(mixed)))
    assert {doubt for _, doubt, *_ in told} == {""}
    assert told[60][4] == pytest.approx(play(source(captured(frames)))[60][4], abs=0.05)


def test_a_table_stops_the_hand_and_the_person_does_not_explode():
    """The capture reaches through a table: the twin stays outside, and says that it does not follow."""
    t = np.arange(90) / 60.0
    q = np.tile(walking(0.1)[1][0], (len(t), 1))
    q[:, JOINTS.index("right_elbow_flexion")] = 1.5
    q[:, JOINTS.index("right_shoulder_flexion")] = np.interp(t, [0.3, 1.0], [0.6, 0.0])
    tables = {
        "parts": [
            {"name": "desk", "at": {"position": [0.45, -0.2, 0.575]}, "shape": {"box": [0.5, 0.8, 1.15]}}
        ],
        "contacts": [
            {"between": ["operator/right_forearm", "desk"]},
            {"between": ["operator/right_hand", "desk"]},
        ],
    }
    free = play(source(captured(frames_of(t, q))))
    told = play(source(captured(frames_of(t, q))), **tables)
    assert free[-1][1] == ""
    assert "the twin is off" in told[-1][1]
    assert max(speed for *_, speed, _ in told) < 20.0
    away = told[-1][2]["right_hand"][0]
    assert away > 0.02 > free[-1][2]["right_hand"][0]


def points(names, q, weight=1.0, shift=0.0):
    _, p = bone_poses(PERSON, q)
    return tuple(
        BodyPoint(
            name=name,
            bone=name,
            position=tuple((p[BONES.index(name)] + shift).tolist()),
            position_weight=weight,
        )
        for name in names
    )


def test_devices_complement_one_another_and_the_best_one_counts():
    _, q = walking()
    body = [b for b in BONES if b != "right_hand"]
    following = Following(PERSON, np.eye(4))
    for seq, t in enumerate((0.0, 0.1)):
        camera = points(BONES, q[0], weight=0.5, shift=0.03)
        tracker = points(["right_hand"], q[0], weight=4.0)
        for name, what in (("camera", camera), ("tracker", tracker)):
            following.hear(BodySample(source=name, target="operator", seq=seq, t=t, points=what))
    found = list(following.until(0.1))[-1]
    assert found.reason == ""
    names = [BONES[b] for b in found.seen.bone]
    assert sorted(names) == sorted([*body, "right_hand"])
    _, exact = bone_poses(PERSON, q[0])
    assert found.seen.position[names.index("right_hand")] == pytest.approx(exact[HAND])
    assert found.seen.position[names.index("head")] == pytest.approx(exact[BONES.index("head")] + 0.03)


def test_a_device_that_falls_silent_leaves_its_bones_to_the_others_or_in_doubt():
    _, q = walking()
    following = Following(PERSON, np.eye(4))
    for seq in range(20):
        t = 0.05 * seq
        body = points([b for b in BONES if b != "right_hand"], q[0])
        following.hear(BodySample(source="camera", target="operator", seq=seq, t=t, points=body, hold=0.3))
        if seq < 8:
            hand = points(["right_hand"], q[0])
            following.hear(BodySample(source="glove", target="operator", seq=seq, t=t, points=hand, hold=0.3))
    told = {found.t: "; ".join(why for why, _ in found.parts) for found in following.until(0.9)}
    assert all(reason == "" for t, reason in told.items() if t < 0.6)
    assert all("right_hand" in reason and "glove" in reason for t, reason in told.items() if t > 0.7)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -1e300])
def test_what_is_not_finite_is_left_out(bad):
    _, q = walking()
    following = Following(PERSON, np.eye(4))
    good = points(BONES, q[0])
    poor = (
        *points([b for b in BONES if b != "head"], q[0]),
        BodyPoint(name="head", bone="head", position=(bad, 0, 0)),
    )
    for seq, what in enumerate((good, poor, poor)):
        following.hear(BodySample(source="d", target="operator", seq=seq, t=0.02 * seq, points=what))
    assert (
        not following.hear(BodySample(source="d", target="operator", seq=9, t=bad, points=good))
        or bad == -1e300
    )
    for found in following.until(0.04):
        assert np.isfinite(found.q).all()
        assert np.abs(found.q - q[0]).max() < 1.0


def test_what_a_device_calls_invalid_is_not_followed():
    _, q = walking()
    following = Following(PERSON, np.eye(4))
    for seq, quality in enumerate((Quality.GOOD, Quality.INVALID, Quality.DEGRADED)):
        what = points(BONES, q[0], shift=0.0 if seq != 1 else 0.05)
        following.hear(
            BodySample(source="d", target="operator", seq=seq, t=0.02 * seq, points=what, quality=quality)
        )
    found = list(following.until(0.04))
    assert [f.t for f in found] == [0.0, 0.04]
    assert found[-1].reason == "d says degraded"


def test_mujoco_agrees_where_the_bones_are():
    """The posture that is fitted and the body that is simulated are the same person."""
    station = Station(workstation())
    model, mechanism = station.model, station.model.mechanisms["operator"]
    data = mujoco.MjData(model.mj)
    q = walking()[1][10]
    data.qpos[mechanism.q_address] = q
    mujoco.mj_kinematics(model.mj, data)
    _, p = Following(PERSON, np.eye(4))._fitter.bones(q)
    for i, bone in enumerate(BONES):
        assert data.xpos[model.frames[f"operator/{bone}"].mj] == pytest.approx(p[i], abs=1e-12)


def test_hostile_samples_are_refused_and_what_waits_is_bounded():
    from seerob.description.capture import following as module

    _, q = walking()
    good = points(BONES, q[0])
    following = Following(PERSON, np.eye(4))

    def hear(source="d", t=0.0, what=good, hold=0.5):
        return following.hear(
            BodySample(source=source, target="operator", seq=0, t=t, points=what, hold=hold)
        )

    assert not hear(what=good * 200)
    for hold in (np.nan, -1.0, np.inf):
        assert not hear(hold=hold)
    assert hear()
    assert not hear()
    # A clock that runs ahead: what it says waits, but not without end.
    for k in range(module.MOST_KEPT + 100):
        assert hear(t=1e6 + k, what=good[:1])
    assert len(following._instants) <= module.MOST_KEPT
    heard = [hear(source=f"d{k}", t=0.5) for k in range(module.MOST_DEVICES + 5)]
    assert sum(heard) == module.MOST_DEVICES - 1


def test_who_is_seen_for_the_first_time_during_a_run_is_put_there():
    """A live device that begins late: the twin does not fly there through the cell."""
    station = Station(workstation(source(captured(frames_of(*walking(0.4))))))
    late, away = 0.3, np.array([3.0, 1.0, 0.0])
    samples = [
        replace(
            sample,
            t=sample.t + late,
            points=tuple(replace(p, position=tuple(p.position + away)) for p in sample.points),
        )
        for _, opened in station.sources
        for sample in opened.samples
    ]
    engine = Engine(station.model, driven={"operator": 0.2}, live=["operator"])
    mechanism = station.model.mechanisms["operator"]
    for tick in range(50):
        near = [s for s in samples if tick * 0.01 <= s.t - 0.02 < (tick + 1) * 0.01]
        engine.take(near)
        state = engine.tick() if tick else engine.start()
        assert np.abs(state.data.qvel[mechanism.v_address]).max() < 10, state.t
        assert bool(state.invalid_reason("operator")) == (state.t < late - 1e-9), state.t
    assert state.joint_positions(mechanism)[0] > 2.9


def test_who_turns_back_while_nothing_is_heard_is_no_farther_from_the_twin_than_is_said():
    """The twin of a live person goes on at its speed for a while, and then stays; the person need not."""
    station = Station(workstation(source(captured(frames_of(*walking(1.2))))))
    said = [sample for _, opened in station.sources for sample in opened.samples]
    turns = next(k for k, sample in enumerate(said) if sample.t > 0.6)
    back = [
        replace(now, points=then.points)
        for now, then in zip(said[turns:], said[turns - 1 :: -1], strict=False)
    ]
    bodies = tuple(b.index for b in station.model.bodies if b.owner == "operator")
    off = TrackingError(station.model, bodies)
    places, errors, waits = [], [], []
    for heard in ([*said[:turns], *back], said[:turns]):
        engine = Engine(station.model, driven={"operator": 0.5}, live=["operator"])
        places.append(last := [])
        errors.append(around := [])
        for tick in range(100):
            engine.take([s for s in heard if (tick - 1) * 0.01 < s.t - 0.02 <= tick * 0.01])
            state = engine.tick() if tick else engine.start()
            if state.t > 0.1:
                last.append(state.positions[list(bodies)].copy())
                around.append(off.at(state))
                if 0.1 < state.t < 0.5:
                    waits.append(state.hearing("operator").slack(state.t))
    apart = np.linalg.norm(np.subtract(*places), axis=2)
    known = np.add(*errors)
    assert (apart <= known + 0.005).all(), (apart - known).max()
    assert apart[-1].max() > 0.2
    assert not any(waits)  # who is heard in time is held nowhere
    silent = 1.0 - 0.6
    assert np.linalg.norm(places[1][-1] - places[1][-5], axis=1).max() < 0.01
    assert min(state.hearing("operator").slack(state.t).values()) > 2 * silent
    # It stands, and nobody says that the person does.
    assert np.abs(state.qd(station.model.mechanisms["operator"])[:3]).max() < 0.05
    assert not state.moved("operator")


def test_who_moved_while_run_time_stood_still_is_not_flung_on():
    """The way between both samples seems made in a moment; at that speed the twin would go on meanwhile."""
    station = Station(workstation(source(captured(frames_of(*walking(0.4))))))
    seen = points(("head", "left_hand", "right_hand"), walking(0.1)[1][0])
    moved = tuple(replace(p, position=(p.position[0], p.position[1], p.position[2] + 0.06)) for p in seen)

    def sample(t, what, quality=Quality.GOOD):
        return BodySample(source="room", seq=0, target="operator", t=t, points=what, quality=quality)

    heard = [sample(0.02 * k, seen) for k in range(16)]
    heard += [sample(0.3 + 1e-6, seen, Quality.LATE), sample(0.308, moved, Quality.LATE)]
    engine = Engine(station.model, driven={"operator": 1.0}, live=["operator"])
    hand = next(b.index for b in station.model.bodies if b.name == "operator/right_hand")
    places = []
    for tick in range(60):
        engine.take([s for s in heard if (tick - 1) * 0.01 < s.t - 0.02 <= tick * 0.01])
        state = engine.tick() if tick else engine.start()
        places.append(state.positions[hand].copy())
    way = np.linalg.norm(places[-1] - places[25])
    assert 0.02 < way < 0.08
    assert max(np.linalg.norm(place - places[-1]) for place in places[25:]) < way + 0.02
