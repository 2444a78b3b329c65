"""Hand-made animations: a TOML file of postures at instants.

.. code-block:: toml

    title = "pick"
    note = "schematic"           # what whoever reads a result must know of it
    floor = true                 # the lowest sole stays on the floor (default)
    travel = "keys"              # or "feet": the foot that carries does not slide
    repeat = 1                   # how often the keys are played; the last must then equal the first

    [[keyframes]]
    t = 0.0                      # [s]
    posture = "standing"         # of the library; a key without one goes on from the key before

    [[keyframes]]
    t = 1.2
    joints_deg = { right_shoulder_flexion = 60 }  # on top; `joints` in rad
    position = [0.2, 0.0]        # pelvis over the floor: forward, left of where the person stands [m]
    heading_deg = 30             # to the left; or `heading` [rad]
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from seerob.core.errors import InputError, Problem, UnknownName, suggestion
from seerob.core.files.bounded import TooLarge, content
from seerob.core.files.toml_file import loads
from seerob.core.printable import printable_table
from seerob.core.transforms import Array
from seerob.description.description import Description
from seerob.description.humans.motion import Motion, Travel
from seerob.description.humans.posture import joint_values, named, names
from seerob.description.humans.skeleton import JOINTS

LIBRARY = "library:"
"""Start of a file name that means a motion that ships with seerob."""
MAX_BYTES = 2_000_000
MAX_KEYS = 10_000
MAX_DURATION = 3600.0
"""[s] after all repetitions."""
LARGEST = 1e6
"""No time, length or angle is as large."""

_TOP = ("title", "note", "floor", "travel", "repeat", "keyframes")
_KEY = ("t", "posture", "joints", "joints_deg", "position", "heading", "heading_deg")
_PLACE = [JOINTS.index(name) for name in ("pelvis_x", "pelvis_y", "pelvis_turn_left")]


def library() -> tuple[str, ...]:
    """Motions that ship with seerob, sorted."""
    folder = files("seerob.description.humans").joinpath("data/motions")
    return tuple(sorted(f.name.removesuffix(".toml") for f in folder.iterdir() if f.name.endswith(".toml")))


def read(file: str, description: Description, *, folder: Path | None = None) -> Motion:
    """A motion from a file, or from the library: ``library:walk``.

    Args:
        file: Path, from ``folder``; or ``library:`` and a name.
        description: The person; limits are checked against it.
        folder: Where relative paths start.

    Raises:
        InputError: The file is missing or wrong; every mistake in it is named.
    """
    if file.startswith(LIBRARY):
        name = file.removeprefix(LIBRARY)
        if name not in library():
            raise InputError.at(file, "", f"no motion named {name!r}", suggestion(name, library()))
        data = files("seerob.description.humans").joinpath(f"data/motions/{name}.toml").read_bytes()
    else:
        path = (folder or Path()) / file
        try:
            data = content(path, MAX_BYTES)
        except TooLarge as error:
            raise InputError.at(file, "", str(error), "split the motion") from None
        except OSError as error:
            raise InputError.at(file, "", f"cannot be read: {error.strerror}", "give a file") from error
    return parse(data, description, file=file)


def parse(data: bytes, description: Description, *, file: str) -> Motion:
    """A motion from the content of a file; see `read`."""
    try:
        table = printable_table(loads(data.decode("utf-8")))
    except (ValueError, RecursionError) as error:
        raise InputError.at(file, "", f"is not TOML: {error}", "correct the line") from error
    problems = _unknown(file, "", table, _TOP)
    title, note = (_text(table, key, file, problems) for key in ("title", "note"))
    floor = table.get("floor", True)
    if not isinstance(floor, bool):
        problems.append(Problem(file, "floor", f"{floor!r} is not true or false", "give true or false"))
    travel = table.get("travel", Travel.KEYS)
    if travel not in tuple(Travel):
        problems.append(Problem(file, "travel", f"{travel!r} is not known", 'give "keys" or "feet"'))
    repeat = table.get("repeat", 1)
    if isinstance(repeat, bool) or not isinstance(repeat, int) or not 1 <= repeat <= MAX_KEYS:
        problems.append(Problem(file, "repeat", f"{repeat!r} is not a count", f"give 1…{MAX_KEYS}"))
    t, q = _keys(table.get("keyframes"), description, file, problems)
    if problems:
        raise InputError(problems)
    t, q = _repeated(t, q, repeat, file)
    return Motion(title, note, t, q, floor, Travel(travel))


def _keys(raw: object, description: Description, file: str, problems: list[Problem]) -> tuple[Array, Array]:
    if not isinstance(raw, list) or not 1 <= len(raw) <= MAX_KEYS:
        what = "no [[keyframes]]" if not raw else f"keyframes are not a list of 1…{MAX_KEYS} tables"
        problems.append(Problem(file, "keyframes", what, "write [[keyframes]] with t and posture"))
        return np.zeros(0), np.zeros((0, len(JOINTS)))
    instants: list[float] = []
    values: list[Array] = []
    for index, key in enumerate(raw):
        where = f"keyframes[{index}]"
        if not isinstance(key, dict):
            problems.append(Problem(file, where, f"{key!r} is not a table", "write [[keyframes]]"))
            continue
        problems += _unknown(file, where, key, _KEY)
        t = _number(key.get("t"))
        if t is None or t < 0:
            what = f"t is {key.get('t')!r}" if "t" in key else "t is missing"
            problems.append(Problem(file, f"{where}.t", what, "give the instant in seconds, from 0"))
        elif instants and t <= instants[-1]:
            what = f"{t:g} s is not after {instants[-1]:g} s"
            problems.append(Problem(file, f"{where}.t", what, "write the keys in the order of time"))
        else:
            instants.append(t)
        values.append(_values(key, values[-1] if values else None, description, (file, where), problems))
    return np.array(instants), np.array(values)


def _values(
    key: dict[str, Any],
    before: Array | None,
    description: Description,
    place: tuple[str, str],
    problems: list[Problem],
) -> Array:
    """Joint values of a key: the posture's or those of the key before, its own on top, where it stands."""
    file, where = place
    base = np.zeros(len(JOINTS)) if before is None else before
    if "posture" in key:
        name = key["posture"]
        if name in names():
            stand = base[_PLACE]
            base = joint_values(description, named(name))
            base[_PLACE] = stand
        else:
            remedy = suggestion(str(name), names())
            problems.append(Problem(file, f"{where}.posture", f"no posture named {name!r}", remedy))
    elif before is None:
        remedy = f"the first key needs one: {', '.join(names())}"
        problems.append(Problem(file, f"{where}.posture", "is missing", remedy))
    wanted: dict[str, Any] = {}
    for table, suffix in (("joints", ""), ("joints_deg", "_deg")):
        given = key.get(table, {})
        if not isinstance(given, Mapping):
            problems.append(Problem(file, f"{where}.{table}", "is not a table", "write { joint = value }"))
            continue
        wanted |= {f"{name}{suffix}": value for name, value in given.items()}
    q = _joints(description, wanted, base, place, problems)
    _stand(key, q, place, problems)
    return q


def _joints(
    description: Description,
    wanted: dict[str, Any],
    base: Array,
    place: tuple[str, str],
    problems: list[Problem],
) -> Array:
    file, where = place
    try:
        return joint_values(description, wanted, base=base, file=file)
    except UnknownName as error:
        remedy = suggestion(error.name, error.known)
        problems.append(Problem(file, f"{where}.joints", f"no joint named {error.name!r}", remedy))
    except InputError as error:
        problems += [p._replace(key=f"{where}.joints.{p.key}") for p in error.problems]
    return base.copy()


def _stand(key: dict[str, Any], q: Array, place: tuple[str, str], problems: list[Problem]) -> None:
    file, where = place
    if "position" in key:
        raw = key["position"]
        numbers = [_number(x) for x in raw] if isinstance(raw, list) and len(raw) == 2 else [None]
        if None in numbers:
            what = f"{raw!r} is not two numbers"
            problems.append(Problem(file, f"{where}.position", what, "give [forward, left] in metres"))
        else:
            q[_PLACE[:2]] = numbers
    if "heading" in key and "heading_deg" in key:
        problems.append(Problem(file, f"{where}.heading", "is given twice", "give heading or heading_deg"))
    for name, factor in (("heading", 1.0), ("heading_deg", math.pi / 180)):
        if name not in key:
            continue
        number = _number(key[name])
        if number is None:
            what = f"{key[name]!r} is not a number"
            problems.append(Problem(file, f"{where}.{name}", what, "give the turn to the left"))
        else:
            q[_PLACE[2]] = number * factor


def _repeated(t: Array, q: Array, count: int, file: str) -> tuple[Array, Array]:
    """The keys ``count`` times one after the other; position goes on from where it ended."""
    length = float(t[-1] - t[0])
    if length * count > MAX_DURATION:
        what = f"{length * count:g} s is longer than {MAX_DURATION:g} s"
        raise InputError.at(file, "keyframes", what, "make the motion shorter and let the source loop")
    if count == 1:
        return t, q
    if len(t) * count > MAX_KEYS * 10:
        raise InputError.at(file, "repeat", f"{len(t) * count} keys", "let the source loop instead")
    step = q[-1] - q[0]
    apart = np.abs(np.delete(step, _PLACE[:2]))
    if len(t) < 2 or apart.max() > 1e-6:
        worst = np.delete(np.array(JOINTS), _PLACE[:2])[int(apart.argmax())]
        what = f"the last key differs from the first in {worst} by {apart.max():.3g}"
        raise InputError.at(file, "repeat", what, "end a repeated motion as it began")
    rounds = np.arange(count)
    shifted_t = (t[1:] + rounds[:, None] * length).ravel()
    shifted_q = (q[1:] + rounds[:, None, None] * step).reshape(-1, q.shape[1])
    return np.append(t[0], shifted_t), np.vstack([q[:1], shifted_q])


def _unknown(file: str, where: str, table: dict[str, Any], known: tuple[str, ...]) -> list[Problem]:
    dot = f"{where}." if where else ""
    return [
        Problem(file, dot + key, "is not known", suggestion(key, known)) for key in table if key not in known
    ]


def _text(table: dict[str, Any], key: str, file: str, problems: list[Problem]) -> str:
    value = table.get(key, "")
    if not isinstance(value, str):
        problems.append(Problem(file, key, f"{value!r} is not a text", 'write "…"'))
        return ""
    return value


def _number(raw: object) -> float | None:
    if isinstance(raw, bool) or not isinstance(raw, int | float) or not abs(raw) < LARGEST:
        return None
    return float(raw)
