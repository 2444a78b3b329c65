"""Where fingers, toes and crown are is bounded when nothing but the joint before them is seen."""

from __future__ import annotations

import numpy as np
import pytest
from made_capture import PERSON, captured, frames_of, source, walking, workstation

from seerob.core.samples import BodyPoint
from seerob.criteria.scoring.rule import bind_posture
from seerob.description.capture.estimated import ENDS, aimed, bare, swing, turned, undetermined
from seerob.description.humans.posture import posture
from seerob.description.humans.skeleton import AXES, BONES, bone_poses
from seerob.session import run as road
from seerob.session.station import Station
from seerob.twin.accuracy.tracking_error import TrackingError
from seerob.twin.engine import Engine

LIMITS = PERSON.joints()
LOWER = np.array([-np.inf if j.lower is None else j.lower for j in LIMITS])
UPPER = np.array([np.inf if j.upper is None else j.upper for j in LIMITS])


def seen(bone, *, at=(0.0, 0.0, 0.0), wxyz=None, weight=1.0):
    return BodyPoint(
        name=f"{bone}{at}", bone=bone, at=at, position=(0, 0, 0), wxyz=wxyz, position_weight=weight
    )


def test_an_orientation_other_places_or_the_toes_tell_how_an_end_is_turned():
    def found(*points):
        return aimed(turned(points))

    assert found(*(seen(bone) for bone in ENDS)) == set()
    assert found(seen("right_hand", wxyz=(1.0, 0, 0, 0))) == {"right_hand"}
    assert found(seen("right_hand"), seen("right_hand", at=(0.0, -0.08, 0.0))) == {"right_hand"}
    assert found(seen("right_hand"), seen("right_hand", at=(0.0, -0.08, 0.0), weight=0.0)) == set()
    assert found(seen("left_foot"), seen("left_toes")) == {"left_foot"}
    assert found(seen("left_forearm", wxyz=(1.0, 0, 0, 0))) == set()
    # Both sides of a wrist, or both ears, do not say where the fingers or the crown are.
    across = [seen("left_hand", at=(0.0, 0.0, z)) for z in (-0.04, 0.04)]
    assert found(*across) == set()
    assert found(*across, seen("left_hand", at=(0.0, -0.08, 0.0))) == {"left_hand"}
    assert found(seen("head", at=(0.0, 0.02, 0.07)), seen("head", at=(0.0, 0.02, -0.07))) == set()


WRIST = {("wrist_flexion", 0), ("wrist_deviation", 0)}
ROLL = {("forearm_rotation", 0)}


@pytest.mark.parametrize(
    ("points", "open_angles"),
    [
        ([], WRIST | ROLL),
        ([seen("right_hand")], WRIST | ROLL),
        # A fingertip shows where the hand points; whether the palm is up it does not.
        ([seen("right_hand"), seen("right_hand", at=(0.0, -0.1, 0.0))], WRIST | ROLL),
        ([seen("right_hand", at=(0.0, -0.1, 0.0)), seen("right_hand", at=(0.0, -0.05, 0.05))], set()),
        ([seen("right_hand", wxyz=(1.0, 0, 0, 0))], set()),
        # Both styloids: how the forearm is turned, and nothing of the hand.
        ([seen("right_forearm", at=(0.0, -0.25, z)) for z in (-0.04, 0.04)], WRIST),
        (
            [
                *(seen("right_forearm", at=(0.0, -0.25, z)) for z in (-0.04, 0.04)),
                seen("right_hand", at=(-0.01, -0.09, 0.0)),
            ],
            set(),
        ),
        ([seen("right_hand", at=(0.0, 0.0, z)) for z in (-0.04, 0.04)], {("wrist_flexion", 0)}),
    ],
)
def test_places_on_one_line_leave_the_turn_about_it_open(points, open_angles):
    left = [seen("left_hand", wxyz=(1.0, 0, 0, 0)), seen("head", wxyz=(1.0, 0, 0, 0))]
    assert undetermined(turned([*points, *left])) == open_angles


def bare_of(*points):
    return bare({p.bone for p in points}, {p.bone for p in points if p.position_weight}, turned(points))


def test_a_joint_alone_does_not_say_where_the_bone_behind_it_points():
    knee, ankle = seen("right_shank"), seen("right_foot")
    assert bare_of(knee) == {"right_shank"}
    assert bare_of(knee, ankle) == set()
    assert bare_of(knee, seen("right_toes")) == set()  # the ankle is told between them
    assert bare_of(seen("right_shank", wxyz=(1.0, 0, 0, 0))) == set()
    assert bare_of(knee, seen("right_shank", at=(0.0, -0.2, 0.05))) == set()
    assert bare_of(knee, seen("right_shank", at=(0.0, 0.0, 0.05))) == {"right_shank"}
    arm = [seen(f"left_{bone}") for bone in ("clavicle", "upper_arm", "forearm", "hand")]
    assert bare_of(*arm) == set()
    assert bare_of(*arm[:3]) == {"left_forearm"}
    assert bare_of(*arm[:2]) == {"left_upper_arm"}
    assert bare_of(arm[1], arm[3]) == set()
    # A wrist of which only the orientation arrives does not show where it is.
    assert bare_of(*arm[:3], seen("left_hand", wxyz=(1.0, 0, 0, 0), weight=0.0)) == {"left_forearm"}
    assert bare_of(seen("neck")) == {"neck"}
    assert bare_of(seen("neck"), seen("head")) == set()


def test_two_points_of_a_head_do_not_tell_all_of_the_neck():
    hands = [seen(f"{side}_hand", wxyz=(1.0, 0, 0, 0)) for side in ("right", "left")]

    def open_angles(*places):
        return undetermined(turned([*hands, *(seen("head", at=at) for at in places)]))

    assert open_angles((0.0, 0.15, 0.0)) == {("neck_twist", 0)}
    assert open_angles((0.0, 0.01, 0.08), (0.0, 0.01, -0.08)) == {("neck_flexion", 0)}
    assert open_angles((0.1, 0.03, 0.0)) == {("neck_side_bend", 0)}
    assert open_angles((0.1, 0.03, 0.0), (0.0, 0.04, 0.07)) == frozenset()


@pytest.mark.parametrize("bone", sorted(ENDS))
def test_no_posture_within_the_limits_turns_it_farther_than_the_bound(bone):
    random, i = np.random.default_rng(3), BONES.index(bone)
    q = posture(PERSON, "standing")
    own = [k for k, axis in enumerate(AXES) if axis.bone == bone]
    many = np.repeat(q[None], 300, axis=0)
    many[:, own] = random.uniform(LOWER[own], UPPER[own], (300, len(own)))
    many[:2, own] = LOWER[own], UPPER[own]
    here, (there, _) = bone_poses(PERSON, q)[0][i], bone_poses(PERSON, many)
    angle = np.arccos(np.clip((np.einsum("nij,ij->n", there[:, i], here) - 1) / 2, -1, 1))
    bound = swing(bone, q, LOWER, UPPER)
    assert angle.max() <= bound + 1e-9
    assert bound <= np.pi


def twin(turned):
    frames = frames_of(*walking(0.3), turned=turned)
    stage = Station(workstation(source(captured(frames))))
    engine = Engine(stage.model, driven={"operator": 0.2})
    for seq, samples in enumerate(road.pump(stage.sources, 0.01)):
        engine.take(samples)
        state = engine.tick() if seq else engine.start()
        if seq == 5:
            break
    return stage.model, state


def test_a_distance_to_a_hand_of_which_the_wrist_alone_is_seen_is_as_uncertain_as_the_hand_is_long():
    model, state = twin(turned=False)
    human = model.human("operator")
    names = [model.bodies[i].name.removeprefix("operator/") for i in human.bodies]
    off = dict(zip(names, TrackingError(model, list(human.bodies)).at(state), strict=True))
    assert set(state.hearings["operator"].unaimed(state.t)) == {"head", "right_hand", "left_hand"}
    assert 0.2 < off["right_hand"] < 0.5
    assert off["head"] > 0.05
    assert off["right_foot"] < 0.02  # its toes are seen
    assert off["right_forearm"] < 0.02
    lost = bind_posture(model, "operator")(state)
    model, state = twin(turned=True)
    assert state.hearings["operator"].unaimed(state.t) == {}
    assert TrackingError(model, list(human.bodies)).at(state).max() < 0.02
    told = bind_posture(model, "operator")(state)
    unknown = {f for f in told.__dataclass_fields__ if np.isnan(np.asarray(getattr(lost, f), float)).any()}
    assert any("wrist" in name for name in unknown)
    assert not any(np.isnan(np.asarray(getattr(told, name), float)).any() for name in unknown)
    assert any("forearm_rotation" in name for name in unknown)
    assert "neck_twist" in unknown
