"""A workpiece that a gripper picks up: in its hand, and where it lies otherwise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from seerob.core.errors import InputError
from seerob.core.transforms import Array
from seerob.model.mounting.specification import Mounting
from seerob.workstation.workstation import Machine, Workpiece

RESTING = "resting"
"""The workpiece where it lies: ``crate/resting``; a part of the environment."""
AWAY = "away"
"""Where the one is put that is not there."""
NOWHERE = 1000.0
"""How high that is above the world [m]: nearer than this nothing is away."""


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
