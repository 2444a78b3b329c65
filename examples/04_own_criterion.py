"""A criterion of your own, in your own package: a dotted ``kind`` names it (see acme/ and pyproject.toml).

Installed (``pip install ./examples``) it is found by its entry point; by its module's name where allowed.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import seerob as sr

cell = """
title = "own criterion"

[[robots]]
name = "ur5e"
model = "library:ur5e"
q_deg = [0, -90, 0, -90, 0, 0]           # upright

[[safety]]
kind = "acme.work_height"
name = "height"
at = "ur5e"
limit = 1.4
"""
with TemporaryDirectory() as folder:
    (Path(folder) / "workstation.toml").write_text(cell)
    station = sr.load(folder, allow_plugins=True)
run = station.run()

worst = run.results["height"].worst()
print(f"{worst.value:.3f} m, at most {worst.limit} m: {run.verdict}")
assert run.verdict == sr.Verdict.WITHIN
# Upright: d1 + a2 + a3 + d5 of the UR5e's published table.
assert worst.value is not None
assert abs(worst.value - (0.1625 + 0.425 + 0.3922 + 0.0997)) < 1e-3
