"""Waypoints in TOML and YAML: a list ``waypoints`` of tables with the keys of `Point`; optionally ``tcp``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from seerob.errors import InputError
from seerob.waypoints.point import program_of
from seerob.waypoints.waypoint import Program

MAX_BYTES = 16 << 20
MAX_DEPTH = 12


def read_structured(content: bytes, file: str, *, yaml: bool) -> Program:
    """The waypoints of a TOML or YAML file.

    Args:
        content: The file.
        file: Its name, for messages.
        yaml: Whether it is YAML.

    Raises:
        InputError: Not such a file, aliases in YAML (which hostile files use to grow), or wrong waypoints.
    """
    if len(content) > MAX_BYTES:
        raise InputError.at(file, "", f"{len(content)} bytes", f"at most {MAX_BYTES} are read")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError.at(file, "", f"is not text: {error}") from error
    table = _yaml(text, file) if yaml else _toml(text, file)
    unknown = [key for key in table if key != "waypoints"]
    points = table.get("waypoints")
    if not isinstance(points, list) or unknown:
        what = f"unknown key {unknown[0]!r}" if unknown else "no list `waypoints`"
        raise InputError.at(file, "", what, "write a list `waypoints` of tables and nothing else")
    wrong = next((i for i, point in enumerate(points) if not isinstance(point, Mapping)), None)
    if wrong is not None:
        raise InputError.at(file, f"waypoints[{wrong}]", "is no table", "write keys and values")
    return program_of(((f"waypoints[{i}]", point) for i, point in enumerate(points)), file)


def _toml(text: str, file: str) -> Mapping[str, Any]:
    import tomllib

    try:
        return tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise InputError.at(file, "", f"is not TOML: {error}") from error


def _yaml(text: str, file: str) -> Mapping[str, Any]:
    try:
        from ruamel.yaml import YAML
        from ruamel.yaml.error import YAMLError
        from ruamel.yaml.events import AliasEvent, CollectionEndEvent, CollectionStartEvent
    except ImportError as error:
        raise InputError.at(
            file, "", "YAML needs the package ruamel.yaml", "install it, or use TOML"
        ) from error
    try:
        depth = 0
        for event in YAML(typ="safe", pure=True).parse(text):
            depth += isinstance(event, CollectionStartEvent) - isinstance(event, CollectionEndEvent)
            if isinstance(event, AliasEvent) or depth > MAX_DEPTH:
                what = "holds aliases" if depth <= MAX_DEPTH else f"is nested deeper than {MAX_DEPTH}"
                raise InputError.at(file, "", what, "write every waypoint out")
        table = YAML(typ="safe", pure=True).load(text)
    except (YAMLError, ValueError, RecursionError) as error:
        first = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InputError.at(file, "", f"is not YAML: {first}") from error
    if not isinstance(table, Mapping):
        raise InputError.at(file, "", "is no table", "write a list `waypoints`")
    return table
