"""A loose workpiece as a chain of six joints, so that its motion is known like everybody's."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from seerob.core.errors import InputError
from seerob.description.description import Description, Joint, JointKind, Link
from seerob.model.mounting.things import WORKPIECE_COLOR, LoadedThing, load_thing
from seerob.workstation.workstation import Workpiece

JOINTS = ("x", "y", "z", "roll", "pitch", "yaw")
"""Along the axes of where it lay first, then about its own. The twin puts that frame anew before the fifth
comes near a right angle (`seerob.twin.machines.loose`)."""
BODY = "body"
"""What moves of it: ``blank/body``."""


def loaded(piece: Workpiece, folder: Path, *, file: str) -> tuple[Description, LoadedThing]:
    """Read a loose workpiece.

    Args:
        piece: Its table.
        folder: Of the workstation file.
        file: The workstation file, for messages.

    Raises:
        InputError: Its mesh cannot be read, no body of this shape has the given mass properties, or nobody
            knows what it weighs: forces move it.
    """
    thing = load_thing(piece, folder, WORKPIECE_COLOR, needs_mass=True, file=file)
    if thing.inertial is None:
        what = f"{piece.name} is loose and moved by forces, and its mesh has holes: nobody knows its mass"
        remedy = "give its mass, close the mesh, or say how far its holes reach: hole_depth"
        raise InputError.at(file, f"{piece.name}.density", what, remedy)
    axes = (*np.eye(3), *np.eye(3))
    kinds = (JointKind.PRISMATIC,) * 3 + (JointKind.REVOLUTE,) * 3
    body = Link(
        BODY,
        None,
        np.eye(4),
        joints=tuple(Joint(name, kind, axis) for name, kind, axis in zip(JOINTS, kinds, axes, strict=True)),
        inertial=thing.inertial,
        visual=tuple(mesh for each in thing.pieces for mesh in each.visual),
        solids=tuple(solid for each in thing.pieces for solid in each.solids),
    )
    return Description(piece.name, (body,), BODY, "workstation file", thing.findings), thing
