"""Bounds between two ticks on random cells: no instant that is looked at there is worse than the bound."""

from __future__ import annotations

import os
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from random_cells import files, random_cell

from made_cell import TWO_R, made, person, two_r
from seerob.core.snapshot import Verdict
from seerob.criteria.between_ticks import SpanResult
from seerob.files.trajectories.path_map import (
    GIVEN,
    PERMISSIBLE,
    PIECE,
    TOOL,
    TOOL_GIVEN,
    TOOL_PERMISSIBLE,
    WHO,
    WHY,
    joint_columns,
)
from seerob.session.run import Judge, engine_of, looks_ahead, pump, ticks
from seerob.session.station import load
from seerob.twin.joint_torques import bind_needed_in_span
from seerob.twin.spans import Points
from worst_between import worst_found

JOINT = (
    "{{ joint = {j}, full_speed = 50.0, speed = [0.1, 0.5, 1.0], extension = [0.5, 1.0], "
    "way = [[[0.05, 0.06]], [[0.2, 0.25]], [[0.5, 0.7]]], "
    "time = [[[0.05, 0.06]], [[0.15, 0.2]], [[0.3, 0.4]]] }}"
)
OTHERS = frozenset({"speed", "fastest", "distance", "separation", "area", "felt", "contact", "posture"})


def by_table(name, joints, stop, more=""):
    """Separation of an arm of which each joint stops by a table."""
    table = (
        '{ robot = "arm", category = 0, source = "s", confidence = "1S", rated_payload = 50.0, reach = 4.0, '
        f"joints = [{', '.join(JOINT.format(j=j) for j in range(joints))}] }}"
    )
    return (
        f'[[safety]]\nkind = "separation"\nname = "{name}"\nbetween = ["arm", "op"]\n'
        f'stop = {{ reaction = 0.1, model = "table", table = {table}{stop} }}\n'
        f"intrusion = 0\nhuman_uncertainty = 0\nrobot_uncertainty = 0\n{more}"
    )


def map_of(cell, rng):
    """A map of the way that the arm goes, with a permissible speed of its own at each place."""
    units = ["rad" if link.kind == "revolute" else "m" for link in cell.links]
    t = np.linspace(-0.01, cell.duration + 0.01, 200)[:, None]
    q = cell.amplitude * np.sin(cell.frequency * t + cell.phase)
    fastest = float(np.linalg.norm(cell.amplitude * cell.frequency))
    return map_csv(units, [(*row, fastest * rng.uniform(1.2, 2)) for row in q.tolist()])


def map_csv(units, places):
    """A map of places: positions of the joints, and the path speed that is permitted there."""
    head = (PIECE, *joint_columns(units), PERMISSIBLE, GIVEN, TOOL_PERMISSIBLE, TOOL_GIVEN, *TOOL, *WHO, WHY)
    rows = ((0, *q, v, 1, v, 1, 0, 0, 0, "w", "", "", "", "") for *q, v in places)
    return "\n".join(",".join(map(str, row)) for row in (head, *rows)) + "\n"


def bounded(seed):
    """A random cell whose criteria are within almost throughout, and the files of its workstation."""
    rng = np.random.default_rng(seed)
    cell = random_cell(seed, published=False, around=False)
    turn = rng.uniform(-np.pi, np.pi)
    more = by_table("held", len(cell.links), ", acceleration = 0") + by_table("ahead", len(cell.links), "")
    more += by_table("ever", len(cell.links), ", acceleration = 0", 'mode = "fixed"\n')
    for name in ("held", "ahead", "ever"):
        more += f'[[safety]]\nkind = "separation_area"\nname = "around {name}"\n'
        more += f'separation = "{name}"\nof = "op"\n'
    more += '[[safety]]\nkind = "path_speed"\nname = "path"\nrobot = "arm"\nmap = "map.csv"\n'
    more += '[[safety]]\nkind = "force_polytope"\nname = "force"\nat = "arm"\nlimit = 1e7\n'
    more += '[[safety]]\nkind = "force_polytope"\nname = "bare"\nat = "arm"\nlimit = 1e7\nload = "none"\n'
    cell = replace(
        cell,
        person=np.array([12 * np.cos(turn), 12 * np.sin(turn), turn]),
        mass_tolerance=0.2,
        limits={**cell.limits, "energy": 1e5},
        physics=bool(seed % 2),
        more=more,
        left_out=OTHERS,
        machine=None,
    )
    made = files(cell)
    made["workstation.toml"] = made["workstation.toml"].replace(
        "mass_tolerance = 0.2\n", "mass_tolerance = 0.2\ncom_tolerance = 0.02\n"
    )
    return {**made, "map.csv": map_of(cell, rng)}


@pytest.mark.parametrize("seed", [1, 8, 9])
def test_no_bound_is_beaten_by_what_is_met_between_two_ticks(tmp_path, seed):
    for name, text in bounded(seed).items():
        (tmp_path / name).write_text(text)
    room = worst_found(load(tmp_path), looks=3)
    # An arm of two joints can press with any force in some direction: that exceeds every limit.
    around = {"around held", "around ahead", "around ever"}
    assert set(room) - {"force", "bare"} == {"energy", "held", "ahead", "ever", "path", *around}
    for name, found in room.items():
        assert min(found) >= -1e-9, name
        assert np.isfinite(found).mean() > 0.5, name  # it bounds something


STOPS = (
    "stop = { reaction = 0.1, stopping = 0.2 }",
    "stop = { reaction = 0.1, stopping = 0.3, acceleration = 2.0 }",
    'stop = { reaction = 0.2, model = "constant_deceleration", deceleration = 4.0, acceleration = 0.0 }',
)


def risen(station, looks):
    """By separation, how far the bound on how S_p rises is above what it does between each two ticks [m].

    S_p is that of the results, at many instants; the largest against the least of them or, where what is
    known ahead is in it, against that at both ends, where both are within. And how far it does rise.
    """
    model, room, most = station.model, {}, {}
    judge = Judge(station.bound)
    between = judge._between

    def watching(i, watch, ends, state):
        path, own = between._way, watch.criterion
        if ends[0].margin is None or ends[1].margin is None:
            return SpanResult()
        bound = own.rises(model)(between._span(path, ends, state))
        S_p = []
        for t in np.union1d(np.linspace(path.t[0], path.t[-1], looks), path.t).tolist():
            result, _, _ = between._look(i, watch, path, t, state)
            S_p.append([part.limit for part in result.parts if part.verdict is not None])
        S_p = np.array(S_p)
        rise = S_p.max(axis=0) - (S_p[[0, -1]].max(axis=0) if own.lasts(model) else S_p.min(axis=0))
        room.setdefault(own.name, []).append(float((bound - rise).min()))
        most[own.name] = max(most.get(own.name, 0.0), float(rise.max()))
        return SpanResult()

    between._judge = watching
    engine, ahead = engine_of(model), looks_ahead(model)
    for _ in ticks(engine, judge, pump(station.sources, station.workstation.engine.tick, ahead=ahead)):
        pass
    return room, most


def rising(folder, seed, looks):
    """Separations of a random arm and a person who reaches, by stops that follow from present speeds."""
    rng = np.random.default_rng(seed)
    cell = random_cell(seed, published=False, around=False)
    turn, more = rng.uniform(-np.pi, np.pi), ""
    for k, stop in enumerate(STOPS):
        for name, speed in (("", ""), (" slow", "human_speed = 0.05\n")):
            more += f'[[safety]]\nkind = "separation"\nname = "{k}{name}"\nbetween = ["arm", "op"]\n{stop}\n'
            more += f"intrusion = 0\nhuman_uncertainty = 0\nrobot_uncertainty = 0\n{speed}"
    far = np.array([12 * np.cos(turn), 12 * np.sin(turn), turn])
    cell = replace(
        cell, person=far, physics=bool(seed % 2), more=more, left_out=OTHERS | {"energy"}, machine=None,
        mass_tolerance=0.0,
    )  # fmt: skip
    for name, text in files(cell).items():
        (folder / name).write_text(text)
    return risen(load(folder), looks)


# Of the latter, S_p hangs on no speed for a while (half a metre whatever they are), and then on them again.
@pytest.mark.parametrize(("seed", "looks"), [(3, 4), (11, 20)])
def test_s_p_rises_between_two_ticks_by_no_more_than_its_bound(tmp_path, seed, looks):
    room, most = rising(tmp_path, seed, looks=looks)
    assert len(room) == 2 * len(STOPS)
    assert max(most.values()) > 1e-3
    for name, found in room.items():
        assert min(found) >= -1e-9, name


@pytest.mark.soak
def test_s_p_of_many_cells_rises_between_two_ticks_by_no_more_than_its_bound(tmp_path):
    for seed in range(int(os.environ.get("SEEROB_SOAK_CELLS", "40"))):
        (tmp_path / f"{seed}").mkdir()
        room, _ = rising(tmp_path / f"{seed}", seed, looks=50)
        for name, found in room.items():
            assert min(found) >= -1e-9, (seed, name)


def masses_of(seed):
    """Effective masses of a random arm that swings from rest or on: along its motion and the heaviest."""
    rng = np.random.default_rng(seed)
    cell = random_cell(seed, published=False, around=False)
    more = "".join(
        f'[[safety]]\nkind = "effective_mass"\nname = "{along}"\nat = "arm"\nalong = "{along}"\n'
        f"limit = 1e4\noffset = {rng.normal(0, 0.1, 3).tolist()}\n"
        for along in ("motion", "worst")
    )
    more += '[[safety]]\nkind = "point_energy"\nname = "at a point"\nat = "arm"\nlimit = 1e4\n'
    return files(
        replace(
            cell, physics=bool(seed % 2), more=more, machine=None, mass_tolerance=0.0,
            left_out=OTHERS | {"energy"},
        )
    )  # fmt: skip


@pytest.mark.parametrize("seed", [2, 3, 5])
def test_no_effective_mass_between_two_ticks_is_above_its_bound(tmp_path, seed):
    for name, text in masses_of(seed).items():
        (tmp_path / name).write_text(text)
    room = worst_found(load(tmp_path), looks=3)
    assert set(room) <= {"motion", "worst", "at a point"}
    assert {"motion", "at a point"} <= set(room)
    assert np.isfinite(room["at a point"]).mean() > 0.3
    for name, found in room.items():
        assert min(found) >= -1e-9, name
    assert np.isfinite(room["motion"]).mean() > 0.3


def needed_between(station):
    """How far each torque that the motion needs between two ticks is inside of its bounds [N·m]."""
    model, robot, room = station.model, station.model.robot("arm"), []
    points = Points(model)
    bound = bind_needed_in_span(model, robot, points)
    data, stepped = mujoco.MjData(model.mj), model.workstation.engine.physics

    def look(state):
        path = state.path
        if path is None:
            return ()
        span = points.span(path, *path.t[[0, -1]], state.attachments.ids, model.mj)
        torques, off = bound(state, span)
        least, most = torques.min(axis=0) - off, torques.max(axis=0) + off
        for t in np.linspace(path.t[0], path.t[-1], 23)[1:-1].tolist():
            k = np.searchsorted(path.t, t) - 1
            before, after = (path.at(t + h)[1] for h in (-1e-6, 1e-6))
            data.qacc[:] = np.diff(path.v[k : k + 2], axis=0)[0] / np.diff(path.t[k : k + 2])
            if not stepped:
                data.qacc[:] = (after - before) / 2e-6
            data.qpos[:], data.qvel[:] = path.at(t)
            mujoco.mj_fwdPosition(model.mj, data)
            mujoco.mj_fwdVelocity(model.mj, data)
            tau = np.empty(model.mj.nv)
            mujoco.mj_rne(model.mj, data, 1, tau)
            tau += model.mj.dof_armature * data.qacc
            there = robot.coupling.T @ tau[robot.v_address]
            room.extend([most - there, there - least])
        return ()

    for _ in ticks(engine_of(model), look, pump(station.sources, model.workstation.engine.tick)):
        pass
    return np.array(room)


@pytest.mark.parametrize("seed", [2, 3])
def test_no_torque_that_a_motion_needs_between_two_ticks_is_above_its_bound(tmp_path, seed):
    for name, text in masses_of(seed).items():
        (tmp_path / name).write_text(text.replace("gravity = [0, 0, 0]", ""))
    room = needed_between(load(tmp_path))
    assert room.min() >= -1e-6
    assert np.isfinite(room).all()


# -- and what exceeds between two ticks is not within ---------------------------------------------

BUMP = 0.105
"""Middle between two ticks [s], about which a joint is faster for 8 ms."""


def bumped(share):
    """A log of an arm that turns at 1 rad/s, and by a share faster between two ticks."""
    t = np.arange(0, 0.3, 0.001)
    qd = 1 + share * np.maximum(0, 1 - np.abs(t - BUMP) / 0.004)
    q = np.concatenate([[0], np.cumsum((qd[1:] + qd[:-1]) / 2 * np.diff(t))])
    lines = ["t [s],j1 [rad],j2 [rad],qd_j1 [rad/s],qd_j2 [rad/s]"]
    return "\n".join([*lines, *(f"{a:.4f},{b:.12g},0,{c:.12g},0" for a, b, c in zip(t, q, qd, strict=True))])


def swinging(folder, what, share, figure):
    """What is said of the arm that log moves, of a figure: a limit [J], or where the person stands [m]."""
    text = "[engine]\nphysics = false\ngravity = [0, 0, 0]\n" + TWO_R
    text += 'mass_tolerance = 0.1\nrotor_inertia = [0.0, 0.0]\n[[sources]]\nkind = "csv"\nrobot = "arm"\n'
    text += 'file = "motion.csv"\n'
    if what == "energy":
        text += f'[[safety]]\nkind = "kinetic_energy"\nname = "c"\nrobot = "arm"\nlimit = {figure}\n'
    elif what == "path":
        text += '[[safety]]\nkind = "path_speed"\nname = "c"\nrobot = "arm"\nmap = "map.csv"\n'
    else:
        own = by_table("c", 2, ", acceleration = 0" if what == "held" else "")
        text += person("op", figure, 0, 0) + own.replace("full_speed = 50.0", "full_speed = 4.0").replace(
            "way = [[[0.05, 0.06]]",
            "way = [[[0.015, 0.02]]",  # no farther than speed times time
        )
    # A place of a thousandth of a radian, which is passed within a millisecond, is to be passed slowly.
    slow = [(q, 0.0, v) for q, v in ((-0.1, 2), (0.1046, 2), (0.105, 0.9), (0.1054, 2), (0.5, 2))]
    kept = {"arm.urdf": two_r(), "map.csv": map_csv(("rad", "rad"), slow), "motion.csv": bumped(share)}
    return made(folder, text, kept).run().results["c"]


@pytest.mark.parametrize("what", ["energy", "held", "ahead", "path"])
def test_what_exceeds_between_two_ticks_is_not_within(tmp_path, what):
    share, figure = 0.6, {"energy": 4.0, "held": 9.0, "ahead": 9.0, "path": 0.0}[what]
    if what == "path":
        share = 0.0
    else:
        steady = swinging(tmp_path / "steady", what, 0.0, figure)
        assert not steady.verdicts[:15].any()  # all within; it ends in motion, and what then is not known
        if what != "energy":
            figure -= float(np.min((steady.values - steady.limits)[:15])) - 0.05
    found = swinging(tmp_path / "bumped", what, share, figure)
    assert found.verdict is Verdict.EXCEEDED
    # Ahead of it, it is in S_p as soon as the reaction may end there, though no tick shows it.
    seen = found.t[found.verdicts == 1]
    assert seen.min() < 0.1 if what == "ahead" else "between two ticks, at 0.10" in found.worst().reason


# -- a field that an AGV takes along --------------------------------------------------------------

AGV = """
variables = "variables.toml"
[engine]
physics = false
[[sources]]
kind = "signals_csv"
name = "plc"
file = "signals.csv"
time = "t"
time_unit = "s"
[[machines]]
name = "agv"
shape = {{ box = [1.0, 0.6, 0.3] }}
at = {{ position = [0, 0, 0.2] }}
mass = 100
vehicle = {{ x = "x", y = "y", heading = "heading" }}
[[parts]]
name = "saw"
shape = {{ box = [0.02, 0.02, 0.2] }}
at = {{ position = [2, 0, 0.5] }}
[[sensors]]
name = "scan"
on = "agv/body"
at = {{ position = [0, 0, {height}], rpy = [{tilt}, 0, 0] }}
capability = 0.07
response = 0.08
source = "data sheet"
laser_scanner = {{ angle = 4.71, resolution = 0.0087, range = 9.0, fields = [
  {{ name = "stop", corners = [[-4, -4], [4, -4], [4, 4], [-4, 4]] }} ] }}
[[safety]]
kind = "device_distance"
name = "c"
sensor = "scan"
hazard = "saw"
stopping = 0.3
reach_under = 0
supplement = {supplement}
"""
VARIABLES = "".join(
    f'[[variables]]\nname = "{name}"\nsource = "plc"\naddress = "{name}"\nunit = "{unit}"\n'
    for name, unit in (("x", "m"), ("y", "m"), ("heading", "rad"))
)


def driven(folder, way, supplement, tilt=0.0):
    """An AGV whose scanner's field lies about a saw, on a way x, y [m] and heading [rad] of t [s]."""
    t = np.arange(0, 0.305, 0.005)
    rows = [",".join(f"{v:.12g}" for v in (at, *way(at))) for at in t.tolist()]
    text = AGV.format(height=0.1, tilt=tilt, supplement=supplement)
    kept = {"variables.toml": VARIABLES, "signals.csv": "\n".join(["t,x,y,heading", *rows]) + "\n"}
    return made(folder, text, kept)


def turning(t):
    """On the spot: the saw is nearest to the border midway between two ticks."""
    return 0.0, 0.0, 6 * (t - BUMP)


def test_no_bound_of_a_field_that_is_taken_along_is_beaten(tmp_path):
    station = driven(tmp_path, lambda t: (0.1 * np.sin(9 * t), 0.2 * np.cos(7 * t), 8 * (t - BUMP)), 0.0)
    room = worst_found(station, looks=3)["c"]
    assert len(room) == 30
    assert -1e-9 <= min(room) < np.inf


def test_a_field_that_is_taken_along_does_not_fall_short_between_two_ticks(tmp_path):
    near = driven(tmp_path / "near", turning, 0.0).run().results["c"]
    assert near.verdict is Verdict.WITHIN
    supplement = float(np.min(near.values - near.limits)) - 0.0006
    found = driven(tmp_path / "far", turning, supplement).run().results["c"]
    assert found.verdict is Verdict.EXCEEDED
    assert "between two ticks, at 0.10" in found.worst().reason


def test_nothing_bounds_a_field_that_tilts_while_it_turns(tmp_path):
    found = driven(tmp_path, turning, 0.0, tilt=5e-4).run().results["c"]
    assert set(found.verdicts.tolist()) == {0}
    assert found.verdict is Verdict.UNDECIDED


def elbow():
    """An arm that turns and bends at shoulder and elbow, whose joints hold 10 N·m."""
    text = '<link name="base"/>'
    for i, (axis, x) in enumerate((("0 0 1", 0), ("0 1 0", 0), ("0 1 0", 1))):
        text += (
            f'<link name="l{i}"><inertial><origin xyz="0.5 0 0"/><mass value="1"/>'
            '<inertia ixx="0.1" iyy="0.1" '
            'izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial><collision><origin xyz="0.5 0 0"/><geometry>'
            '<box size="1 0.1 0.1"/></geometry></collision></link>'
            f'<joint name="j{i}" type="continuous"><parent link="{f"l{i - 1}" if i else "base"}"/>'
            f'<child link="l{i}"/><origin xyz="{x} 0 0"/><axis xyz="{axis}"/>'
            '<limit effort="10" velocity="10"/></joint>'
        )
    text += '<link name="tip"/><joint name="end" type="fixed"><parent link="l2"/><child link="tip"/>'
    return f'<robot name="elbow">{text}<origin xyz="1 0 0"/></joint></robot>'


@pytest.mark.parametrize(("around", "verdict"), [(BUMP, Verdict.EXCEEDED), (-0.2, Verdict.WITHIN)])
def test_an_arm_that_is_straight_between_two_ticks_presses_with_any_force_there(tmp_path, around, verdict):
    rows = ["t [s],j1 [rad],j2 [rad],j3 [rad]"]
    rows += [f"{t:.3f},0,0.3,{3 * (t - around):.9g}" for t in np.arange(0, 0.2, 0.005).tolist()]
    text = '[engine]\nphysics = false\n[[robots]]\nname = "arm"\nmodel = "arm.urdf"\ntool = "tip"\n'
    text += '[[sources]]\nkind = "csv"\nrobot = "arm"\nfile = "motion.csv"\n[[safety]]\nlimit = 4900\n'
    text += 'kind = "force_polytope"\nname = "c"\nat = "arm"\nload = "none"\n'
    station = made(tmp_path, text, {"arm.urdf": elbow(), "motion.csv": "\n".join(rows) + "\n"})
    found = station.run().results["c"]
    assert found.verdict is verdict
    assert ("between two ticks, at 0.10" in found.worst().reason) is (verdict is Verdict.EXCEEDED)
