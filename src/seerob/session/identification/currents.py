r"""Torque constants of joints from currents of two logs, of which the second carries a known mass.

.. math:: i_j = g_j\,(Y_j\,\pi + P_j\,p + \text{friction}), \qquad g_j = 1/k_j, \qquad p_1 = m

is fitted by Gauss and Newton's method, noise in i alone.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from seerob.core.transforms import Array
from seerob.session.explanation import NORMAL_95, Fitted, fit

ROUNDS = 40
"""Steps of Gauss and Newton's method."""


def fit_currents(
    torques: Array, weight: Array, currents: Array, used: NDArray[np.bool_]
) -> tuple[Fitted, Array, Array] | None:
    """Fit what torques are linear in, and the currents that each joint needs per torque.

    Args:
        torques: Columns of all that is fitted but the known mass, shape (N, n, p).
        weight: Torques of the known mass [N·m or N], shape (N, n).
        currents: [A], shape (N, n).
        used: Which rows count, likewise.

    Returns:
        The fit, of the parameters (p,) and of the currents per torque (n,); these two. None where the known
        mass does not show in the currents, so that the common factor stays open.
    """
    n, p = currents.shape[1], torques.shape[-1]
    each = np.eye(n)
    x, g = _begun(torques[used], weight[used], (currents[..., None] * each)[used])
    if not np.isfinite(g).all():
        return None
    for _ in range(ROUNDS):
        needed = torques @ x + weight
        columns = np.concatenate([g[:, None] * torques, needed[..., None] * each], axis=-1)
        found = fit(columns, currents + g * (torques @ x), used)
        off = float(np.abs(found.values[p:] / g - 1).max())
        x, g = found.values[:p], found.values[p:]
        if off < 1e-6:
            break
    else:
        return None
    if not (g > 0).all():
        return None
    halves = NORMAL_95 * np.sqrt(np.maximum(np.diag(found.covariance)[p:], 0))
    if not (g > 2 * halves).all() or not found.determined[p:].all():
        return None
    return found, x, g


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
