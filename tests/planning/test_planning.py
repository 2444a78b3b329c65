"""Paths that keep a distance: against dense sampling, closed forms, and a wall without a door."""

from itertools import pairwise

import numpy as np
import pytest

import seerob
from made_cell import TABLE_ON_AXIS
from seerob.core.errors import InputError
from seerob.kernels import ways
from seerob.session.planning.clearance import Clearance
from seerob.session.planning.plan import NoPath, Stopped, plan

LINK = """
<link name="{0}"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><origin xyz="0.25 0 0" rpy="0 1.5707963267948966 0"/>
<geometry><cylinder radius="0.02" length="0.5"/>
</geometry></collision></link>"""
JOINT = """
<joint name="{0}" type="revolute"><parent link="{1}"/><child link="{2}"/>
<origin xyz="{3} 0 0"/><axis xyz="0 0 1"/>
<limit lower="-3" upper="3" effort="1" velocity="1"/></joint>"""
ARM = (
    '<robot name="arm"><link name="base"/>'
    + LINK.format("upper")
    + LINK.format("fore")
    + JOINT.format("a", "base", "upper", 0)
    + JOINT.format("b", "upper", "fore", 0.55)
    + "</robot>"
)
CELL = """
[[robots]]
name = "arm"
model = "arm.urdf"
q = [-1.2, 0.0]

[[parts]]
name = "post"
shape = {{ sphere = 0.1 }}
at = {{ position = [{x}, 0.0, 0.0] }}
"""


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    folder = tmp_path_factory.mktemp("cell")
    (folder / "arm.urdf").write_text(ARM, encoding="utf-8")
    (folder / "workstation.toml").write_text(CELL.format(x=0.8), encoding="utf-8")
    return seerob.load(folder).model


def dense(clearance, path):
    return min(
        clearance.nearest(a + x * (b - a)).distance for a, b in pairwise(path) for x in np.linspace(0, 1, 200)
    )


def test_distance_is_that_of_a_stretched_arm_to_a_ball(model):
    clearance = Clearance(model, model.robot("arm"), np.array([-1.2, 0.0]))
    near = clearance.nearest(np.array([np.pi / 2, 0.0]))
    # At a right angle the arm's base end is nearest: 0.8 m less the ball and half the thickness.
    assert near.distance == pytest.approx(0.8 - 0.1 - 0.02, abs=2e-3)
    assert near.what == "arm/upper ↔ post"


def test_a_way_that_is_called_clear_is_clear_everywhere_on_it(model):
    clearance = Clearance(model, model.robot("arm"), np.array([-1.2, 0.0]))
    random, told = np.random.default_rng(1), []
    for _ in range(60):
        a, b = random.uniform(-2, 2, (2, 2))
        clear = clearance.clear(a, b, 0.03)
        truth = dense(clearance, [a, b])
        told.append((clear, truth))
        if clear:
            assert truth >= 0.03
            assert clearance.least(a, b) <= truth + 1e-9
            assert clearance.least(a, b) >= truth - 0.02
        else:
            # It gives up only what is nearer than the margin and what moves by a resolution.
            assert truth < 0.03 + 2e-3
    assert {clear for clear, _ in told} == {True, False}


def test_what_is_asked_by_whether_is_what_distances_say(model):
    """One posture, and many in one call."""
    clearance = Clearance(model, model.robot("arm"), np.array([-1.2, 0.0]))
    postures = np.random.default_rng(2).uniform(-2, 2, (200, 2))
    clear = [clearance.is_clear(q, 0.03) for q in postures]
    assert clear == [not clearance.fault(q, 0.03) for q in postures]
    assert set(clear) == {True, False}
    for a, b in pairwise(postures):
        looked = [a + x * (b - a) for x in np.linspace(0, 1, 400)]
        if not clearance.sampled(a, b, 0.03) or not all(clearance.is_clear(q, 0.03) for q in looked):
            assert not clearance.clear(a, b, 0.03)


def test_what_is_clear_at_postures_only_is_searched_again_by_proven_ways(model, monkeypatch):
    """Somebody who looks at the middle and the end of ways alone goes straight through the post."""
    monkeypatch.setattr("seerob.session.planning.clearance.SPACING", 100.0)
    monkeypatch.setattr("seerob.session.planning.plan.SPACING", 100.0)
    clearance = Clearance(model, model.robot("arm"), np.array([-1.2, 0.0]))
    assert clearance.sampled(np.array([-1.2, 0.0]), np.array([1.8, 0.0]), 0.03)
    found = plan(model, "arm", [[1.8, 0.0]], margin=0.03, seed=3)
    assert len(found.q) > 2
    assert 0.03 <= found.least <= dense(clearance, found.q) + 1e-9


def test_the_path_goes_around_keeps_the_margin_and_is_the_same_again(model):
    found = plan(model, "arm", [[1.2, 0.0]], margin=0.03, seed=3)
    assert len(found.q) > 2
    clearance = Clearance(model, model.robot("arm"), found.q[0])
    np.testing.assert_array_equal(found.q[[0, -1]], [[-1.2, 0.0], [1.2, 0.0]])
    assert 0.03 <= found.least <= dense(clearance, found.q) + 1e-9
    np.testing.assert_array_equal(plan(model, "arm", [[1.2, 0.0]], margin=0.03, seed=3).q, found.q)
    lengths = np.linalg.norm(np.diff(found.q, axis=0), axis=1)
    assert lengths.sum() < 4 * 2.4
    text = found.toml()
    assert text.count("[[waypoints]]") == len(found.q)
    # Of arrays that lie otherwise in memory it would be compiled anew, for seconds.
    assert len(ways.is_clear.signatures) == 1


def test_a_way_that_is_free_is_taken_straight(model):
    found = plan(model, "arm", [[-2.0, 0.3], [-2.5, 0.0]])
    np.testing.assert_array_equal(found.q, [[-1.2, 0.0], [-2.0, 0.3], [-2.5, 0.0]])


def test_what_cannot_be_is_said_all_at_once(model):
    with pytest.raises(InputError) as caught:
        plan(model, "arm", [[0.0, 0.0], [4.0, 0.0], [1.0]], margin=0.03)
    assert [p.key for p in caught.value.problems] == ["goal 2", "goal 3"]
    with pytest.raises(InputError, match=r"goal 1: .*arm/\w+ ↔ post"):
        plan(model, "arm", [[0.0, 0.0]], margin=0.03)
    with pytest.raises(InputError, match="missing"):
        plan(model, "arm", [])


def test_it_stops_when_asked_and_does_not_claim_that_there_is_no_path(model):
    with pytest.raises(Stopped):
        plan(model, "arm", [[1.2, 0.0]], margin=0.03, say=lambda tried: True)
    with pytest.raises(NoPath, match="that there is none is not known"):
        plan(model, "arm", [[1.2, 0.0]], margin=0.03, seconds=1e-9)


def test_the_planned_file_is_a_motion_that_keeps_the_margin(model, tmp_path):
    from seerob.devices.sources.waypoints import Waypoints
    from seerob.session.opening import target

    found = plan(model, "arm", [[1.2, 0.0]], margin=0.03, seed=3)
    (tmp_path / "planned.toml").write_text(found.toml(), encoding="utf-8")
    source = Waypoints(
        robot="arm",
        file="planned.toml",
        joint_speed=1.0,
        joint_acceleration=2.0,
        joint_jerk=20.0,
        period=0.02,
    )
    opened = source.open(tmp_path, target(model, "arm"))
    clearance = Clearance(model, model.robot("arm"), found.q[0])
    assert min(clearance.nearest(np.array(s.q)).distance for s in opened.samples) >= 0.03 - 1e-6


CARRIED = (
    TABLE_ON_AXIS
    + """[[robots]]
name = "arm"
model = "arm.urdf"
on = "table"
base = { position = [0.1, 0, 0.05], rpy_deg = [20, 0, 30] }
q = [0.1, 0.2]
[[tools]]
name = "stick"
on = "arm/l3"
shape = { cylinder = [0.02, 0.2] }
mass = 0.8
at = { position = [0, 0.05, 0.1] }
[[parts]]
name = "ball"
shape = { sphere = 0.1 }
at = { position = [2.6, 0.3, 0.5] }
"""
)
FOLLOWING = """<robot name="arm"><link name="base"/>{links}
<joint name="j1" type="revolute"><parent link="base"/><child link="l1"/><origin xyz="0 0 0.3"/>
<axis xyz="0 0.6 0.8"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
<joint name="j2" type="prismatic"><parent link="l1"/><child link="l2"/>
<origin xyz="0.55 0 0" rpy="0.1 0.2 0.3"/><axis xyz="1 0 0"/>
<limit lower="0" upper="0.5" effort="1" velocity="1"/></joint>
<joint name="j3" type="revolute"><parent link="l2"/><child link="l3"/>
<origin xyz="0.55 0 0"/><axis xyz="0 0 1"/>
<mimic joint="j1" multiplier="0.5" offset="0.1"/>
<limit lower="-3" upper="3" effort="1" velocity="1"/></joint></robot>"""


def test_a_robot_that_slides_follows_and_is_carried_is_where_mujoco_has_it(tmp_path):
    """The distance that is found at MuJoCo's poses is where clear ends, to rounding."""
    links = "".join(LINK.format(f"l{k}") for k in (1, 2, 3))
    (tmp_path / "arm.urdf").write_text(FOLLOWING.format(links=links), encoding="utf-8")
    (tmp_path / "workstation.toml").write_text(CARRIED, encoding="utf-8")
    model = seerob.load(tmp_path).model
    places = {"axis": np.array([0.7]), "table": np.array([0.4])}
    clearance = Clearance(model, model.robot("arm"), np.array([0.1, 0.2]), places=places)
    random, seen = np.random.default_rng(3), set()
    for _ in range(40):
        q = random.uniform([-1.5, 0.0], [1.5, 0.5])
        near = clearance.nearest(q)
        own = clearance.nearest(q, own=True)
        if own is not None and own.distance < 0.01:
            continue
        assert clearance.is_clear(q, near.distance - 1e-9)
        assert not clearance.is_clear(q, near.distance + 1e-9)
        assert clearance.least(q) == pytest.approx(near.distance, abs=1e-9)
        seen.add(near.what)
    assert len(seen) > 1
