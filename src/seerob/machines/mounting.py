"""A machine as a chain of joints, so that it is moved, judged and doubted like a robot."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from seerob.machines.tables import Belt, Motion, Slide, Turn
from seerob.model_io.description import Description, Joint, JointKind, Link
from seerob.mounting.things import Color, LoadedThing, load_thing
from seerob.transforms import Array
from seerob.workstation import Machine

MACHINE_COLOR: Color = (0.47, 0.55, 0.50, 1.0)
BODY = "body"
"""The one link of a machine: ``gate/body``."""


def loaded(machine: Machine, folder: Path, *, file: str) -> tuple[Description, LoadedThing]:
    """Read a machine.

    Args:
        machine: Its table.
        folder: Of the workstation file.
        file: The workstation file, for messages.

    Raises:
        InputError: Its mesh cannot be read, or no body of this shape has the given mass properties.
    """
    thing = load_thing(machine, folder, MACHINE_COLOR, needs_mass=True, file=file)
    link = Link(
        BODY,
        None,
        np.eye(4),
        joints=joints(machine.motion),
        inertial=thing.inertial,
        visual=tuple(mesh for piece in thing.pieces for mesh in piece.visual),
        solids=tuple(solid for piece in thing.pieces for solid in piece.solids),
    )
    return Description(machine.name, (link,), BODY, "workstation file", thing.findings), thing


def joints(motion: Motion) -> tuple[Joint, ...]:
    """The degrees of freedom of a motion."""
    if isinstance(motion, Slide):
        axis = _unit(motion.along)
        return (Joint("slide", JointKind.PRISMATIC, axis, lower=motion.lower, upper=motion.upper),)
    if isinstance(motion, Turn):
        axis = _unit(motion.about)
        return (Joint("turn", JointKind.REVOLUTE, axis, lower=motion.lower, upper=motion.upper),)
    if isinstance(motion, Belt):
        return (Joint("belt", JointKind.PRISMATIC, _unit(motion.along), lower=0.0, upper=motion.length),)
    x, y, z = np.eye(3)
    return (
        Joint("x", JointKind.PRISMATIC, x),
        Joint("y", JointKind.PRISMATIC, y),
        Joint("heading", JointKind.REVOLUTE, z),
    )


def home(motion: Motion) -> Array:
    """Where it is before anything is heard [m or rad]: where ``at`` puts it, or at the nearer end."""
    if isinstance(motion, Belt):
        return np.array([motion.start])
    if isinstance(motion, Slide | Turn):
        low = -np.inf if motion.lower is None else motion.lower
        high = np.inf if motion.upper is None else motion.upper
        return np.array([min(max(0.0, low), high)])
    return np.zeros(3)


def _unit(axis: tuple[float, float, float]) -> Array:
    return np.array(axis) / math.hypot(*axis)
