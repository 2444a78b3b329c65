"""What a machine says of itself, against what is admissible."""

from __future__ import annotations

import math
from typing import Annotated, cast

from msgspec import Meta

from seerob.core.errors import InputError
from seerob.core.snapshot import Basis, Input, Origin
from seerob.core.verdict import Verdict
from seerob.criteria.criterion import Criterion
from seerob.criteria.figure import Compute, Figure, Present, Shown, Twin, verdict_of
from seerob.model import provenance
from seerob.model.model import Model
from seerob.twin.spans import Fall, Falls, Points
from seerob.twin.state import State
from seerob.workstation.variables import Kind, Value

_EXCEEDED = Verdict.EXCEEDED


class MachineVariable(Criterion, frozen=True, kw_only=True):
    """A variable that a machine or a controller tells, against a limit or an expected value."""

    variable: str
    """Its name in the dictionary."""
    unit: str = ""  # type: ignore[misc]
    """Its SI unit, of a number: that of the limit and of the results."""
    limit: Annotated[float, Meta(ge=-1e12, le=1e12)] | None = None
    """Greatest admissible value, in ``unit``."""
    expected: bool | str | None = None
    """Instead: what it must be, of a bool, a text or a choice."""

    def __post_init__(self) -> None:
        if self.limit is not None and self.expected is not None:
            raise ValueError("limit and expected are both given: keep one")

    @property
    def at_most(self) -> bool:  # type: ignore[override]
        """Whether its limit bounds from above: that of a number, and a bool that must be false."""
        return self.expected is None or self.expected is False

    def variables(self) -> dict[str, str]:
        """The variable."""
        return {**Criterion.variables(self), self.variable: ""}

    def compute(self, model: Model) -> Compute:
        """Look up every name in the model once and return the function that compares the value."""
        variable = model.dictionary[self.variable]
        number = variable.type is Kind.NUMBER
        if variable.si_unit != self.unit:
            what = f"{self.unit!r}, but {self.variable} is in {variable.si_unit!r} here"
            raise InputError.at(self.name, "unit", what, f'write unit = "{variable.si_unit}"')
        if not number and self.limit is not None:
            raise InputError.at(self.name, "limit", f"{self.variable} is no number", "give expected")
        fits = bool if variable.type is Kind.BOOL else str
        if self.expected is not None and (number or not isinstance(self.expected, fits)):
            what = f"{self.expected!r}, but {self.variable} is a {variable.type}"
            raise InputError.at(self.name, "expected", what, "give a value of that type")

        def compute(twin: Twin) -> Figure:
            state = cast("State", twin)
            now = of(state.signal(self.variable))
            # What was told since the last tick counts too: the first of it that exceeds.
            figures = map(of, state.signals_meanwhile(self.variable))
            return next(
                (each for each in figures if verdict_of(each, at_most=self.at_most) is _EXCEEDED), now
            )

        def of(value: Value) -> Figure:
            if self.expected is None:
                figure = float(value) if isinstance(value, int | float) else None
                return Figure(figure, self.limit, nothing=not number, beside=value)
            # Of a bool itself, 0 or 1; of a text or a choice whether it is what is expected: exact counts.
            if isinstance(self.expected, bool):
                return Figure(int(bool(value)), float(self.expected), beside=value)
            return Figure(int(value == self.expected), 1.0, beside=value)

        return compute

    def present(self, model: Model) -> Present:
        """Return the function that says what the variable is, unless it is a number."""
        number = model.dictionary[self.variable].type is Kind.NUMBER

        def present(state: State, figure: Figure, verdict: Verdict | None) -> Shown:
            return Shown("" if number else self._said(figure.beside))

        return present

    def falls(self, model: Model, points: Points) -> Falls:
        """Return no fall: a variable stands until it is told anew, and all that is told is judged."""
        fall = Fall(0.0 if self.every is None else math.inf)
        return lambda span, least: fall

    def _said(self, value: Value) -> str:
        text = f"{self.variable} is {_word(value)}"
        return text if self.expected in (None, value) else f"{text}, not {_word(self.expected)}"

    def basis(self, model: Model) -> Basis:
        """State the formula, its source, the inputs with their origin, and what is not modelled."""
        variable = model.dictionary[self.variable]
        source = f"{variable.source}: {variable.address}"
        figure = variable.timeout if math.isfinite(variable.timeout) else None
        expected = () if self.expected is None else (_entered(self.expected),)
        return Basis(
            formula=f"{self.variable} as its controller tells it",
            source="the machine itself",
            inputs=(
                Input(
                    name=f"variable {self.variable}", unit=self.unit, origin=Origin.MEASURED, source=source
                ),
                Input(name="time-out", value=figure, unit="s", origin=Origin.GIVEN, source="dictionary"),
                *expected,
                *provenance.limit(self.limit, self.unit),
            ),
            not_modelled=("whether what the controller tells is so",),
        )


def _entered(expected: bool | str) -> Input:
    return Input(name="expected value", value=_word(expected), origin=Origin.GIVEN, source="workstation file")


def _word(value: Value | None) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)
