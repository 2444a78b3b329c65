"""Regions that a part cannot hit by its height, where the file says how people can be there."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from made_cell import FLOATING, TWO_R, heard, made, person, results_at, state_at, two_r
from seerob.core.errors import SeerobError
from seerob.core.snapshot import Origin, Result, RowState, Verdict
from seerob.criteria.contact.regions import ANYWHERE, REGIONS, heights
from seerob.criteria.judging import Judge
from seerob.description.humans import manikin
from seerob.description.humans.posture import posture
from seerob.description.humans.skeleton import bone_poses
from seerob.session.station import Station

STANDING = 'postures = ["standing"]\npostures_source = "risk assessment 7"\n'


def cell(folder: Path, z: float, options: str = STANDING, more: str = "") -> Station:
    text = (
        f"{FLOATING}{TWO_R}base = {{ position = [0, 0, {z}] }}\n{more}"
        '[[safety]]\nkind = "power_and_force"\nname = "pfl"\nrobot = "arm"\nmass = "simplified"\n'
        f"floor = false\ncontact_area = {{ arm = 1e-4 }}\n{options}"
    )
    return made(folder, text, {"arm.urdf": two_r()})


def found(station: Station, speed: float = 0.1, **more) -> Result:
    return results_at(station, arm=([0.0, 0.0], [speed, 0.0]), **more)["pfl"]


def out(result: Result) -> set[str]:
    left = {part.name for part in result.parts if part.reason.startswith("out of reach")}
    assert {row.group for row in result.rows if row.state is RowState.EXCLUDED} == left
    assert all(part.verdict is None for part in result.parts if part.name in left)
    return left


HEAD = {"Skull and forehead", "Face", "Larynx, eyes and ears"}


@pytest.mark.parametrize(
    ("z", "left", "kept"),
    [
        (0.2, {*HEAD, "Neck", "Chest"}, {"Lower legs", "Feet", "Thighs and knees"}),
        (1.2, {"Feet"}, {*HEAD, "Neck", "Chest", "Pelvis"}),
        (3.0, set(REGIONS) - ANYWHERE, set()),
    ],
)
def test_regions_out_of_reach_by_height_are_left_out_and_listed(
    tmp_path: Path, z: float, left: set[str], kept: set[str]
) -> None:
    result = found(cell(tmp_path, z))
    assert left <= out(result)
    assert not out(result) & (kept | ANYWHERE)
    assert {part.name for part in result.parts if part.name in REGIONS} == set(REGIONS)


def test_without_a_word_of_the_file_every_region_counts(tmp_path: Path) -> None:
    result = found(cell(tmp_path, 3.0, ""))
    assert not out(result)
    assert result.verdict is Verdict.UNDECIDED


def test_a_low_robot_beside_people_who_stand_can_be_within(tmp_path: Path) -> None:
    feet = 'excluded = ["Feet"]\n'
    station = cell(tmp_path, 0.2, STANDING + feet)
    assert found(station).verdict is Verdict.WITHIN
    assert found(cell(tmp_path / "a", 0.2, feet)).verdict is Verdict.UNDECIDED
    inputs = {i.name: i for i in station.bound[0].basis.inputs}
    assert (inputs["postures of people"].value, inputs["postures of people"].source) == (
        "standing",
        "risk assessment 7",
    )
    assert inputs["postures of people"].origin is Origin.GIVEN
    assert inputs["Chest: lowest over the ground"].unit == "m"
    assert any("other postures" in text for text in station.bound[0].basis.not_modelled)


def test_who_bends_or_is_smaller_is_lower(tmp_path: Path) -> None:
    """More postures and statures never leave out more."""
    fewer = out(found(cell(tmp_path / "a", 0.4, STANDING + "statures = [1.6, 1.9]\n")))
    small = out(found(cell(tmp_path / "b", 0.4)))
    bending = out(found(cell(tmp_path / "c", 0.4, STANDING.replace('"standing"', '"standing", "reach_low"'))))
    assert fewer >= small >= bending
    assert fewer > bending


def test_who_is_there_in_the_twin_counts_whatever_the_file_says(tmp_path: Path) -> None:
    """Sunk into the floor up to the neck: the head is where only feet should be."""
    station = cell(tmp_path, 0.2, more=person("op", 1.0, 0.0, -1.3))
    op = station.model.mechanisms["op"]
    result = found(station, op=(op.home, np.zeros(len(op.home))))
    assert not out(result) & HEAD
    # And who is not heard may be anywhere.
    state = state_at(station, arm=([0.0, 0.0], [0.1, 0.0]))
    state.engine.take([heard("arm", 0.0, [0.0, 0.0], [0.1, 0.0])])
    (result,) = Judge(station.bound)(state)
    assert not out(result)


@pytest.mark.parametrize(
    ("options", "what"),
    [
        ('postures = ["standing"]\n', "postures_source"),
        (STANDING + 'human = "op"\n', "postures speak of anyone"),
        (STANDING + "statures = [1.9, 1.6]\n", "the least comes first"),
        (STANDING.replace("standing", "floating"), "floating"),
    ],
)
def test_slips_are_told(tmp_path: Path, options: str, what: str) -> None:
    with pytest.raises(SeerobError, match=what):
        found(cell(tmp_path, 1.0, options, person("op", 3.0, 0.0, 0.0)))


def test_heights_hold_the_skin_of_everybody_between() -> None:
    bands = heights(("standing",), (1.5, 1.9))
    rng = np.random.default_rng(1)
    for _ in range(12):
        stature = rng.uniform(1.5, 1.9)
        index, sex = rng.uniform(17, 40), rng.choice(["male", "female"])
        who = manikin.build(name="x", stature=stature, mass=index * stature**2, sex=str(sex))
        rotations, positions = bone_poses(who, posture(who, "standing"))
        for k, link in enumerate(who.links[1:]):
            for solid in link.solids:
                z = (solid.points @ rotations[k].T + positions[k])[:, 2]
                if link.name == "thorax":
                    assert bands["Chest"][0] <= z.min() - solid.radius + 0.02
                    assert z.max() + solid.radius <= bands["Chest"][1] + 0.02
    assert 1.2 < bands["Face"][0] < 1.5 < 1.85 < bands["Skull and forehead"][1] < 1.95
