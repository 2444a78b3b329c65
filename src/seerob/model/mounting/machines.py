"""A machine as a chain of joints, so that it is moved, judged and doubted like a robot."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from seerob.core.errors import InputError
from seerob.core.transforms import Array
from seerob.description.description import Description, Inertial, Joint, JointKind, Link, Mimic
from seerob.model.mounting.specification import Entry, Mounting, extreme_points
from seerob.model.mounting.things import Color, LoadedThing, load_thing
from seerob.workstation.tables.machines import Belt, Fingers, Motion, Route, Slide, Turn
from seerob.workstation.workstation import Machine, Workpiece

MACHINE_COLOR: Color = (0.47, 0.55, 0.50, 1.0)
BODY = "body"
"""What moves of a machine: ``gate/body``; of a gripper what holds its fingers."""
FINGERS = ("left", "right")


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
    body = Link(
        BODY,
        None,
        np.eye(4),
        joints=joints(machine.motion),
        inertial=thing.inertial,
        refused_mass=thing.refused_mass,
        visual=tuple(mesh for piece in thing.pieces for mesh in piece.visual),
        solids=tuple(solid for piece in thing.pieces for solid in piece.solids),
    )
    links = fingers(body, centred=_is_centred(machine)) if isinstance(machine.motion, Fingers) else (body,)
    return Description(machine.name, links, BODY, "workstation file", thing.findings), thing


def _is_centred(machine: Machine) -> bool:
    """Whether its shape lies about its origin, where a file cannot say otherwise."""
    return machine.shape is not None and machine.shape.polygon is None


def fingers(finger: Link, *, centred: bool) -> tuple[Link, ...]:
    """What holds them, a finger, and the same on the other side.

    Args:
        finger: As the file gives it, on the side to which its joint moves it.
        centred: It lies about its origin instead, and is to be put on that side.
    """
    turned = np.diag([-1.0, -1.0, 1.0, 1.0])
    (joint,) = finger.joints
    aside = np.eye(4)
    if centred:
        points, radius = extreme_points(finger.solids)
        aside[:3, 3] = (radius - float((points @ joint.axis).min())) * joint.axis
    places = zip(FINGERS, (aside, turned @ aside), (None, Mimic(FINGERS[0])), strict=True)
    return (
        Link(BODY, None, np.eye(4)),
        *(
            replace(
                finger,
                name=name,
                parent=BODY,
                parent_from_link=pose,
                joints=(replace(joint, name=name, mimic=mimic),),
            )
            for name, pose, mimic in places
        ),
    )


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
    if isinstance(motion, Fingers):
        ends = (None if end is None else end / 2 for end in (motion.lower, motion.upper))
        lower, upper = ends
        return (Joint(FINGERS[0], JointKind.PRISMATIC, _unit(motion.along), lower=lower, upper=upper),)
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
    if isinstance(motion, Fingers):
        return np.array([0.5 * max(0.0, motion.lower or 0.0)])
    return motion.track.at(motion.start)[0] if isinstance(motion, Route) else np.zeros(3)


def _unit(axis: tuple[float, float, float]) -> Array:
    return np.array(axis) / math.hypot(*axis)


RESTING = "resting"
"""The workpiece where it lies: ``crate/resting``; a part of the environment."""
AWAY = "away"
"""Where the one is put that is not there."""
NOWHERE = 1000.0
"""How high that is above the world [m]: nearer than this nothing is away."""
OFF = 1e-4
"""How far what a gripper holds may be from where masses and distances have it [m]: its surface counts as so
much nearer."""


def picked_up(
    mounting: Mounting, piece: Workpiece, holder: Machine | None, world_from_piece: Array, *, file: str
) -> None:
    """Add what lies in the world while the workpiece, which is mounted, is not held.

    Args:
        mounting: With the workpiece in the hand.
        piece: Its table.
        holder: The machine that it is on; None when it is on none.
        world_from_piece: Where it lies first, shape (4, 4).
        file: The workstation file, for messages.

    Raises:
        InputError: It is on what has no fingers.
    """
    if holder is None or holder.grip is None:
        what = f"{piece.on} has no fingers to pick {piece.name} up with"
        raise InputError.at(file, "on", what, "name a machine with grip, or leave rest out")
    away = np.eye(4)
    away[2, 3] = NOWHERE
    mounting.body(f"{piece.name}/{AWAY}", None, away)
    mounting.body(f"{piece.name}/{RESTING}", None, world_from_piece)
    held = [entry for entry in mounting.entries if entry.owner == piece.name]
    for entry in held:
        entry.holder = holder.name
        name = f"{piece.name}/{RESTING}{entry.name.removeprefix(piece.name)}"
        if entry.name != piece.name:
            mounting.body(name, f"{piece.name}/{RESTING}", np.eye(4))
        mounting.entries.append(
            replace(entry, name=name, role="part", owner=piece.name, carrier="", mass=None)
        )


def graspable(
    mounting: Mounting, gripper: str, piece: Entry, inertial: Inertial | None, palm_from_piece: Array
) -> None:
    """Add what a loose workpiece is while a gripper holds it: a part of the gripper, ``gripper/blank``.

    Args:
        mounting: With both.
        gripper: The machine.
        piece: The loose workpiece.
        inertial: What it weighs there in a file that is not run; None for nothing: a gripper holds one.
        palm_from_piece: Where it is held in a file that is not run, shape (4, 4).
    """
    away, name = f"{piece.owner}/{AWAY}", f"{gripper}/{piece.owner}"
    if not mounting.has(away):
        up = np.eye(4)
        up[2, 3] = NOWHERE
        mounting.body(away, None, up)
    body = mounting.body(name, f"{gripper}/{BODY}", palm_from_piece)
    if inertial is not None:
        mounting.inertial(body, inertial)
    solids = tuple(replace(solid, deviation=solid.deviation + OFF) for solid in piece.solids)
    held = replace(piece, name=name, owner=gripper, carrier=gripper, holder=gripper, mass=None, solids=solids)
    mounting.entries.append(held)
