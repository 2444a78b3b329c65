"""Files of a rescaled motion: read back by the sources and by foreign readers, and a program for a UR."""

from __future__ import annotations

import csv
import io
import re

import numpy as np
import openpyxl
import pytest

from made_cell import FLOATING, UR10, made
from seerob.core.errors import InputError
from seerob.core.samples import JointSample
from seerob.session.permissible.speed_map import segments
from seerob.session.permissible.tables import (
    csv_bytes,
    map_head,
    map_rows,
    refusal,
    trajectory_head,
    trajectory_rows,
    urscript,
    workbook,
)

START = np.array([0, -1.2, 1.4, -1.5, -1.5, 0])
TIP = '[[safety]]\nkind = "velocity"\nname = "V"\nat = "arm"\nlimit = 0.4\n'
SOURCE = '[[sources]]\nkind = "{kind}"\nrobot = "arm"\nfile = "{file}"\n'
CELL = FLOATING + 'title = "Cell\\nmovej([0,0,0,0,0,0])"\n' + UR10


def motion():
    t = np.linspace(0, 1, 51)
    way = 10 * t**3 - 15 * t**4 + 6 * t**5
    q = START + way[:, None] * np.array([0.4, 0.2, -0.2, 0.1, 0, 0.3])
    head = ",".join(["t [s]", *(f"J{j} [rad]" for j in range(1, 7))])
    return head + "\n" + "\n".join(",".join(f"{x:.9g}" for x in (a, *b)) for a, b in zip(t, q, strict=True))


@pytest.fixture(scope="module")
def made_up(tmp_path_factory):
    folder = tmp_path_factory.mktemp("exports")
    text = CELL + SOURCE.format(kind="csv", file="motion.csv") + TIP
    station = made(folder, text, {"motion.csv": motion()})
    return folder, station, station.permissible_speed(acceleration=5.0, jerk=[50.0] * 6)


def played(folder, kind, file, data):
    text = CELL + SOURCE.format(kind=kind, file=file)
    station = made(folder, text, {file: data})
    ((_, opened),) = station.sources
    samples = list(opened.samples)
    assert all(isinstance(s, JointSample) for s in samples)
    return tuple(np.array([getattr(s, key) for s in samples]) for key in ("t", "q", "qd"))


def test_our_own_csv_is_the_same_trajectory_when_read_back(made_up, tmp_path):
    _, _, found = made_up
    trajectory = found.rescaled.trajectory(0.008)
    data = csv_bytes(trajectory_head(trajectory, ["rad"] * 6), trajectory_rows(trajectory))
    for ours, back in zip(
        (trajectory.t, trajectory.q, trajectory.qd), played(tmp_path, "csv", "own.csv", data), strict=True
    ):
        np.testing.assert_array_equal(ours, back)


def test_the_workbook_holds_the_trajectory_the_map_and_sources(made_up):
    _, station, found = made_up
    book = openpyxl.load_workbook(
        io.BytesIO(workbook(found, segments(found.map), station.scene(), period=0.008))
    )
    assert book.sheetnames[:5] == ["Summary", "Segments", "Map", "Map by region", "Rescaled"]
    rows = list(book["Rescaled"].iter_rows(values_only=True))
    assert rows[0][:2] == ("t [s]", "J1 [rad]")
    trajectory = found.rescaled.trajectory(0.008)
    np.testing.assert_allclose(np.array(rows[1:], float)[:, 1:7], trajectory.q, rtol=1e-15, atol=1e-15)
    inputs = {row[1]: row for row in book["Inputs"].iter_rows(values_only=True)}
    assert inputs["jerk limit of shoulder_pan_joint"][2:5] == (50, "rad/s³", "given")
    assert inputs["velocity limit of shoulder_pan_joint"][4] == "stated"
    again = list(book["Evaluated again"].iter_rows(values_only=True))
    assert again[1][:3] == ("V", "exceeded", "within")


def test_the_map_as_a_table_has_its_units_and_reasons(made_up):
    _, _, found = made_up
    rows = list(csv.DictReader(io.StringIO(csv_bytes(map_head(found.map), map_rows(found.map)).decode())))
    (stations,) = found.map.stations
    column = "permissible path speed [rad/s or m/s]"
    np.testing.assert_array_equal([float(row[column]) for row in rows], stations.permissible)
    assert {row["criterion"] for row in rows} == {"V"}
    assert {row["governed by"] for row in rows} == {"speed"}


def test_a_program_for_a_ur(made_up):
    _, station, found = made_up
    robot = station.model.robot("arm")
    scene = station.scene()
    program = urscript(
        found.rescaled, robot, period=0.008, title=scene.title, version="x", digest=scene.workstation_hash
    )
    lines = program.splitlines()
    assert "NOT verified on a controller" in program
    # A title with a line break must not become a line of the program.
    assert [line for line in lines if "movej" in line and not line.startswith("#")] == [
        lines[lines.index("def seerob_rescaled():") + 1]
    ]
    moves = [re.findall(r"-?\d+\.\d{9}", line) for line in lines if line.startswith("  servoj(")]
    q = np.array(moves, float)
    t = np.minimum(np.arange(1, len(q) + 1) * 0.008, found.rescaled.duration)
    np.testing.assert_allclose(q, found.rescaled.at(t)[0], atol=6e-10)
    assert np.abs(np.diff(q, axis=0) / 0.008).max() <= found.map.limits.velocity.max()
    assert all(f"t={0.008:g}," in line for line in lines if line.startswith("  servoj("))
    assert (lines[-1], program[-1]) == ("end", "\n")
    assert not any("nan" in line or "e-" in line.partition("#")[0] for line in lines)


def test_a_program_is_refused_where_it_does_not_fit(made_up, tmp_path):
    _, station, found = made_up
    robot = station.model.robot("arm")
    assert refusal(robot) == ""
    with pytest.raises(InputError, match="period"):
        urscript(found.rescaled, robot, period=0.01, title="", version="", digest="")
    other = made(tmp_path, '[[robots]]\nname = "arm"\nmodel = "library:iiwa7"\n').model.robot("arm")
    assert "URScript is for the six joints" in refusal(other)
    with pytest.raises(InputError, match="export CSV"):
        urscript(found.rescaled, other, period=0.008, title="", version="", digest="")
