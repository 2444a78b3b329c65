"""Robots on machines and machines on robots: speeds, energies, doubts and distances of what is carried."""

from __future__ import annotations

import math

import numpy as np
import pytest

from made_cell import TABLE_ON_AXIS, person
from seerob import load
from seerob.core.errors import InputError, Undecided
from seerob.core.samples import JointSample, PoseSample
from seerob.twin.engine import Engine
from seerob.twin.moving_base import velocity_of

STATION = (
    f"[engine]\nphysics = false\n{person('op', 3, 0, 0)}"
    + TABLE_ON_AXIS
    + """[[robots]]
name = "arm"
model = "library:ur10"
on = "table"
base = { position = [0.1, 0, 0.05] }
q = [0.3, -1.2, 1.4, -1.5, -1.5, 0.2]
[[tools]]
name = "flange"
on = "arm/tool0"
shape = { cylinder = [0.05, 0.06] }
mass = 0.8
tcp = { position = [0, 0, 0.2] }
[[machines]]
name = "hand"
on = "flange"
at = { position = [0, 0, 0.03] }
shape = { box = [0.02, 0.02, 0.06] }
mass = 0.2
grip = { upper = 0.1 }
[[safety]]
kind = "velocity"
name = "speed"
at = "arm"
[[safety]]
kind = "kinetic_energy"
name = "energy"
robot = "arm"
[[safety]]
kind = "separation"
name = "sep"
between = ["arm", "op"]
human_speed = 1.6
intrusion = 0.1
human_uncertainty = 0.05
robot_uncertainty = 0.02
stop = { model = "bound", acceleration = 0, reaction = 0.1, stopping = 0.4 }
"""
)
Q = np.array([0.3, -1.2, 1.4, -1.5, -1.5, 0.2])
MOTION = {
    "axis": (np.array([0.4]), np.array([0.5])),
    "table": (np.array([0.7]), np.array([-0.9])),
    "arm": (Q, np.array([0.4, -0.3, 0.5, 0.2, -0.6, 0.1])),
    "hand": (np.array([0.02]), np.array([0.03])),
}


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    folder = tmp_path_factory.mktemp("carried")
    (folder / "workstation.toml").write_text(STATION)
    return load(folder).model


def moving(model, motion=MOTION, ticks=1, timeout=0.2):
    """The twin in uniform motion, everybody heard up to now."""
    engine = Engine(model, driven=dict.fromkeys(motion, timeout))
    heard = [
        JointSample(source=name, seq=k, t=0.01 * k, target=name, q=tuple(q + 0.01 * k * v), qd=tuple(v))
        for name, (q, v) in motion.items()
        for k in range(ticks + 1)
    ]
    engine.take(heard)
    state = engine.start()
    for _ in range(ticks):
        state = engine.tick()
    return engine, state


def test_the_speed_of_a_tool_is_that_of_axis_table_and_joints(model):
    _, state = moving(model)
    arm, frame = model.robot("arm"), model.frame("arm")
    found = velocity_of(state, frame, arm, np.zeros(3))
    position = state.pose(frame)[1]
    _, center = state.pose(model.frame("table/body"))
    table = np.array([0.0, 0.0, -0.9])
    expected = np.array([0.5, 0, 0]) + np.cross(table, position - center)
    own = state.jacobian(frame, arm) @ state.qd(arm)
    np.testing.assert_allclose(found[:3], expected + own[:3], atol=1e-12)
    np.testing.assert_allclose(found[3:], table + own[3:], atol=1e-12)
    # And the places themselves say so.
    _, later = moving(model, ticks=2)
    moved = later.pose(frame)[1] - position
    np.testing.assert_allclose(moved / 0.01, found[:3], atol=0.02)


def test_a_carrier_counts_in_v_r_and_in_the_energy(model, tmp_path):
    (tmp_path / "workstation.toml").write_text(STATION)
    station = load(tmp_path)
    still = {name: (q, np.zeros_like(v)) for name, (q, v) in MOTION.items()}
    _, state = moving(model, still | {"axis": MOTION["axis"]})
    results = {one.criterion.name: one.evaluate(state) for one in station.bound}
    assert results["speed"].value == pytest.approx(0.5, rel=1e-9)
    masses = sum(model.mj.body_mass[i] for i in model.robot("arm").mj_bodies)
    assert results["energy"].value == pytest.approx(0.5 * masses * 0.25, rel=1e-9)
    # S_p = v_h (T_r + T_s) + v_r (T_r + T_s) + C + Z_d + Z_r
    assert results["sep"].limit == pytest.approx((1.6 + 0.5) * 0.5 + 0.17, rel=1e-9)
    parts = {part.name for part in results["sep"].parts}
    assert {"hand/left", "hand/right", "flange", "arm/shoulder_link"} <= parts


def test_the_energy_is_that_of_the_whole_mass_matrix(model):
    import mujoco

    from seerob.twin.moving_base import energy_of

    motion = MOTION | {name: (MOTION[name][0], np.zeros(1)) for name in ("axis", "table")}
    _, state = moving(model, motion)
    nv = model.mj.nv
    M = np.zeros((nv, nv))
    mujoco.mj_makeM(model.mj, state.data)
    mujoco.mj_fullM(model.mj, state.data, M)
    v = state.data.qvel
    # Axis and table stand still and nobody else moves: what there is belongs to the arm and its hand.
    assert energy_of(state, model.robot("arm")) == pytest.approx(0.5 * v @ M @ v, rel=1e-9)


def test_who_is_on_whom(model):
    arm, axis, table, hand = (model.mechanisms[name] for name in ("arm", "axis", "table", "hand"))
    assert (arm.on, arm.riders) == ("table", ("hand",))
    assert (axis.on, axis.riders) == ("", ("table",))
    assert (table.on, hand.on) == ("axis", "arm")
    names = lambda indices: {model.bodies[i].name for i in indices}  # noqa: E731
    assert {"hand/left", "hand/right", "flange"} == names(arm.carried)
    # On a carrier that moves, the foot of the arm moves too.
    assert {*arm.bodies} <= {*arm.moving}
    assert names(model.select("axis")) == {"axis/body", "table/body"}
    assert model.carrier(model.frame("hand/left")) is arm
    assert model.carrier(model.frame("table/body")) is table
    assert not arm.unknown_masses
    note = next(f.text for f in model.findings if f.subject == "arm" and f.text.startswith("carries"))
    assert "carries 1.2 kg: flange 0.8 kg, hand 0.4 kg" in note


def test_a_silent_carrier_leaves_all_it_carries_undecided(model):
    engine, state = moving(model, ticks=5, timeout=0.1)
    assert [state.invalid_reason(name) for name in MOTION] == [""] * 4
    for k in range(5, 25):
        engine.take(
            [
                JointSample(source=n, seq=k, t=0.01 * k + 0.01, target=n, q=tuple(MOTION[n][0]))
                for n in ("table", "arm", "hand")
            ]
        )
        state = engine.tick()
    for name in MOTION:
        assert "axis: not heard for" in state.invalid_reason(name)
    with pytest.raises(Undecided, match="axis: not heard"):
        state.closest(model.gap(model.select("arm"), model.select("op")))


def test_fingers_open_evenly(model):
    _, shut = moving(model, MOTION | {"hand": (np.zeros(1), np.zeros(1))})
    _, state = moving(model, MOTION | {"hand": (np.array([0.03]), np.zeros(1))})
    left, right = (model.frames[f"hand/{side}"] for side in ("left", "right"))
    inner = model.gap(model.select("hand/left"), model.select("hand/right"))
    assert state.closest(inner).distance == pytest.approx(0.06, abs=1e-9)
    assert shut.closest(inner).distance == pytest.approx(0.0, abs=1e-9)
    middle = (state.pose(left)[1] + state.pose(right)[1]) / 2
    np.testing.assert_allclose(middle, state.pose(model.frames["hand/body"])[1], atol=1e-12)


def test_nobody_stands_on_what_cannot_carry(tmp_path):
    for wrong, message in (
        ('on = "tabel"', "tabel"),
        ('on = "op"', r"robots\[0\]\.on"),
        ('on = "arm"', r"robots\[0\]\.on"),
    ):
        (tmp_path / "workstation.toml").write_text(STATION.replace('on = "table"', wrong))
        with pytest.raises(InputError, match=message):
            _ = load(tmp_path).model


def test_poses_of_a_carried_arm_are_refused(model):
    pose = PoseSample(source="plan", seq=0, t=0.0, target="arm", position=(1, 0, 1), wxyz=(1, 0, 0, 0))
    with pytest.raises(InputError, match="carried by table; give its joint positions"):
        Engine(model, driven={"arm": 1.0}).take([pose])


def test_with_physics_a_carried_arm_follows_as_well(tmp_path):
    text = STATION.replace("physics = false\n", "")
    (tmp_path / "workstation.toml").write_text(text)
    model = load(tmp_path).model
    _, state = moving(model, ticks=10)
    assert max(state.hearings[name].error for name in MOTION) < 1e-4
    assert math.isclose(state.data.qvel[model.mechanisms["axis"].v_address[0]], 0.5, abs_tol=1e-3)
