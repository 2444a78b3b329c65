"""Contacts measured at the robot: what is read from a record, and that the worse of both counts."""

from __future__ import annotations

import datetime as dt
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from made_cell import FLOATING, TWO_R, made, results_at, two_r
from seerob.core.errors import InputError, UnknownName
from seerob.core.snapshot import Origin, Result, Verdict
from seerob.criteria.contact.measured import Measurements, missing, peaks, read, read_curve, risen
from seerob.criteria.safety.power_and_force import Contacts, PowerAndForce
from seerob.session.station import Station

CHEST = "Chest"
GOOD = {
    "part": '"arm/l2"', "region": f'"{CHEST}"', "contact": '"free"', "speed": "0.45", "force_N": "200",
    "pressure_N_cm2": "150", "tools": "[]", "device": '"PFMD 7"', "spring_N_mm": "25", "pad": '"70 Shore A"',
    "date": "2026-03-01", "calibrated": "2025-09-01",
}  # fmt: skip
"""280 N and 240 N/cm² are the transient limits of the chest, 140 N and 120 N/cm² the quasi-static ones."""


def entry(**changed: str | None) -> str:
    rows = {**GOOD, **changed}
    return "[[measurements]]\n" + "".join(f"{k} = {v}\n" for k, v in rows.items() if v is not None)


def cell(
    folder: Path, *entries: str, files: dict[str, str] | None = None, more: str = "", tool: str = ""
) -> Station:
    text = (
        f'{FLOATING}{TWO_R}{tool}[[safety]]\nkind = "power_and_force"\nname = "pfl"\nrobot = "arm"\n'
        'mass = "simplified"\ncontact_area = { arm = 1e-4 }\nfloor = false\n'
        + ('measurements = "measured.toml"\n' if entries else "")
        + more
    )
    return made(folder, text, {"arm.urdf": two_r(), "measured.toml": "".join(entries), **(files or {})})


def chest(station: Station, speed: float = 0.45) -> Result:
    found = results_at(station, arm=([0.0, 0.0], [speed / np.hypot(2, 0.05), 0]))["pfl"]
    rows = [row for row in found.rows if row.group == CHEST]
    part = next(part for part in found.parts if part.name == CHEST)
    order = [Verdict.WITHIN, Verdict.UNDECIDED, Verdict.EXCEEDED]
    # What was measured of the region counts for each of its areas.
    least = (
        max(order.index(p.verdict) for p in part.parts if p.name.startswith("measured"))
        if "measured" in str([p.name for p in part.parts])
        else 0
    )
    assert all(order.index(row.verdict) >= least for row in rows)
    return part


def test_without_measurements_it_is_the_prediction(tmp_path: Path) -> None:
    assert chest(cell(tmp_path)).verdict is Verdict.WITHIN


def test_both_within_is_within_and_says_what_was_measured(tmp_path: Path) -> None:
    station = cell(tmp_path, entry())
    part = chest(station)
    assert part.verdict is Verdict.WITHIN
    told = {p.name.partition(":")[0]: (p.value, p.limit, p.unit) for p in part.parts if "measured" in p.name}
    assert told == {
        "measured force, first half second": (200.0, 280.0, "N"),
        "measured pressure": (150e4, 240e4, "Pa"),
    }
    inputs = [i for i in station.bound[0].basis.inputs if i.origin is Origin.MEASURED]
    assert [(i.value, i.unit) for i in inputs] == [(200.0, "N"), (150e4, "Pa")]
    assert all("PFMD 7" in i.source and "2026-03-01" in i.source for i in inputs)
    assert "measured.toml" in station.files


@pytest.mark.parametrize(
    "changed",
    [
        {"force_N": "281"},
        {"pressure_N_cm2": "241"},
        {"spring_N_mm": "20", "force_N": "281"},
        {"speed": "0.3", "force_N": "281"},
    ],
)
def test_what_was_measured_above_its_limit_is_exceeded(tmp_path: Path, changed: dict[str, str]) -> None:
    """A softer spring and a slower robot than here tell less than there is."""
    part = chest(cell(tmp_path, entry(**changed)))
    assert part.verdict is Verdict.EXCEEDED
    assert part.reason.startswith("measured ")


@pytest.mark.parametrize("below", [0.0, 1e-12, 1e-4])
@pytest.mark.parametrize(
    ("figure", "limit", "contact"),
    [
        ("force_N", 280, {}),
        ("pressure_N_cm2", 240, {}),
        ("force_N", 280, {"contact": '"clamped"', "static_force_N": "100", "pressure_N_cm2": "100"}),
        ("static_force_N", 140, {"contact": '"clamped"', "pressure_N_cm2": "100"}),
        ("pressure_N_cm2", 120, {"contact": '"clamped"', "static_force_N": "100"}),
    ],
)
def test_what_was_measured_on_its_limit_is_not_within(tmp_path, figure, limit, contact, below):
    """A device of which the peak is the limit to the last bit, free and where it clamps."""
    station = cell(tmp_path, entry(**{**contact, figure: repr(limit * (1 - below))}))
    told = {p.name.partition(":")[0]: p for p in chest(station).parts if "measured" in p.name}
    names = {"force_N": "force, first half second", "static_force_N": "force after it"}
    name = names.get(figure, "pressure")
    part = told[f"measured {name}"]
    assert part.limit == limit * (1e4 if name == "pressure" else 1)
    assert part.unit == ("Pa" if name == "pressure" else "N")
    assert (part.verdict is Verdict.WITHIN) is (below > 1e-9)


@pytest.mark.parametrize(
    ("changed", "reason"),
    [
        ({"speed": "0.4"}, "measured at 0.4 m/s, and it moves at 0.45 m/s here"),
        ({"part": '"arm"', "speed": "0.4"}, "measured at 0.4 m/s, and it moves at 0.45 m/s here"),
        ({"spring_N_mm": None}, "the spring constant of the device is not told"),
        ({"spring_N_mm": "20"}, "is softer than 25 N/mm"),
        ({"pad": None}, "the pad of the device is not told"),
        ({"tools": None}, "what the robot carried is not told"),
        ({"tools": '["gripper"]'}, "the robot carried gripper, and carries nothing here"),
        ({"device": None}, "which device measured it is not told"),
        ({"calibrated": None}, "is not told (date, calibrated)"),
        ({"date": None}, "is not told (date, calibrated)"),
        ({"calibrated": "2025-02-01"}, "more than a year before"),
        ({"calibrated": "2026-03-02"}, "after the measurement"),
        ({"pressure_N_cm2": None}, "not measured"),
        ({"force_N": None}, "not measured"),
        # Above its limit, and more than a body part would feel.
        ({"spring_N_mm": "35", "force_N": "281"}, "is stiffer than 25 N/mm"),
        ({"speed": "0.6", "force_N": "281"}, "measured at 0.6 m/s"),
        ({"contact": '"clamped"', "force_N": "281", "static_force_N": "100"}, "it is free here"),
    ],
)
def test_what_was_measured_otherwise_leaves_it_open(tmp_path: Path, changed: dict, reason: str) -> None:
    part = chest(cell(tmp_path, entry(**changed)))
    assert part.verdict is Verdict.UNDECIDED
    assert reason in part.reason


def test_a_measurement_never_relieves_a_prediction(tmp_path: Path) -> None:
    fast = {"speed": "9", "force_N": "1", "pressure_N_cm2": "1"}
    for speed in (0.2, 1.0, 1.6, 2.0, 4.0):
        before, after = (
            chest(cell(tmp_path / f"{n}{speed}", *rows), speed)
            for n, rows in (("a", ()), ("b", [entry(**fast)]))
        )
        assert before.verdict is after.verdict
        assert before.limit == after.limit


def test_several_measurements_count_all(tmp_path: Path) -> None:
    other = entry(place='"at the belt"', force_N="300")
    assert chest(cell(tmp_path / "a", entry(), other)).verdict is Verdict.EXCEEDED
    assert (
        chest(cell(tmp_path / "b", entry(), entry(region='"Abdomen"', force_N="300"))).verdict
        is Verdict.WITHIN
    )
    assert (
        chest(cell(tmp_path / "c", entry(), entry(part='"arm/l1"', force_N="300", speed="0.2"))).verdict
        is Verdict.EXCEEDED
    )


def test_with_the_same_tool_it_counts_and_with_another_not(tmp_path: Path) -> None:
    tool = '[[tools]]\nname = "hook"\non = "arm/tip"\nmass = 0.1\nshape = { sphere = 0.03 }\n'
    area = "contact_area = { arm = 1e-4, hook = 1e-4 }"
    for tools, verdict in (('["hook"]', Verdict.WITHIN), ("[]", Verdict.UNDECIDED)):
        folder = tmp_path / str(len(tools))
        station = cell(folder, entry(tools=tools), tool=tool)
        text = folder.joinpath("workstation.toml").read_text().replace("contact_area = { arm = 1e-4 }", area)
        station = made(folder, text)
        assert chest(station).verdict is verdict


def test_a_clamped_body_part_asks_for_a_clamped_measurement(tmp_path: Path) -> None:
    wall = '[[parts]]\nname = "wall"\nshape = { box = [1, 0.1, 1] }\nat = { position = [1.5, 0.3, 0] }\n'
    clamped = {"contact": '"clamped"', "force_N": "200", "static_force_N": "130", "pressure_N_cm2": "110"}
    free = chest(cell(tmp_path / "a", entry(), tool=wall), 0.3)
    assert "it is clamped here" in free.reason
    assert free.verdict is Verdict.UNDECIDED
    whole = chest(cell(tmp_path / "w", entry(part='"arm"'), tool=wall), 0.3)
    assert "it is clamped here" in whole.reason
    cases = (
        ({}, Verdict.WITHIN),
        ({"static_force_N": "141"}, Verdict.EXCEEDED),
        ({"static_force_N": None}, Verdict.UNDECIDED),
        ({"pressure_N_cm2": "121"}, Verdict.EXCEEDED),
    )
    for n, (more, verdict) in enumerate(cases):
        found = chest(cell(tmp_path / str(n), entry(**{**clamped, "speed": "0.3", **more}), tool=wall), 0.3)
        assert found.verdict is verdict, more


def bound(folder: Path, *entries: str) -> tuple[Measurements, int]:
    station = cell(folder, *entries)
    (criterion,) = station.workstation.safety
    contacts = Contacts(criterion, station.model)
    return contacts.measured, contacts.columns[CHEST]


def test_of_the_bodies_of_a_part_the_fastest_counts_and_whichever_clamps(tmp_path: Path) -> None:
    measured, column = bound(tmp_path, entry(part='"arm"', speed="0.4"))
    yes, no = np.array([True, True]), np.array([False, False])

    def said(v: list[float], near: np.ndarray, clamped: np.ndarray, at: int = column) -> list[str]:
        return [part.reason for part in measured.results(at, np.array(v), near, clamped)]

    assert said([0.1, 0.4], yes, no) == ["", ""]
    assert said([0.4 * (1 + 1e-10), 0.4], yes, no) == ["", ""]
    for v in ([0.1, 0.5], [0.5, 0.1]):
        assert all("it moves at 0.5 m/s" in reason for reason in said(v, yes, no))
    for clamped in ([True, False], [False, True]):
        assert all("it is clamped here" in reason for reason in said([0.4, 0.4], yes, np.array(clamped)))
    # Who cannot be hit is not asked, nor is another region.
    assert said([0.5, 0.4], np.array([False, True]), np.array([True, False])) == ["", ""]
    assert said([0.5, 0.5], no, no) == said([0.5, 0.5], yes, no, column + 1) == []


def test_a_measurement_bears_out_its_own_speed_and_no_more(tmp_path: Path) -> None:
    """Of the part that was measured, where it says that all of it is within."""
    no, nan, inf = np.array([False, False]), np.nan, np.inf
    for k, (entries, expected) in enumerate(
        (
            ([entry(speed="0.4")], [inf, 0.4]),
            ([entry(part='"arm"', speed="0.4"), entry(speed="0.3")], [0.4, 0.3]),
            ([entry(part='"arm"', speed="0.3"), entry(speed="0.4")], [0.3, 0.3]),
            ([entry(force_N="281")], [inf, nan]),
            ([entry(pressure_N_cm2="241")], [inf, nan]),
            ([entry(pad=None)], [inf, nan]),
            ([entry(region='"Pelvis"')], [inf, inf]),
        )
    ):
        measured, column = bound(tmp_path / str(k), *entries)
        np.testing.assert_array_equal(measured.permits(column, no), expected)
    measured, column = bound(tmp_path / "clamped", entry(part='"arm"', speed="0.4"))
    np.testing.assert_array_equal(measured.permits(column, np.array([True, False])), [nan, 0.4])


# -- records ------------------------------------------------------------------------------------


def test_peaks_are_those_of_the_first_half_second_and_of_the_rest() -> None:
    t = np.arange(0, 2, 1e-3)
    force = np.where(t < 0.3, 0.5, 0) + np.where((t >= 0.3) & (t < 0.35), 250.0, 0)
    force += np.where((t >= 0.35) & (t < 0.85), 90, 0) + np.where(t >= 0.85, 60, 0)
    assert peaks(t, force) == (250.0, 90.0)  # the sample at 0.8 s counts for both
    assert peaks(t[:500], force[:500]) == (250.0, None)


def pressed(peak: float, zero: float = 0.0, gone: float = 0.0) -> str:
    """A contact of 200 ms after 0.1 s of rest, about a zero that is off, with nothing said for a while."""
    t = np.arange(0, 0.6, 1e-3)
    force = peak * np.sin(np.pi * np.clip((t - 0.1) / 0.2, 0, 1))
    force[(t > 0.18) & (t <= 0.18 + gone)] = 0
    return "Time [s];Force [N]\n" + "".join(
        f"{a:.4f};{b + zero:.4f}\n" for a, b in zip(t, force, strict=True)
    )


@pytest.mark.parametrize(
    ("record", "verdict", "reason"),
    [
        (pressed(250), Verdict.WITHIN, ""),
        (pressed(290), Verdict.EXCEEDED, "above its limit"),
        (pressed(290, zero=-30), Verdict.EXCEEDED, "above its limit"),  # tells 260
        (pressed(250, zero=40), Verdict.EXCEEDED, "above its limit"),  # what it tells counts, too
        (pressed(290, gone=0.05), Verdict.UNDECIDED, "it drops out at 0.18"),
    ],
)
def test_a_zero_that_is_off_and_a_loose_cable_hide_no_peak(tmp_path, record, verdict, reason) -> None:
    files = {"belt.csv": record}
    part = chest(cell(tmp_path, entry(curve='"belt.csv"', force_N=None), files=files))
    assert part.verdict is verdict
    assert reason in part.reason


@pytest.mark.parametrize(
    ("changed", "reason"),
    [
        ({"spring_N_mm": "25000"}, "spring_N_mm = 25000 N/mm"),
        ({"pressure_N_cm2": "1.5"}, "contact_area = 0.0133333 m²"),  # N/mm²
        ({"force_N": "0.2"}, "contact_area = 1.33333e-07 m²"),  # kN
    ],
)
def test_units_that_nobody_means_leave_it_open_and_relieve_nothing(tmp_path, changed, reason) -> None:
    part = chest(cell(tmp_path / "a", entry(**changed)))
    assert part.verdict is Verdict.UNDECIDED
    assert reason in part.reason
    more = "281" if "pressure_N_cm2" not in changed else "2810"
    assert chest(cell(tmp_path / "b", entry(**{**changed, "force_N": more}))).verdict is not Verdict.WITHIN


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_no_sample_of_a_contact_is_in_neither_peak(seed: int) -> None:
    rng = np.random.default_rng(seed)
    t = np.cumsum(rng.uniform(1e-3, 0.05, 60))
    force = rng.uniform(0, 200, 60)
    transient, static = peaks(t, force)
    assert max(transient, static or 0.0) == force.max()


@pytest.mark.parametrize(
    "text",
    [
        "Time [ms];Force [N]\n0;0\n1,5;100,5\n700;50\n",
        "device;PFMD\nserial;7\n\nZeit [s];Weg [mm];Kraft [N]\n0;1;0\n0,0015;2;100,5\n0,7;3;50\n",
        "t (s),F (kN)\n0,0\n0.0015,0.1005\n0.7,0.05\n",
        "Time [s]\tForce [N]\n0\t0\n0.0015\t100.5\n0.7\t50\n",
    ],
)
def test_records_are_read_with_their_units(tmp_path: Path, text: str) -> None:
    path = tmp_path / "a.csv"
    path.write_text(text)
    t, force = read_curve(path, "a.csv")
    np.testing.assert_allclose(t, [0, 0.0015, 0.7])
    np.testing.assert_allclose(force, [0, 100.5, 50])


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("Time;Force\n0;1\n1;2\n", "no columns of time and force with units"),
        ("Time [s];Weg [mm]\n0;1\n1;2\n", "no columns of time and force with units"),
        ("Weg [mm];Force [N]\n0;1\n1;2\n", "no columns of time and force with units"),
        ("Time [s];Force [N]\n1;1\n0;2\n", "do not rise"),
        ("Time [s];Force [N]\n0;1\n1;2\n0,5;3\n", "do not rise"),
        ("Time [s];Force [N]\n0;1\n0;2\n1;3\n", "do not rise"),
        ("Time [s];Force [N]\n0;0\n1;0\n", "no force above 0"),
        ("Time [s];Force [N]\n0;2\n0,01;-900\n0,02;1\n", "pressing is positive: turn the sign"),
        ("Time [s];Force [N]\n0;x\n1;0\n", "'x'"),
        ("Time [s];Force [N];Force [N]\n0;0;0\n1;5;900\n", "more than one column says Force"),
        ("Time [s];Force [N];Time [s];Force [N]\n0;0;0;0\n1;5;1;900\n", "more than one column says Time"),
        ("Time [s],Force [N]\n0,0,0,0\n1,5,280,5\n", "row 2 has more cells than the header"),
        ("", "empty"),
    ],
)
def test_what_is_no_record_says_so(tmp_path: Path, text: str, what: str) -> None:
    path = tmp_path / "a.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=what):
        read_curve(path, "a.csv")


def test_a_force_below_a_newton_is_one(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("Time [s];Force [N]\n0;0\n1;0,5\n")
    assert read_curve(path, "a.csv")[1].tolist() == [0.0, 0.5]


INSTANTS = np.arange(0, 0.7, 1e-3)


def pulse(peak: float, at: float, width: float) -> np.ndarray:
    return peak * np.exp(-(((INSTANTS - at) / width) ** 2))


@pytest.mark.parametrize(
    ("force", "rows", "why"),
    [
        (pulse(200, 0.1, 0.02), slice(None), ""),
        (pulse(200, 0.0, 0.02), slice(None), "begins in contact"),
        (pulse(900, 0.1, 0.02), slice(70), "ends in contact"),
        (pulse(900, 0.125, 0.01) + 5, slice(None, None, 50), "samples are 50 ms apart"),
        (pulse(200, 0.1, 0.02), slice(None, None, 3), "samples are 3 ms apart"),
        (np.minimum(pulse(900, 0.1, 0.02), 250), slice(None), "stands still"),
        # A cable that comes off while the force rises, or at its peak, and is not put back.
        (pulse(500, 0.1, 0.02) * (INSTANTS < 0.08), slice(None), "it ends at 0.08 s, from 166"),
        (pulse(200, 0.1, 0.02) * (INSTANTS < 0.105), slice(None), "it ends at 0.105 s, from 192"),
        # The quickest that a hand of 0.6 kg gives way, at 75 N/mm, every 2 ms.
        (200 * np.sin(np.pi * np.clip((INSTANTS - 0.1) / 8.9e-3, 0, 1)), slice(None, None, 2), ""),
    ],
)
def test_a_record_that_may_miss_its_peak_is_never_within(tmp_path: Path, force, rows, why: str) -> None:
    t, F = INSTANTS[rows], force[rows]
    curve = "Time [s];Force [N]\n" + "".join(f"{a:.6g};{b:.6g}\n" for a, b in zip(t, F, strict=True))
    station = cell(tmp_path, entry(curve='"a.csv"', force_N=None), files={"a.csv": curve})
    part = chest(station)
    assert part.verdict is (Verdict.UNDECIDED if why else Verdict.WITHIN)
    assert why in part.reason
    told = {p.name.partition(":")[0]: p.verdict for p in part.parts if "measured" in p.name}
    assert told["measured force, first half second"] is part.verdict
    assert told["measured pressure"] is Verdict.WITHIN


@pytest.mark.parametrize(
    ("force", "left_out", "why"),
    [
        (lambda t: 100 - 30 * (t > 0.5) + np.sin(70 * t), (), ""),
        (lambda t: 100 + 2 * np.sin(50 * t), (), ""),
        (lambda t: 60 + 60 * t, (), "while its force still rises"),
        (
            lambda t: 100 + np.sin(70 * t) + 500 * np.clip(t - 1.0, 0, 0.1),
            (0.8, 1.5),
            "nothing was told for 0.7",
        ),
    ],
)
def test_a_force_that_lasts_is_known_as_far_as_it_was_told(tmp_path: Path, force, left_out, why: str) -> None:
    """A press of which the rise was left out, or that was cut off while it rose, was within."""
    wall = '[[parts]]\nname = "wall"\nshape = { box = [1, 0.1, 1] }\nat = { position = [1.5, 0.3, 0] }\n'
    t = np.arange(0, 0.75 if "rises" in why else 1.8, 1e-3)
    F = np.where(t < 0.1, 0.0, force(t)) * (t < 1.7)
    keep = np.ones(len(t), bool) if not left_out else (t < left_out[0]) | (t > left_out[1])
    if left_out:
        F[t > left_out[1]] = 60
    curve = "Time [s];Force [N]\n" + "".join(
        f"{a:.6g};{b:.6g}\n" for a, b in zip(t[keep], F[keep], strict=True)
    )
    clamped = {"contact": '"clamped"', "speed": "0.3", "pressure_N_cm2": "110", "force_N": None}
    station = cell(tmp_path, entry(**clamped, curve='"a.csv"'), tool=wall, files={"a.csv": curve})
    part = chest(station, 0.3)
    assert part.verdict is (Verdict.UNDECIDED if why else Verdict.WITHIN)
    assert why in part.reason


def blow(t: np.ndarray, *, begins: float = 0.0) -> np.ndarray:
    """100 N in 20 ms from 0.1 s on, and a share of it before."""
    return np.where(t < 0.1, 100 * begins, 100 * np.sin(np.pi * np.clip((t - 0.1) / 0.02, 0, 1)))


def lasting(t: np.ndarray, end: float = 1.0) -> np.ndarray:
    """The same, and 60 N that stay until an instant."""
    return np.where((t > 0.115) & (t < end), 60.0, blow(t))


EVERY = np.arange(0, 1300) / 1000


@pytest.mark.parametrize(
    ("t", "force", "why"),
    [
        (EVERY, blow(EVERY), None),
        (EVERY, lasting(EVERY), None),
        # A contact begins at a twentieth of its largest force.
        (EVERY, blow(EVERY, begins=0.048), None),
        (EVERY, blow(EVERY, begins=0.052), "begins in contact"),
        # Samples are 2 ms apart at most, while it may be quick.
        (2.0 * EVERY, blow(2.0 * EVERY), None),
        (2.1 * EVERY, blow(2.1 * EVERY), "2.1 ms apart"),
        (np.delete(EVERY, slice(99, 101)), blow(np.delete(EVERY, slice(99, 101))), "3 ms apart"),
        (np.delete(EVERY, slice(90, 97)), blow(np.delete(EVERY, slice(90, 97))), None),
        (np.delete(EVERY, slice(97, 100)), blow(np.delete(EVERY, slice(97, 100))), None),
        (np.delete(EVERY[98:], [1, 2]), blow(np.delete(EVERY[98:], [1, 2])), "3 ms apart"),
        # It is followed for half a second: from 0.101 s, the first sample that is above 5 N.
        (EVERY[:601], lasting(EVERY[:601], 9.0), "the record ends in contact, 0.499 s after it began"),
        (EVERY[:603], lasting(EVERY[:603], 9.0), None),
        # No contact falls to nothing from 0.3 of its largest force, to come back, or from 0.8 for good.
        (EVERY, np.where(EVERY == 0.2, 0, np.where(EVERY < 0.199, lasting(EVERY), 29)), None),
        (EVERY, np.where(EVERY == 0.2, 0, np.where(EVERY < 0.199, lasting(EVERY), 31)), "drops out at 0.2 s"),
        (EVERY, np.where(EVERY < 0.199, lasting(EVERY), 79.0 * (EVERY < 0.3)), None),
        (EVERY, np.where(EVERY < 0.199, lasting(EVERY), 81.0 * (EVERY < 0.3)), "it ends at 0.3 s, from 81"),
        (EVERY, np.where(EVERY < 0.199, lasting(EVERY), 81.0 * (EVERY < 0.62)), None),
        # Something is told every tenth of a second of a force that lasts.
        (np.delete(EVERY, slice(701, 800)), lasting(np.delete(EVERY, slice(701, 800))), None),
        (np.delete(EVERY, slice(701, 805)), lasting(np.delete(EVERY, slice(701, 805))), "told for 0.105 s"),
        # A force that has settled rises by a fiftieth of itself in that time at most.
        (EVERY, lasting(EVERY, 9.0) * np.where(EVERY > 1.25, 1.019, 1), None),
        (EVERY, lasting(EVERY, 9.0) * np.where(EVERY > 1.25, 1.021, 1), "while its force still rises"),
        (EVERY, lasting(EVERY, 9.0) * np.where(EVERY > 1.2985, 1.021, 1), "while its force still rises"),
        # Ten samples at the largest force are the end of a range.
        (EVERY, np.where((EVERY > 0.1995) & (EVERY < 0.2085), 101.0, lasting(EVERY)), None),
        (EVERY, np.where((EVERY > 0.1995) & (EVERY < 0.2095), 101.0, lasting(EVERY)), "101 N, stands still"),
        (
            EVERY,
            np.where(((EVERY > 0.1995) & (EVERY < 0.2095)) | (EVERY == 0.3), 101.0, lasting(EVERY)),
            "101 N, stands still",
        ),
    ],
)  # fmt: skip
def test_a_record_shows_its_peak_on_one_side_of_each_figure_and_not_on_the_other(t, force, why) -> None:
    found = missing(t, force)
    assert len(found) == (why is not None), found
    assert why is None or why in found[0]


def test_what_lasts_half_a_second_is_transient_and_what_is_then_told_is_not() -> None:
    """It begins between 0.1 s and 0.101 s, so that both ends of the half second count for both."""
    for at, transient, static in ((0.599, True, False), (0.6, True, True), (0.601, False, True)):
        found = peaks(EVERY, np.where(np.abs(EVERY - at) < 1e-6, 500.0, lasting(EVERY) * 10))
        assert (found[0] == 1000.0, found[1] == 600.0) == (True, True)
        found = peaks(EVERY, np.where(np.abs(EVERY - at) < 1e-6, 1010.0, lasting(EVERY) * 10))
        assert (found[0] == 1010.0, found[1] == 1010.0) == (transient, static), at
        noisy = np.where(EVERY < 0.1, 3.0, lasting(EVERY) * 10)  # of a device that presses nothing
        found = peaks(EVERY, np.where(np.abs(EVERY - at) < 1e-6, 1010.0, noisy))
        assert (found[0] == 1010.0, found[1] == 1010.0) == (transient, static), at
    assert peaks(np.array([0.0, 0.1, 0.1]), np.array([1.0, 2.0, 3.0])) == (3.0, None)
    with pytest.raises(ValueError, match="t falls"):
        peaks(np.array([0.0, 1.0, 0.5]), np.ones(3))


def test_a_zero_counts_from_below_and_never_from_above() -> None:
    force = blow(EVERY)
    np.testing.assert_allclose(risen(force - 3.0), force, atol=1e-12)
    np.testing.assert_allclose(risen(force + 3.0), force + 3.0)
    np.testing.assert_array_equal(risen(force[105:]), force[105:])


@pytest.mark.parametrize(
    ("changed", "verdict"),
    [
        ({"spring_N_mm": "22.6"}, Verdict.WITHIN),
        ({"spring_N_mm": "22.4"}, Verdict.UNDECIDED),
        ({"spring_N_mm": "27.4", "force_N": "281"}, Verdict.EXCEEDED),
        ({"spring_N_mm": "27.6", "force_N": "281"}, Verdict.UNDECIDED),
        ({"calibrated": "2025-02-28"}, Verdict.WITHIN),
        ({"calibrated": "2025-02-27"}, Verdict.UNDECIDED),
        ({"calibrated": "2026-03-01"}, Verdict.WITHIN),
    ],
)
def test_springs_and_calibrations_count_on_one_side_of_each_figure(tmp_path, changed, verdict) -> None:
    """A tenth about 25 N/mm; 366 days."""
    assert chest(cell(tmp_path, entry(**changed))).verdict is verdict


def test_a_curve_outside_the_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / "away.csv").write_text("Time [s];Force [N]\n0;0\n0,01;290\n0,4;10\n")
    (tmp_path / "cell").mkdir()
    for name in ("../away.csv", "link.csv"):
        station = cell(tmp_path / "cell", entry(curve=f'"{name}"', force_N=None))
        (tmp_path / "cell" / "link.csv").unlink(missing_ok=True)
        (tmp_path / "cell" / "link.csv").symlink_to("../away.csv")
        with pytest.raises(InputError, match=r"leads to .*away\.csv, outside the folder.*--allow-out"):
            _ = station.bound
        assert not any(b"290" in content for content in station.files.values())


def test_a_curve_is_judged_like_its_peaks_and_goes_with_the_recording(tmp_path: Path) -> None:
    curve = {"files": {"curves/a.csv": "Time [s];Force [N]\n0;0\n0,01;290\n0,4;10\n"}}
    station = cell(tmp_path, entry(curve='"curves/a.csv"', force_N=None), **curve)
    assert chest(station).verdict is Verdict.EXCEEDED
    assert "curves/a.csv" in station.files


@pytest.mark.parametrize(
    ("text", "what"),
    [
        (entry(speed="-1"), "speed"),
        (entry(force="3"), "force"),
        (entry(curve='"a.csv"'), "a curve, and forces beside it"),
        (entry(force_N=None, pressure_N_cm2=None), "nothing was measured"),
        ("", "measurements"),
        ("[[measurements", "not TOML"),
    ],
)
def test_slips_in_the_file_are_told(tmp_path: Path, text: str, what: str) -> None:
    path = tmp_path / "measured.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=what):
        read(path)


@pytest.mark.parametrize("changed", [{"part": '"arm/l9"'}, {"region": '"Face"'}, {"area": '"Palm"'}])
def test_what_is_not_there_is_told_at_start(tmp_path: Path, changed: dict[str, str]) -> None:
    station = cell(tmp_path, entry(**changed))
    criterion = next(c for c in station.workstation.safety if isinstance(c, PowerAndForce))
    with pytest.raises(UnknownName):
        criterion.bind(station.model)


def test_dates_are_those_of_the_file(tmp_path: Path) -> None:
    path = tmp_path / "measured.toml"
    path.write_text(entry())
    (one,) = read(path)
    assert one.date == dt.date(2026, 3, 1)
