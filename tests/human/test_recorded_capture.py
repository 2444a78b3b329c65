"""Captured motion is recorded as it was heard, and computed again from that: same samples, same figures."""

from __future__ import annotations

import numpy as np
from made_capture import captured, frames_of, source, walking, workstation

from seerob.core.samples import BodySample
from seerob.description.humans.skeleton import BONES
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
