"""Safety areas and sensors: what a tick costs, and rays and inside tests beside their peers.

    python benchmarks/areas.py            # µs per tick of every question; ratios to peers in the same run
    python benchmarks/areas.py --smoke    # fewer repetitions, correctness only

A scanner of 541 beams looks at a concave mesh of 5120 triangles; the peer of the rays is MuJoCo, whose
meshes are of single precision, and that of the inside test the winding number with dipoles. The parts of
the depths lie anywhere within 1 m, many of them where all sides are equally far: the dearest case.
Times are those of the processor.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Callable

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import mujoco
import numpy as np
import trimesh

from seerob.core.shapes import Mesh, Solid, capsule
from seerob.description.shapes.shapes import box_mesh
from seerob.distance.depth import Depths
from seerob.distance.least import Shapes
from seerob.distance.scan import Rays
from seerob.kernels.crossings import encloses
from seerob.kernels.tree_file import tree_of
from seerob.kernels.winding import contains

BEAMS, PARTS, TOLERANCE = 541, 21, 0.005


def bumpy(subdivisions: int) -> Mesh:
    """A closed concave ball of 1 m."""
    ball = trimesh.creation.icosphere(subdivisions)
    u = np.asarray(ball.vertices)
    radius = 1 + 0.2 * np.sin(5 * u[:, :1]) * np.cos(4 * u[:, 1:2]) + 0.1 * np.sin(9 * u[:, 2:])
    return Mesh(u * radius, np.asarray(ball.faces, np.int32))


def median(work: Callable[[], object], times: int) -> float:
    """[s]"""
    work()
    spent = []
    for _ in range(times):
        begin = time.thread_time()
        work()
        spent.append(time.thread_time() - begin)
    return float(np.median(spent))


def rays(times: int) -> tuple[float, float, float]:
    """One scan by seerob and by MuJoCo [s], and the largest difference of a range [m]."""
    mesh = bumpy(4)
    shapes = Shapes.build([("thing", (Solid(mesh=mesh),))])
    R, x = np.eye(3)[None], np.zeros((1, 3))
    angle = np.linspace(-0.75 * np.pi, 0.75 * np.pi, BEAMS) + 1e-4
    u = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(BEAMS)])
    o = np.broadcast_to([-3.0, 0.013, 0.017], u.shape).copy()
    asked = Rays(shapes, [0])
    distance, met = np.empty(BEAMS), np.empty(BEAMS, np.int64)

    def scan() -> None:
        distance[:], met[:] = 10.0, -1
        asked.cast(R, x, o, u, distance, met)

    spec = mujoco.MjSpec()
    spec.add_mesh(name="m", uservert=mesh.vertices.ravel(), userface=mesh.faces.ravel())
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="m")
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    theirs, geoms = np.empty(BEAMS), np.empty(BEAMS, np.int32)

    def peer() -> None:
        mujoco.mj_multiRay(model, data, o[0], u.ravel(), None, 1, -1, geoms, theirs, None, BEAMS, 10.0)

    own, other = median(scan, times), median(peer, max(times // 10, 1))
    ranges = np.where(geoms >= 0, theirs, 10.0)
    return own, other, float(np.abs(distance - ranges).max())


def inside(times: int) -> tuple[float, float, int]:
    """An inside test by crossings and by the winding number [s], and how often they differ."""
    mesh = bumpy(4)
    tree = tree_of(mesh.vertices, mesh.faces)
    points = np.random.default_rng(0).uniform(-1, 1, (200, 3))
    rows = tree.nodes, tree.links, tree.triangles

    def ask(test: Callable[..., bool], *more: bool) -> list[bool]:
        return [bool(test(*rows, *more, *p)) for p in points]

    own, other = median(lambda: ask(encloses, True), times), median(lambda: ask(contains), times)
    differ = sum(a != b for a, b in zip(ask(encloses, True), ask(contains), strict=True))
    return own / len(points), other / len(points), differ


def depths(times: int) -> dict[str, tuple[float, float]]:
    """A tick with every part of a person in an area [s], and the width of the widest interval [m]."""
    rng = np.random.default_rng(1)
    people = [("part", (capsule(np.zeros(3), np.array([0, 0, 0.3]), 0.08),)) for _ in range(PARTS)]
    found = {}
    for name, mesh in (("box", box_mesh([-1] * 3, [1] * 3)), ("concave mesh", bumpy(4))):
        shapes = Shapes.build([("area", (Solid(mesh=mesh),)), *people])
        R = np.repeat(np.eye(3)[None], PARTS + 1, axis=0)
        x = np.vstack([np.zeros(3), rng.uniform(-0.6, 0.6, (PARTS, 3))])
        asked = Depths(shapes, tolerance=TOLERANCE, cells=130, fewest=5)
        pairs = [(0, k) for k in range(1, PARTS + 1)]
        deep = asked.ask(R, x, pairs)
        wide = max(d.at_most - d.at_least for d in deep)
        found[name] = median(lambda a=asked, b=(R, x, pairs): a.ask(*b), times), wide  # type: ignore[misc]
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--smoke", action="store_true")
    times = 10 if parser.parse_args().smoke else 200
    own, other, off = rays(times)
    print(
        f"scan of {BEAMS} beams: {own * 1e6:.0f} µs, MuJoCo {other * 1e6:.0f} µs, ratio {other / own:.0f}; "
        f"ranges differ by {off:.1e} m"
    )
    test, winding, differ = inside(times // 10)
    print(
        f"inside test: {test * 1e6:.1f} µs, winding number {winding * 1e6:.1f} µs, ratio "
        f"{winding / test:.0f} (calls from Python in both); {differ} differ"
    )
    for name, (spent, wide) in depths(times).items():
        print(f"{PARTS} parts in a {name}: {spent * 1e6:.0f} µs, intervals to {wide * 1e3:.1f} mm")
    return 0 if off < 1e-5 and differ == 0 else 1


if __name__ == "__main__":
    sys.exit(main())
