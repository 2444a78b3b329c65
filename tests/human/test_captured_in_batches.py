"""Arrays of a person whom devices see say no more than a run does of what they see."""

from __future__ import annotations

import numpy as np
import pytest
from made_capture import captured, frames_of, source, walking, workstation

from seerob.core.snapshot import Verdict
from seerob.recording.series import CODES
from seerob.session import run as road
from seerob.session.run import Judge
from seerob.session.station import Station

PART = {"name": "post", "shape": {"box": [0.1, 0.1, 3.0]}, "at": {"position": [4.0, 0, 1.5]}}
SAFETY = [
    {"kind": "minimum_distance", "name": "distance", "between": ["operator/right_hand", "post"]},
    {"kind": "minimum_distance", "name": "trunk", "between": ["operator/thorax", "post"], "limit": 0.1},
    {"kind": "velocity", "name": "speed", "of": "operator/right_hand", "limit": 20.0},
]
RULES = [{"kind": "reba", "name": "REBA", "human": "operator", "action_level": 4}]


def both(limit: float) -> dict[str, tuple[set[Verdict | None], bool]]:
    """By criterion, what instants come to in a run, and whether arrays say the same of each."""
    recording = captured(frames_of(*walking(0.3), turned=False))
    safety = [one | ({"limit": limit} if one["name"] == "distance" else {}) for one in SAFETY]
    tables = {"engine": {"physics": False}, "safety": safety, "ergonomics": RULES, "parts": [PART]}
    station = Station(workstation(source(recording), **tables))
    engine, judge = road.engine_of(station.model), Judge(station.bound)
    rows = []
    for k, samples in enumerate(road.pump(station.sources, 0.01)):
        engine.take(samples)
        rows.append(judge(engine.tick() if k else engine.start()))
    found = {}
    batch = station.batch()
    for i, one in enumerate(station.bound):
        said = [row[i].verdict for row in rows]
        same = batch[one.criterion.name].answers.verdict.tolist() == [CODES[each] for each in said]
        found[one.criterion.name] = set(said), same
    return found


def test_what_devices_leave_open_is_open_in_arrays_too() -> None:
    values = both(0.1)
    assert Verdict.WITHIN in values["distance"][0]
    least = least_distance()
    # Of the hand nothing but the wrist is seen: it may be nearer than the twin's.
    found = both(least - 0.05)
    assert Verdict.UNDECIDED in found["distance"][0]
    assert Verdict.WITHIN in found["trunk"][0]
    for name, (_, same) in {**found, **{f"far {name}": each for name, each in values.items()}}.items():
        assert same, name


def least_distance() -> float:
    recording = captured(frames_of(*walking(0.3), turned=False))
    tables = {"engine": {"physics": False}, "safety": [SAFETY[0]], "parts": [PART]}
    return float(np.nanmin(Station(workstation(source(recording), **tables)).batch()["distance"].value))


@pytest.mark.parametrize("given", [True, False])
def test_a_robot_that_no_source_moves_has_no_speed_in_arrays(given: bool) -> None:
    robot = {"name": "arm", "model": "library:ur5e"} | ({"q": [0, -1.2, 1.4, -1.5, -1.5, 0]} if given else {})
    asked = [{"kind": "velocity", "name": "speed", "at": "arm", "limit": 1.0}]
    asked.append({"kind": "manipulability", "name": "far", "at": "arm", "limit": 0.1})
    recording = captured(frames_of(*walking(0.3)))
    tables = {"engine": {"physics": False}, "safety": asked, "robots": [robot]}
    batch = Station(workstation(source(recording), **tables)).batch()
    assert set(batch["speed"].answers.verdict) == {CODES[Verdict.UNDECIDED]}
    assert (set(batch["far"].answers.verdict) == {CODES[Verdict.WITHIN]}) == given
