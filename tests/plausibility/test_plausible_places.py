"""Where a live source puts a person is looked at when it is heard, and held until it is plausible once."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from msgspec import structs

from made_cell import FLOATING, TWO_R, heard, made, person, two_r
from seerob.core.samples import BodyPoint, BodySample, Quality
from seerob.core.verdict import Verdict
from seerob.criteria.judging import Judge
from seerob.criteria.plausible_places import AGAIN, LASTS, PlausiblePlaces, _no_farther
from seerob.description.humans.manikin import build
from seerob.description.humans.skeleton import BONES, bone_poses
from seerob.devices.sources.csv import Csv
from seerob.devices.sources.joint_angles import JointAngleFile
from seerob.devices.sources.keyframes import Keyframes
from seerob.devices.sources.mvn import Mvn
from seerob.twin.engine import Engine
from seerob.workstation.source import Source

CELL = (
    FLOATING.replace("{ ", "{ physics = false, ")
    + TWO_R
    + "q = [0, 0]\n"
    + person("op", 3.0, 0, 0)
    + """
[[parts]]
name = "table"
shape = { box = [0.8, 1.4, 0.74] }
at = { position = [5.5, 0, 0.37] }
[[sources]]
kind = "mvn"
human = "op"
[[safety]]
kind = "minimum_distance"
name = "distance"
between = ["arm", "op"]
limit = 0.1
"""
)

PERSON = build(name="op", stature=1.75, mass=75, sex="male")

LIVE = 'kind = "ros_tcp"\nrobot = "arm"\nhost = "127.0.0.1"'


def results(folder, shifts, *, more="", text=CELL):
    """Verdicts and reasons with the person moved by each of the shifts [m] for 1.2 s each."""
    station = made(folder, text + more, {"arm.urdf": two_r()})
    human = station.model.mechanisms["op"]
    engine = Engine(station.model, driven={"op": 1.0}, live={"op"})
    judge, found, state = Judge(station.bound, station.model.findings), [], None
    for shift in shifts:
        for _ in range(120):
            t = 0.01 * len(found)
            q = human.home + np.concatenate([shift, np.zeros(len(human.home) - 3)])
            engine.take([heard("op", t, q, np.zeros(len(q)))])
            state = engine.start() if state is None else engine.tick()
            (result,) = judge(state)
            found.append((result.verdict, result.reason))
    return found


@pytest.mark.parametrize(
    ("shift", "why"),
    [
        ([0, 0, 0], ""),
        ([15, 0, 0], "robots[0].nobody_within"),
        ([0, 0, 1.0], "humans[0].feet"),
        ([2.5, 0, 0], "humans[0].inside.table"),
    ],
)
def test_where_a_device_puts_somebody_is_looked_at(tmp_path, shift, why):
    found = results(tmp_path, [shift])
    assert {verdict for verdict, _ in found} == {Verdict.UNDECIDED if why else Verdict.WITHIN}
    assert all(why in reason for _, reason in found)


STOOD = '[[parts]]\nname = "{0}"\nshape = {{ box = [1, 1, {1}] }}\nat = {{ position = [9, 0, {2}] }}\n'
UNSEEN = "nothing is drawn that stands at z = 0: nobody looks at what op stands on"


@pytest.mark.parametrize(
    ("low", "more", "held", "told"),
    [
        (-1.0, "", False, True),
        (-1.49, "", False, True),
        (-1.52, "", True, True),
        (-1.52, STOOD.format("crate", 0.4, -0.8), False, True),
        (-3.0, STOOD.format("crate", 0.4, -0.8), True, True),
        (-1.0, STOOD.format("floor", 0.1, 0.05), True, False),
        (0.0, "", False, False),
        (-0.04, "", False, False),
    ],
)
def test_who_is_below_all_that_stands_is_held_and_told_of_where_no_floor_is_drawn(
    tmp_path, low, more, held, told
):
    """Without a floor the origin may be at the base of the robot, on a bench; no bench is 1.5 m high."""
    text = FLOATING + TWO_R + "q = [0, 0]\n" + person("op", 3, 0, low) + CELL[CELL.index("[[safety]]") :]
    station = made(tmp_path, text + more, {"arm.urdf": two_r()})
    assert any(UNSEEN in f.text and not f.holds for f in station.model.findings) is told
    found = station.run().results["distance"]
    assert found.verdict is (Verdict.UNDECIDED if held else Verdict.WITHIN)
    key = "feet" if "floor" in more else "feet_below"
    assert (f"humans[0].{key} =" in found.worst().reason) is held
    if held:
        depth = low - min(0.0, -1.0 if "crate" in more else 0.0)
        said = f'key = "humans[0].{key}"\nof = "op"\nvalue = {depth}\nwhy = "a pit"\n'
        confirmed = made(tmp_path, f"{text}{more}[[confirmed]]\n{said}", {"arm.urdf": two_r()})
        assert confirmed.run().results["distance"].verdict is Verdict.WITHIN


def test_who_is_put_below_all_that_stands_by_a_device_is_held(tmp_path):
    """As whoever the file puts there; who comes up again, from a pit that nobody drew, is not."""
    text = re.sub(r"\[\[parts\]\].*?(?=\[\[sources)", "", CELL, flags=re.DOTALL)
    assert "op stands on where a source puts them" in "".join(
        f.text for f in made(tmp_path, text, {"arm.urdf": two_r()}).model.findings
    )
    found = results(tmp_path, [[0, 0, -2.0], [0, 0, -1.0]], text=text)
    assert found[0][0] is Verdict.UNDECIDED
    assert "humans[0].feet_below" in found[0][1]
    assert found[-1][0] is Verdict.WITHIN


def test_what_is_plausible_once_is_not_held_any_more(tmp_path):
    """Who comes in from far away, and then stands on something that is not drawn."""
    found = results(tmp_path, [[15, 0, 0], [1, 0, 0], [1, 0, 1.0]])
    verdicts = [verdict for verdict, _ in found]
    assert set(verdicts[:120]) == {Verdict.UNDECIDED}
    assert set(verdicts[210:240]) == set(verdicts[330:]) == {Verdict.WITHIN}


@pytest.mark.parametrize("away", [0.6, -0.6])
def test_who_floats_later_is_held_until_there_is_ground_again(tmp_path, away):
    """A capture that drifts up or down, long after feet were on the floor; what lasts a moment is a step."""
    found = results(tmp_path, [[0, 0, 0], [0, 0, away], [0, 0, 0], *[[0, 0, away]] * 4, *[[0, 0, 0]] * 2])
    verdicts = [verdict for verdict, _ in found]
    assert set(verdicts[30:120] + verdicts[150:240] + verdicts[270:360]) == {Verdict.WITHIN}
    held = found[360 + round(100 * (LASTS + AGAIN)) + 1 : 840]
    assert {verdict for verdict, _ in held} == {Verdict.UNDECIDED}
    assert all("humans[0].feet" in reason for _, reason in held)
    assert set(verdicts[-100:]) == {Verdict.WITHIN}


@pytest.mark.parametrize(("value", "verdict"), [(20.0, Verdict.WITHIN), (12.0, Verdict.UNDECIDED)])
def test_it_is_confirmed_up_to_a_value(tmp_path, value, verdict):
    own = (
        f'[[confirmed]]\nkey = "robots[0].nobody_within"\nof = "arm"\nvalue = {value}\nwhy = "a long hall"\n'
    )
    assert {v for v, _ in results(tmp_path, [[15, 0, 0]], more=own)} == {verdict}


@pytest.mark.parametrize(
    ("confirmed", "verdict"), [(-0.4, Verdict.WITHIN), (0.4, Verdict.UNDECIDED), (-0.2, Verdict.UNDECIDED)]
)
def test_it_is_confirmed_to_one_side_only(tmp_path, confirmed, verdict):
    """Who may stand 0.4 m above the floor does not sink 0.3 m into it, nor the other way round."""
    own = f'[[confirmed]]\nkey = "humans[0].feet"\nof = "op"\nvalue = {confirmed}\nwhy = "a platform"\n'
    assert {v for v, _ in results(tmp_path, [[0, 0, -0.3]], more=own)} == {verdict}


def test_what_is_in_doubt_is_no_place_that_is_plausible(tmp_path):
    """Samples that their source calls degraded, before those that put the person 15 m away."""
    station = made(tmp_path, CELL, {"arm.urdf": two_r()})
    human = station.model.mechanisms["op"]
    engine = Engine(station.model, driven={"op": 1.0}, live={"op"})
    judge, found, state = Judge(station.bound, station.model.findings), [], None
    for k in range(300):
        q = human.home + np.concatenate([[0.0 if k < 50 else 15.0], np.zeros(len(human.home) - 1)])
        quality = Quality.DEGRADED if k < 50 else Quality.GOOD
        engine.take([heard("op", 0.01 * k, q, np.zeros(len(q)), quality=quality)])
        state = engine.start() if state is None else engine.tick()
        (result,) = judge(state)
        found.append(result)
    assert {result.verdict for result in found} == {Verdict.UNDECIDED}
    assert "robots[0].nobody_within" in found[-1].reason


SLIDE = """<robot name="slide"><link name="base"/><link name="cart"><inertial><mass value="1"/>
<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><geometry><box size="0.2 0.2 0.2"/></geometry></collision></link>
<joint name="j" type="prismatic"><parent link="base"/><child link="cart"/><axis xyz="1 0 0"/>
<limit lower="-50" upper="50" effort="1000" velocity="10"/></joint></robot>"""


@pytest.mark.parametrize(("away", "verdict"), [(0.0, Verdict.WITHIN), (-20.0, Verdict.UNDECIDED)])
def test_where_a_device_puts_a_robot_is_looked_at_too(tmp_path, away, verdict):
    """A carriage that is said to be 20 m off, as one whose unit was mistaken is."""
    text = CELL.replace("q = [0, 0]\n", "").replace('kind = "mvn"\nhuman = "op"', LIVE)
    station = made(tmp_path, text, {"arm.urdf": SLIDE})
    engine = Engine(station.model, driven={"arm": 1.0}, live={"arm"})
    judge, found, state = Judge(station.bound, station.model.findings), [], None
    for k in range(20):
        engine.take([heard("arm", 0.01 * k, [away], [0.0])])
        state = engine.start() if state is None else engine.tick()
        found.append(judge(state)[0])
    assert {result.verdict for result in found} == {verdict}
    assert all(("robots[0].nobody_within" in r.reason) is (verdict is Verdict.UNDECIDED) for r in found)


def verdicts(station, steps, *, live=("op",)):
    """Results of one criterion at each tick of 10 ms: what is heard of whom, or None for nothing."""
    engine = Engine(station.model, driven=dict.fromkeys(live, 0.05), live={*live})
    judge, found, state = Judge(station.bound, station.model.findings), [], None
    for samples in steps:
        engine.take(list(samples))
        state = engine.start() if state is None else engine.tick()
        found.append(judge(state)[0])
    return found


def test_what_is_implausible_is_looked_at_again_after_a_second_and_at_no_tick_before(tmp_path):
    """A carriage that comes back from 12 m away at 9 m/s, and is 10 m away after a quarter of a second."""
    text = CELL.replace("q = [0, 0]\n", "").replace('kind = "mvn"\nhuman = "op"', LIVE)
    station = made(tmp_path, text, {"arm.urdf": SLIDE})
    places = [min(0.0, -9.5 + 0.09 * k) for k in range(130)]
    steps = [[heard("arm", 0.01 * k, [x], [9.0 if x else 0.0])] for k, x in enumerate(places)]
    found = verdicts(station, steps, live=("arm",))
    held = ["nobody_within" in result.reason for result in found]
    assert held == [k < 100 for k in range(130)]


def test_a_number_is_confirmed_by_numbers_and_by_its_own_name(tmp_path):
    """Two confirmations, of which one is of another figure and one of words."""
    key = 'key = "robots[0].nobody_within"\nof = "arm"\nwhy = "a long hall"\n'
    other = '[[confirmed]]\nkey = "humans[0].feet"\nof = "op"\nvalue = 90.0\nwhy = "a platform"\n'
    assert {v for v, _ in results(tmp_path, [[15, 0, 0]], more=other)} == {Verdict.UNDECIDED}
    both = other + f"[[confirmed]]\n{key}value = 20.0\n"
    assert {v for v, _ in results(tmp_path, [[15, 0, 0]], more=both)} == {Verdict.WITHIN}


@pytest.mark.parametrize(("away", "verdict"), [(0.0, Verdict.WITHIN), (-20.0, Verdict.UNDECIDED)])
def test_where_a_file_of_motion_puts_a_robot_is_looked_at_as_where_a_device_does(tmp_path, away, verdict):
    """A carriage that a log has 20 m away from everybody."""
    file = 'kind = "csv"\nrobot = "arm"\nfile = "m.csv"'
    text = CELL.replace("q = [0, 0]\n", "").replace('kind = "mvn"\nhuman = "op"', file)
    rows = "t [s],j1 [m],qd_j1 [m/s]\n" + "".join(f"{0.01 * k:.2f},{away},0\n" for k in range(5))
    urdf = SLIDE.replace('name="j"', 'name="j1"')
    found = made(tmp_path, text, {"arm.urdf": urdf, "m.csv": rows}).run().results["distance"]
    assert found.verdict is verdict
    assert ("robots[0].nobody_within" in found.worst().reason) is (verdict is Verdict.UNDECIDED)


@pytest.mark.parametrize(("value", "confirmed", "no_farther"), [
    (0.3, 0.3, True), (-0.3, -0.3, True), (0.3, 0.2, False), (-0.3, -0.2, False), (0.2, -0.3, False),
])  # fmt: skip
def test_up_to_the_value_that_was_confirmed_and_at_it(value, confirmed, no_farther):
    assert _no_farther(value, confirmed) is no_farther


@pytest.mark.parametrize(
    ("source", "waits"),
    [
        (Source(), False),
        (Keyframes(human="op", file="m.toml"), False),  # asked where it begins, when it is opened
        (JointAngleFile(human="op", file="m.mot"), True),
        (Mvn(human="op"), True),
        (Mvn(human="other"), False),
        (Csv(robot="arm", file="m.csv"), True),
    ],
)
def test_it_waits_for_whom_a_device_or_a_capture_places(tmp_path, source, waits):
    model = made(tmp_path, CELL, {"arm.urdf": two_r()}).model
    asked = PlausiblePlaces(replace(model, workstation=structs.replace(model.workstation, sources=(source,))))
    assert asked.waits is waits


@pytest.mark.parametrize(("seen", "told"), [(("head", "left_hand", "right_hand"), True), (BONES, False)])
def test_whose_legs_nobody_sees_is_told_to_be_fitted(tmp_path, seen, told):
    """Feet that nobody sees are where the file's stature has them: `at.position` is not what is wrong."""
    stage = made(tmp_path, CELL, {"arm.urdf": two_r()})
    human = stage.model.mechanisms["op"]
    engine = Engine(stage.model, driven={"op": 1.0}, live={"op"})
    looked, found = PlausiblePlaces(stage.model), None
    for k in range(3):
        q = human.home.copy()
        q[2] += 1.0
        places = bone_poses(PERSON, q)[1] + [3.0, 0, 0]
        points = tuple(
            BodyPoint(name=bone, bone=bone, position=tuple(places[BONES.index(bone)].tolist()))
            for bone in seen
        )
        engine.take([BodySample(source="mvn", target="op", seq=k, t=0.01 * k, points=points)])
        state = engine.start() if k == 0 else engine.tick()
        found = looked.at(state) or found
    (finding,) = found
    assert "humans[0].feet" in finding.text
    assert ("fit the person to the wearer" in finding.text) is told
