"""Contacts act only where the file asks, and a concave part is not its hull."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from made_cell import TWO_R, heard, made, two_r
from seerob.core.errors import InputError
from seerob.twin.engine import Engine

DROP = """<robot name="d"><link name="base"/>
<link name="ball"><inertial><mass value="1"/>
<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/>
</inertial><collision><geometry>{shape}</geometry></collision></link>
<joint name="fall" type="prismatic"><parent link="base"/><child link="ball"/><axis xyz="0 0 1"/>
<limit lower="-9" upper="9" effort="20" velocity="9"/></joint></robot>"""
BALL, BLOCK = '<sphere radius="0.1"/>', '<box size="0.2 0.2 0.2"/>'
FLOOR = '[[parts]]\nname = "floor"\nshape = { box = [2, 2, 0.2] }\nat = { position = [0, 0, -1] }\n'
TOUCH = '[[contacts]]\nbetween = ["{a}", "{b}"]\n'


def fallen(folder, text, shape=BALL, seconds=1.0, files=None):
    station = made(folder, TWO_R + text, {"arm.urdf": DROP.format(shape=shape), **(files or {})})
    engine = Engine(station.model, controllers=False)
    # Contacts of a free fall want the integrator that they were made for.
    engine._mj.opt.integrator = station.model.mj.opt.integrator
    for _ in range(int(seconds * 100)):
        state = engine.tick()
    return state.joint_positions(station.model.robot("arm"))[0], engine


@pytest.mark.parametrize("shape", [BALL, BLOCK])
def test_falls_through_unless_asked_to_touch(tmp_path, shape):
    through, engine = fallen(tmp_path / "through", FLOOR, shape)
    assert through == pytest.approx(-0.5 * 9.81, rel=1e-2)
    assert engine._data.ncon == 0
    height, engine = fallen(tmp_path / "on", FLOOR + TOUCH.format(a="arm", b="floor"), shape)
    assert height == pytest.approx(-0.8, abs=2e-3)
    assert engine._data.ncon > 0


def test_pressed_against_a_part_the_twin_stops_and_says_so(tmp_path):
    reports = {}
    for name, text in (("free", FLOOR), ("asked", FLOOR + TOUCH.format(a="floor", b="arm/ball"))):
        station = made(tmp_path / name, TWO_R + text, {"arm.urdf": DROP.format(shape=BLOCK)})
        engine = Engine(station.model)
        for k in range(150):
            engine.take([heard("arm", 0.01 * k, (-0.01 * k,), (-1.0,))])
            state = engine.tick()
        reports[name] = state.joint_positions(station.model.robot("arm"))[0], state.invalid_reason("arm")
    assert reports["free"] == (pytest.approx(-1.49, abs=1e-2), "")
    assert reports["asked"][0] == pytest.approx(-0.8, abs=0.01)
    assert "torque limit" in reports["asked"][1]


def test_other_pairs_stay_without_contact(tmp_path):
    """Asked for floor 2 only, the ball falls through floor 1."""
    lower = FLOOR.replace('"floor"', '"lower"').replace("-1]", "-2]")
    height, _ = fallen(tmp_path, FLOOR + lower + TOUCH.format(a="arm", b="lower"))
    assert height == pytest.approx(-1.8, abs=2e-3)


def test_pairs_do_not_mix(tmp_path):
    """The arm may touch the lower floor and a post the upper one: the arm falls through the upper one."""
    lower = FLOOR.replace('"floor"', '"lower"').replace("-1]", "-2]")
    post = FLOOR.replace('"floor"', '"post"').replace("-1]", "9]")
    pairs = TOUCH.format(a="arm", b="lower") + TOUCH.format(a="post", b="floor")
    height, _ = fallen(tmp_path, FLOOR + lower + post + pairs)
    assert height == pytest.approx(-1.8, abs=2e-3)


def u_shape():
    """A slot 0.3 m wide along y, 0.5 m deep."""
    solid = trimesh.creation.box((1, 1, 1))
    slot = trimesh.creation.box((0.3, 1.2, 1.0))
    slot.apply_translation((0, 0, 0.5))
    return trimesh.boolean.difference([solid, slot], engine="manifold")


@pytest.mark.parametrize("shape", [BALL, BLOCK])
def test_in_the_slot_of_a_concave_part_nothing_touches_but_its_ground(tmp_path, shape):
    part = '[[parts]]\nname = "u"\nmesh = "u.stl"\nunits = "m"\nup = "z"\nat = { position = [0, 0, -1] }\n'
    stl = u_shape().export(file_type="stl")
    text = part + TOUCH.format(a="arm", b="u")
    station = made(tmp_path, TWO_R + text, {"arm.urdf": DROP.format(shape=shape), "u.stl": stl})
    engine = Engine(station.model)
    touched = []
    # The slot reaches from z = -1 to -0.5; inside the hull of the part all the way down.
    for k in range(90):
        z = -0.01 * k
        engine.take([heard("arm", 0.01 * k, (z,), (-1.0,))])
        engine.tick()
        if engine._data.ncon:
            touched.append(z)
    assert not touched or max(touched) < -0.88
    height, _ = fallen(tmp_path / "ground", text, shape, files={"u.stl": stl})
    assert height == pytest.approx(-0.9, abs=0.01)
    assert any("convex pieces" in finding.text for finding in station.model.findings)


def test_a_robot_never_touches_itself(tmp_path):
    """The folded arm lies in itself; contacts with a far floor change nothing."""
    text = TWO_R + FLOOR + TOUCH.format(a="arm", b="floor")
    station = made(tmp_path, text, {"arm.urdf": two_r()})
    engine = Engine(station.model)
    engine.take([heard("arm", 0.0, (0.0, np.pi))])
    engine.start()
    for _ in range(15):
        state = engine.tick()
        assert engine._data.ncon == 0
    assert not state.invalid_reason("arm")


def test_an_area_is_watched_not_touched(tmp_path):
    area = '[[areas]]\nname = "zone"\non = "arm/ball"\nshape = { box = [1, 1, 1] }\n'
    height, _ = fallen(tmp_path, FLOOR + area + TOUCH.format(a="arm", b="floor"))
    assert height == pytest.approx(-0.8, abs=2e-3)


def test_contacts_can_be_switched_off_for_a_run(tmp_path):
    text = TWO_R + FLOOR + TOUCH.format(a="arm", b="floor")
    station = made(tmp_path, text, {"arm.urdf": DROP.format(shape=BALL)})
    engine = Engine(station.model, controllers=False, contacts=False)
    for _ in range(100):
        state = engine.tick()
    assert state.joint_positions(station.model.robot("arm"))[0] < -4


def test_names_and_number_of_pairs_are_checked(tmp_path):
    with pytest.raises(InputError, match=r"contacts\[0\]\.between\[1\].*'flor'.*did you mean 'floor'"):
        fallen(tmp_path / "name", FLOOR + TOUCH.format(a="arm", b="flor"))
    with pytest.raises(InputError, match="32 pairs; give at most 31"):
        fallen(tmp_path / "many", FLOOR + TOUCH.format(a="arm", b="floor") * 32)
