"""A posture comes back from what devices see of it, within the joints' limits."""

from __future__ import annotations

import numpy as np
import pytest
from made_capture import PERSON

from seerob.core.samples import BodyPoint
from seerob.core.transforms import (
    inverse,
    rotation_from_axis_angle,
    rotation_from_rpy,
    transform,
    wxyz_from_rotation,
)
from seerob.description.capture.fitting import Fitter, Pulls, pulls
from seerob.description.humans.angles import angles
from seerob.description.humans.posture import lowest_sole
from seerob.description.humans.skeleton import BONES, JOINTS, bone_poses
from seerob.kernels import posture_fit as kernel

FITTER = Fitter(PERSON)


def random_posture(seed: int, share: float = 0.4) -> np.ndarray:
    """Inside the limits by a share of the range, anywhere and facing anywhere."""
    random = np.random.default_rng(seed)
    low, high = np.maximum(FITTER.lower, -1.0), np.minimum(FITTER.upper, 1.0)
    q = np.clip(FITTER.rest + share * random.uniform(low - FITTER.rest, high - FITTER.rest), low, high)
    q[:3], q[3] = random.uniform(-3, 3, 3), random.uniform(-3, 3)
    return np.asarray(q)


def seen_of(q: np.ndarray, *, turned: bool = True, world: np.ndarray | None = None) -> Pulls:
    world = np.eye(4) if world is None else world
    R, p = bone_poses(PERSON, q)
    R, p = world[:3, :3] @ R, p @ world[:3, :3].T + world[:3, 3]
    points = [
        BodyPoint(
            name=bone,
            bone=bone,
            position=tuple(p[i].tolist()),
            wxyz=tuple(wxyz_from_rotation(R[i]).tolist()) if turned else None,
        )
        for i, bone in enumerate(BONES)
    ]
    return pulls(points, inverse(world))


@pytest.mark.parametrize("seed", range(6))
def test_the_kernel_has_bones_where_the_description_has_them(seed):
    q = random_posture(seed, share=0.9)
    for own, other in zip(FITTER.bones(q), bone_poses(PERSON, q), strict=True):
        assert own == pytest.approx(other, abs=1e-13)


@pytest.mark.parametrize("seed", range(8))
def test_a_posture_comes_back_from_its_bones_wherever_the_person_stands(seed):
    q = random_posture(seed)
    world = transform(rotation_from_rpy([0, 0, 0.7 * seed]), [seed, -2.0, 0.1])
    found, error = FITTER.fit(seen_of(q, world=world), None)
    assert found == pytest.approx(q, abs=2e-3)
    assert np.abs(error).max() < 1e-3


@pytest.mark.parametrize("seed", range(4))
def test_joint_centres_alone_tell_where_every_bone_begins(seed):
    _, error = FITTER.fit(seen_of(random_posture(seed), turned=False), None)
    assert np.abs(error[:, :3]).max() < 1e-3


def test_the_fit_is_a_minimum():
    """No random step within the limits makes the sum of squares smaller."""
    random = np.random.default_rng(0)
    seen = seen_of(random_posture(3))
    moved = np.asarray(seen.position) + 0.03 * random.standard_normal(seen.position.shape)
    seen = Pulls(seen.names, seen.bone, seen.at, moved, seen.wp, seen.rotation, seen.wo)
    q, _ = FITTER.fit(seen, None)

    def cost(q):
        beside = (FITTER._w_rest * (q - FITTER.rest) ** 2).sum()
        error = np.zeros((len(seen.bone), 6))
        return beside + kernel.residuals(FITTER.poses(q), seen.of_links(), error)

    best = cost(q)
    for size in (1e-4, 1e-3, 1e-2):
        for _ in range(200):
            other = np.clip(q + size * random.standard_normal(len(q)), FITTER.lower, FITTER.upper)
            assert cost(other) >= best - 1e-6


def test_limits_are_kept_and_the_rest_still_fits():
    q = random_posture(1)
    seen = seen_of(q)
    bone = BONES.index("right_shank")
    # A knee that is bent the wrong way.
    seen.rotation[bone] = seen.rotation[BONES.index("right_thigh")] @ rotation_from_axis_angle([0, 0, 1], 1.0)
    found, error = FITTER.fit(seen, None)
    assert (found >= FITTER.lower - 1e-12).all()
    assert (found <= FITTER.upper + 1e-12).all()
    assert np.linalg.norm(error[bone, 3:]) > 0.5


def test_one_point_that_is_seen_wrongly_carries_nobody_away():
    seen = seen_of(random_posture(2))
    k = BONES.index("right_hand")
    seen.position[k] += (2.0, 0.0, 0.0)
    _, error = FITTER.fit(seen, None)
    others = np.delete(np.linalg.norm(error[:, :3], axis=1), k)
    assert np.median(others) < 0.01
    assert np.linalg.norm(error[k, :3]) > 1.5


def test_joints_move_no_farther_than_they_can():
    before, after = random_posture(4), random_posture(5)
    reach = np.full(53, 0.05)
    found, _ = FITTER.fit(seen_of(after), before, reach=reach)
    assert np.abs(found - before).max() <= 0.05 + 1e-12


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("lift", [0.0, 0.3, 0.9])
def test_who_raises_hands_of_which_alone_a_headset_sees_stays_on_the_floor(lift, turned):
    """Nothing below the chest is seen: the legs do not swing forward, nor does the person float."""
    R, p = FITTER.bones(FITTER.rest)
    q, head = None, BONES.index("head")
    for share in np.linspace(0, 1, 40):
        points = [
            BodyPoint(name=bone, bone=bone, position=tuple((p[BONES.index(bone)] + share * moved).tolist()))
            for bone, moved in (
                ("head", np.array([0.0, 0.0, -0.02])),
                ("left_hand", np.array([0.3, 0.0, lift])),
                ("right_hand", np.array([0.3, 0.0, lift])),
            )
        ]
        if turned:
            points.append(
                BodyPoint(name="way", bone="head", wxyz=tuple(wxyz_from_rotation(R[head]).tolist()))
            )
        q, error = FITTER.fit(pulls(points, np.eye(4)), q)
    assert np.abs(error[:, :3]).max() < 0.01
    assert abs(lowest_sole(PERSON, q)) < 0.05


@pytest.mark.parametrize("weight", [1.0, 0.1])
@pytest.mark.parametrize("higher", [0.1, 0.3, 1.0])
def test_who_is_seen_by_head_and_hands_on_a_platform_is_there(higher, weight):
    _, p = FITTER.bones(FITTER.rest)
    points = [
        BodyPoint(name=bone, bone=bone, position=tuple(p[k] + [0, 0, higher]), position_weight=weight)
        for bone in ("head", "left_hand", "right_hand")
        for k in [BONES.index(bone)]
    ]
    q = None
    for _ in range(20):
        q, error = FITTER.fit(pulls(points, np.eye(4)), q)
    assert np.abs(error[:, :3]).max() < 1e-3
    assert lowest_sole(PERSON, q) == pytest.approx(higher, abs=2e-3)


@pytest.mark.parametrize("lean", [-110.0, 50.0, 60.0, 80.0])
def test_a_chest_that_is_seen_is_where_it_is_seen(lean):
    """Pulled upright it would be turned away from there, and the neck judged against it bent less."""
    posture = FITTER.rest.copy()
    for name, value in {"pelvis_tilt_back": lean, "neck_extension": -14, "head_extension": -9}.items():
        posture[JOINTS.index(name)] = np.radians(value)
    R, p = FITTER.bones(posture)
    points = [
        BodyPoint(name=b, bone=b, position=tuple(p[k]), wxyz=tuple(wxyz_from_rotation(R[k]).tolist()))
        for b in ("head", "thorax", "left_hand", "right_hand")
        for k in [BONES.index(b)]
    ]
    q = None
    for _ in range(40):
        q, error = FITTER.fit(pulls(points, np.eye(4)), q)
    assert np.degrees(np.abs(error[:, 3:]).max()) < 0.1
    assert angles(*FITTER.bones(q)).neck_flexion == pytest.approx(angles(R, p).neck_flexion, abs=2e-3)


def test_who_is_lower_than_somebody_who_stands_is_not_bent_until_the_feet_fit():
    """Whether somebody sits, crouches or bows is not seen: no posture is made of which that looks known."""
    _, p = FITTER.bones(FITTER.rest)
    points = [
        BodyPoint(name=bone, bone=bone, position=(*p[BONES.index(bone)][:2].tolist(), p[i, 2] - 0.4))
        for bone in ("head", "left_hand", "right_hand")
        for i in [BONES.index(bone)]
    ]
    q, _ = FITTER.fit(pulls(points, np.eye(4)), None)
    assert lowest_sole(PERSON, q) < -0.3


def test_errors_are_those_of_the_bones():
    q = random_posture(6)
    seen = seen_of(q)
    k = BONES.index("left_hand")
    seen.position[k] += (0.03, 0.0, 0.04)
    turn = rotation_from_axis_angle([1, 2, 3], 0.3)
    seen.rotation[BONES.index("head")] = turn @ seen.rotation[BONES.index("head")]
    seen.wo[BONES.index("pelvis")] = 0.0
    errors = FITTER.errors(seen, q)
    assert errors["left_hand"] == pytest.approx((0.05, 0.0), abs=1e-7)
    assert errors["head"] == pytest.approx((0.0, 0.3), abs=1e-7)
    assert errors["pelvis"] == (pytest.approx(0.0, abs=1e-9), None)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-3, 1.0, 3.0, np.pi])
def test_logarithm_is_axis_times_angle(angle):
    axis = np.array([2.0, -1.0, 0.5])
    axis /= np.linalg.norm(axis)
    R = rotation_from_axis_angle([1, 1, 0], 0.4)
    out = np.zeros(3)
    kernel.logarithm(rotation_from_axis_angle(axis, angle) @ R, R, out)
    assert np.linalg.norm(out) == pytest.approx(angle, abs=1e-7)
    assert abs(out @ axis) == pytest.approx(angle, abs=1e-7)
