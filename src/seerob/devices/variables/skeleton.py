"""A variable dictionary to begin with, from what a device says it has: what it does not say stays open."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

from seerob.devices.variables.live_source import Node
from seerob.files.tables.mapping import toml_value
from seerob.workstation.variables.units import unit

BOOLS = ("bool", "boolean")
TEXTS = ("string", "wstring", "char", "wchar", "text", "bytestring", "localizedtext")
_NEVER = re.compile(r"[^A-Za-z0-9_.\-]+")
LONGEST = 120
"""Characters of a name."""


def skeleton(nodes: Iterable[Node], source: str) -> str:
    """Entries of a dictionary, as TOML.

    A number whose unit the device does not state has none: the file cannot be read until somebody says it.

    Args:
        nodes: What was found.
        source: Name of the source that reads them.
    """
    taken: set[str] = set()
    entries = ["\n".join(_entry(node, _name(node.address, taken), source)) for node in nodes]
    head = f"# Variables that {source} has. Take out what the twin does not use, and state the units.\n"
    return "\n\n".join([head, *entries]) + "\n"


def _entry(node: Node, name: str, source: str) -> Iterator[str]:
    yield "[[variables]]"
    yield f'name = "{name}"'
    yield f"source = {toml_value(source)}"
    yield f"address = {node.address if node.address.startswith('{') else toml_value(node.address)}"
    kind = node.type.lower()
    if kind in BOOLS or node.value in ("True", "False", "true", "false"):
        yield 'type = "bool"'
    elif kind in TEXTS:
        yield 'type = "text"'
    elif node.unit and unit(node.unit) is not None:
        yield f"unit = {toml_value(node.unit)}"
    elif node.unit:
        yield f"# unit = …   the device says {toml_value(node.unit)}, not known: give unit, scale, offset"
    else:
        yield "# unit = …   the device does not say it; 1 for none"
    if node.type or node.value:
        said = " ".join(part for part in (node.type, node.value and f"was {node.value}") if part)
        yield f"comment = {toml_value(said[:200])}"


def _name(address: str, taken: set[str]) -> str:
    plain = "/".join(part for part in _NEVER.split(address[-LONGEST:]) if part.strip("./-")) or "variable"
    name, n = plain, 1
    while name in taken:
        n += 1
        name = f"{plain}_{n}"
    taken.add(name)
    return name
