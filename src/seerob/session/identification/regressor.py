r"""Torques of an arm as a linear function of what its bodies weigh, and what of that any motion tells.

Of every moving body b ten parameters :math:`\pi_b = (m, h, I)` about its frame, and of every joint a rotor
inertia, are in the torques by :math:`\tau = Y(q, \dot q, \ddot q)\,\pi`. No motion tells them all: columns
of Y that follow from the others, by random motions of the same arm, are regrouped into these,
:math:`\beta = \pi_1 + K \pi_2` (Gautier and Khalil 1990, from memory; the text was not seen).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from seerob.core.errors import InputError
from seerob.core.transforms import Array
from seerob.description.description import Description, JointKind, Link, groups

PARAMETERS = ("m", "hx", "hy", "hz", "Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz")
"""Of one body, about its frame: [kg], [kg·m], [kg·m²]."""
RANDOM, DEPENDENT = 40, 1e-7
"""Random motions by which columns are told apart; a remainder up to this share of the largest is none."""


class Regressor:
    """Torques of an arm as a linear function of what its bodies weigh."""

    def __init__(self, description: Description, gravity: Array) -> None:
        """Gather what moves.

        Args:
            description: The arm; its masses are not looked at.
            gravity: In the frame of its base [m/s²], shape (3,).

        Raises:
            InputError: A joint follows another one.
        """
        if any(joint.mimic for link in description.links for joint in link.joints):
            what = "has joints that follow others"
            raise InputError.at(description.source, description.name, what, "identify arms of plain joints")
        self.description, self.gravity = description, gravity
        self.bodies = [group for group in groups(description.links) if _moves(description, group[0])]
        self.names = [joint.name for joint in description.joints()]
        kinds = [joint.kind for joint in description.joints()]
        self.revolute = np.array([kind is JointKind.REVOLUTE for kind in kinds])

    @property
    def columns(self) -> list[str]:
        """Name of each parameter: of the bodies, then of rotors."""
        of_bodies = [f"{p} of {body[0].name}" for body in self.bodies for p in PARAMETERS]
        return [*of_bodies, *(f"rotor of {name}" for name in self.names)]

    def __call__(self, q: Array, qd: Array, qdd: Array, gravity: Array | None = None) -> Array:
        """Columns Y of every instant, (N, n, 10 bodies + n).

        Args:
            q: [rad or m], shape (N, n).
            qd: [rad/s or m/s], likewise.
            qdd: [rad/s² or m/s²], likewise.
            gravity: Instead of that of the arm [m/s²], shape (3,).
        """
        N, n = q.shape
        Y = np.zeros((N, n, 10 * len(self.bodies) + n))
        Y[:, np.arange(n), 10 * len(self.bodies) + np.arange(n)] = qdd
        g = self.gravity if gravity is None else gravity
        # Of each link: pose, angular speed and its rate, acceleration of the origin, and joints above it.
        State = tuple[Array, Array, Array, Array, Array, tuple[int, ...]]
        states: dict[str, State] = {}
        axes, points = np.zeros((n, N, 3)), np.zeros((n, N, 3))
        count = 0
        for link in self.description.links:
            if link.parent is None:
                R = np.broadcast_to(link.parent_from_link[:3, :3], (N, 3, 3))
                p = np.broadcast_to(link.parent_from_link[:3, 3], (N, 3))
                zero = np.zeros((N, 3))
                states[link.name] = (R, p, zero, zero, np.broadcast_to(-g, (N, 3)), ())
                continue
            R, p, w, dw, a, above = states[link.parent]
            R, p, a = _carried(R, p, w, dw, a, link.parent_from_link)
            for joint in link.joints:
                j, count = count, count + 1
                axis = R @ joint.axis
                if joint.kind is JointKind.REVOLUTE:
                    # The anchor is carried by the parent; the link turns about it.
                    anchor = np.einsum("nij,j->ni", R, joint.anchor)
                    p_a = p + anchor
                    a_a = a + np.cross(dw, anchor) + np.cross(w, np.cross(w, anchor))
                    turned = qd[:, j, None] * axis
                    dw = dw + qdd[:, j, None] * axis + np.cross(w, turned)
                    w = w + turned
                    R = R @ _turned(joint.axis, q[:, j])
                    back = np.einsum("nij,j->ni", R, -joint.anchor)
                    p = p_a + back
                    a = a_a + np.cross(dw, back) + np.cross(w, np.cross(w, back))
                    axes[j], points[j] = axis, p_a
                else:
                    step = q[:, j, None] * axis
                    a = a + np.cross(dw, step) + np.cross(w, np.cross(w, step))
                    a = a + qdd[:, j, None] * axis + 2 * np.cross(w, qd[:, j, None] * axis)
                    p = p + step
                    axes[j], points[j] = axis, p
                above = (*above, j)
            states[link.name] = (R, p, w, dw, a, above)
        for b, body in enumerate(self.bodies):
            R, p, w, dw, a, above = states[body[0].name]
            force, moment = _wrench(R, w, dw, a)
            for j in above:
                if self.revolute[j]:
                    about = moment + np.cross((p - points[j])[:, None], force.swapaxes(1, 2)).swapaxes(1, 2)
                    rows = np.einsum("ni,nik->nk", axes[j], about)
                else:
                    rows = np.einsum("ni,nik->nk", axes[j], force)
                Y[:, j, 10 * b : 10 * b + 10] = rows
        return Y

    def mass_matrices(self, q: Array) -> Array:
        """Mass matrix of each parameter alone, shape (N, p, n, n)."""
        N, n = q.shape
        still, found = np.zeros((N, n)), []
        for j in range(n):
            qdd = np.zeros((N, n))
            qdd[:, j] = 1.0
            found.append(self(q, still, qdd, np.zeros(3)))
        return np.stack(found, axis=-1).swapaxes(1, 2)


def _moves(description: Description, link: Link) -> bool:
    by_name = {each.name: each for each in description.links}
    while not link.joints:
        if link.parent is None:
            return False
        link = by_name[link.parent]
    return True


def _turned(axis: Array, angle: Array) -> Array:
    """Rotations about a unit axis by angles (N,) [rad], shape (N, 3, 3)."""
    K = _cross(axis[None])[0]
    return np.asarray(
        np.eye(3) + np.sin(angle)[:, None, None] * K + (1 - np.cos(angle))[:, None, None] * (K @ K)
    )


def _carried(R: Array, p: Array, w: Array, dw: Array, a: Array, pose: Array) -> tuple[Array, Array, Array]:
    """Rotation, origin and acceleration of a frame that is fixed to one that moves."""
    offset = np.einsum("nij,j->ni", R, pose[:3, 3])
    return R @ pose[:3, :3], p + offset, a + np.cross(dw, offset) + np.cross(w, np.cross(w, offset))


def _wrench(R: Array, w: Array, dw: Array, a: Array) -> tuple[Array, Array]:
    """Force and moment about a body's origin that its parameters need, in the base's axes (N, 3, 10)."""
    N = len(w)
    Rt = R.swapaxes(1, 2)
    w, dw, a = (np.einsum("nij,nj->ni", Rt, x) for x in (w, dw, a))
    W, dW = _cross(w), _cross(dw)
    force, moment = np.zeros((N, 3, 10)), np.zeros((N, 3, 10))
    force[:, :, 0] = a
    force[:, :, 1:4] = dW + W @ W
    moment[:, :, 1:4] = -_cross(a)
    moment[:, :, 4:] = _inertia(dw) + W @ _inertia(w)
    return R @ force, R @ moment


def _cross(v: Array) -> Array:
    x, y, z = v.T
    o = np.zeros_like(x)
    return np.stack([np.stack([o, -z, y], -1), np.stack([z, o, -x], -1), np.stack([-y, x, o], -1)], 1)


def _inertia(v: Array) -> Array:
    """I v of each of xx, yy, zz, xy, xz, yz, shape (N, 3, 6)."""
    x, y, z = v.T
    o = np.zeros_like(x)
    rows = ((x, o, o, y, z, o), (o, y, o, x, o, z), (o, o, z, o, x, y))
    return np.stack([np.stack(row, -1) for row in rows], 1)


@dataclass(frozen=True, eq=False)
class Base:
    """Which parameters torques tell: independent ones, and what of the others is regrouped into each."""

    columns: tuple[int, ...]
    """Independent columns, shape (k,)."""
    regrouped: Array
    """β = regrouped · π, shape (k, p)."""


def base_parameters(regressor: Regressor) -> Base:
    """Columns that no others make, whatever the motion; the outermost bodies' first.

    Args:
        regressor: Of the arm.
    """
    rng, n = np.random.default_rng(0), len(regressor.names)
    motion = (rng.uniform(-np.pi, np.pi, (RANDOM, n)), *rng.normal(0, 2, (2, RANDOM, n)))
    Y = regressor(*motion).reshape(RANDOM * n, -1)
    count = len(regressor.bodies)
    order = [10 * b + k for b in reversed(range(count)) for k in range(10)]
    order += list(range(10 * count, Y.shape[1]))
    kept: list[int] = []
    least = DEPENDENT * float(np.linalg.norm(Y, axis=0).max())
    Q = np.zeros((len(Y), 0))
    for column in order:
        x = Y[:, column]
        rest = x - Q @ (Q.T @ x)
        rest -= Q @ (Q.T @ rest)
        if np.linalg.norm(rest) > least:
            kept.append(column)
            Q = np.concatenate([Q, rest[:, None] / np.linalg.norm(rest)], axis=1)
    regrouped = np.linalg.lstsq(Y[:, kept], Y, rcond=None)[0]
    regrouped[np.abs(regrouped) < 1e-9] = 0.0
    return Base(tuple(kept), np.asarray(regrouped, float))
