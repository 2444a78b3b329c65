"""By which methods a robot's speed is limited, and how their ceilings come together at one place.

ISO/TS 15066 lets a robot move near a person by speed and separation monitoring or by power and force
limiting. Where both are there, each alone is enough to permit a speed: below what contact permits, nobody
needs to be kept away; as long as the separation is kept, nobody is hit. Limits that the workstation file
sets on speed and energy are no method: they count whatever is chosen.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from enum import StrEnum

from seerob.core.errors import InputError, Problem
from seerob.criteria.criterion import Criterion
from seerob.criteria.safety.power_and_force import PowerAndForce
from seerob.criteria.safety.separation import Separation
from seerob.model.model import Model
from seerob.session.permissible.ceiling import Ceiling, Method


class By(StrEnum):
    """Which methods count."""

    ALL = "all"
    """Every method that the workstation has; the lesser of both speeds counts."""
    SSM = "ssm"
    """Speed and separation monitoring alone."""
    PFL = "pfl"
    """Power and force limiting alone."""
    BOTH = "both"
    """The lesser of the two; both must be there."""
    EITHER = "either"
    """Whichever permits more at each place; both must be there, and about the same people."""

    def counts(self, method: Method) -> bool:
        """Whether ceilings of a method count."""
        if self is By.SSM:
            return method is not Method.PFL
        return self is not By.PFL or method is not Method.SSM

    def contact_anywhere(self, criteria: Sequence[Criterion], robot: str) -> bool:
        """Whether contact is asked about wherever people are, not only within its horizon.

        A speed that contact permits by itself holds for whoever comes near: nothing else keeps them away.
        """
        separated = any(isinstance(c, Separation) and robot in c.between for c in criteria)
        return self in (By.PFL, By.EITHER) or (self is By.ALL and not separated)


BY = {
    By.ALL: "by every criterion that limits it",
    By.SSM: "by speed and separation monitoring",
    By.PFL: "by power and force limiting",
    By.BOTH: "by speed and separation monitoring and power and force limiting, the lesser of both",
    By.EITHER: "by separation monitoring or power and force limiting, whichever permits more at each place",
}

EITHER_NEEDS = (
    "each method alone is enough; that needs a controller that monitors both at once and falls back "
    "to the speed of power and force limiting, or stops, before the separation is lost; a detection that "
    "sees everybody who can come near; and contacts that are limited all along the path, wherever they count"
)


def governing(ceilings: Sequence[Ceiling], by: By, *, below: float = 1.0) -> Ceiling | None:
    """What governs at a place: what cannot be told, else the least share; None when none is below a share."""
    counted = [c for c in ceilings if by.counts(c.method) and c.asked]
    # What is not asked there protects nobody, and no method is enough without it.
    if by is By.EITHER and all(c.asked or c.method is Method.OWN for c in ceilings):
        own = [c for c in counted if c.method is Method.OWN]
        ssm, pfl = (_least([c for c in counted if c.method is m]) for m in (Method.SSM, Method.PFL))
        # Who permits everything needs no help of the other.
        counted = own if ssm is None or pfl is None else [*own, _larger(ssm, pfl)]
    least = _least(counted)
    return least if least is not None and (least.undecided or least.share < below) else None


def _least(ceilings: Sequence[Ceiling]) -> Ceiling | None:
    """What cannot be told, else the least; None when nothing limits the speed."""
    doubts = [c for c in ceilings if c.undecided]
    least = doubts[0] if doubts else min(ceilings, key=lambda c: c.share, default=None)
    return None if least is None or least.share == math.inf else least


def _larger(a: Ceiling, b: Ceiling) -> Ceiling:
    """Of two methods that each permit a share; who is unknown only counts where the other permits none."""
    for known, other in ((a, b), (b, a)):
        if other.undecided and not known.undecided:
            return known if known.share > 0 else other
    return a if a.undecided or a.share >= b.share else b


def require(by: By, criteria: Sequence[Criterion], model: Model, robot: str) -> None:
    """Refuse a choice that the criteria of a workstation do not carry.

    Raises:
        InputError: A method that nobody asks for, or methods that do not speak of the same people; all of it.
    """
    ssm = [c for c in criteria if isinstance(c, Separation) and robot in c.between]
    pfl = [c for c in criteria if isinstance(c, PowerAndForce) and c.robot == robot]
    needed = {
        "separation": (by in (By.SSM, By.BOTH, By.EITHER), ssm),
        "power_and_force": (by in (By.PFL, By.BOTH, By.EITHER), pfl),
    }
    problems = [
        Problem(
            "permissible speed",
            "by",
            f"{by.value} needs a criterion of kind {kind} for {robot}",
            f'add [[safety]] with kind = "{kind}"',
        )
        for kind, (wanted, found) in needed.items()
        if wanted and not found
    ]
    if by is By.EITHER and ssm and pfl:
        asked = {name for c in ssm for name in c.between}
        problems += [
            Problem(
                "permissible speed",
                "by",
                f"either: separation does not ask about {human.name}, contact alone would not protect them",
                f"add a criterion of kind separation for {human.name}",
            )
            for human in model.workstation.humans
            if human.name not in asked
        ]
    if problems:
        raise InputError(problems)
