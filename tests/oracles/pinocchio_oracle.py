"""A Pinocchio model built from a `Description`, call by call: the second opinion on M, J, E and poses.

Tests import it as ``from oracles.pinocchio_oracle import pinocchio_model`` (``tests`` is on the path).
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from seerob.description.description import Description, JointKind


def pinocchio_model(description: Description) -> pin.Model:
    """One degree of freedom per joint that can be commanded, in the order of ``description.joints()``.

    Every link becomes a frame of its name. Masses of links that do not move are left out, as they change
    nothing. Mimic joints are refused: Pinocchio's own treatment of them differs between versions.
    """
    if any(joint.mimic for link in description.links for joint in link.joints):
        raise NotImplementedError("mimic joints")
    model = pin.Model()
    model.name = description.name
    carrier: dict[str, tuple[int, pin.SE3]] = {}
    for link in description.links:
        joint_id, joint_from_parent = carrier[link.parent] if link.parent else (0, pin.SE3.Identity())
        placement = joint_from_parent * pin.SE3(link.parent_from_link)
        for joint in link.joints:
            # The joint turns about a line through its anchor; Pinocchio's joints turn about their origin.
            anchor = pin.SE3(np.eye(3), np.asarray(joint.anchor, float))
            axis = np.asarray(joint.axis, float)
            kind = (
                pin.JointModelRevoluteUnaligned
                if joint.kind is JointKind.REVOLUTE
                else pin.JointModelPrismaticUnaligned
            )
            joint_id = model.addJoint(joint_id, kind(axis), placement * anchor, joint.name)
            model.addJointFrame(joint_id)
            placement = anchor.inverse()
        if link.inertial is not None and joint_id:
            inertial = pin.Inertia(
                link.inertial.mass, np.asarray(link.inertial.com, float), link.inertial.inertia
            )
            model.appendBodyToJoint(joint_id, inertial, placement)
        parent_frame = model.getFrameId(link.parent, pin.FrameType.BODY) if link.parent else 0
        model.addFrame(pin.Frame(link.name, joint_id, parent_frame, placement, pin.FrameType.BODY))
        carrier[link.name] = (joint_id, placement)
    for joint in description.joints():
        model.armature[model.joints[model.getJointId(joint.name)].idx_v] = (
            joint.armature.value if joint.armature else 0.0
        )
    return model


def index_of(model: pin.Model, description: Description) -> np.ndarray:
    """Index of each commanded joint of the description in Pinocchio's q, shape (n,)."""
    return np.array([model.joints[model.getJointId(j.name)].idx_q for j in description.joints()], int)


def mass_matrix(model: pin.Model, q: np.ndarray) -> np.ndarray:
    """Joint-space mass matrix, symmetric, shape (n, n)."""
    upper = np.triu(pin.crba(model, model.createData(), q))
    return upper + np.triu(upper, 1).T


def jacobian(model: pin.Model, q: np.ndarray, link: str) -> np.ndarray:
    """Jacobian of a link's origin in world axes, linear rows first, shape (6, n)."""
    frame = model.getFrameId(link, pin.FrameType.BODY)
    return pin.computeFrameJacobian(
        model, model.createData(), q, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    )


def pose(model: pin.Model, q: np.ndarray, link: str) -> np.ndarray:
    """``base_from_link``, shape (4, 4)."""
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    return data.oMf[model.getFrameId(link, pin.FrameType.BODY)].homogeneous


def kinetic_energy(model: pin.Model, q: np.ndarray, qd: np.ndarray) -> float:
    """Kinetic energy [J]."""
    return float(pin.computeKineticEnergy(model, model.createData(), q, qd))
