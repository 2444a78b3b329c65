"""The fixed separation distance: the largest that occurred since a run began."""

from __future__ import annotations

import weakref
from collections.abc import Callable

import numpy as np

from seerob.core.transforms import Array
from seerob.criteria.stopping.terms import worst_case
from seerob.twin.state import State


class LargestSeparation:
    """Largest S_p of each part since a run began."""

    def __init__(self) -> None:
        self._run: Callable[[], State | None] = lambda: None
        self._t = -np.inf
        self._S_p = np.zeros(0)

    def including(self, state: State, S_p: Array) -> Array:
        """The largest, with that of this tick."""
        if self._run() is not state or state.t < self._t:
            self._run, self._S_p = weakref.ref(state), S_p
        self._t = state.t
        self._S_p = worst_case(np.stack([self._S_p, S_p]))
        return self._S_p
