"""Hand-made animations: a TOML file of postures at instants, and the motion between them.

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

Between keys each joint follows the cubic Hermite spline with the slopes of Fritsch and Butland (1984;
"pchip"), and starts and ends at rest: its velocity is continuous, and where the keys rise it rises, so it
never leaves the range of two neighbouring keys and thus never a limit.

The pelvis' height is not interpolated but follows from the legs: at every instant the lowest sole is on
the floor. Its velocity may jump when the weight passes from one edge of a sole to another.
With `Travel.FEET` the pelvis also moves over the floor so that the point that touches it does not slide.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from importlib.resources import files
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from seerob.core.errors import InputError, Problem, UnknownName, suggestion
from seerob.core.files.bounded import TooLarge, content
from seerob.core.files.toml_file import loads
from seerob.core.printable import printable_table
from seerob.core.transforms import Array
from seerob.description.description import Description
from seerob.description.humans.posture import HEIGHT, joint_values, named, names, sole_corners
from seerob.description.humans.skeleton import JOINTS, bone_poses

FINENESS = 8
"""Instants per sample at which floor contact is followed."""


class Travel(StrEnum):
    """How the pelvis gets over the floor."""

    KEYS = "keys"
    """Places are those of the keys' positions; feet may slide."""
    FEET = "feet"
    """On top of the keys' positions, so that the point of the foot that carries stays where it is."""


class Sampled(NamedTuple):
    """A motion at a fixed rate."""

    t: Array
    """Instants from 0 [s], shape (n,)."""
    q: Array
    """Joint values [rad, m], shape (n, 53)."""
    qd: Array
    """Their velocities [rad/s, m/s], shape (n, 53)."""


@dataclass(frozen=True, eq=False)
class Motion:
    """Postures at instants."""

    title: str
    note: str
    """What it is not: ``schematic``."""
    t: Array
    """Instants of the keys from 0 [s], shape (k,), strictly increasing, k >= 1."""
    q: Array
    """Joint values at the keys [rad, m], shape (k, 53)."""
    floor: bool = True
    """Keep the lowest sole on the floor; else the pelvis' height is interpolated like a joint."""
    travel: Travel = Travel.KEYS

    @property
    def duration(self) -> float:
        """From the first to the last key [s]."""
        return float(self.t[-1] - self.t[0])


def interpolated(keys_t: Array, keys_q: Array, t: Array) -> tuple[Array, Array]:
    """Values and velocities, each (n, m), of keys (k,), (k, m) at instants (n,) within their span."""
    if len(keys_t) == 1:
        return np.repeat(keys_q, len(t), axis=0), np.zeros((len(t), keys_q.shape[1]))
    width = np.diff(keys_t)[:, None]
    chord = np.diff(keys_q, axis=0) / width
    slopes = np.zeros_like(keys_q)
    slopes[1:-1] = _between(width, chord)
    bend = (slopes[:-1] + slopes[1:] - 2 * chord) / width
    cubic = (keys_q[:-1], slopes[:-1], (chord - slopes[:-1]) / width - bend, bend / width)
    # Rounding may leave the range of the keys by the last bit; a limit is a limit.
    after = np.clip(np.searchsorted(keys_t, t, side="right"), 1, len(keys_t) - 1)
    low = np.minimum(keys_q[after - 1], keys_q[after])
    high = np.maximum(keys_q[after - 1], keys_q[after])
    x = (t - keys_t[after - 1])[:, None]
    a, b, c, d = (each[after - 1] for each in cubic)
    return np.clip(a + b * x + c * (x * x) + d * (x * x * x), low, high), b + c * x * 2 + d * (x * x) * 3


def _between(width: Array, chord: Array) -> Array:
    """Slopes at the inner keys (k - 2, m) of chords (k - 1, m), with which nothing is passed beyond a key.

    The weighted harmonic mean of both chords (Fritsch and Butland 1984), 0 where they differ in sign.
    """
    before, after = chord[:-1], chord[1:]
    w1, w2 = 2 * width[1:] + width[:-1], width[1:] + 2 * width[:-1]
    onward = np.sign(before) * np.sign(after) > 0
    mean = (w1 / np.where(onward, before, 1.0) + w2 / np.where(onward, after, 1.0)) / (w1 + w2)
    return np.where(onward, 1.0 / np.where(onward, mean, 1.0), 0.0)


def sample(motion: Motion, description: Description, rate: float) -> Sampled:
    """The motion at a rate [1/s]; the last sample is at the last key or less than 1/rate after it."""
    count = int(np.ceil(motion.duration * rate - 1e-9)) + 1
    t = np.arange(count) / rate
    following = motion.floor or motion.travel is Travel.FEET
    fine = FINENESS if following else 1
    instants = np.arange((count - 1) * fine + 1) / (rate * fine)
    within = np.minimum(motion.t[0] + instants, motion.t[-1])
    q, qd = interpolated(motion.t, motion.q, within)
    if following:
        moved = q[:, :3] + _carried(description, q, floor=motion.floor, travel=motion.travel)
        q[:, :3] = moved
        if count > 1:
            qd[:, :3] = np.gradient(moved, instants, axis=0)
    return Sampled(t, q[::fine], qd[::fine])


def _carried(description: Description, q: Array, *, floor: bool, travel: Travel) -> Array:
    """What to add to the pelvis' position in the root's axes [m], (n, 3), for the feet to carry it."""
    placed = q.copy()
    if floor:
        placed[:, HEIGHT] = 0.0
    rotations, positions = bone_poses(description, placed)
    corners, centers, owners = sole_corners(description, rotations, positions)
    lowest = corners[..., 2].argmin(axis=1)
    rows = np.arange(len(q))
    added = np.zeros((len(q), 3))
    if floor:
        added[:, 2] = -q[:, HEIGHT] - corners[rows, lowest, 2]
    if travel is Travel.FEET and len(q) > 1:
        added[1:, :2] = -np.cumsum(_slips(rotations, corners, centers, owners, lowest), axis=0)
    return added


def _slips(
    rotations: Array, corners: Array, centers: Array, owners: NDArray[np.intp], lowest: NDArray[np.intp]
) -> Array:
    """Way over the floor of the touching point from one instant to the next [m], shape (n - 1, 2)."""
    rows = np.arange(len(lowest) - 1)
    which = lowest[:-1]
    bone = owners[which]
    arm = corners[rows, which] - centers[rows, which]  # from the core's corner down to the floor
    turned = rotations[rows + 1, bone] @ np.swapaxes(rotations[rows, bone], -1, -2)
    after = centers[rows + 1, which] + (turned @ arm[..., None])[..., 0]
    return np.asarray((after - corners[rows, which])[:, :2])


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
