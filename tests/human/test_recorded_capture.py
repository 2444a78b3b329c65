"""Captured motion is recorded as it was heard, and computed again from that: same samples, same figures."""

from __future__ import annotations

import numpy as np
import pytest
from made_capture import captured, frames_of, source, walking, workstation

from seerob.core.samples import BodySample
from seerob.core.snapshot import Verdict
from seerob.criteria.ergonomics.owas import Owas, OwasPhase
from seerob.description.humans.skeleton import BONES, JOINTS
from seerob.devices.capture.options import Weights
from seerob.outputs.sinks.recorder import Recorder
from seerob.recording.recording import Recording
from seerob.session.station import Station


def test_two_devices_are_recorded_and_replayed_bit_for_bit(tmp_path):
    t, q = walking(0.6)
    camera = captured(frames_of(t, q, turned=False))
    tracker = frames_of(t + 0.004, q)
    for frame in tracker:
        for k, bone in enumerate(BONES):
            if bone not in ("head", "right_hand"):
                frame.positions[k] = np.nan
                frame.orientations[k] = np.nan
    station = Station(
        workstation(
            source(camera, name="camera"),
            source(captured(tracker), name="tracker", weights=Weights(position=4.0)),
        )
    )
    first = station.run(folder=tmp_path, sinks=[Recorder(lossless=True)])
    recording = Recording.open(next(tmp_path.glob("*.mcap")))
    ticks = list(recording.ticks())
    samples = [s for tick in ticks for s in tick.samples]
    assert {s.source for s in samples} == {"camera", "tracker"}
    assert all(isinstance(s, BodySample) for s in samples)
    snapshots = list(recording.snapshots())
    assert set(snapshots[-1].bones["operator"]) == set(BONES)
    again = tmp_path / "again"
    second = station.replay(recording, folder=again, sinks=[Recorder(lossless=True)])
    repeated = list(Recording.open(next(again.glob("*.mcap"))).snapshots())
    assert first.ticks == second.ticks
    for one, other in zip(snapshots, repeated, strict=True):
        assert one.joints == other.joints
        assert one.bones == other.bones
        assert one.poses == other.poses


@pytest.mark.parametrize(
    ("start", "verdict"),
    [(0.5, Verdict.EXCEEDED), (500.0, Verdict.UNDECIDED), (None, Verdict.WITHIN)],
)
def test_a_phase_that_begins_when_the_motion_is_over_leaves_its_rule_undecided(start, verdict):
    """Milliseconds for seconds: what is carried from 0.5 s on was judged at no instant, and was WITHIN."""
    t, q = np.arange(0, 1.0, 0.05), np.zeros((20, len(JOINTS)))
    phases = [OwasPhase(load=0.0, legs="standing")]
    if start is not None:
        phases.append(OwasPhase(title="carries", start=start, load=25.0, legs="both_knees_bent"))
    rule = Owas(human="operator", name="owas", action_category=1, phases=tuple(phases))
    station = Station(workstation(source(captured(frames_of(t, q))))).with_criteria(rule)
    series = station.run().results["owas"]
    assert series.verdict is verdict
    assert ("the phase 'carries' begins at 500 s" in series.worst().reason) == (start == 500)
