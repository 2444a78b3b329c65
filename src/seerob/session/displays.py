"""What is shown beside poses and never judged: looks that follow variables, who may be elsewhere."""

from __future__ import annotations

from seerob.model.model import Model
from seerob.twin.state import State
from seerob.twin.validity.hearing import nobody_says
from seerob.workstation.variables import Value, WhenStale

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


# -- who may be elsewhere than shown --------------------------------------------------------------


def invalid_reasons(state: State) -> dict[str, str]:
    """Robots, people, machines and single bodies that may not be where the twin shows them, with the reason.

    A robot, a person or a machine stands for all that it moves (`Node.mover`). Of a person of whom only
    some bones are in doubt those are named, and what the person holds.
    """
    found: dict[str, str] = {}
    for name in state.model.mechanisms:
        if reason := state.invalid_place_reason(name):
            found[name] = reason
        elif reason := state.invalid_reason(name):
            hearing = state.hearings[name]
            found |= {f"{name}/{bone}": "no device sees it" for bone in hearing.unobserved(state.t)}
            unplaced = hearing.unplaced(state.t)
            found |= {f"{name}/{bone}": nobody_says(unplaced) for bone in unplaced}
            found |= {
                f"{name}/{bone}": why for why, bones in hearing.invalid_parts(state.t) for bone in bones
            }
            held = (body.name for body in state.model.bodies if body.mover == name and body.owner != name)
            found |= dict.fromkeys(held, reason)
    return found | {state.model.bodies[i].name: why for i, why in state.attachments.unknown.items()}
