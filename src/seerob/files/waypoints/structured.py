"""Waypoints in TOML and YAML: a list ``waypoints`` of tables with the keys of `Point`; optionally ``tcp``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from seerob.core.errors import InputError
from seerob.files.waypoints.point import program_of
from seerob.files.waypoints.waypoint import Program

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
    except (ValueError, RecursionError) as error:
        # Also what tomllib lets through: a number of 10 000 digits.
        raise InputError.at(file, "", f"is not TOML: {error}") from error


def _yaml(text: str, file: str) -> Mapping[str, Any]:
    from ruamel.yaml import YAML
    from ruamel.yaml.error import YAMLError
    from ruamel.yaml.events import AliasEvent, CollectionEndEvent, CollectionStartEvent

    try:
        depth = 0
        for event in YAML(typ="safe", pure=True).parse(text):
            depth += isinstance(event, CollectionStartEvent) - isinstance(event, CollectionEndEvent)
            # An anchor is what an alias refers to; a second one of the name is only warned of.
            named = isinstance(event, AliasEvent) or getattr(event, "anchor", None) is not None
            if named or depth > MAX_DEPTH:
                what = "holds aliases" if depth <= MAX_DEPTH else f"is nested deeper than {MAX_DEPTH}"
                raise InputError.at(file, "", what, "write every waypoint out")
        table = YAML(typ="safe", pure=True).load(text)
    except (YAMLError, ValueError, RecursionError) as error:
        first = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InputError.at(file, "", f"is not YAML: {first}") from error
    if not isinstance(table, Mapping):
        raise InputError.at(file, "", "is no table", "write a list `waypoints`")
    _check_keys(table, file)
    return table


def _check_keys(value: Any, file: str) -> None:
    """Only texts may be keys: YAML also has numbers, lists and nothing for one."""
    if isinstance(value, Mapping):
        for key, below in value.items():
            if not isinstance(key, str):
                raise InputError.at(file, "", f"{str(key)[:40]} is no key", "write texts for keys")
            _check_keys(below, file)
    elif isinstance(value, list):
        for below in value:
            _check_keys(below, file)
