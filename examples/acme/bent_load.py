"""Ergonomics rule of a company: points for a bent trunk and a load. Phases of the task, and spans."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from seerob.api import (
    Basis,
    Compute,
    Figure,
    Model,
    Phase,
    Present,
    Rule,
    Shown,
    Twin,
    between,
    beyond,
    bind_posture,
    exactly,
    phase_at,
    shared_phases,
)

BENT = 0.7
"""The trunk counts as bent from here on [rad]."""
HEAVY = 5.0
"""A load counts as heavy beyond this [kg]."""


class Handled(Phase, frozen=True, kw_only=True):
    """What the rule takes from ``[[phases]]``: fields with the names that they have there."""

    load: float | None = None
    """Handled mass [kg]; nobody said when None."""


class BentLoad(Rule, frozen=True, kw_only=True):
    """Points, 0 to 2: one for a bent trunk, one for a heavy load."""

    unit: ClassVar[str] = "points"

    limit: int = 1
    """Most points that are admissible."""

    def compute(self, model: Model) -> Compute:
        """Look up person and phases once, and return the function that counts the points."""
        read = bind_posture(model, self.human, self.unmeasured)
        phases = shared_phases(model, self.human, (), Handled.from_task)
        error = self.error(model) or 0.0  # of all angles, or by the name of each
        accuracy = error.get("trunk_flexion", 0.0) if isinstance(error, Mapping) else error

        def compute(twin: Twin) -> Figure:
            flexion = read(twin).trunk_flexion
            if np.isnan(flexion):  # an angle that nobody measures is not assessed, whatever the limit
                return Figure(None, self.limit, beside="trunk not measured")
            load = phase_at(phases, float(twin.t), Handled()).load
            bent = beyond(flexion, BENT, accuracy=accuracy, signed=True)
            heavy = between(0, 1) if load is None else exactly(int(load > HEAVY))
            points = bent + heavy
            low, high = int(points.low), int(points.high)  # counts are exact, and keep the limit they are on
            missing = "" if points.known else "trunk not measured" if heavy.known else "nobody said the load"
            return Figure(high, self.limit, interval=(low, high), beside=missing)

        return compute

    def present(self, model: Model) -> Present:
        """Say what is missing."""
        return lambda state, figure, verdict: Shown(figure.beside)

    def basis(self, model: Model) -> Basis:
        """State formula and source."""
        return Basis(
            formula="1 for a trunk bent by 0.7 rad, 1 for more than 5 kg", source="ACME works standard 9"
        )
