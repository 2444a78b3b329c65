"""Ways of a UR10 past a pillar and under a shelf, beside a person: seerob against OMPL with Coal's checks.

Run ``python benchmarks/planning.py``; ``--smoke`` takes one seed and two problems. Both in one process, by
turns, RRT-Connect with steps of one length, short cuts, the same shapes, 30 mm kept. Then random
problems in the manner of MotionBenchMaker (its own were not taken): shelves, a table, an open box, a cage,
all of random sizes, from a random clear posture to one with the tool in there, 10 mm kept.

The peer asks Coal at postures along a way whether any two bodies are nearer than the margin (its
``security_margin``): balls around them first, all in one call of NumPy. Nothing between
those postures is looked at; how many of its ways hold is told by seerob's proof, which every way of seerob
has passed.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import time
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import coal
import numpy as np
from ompl import base, geometric, util

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from made_cell import made
from seerob.core.shapes import Solid
from seerob.core.transforms import Array
from seerob.model.model import Model
from seerob.session.planning.clearance import OWN_MARGIN, Clearance
from seerob.session.planning.plan import STRIDE, NoPath, plan

CELL = """
[[robots]]
name = "arm"
model = "library:ur10"
q = [-0.9, -1.2, 1.6, -1.97, -1.57, 0.0]
[[parts]]
name = "pillar"
shape = { box = [0.12, 0.12, 1.6] }
at = { position = [0.72, 0.0, 0.7] }
[[parts]]
name = "shelf"
shape = { box = [0.9, 1.2, 0.03] }
at = { position = [0.75, 0.0, 0.95] }
[[parts]]
name = "table"
shape = { box = [1.8, 1.8, 0.05] }
at = { position = [0.0, 0.0, -0.06] }
[[humans]]
name = "op"
stature = 1.75
mass = 75
sex = "male"
at = { position = [1.25, 0.75, -0.9] }
"""
START = np.array([-0.9, -1.2, 1.6, -1.97, -1.57, 0.0])
GOAL = np.array([0.9, -1.2, 1.6, -1.97, -1.57, 0.0])
MARGIN, SECONDS = 0.03, 60.0
NEAR, PATIENCE = 0.01, 10.0
"""Of the problems: margin [m], and how long either searches [s]."""
STEPS = 0.05, 0.016
"""Between two postures that the peer looks at [rad]: as is usual, and 2 cm at the tool."""


def geometry(solid: Solid) -> Any:
    """Its core as Coal has it: a tree of triangles, or one of the degenerate triangle of a segment."""
    if solid.mesh is not None:
        vertices, faces = solid.mesh.vertices, solid.mesh.faces.tolist()
    elif len(solid.points) == 2:
        vertices, faces = np.array([*solid.points, solid.points[1]]), [(0, 1, 2)]
    else:
        corner, one, other = solid.points
        vertices, faces = np.array([corner, one, other, one + other - corner]), [(0, 1, 2), (1, 3, 2)]
    tree = coal.BVHModelOBBRSS()
    tree.beginModel(len(faces), len(vertices))
    points, triangles = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
    for v in vertices:
        points.append(np.asarray(v, float))
    for f in faces:
        triangles.append(coal.Triangle(*map(int, f)))
    tree.addSubModel(points, triangles)
    tree.endModel()
    tree.computeLocalAABB()
    return tree


def boards(kind: str, random: np.random.Generator) -> tuple[list[Array], Array, Array]:
    """Boxes as rows of centre and size [m], and two corners of where the tool is to go."""
    x, z = random.uniform(0.55, 0.75), random.uniform(0.0, 0.3)
    width, deep, high = random.uniform(0.7, 1.1), random.uniform(0.3, 0.45), random.uniform(0.35, 0.5)
    rows: list[tuple[float, ...]] = []
    if kind == "shelf":
        rows += [(x + deep / 2, 0, z + k * high, deep, width, 0.02) for k in range(3)]
        rows += [(x + deep / 2, s * width / 2, z + high, deep, 0.02, 2 * high) for s in (-1, 1)]
        rows += [(x + deep, 0, z + high, 0.02, width, 2 * high)]
        low, top = (x + 0.05, -0.3 * width, z + 0.1), (x + 0.7 * deep, 0.3 * width, z + high - 0.05)
    elif kind == "table":
        rows += [(x + 0.2, 0, -0.05, 0.9, 1.4, 0.04)]
        rows += [
            (x + random.uniform(-0.1, 0.5), random.uniform(-0.6, 0.6), 0.1, 0.1, 0.1, 0.25) for _ in range(8)
        ]
        low, top = (x - 0.1, -0.5, 0.03), (x + 0.4, 0.5, 0.2)
    elif kind == "box":
        rows += [(x + 0.2, 0, z - 0.1, 0.5, 0.5, 0.02)]
        rows += [(x + 0.2 + s * 0.25, 0, z + 0.05, 0.02, 0.5, 0.3) for s in (-1, 1)]
        rows += [(x + 0.2, s * 0.25, z + 0.05, 0.5, 0.02, 0.3) for s in (-1, 1)]
        low, top = (x + 0.05, -0.15, z), (x + 0.35, 0.15, z + 0.15)
    else:
        rows += [(x + 0.2 + s * 0.25, t * 0.3, z + 0.2, 0.04, 0.04, 1.0) for s in (-1, 1) for t in (-1, 0, 1)]
        rows += [(x + 0.2 + s * 0.25, 0, z + h, 0.04, 0.64, 0.04) for s in (-1, 1) for h in (-0.1, 0.5)]
        low, top = (x + 0.05, -0.2, z), (x + 0.35, 0.2, z + 0.4)
    return [np.array(row) for row in rows], np.array(low), np.array(top)


KINDS = "shelf", "table", "box", "cage"
PROBLEM = """
[[robots]]
name = "arm"
model = "library:ur10"
q = [-0.9, -1.2, 1.6, -1.97, -1.57, 0.0]
[[parts]]
name = "floor"
shape = { box = [3.0, 3.0, 0.05] }
at = { position = [0.0, 0.0, -0.3] }
"""


def problem(kind: str, seed: int) -> tuple[Model, Array, Array]:
    """A workstation, a posture to begin with, and one with the tool among the boards."""
    random = np.random.default_rng(seed)
    rows, low, top = boards(kind, random)
    parts = "".join(
        f'[[parts]]\nname = "board{k}"\nshape = {{ box = {row[3:].tolist()} }}\n'
        f"at = {{ position = {row[:3].tolist()} }}\n"
        for k, row in enumerate(rows)
    )
    with TemporaryDirectory() as folder:
        model = made(Path(folder), PROBLEM + parts).model
    robot = model.robot("arm")
    clearance = Clearance(model, robot, START)
    tool = max(robot.moving, key=lambda i: model.bodies[i].name)

    def clear(there: bool) -> Array:
        while True:
            q = random.uniform(-np.pi, np.pi, 6)
            q[1], q[3] = random.uniform(-np.pi, 0.3), random.uniform(-np.pi, np.pi)
            x = clearance._poses(q)[1][tool]
            if there == bool(((x >= low) & (x <= top)).all()) and clearance.is_clear(q, NEAR):
                return q

    return model, clear(False), clear(True)


class Peer:
    """What MoveIt and others do: OMPL, and a collision library asked at postures."""

    def __init__(self, model: Model, clearance: Clearance, margin: float) -> None:
        self.clearance = clearance
        self.trees = [[(geometry(s), s.radius) for s in body.solids] for body in model.bodies]
        flat = [(k, i) for k, body in enumerate(self.trees) for i in range(len(body))]
        at = {one: index for index, one in enumerate(flat)}
        self.geometries = [self.trees[k][i][0] for k, i in flat]
        self.body = np.array([k for k, _ in flat])
        self.centre = np.array([g.aabb_center for g in self.geometries])
        ball = np.array([g.aabb_radius for g in self.geometries])
        pairs = [
            (at[a, i], at[b, j], need + self.trees[a][i][1] + self.trees[b][j][1])
            for pairs in clearance._pairs
            for need in [pairs.deviation + (OWN_MARGIN if pairs.own else margin)]
            for b in pairs.query.b
            for a in pairs.query.a
            for i in range(len(self.trees[a]))
            for j in range(len(self.trees[b]))
        ]
        self.first, self.second = (np.array([pair[k] for pair in pairs]) for k in (0, 1))
        self.need = np.array([pair[2] for pair in pairs])
        self.far = (ball[self.first] + ball[self.second] + self.need) ** 2
        self.request = coal.CollisionRequest()
        self.request.num_max_contacts = 1

    def is_clear(self, q: Array) -> bool:
        R, x = self.clearance._poses(q)
        R, x = R[self.body], x[self.body]
        centre = np.einsum("nij,nj->ni", R, self.centre) + x
        apart = ((centre[self.first] - centre[self.second]) ** 2).sum(axis=1)
        for k in np.flatnonzero(apart <= self.far).tolist():
            i, j = self.first[k], self.second[k]
            self.request.security_margin = float(self.need[k])
            result = coal.CollisionResult()
            one, other = coal.Transform3s(R[i], x[i]), coal.Transform3s(R[j], x[j])
            if coal.collide(self.geometries[i], one, self.geometries[j], other, self.request, result):
                return False
        return True

    def plan(self, start: Array, goal: Array, seed: int, step: float, seconds: float) -> list[Array] | None:
        util.RNG.setSeed(seed + 1)
        n = len(start)
        space, bounds = base.RealVectorStateSpace(n), base.RealVectorBounds(n)
        robot = self.clearance.robot
        for i in range(n):
            ends = sorted((start[i], goal[i]))
            bounds.setLow(i, float(max(robot.lower[i], ends[0] - np.pi)))
            bounds.setHigh(i, float(min(robot.upper[i], ends[1] + np.pi)))
        space.setBounds(bounds)
        setup = geometric.SimpleSetup(space)
        information = setup.getSpaceInformation()

        def posture(state: Any) -> Array:
            return np.array([state[i] for i in range(n)])

        def state(q: Array) -> Any:
            found = space.allocState()
            for i, value in enumerate(q.tolist()):
                found[i] = value
            return found

        setup.setStateValidityChecker(lambda s: self.is_clear(posture(s)))
        information.setStateValidityCheckingResolution(step / space.getMaximumExtent())
        setup.setStartAndGoalStates(state(start), state(goal))
        planner = geometric.RRTConnect(information)
        planner.setRange(STRIDE)
        setup.setPlanner(planner)
        setup.solve(seconds)
        if not setup.haveExactSolutionPath():
            return None
        path = setup.getSolutionPath()
        simplifier = geometric.PathSimplifier(information)
        simplifier.ropeShortcutPath(path)
        simplifier.partialShortcutPath(path, 60, 30)
        simplifier.reduceVertices(path)
        return [posture(s) for s in path.getStates()]


def length(path: list[Array]) -> float:
    return float(sum(np.linalg.norm(b - a) for a, b in pairwise(path)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--smoke", action="store_true")
    options = parser.parse_args()
    util.setLogLevel(util.LOG_NONE)
    seeds = range(1, 2) if options.smoke else range(1, 11)
    with TemporaryDirectory() as folder:
        model = made(Path(folder), CELL).model
    clearance = Clearance(model, model.robot("arm"), START)
    peer = Peer(model, clearance, MARGIN)
    random = np.random.default_rng(0)
    postures = random.uniform(START - 1, GOAL + 1, (20 if options.smoke else 300, 6))
    differ = sum(peer.is_clear(q) != clearance.is_clear(q, MARGIN) for q in postures)
    print(f"postures that both judge: {len(postures)}, {differ} differ")
    ours: list[tuple[float, float]] = []
    theirs: dict[float, list[tuple[float, float]]] = {step: [] for step in STEPS}
    held = dict.fromkeys(STEPS, 0)
    plan(model, "arm", [GOAL], margin=MARGIN)  # loops are loaded, or compiled
    for seed in seeds:
        begun = time.thread_time()
        try:
            found = plan(model, "arm", [GOAL], margin=MARGIN, seed=seed, seconds=SECONDS)
            ours.append((time.thread_time() - begun, length(list(found.q))))
        except NoPath:
            ours.append((np.inf, np.inf))
        for step in STEPS:
            begun = time.thread_time()
            path = peer.plan(START, GOAL, seed, step, SECONDS)
            spent = time.thread_time() - begun
            theirs[step].append((spent, np.inf if path is None else length(path)))
            held[step] += path is not None and all(clearance.clear(a, b, MARGIN) for a, b in pairwise(path))
    every = {"seerob, proven": ours, **{f"OMPL and Coal each {step} rad": theirs[step] for step in STEPS}}
    for name, each in every.items():
        done = [one for one in each if one[1] < np.inf]
        times = [t for t, _ in done] or [np.inf]
        median, longest = statistics.median(times), max(times)
        way = statistics.median([w for _, w in done] or [np.inf])
        print(
            f"{name}: {len(done)} of {len(each)} found, median {median:.2f} s, longest {longest:.2f} s "
            f"of the processor, length {way:.2f} rad"
        )
    for step in STEPS:
        both = zip(ours, theirs[step], strict=True)
        ratio = statistics.median(t / o for (o, _), (t, _) in both if o < np.inf)
        print(
            f"each {step} rad: {held[step]} of the peer's ways hold between postures, too; "
            f"seerob is {ratio:.1f} times as fast"
        )
    if differ:
        raise SystemExit("they differ")
    problems(
        [(kind, seed) for seed in range(1 if options.smoke else 10) for kind in KINDS][
            : 2 if options.smoke else None
        ]
    )


def problems(every: list[tuple[str, int]]) -> None:
    """Both at random problems, by turns."""
    solved = missed = sooner = ours_alone = 0
    ratios = []
    for kind, seed in every:
        model, start, goal = problem(kind, seed)
        clearance = Clearance(model, model.robot("arm"), start)
        peer = Peer(model, clearance, NEAR)
        begun = time.thread_time()
        try:
            plan(model, "arm", [goal], start=start.tolist(), margin=NEAR, seed=seed, seconds=PATIENCE)
            ours = time.thread_time() - begun
        except NoPath:
            ours = np.inf
        begun = time.thread_time()
        path = peer.plan(start, goal, seed, STEPS[0], PATIENCE)
        theirs = time.thread_time() - begun
        if path is None:
            ours_alone += ours < np.inf
            continue
        solved += 1
        missed += ours == np.inf
        sooner += ours <= theirs
        ratios.append(theirs / ours)
    low, middle, high = np.percentile(ratios, (10, 50, 90)) if ratios else (np.nan,) * 3
    print(
        f"{len(every)} problems: OMPL and Coal solve {solved}; seerob {solved - missed} of these, {sooner} "
        f"in the time that OMPL took; seerob alone solves {ours_alone}; seerob is {middle:.1f} times as fast "
        f"(a tenth less than {low:.1f}, a tenth more than {high:.1f})"
    )


if __name__ == "__main__":
    main()
