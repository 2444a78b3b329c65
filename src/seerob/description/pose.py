"""Where the links of a description are, by forward kinematics in a few lines, and which links move as one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from seerob.core.transforms import Array, rotation_from_axis_angle, transform
from seerob.description.description import Description, Joint, JointKind, Link


def base_from_links(description: Description, q: Mapping[str, float]) -> dict[str, Array]:
    """Pose of every link (4, 4) in the root's frame; joints that ``q`` does not name are at 0.

    Args:
        description: The robot.
        q: Joint name → position [rad or m].
    """
    poses: dict[str, Array] = {}
    for link in description.links:
        pose = link.parent_from_link if link.parent is None else poses[link.parent] @ link.parent_from_link
        for joint in link.joints:
            pose = pose @ displacement(joint, q.get(joint.name, 0.0))
        poses[link.name] = pose
    return poses


def displacement(joint: Joint, q: float) -> Array:
    """``link_at_0_from_link_at_q`` of a joint, shape (4, 4)."""
    if joint.kind is JointKind.PRISMATIC:
        return transform(position=joint.axis * q)
    rotation = rotation_from_axis_angle(joint.axis, q)
    return transform(rotation, joint.anchor - rotation @ joint.anchor)


def groups(links: Sequence[Link]) -> tuple[tuple[Link, ...], ...]:
    """Links that no joint moves relative to each other; the first of each is the one its joint moves."""
    head: dict[str, str] = {}
    found: dict[str, list[Link]] = {}
    for link in links:
        head[link.name] = link.name if link.parent is None or link.joints else head[link.parent]
        found.setdefault(head[link.name], []).append(link)
    return tuple(map(tuple, found.values()))
