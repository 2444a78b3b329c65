"""Formulas refuse what cannot be, and what is not a number never comes out as the least."""

from __future__ import annotations

import dataclasses
import importlib
import inspect
import math
import pkgutil

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from seerob.core.domains import number, whole
from seerob.core.errors import SeerobError
from seerob.criteria.contact import collision
from seerob.criteria.contact.limits import robot_masses
from seerob.criteria.ergonomics import eaws_posture, niosh, owas, reba, rula
from seerob.criteria.ergonomics.eaws_posture import HeldTimes
from seerob.criteria.safety.separation import separation_bound
from seerob.criteria.scoring import held_work, spans
from seerob.criteria.stopping import terms
from seerob.description.norms import iso_13855

END = niosh.End(H=0.3, V=0.8)
NEGATIVE = st.floats(max_value=-1e-6, allow_nan=False)
NOT = st.one_of(NEGATIVE, st.just(math.nan), st.just(-math.inf))
"""What no length, mass, time, share or speed is."""


def lifted(**changed):
    task = {"average": 5.0, "heaviest": 8.0, "origin": END, "destination": END, "control": False}
    task |= {"frequency": 1.0, "grip": niosh.Grip.GOOD}
    return niosh.composite_index([niosh.Task(**{**task, **changed})], niosh.Duration.SHORT)


def minimum(**given):
    return iso_13855.minimum_distance("orthogonal", "2024", **{"time": 0.5, "over": 0, "under": 0, **given})


REFUSES = {
    "niosh H": lambda x: lifted(origin=niosh.End(H=x, V=0.8)),
    "niosh V": lambda x: lifted(origin=niosh.End(H=0.3, V=x)),
    "niosh average": lambda x: lifted(average=x),
    "niosh heaviest": lambda x: lifted(heaviest=x),
    "niosh frequency": lambda x: lifted(frequency=x),
    "niosh recovery": lambda x: niosh.duration(3600, x),
    "niosh work": lambda x: niosh.duration(x, 3600),
    "niosh D": lambda x: niosh.distance_multiplier([0.3, x]),
    "reba load": lambda x: reba.load(x, False),
    "rula load": lambda x: rula.force(x, rula.LoadUse.STATIC, rula.Profile.WORKSHEET),
    "owas load": owas.load_codes,
    "eaws share": lambda x: eaws_posture.line_points("2", x),
    "eaws asymmetry": lambda x: eaws_posture.asymmetry_points((0.5, 0.2, x)),
    "hold": lambda x: held_work.static([0.0, 1.0], [1, 1], x),
    "window": lambda x: held_work.repetitions([0.0, 1.0], [1, 2], window=x),
    "iso 13855 over": lambda x: minimum(over=x, supplement=0.1),
    "iso 13855 supplement": lambda x: minimum(supplement=x),
    "iso 13855 time": lambda x: minimum(time=x, supplement=0.1),
    "S_p v_h": lambda x: separation_bound(np.array([1.0]), x, 0.1, 0.5, 0.2),
    "S_p T_r": lambda x: separation_bound(np.array([1.0]), 1.6, x, 0.5, 0.2),
    "S_p T_s": lambda x: separation_bound(np.array([1.0]), 1.6, 0.1, x, 0.2),
    "S_p xi": lambda x: separation_bound(np.array([1.0]), 1.6, 0.1, 0.5, x),
    "course T_r": lambda x: terms.course(np.array([1.0]), x, 0.5),
    "course T_s": lambda x: terms.course(np.array([1.0]), 0.1, x),
    "decelerating a": lambda x: terms.decelerating(1.0, 1.6, 0.1, x, 0.2),
    "inverse a": lambda x: terms.largest_speed_decelerating(1.0, 1.6, 0.1, x, 0.2),
    "inverse T_s": lambda x: terms.largest_speed_in_time(1.0, 1.6, 0.1, x, 0.2),
    "A.3": lambda x: collision.reduced_mass(x, 10.0),
    "A.4": lambda x: collision.robot_mass(x, 1.0),
    "A.1": lambda x: collision.spring_energy(100.0, x),
    "A.5": lambda x: collision.speed_at_force(100.0, 5.0, x),
    "A.6": lambda x: collision.speed_at_pressure(1e6, x, 5.0, 75e3),
    "speed of an energy": lambda x: collision.speed_at_energy(x, 5.0),
}


@pytest.mark.parametrize("name", REFUSES)
@settings(max_examples=12, deadline=None)
@given(x=NOT)
def test_what_cannot_be_is_refused(name, x):
    with pytest.raises((ValueError, SeerobError)):
        REFUSES[name](x)


SCORES = {
    "rula": (rula.rula, list(zip(rula.LEAST.values(), rula.MOST.values(), strict=True))),
    "reba": (reba.reba, list(zip(reba.LEAST.values(), reba.MOST.values(), strict=True))),
    "owas": (owas.owas, [(1, most) for most in owas.CODES.values()]),
}


@pytest.mark.parametrize("method", SCORES)
@settings(max_examples=40, deadline=None)
@given(data=st.data())
def test_scores_that_a_method_does_not_have_are_refused_and_all_others_are_taken(method, data):
    score, ranges = SCORES[method]
    good = [data.draw(st.integers(low, high)) for low, high in ranges]
    score(*good)
    k = data.draw(st.integers(0, len(ranges) - 1))
    low, high = ranges[k]
    bad = data.draw(
        st.one_of(st.integers(-9, low - 1), st.integers(high + 1, 99), st.just(math.nan), st.just(low + 0.5))
    )
    with pytest.raises(ValueError, match=f"{low} to {high}"):
        score(*good[:k], bad, *good[k + 1 :])


BANDS = {
    "rula upper arm": (rula.upper_arm, 4),
    "rula lower arm": (rula.lower_arm, 2),
    "rula neck": (lambda x: rula.neck(x, 0.1), 4),
    "rula trunk": (lambda x: rula.trunk(x, 0.1), 4),
    "rula wrist": (lambda x: rula.wrist(x, 0.1), 3),
    "reba upper arm": (reba.upper_arm, 4),
    "reba lower arm": (reba.lower_arm, 2),
    "reba neck": (lambda x: reba.neck(x, 0.1), 2),
    "reba trunk": (lambda x: reba.trunk(x, 0.1), 4),
    "reba wrist": (reba.wrist, 2),
    "reba knees": (reba.knees, 2),
}


@pytest.mark.parametrize("name", BANDS)
def test_an_angle_that_is_not_a_number_scores_most(name):
    score, most = BANDS[name]
    assert score(np.array([math.nan])).tolist() == [most]


@pytest.mark.parametrize(("which", "known"), [(0, False), (1, True), (2, False)])
@given(speeds=st.lists(st.floats(0.01, 2.0), min_size=3, max_size=3))
@settings(max_examples=20, deadline=None)
def test_no_speed_is_permitted_by_what_is_not_a_number_but_where_the_area_is_unknown(which, known, speeds):
    speeds[which] = math.nan
    found, _ = collision.permissible_speed(*speeds)
    assert np.isfinite(found) == known


def test_instants_increase_and_are_numbers():
    for t in ([0.0, 0.0], [1.0, 0.5], [0.0, math.nan]):
        with pytest.raises(ValueError, match="instant"):
            held_work.static(t, [1, 1], 1.0)
    with pytest.raises(ValueError, match="instant"):
        HeldTimes([1.0]).add(np.array([math.nan]), np.array([[True]]))


def test_editions_are_not_guessed():
    with pytest.raises(ValueError, match="2031"):
        iso_13855.intrusion("orthogonal", "2031", capability=0.03)
    # A text is the edition that it names, not the other one.
    assert iso_13855.intrusion("parallel", "2024", capability=0.05, height=0.8).value == iso_13855.FLOOR
    assert iso_13855.intrusion("parallel", "2010", capability=0.05, height=0.8).value < iso_13855.FLOOR


def test_the_message_says_what_is_wrong_and_what_would_be_right():
    with pytest.raises(ValueError, match=r"H is -0\.1 m, it is 0 or more m"):
        number("H", [0.2, -0.1], 0, unit="m")
    with pytest.raises(ValueError, match=r"neck is 2\.5, it is a whole number, 1 to 3"):
        whole("neck", 2.5, 1, 3)
    with pytest.raises(ValueError, match=r"x is nan, it is a number"):
        number("x", math.nan)


# -- every formula of the judging packages ---------------------------------------------------------

WALKED = ("criteria", "description.norms", "core.transforms")
NUMBERS = {"float", "int", "Array", "ArrayLike", "Array | float", "ArrayLike | None", "Sequence[float]"}
J = np.array([[1.0, 0.5], [0.2, 1.0], [0.1, 0.3]])
M = np.array([[2.0, 0.3], [0.3, 1.0]])
TWO = np.array([1.0, 2.0])
HALF = np.array([0.5])
POSE = np.eye(4)
RULA = dict(zip(inspect.signature(rula.rula).parameters, rula.LEAST.values(), strict=True))
REBA = dict(zip(inspect.signature(reba.reba).parameters, reba.LEAST.values(), strict=True))
BOXED = {"J_v": np.eye(3) + 0.1, "low": -np.ones(3), "high": np.ones(3)}
CALLS = {
    "criteria.safety.effective_mass.inverse_effective_mass": {"J_v": J, "M": M},
    "criteria.safety.separation.room_ends": {
        "near": np.array([1.0]),
        "far": np.array([1.1]),
        "S_p": np.array([0.5]),
        "more": np.array([0.1]),
        "low": np.array([0.4]),
        "high": np.array([0.6]),
    },
    "criteria.safety.effective_mass.felt_toward": {
        "inverse": np.eye(3),
        "along": np.array([1.0, 0, 0]),
        "least": 0.1,
    },
    "criteria.safety.effective_mass.projected_mass": {"inverse": np.eye(3), "u": np.array([1.0, 0, 0])},
    "criteria.safety.effective_mass.principal_masses": {"inverse": np.eye(3)},
    "criteria.safety.joint_torque.shares": {"torques": TWO, "limits": 10 * TWO, "uncertainty": TWO},
    "criteria.safety.kinetic_energy.kinetic_energy": {"M": M, "qd": TWO},
    "criteria.safety.point_energy.point_energy": {
        "inverse": np.eye(3),
        "velocity": np.array([0.3, 0.4, 0.0]),
    },
    "criteria.ergonomics.back_compression.compression": {
        "moment": 100.0,
        "weight": 400.0,
        "upright": 0.5,
        "lever": 0.05,
    },
    "criteria.safety.manipulability.singular_values": {"J_v": J},
    "criteria.safety.manipulability.least_value_after": {"J": np.eye(6)},
    "criteria.safety.separation.separation_bound": {
        "v_r": HALF,
        "v_h": 1.6,
        "T_r": 0.1,
        "T_s": 0.5,
        "xi": 0.2,
    },
    "criteria.safety.tool_force.wrench_from_torques": {"J": J, "tau": TWO, "damped_below": 0.01},
    "criteria.safety.tool_force.largest_error": {"gain": J, "uncertainty": TWO},
    "criteria.safety.tool_force.pseudo_inverse_change": {"least": 0.5, "change": 0.1},
    "criteria.safety.velocity.point_velocity": {"J": J, "qd": TWO},
    "criteria.safety.velocity.speed_noise": {"J": J, "error": TWO},
    "criteria.stopping.planned.terms": {"S_r": 0.1, "S_s": 0.2, "S_h": 0.3},
    "criteria.stopping.onset.accelerated": {"v": HALF, "T_r": 0.1, "a": 2.0, "qd": TWO},
    "criteria.stopping.onset.largest_between": {"t": TWO, "q": np.eye(2), "qd": np.eye(2)},
    "criteria.stopping.onset.farthest": {
        "t": TWO - 1,
        "most": HALF[None],
        "now": HALF,
        "T_r": 0.1,
        "lead": 0.5,
    },
    "criteria.stopping.stated_acceleration.largest_gain": {
        "t": TWO,
        "v": np.diag([0.0, 3.0]),
        "a": 2.0,
        "window": 9.0,
        "noise": 0.1,
    },
    "criteria.stopping.stated_acceleration.explains": {
        "t": TWO,
        "v": np.diag([0.0, 3.0]),
        "window": 9.0,
        "noise": 0.1,
    },
    "criteria.stopping.terms.way_of_person": {"v_h": 1.6, "T_r": 0.1, "T_s": 0.5},
    "criteria.stopping.terms.course": {"v_r": HALF, "T_r": 0.1, "T_s": 0.5, "share": 0.5},
    "criteria.stopping.terms.decelerating": {"v": HALF, "v_h": 1.6, "T_r": 0.1, "a": 2.0, "K": 0.2},
    "criteria.stopping.terms.largest_speed_decelerating": {
        "d": 4 * HALF,
        "v_h": 1.6,
        "T_r": 0.1,
        "a": 2.0,
        "K": 0.2,
    },
    "criteria.stopping.terms.largest_speed_in_time": {
        "d": 4 * HALF,
        "v_h": 1.6,
        "T_r": 0.1,
        "T_s": 0.5,
        "K": 0.2,
        "share": 0.5,
    },
    "criteria.stopping.terms.largest_factor": {"c": HALF, "b": HALF, "a": HALF},
    "criteria.stopping.terms.worst_case": {"S_p": TWO},
    "criteria.contact.clamping.clamps": {
        "gaps": HALF,
        "speed": HALF,
        "thickness": HALF[None],
    },
    "criteria.contact.collision.robot_mass": {"M": 10.0, "m_L": 1.0},
    "criteria.contact.collision.reduced_mass": {"m_H": 10.0, "m_R": 10.0},
    "criteria.contact.collision.mass_of_rows": {"w": J, "M": M},
    "criteria.contact.collision.spring_energy": {"F": 100.0, "k": 25e3},
    "criteria.contact.collision.speed_at_force": {"F": 100.0, "mu": 2.0, "k": 25e3},
    "criteria.contact.collision.speed_at_pressure": {"p": 1e6, "A": 1e-4, "mu": 2.0, "k": 25e3},
    "criteria.contact.collision.speed_at_energy": {"E": 1.0, "mu": 2.0},
    "criteria.contact.collision.energy_limit": {"F": 100.0, "k": 25e3, "printed": 1.0},
    "criteria.contact.collision.permissible_speed": {"v_F": 1.0, "v_P": 1.0, "v_E": 1.0},
    "criteria.contact.measured.peaks": {"t": TWO - 1, "force": TWO},
    "criteria.contact.measured.risen": {"force": TWO},
    "criteria.contact.limits.permissible_while_pushed": {"v": HALF, "mu": TWO, "k": TWO * 1e4, "F": 10.0},
    "criteria.contact.shape.round_shape": {"radius": 0.01},
    "criteria.contact.shape.patch_area": {"radii": TWO / 100, "indentation": 0.01, "cap": 1e-4},
    "criteria.contact.shape.force_at_pressure": {
        "radii": TWO / 100,
        "pressure": 4e6,
        "stiffness": 75e3,
        "cap": 1e-4,
    },
    "core.transforms.apply": {"a_from_b": POSE, "points_in_b": np.ones(3)},
    "core.transforms.cross": {"a": np.ones(3), "b": np.array([1.0, 2, 4])},
    "core.transforms.inverse": {"a_from_b": POSE},
    "core.transforms.left_product": {"wxyz": POSE[0]},
    "core.transforms.length": {"v": np.array([1.0, 2, 4])},
    "core.transforms.multiplied": {"left": np.eye(4), "wxyz": POSE[0]},
    "core.transforms.product": {"p": POSE[:1], "q": POSE[:1]},
    "core.transforms.right_product": {"wxyz": POSE[0]},
    "core.transforms.rotation_from_axis_angle": {"axis": POSE[2, :3], "angle": 0.5},
    "core.transforms.rotation_from_rpy": {"rpy": np.ones(3)},
    "core.transforms.rotation_from_wxyz": {"wxyz": POSE[0]},
    "core.transforms.transform": {"rotation": POSE[:3, :3], "position": np.ones(3)},
    "core.transforms.turned": {"rotation": POSE[:3, :3], "wxyz": POSE[0]},
    "core.transforms.wxyz_from_rotation": {"rotation": POSE[:3, :3]},
    "criteria.ergonomics.eaws_posture.asymmetry_points": {"at_least": np.array([0.5, 0.2, 0.1])},
    "criteria.ergonomics.niosh.asymmetry_multiplier": {"A": HALF},
    "criteria.ergonomics.niosh.distance_multiplier": {"D": HALF},
    "criteria.ergonomics.niosh.horizontal_multiplier": {"H": HALF},
    "criteria.ergonomics.niosh.vertical_multiplier": {"V": HALF},
    "criteria.ergonomics.hand_activity.activity": {"share": HALF, "per_second": HALF},
    "criteria.ergonomics.hand_activity.force_at": {"hal": HALF, "at_no_activity": 5.6},
    "criteria.ergonomics.manual_handling.share_of": {"load": 5.0, "half": 10.0, "variation": 0.3},
    "criteria.ergonomics.ocra_checklist.time_factor": {"daily": 3600.0},
    "criteria.ergonomics.strain_index.composite": {"strain": TWO, "per_minute": TWO},
    "criteria.ergonomics.strain_index.daily_multiplier": {"daily": TWO},
    "criteria.ergonomics.strain_index.frequency_multiplier": {"per_minute": TWO},
    "criteria.ergonomics.strain_index.intensity_multiplier": {"borg": TWO},
    "criteria.ergonomics.strain_index.time_multiplier": {"time": TWO},
    "criteria.ergonomics.strain_index.wrist_multiplier": {"wrist": HALF},
    "criteria.ergonomics.reba.reba": REBA,
    "criteria.ergonomics.rula.rula": RULA,
    "criteria.ergonomics.owas.owas": {"back": 1, "arms": 1, "legs": 1, "load": 1},
    "criteria.ergonomics.owas.only": {"code": 1, "of": 4},
    "criteria.polytope.torque_box": BOXED,
    "criteria.polytope.zero_moment": BOXED,
    "criteria.polytope.free_moment": {"J": np.eye(6), "low": -np.ones(6), "high": np.ones(6)},
    "criteria.scoring.measured.turned": {"accuracy": 0.1, "lever": HALF},
    "criteria.scoring.held_work.repetitions": {"t": TWO, "scores": np.array([1, 2]), "window": 60.0},
    "criteria.scoring.held_work.static": {"t": TWO, "scores": np.ones(2), "hold": 0.5, "gap": 2.0},
    "criteria.scoring.spans.between": {"low": TWO, "high": TWO},
    "criteria.scoring.spans.exactly": {"score": TWO},
}
ELSEWHERE = {
    "criteria.scoring.score_rows.degrees": "words of edges that ship",
    "criteria.scoring.spans.any_of": "of truths",
    "criteria.scoring.spans.fallen": "what is not a number is, see BANDS",
    "criteria.scoring.spans.reached": "what is not a number is, see BANDS",
    "criteria.ergonomics.niosh.duration": "one of three words; see REFUSES",
    **{f"criteria.ergonomics.{name.replace(' ', '.', 1).replace(' ', '_')}": "see BANDS" for name in BANDS},
    "criteria.stopping.onset.by_speed": "of speeds that the twin has; `accelerated` checks T_r and a",
    "criteria.contact.clamping.getting_in": "of openings that shapes have, in a table that ships",
    "criteria.contact.measured.missing": "reasons in words, of records that `peaks` took",
}
STRICT = {
    "criteria.scoring.measured.turned lever": "turns the direction to anywhere",
    "criteria.stopping.onset.accelerated qd": "is kept, and asked for by nobody else",
    "criteria.stopping.terms.largest_factor b": "is 0, no speed",
    "criteria.stopping.terms.largest_factor a": "is 0, no speed",
    "criteria.contact.clamping.clamps gaps": "clamps",
    "criteria.contact.clamping.clamps speed": "clamps",
    "criteria.contact.clamping.clamps thickness": "clamps",
    "criteria.contact.collision.energy_limit printed": "was not printed: that of force and stiffness",
    **{
        f"criteria.contact.shape.force_at_pressure {x}": "no force"
        for x in ("radii", "pressure", "stiffness")
    },
    "criteria.contact.collision.permissible_speed v_P": "of an unknown area: the upper bound of the others",
}
"""What is strictest, or right, where an argument is not a number."""
BELOW = {
    "criteria.ergonomics.back_compression.compression": "moment weight lever",
    "criteria.safety.joint_torque.shares": "limits uncertainty",
    "criteria.safety.kinetic_energy.kinetic_energy": "M",
    "criteria.safety.point_energy.point_energy": "inverse",
    "criteria.safety.separation.separation_bound": "v_h T_r T_s xi",
    "criteria.safety.tool_force.wrench_from_torques": "damped_below",
    "criteria.safety.tool_force.largest_error": "uncertainty",
    "criteria.safety.tool_force.pseudo_inverse_change": "least change",
    "criteria.safety.velocity.speed_noise": "error",
    "criteria.stopping.onset.accelerated": "T_r a",
    "criteria.stopping.onset.farthest": "T_r lead",
    "criteria.stopping.stated_acceleration.largest_gain": "v a window noise",
    "criteria.stopping.stated_acceleration.explains": "v window noise",
    "criteria.stopping.terms.way_of_person": "T_r T_s",
    "criteria.stopping.terms.course": "T_r T_s share",
    "criteria.stopping.terms.decelerating": "v_h T_r a K",
    "criteria.stopping.terms.largest_speed_decelerating": "v_h T_r a K",
    "criteria.stopping.terms.largest_speed_in_time": "v_h T_r T_s K share",
    "criteria.contact.collision.robot_mass": "M m_L",
    "criteria.contact.collision.reduced_mass": "m_R",
    "criteria.contact.collision.spring_energy": "k",
    "criteria.contact.collision.speed_at_force": "k",
    "criteria.contact.collision.speed_at_pressure": "k",
    "criteria.contact.limits.permissible_while_pushed": "F",
    "criteria.contact.shape.round_shape": "radius",
    "criteria.contact.shape.patch_area": "radii indentation cap",
    "criteria.contact.shape.force_at_pressure": "radii pressure stiffness cap",
}
"""What is refused below 0."""


def formulas():
    for walked in WALKED:
        found = importlib.import_module(f"seerob.{walked}")
        inside = pkgutil.walk_packages(getattr(found, "__path__", ()), f"seerob.{walked}.")
        for module in (found, *(importlib.import_module(each.name) for each in inside)):
            for name, function in inspect.getmembers(module, inspect.isfunction):
                kinds = [p.annotation for p in inspect.signature(function).parameters.values()]
                own = function.__module__ == module.__name__ and not name.startswith("_")
                returns = inspect.signature(function).return_annotation
                if own and kinds and set(kinds) <= NUMBERS and returns not in ("Input", "str"):
                    yield f"{module.__name__.removeprefix('seerob.')}.{name}"


def called(name, arguments):
    module, _, function = name.rpartition(".")
    with np.errstate(all="ignore"):
        return getattr(importlib.import_module(f"seerob.{module}"), function)(**arguments)


def figures(told):
    if dataclasses.is_dataclass(told):
        told = [getattr(told, each.name) for each in dataclasses.fields(told)]
    if isinstance(told, msgspec.Struct):
        told = msgspec.structs.astuple(told)
    if isinstance(told, tuple | list):
        return [x for each in told for x in figures(each)]
    return [] if told is None or isinstance(told, str) else np.ravel(np.asarray(told, float)).tolist()


def spoiled(value, bad):
    changed = np.array(value, float)
    changed.flat[0] = bad
    return changed if changed.ndim else bad


def test_every_formula_is_asked():
    assert set(formulas()) <= {*CALLS, *ELSEWHERE}


@pytest.mark.parametrize("name", CALLS)
def test_what_is_not_a_number_is_refused_or_stays_so(name):
    """A NaN never becomes a plausible figure: of what it is in, at least one is NaN."""
    good = figures(called(name, CALLS[name]))
    assert good
    assert not np.isnan(good).any()
    for argument, value in CALLS[name].items():
        asked = {**CALLS[name], argument: spoiled(value, math.nan)}
        try:
            told = figures(called(name, asked))
        except (ValueError, SeerobError, np.linalg.LinAlgError):
            continue
        assert np.isnan(told).any() or f"{name} {argument}" in STRICT, (argument, told)
        if name.endswith("clamps"):
            assert any(told)


def test_the_least_of_several_figures_is_not_a_number_where_one_is_not():
    """Manipulability is the least singular value, and the mass along the easiest way the least of three."""
    assert np.isnan(
        called("criteria.safety.manipulability.singular_values", {"J_v": spoiled(J, math.nan)})[0]
    ).all()
    inverse = {"inverse": spoiled(np.eye(3), math.nan)}
    assert np.isnan(called("criteria.safety.effective_mass.principal_masses", inverse)[0]).all()


@pytest.mark.parametrize("name", BELOW)
def test_what_cannot_be_below_nothing_is_refused_by_its_name(name):
    for argument in BELOW[name].split():
        asked = {**CALLS[name], argument: spoiled(CALLS[name][argument], -100.0)}
        with pytest.raises((ValueError, SeerobError), match=argument):
            called(name, asked)


FREE = {
    "core.transforms.apply a_from_b 0": "the last row is not asked",
    "core.transforms.transform rotation 0": "written into a frame",
    "core.transforms.transform rotation 1": "written into a frame",
    "core.transforms.transform position 0": "written into a frame",
    "criteria.safety.manipulability.singular_values J_v 0": "of any shape",
    "criteria.safety.manipulability.singular_values J_v 1": "of any shape",
    "criteria.safety.manipulability.least_value_after J 1": "of any shape",
    "criteria.stopping.onset.accelerated qd 0": "is kept as it is",
    "criteria.stopping.stated_acceleration.largest_gain v 1": "fewer parts",
    "criteria.stopping.stated_acceleration.explains v 1": "fewer parts",
    "criteria.contact.limits.permissible_while_pushed mu 0": "one may be of all regions",
    "criteria.contact.limits.permissible_while_pushed k 0": "one may be of all regions",
    "criteria.scoring.spans.between low 0": "one may be of all rows",
    "criteria.scoring.spans.between high 0": "one may be of all rows",
}
"""Where fewer than there are is another question, or no figure of a robot."""
ROWS = {"J_v", "J", "w", "gain"}
"""Of which fewer points, axes or rows are another question."""
FEWER = [
    (name, argument, axis)
    for name, arguments in CALLS.items()
    for argument, value in arguments.items()
    for axis in range(np.ndim(value))
    if np.shape(value)[axis] > 1 and f"{name} {argument} {axis}" not in FREE
    if len(arguments) > 1 and not (axis == 0 and argument in ROWS)
]


@pytest.mark.parametrize(("name", "argument", "axis"), FEWER)
def test_arrays_that_do_not_fit_are_refused_not_stretched(name, argument, axis):
    """One joint's or one instant's figure never stands for all, and no kernel reads beyond an array."""
    one = np.take(np.asarray(CALLS[name][argument], float), [0], axis=axis)
    with pytest.raises((ValueError, SeerobError, np.linalg.LinAlgError, IndexError)):
        called(name, {**CALLS[name], argument: one})


GROWING = {
    "criteria.safety.kinetic_energy.kinetic_energy": "M qd",
    "criteria.safety.separation.separation_bound": "v_r v_h T_r T_s xi",
    "criteria.safety.joint_torque.shares": "torques uncertainty",
    "criteria.stopping.onset.accelerated": "v T_r a",
    "criteria.stopping.terms.course": "v_r T_r T_s",
    "criteria.stopping.terms.way_of_person": "v_h T_r T_s",
}


@pytest.mark.parametrize("name", GROWING)
def test_what_is_infinite_makes_no_figure_smaller(name):
    good = figures(called(name, CALLS[name]))
    for argument in GROWING[name].split():
        told = figures(called(name, {**CALLS[name], argument: spoiled(CALLS[name][argument], math.inf)}))
        assert all(b >= a or math.isnan(b) for a, b in zip(good, told, strict=True)), argument
        assert not np.isfinite(told).all(), argument


def test_words_and_directions_that_a_formula_does_not_have_are_refused():
    """No mass is that of a word or of a longer direction that there is none of."""
    with pytest.raises(ValueError, match="which is 'Larger', it is 'larger', 'simplified' or 'projected'"):
        robot_masses("Larger", 10.0, TWO)
    for none in (math.nan, -1.0):
        with pytest.raises(ValueError, match="simplified is"):
            robot_masses("larger", none, TWO)
    assert robot_masses("larger", 1.5, np.array([1.0, 2.0, math.nan])).tolist() == [1.5, 2.0, 1.5]
    along = "criteria.safety.effective_mass.projected_mass"
    with pytest.raises(ValueError, match="length of u is 10, it is"):
        called(along, {**CALLS[along], "u": np.array([10.0, 0, 0])})


def test_scores_of_an_author_are_whole_numbers():
    for score in (math.nan, math.inf, 1.5, -math.inf, [1, math.nan]):
        for made in (spans.exactly, lambda x: spans.between(x, 9), lambda x: spans.between(0, x)):
            with pytest.raises(ValueError, match="score"):
                made(score)
    with pytest.raises(ValueError, match="at least more"):
        spans.between(3, 2)
