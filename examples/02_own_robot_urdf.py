"""A robot of your own from a URDF file: a two-link arm whose kinetic energy fits on a napkin.

Stretched out, its first joint turning at 1 rad/s: E = (m1 r1² + m2 r2²) / 2. Each mass is a needle
along the axis: it has no inertia about that.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import seerob as sr

LINK = """<link name="{name}"><inertial><origin xyz="1 0 0"/><mass value="{mass}"/>
<inertia ixx="0.01" iyy="0.01" izz="1e-9" ixy="0" ixz="0" iyz="0"/></inertial><collision>
<origin xyz="0.5 0 0"/><geometry><box size="1 0.05 0.05"/></geometry></collision></link>"""
HINGE = """<joint name="{name}" type="continuous"><origin xyz="{x} 0 0"/><axis xyz="0 0 1"/>
<parent link="{parent}"/><child link="{child}"/><limit effort="100" velocity="3"/></joint>"""

arm = ['<robot name="arm"><link name="base"/>']
arm += [LINK.format(name="upper", mass=2.0), LINK.format(name="lower", mass=1.0)]
arm += [HINGE.format(name="shoulder", x=0, parent="base", child="upper")]
arm += [HINGE.format(name="elbow", x=1, parent="upper", child="lower"), "</robot>"]
motion = "time [s],J1 [rad],J2 [rad]\n" + "".join(f"{k / 100},{k / 100},0\n" for k in range(101))
cell = """
robots = [{ name = "arm", model = "arm.urdf" }]
sources = [{ kind = "csv", robot = "arm", file = "motion.csv" }]
safety = [{ kind = "kinetic_energy", name = "energy", robot = "arm", limit = 5 }]
"""
with TemporaryDirectory() as folder:
    for name, text in (("arm.urdf", "\n".join(arm)), ("motion.csv", motion), ("workstation.toml", cell)):
        (Path(folder) / name).write_text(text)
    run = sr.load(folder).run()

energy = run.results["energy"].values[50]
print(f"energy {energy:.4f} J in the middle of the motion, {run.verdict}")
assert abs(energy - (2.0 * 1.0**2 + 1.0 * 2.0**2) / 2) < 0.01
assert run.verdict == sr.Verdict.WITHIN
