"""What if the gripper were another one? The same cell with a light and a heavy, longer tool."""

import math
import tomllib
from pathlib import Path

from msgspec.structs import replace

import seerob as sr
from seerob.workstation.workstation import Pose, Shape

cell = sr.read(Path(__file__).parents[1] / "workstations" / "ur10_assembly")
(gripper,) = cell.tools
engine = replace(cell.engine, tick=0.05)  # a comparison needs no more instants than that
others = {
    "as it is": gripper,
    "heavy": replace(gripper, mass=4.0),
    "long": replace(
        gripper, mesh=None, units=None, shape=Shape(box=(0.08, 0.08, 0.3)), at=Pose(position=(0, 0, 0.15))
    ),
}
energy, distance = {}, {}
for name, tool in others.items():
    results = sr.Station(replace(cell, tools=(tool,), engine=engine)).run().results
    energy[name] = results["arm energy"].max()
    distance[name] = results["robot – operator"].min()
    print(f"{name:<10} {tool.mass} kg: ≤ {energy[name]:.2f} J, ≥ {distance[name] * 1e3:.0f} mm away")

# The file that the cell came from says what stayed the same.
assert tomllib.loads(cell.files["workstation.toml"].decode())["tools"][0]["mass"] == gripper.mass
assert energy["heavy"] > energy["as it is"]
assert math.isclose(distance["heavy"], distance["as it is"], abs_tol=1e-4)  # but for the controller
assert distance["long"] < distance["as it is"]
