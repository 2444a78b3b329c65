"""Forward kinematics of an arm from its description alone, for many joint positions at once."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seerob.core.errors import InputError, UnknownName
from seerob.core.transforms import Array, inverse
from seerob.description.description import Description, Joint, JointKind, Link


@dataclass(frozen=True, eq=False)
class Posture:
    """Where an arm is, for joint positions of leading shape (...)."""

    rotation: Array
    """Base from tool, shape (..., 3, 3)."""
    position: Array
    """Position of the tool point in the base [m], shape (..., 3)."""
    anchors: Array
    """A point on each joint's axis [m], shape (..., n, 3)."""
    axes: Array
    """Unit axis of each joint, shape (..., n, 3); 0 of a joint that does not move the tool."""
    slides: NDArray[np.bool_]
    """Which joints are prismatic, shape (n,)."""

    def jacobian(self) -> Array:
        """Linear rows at the tool point before angular ones, base axes, shape (..., 6, n)."""
        arm = self.position[..., None, :] - self.anchors
        linear = np.where(self.slides[:, None], self.axes, np.cross(self.axes, arm))
        angular = np.where(self.slides[:, None], 0.0, self.axes)
        return np.swapaxes(np.concatenate([linear, angular], axis=-1), -1, -2)


class Arm:
    """The chain from a robot's root link to its tool point.

    Args:
        description: The robot.
        link: Link that carries the tool; the description's tip when not given.
        link_from_tcp: Tool point in that link's frame, shape (4, 4).
        base: Link whose frame everything is given in; the root when not given. It must stand still.

    Raises:
        UnknownName: No such link.
        InputError: A joint of the chain that follows another, or a base that moves.
    """

    def __init__(
        self,
        description: Description,
        *,
        link: str | None = None,
        link_from_tcp: ArrayLike | None = None,
        base: str | None = None,
    ) -> None:
        commanded = description.joints()
        self.joints: tuple[Joint, ...] = commanded
        self.n = len(commanded)
        self.slides = np.array([j.kind is JointKind.PRISMATIC for j in commanded], bool)
        self.lower = np.array([-np.inf if j.lower is None else j.lower for j in commanded])
        self.upper = np.array([np.inf if j.upper is None else j.upper for j in commanded])
        index = {joint.name: i for i, joint in enumerate(commanded)}
        links, order, start = [], [], [0]
        for part in _way(description, link or description.tip):
            for joint in part.joints:
                if joint.mimic is not None:
                    what = f"joint {joint.name!r} follows another one, and moves the tool"
                    raise InputError.at(description.name, "waypoints", what, "give joint positions")
            links.append(part.parent_from_link)
            order += [index[joint.name] for joint in part.joints]
            start.append(len(order))
        links.append(np.eye(4) if link_from_tcp is None else np.asarray(link_from_tcp, float))
        self._chain = (
            np.array(links, float),
            np.array([*start, len(order)], np.int64),
            np.array(order, np.int64),
            np.array([joint.anchor for joint in commanded], float).reshape(-1, 3),
            np.array([joint.axis for joint in commanded], float).reshape(-1, 3),
            self.slides,
        )
        """Links and the joints between them, as `seerob.kernels.arm.postures` has them."""
        self.base_from_root: Array = np.eye(4)
        if base is not None:
            root_from_base: Array = np.eye(4)
            for part in _way(description, base):
                if part.joints:
                    raise InputError.at(
                        description.name, "base", f"{base!r} moves", "name a link that does not"
                    )
                root_from_base = root_from_base @ part.parent_from_link
            self.base_from_root = inverse(root_from_base)

    def carrying(self, link_from_tcp: ArrayLike) -> Arm:
        """Return this arm with another tool point, in the frame of the link that carries it, (4, 4)."""
        other = copy(self)
        links = self._chain[0].copy()
        links[-1] = link_from_tcp
        other._chain = (links, *self._chain[1:])
        return other

    def posture(self, q: ArrayLike) -> Posture:
        """Where the arm is.

        Args:
            q: Joint positions [rad or m], shape (..., n).
        """
        from seerob.kernels.arm import postures

        q = np.asarray(q, float)
        lead, rows = q.shape[:-1], np.ascontiguousarray(q).reshape(-1, self.n)
        rotations, positions = np.empty((len(rows), 3, 3)), np.empty((len(rows), 3))
        anchors, axes = np.zeros((2, len(rows), self.n, 3))
        base = np.ascontiguousarray(self.base_from_root)
        postures(rows, base, *self._chain, rotations, positions, anchors, axes)
        return Posture(
            rotations.reshape(*lead, 3, 3),
            positions.reshape(*lead, 3),
            anchors.reshape(*lead, self.n, 3),
            axes.reshape(*lead, self.n, 3),
            self.slides,
        )


def _way(description: Description, name: str) -> list[Link]:
    """Links from the root to one of them."""
    links = {link.name: link for link in description.links}
    if name not in links:
        raise UnknownName(f"link of {description.name}", name, links)
    way = [links[name]]
    while (parent := way[-1].parent) is not None:
        way.append(links[parent])
    return way[::-1]
