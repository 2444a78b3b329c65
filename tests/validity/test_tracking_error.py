"""How far what devices see of a person may be off: in closed form, and what it makes of three criteria."""

from __future__ import annotations

import numpy as np
import pytest

from made_cell import FLOATING, TWO_R, made, person, state_at, two_r
from seerob.criteria.judging import Judge
from seerob.description.humans.skeleton import BONES
from seerob.distance.least import Query
from seerob.twin.accuracy.tracking_error import TrackingError, tracking
from seerob.twin.validity.hearing import EVERYWHERE, BonesHeard

PEOPLE = person("op", 3, 0, 0) + person("other", -9, 0, 0)
AREA = '[[areas]]\nname = "zone"\nshape = { box = [1, 1, 3] }\n'
MAT = (
    '[[sensors]]\nname = "mat"\npressure_mat = { corners = [[0, -0.5], [0.5, -0.5], [0.5, 0.5], [0, 0.5]] }\n'
)
SSM = """
[[safety]]
kind = "separation"
name = "ssm"
between = ["arm", "op"]
stop = { acceleration = 0, reaction = 0.01, stopping = 0.01 }
human_speed = 1.6
intrusion = 0
human_uncertainty = 0
robot_uncertainty = 0
"""
HEAD, HAND = "op/head", "op/right_hand"


def twin(folder, more=""):
    station = made(folder, FLOATING + TWO_R + PEOPLE + more, {"arm.urdf": two_r()})
    return station, state_at(station, arm=((0.0, 0.0), (0.0, 0.0)))


def off(station, state, *names):
    indices = [next(b.index for b in station.model.bodies if b.name == name) for name in names]
    return TrackingError(station.model, indices).at(state)


def reach(station, name):
    """Of a body's farthest point from its origin [m]."""
    body = next(b for b in station.model.bodies if b.name == name)
    return np.linalg.norm(body.corners, axis=1).max() + body.radius


def test_a_bone_moves_its_points_by_its_place_and_by_its_turn_times_how_far_they_are(tmp_path):
    station, state = twin(tmp_path)
    assert off(station, state, HEAD, HAND).tolist() == [0, 0]
    state.hearings["op"].bones = {"head": (0.02, 0.1), "right_hand": (None, 0.2), "left_hand": (0.3, None)}
    found = off(station, state, HEAD, HAND, "op/left_hand", "op/pelvis", "other/head", "arm/l1")
    expected = [0.02 + 0.1 * reach(station, HEAD), 0.2 * reach(station, HAND), 0.3, 0, 0, 0]
    assert found == pytest.approx(expected, rel=1e-12)


def test_one_person_that_devices_see_is_enough(tmp_path):
    station, state = twin(tmp_path)
    state.hearings["other"].bones = {"head": (0.5, 0.0)}
    assert off(station, state, HEAD, "other/head").tolist() == [0, 0.5]


def test_a_bone_that_is_not_aimed_is_on_a_circle_around_its_joint(tmp_path):
    """Points at r, turned by up to α, are off by up to the chord 2 r sin α/2, or by what is measured."""
    station, state = twin(tmp_path)
    hearing = state.hearings["op"]
    hearing.bones = {"head": (0.02, None), "right_hand": (0.01, 0.9)}
    r = reach(station, HEAD)
    for angle in (0.3, np.pi):
        hearing.bones_heard[:] = [BonesHeard(0.0, unaimed={"head": angle, "right_hand": 0.3})]
        assert off(station, state, HEAD, HAND, "op/left_hand") == pytest.approx(
            [0.02 + 2 * r * np.sin(angle / 2), 0.01 + 0.9 * reach(station, HAND), 0.0]
        )


def test_what_is_held_or_seen_elsewhere_too_may_be_farther_by_so_much(tmp_path):
    station, state = twin(tmp_path)
    hearing = state.hearings["op"]
    places = EVERYWHERE._replace(slack={"head": 0.25})
    hearing.bones = {"head": (0.02, 0.0), "right_hand": (0.01, 0.0)}
    hearing.bones_heard[:] = [BonesHeard(0.0, places=places)]
    assert off(station, state, HEAD, HAND, "other/head") == pytest.approx([0.27, 0.01, 0.0])


def test_a_twin_that_is_held_elsewhere_is_off_by_its_way_from_where_it_was_captured(tmp_path):
    """And by what devices are off from there: every bone by how far its joint is, and how it is turned."""
    station, state = twin(tmp_path)
    human, hearing = station.model.human("op"), state.hearings["op"]
    names = [f"op/{bone}" for bone in BONES]
    bodies = tuple(next(b.index for b in station.model.bodies if b.name == name) for name in names)
    q = state.q(human).copy()
    for shift, turn in (((0.3, 0.0, 0.4), 0.0), ((0.3, 0.0, 0.0), 0.5)):
        hearing.captured = q.copy()
        hearing.captured[:6] += np.array([*shift, 0.0, 0.0, turn])
        hearing.error, hearing.bones = 9.0, dict.fromkeys(BONES, (5.0, 5.0))
        hearing.residual = dict.fromkeys(BONES, (0.02, 0.0))
        state.refresh(0.0)
        R, x = state.captured("op", bodies)
        away = np.linalg.norm(x - state.positions[list(bodies)], axis=1)
        turned = np.einsum("nij,nij->n", R, state.rotations[list(bodies)])
        angle = np.arccos(np.clip((turned - 1) / 2, -1, 1))
        assert away[0] == pytest.approx(np.linalg.norm(shift), abs=1e-6)
        assert angle == pytest.approx(turn, abs=1e-6)
        expected = [
            0.02 + a + 2 * reach(station, name) * np.sin(turn / 2)
            for a, name in zip(away, names, strict=True)
        ]
        assert off(station, state, *names) == pytest.approx(expected, abs=1e-6)


def test_what_no_device_sees_is_off_by_what_the_file_accepts_or_by_more(tmp_path):
    folder, plain = tmp_path / "a", tmp_path / "b"
    for where, accepted in ((folder, 0.25), (plain, 0.0)):
        more = (
            PEOPLE.replace('sex = "male"', 'sex = "male"\nunseen_uncertainty = 0.25') if accepted else PEOPLE
        )
        station = made(where, FLOATING + more)
        state = state_at(station)
        hearing = state.hearings["op"]
        hearing.bones = {"head": (0.02, 0.0), "right_hand": (0.0, 0.0), "left_hand": (0.5, 0.0)}
        hearing.bones_heard[:] = [BonesHeard(0.0, observed=frozenset(BONES) - {"right_hand", "left_hand"})]
        assert off(station, state, HEAD, HAND, "op/left_hand", "op/pelvis", "other/head") == pytest.approx(
            [0.02, accepted, 0.5, 0.0, 0.0]
        )


def test_a_bone_between_two_that_are_seen_ends_where_its_parent_does(tmp_path):
    """An elbow of which a device says nothing: at the end of the upper arm, however that is turned."""
    station, state = twin(tmp_path)
    shoulder, elbow = (
        state.positions[next(b.index for b in station.model.bodies if b.name == f"op/left_{bone}")]
        for bone in ("upper_arm", "forearm")
    )
    arm = {"left_upper_arm": (0.01, 0.2), "left_hand": (0.03, None)}
    for unobserved in ({}, {"left_forearm": (None, None)}):
        state.hearings["op"].bones = arm | unobserved
        found = off(station, state, "op/left_forearm", "op/left_hand", "op/right_forearm")
        assert found == pytest.approx([0.01 + 0.2 * np.linalg.norm(elbow - shoulder), 0.03, 0])
    state.hearings["op"].bones = {"left_upper_arm": (0.01, 0.2)}
    assert off(station, state, "op/left_forearm") == 0


def test_the_input_that_decides_is_named_in_millimetres():
    assert str(tracking(0.0123)) == "tracking of the person ± 12.3 mm"


@pytest.mark.parametrize(
    "criterion",
    [
        AREA + '[[safety]]\nkind = "safety_area"\nname = "it"\narea = "zone"\nof = "op"\n',
        MAT + '[[safety]]\nkind = "pressure_mat"\nname = "it"\nsensor = "mat"\nof = "op"\n',
        SSM + '[[safety]]\nkind = "separation_area"\nname = "it"\nseparation = "ssm"\nof = "op"\n',
    ],
    ids=["safety_area", "pressure_mat", "separation_area"],
)
def test_the_room_is_that_of_the_nearest_and_whoever_may_be_inside_leaves_it_open(tmp_path, criterion):
    station, state = twin(tmp_path, criterion)

    def asked(**bones):
        state.hearings["op"].bones = bones
        state.refresh(0.0)
        return Judge(station.bound)(state)[-1]

    exact = asked()
    assert exact.verdict == "within"
    # The pelvis is farther than the nearest; off by 0.9 m it would still be outside, by 9 m it may be inside.
    for away, verdict, who in ((0.9, "within", exact.reason), (9.0, "undecided", "pelvis")):
        found = asked(pelvis=(away, 0.0))
        assert (found.value, found.verdict) == (exact.value, verdict)
        assert who in found.reason
    assert "within 9000 mm" in found.reason


def test_what_a_person_carries_is_off_as_its_bone_is_and_two_people_add_up(tmp_path):
    """A rod in the hand, turned and beside it, moves by the hand's place and turn times its own reach."""
    more = (
        '[[workpieces]]\nname = "rod"\non = "op/right_hand"\nshape = { box = [0.6, 0.1, 0.1] }\nmass = 1\n'
        "at = { position = [0.2, 0, 0], rpy_deg = [0, 0, 90] }\n"
        '[[areas]]\nname = "halo"\non = "op/head"\nshape = { sphere = 0.5 }\n'
        '[[areas]]\nname = "wedge"\non = "op/right_hand"\nat = { position = [-1, 0, 0] }\n'
        "shape = { polygon = [[0, 0], [3, 0], [0, 1]], height = [0, 2] }\n"
        '[[safety]]\nkind = "minimum_distance"\nname = "rod"\nbetween = ["rod", "arm"]\n'
        '[[safety]]\nkind = "minimum_distance"\nname = "both"\nbetween = ["op", "other"]\n'
        '[[safety]]\nkind = "safety_area"\nname = "halo"\narea = "halo"\nof = "other"\n'
    )
    station, state = twin(tmp_path, more)
    state.hearings["op"].bones = {"head": (0.03, 0.2), "right_hand": (0.02, 0.1)}
    state.hearings["other"].bones = {"pelvis": (0.5, 0.0)}
    rod = 0.02 + 0.1 * np.linalg.norm([0.2 + 0.05, 0.3, 0.05])
    wedge = 0.02 + 0.1 * np.linalg.norm([3 - 1, 0, 2])
    expected = [rod, 0.03 + 0.2 * 0.5, wedge]
    assert off(station, state, "rod", "halo", "wedge") == pytest.approx(expected, rel=1e-9)
    found = {result.name: result for result in Judge(station.bound)(state)}
    assert found["rod"].interval == pytest.approx((found["rod"].value - rod, found["rod"].value + rod))
    bodies = [station.model.select(name) for name in ("op", "other")]
    apart = Query(station.model.shapes, *bodies).per_pair(state.rotations, state.positions).distance
    first, second = (TrackingError(station.model, side).at(state) for side in bodies)
    errors = (first[:, None] + second).ravel()
    assert found["both"].interval == pytest.approx(((apart - errors).min(), (apart + errors).min()))
    assert found["both"].interval[0] < found["both"].value - 0.4


@pytest.mark.parametrize(("error", "verdict"), [(0.0, "within"), (0.04, "within"), (0.06, "undecided")])
def test_an_area_on_a_bone_may_be_where_the_bone_is(tmp_path, error, verdict):
    """Of 5 cm of room."""
    area = '[[areas]]\nname = "halo"\non = "op/pelvis"\nshape = {{ sphere = {} }}\n'
    area += '[[safety]]\nkind = "safety_area"\nname = "it"\narea = "halo"\nof = "arm"\n'
    station, state = twin(tmp_path / "a", area.format(0.5))
    room = Judge(station.bound)(state)[0].value
    station, state = twin(tmp_path / "b", area.format(0.5 + room - 0.05))
    state.hearings["op"].bones = {"pelvis": (error, 0.0)}
    found = Judge(station.bound)(state)[0]
    assert (found.value, found.verdict) == (pytest.approx(0.05, abs=1e-9), verdict)


@pytest.mark.parametrize(("turn", "verdict"), [(0.009, "within"), (0.011, "undecided")])
def test_the_farther_field_of_a_device_on_a_person_moves_more(tmp_path, turn, verdict):
    """Turned about its bone by 1/100: the corner at 5 m by 5 cm, which is the room there is."""
    device = (
        '[[sensors]]\nname = "scan"\non = "op/pelvis"\ncapability = 0.07\nresponse = 0.08\nsource = "sheet"\n'
        "laser_scanner = {{ range = 9, angle = 3, resolution = 0.01, fields = [\n"
        '  {{ name = "far", corners = [[0, 0], [5, 0], [0, 0.1]] }},\n'
        '  {{ name = "near", corners = [[0, 0], [0.2, 0], [0, 0.1]] }} ] }}\n'
        '[[parts]]\nname = "box"\nshape = {{ box = [0.1, 0.1, 0.1] }}\nat = {{ position = {} }}\n'
        '[[safety]]\nkind = "safety_area"\nname = "it"\narea = "scan"\nof = "box"\n'
    )
    station, state = twin(tmp_path / "a", device.format([3, 0, 9]))
    height = state.positions[next(b.index for b in station.model.bodies if b.name == "scan/far")][2]
    far = device.format([3 + 5 + 0.1, 0, float(height)])
    station, state = twin(tmp_path / "b", far)
    state.hearings["op"].bones = {"pelvis": (0.0, turn)}
    found = Judge(station.bound)(state)[0]
    assert (found.value, found.verdict) == (pytest.approx(0.05, abs=1e-3), verdict)
