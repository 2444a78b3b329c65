"""A robot of your own from a URDF file: a two-link arm whose kinetic energy fits on a napkin.

Both joints are still but the first, which turns at 1 rad/s, so E = (m1 r1² + m2 r2²) / 2.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import seerob as sr


def link(name: str, mass: float) -> str:
    """A light rod of 1 m with its mass at the end."""
    return f"""<link name="{name}">
  <inertial><origin xyz="1 0 0"/><mass value="{mass}"/>
    <inertia ixx="1e-9" iyy="1e-9" izz="1e-9" ixy="0" ixz="0" iyz="0"/></inertial>
  <collision><origin xyz="0.5 0 0"/><geometry><box size="1 0.05 0.05"/></geometry></collision>
</link>"""


def joint(name: str, parent: str, child: str, x: float) -> str:
    """A hinge about z."""
    return f"""<joint name="{name}" type="continuous"><origin xyz="{x} 0 0"/><axis xyz="0 0 1"/>
  <parent link="{parent}"/><child link="{child}"/><limit effort="100" velocity="3"/></joint>"""


urdf = "\n".join(
    [
        '<robot name="arm"><link name="base"/>',
        *(link("upper", 2.0), link("lower", 1.0)),
        *(joint("shoulder", "base", "upper", 0.0), joint("elbow", "upper", "lower", 1.0)),
        "</robot>",
    ]
)
motion = "time [s],J1 [rad],J2 [rad]\n" + "".join(f"{k / 100},{k / 100},0\n" for k in range(101))
cell = """
robots = [{ name = "arm", model = "arm.urdf" }]
sources = [{ kind = "csv", robot = "arm", file = "motion.csv" }]
safety = [{ kind = "kinetic_energy", name = "energy", robot = "arm", limit = 5 }]
"""
with TemporaryDirectory() as folder:
    for name, text in (("arm.urdf", urdf), ("motion.csv", motion), ("workstation.toml", cell)):
        (Path(folder) / name).write_text(text)
    run = sr.load(folder).run()

energy = run.results["energy"].values
print(f"energy {energy[50]:.4f} J in the middle of the motion, {run.verdict}")
assert abs(energy[50] - (2.0 * 1.0**2 + 1.0 * 2.0**2) / 2) < 0.01
assert run.verdict == sr.Verdict.WITHIN
