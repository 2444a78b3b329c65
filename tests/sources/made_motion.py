"""Motions with closed forms, and the files that tools write of them."""

import csv
from pathlib import Path

import numpy as np

from seerob.workstation.source import Target

DOF = 6
INF = float("inf")


def target(dof=DOF, *, name="ur10", limit=2 * np.pi, speed=3.0, units=None):
    return Target(
        name=name,
        joints=tuple(f"joint_{i + 1}" for i in range(dof)),
        units=units or ("rad",) * dof,
        lower=(-limit,) * dof,
        upper=(limit,) * dof,
        velocity=(speed,) * dof,
    )


def motion(n=200, period=0.01, dof=DOF):
    """t [s], q [rad], qd [rad/s] of sines with different amplitudes and phases."""
    t = np.arange(n) * period
    a, w = np.linspace(0.4, 1.2, dof), np.linspace(0.8, 1.6, dof)
    phase = np.arange(dof) * 0.5
    return t, a * np.sin(t[:, None] * w + phase), a * w * np.cos(t[:, None] * w + phase)


def write_csv(path, header, rows, *, delimiter=",", comma=False, encoding="utf-8", newline="\n", above=()):
    def text(cell):
        if isinstance(cell, str):
            return cell
        return repr(float(cell)).replace(".", ",") if comma else repr(float(cell))

    with Path(path).open("w", encoding=encoding, newline="") as file:
        writer = csv.writer(file, delimiter=delimiter, lineterminator=newline)
        writer.writerows(above)
        if header:
            writer.writerow(header)
        writer.writerows([[text(c) for c in row] for row in rows])
    return path


def write_delmia_like(path, *, joint_unit="deg", sheet="Trajectory", robots=("UR10_1",), units_row=False):
    """A workbook as an offline programming tool exports it: title, groups over merged cells, names.

    Returns the motion that is in it: t [s], q [rad], qd [rad/s].
    """
    from openpyxl import Workbook

    t, q, qd = motion(50, 0.02)
    scale = 180 / np.pi if joint_unit == "deg" else 1.0
    book = Workbook()
    page = book.active
    page.title = sheet
    page.append(["Cycle export", "UR10 assembly"])
    page.append([])
    groups = ["", "", "Position"] + [""] * (DOF - 1) + ["Velocity"] + [""] * (DOF - 1)
    unit, rate = f"[{joint_unit}]", f"[{joint_unit}/s]"
    names = [f"J{i + 1}" for i in range(DOF)]
    page.append(groups)
    if units_row:
        page.append(["Robot", "Time", *names, *names])
        page.append(["", "[s]", *[unit] * DOF, *[rate] * DOF])
    else:
        page.append(["Robot", "Time [s]", *[f"{n} {unit}" for n in names], *[f"{n} {rate}" for n in names]])
    page.merge_cells(start_row=3, start_column=3, end_row=3, end_column=2 + DOF)
    page.merge_cells(start_row=3, start_column=3 + DOF, end_row=3, end_column=2 + 2 * DOF)
    for k in range(len(t)):
        for r, robot in enumerate(robots):
            page.append([robot, t[k], *((q[k] + 0.1 * r) * scale), *(qd[k] * scale)])
    book.save(path)
    return t, q, qd


def write_sheet(path, rows, *, title="Sheet1", more=None):
    """A workbook of literal cells; ``more`` maps further sheet titles to rows."""
    from openpyxl import Workbook

    book = Workbook()
    page = book.active
    page.title = title
    for row in rows:
        page.append(list(row))
    for name, cells in (more or {}).items():
        extra = book.create_sheet(name)
        for row in cells:
            extra.append(list(row))
    book.save(path)
    return path


def arrays(opened):
    """t, q, qd of what a source hands on."""
    samples = list(opened.samples)
    return (
        np.array([s.t for s in samples]),
        np.array([s.q for s in samples]),
        np.array([s.qd for s in samples]),
    )
