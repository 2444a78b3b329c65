"""Joint angles of a person from a file: OpenSim's storage format, or a table with our names of joints.

The table is delimited text whose first row names the columns and whose other rows are numbers only.
"""

from __future__ import annotations

import re
from array import array
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

from seerob.core.errors import InputError, Problem, UnknownName, suggestion
from seerob.core.snapshot import Finding
from seerob.core.transforms import Array
from seerob.description.humans.skeleton import JOINTS, resolve
from seerob.files.motion_capture import opensim_coordinates as opensim
from seerob.files.motion_capture import storage
from seerob.files.motion_capture.decimal_comma import Commas
from seerob.files.motion_capture.frame_arrays import check_size
from seerob.files.motion_capture.storage import Storage
from seerob.files.tables.candidates import candidates
from seerob.files.tables.grid import MAX_COLUMNS, MAX_PROBLEMS, Grid
from seerob.files.tables.headers import Role, understand
from seerob.files.tables.mapping import Mapping


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


def from_storage(path: Path, *, file: str) -> JointAngles:
    """OpenSim's coordinates, or our own names of joints, in a ``.mot`` or ``.sto``.

    Raises:
        InputError: It is no such file, does not say whether angles are in degrees, or has no known names.
    """
    found = storage.read(path, file=file)
    if found.degrees is None:
        what = "it does not say whether angles are in degrees"
        raise InputError.at(file, "inDegrees", what, "write inDegrees=yes or inDegrees=no in its header")
    known = [name for name in found.labels if name in opensim.coordinates()]
    own = [name for name in found.labels if name in JOINTS]
    if len(known) >= len(own) and known:
        return _of_opensim(found, file)
    if not own:
        what = f"no coordinate that is known: {', '.join(found.labels[:8])}"
        raise InputError.at(
            file, "", what, f"names such as {', '.join(opensim.coordinates()[9:12])} are expected"
        )
    factor = np.pi / 180 if found.degrees else 1.0
    units = ["m" if name in LENGTHS else ("deg" if factor != 1.0 else "rad") for name in found.labels]
    return _of_names(list(found.labels), units, found.t, found.values, found.findings, file)


def _of_opensim(found: Storage, file: str) -> JointAngles:
    lengths = np.array([opensim.is_length(name) for name in found.labels])
    scale = np.where(lengths, 1.0, np.pi / 180 if found.degrees else 1.0)
    values = found.values * scale
    said = list(found.findings)
    knee = opensim.knee_sign(found.labels, values)
    if knee is None:
        knee = opensim.BENT
    elif knee != opensim.BENT:
        text = f"{file}: a bent knee is negative in it, as in older models (gait2392); taken so"
        said.append(Finding(level="assumed", subject="", text=text))
    q, pelvis, used = opensim.to_joints(found.labels, values, knee=knee)
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
    return JointAngles(found.t, q, pelvis, tuple(said), placed=bool(np.isfinite(pelvis).any()))


def from_table(path: Path, *, file: str) -> JointAngles:
    """A table with our names of joints and their units in the header: ``right_knee_flexion [deg]``.

    Raises:
        InputError: A header that is no joint or has no unit, a cell that is no number; all of them.
    """
    header, t, values = read_columns(path, file=file)
    names, units = [], []
    problems: list[Problem] = []
    joints = [k for k, text in enumerate(header[1:]) if not OF_OUR_EXPORT.fullmatch(text)]
    told: tuple[Finding, ...] = ()
    if len(joints) < values.shape[1]:
        text = f"{file}: tracking errors, and what was measured and what estimated, are not read"
        told = (Finding(level="assumed", subject="", text=text),)
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
    return _of_names(names, units, t * TIMES[time.unit or "s"], values, told, file)


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
    return JointAngles(t, q, nowhere, findings, JOINTS.index("pelvis_z") in taken, placed)
