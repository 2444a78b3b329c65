"""Rows of power and force limiting for the body map."""

from __future__ import annotations

from pathlib import Path

import pytest

from made_cell import FLOATING, TWO_R, made, results_at, two_r
from seerob.snapshot import Result, Row, RowState, Verdict
from seerob.station import Station

PFL = '[[safety]]\nkind = "power_and_force"\nname = "pfl"\nrobot = "arm"\n'
FLAT = "contact_area = { arm = 1e-4 }\n"


def cell(folder: Path, options: str = FLAT, *, more: str = "") -> Station:
    return made(folder, FLOATING + TWO_R + more + PFL + options, {"arm.urdf": two_r()})


def pfl(station: Station, speed: float = 0.1) -> Result:
    """Of a stretched arm of 2 m whose end moves at ``speed`` [m/s]."""
    return results_at(station, arm=([0.0, 0.0], [speed / 2, 0]))["pfl"]


def test_every_one_of_the_29_areas_has_a_row_and_the_feet_too(tmp_path: Path) -> None:
    rows = pfl(cell(tmp_path)).rows
    assert sorted(n for row in rows for n in row.areas) == list(range(1, 30))
    assert [row.name for row in rows if not row.areas] == ["Larynx, eyes and ears", "Feet"]
    states = {row.name: row.state for row in rows}
    assert states["Middle of forehead"] is states["Larynx, eyes and ears"] is RowState.FORBIDDEN
    assert states["Feet"] is RowState.NO_LIMIT
    assert states["Sternum"] is RowState.JUDGED
    assert all(row.limit is None for row in rows if row.state is not RowState.JUDGED)


@pytest.mark.parametrize("speed", [0.05, 0.4, 1.5])
def test_rows_say_what_the_parts_say(tmp_path: Path, speed: float) -> None:
    result = pfl(cell(tmp_path), speed)
    judged = [row for row in result.rows if row.state is RowState.JUDGED]
    areas = [(part, area) for part in result.parts for area in part.parts]
    assert len(judged) == len(areas) == 26
    for row, (part, area) in zip(judged, areas, strict=True):
        assert (row.group, row.name) == (part.name, area.name)
        assert (row.value, row.limit, row.verdict) == (area.value, area.limit, area.verdict)
        allowed = {aspect.name: aspect.value for aspect in row.aspects if not aspect.band}
        assert min(v for v in allowed.values() if v is not None) == row.limit
        if row.verdict is not Verdict.UNDECIDED:
            assert allowed[f"allowed by {row.reason.split(',')[0]}"] == row.limit


def test_the_least_row_of_a_region_is_the_regions_limit(tmp_path: Path) -> None:
    result = pfl(cell(tmp_path))
    for part in result.parts:
        if part.limit is not None:
            least = min(row.limit for row in result.rows if row.group == part.name)
            assert least == pytest.approx(part.limit, rel=1e-12)


def test_limits_can_be_looked_up_in_the_basis(tmp_path: Path) -> None:
    station = cell(tmp_path)
    known = {
        i.name: i for criterion in station.scene(with_sources=False).criteria for i in criterion.basis.inputs
    }
    for row in pfl(station).rows:
        assert all(known[name].source for name in row.inputs)
        if row.state is RowState.JUDGED:
            force, pressure, _ = (known[name] for name in row.inputs)
            assert (force.unit, pressure.unit) == ("N", "Pa")


def test_sharp_edges_leave_the_pressure_open(tmp_path: Path) -> None:
    for row in pfl(cell(tmp_path, "")).rows:
        if row.state is RowState.JUDGED:
            assert {a.name: a.value for a in row.aspects}["allowed by pressure"] is None
            assert row.verdict is Verdict.UNDECIDED
            assert row.reason.startswith("contact pressure of arm/")


def near(folder: Path, hand: str, horizon: float = 0.3) -> dict[str, Row]:
    human = (
        f'[[humans]]\nname = "op"\nstature = 1.75\nmass = 75\nsex = "male"\nhand = "{hand}"\n'
        "at = { position = [2.25, 0, -1.0] }\n"
    )
    station = cell(folder, FLAT + f'human = "op"\nhorizon = {horizon}', more=human)
    return {row.name: row for row in pfl(station).rows}


def test_only_what_can_be_hit_has_rows_with_its_bones(tmp_path: Path) -> None:
    rows = near(tmp_path, "right")
    assert rows["Abdominal muscle"].bones == ("op/lumbar",)
    assert rows["Abdominal muscle"].side == ""
    assert "Middle of shin" not in rows
    assert all(bone.startswith("op/") for row in rows.values() for bone in row.bones)


def test_hands_are_told_apart_by_the_dominant_one(tmp_path: Path) -> None:
    for hand, other in (("right", "left"), ("left", "right")):
        rows = near(tmp_path / hand, hand, horizon=0.5)
        assert (rows["Palm, dominant"].side, rows["Palm, non-dominant"].side) == (hand, other)


def test_excluded_regions_stay_visible_as_excluded(tmp_path: Path) -> None:
    rows = pfl(cell(tmp_path, FLAT + 'excluded = ["Face"]')).rows
    (face,) = [row for row in rows if row.group == "Face"]
    assert (face.state, face.verdict, face.areas) == (RowState.EXCLUDED, None, (3,))
