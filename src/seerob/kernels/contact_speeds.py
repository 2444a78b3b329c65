r"""Permissible speeds of many surfaces against many body regions: `contact.collision` in one loop."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from seerob.core.transforms import Array

ROUNDING = 1 - 1e-12
"""Where the energy limit is that of the force, rounding must not say that energy governs."""


@njit(cache=True, nogil=True, error_model="numpy")
def permissible_speeds(
    m_R: Array,
    forces: Array,
    clamped: NDArray[np.bool_],
    force: Array,
    multiplier: Array,
    stiffness: Array,
    mass: Array,
    energy: Array,
) -> tuple[Array, NDArray[np.int64], Array, Array, Array, Array]:
    """Speeds by force, pressure and energy, and the least of them that are known.

    Args:
        m_R: Effective mass of the robot at each surface [kg], shape (b,).
        forces: That the pressure limits allow, free and clamped, NaN when unknown [N], shape (b, 2, r).
        clamped: Whether the body part cannot recoil, shape (b, r).
        force: Quasi-static limit of each region [N], shape (r,).
        multiplier: Transient over quasi-static, shape (r,).
        stiffness: [N/m], shape (r,).
        mass: Of the body part [kg], shape (r,).
        energy: Printed transient energy [J], NaN when there is none, shape (r,).

    Returns:
        The least [m/s]; which it is (`seerob.criteria.contact.collision.Governing`); by force, pressure,
        energy [m/s]; reduced mass [kg]; shape (b, r) each.
    """
    b, r = clamped.shape
    least, by_force, by_pressure, by_energy, reduced = (
        np.empty((b, r)),
        np.empty((b, r)),
        np.empty((b, r)),
        np.empty((b, r)),
        np.empty((b, r)),
    )
    which = np.empty((b, r), np.int64)
    for i in range(b):
        for j in range(r):
            k, F, F_P, mu, E = stiffness[j], multiplier[j] * force[j], forces[i, 0, j], m_R[i], energy[j]
            if clamped[i, j]:
                # Printed energies are transient.
                F, F_P, E = force[j], forces[i, 1, j], np.nan
            else:
                mu = 1.0 / (1.0 / mass[j] + 1.0 / m_R[i])
            stored = F * F / (2.0 * k)
            if not math.isnan(E):
                stored = E if math.isnan(stored) else min(stored, E)
            root = math.sqrt(mu * k)
            v_F, v_P, v_E = F / root, F_P / root, math.sqrt(2.0 * stored / mu)
            by_force[i, j], by_pressure[i, j], by_energy[i, j], reduced[i, j] = v_F, v_P, v_E, mu
            v = v_F
            if v_E < v_F * ROUNDING:
                v = v_E
            if v_P < v or math.isnan(v):
                v = v_P
            least[i, j] = v
            which[i, j] = 0 if v == v_F else 1 if v == v_P else 2
    return least, which, by_force, by_pressure, by_energy, reduced


@njit("f8(f8, f8)", cache=True, nogil=True, error_model="numpy")
def _admitted(limit: float, rounding: float) -> float:
    return limit if math.isinf(limit) else limit - rounding * max(1.0, abs(limit))


@njit("void(f8[:,:], f8[:,:], f8[:,:], f8[:,:], f8, i8[:,::1])", cache=True, nogil=True, error_model="numpy")
def ranks(
    v: Array, pressure: Array, low: Array, high: Array, rounding: float, found: NDArray[np.int64]
) -> None:
    """Judge relative speeds against what is permitted, as `seerob.core.verdict.keeps` does.

    Args:
        v: [m/s], shape (b, r).
        pressure: Permissible by it alone [m/s], NaN where that is not known, shape (b, r).
        low: What is permitted at least [m/s], shape (b, r).
        high: At most, likewise.
        rounding: Share of a limit, and of 1 where it is less, by which a speed must keep it.
        found: 2 exceeded, 1 open, 0 within, shape (b, r).
    """
    for i in range(v.shape[0]):
        for j in range(v.shape[1]):
            keeps = v[i, j] <= _admitted(low[i, j], rounding)
            known = not (math.isnan(v[i, j]) or math.isnan(high[i, j]))
            if known and not v[i, j] <= _admitted(high[i, j], rounding):
                found[i, j] = 2
            else:
                found[i, j] = 1 if math.isnan(pressure[i, j]) or not keeps else 0


@njit("void(i1[::1], i8, b1[:,::1], f8[::1], b1[:,::1], b1[::1], f8[::1])", cache=True, nogil=True)
def reached(
    kinds: NDArray[np.int8],
    within: int,
    member: NDArray[np.bool_],
    fast: Array,
    near: NDArray[np.bool_],
    close: NDArray[np.bool_],
    speeds: Array,
) -> None:
    """Find which regions of people each of b surfaces may hit; writes into the last three arguments.

    Args:
        kinds: Of the distance of each surface to each of n bones, shape (b·n,).
        within: The kind that says that they are near.
        member: Which bone counts for which region, shape (n, k).
        fast: Bound on the speed of each bone [m/s], shape (n,).
        near: Shape (b, k).
        close: Which bones are near any surface, shape (n,).
        speeds: Bound on those of each region's bones that are near [m/s], 0 of none, shape (k,).
    """
    n, k = member.shape
    near[:] = False
    close[:] = False
    speeds[:] = 0.0
    for i in range(len(near)):
        for bone in range(n):
            if kinds[i * n + bone] != within:
                continue
            close[bone] = True
            for region in range(k):
                if member[bone, region]:
                    near[i, region] = True
                    speeds[region] = np.maximum(speeds[region], fast[bone])


@njit(cache=True, nogil=True, error_model="numpy")
def governing(
    v: Array,
    near: NDArray[np.bool_],
    columns: NDArray[np.int64],
    permissible: Array,
    known: NDArray[np.int64],
    far: float,
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Which surface is the worst for each region: by rank, then by margin; without a limit the fastest.

    Args:
        v: Relative speeds [m/s], shape (b, k).
        near: What could be hit by what, shape (b, k).
        columns: Of ``v``: the regions with limits, shape (r,).
        permissible: As given [m/s], shape (b, r).
        known: Ranks against the limits: 2 exceeded, 1 open, 0 within, shape (b, r).
        far: Larger than any margin of speed [m/s].

    Returns:
        Rows of surfaces, and their ranks, 0 without a limit; shape (k,) each.
    """
    b, k = v.shape
    column = np.full(k, -1)
    for i in range(len(columns)):
        column[columns[i]] = i
    rows, ranks = np.zeros(k, np.int64), np.zeros(k, np.int64)
    for j in range(k):
        worst = -np.inf
        c = column[j]
        for i in range(b):
            rank = known[i, c] if c >= 0 else 0
            if i == 0:
                ranks[j] = rank
            if not near[i, j]:
                continue
            badness = v[i, j] if c < 0 else rank * far - (permissible[i, c] - v[i, j])
            # What is not a number is the worst.
            if badness > worst or (math.isnan(badness) and not math.isnan(worst)):
                worst, rows[j], ranks[j] = badness, i, rank
    return rows, ranks
