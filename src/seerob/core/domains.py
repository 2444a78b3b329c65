"""What an argument of a formula may be: everything else is refused, what is not a number first of all."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seerob.core.transforms import Array


def number(
    name: str, value: ArrayLike, low: float = -math.inf, high: float = math.inf, unit: str = ""
) -> Array:
    """A quantity as an array.

    Args:
        name: For the message.
        value: Shape (...).
        low: Least value that can be.
        high: Greatest.
        unit: Of all three.

    Raises:
        ValueError: A value is not a number, or beyond what can be.
    """
    found = np.asarray(value, float)
    if not found.ndim and low <= found.item() <= high:  # most are one figure, of which reductions take long
        return found
    good = (found >= low) & (found <= high)  # false for NaN
    if not good.all():
        bad = float(found[~good].flat[0]) if found.ndim else float(found)
        own = f" {unit}" if unit else ""
        raise ValueError(f"{name} is {bad:g}{own}, it is {_range(low, high)}{own}")
    return found


def at_least(name: str, value: ArrayLike, low: float = 0.0, unit: str = "") -> Array:
    """A quantity as an array, of which some may be unknown: what is not a number stays so.

    Raises:
        ValueError: A value is below what can be.
    """
    found = np.asarray(value, float)
    if not found.ndim and not found.item() < low:
        return found
    if (found < low).any():
        number(name, found[found < low], low, unit=unit)
    return found


def agree(**lengths: Sequence[int]) -> None:
    """Raise ValueError where arrays do not fit each other.

    Args:
        lengths: All lengths of a dimension, by its name in the docstring: ``n=(J.shape[-1], *M.shape)``.
    """
    for name, found in lengths.items():
        if len(set(found)) > 1:
            raise ValueError(f"{name} is {' and '.join(map(str, found))} in the shapes of what is given")


def whole(name: str, value: ArrayLike, low: int, high: int) -> NDArray[np.int64]:
    """A score or a code as an array of whole numbers.

    Raises:
        ValueError: A value is no whole number, or there is no such score.
    """
    found = number(name, value, low, high)
    if not found.ndim and found.item().is_integer():
        return found.astype(np.int64)
    if (found != np.round(found)).any():
        bad = float(found[found != np.round(found)].flat[0]) if found.ndim else float(found)
        raise ValueError(f"{name} is {bad:g}, it is a whole number, {_range(low, high)}")
    return found.astype(np.int64)


def _range(low: float, high: float) -> str:
    if math.isinf(low) and math.isinf(high):
        return "a number"
    if math.isinf(high):
        return f"{low:g} or more"
    return f"at most {high:g}" if math.isinf(low) else f"{low:g} to {high:g}"
