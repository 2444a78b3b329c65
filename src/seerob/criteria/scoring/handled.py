"""What hands of the twin's person hold, beside the load that is entered for a phase.

It never relieves: the larger of both counts, and where nobody entered a load, what else is handled or pushed
meanwhile stays unknown.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple, cast

import numpy as np

from seerob.core.snapshot import Origin
from seerob.core.transforms import Array
from seerob.criteria.figure import Twin
from seerob.model.model import Body, Model
from seerob.twin.accuracy.mass_tolerances import heavier_by_tolerances
from seerob.twin.state import State


class Handled(NamedTuple):
    """What one person holds at one instant."""

    mass: float | None
    """Of all of it together [kg]; None where nobody knows."""
    hands: frozenset[str]
    """``left`` and ``right``, as far as they hold anything."""


NOTHING = Handled(0.0, frozenset())
KNOWN = (Origin.MEASURED, Origin.STATED, Origin.GIVEN, Origin.COMPUTED)
"""Where a mass comes from that a load may rest on."""
NOTE = "of loose workpieces that are held their weight counts, not what it takes to accelerate them"


def bind_handled(model: Model, human: str) -> Callable[[Twin], Handled]:
    """Return what reads what a person holds now; of what two people hold, each has all of it.

    What the workstation file mounts on the person is held all the time; where nobody knows what a thing on a
    hand weighs, nobody knows what all of it does. Where workpieces are loose there is one instant at a time.
    """
    station = model.workstation
    # By a mass that is given, or by density, at most; one of several shapes has it on each.
    weighed = {body.owner: at_most(model, body) for body in model.bodies if body.mass is not None}
    worn = [
        ((thing.on or "").partition("/")[2], weighed[thing.name])
        for thing in (*station.workpieces, *station.tools)
        if (thing.on or "").startswith(f"{human}/") and thing.name in weighed
    ]
    weight = None if unweighed(model, human) else sum(mass for _, mass in worn)
    always = Handled(weight, frozenset(bone.removesuffix("_hand") for bone, _ in worn))
    loose = {piece.name for piece in station.workpieces if piece.loose}
    masses: dict[str, float | None] = dict.fromkeys(loose, 0.0)
    for body in model.bodies:
        before = masses.get(body.owner)
        if body.owner in loose:
            masses[body.owner] = None
            if before is not None and body.mass is not None and model.mass_origin(body) in KNOWN:
                masses[body.owner] = before + at_most(model, body)

    def read(twin: Twin) -> Handled:
        if twin.many:
            return always
        mass, hands = always
        for piece, held_by in cast("State", twin).held.items():
            own = [hand.removeprefix(f"{human}/") for hand in held_by if hand.startswith(f"{human}/")]
            if own:
                more = masses.get(piece)
                mass = None if mass is None or more is None else mass + more
                hands |= {hand.removesuffix("_hand") for hand in own}
        return Handled(mass, hands)

    return read if loose else lambda twin: always


def at_most(model: Model, body: Body) -> float:
    """What a body weighs at most [kg]; 0 where nobody knows."""
    return 0.0 if body.mass is None else body.mass.value * heavier(model, body)


def heavier(model: Model, body: Body) -> float:
    """Factor by which a body may be heavier: by tolerances, and by a volume that is within bounds alone."""
    station = model.workstation
    own = (thing for thing in (*station.tools, *station.workpieces) if thing.name == body.owner)
    off = math.prod(map(heavier_by_tolerances, own))
    return off * (1 + (0.0 if body.mass is None else body.mass.error))


def unweighed(model: Model, human: str) -> list[str]:
    """What is mounted on the hands of a person, and nobody knows what it weighs, by name."""
    hands = {f"{human}/left_hand", f"{human}/right_hand"}
    station = model.workstation
    mounted = {thing.name for thing in (*station.workpieces, *station.tools) if thing.on in hands}
    weighed = {body.owner for body in model.bodies if body.mass is not None}
    return sorted(mounted - weighed)


def load_range(entered: float | None, handled: Handled) -> tuple[float, float]:
    """Between what the load may be [kg].

    Args:
        entered: For the phase [kg]; None when nobody did.
        handled: What the person holds.

    Returns:
        The least and the most, which is infinite where it is not known.
    """
    least = max(entered or 0.0, handled.mass or 0.0)
    return least, math.inf if entered is None or handled.mass is None else least


def holding(handled: Handled) -> Array:
    """1 for a hand that holds something, shape (2,) for right and left."""
    return np.array([float(side in handled.hands) for side in ("right", "left")])
