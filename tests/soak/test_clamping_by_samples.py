"""No gap that closes is free, by dense samples of surfaces: arms on carts, doors and turntables among things.

Facing surfaces are found with the nearest of samples, how fast they close by differences of places.
``SEEROB_SOAK_CELLS`` says of how many cells.
"""

from __future__ import annotations

import os

import mujoco
import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree

from made_cell import FLOATING, TWO_R, made, state_at, two_r
from seerob.criteria.contact.clamped_regions import Clamping

CELLS = int(os.environ.get("SEEROB_SOAK_CELLS", "200"))
HAND, D = "Hands and fingers", 0.1
SAMPLES, NARROW, STEP, CLOSING = 3000, 0.015, 1e-3, 0.02
"""Of each body; gaps below which nothing is said [m]; of the differences [s]; from which speed on a
gap closes [m/s]."""
MOVES = (
    "slide = {{ along = {along}, lower = -2, upper = 2 }}\nshape = {{ box = [1, 0.6, 0.3] }}",
    "turn = {{ about = [0, 0, 1] }}\nshape = {{ box = [0.8, 0.8, 0.1] }}",
    "turn = {{ about = [0, 0, 1] }}\nshape = {{ box = [1, 0.05, 1] }}",
)


def cell(rng):
    """A machine that carries an arm with a tool, another arm, and four boxes."""

    def at(*ranges):
        return [float(rng.uniform(*each)) for each in ranges]

    along = [*rng.normal(size=2).tolist(), 0.0]
    text = FLOATING + '[[machines]]\nname = "cart"\nat = { position = [0, 0, 5] }\nmass = 100\n'
    text += f"{MOVES[rng.integers(3)].format(along=along)}\n"
    text += f'{TWO_R}on = "cart"\nbase = {{ position = {[0.0, 0.0, *at((0.2, 0.6))]} }}\n'
    place = at((-1.5, 1.5), (-1.5, 1.5), (4.9, 5.6))
    text += f'[[robots]]\nname = "other"\nmodel = "arm.urdf"\nbase = {{ position = {place} }}\n'
    text += f'[[tools]]\nname = "piece"\non = "arm/tip"\nshape = {{ box = {at(*[(0.03, 0.3)] * 3)} }}\n'
    text += f"mass = 1\nat = {{ position = {at(*[(-0.15, 0.15)] * 3)} }}\n"
    for k in range(4):
        size, place = at(*[(0.05, 0.8)] * 3), at((-1.3, 1.3), (-1.3, 1.3), (4.6, 5.8))
        pose = f"{{ position = {place}, rpy = {at(*[(-1, 1)] * 3)} }}"
        text += f'[[parts]]\nname = "p{k}"\nshape = {{ box = {size} }}\nat = {pose}\n'
    return text


def sampled(body):
    """Points on a body and their normals."""
    meshes = [trimesh.Trimesh(s.mesh.vertices, s.mesh.faces, process=False) for s in body.solids]
    mesh = trimesh.util.concatenate(meshes)
    points, faces = trimesh.sample.sample_surface(mesh, SAMPLES, seed=1)
    return points, mesh.face_normals[faces]


def places(model, q):
    """Of all bodies, by index."""
    data = mujoco.MjData(model.mj)
    for name, positions in q.items():
        mechanism = model.mechanisms[name]
        data.qpos[mechanism.q_address] = mechanism.coupling @ positions + mechanism.offset
    mujoco.mj_kinematics(model.mj, data)
    return [(data.xmat[b.mj].reshape(3, 3).copy(), data.xpos[b.mj].copy()) for b in model.bodies]


def closes(one, other, before, after):
    """Whether several samples of one body close on the other, which they face and which faces them."""
    (p, n), (r, m) = one, other
    (R, x), (S, y) = before
    a, b = p @ R.T + x, r @ S.T + y
    gap, nearest = cKDTree(b).query(a, distance_upper_bound=D)
    near = np.flatnonzero(np.isfinite(gap) & (gap > NARROW) & (gap < D - 0.01))
    if not len(near):
        return False
    nearest, gap = nearest[near], gap[near]
    way = b[nearest] - a[near]
    faces = ((way * (n[near] @ R.T)).sum(axis=1) > 0.8 * gap) & (
        (-way * (m[nearest] @ S.T)).sum(axis=1) > 0.8 * gap
    )
    (R, x), (S, y) = after
    later = np.linalg.norm(r[nearest] @ S.T + y - p[near] @ R.T - x, axis=1)
    return bool((faces & ((gap - later) / STEP > CLOSING)).sum() >= 5)


@pytest.mark.soak
def test_no_gap_that_closes_is_free(tmp_path):
    closing = 0
    for seed in range(CELLS):
        rng = np.random.default_rng(seed)
        model = (station := made(tmp_path / f"{seed}", cell(rng), {"arm.urdf": two_r()})).model
        movers = model.mechanisms
        bound = {name: Clamping(model, mover, {}, (HAND,), None) for name, mover in movers.items()}
        surfaces = [sampled(body) for body in model.bodies]
        for _ in range(6):
            q = {name: rng.uniform(-1.5, 1.5, len(m.joints)) for name, m in movers.items()}
            v = {name: rng.uniform(-1, 1, len(q[name])) * (rng.random() < 0.6) for name in movers}
            before, after = places(model, q), places(model, {n: q[n] + STEP * v[n] for n in movers})
            state, clamped = state_at(station, **{n: (q[n], v[n]) for n in movers}), set()
            for name, mover in movers.items():
                flags, *_ = bound[name].at(state, np.ones((len(mover.moving), 1), bool))
                clamped |= {i for i, flag in zip(mover.moving, flags[:, 0], strict=True) if flag}
            for i, one in enumerate(model.bodies):
                for j, other in enumerate(model.bodies):
                    pair = (before[i], before[j]), (after[i], after[j])
                    if i != j and closes(surfaces[i], surfaces[j], *pair):
                        closing += 1
                        assert {i, j} & clamped, (seed, one.name, other.name, q, v)
    assert closing >= CELLS
