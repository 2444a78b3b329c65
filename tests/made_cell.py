"""Small workstations made on the spot, and states of them: tests import it as ``from made_cell import …``."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from seerob.core.samples import JointSample
from seerob.core.snapshot import Basis, Result
from seerob.session.run import Bound, Judge
from seerob.session.station import Station, load
from seerob.twin.engine import Engine
from seerob.twin.state import State
from seerob.workstation.source import Opened

FLOATING = "engine = { gravity = [0, 0, 0] }\n"

VISITOR_AT_TABLE = """
title = "A visitor at a table"
[[parts]]
name = "table"
shape = { box = [0.6, 1.2, 0.75] }
at = { position = [0.9, 0, 0.375] }
[[humans]]
name = "anna"
stature = 1.75
mass = 75
sex = "male"
unseen_uncertainty_mm = 100
[[sources]]
kind = "headset"
human = "anna"
timeout = 2
hold = 2
"""
TABLE_ON_AXIS = """
[[machines]]
name = "axis"
shape = { box = [0.6, 0.6, 0.1] }
mass = 50
slide = { along = [1, 0, 0], lower = -1, upper = 3 }
[[machines]]
name = "table"
on = "axis"
at = { position = [0, 0, 0.1] }
shape = { cylinder = [0.3, 0.1] }
mass = 20
turn = { }
"""


def two_r(*, mimic: str = "", masses: tuple[float, float] = (1.0, 1.0), effort: float = 1000.0) -> str:
    """A planar arm of two links of 1 m with masses at their ends, turning about z.

    Each is a needle along z: points in the plane, and no body in its shape that nobody could build.
    """
    links, joints = ['<link name="base"/>'], []
    for i, mass in enumerate(masses, 1):
        links.append(
            f'<link name="l{i}"><inertial><origin xyz="1 0 0"/><mass value="{mass}"/>'
            f'<inertia ixx="{2e-3 * mass}" iyy="{2e-3 * mass}" izz="{1e-11 * mass}" ixy="0" ixz="0" '
            'iyz="0"/></inertial>'
            '<collision><origin xyz="0.5 0 0"/><geometry><box size="1 0.1 0.1"/></geometry>'
            "</collision></link>"
        )
        parent, x = ("base", 0) if i == 1 else (f"l{i - 1}", 1)
        joints.append(
            f'<joint name="j{i}" type="continuous"><parent link="{parent}"/><child link="l{i}"/>'
            f'<origin xyz="{x} 0 0"/><axis xyz="0 0 1"/><limit effort="{effort}" velocity="10"/>'
            f"{mimic if i == 2 else ''}</joint>"
        )
    tip = (
        '<link name="tip"/><joint name="end" type="fixed"><parent link="l2"/><child link="tip"/>'
        '<origin xyz="1 0 0"/></joint>'
    )
    return f'<robot name="two_r">{"".join(links + joints)}{tip}</robot>'


TWO_R = '[[robots]]\nname = "arm"\nmodel = "arm.urdf"\n'

UR10 = """
[[robots]]
name = "arm"
model = "library:ur10"
[[tools]]
name = "load"
on = "arm/tool0"
shape = { box = [0.1, 0.1, 0.1] }
mass = 3
uniform_density = true
tcp = { position = [0, 0, 0.1] }
"""
Q0, AMPLITUDE = np.array([0, -1.2, 1.4, -1.5, -1.5, 0]), np.array([1, 0.5, -0.6, 0.8, -0.7, 1.0])


def wave(t):
    """Peak 2 rad/s, in full motion from the first sample on."""
    return Q0 + AMPLITUDE * np.sin(2 * t), 2 * AMPLITUDE * np.cos(2 * t)


def person(name: str = "op", *at: float) -> str:
    """A man of 1.75 m and 75 kg who stands at x, y, z [m]."""
    place = f"at = {{ position = [{', '.join(map(str, at))}] }}\n" if at else ""
    return f'[[humans]]\nname = "{name}"\nstature = 1.75\nmass = 75\nsex = "male"\n{place}'


def made(folder: Path, text: str, files: Mapping[str, str | bytes] | None = None, **allowed: bool) -> Station:
    """Write a workstation and the files it names, and load it."""
    for name, content in {"workstation.toml": text, **(files or {})}.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return load(folder, allow_plugins=True, **allowed)


def meant(text: str) -> str:
    """Confirm each ``stop.acceleration`` of a workstation, whatever its robot's motion says of it."""
    tables = text.split("[[safety]]")[1:]
    stated = (
        (i, re.search(r'name = "(.*)"', table), re.search(r"stop = .*\bacceleration = ([0-9.]+)", table))
        for i, table in enumerate(tables)
    )
    return "".join(
        f'[[confirmed]]\nkey = "safety[{i}].stop.acceleration"\nof = "{name[1]}"\nvalue = {a[1]}\n'
        'why = "monitored"\n'
        for i, name, a in stated
        if a is not None
    )


def heard(
    target: str, t: float, q: Sequence[float], qd: Sequence[float] | None = None, **more: object
) -> JointSample:
    """A sample."""
    speeds = None if qd is None else tuple(map(float, qd))
    return JointSample(source="test", seq=0, target=target, t=t, q=tuple(map(float, q)), qd=speeds, **more)


def state_at(station: Station, **motion: tuple[Sequence[float], Sequence[float]]) -> State:
    """The twin with each named robot or human at (q, qd), just heard."""
    engine = Engine(station.model, controllers=False)
    engine.take([heard(name, 0.0, q, qd) for name, (q, qd) in motion.items()])
    state = engine.start()
    state.engine = engine  # keeps MuJoCo's model alive as long as the state
    return state


def results_at(station: Station, **motion: tuple[Sequence[float], Sequence[float]]) -> dict[str, Result]:
    """What every criterion says at (q, qd)."""
    return {r.name: r for r in judged(station.bound, state_at(station, **motion))}


def basis_in(folder: Path) -> Basis:
    """What the first criterion of the workstation in a folder rests on."""
    return load(folder, allow_plugins=True).bound[0].basis


def judged(bound: Sequence[Bound], state: State) -> tuple[Result, ...]:
    """Results as the run loop makes them."""
    return Judge(bound)(state)


def hinge_limits(station: Station, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Position limits, those that are missing replaced by ±π."""
    mechanism = station.model.mechanism(name)
    return np.clip(mechanism.lower, -np.pi, np.pi), np.clip(mechanism.upper, -np.pi, np.pi)


def recorded(name, motion, rate, duration, *, velocities=True):
    samples = []
    for t in np.arange(0, duration + 1e-9, 1 / rate).tolist():
        q, qd = motion(t)
        samples.append(heard(name, t, q, qd if velocities else None))
    return Opened(samples=tuple(samples), duration=samples[-1].t)
