"""Whose names of bones, joints and markers mean which bone of the person, and how they are turned.

The tables are ``data/capture.toml``; a file of the same shape adds to them or replaces entries. A name is
compared without case, punctuation and a prefix that ends in a colon (``mixamorig:LeftArm``). In a pattern
``{side}`` stands for both sides in every spelling; ``at`` is of the right side, and mirrored for the left.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from seerob.core.errors import InputError, Problem, UnknownName, suggestion
from seerob.core.files.bounded import TooLarge, content
from seerob.core.files.toml_file import loads
from seerob.core.printable import printable_table
from seerob.core.snapshot import Finding
from seerob.core.transforms import Array
from seerob.description.capture.captured import Layout, Seen
from seerob.description.humans.anthropometry import table
from seerob.description.humans.skeleton import BONES, SIDES

SPELLINGS = {"right": ("right", "r"), "left": ("left", "l")}
"""What ``{side}`` in a pattern stands for."""
FEWEST = 4
"""A convention of which fewer names are found is not the device's."""
MAX_FILE = 1 << 20
"""Of a table of the user's [byte]."""
DIRECTIONS: dict[str, Array] = {
    "forward": np.array([1.0, 0.0, 0.0]),
    "left": np.array([0.0, 1.0, 0.0]),
    "up": np.array([0.0, 0.0, 1.0]),
}
OPPOSITES = {"back": "forward", "right": "left", "down": "up"}


@dataclass(frozen=True, eq=False)
class Place:
    """Where a thing that a device sees is on the person."""

    bone: str
    at: Array
    """In the bone's frame, as a share of the stature, (3,)."""
    position: float = 1.0
    """Weight of its position; 0 when it says nothing."""
    orientation: float = 0.0
    """Weight of its orientation."""
    metres: bool = False
    """``at`` is in metres instead."""
    fitted: bool = False
    """Devices place it as they like: where it is on the bone follows from a recording or a calibration, and
    without either its position is not used."""


@dataclass(frozen=True, eq=False)
class Convention:
    """One device's or exporter's names."""

    name: str
    places: dict[str, Place]
    """By plain name (`plain`)."""
    rest: str | None
    """Posture (`humans.posture`) in which all segments have the axes ``axes``; None when the
    orientations of this convention say nothing without a calibration."""
    axes: Array
    """Rotation of a segment in the rest posture of a person who faces x with z up, shape (3, 3)."""
    source: str
    """Where this is from."""
    seen: str = ""
    """What the names are of (`seerob.description.capture.captured.Seen`); anything when empty."""


def plain(name: str) -> str:
    """A name without what exporters differ in: prefix, case, punctuation."""
    return re.sub(r"[^a-z0-9]", "", name.rpartition(":")[2].lower())


@cache
def conventions() -> dict[str, Convention]:
    """Conventions that ship with seerob, by name."""
    return _conventions(table("capture"), "data/capture.toml")


def read_conventions(path: Path, name: str) -> dict[str, Convention]:
    """The conventions that ship with seerob and those of a file, which replace names that it repeats.

    Raises:
        InputError: The file is missing, or not such a table; every mistake in it.
    """
    try:
        tables = printable_table(loads(content(path, MAX_FILE).decode("utf-8")))
    except TooLarge as error:
        raise InputError.at(name, "", str(error), f"a table has at most {MAX_FILE}") from None
    except OSError as error:
        raise InputError.at(name, "", "no such file", "give a TOML file of tables of names") from error
    except (ValueError, RecursionError) as error:
        raise InputError.at(name, "", f"is not TOML: {error}") from error
    merged: dict[str, Any] = {key: dict(value) for key, value in table("capture").items()}
    for key, value in tables.items():
        if not isinstance(value, dict):
            raise InputError.at(name, key, "is not a table", f"write [{key}] and names below")
        before, names = merged.get(key, {}), value.get("names", {})
        if not isinstance(names, dict):
            raise InputError.at(name, f"{key}.names", "is not a table", 'write names = { "theirs" = "ours" }')
        merged[key] = {**before, **value, "names": {**before.get("names", {}), **names}}
    return _conventions(merged, name)


def choose(
    layout: Layout, subject: str, *, convention: str = "", known: Mapping[str, Convention] | None = None
) -> tuple[Convention | None, list[Finding]]:
    """The convention of a layout: the one it states, or the one that explains most of its names.

    Args:
        layout: The device's names.
        subject: Whom findings are about.
        convention: The user's choice.
        known: Conventions; those that ship with seerob when not given.

    Returns:
        None when no convention fits.

    Raises:
        UnknownName: No convention of the name that the user gave.
    """
    known = conventions() if known is None else known
    if convention and convention not in known:
        raise UnknownName("convention of names", convention, known)
    stated = convention or layout.convention
    if stated in known:
        return known[stated], []
    names = {plain(name) for name in layout.names}
    hits = {key: len(names & each.places.keys()) for key, each in known.items()}
    # An elbow's marker is beside its joint: points on the skin are in no table of joints.
    fitting = [key for key in hits if not _other(known[key], layout)]
    best = max(hits, key=lambda key: (hits[key], key in fitting), default="")
    if not best or hits[best] < min(FEWEST, len(names)) or not hits[best]:
        return None, []
    if best not in fitting:
        text = (
            f"names are not read as those of {best}, {known[best].seen}, although it has {hits[best]} of "
            f'{len(layout.names)}: these are {layout.seen}; give convention = "{best}" if they are not'
        )
        return None, [Finding(level="warning", subject=subject, text=text)]
    text = f"names are read as those of {best}: it explains {hits[best]} of {len(layout.names)}"
    return known[best], [Finding(level="assumed", subject=subject, text=text)]


def _other(convention: Convention, layout: Layout) -> bool:
    return layout.seen is Seen.MARKERS and convention.seen not in ("", Seen.MARKERS)


def places(
    layout: Layout, convention: Convention | None, given: Mapping[str, Place | None], *, file: str
) -> tuple[Place | None, ...]:
    """Where each row of a layout is; None for one that is not used.

    Args:
        layout: The device's names.
        convention: From `choose`.
        given: The user's own entries by the device's name; None for one that shall not be used.
        file: For messages.

    Raises:
        InputError: A name of the user's that the device does not have, or nothing is left to use.
    """
    problems = [
        Problem(
            file, f"mapping.{name}", "the device has nothing of that name", suggestion(name, layout.names)
        )
        for name in given
        if name not in layout.names
    ]
    if problems:
        raise InputError(problems)
    known = {} if convention is None else convention.places
    found = tuple(given[name] if name in given else known.get(plain(name)) for name in layout.names)
    if not any(found):
        what = f"no bone is known for any of {', '.join(layout.names[:8])}"
        raise InputError.at(file, "mapping", what, 'write mapping = { "their name" = "our bone", … }')
    return found


def _conventions(tables: Mapping[str, Any], file: str) -> dict[str, Convention]:
    problems: list[Problem] = []
    found = {key: _convention(key, value, file, problems) for key, value in tables.items()}
    if problems:
        raise InputError(problems)
    return found


def _convention(name: str, entry: Mapping[str, Any], file: str, problems: list[Problem]) -> Convention:
    every: dict[str, Place] = {}
    weights = tuple(
        _weight(entry.get(key, usual), f"{name}.{key}", file, problems)
        for key, usual in (("position", 1.0), ("orientation", 0.0))
    )
    for pattern, value in entry.get("names", {}).items():
        given = {"bone": value} if isinstance(value, str) else value
        for side in SIDES if "{side}" in pattern else ("",):
            place = _place(given, side, weights)
            if place is None:
                where = f"{name}.names.{pattern}"
                problems.append(Problem(file, where, f"{value!r} is no place", suggestion(str(value), BONES)))
                continue
            for spelling in SPELLINGS.get(side, ("",)):
                every[plain(pattern.replace("{side}", spelling))] = place
    axes = np.eye(3)
    if "axes" in entry:
        given_axes = entry["axes"] if isinstance(entry["axes"], dict) else {}
        columns = [_direction(given_axes.get(axis)) for axis in "xyz"]
        if any(column is None for column in columns) or abs(np.linalg.det(np.array(columns)) - 1) > 1e-9:
            what = f"{entry['axes']!r} is not a right-handed frame"
            problems.append(
                Problem(file, f"{name}.axes", what, 'write { x = "forward", y = "left", z = "up" }')
            )
        else:
            axes = np.array(columns, float).T
    rest = entry.get("rest")
    if not (rest is None or isinstance(rest, str)):
        problems.append(Problem(file, f"{name}.rest", f"{rest!r} is no posture", "give the name of one"))
        rest = None
    return Convention(
        name, every, rest, axes, str(entry.get("source", file)), _seen(entry, name, file, problems)
    )


def _seen(entry: Mapping[str, Any], name: str, file: str, problems: list[Problem]) -> str:
    seen = entry.get("seen", "")
    if seen not in ("", *Seen):
        problems.append(Problem(file, f"{name}.seen", f"{str(seen)[:40]!r}", f"one of {', '.join(Seen)}"))
        return ""
    return str(seen)


def _weight(value: Any, where: str, file: str, problems: list[Problem]) -> float:
    if isinstance(value, int | float) and not isinstance(value, bool) and 0 <= value < np.inf:
        return float(value)
    problems.append(Problem(file, where, f"{str(value)[:40]} is no weight", "give a number from 0 on"))
    return 0.0


def _place(given: Any, side: str, weights: tuple[float, ...]) -> Place | None:
    try:
        bone = given["bone"].replace("{side}", side)
        at = np.array(given.get("at", (0.0, 0.0, 0.0)), float)
        weight = float(given.get("position", weights[0])), float(given.get("orientation", weights[1]))
    except (TypeError, KeyError, ValueError, AttributeError, OverflowError):
        return None
    if bone not in BONES or at.shape != (3,) or not np.isfinite([*at, *weight]).all() or min(weight) < 0:
        return None
    fitted = given.get("fitted") is True
    return Place(bone, at * (1.0, 1.0, -1.0 if side == "left" else 1.0), *weight, fitted=fitted)


def _direction(name: Any) -> Array | None:
    if not isinstance(name, str):
        return None
    if name in OPPOSITES:
        return -DIRECTIONS[OPPOSITES[name]]
    return DIRECTIONS.get(name)
