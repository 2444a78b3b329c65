"""Ten lines: load a workstation, run it as fast as possible, ask what came out."""

from pathlib import Path

import seerob as sr

station = sr.load(Path(__file__).parents[1] / "workstations" / "ur10_assembly")
run = station.run()

for name, series in run.results.items():
    print(f"{name:<25} {series.verdict or '':<10} {series.min():8.3g} … {series.max():.3g} {series.unit}")
print(f"{run.duration:.1f} s of motion in {run.wall:.1f} s: {run.verdict}")

speed = run.results["tcp speed"]
assert 0 < speed.max() < 1.0
assert speed.worst().value == speed.max()
assert run.verdict == sr.Verdict.EXCEEDED  # the separation, when the operator reaches in
