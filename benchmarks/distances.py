"""Distances of a person and of machine parts to a UR10, against Coal and FCL, in one process, interleaved.

Run ``python benchmarks/distances.py``; ``--smoke`` makes few ticks and only checks that all agree.

The peer for the person is Coal as good as it gets from Python: each capsule's core segment as a
tree of one degenerate triangle, less the radius; pairs in the order of bounding balls, pruned, with the
least so far as Coal's own upper bound. (Coal's mesh-to-capsule routine is 4 times slower and exact
to 3e-7 m only.) Between parts and robot, links are the peer's sets, with the same pruning.
Robot and motion come from the packages example-robot-data and pin, the person from 25 capsules.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

import coal
import fcl
import manifold3d
import numpy as np
import pinocchio as pin
import trimesh
from defusedxml import ElementTree

from seerob.core.shapes import Mesh, Solid, capsule
from seerob.core.transforms import Array, rotation_from_rpy
from seerob.distance.least import DistanceKind, Per, Query, Shapes

ROBOTS = Path(coal.__file__).parents[4] / "share" / "example-robot-data" / "robots"
UR10 = ROBOTS / "ur_description" / "urdf" / "ur10_robot.urdf"
BASE = np.array([0.0, 0.0, 0.72])
PERIOD = 0.01


def link_meshes(kind: str) -> list[tuple[str, Mesh]]:
    """Names and meshes (in the link's frame [m]) of the UR10, ``collision`` or ``visual``."""
    found = []
    for link in ElementTree.parse(UR10).getroot().findall("link"):
        for shape in link.findall(kind):
            mesh = shape.find("geometry").find("mesh")
            if mesh is None:
                continue
            path = ROBOTS / mesh.get("filename").removeprefix("package://example-robot-data/robots/")
            loaded = trimesh.load(path, force="mesh")
            origin = shape.find("origin")
            rotation, position = np.eye(3), np.zeros(3)
            if origin is not None:
                rotation = rotation_from_rpy([float(v) for v in origin.get("rpy", "0 0 0").split()])
                position = np.array([float(v) for v in origin.get("xyz", "0 0 0").split()])
            vertices = np.asarray(loaded.vertices, float) @ rotation.T + position
            found.append((link.get("name"), Mesh(vertices, np.asarray(loaded.faces, np.int32))))
    return found


def robot_motion(names: list[str], ticks: int) -> tuple[Array, Array]:
    """world_from_link over time: (ticks, n, 3, 3) and (ticks, n, 3)."""
    model = pin.buildModelFromUrdf(str(UR10))
    data = model.createData()
    frames = [model.getFrameId(name) for name in names]
    home = np.array([0.0, -1.2, 1.4, -1.5, -1.57, 0.0])
    reach = np.array([0.8, 0.4, 0.5, 0.8, 0.5, 1.5])
    R, x = np.zeros((ticks, len(names), 3, 3)), np.zeros((ticks, len(names), 3))
    for k in range(ticks):
        t = k * PERIOD
        pin.forwardKinematics(
            model, data, home + reach * np.sin(np.array([1.9, 1.4, 1.6, 2.0, 1.7, 2.1]) * t)
        )
        pin.updateFramePlacements(model, data)
        R[k] = [data.oMf[f].rotation for f in frames]
        x[k] = [data.oMf[f].translation + BASE for f in frames]
    return R, x


# Length along its own z [m], radius [m], middle from the pelvis [m], axis, how far it swings [m].
TRUNK = [
    (0.10, 0.13, (0, 0, 0), (0, 0, 1), 0),
    (0.12, 0.12, (0, 0, 0.16), (0, 0, 1), 0),
    (0.18, 0.13, (0, 0, 0.34), (0, 0, 1), 0),
    (0.07, 0.05, (0, 0, 0.52), (0, 0, 1), 0),
    (0.10, 0.09, (0, 0, 0.64), (0, 0, 1), 0),
    (0.26, 0.10, (0, 0, 0.40), (0, 1, 0), 0),
    (0.26, 0.10, (0, 0, 0.02), (0, 1, 0), 0),
]
LEFT = [
    (0.16, 0.045, (0, 0.10, 0.45), (0, 1, 0), 0),
    (0.29, 0.047, (-0.10, 0.20, 0.33), (-1, 0, -1), 0.02),
    (0.23, 0.038, (-0.30, 0.20, 0.22), (-1, 0, 0.2), 0.06),
    (0.16, 0.035, (-0.50, 0.19, 0.26), (-1, 0, 0.1), 0.1),
    (0.07, 0.028, (-0.50, 0.19, 0.26), (0, 1, 0), 0.1),
    (0.36, 0.078, (0, 0.09, -0.25), (0, 0, 1), 0),
    (0.38, 0.055, (0, 0.09, -0.66), (0, 0, 1), 0),
    (0.14, 0.038, (-0.07, 0.09, -0.88), (1, 0, 0), 0),
    (0.07, 0.03, (-0.18, 0.09, -0.89), (1, 0, 0), 0),
]
RIGHT = [(length, radius, (x, -y, z), axis, swing) for length, radius, (x, y, z), axis, swing in LEFT]
PARTS = [*TRUNK, *LEFT, *RIGHT]


def person_motion(ticks: int) -> tuple[Array, Array]:
    """world_from_part over time: (ticks, 25, 3, 3) and (ticks, 25, 3)."""
    R, x = np.zeros((ticks, len(PARTS), 3, 3)), np.zeros((ticks, len(PARTS), 3))
    for k in range(ticks):
        t = k * PERIOD
        lean = rotation_from_rpy([0.0, -0.25 * np.sin(0.9 * t), 0.1 * np.sin(0.5 * t)])
        pelvis = np.array([1.45 + 0.15 * np.sin(1.1 * t), 0.1 + 0.1 * np.sin(0.7 * t), 0.93])
        for i, (_, _, middle, axis, swing) in enumerate(PARTS):
            z = np.array(axis, float) / np.linalg.norm(axis)
            y = np.cross(z, [1.0, 0.0, 0.0]) if abs(z[0]) < 0.9 else np.cross(z, [0.0, 1.0, 0.0])
            y /= np.linalg.norm(y)
            R[k, i] = lean @ np.column_stack([np.cross(y, z), y, z])
            x[k, i] = pelvis + lean @ (np.array(middle) + np.array([0, 0, swing * np.sin(2 * t + middle[1])]))
    return R, x


def coal_tree(vertices: Array, faces: Any) -> Any:
    tree = coal.BVHModelOBBRSS()
    tree.beginModel(len(faces), len(vertices))
    points, triangles = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
    for v in vertices:
        points.append(np.asarray(v, float))
    for f in faces:
        triangles.append(coal.Triangle(int(f[0]), int(f[1]), int(f[2])))
    tree.addSubModel(points, triangles)
    tree.endModel()
    return tree


class CoalPeer:
    """Least distance of each second thing to all first ones: ball order, pruned, shared bound."""

    def __init__(self, first: list[Any], balls: Array, second: list[Any], radii: Array) -> None:
        """``balls``: centre and radius of all, first then second, in their own frames."""
        self.first, self.second, self.balls, self.radii = first, second, balls, radii
        self.request = coal.DistanceRequest(True)
        self.request.rel_err = self.request.abs_err = 0

    def to_segments(self, R: Array, x: Array, placed: list[Any], a: Array, b: Array) -> Array:
        return self.per_second(placed, self.bounds_to_segments(R, x, a, b))

    def to_balls(self, R: Array, x: Array, placed: list[Any]) -> Array:
        return self.per_second(placed, self.bounds_to_balls(R, x))

    def per_second(self, placed: list[Any], lower: Array) -> Array:
        n = len(self.first)
        order = np.argsort(lower, axis=0)
        least = np.empty(len(self.second))
        for i in range(len(self.second)):
            result = coal.DistanceResult()
            bound = np.inf
            for j in order[:, i]:
                if lower[j, i] >= bound:
                    break
                coal.distance(self.first[j], placed[j], self.second[i], placed[n + i], self.request, result)
                bound = result.min_distance - self.radii[i]
            least[i] = bound
        return least

    def bounds_to_segments(self, R: Array, x: Array, a: Array, b: Array) -> Array:
        n = len(self.first)
        c = np.einsum("jab,jb->ja", R[:n], self.balls[:n, :3]) + x[:n]
        ab = b - a
        t = np.clip(((c[:, None] - a) * ab).sum(-1) / (ab * ab).sum(-1), 0, 1)
        gap = np.linalg.norm(c[:, None] - (a + t[..., None] * ab), axis=2)
        return gap - self.balls[:n, 3:] - self.radii

    def bounds_to_balls(self, R: Array, x: Array) -> Array:
        n = len(self.first)
        c = np.einsum("jab,jb->ja", R, self.balls[:, :3]) + x
        gap = np.linalg.norm(c[:n, None] - c[None, n:], axis=2)
        return gap - self.balls[:n, 3:] - self.balls[None, n:, 3]


def ball_of(vertices: Array) -> Array:
    centre = (vertices.min(0) + vertices.max(0)) / 2
    return np.append(centre, np.linalg.norm(vertices - centre, axis=1).max())


def report(title: str, times: dict[str, list[float]], peer: str, worst: float) -> None:
    ms = {name: np.median(t) * 1e3 for name, t in times.items()}
    tail = {name: np.percentile(t, 95) * 1e3 for name, t in times.items()}
    print(title)
    for name in times:
        ratio = f"  {ms[peer] / ms[name]:6.2f} x {peer}" if name != peer else ""
        print(f"  {name:28s} {ms[name]:8.3f} ms  p95 {tail[name]:8.3f}{ratio}")
    print(f"  largest difference           {worst:.1e} m", flush=True)


def clock(times: dict[str, list[float]], name: str, ask: Any, *given: Any) -> Any:
    begin = time.thread_time()
    answer = ask(*given)
    times.setdefault(name, []).append(time.thread_time() - begin)
    return answer


def person(kind: str, ticks: int) -> tuple[float, float]:
    """25 parts × UR10; returns the ratio over Coal and the largest difference [m]."""
    links = link_meshes(kind)
    n = len(links)
    begin = time.thread_time()
    halves = np.array([length / 2 for length, *_ in PARTS])
    radii = np.array([radius for _, radius, *_ in PARTS])
    ends = np.stack([np.zeros_like(halves), np.zeros_like(halves), halves], axis=1)
    bodies = [(name, [Solid(mesh=mesh)]) for name, mesh in links]
    bodies += [(f"part {i}", [capsule(-ends[i], ends[i], radii[i])]) for i in range(len(PARTS))]
    shapes = Shapes.build(bodies)
    built = time.thread_time() - begin
    sets = range(n), range(n, len(bodies))
    parts, all_pairs, least = (Query(shapes, *sets) for _ in range(3))
    peer = CoalPeer(
        [coal_tree(mesh.vertices, mesh.faces) for _, mesh in links],
        np.array([ball_of(mesh.vertices) for _, mesh in links]),
        [coal_tree(np.array([-e, e, e]), [(0, 1, 2)]) for e in ends],
        radii,
    )
    robot, human = robot_motion([name for name, _ in links], ticks), person_motion(ticks)
    R, x = (np.concatenate(both, axis=1) for both in zip(robot, human, strict=True))
    times: dict[str, list[float]] = {}
    worst, nearest, farthest = 0.0, np.inf, -np.inf
    for k in range(ticks):
        placed = [coal.Transform3s(R[k, i], x[k, i]) for i in range(len(bodies))]
        tips = np.einsum("iab,ib->ia", R[k, n:], ends)
        a, b = x[k, n:] - tips, x[k, n:] + tips
        theirs = clock(
            times,
            "coal, 25 parts",
            peer.to_segments,
            R[k],
            x[k],
            placed,
            a,
            b,
        )
        ours = clock(times, "seerob, 25 parts", parts.per_body, R[k], x[k])
        pairs = clock(times, f"seerob, {n * len(PARTS)} pairs", all_pairs.per_pair, R[k], x[k])
        one = clock(times, "seerob, least of all", least.minimum, R[k], x[k])
        exact = ours.kind == DistanceKind.EXACT  # Coal knows no depth and no inside.
        worst = max(worst, np.abs(ours.distance - theirs)[exact].max())
        assert (ours.distance <= theirs + 1e-9).all()
        nearest, farthest = min(nearest, ours.distance.min()), max(farthest, ours.distance.min())
        assert (pairs.distance.reshape(n, -1).min(0) == ours.distance).all()
        assert one.distance == ours.distance.min()
    clock(times, "seerob, 25 parts, batch/tick", parts.batch, R, x, Per.BODY)
    times["seerob, 25 parts, batch/tick"][0] /= ticks
    count = sum(len(mesh.faces) for _, mesh in links)
    report(
        f"person at {nearest:.2f} … {farthest:.2f} m × UR10 {kind} ({count} triangles, {built:.2f} s)",
        times,
        "coal, 25 parts",
        worst,
    )
    return float(np.median(times["coal, 25 parts"]) / np.median(times["seerob, 25 parts"])), worst


def machine() -> list[tuple[Array, Any]]:
    """Concave machine parts around the robot, as modellers leave them after simplification without loss."""
    box = manifold3d.Manifold.cube
    made = []
    for k in range(10):
        angle = 0.3 + 2 * np.pi * k / 10
        if k % 3 == 0:  # a slotted block
            solid = box((0.6, 0.4, 0.3), True) - box((0.7, 0.1, 0.2), True).translate((0, 0, 0.1))
        elif k % 3 == 1:  # a frame
            solid = box((0.8, 0.1, 0.8), True) - box((0.6, 0.2, 0.6), True)
        else:  # a ring
            ring = manifold3d.CrossSection.circle(0.06, 48).translate((0.25, 0))
            solid = manifold3d.Manifold.revolve(ring, 96)
        solid = solid.rotate((10 * k, 25 * k, np.degrees(angle))).translate(
            (1.1 * np.cos(angle), 1.1 * np.sin(angle), 0.6 + 0.12 * k)
        )
        mesh = solid.to_mesh()
        made.append((np.array(mesh.vert_properties[:, :3], float), np.array(mesh.tri_verts, np.int32)))
    return made


def environment(ticks: int) -> tuple[float, float]:
    """UR10 × ten concave parts, mesh to mesh; returns the ratio over Coal and the largest difference [m]."""
    links = link_meshes("collision")
    parts = machine()
    n, m = len(links), len(parts)
    bodies = [(f"part {i}", [Solid(mesh=Mesh(v, f))]) for i, (v, f) in enumerate(parts)]
    bodies += [(name, [Solid(mesh=mesh)]) for name, mesh in links]
    shapes = Shapes.build(bodies)
    per_link, one = (Query(shapes, range(m), range(m, m + n)) for _ in range(2))
    capped = Query(shapes, range(m), range(m, m + n), cap=0.1)
    meshes = [*parts, *((mesh.vertices, mesh.faces) for _, mesh in links)]
    trees = [coal_tree(v, f) for v, f in meshes]
    peer = CoalPeer(trees[:m], np.array([ball_of(v) for v, _ in meshes]), trees[m:], np.zeros(n))
    theirs_fcl = []
    for v, f in meshes:
        tree = fcl.BVHModel()
        tree.beginModel(len(f), len(v))
        tree.addSubModel(v, f)
        tree.endModel()
        theirs_fcl.append(fcl.CollisionObject(tree))
    Rl, xl = robot_motion([name for name, _ in links], ticks)
    R = np.concatenate([np.tile(np.eye(3), (ticks, m, 1, 1)), Rl], axis=1)
    x = np.concatenate([np.zeros((ticks, m, 3)), xl], axis=1)
    times: dict[str, list[float]] = {}
    worst = 0.0

    def bare(R: Array, x: Array) -> Array:
        lower = peer.bounds_to_balls(R, x)
        least = np.full(n, np.inf)
        for i in range(n):
            for j in np.argsort(lower[:, i]):
                if lower[j, i] >= least[i]:
                    break
                least[i] = min(
                    least[i],
                    fcl.distance(
                        theirs_fcl[j], theirs_fcl[m + i], fcl.DistanceRequest(True), fcl.DistanceResult()
                    ),
                )
        return least

    for k in range(ticks):
        placed = [coal.Transform3s(R[k, i], x[k, i]) for i in range(m + n)]
        for i in range(m + n):
            theirs_fcl[i].setTransform(fcl.Transform(R[k, i], x[k, i]))
        theirs = clock(
            times,
            "coal, 7 links",
            peer.to_balls,
            R[k],
            x[k],
            placed,
        )
        if k < 20:
            clock(times, "fcl, 7 links", bare, R[k], x[k])
        ours = clock(times, "seerob, 7 links", per_link.per_body, R[k], x[k])
        clock(times, "seerob, 7 links within 0.1 m", capped.per_body, R[k], x[k])
        clock(times, "seerob, least of all", one.minimum, R[k], x[k])
        apart = theirs > 1e-9
        worst = max(worst, np.abs(ours.distance - theirs)[apart].max())
        assert (ours.distance[~apart] <= 0).all()
    count = sum(len(f) for _, f in parts), sum(len(mesh.faces) for _, mesh in links)
    report(
        f"UR10 collision ({count[1]} triangles) × 10 parts ({count[0]} triangles)",
        times,
        "coal, 7 links",
        worst,
    )
    return float(np.median(times["coal, 7 links"]) / np.median(times["seerob, 7 links"])), worst


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--smoke", action="store_true", help="few ticks; only that all agree")
    smoke = parser.parse_args().smoke
    kinds = ("collision",) if smoke else ("collision", "visual")
    found = [person(kind, 5 if smoke else 200) for kind in kinds]
    found.append(environment(3 if smoke else 200))
    assert all(worst < 1e-6 for _, worst in found), "the libraries disagree"


if __name__ == "__main__":
    main()
