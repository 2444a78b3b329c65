r"""What a recorded excitation tells of an arm: base inertial parameters, friction, payload, and how surely.

Of every moving body b ten parameters :math:`\pi_b = (m, h, I)` about its frame, and of every joint a rotor
inertia, are in the torques by

.. math:: \tau = Y(q, \dot q, \ddot q)\,\pi + F_c\,\mathrm{sgn}(\dot q) + F_v\,\dot q + o + \varepsilon .

No motion tells them all: columns of Y that follow from the others, by random motions of the same arm, are
regrouped into these, :math:`\beta = \pi_1 + K \pi_2` (Gautier and Khalil 1990, from memory; the text was not
seen). β and friction are fitted as `seerob.session.explanation` fits, with the same intervals.

The mass matrix depends on β alone. A robot file needs masses that a body can have: of all such that make β as
it was fitted, weighed by its covariance, those nearest to the envelope's shapes are taken (pseudo-inertias
:math:`U U^T`, Rucker and Wensing 2022, from memory), with the mass that the maker states for the whole arm.
Their *error* is the least s with :math:`(1-s) M \preceq M' \preceq (1+s) M`, where M' is the mass matrix of β
drawn from its distribution, in sampled postures, for 95 of 100 draws: every criterion that scales masses by s
holds M' between its ends.

Of motor currents i, :math:`\tau_j = k_j i_j`. A log alone leaves all torque constants :math:`k_j` open by one
common factor. Either somebody states them, with a tolerance: then :math:`\beta` is linear in each, and what
the largest errors make of it is added to every interval. Or a second log carries a known mass: then

.. math:: i_j = g_j\,(Y_j\,\pi + P_j\,p + \text{friction}), \qquad g_j = 1/k_j, \qquad p_1 = m

is fitted by Gauss and Newton's method, noise in i alone; what the tolerance of m makes of it is added.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import PurePath
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from seerob.core.errors import InputError
from seerob.core.shapes import Solid
from seerob.core.transforms import Array
from seerob.description.description import Description, JointKind, Link, groups
from seerob.description.lint import box
from seerob.session.explanation import (
    HALF_WINDOW,
    LEAST,
    MOST,
    NORMAL_95,
    SLOW,
    Figure,
    Fitted,
    fit,
    friction,
    slopes,
    spread,
)
from seerob.twin.controller_check import ControllerLog

PARAMETERS = ("m", "hx", "hy", "hz", "Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz")
"""Of one body, about its frame: [kg], [kg·m], [kg·m²]."""
UNITS = ("kg", *("kg·m",) * 3, *("kg·m²",) * 6)
RANDOM, DEPENDENT = 40, 1e-7
"""Random motions by which columns are told apart; a remainder up to this share of the largest is none."""
DRAWS, POSTURES = 400, 100
"""Of the parameters and of the arm, by which the error of the mass matrix is found."""
PRIOR = 3.0
"""How far logarithms of sizes and masses may be from those of the shapes, as a standard deviation."""
STEPS = 120
SOUGHT = 0.95
ROUNDS = 40
"""Steps of Gauss and Newton's method."""
LOOSEST = 0.9
"""From this error on a file would say nothing."""

Of = Callable[[Array], Array]


# -- mathematics ------------------------------------------------------------------------------


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


def parameters(theta: Array) -> Array:
    """Ten parameters of bodies from logarithms of the diagonals and the rest of U, (B, 10) → (B, 10)."""
    U = np.zeros((len(theta), 4, 4))
    U[:, np.arange(4), np.arange(4)] = np.exp(theta[:, :4])
    for k, (i, j) in enumerate(((0, 1), (0, 2), (1, 2), (0, 3), (1, 3), (2, 3))):
        U[:, i, j] = theta[:, 4 + k]
    J = U @ U.swapaxes(1, 2)
    S = J[:, :3, :3]
    inertia = np.trace(S, axis1=1, axis2=2)[:, None, None] * np.eye(3) - S
    parts = [J[:, 3, 3:4], J[:, :3, 3]]
    parts += [inertia[:, i, j][:, None] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
    return np.concatenate(parts, axis=1)


def _theta(mass: float, com: Array, half: Array) -> Array:
    """Logarithms of a box of a mass [kg], with its centre and half sides [m]."""
    S = mass * (np.diag(np.maximum(half, 1e-3) ** 2) / 3 + np.outer(com, com))
    J = np.block([[S, mass * com[:, None]], [mass * com[None], np.array([[mass]])]])
    # U is upper triangular: Cholesky of J from the other end.
    U = np.linalg.cholesky(J[::-1, ::-1])[::-1, ::-1]
    return np.array([*np.log(np.diag(U)), U[0, 1], U[0, 2], U[1, 2], U[0, 3], U[1, 3], U[2, 3]])


# -- what a log tells -------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Identified:
    """What a log tells of an arm."""

    robot: str
    source: str
    samples: int
    names: tuple[str, ...]
    """Of base parameters: the one that stands for each."""
    units: tuple[str, ...]
    values: tuple[Figure, ...]
    coulomb: tuple[Figure, ...]
    viscous: tuple[Figure, ...]
    offset: tuple[Figure, ...]
    left: Array
    """Root mean square of the torques that the fit leaves, per joint [N·m or N]."""
    condition: float
    regressor: Regressor
    base: Base
    fitted: Fitted
    payload: tuple[Figure, ...] = ()
    """Mass [kg], first moments [kg·m] and moments of inertia [kg·m²] in the frame of the last body."""
    constants: tuple[Figure, ...] = ()
    """Of currents: torque constants of the joints [N·m/A or N/A]."""
    systematic: Array | None = None
    """What errors of constants or of a known mass do to the fit at the most, each in a row, shape (e, p)."""

    @property
    def hidden(self) -> tuple[str, ...]:
        """Base parameters that this motion does not tell."""
        return tuple(n for n, value in zip(self.names, self.values, strict=True) if not value.determined)

    @property
    def never(self) -> tuple[str, ...]:
        """Parameters that no motion tells by themselves: they are in others, or in none."""
        shared = (np.abs(self.base.regrouped) > 0).sum(axis=0)
        alone = {c for k, c in enumerate(self.base.columns) if (self.base.regrouped[k] != 0).sum() == 1}
        columns = self.regressor.columns
        return tuple(name for c, name in enumerate(columns) if c not in alone and shared[c] >= 0)


class Known(NamedTuple):
    """What turns currents into torques: constants of the joints, or a mass that the second log carries."""

    constants: tuple[float, ...] = ()
    """Torque per current at each joint, gears included [N·m/A or N/A]."""
    payload: float | None = None
    """[kg]"""
    tolerance: float = 0.0
    """By which share each constant, or the mass, may be off."""


NOTHING_KNOWN = Known()


def identify(
    description: Description,
    gravity: Array,
    said: ControllerLog,
    carrying: ControllerLog | None = None,
    known: Known = NOTHING_KNOWN,
) -> Identified:
    """Fit base parameters and friction to a log, and a payload to a second one.

    Args:
        description: The arm.
        gravity: In the frame of its base [m/s²], shape (3,).
        said: Of the bare arm; torques are needed, or currents and what is ``known``.
        carrying: Of the same arm with a payload on it, after the first.
        known: Of currents.

    Raises:
        InputError: No torques, too little motion, or currents of which nobody knows the common factor.
    """
    regressor = Regressor(description, gravity)
    base = base_parameters(regressor)
    n = len(regressor.names)
    if said.tau is not None and known != NOTHING_KNOWN:
        what = "torques are measured already"
        raise InputError.at(said.file, "currents", what, "leave out --constants and --payload")
    if said.tau is None and said.current is not None:
        if not known.constants:
            return _of_currents(regressor, base, said, carrying, known)
        if len(known.constants) != n:
            what = f"{len(known.constants)} torque constants for {n} joints"
            raise InputError.at(said.file, "currents", what, "give one per joint, from the base on")
        said = said._replace(tau=said.current * np.array(known.constants))
        if carrying is not None and carrying.tau is None and carrying.current is not None:
            carrying = carrying._replace(tau=carrying.current * np.array(known.constants))
    Y, friction_columns, tau, used = _rows(regressor, said)
    columns = np.concatenate([Y[..., list(base.columns)], friction_columns], axis=-1)
    if carrying is not None:
        more, more_friction, more_tau, more_used = _rows(regressor, carrying)
        last = 10 * (len(regressor.bodies) - 1)
        upper = np.concatenate([columns, np.zeros((*tau.shape, 10))], axis=-1)
        lower = np.concatenate(
            [more[..., list(base.columns)], more_friction, more[..., last : last + 10]], axis=-1
        )
        columns = np.concatenate([upper, lower])
        tau, used = np.concatenate([tau, more_tau]), np.concatenate([used, more_used])
    found = fit(columns, tau, used)
    systematic = None
    if known.constants:
        # What one joint's torques alone add to the fit: it grows with that joint's constant.
        systematic = np.array([_of_joint(columns, tau, used, found, j) for j in range(n)]) * known.tolerance
    figures = _figures(found, systematic)
    constants = [Figure(value, known.tolerance * value) for value in known.constants]
    return _identified(regressor, base, said, found, figures, tau, tuple(constants), systematic)


def _figures(found: Fitted, systematic: Array | None) -> list[Figure]:
    """Values with halves of their intervals: 95 % of the noise, and the most that errors make of them."""
    more = np.zeros(len(found.values)) if systematic is None else np.abs(systematic).sum(axis=0)
    return [
        Figure(float(x), float(NORMAL_95 * np.sqrt(max(v, 0.0)) + m) if told else float("inf"))
        for x, v, told, m in zip(found.values, np.diag(found.covariance), found.determined, more, strict=True)
    ]


def _of_joint(columns: Array, measured: Array, used: NDArray[np.bool_], found: Fitted, j: int) -> Array:
    """Of a weighted fit, the part that what is measured of one joint makes, shape (p,)."""
    sigma = np.sqrt(np.nanmean(found.residuals**2, axis=0))
    A, b = columns / sigma[:, None], measured / sigma
    rows = A[used]
    alone = np.zeros_like(used)
    alone[:, j] = used[:, j]
    scale = np.maximum(np.linalg.norm(rows, axis=0), 1e-300)
    return np.asarray(np.linalg.lstsq(rows / scale, np.where(alone, b, 0.0)[used], rcond=1e-10)[0] / scale)


def _of_currents(
    regressor: Regressor, base: Base, said: ControllerLog, carrying: ControllerLog | None, known: Known
) -> Identified:
    """Fit currents of two logs, of which the second carries a known mass.

    Raises:
        InputError: There is no such log, or it does not tell the common factor.
    """
    if known.payload is None or carrying is None or carrying.current is None:
        what = "are currents [A]: alone they leave every mass open by one common factor"
        remedy = (
            "give torque constants (--constants), or a second log of currents with a payload of known mass "
            "(--carrying, --payload); each with --tolerance and --known-by"
        )
        raise InputError.at(said.file, "actual_current", what, remedy)
    n, k = len(regressor.names), len(base.columns)
    Y, F, current, used = _rows(regressor, said._replace(tau=said.current))
    more, more_F, more_current, more_used = _rows(regressor, carrying._replace(tau=carrying.current))
    first = len(current)
    current, used = np.concatenate([current, more_current]), np.concatenate([used, more_used])
    last = 10 * (len(regressor.bodies) - 1)
    load = np.concatenate([np.zeros((first, n, 10)), more[..., last : last + 10]])
    of_base = np.concatenate([Y, more])[..., list(base.columns)]
    # Torques: those of the known mass, and linear in the rest. Currents: g times that.
    torques = np.concatenate([of_base, np.concatenate([F, more_F]), load[..., 1:]], axis=-1)
    weight = load[..., 0] * known.payload
    p = torques.shape[-1]
    each = np.eye(n)
    x, g = _begun(torques[used], weight[used], (current[..., None] * each)[used])
    for _ in range(ROUNDS if np.isfinite(g).all() else 0):
        needed = torques @ x + weight
        columns = np.concatenate([g[:, None] * torques, needed[..., None] * each], axis=-1)
        found = fit(columns, current + g * (torques @ x), used)
        off = float(np.abs(found.values[p:] / g - 1).max())
        x, g = found.values[:p], found.values[p:]
        if off < 1e-6:
            break
    else:
        g = np.zeros(n)
    halves = NORMAL_95 * np.sqrt(np.maximum(np.diag(found.covariance)[p:], 0)) if (g > 0).all() else g
    if not (g > 2 * halves).all() or not found.determined[p:].all():
        what = f"{known.payload:g} kg more does not show in them: the common factor stays open"
        raise InputError.at(carrying.file, "actual_current", what, "carry more, and move as in the first log")
    # All that weighs grows with the known mass, and the currents per torque shrink.
    grow = np.concatenate([x, -g])[None] * known.tolerance
    figures = _figures(found, grow)
    constants = tuple(Figure(1 / each.value, each.half / each.value**2) for each in figures[p:])
    load_mass = Figure(known.payload, known.payload * known.tolerance)
    figures = [*figures[: k + 3 * n], load_mass, *figures[k + 3 * n : p]]
    found = replace(found, residuals=found.residuals / g)
    return _identified(regressor, base, said, found, figures, current, constants, grow)


def _begun(torques: Array, weight: Array, currents: Array) -> tuple[Array, Array]:
    """Where Gauss and Newton's method begins: parameters (p,), currents per torque (n,), NaN where none are.

    Of :math:`C k = T y + u w`, which has no scale, the k is taken of which the least is left relative to the
    currents, then u, which scales.

    Args:
        torques: T, shape (rows, p).
        weight: Torques of the known mass w, shape (rows,).
        currents: C, each joint's in its column, shape (rows, n).
    """
    A = np.concatenate([torques, weight[:, None]], axis=1)
    Q, _ = np.linalg.qr(A / np.maximum(np.linalg.norm(A, axis=0), 1e-300))
    size = np.linalg.norm(currents, axis=0)
    relative = currents / size
    rest = relative - Q @ (Q.T @ relative)
    k = np.linalg.eigh(rest.T @ rest)[1][:, 0] / size
    k *= np.sign(k.sum())
    y = np.linalg.lstsq(A, currents @ k, rcond=None)[0]
    if not (k > 0).all() or y[-1] <= 0:
        return y[:-1], np.full(len(k), np.nan)
    return y[:-1] / y[-1], y[-1] / k


def _identified(
    regressor: Regressor,
    base: Base,
    said: ControllerLog,
    found: Fitted,
    figures: list[Figure],
    tau: Array,
    constants: tuple[Figure, ...],
    systematic: Array | None,
) -> Identified:
    n, k = len(regressor.names), len(base.columns)
    units = [*UNITS * len(regressor.bodies), *("kg·m²" if r else "kg" for r in regressor.revolute)]
    return Identified(
        robot=regressor.description.name,
        source=said.file,
        samples=len(tau),
        names=tuple(regressor.columns[c] for c in base.columns),
        units=tuple(units[c] for c in base.columns),
        values=tuple(figures[:k]),
        coulomb=tuple(figures[k : k + n]),
        viscous=tuple(figures[k + n : k + 2 * n]),
        offset=tuple(figures[k + 2 * n : k + 3 * n]),
        left=np.sqrt(np.nanmean(found.residuals**2, axis=0)),
        condition=found.condition,
        regressor=regressor,
        base=base,
        fitted=found,
        payload=tuple(figures[k + 3 * n :]),
        constants=constants,
        systematic=systematic,
    )


def _rows(regressor: Regressor, said: ControllerLog) -> tuple[Array, Array, Array, NDArray[np.bool_]]:
    """Columns of bodies and of friction, torques, and which rows count."""
    n = len(regressor.names)
    if said.tau is None:
        remedy = (
            "log measured torques: actual_current_as_torque of RTDE, measured torques of FRI; or its currents"
        )
        raise InputError.at(said.file, "torques", "the source measures none", remedy)
    if said.q.shape[1] != n:
        what = f"{said.q.shape[1]} joints, and the robot has {n}"
        raise InputError.at(said.file, "joints", what, "name the log of this robot")
    if len(said.t) < LEAST:
        raise InputError.at(said.file, "torques", f"{len(said.t)} valid samples", f"log {LEAST} or more")
    qd = said.qd if said.qd is not None else slopes(said.t, said.q, HALF_WINDOW)
    qdd = slopes(said.t, qd, HALF_WINDOW)
    rows = spread(len(said.t), MOST)
    q, qd, qdd = (np.asarray(x[rows], float) for x in (said.q, qd, qdd))
    slow = np.where(regressor.revolute, SLOW["rad"], SLOW["m"])
    used = np.abs(qd) > slow
    still = [name for j, name in enumerate(regressor.names) if used[:, j].sum() < LEAST]
    if still:
        what = f"{', '.join(still)} never move" if len(still) > 1 else f"{still[0]} never moves"
        raise InputError.at(said.file, "motion", what, "log a motion in which every joint moves")
    return regressor(q, qd, qdd), friction(qd), np.asarray(said.tau[rows]), used


# -- a robot of it ----------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Weighed:
    """Masses that bodies can have and that make the torques of a log; how far the mass matrix may be off."""

    bodies: Array
    """Ten parameters of each moving body about its frame, shape (B, 10)."""
    rotors: Array
    """[kg·m² or kg], shape (n,)."""
    error: float
    """s of (1 − s) M ≼ M' ≼ (1 + s) M."""
    distance: float
    """Of its base parameters from the fitted ones, in standard deviations, root mean square."""


def weighed(found: Identified, mass: float) -> Weighed:
    """Masses for a robot file.

    Args:
        found: What a log tells.
        mass: Of the whole arm, base included, as its maker states it [kg]: more than moves, so that what
            goes by the mass of all that moves is too large rather than too small.

    Raises:
        InputError: The motion leaves base parameters open.
    """
    if found.hidden:
        what = f"tells nothing of {', '.join(found.hidden[:6])}" + ("…" if len(found.hidden) > 6 else "")
        raise InputError.at(found.source, "motion", what, "excite all joints together, faster and farther")
    regressor, base = found.regressor, found.base
    k, B, n = len(base.columns), len(regressor.bodies), len(regressor.names)
    beta, covariance = found.fitted.values[:k], found.fitted.covariance[:k, :k]
    systematic = np.zeros((1, k)) if found.systematic is None else found.systematic[:, :k]
    white, _ = _principal(covariance + systematic.T @ systematic)
    _, coloured = _principal(covariance)
    prior = np.concatenate([_guess(regressor.bodies, mass).ravel(), np.full(n, np.log(0.05))])
    G = base.regrouped

    def physical(x: Array) -> Array:
        return np.concatenate([parameters(x[: 10 * B].reshape(B, 10)).ravel(), np.exp(x[10 * B :])])

    sums = np.zeros(10 * B + n)
    sums[: 10 * B : 10] = 1.0
    rows = np.vstack([white @ G, sums / (1e-4 * mass)])
    wanted = np.append(white @ beta, 1e4)

    def residuals(x: Array) -> Array:
        return np.concatenate([rows @ physical(x) - wanted, (x - prior) / PRIOR])

    def slope(x: Array) -> Array:
        """Of the residuals; each body's parameters go by its own ten logarithms, each rotor by its own."""
        inner = np.zeros((10 * B + n, 10 * B + n))
        theta = x[: 10 * B].reshape(B, 10)
        for j in range(10):
            step = np.zeros((B, 10))
            step[:, j] = 1e-6
            each = (parameters(theta + step) - parameters(theta - step)) / 2e-6
            for b in range(B):
                inner[10 * b : 10 * b + 10, 10 * b + j] = each[b]
        at = np.arange(10 * B, 10 * B + n)
        inner[at, at] = np.exp(x[10 * B :])
        return np.vstack([rows @ inner, np.eye(len(x)) / PRIOR])

    x = _least_squares(residuals, slope, prior)
    pi = physical(x)
    rng = np.random.default_rng(0)
    lower = [-np.pi if j.lower is None else j.lower for j in regressor.description.joints()]
    upper = [np.pi if j.upper is None else j.upper for j in regressor.description.joints()]
    q = rng.uniform(lower, upper, (POSTURES, n))
    every = regressor.mass_matrices(q)
    M = np.einsum("npij,p->nij", every, pi)
    half = np.linalg.inv(np.linalg.cholesky(M))
    of_base = half[:, None] @ every[:, list(base.columns)] @ half.swapaxes(1, 2)[:, None]
    drawn = beta + rng.normal(size=(DRAWS, k)) @ coloured.T
    # Errors of constants at their ends, half of the time all in one direction.
    ends = rng.choice((-1.0, 1.0), size=(DRAWS, len(systematic)))
    ends[::2] = ends[::2, :1]
    drawn = drawn + ends @ systematic
    off = np.einsum("nkij,dk->dnij", of_base, drawn - G @ pi)
    worst = np.abs(np.linalg.eigvalsh(off)).max(axis=(1, 2))
    return Weighed(
        bodies=pi[: 10 * B].reshape(B, 10),
        rotors=pi[10 * B :],
        error=float(np.quantile(worst, SOUGHT)),
        distance=float(np.sqrt(np.mean((white @ (G @ pi - beta)) ** 2))),
    )


def _principal(covariance: Array) -> tuple[Array, Array]:
    """Whiten errors of a covariance, shape (k, k), and draw them from independent ones, likewise."""
    # Scaled, for figures differ by magnitudes.
    scale = np.sqrt(np.diag(covariance))
    variances, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    deviations = np.sqrt(np.maximum(variances, variances.max() * 1e-12))
    return (vectors / deviations).T / scale, scale[:, None] * vectors * deviations


def _guess(bodies: Sequence[Sequence[Link]], mass: float) -> Array:
    """Logarithms of boxes around the bodies' shapes that share a mass by volume, shape (B, 10)."""
    boxes = []
    for body in bodies:
        solids: list[Solid] = [solid for link in body[:1] for solid in link.solids]
        low, high = box(solids) if solids else (np.full(3, -0.05), np.full(3, 0.05))
        boxes.append((0.5 * (low + high), np.maximum(0.5 * (high - low), 0.01)))
    volumes = np.array([float(np.prod(half)) for _, half in boxes])
    shares = mass * volumes / volumes.sum()
    return np.stack([_theta(float(m), c, half) for m, (c, half) in zip(shares, boxes, strict=True)])


def _least_squares(residuals: Of, slope: Of, x: Array) -> Array:
    """Levenberg and Marquardt's method, damped by the diagonal."""
    damping = 1e-2
    r = residuals(x)
    for _ in range(STEPS):
        J = slope(x)
        A, g = J.T @ J, J.T @ r
        for _ in range(12):
            step = np.linalg.solve(A + damping * np.diag(np.diag(A)), -g)
            new = residuals(x + np.clip(step, -2.0, 2.0))
            if new @ new < r @ r:
                break
            damping *= 4
        else:
            break
        gain = (r @ r - new @ new) / (r @ r)
        x, r, damping = x + np.clip(step, -2.0, 2.0), new, max(damping / 6, 1e-12)
        if gain < 1e-7:
            break
    return x


def robot_table(found: Identified, made: Weighed, *, mass: float, source: str, currents: str = "") -> str:
    """Keys of a robot's table in a workstation file: masses, rotors, and how far both may be off.

    Args:
        found: What a log tells.
        made: Masses of it.
        mass: Of the whole arm [kg].
        source: Where the maker states it.
        currents: What torques were made of currents by.

    Raises:
        InputError: The mass matrix is open, or two links that move as one both weigh in the description.
    """
    if made.error >= LOOSEST:
        what = f"leaves the mass matrix open by ± {100 * made.error:.0f} % in some direction"
        remedy = "log longer, and excite the outer joints faster: their inertias are what is told least"
        raise InputError.at(found.source, "motion", what, remedy)
    told = f"identified from {PurePath(found.source).name}, {found.samples} samples; {mass:g} kg by {source}"
    told += f"; torques of currents by {currents}" if found.constants else ""
    rotors = ", ".join(f"{x:.4g}" for x in made.rotors)
    share = max(round(made.error, 4), 1e-4)
    lines = [
        f"# {found.robot}: {told}",
        "# Masses of single links are one choice of many; the log tells the mass matrix, within these.",
        f"rotor_inertia = [{rotors}]",
        f"rotor_tolerance = {share:g}",
        f"mass_tolerance = {share:g}",
        f"published_mass = {mass:g}",
        f"published_mass_source = {json.dumps(source)}",
        "",
    ]
    for body, (m, *rest) in zip(found.regressor.bodies, made.bodies.tolist(), strict=True):
        others = [link.name for link in body[1:] if link.inertial is not None]
        if others:
            what = f"{', '.join(others)} moves with {body[0].name} and has a mass of its own"
            raise InputError.at(found.source, found.robot, what, "take it out of the description")
        com = np.array(rest[:3]) / m
        xx, yy, zz, xy, xz, yz = rest[3:]
        about = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        about -= m * (com @ com * np.eye(3) - np.outer(com, com))
        inertia = [about[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
        lines += [
            f"[robots.masses.{json.dumps(body[0].name)}]",
            f"mass = {m:.9g}",
            f"com = [{', '.join(f'{x:.9g}' for x in com)}]",
            f"inertia = [{', '.join(f'{x:.9g}' for x in inertia)}]",
            f"source = {json.dumps(told[:190])}",
            "",
        ]
    return "\n".join(lines)
