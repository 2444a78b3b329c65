"""The mass table of every robot: what each link and each thing on it weighs, and what nobody knows."""

from __future__ import annotations

from collections.abc import Sequence

from seerob.core.snapshot import LinkMass, MechanismInfo, Scene
from seerob.outputs.html import Html, joined, table, tag, whole
from seerob.outputs.report.report import WHO
from seerob.outputs.sentences import number

HEAD = ("link or thing", "mass", "mass is", "moves", "moves as one with", "from, or why")


def total(rows: Sequence[LinkMass]) -> str:
    """``33.1 kg, of which 29.1 kg move``; what is not known is named."""
    known = [row for row in rows if row.mass is not None]
    whole_of_it = sum(row.mass or 0.0 for row in known)
    moving = sum(row.mass or 0.0 for row in known if row.moves)
    unknown = [row.name for row in rows if row.mass is None]
    if unknown and not whole_of_it:
        return "unknown"
    text = f"{number(whole_of_it, 'kg')}, of which {number(moving, 'kg')} move"
    return f"at least {text}; unknown: {', '.join(unknown)}" if unknown else text


def cells(row: LinkMass) -> list[str]:
    """One row of the table, in the order of `HEAD`."""
    mass = "unknown" if row.mass is None else number(row.mass, "kg")
    why = "; ".join(filter(None, (row.note, row.source)))
    return [row.name, mass, WHO[row.origin], "yes" if row.moves else "no", row.merged or "–", why or "–"]


def _shown(row: LinkMass) -> list[str | Html]:
    name, mass, *rest = cells(row)
    return [name, whole(mass), *rest]


def weighed(scene: Scene) -> tuple[MechanismInfo, ...]:
    """Robots and machines that have a mass table."""
    return tuple(mechanism for mechanism in scene.mechanisms if mechanism.masses)


def masses(scene: Scene) -> Html | None:
    """The tables of all of them."""
    if not weighed(scene):
        return None
    return joined(
        [
            joined(
                [
                    tag("h4", f"Masses of {mechanism.name}: {total(mechanism.masses)}"),
                    table(HEAD, map(_shown, mechanism.masses)),
                ]
            )
            for mechanism in weighed(scene)
        ]
    )
