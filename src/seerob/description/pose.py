"""Where the links of a description are: forward kinematics in a few lines, for readers and tests."""

from __future__ import annotations

from collections.abc import Mapping

from seerob.core.transforms import Array, rotation_from_axis_angle, transform
from seerob.description.description import Description, Joint, JointKind


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
