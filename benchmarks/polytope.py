"""Exact force polytopes with asymmetric limits and gravity bias, against pycapacity, in one process.

    python benchmarks/polytope.py            # against pycapacity too where it is installed (it pulls
                                             # cvxopt, which is GPL: so it is no dependency)
    python benchmarks/polytope.py --smoke    # a few poses against scipy only

Poses, Jacobians and gravity torques of a UR10e and an LBR iiwa 14 come from Pinocchio and are not timed.
All sides get the same arrays: a Jacobian, asymmetric limits and a bias. The ratio is of like things: every
vertex of every polytope from `seerob.kernels.polytope.vertices` in a batch, against the vertices of
pycapacity's ``force_polytope`` and against those of scipy's half-space intersection (Qhull), which is always
there. Beside it: the farthest corner and the inscribed force alone, and one call with corners and faces.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import numpy as np
import pinocchio as pin
from scipy.spatial import ConvexHull, HalfspaceIntersection

from seerob.core.transforms import Array
from seerob.criteria.polytope import SAME, zero_moment
from seerob.description.description import Description, JointKind
from seerob.description.robots import library
from seerob.kernels.polytope import largest, vertices

ROBOTS = ("ur10e", "iiwa14")
PUBLISHED = {6: np.array([330.0, 330, 150, 54, 54, 54]), 7: np.array([320.0, 320, 176, 176, 110, 40, 40])}


def pinocchio_model(description: Description) -> pin.Model:
    """The robot, gravity along −z."""
    model = pin.Model()
    at: dict[str, tuple[int, pin.SE3]] = {}
    for link in description.links:
        parent, placement = at[link.parent] if link.parent else (0, pin.SE3.Identity())
        placement = placement * pin.SE3(link.parent_from_link)
        for joint in link.joints:
            assert joint.kind is JointKind.REVOLUTE
            parent = model.addJoint(
                parent, pin.JointModelRevoluteUnaligned(joint.axis), placement, joint.name
            )
            placement = pin.SE3.Identity()
        if link.inertial is not None and parent:
            body = pin.Inertia(link.inertial.mass, link.inertial.com, link.inertial.inertia)
            model.appendBodyToJoint(parent, body, placement)
        model.addFrame(pin.Frame(link.name, parent, 0, placement, pin.FrameType.BODY))
        at[link.name] = parent, placement
    return model


def cases(name: str, count: int) -> tuple[Array, Array, Array, Array]:
    """Jacobians (N, 3, n), lower and upper limits (n,), gravity torques (N, n)."""
    description = library.load(name)
    model = pinocchio_model(description)
    data, frame = model.createData(), model.getFrameId(description.tip)
    rng = np.random.default_rng(0)
    upper = PUBLISHED[model.nv]
    lower = -upper * rng.uniform(0.6, 1.0, model.nv)
    J, gravity = [], []
    while len(J) < count:
        q = rng.uniform(-2.5, 2.5, model.nv)
        row = pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED)[:3]
        bias = pin.computeGeneralizedGravity(model, data, q).copy()
        # Qhull needs 0 inside, pycapacity a Jacobian of full rank.
        if np.linalg.cond(row) < 100 and (lower < bias).all() and (bias < upper).all():
            J.append(row.copy())
            gravity.append(bias)
    return np.array(J), lower, upper, np.array(gravity)


def seconds(call: Callable[[], object], repeats: int) -> float:
    """Median of several runs [s]."""
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        call()
        times.append(time.perf_counter() - begin)
    return float(np.median(times))


def qhull(J: Array, low: Array, high: Array) -> Array:
    """Corners by half-space intersection about 0."""
    slabs = np.block([[J.T, -high[:, None]], [-J.T, low[:, None]]])
    slabs = slabs[np.linalg.norm(slabs[:, :3], axis=1) > 1e-9]
    return np.asarray(HalfspaceIntersection(slabs, np.zeros(3)).intersections)


def measure(name: str, *, smoke: bool) -> None:
    """Print agreement and ratios for one robot."""
    J, lower, upper, gravity = cases(name, 20 if smoke else 2000)
    low, high = lower - gravity, upper - gravity
    norm, _, _ = largest(J, low, high)
    theirs = [np.linalg.norm(qhull(*case), axis=1).max() for case in zip(J[:20], low, high, strict=False)]
    error = float(np.abs(norm[:20] / theirs - 1).max())
    print(f"{name}: largest force against scipy HalfspaceIntersection, 20 poses: {error:.1e} relative")
    assert error < 1e-12
    V, begin = vertices(J, low, high, SAME)
    hulls = [ConvexHull(V[begin[k] : begin[k + 1]]).volume for k in range(20)]
    peers = [ConvexHull(qhull(J[k], low[k], high[k])).volume for k in range(20)]
    error = float(np.abs(np.divide(hulls, peers) - 1).max())
    print(f"  volume of the vertices' hull against scipy, 20 poses: {error:.1e} relative")
    assert error < 1e-9
    count = len(J)
    batch = seconds(lambda: vertices(J, low, high, SAME), 3 if smoke else 9) / count
    scipy = seconds(lambda: [qhull(J[k], low[k], high[k]) for k in range(20)], 3 if smoke else 5) / 20
    print(f"  all vertices, batch of {count}: {1e6 * batch:.2f} us; scipy {1e6 * scipy:.0f} us: "
          f"{scipy / batch:.0f} x")  # fmt: skip
    if smoke:
        return
    farthest = seconds(lambda: largest(J, low, high), 9) / count
    single = seconds(lambda: [zero_moment(J[k], low[k], high[k]) for k in range(200)], 5) / 200
    print(f"  farthest vertex and inscribed force alone, batch: {1e6 * farthest:.2f} us")
    print(f"  one call with corners and faces: {1e6 * single:.1f} us, scipy {scipy / single:.1f} x")
    try:
        from pycapacity.robot import force_polytope
    except ImportError:
        print("  pycapacity is not installed: no ratio to it was measured in this run")
        return

    def peer(k: int) -> Array:
        return np.asarray(force_polytope(J[k], upper, lower, gravity[k]).vertices)

    theirs = [ConvexHull(peer(k).T).volume for k in range(20)]
    print(f"  volume against pycapacity, 20 poses: {np.abs(np.divide(theirs, hulls) - 1).max():.1e} relative")
    took = seconds(lambda: [peer(k) for k in range(30)], 5) / 30
    print(
        f"  pycapacity, vertices: {1e6 * took:.0f} us: {took / batch:.0f} x the batch (goal: >= 500), "
        f"{took / single:.0f} x one call"
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--smoke", action="store_true", help="few poses, correctness only")
    options = parser.parse_args()
    for robot in ROBOTS:
        measure(robot, smoke=options.smoke)
