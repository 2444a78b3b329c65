r"""Where a device's room lies in the cell, and how far off that may be: solves and their covariances.

A registration is the pose :math:`T` of the room in the cell with a covariance :math:`\Sigma` of its error
:math:`(\delta t, \delta\theta)` about a point o of the cell: what it puts at p is truly at

.. math:: p + \delta t + \delta\theta \times (p - o),

so that far from what was touched an error of the turn counts more. All solves are weighted least squares
(Gauss and Newton from a closed form), their covariance is the inverse of the normal matrix.

Both worlds have z up: a headset knows gravity, robots are levelled. How well, ``level`` says [rad]: it holds
the tilt as one more measurement does; with 0 only the turn about z is solved (4 unknowns), with infinity all
6 are. Where nobody says how good a touch is, its error is that of the residuals, and the covariance is
widened so that a region of `CHI` standard deviations holds 95 % all the same: by Fisher's F for as many
degrees of freedom as there are.

Sources: rigid fit, Arun, Huang, Blostein 1987, IEEE PAMI 9(5); error at a target away from the touched
points, Fitzpatrick, West, Maurer 1998, IEEE TMI 17(5); pivot calibration, Yaniv 2015, Proc. SPIE 9415;
robot-world and hand-eye in closed form, Shah 2013, J. Mechanisms Robotics 5(3) 031007 (M: from memory).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np

from seerob.core.transforms import Array, inverse, transform

CHI = 2.7954834829151074
"""Radius that holds 95 % of a normal distribution in space, in standard deviations: the root of the 95 %
quantile of χ² with 3 degrees of freedom."""
STEPS = 6
"""Of Gauss and Newton; they converge quadratically from a closed form."""


@dataclass(frozen=True, eq=False)
class Registration:
    """Where a room lies in the cell; leading batch dimensions are allowed."""

    cell_from_room: Array
    """Shape (..., 4, 4)."""
    covariance: Array
    """Of translation [m] before rotation [rad], in the cell's axes about ``about``, shape (..., 6, 6)."""
    about: Array
    """Point of the cell [m], shape (..., 3)."""
    residuals: Array
    """How far each thing that was touched is from where it is then [m], shape (..., n)."""
    freedom: Array
    """Degrees of freedom that are left, shape (...); infinity where the error was known before."""
    strange: Array
    """How far each touch contradicts all others, in units of what 99.9 % of honest ones stay within,
    shape (..., n); 0 where too few are left to tell."""


def skew(v: Array) -> Array:
    """Matrix of the vector product from the left, shape (..., 3, 3)."""
    x, y, z = (np.asarray(v, float)[..., k] for k in range(3))
    zero = np.zeros_like(x)
    rows = [np.stack([zero, -z, y], -1), np.stack([z, zero, -x], -1), np.stack([-y, x, zero], -1)]
    matrix: Array = np.stack(rows, -2)
    return matrix


def turn(v: Array) -> Array:
    """Rotation matrix of a rotation vector [rad], shape (..., 3, 3)."""
    angle = np.linalg.norm(v, axis=-1)[..., None, None]
    K = skew(v)
    return np.asarray(
        np.eye(3) + np.sinc(angle / np.pi) * K + 0.5 * np.sinc(angle / (2 * np.pi)) ** 2 * K @ K
    )


def vector(R: Array) -> Array:
    """Rotation vector [rad] of a rotation by less than half a turn, shape (..., 3)."""
    axis = 0.5 * np.stack(
        [R[..., 2, 1] - R[..., 1, 2], R[..., 0, 2] - R[..., 2, 0], R[..., 1, 0] - R[..., 0, 1]], -1
    )
    sine = np.linalg.norm(axis, axis=-1)
    cosine = 0.5 * (np.trace(R, axis1=-2, axis2=-1) - 1)
    factor = np.where(sine < 1e-9, 1.0, np.arctan2(sine, cosine) / np.maximum(sine, 1e-12))
    return axis * factor[..., None]


# -- how likely ------------------------------------------------------------------------------------


def fisher_quantile(p: float, freedom: Array) -> Array:
    """Fisher's F with 3 and ``freedom`` degrees of freedom: below it lies a share p (to 0.1 %)."""
    inverse_freedom, log_quantile = _quantiles(p)
    nu = np.clip(np.asarray(freedom, float), 1.0, MOST_FREEDOM)
    return np.asarray(np.exp(np.interp(np.sqrt(1 / nu), inverse_freedom, log_quantile)))


MOST_FREEDOM = 2000.0
"""Beyond it F is that of infinitely many, to 0.2 %."""


@cache
def _quantiles(p: float) -> tuple[Array, Array]:
    root = np.linspace(math.sqrt(1 / MOST_FREEDOM), 1.0, 200)
    nu = 1 / root**2
    low, high = np.full_like(nu, -12.0), np.full_like(nu, 18.0)
    for _ in range(45):
        middle = 0.5 * (low + high)
        below = _fisher(np.exp(middle), nu) < p
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return root, 0.5 * (low + high)


def _fisher(x: Array, nu: Array) -> Array:
    """Share of F with 3 and nu that lies below x: the incomplete beta function, by Simpson's rule."""
    # With 3 x / (3 x + nu) = sin² a it is ∫ sin² cos^(nu-1) / ∫ to a quarter turn.
    return _area(np.arctan(np.sqrt(3 * x / nu)), nu) / _area(np.full_like(nu, np.pi / 2), nu)


def _area(end: Array, nu: Array) -> Array:
    n = 400
    a = end[:, None] * np.linspace(0, 1, n + 1)
    weight = np.ones(n + 1)
    weight[1:-1:2], weight[2:-1:2] = 4.0, 2.0
    power = np.exp((nu[:, None] - 1) * np.log(np.maximum(np.cos(a), 1e-300)))
    return np.asarray((np.sin(a) ** 2 * power * weight).sum(-1) * end / (3 * n))


def _widened(freedom: Array) -> Array:
    """Factor on a covariance of estimated scale, so that `CHI` standard deviations hold 95 %."""
    return np.where(np.isfinite(freedom), 3 * fisher_quantile(0.95, freedom) / CHI**2, 1.0)


# -- touched points --------------------------------------------------------------------------------


def touched(
    room: Array,
    cell: Array,
    *,
    place_error: Array,
    touch_error: float | None = None,
    level: float = 0.0,
    grips: Array | None = None,
    tip_covariance: Array | None = None,
    judge: bool = True,
) -> Registration:
    """Registration from points that were touched.

    Args:
        room: Where they were touched, in the room, z up [m], shape (..., n, 3); n is at least 3 (2 when
            ``level`` is 0).
        cell: Where they are in the cell [m], likewise.
        place_error: Standard deviation of that per axis [m], shape (n,).
        touch_error: Standard deviation of a touch per axis [m]; None where nobody knows: then residuals say.
        level: Standard deviation of the tilt between both verticals, per axis [rad].
        grips: How the controller was turned at each touch, room from grip, shape (..., n, 3, 3).
        tip_covariance: Of the tip in the grip's frame [m²], shape (3, 3): one error that all touches share.
        judge: Whether each touch is compared with all others.

    Raises:
        ValueError: Too few points, or no two of them are apart: nothing tells how the room is turned.
    """
    room, cell = np.asarray(room, float), np.asarray(cell, float)
    n = room.shape[-2]
    least = 2 if level == 0 else 3
    if n < least:
        raise ValueError(f"{n} touches tell no registration: {least} at least")
    spread = cell - cell.mean(-2, keepdims=True)
    if not np.all(np.linalg.norm(spread[..., :2], axis=-1).max(-1) > 1e-3):
        raise ValueError("the touched points lie above one another: nothing tells how the room is turned")
    if np.isinf(level) and not np.all(np.linalg.svd(spread, compute_uv=False)[..., 1] > 1e-3):
        raise ValueError("the touched points lie on a line: nothing tells how the room is turned about it")
    sigma2 = np.full(room.shape[:-2], 0.0 if touch_error is None else touch_error**2)
    place2 = np.broadcast_to(np.asarray(place_error, float) ** 2, room.shape[:-1])
    freedom = np.full(room.shape[:-2], np.inf)
    for _ in range(1 if touch_error is not None else 4):
        variance = np.maximum(sigma2[..., None] + place2, 1e-12)
        R, b, centre, normal, prior = _fit(room, cell, 1 / variance, level)
        off = cell - (np.einsum("...ij,...nj->...ni", R, room - centre[..., None, :]) + b[..., None, :])
        if touch_error is None:
            held = np.trace(np.linalg.solve(normal, prior), axis1=-2, axis2=-1)
            freedom = np.maximum(3 * n - 6 + held, 1.0)
            seen = (off**2).sum((-1, -2)) / freedom
            sigma2 = np.maximum(seen - place2.mean(-1), 0.05 * seen)
    covariance = np.linalg.inv(normal)
    if level == 0:
        covariance[..., 3:5, :] = covariance[..., :, 3:5] = 0.0
    covariance = covariance * _widened(freedom)[..., None, None]
    if grips is not None and tip_covariance is not None:
        covariance = covariance + _of_the_tip(room, R, centre, 1 / variance, normal, grips, tip_covariance)
    return Registration(
        cell_from_room=_pose(R, b - np.einsum("...ij,...j->...i", R, centre)),
        covariance=covariance,
        about=b,
        residuals=np.linalg.norm(off, axis=-1),
        freedom=freedom,
        strange=_strange(room, cell, place_error, touch_error, level) if judge else np.zeros(room.shape[:-1]),
    )


def _fit(room: Array, cell: Array, weight: Array, level: float) -> tuple[Array, Array, Array, Array, Array]:
    """Rotation, where the middle of the touches comes to be, that middle, normal matrix, and the level's."""
    total = weight.sum(-1)
    centre = (weight[..., None] * room).sum(-2) / total[..., None]
    goal = (weight[..., None] * cell).sum(-2) / total[..., None]
    a, q = room - centre[..., None, :], cell - goal[..., None, :]
    if np.isinf(level):
        R = _kabsch(a, q, weight)
    else:
        sine = (weight * (a[..., 0] * q[..., 1] - a[..., 1] * q[..., 0])).sum(-1)
        cosine = (weight * (a[..., 0] * q[..., 0] + a[..., 1] * q[..., 1])).sum(-1)
        yaw = np.zeros((*sine.shape, 3))
        yaw[..., 2] = np.arctan2(sine, cosine)
        R = turn(yaw)
    held = np.zeros((6, 6))
    stiff = 0.0 if np.isinf(level) else 1 / max(level, 1e-7) ** 2
    held[3, 3] = held[4, 4] = stiff
    b = goal.copy()
    for _ in range(STEPS):
        r = np.einsum("...ij,...nj->...ni", R, a)
        J = np.concatenate([np.broadcast_to(np.eye(3), (*r.shape, 3)), -skew(r)], -1)
        off = cell - r - b[..., None, :]
        normal = np.einsum("...nik,...n,...nil->...kl", J, weight, J) + held
        right = np.einsum("...nik,...n,...ni->...k", J, weight, off)
        right[..., 3:5] -= stiff * _tilt(R)
        step = np.linalg.solve(normal, right[..., None])[..., 0]
        b = b + step[..., :3]
        R = turn(step[..., 3:]) @ R
    return R, b, centre, normal, held


def _tilt(R: Array) -> Array:
    """How far a rotation leans the vertical [rad], as a rotation vector across it, shape (..., 2)."""
    up = R[..., :, 2]
    lean = np.stack([-up[..., 1], up[..., 0]], -1)
    sine = np.linalg.norm(lean, axis=-1, keepdims=True)
    angle = np.arctan2(sine, up[..., 2:])
    return np.asarray(lean * np.where(sine < 1e-12, 1.0, angle / np.maximum(sine, 1e-12)))


def _kabsch(a: Array, q: Array, weight: Array) -> Array:
    U, _, Vt = np.linalg.svd(np.einsum("...ni,...n,...nj->...ij", q, weight, a))
    sign = np.sign(np.linalg.det(U @ Vt))
    keep = np.ones((*sign.shape, 3))
    keep[..., 2] = sign
    return np.asarray((U * keep[..., None, :]) @ Vt)


def _of_the_tip(
    room: Array, R: Array, centre: Array, weight: Array, normal: Array, grips: Array, tip: Array
) -> Array:
    """What an error of the tip that all touches share does to the solution, shape (..., 6, 6)."""
    r = np.einsum("...ij,...nj->...ni", R, room - centre[..., None, :])
    J = np.concatenate([np.broadcast_to(np.eye(3), (*r.shape, 3)), -skew(r)], -1)
    moved = R[..., None, :, :] @ grips
    gain = np.linalg.solve(normal, np.einsum("...nik,...n,...nij->...kj", J, weight, moved))
    return np.asarray(gain @ tip @ np.swapaxes(gain, -1, -2))


def _strange(room: Array, cell: Array, place_error: Array, touch_error: float | None, level: float) -> Array:
    """How far each touch is from the registration of all others, as `Registration.strange`, (..., n)."""
    n = room.shape[-2]
    found = np.zeros(room.shape[:-1])
    place_error = np.broadcast_to(np.asarray(place_error, float), (n,))
    if n < (3 if level == 0 else 4):
        return found
    for k in range(n):
        rest = [i for i in range(n) if i != k]
        try:
            others = touched(
                room[..., rest, :],
                cell[..., rest, :],
                place_error=place_error[rest],
                touch_error=touch_error,
                level=level,
                judge=False,
            )
        except ValueError:
            continue
        off = np.linalg.norm(put(others, room[..., k, :]) - cell[..., k, :], axis=-1)
        # The touch itself is as good as the others were.
        own = (others.residuals**2).sum(-1) / np.maximum(others.freedom, 1) if touch_error is None else 0.0
        own = np.asarray(own) + (touch_error or 0.0) ** 2 + place_error[k] ** 2
        spread = CHI * np.sqrt(np.linalg.eigvalsh(at(others, cell[..., k, :]))[..., -1] + own)
        farther = np.sqrt(3 * fisher_quantile(0.999, others.freedom)) / CHI
        if touch_error is None:
            farther = farther / np.sqrt(_widened(others.freedom))
            spread = np.sqrt(spread**2 + (_widened(others.freedom) - 1) * CHI**2 * own)
        found[..., k] = off / (spread * farther)
    return found


# -- what follows from it --------------------------------------------------------------------------


def put(registration: Registration, room: Array) -> Array:
    """Where points of the room are in the cell [m], shape (..., 3)."""
    T = registration.cell_from_room
    return np.asarray(np.einsum("...ij,...j->...i", T[..., :3, :3], room) + T[..., :3, 3])


def at(registration: Registration, cell: Array) -> Array:
    """Covariance of the error at points of the cell [m²], shape (..., 3, 3)."""
    return covariance_at(registration.covariance, registration.about, cell)


def covariance_at(covariance: Array, about: Array, cell: Array) -> Array:
    """Covariance of the error at points of the cell [m²], shape (..., 3, 3).

    Args:
        covariance: As `Registration.covariance`.
        about: Its point of the cell [m].
        cell: The points [m], shape (..., 3).
    """
    lever = np.asarray(cell, float) - about
    J = np.concatenate([np.broadcast_to(np.eye(3), (*lever.shape, 3)), -skew(lever)], -1)
    return np.asarray(J @ covariance @ np.swapaxes(J, -1, -2))


def bound(covariance: Array, about: Array, cell: Array, reach: Array) -> Array:
    """How far anything within ``reach`` [m] of points of the cell may be off, 95 % [m], shape (...)."""
    here = np.linalg.eigvalsh(covariance_at(covariance, about, cell))[..., -1]
    turned = np.linalg.eigvalsh(covariance[..., 3:, 3:])[..., -1]
    return np.asarray(CHI * (np.sqrt(np.maximum(here, 0)) + reach * np.sqrt(np.maximum(turned, 0))))


def nudged(registration: Registration, by: Array) -> Registration:
    """A registration that somebody moved by hand, about its point.

    That it had to be moved says that it was off by as much: its square is added to the covariance.

    Args:
        registration: Before.
        by: Translation [m] and rotation vector [rad] in the cell's axes, shape (6,).
    """
    T, o = registration.cell_from_room, registration.about
    about, back = transform(None, o), transform(None, -o)
    moved = transform(turn(by[3:]), by[:3])
    return Registration(
        about @ moved @ back @ T,
        registration.covariance + np.outer(by, by),
        o + by[:3],
        registration.residuals,
        registration.freedom,
        registration.strange,
    )


def contradiction(registration: Registration, room: Array, cell: Array, error: float) -> tuple[float, float]:
    """One touch of a known place against a registration: how far it is off, and how far it may be [m].

    Args:
        registration: That is checked.
        room: Where it was touched [m], shape (3,).
        cell: Where it is [m], shape (3,).
        error: Standard deviation of touch and place per axis [m].
    """
    off = float(np.linalg.norm(put(registration, room) - cell))
    largest = float(np.linalg.eigvalsh(at(registration, cell))[-1])
    return off, CHI * math.sqrt(largest + error**2)


# -- poses at a known place: a tracker, a printed tag ----------------------------------------------


def placed(
    cell_from_thing: Array,
    room_from_thing: Array,
    *,
    place_error: tuple[float, float],
    pose_error: tuple[float, float],
    level: float,
) -> Registration:
    """Registration from something whose pose in the cell is known, and that the room's device sees.

    Args:
        cell_from_thing: Where it is, shape (4, 4).
        room_from_thing: Where it is seen, shape (n, 4, 4): several looks at the same thing.
        place_error: Standard deviations of where it is: position [m], turn [rad], per axis.
        pose_error: Standard deviations of one look, position [m] and turn [rad] per axis: what is common to
            all looks is not made less by many.
        level: As for `touched`.
    """
    looks = np.asarray(room_from_thing, float)
    mean = looks[0]
    for _ in range(STEPS):
        turns = vector(looks[:, :3, :3] @ mean[:3, :3].T).mean(0)
        mean = transform(turn(turns) @ mean[:3, :3], looks[:, :3, 3].mean(0))
    T = cell_from_thing @ inverse(mean)
    position, angle = (place_error[k] ** 2 + pose_error[k] ** 2 for k in range(2))
    covariance = np.diag([position] * 3 + [angle] * 3)
    about = np.asarray(cell_from_thing[:3, 3], float)
    if not np.isinf(level):
        # The tilt is measured twice: by the thing, and by both verticals.
        share = angle / (angle + level**2) if angle else 0.0
        tilt = np.append(_tilt(T[:3, :3]), 0.0)
        T = transform(None, about) @ transform(turn(-share * tilt)) @ transform(None, -about) @ T
        covariance[3, 3] = covariance[4, 4] = (1 - share) * angle
    off = np.linalg.norm(looks[:, :3, 3] - mean[:3, 3], axis=-1)
    return Registration(T, covariance, about, off, np.array(np.inf), np.zeros(len(looks)))


def looked(
    cell_from_camera: Array,
    room_from_camera: Array,
    covariance: Array,
    *,
    about: Array,
    place_error: tuple[float, float],
    level: float,
) -> Registration:
    """Registration from looks of the device's own camera at a board of which the place is known.

    What looks disagree by beyond their own errors, as where the device is off or its lens is another than
    it says, widens the covariance as residuals of touches do. What all looks share cannot be seen so: that of
    the board's own place is added.

    Args:
        cell_from_camera: By the board, shape (n, 4, 4).
        room_from_camera: By the device, shape (n, 4, 4).
        covariance: Of errors of the first, translation [m] before rotation [rad], in the camera's axes about
            its eye, shape (n, 6, 6).
        about: Where the board is [m], shape (3,).
        place_error: Standard deviations of that: position [m], turn [rad], per axis.
        level: As for `touched`.

    Raises:
        ValueError: Too few looks, or all from one place: nothing tells what they are off by.
    """
    C, G = np.asarray(cell_from_camera, float), np.asarray(room_from_camera, float)
    n = len(C)
    eyes = C[:, :3, 3]
    apart = np.linalg.norm(eyes[:, None] - eyes[None], axis=-1) + 1e9 * np.eye(n)
    if n < LEAST_LOOKS or float(apart.min()) < APART:
        raise ValueError(
            f"{n} looks: take {LEAST_LOOKS} or more, each {1e3 * APART:.0f} mm or more from every other one"
        )
    about = np.asarray(about, float)
    to_cell = np.zeros((n, 6, 6))
    to_cell[:, :3, :3] = to_cell[:, 3:, 3:] = C[:, :3, :3]
    to_cell[:, :3, 3:] = -skew(about - eyes) @ C[:, :3, :3]
    N = np.linalg.inv(to_cell @ covariance @ np.swapaxes(to_cell, -1, -2))
    held = np.zeros((6, 6))
    if not np.isinf(level):
        held[3, 3] = held[4, 4] = 1 / max(level, 1e-7) ** 2
    each = C @ inverse(G)
    T = each[0]
    for _ in range(STEPS):
        R = T[:3, :3]
        # Where each has what T puts at the board, and how it is turned against it.
        at = each @ inverse(T) @ np.append(about, 1.0)
        off = np.concatenate([at[:, :3] - about, vector(each[:, :3, :3] @ R.T)], -1)
        right = np.einsum("nij,nj->i", N, off)
        right[3:5] -= held[3, 3] * _tilt(R)
        x = np.linalg.solve(N.sum(0) + held, right)
        T = transform(None, about + x[:3]) @ transform(turn(x[3:])) @ transform(None, -about) @ T
    off = off - x
    chi2 = np.einsum("ni,nij,nj->n", off, N, off)
    scale = max(1.0, float(chi2.sum() / (6.0 * n - 6.0)))
    # A device that is off moves and turns what it sees at once: two numbers of each look count.
    freedom = np.array(2.0 * n - 2.0)
    covariance = np.linalg.inv(N.sum(0) / scale + held) * float(_widened(freedom))
    covariance = covariance + np.diag([place_error[0] ** 2] * 3 + [place_error[1] ** 2] * 3)
    others = np.maximum(1.0, (chi2.sum() - chi2) / max(6.0 * (n - 1) - 6.0, 1.0))
    strange = np.sqrt(chi2 / others / LOOK_999) if n > LEAST_LOOKS else np.zeros(n)
    return Registration(T, covariance, about, np.linalg.norm(off[:, :3], axis=-1), freedom, strange)


LEAST_LOOKS, APART = 3, 0.15
"""How many, and how far each camera from every other [m]; our choice."""
LOOK_999 = 22.457744
"""99.9 % quantile of χ² with 6 degrees of freedom."""

# -- the tip of a controller, and a controller strapped to a flange --------------------------------


def pivot(turns: Array, positions: Array) -> tuple[Array, Array, float]:
    """Where the tip of something is that was turned about it, in its own frame.

    Args:
        turns: Room from grip, shape (n, 3, 3).
        positions: Of the grip [m], shape (n, 3).

    Returns:
        The tip [m], shape (3,); its covariance [m²]; the cone it was turned through [rad]. Samples of one
        sweep are alike: they count as if there were one per 3° of the way.

    Raises:
        ValueError: It was hardly turned: nothing tells where the tip is.
    """
    R, p = np.asarray(turns, float), np.asarray(positions, float)
    n = len(p)
    middle = R[n // 2]
    cone = 2 * float(np.linalg.norm(vector(R @ middle.T), axis=-1).max()) if n else 0.0
    A = np.concatenate([R, np.broadcast_to(-np.eye(3), R.shape)], -1).reshape(-1, 6)
    if n < 12 or np.linalg.svd(A, compute_uv=False)[-1] < 0.05 * math.sqrt(n):
        raise ValueError(
            f"{n} samples over {math.degrees(cone):.0f}°: turn the controller about its tip, "
            "in two directions, through 60° or more"
        )
    x, *_ = np.linalg.lstsq(A, -p.reshape(-1), rcond=None)
    s2 = float(((A @ x + p.reshape(-1)) ** 2).sum() / (3 * n - 6))
    way = float(np.linalg.norm(vector(R[1:] @ np.swapaxes(R[:-1], -1, -2)), axis=-1).sum())
    alike = max(n / max(way / math.radians(3), 6.0), 1.0)
    return x[:3], s2 * alike * np.linalg.inv(A.T @ A)[:3, :3], cone


def strapped(flange: Array, grip: Array, *, place_error: float) -> tuple[Registration, Array]:
    """Registration from a controller that is fixed to a flange, wherever on it.

    Args:
        flange: Cell from flange at each pose, shape (n, 4, 4).
        grip: Room from grip at each pose, shape (n, 4, 4).
        place_error: Standard deviation of where the flange is, per axis [m]. It is taken to be common to all
            poses, so that no fit shows it.

    Returns:
        The registration, and flange from grip, shape (4, 4).

    Raises:
        ValueError: Too few poses, or turned too little.
    """
    F, G = np.asarray(flange, float), np.asarray(grip, float)
    n = len(F)
    turns = vector(F[:, :3, :3] @ F[0, :3, :3].T) if n else np.zeros((0, 3))
    apart = np.linalg.svd(turns, compute_uv=False) if n >= 4 else np.zeros(3)
    if n < 5 or apart[1] < 0.3:
        raise ValueError(
            f"{n} poses of the flange do not tell how the controller is strapped to it: give 5 or more, "
            "turned about two axes by 30° or more"
        )
    # R_F R_Y = R_X R_G for all poses: the pair of rotations is the first pair of singular vectors (Shah).
    K = sum(np.kron(g.T, f.T) for f, g in zip(F[:, :3, :3], G[:, :3, :3], strict=True))
    U, _, Vt = np.linalg.svd(K)
    Y, X = (_nearest(v.reshape(3, 3).T) for v in (U[:, 0], Vt[0]))
    if np.linalg.norm(F[0, :3, :3] @ Y - X @ G[0, :3, :3]) > np.linalg.norm(
        F[0, :3, :3] @ Y + X @ G[0, :3, :3]
    ):
        Y = -Y
    if np.linalg.det(X) < 0:
        X, Y = -X, -Y
    A = np.concatenate([np.broadcast_to(np.eye(3), (n, 3, 3)), -F[:, :3, :3]], -1).reshape(-1, 6)
    right = (F[:, :3, 3] - np.einsum("ij,nj->ni", X, G[:, :3, 3])).reshape(-1)
    x, *_ = np.linalg.lstsq(A, right, rcond=None)
    Tx, Ty = transform(X, x[:3]), transform(Y, x[3:])
    about = F[:, :3, 3].mean(0)
    scale = 1.0
    for _ in range(2 * STEPS):
        seen, told = Tx @ G, F @ Ty
        off = np.concatenate(
            [told[:, :3, 3] - seen[:, :3, 3], vector(told[:, :3, :3] @ np.swapaxes(seen[:, :3, :3], -1, -2))],
            -1,
        )
        # Metres and radians weigh by what each is off by.
        spread = np.sqrt((off**2).reshape(n, 2, 3).mean((0, 2)) * n / max(n - 2, 1))
        weight = np.repeat(1 / np.maximum(spread, [1e-6, 1e-6]) ** 2, 3)
        lever = skew(seen[:, :3, 3] - about)
        J = np.zeros((n, 6, 12))
        J[:, :3, :3] = J[:, 3:, 3:6] = np.eye(3)
        J[:, :3, 3:6] = -lever
        J[:, :3, 6:9] = J[:, 3:, 9:] = -F[:, :3, :3]
        N = np.einsum("nik,i,nil->kl", J, weight, J)
        step = np.linalg.solve(N, np.einsum("nik,i,ni->k", J, weight, off))
        Tx = transform(None, about + step[:3]) @ transform(turn(step[3:6])) @ transform(None, -about) @ Tx
        Ty = transform(turn(step[9:]) @ Ty[:3, :3], Ty[:3, 3] + step[6:9])
    freedom = np.array(float(6 * n - 12))
    scale = n / max(n - 2, 1) * float(_widened(freedom))
    covariance = np.linalg.inv(N)[:6, :6] * scale
    covariance[:3, :3] += place_error**2 * np.eye(3)
    residuals = np.linalg.norm(off[:, :3], axis=-1)
    return Registration(Tx, covariance, about, residuals, freedom, np.zeros(n)), Ty


def _nearest(R: Array) -> Array:
    U, _, Vt = np.linalg.svd(R)
    return np.asarray(U @ Vt)


def _pose(R: Array, t: Array) -> Array:
    T = np.zeros((*R.shape[:-2], 4, 4))
    T[..., :3, :3], T[..., :3, 3], T[..., 3, 3] = R, t, 1.0
    return T
