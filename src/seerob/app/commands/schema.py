"""``seerob schema``: JSON schema of the workstation file, for editors."""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, get_args

import msgspec

from seerob.app.console.terminal import OUT, Exit, line
from seerob.core import quantities
from seerob.workstation.conversion import is_struct, members, unit_of
from seerob.workstation.workstation import PLUGINS, TABLES, Workstation

HELP = "write the JSON schema of the workstation file, for editors"
EXAMPLE = "seerob schema -o workstation.schema.json"


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments."""
    sub.add_argument("-o", "--output", type=Path, help="file to write (default: standard output)")


def run(options: argparse.Namespace) -> int:
    """Write it."""
    text = json.dumps(schema(), indent=1, ensure_ascii=False)
    if options.output is None:
        OUT.print(text, markup=False)
    else:
        options.output.write_text(text + "\n", encoding="utf-8")
        line("wrote", str(options.output))
    return Exit.WITHIN


def schema() -> dict[str, Any]:
    """The schema: the types of the tables, the kinds of the plug-ins, and keys with unit suffixes."""
    from seerob.core import plugin
    from seerob.session.reading import BASES

    classes = {(g, kind): plugin.load(g, kind, base) for g, base in BASES.items() for kind in plugin.kinds(g)}
    order = [Workstation, *TABLES.values(), *classes.values()]
    refs, definitions = msgspec.json.schema_components(order, ref_template="#/$defs/{name}")
    found = {kind: definitions[_name(ref)] for kind, ref in zip(order, refs, strict=True)}
    for kind in _tables_in(order):
        _add_suffixes(found.get(kind) or definitions[kind.__name__], kind)
    station = found[Workstation]
    for hidden in ("folder", "outside", "files"):
        station["properties"].pop(hidden)
    for group in PLUGINS:
        bodies = [_with_kind(found[c], kind) for (owner, kind), c in classes.items() if owner == group]
        other = {"type": "object", "required": ["kind"], "properties": {"kind": {"pattern": r"\."}}}
        station["properties"][group] = {"type": "array", "items": {"anyOf": [*bodies, other]}}
    whole = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "seerob workstation",
        **station,
        "$defs": definitions,
    }
    # As a reader of the file sees it: plain lists, no tuples.
    plain: dict[str, Any] = json.loads(json.dumps(whole))
    return plain


def _name(ref: dict[str, Any]) -> str:
    return str(ref["$ref"]).rsplit("/", 1)[-1]


def _with_kind(body: dict[str, Any], kind: str) -> dict[str, Any]:
    properties = {"kind": {"const": kind}, **body["properties"]}
    return {**body, "properties": properties, "required": ["kind", *body.get("required", [])]}


def _tables_in(kinds: Sequence[Any]) -> list[type[msgspec.Struct]]:
    """Every struct type that is reachable from some types, each once."""
    found: dict[type[msgspec.Struct], None] = {}

    def visit(wanted: Any) -> None:
        for member in members(wanted):
            if is_struct(member) and member not in found:
                found[member] = None
                for field in msgspec.structs.fields(member):
                    visit(field.type)
            for inner in get_args(member):
                visit(inner)

    for kind in kinds:
        visit(kind)
    return list(found)


def _add_suffixes(definition: dict[str, Any], kind: type[msgspec.Struct]) -> None:
    """``rpy_deg`` beside ``rpy``: the same shape without the limits, which are in SI."""
    properties = definition["properties"]
    required = definition.pop("required", [])
    either, replaced = [], set()
    for field in msgspec.structs.fields(kind):
        unit = unit_of(field.type)
        suffixes = [suffix for suffix, (si, _) in quantities.SUFFIXES.items() if si == unit]
        for suffix in suffixes:
            shape = _without_limits(properties[field.name])
            shape["description"] = f"{field.name} in {suffix.replace('_', '/')}"
            properties[f"{field.name}_{suffix}"] = shape
        if field.name in required and suffixes:
            keys = [field.name, *(f"{field.name}_{suffix}" for suffix in suffixes)]
            replaced.add(field.name)
            either.append({"oneOf": [{"required": [key]} for key in keys]})
    if one_of := getattr(kind, "one_of", ()):
        definition["x-one-of"] = one_of
    definition["required"] = [name for name in required if name not in replaced]
    if either:
        definition["allOf"] = either


def _without_limits(entry: Any) -> Any:
    limits = (
        "minimum",
        "maximum",
        "exclusiveMinimum",
        "exclusiveMaximum",
        "default",
        "examples",
        "x-unit",
        "description",
    )
    if isinstance(entry, dict):
        return {key: _without_limits(value) for key, value in entry.items() if key not in limits}
    if isinstance(entry, list | tuple):
        return [_without_limits(item) for item in entry]
    return entry
