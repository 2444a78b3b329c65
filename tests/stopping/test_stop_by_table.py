"""Stopping tables carried over to the parts that a robot moves: levers, extension, coupling, payload."""

from __future__ import annotations

import numpy as np
import pytest

from made_cell import FLOATING, TWO_R, made, results_at, state_at, two_r
from seerob.criteria.stopping.models import Stop, bind_stop
from seerob.criteria.stopping.table import JointStop, StoppingTable

V = np.hypot(2, 0.05)
"""Farthest that a corner of the stretched arm is from its base [m]."""
WAY, TIME = 0.4, 0.3


def joint(j, way=WAY, time=TIME, **more):
    return JointStop(joint=j, full_speed=3.0, way=(((way,),),), time=(((time,),),), **more)


def table(*joints, **more):
    head = {"robot": "arm", "category": 1, "source": "s", "confidence": "1S", "rated_payload": 5.0}
    return StoppingTable(**{**head, "joints": joints, **more})


def bound(folder, its, *, urdf=None, more="", at="", **options):
    text = FLOATING + TWO_R + at + more
    text += '[[parts]]\nname = "wall"\nshape = { box = [0.1, 1, 1] }\nat = { position = [9, 0, 0] }\n'
    cell = made(folder, text, {"arm.urdf": urdf or two_r()})
    robot = cell.model.robot("arm")
    gap = cell.model.gap(cell.model.select("wall"), robot.moving)
    stop = Stop(acceleration=0.0, reaction=0.1, model="table", table=its, **options)
    return cell, bind_stop(stop, cell.model, robot, gap)


def course(folder, its, q, qd, scale=1.0, **more):
    cell, stop = bound(folder, its, **more)
    return stop.courses(state_at(cell, arm=(q, qd)))(scale)


@pytest.mark.parametrize("scale", [1.0, 0.5])
@pytest.mark.parametrize("qd", [1.0, -1.0])
def test_a_part_as_round_as_a_ball_reaches_its_radius_farther(tmp_path, scale, qd):
    """Balls of 0.2 m in the middle of the links: 0.7 and 1.7 m; while reacting, and 0.3 s at full speed."""
    urdf = two_r().replace('box size="1 0.1 0.1"', 'sphere radius="0.2"')
    found = course(tmp_path, table(joint(0), joint(1)), (0.0, 0.0), (qd, 0.0), scale, urdf=urdf)
    arms = np.array([0.7, 1.7])
    np.testing.assert_allclose(found.v_r, scale * arms)
    np.testing.assert_allclose(found.S_r, scale * 0.1 * arms)
    np.testing.assert_allclose(found.S_s, scale * TIME * arms)
    assert found.T_s == TIME


def test_what_a_surface_may_stick_out_is_on_every_lever(tmp_path):
    visual = '<visual><origin xyz="0.5 0 0"/><geometry><box size="1.04 0.14 0.14"/></geometry></visual>'
    urdf = two_r().replace("</collision></link>", f"</collision>{visual}</link>")
    cell, stop = bound(tmp_path, table(joint(0), joint(1)), urdf=urdf)
    found = stop.courses(state_at(cell, arm=((0.0, 0.0), (1.0, 0.0))))(1.0)
    out = cell.model.bodies[cell.model.robot("arm").moving[1]].deviation
    assert out > 0.019
    assert found.S_s[1] == pytest.approx(TIME * (V + out))


@pytest.mark.parametrize(("q2", "share"), [(0.0, 1.0), (np.pi / 2, np.sqrt(0.5))])
def test_extension_is_how_far_the_flange_is_from_the_first_axis(tmp_path, q2, share):
    """From an axis at x = 0.3, whatever its height; above it, at half a metre, it is no farther."""
    one = JointStop(
        joint=0, full_speed=3.0, extension=(0.5, 1.0), way=(((0.01, 0.05),),), time=(((0.1, 0.5),),)
    )
    urdf = two_r().replace('link="tip"/><origin xyz="1 0 0"/>', 'link="tip"/><origin xyz="1 0 0.5"/>')
    assert "0.5" in urdf.rpartition("tip")[2]
    place = "base = { position = [0.3, 0, 0] }\n"
    found = course(tmp_path, table(one, reach=2.0), (0.0, q2), (1.0, 0.0), urdf=urdf, at=place)
    assert found.T_s == pytest.approx(0.1 + 0.4 * (share - 0.5) / 0.5)


def test_a_joint_that_another_turns_the_other_way_adds_to_the_way(tmp_path):
    urdf = two_r(mimic='<mimic joint="j1" multiplier="-1" offset="0.0"/>')
    found = course(tmp_path, table(joint(0)), [0.0], [1.0], urdf=urdf)
    way = 0.1 + TIME
    outer = way * np.hypot(1, 0.05)
    assert found.S_r[1] + found.S_s[1] == pytest.approx(outer + way * (V + outer))


def test_without_a_full_speed_of_its_own_the_robots_holds(tmp_path):
    """10 rad/s: at 5 it is half of it."""
    one = JointStop(
        joint=0, speed=(0.25, 1.0), way=(((9.0,),), ((9.0,),)), time=(((0.1,),), ((0.4,),))
    )  # fmt: skip
    assert course(tmp_path / "a", table(one), (0.0, 0.0), (5.0, 0.0)).T_s == pytest.approx(0.2)


@pytest.mark.parametrize("of_the_file", [True, False])
def test_a_speed_limit_of_0_says_nothing_of_full_speed(tmp_path, of_the_file):
    """Some descriptions write 0 for unknown: a share of it would be any, and the stop nobody's figure."""
    one = JointStop(joint=0, speed=(1.0,), way=(((9.0,),),), time=(((0.4,),),))
    said = {"at": "velocity_limits = [0, 1]\n"} if of_the_file else {}
    urdf = two_r() if of_the_file else two_r().replace('velocity="10"', 'velocity="0"')
    found = course(tmp_path / "moves", table(one), (0.0, 0.0), (5.0, 0.0), urdf=urdf, **said)
    assert "j1: neither the stopping table nor the robot says what full speed" in found.unbounded_reason
    assert course(tmp_path / "stands", table(one), (0.0, 0.0), (0.0, 0.0), urdf=urdf, **said).T_s == 0.0


def payload(folder, mass, its, *, name="t", **options):
    tool = f'[[tools]]\nname = "{name}"\non = "arm/tip"\nshape = {{ sphere = 0.05 }}\nmass = {mass}\n'
    text = FLOATING + TWO_R + tool
    text += (
        '[[humans]]\nname = "op"\nstature = 1.75\nmass = 75\nsex = "male"\nat = { position = [9, 0, 0] }\n'
    )
    text += '[[safety]]\nkind = "separation"\nname = "S"\nbetween = ["arm", "op"]\nintrusion = 0\n'
    text += "human_uncertainty = 0\nrobot_uncertainty = 0\n"
    text += f'stop = {{ acceleration = 0, reaction = 0.1, model = "table", table = "{its}", table_for = "arm"'
    text += "".join(f", {key} = {value}" for key, value in options.items()) + " }\n"
    cell = made(folder, text, {"arm.urdf": two_r()})
    return results_at(cell, arm=((0.0, 0.0), (0.5, 0.0)))["S"]


@pytest.mark.parametrize("name", ["t", "arm/gripper"])
@pytest.mark.parametrize(("mass", "verdict"), [(10.0, "within"), (10.001, "undecided")])
def test_a_table_holds_up_to_its_rated_payload(tmp_path, name, mass, verdict):
    """Whatever the tool is called: one named below the robot is no link of it."""
    assert payload(tmp_path, mass, "ur10_cb3", name=name).verdict == verdict


def inputs(folder, its, **options):
    _, stop = bound(folder, its, **options)
    return {i.name: (i.value, i.unit, i.origin) for i in stop.inputs}, stop


def test_where_the_figures_are_from(tmp_path):
    own, stop = inputs(tmp_path / "own", table(joint(0), joint(1)))
    assert own["rated payload of the stopping table"] == (5.0, "kg", "stated")
    assert own["payload of arm"] == (0.0, "kg", "computed")
    assert "T_s of joints without a table" not in own
    assert stop.undecided_reasons == ()
    assert stop.formula.startswith("S_s from each joint's way")
    assert "the lesser of its first way" in stop.not_modelled[1]
    silent, _ = inputs(tmp_path / "silent", table(joint(0), rated_payload=None), stopping=0.7)
    assert silent["rated payload of the stopping table"] == (None, "kg", "missing")
    assert silent["T_s of joints without a table"] == (0.7, "s", "given")
    said, _ = inputs(tmp_path / "said", table(joint(0), rated_payload=None), rated_payload=3.0)
    assert said["rated payload of the stopping table"] == (3.0, "kg", "given")
    _, stop = inputs(tmp_path / "tool", "ur10_cb3")
    assert stop.formula == "S_s = v_s T_s(v_s)"
    assert "the lesser of its first way" not in stop.not_modelled[1]
    assert stop.undecided_reasons
