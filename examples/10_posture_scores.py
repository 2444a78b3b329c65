"""A person who works for some seconds: RULA over time, and the angles behind each score as a table."""

from pathlib import Path
from tempfile import TemporaryDirectory

import seerob as sr
from seerob.outputs.sinks.recorder import Recorder

CELL = """
title = "reaching"

[[humans]]
name = "worker"
stature = 1.68
mass = 62
sex = "female"

[[sources]]
kind = "keyframes"
human = "worker"
file = "library:reach"

[[ergonomics]]
kind = "rula"
human = "worker"
action_level = 2

[[ergonomics.phases]]
load = 0
load_use = "intermittent"
legs = "balanced"
muscle_arms = false
muscle_body = false
"""

with TemporaryDirectory() as folder:
    (Path(folder) / "workstation.toml").write_text(CELL)
    run = sr.load(folder).run(folder=folder, sinks=[Recorder()])
    recording = sr.Recording.open(Path(folder) / "run.mcap")
    angles = recording.to_pandas("aspects")
    rows = recording.to_pandas("rows")

(score,) = run.results.values()
print(f"{score.name}: {score.verdict}, {score.worst().reason}")
print(angles.groupby(["place", "aspect"], observed=True).value.agg(["min", "max"]))

# Every angle belongs to a place whose score is a row; above the shoulder the upper arm is what counts.
assert score.verdict == sr.Verdict.EXCEEDED
assert set(angles.place) <= set(rows.place)
assert angles[angles.aspect == "shoulder flexion"].value.max() > 1.5  # she reaches above her head
