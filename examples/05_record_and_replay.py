"""Record a run, compute it again from the samples in the recording, and judge it by another limit."""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import seerob as sr
from seerob.criteria.safety.velocity import Velocity
from seerob.outputs.sinks.recorder import Recorder

station = sr.load(Path(__file__).parents[1] / "workstations" / "iiwa_bench")
stricter = Velocity(name="slow", at="iiwa", limit=0.25)
with TemporaryDirectory() as folder:
    run = station.run(folder=folder, sinks=[Recorder(lossless=True)])
    recording = sr.Recording.open(Path(folder) / "run.mcap")
    again = sr.load_recorded(recording).with_criteria(stricter).replay(recording)
    instant = recording.snapshot_at(5.0)

print(f"{recording.duration:.2f} s recorded; at 5 s joint 1 stood at {instant.joints['iiwa'][0]:.3f} rad")
for name, series in run.results.items():
    np.testing.assert_array_equal(again.results[name].values, series.values)
    assert again.results[name].verdict == series.verdict
assert again.results["slow"].verdict == sr.Verdict.EXCEEDED
assert again.results["slow"].max() == run.results["tool speed"].max()
assert instant.t == 5.0
