"""Record a run, compute it again from the samples in the recording, and judge it by another limit."""

from pathlib import Path
from tempfile import TemporaryDirectory

from msgspec.structs import replace

import seerob as sr
from seerob.safety.velocity import Velocity
from seerob.sinks.recorder import Recorder

station = sr.load(Path(__file__).parents[1] / "workstations" / "ur10_assembly")
stricter = station.with_criteria(Velocity(name="slow", at="ur10", limit=0.25))
with TemporaryDirectory() as folder:
    run = station.run(folder=folder, sinks=[Recorder(lossless=True)])
    recording = sr.Recording.open(Path(folder) / "run.mcap")
    again = sr.load_recorded(recording).replay(recording)
    strict = stricter.replay(recording)
    instant = recording.snapshot_at(5.0)

print(
    f"{recording.duration:.2f} s recorded; the arm stood at {[round(q, 3) for q in instant.joints['ur10']]}"
)
for name, series in run.results.items():
    assert (again.results[name].values == series.values).tolist().count(False) == sum(
        series.values != series.values
    )
    assert (again.results[name].verdicts == series.verdicts).all()
assert strict.results["slow"].verdict == sr.Verdict.EXCEEDED
assert strict.results["slow"].max() == run.results["tcp speed"].max()
assert replace(instant, results=()).t == 5.0
