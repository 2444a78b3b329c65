"""What is lost of a person leaves the rest: the left side is scored while the right arm is not seen."""

from __future__ import annotations

import numpy as np
import pytest
from made_capture import captured, frames_of, play, source, walking, workstation

from seerob.core.errors import Undecided
from seerob.criteria.scoring.rule import bind_posture
from seerob.description.capture.estimated import invalid_with
from seerob.description.humans.skeleton import BONES
from seerob.session import run as road
from seerob.session.station import Station
from seerob.twin.engine import Engine

ARM = ("right_upper_arm", "right_forearm", "right_hand")


def blind(frames, bones, begin=20):
    """The same without some bones from a frame on."""
    for frame in frames[begin:]:
        for bone in bones:
            frame.positions[BONES.index(bone)] = np.nan
    return frames


def last_state(recording, **options):
    station = Station(workstation(source(recording, **options)))
    engine = Engine(station.model, driven={"operator": 0.2})
    for seq, samples in enumerate(road.pump(station.sources, 0.01)):
        engine.take(samples)
        state = engine.tick() if seq else engine.start()
    return state


def test_the_left_side_is_measured_while_the_right_arm_is_lost():
    state = last_state(captured(blind(frames_of(*walking(), turned=False), ARM)), hold=0.3)
    found = bind_posture(state.model, "operator")(state)
    assert np.isnan(found.shoulder_flexion[0])
    assert np.isnan(found.elbow_flexion[0])
    assert np.isnan(found.wrist_flexion[0])
    assert np.isfinite(found.shoulder_flexion[1])
    assert np.isfinite(found.elbow_flexion[1])
    assert np.isfinite(found.trunk_flexion)
    assert np.isfinite(found.knee_flexion).all()


def test_distances_to_the_person_are_undecided_meanwhile():
    state = last_state(captured(blind(frames_of(*walking(), turned=False), ARM)), hold=0.3)
    with pytest.raises(Undecided, match="not seen any more: right_upper_arm, right_forearm, right_hand"):
        state.require("operator")


def test_all_of_it_comes_back():
    frames = frames_of(*walking(), turned=False)
    seen = [frame.positions.copy() for frame in frames]
    blind(frames, ARM)
    for frame, positions in zip(frames[60:], seen[60:], strict=True):
        frame.positions[:] = positions
    told = play(source(captured(frames), hold=0.18))
    lost = [t for t, doubt, *_ in told if doubt]
    assert 19 / 60 + 0.15 < min(lost) < 19 / 60 + 0.23
    # The arm swings back into the place where it is seen again.
    assert max(lost) < 1.2
    assert max(speed for *_, speed, _ in told) < 15.0


def test_a_person_who_is_lost_altogether_is_not_scored():
    state = last_state(
        captured(blind(frames_of(*walking(), turned=False), [b for b in BONES if b != "head"]))
    )
    with pytest.raises(Undecided):
        state.require("operator")


@pytest.mark.parametrize(
    ("lost", "seen", "doubted"),
    [
        ("right_hand", set(BONES), {"right_hand", "right_forearm"}),
        ("right_forearm", set(BONES), {"right_forearm", "right_upper_arm"}),
        ("left_thigh", set(BONES), {"left_thigh"}),
        ("left_shank", {"pelvis"}, {"left_shank", "left_thigh", "left_foot", "left_toes"}),
        ("pelvis", set(BONES), {"pelvis"}),
        ("head", set(BONES), {"head", "neck"}),
        ("right_clavicle", {"thorax"}, {"right_clavicle", *ARM}),
        ("right_upper_arm", {"right_hand"}, {"right_upper_arm", "right_clavicle", "right_forearm"}),
    ],
)
def test_what_is_in_doubt_with_a_bone(lost, seen, doubted):
    assert set(invalid_with(lost, seen)) == doubted
