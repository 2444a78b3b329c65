"""Mistakes that span tables of a workstation file: names that are taken, or that nothing carries.

What the names of links are is known only once models are read; here, only the part of a name
before its first ``/`` that does not belong to a part's own name is looked at.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from msgspec import Struct

from seerob.core.errors import Problem, suggestion
from seerob.description.humans.skeleton import BONES

NAMED = ("robots", "tools", "workpieces", "parts", "machines", "areas", "sensors", "humans")
"""Tables whose entries have a name that is theirs alone."""

Entries = Mapping[str, Mapping[int, Any]]
"""Table → number of the entry → the entry, where it could be read."""


class Named(NamedTuple):
    """A name that the file declares."""

    table: str
    entry: int
    name: str


def declared(table: Mapping[str, Any]) -> list[Named]:
    """Names of a parsed file, also of entries that cannot be read otherwise."""
    found = []
    for group in NAMED:
        entries = table.get(group)
        for i, entry in enumerate(entries if isinstance(entries, list) else ()):
            if isinstance(entry, dict) and isinstance(entry.get("name"), str):
                found.append(Named(group, i, entry["name"]))
    return found


def check(names: Sequence[Named], entries: Entries, file: str) -> list[Problem]:
    """Every mistake that a name makes across tables."""
    return [
        *_taken(names, file),
        *_mounts(names, entries, file),
        *_sources(names, entries, file),
        *_bones(entries, file),
        *_subjects(names, entries, file),
        *_results(entries, file),
    ]


def _taken(names: Sequence[Named], file: str) -> Iterator[Problem]:
    seen: dict[str, str] = {}
    for table, i, name in names:
        key = f"{table}[{i}].name"
        if name in seen:
            yield Problem(file, key, f"the name {name!r} is taken by {seen[name]}", "choose another")
        seen.setdefault(name, key)


def _mounts(names: Sequence[Named], entries: Entries, file: str) -> Iterator[Problem]:
    robots = [n.name for n in names if n.table == "robots"]
    people = [n.name for n in names if n.table == "humans"]
    machines = [n.name for n in names if n.table == "machines"]
    movable = [n.name for n in names if n.table in ("tools", "workpieces")]
    on = {
        thing.name: thing.on for group in ("tools", "workpieces") for thing in entries.get(group, {}).values()
    }
    carriers = [*robots, *people, *machines]
    for group in ("tools", "workpieces", "areas", "sensors"):
        for i, thing in entries.get(group, {}).items():
            if getattr(thing, "loose", False):
                continue
            at, steps = thing.on, 0
            while at in on and steps <= len(on):
                at, steps = on[at], steps + 1
            key = f"{group}[{i}].on"
            if steps > len(on):
                yield Problem(
                    file,
                    key,
                    f"{thing.name!r} is mounted on itself in a circle",
                    "mount one of them on a robot or a person",
                )
            elif at is not None and at not in movable and at.split("/")[0] not in carriers:
                known = [*(f"{carrier}/<link>" for carrier in carriers), *movable]
                what = f"nothing named {thing.on!r} to mount on"
                yield Problem(file, key, what, suggestion(thing.on, known))


def _sources(names: Sequence[Named], entries: Entries, file: str) -> Iterator[Problem]:
    kinds = {n.name: n.table.removesuffix("s") for n in names if n.table in ("robots", "humans", "machines")}
    driven: dict[str, int] = {}
    for i, source in entries.get("sources", {}).items():
        target = source.target()
        key = f"sources[{i}]" + "".join(f".{field}" for field, _ in _fields_with(source, target))
        wanted = next((kind for kind in ("robot", "human") if hasattr(source, kind)), None)
        # A machine is a chain of joints like a robot, and follows the same files.
        fits = {None: ("robot", "human", "machine"), "robot": ("robot", "machine"), "human": ("human",)}
        fitting = [name for name, kind in kinds.items() if kind in fits[wanted]]
        if not target:
            continue
        if target in kinds and target not in fitting:
            what = f"{target!r} is a {kinds[target]}, this source drives a {wanted}"
            yield Problem(file, key, what, suggestion(target, fitting))
        elif target not in kinds:
            yield Problem(
                file, key, f"no {wanted or 'robot or human'} named {target!r}", suggestion(target, fitting)
            )
        elif target in driven and not (source.shares and entries["sources"][driven[target]].shares):
            yield Problem(file, key, f"{target!r} is already driven by sources[{driven[target]}]", "keep one")
        driven.setdefault(target, i)


def _bones(entries: Entries, file: str) -> Iterator[Problem]:
    """Bones of people that sources and rules name, whatever else they are."""
    named: list[tuple[str, str]] = []
    for i, source in entries.get("sources", {}).items():
        bones = getattr(getattr(source, "weights", None), "bones", {})
        named += [(f"sources[{i}].weights.bones.{bone}", bone) for bone in bones]
    for i, rule in entries.get("ergonomics", {}).items():
        unmeasured = getattr(rule, "unmeasured", ())
        named += [(f"ergonomics[{i}].unmeasured[{k}]", bone) for k, bone in enumerate(unmeasured)]
    for key, bone in named:
        if bone not in BONES:
            yield Problem(file, key, f"no bone named {bone!r}", suggestion(bone, BONES))


def _subjects(names: Sequence[Named], entries: Entries, file: str) -> Iterator[Problem]:
    known = [n.name for n in names]
    asked = [("contacts", i, contact, contact.between) for i, contact in entries.get("contacts", {}).items()]
    for group in ("safety", "ergonomics"):
        asked += [(group, i, c, c.subjects()) for i, c in entries.get(group, {}).items()]
    for group, i, entry, subjects in asked:
        if isinstance(subjects, str):
            what = f"subjects of {type(entry).__module__} is the text {subjects!r}"
            yield Problem(file, f"{group}[{i}]", what, f"return a tuple of names: ({subjects!r},)")
            continue
        for subject in dict.fromkeys(subjects):
            if not subject or _begins(subject, known):
                continue
            place = next((f".{field}{where}" for field, where in _fields_with(entry, subject)), "")
            what, fitting = f"nothing named {subject!r} in the workstation", known
            if place == ".sensor":
                what = f"no sensor named {subject!r}"
                fitting = [entry.name for entry in entries.get("sensors", {}).values()]
            yield Problem(file, f"{group}[{i}]{place}", what, suggestion(subject, fitting))


def _begins(subject: str, known: Sequence[str]) -> bool:
    """Whether a subject may be something declared, below it, or a prefix of several."""
    if any(sign in subject for sign in "*?["):
        return True
    return any(
        subject == name or subject.startswith(name + "/") or name.startswith(subject + "/") for name in known
    )


def _results(entries: Entries, file: str) -> Iterator[Problem]:
    seen: dict[str, str] = {}
    for group in ("safety", "ergonomics"):
        for i, criterion in entries.get(group, {}).items():
            if criterion.name in seen:
                what = f"the name {criterion.name!r} is taken by {seen[criterion.name]}"
                yield Problem(file, f"{group}[{i}].name", what, "choose another")
            seen.setdefault(criterion.name, f"{group}[{i}]")
    written: dict[str, str] = {}
    for i, sink in entries.get("sinks", {}).items():
        name = getattr(sink, "file", None)
        if isinstance(name, str) and name in written:
            yield Problem(
                file, f"sinks[{i}].file", f"{name!r} is written by {written[name]} too", "name another file"
            )
        elif isinstance(name, str):
            written[name] = f"sinks[{i}]"


def _fields_with(entry: Struct, value: str) -> Iterator[tuple[str, str]]:
    """Fields of an entry that hold a value, and where in them."""
    for field in entry.__struct_fields__:
        held = getattr(entry, field)
        if field != "name" and held == value:
            yield field, ""
        elif isinstance(held, tuple) and value in held:
            yield field, f"[{held.index(value)}]"
