"""What no device sees is not known: neither distances nor scores are made of it, with physics or without."""

from __future__ import annotations

from itertools import chain, combinations

import numpy as np
import pytest
from made_capture import captured, frames_of, source, walking, workstation
from msgspec.structs import replace

from seerob.core.errors import Undecided
from seerob.core.snapshot import Verdict
from seerob.criteria.safety.minimum_distance import MinimumDistance
from seerob.criteria.safety.velocity import Velocity
from seerob.criteria.scoring.rule import bind_posture
from seerob.description.capture.estimated import estimated
from seerob.description.humans.skeleton import BONES, PARENTS
from seerob.devices.capture.options import Weights
from seerob.session import run as road
from seerob.session.run import Judge
from seerob.session.station import Station
from seerob.twin.accuracy.tracking_error import TrackingError
from seerob.twin.engine import Engine
from seerob.twin.validity.hearing import BonesHeard, Hearing

RIGHT = ("right_clavicle", "right_upper_arm", "right_forearm", "right_hand")
UPPER = ("pelvis", "lumbar", "thorax", "neck", "head", *RIGHT)
TRACKERS = ("pelvis", "left_foot", "right_foot", "left_hand", "right_hand")
BOX = {"shape": {"box": [0.1, 0.1, 0.1]}}


def seen_only(bones, *, ticks=2, person=None, weights=None, physics=True, criteria=(), at=(3.0, 0.0, 1.0)):
    """The twin after some ticks of a device that sees some bones, and what criteria say."""
    frames = frames_of(*walking())
    for frame in frames:
        for k, bone in enumerate(BONES):
            if bone not in bones:
                frame.positions[k] = np.nan
                frame.orientations[k] = np.nan
    if weights is None:
        mapping = {bone: "" for bone in BONES if bone not in bones}
        made = source(captured(frames), mapping=mapping)
    else:
        made = source(captured(frames_of(*walking())), weights=Weights(bones=weights))
    part = {"name": "post", "at": {"position": list(at)}, **BOX}
    station = workstation(made, person=person, parts=[part], engine={"physics": physics})
    stage = Station(replace(station, safety=tuple(criteria)))
    engine, judge = Engine(stage.model, driven={"operator": 0.2}), Judge(stage.bound)
    results = ()
    for seq, samples in enumerate(road.pump(stage.sources, 0.01)):
        engine.take(samples)
        state = engine.tick() if seq else engine.start()
        results = judge(state)
        if seq + 1 == ticks:
            break
    return state, results


def distance(to="operator", limit=0.3):
    return MinimumDistance(name=f"distance to {to}", between=("post", to), limit=limit)


def test_a_bone_is_told_by_neighbours_on_both_sides_only():
    assert estimated(BONES) == ()
    assert estimated(()) == BONES
    for bone in BONES:
        ends = bone not in PARENTS.values() and "toes" not in bone
        lonely = estimated(set(BONES) - {bone})
        assert lonely == ((bone,) if ends else ()), bone
    for upper, lower in PARENTS.items():
        if lower in PARENTS and not {upper, lower} & {"pelvis", "thorax"} and "toes" not in upper:
            assert {upper, lower} <= set(estimated(set(BONES) - {upper, lower})), (upper, lower)


def test_more_seen_is_never_less_known():
    few = ("pelvis", "thorax", "left_upper_arm", "right_upper_arm", "left_thigh", "right_thigh", "head")
    sets = [frozenset(s) for s in chain.from_iterable(combinations(few, n) for n in range(1, len(few) + 1))]
    for one in sets:
        for bone in few:
            assert set(estimated(one | {bone})) <= set(estimated(one))


def test_hips_and_shoulders_of_a_picture_tell_the_trunk():
    joints = {f"{s}_{b}" for s in ("left", "right") for b in ("thigh", "shank", "foot", "upper_arm", "hand")}
    assert estimated({*joints, "head"}) == ()
    assert "pelvis" in estimated({bone for bone in joints if "arm" not in bone and "hand" not in bone})


@pytest.mark.parametrize(
    "sets",
    [[set()], [BONES, set()], [set(), BONES], [UPPER, set(BONES) - set(UPPER)]],
    ids=["nothing", "nothing next", "nothing before", "nothing twice"],
)
def test_who_is_not_seen_at_two_instants_alike_is_not_seen_between_them(sets):
    said = [BonesHeard(0.1 * k, observed=frozenset(seen)) for k, seen in enumerate(sets)]
    assert Hearing(given=False, driven=True, bones_heard=said).unobserved(0.05) == BONES
    assert Hearing(given=False, driven=True).unobserved(0.05) == ()


@pytest.mark.parametrize("physics", [True, False])
@pytest.mark.parametrize("ticks", [1, 3])
def test_the_person_is_undecided_and_a_seen_bone_is_not(physics, ticks):
    criteria = (distance(), distance("operator/left_hand"), distance("operator/right_hand"))
    _, (whole, left, right) = seen_only(UPPER, ticks=ticks, physics=physics, criteria=criteria)
    assert whole.verdict is left.verdict is Verdict.UNDECIDED
    assert "no device sees left_clavicle" in whole.reason
    assert right.verdict is Verdict.WITHIN


@pytest.mark.parametrize("physics", [True, False])
@pytest.mark.parametrize("ticks", [1, 3])
def test_an_arm_that_nobody_sees_is_not_scored(physics, ticks):
    state, _ = seen_only(UPPER, ticks=ticks, physics=physics)
    found = bind_posture(state.model, "operator")(state)
    assert np.isfinite(found.elbow_flexion[0])
    assert np.isfinite(found.trunk_flexion)
    assert np.isnan(found.elbow_flexion[1])
    assert np.isnan(found.knee_flexion).all()


def test_the_waist_alone_tells_no_trunk_and_five_trackers_no_person():
    state, (result,) = seen_only(TRACKERS, criteria=(distance(),))
    found = bind_posture(state.model, "operator")(state)
    assert np.isnan(found.trunk_flexion)
    assert np.isnan(found.elbow_flexion).all()
    assert np.isnan(found.knee_flexion).all()
    assert result.verdict is Verdict.UNDECIDED
    with pytest.raises(Undecided, match="no device sees lumbar, thorax, neck, head"):
        state.require("operator")


@pytest.mark.parametrize("physics", [True, False])
def test_the_speed_of_a_bone_needs_that_bone_alone(physics):
    criteria = [Velocity(name=at, at=f"operator/{at}", limit=9.0) for at in ("pelvis", "left_hand", "head")]
    _, results = seen_only(TRACKERS, ticks=3, physics=physics, criteria=criteria)
    pelvis, hand, head = (result.verdict for result in results)
    assert (pelvis, hand, head) == (Verdict.WITHIN, Verdict.WITHIN, Verdict.UNDECIDED)


def test_what_is_seen_exceeds_by_itself():
    state, _ = seen_only(TRACKERS)
    hand = next(k for k, body in enumerate(state.model.bodies) if body.name == "operator/right_hand")
    _, (result,) = seen_only(TRACKERS, criteria=(distance(),), at=state.positions[hand].tolist())
    assert result.verdict is Verdict.EXCEEDED
    assert "right" in result.reason


def test_an_accepted_estimate_widens_the_distance_by_its_uncertainty():
    criteria = (distance(), distance("operator/right_hand"))
    _, (whole, hand) = seen_only(UPPER, person={"unseen_uncertainty": 0.3}, criteria=criteria)
    assert whole.verdict is hand.verdict is Verdict.WITHIN
    # The nearest bone is one of those that nobody sees, but for a micrometre.
    assert whole.interval[0] == pytest.approx(whole.value - 0.3, abs=1e-5)
    assert hand.interval is None or hand.interval[0] > hand.value - 0.1
    near = (distance(limit=whole.value - 0.1),)
    _, (open_,) = seen_only(UPPER, person={"unseen_uncertainty": 0.3}, criteria=near)
    assert open_.verdict is Verdict.UNDECIDED


def test_other_figures_of_an_accepted_estimate_stay_undecided():
    state, _ = seen_only(UPPER, person={"unseen_uncertainty": 0.3})
    index = {body.name: k for k, body in enumerate(state.model.bodies)}
    state.fastest_point(index["operator/right_hand"])
    with pytest.raises(Undecided, match="no device sees"):
        state.fastest_point(index["operator/left_hand"])
    with pytest.raises(Undecided, match="no device sees"):
        state.mass_matrix(state.model.mechanisms["operator"])


def test_a_weight_of_nought_is_as_good_as_not_mapped():
    unobserved = dict.fromkeys((bone for bone in BONES if bone not in UPPER), 0.0)
    named, _ = seen_only(UPPER, ticks=40)
    state, _ = seen_only(UPPER, ticks=40, weights=unobserved)
    assert state.invalid_bones("operator") == named.invalid_bones("operator") == estimated(UPPER)
    assert state.input_reason("operator") == ""


def test_a_person_whom_a_device_sees_whole_is_decided():
    _, (result,) = seen_only([bone for bone in BONES if "toes" not in bone], criteria=(distance(),))
    assert result.verdict is Verdict.WITHIN


def test_a_bone_between_two_that_are_seen_widens_the_distance_by_what_its_lengths_allow():
    """No device sees an elbow: the upper arm tells it by how it is turned; places alone leave a circle."""
    turned = [bone for bone in BONES if "toes" not in bone and bone != "left_forearm"]
    state, (result,) = seen_only(turned, criteria=(distance(),))
    assert result.verdict is Verdict.WITHIN
    gap = state.model.gap(state.model.select("operator"), state.model.select("post"))
    off = TrackingError(state.model, gap.a)
    assert off.at(state).max() < 0.05
    errors = state.hearings["operator"].bones
    state.hearings["operator"].bones = {bone: (place, None) for bone, (place, _) in errors.items()}
    rows = {state.model.bodies[i].name: k for k, i in enumerate(gap.a)}
    found = off.at(state)
    assert found[rows["operator/left_forearm"]] == found[rows["operator/left_upper_arm"]] > 0.03
    assert found[rows["operator/right_forearm"]] < 0.02


@pytest.mark.parametrize(
    ("gone", "angle"), [("foot", "knee_flexion"), ("hand", "elbow_flexion"), ("hand", "arm_rise")]
)
def test_of_a_limb_that_ends_out_of_sight_no_angle_is_made(gone, angle):
    """A camera that sees knees and no ankles does not know how the knees are bent."""
    frames = frames_of(*walking(0.3), turned=False)
    centres = Weights(orientation=0.0)
    whole = source(captured(frames), weights=centres)
    cut = source(
        captured(frames),
        weights=centres,
        mapping={f"{s}_{b}": "" for s in ("left", "right") for b in (gone, "toes")},
    )
    for made, known in ((whole, True), (cut, False)):
        stage = Station(workstation(made))
        engine = Engine(stage.model, driven={"operator": 0.2})
        engine.take(next(iter(road.pump(stage.sources, 0.01))))
        found = getattr(bind_posture(stage.model, "operator")(engine.start()), angle)
        assert np.isfinite(found).all() == known
    (said,) = [
        f.text for _, o in stage.sources for f in o.findings if f.text.startswith("no verdict rests on")
    ]
    assert {"foot": "right_shank", "hand": "right_forearm"}[gone] in said
