"""What tolerances of inputs make of a figure, and which of them decides.

Only for figures that are monotone in every input, whatever the others are: then the ends of the figure are
at the ends of the inputs, and no sampling is needed. Whoever calls says why that is so.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from seerob.core.transforms import Array


class Tolerance(NamedTuple):
    """How far an input may be off, either way."""

    name: str
    """Key of the workstation file: ``stop.reaction``."""
    half: float
    """Half the width, in ``unit``."""
    unit: str
    """SI; ``%`` for a share of the input itself, with ``half`` in percent."""

    def __str__(self) -> str:
        """``stop.reaction ± 20 ms``."""
        shown = {"s": (1e3, "ms"), "m": (1e3, "mm")}
        factor, unit = shown.get(self.unit, (1.0, self.unit))
        return f"{self.name} ± {self.half * factor:.4g} {unit}"


Shifts = tuple[int, ...]
"""One number per input: −1 where the input makes the figure least, 0 as given, 1 where it makes it largest.
"""


@dataclass(frozen=True, eq=False)
class Spread:
    """Ends of a figure of any shape (...)."""

    low: Array
    high: Array
    by_input: Array | Callable[[], Array]
    """What each input makes of the width by itself, shape (inputs, ...), or a function that works it out."""

    @cached_property
    def widths(self) -> Array:
        """What each input makes of the width by itself, shape (inputs, ...).

        Only a verdict that is open asks for it: worked out when it is asked for first.
        """
        return self.by_input() if callable(self.by_input) else self.by_input


def spread(figure: Callable[[Shifts], Array], inputs: int) -> Spread:
    """Ends of a figure that is monotone in every input.

    Args:
        figure: At shifted inputs, shape (...); also asked later, when widths are, as long as its state is.
        inputs: How many there are.
    """

    def alone(k: int, side: int) -> Shifts:
        return tuple(side if i == k else 0 for i in range(inputs))

    low, high = np.asarray(figure((-1,) * inputs)), np.asarray(figure((1,) * inputs))

    def widths() -> Array:
        found = [np.asarray(figure(alone(k, 1))) - np.asarray(figure(alone(k, -1))) for k in range(inputs)]
        return np.array(found).reshape(inputs, *low.shape)

    return Spread(low, high, widths)


def deciding(tolerances: Sequence[Tolerance], widths: Array) -> str:
    """Which input leaves a verdict open: the one that makes the figure widest by itself.

    Args:
        tolerances: The inputs.
        widths: What each of them makes of the width by itself, shape (inputs,).
    """
    if not len(tolerances):
        return ""
    # What is infinite by more than one input is by the first.
    return f"decided by {tolerances[int(np.nan_to_num(widths, nan=np.inf, posinf=np.inf).argmax())]}"
