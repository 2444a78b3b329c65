"""Looks that follow variables: what is shown, never what is judged."""

from __future__ import annotations

from seerob.model.model import Model
from seerob.twin.state import State
from seerob.workstation.variables.dictionary import Value, WhenStale

UNKNOWN = (0.55, 0.55, 0.6)
"""Of a lamp of which nobody knows whether it is lit: red, green, blue."""

Look = tuple[float, float, float] | None
"""Red, green, blue in 0…1; None where it is not drawn."""


class Looks:
    """The displays of a workstation, names resolved.

    Args:
        model: The compiled workstation.

    Raises:
        UnknownName: A display is of something that is not there.
    """

    def __init__(self, model: Model) -> None:
        self._displays = tuple(
            (display, tuple(model.bodies[i].name for i in model.select(display.of)))
            for display in model.workstation.displays
        )

    def at(self, state: State) -> dict[str, Look]:
        """Body → how it looks now; nothing where it looks as it is."""
        looks: dict[str, Look] = {}
        for display, bodies in self._displays:
            known = state.signals.at(display.variable, state.t)
            held = state.signals.dictionary[display.variable].when_stale is WhenStale.HOLD
            look: Look
            if known.value is None or (known.invalid_reason and not held):
                # What may be there is drawn.
                if not display.colors:
                    continue
                look = UNKNOWN
            elif (word := _word(known.value)) in display.hidden:
                look = None
            elif word in display.colors:
                look = display.colors[word]
            else:
                continue
            looks |= dict.fromkeys(bodies, look)
        return looks


def _word(value: Value) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)
