r"""Where a part of a person could be clamped: in a gap no wider than the body part, of parts that move.

A gap :math:`g` between a moving part of a robot and another surface clamps a body part of the
thickness :math:`D` where it is no wider than it, or may be by the next instant, while its sides move:

.. math:: |v| > 0, \qquad g - \delta \le D

with :math:`\delta` how far the sides have moved since the instant before. Whether the *least* distance
closes does not count: a nearer surface at a constant distance, or a part that tilts, hides another place
where the gap closes. A part that moves past a surface or away from it counts as well: the rule errs on the
side of clamping, and one more surface never permits more.

Gaps of one robot's own parts are counted only after they were once as wide as the body part, since nothing
gets between links that are always near, and only while these two move against each other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from seerob.distances.least import Per, Query
from seerob.kernels.shapes import Shapes
from seerob.model import Mechanism, Model
from seerob.transforms import Array

Flags = NDArray[np.bool_]

STILL = 1e-3
"""Parts of a robot that move more slowly against each other stay as they are [m/s]."""
AHEAD = 0.09
"""Largest way that is looked ahead to the next instant [m]."""


def clamps(
    gaps: Array,
    moved: Array,
    speed: Array,
    thickness: Array,
    *,
    opened: Flags,
) -> Flags:
    """Which gaps clamp which body parts, and when.

    Args:
        gaps: Distances of pairs of surfaces [m], shape (N, g); not above a cap that exceeds every thickness
            by more than `AHEAD`.
        moved: How far their sides have moved since the instant before [m], 0 at the first, shape (N, g).
        speed: Of one side seen from the other [m/s], infinity where it counts in any case, shape (N, g).
        thickness: Of body parts [m], shape (r,).
        opened: Whether a pair counts from the start on (True) or only after it was as wide as the body
            part (False), shape (g,) or, of each body part, (g, r).

    Returns:
        Shape (N, g, r).
    """
    gaps = np.asarray(gaps, float)
    seen = np.maximum.accumulate(gaps, axis=0)
    opened = opened[:, None] if opened.ndim == 1 else opened
    wide = opened | (seen[..., None] >= thickness)
    ahead = gaps - np.minimum(moved, AHEAD)
    return np.asarray((speed > STILL)[..., None] & (ahead[..., None] <= thickness) & wide)


@dataclass(frozen=True, eq=False)
class PinchPairs:
    """The gaps in which the moving parts of a robot could clamp somebody, bound once."""

    moving: tuple[int, ...]
    """Bodies of the robot that its joints move."""
    queries: tuple[tuple[Query, Per], ...]
    first: NDArray[np.int64]
    """Row in ``moving`` of each gap, shape (g,)."""
    second: NDArray[np.int64]
    """Row in ``moving`` of the other side, -1 when it is a surface, shape (g,)."""
    opened: Flags
    """See `clamps`."""

    def gaps(self, rotations: Array, positions: Array) -> tuple[Array, NDArray[np.int64]]:
        """Gaps [m] and the body on the other side (-1 beyond the cap), shape (g,).

        Args:
            rotations: world_from_body of every body, shape (n, 3, 3).
            positions: Likewise [m], shape (n, 3).
        """
        distances, others = [np.zeros(0)], [np.zeros(0, np.int64)]
        for query, per in self.queries:
            found = query.ask(rotations, positions, per)
            distances.append(found.distance)
            others.append(found.body_a)
        return np.concatenate(distances), np.concatenate(others)

    def batch(self, rotations: Array, positions: Array) -> Array:
        """Gaps of many samples [m], shape (N, g). Poses as of `Query.batch`."""
        found = [query.batch(rotations, positions, per).distance for query, per in self.queries]
        return np.concatenate([np.zeros((len(rotations), 0)), *found], axis=1)

    def per_body(self, clamped: Flags) -> Flags:
        """Of gaps (..., g, r), which moving bodies clamp: shape (..., b, r)."""
        found = np.zeros((*clamped.shape[:-2], len(self.moving), clamped.shape[-1]), bool)
        if not clamped.any():
            return found
        for side in (self.first, self.second):
            for gap in np.flatnonzero(side >= 0):
                found[..., side[gap], :] |= clamped[..., gap, :]
        return found


def pinch_pairs(
    shapes: Shapes,
    moving: Sequence[int],
    surfaces: Sequence[int],
    neighbours: frozenset[tuple[int, int]],
    *,
    still: Sequence[int] = (),
    cap: float,
) -> PinchPairs:
    """Bind the gaps of a robot.

    Args:
        shapes: Of the model.
        moving: Bodies that the robot's joints move.
        surfaces: Bodies of the environment and of other robots.
        neighbours: Pairs of the robot's own bodies that a joint or a weld connects.
        still: The robot's own bodies that its joints do not move.
        cap: Largest gap that matters [m].
    """
    queries: list[tuple[Query, Per]] = []
    first: list[int] = []
    second: list[int] = []
    if moving and surfaces:
        queries.append((Query(shapes, surfaces, moving, cap=cap), Per.BODY))
        first += range(len(moving))
        second += [-1] * len(moving)
    outside = len(first)
    own = [*moving, *still]
    for row, body in enumerate(moving):
        others = [
            k
            for k in range(row + 1, len(own))
            if (body, own[k]) not in neighbours and (own[k], body) not in neighbours
        ]
        if others:
            queries.append((Query(shapes, [own[k] for k in others], [body], cap=cap), Per.PAIR))
            first += [row] * len(others)
            second += [k if k < len(moving) else -1 for k in others]
    opened = np.arange(len(first)) < outside
    return PinchPairs(
        tuple(moving), tuple(queries), np.array(first, np.int64), np.array(second, np.int64), opened
    )


def robot_pinch_pairs(model: Model, robot: Mechanism, *, cap: float) -> PinchPairs:
    """The gaps of a robot to parts, other robots and its own links that no joint connects.

    Args:
        model: The compiled workstation.
        robot: The robot.
        cap: Largest gap that matters [m].
    """
    own = (*robot.bodies, *robot.carried)
    still = [i for i in own if i not in robot.moving]
    surfaces = [b.index for b in model.bodies if b.role not in ("human", "area") and b.index not in own]
    weld, parent = model.mj.body_weldid, model.mj.body_parentid
    group = {i: int(weld[model.bodies[i].mj]) for i in own}
    above = {i: int(weld[parent[group[i]]]) for i in own}
    neighbours = frozenset(
        (i, j)
        for i in own
        for j in own
        if group[i] == group[j] or above[i] == group[j] or above[j] == group[i]
    )
    return pinch_pairs(model.shapes, robot.moving, surfaces, neighbours, still=still, cap=cap)
