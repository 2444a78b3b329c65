"""What follows from S_p: origin of its inputs, its ends, the largest of a run, the largest speed.

S_p rises with C, and with the approach speed v_h, whose coefficient is T_r + T_s. It rises with T_r and T_s,
whose coefficients v_h + v_r and v_h + v_r (or v_h + v_r/2) are never negative, and falls with a constant
deceleration a, which only occurs as v/a and v²/2a; with the approach speeds of ISO 13855 it is made of such
figures by taking the larger and the lesser, which keeps that. So its ends are at the ends of the inputs. With
a simulated stop the pose in which braking begins depends on T_r too: there the ends are two samples, and
nothing is proved of what lies between.
"""

from __future__ import annotations

import weakref
from collections.abc import Callable

import numpy as np
from msgspec.structs import replace

from seerob.core.errors import Undecided
from seerob.core.snapshot import Input, Origin
from seerob.core.tolerances import Shifts, Spread, Tolerance, spread
from seerob.core.transforms import Array
from seerob.criteria.stopping.models import Stop
from seerob.criteria.stopping.terms import largest_scale, worst_case
from seerob.description.norms import iso_13855
from seerob.description.norms.iso_13855 import WALKING
from seerob.model import provenance
from seerob.twin.state import State

SIMULATED = (
    "with a simulated stop, reaction times between the ends of their tolerance: only the ends are asked"
)
TOP = 10.0
"""Factor on the present speeds beyond which a larger permissible speed is not searched for."""
HALVINGS, COSTLY_HALVINGS = 14, 6
"""Of the search for the largest permissible speed."""
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


def factor_by_search(S_p: Callable[[float], Array], distance: Array, costly: bool) -> float:
    """Largest factor of all speeds for which no part is nearer than its S_p.

    Args:
        S_p: Of every part at a factor [m], shape (n,).
        distance: Of every part [m], shape (n,).
        costly: Whether asking takes long; then no more than the present speeds are looked at.
    """

    def holds(factor: float) -> bool:
        try:
            return bool((S_p(factor) <= distance).all())
        except Undecided:
            return False

    return largest_scale(holds, 1.0, COSTLY_HALVINGS) if costly else largest_scale(holds, TOP, HALVINGS)


def approach_speed(v_h: float | None) -> Input:
    """v_h as given [m/s]; None for that of ISO 13855."""
    if v_h is None:
        return Input(
            name="v_h",
            value=f"{WALKING} m/s, {iso_13855.REACHING:g} m/s up to S_p = {iso_13855.ARM_REACH} m",
            unit="",
            origin=Origin.STATED,
            source="ISO/TS 15066:2016 5.5.4.2.3 and ISO 13855, from public sources that agree (2S); "
            f"that S_p with {WALKING} m/s is not below {iso_13855.ARM_REACH} m is from memory (M)",
        )
    if v_h == WALKING:
        return Input(
            name="v_h",
            value=v_h,
            unit="m/s",
            origin=Origin.STATED,
            source="ISO/TS 15066:2016 5.5.4.2.3, from public sources that agree (2S)",
        )
    return provenance.given("v_h", v_h, "m/s")


def intrusion(C: float | None) -> Input:
    """C as given [m]."""
    return Input(name="C", unit="m", origin=Origin.MISSING) if C is None else provenance.given("C", C, "m")
