"""Tolerances of how a robot stops and of what else S_p is made from, and S_p at their ends.

S_p rises with C, and with the approach speed v_h, whose coefficient is T_r + T_s. It rises with T_r and T_s,
whose coefficients v_h + v_r and v_h + v_r (or v_h + v_r/2) are never negative, and falls with a constant
deceleration a, which only occurs as v/a and v²/2a; with the approach speeds of ISO 13855 it is made of such
figures by taking the larger and the lesser, which keeps that. So its ends are at the ends of the inputs. With
a simulated stop the pose in which braking begins depends on T_r too: there the ends are two samples, and
nothing is proved of what lies between.
"""

from __future__ import annotations

from collections.abc import Callable

from msgspec.structs import replace

from seerob.core.tolerances import Shifts, Spread, Tolerance, spread
from seerob.core.transforms import Array
from seerob.criteria.stopping.models import Stop
from seerob.twin.state import State

SIMULATED = (
    "with a simulated stop, reaction times between the ends of their tolerance: only the ends are asked"
)
_UNITS = {"reaction": "s", "stopping": "s", "deceleration": "m/s²"}


def tolerances(stop: Stop) -> tuple[Tolerance, ...]:
    """The inputs of a stop that may be off."""
    given = stop.tolerance
    found = {} if given is None else {key: getattr(given, key) for key in _UNITS}
    return tuple(Tolerance(f"stop.{key}", half, _UNITS[key]) for key, half in found.items() if half)


def shifted(stop: Stop, shifts: Shifts) -> Stop:
    """The stop with its inputs at an end: 1 where S_p is largest."""
    changed = {}
    for tolerance, shift in zip(tolerances(stop), shifts, strict=True):
        key = tolerance.name.removeprefix("stop.")
        side = -shift if key == "deceleration" else shift
        changed[key] = getattr(stop, key) + side * tolerance.half
    return replace(stop, tolerance=None, **changed)


class SeparationEnds:
    """S_p of every moving part [m] at the ends of what it is made from.

    Args:
        tolerances: The inputs that may be off.
        required: S_p of every part at a state, for shifted inputs.
        remembers: Whether S_p depends on what was before, so that every end is to be asked at every tick.
    """

    def __init__(
        self,
        tolerances: tuple[Tolerance, ...],
        required: Callable[[Shifts], Callable[[State], Array]],
        *,
        remembers: bool,
    ) -> None:
        self.tolerances = tolerances
        self._required, self._remembers = required, remembers
        self._bound: dict[Shifts, Callable[[State], Array]] = {}

    def at(self, state: State) -> Spread:
        """Ends of S_p, shape (n,); to be asked at every tick."""

        def figure(shifts: Shifts) -> Array:
            if shifts not in self._bound:
                self._bound[shifts] = self._required(shifts)
            return self._bound[shifts](state)

        found = spread(figure, len(self.tolerances))
        if self._remembers:
            _ = found.widths
        return found
