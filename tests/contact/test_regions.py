"""Which regions of a person a part of the robot could hit, and how fast they are."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from made_cell import FLOATING, TWO_R, made, results_at, state_at, two_r
from seerob.core.errors import Undecided
from seerob.core.snapshot import Verdict
from seerob.core.transforms import Array
from seerob.criteria.contact.clamped_regions import Clamping
from seerob.criteria.contact.regions import (
    ANYWHERE,
    FEET,
    REGIONS,
    SENSITIVE,
    HeightReach,
    Person,
    heights,
    without_limit,
)
from seerob.description.humans import manikin
from seerob.description.humans.body_areas import BODY_REGION
from seerob.description.humans.posture import posture
from seerob.description.humans.skeleton import bone_poses, without_side
from seerob.session.station import Station, load
from seerob.twin.spans import Span
from seerob.twin.state import State

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


def a_span(station: Station, state: State, robot: float, person: float, noise: float = 0.0) -> Span:
    """0.1 s in which bodies of the robot and of the person are at most so fast [m/s]."""
    model = station.model
    fast = np.zeros(len(model.bodies))
    fast[list(model.robot("arm").moving)], fast[list(model.human("op").bodies)] = robot, person
    zeros = np.zeros_like(fast)
    span = Span(0.0, 0.1, np.array([fast, zeros, zeros]), np.zeros((4, model.mj.nv)), None, model.mj)
    span.noise = np.where(fast == person, noise, 0.0)
    return span


def least(holds: Callable[[float], bool]) -> float:
    """Where something begins to hold, by bisection."""
    low, high = -4.0, 4.0
    assert not holds(low)
    assert holds(high)
    while high - low > 1e-8:
        middle = (low + high) / 2
        low, high = (low, middle) if holds(middle) else (middle, high)
    return high


def test_until_the_next_tick_the_horizon_is_wider_by_both_ways_and_the_person_as_fast_as_they_may_be(
    tmp_path: Path,
) -> None:
    """2 m/s and 0.5 m/s for 0.1 s; more is touched where surfaces come so much nearer or bones are off."""
    station = cell(tmp_path, -1.0)
    state = state_at(station, arm=((0.0, 0.0), (0.1, 0.0)))
    region = "Skull and forehead"
    column, robot = REGIONS.index(region), station.model.robot("arm")
    plain, span = horizon_of(station, region), a_span(station, state, 2.0, 0.5, noise=0.03)

    def near(horizon: float) -> tuple[Array, Array]:
        return Person(station.model, robot, "op", horizon=horizon).near(state, None, span)

    assert least(lambda h: bool(near(max(h, 1e-6))[0][:, column].any())) == pytest.approx(
        plain - 0.25, abs=1e-6
    )
    hit, v = near(plain)
    assert v[column] == pytest.approx(0.53, abs=1e-12)
    assert (v[~hit.any(axis=0)] == 0).all()
    given = Person(station.model, robot, "op", horizon=plain).near(state, 0.9, span)[1]
    assert (given == 0.9).all()

    def touches(way: float) -> bool:
        person = Person(station.model, robot, "op", horizon=0.1)
        return bool(person.touched(state, max(way, 0.0))[:, column].any())

    assert least(touches) == pytest.approx(plain, abs=1e-6)
    state.hearings["op"].bones = {"head": (0.05, 0.0)}
    assert least(touches) == pytest.approx(plain - 0.05, abs=1e-6)
    with pytest.raises(Undecided, match="between two ticks"):
        near(plain)


def test_one_person_is_not_several(tmp_path: Path) -> None:
    guest = (
        '[[humans]]\nname = "guest"\nstature = 1.75\nmass = 75\nsex = "male"\nat = { position = [9, 0, 0] }\n'
    )
    cell(tmp_path, -1.0)
    text = tmp_path.joinpath("workstation.toml").read_text() + guest
    model = made(tmp_path / "two", text, {"arm.urdf": two_r()}).model
    several = [
        Person(model, model.robot("arm"), *who, horizon=1.0).several for who in (("op",), ("op", "guest"))
    ]
    assert several == [False, True]


@pytest.mark.parametrize(
    ("permitted", "within", "verdict"),
    [
        (True, None, "undecided"),
        (True, "x", "undecided"),
        (False, None, "undecided"),
        (False, "x", "exceeded"),
    ],
)
def test_a_region_without_a_limit_is_never_within(permitted: bool, within: str | None, verdict: str) -> None:
    assert without_limit("Chest", permitted, within, "f")[0] == verdict
    forbidden = without_limit(SENSITIVE, permitted, within, "f")[0]
    assert forbidden == ("undecided" if within is None else "exceeded")
    assert without_limit(FEET, True, None, "f")[1] == "no limit available"


def test_a_part_reaches_a_region_from_its_skin_to_the_horizon_above_and_below(tmp_path: Path) -> None:
    """The arm at 0, ± 0.05 m thick and off by 0.02 m; the floor that people stand on is moved."""
    station = made(tmp_path, FLOATING + TWO_R, {"arm.urdf": two_r()})
    state = state_at(station, arm=((0.0, 0.0), (0.1, 0.0)))
    robot, bands = station.model.robot("arm"), heights(("standing",), (1.6, 1.9))
    zeros = np.zeros(len(station.model.bodies))
    fast = zeros + 2.0
    span = Span(
        0.0, 0.1, np.array([fast, zeros, zeros]), np.zeros((4, station.model.mj.nv)), None, station.model.mj
    )
    bodies = [
        replace(body, solids=tuple(replace(solid, deviation=0.02) for solid in body.solids))
        for body in station.model.bodies
    ]
    model = replace(station.model, bodies=tuple(bodies))
    for between, way in ((None, 0.0), (span, 0.2)):

        def reached(floor: float, between: Span | None = between) -> Array:
            reach = HeightReach(model, robot, ("standing",), (1.6, 1.9), horizon=0.3, floor=floor)
            return reach.at(state, between).all(axis=0)

        for region in ("Face", "Feet", SENSITIVE):
            low, high = bands[region]
            for floor, inward in ((-0.37 - way - high, 1e-6), (0.37 + way - low, -1e-6)):
                found = [reached(floor + step)[REGIONS.index(region)] for step in (inward, -inward)]
                assert found == [True, False], (region, floor)
        anywhere = reached(50.0)
        assert {REGIONS[k] for k in np.flatnonzero(anywhere)} >= ANYWHERE
        assert not anywhere.all()


@pytest.mark.parametrize("stature", [1.4, 1.75, 2.1])
def test_heights_are_those_of_the_leanest_and_the_heaviest_man_and_woman(stature: float) -> None:
    """From 15 to 45 kg/m², and 30 to 250 kg; the fourth corner of a flat bone lies across from its first."""
    skin: dict[str, list[float]] = {}
    for sex in ("male", "female"):
        for mass in (max(15 * stature**2, 30.0), min(45 * stature**2, 250.0)):
            who = manikin.build(name="x", stature=stature, mass=mass, sex=sex)
            rotations, positions = bone_poses(who, posture(who, "standing"))
            for k, link in enumerate(who.links[1:]):
                bone = without_side(link.name)
                regions = {FEET if region is None else region for region in BODY_REGION[bone]}
                for solid in link.solids:
                    p = solid.points
                    corners = [*p] if len(p) == 2 else [*p, p[1] + p[2] - p[0]]
                    z = [float((rotations[k] @ corner + positions[k])[2]) for corner in corners]
                    for region in regions | ({SENSITIVE} if bone in ("head", "neck") else set()):
                        skin.setdefault(region, []).extend((min(z) - solid.radius, max(z) + solid.radius))
    found = heights(("standing",), (stature, stature))
    assert found.keys() == skin.keys()
    for region, (low, high) in found.items():
        assert (low, high) == pytest.approx((min(skin[region]), max(skin[region])), abs=1e-12)
