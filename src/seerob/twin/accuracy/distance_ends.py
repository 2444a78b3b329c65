r"""Between which ends a distance to people lies whose bones may be elsewhere, each bone with its own error.

With :math:`d_{ij}` the distance of body i to body j and :math:`e_i, e_j` how far their points may be off,

.. math:: \min_i (d_{ij} - e_i) - e_j \;\le\; d_j \;\le\; \min_i (d_{ij} + e_i) + e_j.

Only pairs within :math:`\max e - \min e` of the least can make an end, so no others are measured.
"""

from __future__ import annotations

from typing import cast

import numpy as np

from seerob.core.transforms import Array
from seerob.distance.least import Per, Query, Survey
from seerob.model.model import Gap, Model
from seerob.twin.accuracy.tracking_error import TrackingError
from seerob.twin.state import State
from seerob.twin.states import States

Ends = float | Array


class DistanceEnds:
    """Ends of distances of the bodies of a gap's second set, bound once.

    Args:
        model: The compiled workstation.
        gap: The two sets; people in either.
    """

    def __init__(self, model: Model, gap: Gap) -> None:
        self._off = TrackingError(model, gap.bodies)
        self._concerned = gap.bodies
        self._shape = len(gap.a), len(gap.b)
        self._pairs = Survey(model.shapes, [(Query(model.shapes, gap.a, gap.b), Per.PAIR)])

    def of_bodies(self, state: State, distance: Array) -> tuple[Array, Array]:
        """Least and largest distance of each body of ``gap.b`` to ``gap.a`` [m], shape (b,) each.

        Args:
            state: The twin.
            distance: As the twin has it [m], shape (b,).
        """
        if self._off.none(state):
            return distance, distance
        own, others = self._errors(state)
        if np.ptp(own) == 0.0:
            return distance - own[0] - others, distance + own[0] + others
        found = self._within(state, np.tile(distance + np.ptp(own), (len(own), 1)))
        low, high = (found - own[:, None]).min(axis=0), (found + own[:, None]).min(axis=0)
        return low - others, high + others

    def of_sets(self, twin: State | States, distance: Ends) -> tuple[Ends, Ends]:
        """Least and largest distance between ``gap.a`` and ``gap.b`` [m]; the twin's is ``distance``.

        Of many instants they are the same: whom a device sees is asked of instant by instant.
        """
        if twin.many or self._off.none(state := cast("State", twin)):
            return distance, distance
        own, others = self._errors(state)
        off = own[:, None] + others
        if np.ptp(off) == 0.0:
            return distance - float(off[0, 0]), distance + float(off[0, 0])
        found = self._within(state, np.full(off.shape, distance + np.ptp(off)))
        return float((found - off).min()), float((found + off).min())

    def _errors(self, state: State) -> tuple[Array, Array]:
        errors = self._off.at(state)
        return errors[: self._shape[0]], errors[self._shape[0] :]

    def _within(self, state: State, caps: Array) -> Array:
        """Distance of every pair [m], or its cap where it is not less, shape (a, b)."""
        beyond = np.nextafter(caps, np.inf).ravel()
        found = self._pairs.within(*state.placed(self._concerned, allow_estimated=True, strayed=True), beyond)
        return found.distance.reshape(self._shape)
