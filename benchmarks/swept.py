"""Swept volume of 1 000 poses of a UR10 at 1 cm: time, memory, what is missed, what is too much.

Run ``python benchmarks/swept.py``; ``--smoke`` takes few poses and points, ``--points`` sets how many random
points of the moving meshes are looked for at random times between the samples (a soak takes 1 000 000).
The UR10's collision meshes come from the package example-robot-data.
"""

from __future__ import annotations

import argparse
import resource
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import coal

from made_sweep import missed
from seerob.core.transforms import Array
from seerob.model.model import Model
from seerob.model.volumes.swept import swept_volume
from seerob.session.station import load

ROBOTS = Path(coal.__file__).parents[4] / "share" / "example-robot-data" / "robots"
HOME = np.array([0.0, -1.2, 1.4, -1.5, -1.57, 0.0])
SWING = np.array([0.8, 0.4, 0.5, 0.8, 0.5, 1.5])


def cell(folder: Path) -> Model:
    (folder / "workstation.toml").write_text(
        f'[[robots]]\nname = "ur10"\nmodel = "{ROBOTS}/ur_description/urdf/ur10_robot.urdf"\n'
        f'base = {{ position = [0, 0, 0.72] }}\npackages = {{ "example-robot-data" = "{ROBOTS.parent}" }}\n'
    )
    return load(folder, allow_outside=True).model


def motion(poses: int) -> Array:
    """From way-point to way-point in 1.5 s each, with quintic blends, at 100 Hz: (poses, 6) [rad]."""
    rng = np.random.default_rng(0)
    ways = HOME + np.vstack([np.zeros(6), rng.uniform(-1, 1, (poses // 150 + 1, 6)) * SWING])
    i, s = np.arange(poses) // 150, (np.arange(poses) % 150)[:, None] / 150
    return ways[i] + (10 * s**3 - 15 * s**4 + 6 * s**5) * (ways[i + 1] - ways[i])


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--smoke", action="store_true")
    parser.add_argument("--points", type=int, default=100_000)
    options = parser.parse_args()
    poses, points = (60, 5_000) if options.smoke else (1000, options.points)
    failed = False
    with TemporaryDirectory() as folder:
        model = cell(Path(folder))
        bodies, q = model.select("ur10"), motion(poses)
        print(f"UR10, {poses} poses at 100 Hz, {len(bodies)} links, joint speeds up to "
              f"{np.abs(np.diff(q, axis=0)).max() * 100:.1f} rad/s")  # fmt: skip
        swept_volume(model, bodies, {"ur10": q[:20]}, voxel=0.05).mesh()
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
        for voxel in (0.02, 0.01):
            wall, cpu = time.perf_counter(), time.process_time()
            swept = swept_volume(model, bodies, {"ur10": q}, voxel=voxel)
            wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
            start = time.perf_counter()
            mesh = swept.mesh()
            meshing = time.perf_counter() - start
            peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
            print(
                f"voxel {voxel * 100:.0f} cm: {cpu:.2f} s of CPU, {wall:.2f} s by the clock (distance fields "
                f"included; goal at 1 cm and 1000 poses on a core of its own: <= 2 s, <= 500 MB), "
                f"mesh {meshing:.2f} s, {len(mesh.faces)} triangles; "
                f"grid {swept.grid.cells.nbytes / 1e6:.1f} MB, "
                f"peak of the process {peak:.0f} MB ({before:.0f} MB before)"
            )
            print(
                f"   volume {swept.volume:.4f} m³, dilated for motion by {swept.mean_dilation * 1e3:.1f} mm "
                f"(at most {swept.dilation * 1e3:.1f} mm), {swept.stamps} stamps"
            )
            wrong = missed(model, bodies, {"ur10": q}, swept.grid.contains, points, np.random.default_rng(1))
            failed |= wrong > 0
            print(f"   {points} random points of the moving meshes at random times: {wrong} outside")
        if not options.smoke:
            fine = swept_volume(model, bodies, {"ur10": q}, voxel=0.0025, slack=1.0)
            print(
                f"reference at 2.5 mm: {fine.volume:.4f} m³, itself not less than the truth; at 1 cm "
                f"{(swept.volume / fine.volume - 1) * 100:+.0f} %"
            )
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
