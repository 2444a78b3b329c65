r"""What acts on a loose workpiece at a step: the spring that holds it, the surface that runs below it.

The formulae are those of `seerob.twin.machines.loose`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from seerob.core.transforms import Array
from seerob.kernels.bound import Layout
from seerob.kernels.posture_fit import logarithm

Indices = NDArray[np.int64]
PYRAMIDAL = 0
"""``mjCONE_PYRAMIDAL``"""
MASS, PULLED, RADIUS, FRICTION, LARGEST, NEAR, FASTEST, QUICKEST = range(8)
"""Where `Piece.figures` has what."""


class Bodies(NamedTuple):
    """Of all of MuJoCo's bodies, as `MjData` and `MjModel` have it."""

    xpos: Array
    """[m], shape (n, 3)."""
    xmat: Array
    """Shape (n, 9)."""
    ximat: Array
    """Shape (n, 9)."""
    xipos: Array
    """[m], shape (n, 3)."""
    cvel: Array
    """[rad/s, m/s], shape (n, 6)."""
    subtree_com: Array
    """[m], shape (n, 3)."""
    root: NDArray[np.int32]
    """``MjModel.body_rootid``, shape (n,)."""
    xfrc: Array
    """``MjData.xfrc_applied`` [N, N·m], shape (n, 6)."""
    gravity: Array
    """[m/s²], shape (3,)."""


BODIES = Layout(Bodies, [*[(np.float64, 2)] * 6, (np.int32, 1), (np.float64, 2), (np.float64, 1)])


class Piece(NamedTuple):
    """What of a workpiece is the same at all instants."""

    ipos: Array
    """Centre of mass in its frame [m], shape (3,)."""
    inertia: Array
    """Principal moments about it [kg·m²], shape (3,)."""
    figures: Array
    """Its mass, the mass by which a spring is as stiff as it is [kg], the radius of the ball about its centre
    of mass that contains it [m], its coefficient of friction, the largest of its moments [kg·m²]; how near
    its carrier, beside that radius, a spring has it where it is [m], and how fast a spring makes it at the
    most [m/s], [rad/s]; shape (8,)."""


PIECE = Layout(Piece, [(np.float64, 1)] * 3)
_bodies_in, _piece_in = BODIES.read, PIECE.read


@njit(cache=True, nogil=True, error_model="numpy")
def _velocity(cvel: Array, about: Array, at: Array, out: Array) -> None:
    """Linear velocity of a point ``at`` [m] of a body, into ``out`` (3,), see ``mj_objectVelocity``.

    Args:
        cvel: Angular and linear velocity of the body, shape (6,).
        about: The point that the linear one is of [m], ``MjData.subtree_com`` of the root.
        at: The point [m], shape (3,).
        out: Written [m/s].
    """
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        out[i] = cvel[3 + i] + cvel[j] * (at[k] - about[k]) - cvel[k] * (at[j] - about[j])


@njit(cache=True, nogil=True, error_model="numpy")
def _at_most(v: Array, most: float) -> None:
    """Shorten a vector (3,) to a length."""
    far = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    if far > most:
        for i in range(3):
            v[i] *= most / far


@njit(cache=True, nogil=True, error_model="numpy")
def pull(
    bodies: Indices, piece: Indices, body: int, carrier: int, fixed: Array, omega: float, firm: bool,
    reels: bool, reel: float,
) -> tuple[float, bool]:  # fmt: skip
    """Add the forces of a spring that pulls a workpiece to ``MjData.xfrc_applied``.

    Args:
        bodies: Of `BODIES`; forces are added to its ``xfrc``.
        piece: Of `PIECE`.
        body: The workpiece.
        carrier: Body that the spring is fixed to.
        fixed: Where in its frame the spring pulls to, shape (4, 4); moved on while it ``reels``.
        omega: Natural frequency [rad/s].
        firm: Whether the carrier feels moments.
        reels: Whether the workpiece is still on its way.
        reel: How far the spring is reeled in at this step [m].

    Returns:
        How far the workpiece is from where it is pulled to [m], and whether it is still on its way.
    """
    xpos, xmat, ximat, xipos, cvel, subtree_com, root, xfrc, gravity = _bodies_in(bodies, 0)
    ipos, inertia, figures = _piece_in(piece, 0)
    mass, pulled, radius = figures[MASS], figures[PULLED], figures[RADIUS]
    near, fastest, quickest = figures[NEAR], figures[FASTEST], figures[QUICKEST]
    R, H, axes = (
        xmat[carrier].copy().reshape(3, 3),
        xmat[body].copy().reshape(3, 3),
        ximat[body].copy().reshape(3, 3),
    )
    wanted, to = np.zeros((3, 3)), np.zeros(3)
    for i in range(3):
        to[i] = xpos[carrier, i]
        for k in range(3):
            to[i] += R[i, k] * fixed[k, 3]
            for j in range(3):
                wanted[i, j] += R[i, k] * fixed[k, j]
    for i in range(3):
        for k in range(3):
            to[i] += wanted[i, k] * ipos[k]
    if reels:
        away = to - xpos[carrier]
        far, least = math.sqrt(away[0] ** 2 + away[1] ** 2 + away[2] ** 2), radius + near
        rest = max(far - reel, least)
        if far > least:
            away *= rest / far - 1
            for i in range(3):
                to[i] += away[i]
                for k in range(3):
                    fixed[k, 3] += R[i, k] * away[i]
        reels = rest > least
    speed, own, spin = np.zeros(3), np.empty(3), np.zeros(3)
    _velocity(cvel[body], subtree_com[root[body]], xipos[body], own)
    if carrier:
        spin[:] = cvel[carrier, :3]
        _velocity(cvel[carrier], subtree_com[root[carrier]], to, speed)
    gap, turn = to - xipos[body], np.empty(3)
    logarithm(wanted, H, turn)
    speed += 0.5 * omega * gap
    _at_most(speed, fastest)
    spin += 0.5 * omega * turn
    _at_most(spin, quickest)
    spin -= cvel[body, :3]
    torque, local = np.zeros(3), np.zeros(3)
    for i in range(3):
        for k in range(3):
            local[i] += axes[k, i] * spin[k]
        local[i] *= 2 * omega * inertia[i]
    for i in range(3):
        for k in range(3):
            torque[i] += axes[i, k] * local[k]
    force = 2 * omega * pulled * (speed - own) - mass * gravity
    for i in range(3):
        xfrc[body, i] += force[i]
        xfrc[body, 3 + i] += torque[i]
    if carrier:
        lever = np.empty(3)
        for i in range(3):
            lever[i] = (xipos[body, i] if firm else xpos[carrier, i]) - xipos[carrier, i]
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            xfrc[carrier, i] -= force[i]
            xfrc[carrier, 3 + i] -= lever[j] * force[k] - lever[k] * force[j] + (torque[i] if firm else 0.0)
    return math.sqrt(gap[0] ** 2 + gap[1] ** 2 + gap[2] ** 2), reels


@njit(cache=True, nogil=True, error_model="numpy")
def pressed(
    geom: NDArray[np.int32], frame: Array, dim: NDArray[np.int32], address: NDArray[np.int32], force: Array,
    cone: int, body_of: NDArray[np.int32], piece_of: Indices, surface_of: Indices, normal: Array,
    touch: NDArray[np.bool_],
) -> int:  # fmt: skip
    """Sum the normal forces with which workpieces lie on surfaces that run.

    Args:
        geom: Two geometries of each contact, shape (n, 2); ``frame``, ``dim`` and ``address`` likewise.
        frame: Shape (n, 9), the normal first, from the first geometry to the second.
        dim: Of each contact.
        address: Of its forces in ``force``; -1 of one that has none.
        force: ``MjData.efc_force`` [N].
        cone: `PYRAMIDAL`, or elliptic.
        body_of: Body of each geometry.
        piece_of: Row of the workpiece that a body is, -1 for none.
        surface_of: Row of the surface that a body is, -1 for none.
        normal: Written: forces on workpieces [N], shape (p, s, 3).
        touch: Written: whether they touch, shape (p, s).

    Returns:
        How many contacts there are.
    """
    normal[:] = 0.0
    touch[:] = False
    count = 0
    for c in range(len(geom)):
        one, other = body_of[geom[c, 0]], body_of[geom[c, 1]]
        sign = 1.0
        p, s = piece_of[other], surface_of[one]
        if p < 0 or s < 0:
            p, s, sign = piece_of[one], surface_of[other], -1.0
        if p < 0 or s < 0:
            continue
        count += 1
        touch[p, s] = True
        first = address[c]
        if first < 0:
            continue
        rows = 1 if dim[c] == 1 or cone != PYRAMIDAL else 2 * (dim[c] - 1)
        size = 0.0
        for row in range(first, first + rows):
            size += force[row]
        for i in range(3):
            normal[p, s, i] += sign * size * frame[c, i]
    return count


@njit(cache=True, nogil=True, error_model="numpy")
def drag(bodies: Indices, piece: Indices, body: int, rides: Array, normal: Array, dt: float) -> None:
    """Add the friction of a surface that runs to ``MjData.xfrc_applied``.

    Args:
        bodies: Of `BODIES`; forces are added to its ``xfrc``.
        piece: Of `PIECE`.
        body: The workpiece.
        rides: Velocity of the surface [m/s], shape (3,).
        normal: Force on the workpiece [N], shape (3,).
        dt: Of a step [s].
    """
    all_, own = _bodies_in(bodies, 0), _piece_in(piece, 0)
    xipos, cvel, subtree_com, root, xfrc = all_.xipos, all_.cvel, all_.subtree_com, all_.root, all_.xfrc
    mass, radius = own.figures[MASS], own.figures[RADIUS]
    friction, inertia = own.figures[FRICTION], own.figures[LARGEST]
    pressure = math.sqrt(normal[0] ** 2 + normal[1] ** 2 + normal[2] ** 2)
    if pressure == 0.0:
        return
    slip = np.empty(3)
    _velocity(cvel[body], subtree_com[root[body]], xipos[body], slip)
    along, spin = 0.0, 0.0
    for i in range(3):
        slip[i] -= rides[i]
        along += slip[i] * normal[i] / pressure
        spin += cvel[body, i] * normal[i] / pressure
    for i in range(3):
        slip[i] -= along * normal[i] / pressure
    fast, most = math.sqrt(slip[0] ** 2 + slip[1] ** 2 + slip[2] ** 2), friction * pressure
    pull = min(most, 0.5 * mass * fast / dt) / fast if fast > 0 else 0.0
    turn = math.copysign(min(0.5 * most * radius, 0.5 * inertia * abs(spin) / dt), spin)
    for i in range(3):
        xfrc[body, i] -= pull * slip[i]
        xfrc[body, 3 + i] -= turn * normal[i] / pressure
