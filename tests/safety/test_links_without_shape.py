"""A link that moves and has a mass but no shape is somewhere: nothing that is about shapes is within."""

from __future__ import annotations

import re

import numpy as np
import pytest

from made_cell import FLOATING, TWO_R, made, person, results_at, state_at, two_r
from seerob.errors import Undecided
from seerob.permissible.between_samples import BetweenSamples
from seerob.permissible.ceilings import ceilings_of
from seerob.permissible.given_motion import GivenMotion

LAST = re.compile(r'(<link name="l2">.*?)<collision>.*?</collision>')
BARE = LAST.sub(r"\1", two_r())
FIXED = (
    '<link name="tip"><inertial><mass value="0.1"/><inertia ixx="4e-4" iyy="4e-4" izz="4e-4" ixy="0" ixz="0" '
    'iyz="0"/></inertial><collision><geometry><sphere radius="0.1"/></geometry></collision></link>'
)
TERMS = "intrusion = 0\nhuman_uncertainty = 0\nrobot_uncertainty = 0\n"
STOP = "stop = { reaction = 0.01, stopping = 0.01 }\n"
ABOUT = {
    "minimum_distance": 'between = ["arm", "op"]\nlimit = 0.01\n',
    "separation": f'between = ["arm", "op"]\n{STOP}{TERMS}',
    "separation_area": 'separation = "separation"\nof = "op"\n',
    "safety_area": 'area = "zone"\nof = "arm"\n',
    "power_and_force": 'robot = "arm"\nhuman = "op"\n',
    "swept_volume": 'of = "arm"\nvoxel = 0.1\nlimit = 9\n',
    "velocity": 'of = "arm"\nlimit = 9\n',
}
ZONE = '[[areas]]\nname = "zone"\nshape = { sphere = 0.1 }\nat = { position = [0, 0, 9] }\n'


def cell(folder, urdf, x=9.0, more=""):
    kinds = (f'[[safety]]\nkind = "{kind}"\nname = "{kind}"\n{rest}' for kind, rest in ABOUT.items())
    point = '[[safety]]\nkind = "velocity"\nname = "point"\nat = "arm"\nlimit = 9\n'
    point += '[[safety]]\nkind = "minimum_distance"\nname = "figure"\nbetween = ["arm", "op"]\n'
    text = FLOATING + TWO_R + more + person("op", x, 0, -1) + ZONE + "".join(kinds) + point
    return made(folder, text, {"arm.urdf": urdf})


def verdicts(station):
    return {name: result.verdict for name, result in results_at(station, arm=((0, 0), (1, 0))).items()}


def test_nothing_about_shapes_is_within(tmp_path):
    station = cell(tmp_path, BARE)
    results = results_at(station, arm=((0.0, 0.0), (1.0, 0.0)))
    for kind in ABOUT:
        assert (kind, results[kind].verdict) == (kind, "undecided")
        assert "no shape shows arm/l2, which has a mass" in results[kind].reason
        coloured = [getattr(marker, "verdict", None) for marker in results[kind].markers]
        assert set(coloured) <= {None, "undecided"}
    assert results["minimum_distance"].markers[0].verdict == "undecided"
    assert results["point"].verdict == "within"
    assert results["figure"].verdict is None  # nothing to be within of
    still = {"arm": np.zeros((2, 2))}
    batch = station.batch(still, still)
    assert {kind: int(batch[kind].answers.verdict.min()) for kind in ABOUT} == dict.fromkeys(ABOUT, 2)


@pytest.mark.parametrize(
    "shown",
    [
        (two_r(), ""),
        (BARE, '[[tools]]\nname = "cover"\non = "arm/l2"\nshape = { box = [1, 0.1, 0.1] }\nmass = 0.1\n'),
        (LAST.sub(r"\1", two_r(masses=(1.0, 0.05))), ""),
        (BARE.replace('<link name="tip"/>', FIXED), ""),
    ],
    ids=["itself", "mounted", "as light as a frame", "fixed to it"],
)
def test_what_is_shown_is_enough(tmp_path, shown):
    urdf, more = shown
    found = verdicts(cell(tmp_path, urdf, more=more))
    assert found.pop("power_and_force") is None  # nobody is near
    assert found.pop("figure") is None
    assert set(found.values()) == {"within"}


def test_a_robot_that_must_stay_outside_counts_whole(tmp_path):
    """The area is that of a robot whose shapes are all there."""
    other = '[[robots]]\nname = "other"\nmodel = "{}.urdf"\nbase = {{ position = [0, 8, 0] }}\nq = [0, 0]\n'
    kinds = (
        f'[[safety]]\nkind = "{kind}"\nname = "{kind}"\n{ABOUT[kind].replace(old, new)}'
        for kind, old, new in (("separation", "", ""), ("separation_area", '"op"', '"other"'))
    )
    text = FLOATING + TWO_R + person("op", 9.0, 0, -1) + "".join(kinds)
    for name, verdict in (("bare", "undecided"), ("arm", "within")):
        files = {"arm.urdf": two_r(), "bare.urdf": BARE}
        station = made(tmp_path / name, text + other.format(name), files)
        assert verdicts(station) == {"separation": "within", "separation_area": verdict}


def test_what_is_seen_exceeds_by_itself(tmp_path):
    found = verdicts(cell(tmp_path, BARE, x=0.5))
    assert [found[kind] for kind in ("minimum_distance", "separation", "separation_area")] == ["exceeded"] * 3


def test_no_speed_is_permitted_and_nothing_bounded(tmp_path):
    model = cell(tmp_path, BARE).model
    state = state_at(cell(tmp_path / "again", BARE), arm=((0.0, 0.0), (1.0, 0.0)))
    asked = [ceilings_of(c, model, "arm") for c in model.workstation.safety if c.name in ABOUT]
    for ask in filter(None, asked):
        assert [c.undecided for c in ask.ceilings(state)] == [True]
    t, q = np.array([0.0, 1.0]), np.array([[0.0, 0.0], [1.0, 0.0]])
    motion = GivenMotion("arm", t, q, np.zeros_like(q), np.ones(2, bool))
    between = BetweenSamples(model, {"arm": motion})
    for ask in (lambda: between.distance("arm", "op"), lambda: between.speed("arm")):
        with pytest.raises(Undecided, match="no shape shows arm/l2"):
            ask()
    assert between.distance("arm/l1", "op").value > 6
