r"""The static forces that joint torques allow at a point, as exact polytopes.

Three sets carry the name force polytope. With :math:`l = \tau_{min} - b,\ h = \tau_{max} - b` and
:math:`b` what the joints need for themselves (gravity, motion):

=============  ==========================================================  =================================
zero moment    :math:`\{f : l \le J_v^T f \le h\}`                         a point contact, [Chiacchio1997]_
free moment    :math:`\{f : \exists m,\ l \le J_v^T f + J_w^T m \le h\}`   a grip that also bears a moment
torque box     :math:`\{(J_v^T)^+ \tau : l \le \tau \le h\}`               [Weistroffer2022]_ section 2.2.2.4
=============  ==========================================================  =================================

The first lies within the second and within the third. The third also counts torques that no static
force balances, and is the only one that is an image of :math:`2^n` corners.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from seerob.core.domains import agree
from seerob.core.shapes import Faces
from seerob.core.transforms import Array
from seerob.description.shapes.hull import convex_hull
from seerob.kernels import polytope as kernel
from seerob.kernels.contact_forces import zero_moment_set

SINGULAR = 1e-9
"""Singular value below which a direction counts as not driven, relative to the largest."""
SAME = 1e-9
"""Corners nearer than this are one, relative to the farthest."""


@dataclass(frozen=True, eq=False)
class Polytope:
    """A convex set of forces, or none, or one without end."""

    corners: Array
    """Distinct corners, shape (k, 3) [N]; of an unbounded set those of its section across ``free``."""
    triangles: kernel.Indices
    """Triangles of the surface, counter-clockwise from outside, shape (m, 3); none when it is flat and made
    by a hull."""
    free: Array
    """Orthonormal directions in which it has no end, as columns, shape (3, d)."""
    inscribed: float
    """Largest force that is possible in every direction [N]; below 0 when no force at all is not
    possible; nan when empty."""

    @property
    def empty(self) -> bool:
        """Whether the torques cannot even balance themselves."""
        return len(self.corners) == 0

    @property
    def farthest(self) -> Array:
        """The largest force of ``corners``, shape (3,) [N]; a norm is convex, so it is at a corner."""
        squares = np.einsum("ij,ij->i", self.corners, self.corners)
        return np.asarray(self.corners[int(squares.argmax())])

    @property
    def largest(self) -> float:
        """Norm of the largest force [N]; inf when unbounded, nan when empty."""
        if self.empty:
            return float("nan")
        return float("inf") if self.free.shape[1] else float(np.linalg.norm(self.farthest))


def zero_moment(J_v: Array, low: Array, high: Array) -> Polytope:
    r"""Forces at a point contact, :math:`\{f : l \le J_v^T f \le h\}`, from all pairs of planes.

    Args:
        J_v: Linear Jacobian of the point, shape (3, n).
        low: Torques left below, τ_min − b, shape (n,) [N·m or N].
        high: Torques left above, τ_max − b, shape (n,).

    Raises:
        ValueError: Bounds that are not finite or are inverted.
    """
    J_v = np.ascontiguousarray(J_v, float)
    bounds = np.asarray(low, float), np.asarray(high, float)
    agree(n=(J_v.shape[-1], *bounds[0].shape, *bounds[1].shape))
    proper, V, triangles, free, inscribed = zero_moment_set(J_v, *bounds, SINGULAR, SAME)
    if not proper:
        _checked(J_v, *bounds)
    return Polytope(V, triangles, free, inscribed) if len(V) else _nothing()


def free_moment(J: Array, low: Array, high: Array) -> Polytope:
    r"""Forces of a grip that can bear a moment too: all wrenches that the torques allow, seen as forces.

    In torque space these are :math:`\{\tau : l \le \tau \le h,\ N \tau = 0\}`, the rows of N spanning
    the null space of J. Its corners lie where as many torques are between their bounds as N has rows.

    Args:
        J: Jacobian of the point, linear rows first, shape (6, n).
        low: As in `zero_moment`.
        high: Likewise.

    Raises:
        ValueError: Bounds that are not finite or are inverted; more than 10 driven joints.
    """
    J, low, high = _checked(J, low, high)
    moves = _moving(J)
    if ((low > 0) | (high < 0))[~moves].any():
        return _nothing()
    J, low, high = J[:, moves], low[moves], high[moves]
    U, sigma, Vt = np.linalg.svd(J, full_matrices=True)
    rank = _rank(sigma)
    torques = _corners_of_section(Vt[rank:], low, high)
    if not len(torques):
        return _nothing()
    force_from_torque = (U[:3, :rank] / sigma[:rank]) @ Vt[:rank]
    undriven, size, _ = np.linalg.svd(U[:3, rank:], full_matrices=False)
    free = undriven[:, size > SINGULAR]
    forces = torques @ force_from_torque.T
    return _hull(forces - forces @ free @ free.T, free)


def torque_box(J_v: Array, low: Array, high: Array) -> Polytope:
    r"""Image of the box of torques, :math:`\{(J_v^T)^+ \tau : l \le \tau \le h\}`.

    Args:
        J_v: Linear Jacobian of the point, shape (3, n).
        low: As in `zero_moment`.
        high: Likewise.

    Raises:
        ValueError: Bounds that are not finite or are inverted; more than 10 driven joints.
    """
    J_v, low, high = _checked(J_v, low, high)
    moves = _moving(J_v)
    J_v, low, high = J_v[:, moves], low[moves], high[moves]
    U, sigma, Vt = np.linalg.svd(J_v, full_matrices=True)
    rank = _rank(sigma)
    torques = _corners_of_section(np.zeros((0, len(low))), low, high)
    return _hull(torques @ ((U[:, :rank] / sigma[:rank]) @ Vt[:rank]).T, U[:, rank:])


def _checked(J: Array, low: Array, high: Array) -> tuple[Array, Array, Array]:
    J, low, high = np.asarray(J, float), np.asarray(low, float), np.asarray(high, float)
    if not (np.isfinite(J).all() and np.isfinite(low).all() and np.isfinite(high).all()):
        raise ValueError("a Jacobian or torque bound is not finite")
    agree(n=(J.shape[-1], *low.shape, *high.shape))
    if (low > high).any():
        raise ValueError(f"joint {int((low > high).argmax())}: the lower torque bound is above the upper one")
    return J, low, high


def _moving(J: Array) -> NDArray[np.bool_]:
    """Joints that move the point."""
    size = np.abs(J)
    return np.asarray(size.max(axis=0) > kernel.INERT * size.max(initial=0.0))


def _rank(sigma: Array) -> int:
    """How many directions are driven, of singular values in falling order."""
    return int((sigma > SINGULAR * sigma[:1]).sum())


def _nothing() -> Polytope:
    return Polytope(np.zeros((0, 3)), np.zeros((0, 3), np.int64), np.zeros((3, 0)), float("nan"))


def _corners_of_section(N: Array, low: Array, high: Array) -> Array:
    """Corners of ``{τ : l <= τ <= h, N τ = 0}``, shape (k, n); some are found more than once."""
    n, r = len(low), len(N)
    if n > 10:
        raise ValueError(f"{n} driven joints are too many for this set; zero_moment has no such bound")
    slack = 1e-12 * np.abs([low, high]).max(initial=0.0)
    at_high = (np.arange(2 ** (n - r))[:, None] >> np.arange(n - r)) & 1
    found = []
    for between in combinations(range(n), r):
        held = [i for i in range(n) if i not in between]
        torques = np.empty((len(at_high), n))
        torques[:, held] = np.where(at_high, high[held], low[held])
        if r:
            block = N[:, between]
            # A singular block has no corner of its own: another choice of joints finds it.
            if np.linalg.cond(block) > 1 / SINGULAR:
                continue
            torques[:, between] = -np.linalg.solve(block, N[:, held] @ torques[:, held].T).T
        inside = ((torques >= low - slack) & (torques <= high + slack)).all(axis=1)
        found.append(torques[inside])
    # At least one block is regular: the rows of N are orthonormal.
    return np.vstack(found)


def _hull(points: Array, free: Array) -> Polytope:
    """Convex hull of a cloud that spans space, or its points alone when it is flat."""
    size = float(np.abs(points).max())
    V = kernel.merged(np.ascontiguousarray(points), SAME * size)
    flat = np.linalg.matrix_rank(V - V[0], tol=SINGULAR * size) < 3
    if flat:
        return Polytope(V, np.zeros((0, 3), np.int64), free, 0.0 if free.shape[1] == 0 else float("nan"))
    V, faces, normal = _cornered(V)
    least = float(np.einsum("ij,ij->i", normal, V[faces[:, 0]]).min(where=normal.any(axis=1), initial=np.inf))
    return Polytope(V, faces.astype(np.int64), free, least)


def _cornered(V: Array) -> tuple[Array, Faces, Array]:
    """Corners (k, 3) of a cloud's hull, its triangles (m, 3), and their normals, 0 of slivers.

    What only rounding makes a corner, a point in a facet or on an edge, is left out.
    """
    while True:
        faces = convex_hull(V)
        if faces is None:
            raise ValueError("the polytope is too flat for its hull")
        a, b, c = (V[faces[:, i]] for i in range(3))
        normal = np.cross(b - a, c - a)
        area = np.linalg.norm(normal, axis=1)
        # The direction of a sliver is rounding; the facets beside it bound the same place.
        sure = area > SINGULAR * np.linalg.norm([b - a, c - a], axis=2).prod(axis=0)
        normal = np.where(sure[:, None], normal / np.where(sure, area, 1.0)[:, None], 0.0)
        around = [normal[(faces == k).any(axis=1)] for k in range(len(V))]
        turns = [np.linalg.svd(n, compute_uv=False) for n in around]
        corner = np.array([len(s) == 3 and s[2] > SINGULAR for s in turns])
        if corner.all():
            return V, faces, normal
        V = V[corner]
