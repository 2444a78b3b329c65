"""Where one frame is in another, out of a stream of transforms (tf) of which each says one edge."""

from __future__ import annotations

import math

import numpy as np

from seerob.core.errors import InputError, suggestion
from seerob.core.transforms import Array, rotation_from_wxyz, transform
from seerob.devices.motion_files import PoseFrame, fixed_links
from seerob.protocols.ros.ros_messages import Transform
from seerob.workstation.source import Target

STATIC = "/tf_static"
"""Where frames are said that never change."""
LONGEST = 64
"""Edges of a chain."""
MOST_FRAMES = 4096
UNIT = 1e-2
"""A quaternion whose length is off by more is none."""


class FrameTree:
    """What is known of the frames.

    Args:
        parent: Frame that is wanted as parent.
        child: Frame whose pose is wanted.
    """

    def __init__(self, parent: str, child: str) -> None:
        self._parent, self._child = parent, child
        self._edges: dict[str, tuple[str, float | None, Array, bool]] = {}

    def take(self, transforms: tuple[Transform, ...], *, fixed: bool) -> bool:
        """Note them; whether one of the chain is among them.

        Args:
            transforms: What a message says.
            fixed: Whether they never change (``/tf_static``).
        """
        for said in transforms:
            if said.child in self._edges or len(self._edges) < MOST_FRAMES:
                self._edges[said.child] = (said.parent, said.stamp, _matrix(said), fixed)
        on = {child for child, _ in self._chain()}
        return any(said.child in on for said in transforms)

    def pose(self) -> tuple[Array, float | None] | None:
        """Parent from child (4, 4), NaN where one edge is none, and the stamp of the oldest moving edge [s].

        None when the chain is not known, or nothing in it moves and nobody says when that was.
        """
        chain = self._chain()
        if not chain or self._edges[chain[-1][0]][0] != self._parent:
            return None
        matrix = np.eye(4)
        stamps: list[float | None] = []
        for child, _ in reversed(chain):
            _, stamp, edge, fixed = self._edges[child]
            matrix = matrix @ edge
            if not fixed:
                stamps.append(stamp)
        known = [s for s in stamps if s is not None]
        return matrix, min(known) if known and len(known) == len(stamps) else None

    def lacking(self) -> str:
        """Why there is no pose, for a message."""
        frames = sorted({*self._edges, *(e[0] for e in self._edges.values())})
        shown = ", ".join(frames[:16]) or "none"
        return f"nothing leads from {self._parent!r} to {self._child!r}; frames that are heard: {shown}"

    def _chain(self) -> list[tuple[str, str]]:
        """Child and parent of each edge, from the child upwards, as far as the parent or as is known."""
        found: list[tuple[str, str]] = []
        frame = self._child
        while frame in self._edges and frame != self._parent and len(found) < LONGEST:
            found.append((frame, self._edges[frame][0]))
            frame = self._edges[frame][0]
        return found


def _matrix(said: Transform) -> Array:
    length = math.hypot(*said.wxyz)
    if not (math.isfinite(length) and abs(length - 1) < UNIT):
        return np.full((4, 4), np.nan)
    return transform(rotation_from_wxyz(np.array(said.wxyz) / length), said.position)


def world_from_parent(target: Target, parent: str, frame: PoseFrame, where: str) -> Array:
    """Where the parent stands in the workstation, (4, 4).

    Args:
        target: The robot.
        parent: Frame of ROS, which is a link of the robot of the same name or the workstation's origin.
        frame: Which of both.
        where: The other end or the file, for messages.

    Raises:
        InputError: The robot has no such link that stands still.
    """
    if frame is PoseFrame.WORLD:
        return np.eye(4)
    fixed = fixed_links(target)
    name = f"{target.name}/{parent}"
    if name not in fixed or target.world_from_base is None:
        what = f"no link {name!r} that stands still with {target.name}"
        remedy = f'{suggestion(name, fixed)}; or frame = "world" when {parent!r} is its origin'
        raise InputError.at(where, "parent", what, remedy)
    return np.array(target.world_from_base) @ fixed[name]


def driven(target: Target, at: str, where: str) -> str:
    """Full name of what a pose drives.

    Args:
        target: The robot.
        at: What it should be.
        where: The other end or the file, for messages.

    Raises:
        InputError: The robot does not move it.
    """
    if target.frames and at not in (*target.frames, target.name):
        what = f"no link or tool {at!r} that {target.name} moves"
        raise InputError.at(where, "at", what, suggestion(at, target.frames))
    return at
