"""Which criteria of a workstation limit the speed of a robot, and how each is asked."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from seerob.core.errors import Undecided
from seerob.core.verdict import admitted
from seerob.criteria.criterion import Criterion
from seerob.criteria.judging import held
from seerob.criteria.safety.kinetic_energy import KineticEnergy
from seerob.criteria.safety.power_and_force import PowerAndForce
from seerob.criteria.safety.separation import Separation
from seerob.criteria.safety.velocity import Velocity
from seerob.model.model import Model
from seerob.session.permissible.ceiling import Answer, Ask, Ceiling, Figure, Look, Method
from seerob.session.permissible.contact_ceiling import contact
from seerob.session.permissible.separation_ceiling import separation
from seerob.twin.state import State


def ceilings_of(criterion: Criterion, model: Model, robot: str, *, anywhere: bool = False) -> Ask | None:
    """How to ask a criterion; None for one that does not limit the speed of the robot.

    Args:
        criterion: Of the workstation.
        model: The compiled workstation.
        robot: Whose speed is asked about.
        anywhere: Whether contact is asked about wherever people are, not only within its horizon.
    """
    ask: Answer | None = None
    look: Look | None = None
    method = Method.OWN
    if isinstance(criterion, Separation) and robot in criterion.between:
        ask, look = separation(criterion, model, robot)
        method = Method.SSM
    elif isinstance(criterion, PowerAndForce) and criterion.robot == robot:
        ask = contact(criterion, model, anywhere=anywhere)
        method = Method.PFL
    elif isinstance(criterion, Velocity) and criterion.limit is not None:
        ask = _power(criterion, model, robot, criterion.limit, 1)
    elif isinstance(criterion, KineticEnergy) and criterion.limit is not None and criterion.robot == robot:
        ask = _power(criterion, model, robot, criterion.limit, 2)
    if ask is None:
        return None
    inner, withheld = ask, held(criterion, model, model.findings)

    def muted(state: State) -> bool:
        return criterion.active is not None and not state.signal(criterion.active)

    def decided(state: State) -> tuple[Ceiling, ...]:
        try:
            if withheld and not muted(state):
                raise Undecided(withheld)
            found = inner(state) if not muted(state) else (_not_asked(criterion),)
        except Undecided as why:
            found = (Ceiling(criterion.name, math.nan, reason=str(why)),)
        return tuple(replace(ceiling, method=method) for ceiling in found)

    return Ask(decided, method, None if look is None else _unless(muted, look))


def _not_asked(criterion: Criterion) -> Ceiling:
    reason = f"not asked: {criterion.active} is false"
    return Ceiling(criterion.name, math.inf, reason=reason, asked=False)


def _unless(muted: Callable[[State], bool], look: Look) -> Look:
    """Shown only the places at which the criterion is asked; where nobody knows, it is shown too."""

    def shown(state: State) -> None:
        try:
            if muted(state):
                return
        except Undecided:
            pass
        look(state)

    return shown


def _power(criterion: Criterion, model: Model, robot: str, limit: float, power: int) -> Answer | None:
    """A figure that grows with a power of all the robot's speeds."""
    if isinstance(criterion, Velocity):
        names = {model.carrier(model.frame(criterion.at)).name} if criterion.at else {
            model.bodies[i].carrier for i in model.select(criterion.of or "")
        }  # fmt: skip
        if names - {""} != {robot}:
            return None
    evaluate = criterion.bind(model)
    figure = Figure(limit, criterion.unit, "workstation file")

    def ask(state: State) -> tuple[Ceiling, ...]:
        result = evaluate(state)
        value = 0.0 if result.value is None else result.value
        if result.interval is not None:
            # What may be off counts in full, as in the criterion's own verdict.
            value = result.interval[1]
        share = math.inf if value <= 0 else (max(0.0, admitted(limit)) / value) ** (1 / power)
        speed = limit if power == 1 else math.nan
        governs = "speed" if power == 1 else "kinetic energy"
        return (Ceiling(criterion.name, share, speed, surface=result.reason, governs=governs, limit=figure),)

    return ask
