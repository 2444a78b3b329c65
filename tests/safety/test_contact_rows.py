"""Rows of power and force limiting for the body map."""

from __future__ import annotations

import math
from dataclasses import replace as replaced
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

from made_cell import FLOATING, TWO_R, made, results_at, state_at, two_r
from seerob.core.snapshot import Result, Row, RowState, Verdict
from seerob.criteria.contact.limits import Judged, Spread
from seerob.criteria.contact.regions import REGIONS
from seerob.criteria.contact.rows import area_results
from seerob.criteria.safety.power_and_force import Contacts
from seerob.session.station import Station

PFL = '[[safety]]\nkind = "power_and_force"\nname = "pfl"\nrobot = "arm"\n'
FLAT = "contact_area = { arm = 1e-4 }\n"


def cell(folder: Path, options: str = FLAT, *, more: str = "") -> Station:
    return made(folder, FLOATING + TWO_R + more + PFL + options, {"arm.urdf": two_r()})


def pfl(station: Station, speed: float = 0.1) -> Result:
    """Of a stretched arm of 2 m whose end moves at ``speed`` [m/s]."""
    return results_at(station, arm=([0.0, 0.0], [speed / 2, 0]))["pfl"]


def judged_of(rows: tuple[Row, ...]) -> list[Row]:
    """The 26 areas that may be hit."""
    judged = [row for row in rows if row.state is RowState.JUDGED]
    assert len(judged) == 26
    return judged


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
    judged = judged_of(result.rows)
    areas = [(part, area) for part in result.parts for area in part.parts]
    assert len(areas) == 26
    for row, (part, area) in zip(judged, areas, strict=True):
        assert (row.group, row.name) == (part.name, area.name)
        assert (row.value, row.limit, row.verdict) == (area.value, area.limit, area.verdict)
        allowed = {aspect.name: aspect.value for aspect in row.aspects if not aspect.band}
        assert min(v for v in allowed.values() if v is not None) == row.limit
        if row.verdict is not Verdict.UNDECIDED:
            assert allowed[f"allowed by {row.reason.split(',')[0]}"] == row.limit


def test_the_least_row_of_a_region_is_the_regions_limit(tmp_path: Path) -> None:
    result = pfl(cell(tmp_path))
    limited = [part for part in result.parts if part.limit is not None]
    assert len(limited) > 5
    for part in limited:
        least = min(row.limit for row in result.rows if row.group == part.name)
        assert least == pytest.approx(part.limit, rel=1e-12)


def test_limits_can_be_looked_up_in_the_basis(tmp_path: Path) -> None:
    station = cell(tmp_path)
    known = {
        i.name: i for criterion in station.scene(with_sources=False).criteria for i in criterion.basis.inputs
    }
    rows = pfl(station).rows
    assert all(known[name].source for row in rows for name in row.inputs)
    for row in judged_of(rows):
        force, pressure, _ = (known[name] for name in row.inputs)
        assert (force.unit, pressure.unit) == ("N", "Pa")


def test_sharp_edges_leave_the_pressure_open(tmp_path: Path) -> None:
    for row in judged_of(pfl(cell(tmp_path, "")).rows):
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
    rows = pfl(cell(tmp_path, FLAT + 'excluded = ["Face", "Chest"]')).rows
    excluded = [row for row in rows if row.group in ("Face", "Chest")]
    assert [row.areas for row in excluded] == [(3,), (8,), (9,)]
    assert {(row.state, row.verdict, row.limit) for row in excluded} == {(RowState.EXCLUDED, None, None)}


def judged_chest(folder: Path) -> tuple[Contacts, Judged, Result, int]:
    station = cell(folder)
    contacts = Contacts(station.bound[0].criterion, station.model)
    judged = contacts.judge(state_at(station, arm=([0.0, 0.0], [0.05, 0])))
    chest = next(part for part in pfl(station).parts if part.name == "Chest")
    return contacts, judged, chest, int(judged.rows[REGIONS.index("Chest")])


def test_a_value_below_its_limit_is_within_and_one_on_it_is_not(tmp_path: Path) -> None:
    contacts, judged, chest, row = judged_chest(tmp_path)
    pressed = contacts.rows.by_pressure(judged)
    for least in chest.parts:
        for value, expected in ((least.limit - 2e-9, "within"), (least.limit, "exceeded")):
            rows = contacts.rows.of(
                [(replace(chest, value=value), row)], judged, lambda _: (), pressed=pressed
            )
            (found,) = [r for r in rows if r.name == least.name]
            assert (found.limit, found.verdict) == (least.limit, expected)


@pytest.mark.parametrize("whole", [Verdict.WITHIN, Verdict.UNDECIDED, Verdict.EXCEEDED])
@pytest.mark.parametrize("off", [False, True])
@pytest.mark.parametrize("F", [0.3, 0.6])
@pytest.mark.parametrize("E", [0.4, 0.5])
@pytest.mark.parametrize("P", [0.2, 0.7, math.nan])
def test_an_area_is_judged_by_the_least_speed_that_is_known(chest_judged, whole, off, F, E, P) -> None:
    """Its own pressure, and force and energy of its region; what a tolerance leaves open is as the region."""
    contacts, judged, chest, row = chest_judged
    arrays, column = contacts.arrays, contacts.columns["Chest"]
    speeds = judged.speeds
    speeds = replaced(speeds, force=np.full_like(speeds.force, F), energy=np.full_like(speeds.energy, E))
    ends = Spread(speeds.permissible, speeds.permissible, ()) if off else None
    judged = replaced(judged, speeds=speeds, ends=ends)
    known = [x for x in (F, E, P) if not math.isnan(x)]
    body, how = contacts.names[row], "clamped" if judged.clamped[row, column] else "free"
    for v in (0.1, 0.25, 0.35, 0.45, 0.55, 0.65):
        beyond, open_ = v >= min(known), math.isnan(P)
        expected = Verdict.EXCEEDED if beyond else Verdict.UNDECIDED if open_ else Verdict.WITHIN
        if off and expected is not whole:
            expected = Verdict.UNDECIDED
        part = replace(chest, value=v, verdict=whole, reason="that of the region")
        rows = contacts.rows.of([(part, row)], judged, lambda _: (), pressed=[P] * len(arrays.owner))
        assert {(found.limit, found.verdict, found.value) for found in rows} == {(min(known), expected, v)}
        if expected is not Verdict.UNDECIDED:
            by = {F: "force", E: "energy", P: "pressure"}[min(known)]
            reason = f"{by}, {how}, {body}"
        else:
            reason = f"contact pressure of {body} ({how}): " if open_ else "that of the region"
        assert {found.reason for found in rows} == {reason}
        for unknown in ("", "nobody knows"):
            found = area_results(arrays, [P, P], (row, column), judged, whole=whole, unknown=unknown, v=v)
            assert {(a.limit, a.verdict, a.value, a.unit) for a in found} == {
                (min(known), expected, v, "m/s")
            }
            undecided = unknown or "decided as its region is"
            assert {a.reason for a in found} == {undecided if expected is Verdict.UNDECIDED else ""}


@pytest.fixture(scope="module")
def chest_judged(tmp_path_factory: pytest.TempPathFactory) -> tuple[Contacts, Judged, Result, int]:
    return judged_chest(tmp_path_factory.mktemp("chest"))


def test_what_was_measured_counts_where_it_is_worse(chest_judged) -> None:
    contacts, judged, chest, row = chest_judged
    pressed = contacts.rows.by_pressure(judged)
    slow = replace(chest, value=1e-3, verdict=Verdict.WITHIN)
    for said, expected in ((Verdict.EXCEEDED, Verdict.EXCEEDED), (Verdict.WITHIN, Verdict.WITHIN)):
        measured = {"Chest": (Result(name="M", verdict=said),), "Face": (Result(name="N"),)}
        rows = contacts.rows.of([(slow, row)], judged, lambda _: (), pressed=pressed, measured=measured)
        assert {found.verdict for found in rows} == {expected}
        assert all(
            found.reason.startswith("M: above") == (said is expected is Verdict.EXCEEDED) for found in rows
        )


def test_what_a_tolerance_leaves_open_says_which(tmp_path: Path) -> None:
    station = cell(tmp_path, FLAT + "stiffness_tolerance = 0.5\n")
    result = pfl(station, pfl(station).parts[3].limit)
    decided = {part.name: part.reason for part in result.parts if "decided by" in part.reason}
    rows = [row for row in result.rows if row.group in decided]
    assert decided
    assert {row.reason for row in rows if row.verdict == "undecided"} == set(decided.values())


def test_the_side_of_a_row_is_that_of_all_its_bones(tmp_path: Path) -> None:
    contacts, judged, chest, row = judged_chest(tmp_path)
    pressed = contacts.rows.by_pressure(judged)
    for bones, side in (
        ((), ""),
        (("op/right_hand",), "right"),
        (("op/left_hand", "op/left_forearm"), "left"),
        (("op/left_hand", "op/right_hand"), ""),
        (("op/right_hand", "op/thorax"), ""),
        (("op/thorax",), ""),
    ):
        rows = contacts.rows.of([(chest, row)], judged, lambda _, bones=bones: bones, pressed=pressed)
        assert {found.side for found in rows} == {side}, bones
        open_ = replace(chest, limit=None)
        rows = contacts.rows.of([(open_, row)], judged, lambda _, bones=bones: bones, pressed=pressed)
        assert {found.side for found in rows} == {side}, bones
