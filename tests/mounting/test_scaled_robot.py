"""A robot of another size moves like the one that exists, only slower: MuJoCo's dynamics are the judge."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

import seerob as sr
from seerob.core.errors import InputError
from seerob.core.snapshot import Origin
from seerob.description.description import Description, Inertial, Joint, JointKind, Link, Mimic, Quantity
from seerob.description.robots.scaled import scaled

ROBOT = 'title = "one robot"\n[[robots]]\nname = "arm"\nmodel = "library:ur10"\n'


def station(folder, text=""):
    folder.mkdir()
    (folder / "workstation.toml").write_text(ROBOT + text)
    return sr.load(folder)


@pytest.mark.parametrize("scale", [10.0, 0.3])
def test_the_same_motion_in_the_time_of_froude_takes_the_torques_of_froude(tmp_path, scale):
    real = station(tmp_path / "real").model
    large = station(tmp_path / "large", f"scale = {scale}\n").model
    rng = np.random.default_rng(5)
    n = real.mj.nv
    for _ in range(5):
        q, qd, qdd = rng.uniform(-1, 1, (3, n))
        found = []
        for model, time in ((real, 1.0), (large, scale**0.5)):
            data = mujoco.MjData(model.mj)
            data.qpos, data.qvel, data.qacc = q, qd / time, qdd / time**2
            mujoco.mj_inverse(model.mj, data)
            tip = model.mechanisms["arm"].tip
            found.append((data.qfrc_inverse.copy(), data.xpos[tip.mj].copy(), data.xmat[tip.mj].copy()))
        (torque, place, turn), (torque_large, place_large, turn_large) = found
        np.testing.assert_allclose(torque_large, scale**4 * torque, rtol=1e-9, atol=1e-9 * scale**4)
        np.testing.assert_allclose(place_large, scale * place, atol=1e-12 * scale)
        np.testing.assert_allclose(turn_large, turn, atol=1e-12)


def test_shapes_and_limits_follow_and_the_findings_say_that_there_is_no_such_robot(tmp_path):
    real, large = station(tmp_path / "real"), station(tmp_path / "large", "scale = 10\n")
    for small, big in zip(real.model.bodies, large.model.bodies, strict=True):
        np.testing.assert_allclose(big.corners, 10 * small.corners, rtol=1e-12)
        assert big.radius == pytest.approx(10 * small.radius)
    (small,), (big,) = real.workstation.robots, large.workstation.robots
    assert (small.scale, big.scale) == (1, 10)
    assert [f for f in large.scene().findings if "does not exist" in f.text and f.level == "warning"]
    assert not [f for f in real.scene().findings if "does not exist" in f.text]


@pytest.mark.parametrize("origin", Origin)
def test_what_nobody_knows_of_the_real_one_is_known_no_better(origin):
    inertial = Inertial(1.0, np.zeros(3), np.eye(3), origin, "somebody")
    joint = Joint("j", JointKind.REVOLUTE, np.array([0, 0, 1.0]), effort=Quantity(5.0, origin, "somebody"))
    link = Link("l", None, np.eye(4), joints=(joint,), inertial=inertial)
    (large,) = scaled(Description("r", (link,), "l", "a file"), 2.0, name="r").links
    unknown = origin in (Origin.ASSUMED, Origin.MISSING, Origin.ESTIMATED, Origin.CHOICE)
    expected = origin if unknown else Origin.COMPUTED
    assert large.inertial.origin == large.joints[0].effort.origin == expected


@pytest.mark.parametrize("text", ["scale = 10\nreal = true\n", "scale = 0\n", "scale = 1e9\n"])
def test_what_contradicts_itself_is_refused(tmp_path, text):
    with pytest.raises(InputError, match="scale"):
        station(tmp_path / "cell", text)


@pytest.mark.parametrize(("scale", "told"), [(1.0, False), (0.5, True), (2.0, False)])
def test_what_it_is_rated_for_follows_too(tmp_path, scale, told):
    """6 kg are fewer than the 10 kg of a UR10, and more than the 1.25 kg of half of one."""
    load = '[[tools]]\nname = "load"\non = "arm/tool0"\nshape = { box = [0.1, 0.1, 0.1] }\nmass = 6\n'
    findings = station(tmp_path / "cell", f"scale = {scale}\n{load}").model.findings
    assert bool([f for f in findings if "6 kg of 1.25 kg" in f.text and f.holds]) == told


@pytest.mark.parametrize(
    ("leads", "follows", "per"),
    [
        ("PRISMATIC",) * 2 + (1,),
        ("REVOLUTE",) * 2 + (1,),
        ("REVOLUTE", "PRISMATIC", 3),
        ("PRISMATIC", "REVOLUTE", 1 / 3),
    ],
)
def test_what_follows_another_joint_goes_as_far_for_its_size(leads, follows, per):
    """A finger that slides by 0.1 m per radian slides by 0.3 m of one that is three times as large."""
    axis = np.array([0, 0, 1.0])
    led = Joint("b", JointKind[follows], axis, mimic=Mimic("a", 0.1, 0.02))
    links = (
        Link("base", None, np.eye(4)),
        Link("l", "base", np.eye(4), joints=(Joint("a", JointKind[leads], axis),)),
        Link("m", "l", np.eye(4), joints=(led,)),
    )
    mimic = scaled(Description("r", links, "m", "somebody"), 3.0, name="r").links[2].joints[0].mimic
    offset = 0.06 if follows == "PRISMATIC" else 0.02
    assert (mimic.multiplier, mimic.offset) == (pytest.approx(0.1 * per), pytest.approx(offset))
