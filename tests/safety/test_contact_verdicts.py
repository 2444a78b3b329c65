"""Power and force limiting: who is hit, what decides, and every interval, unit and reason, by hand."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from made_cell import FLOATING, TWO_R, made, results_at, state_at, two_r
from seerob.core.snapshot import Result, RowState, Verdict
from seerob.criteria.contact.regions import REGIONS
from seerob.criteria.judging import Judge
from seerob.criteria.safety.power_and_force import STANDSTILL, PowerAndForce
from seerob.description.humans.skeleton import BONES
from seerob.session.station import Station
from seerob.twin.validity.hearing import BonesHeard

KEPT = 'excluded = ["Skull and forehead", "Face", "Larynx, eyes and ears", "Feet"]\n'
FLAT = 'mass = "simplified"\ncontact_area = { arm = 1e-4 }\n'
"""All faces carry 1 cm²."""
V = math.hypot(2, 0.05)
"""Speed of the stretched arm's fastest corner at 1 rad/s [m/s]."""
M_R = 1.0
"""(1 kg + 1 kg) / 2"""
CHEST = 240e4 * 1e-4 / math.sqrt(25e3 / (1 / 40 + 1 / M_R))
"""Permissible speed of the free chest, by its pressure [m/s]: v = p A / √(μ k)."""


def person(x: float, z: float = -1.0, more: str = "") -> str:
    return (
        f'[[humans]]\nname = "op"\nstature = 1.75\nmass = 75\nsex = "male"\n{more}'
        f"at = {{ position = [{x}, 0, {z}] }}\n"
    )


def cell(folder: Path, options: str = FLAT, *, more: str = "", base: str = "", axis: str = "") -> Station:
    """The arm lies in the plane of the floor, which is left out unless there is a base."""
    options = options if base or "floor" in options else f"{options}floor = false\n"
    text = (
        FLOATING + TWO_R + base + more + '[[safety]]\nkind = "power_and_force"\nname = "F"\nrobot = "arm"\n'
    )
    urdf = two_r().replace("0 0 1", axis) if axis else two_r()
    return made(folder, text + options, {"arm.urdf": urdf})


def judged(station: Station, *qd: float) -> Result:
    return results_at(station, arm=((0.0, 0.0), qd))["F"]


def named(result: Result) -> dict[str, Result]:
    return {part.name: part for part in result.parts}


@pytest.fixture(scope="module")
def anyone(tmp_path_factory: pytest.TempPathFactory) -> Station:
    return cell(tmp_path_factory.mktemp("anyone"))


@pytest.fixture(scope="module")
def someone(tmp_path_factory: pytest.TempPathFactory) -> Station:
    """A person beside the arm's end."""
    return cell(tmp_path_factory.mktemp("someone"), FLAT + 'human = "op"\nhorizon = 0.3\n', more=person(2.25))


@pytest.fixture(scope="module")
def off(tmp_path_factory: pytest.TempPathFactory) -> Station:
    return cell(tmp_path_factory.mktemp("off"), FLAT + KEPT + "stiffness_tolerance = 0.2\n")


def test_every_figure_has_its_unit(anyone: Station, off: Station) -> None:
    """Whether a region is judged, excluded or without a limit."""
    assert PowerAndForce.unit == "m/s"
    for result in (judged(anyone, 0.1, 0.0), judged(off, 0.1, 0.0)):
        parts = named(result)
        masses = parts.pop("M/2 + m_L"), parts.pop("m_u along the motion, heaviest part")
        assert [mass.unit for mass in masses] == ["kg", "kg"]
        assert result.unit == "m/s"
        assert set(parts) == set(REGIONS)
        assert {part.unit for part in parts.values()} == {"m/s"}
        assert {area.unit for part in parts.values() for area in part.parts} == {"m/s"}


@pytest.mark.parametrize(("v", "hits"), [(STANDSTILL * 0.99, False), (1.01e-3, True)])
def test_a_part_hits_from_a_millimetre_a_second_on(anyone: Station, v: float, hits: bool) -> None:
    result = judged(anyone, v / V, 0.0)
    assert ("Chest" in named(result)) == hits
    assert (result.verdict, result.reason, result.unit) == (
        (Verdict.UNDECIDED, result.reason, "m/s") if hits else (None, "no part moves", "m/s")
    )


def test_nobody_is_near_a_part_that_moves_also_where_another_stands(tmp_path: Path) -> None:
    station = cell(tmp_path, FLAT + 'human = "op"\n', more=person(6.0))
    for qd, reason in (
        ((0.0, 0.0), "no part moves"),
        ((0.0, 0.1), "nobody within 0.5 m of a moving part"),
        ((0.1, 0.0), "nobody within 0.5 m of a moving part"),
    ):
        result = judged(station, *qd)
        assert (result.verdict, result.value, result.reason, result.unit) == (None, None, reason, "m/s")


def test_only_who_is_near_any_part_is_hit_and_by_that_part(someone: Station) -> None:
    """The first link is a metre away."""
    result = judged(someone, 0.1, 0.0)
    parts = named(result)
    assert "Abdomen" in parts
    assert not {"Lower legs", "Face"} & set(parts)
    assert all("arm/l2" in part.reason for part in parts.values() if part.limit is not None)
    assert {bone for row in result.rows for bone in row.bones} >= {"op/lumbar"}


def test_the_persons_own_hand_is_the_dominant_one(tmp_path: Path) -> None:
    for hand, other in (("right", "left"), ("left", "right")):
        more = person(2.25, more=f'hand = "{hand}"\n')
        station = cell(tmp_path / hand, FLAT + 'human = "op"\nhorizon = 0.6\n', more=more)
        sides = {row.name: row.side for row in judged(station, 0.1, 0.0).rows if "dominant" in row.name}
        assert len(sides) >= 2
        assert sides == {name: other if "non-dominant" in name else hand for name in sides}


@pytest.mark.parametrize(
    ("lost", "verdict"), [(("right_hand",), Verdict.EXCEEDED), (("head", "neck"), Verdict.UNDECIDED)]
)
def test_what_the_bones_that_are_seen_exceed_is_exceeded(
    tmp_path: Path, lost: tuple[str, ...], verdict: Verdict
) -> None:
    """The arm's end is beside the face; without head and neck nothing that is seen is exceeded."""
    station = cell(tmp_path, FLAT + 'human = "op"\nhorizon = 0.2\n', more=person(2.25, -1.6))
    state = state_at(station, arm=((0.0, 0.0), (0.005, 0.0)))
    hearing = state.hearings["op"]
    hearing.bones = dict.fromkeys(BONES, (0.0, 0.0))
    hearing.bones_heard[:] = [BonesHeard(0.0, observed=frozenset(BONES) - set(lost))]
    (result,) = Judge(station.bound)(state)
    assert result.verdict is verdict
    assert result.reason.endswith("without op/right_hand, which may be elsewhere") == (verdict == "exceeded")


@pytest.mark.parametrize(
    ("area", "largest", "credited"),
    [(5e-4, 1e-4, 1e-4), (5e-5, 1e-4, 5e-5), (5e-5, 2.5e-5, 2.5e-5), (5e-4, 2.5e-5, 2.5e-5)],
)
def test_an_area_is_credited_up_to_the_largest(
    tmp_path: Path, area: float, largest: float, credited: float
) -> None:
    """1 cm² unless the file says less; the permissible speed by pressure is proportional to it."""
    options = f'mass = "simplified"\ncontact_area = {{ arm = {area} }}\nlargest_area = {largest}\n'
    chest = named(judged(cell(tmp_path, options + KEPT), 0.05, 0.0))["Chest"]
    assert chest.limit == pytest.approx(CHEST * credited / 1e-4, rel=1e-9)
    assert chest.reason.startswith("pressure, free")


@pytest.mark.parametrize(("share", "verdict"), [(0.999, "within"), (1.001, "exceeded")])
def test_the_persons_speed_counts_in_the_verdict_too(tmp_path: Path, share: float, verdict: str) -> None:
    station = cell(tmp_path, FLAT + KEPT + "person_speed = 0.5\n")
    chest = named(judged(station, (share * CHEST - 0.5) / V, 0.0))["Chest"]
    assert (chest.value, chest.verdict) == (pytest.approx(share * CHEST), verdict)


@pytest.mark.parametrize(("v", "verdict"), [(0.3, "within"), (1.7, "exceeded")])
def test_the_region_with_the_least_room_is_the_one_that_is_shown(
    tmp_path: Path, v: float, verdict: str
) -> None:
    """Among those of the worst verdict."""
    result = judged(cell(tmp_path, FLAT + KEPT), v / V, 0.0)
    rooms = {p.name: p.limit - p.value for p in result.parts if p.limit is not None and p.verdict == verdict}
    assert len(set(rooms.values())) > 1
    least = min(rooms, key=rooms.__getitem__)
    assert (result.verdict, result.limit - result.value) == (verdict, rooms[least])
    assert result.reason.startswith(f"{least}: ")


# -- intervals ------------------------------------------------------------------------------------


def test_the_limit_is_the_closed_form_and_its_ends_are_those_of_the_stiffness(off: Station) -> None:
    """Force, pressure and energy all give v ~ 1/√k."""
    for v in (0.3, CHEST, 2.5):
        chest = named(judged(off, v / V, 0.0))["Chest"]
        assert (chest.value, chest.limit) == (pytest.approx(v, abs=1e-9), pytest.approx(CHEST, rel=1e-9))
        low, high = CHEST / math.sqrt(1.2), CHEST / math.sqrt(0.8)
        assert chest.interval == pytest.approx((v - (high - CHEST), v + (CHEST - low)))


@pytest.mark.parametrize(
    ("share", "verdict", "reason"),
    [
        (0.999 / math.sqrt(1.2), "within", "; not clamped by a gap that is not verified (M)"),
        (1.001 / math.sqrt(1.2), "undecided", "; decided by stiffness_tolerance ± 20 %"),
        (0.999 / math.sqrt(0.8), "undecided", "; decided by stiffness_tolerance ± 20 %"),
        (1.001 / math.sqrt(0.8), "exceeded", ""),
    ],
)
def test_between_the_ends_the_input_that_decides_is_named(
    off: Station, share: float, verdict: str, reason: str
) -> None:
    chest = named(judged(off, share * CHEST / V, 0.0))["Chest"]
    assert (chest.verdict, chest.reason) == (verdict, f"pressure, free, arm/l2{reason}")


def test_without_tolerances_there_is_no_interval_and_what_decides_is_the_limit(anyone: Station) -> None:
    for share, verdict in ((0.999, "within"), (1.001, "exceeded")):
        chest = named(judged(anyone, share * CHEST / V, 0.0))["Chest"]
        assert (chest.verdict, chest.interval) == (verdict, None)
        assert "decided by" not in chest.reason


@pytest.mark.parametrize("more", ["", "stiffness_tolerance = 0.2\n"])
def test_a_contact_that_nobody_knows_is_what_leaves_the_pressure_open(tmp_path: Path, more: str) -> None:
    """Whatever else may be off: of an edge no tolerance says how far."""
    station = cell(tmp_path, 'mass = "simplified"\n' + KEPT + more)
    chest = named(judged(station, 0.1, 0.0))["Chest"]
    assert chest.verdict is Verdict.UNDECIDED
    assert chest.reason.startswith("contact pressure of arm/l2 (free): edge radius")
    assert "decided by" not in chest.reason
    assert (chest.interval is None) == (more == "")


# -- what is said ---------------------------------------------------------------------------------


def test_the_floor_is_named_where_it_is_what_clamps(tmp_path: Path) -> None:
    """0.14 m above it, coming down; left out, nothing clamps, and against a slab it is the slab."""
    base = "base = { position = [0, 0, 0.14] }\n"
    slab = '[[parts]]\nname = "slab"\nshape = { box = [6, 6, 0.2] }\nat = { position = [0, 0, -0.1] }\n'
    for k, (options, more, reason) in enumerate(
        [
            ("", "", "pressure, clamped, arm/l2, on the floor"),
            ("floor = false\n", "", "pressure, free, arm/l2; not clamped by a gap that is not verified (M)"),
            ("floor = false\n", slab, "pressure, clamped, arm/l2"),
        ]
    ):
        station = cell(tmp_path / str(k), FLAT + KEPT + options, more=more, base=base, axis="0 1 0")
        assert named(judged(station, 0.05, 0.0))["Chest"].reason == reason


@pytest.mark.parametrize(
    ("human", "speed", "left_out"),
    [
        (True, False, "the person's own motion, beyond what is observed: who stands still counts with 0 m/s"),
        (False, False, "the person's own motion"),
        (True, True, None),
        (False, True, None),
    ],
)
def test_the_basis_has_the_options_that_count(
    tmp_path: Path, human: bool, speed: bool, left_out: str | None
) -> None:
    options = ('human = "op"\n' if human else "") + ("person_speed = 1.2\n" if speed else "")
    basis = cell(tmp_path, FLAT + options, more=person(2.25)).bound[0].basis
    given = {i.name: (i.value, i.unit) for i in basis.inputs}
    assert given.get("horizon") == ((0.5, "m") if human else None)
    assert given.get("person_speed") == ((1.2, "m/s") if speed else None)
    said = [text for text in basis.not_modelled if "own motion" in text]
    assert said == ([] if left_out is None else [f"{left_out} (person_speed is not given)"])


def test_a_row_of_a_region_that_is_kept_from_contact_says_so(off: Station) -> None:
    rows = {row.group: row for row in judged(off, 0.1, 0.0).rows}
    assert (rows["Face"].state, rows["Face"].verdict) == (RowState.EXCLUDED, None)
    assert rows["Face"].reason == "kept from contact by the workstation file"
    assert np.isfinite(rows["Chest"].limit)


def test_who_is_named_is_not_alone(tmp_path):
    """The arm is in another person than the one who is named, nine metres away."""
    text = FLOATING + TWO_R + person(9).replace("op", "far") + person(1.5).replace("op", "near")
    contact = '[[safety]]\nkind = "power_and_force"\nname = "contact"\nrobot = "arm"\nhuman = "far"\n'
    distance = '[[safety]]\nkind = "minimum_distance"\nname = "distance"\nbetween = ["arm", "far"]\n'
    cell = made(tmp_path, text + contact + distance, {"arm.urdf": two_r()})
    found = results_at(cell, arm=((0.0, 0.0), (1.0, 0.0)))["contact"]
    assert found.verdict is Verdict.EXCEEDED
    assert found.reason.endswith("; near")
    assert {bone.split("/")[0] for row in found.rows for bone in row.bones} == {"near"}
    told = made(tmp_path / "told", text + distance, {"arm.urdf": two_r()}).model.findings
    (finding,) = [f for f in told if f.subject == "near" and "not evaluated" in f.text]
    assert "ask about far, and none about near" in finding.text
