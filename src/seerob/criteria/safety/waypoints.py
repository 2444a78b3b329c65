"""Programmed waypoints in the room, [Weistroffer2022]_ section 2.1.3.4, and how far the tool is from them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import mujoco
import numpy as np

from seerob.core.errors import InputError
from seerob.core.snapshot import Basis, Label, Marker, Polyline, Sphere, Vec3
from seerob.core.transforms import Array
from seerob.core.verdict import Verdict
from seerob.criteria.criterion import Criterion
from seerob.criteria.figure import Compute, Figure, Present, Shown, Twin
from seerob.files.waypoints.continuous import Programmed
from seerob.files.waypoints.timing import JointLimits
from seerob.model import provenance
from seerob.model.model import Mechanism, Model
from seerob.twin.state import State
from seerob.workstation.source import Target

DRAWN_RADIUS = 0.012
"""Radius of the balls that are drawn [m]."""
DRAWN = 300
"""Points of the line that is drawn."""
DRAWN_LABELS = 60
"""Waypoints with a text; more would hide the picture."""


@dataclass(frozen=True, eq=False)
class _Drawn:
    names: tuple[str, ...]
    at: Array
    """Of the waypoints, world [m], shape (k, 3)."""
    markers: tuple[Marker, ...]


class Waypoints(Criterion, frozen=True, kw_only=True):
    """Where the waypoints of a robot's program are, and how far its tool point is from the nearest."""

    unit: ClassVar[str] = "m"
    by_shape: ClassVar[bool] = False

    robot: str
    """A robot with a source of kind ``waypoints``."""

    def subjects(self) -> tuple[str, ...]:
        """The robot."""
        return (self.robot,)

    def compute(self, model: Model) -> Compute:
        """Look up every name in the model once and return the function that computes the distance."""
        robot = model.robot(self.robot)
        at = _drawn(model, robot).at

        def compute(twin: Twin) -> Figure:
            twin.require(robot.name)
            _, position = twin.pose(robot.tip)
            away = np.linalg.norm(at - position[..., None, :], axis=-1)
            return Figure(away.min(axis=-1), beside=away)

        return compute

    def present(self, model: Model) -> Present:
        """Return the function that names the nearest waypoint and draws all of them."""
        drawn = _drawn(model, model.robot(self.robot))

        def present(state: State, figure: Figure, verdict: Verdict | None) -> Shown:
            return Shown(f"nearest is {drawn.names[int(figure.beside.argmin())]}", lambda: drawn.markers)

        return present

    def one_by_one(self, model: Model) -> str:
        """Say so of a robot that is carried by something that moves."""
        return "" if model.robot(self.robot).alone else "something that moves carries the robot"

    def basis(self, model: Model) -> Basis:
        """State the formula, its source, the inputs with their origin, and what is not modelled."""
        return Basis(
            formula="d = min |p - p_k| over the waypoints k",
            source="[Weistroffer2022] 2.1.3.4",
            inputs=provenance.motion(model, self.robot),
            not_modelled=(
                "the order of the waypoints; orientations; a controller's own way between them",
                "waypoints are drawn where the twin's tool point is at their joint positions",
            ),
        )


def _drawn(model: Model, robot: Mechanism) -> _Drawn:
    sources = model.workstation.sources
    source = next((s for s in sources if s.target() == robot.name and isinstance(s, Programmed)), None)
    if source is None:
        what = f"no source of kind waypoints drives {robot.name}"
        raise InputError.at("safety", "waypoints", what, 'give [[sources]] kind = "waypoints"')
    program = source.program(model.folder / source.file)
    target = Target(name=robot.name, description=robot.description)
    arm, _ = source.arm(program, target)
    table = next(r for r in model.workstation.robots if r.name == robot.name)
    limits = JointLimits.of(
        arm.n,
        speed=tuple(None if v is None else v.value for v in robot.velocity_limits),
        acceleration=table.acceleration_limits or (),
        jerk=table.jerk_limits or (),
    )
    motion = source.motion(program, arm, limits)
    at = _tool_points(model, robot, np.array(motion.at))
    names = tuple(w.name or str(i + 1) for i, w in enumerate(program.waypoints))
    return _Drawn(names, at, _markers(model, robot, motion.trajectory.q, at, names))


def _markers(
    model: Model, robot: Mechanism, q: Array, at: Array, names: tuple[str, ...]
) -> tuple[Marker, ...]:
    """The way through joint positions of shape (n, d), and the waypoints at (k, 3) [m]."""
    rows = np.unique(np.linspace(0, len(q) - 1, DRAWN).astype(int))
    way = _tool_points(model, robot, q[rows])
    markers: list[Marker] = [Polyline(points=tuple(_vector(p) for p in way))]
    for i, p in enumerate(at):
        markers.append(Sphere(center=_vector(p), radius=DRAWN_RADIUS))
        if i < DRAWN_LABELS:
            markers.append(Label(position=_vector(np.add(p, (0.0, 0.0, 2 * DRAWN_RADIUS))), text=names[i]))
    return tuple(markers)


def _tool_points(model: Model, robot: Mechanism, q: Array) -> Array:
    """Of the robot's point of interest in the world [m], shape (k, 3)."""
    data, frame = mujoco.MjData(model.mj), robot.tip
    found = np.empty((len(q), 3))
    for i, row in enumerate(q):
        data.qpos[robot.q_address] = robot.coupling @ row + robot.offset
        mujoco.mj_kinematics(model.mj, data)
        turn = data.xmat[frame.mj].reshape(3, 3)
        found[i] = data.xpos[frame.mj] + turn @ frame.body_from_frame[:3, 3]
    return found


def _vector(p: Array) -> Vec3:
    x, y, z = (round(float(v), 5) for v in p)
    return x, y, z
