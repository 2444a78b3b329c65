"""Verdicts in arrays at the edges of what they rest on, instant by instant those of one instant."""

from __future__ import annotations

import numpy as np
import pytest

from made_cell import FLOATING, TWO_R, made, results_at, two_r
from seerob.core.errors import InputError
from seerob.criteria.safety.effective_mass import EffectiveMass
from seerob.criteria.safety.force_polytope import ForcePolytope
from seerob.criteria.safety.kinetic_energy import KineticEnergy
from seerob.criteria.safety.tool_force import ToolForce
from seerob.criteria.safety.velocity import Velocity
from seerob.recording.series import CODES, NO_VERDICT

WALL = '[[parts]]\nname = "wall"\nshape = {{ box = [0.1, 9, 9] }}\nat = {{ position = [{x}, 0, 0] }}\n'
MASS = '[[safety]]\nkind = "effective_mass"\nname = "m"\nat = "arm"\nlimit = 1.5\n'
SLOW = "engine = { gravity = [0, 0, 0], physics = false }\n"


def both(folder, text, motion):
    """Value and verdict of each instant by itself, and of all at once."""
    station = made(folder, text, {"arm.urdf": two_r()})
    alone = [results_at(station, arm=each)["m"] for each in motion]
    q, qd = (np.array([each[k] for each in motion]) for k in (0, 1))
    answers = station.batch({"arm": q}, {"arm": qd})["m"].answers
    values = [np.nan if r.value is None else r.value for r in alone]
    codes = [NO_VERDICT if r.verdict is None else CODES[r.verdict] for r in alone]
    return values, codes, answers


def test_a_mass_along_the_motion_begins_with_the_motion(tmp_path):
    """Of an arm bent by 90°, at 0.99 and 1.01 mm/s of its tip, √2 m from its base."""
    motion = [((0.0, np.pi / 2), (v / np.sqrt(2), 0.0)) for v in (0.0, 0.99e-3, 1.01e-3, 1.0)]
    values, codes, answers = both(tmp_path, SLOW + TWO_R + MASS, motion)
    assert np.isnan(values).tolist() == [True, True, False, False]
    np.testing.assert_allclose(answers.value, values, rtol=1e-9)
    assert answers.verdict.tolist() == codes
    assert codes[:2] == [NO_VERDICT] * 2


@pytest.mark.parametrize("which", ['of = "arm"', 'at = "arm"', 'at = "arm"\noffset = [0.5, 0, 0]'])
def test_the_fastest_point_of_many_instants_is_that_of_each(tmp_path, which):
    text = SLOW + TWO_R + f'[[safety]]\nkind = "velocity"\nname = "m"\n{which}\nlimit = 2\n'
    values, codes, answers = both(tmp_path, text, [((0.0, 0.5), (v, 0.0)) for v in (0.0, 0.7, -1.5)])
    np.testing.assert_allclose(answers.value, values, rtol=1e-9)
    assert answers.verdict.tolist() == codes
    assert codes == [CODES["within"]] * 2 + [CODES["exceeded"]]


@pytest.mark.parametrize("gap", [0.0005, 0.1])
def test_a_line_of_half_a_millimetre_has_a_direction(tmp_path, gap):
    """Toward a wall across x, half a millimetre and more before the arm at (-1, 1.05)."""
    text = SLOW + TWO_R + WALL.format(x=-1.05 - 0.05 - gap) + MASS + 'toward = "wall"\n'
    values, codes, answers = both(tmp_path, text, [((np.pi / 2, np.pi / 2), (0.0, 0.0))] * 2)
    assert np.isfinite(values).all()
    np.testing.assert_allclose(answers.value, values, rtol=1e-9)
    assert answers.verdict.tolist() == codes


def test_who_touches_has_no_direction_and_is_undecided(tmp_path):
    text = SLOW + TWO_R + WALL.format(x=0) + MASS + 'toward = "wall"\n'
    values, codes, answers = both(tmp_path, text, [((0.0, 0.5), (1.0, 0.0))] * 2)
    assert np.isnan(values).all()
    assert np.isnan(answers.value).all()
    assert answers.verdict.tolist() == codes == [CODES["undecided"]] * 2


AXIS = '[[machines]]\nname = "axis"\nshape = { box = [1, 1, 0.1] }\nmass = 9\nslide = { along = [1, 0, 0] }\n'
CARRIED = FLOATING + AXIS + TWO_R + 'on = "axis"\n'


@pytest.mark.parametrize(
    ("text", "batched"),
    [
        (FLOATING + TWO_R, (True, True, True)),
        # A tolerance makes an interval, which the arrays do not know of energies and masses.
        (FLOATING + TWO_R + "mass_tolerance = 0.1\n", (True, False, False)),
        (CARRIED, (False, False, False)),
    ],
    ids=["alone", "tolerance", "carried"],
)
def test_what_the_arrays_do_not_know_is_left_to_the_road(tmp_path, text, batched):
    model = made(tmp_path, text, {"arm.urdf": two_r()}).model
    asked = (
        Velocity(name="v", at="arm").batch(model),
        KineticEnergy(name="E", robot="arm").batch(model),
        EffectiveMass(name="m", at="arm").batch(model),
    )
    assert tuple(each is not None for each in asked) == batched


@pytest.mark.parametrize(
    ("options", "batched"),
    [
        ({}, True),
        ({"load": "none"}, True),
        ({"load": "motion"}, False),
        ({"definition": "free_moment"}, False),
        ({"definition": "torque_box", "load": "motion"}, False),
    ],
)
def test_forces_that_need_a_hull_or_the_motion_are_left_to_the_road(tmp_path, options, batched):
    model = made(tmp_path, FLOATING + TWO_R, {"arm.urdf": two_r()}).model
    assert (ForcePolytope(name="f", at="arm", **options).batch(model) is not None) is batched


@pytest.mark.parametrize(
    ("asked", "needs"),
    [
        (ForcePolytope(name="f", at="arm"), True),
        (ForcePolytope(name="f", at="arm", load="motion"), True),
        (ForcePolytope(name="f", at="arm", load="none"), False),
        (ToolForce(name="f", at="arm"), True),
        (ToolForce(name="f", at="arm", torques="external"), False),
        (KineticEnergy(name="E", robot="arm"), True),
        (EffectiveMass(name="m", at="arm"), True),
        (Velocity(name="v", at="arm"), False),
    ],
    ids=lambda value: type(value).__name__,
)
def test_a_mass_that_cannot_be_is_refused_where_it_is_needed(tmp_path, asked, needs):
    model = made(tmp_path, FLOATING + TWO_R, {"arm.urdf": two_r(masses=(0, 1))}).model
    if needs:
        with pytest.raises(InputError, match="l1"):
            asked.bind(model)
    else:
        assert asked.bind(model)
