"""Ergonomics rule of a company: nobody bends down for long. One file, one class, one ``kind``."""

from __future__ import annotations

from typing import ClassVar

from seerob.api import Basis, Compute, Criterion, Figure, Model, Present, Shown, Twin, beyond, bind_posture

BENT = 0.7
"""The trunk counts as bent beyond this [rad]."""


class Bending(Criterion, frozen=True, kw_only=True):
    """How long a person has been bending down without a break."""

    unit: ClassVar[str] = "s"

    human: str
    """Who is judged."""
    limit: float = 10.0
    """Longest admissible bend [s]."""

    def subjects(self) -> tuple[str, ...]:
        """Who it speaks of."""
        return (self.human,)

    def compute(self, model: Model) -> Compute:
        """Look the person up once, and return the function that computes how long they bend."""
        read = bind_posture(model, self.human)  # a name that does not exist fails here, not in the loop
        since: list[float] = []

        def compute(twin: Twin) -> Figure:
            bent, t = beyond(read(twin).trunk_flexion, BENT, signed=True), float(twin.t)
            if not bent.known:  # an angle that nobody measures is not assessed
                return Figure(None, self.limit)
            # Only what was before an instant counts, so that a replay finds the same.
            if not bent.low or (since and t < since[0]):
                since.clear()
            if bent.low and not since:
                since.append(t)
            return Figure(t - since[0] if since else 0.0, self.limit, beside=bool(since))

        return compute

    def present(self, model: Model) -> Present:
        """Say what was found."""
        words = {True: "trunk bent forward", False: "upright", None: "trunk not measured"}
        return lambda state, figure, verdict: Shown(words[figure.beside])

    def one_by_one(self, model: Model) -> str:
        """Say why many instants are not computed together."""
        return "how long somebody bends is counted as it happens"

    def basis(self, model: Model) -> Basis:
        """State formula and source."""
        return Basis(formula="time since the trunk was bent beyond 0.7 rad", source="ACME works standard 9")
