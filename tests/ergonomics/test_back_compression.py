"""Compression of the back: Pinocchio's inverse dynamics of the same body has the same moments."""

import re

import numpy as np
import pinocchio as pin
import pytest
from made_postures import PERSON, random_q

from made_cell import made, person
from oracles.pinocchio_oracle import index_of, pinocchio_model
from seerob.core.errors import InputError
from seerob.core.verdict import Verdict
from seerob.criteria.ergonomics.back_compression import UPPER, G, compression, held
from seerob.description.humans.posture import posture
from seerob.description.humans.skeleton import BONES, JOINTS, bone_poses
from seerob.session.run import Judge
from seerob.twin.engine import Engine

MODEL = pinocchio_model(PERSON)
LINKS = {link.name: link for link in PERSON.links}
MASSES = np.array([LINKS[bone].inertial.mass for bone in UPPER])
COMS = np.array([LINKS[bone].inertial.com for bone in UPPER])
ROWS = [BONES.index(bone) for bone in UPPER]


def of(q, load=0.0, hands=("right", "left"), off=0.0):
    R, x = bone_poses(PERSON, q)
    return held(R[ROWS], x[ROWS], MASSES, COMS, load, hands, off)


@pytest.mark.parametrize("load", [0.0, 12.0])
def test_pinocchio_has_the_same_moments_of_any_posture(load):
    for q in random_q(20, seed=3):
        model, data = MODEL.copy(), MODEL.createData()
        own = np.zeros(model.nq)
        own[index_of(model, PERSON)] = q
        for side in ("right", "left"):
            hand = model.frames[model.getFrameId(f"{side}_hand", pin.FrameType.BODY)]
            at = hand.placement.act(np.asarray(LINKS[f"{side}_hand"].inertial.com))
            model.appendBodyToJoint(
                hand.parentJoint, pin.Inertia(load / 2, at, np.zeros((3, 3))), pin.SE3.Identity()
            )
        data = model.createData()
        zero = np.zeros(model.nv)
        torque = pin.rnea(model, data, own, zero, zero)
        found = of(q, load)
        pin.computeJointJacobians(model, data, own)
        lumbar = [name for name in JOINTS if name.startswith("lumbar")]
        assert len(lumbar) == 3
        for name in lumbar:
            joint = model.getJointId(name)
            column = model.joints[joint].idx_v
            J = pin.getJointJacobian(model, data, joint, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
            assert J[3:, column] @ found.vector == pytest.approx(-torque[column], abs=1e-9)


def test_a_load_weighs_by_its_distance_and_one_hand_takes_all_of_it():
    q = posture(
        PERSON, "standing", joints={"right_shoulder_flexion_deg": 90, "left_shoulder_flexion_deg": 90}
    )
    _, x = bone_poses(PERSON, q)
    place = dict(zip(BONES, x, strict=True))
    empty, both, right = of(q), of(q, 10.0), of(q, 10.0, ("right",))
    assert both.weight - empty.weight == pytest.approx(98.1)
    assert right.shoulders[1] == pytest.approx(empty.shoulders[1])
    more = right.shoulders[0] - empty.shoulders[0]
    reach = place["right_hand"][:2] - place["right_upper_arm"][:2]
    assert more == pytest.approx(98.1 * np.linalg.norm(reach), rel=0.2)  # held in the hand, not at the wrist
    assert both.shoulders[0] - empty.shoulders[0] == pytest.approx(more / 2, rel=1e-3)


def test_who_bends_over_has_the_weight_of_the_trunk_at_its_lever():
    q = posture(PERSON, "anatomical", joints={"pelvis_tilt_back_deg": -90})
    found = of(q)
    com = (MASSES[:, None] * _centres(q)).sum(axis=0) / MASSES.sum()
    hip = bone_poses(PERSON, q)[1][BONES.index("lumbar")]
    assert found.moment == pytest.approx(MASSES.sum() * G * np.linalg.norm((com - hip)[:2]), rel=1e-9)
    assert compression(found.moment, found.weight, found.upright, 0.05) == pytest.approx(found.moment / 0.05)


def _centres(q):
    R, x = bone_poses(PERSON, q)
    return x[ROWS] + np.einsum("nij,nj->ni", R[ROWS], COMS)


def test_angles_that_are_off_stay_within_their_bound():
    rng = np.random.default_rng(5)
    limbs = [k for k, name in enumerate(JOINTS) if not name.startswith("pelvis")]
    for q in random_q(10, seed=8, scale=0.5):
        off = 0.05
        here = of(q, 8.0, off=off)
        for _ in range(20):
            # One rotation per joint: a bone's axes together turn it by no more than this.
            moved = q.copy()
            moved[limbs] += rng.uniform(-off, off, len(limbs)) / 3
            assert abs(of(moved, 8.0).moment - here.moment) <= here.error


TABLE = '[[ergonomics]]\nkind = "back_compression"\nname = "back"\nhuman = "op"\n'


def told(folder, more, standing="standing"):
    cell = made(folder, person("op").rstrip() + f'\nposture = "{standing}"\n' + TABLE + more)
    engine, judge = Engine(cell.model), Judge(cell.bound)
    (result,) = judge(engine.start())
    return result


def test_without_a_load_or_without_being_slow_nothing_is_within(tmp_path):
    light = told(tmp_path / "a", "load = 1\nslow = true\n")
    assert light.verdict is Verdict.WITHIN
    assert {part.name for part in light.parts} >= {"moment at L5/S1", "moment at the right shoulder"}
    quick = told(tmp_path / "b", "load = 1\n")
    assert quick.verdict is Verdict.UNDECIDED
    assert "slow = true" in quick.reason
    unknown = told(tmp_path / "c", "slow = true\n")
    assert unknown.verdict is Verdict.UNDECIDED
    assert "load" in unknown.reason
    heavy = told(tmp_path / "d", "load = 300\n")
    assert heavy.verdict is Verdict.EXCEEDED
    unseen = told(tmp_path / "e", 'load = 1\nslow = true\nunmeasured = ["right_hand"]\n')
    assert unseen.verdict is Verdict.UNDECIDED
    assert re.search("not measured: right hand", unseen.reason)
    off = told(tmp_path / "f", "load = 1\nslow = true\naccuracy_deg = 40\n")
    assert off.verdict is Verdict.UNDECIDED
    with pytest.raises(InputError, match="shorter"):
        told(tmp_path / "g", "lever = 0.06\nlong_lever = 0.05\n")
