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
from seerob.criteria.ergonomics.back_compression import (
    UPPER,
    WINDOW,
    Accelerations,
    G,
    compression,
    held,
    moved,
)
from seerob.description.humans.posture import posture
from seerob.description.humans.skeleton import BONES, JOINTS, bone_poses
from seerob.session.run import Judge, looks_ahead, pump
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


# -- a motion that is called slow ---------------------------------------------------------------


@pytest.mark.parametrize("load", [0.0, 12.0])
def test_pinocchio_has_the_same_moments_of_any_motion(load):
    rng = np.random.default_rng(11)
    for q in random_q(10, seed=5):
        v, qdd = rng.normal(0, 1, (2, len(q)))
        model = MODEL.copy()
        rows = index_of(model, PERSON)
        for side in ("right", "left"):
            hand = model.frames[model.getFrameId(f"{side}_hand", pin.FrameType.BODY)]
            at = hand.placement.act(np.asarray(LINKS[f"{side}_hand"].inertial.com))
            model.appendBodyToJoint(
                hand.parentJoint, pin.Inertia(load / 2, at, np.zeros((3, 3))), pin.SE3.Identity()
            )
        # Bones as points: their own turning inertia is no part of the formula.
        for inertia in model.inertias:
            inertia.inertia = np.zeros((3, 3))
        data, own, rate, gain = model.createData(), *np.zeros((3, model.nq))
        own[rows], rate[rows], gain[rows] = q, v, qdd
        torque = pin.rnea(model, data, own, rate, gain)
        found = of(q, load)
        t = np.linspace(-2e-3, 0.0, 21)
        seen = []
        for s in t:
            R, x = bone_poses(PERSON, q + s * v + s**2 * qdd / 2)
            seen.append(x[ROWS] + np.einsum("nij,nj->ni", R[ROWS], COMS))
        a = 2 * np.polyfit(t, np.array(seen).reshape(len(t), -1), 4)[2].reshape(-1, 3)
        force = found.masses[:, None] * (np.array([0.0, 0.0, -G]) - a)
        vector = np.cross(found.at - found.joint, force).sum(axis=0)
        pin.computeJointJacobians(model, data, own)
        for name in [name for name in JOINTS if name.startswith("lumbar")]:
            joint = model.getJointId(name)
            column = model.joints[joint].idx_v
            J = pin.getJointJacobian(model, data, joint, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
            assert J[3:, column] @ vector == pytest.approx(-torque[column], abs=1e-2)
        across = np.linalg.norm(vector - (vector @ found.spine) * found.spine)
        expected = compression(across, max(0.0, -force[:, 2].sum()), found.spine[2], 0.05)
        assert moved(found, a, 0.05) == pytest.approx(expected)
        still = compression(found.moment, found.weight, found.upright, 0.05)
        assert moved(found, np.zeros_like(a), 0.05) == pytest.approx(still)


def test_accelerations_are_those_of_a_parabola_and_nothing_is_made_up():
    seen, at = Accelerations(), lambda t: np.array([[1 + t + 2 * t**2, 0.0, -(t**2)]])
    found = [seen.add(0.01 * k, at(0.01 * k)) for k in range(40)]
    assert found[0] is found[9] is None
    for a in found[10:]:
        np.testing.assert_allclose(a, [[4.0, 0.0, -2.0]], atol=1e-6)
    np.testing.assert_allclose(seen.add(0.39, at(0.39)), [[4.0, 0.0, -2.0]], atol=1e-6)  # asked again
    assert seen.add(0.1, at(0.1)) is None  # from another beginning
    noise = np.random.default_rng(2).normal(0, 1e-3, (200, 1, 3))
    seen = Accelerations()
    found = [seen.add(0.01 * k, noise[k]) for k in range(200)]
    assert np.abs([a for a in found if a is not None]).max() < 0.8


def bends_forward(folder, lasts, bend, more, stands=1.0):
    """A person who stands for a second, and bends forward."""
    (folder / "motion").mkdir(parents=True, exist_ok=True)
    at = '[[keyframes]]\nposture = "standing"\nt ='
    bent = f"joints = {{ pelvis_tilt_back_deg = {-bend} }}"
    before = f"{at} {stands}\n" if stands else ""
    keys = f'title = "bend"\n{at} 0\n{before}{at} {stands + lasts}\n{bent}\n'
    (folder / "motion/bend.toml").write_text(keys)
    source = '[[sources]]\nkind = "keyframes"\nhuman = "op"\nfile = "motion/bend.toml"\n'
    return made(folder, person("op") + source + TABLE + more)


def verdicts(cell, until, live=False):
    engine, judge = Engine(cell.model, driven={"op": 0.2}), Judge(cell.bound)
    if live:
        engine.ahead.clear()
    feed = pump(cell.sources, cell.workstation.engine.tick, ahead=looks_ahead(cell.model))
    found = []
    for samples in feed:
        engine.take(samples)
        state = engine.tick() if found else engine.start()
        (result,) = judge(state)
        found.append((state.t, result))
        if state.t >= until:
            return found
    return found


@pytest.mark.parametrize("load", [1, 4])
def test_a_motion_that_is_called_slow_and_is_not_is_never_within(tmp_path, load):
    more = f"load = {load}\nslow = true\n"
    slow = verdicts(bends_forward(tmp_path / "slow", 4.0, 10, more), 5.0)
    assert {result.verdict for _, result in slow} == {Verdict.WITHIN}
    quick = verdicts(bends_forward(tmp_path / "quick", 0.15, 10, more), 2.0)
    undecided = [result for _, result in quick if result.verdict is Verdict.UNDECIDED]
    assert undecided
    assert all("harder than their weight" in result.reason for result in undecided)
    seldom = verdicts(bends_forward(tmp_path / "seldom", 0.15, 10, f"{more}every = 0.5\n"), 2.0)
    assert Verdict.WITHIN not in {result.verdict for _, result in seldom}
    assert "nobody sees whether it is slow" in seldom[0][1].reason


def test_who_was_not_looked_at_for_a_while_is_not_slow_until_that_is_seen(tmp_path):
    cell = bends_forward(tmp_path, 4.0, 10, "load = 1\nslow = true\n")
    engine, judge = Engine(cell.model), Judge(cell.bound)
    feed = pump(cell.sources, cell.workstation.engine.tick)
    found = []
    for samples in feed:
        engine.take(samples)
        state = engine.tick() if found else engine.start()
        looked = not 1.0 < state.t < 1.5
        found.append((state.t, judge(state)[0] if looked else None))
        if state.t >= 2.0:
            break
    after = [result for t, result in found if t >= 1.5]
    assert [result.verdict for result in after[:5]] == [Verdict.UNDECIDED] * 5
    assert "not seen throughout the last 0.1 s" in after[0].reason
    assert {result.verdict for result in after[15:]} == {Verdict.WITHIN}


def test_at_first_a_file_says_whether_it_is_slow_and_nobody_does_of_who_is_heard_live(tmp_path):
    """A person who bends from the first instant on, with the motion known ahead, and as heard live."""
    more = "load = 1\nslow = true\n"
    for name, lasts, first in (("slow", 4.0, Verdict.WITHIN), ("quick", 0.12, Verdict.UNDECIDED)):
        cell = bends_forward(tmp_path / name, lasts, 10, more, stands=0.0)
        assert {result.verdict for _, result in verdicts(cell, 0.05)} == {first}, name
        heard = verdicts(cell, 0.5, live=True)
        assert {result.verdict for t, result in heard if t < 0.095} == {Verdict.UNDECIDED}
        assert "not seen throughout the last 0.1 s" in heard[0][1].reason
    assert {result.verdict for _, result in verdicts(cell, 0.05)} == {Verdict.UNDECIDED}
    assert looks_ahead(cell.model) == {"op": WINDOW}


def test_what_accelerations_bring_over_the_limit_is_not_within(tmp_path):
    """A bend that presses a few per cent harder than its weight, under a limit that is as near."""

    def bent(name, more):
        cell = bends_forward(tmp_path / name, 2.0, 10, f"load = 1\nslow = true\n{more}")
        return [result for _, result in verdicts(cell, 3.0)]

    far = bent("far", "")
    assert {result.verdict for result in far} == {Verdict.WITHIN}
    most = max(result.interval[1] for result in far)
    near = bent("near", f"limit = {1.001 * most:.6g}\n")
    open_ = [result for result in near if result.verdict is not Verdict.WITHIN]
    assert 0 < len(open_) < len(near) / 2
    assert all("harder than their weight" in result.reason for result in open_)
