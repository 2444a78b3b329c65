"""Joint angles of a person from a file: OpenSim's storage format, or a table with our names of joints.

The table is delimited text whose first row names the columns and whose other rows are numbers only.

Joint values of a person as the coordinates of OpenSim's full-body models, and back.

Names and senses are those of Rajagopal et al. 2016 (``pelvis_tilt``, ``hip_flexion_r``, ``arm_add_l`` …),
as far as they are known here from use, not from its file (confidence M). Its axes are the ISB's, as ours:
X forward, Y up, Z to the right. Three things differ and are converted or said:

- the pelvis turns in the order tilt, list, rotation, ours the other way round; the shoulder likewise;
- it has one joint of the back where we have two: each takes half of the turn, about the same axis;
- it has no neck, no collar bones, and oblique axes in ankle, foot, elbow and wrist: taken as straight.
"""

from __future__ import annotations

import re
from array import array
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

from seerob.core.errors import InputError, Problem, UnknownName, suggestion
from seerob.core.snapshot import Finding
from seerob.core.transforms import Array, about, angles_from_rotation, product, rotation_from_wxyz
from seerob.description.humans.skeleton import JOINTS, resolve
from seerob.files.motion_capture import storage
from seerob.files.motion_capture.body_table import Commas
from seerob.files.motion_capture.frame_arrays import check_size
from seerob.files.motion_capture.storage import Storage
from seerob.files.tables.grid import MAX_COLUMNS, MAX_PROBLEMS, Grid
from seerob.files.tables.headers import Role, understand
from seerob.files.tables.mapping import Mapping
from seerob.files.tables.table_files import candidates

SIDES = {"r": "right", "l": "left"}
PELVIS = ("pelvis_tilt", "pelvis_list", "pelvis_rotation")
PLACE = ("pelvis_tx", "pelvis_ty", "pelvis_tz")
BACK = ("lumbar_extension", "lumbar_bending", "lumbar_rotation")
BENT = -1.0
"""Sign of knee flexion in our values; older models (gait2392) have it so too."""

_STRAIGHT = (
    # Ours on the right, theirs, sign.
    ("hip_flexion", "hip_flexion", 1.0),
    ("hip_adduction", "hip_adduction", 1.0),
    ("hip_internal_rotation", "hip_rotation", 1.0),
    ("knee_extension", "knee_angle", BENT),
    ("ankle_dorsiflexion", "ankle_angle", 1.0),
    ("ankle_inversion", "subtalar_angle", 1.0),
    ("toes_extension", "mtp_angle", 1.0),
    ("elbow_flexion", "elbow_flex", 1.0),
    ("elbow_pronation", "pro_sup", 1.0),
    ("wrist_flexion", "wrist_flex", 1.0),
    ("wrist_ulnar_deviation", "wrist_dev", 1.0),
)
ARM = ("arm_flex", "arm_add", "arm_rot")


def _index(side: str, name: str) -> tuple[int, float]:
    """Place in q of a movement named for the right side, and the sign that it has on this side."""
    from seerob.description.humans.skeleton import resolve

    ((place, sign),) = resolve(f"{SIDES[side]}_{name}")
    return place, sign


def coordinates() -> tuple[str, ...]:
    """All names, in the order of `from_joints`."""
    sided = [f"{theirs}_{s}" for s in SIDES for theirs in (*(t for _, t, _ in _STRAIGHT), *ARM)]
    return (*PELVIS, *PLACE, *BACK, *sided)


def is_length(name: str) -> bool:
    """Whether a coordinate is a length [m] and not an angle."""
    return name in PLACE


def in_its_world(points: Array) -> Array:
    """Points of a world with z up in OpenSim's (x forward, y up, z right), shape (..., 3)."""
    return np.stack([points[..., 0], points[..., 2], -points[..., 1]], axis=-1)


def from_joints(q: Array, pelvis: Array) -> Array:
    """OpenSim's coordinates of postures.

    Args:
        q: Joint values [rad, m], shape (n, 53).
        pelvis: Where the pelvis is in a world with z up [m], shape (n, 3).

    Returns:
        Angles [rad] and lengths [m] in OpenSim's world (x forward, y up, z right), shape (n, 37), in the
        order of `coordinates`.
    """
    found: dict[str, Array] = {}
    turn = _turned("YXZ", q[:, _places("pelvis_turn_left", "pelvis_list_right", "pelvis_tilt_back")])
    found |= zip(PELVIS, _angles("ZXY", turn).T, strict=True)
    found |= zip(PLACE, in_its_world(pelvis).T, strict=True)
    back = product(_turned("ZXY", q[:, _spine("lumbar")]), _turned("ZXY", q[:, _spine("thorax")]))
    found |= zip(BACK, _angles("ZXY", back).T, strict=True)
    for side in SIDES:
        for ours, theirs, sign in _STRAIGHT:
            place, own = _index(side, ours)
            found[f"{theirs}_{side}"] = sign * own * q[:, place]
        mirror = _mirror(side)
        arm = _turned("ZYX", q[:, _arm(side)])
        for name, values in zip(ARM, (_angles("ZXY", arm) * mirror[[0, 1, 2]]).T, strict=True):
            found[f"{name}_{side}"] = values
    return np.stack([found[name] for name in coordinates()], axis=1)


def to_joints(
    names: Sequence[str], values: Array, *, knee: float = BENT
) -> tuple[Array, Array, tuple[str, ...]]:
    """Postures of OpenSim's coordinates.

    Args:
        names: Of the coordinates; what is not known is left out, what is not there is 0.
        values: Angles [rad] and lengths [m], shape (n, k).
        knee: Sign of knee flexion in our values per theirs: -1 where a bent knee is positive.

    Returns:
        Joint values [rad, m] with the place of the pelvis left at 0, shape (n, 53); where the pelvis is in a
        world with z up [m], shape (n, 3), NaN where nobody says; and the names that were used.
    """
    known = {name: values[:, k] for k, name in enumerate(names)}
    zero = np.zeros(len(values))
    q = np.zeros((len(values), len(JOINTS)))

    def block(wanted: Sequence[str]) -> Array:
        return np.stack([known.get(name, zero) for name in wanted], axis=1)

    places = _places("pelvis_turn_left", "pelvis_list_right", "pelvis_tilt_back")
    q[:, places] = _angles("YXZ", _turned("ZXY", block(PELVIS)))
    half = _turned("ZXY", block(BACK))
    half = np.where(half[:, :1] < 0, -half, half) + np.array([1.0, 0.0, 0.0, 0.0])
    angles = _angles("ZXY", half)
    q[:, _spine("lumbar")] = q[:, _spine("thorax")] = angles
    for side in SIDES:
        for ours, theirs, sign in _STRAIGHT:
            place, own = _index(side, ours)
            factor = knee if theirs == "knee_angle" else sign
            q[:, place] = factor * own * known.get(f"{theirs}_{side}", zero)
        arm = block([f"{name}_{side}" for name in ARM]) * _mirror(side)
        q[:, _arm(side)] = _angles("ZYX", _turned("ZXY", arm))
    at = block(PLACE) if set(PLACE) <= set(known) else np.full((len(values), 3), np.nan)
    pelvis = np.stack([at[:, 0], -at[:, 2], at[:, 1]], axis=1)
    return q, pelvis, tuple(name for name in coordinates() if name in known)


def knee_sign(names: Sequence[str], values: Array) -> float | None:
    """Which sign a bent knee has: a knee bends to one side only.

    Returns:
        For ``knee`` of `to_joints`; None when the knees never bend by more than a little.
    """
    columns = [k for k, name in enumerate(names) if name in ("knee_angle_r", "knee_angle_l")]
    if not columns:
        return None
    with np.errstate(invalid="ignore"):
        knees = values[:, columns]
        most, least = np.nanmax(knees, initial=0.0), np.nanmin(knees, initial=0.0)
    if max(most, -least) < np.radians(10):
        return None
    return BENT if most > -least else -BENT


def _places(*names: str) -> list[int]:
    return [JOINTS.index(name) for name in names]


def _spine(bone: str) -> list[int]:
    return _places(f"{bone}_extension", f"{bone}_bend_right", f"{bone}_turn_left")


def _arm(side: str) -> list[int]:
    names = ("shoulder_flexion", "shoulder_internal_rotation", "shoulder_adduction")
    return [_index(side, name)[0] for name in names]


def _mirror(side: str) -> Array:
    """Signs of flexion, adduction, rotation about the axes of the bone."""
    return np.array([1.0, 1.0, 1.0] if side == "r" else [1.0, -1.0, -1.0])


def _turned(order: str, angles: Array) -> Array:
    """Quaternions (n, 4) of three turns (n, 3) [rad] about turned axes."""
    first, second, third = (about(axis, angles[:, k]) for k, axis in enumerate(order.lower()))
    return product(product(first, second), third)


def _angles(order: str, wxyz: Array) -> Array:
    return angles_from_rotation(order, rotation_from_wxyz(wxyz))


def read_columns(path: Path, *, file: str) -> tuple[list[str], Array, Array]:
    """Header, first column (n,) and the other columns (n, k); empty cells and ``NaN`` are NaN.

    Raises:
        InputError: It is no such table; every row that is wrong, up to a bound.
    """
    for grid, _ in candidates(path, file, Mapping()):
        rows = [list(map(str, row)) for row in islice(grid.rows(), 2)]
        if len(rows) == 2 and 2 <= len(rows[0]) <= MAX_COLUMNS and len(rows[0]) == len(rows[1]):
            return _read(grid, [cell.strip() for cell in rows[0]])
    raise InputError.at(file, "", "no table: a row of names and rows of numbers", "is it delimited text?")


def _read(grid: Grid, header: list[str]) -> tuple[list[str], Array, Array]:
    flat = array("d")
    count = 0
    problems: list[Problem] = []
    commas = Commas(grid.file)
    for number, row in enumerate(islice(grid.rows(), 1, None), start=2):
        cells = [str(cell).strip() for cell in row]
        if not any(cells):
            continue
        if len(cells) != len(header):
            problems.append(Problem(grid.file, f"row {number}", f"{len(cells)} cells, {len(header)} names"))
        else:
            try:
                flat.extend([commas.number(cell or "nan") for cell in cells])
                count += 1
            except ValueError as error:
                problems.append(Problem(grid.file, f"row {number}", str(error)[:120]))
        if len(problems) >= MAX_PROBLEMS:
            break
        check_size(grid.file, count, len(header))
    if problems:
        raise InputError(problems)
    commas.check()
    table = np.array(flat).reshape(count, len(header)) if count else np.empty((0, len(header)))
    return header, table[:, 0], table[:, 1:]


LENGTHS = tuple(name for name in JOINTS if name in ("pelvis_x", "pelvis_y", "pelvis_z"))
FACTORS = {"deg": np.pi / 180, "rad": 1.0, "mm": 1e-3, "m": 1.0}
OF_OUR_EXPORT = re.compile(r"tracking error( \[.*\])?|\w+ measured", re.IGNORECASE)
"""Columns of the sink `csv` that are no joints."""
TIMES = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0}


@dataclass(frozen=True, eq=False)
class JointAngles:
    """Postures at instants."""

    t: Array
    """[s], shape (n,)."""
    q: Array
    """Joint values [rad, m], shape (n, 53); the pelvis is at 0 where `pelvis` says where it is."""
    pelvis: Array
    """Where the pelvis is, z up [m], shape (n, 3); NaN where nobody says."""
    findings: tuple[Finding, ...]
    high: bool = False
    """The joint values themselves say how high the pelvis is."""
    placed: bool = True
    """It says where the person stands."""
    given: frozenset[str] = frozenset(JOINTS)
    """Joints of which the file says anything; the others are at 0."""


def from_storage(path: Path, *, file: str) -> JointAngles:
    """OpenSim's coordinates, or our own names of joints, in a ``.mot`` or ``.sto``.

    Raises:
        InputError: It is no such file, does not say whether angles are in degrees, or has no known names.
    """
    found = storage.read(path, file=file)
    if found.degrees is None:
        what = "it does not say whether angles are in degrees"
        raise InputError.at(file, "inDegrees", what, "write inDegrees=yes or inDegrees=no in its header")
    known = [name for name in found.labels if name in coordinates()]
    own = [name for name in found.labels if name in JOINTS]
    if len(known) >= len(own) and known:
        return _of_opensim(found, file)
    if not own:
        what = f"no coordinate that is known: {', '.join(found.labels[:8])}"
        raise InputError.at(file, "", what, f"names such as {', '.join(coordinates()[9:12])} are expected")
    factor = np.pi / 180 if found.degrees else 1.0
    units = ["m" if name in LENGTHS else ("deg" if factor != 1.0 else "rad") for name in found.labels]
    return _of_names(list(found.labels), units, found.t, found.values, found.findings, file)


def _of_opensim(found: Storage, file: str) -> JointAngles:
    lengths = np.array([is_length(name) for name in found.labels])
    scale = np.where(lengths, 1.0, np.pi / 180 if found.degrees else 1.0)
    values = found.values * scale
    said = list(found.findings)
    knee = knee_sign(found.labels, values)
    if knee is None:
        knee = BENT
    elif knee != BENT:
        text = f"{file}: a bent knee is negative in it, as in older models (gait2392); taken so"
        said.append(Finding(level="assumed", subject="", text=text))
    q, pelvis, used = to_joints(found.labels, values, knee=knee)
    q[~np.isfinite(values[:, [k for k, n in enumerate(found.labels) if n in used]]).all(axis=1)] = np.nan
    text = (
        f"{file}: {len(used)} coordinates of OpenSim taken for joints of ours; oblique axes of its ankles, "
        "elbows and wrists are taken as straight, its one joint of the back is divided evenly, neck and "
        "collar bones stay at 0"
    )
    said.append(Finding(level="assumed", subject="", text=text))
    rest = [name for name in found.labels if name not in used]
    if rest:
        said.append(Finding(level="note", subject="", text=f"{file}: not used: {', '.join(rest)[:200]}"))
    # Which of our joints any of its coordinates moves: several of ours may follow from several of its.
    moved, _, _ = to_joints(found.labels, np.linspace(0.1, 0.4, len(found.labels))[None])
    given = frozenset(name for name, q0 in zip(JOINTS, moved[0].tolist(), strict=True) if q0)
    placed = bool(np.isfinite(pelvis).any())
    return JointAngles(found.t, q, pelvis, tuple(said), placed=placed, given=given)


def from_table(path: Path, *, file: str) -> JointAngles:
    """A table with our names of joints and their units in the header: ``right_knee_flexion [deg]``.

    Raises:
        InputError: A header that is no joint or has no unit, a cell that is no number; all of them.
    """
    header, t, values = read_columns(path, file=file)
    names, units = [], []
    problems: list[Problem] = []
    joints = [k for k, text in enumerate(header[1:]) if not OF_OUR_EXPORT.fullmatch(text)]
    findings: tuple[Finding, ...] = ()
    if len(joints) < values.shape[1]:
        text = f"{file}: tracking errors, and what was measured and what estimated, are not read"
        findings = (Finding(level="assumed", subject="", text=text),)
        header, values = [header[0], *(header[1 + k] for k in joints)], values[:, joints]
    for text in header[1:]:
        plain = understand(text)
        name = text.partition("[")[0].partition("(")[0].strip().replace(" ", "_").lower()
        name = name.removesuffix("_deg").removesuffix("_rad") if plain.unit in ("deg", "rad") else name
        if plain.unit not in FACTORS:
            problems.append(
                Problem(file, text[:60], "no unit in this header", "write it: [deg], [rad] or [m]")
            )
        names.append(name)
        units.append(plain.unit or "")
    time = understand(header[0])
    if time.role is not Role.TIME or time.unit not in TIMES:
        problems.append(Problem(file, header[0][:60], "no time with a unit", "the first column is time [s]"))
    if problems:
        raise InputError(problems[:20])
    return _of_names(names, units, t * TIMES[time.unit or "s"], values, findings, file)


def _of_names(
    names: list[str], units: list[str], t: Array, values: Array, said: tuple[Finding, ...], file: str
) -> JointAngles:
    q = np.zeros((len(t), len(JOINTS)))
    problems: list[Problem] = []
    taken: dict[int, str] = {}
    for k, (name, unit) in enumerate(zip(names, units, strict=True)):
        try:
            places = resolve(name)
        except UnknownName as error:
            problems.append(Problem(file, name[:60], "no joint of a person", suggestion(name, error.known)))
            continue
        for place, sign in places:
            length = JOINTS[place] in LENGTHS
            if length != (unit in ("m", "mm")):
                problems.append(
                    Problem(file, name[:60], f"in {unit}", "a length is in m, an angle in deg or rad")
                )
            if place in taken:
                problems.append(
                    Problem(file, name[:60], f"is the same joint as {taken[place]!r}", "keep one")
                )
            taken[place] = name
            q[:, place] = sign * FACTORS[unit] * values[:, k]
    if problems:
        raise InputError(problems[:20])
    unseen = [name for i, name in enumerate(JOINTS) if i not in taken and name not in LENGTHS]
    text = (
        f"{file}: {len(taken)} joints given; at 0: {', '.join(unseen[:12])}{' …' if len(unseen) > 12 else ''}"
    )
    findings = said if not unseen else (*said, Finding(level="assumed", subject="", text=text))
    placed = {JOINTS.index(name) for name in LENGTHS[:2]} <= taken.keys()
    nowhere = np.full((len(t), 3), np.nan)
    given = frozenset(JOINTS[place] for place in taken)
    return JointAngles(t, q, nowhere, findings, JOINTS.index("pelvis_z") in taken, placed, given)
