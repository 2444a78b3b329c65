"""How far the bones of people were from where devices saw them, over the run: rows and the report's table."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from seerob.description.humans.skeleton import BONES
from seerob.outputs.html import Html, joined, table, tag
from seerob.outputs.sentences import number
from seerob.recording.bone_errors import BoneErrors

Cell = str | float | int | None
HEAD: list[Cell] = ["person", "bone", "what", "unit", "median", "P95", "largest", "at [s]", "ticks"]


def bone_rows(people: Mapping[str, BoneErrors]) -> Iterator[list[Cell]]:
    """A row for all bones of a person together, then one per bone, positions before angles."""
    for name, errors in people.items():
        for e in (*errors.all(), *errors.bones()):
            yield [name, e.bone or "all", e.what, e.unit, e.median, e.p95, e.largest, e.t, e.ticks]


def bones_told(people: Mapping[str, BoneErrors]) -> Html | None:
    """The report's table; nothing when no device saw a person."""
    # What no device saw has no error, which is no praise.
    seen = {name: len({e.bone for e in errors.bones()}) for name, errors in people.items()}
    rows = [
        [
            str(name),
            f"of the bones seen: {seen[str(name)]} of {len(BONES)}" if bone == "all" else str(bone),
            str(what),
            *(number(float(value), str(unit)) for value in (median, p95, largest) if value is not None),
            f"{float(t or 0.0):.2f} s",
        ]
        for name, bone, what, unit, median, p95, largest, t, _ in bone_rows(people)
    ]
    if not rows:
        return None
    head = ["person", "bone", "what is missing", "median", "P95", "largest", "at"]
    text = (
        "How far the twin's bones are from where the devices see them: fit of the person's lengths, "
        "the controllers, and contacts together. Percentiles are good to half a per cent of themselves."
    )
    return joined([tag("h4", "Tracking of bones"), table(head, rows), tag("p", text, class_="lead")])
