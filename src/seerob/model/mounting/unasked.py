"""Whom and what in a workstation with people no criterion asks about."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress

from seerob.core.errors import SeerobError
from seerob.core.snapshot import Finding
from seerob.model.model import Mechanism, Model


def unasked(model: Model) -> Iterator[Finding]:
    """Robots and machines that move and are judged by nobody, and people whom nobody asks about.

    One that carries a robot which somebody asks about holds that robot: nothing said of an arm is within
    while what moves it is not looked at.
    """
    station = model.workstation
    if not station.humans or not station.safety:
        return
    judged: set[int] = set()
    for criterion in station.safety:
        # A name that does not exist is told where the criterion is bound.
        with suppress(SeerobError):
            judged |= criterion.judged(model)
    named = {name for criterion in station.safety for name in criterion.subjects()}
    yield from _people(model)
    for mechanism in model.mechanisms.values():
        own = {i for i in mechanism.moving if model.bodies[i].carrier == mechanism.name}
        if not own or not own.isdisjoint(judged) or not _moves(model, mechanism):
            continue
        carried = tuple(
            m.name
            for m in model.mechanisms.values()
            if mechanism.name in model.carriers_of(m.name)
            and (m.name in named or not judged.isdisjoint(m.bodies))
        )
        remedy = (
            f'name it in one, such as separation between = ["{mechanism.name}", "{station.humans[0].name}"]'
        )
        what = f"not evaluated: {mechanism.name} moves"
        if carried:
            what += f" and carries {', '.join(carried)}"
        text = f"{what}, and no criterion asks about it: {remedy}"
        yield Finding(level="warning", subject=mechanism.name, text=text, holds=carried)


def _people(model: Model) -> Iterator[Finding]:
    """People whom no criterion of safety asks about, while it asks about others."""
    asked: set[str] = set()
    for criterion in model.workstation.safety:
        with suppress(SeerobError):
            asked |= {*criterion.subjects(), *criterion.depends(model)}
    humans = {human.name for human in model.workstation.humans}
    for name in [human.name for human in model.workstation.humans] if humans & asked else []:
        if name not in asked:
            others = ", ".join(sorted(humans & asked))
            text = (
                f"not evaluated: criteria ask about {others}, and none about {name}: name {name} in one, too"
            )
            yield Finding(level="warning", subject=name, text=text)


def _moves(model: Model, mechanism: Mechanism) -> bool:
    """Whether a source or variables drive it."""
    station = model.workstation
    if mechanism.name in {source.target() for source in station.sources}:
        return mechanism.role != "human"
    return any(m.name == mechanism.name and m.motion.variables() for m in station.machines)
