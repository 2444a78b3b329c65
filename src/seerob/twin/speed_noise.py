r"""How far speeds of points may be off, of joints whose speeds were derived from noisy positions.

Errors :math:`\delta_j` of joints are independent: each is that of its own encoder. A point at the distance
:math:`w_j` from the axis of a joint that turns, 1 for one that slides, is off by at most

.. math:: \delta = \sqrt{\sum_j w_j^2 \delta_j^2}

and so is the speed of the fastest point of a body, with the largest :math:`w_j` of any of its points. A
joint that others follow (a mimic, a gripper) moves points by the sum of what each of them does.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from seerob.core.transforms import Array
from seerob.model.model import Body, Mechanism, Model
from seerob.twin.spans import joints_of

Indices = NDArray[np.int64]


def levers(data: mujoco.MjData, joints: NDArray[np.signedinteger], body: Body, R: Array, x: Array) -> Array:
    """Largest distance of a body from axes [m], shape (k,).

    Args:
        data: With MuJoCo's kinematics.
        joints: MuJoCo's.
        body: The body.
        R: World from body, shape (3, 3).
        x: Of its origin in the world [m], shape (3,).
    """
    corners = x + body.corners @ R.T
    arms = corners[None] - data.xanchor[joints][:, None]
    along = np.einsum("kci,ki->kc", arms, data.xaxis[joints])
    squares = np.einsum("kci,kci->kc", arms, arms) - along**2
    return np.asarray(np.sqrt(np.maximum(squares, 0.0).max(axis=1)) + body.radius + body.deviation)


class _Arms(NamedTuple):
    """The joints of one robot, machine or person that move bodies: r pairs of a body and a joint.

    Pairs of one body follow each other, and so do the points of one pair.
    """

    bodies: Indices
    """Those of the asked ones that are moved, shape (c,)."""
    first: Indices
    """First pair of each, shape (c,)."""
    joints: Indices
    """MuJoCo's, shape (r,)."""
    turns: NDArray[np.bool_]
    beyond: Array
    """How far the body reaches beyond its points [m], shape (r,)."""
    coupling: Array
    """Share of each commanded joint, not negative, shape (r, n)."""
    points: Array
    """Of all of these bodies, in their own frames [m], shape (p, 3)."""
    of: Indices
    """The body of each among all of the workstation's, shape (p,)."""
    at: Indices
    """The points of all pairs, shape (s,)."""
    pair: Indices
    """The pair of each of these, shape (s,)."""
    begins: Indices
    """The first of these of each pair, shape (r,)."""


class SpeedNoise:
    """Of the bodies of a workstation.

    Args:
        model: The compiled workstation.
    """

    def __init__(self, model: Model) -> None:
        self._model = model
        self._arms: dict[tuple[str, bytes, bytes], _Arms | None] = {}

    def of_bodies(
        self,
        data: mujoco.MjData,
        ids: Indices,
        rotations: Array,
        positions: Array,
        bodies: Indices,
        errors: Mapping[str, Array],
    ) -> Array:
        """How far the speed of any point of bodies may be off [m/s], shape (b,).

        Args:
            data: With MuJoCo's kinematics.
            ids: MuJoCo's body that moves each body.
            rotations: World from body, shape (n, 3, 3).
            positions: Origins in the world [m], shape (n, 3).
            bodies: By index, shape (b,).
            errors: Of joints by name of who has them [rad/s or m/s], shape (joints,) each.
        """
        found = np.zeros(len(bodies))
        for name, error in errors.items():
            arms = self._of(name, ids, bodies)
            if arms is None:
                continue
            # Component by component: what is said of a body does not depend on who else is asked about.
            R, p = rotations[arms.of], arms.points
            points = positions[arms.of] + R[..., 0] * p[:, :1] + R[..., 1] * p[:, 1:2] + R[..., 2] * p[:, 2:]
            x, y, z = (points[arms.at] - data.xanchor[arms.joints][arms.pair]).T
            u, v, w = data.xaxis[arms.joints][arms.pair].T
            squares = (y * w - z * v) ** 2 + (z * u - x * w) ** 2 + (x * v - y * u) ** 2
            far = np.sqrt(np.maximum.reduceat(squares, arms.begins)) + arms.beyond
            each = np.add.reduceat(np.where(arms.turns, far, 1.0)[:, None] * arms.coupling, arms.first)
            found[arms.bodies] += ((each * error) ** 2).sum(axis=1)
        return np.asarray(np.sqrt(found))

    def _of(self, name: str, ids: Indices, bodies: Indices) -> _Arms | None:
        key = name, ids.tobytes(), bodies.tobytes()
        if key not in self._arms:
            self._arms[key] = _arms(self._model, self._model.mechanisms[name], ids, bodies)
        return self._arms[key]


def _arms(model: Model, mechanism: Mechanism, ids: Indices, bodies: Indices) -> _Arms | None:
    """What joints move of some bodies; None where they move none of them."""
    mj, own = model.mj, model.mj.dof_jntid[mechanism.v_address]
    moved: list[tuple[int, Body, list[int]]] = []
    for k, i in enumerate(bodies.tolist()):
        body, moving = model.bodies[i], set(joints_of(mj, int(ids[i])))
        rows = [row for row, joint in enumerate(own.tolist()) if joint in moving]
        if rows and len(body.corners):
            moved.append((k, body, rows))
    if not moved:
        return None
    rows = [row for _, _, each in moved for row in each]
    joints = own[rows].astype(np.int64)
    counts = np.array([len(body.corners) for _, body, _ in moved])
    pairs = np.array([len(each) for _, _, each in moved])
    starts = np.cumsum(counts) - counts
    sizes = np.repeat(counts, pairs)
    return _Arms(
        bodies=np.array([k for k, _, _ in moved]),
        first=np.cumsum(pairs) - pairs,
        joints=joints,
        turns=mj.jnt_type[joints] == mujoco.mjtJoint.mjJNT_HINGE,
        beyond=np.repeat([body.radius + body.deviation for _, body, _ in moved], pairs),
        coupling=np.abs(mechanism.coupling[rows]),
        points=np.concatenate([body.corners for _, body, _ in moved]),
        of=np.repeat([body.index for _, body, _ in moved], counts),
        at=np.concatenate(
            [np.arange(s, s + n) for s, n in zip(np.repeat(starts, pairs), sizes, strict=True)]
        ),
        pair=np.repeat(np.arange(len(rows)), sizes),
        begins=np.cumsum(sizes) - sizes,
    )
