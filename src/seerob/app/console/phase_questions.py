"""What rules need and no posture shows, asked on the terminal: phases of the work, one after another.

An answer that is not given is not guessed: it is left out of the file, and what rests on it is UNDECIDED.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from typing import Any, Literal, get_args, get_origin

import msgspec

from seerob.core.errors import InputError
from seerob.workstation.tables.task_phase import Phase, TaskPhase, check_order

OF_PHASES = ("title", "start", "end", "cycle", "human")
"""Fields that are asked for by themselves."""
QUESTIONS = {
    "load": "mass that is handled [kg], or a force in N divided by 9.81; 0 for none",
    "load_use": "how does the load act?",
    "hand": "which arm carries the load, and makes the exertions (Enter: both)?",
    "coupling": "how well can the load be held?",
    "supported_arms": "which arms are supported, or leaned on?",
    "back_supported": "is the trunk well supported?",
    "legs": "how are the legs used (posture: estimate it, of somebody who stands or kneels)?",
    "balanced": "are legs and feet well supported and evenly loaded?",
    "muscle_arms": "are the arms mainly static, or is their posture repeated 4 times per minute or more?",
    "muscle_body": "are neck, trunk and legs so?",
    "static": "is a part of the body held for longer than 1 min?",
    "repeated": "are small movements repeated more than 4 times per minute?",
    "rapid": "are there rapid large changes of posture, or is the base unstable?",
    "exertion": "greatest force of a hand, on Borg's scale from 0 to 10",
    "exertions": "exertions of a hand in the phase",
    "exertion_time": "how long one of them lasts [s]",
    "wrist": "wrist in the exertions [rad], flexion above 0; empty for the twin's",
}
ONLY_LOADED = ("load_use", "coupling", "hand")
"""Not asked of a load of 0."""
MOST = 100
"""Phases."""
YES, NO = ("y", "yes", "true"), ("n", "no", "false")


class _Noticing:
    """A phase that notes which of its fields are asked for."""

    def __init__(self, task: TaskPhase, noted: set[str]) -> None:
        self._task, self._noted = task, noted

    def __getattr__(self, name: str) -> Any:
        self._noted.add(name)
        return getattr(self._task, name)


def needed(rules: Iterable[type]) -> tuple[str, ...]:
    """Fields of `TaskPhase` that rules read, in its order.

    Args:
        rules: Classes of the rules of a workstation.
    """
    noted: set[str] = set()
    for rule in rules:
        phase: type[Phase] | None = getattr(rule, "PHASE", None)
        if phase is None:
            continue
        noted |= set(phase.__struct_fields__)
        for legs in (None, "posture", "sitting"):
            phase.read(_Noticing(TaskPhase(legs=legs), noted))  # type: ignore[arg-type]
    return tuple(name for name in QUESTIONS if name in noted)


def ask_phases(
    fields: Sequence[str], length: float, hear: Callable[[str], str], tell: Callable[[str], None]
) -> list[dict[str, Any]]:
    """Phases as tables of the workstation file, without what nobody answered; none when nothing was entered.

    Args:
        fields: From `needed`.
        length: Of the recording [s].
        hear: Puts a question and returns the answer.
        tell: Says a line.
    """
    tell("Enter leaves a question open, and what rests on it is UNDECIDED.")
    cycle = _answer("cycle", "length of a cycle of the work [s]; empty when nothing repeats", hear, tell)
    end = length if cycle is None else cycle
    found: list[dict[str, Any]] = []
    begin = 0.0
    while begin < end and len(found) < MOST:
        title = hear(f"phase {len(found) + 1}, what is done from {begin:g} s on? (Enter: no more) > ").strip()
        if not title:
            break
        table: dict[str, Any] = {"title": title, "start": begin}
        table |= {} if cycle is None else {"cycle": cycle}
        until = _end(table, end, hear, tell)
        table |= {} if until == end and cycle is None else {"end": until}
        for name in fields:
            if table.get("load") == 0 and name in ONLY_LOADED:
                continue
            value = _answer(name, QUESTIONS[name], hear, tell)
            table |= {} if value is None else {name: value}
        tell(f"{title}: {100 * (until - begin) / end:.0f} % of the {'cycle' if cycle else 'recording'}")
        found.append(table)
        begin = until
    if found and begin < end:
        tell(f"nothing is entered from {begin:g} to {end:g} s: scores are UNDECIDED there")
    check_order([msgspec.convert(table, TaskPhase) for table in found])
    return found


def _end(
    table: Mapping[str, Any], end: float, hear: Callable[[str], str], tell: Callable[[str], None]
) -> float:
    while True:
        given = hear(f"  until [s]? (Enter: {end:g}) > ").strip()
        if not given:
            return end
        try:
            until = _number(given)
            msgspec.convert({**table, "end": until}, TaskPhase)
        except (ValueError, msgspec.ValidationError) as error:
            tell(f"  {error}")
            continue
        if until <= end:
            return until
        tell(f"  it ends at {end:g} s")


def _answer(name: str, question: str, hear: Callable[[str], str], tell: Callable[[str], None]) -> Any:
    """What was answered, as the file has it; None where nothing was."""
    kind = next(f.type for f in msgspec.structs.fields(TaskPhase) if f.name == name)
    choices = _choices(kind)
    shown = f" ({' / '.join(choices)})" if choices else ""
    while True:
        given = hear(f"  {question}{shown} > ").strip()
        if not given:
            return None
        try:
            value = _value(given, kind, choices)
            # A phase checks itself, too; only its own field is looked at here.
            msgspec.convert({name: value}, TaskPhase)
        except (ValueError, msgspec.ValidationError) as error:
            tell(f"  {error}")
            continue
        return value


def _choices(kind: Any) -> tuple[str, ...]:
    """What may be answered, where that is one of some words."""
    parts = (kind, *get_args(kind))
    if bool in parts:
        return "y", "n"
    for part in parts:
        inner = get_args(part)[0] if get_origin(part) is not Literal and get_args(part) else part
        for each in (part, inner):
            if get_origin(each) is Literal:
                return tuple(map(str, get_args(each)))
    return ()


def _value(given: str, kind: Any, choices: Sequence[str]) -> Any:
    """An answer as the file has it.

    Raises:
        ValueError: It is none.
    """
    if not choices:
        return _number(given)
    if bool in (kind, *get_args(kind)):
        if given.lower() in YES + NO:
            return given.lower() in YES
    else:
        near = [choice for choice in choices if choice == given] or [
            c for c in choices if c.startswith(given)
        ]
        if len(near) == 1:
            return near[0]
    raise ValueError(f"answer one of {', '.join(choices)}, or nothing")


def _number(given: str) -> float:
    """A finite number, with a point or a comma.

    Raises:
        ValueError: It is none.
    """
    with suppress(ValueError):
        if math.isfinite(value := float(given.replace(",", "."))):
            return value
    raise ValueError(f"{given!r} is no number")


def on_a_terminal(question: str) -> str:
    """Ask on the terminal.

    Raises:
        InputError: Nobody is there to answer.
    """
    try:
        return input(question)
    except EOFError:
        what = "the entry ended before all was asked"
        raise InputError.at("--ask", "", what, "answer on a terminal; Enter leaves a question open") from None
