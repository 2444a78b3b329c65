"""Which bones of people a question is about, and what is said of those that nobody sees."""

from __future__ import annotations

from collections.abc import Sequence

from seerob.model.model import Model


def bones_of(model: Model, bodies: Sequence[int]) -> tuple[tuple[str, ...], dict[str, frozenset[str]]]:
    """Who moves bodies: all but people, and of each person the bones among them.

    Args:
        model: The compiled workstation.
        bodies: By index. What a person holds asks for the whole person.
    """
    others: dict[str, None] = {}
    people: dict[str, set[str]] = {}
    for body in (model.bodies[i] for i in bodies):
        if body.role == "human":
            people.setdefault(body.owner, set()).add(body.name.removeprefix(f"{body.owner}/"))
        elif body.mover:
            others[body.mover] = None
    return tuple(others), {name: frozenset(bones) for name, bones in people.items()}


def unobserved_reason(person: str, bones: Sequence[str]) -> str:
    """Why nothing is decided of a person of whom bones are not seen; empty when there are none."""
    if not bones:
        return ""
    shown = ", ".join(bones[:6]) + (f" and {len(bones) - 6} more" if len(bones) > 6 else "")
    return f"{person}: no device sees {shown}"
