"""Power and force limiting on arms and people whose permissible speeds follow by hand."""

from __future__ import annotations

import math
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from made_cell import FLOATING, TWO_R, heard, judged, made, results_at, state_at, two_r
from seerob.core.errors import InputError
from seerob.core.snapshot import Origin, Result, Verdict
from seerob.criteria.contact.regions import FORBIDDEN, REGIONS
from seerob.description.norms.body_limits import SHIPPED
from seerob.session.station import Station
from seerob.twin.engine import Engine

KEPT = '["Skull and forehead", "Face", "Larynx, eyes and ears", "Feet"]'
STRETCHED = [0.0, 0.0]
M_R = 1.0  # (1 + 1) / 2
M_TIP = 1.0  # the outer point mass, at the end of a straight arm across its direction


def cell(folder: Path, options: str = "", *, head: str = "", more: str = "", **arm: object) -> Station:
    """The arm lies in the plane of the floor, which is left out unless it is asked for."""
    options = options if "floor" in options else f"floor = false\n{options}"
    text = (
        f"{head}{FLOATING}{TWO_R}{more}"
        f'[[safety]]\nkind = "power_and_force"\nname = "pfl"\nrobot = "arm"\n{options}'
    )
    return made(folder, text, {"arm.urdf": two_r(**arm)})


def by_name(result: Result) -> dict[str, Result]:
    return {part.name: part for part in result.parts}


def regions_at(station: Station, speed: float, q: list[float] = STRETCHED) -> dict[str, Result]:
    """With the end of the arm at ``speed`` [m/s]."""
    reach = math.hypot(math.cos(q[0]) + math.cos(q[0] + q[1]), math.sin(q[0]) + math.sin(q[0] + q[1]))
    return by_name(results_at(station, arm=(q, [speed / reach, 0]))["pfl"])


def flat(folder: Path, options: str = "", **more: object) -> Station:
    """All faces carry 1 cm²."""
    return cell(folder, f"contact_area = {{ arm = 1e-4 }}\n{options}", **more)


def test_free_hand_is_limited_by_energy_of_the_printed_table(tmp_path: Path) -> None:
    station = flat(tmp_path, f'mass = "simplified"\nexcluded = {KEPT}')
    hand = regions_at(station, 0.5)["Hands and fingers"]
    assert hand.limit == pytest.approx(math.sqrt(2 * 0.49 / (0.6 * M_R / (0.6 + M_R))), rel=1e-9)
    assert hand.reason == "energy, free, arm/l2; not clamped by a gap that is not verified (M)"


@pytest.mark.parametrize(("name", "limit"), [("Chest", 1.537), ("Back and shoulders", 1.732)])
def test_free_chest_and_back_are_limited_by_pressure(tmp_path: Path, name: str, limit: float) -> None:
    part = regions_at(flat(tmp_path, 'mass = "simplified"'), 0.5)[name]
    assert round(part.limit, 3) == limit
    assert part.reason.startswith("pressure, free")


def test_lower_arm_is_limited_by_force(tmp_path: Path) -> None:
    part = regions_at(flat(tmp_path, 'mass = "simplified"'), 0.5)["Lower arms and wrist joints"]
    assert round(part.limit, 3) == 1.960
    assert part.reason.startswith("force, free")


def test_verdict_turns_at_the_limit_and_the_bound_is_of_the_fastest_corner(tmp_path: Path) -> None:
    station = flat(tmp_path, f'mass = "simplified"\nexcluded = {KEPT}')
    limit = regions_at(station, 0.5)["Chest"].limit
    corner = math.hypot(2, 0.05) / 2
    assert regions_at(station, (limit - 1e-6) / corner)["Chest"].verdict is Verdict.WITHIN
    assert regions_at(station, (limit + 1e-6) / corner)["Chest"].verdict is Verdict.EXCEEDED
    assert regions_at(station, 0.5)["Chest"].value == pytest.approx(0.5 * corner, abs=1e-6)


def test_areas_share_the_force_and_have_their_own_pressure(tmp_path: Path) -> None:
    chest = regions_at(flat(tmp_path, 'mass = "simplified"'), 1.6)["Chest"]
    areas = by_name(chest)
    assert set(areas) == {"Sternum", "Pectoral muscle"}
    assert areas["Sternum"].limit == chest.limit
    # v_P of the pectoral muscle is 170/120 of it, so that force governs there.
    assert round(areas["Pectoral muscle"].limit, 3) == 1.793
    assert (areas["Sternum"].verdict, areas["Pectoral muscle"].verdict) == (
        Verdict.EXCEEDED,
        Verdict.WITHIN,
    )


def test_all_regions_and_all_permitted_areas_are_there(tmp_path: Path) -> None:
    found = regions_at(flat(tmp_path), 0.5)
    assert set(REGIONS) <= set(found)
    assert sum(len(found[name].parts) for name in REGIONS) == 26


@pytest.mark.parametrize("speed", [0.01, 5.0])
def test_head_and_feet_never_have_a_limit(tmp_path: Path, speed: float) -> None:
    found = regions_at(flat(tmp_path), speed)
    for name in (*FORBIDDEN, "Feet"):
        assert found[name].limit is None
        assert found[name].verdict is Verdict.UNDECIDED
        assert not found[name].parts
    assert all("not permitted" in found[name].reason for name in FORBIDDEN)
    assert found["Feet"].reason == "no limit available"


def test_without_a_person_the_whole_is_undecided_until_the_head_is_kept_out(tmp_path: Path) -> None:
    for folder, options, verdict in (
        ("a", "", Verdict.UNDECIDED), ("b", f"excluded = {KEPT}", Verdict.WITHIN),
    ):  # fmt: skip
        assert (
            results_at(flat(tmp_path / folder, options), arm=(STRETCHED, [0.1, 0]))["pfl"].verdict is verdict
        )


def test_exclusion_is_named_in_the_basis(tmp_path: Path) -> None:
    inputs = flat(tmp_path, 'excluded = ["Feet"]').bound[0].basis.inputs
    assert [i.origin for i in inputs if i.name.startswith("Feet")] == [Origin.GIVEN]


def test_box_edges_leave_the_pressure_undecided_below_the_force_limit(tmp_path: Path) -> None:
    station = cell(tmp_path, f"excluded = {KEPT}")
    slow, fast = regions_at(station, 0.5)["Chest"], regions_at(station, 2.0)["Chest"]
    assert slow.verdict is Verdict.UNDECIDED
    assert "edge radius below mesh resolution" in slow.reason
    assert round(slow.limit, 3) == 1.793
    assert fast.verdict is Verdict.EXCEEDED
    missing = [i for i in station.bound[0].basis.inputs if i.name == "contact radius of arm/l2"]
    assert [i.origin for i in missing] == [Origin.MISSING]


def test_given_radius_is_the_contact_of_a_ball(tmp_path: Path) -> None:
    station = cell(tmp_path, 'mass = "simplified"\ncontact_radius = { arm = 0.005 }')
    chest = regions_at(station, 0.5)["Chest"]
    # k / (π R) is below the limit: it holds until the force is that on all of the ball's projection.
    mu = 40 / 41
    assert chest.limit == pytest.approx(240e4 * math.pi * 0.005**2 / math.sqrt(mu * 25e3), rel=1e-9)


def test_ball_that_presses_too_hard_at_every_force_may_not_touch_at_all(tmp_path: Path) -> None:
    """75 N/mm / (π 5 mm) = 4.77 MPa, above the 3.8 MPa of the hand."""
    hand = regions_at(cell(tmp_path, "contact_radius = { arm = 0.005 }"), 0.01)["Hands and fingers"]
    assert (hand.limit, hand.verdict) == (0.0, Verdict.EXCEEDED)
    assert "every force exceeds the pressure" in hand.reason
    pads = by_name(hand)["Forefinger pad, dominant"]
    assert pads.limit > 0  # 300 N/cm², twice of it 6 MPa


def test_sharper_parts_may_only_be_slower(tmp_path: Path) -> None:
    limits = [
        regions_at(cell(tmp_path / str(k), f"contact_radius = {{ arm = {r} }}"), 0.5)["Neck"].limit
        for k, r in enumerate((0.0005, 0.006, 0.008))
    ]
    assert limits == sorted(limits)
    assert limits[0] == 0 < limits[1]


def test_larger_of_both_masses_governs_unless_chosen(tmp_path: Path) -> None:
    """Pushed along itself the straight arm does not give way, pushed across only its end mass does."""
    options = {m: f'mass = "{m}"\n' for m in ("larger", "simplified", "projected")}
    stations = {m: flat(tmp_path / m, text, masses=(1.0, 9.0)) for m, text in options.items()}
    found = {m: regions_at(s, 0.5) for m, s in stations.items()}
    mu = {m: (240e4 * 1e-4 / found[m]["Chest"].limit) ** 2 / 25e3 for m in found}
    m_R = {m: 1 / (1 / x - 1 / 40) for m, x in mu.items()}
    assert m_R["simplified"] == pytest.approx(5.0, rel=1e-6)
    # Across a straight arm, at (2, ±0.05): the end mass of 9 kg.
    assert m_R["projected"] == pytest.approx(9.0, rel=0.01)
    assert m_R["larger"] == m_R["projected"]
    for parts in found.values():
        assert parts["M/2 + m_L"].value == pytest.approx(5.0, rel=1e-6)
        assert parts["m_u along the motion, heaviest part"].value >= 9.0 * 0.99


def test_load_counts_in_full(tmp_path: Path) -> None:
    tool = '[[tools]]\nname = "hand"\non = "arm/tip"\nshape = { sphere = 0.02 }\nmass = 3.0\n'
    found = regions_at(flat(tmp_path, more=tool), 0.5)
    assert found["M/2 + m_L"].value == pytest.approx(M_R + 3.0, rel=1e-6)


def test_robot_that_was_not_heard_is_undecided(tmp_path: Path) -> None:
    station = flat(tmp_path)
    result = judged(station.bound, Engine(station.model, driven={"arm": 0.2}).start())[0]
    assert (result.verdict, result.value) == (Verdict.UNDECIDED, None)
    assert "nothing heard" in result.reason


def test_robot_at_rest_hits_nobody(tmp_path: Path) -> None:
    result = results_at(flat(tmp_path), arm=(STRETCHED, [0, 0]))["pfl"]
    assert (result.verdict, result.reason) == (None, "no part moves")


# -- clamping -----------------------------------------------------------------------------------

WALL = '[[parts]]\nname = "wall"\nshape = { box = [1, 0.1, 1] }\nat = { position = [1.5, 0.3, 0] }\n'


def swing(station: Station, speed: float, q: float = 0.0) -> dict[str, Result]:
    """Two ticks of the straight arm turning about its base."""
    state = state_at(station, arm=([q, 0.0], [speed, 0]))
    judged(station.bound, state)
    state.engine.take([heard("arm", 0.01, [q + 0.01 * speed, 0.0], [speed, 0])])
    for _ in range(3):
        state = state.engine.tick()
        found = by_name(judged(station.bound, state)[0])
    return found


@pytest.mark.parametrize("speed", [0.2, -0.2])
def test_part_that_moves_in_a_narrow_gap_clamps_either_way(tmp_path: Path, speed: float) -> None:
    """Where the least distance opens, another place may close."""
    chest = swing(flat(tmp_path, 'mass = "simplified"', more=WALL), speed)["Chest"]
    assert ", clamped, arm/l2" in chest.reason


def test_clamped_is_the_static_limit_against_the_robots_mass_alone(tmp_path: Path) -> None:
    chest = swing(flat(tmp_path, 'mass = "simplified"', more=WALL), 0.2)["Chest"]
    assert chest.limit == pytest.approx(120e4 * 1e-4 / math.sqrt(M_R * 25e3), rel=1e-9)
    assert chest.reason == "pressure, clamped, arm/l2"


def test_clamped_contact_has_the_static_pressure(tmp_path: Path) -> None:
    options = 'mass = "simplified"\ncontact_radius = { arm = 0.003 }\nthickness = { "Abdomen" = 0.5 }'
    part = swing(cell(tmp_path, options, more=WALL), 0.2)["Abdomen"]
    # 10 N/mm / (π 3 mm) = 1.06 MPa: below 1.4 MPa until all of the ball is in.
    assert part.limit == pytest.approx(140e4 * math.pi * 0.003**2 / math.sqrt(M_R * 10e3), rel=1e-9)
    assert "clamped" in part.reason


def test_what_rests_on_a_gap_that_is_not_verified_says_so(tmp_path: Path) -> None:
    options = f'excluded = {KEPT}\nthickness = {{ "Neck" = 0.1 }}'
    station = flat(tmp_path, options)
    found = regions_at(station, 0.1)
    assert "not verified (M)" in found["Chest"].reason
    assert "not verified" not in found["Neck"].reason
    gaps = {
        i.name: (i.value, i.origin)
        for i in station.bound[0].basis.inputs
        if "clamped in gaps up to" in i.name
    }
    assert gaps["Chest: clamped in gaps up to"] == (0.5, Origin.ESTIMATED)
    assert gaps["Neck: clamped in gaps up to"] == (0.1, Origin.GIVEN)
    assert len(gaps) == 10
    opened = [i for i in station.bound[0].basis.inputs if "gets between parts of one robot" in i.name]
    assert {i.name.split(":")[0]: i.value for i in opened}["Chest"] == 0.18
    assert all("(M)" in i.source for i in opened)


def test_gap_wider_than_the_body_part_does_not_clamp_it(tmp_path: Path) -> None:
    found = swing(flat(tmp_path, more=WALL), 0.2)
    assert "clamped" in found["Neck"].reason
    assert "free" in found["Hands and fingers"].reason
    thick = swing(flat(tmp_path / "b", 'thickness = { "Hands and fingers" = 0.3 }', more=WALL), 0.2)
    assert "clamped" in thick["Hands and fingers"].reason


# -- a person -----------------------------------------------------------------------------------


def person(x: float) -> str:
    return (
        '[[humans]]\nname = "op"\nstature = 1.75\nmass = 75\nsex = "male"\n'
        f"at = {{ position = [{x}, 0, -1.0] }}\n"
    )


def test_only_regions_within_the_horizon_count(tmp_path: Path) -> None:
    station = flat(tmp_path, 'human = "op"\nhorizon = 0.2', more=person(2.25))
    found = regions_at(station, 0.1)
    assert "Abdomen" in found
    assert "Lower legs" not in found
    assert "Face" not in found
    far = flat(tmp_path / "far", 'human = "op"', more=person(6.0))
    result = results_at(far, arm=(STRETCHED, [0.1, 0]))["pfl"]
    assert (result.verdict, result.reason) == (None, "nobody within 0.5 m of a moving part")


def test_head_within_the_horizon_is_exceeded_without_a_number(tmp_path: Path) -> None:
    low = person(2.4).replace("-1.0]", "-1.6]")
    result = results_at(flat(tmp_path, 'human = "op"', more=low), arm=(STRETCHED, [0.01, 0]))["pfl"]
    assert result.verdict is Verdict.EXCEEDED
    assert (result.limit, by_name(result)["Face"].limit) == (None, None)
    assert "contact not permitted" in result.reason
    sensitive = by_name(result)["Larynx, eyes and ears"]
    assert (sensitive.verdict, sensitive.limit) == (Verdict.EXCEEDED, None)


def test_feet_within_the_horizon_are_undecided_and_not_taken_for_legs(tmp_path: Path) -> None:
    high = person(2.3).replace("-1.0]", "0.1]")
    found = regions_at(flat(tmp_path, 'human = "op"\nhorizon = 0.4', more=high), 0.01)
    assert (found["Feet"].verdict, found["Feet"].limit) == (Verdict.UNDECIDED, None)
    assert "Thighs and knees" not in found


def test_given_speed_of_the_person_adds_to_the_robots(tmp_path: Path) -> None:
    values = [
        regions_at(flat(tmp_path / str(v), f"person_speed = {v}"), 0.5)["Chest"].value for v in (0.0, 0.7)
    ]
    assert values[1] - values[0] == pytest.approx(0.7, rel=1e-9)


def test_persons_own_motion_is_left_out_until_a_speed_is_given(tmp_path: Path) -> None:
    """A named person who stands still is observed with 0 m/s."""
    for folder, options, left_out in (
        ("a", 'human = "op"', True), ("b", "", True), ("c", 'human = "op"\nperson_speed = 1.6', False),
    ):  # fmt: skip
        basis = flat(tmp_path / folder, options, more=person(2.25)).bound[0].basis
        assert any("the person's own motion" in text for text in basis.not_modelled) == left_out


def test_basis_has_the_options_and_the_mass_that_moves(tmp_path: Path) -> None:
    options = 'human = "op"\nhorizon = 0.3\nperson_speed = 1.2\nmultiplier = 1.5'
    inputs = {i.name: i for i in flat(tmp_path, options, more=person(2.25)).bound[0].basis.inputs}
    assert (inputs["horizon"].value, inputs["person_speed"].value) == (0.3, 1.2)
    multiplier = inputs["Chest: transient multiplier"]
    assert (multiplier.value, multiplier.origin) == (1.5, Origin.GIVEN)


def test_marker_never_shows_an_exceeded_speed_as_equal(tmp_path: Path) -> None:
    station = flat(tmp_path, f'mass = "simplified"\nexcluded = {KEPT}')
    least = min(p.limit for p in regions_at(station, 0.5).values() if p.limit)
    corner = math.hypot(2, 0.05) / 2
    result = results_at(station, arm=(STRETCHED, [(least + 1e-6) / corner / 2, 0]))["pfl"]
    value, _, limit = result.markers[0].label.partition(": ")[2].replace(" m/s", "").partition(" of ")
    assert result.verdict is Verdict.EXCEEDED
    assert float(value) > float(limit)


# -- options, edition, own table ----------------------------------------------------------------


def test_own_table_replaces_the_figures(tmp_path: Path) -> None:
    text = files("seerob.description.norms").joinpath(SHIPPED).read_text("utf-8")
    tmp_path.joinpath("mine.toml").write_text(
        text.replace('pressure = [120, "2S", "U T S"]', 'pressure = [60, "own", "T"]'), encoding="utf-8"
    )
    station = flat(tmp_path, 'limits = "mine.toml"\nmass = "simplified"')
    assert round(regions_at(station, 0.5)["Chest"].limit, 4) == round(1.5369 / 2, 4)
    assert all(i.origin is Origin.GIVEN for i in station.bound[0].basis.inputs if "p_s" in i.name)


def test_multiplier_may_be_lowered_and_not_raised(tmp_path: Path) -> None:
    limit = regions_at(flat(tmp_path / "1", 'multiplier = 1.0\nmass = "simplified"'), 0.5)["Chest"].limit
    assert round(limit, 3) == round(1.537 / 2, 3)
    with pytest.raises(InputError, match="multiplier"):
        flat(tmp_path / "2", "multiplier = 2.5")


@pytest.mark.parametrize(
    ("options", "word"),
    [
        ('human = "nobody"', "nobody"),
        ('excluded = ["Nose"]', "Nose"),
        ("thickness = { Nose = 0.1 }", "Nose"),
        ("contact_radius = { gripper = 0.01 }", "gripper"),
        ("contact_radius = { 'arm' = -0.01 }", "contact_radius"),
        ('limits = "none.toml"', "none.toml"),
        ("largest_area = 2e-4", "largest_area"),
    ],
)
def test_what_cannot_be_is_named_before_the_run(tmp_path: Path, options: str, word: str) -> None:
    with pytest.raises(InputError, match=word):
        _ = cell(tmp_path, options).bound


def test_edition_of_2025_uses_the_figures_of_2016_and_says_so(tmp_path: Path) -> None:
    old = flat(tmp_path / "a")
    new = flat(tmp_path / "b", head='edition = "ISO 10218-2:2025"\n')
    assert regions_at(old, 0.5)["Chest"].limit == regions_at(new, 0.5)["Chest"].limit
    assert not any("Annex M" in text for text in old.bound[0].basis.not_modelled)
    assert any("not known row by row" in text for text in new.bound[0].basis.not_modelled)
    source = next(i.source for i in new.bound[0].basis.inputs if i.name == "limits")
    assert "ISO/TS 15066:2016" in source
    assert "ISO 10218-2:2025" in source


def test_basis_says_that_measurement_is_needed_and_where_every_limit_is_from(tmp_path: Path) -> None:
    basis = flat(tmp_path).bound[0].basis
    assert any("measurement" in text for text in basis.not_modelled)
    force = next(i for i in basis.inputs if i.name == "Chest: F_s")
    assert (force.value, force.unit) == (140, "N")
    assert "Table A.2" in force.source
    assert "(2S)" in force.source


def test_result_is_a_function_of_the_state(tmp_path: Path) -> None:
    station = flat(tmp_path, more=WALL)
    state = state_at(station, arm=([0.0, 0.3], [0.4, 0.2]))
    assert judged(station.bound, state) == judged(station.bound, state)


def test_faster_is_never_better(tmp_path: Path) -> None:
    station = flat(tmp_path, f"excluded = {KEPT}")
    margins = [
        min(p.limit - p.value for p in regions_at(station, v, [0.2, 0.7]).values() if p.limit)
        for v in np.linspace(0.1, 3, 6)
    ]
    assert (np.diff(margins) < 0).all()
