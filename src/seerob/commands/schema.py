"""``seerob schema``: JSON schema of the workstation file, for editors."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import msgspec

from seerob import units
from seerob.commands import OUT, Exit, line
from seerob.workstation import PLUGINS, Workstation

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
    from seerob import plugin
    from seerob.reading import BASES

    classes = {(g, kind): plugin.load(g, kind, base) for g, base in BASES.items() for kind in plugin.kinds(g)}
    order = [Workstation, *classes.values()]
    (top, *refs), definitions = msgspec.json.schema_components(order, ref_template="#/$defs/{name}")
    by_class = dict(zip(classes, refs, strict=True))
    station = definitions[top["$ref"].rsplit("/", 1)[-1]]
    for hidden in ("folder", "files"):
        station["properties"].pop(hidden)
    for group in PLUGINS:
        options = []
        for (owner, kind), ref in by_class.items():
            if owner != group:
                continue
            body = dict(definitions[ref["$ref"].rsplit("/", 1)[-1]])
            body["properties"] = {"kind": {"const": kind}, **body["properties"]}
            body["required"] = ["kind", *body.get("required", [])]
            options.append(body)
        other = {"type": "object", "required": ["kind"], "properties": {"kind": {"pattern": r"\."}}}
        station["properties"][group] = {"type": "array", "items": {"anyOf": [*options, other]}}
    for definition in [*definitions.values(), *_bodies(station)]:
        _add_suffixes(definition)
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "seerob workstation",
        **station,
        "$defs": definitions,
    }


def _bodies(station: dict[str, Any]) -> list[dict[str, Any]]:
    return [body for group in PLUGINS for body in station["properties"][group]["items"]["anyOf"]]


def _add_suffixes(definition: dict[str, Any]) -> None:
    """``rpy_deg`` beside ``rpy``: the same shape without the limits, which are in SI."""
    properties = definition.get("properties", {})
    for name, entry in list(properties.items()):
        unit = _unit(entry)
        for suffix, (si, _) in units.SUFFIXES.items():
            if unit == si:
                properties.setdefault(
                    f"{name}_{suffix}", {"description": f"{name} in {suffix.replace('_', '/')}"}
                )


def _unit(entry: dict[str, Any]) -> str | None:
    if "x-unit" in entry:
        return str(entry["x-unit"])
    return next((str(o["x-unit"]) for o in entry.get("anyOf", []) if "x-unit" in o), None)
