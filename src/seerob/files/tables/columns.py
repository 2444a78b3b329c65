"""Which columns hold time, joints and the tool, by the words in their headers."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from seerob.core.errors import Problem
from seerob.core.orientation import CONVENTIONS, columns_of, is_convention
from seerob.files.tables.grid import blank
from seerob.files.tables.headers import ROTATION_VECTOR, UR_POSE, Role
from seerob.files.tables.layout import Layout
from seerob.files.tables.mapping import Mapping, Motion
from seerob.workstation.source import Target

ORIENTATIONS: dict[tuple[str, ...], str] = {
    ("qw", "qx", "qy", "qz"): "wxyz",
    ("a", "b", "c"): "ZYX",
    ("roll", "pitch", "yaw"): "rpy",
    ("w", "p", "r"): "rpy",
    ("rx", "ry", "rz"): "XYZ",
    ROTATION_VECTOR: "rotation_vector",
}
"""Names of orientation columns → the convention they most often mean."""
CERTAIN = (("qw", "qx", "qy", "qz"), ROTATION_VECTOR)
"""Those that mean nothing else."""


@dataclass(eq=False)
class Columns:
    """Columns of a layout; indices from 0."""

    mapping: dict[str, Any] = field(default_factory=dict)
    questions: dict[str, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    problems: list[Problem] = field(default_factory=list)
    indices: dict[str, tuple[int, ...]] = field(default_factory=dict)
    """Key of the mapping → columns."""


def guess_columns(
    layout: Layout, given: Mapping, target: Target | None, motion: Motion = Motion.JOINTS
) -> Columns:
    """The columns of every role, given or found; questions where several could be meant."""
    found = Columns()
    _single(layout, given, found, "time", Role.TIME)
    _single(layout, given, found, "robot_column", Role.ROBOT)
    _robots(layout, given, found, target)
    needed = {"time": "time"}
    if motion is Motion.JOINTS:
        needed["joints"] = "joint"
        if not _joints_by_name(layout, given, found, target):
            _joints(layout, given, found, "joints", Role.JOINT)
        count = len(found.indices.get("joints", ()))
        _joints(layout, given, found, "velocities", Role.VELOCITY, count)
        _joints(layout, given, found, "torques", Role.TORQUE, count)
    else:
        needed |= {"tcp_position": "tool position", "tcp_orientation": "tool orientation"}
        _tool_by_name(layout, given, found)
    _tool(layout, given, found)
    file, header = layout.grid.file, f"row {layout.header_row}"
    for key, what in needed.items():
        if not found.problems and not found.indices.get(key):
            names = ", ".join(repr(h.text) for h in layout.headers[:12] if h.text)
            remedy = f"name it in [sources.mapping]: {key} = …"
            found.problems.append(Problem(file, header, f"no {what} column among {names or 'none'}", remedy))
    used = {i for indices in found.indices.values() for i in indices}
    left = [h.text for i, h in enumerate(layout.headers) if h.text and i not in used]
    if left:
        more = f" and {len(left) - 12} more" if len(left) > 12 else ""
        found.notes.append("columns not used: " + ", ".join(left[:12]) + more)
    return found


def _single(layout: Layout, given: Mapping, found: Columns, key: str, role: Role) -> None:
    column = getattr(given, key)
    if column is not None:
        index = layout.find(key, column)
        if isinstance(index, Problem):
            found.problems.append(index)
        else:
            found.indices[key] = (index,)
        return
    fits = [i for i, h in enumerate(layout.headers) if h.role is role]
    if not fits:
        return
    found.indices[key] = (fits[0],)
    found.mapping[key] = layout.reference(fits[0])
    if len(fits) > 1:
        names = ", ".join(repr(layout.label(i)) for i in fits)
        found.questions[key] = f"{len(fits)} columns could be meant: {names}"


def _robots(layout: Layout, given: Mapping, found: Columns, target: Target | None) -> None:
    if given.robot is not None or "robot_column" not in found.indices:
        return
    (column,) = found.indices["robot_column"]
    names = {str(r[column]).strip(): None for r in layout.preview if column < len(r) and not blank(r[column])}
    if not names:
        return
    own = target is not None and target.name in names
    found.mapping["robot"] = target.name if target is not None and own else next(iter(names))
    if len(names) > 1 and not own:
        shown = ", ".join(map(repr, list(names)[:12]))
        found.questions["robot"] = f"the rows are of {len(names)} robots: {shown}"


def _joints_by_name(layout: Layout, given: Mapping, found: Columns, target: Target | None) -> bool:
    """Whether the headers are the names of the robot's own joints, as ROS writes them."""
    if target is None or given.joints is not None:
        return False
    indices = layout.find_all("joints", target.joints)
    if isinstance(indices, list):
        return False
    found.indices["joints"] = indices
    found.mapping["joints"] = tuple(layout.reference(i) for i in indices)
    return True


def _joints(
    layout: Layout, given: Mapping, found: Columns, key: str, role: Role, count: int | None = None
) -> None:
    columns = getattr(given, key)
    if columns is not None:
        indices = layout.find_all(key, columns)
        if isinstance(indices, list):
            found.problems += indices
            return
        found.indices[key] = indices
        if count and indices and len(indices) != count:
            what = f"{len(indices)} columns for {count} joints"
            found.problems.append(
                Problem(layout.grid.file, f"mapping.{key}", what, "name one per joint, or []")
            )
        return
    fits = [(int(h.which), i) for i, h in enumerate(layout.headers) if h.role is role]
    measured = [(n, i) for n, i in fits if not layout.headers[i].commanded]
    both = bool(measured) and len(measured) < len(fits)
    fits = sorted(measured or fits)
    if not fits:
        return
    numbers = [n for n, _ in fits]
    chosen = dict(reversed(fits))
    question = ""
    if both:
        question = "there are measured and commanded columns; these are the measured ones"
    if len(chosen) < len(numbers):
        twice = sorted({n for n in numbers if numbers.count(n) > 1})
        question = f"several columns could be joint {', '.join(map(str, twice))}; these are the first ones"
    elif numbers[0] not in (0, 1) or numbers[-1] - numbers[0] != len(numbers) - 1:
        question = f"the columns are numbered {', '.join(map(str, numbers))}"
    indices = tuple(chosen[n] for n in sorted(chosen))
    if count is not None and len(indices) != count:
        found.notes.append(f"{len(indices)} {role} columns for {count} joints: left out")
        return
    if key == "torques" and any(layout.headers[i].unit != "Nm" for i in indices):
        found.notes.append("torque columns whose header does not say Nm: left out")
        return
    found.indices[key] = indices
    found.mapping[key] = tuple(layout.reference(i) for i in indices)
    if question:
        found.questions[key] = question


def _tool_by_name(layout: Layout, given: Mapping, found: Columns) -> None:
    """Take the columns of a controller's own log, when the mapping names none."""
    indices = layout.find_all("tcp_position", UR_POSE)
    if given.tcp_position is not None or given.tcp_orientation is not None or isinstance(indices, list):
        return
    for key, group in (("tcp_position", indices[:3]), ("tcp_orientation", indices[3:])):
        found.indices[key] = group
        found.mapping[key] = tuple(layout.reference(i) for i in group)


def _tool(layout: Layout, given: Mapping, found: Columns) -> None:
    _axes(layout, given, found, "tcp_position", Role.TCP_POSITION, (("x", "y", "z"),))
    _axes(layout, given, found, "tcp_orientation", Role.TCP_ORIENTATION, tuple(ORIENTATIONS))
    file, indices = layout.grid.file, found.indices.get("tcp_orientation", ())
    if given.tcp_position and len(given.tcp_position) != 3:
        what = f"{len(given.tcp_position)} columns"
        found.problems.append(Problem(file, "mapping.tcp_position", what, "name x, y and z, or []"))
    if given.tcp_convention is not None:
        if not is_convention(given.tcp_convention):
            what = f"{given.tcp_convention!r} is not a convention"
            found.problems.append(Problem(file, "mapping.tcp_convention", what, f"write {CONVENTIONS}"))
        elif indices and len(indices) != columns_of(given.tcp_convention):
            what = (
                f"{len(indices)} columns, but {given.tcp_convention!r} has {columns_of(given.tcp_convention)}"
            )
            found.problems.append(Problem(file, "mapping.tcp_orientation", what))
        return
    if not indices:
        return
    which = tuple(layout.headers[i].which if i < len(layout.headers) else "" for i in indices)
    convention = ORIENTATIONS.get(which, "wxyz" if len(indices) == 4 else "ZYX")
    found.mapping["tcp_convention"] = convention
    if which not in CERTAIN:
        names = ", ".join(layout.label(i) for i in indices)
        found.questions["tcp_convention"] = f"{names} can be several conventions, {convention} among them"


def _axes(
    layout: Layout, given: Mapping, found: Columns, key: str, role: Role, sets: tuple[tuple[str, ...], ...]
) -> None:
    columns = getattr(given, key)
    if columns is not None:
        indices = layout.find_all(key, columns)
        if isinstance(indices, list):
            found.problems += indices
        elif indices:
            found.indices[key] = indices
        return
    if key in found.indices:
        return
    named: dict[str, list[int]] = {}
    for i, header in enumerate(layout.headers):
        if header.role is role:
            named.setdefault(header.which, []).append(i)
    complete = [s for s in sets if all(axis in named for axis in s)]
    if not complete:
        return
    if len(complete) > 1 or any(len(named[axis]) > 1 for axis in complete[0]):
        found.questions[key] = "several columns could be meant; these are the first ones"
    found.indices[key] = tuple(named[axis][0] for axis in complete[0])
    found.mapping[key] = tuple(layout.reference(i) for i in found.indices[key])
