r"""Contact that was measured at the robot, beside what is predicted: the worse of both counts.

A device for pressure and force (PFMD) stands for the body part: a spring of its stiffness in series with
a pad, and a film or cells for the pressure. From a record of the force over time

.. math:: F_T = \max_{0 \le t < 0.5\,s} F, \qquad F_S = \max_{t \ge 0.5\,s} F

with t from the begin of the contact; F_T is compared with the transient limit, F_S with the quasi-static one
(TS 15066 as public sources tell it, 1S+M). A film has no time: its peak is compared with the transient limit
of a body part that is free and with the quasi-static one of a body part that is clamped.

A measurement speaks of what moves no faster than what was measured, with the same tools, no more clamped
than then, as a device tells it that was calibrated and is as stiff as the body part. Otherwise it leaves
open what it says. It never relieves a prediction.
"""

from __future__ import annotations

import datetime as dt
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import msgspec
import numpy as np
from msgspec import Meta, Struct
from numpy.typing import NDArray

from seerob.core.domains import number
from seerob.core.errors import InputError, Problem, UnknownName
from seerob.core.files.bounded import REMEDY, leads_outside
from seerob.core.files.toml_file import read_toml
from seerob.core.snapshot import Input, Origin, Result, Verdict
from seerob.core.transforms import Array
from seerob.core.verdict import keeps, worst
from seerob.criteria.contact.limits import RegionArrays
from seerob.files.tables.grid import read_numbers
from seerob.files.tables.table_files import TextGrid, check_file, encoding_of, head
from seerob.model.model import Mechanism, Model
from seerob.workstation.plausibility.ranges import Quantity, implausible, row_of, sentence

Flags = NDArray[np.bool_]

TRANSIENT = 0.5
"""How long a contact counts as transient [s] (1S+M)."""
BEGIN = 0.05
"""Share of the largest force with which a contact begins: below it lies the noise of a device."""
SPRING = 0.1
"""By which share a spring may be off the stiffness of the body part: springs of devices are chosen for their
working range and not linear (GTE, 1S)."""
COARSE = 2e-3
"""Largest step of a record that shows its peak [s]: of half a sine of 9 ms, the shortest contact of the table
(a hand, 0.6 kg and 75 N/mm: π √(m/k)), samples so far apart meet 94 % at least. Own choice (D)."""
DROPS = 0.3
"""Share of its largest force from which no contact falls to nothing in a sample. Own choice (D)."""
ENDS = 0.8
"""Share of its largest force from which no contact ends for good between two samples that are `COARSE` apart:
of half a sine of 9 ms it is 0.69 at most. Own choice (D)."""
SLOW = 0.1
"""A force that a drive keeps up is looked at so often at least [s]. Own choice (D)."""
RISES = 0.02
"""By which share of itself a force that has settled rises in `SLOW` at most. Own choice (D)."""
FLAT = 10
"""So many samples in a row at the largest force are the end of a device's range, rather than a peak."""
CALIBRATED = dt.timedelta(days=366)
"""How long a calibration holds: pads and devices are renewed every year (GTE manual, 1S)."""
ROUNDING = 1e-9
"""Relative: at the speed that was measured a measurement speaks of both sides."""
MAX_CURVE = 64 << 20
"""Largest record of a force [byte]."""
MOST = 1000
"""Most measurements of a file."""

_Positive = Annotated[float, Meta(gt=0, le=1e6)]
_Name = Annotated[str, Meta(min_length=1, max_length=200)]
_TIMES = {"s": 1.0, "ms": 1e-3}
_FORCES = {"N": 1.0, "kN": 1e3}


class Measurement(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One measurement, as its file has it."""

    part: _Name
    """Part of the robot, its tools or workpieces that made contact."""
    region: _Name
    """Body region that the device stood for."""
    area: _Name | None = None
    """Specific body area, for the pressure; else the most sensitive of the region counts."""
    contact: Literal["free", "clamped"]
    """Whether a body part there could give way, or not."""
    speed: Annotated[float, Meta(gt=0, le=10)]
    """Speed of the part at the contact [m/s]."""
    curve: _Name | None = None
    """CSV file of force over time, beside the workstation file."""
    force_N: _Positive | None = None
    """Largest force in the first half second, where there is no curve."""
    static_force_N: Annotated[float, Meta(ge=0, le=1e6)] | None = None
    """Largest force after it, likewise."""
    pressure_N_cm2: _Positive | None = None
    """Largest pressure of film or cells."""
    tools: tuple[_Name, ...] | None = None
    """Tools and workpieces that the robot carried."""
    device: _Name | None = None
    """Which device, with its number."""
    spring_N_mm: _Positive | None = None
    """Spring constant of the device."""
    pad: str = ""
    """Its damping element: a softer one tells less pressure."""
    date: dt.date | None = None
    """Date of the measurement."""
    calibrated: dt.date | None = None
    """Last calibration of the device."""
    place: Annotated[str, Meta(max_length=500)] = ""
    """Where in the cell, in words."""


class _File(Struct, frozen=True, forbid_unknown_fields=True):
    measurements: Annotated[tuple[Measurement, ...], Meta(min_length=1, max_length=MOST)]


@dataclass(frozen=True)
class Measured:
    """A measurement and what it is about."""

    said: Measurement
    rows: tuple[int, ...]
    """Rows of the moving bodies."""
    column: int
    """Column of the body region."""
    transient: float | None
    """F_T [N]; None when not measured."""
    static: float | None
    """F_S [N]; None when not measured, or when the record ends before."""
    pressure: float | None
    """Peak [Pa]; None when not measured."""
    undecided_reasons: tuple[str, ...]
    """Why it leaves open what it says, whatever the robot does."""
    stiff: str
    """Why it may say more than a body part would feel."""
    unshown: tuple[str, ...] = ()
    """Why its record may not show the largest force."""
    odd: tuple[str, ...] = ()
    """What of it nobody would type."""

    @property
    def name(self) -> str:
        """In words."""
        return f"{self.said.part} on {self.said.region} at {self.said.speed:g} m/s, {self.said.contact}"


def peaks(t: Array, force: Array) -> tuple[float, float | None]:
    """Largest force of a record in the first half second of contact and after it [N].

    Args:
        t: Instants, rising [s], shape (n,).
        force: Pressing is positive [N], shape (n,).

    Returns:
        F_T and F_S; None for what the record does not reach.
    """
    t, force = number("t", t), number("force", force)
    if (np.diff(t) < 0).any():
        raise ValueError("t falls: give the instants in their order")
    peak = float(force.max())
    first = int(np.argmax(force >= BEGIN * peak))
    # It began after the sample before: so what is called static begins no later than it does.
    late = t >= t[max(first - 1, 0)] + TRANSIENT
    early = t < t[first] + TRANSIENT
    static = float(force[late].max()) if late.any() else None
    return float(force[early].max()), static


def risen(force: Array) -> Array:
    """Forces [N], shape (n,), by which they rose, where the device rests below 0: its zero is off."""
    force = number("force", force)
    before = force[: int(np.argmax(force >= BEGIN * float(force.max())))]
    return force - min(float(np.median(before)), 0.0) if len(before) else force


def missing(t: Array, force: Array) -> tuple[str, ...]:
    """Why a record may not show the largest force of its contact.

    Args:
        t: Instants, rising [s], shape (n,).
        force: Pressing is positive [N], shape (n,).
    """
    t, force = number("t", t), number("force", force)
    peak = float(force.max())
    touches = force >= BEGIN * peak
    first = int(np.argmax(touches))
    early = np.flatnonzero((t >= t[max(first - 1, 0)]) & (t < t[first] + TRANSIENT))
    found = []
    if first == 0:
        found.append("the record begins in contact: what was before it is not known")
    if touches[-1] and t[-1] < t[first] + TRANSIENT:
        found.append(f"the record ends in contact, {t[-1] - t[first]:.3g} s after it began")
    seen = np.append(t[early], t[early[-1] + 1 : early[-1] + 2])
    step = float(np.diff(seen).max(initial=0.0))
    if step > COARSE * (1 + ROUNDING):
        found.append(f"samples are {1e3 * step:.3g} ms apart, and a peak between them is not seen")
    later = np.diff(t) * (touches[:-1] | touches[1:]) * (t[1:] > t[first] + TRANSIENT)
    if (gap := float(later.max(initial=0.0))) > SLOW * (1 + ROUNDING):
        found.append(f"nothing was told for {gap:.3g} s of the force that lasts")
    last, before = (force[(t > end - SLOW) & (t <= end)] for end in (t[-1], t[-1] - SLOW))
    if touches[-1] and last.max() > (1 + RISES) * before.max(initial=0.0):
        found.append("the record ends in contact while its force still rises")
    # Who is let go feels less and less; a loose cable says nothing from one sample to the next.
    gone = np.flatnonzero((force[:-1] >= DROPS * peak) & ~touches[1:])
    if len(gone) and touches[gone[0] + 1 :].any():
        found.append(f"it drops out at {t[gone[0] + 1]:.4g} s, from {force[gone[0]]:.4g} N, and comes back")
    elif len(lost := gone[(force[gone] >= ENDS * peak) & (t[gone] < t[first] + TRANSIENT)]):
        found.append(
            f"it ends at {t[lost[0] + 1]:.4g} s, from {force[lost[0]]:.4g} N from one sample to the next"
        )
    top = np.concatenate([[False], force == peak, [False]]).astype(int)
    starts, ends = (np.flatnonzero(np.diff(top) == way) for way in (1, -1))
    if int((ends - starts).max()) >= FLAT:
        found.append(f"its largest force, {peak:g} N, stands still: the device may not show more")
    return tuple(found)


def judged(
    value: float, limit: float, *, undecided_reasons: Sequence[str], above: Sequence[str]
) -> tuple[Verdict, str]:
    """Verdict on a measured figure and why.

    Args:
        value: What was measured.
        limit: What is permitted.
        undecided_reasons: Why it may be more than that.
        above: Why it may be less.
    """
    if not keeps(value, limit):
        open_ = tuple(above)
        return (Verdict.UNDECIDED, "; ".join(open_)) if open_ else (Verdict.EXCEEDED, "")
    return (Verdict.UNDECIDED, "; ".join(undecided_reasons)) if undecided_reasons else (Verdict.WITHIN, "")


def worse(verdict: Verdict | None, reason: str, measured: Sequence[Result]) -> tuple[Verdict | None, str]:
    """A predicted verdict and its reason, or those of what was measured where it is worse."""
    for part in measured:
        both = worst([verdict, part.verdict])
        if both is not verdict:
            verdict, reason = both, f"{part.name}: {part.reason or 'above its limit'}"
    return verdict, reason


class Measurements:
    """The measurements of a robot, bound once."""

    def __init__(self, model: Model, robot: Mechanism, arrays: RegionArrays, name: str | None) -> None:
        """Bind.

        Args:
            model: The compiled workstation.
            robot: The robot.
            arrays: Body regions and their limits.
            name: File of measurements, beside the workstation file; None for none.

        Raises:
            InputError: The file or a curve cannot be read, with every mistake.
            UnknownName: A part, a region or an area that does not exist.
        """
        self._arrays = arrays
        self._carried = sorted({model.bodies[i].owner for i in robot.carried})
        self.every: tuple[Measured, ...] = ()
        if name is not None:
            self._file, folder = name, model.folder
            self.every = tuple(self._bound(model, robot, said, folder) for said in read(folder / name))

    def _bound(self, model: Model, robot: Mechanism, said: Measurement, folder: Path) -> Measured:
        known = [model.bodies[i].name for i in robot.moving]
        bodies = [i for i in model.select(said.part) if i in robot.moving]
        if not bodies:
            raise UnknownName(f"moving part of {robot.name} ({self._file})", said.part, known)
        names = [region.name for region in self._arrays.regions]
        if said.region not in names:
            raise UnknownName(f"body region where contact is permitted ({self._file})", said.region, names)
        column = names.index(said.region)
        areas = [area.name for area in self._arrays.regions[column].areas]
        if said.area is not None and said.area not in areas:
            raise UnknownName(f"body area of {said.region} ({self._file})", said.area, areas)
        transient, static = said.force_N, said.static_force_N
        unshown: tuple[str, ...] = ()
        if said.curve is not None:
            if not model.workstation.outside and (real := leads_outside(folder / said.curve, folder)):
                what = f"leads to {real}, outside the folder of the workstation"
                raise InputError.at(self._file, f"curve {said.curve}", what, REMEDY)
            t, force = read_curve(folder / said.curve, said.curve)
            force = risen(force)
            (transient, static), unshown = peaks(t, force), missing(t, force)
        pressure = None if said.pressure_N_cm2 is None else said.pressure_N_cm2 * 1e4
        rows = tuple(k for k, body in enumerate(robot.moving) if body in bodies)
        k = float(self._arrays.stiffness[column])
        undecided_reasons, stiff = list(_undated(said)), ""
        if not said.pad:
            undecided_reasons.append("the pad of the device is not told (pad)")
        if said.spring_N_mm is None:
            undecided_reasons.append("the spring constant of the device is not told (spring_N_mm)")
        elif said.spring_N_mm * 1e3 < (1 - SPRING) * k:
            undecided_reasons.append(
                f"its spring, {said.spring_N_mm:g} N/mm, is softer than {k / 1e3:g} N/mm"
            )
        elif said.spring_N_mm * 1e3 > (1 + SPRING) * k:
            stiff = f"its spring, {said.spring_N_mm:g} N/mm, is stiffer than {k / 1e3:g} N/mm"
        if said.tools is None:
            undecided_reasons.append("what the robot carried is not told (tools)")
        elif sorted(set(said.tools)) != self._carried:
            now, then = (", ".join(those) or "nothing" for those in (self._carried, sorted(said.tools)))
            undecided_reasons.append(f"the robot carried {then}, and carries {now} here")
        odd = tuple(_implausible(said, transient, pressure))
        return Measured(
            said, rows, column, transient, static, pressure, tuple(undecided_reasons), stiff, unshown, odd
        )

    def results(self, column: int, v: Array, near: Flags, clamped: Flags) -> tuple[Result, ...]:
        """What was measured of a body region, against its limits.

        Args:
            column: The region.
            v: Relative speed of each moving body [m/s], shape (b,).
            near: Whether each could hit it, shape (b,).
            clamped: Whether each clamps it, shape (b,).
        """
        found: list[Result] = []
        for one in self.every:
            rows = [row for row in one.rows if near[row]]
            if one.column != column or not rows:
                continue
            found += self._of(one, float(v[rows].max()), bool(clamped[rows].any()))
        return tuple(found)

    def permits(self, column: int, clamped: Flags) -> Array:
        """Largest speed of each moving body that what was measured of a region bears out [m/s], shape (b,).

        Infinity where nothing was measured, NaN where it leaves open which.

        Args:
            column: The region.
            clamped: Whether each body clamps it, shape (b,).
        """
        found = np.full(clamped.shape, np.inf)
        for one in self.every:
            for row in one.rows if one.column == column else ():
                told = self._of(one, one.said.speed, bool(clamped[row]))
                within = all(part.verdict is Verdict.WITHIN for part in told)
                found[row] = np.minimum(found[row], one.said.speed if within else math.nan)
        return found

    def _of(self, one: Measured, v: float, clamped: bool) -> list[Result]:
        said, arrays, column = one.said, self._arrays, one.column
        multiplier, F = float(arrays.multiplier[column]), float(arrays.force[column])
        free = said.contact == "free"
        undecided_reasons, above = (
            [*one.undecided_reasons, *one.odd],
            [*(d for d in one.undecided_reasons if "softer" not in d)],
        )
        above += [one.stiff] if one.stiff else []
        if v > said.speed * (1 + ROUNDING):
            undecided_reasons.append(f"measured at {said.speed:g} m/s, and it moves at {v:.3g} m/s here")
        if v < said.speed * (1 - ROUNDING):
            above.append(f"measured at {said.speed:g} m/s, and it moves at {v:.3g} m/s here")
        if clamped and free:
            undecided_reasons.append("measured where a body part gives way, and it is clamped here")
        if not clamped and not free:
            above.append("measured where a body part is clamped, and it is free here")
        own = arrays.pressure[arrays.owner == column]
        names = [area.name for area in arrays.regions[column].areas]
        p = float(own.min() if said.area is None else own[names.index(said.area)])
        figures: list[tuple[str, float | None, float, str]] = [
            ("force, first half second", one.transient, multiplier * F, "N"),
            ("force after it", one.static, F, "N"),
            ("pressure", one.pressure, p * (multiplier if free else 1.0), "Pa"),
        ]
        found = []
        for name, value, limit, unit in figures:
            label = f"measured {name}: {one.name}"
            if value is None:
                # Who gives way is let go before; whoever is clamped is not.
                if name == "force after it" and free:
                    continue
                verdict, reason = Verdict.UNDECIDED, "not measured"
            else:
                more = one.unshown if unit == "N" else ()
                verdict, reason = judged(
                    value, limit, undecided_reasons=(*undecided_reasons, *more), above=above
                )
            found.append(
                Result(name=label, value=value, unit=unit, limit=limit, verdict=verdict, reason=reason)
            )
        return found

    def inputs(self) -> tuple[Input, ...]:
        """Every measured figure with device and date."""
        found = []
        for one in self.every:
            said = one.said
            source = ", ".join(
                text
                for text in (
                    said.device or "device not told",
                    f"spring {said.spring_N_mm:g} N/mm" if said.spring_N_mm else "",
                    said.pad and f"pad {said.pad}",
                    f"measured {said.date}" if said.date else "date not told",
                    f"calibrated {said.calibrated}" if said.calibrated else "calibration not told",
                    said.place,
                    said.curve or self._file,
                )
                if text
            )
            for name, value, unit in (
                ("F_T", one.transient, "N"), ("F_S", one.static, "N"), ("p", one.pressure, "Pa"),
            ):  # fmt: skip
                if value is not None:
                    of = f"measured {name}: {one.name}"
                    found.append(
                        Input(name=of, value=value, unit=unit, origin=Origin.MEASURED, source=source)
                    )
        return tuple(found)


def _implausible(said: Measurement, force: float | None, pressure: float | None) -> Iterator[str]:
    """What of a measurement nobody would type: units of springs and pressures."""
    figures = {"spring_N_mm": ("N/mm", said.spring_N_mm)}
    if force is not None and pressure is not None:
        figures["contact_area"] = ("m²", force / pressure)
    for name, (unit, value) in figures.items():
        if value is None:
            continue
        quantity = Quantity(name, f"measurements.{name}", unit, (value,), (), f"{said.part} on {said.region}")
        row = row_of(quantity)
        if row is not None and implausible(quantity.values, row) is not None:
            yield sentence(quantity, value, row)


def _undated(said: Measurement) -> list[str]:
    """What is not known of device and calibration."""
    if said.device is None:
        return ["which device measured it is not told (device)"]
    if said.date is None or said.calibrated is None:
        return ["when it was measured, and the device calibrated, is not told (date, calibrated)"]
    if said.calibrated > said.date:
        return [f"the device was calibrated on {said.calibrated}, after the measurement"]
    if said.date - said.calibrated > CALIBRATED:
        return [f"the device was calibrated on {said.calibrated}, more than a year before"]
    return []


# -- files --------------------------------------------------------------------------------------


def read(path: Path) -> tuple[Measurement, ...]:
    """Measurements of a file.

    Raises:
        InputError: It cannot be read, or is not what a file of measurements is.
    """
    table, _ = read_toml(path)
    try:
        found = msgspec.convert(table, _File).measurements
    except msgspec.ValidationError as error:
        raise InputError.at(
            path, "measurements", str(error), "see docs/safety/measured_contact.md"
        ) from error
    problems = [
        Problem(str(path), f"measurements[{i}]", what, remedy)
        for i, one in enumerate(found)
        for what, remedy in _mistakes(one)
    ]
    if problems:
        raise InputError(problems)
    return found


def _mistakes(one: Measurement) -> list[tuple[str, str]]:
    forces = (one.force_N, one.static_force_N)
    if one.curve is not None and any(force is not None for force in forces):
        return [("a curve, and forces beside it", "keep one: forces are read from the curve")]
    if one.curve is None and one.force_N is None and one.pressure_N_cm2 is None:
        return [("nothing was measured", "give curve, force_N or pressure_N_cm2")]
    return []


def curves(path: Path) -> tuple[str, ...]:
    """Curves that a file of measurements names, as it names them; none when it cannot be read."""
    try:
        return tuple(one.curve for one in read(path) if one.curve is not None)
    except InputError:
        return ()


def read_curve(path: Path, name: str) -> tuple[Array, Array]:
    """Instants [s] and forces [N] of a record, shape (n,) each.

    A table with a header that tells time and force with their units in brackets, as ``Time [ms]; Force [N]``.

    Raises:
        InputError: No such table, or instants that do not rise.
    """
    check_file(path, name, MAX_CURVE)
    encoding = encoding_of(path, name)
    for delimiter in (";", "\t", ","):
        grid = TextGrid(path, name, encoding, delimiter)
        for row, cells in enumerate(head(grid, 50), start=1):
            every = [_columns(cells, words, units) for words, units in ((_TIME, _TIMES), (_FORCE, _FORCES))]
            if not all(every):
                continue
            if beside := [cells[each[1][0]] for each in every if len(each) > 1]:
                what = f"more than one column says {' and '.join(beside)}"
                raise InputError.at(name, "header", what, "keep one record in a file")
            t, force = (each[0] for each in every)
            columns = {"time": t[0], "force": force[0]}
            numbers = read_numbers(grid, row + 1, columns, decimal_comma=delimiter != ",", width=len(cells))
            if numbers.longer:
                what = f"row {numbers.first_longer} has more cells than the header"
                raise InputError.at(
                    name, "header", what, "decimal commas need semicolons or tabs between cells"
                )
            instants, forces = numbers.values[:, 0] * t[1], numbers.values[:, 1] * force[1]
            if len(instants) < 2 or not (np.diff(instants) > 0).all():
                raise InputError.at(name, cells[t[0]], "instants that do not rise", "give the record itself")
            if -forces.min() > forces.max():
                what = f"{forces.min():g} N is the largest force, against {forces.max():g} N"
                raise InputError.at(name, cells[force[0]], what, "pressing is positive: turn the sign")
            if not forces.max() > 0 or not math.isfinite(float(forces.max())):
                raise InputError.at(name, cells[force[0]], "no force above 0", "pressing is positive")
            return instants, forces
    raise InputError.at(
        name, "header", "no columns of time and force with units", "such as: Time [ms]; Force [N]"
    )


_TIME = ("time", "zeit", "t", "temps", "tempo")
_FORCE = ("force", "kraft", "f", "forza")


def _columns(cells: Sequence[str], words: Sequence[str], units: dict[str, float]) -> list[tuple[int, float]]:
    """Index of each such column and the factor of its unit."""
    found = []
    for i, cell in enumerate(cells):
        name, _, rest = cell.strip().replace("(", "[").replace(")", "]").partition("[")
        unit = rest.rstrip("] ").strip()
        if name.strip().lower() in words and unit in units:
            found.append((i, units[unit]))
    return found
