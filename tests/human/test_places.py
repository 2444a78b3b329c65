"""Where a person stands has an age of its own: how all bones are turned does not tell it."""

from __future__ import annotations

import numpy as np
import pytest
from made_capture import PERSON, captured, frames_of, source, walking, workstation
from msgspec.structs import replace

from seerob.core.samples import BodyPoint, BodySample
from seerob.core.snapshot import Verdict
from seerob.core.transforms import wxyz_from_rotation
from seerob.criteria.safety.minimum_distance import MinimumDistance
from seerob.criteria.scoring.rule import bind_posture
from seerob.description.capture.estimated import located
from seerob.description.capture.following import HELD_SPEED, Following
from seerob.description.capture.mapping import conventions
from seerob.description.humans.skeleton import BONES, JOINTS, bone_poses
from seerob.devices.capture.options import Weights
from seerob.session import run as road
from seerob.session.reading import read
from seerob.session.run import Judge
from seerob.session.station import Station
from seerob.twin.engine import Engine
from seerob.twin.validity.hearing import Hearing

TIMEOUT = 0.2
POST = {"name": "post", "at": {"position": [1.6, 0.0, 1.0]}, "shape": {"box": [0.1, 1.0, 1.6]}}
CRITERIA = (
    MinimumDistance(name="whole", between=("post", "operator"), limit=0.3),
    MinimumDistance(name="hand", between=("post", "operator/right_hand"), limit=0.3),
)


def watched(*sources, criteria=CRITERIA, person=None, look=None, physics=False):
    """Tick by tick the results, and what ``look`` finds in the state."""
    station = workstation(*sources, person=person, parts=[POST], engine={"physics": physics})
    stage = Station(replace(station, safety=criteria))
    engine, judge = Engine(stage.model, driven={"operator": TIMEOUT}), Judge(stage.bound)
    told = []
    for seq, samples in enumerate(road.pump(stage.sources, 0.01)):
        engine.take(samples)
        state = engine.tick() if seq else engine.start()
        told.append((state.t, judge(state), None if look is None else look(state)))
    return told


def without_places(frames, begin, bones=BONES):
    for frame in frames[begin:]:
        frame.positions[[BONES.index(bone) for bone in bones]] = np.nan
    return frames


def posture_of(state):
    return bind_posture(state.model, "operator")(state)


def test_who_walks_on_while_only_directions_are_heard_is_undecided_and_the_posture_is_not():
    frames = without_places(frames_of(*walking(1.0)), 20)
    told = watched(source(captured(frames)), look=posture_of)
    late = [(results, found) for t, results, found in told if t > 19 / 60 + TIMEOUT + 0.01]
    assert len(late) > 40
    for results, found in late:
        assert {r.verdict for r in results} == {Verdict.UNDECIDED}
        assert "no device says where the person is" in results[0].reason
        assert np.isfinite(found.trunk_flexion)
        assert np.isfinite(found.elbow_flexion).all()


@pytest.mark.parametrize("physics", [True, False])
def test_whoever_was_never_placed_is_undecided_at_once_whatever_estimate_the_file_accepts(physics):
    frames = frames_of(*walking(0.3))
    suit = source(captured(frames), weights=Weights(position=0.0))
    told = watched(suit, person={"unseen_uncertainty": 0.3}, physics=physics)
    assert {r.verdict for _, results, _ in told for r in results} == {Verdict.UNDECIDED}


def test_a_hand_that_is_turned_and_no_longer_placed_hangs_on_an_arm_that_is_both():
    frames = without_places(frames_of(*walking(0.8)), 10, ["right_hand"])
    told = watched(source(captured(frames)))
    assert {r.verdict for _, results, _ in told[:60] for r in results} == {Verdict.WITHIN}


def test_a_hand_that_is_turned_and_no_longer_placed_is_undecided_where_nobody_sees_the_arm():
    frames = without_places(frames_of(*walking(0.8)), 10, ["right_hand"])
    arm = dict.fromkeys(("right_clavicle", "right_upper_arm", "right_forearm"), "")
    told = watched(source(captured(frames), mapping=arm), person={"unseen_uncertainty": 0.1})
    hands = [(t, results[1].verdict) for t, results, _ in told]
    assert {verdict for t, verdict in hands if t < 0.1} == {Verdict.WITHIN}
    assert {verdict for t, verdict in hands if t > 9 / 60 + TIMEOUT + 0.01} == {Verdict.UNDECIDED}


def test_what_is_held_may_have_moved_meanwhile():
    frames = frames_of(*walking(0.8), turned=False)
    lost = without_places(frames[:], 30, ["right_hand"])
    told = watched(source(captured(lost)), criteria=CRITERIA[1:])
    t, (result,), _ = next(each for each in told if each[0] >= 29 / 60 + 0.1)
    low, high = result.interval
    age = (np.ceil(t * 60) - 29) / 60
    assert high - result.value >= HELD_SPEED * age - 1e-6
    assert result.value - low >= HELD_SPEED * age - 1e-6


def test_places_go_on_over_bones_of_which_it_is_known_where_they_point():
    assert located(BONES, ()) == frozenset()
    assert located(BONES, ["left_foot"]) == frozenset(BONES)
    assert located({"pelvis"}, ["pelvis"]) == {"pelvis", "lumbar", "left_thigh", "right_thigh"}
    arm = set(BONES) - {"right_upper_arm"}
    assert located(arm, ["pelvis"]) == frozenset(BONES) - {"right_forearm", "right_hand"}


@pytest.mark.parametrize("seed", range(2))
def test_dropping_any_bones_from_any_frames_never_makes_anything_within(seed):
    dropped(seed)


def dropped(seed):
    """Judge a walk with and without some bones of some frames; `tests/soak` does so more often."""
    random = np.random.default_rng(seed)
    whole = frames_of(*walking(1.2), turned=bool(seed % 2))
    full = watched(source(captured(whole)))
    assert {r.verdict for _, results, _ in full for r in results} >= {Verdict.WITHIN, Verdict.EXCEEDED}
    frames = frames_of(*walking(1.2), turned=bool(seed % 2))
    begin = int(random.integers(5, 60))
    for frame in frames[begin:]:
        drop = random.random(len(BONES)) < random.choice([0.0, 0.3, 1.0])
        frame.positions[drop] = np.nan
        if frame.orientations is not None:
            frame.orientations[drop & (random.random(len(BONES)) < 0.5)] = np.nan
    for (_, before, _), (t, after, _) in zip(full, watched(source(captured(frames))), strict=False):
        for a, b in zip(before, after, strict=True):
            # The posture before is in a fit: it is the same but for some millimetres.
            near = a.interval or (a.value, a.value)
            assert b.verdict is not Verdict.WITHIN or near[0] >= a.limit - 0.01, (t, a, b)
            assert b.verdict is not Verdict.WITHIN or a.verdict is not Verdict.EXCEEDED, (t, a, b)


@pytest.mark.parametrize(
    ("columns", "stays", "verdict"),
    [
        (("pelvis_x [m]", "pelvis_y [m]"), "", Verdict.WITHIN),
        (("pelvis_x [m]",), "", Verdict.UNDECIDED),
        ((), "", Verdict.UNDECIDED),
        ((), "stays = true", Verdict.WITHIN),
    ],
)
def test_a_table_of_joints_that_says_no_place_decides_no_distance_unless_the_person_stays(
    tmp_path, columns, stays, verdict
):
    head = ",".join(("time [s]", *columns, "right_elbow_flexion [deg]"))
    rows = "\n".join(",".join([f"{0.1 * k:.1f}", *("0.0" for _ in columns), f"{10 * k}"]) for k in range(6))
    (tmp_path / "joints.csv").write_text(f"{head}\n{rows}\n")
    table = 'kind = "joint_angles"\nfile = "joints.csv"\nrest_at_zero = true\n'
    results = assessed(tmp_path, f"{table}{stays}")
    assert {r.verdict for r in results if r.name == "d"} == {verdict}
    assert {r.verdict for r in results if r.name == "owas"} == {Verdict.WITHIN}


@pytest.mark.parametrize(
    ("joints", "verdicts"),
    [
        (("right_elbow_flexion",), (Verdict.UNDECIDED, Verdict.UNDECIDED)),
        (
            tuple(name for name in JOINTS if not name.startswith("left_")),
            (Verdict.UNDECIDED, Verdict.UNDECIDED),
        ),
        (tuple(name for name in JOINTS if "toes" not in name), (Verdict.WITHIN, Verdict.WITHIN)),
    ],
)
def test_bones_of_which_a_table_has_no_joint_are_not_at_rest(tmp_path, joints, verdicts):
    """An arm, trunk and neck that nobody measured were at 0: upright, and within."""
    sliding = ("pelvis_x", "pelvis_y", "pelvis_z")
    head = ",".join(("time [s]", *(f"{name} [{'m' if name in sliding else 'deg'}]" for name in joints)))
    rows = "\n".join(",".join([f"{0.1 * k:.1f}", *("0.0" for _ in joints)]) for k in range(6))
    (tmp_path / "joints.csv").write_text(f"{head}\n{rows}\n")
    for more, expected in (("", verdicts), ("rest_at_zero = true\n", (Verdict.WITHIN, Verdict.WITHIN))):
        table = f'kind = "joint_angles"\nfile = "joints.csv"\nstays = true\n{more}'
        results = assessed(tmp_path, table)
        for name, verdict in zip(("d", "owas"), expected, strict=True):
            assert {r.verdict for r in results if r.name == name} == {verdict}


def test_a_bvh_without_places_of_its_root_decides_no_distance(tmp_path):
    channels = "CHANNELS 3 Zrotation Xrotation Yrotation"
    legs = "".join(
        f"JOINT {side}UpLeg {{ OFFSET {x} 0 0 {channels} JOINT {side}Leg {{ OFFSET 0 -42 0 {channels} JOINT "
        f"{side}Foot {{ OFFSET 0 -41 0 {channels} End Site {{ OFFSET 0 -5 12 }} }} }} }}\n"
        for side, x in (("Left", 10), ("Right", -10))
    )
    spine = (
        f"JOINT Spine {{ OFFSET 0 10 0 {channels} JOINT Neck {{ OFFSET 0 40 0 {channels} JOINT Head {{ "
        f"OFFSET 0 10 0 {channels} End Site {{ OFFSET 0 20 0 }} }} }} }}\n"
    )
    for place, verdict in (("", {Verdict.UNDECIDED}), ("Xposition Yposition Zposition ", {Verdict.WITHIN})):
        count = 6 if place else 3
        text = f"HIERARCHY\nROOT Hips {{ OFFSET 0 0 0 CHANNELS {count} {place}Zrotation Xrotation Yrotation\n"
        frame = " ".join((["0 90 0"] if place else []) + ["0"] * 3 * 10)
        motion = "\n".join([frame] * 8)
        whole = f"{text}{legs}{spine}}}\nMOTION\nFrames: 8\nFrame Time: 0.05\n{motion}\n"
        whole = whole.replace("{ ", "{\n").replace(" }", "\n}").replace(" JOINT", "\nJOINT")
        whole = whole.replace(" CHANNELS", "\nCHANNELS").replace(" End Site", "\nEnd Site")
        (tmp_path / "motion.bvh").write_text(whole)
        results = assessed(tmp_path, 'kind = "bvh"\nfile = "motion.bvh"\nunit = "cm"\nup = "y"', part="head")
        assert {r.verdict for r in results if r.name == "d"} == verdict


def assessed(folder, table, part=""):
    """Results of all ticks of a person whom a file moves, 3 m from a post."""
    body = f"op/{part}" if part else "op"
    (folder / "cell.toml").write_text(
        f"""
[[humans]]
name = "op"
stature = 1.75
mass = 75
sex = "male"
[[parts]]
name = "post"
at = {{ position = [3.0, 0.0, 1.0] }}
shape = {{ box = [0.1, 0.1, 0.1] }}
[[sources]]
human = "op"
{table}
[[safety]]
kind = "minimum_distance"
name = "d"
between = ["post", "{body}"]
limit = 0.5
[[ergonomics]]
kind = "owas"
name = "owas"
human = "op"
action_category = 4
phases = [{{ load = 0, legs = "standing" }}]
[[confirmed]]
key = "ergonomics[0].action_category"
of = "owas"
value = 4
why = "only what is not known keeps it from being within"
"""
    )
    stage = Station(read(folder / "cell.toml"))
    engine, judge = Engine(stage.model, driven={"op": TIMEOUT}), Judge(stage.bound)
    told = []
    for seq, samples in enumerate(road.pump(stage.sources, 0.01)):
        engine.take(samples)
        told += judge(engine.tick() if seq else engine.start())
    return told


@pytest.mark.parametrize("name", sorted(conventions()))
def test_of_every_device_lost_places_leave_nobody_placed_and_nothing_of_it_is_within(name):
    """Every layout that ships (suits, cameras, markers, trackers), with orientations that go on."""
    t, q = walking(1.0)
    R, p = bone_poses(PERSON, q)
    rows = {place.bone: place for place in conventions()[name].places.values() if place.position}
    following = Following(PERSON, np.eye(4), TIMEOUT)
    hearing = Hearing(given=False, driven=True, timeout=TIMEOUT)
    before = None
    for k, instant in enumerate(t):
        points = tuple(
            BodyPoint(
                name=bone,
                bone=bone,
                at=tuple((1.75 * place.at).tolist()),
                position=tuple((p[k, i] + R[k, i] @ (1.75 * place.at)).tolist()) if k < 20 else None,
                wxyz=tuple(wxyz_from_rotation(R[k, i]).tolist()),
                position_weight=place.position,
                orientation_weight=1.0,
            )
            for bone, place in rows.items()
            for i in [BONES.index(bone)]
        )
        following.hear(BodySample(source=name, target="operator", seq=k, t=float(instant), points=points))
        for found in following.until(float(instant)):
            hearing.follow(found)
        if k == 19:
            before = set(hearing.unplaced(float(instant)))
    assert before == set()
    known = set(BONES) - set(hearing.unobserved(t[-1]))
    assert known
    assert set(hearing.unplaced(t[-1])) == known
    assert "no device says where" in hearing.displaced(t[-1])


@pytest.mark.parametrize(("apart", "doubt"), [(0.1, False), (0.6, True)])
def test_what_two_devices_see_apart_widens_distances_or_is_in_doubt(apart, doubt):
    t, q = walking(0.3)
    one, other = frames_of(t, q, turned=False), frames_of(t, q, turned=False)
    for frame in other:
        frame.positions[BONES.index("right_hand")] += [0.0, 0.0, apart]
    weaker = source(captured(other), name="other", weights=Weights(position=0.25))
    told = watched(source(captured(one)), weaker, criteria=CRITERIA[1:])
    for instant, (result,), _ in told[1:]:
        if doubt:
            assert result.verdict is Verdict.UNDECIDED, instant
            assert "apart" in result.reason
        else:
            assert result.value - result.interval[0] >= apart - 0.01
            assert result.interval[1] - result.value >= apart - 0.01
