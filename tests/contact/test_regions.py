"""Which regions of a person a part of the robot could hit, and how fast they are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from made_cell import FLOATING, TWO_R, made, results_at, state_at, two_r
from seerob.core.snapshot import Verdict
from seerob.core.transforms import Array
from seerob.criteria.contact.clamped_regions import Clamping
from seerob.criteria.contact.regions import FEET, REGIONS, SENSITIVE, Person
from seerob.session.station import Station, load

REACH = 2.0
"""Of the arm along x [m]; it is ± 0.05 m thick."""


def cell(folder: Path, z: float) -> Station:
    """The arm along x, and a person in front of its end."""
    person = (
        '[[humans]]\nname = "op"\nstature = 1.75\nmass = 75\nsex = "male"\n'
        f"at = {{ position = [{REACH + 0.5}, 0, {z}] }}\n"
    )
    return made(folder, FLOATING + TWO_R + person, {"arm.urdf": two_r()})


def speeds(station: Station, slide: float) -> Array:
    """Of a person whose root slides along its first axis [m/s], see `Person.near`; nothing turns."""
    joints = len(station.model.human("op").joints)
    qd = np.zeros(joints)
    qd[0] = slide
    state = state_at(station, arm=((0.0, 0.0), (0.1, 0.0)), op=(np.zeros(joints), qd))
    near, v = Person(station.model, station.model.robot("arm"), "op", horizon=0.5).near(state, None)
    assert (v[~near.any(axis=0)] == 0).all()
    return v[near.any(axis=0)]


def test_regions_move_as_their_bones_do_and_stand_when_those_stand(tmp_path: Path) -> None:
    station = cell(tmp_path, -1.0)
    assert speeds(station, 0.0) == pytest.approx(0, abs=1e-12)
    assert speeds(station, 0.7) == pytest.approx(0.7, rel=1e-9)


@pytest.mark.parametrize(("z", "region"), [(-1.6, SENSITIVE), (-0.1, FEET)])
def test_only_head_and_neck_count_for_larynx_eyes_and_ears(tmp_path: Path, z: float, region: str) -> None:
    station = cell(tmp_path, z)
    state = state_at(station, arm=((0.0, 0.0), (0.1, 0.0)))
    near, _ = Person(station.model, station.model.robot("arm"), "op", horizon=0.5).near(state, None)
    found = {REGIONS[k] for k in np.flatnonzero(near.any(axis=0))}
    assert found & {SENSITIVE, FEET} == {region}


def horizon_of(station: Station, region: str, **off: tuple[float, float]) -> float:
    """Largest horizon within which a region is not yet near, by bisection [m]."""
    state = state_at(station, arm=((0.0, 0.0), (0.1, 0.0)))
    state.hearings["op"].bones = dict(off)
    low, high = 1e-6, 4.0
    while high - low > 1e-7:
        middle = (low + high) / 2
        person = Person(station.model, station.model.robot("arm"), "op", horizon=middle)
        near = person.near(state, None)[0][:, REGIONS.index(region)].any()
        low, high = (low, middle) if near else (middle, high)
    return high


def test_what_surfaces_may_stick_out_and_bones_are_off_by_is_within_the_horizon(tmp_path: Path) -> None:
    station = cell(tmp_path, -1.0)
    region = "Skull and forehead"
    plain = horizon_of(station, region)
    assert horizon_of(station, region, pelvis=(0.05, 0.0)) == pytest.approx(plain, abs=2e-7)
    assert horizon_of(station, region, head=(0.05, 0.0)) == pytest.approx(plain - 0.05, abs=2e-7)
    thicker = '<visual><origin xyz="0.5 0 0"/><geometry><box size="1 0.1 0.14"/></geometry></visual>'
    urdf = tmp_path.joinpath("arm.urdf").read_text()
    at = urdf.rindex("</link>", 0, urdf.index('name="j1"'))
    tmp_path.joinpath("arm.urdf").write_text(urdf[:at] + thicker + urdf[at:])
    out = load(tmp_path)
    off = max(body.deviation for body in out.model.bodies)
    assert off > 0.019
    assert horizon_of(out, region) == pytest.approx(plain - off, abs=2e-7)


def test_own_links_that_fold_clamp_a_hand_whatever_was_before(tmp_path: Path) -> None:
    """The forearm of a UR10 folds onto its upper arm; stretched out, it does not."""
    station = made(tmp_path, FLOATING + '[[robots]]\nname = "arm"\nmodel = "library:ur10"\n')
    robot = station.model.robot("arm")
    clamping = Clamping(station.model, robot, {}, ("Hands and fingers",), None)
    wanted = np.ones((len(robot.moving), 1), bool)
    found = []
    for t, elbow in ((0.0, 2.6), (0.1, 0.0), (0.2, 2.6), (0.1, 2.6)):
        state = state_at(station, arm=((0, -1.5, elbow, 0, 0, 0), (0, 0, 0.5, 0, 0, 0)))
        state.t = t
        found.append(bool(clamping.at(state, wanted)[0].any()))
    assert found == [True, False, True, True]


@pytest.mark.parametrize("named", [True, False])
@pytest.mark.parametrize("touched", [True, False])
def test_who_is_touched_all_the_same_was_not_kept_from_contact(
    tmp_path: Path, touched: bool, named: bool
) -> None:
    """The arm at the height of a pelvis that the file keeps from contact: in it, or 0.1 m before it."""
    text = (
        f"{FLOATING}{TWO_R}base = {{ position = [0, 0, 1] }}\n"
        '[[humans]]\nname = "op"\nstature = 1.75\nmass = 75\nsex = "male"\n'
        f"at = {{ position = [{1.0 if touched else 2.3}, 0, 0] }}\n"
        '[[safety]]\nkind = "power_and_force"\nname = "pfl"\nrobot = "arm"\n'
        + ('human = "op"\n' if named else "")
        + 'contact_area = { arm = 1e-4 }\nexcluded = ["Pelvis"]\n'
    )
    station = made(tmp_path, text, {"arm.urdf": two_r()})
    home = station.model.mechanisms["op"].home
    found = results_at(station, arm=((0, 0), (0.1, 0)), op=(home, np.zeros(len(home))))["pfl"]
    pelvis = next(part for part in found.parts if part.name == "Pelvis")
    assert ("touched by arm/l" in pelvis.reason) == touched
    assert pelvis.verdict is (Verdict.UNDECIDED if touched else None)
