"""Forward kinematics of an arm from its description alone, for many joint positions at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

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
    slides: Array
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
        self._steps: list[tuple[Array, Sequence[tuple[int, Joint]]]] = []
        for part in _way(description, link or description.tip):
            for joint in part.joints:
                if joint.mimic is not None:
                    what = f"joint {joint.name!r} follows another one, and moves the tool"
                    raise InputError.at(description.name, "waypoints", what, "give joint positions")
            self._steps.append((part.parent_from_link, [(index[j.name], j) for j in part.joints]))
        self._tcp = np.eye(4) if link_from_tcp is None else np.asarray(link_from_tcp, float)
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

    def posture(self, q: ArrayLike) -> Posture:
        """Where the arm is.

        Args:
            q: Joint positions [rad or m], shape (..., n).
        """
        q = np.asarray(q, float)
        lead = q.shape[:-1]
        T: Array = np.broadcast_to(self.base_from_root, (*lead, 4, 4))
        anchors, axes = np.zeros((*lead, self.n, 3)), np.zeros((*lead, self.n, 3))
        for parent_from_link, joints in self._steps:
            T = T @ parent_from_link
            for i, joint in joints:
                anchors[..., i, :] = T[..., :3, :3] @ joint.anchor + T[..., :3, 3]
                axes[..., i, :] = T[..., :3, :3] @ joint.axis
                T = T @ _moved(joint, q[..., i])
        T = T @ self._tcp
        return Posture(T[..., :3, :3], T[..., :3, 3], anchors, axes, self.slides)


def _way(description: Description, name: str) -> list[Link]:
    """Links from the root to one of them."""
    links = {link.name: link for link in description.links}
    if name not in links:
        raise UnknownName(f"link of {description.name}", name, links)
    way = [links[name]]
    while (parent := way[-1].parent) is not None:
        way.append(links[parent])
    return way[::-1]


def _moved(joint: Joint, q: Array) -> Array:
    """Frame of a joint from the frame that it leaves, shape (..., 4, 4)."""
    T = np.zeros((*q.shape, 4, 4))
    T[..., 3, 3] = 1.0
    if joint.kind is JointKind.PRISMATIC:
        T[..., :3, :3] = np.eye(3)
        T[..., :3, 3] = q[..., None] * joint.axis
        return T
    x, y, z = joint.axis
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    s, c = np.sin(q)[..., None, None], np.cos(q)[..., None, None]
    R = np.eye(3) + s * K + (1 - c) * (K @ K)
    T[..., :3, :3] = R
    T[..., :3, 3] = joint.anchor - R @ joint.anchor
    return T
