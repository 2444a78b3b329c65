"""Poses, Jacobians and mass matrices of a `Description` from first principles, in plain numpy.

``M = Σ m J_cᵀ J_c + J_wᵀ (R I Rᵀ) J_w`` over links, with Jacobians built column by column.
"""

from __future__ import annotations

import numpy as np

from seerob.description.description import Description, JointKind


def _rotation(axis, angle):
    x, y, z = axis
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def kinematics(description: Description, q):
    """``{link: (base_from_link, J (6, n))}``, Jacobian of the link's origin, linear rows first."""
    index = {joint.name: i for i, joint in enumerate(description.joints())}
    n = len(index)
    done = {}
    for link in description.links:
        pose, columns = (np.eye(4), {}) if link.parent is None else done[link.parent]
        pose, columns = pose @ link.parent_from_link, dict(columns)
        for joint in link.joints:
            i, factor, offset = joint.name, 1.0, 0.0
            if joint.mimic:
                i, factor, offset = joint.mimic.joint, joint.mimic.multiplier, joint.mimic.offset
            value = factor * q[index[i]] + offset
            axis = pose[:3, :3] @ joint.axis
            point = pose[:3, :3] @ joint.anchor + pose[:3, 3]
            columns.setdefault(index[i], [])
            columns[index[i]] = [*columns[index[i]], (joint.kind, factor * axis, point)]
            step = np.eye(4)
            if joint.kind is JointKind.REVOLUTE:
                step[:3, :3] = _rotation(joint.axis, value)
                step[:3, 3] = joint.anchor - step[:3, :3] @ joint.anchor
            else:
                step[:3, 3] = joint.axis * value
            pose = pose @ step
        done[link.name] = pose, columns
    return {name: (pose, jacobian_at(columns, pose[:3, 3], n)) for name, (pose, columns) in done.items()}, {
        name: columns for name, (_, columns) in done.items()
    }


def jacobian_at(columns, point, n):
    J = np.zeros((6, n))
    for i, movers in columns.items():
        for kind, axis, through in movers:
            if kind is JointKind.REVOLUTE:
                J[:3, i] += np.cross(axis, point - through)
                J[3:, i] += axis
            else:
                J[:3, i] += axis
    return J


def mass_matrix(description: Description, q):
    links, columns = kinematics(description, q)
    n = len(description.joints())
    M = np.zeros((n, n))
    for link in description.links:
        if link.inertial is None:
            continue
        pose, _ = links[link.name]
        R = pose[:3, :3]
        J = jacobian_at(columns[link.name], R @ link.inertial.com + pose[:3, 3], n)
        M += link.inertial.mass * J[:3].T @ J[:3] + J[3:].T @ (R @ link.inertial.inertia @ R.T) @ J[3:]
    return M
