"""Static and repeated postures, found in a recording of component scores.

The methods ask "held longer than" and "repeated more than … per minute" of an observer. Here a posture is
static while its scores stay, and a joint repeats when its score rises into a higher band: choices.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seerob.core.domains import agree, number
from seerob.core.transforms import Array
from seerob.criteria.scoring.published import Ints

GAP = 1.0
"""A posture that is left for less [s] was not left."""
WINDOW = 60.0
"""Over which repetitions are counted [s]."""
_ROUNDING = 1e-9
"""Instants that differ by less [s] are the same."""


def static(t: ArrayLike, scores: ArrayLike, hold: float, *, gap: float = GAP) -> NDArray[np.bool_]:
    """Whether each instant belongs to a posture that is held long enough.

    Args:
        t: Instants, increasing, shape (n,) [s]; scores hold until the next one.
        scores: Component scores, shape (n, k) or (n,).
        hold: How long is static [s]: 60 in RULA and REBA, `rula.Profile.static`.
        gap: Interruptions that are shorter do not count [s].

    Returns:
        Shape (n,); the interruptions within a held posture belong to it.
    """
    instants, vectors = _increasing(t), number("a score", scores)
    agree(n=(len(instants), len(vectors)))
    number("hold", hold, 0, unit="s")
    number("gap", gap, 0, unit="s")
    found = np.zeros(len(instants), bool)
    if len(instants) < 2:
        return found
    ends = np.append(instants[1:], instants[-1])
    _, kinds = np.unique(vectors.reshape(len(vectors), -1), axis=0, return_inverse=True)
    for kind in range(int(kinds.max()) + 1):
        at = np.flatnonzero(kinds.ravel() == kind)
        # A stretch ends where the posture is away for at least the gap.
        away = instants[at[1:]] - ends[at[:-1]]
        for stretch in np.split(at, np.flatnonzero(away >= gap - _ROUNDING) + 1):
            if ends[stretch[-1]] - instants[stretch[0]] >= hold - _ROUNDING:
                found[stretch[0] : stretch[-1] + 1] = True
    return found


def repetitions(t: ArrayLike, scores: ArrayLike, *, window: float = WINDOW) -> Ints:
    """How often a score rose within the last ``window``, at each instant.

    Args:
        t: Instants, increasing, shape (n,) [s].
        scores: Of one component, shape (n,).
        window: [s]

    Returns:
        Counts, shape (n,); 4 or more per minute is repeated work in RULA's worksheet, more than 4 in REBA.
    """
    instants, values = _increasing(t), number("a score", scores)
    agree(n=(*instants.shape, *values.shape))
    number("window", window, 0, unit="s")
    rises = instants[1:][np.diff(values) > 0]
    first = np.searchsorted(rises, instants - window + _ROUNDING, side="right")
    return np.asarray(np.searchsorted(rises, instants, side="right") - first)


def _increasing(t: ArrayLike) -> Array:
    instants = number("an instant", t, unit="s")
    if (np.diff(instants) <= 0).any():
        raise ValueError("instants do not increase")
    return instants
