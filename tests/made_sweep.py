"""Random points of moving bodies, and whether a closed mesh contains points."""

import mujoco
import numpy as np

from seerob.core.shapes import Mesh
from seerob.kernels.tree_file import tree_of
from seerob.kernels.winding import contains
from seerob.model.volumes.moving import posed


def points_of(solid, count, rng):
    """Random points of the surface of a solid, in its body's frame (count, 3)."""
    outward = rng.normal(size=(count, 3))
    outward *= solid.radius / np.linalg.norm(outward, axis=1, keepdims=True)
    if solid.mesh is None:
        origin, edges = solid.points[0], solid.points[1:] - solid.points[0]
        return origin + rng.random((count, len(edges))) @ edges + outward
    corners = solid.mesh.vertices[solid.mesh.faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    chosen = corners[rng.choice(len(area), count, p=area / area.sum())]
    weights = rng.dirichlet((1, 1, 1), count)
    weights[: count // 4] = np.eye(3)[rng.integers(0, 3, count // 4)]
    return np.einsum("nc,ncx->nx", weights, chosen) + outward


def missed(model, bodies, motion, contained, count, rng, each=64):
    """How many of ``count`` points of bodies, at random times on straight joint ways, are not contained."""
    qpos = posed(model, motion)
    data = mujoco.MjData(model.mj)
    solids = [(model.bodies[i].mj, solid) for i in bodies for solid in model.bodies[i].solids]
    instants = max(count // (each * len(solids)), 1)
    wrong = 0
    for _ in range(instants):
        i = rng.integers(0, len(qpos) - 1)
        share = rng.random()
        data.qpos[:] = (1 - share) * qpos[i] + share * qpos[i + 1]
        mujoco.mj_kinematics(model.mj, data)
        points = [
            points_of(solid, each, rng) @ data.xmat[body].reshape(3, 3).T + data.xpos[body]
            for body, solid in solids
        ]
        wrong += int((~contained(np.vstack(points))).sum())
    return wrong


def outside(model, contained, count, rng, turns=np.pi):
    """How many random points of moving bodies, at random joint positions within the limits, are outside."""
    mechanism = model.mechanism("arm")
    data, wrong = mujoco.MjData(model.mj), 0
    low, high = np.maximum(mechanism.lower, -turns), np.minimum(mechanism.upper, turns)
    for _ in range(count):
        q = rng.uniform(low, high)
        ends = rng.random(len(q)) < 0.3
        q[ends] = np.where(rng.random(len(q)) < 0.5, low, high)[ends]
        data.qpos[mechanism.q_address] = mechanism.coupling @ q + mechanism.offset
        mujoco.mj_kinematics(model.mj, data)
        for i in model.select("arm"):
            body = model.bodies[i]
            for solid in body.solids:
                points = points_of(solid, 20, rng) @ data.xmat[body.mj].reshape(3, 3).T + data.xpos[body.mj]
                wrong += int((~contained(points)).sum())
    return wrong


def inside(mesh: Mesh, points):
    """Whether a closed mesh contains each point (n, 3)."""
    tree = tree_of(np.ascontiguousarray(mesh.vertices), mesh.faces)
    return np.array([contains(tree.nodes, tree.links, tree.triangles, *p) for p in points])
