r"""Masses for a robot file that make the torques of a log, and how far the mass matrix may be off by them.

The mass matrix depends on the base parameters β alone. A robot file needs masses that a body can have: of all
such that make β as it was fitted, weighed by its covariance, those nearest to the envelope's shapes are taken
(pseudo-inertias :math:`U U^T`, Rucker and Wensing 2022, from memory), with the mass that the maker states for
the whole arm. Their *error* is the least s with :math:`(1-s) M \preceq M' \preceq (1+s) M`, where M' is the
mass matrix of β drawn from its distribution, in sampled postures, for 95 of 100 draws: every criterion that
scales masses by s holds M' between its ends.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import PurePath

import numpy as np

from seerob.core.errors import InputError
from seerob.core.shapes import Solid
from seerob.core.transforms import Array
from seerob.description.description import Link
from seerob.description.lint import box
from seerob.session.identification.identify import Identified

DRAWS, POSTURES = 400, 100
"""Of the parameters and of the arm, by which the error of the mass matrix is found."""
PRIOR = 3.0
"""How far logarithms of sizes and masses may be from those of the shapes, as a standard deviation."""
STEPS = 120
SOUGHT = 0.95
LOOSEST = 0.9
"""From this error on a file would say nothing."""

Of = Callable[[Array], Array]


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
