"""Edges of limits, signs and units, one by one: each of these fails when that one thing is changed.

What `scripts/mutate` found that no other test would have noticed.
"""

from __future__ import annotations

from dataclasses import replace
from importlib.resources import files

import numpy as np
import pytest

from made_cell import FLOATING, TWO_R, made, results_at, state_at, two_r
from seerob.core.errors import InputError
from seerob.core.snapshot import Verdict
from seerob.core.tolerances import Spread
from seerob.core.verdict import judge, judge_interval, worst
from seerob.criteria.contact.collision import speed_at_force
from seerob.criteria.contact.limits import Judged, RegionArrays, area_verdict, ranks
from seerob.criteria.contact.rows import area_results
from seerob.criteria.contact.shape import ContactShape, force_at_pressure
from seerob.criteria.judging import Judge
from seerob.criteria.safety.effective_mass import inverse_effective_mass, principal_masses
from seerob.criteria.safety.manipulability import Manipulability, singular_values
from seerob.criteria.safety.minimum_distance import MinimumDistance
from seerob.criteria.safety.separation import Separation
from seerob.criteria.stopping.terms import assumed_speed
from seerob.description.norms.body_limits import SHIPPED, parse, shipped
from seerob.description.norms.iso_13855 import Approach, Edition, intrusion, minimum_distance
from seerob.kernels.separation import approach_speeds
from seerob.recording.answers import judge_many
from seerob.recording.series import CODES
from seerob.twin import joint_torques

TEXT = files("seerob.description.norms").joinpath(SHIPPED).read_text("utf-8")
WITHIN, EXCEEDED, UNDECIDED = Verdict.WITHIN, Verdict.EXCEEDED, Verdict.UNDECIDED
EXCLUDED = '"Skull and forehead", "Face", "Larynx, eyes and ears", "Feet"'


def test_judging_a_number_an_interval_and_a_whole():
    assert judge(float("nan"), 1.0) is judge(float("nan"), None) is UNDECIDED
    # A figure that is its limit but for rounding is beyond it, a score on its limit is not.
    assert [judge(x, 1.0) for x in (1 - 2e-9, 1 - 1e-10, 1.0, 1)] == [WITHIN, EXCEEDED, EXCEEDED, WITHIN]
    above = [judge(x, 1.0, at_most=False) for x in (1 + 2e-9, 1 + 1e-10, 1.0, np.int64(1))]
    assert above == [WITHIN, EXCEEDED, EXCEEDED, WITHIN]
    # A share of large limits, of small ones a share of the unit; an infinite one is kept by what is finite.
    assert [judge(x, 1e6) for x in (1e6 - 2e-3, 1e6 - 1e-4)] == [WITHIN, EXCEEDED]
    assert [judge(x, 0.0, at_most=False) for x in (2e-9, 1e-10)] == [WITHIN, EXCEEDED]
    assert judge(5.0, np.inf) is WITHIN
    for limit, at_most in ((1.0, True), (0.0, False), (1e6, True), (-3.0, False), (np.inf, True)):
        near = limit + np.array([-2e-3, -1e-4, -2e-9, -1e-10, 0.0, 1e-10, 2e-9, 1e-3, np.nan])
        told = judge_many(near, limit, at_most=at_most).tolist()
        assert told == [CODES[judge(x, limit, at_most=at_most)] for x in near.tolist()]
    ends = ((0, 1), (0.5, 1.5), (1.1, 2), (0.5, 1.0))
    assert [judge_interval(e, 1.0) for e in ends] == [WITHIN, UNDECIDED, EXCEEDED, UNDECIDED]
    assert judge_interval((0, 1), None) is None
    assert worst([WITHIN, None, UNDECIDED, EXCEEDED]) is EXCEEDED
    assert worst([WITHIN, None, UNDECIDED]) is UNDECIDED
    assert worst([None, WITHIN]) is WITHIN
    assert worst([None]) is None


def test_limits_that_bound_from_below_say_so():
    assert [kind.at_most for kind in (Manipulability, MinimumDistance, Separation)] == [False] * 3


# -- the table of limits --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("quantity", "unit", "si"),
    [
        ("pressure", "Pa", 1.0),
        ("pressure", "kPa", 1e3),
        ("pressure", "N/cm2", 1e4),
        ("pressure", "MPa", 1e6),
        ("stiffness", "N/m", 1.0),
        ("stiffness", "N/mm", 1e3),
        ("force", "N", 1.0),
        ("mass", "kg", 1.0),
        ("energy", "J", 1.0),
    ],
)
def test_units_of_a_table(quantity, unit, si):
    """Who answers for odd figures may have them; 140 of any unit is 140 of that unit."""
    import re

    text = re.sub(rf'^{quantity} = "[^"]+"', f'{quantity} = "{unit}"', TEXT, flags=re.MULTILINE)
    table = parse(f'reviewed_by = "somebody"\n{text}'.encode(), file="mine.toml")
    given = shipped().regions["Chest"]
    pairs = {
        "pressure": (table.regions["Chest"].areas[0].pressure.value, given.areas[0].pressure.value / 1e4),
        "stiffness": (table.regions["Chest"].stiffness.value, given.stiffness.value / 1e3),
        "force": (table.regions["Chest"].force.value, given.force.value),
        "mass": (table.regions["Chest"].mass.value, given.mass.value),
        "energy": (table.regions["Chest"].energy.value, given.energy.value),
    }
    ours, figure = pairs[quantity]
    assert ours == pytest.approx(figure * si)


@pytest.mark.parametrize(
    ("old", "low", "high", "range_"),
    [
        ("pressure = [140, ", 60, 300, r"600000 to 3e\+06 Pa"),
        ("force = [150, ", 50, 250, "50 to 250 N"),
        ("stiffness = [50, ", 5, 200, "5000 to 200000 N/m"),
        ("mass = [1.2, ", 0.3, 100, "0.3 to 100 kg"),
        ("energy = [0.84, ", 0.05, 5, "0.05 to 5 J"),
    ],
)
def test_figures_are_plausible_up_to_their_edges_and_not_beyond(old, low, high, range_):
    """Pressures below 60 and above 300 N/cm² are a wrong column or a wrong unit."""
    assert old in TEXT
    for figure in (low, high):
        parse(TEXT.replace(old, f"{old.split('[')[0]}[{figure}, ", 1).encode(), file="mine.toml")
    for figure, said in ((low * 0.99, range_), (high * 1.01, range_), (0, "above 0")):
        with pytest.raises(InputError, match=f"{said}(:|;|$)"):
            parse(TEXT.replace(old, f"{old.split('[')[0]}[{figure}, ", 1).encode(), file="mine.toml")


@pytest.mark.parametrize(("factor", "kept"), [(1, True), (2, True), (0.999, False), (2.001, False)])
def test_transient_limits_are_once_to_twice_the_static_ones(factor, kept):
    raw = TEXT.replace("multiplier = [2,", f"multiplier = [{factor},", 1).encode()
    if kept:
        assert parse(raw, file="mine.toml").regions["Neck"].multiplier.value == factor
    else:
        with pytest.raises(InputError, match="never raised"):
            parse(raw, file="mine.toml")


# -- contact --------------------------------------------------------------------------------------


def test_speeds_of_free_and_clamped_contact_by_hand():
    arrays = RegionArrays.of(shipped())
    k = [region.name for region in arrays.regions].index("Hands and fingers")
    forces = np.full((1, 2, len(arrays.regions)), 1e9)
    for clamped in (False, True):
        found = arrays.speeds(np.array([8.641]), forces, np.full((1, len(arrays.regions)), clamped))
        mu = 8.641 if clamped else 1 / (1 / 0.6 + 1 / 8.641)
        F = 140.0 if clamped else 280.0
        assert found.mu[0, k] == pytest.approx(mu)
        assert found.force[0, k] == pytest.approx(F / np.sqrt(mu * 75e3))
        energy = 140**2 / 150e3 if clamped else 0.49
        assert found.energy[0, k] == pytest.approx(np.sqrt(2 * energy / mu))
        assert found.pressure[0, k] == pytest.approx(1e9 / np.sqrt(mu * 75e3))


def shape(*radii):
    flat = np.array(radii, float).reshape(-1, 2)
    return ContactShape(np.zeros((len(flat), 3)), flat)


def test_a_flat_contact_is_credited_with_its_cap_and_many_patches_with_the_least():
    arrays, cap = RegionArrays.of(shipped()), 1e-4
    np.testing.assert_allclose(arrays.pressure_force(shape((np.inf, np.inf)), cap), arrays.pressures() * cap)
    patches = [(0.02, 0.3), (0.03, 0.02), (0.01, 0.9), (0.05, 0.05), (0.05, 0.01), (0.2, 0.2)]
    each = [
        force_at_pressure(np.array([[[sorted(p)]]]), arrays.pressures(), arrays.stiffness[arrays.owner], cap)
        for p in patches
    ]
    least = np.min([np.reshape(force, arrays.pressures().shape) for force in each], axis=0)
    np.testing.assert_allclose(arrays.pressure_force(shape(*patches), cap), least, rtol=1e-12)


def test_a_sharp_patch_is_not_hidden_by_one_that_is_longer_and_narrower():
    arrays, cap = RegionArrays.of(shipped()), 1e-4
    long, round_ = (arrays.pressure_force(shape(radii), cap) for radii in ((0.003, 0.9), (0.005, 0.006)))
    assert (round_ < long).any()
    both = arrays.pressure_force(shape((0.003, 0.9), (0.005, 0.006)), cap)
    np.testing.assert_array_equal(both, np.minimum(long, round_))


PLACED = """
[[robots]]
name = "arm"
model = "arm.urdf"
base = {{ {base}, rpy_deg = [0, 0, {turn}] }}
[[parts]]
name = "ball"
shape = {{ sphere = 0.1 }}
at = {{ {ball} }}
[[safety]]
kind = "minimum_distance"
name = "gap"
between = ["arm", "ball"]
{limit}
[[safety]]
kind = "velocity"
name = "speed"
at = "arm"
{fastest}
"""


@pytest.mark.parametrize("deviation", [0.0, 1e-6])
@pytest.mark.parametrize("unit", ["", "_mm"])
@pytest.mark.parametrize(("turn", "shift"), [(0.0, 0.0), (37.0, 0.1), (90.0, 1 / 3), (200.0, 7.7)])
def test_on_its_limit_a_figure_is_beyond_it_wherever_the_cell_stands(tmp_path, turn, shift, unit, deviation):
    """The arm of 2 m, a ball of 0.1 m 0.7 m before its end, and 2 m/s at 1 rad/s."""
    yaw, scale = np.radians(turn), 1000.0 if unit else 1.0
    ball = scale * (shift + (2.0 + 0.7 + deviation + 0.1) * np.array([np.cos(yaw), np.sin(yaw)]))
    text = PLACED.format(
        base=f"position{unit} = [{scale * shift!r}, {scale * shift!r}, 0]",
        ball=f"position{unit} = [{ball[0].item()!r}, {ball[1].item()!r}, 0]",
        turn=turn,
        limit=f"limit{unit} = {scale * 0.7!r}",
        fastest=f"limit{'_mm_s' if unit else ''} = {scale * (2.0 + deviation)!r}",
    )
    told = results_at(made(tmp_path, FLOATING + text, {"arm.urdf": two_r()}), arm=([0, 0], [1.0, 0.0]))
    assert told["gap"].value == pytest.approx(0.7 + deviation, abs=1e-12)
    assert told["speed"].value == pytest.approx(2.0, abs=1e-12)
    assert {told[name].verdict for name in told} == {WITHIN if deviation else EXCEEDED}


def test_what_is_least_permitted():
    arrays = RegionArrays.of(shipped())
    n = len(arrays.regions)
    speeds = arrays.speeds(np.array([4.0]), np.full((1, 2, n), 1e9), np.zeros((1, n), bool))
    ends = Spread(speeds.permissible * 0.9, speeds.permissible, np.zeros((0, 1, n)))
    none = np.zeros((1, n), bool)
    judged = Judged(
        np.ones(1), np.ones(1, bool), np.zeros(n), none, np.ones(1), speeds, none, np.zeros(n), np.zeros(n)
    )
    assert judged.least is speeds.permissible
    assert replace(judged, ends=ends).least is ends.low


def test_ranks_on_and_beside_the_permissible_speed():
    arrays = RegionArrays.of(shipped())
    n = len(arrays.regions)
    speeds = arrays.speeds(np.array([4.0]), np.full((1, 2, n), 1e9), np.zeros((1, n), bool))
    v = speeds.permissible
    below = v - 1e-8
    assert (ranks(below, speeds, None) == 0).all()
    assert (ranks(v, speeds, None) == 2).all()
    unknown = replace(speeds, pressure=np.full_like(v, np.nan))
    assert (ranks(below, unknown, None) == 1).all()
    assert (ranks(v, unknown, None) == 2).all()
    assert (ranks(np.full_like(v, np.nan), speeds, None) == 1).all()
    ends = Spread(v * 0.9, v * 1.1, np.zeros((0, 1, n)))
    got = [int(ranks(v * f, speeds, ends)[0, 0]) for f in (0.899999, 0.9, 1.0, 1.099999, 1.1)]
    assert got == [0, 1, 1, 1, 2]
    assert area_verdict(WITHIN, EXCEEDED, None) is WITHIN
    assert area_verdict(WITHIN, EXCEEDED, ends) is area_verdict(EXCEEDED, UNDECIDED, ends) is UNDECIDED
    assert area_verdict(WITHIN, WITHIN, ends) is WITHIN


def test_areas_on_and_beside_the_speed_that_each_allows():
    arrays = RegionArrays.of(shipped())
    n, column = (
        len(arrays.regions),
        next(k for k, region in enumerate(arrays.regions) if region.name == "Hands and fingers"),
    )
    speeds = arrays.speeds(np.array([4.0]), np.full((1, 2, n), 1e9), np.zeros((1, n), bool))
    judged = Judged(
        v_r=np.ones(1), moves=np.ones(1, bool), v_h=np.zeros(n), near=np.ones((1, n), bool),
        projected=np.ones(1), speeds=speeds,
        clamped=np.zeros((1, n), bool), rows=np.zeros(n, int), ranks=np.zeros(n),
    )  # fmt: skip

    def areas(v, force=1e9, unknown="", ends=None, whole=WITHIN):
        forces = np.full((arrays.owner == column).sum(), force)
        pressed = speed_at_force(forces, speeds.mu[0, column], arrays.stiffness[column]).tolist()
        return area_results(
            arrays, pressed, (0, column), replace(judged, ends=ends), whole=whole, unknown=unknown, v=v
        )

    limit = float(min(speeds.force[0, column], speeds.energy[0, column]))
    pressed = 50.0 / np.sqrt(speeds.mu[0, column] * 75e3)
    for force, allowed in ((1e9, limit), (50.0, pressed), (np.nan, limit)):
        np.testing.assert_allclose([found.limit for found in areas(limit, force)], allowed, rtol=1e-12)
    (allowed,) = {found.limit for found in areas(1.0, 50.0)}
    for v, verdict in ((allowed - 2e-9, WITHIN), (allowed, EXCEEDED)):
        told = {(found.value, found.unit, found.verdict, found.reason) for found in areas(v, 50.0)}
        assert told == {(v, "m/s", verdict, "")}
    for v, verdict, reason in ((limit - 2e-9, UNDECIDED, "a mesh"), (limit, EXCEEDED, "")):
        assert {(f.verdict, f.reason) for f in areas(v, np.nan, "a mesh")} == {(verdict, reason)}
    ends = Spread(speeds.permissible, speeds.permissible, np.zeros((0, 1, n)))
    for unknown, reason in (("", "decided as its region is"), ("a mesh", "a mesh")):
        found = areas(limit - 2e-9, 1e9, unknown, ends, UNDECIDED)
        assert {(f.verdict, f.reason) for f in found} == {(UNDECIDED, reason)}


def contact(
    folder,
    options="",
    *,
    speed=1.0,
    more="",
    area="contact_area = { arm = 1e-4 }\n",
):
    text = FLOATING + TWO_R + more
    text += f'[[safety]]\nkind = "power_and_force"\nname = "it"\nrobot = "arm"\n{area}{options}\n'
    station = made(folder, text, {"arm.urdf": two_r(masses=(4, 4))})
    return results_at(station, arm=((0.0, 0.0), (speed, 0.0)))["it"]


def test_a_large_area_is_credited_up_to_the_cap_only(tmp_path):
    out = f"excluded = [{EXCLUDED}]"
    one, five = (
        contact(tmp_path / a, out, area=f"contact_area = {{ arm = {a} }}\n") for a in ("1e-4", "5e-4")
    )
    assert [part.limit for part in one.parts] == [part.limit for part in five.parts]


def test_who_comes_nearer_decides_with_the_robot(tmp_path):
    """At 0.9 of what the chest permits a person at 0.2 of it makes the sum exceed."""
    out = f"excluded = [{EXCLUDED}]\n"
    slow = contact(tmp_path / "a", out, speed=0.05)
    chest = next(part for part in slow.parts if part.name == "Chest")
    speed = 0.05 * 0.9 * chest.limit / chest.value
    alone = contact(tmp_path / "b", out, speed=speed)
    met = contact(tmp_path / "c", f"{out}person_speed = {0.2 * chest.limit}", speed=speed)
    verdicts = [next(part.verdict for part in r.parts if part.name == "Chest") for r in (alone, met)]
    assert verdicts == ["within", "exceeded"]
    assert met.verdict == "exceeded"


def test_the_whole_shows_the_region_with_the_least_margin(tmp_path):
    out = f"excluded = [{EXCLUDED}]"
    for speed in (0.1, 3.0):
        found = contact(tmp_path / str(speed), out, speed=speed)
        margins = [
            p.limit - p.value for p in found.parts if p.limit is not None and p.verdict == found.verdict
        ]
        assert found.limit - found.value == min(margins)


def test_areas_whose_pressure_is_not_known_are_open_with_the_reason(tmp_path):
    found = contact(tmp_path, f"excluded = [{EXCLUDED}]", area="", speed=0.1)
    areas = [area for part in found.parts for area in part.parts]
    assert areas
    assert {area.verdict for area in areas} == {"undecided"}
    assert all(area.reason for area in areas)


def test_another_robot_that_nobody_hears_leaves_clamping_open(tmp_path):
    text = FLOATING + TWO_R + TWO_R.replace('"arm"', '"other"')
    text += '[[safety]]\nkind = "power_and_force"\nname = "it"\nrobot = "arm"\n'
    station = made(tmp_path, text, {"arm.urdf": two_r(masses=(4, 4))})
    state = state_at(station, arm=((0.0, 0.0), (1.0, 0.0)))
    state.hearings["other"].given = False
    (found,) = Judge(station.bound)(state)
    assert found.verdict == "undecided"
    assert "other" in found.reason


# -- separation -----------------------------------------------------------------------------------


@pytest.mark.parametrize("edition", Edition)
def test_fields_of_40_mm_are_fine_ones(edition):
    found = intrusion(Approach.ORTHOGONAL, edition, capability=0.040)
    assert found.value == pytest.approx(0.208)
    assert "do not agree" not in found.note
    coarse = intrusion(Approach.ORTHOGONAL, edition, capability=0.050)
    assert (coarse.value, "do not agree" in coarse.note) == (0.85, edition is Edition.E2024)


@pytest.mark.parametrize("T", [float("inf"), float("nan"), -0.1])
def test_a_time_that_is_none_is_refused(T):
    with pytest.raises(InputError, match="time"):
        minimum_distance(Approach.ORTHOGONAL, Edition.E2010, T, capability=0.03, over=0.0, under=0.0)


def test_people_walk_from_half_a_metre_on():
    found = np.empty(4)
    approach_speeds(np.array([0.0, np.nextafter(0.5, 0), 0.5, 9.0]), assumed_speed(None), 0.0, found)
    assert found.tolist() == [2.0, 2.0, 1.6, 1.6]


@pytest.mark.parametrize("mode", ["dynamic", "fixed"])
@pytest.mark.parametrize("speed", ["", "human_speed = 1.6\n"])
def test_terms_shown_sum_to_the_separation_distance_shown(tmp_path, mode, speed):
    """Also of a robot that has become slower since, in the fixed mode."""
    text = FLOATING + TWO_R + '[[humans]]\nname = "op"\nstature = 1.75\nmass = 75\nsex = "male"\n'
    text += 'at = { position = [6, 0, -1] }\n[[safety]]\nkind = "separation"\nname = "S"\n'
    text += 'between = ["arm", "op"]\nstop = { acceleration = 0, reaction = 0.1, stopping = 0.3 }\n'
    text += "intrusion = 0.2\n"
    text += f'human_uncertainty = 0.1\nrobot_uncertainty = 0.05\nmode = "{mode}"\n{speed}'
    station = made(tmp_path, text, {"arm.urdf": two_r()})
    state = state_at(station, arm=((0.0, 0.0), (1.0, 0.0)))
    judge_it = Judge(station.bound)
    (first,) = judge_it(state)
    state.data.qvel[:] *= 0.5
    state.refresh(0.0)
    (second,) = judge_it(state)
    assert (second.limit == first.limit) == (mode == "fixed")
    for result in (first, second):
        terms = {
            part.name: part.value
            for part in result.parts
            if part.name in ("S_h", "S_r", "S_s", "C", "Z_d", "Z_r")
        }
        assert sum(terms.values()) == pytest.approx(result.limit, abs=1e-12)
        assert (terms["C"], terms["Z_d"], terms["Z_r"]) == (0.2, 0.1, 0.05)
        assert all(part.at_most is False for part in result.parts if part.limit is not None)


# -- points ---------------------------------------------------------------------------------------


def test_axes_of_a_batch_are_those_of_each():
    rng = np.random.default_rng(5)
    J = rng.normal(size=(2, 4, 3, 6))
    M = np.eye(6) * rng.uniform(1, 2, (2, 4, 1, 1))
    sigma, _ = singular_values(J)
    masses, _ = principal_masses(inverse_effective_mass(J, M))
    for i in np.ndindex(2, 4):
        np.testing.assert_allclose(sigma[i], np.linalg.svd(J[i], compute_uv=False), rtol=1e-12)
        inverse = J[i] @ np.linalg.inv(M[i]) @ J[i].T
        np.testing.assert_allclose(masses[i], 1 / np.linalg.eigvalsh(inverse)[::-1], rtol=1e-9)


def test_a_slow_motion_has_a_direction_and_its_mass_is_drawn_at_the_point(tmp_path):
    text = (
        FLOATING
        + TWO_R
        + '[[safety]]\nkind = "effective_mass"\nname = "m"\nat = "arm/l2"\noffset = [0.5, 0.1, 0]\n'
    )
    station = made(tmp_path, text, {"arm.urdf": two_r()})
    found = results_at(station, arm=((0.0, np.pi / 2), (0.005, 0.0)))["m"]
    assert found.value is not None
    ellipsoid, arrow = found.markers
    assert ellipsoid.center == pytest.approx((1 - 0.1, 0.5, 0))
    assert arrow.origin == pytest.approx((1 - 0.1, 0.5, 0))
    *_, simplified = found.parts
    assert simplified.value == pytest.approx(1.0)  # M/2 + m_L, which is drawn 0.1 m long
    assert np.linalg.norm(arrow.vector) == pytest.approx(0.1 * found.value)


def test_an_acceleration_needs_two_evaluations_within_50_ms():
    assert joint_torques.LONGEST == 0.05
