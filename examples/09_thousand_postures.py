"""A thousand postures of a robot at once: where a person at the bench is nearer than a limit, in arrays."""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import seerob as sr

CELL = """
title = "sweep"

[[robots]]
name = "arm"
model = "library:ur5e"

[[humans]]
name = "person"
stature = 1.75
mass = 75
sex = "male"
at = { position = [0.9, 0, 0], rpy_deg = [0, 0, 180] }

[[safety]]
kind = "minimum_distance"
name = "distance"
between = ["arm", "person"]
limit = 0.2
"""

with TemporaryDirectory() as folder:
    (Path(folder) / "workstation.toml").write_text(CELL)
    station = sr.load(folder)
    pan, lift = np.meshgrid(np.radians(np.linspace(-180, 180, 40)), np.radians(np.linspace(-150, -30, 25)))
    q = np.zeros((pan.size, 6))
    q[:, 0], q[:, 1], q[:, 2] = pan.ravel(), lift.ravel(), np.radians(60)
    batch = station.batch({"arm": q}, {"arm": np.zeros_like(q)})

distance = batch["distance"]
near = (batch.to_pandas()["verdict"]["distance"] == "exceeded").to_numpy()
print(f"{near.sum()} of {len(q)} postures come nearer than 0.2 m; the least is {distance.value.min():.3f} m")

# Somebody stands along x: whoever is nearest is turned there, and nobody who is turned away is near.
assert abs(np.degrees(q[distance.value.argmin(), 0])) < 60
assert not near[np.abs(np.degrees(q[:, 0])) > 150].any()
assert near.any()
assert not near.all()
