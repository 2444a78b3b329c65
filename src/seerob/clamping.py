r"""Where a part of a person could be clamped: a gap that closes below the body part's thickness.

A gap :math:`g` between a moving part of a robot and another surface clamps a body part of the
thickness :math:`D` while it closes and is, or by the next instant may be, no wider than it:

.. math:: \dot g < 0, \qquad g_n + (g_n - g_{n-1}) \le D

Causal, so that a live run and a recording say the same. What was before the first instant is not
known: a gap that is narrow there counts as closing, unless nothing is left of it. Gaps of
one robot's own parts are counted only after they were once as wide as the body part: nothing gets
between links that are always near.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from seerob.distance import Per, Query
from seerob.kernels.shapes import Shapes
from seerob.model import Mechanism, Model
from seerob.transforms import Array

Flags = NDArray[np.bool_]

STILL = 1e-3
"""A gap that closes more slowly than this stays as it is [m/s]."""


def clamps(
    gaps: Array,
    t: Array,
    thickness: Array,
    *,
    opened: Flags,
    before: tuple[float, Array, Array] | None = None,
) -> Flags:
    """Which gaps clamp which body parts, and when.

    Args:
        gaps: Distances of pairs of surfaces [m], shape (N, g); not above a cap that exceeds every thickness.
        t: Instants, increasing [s], shape (N,).
        thickness: Of body parts [m], shape (r,).
        before: Instant [s], gaps and widest gaps so far [m] just before the first instant, shape (g,) each;
            None when nothing is known of it.
        opened: Whether a pair counts from the start on (True) or only after it was as wide as the body
            part (False), shape (g,).

    Returns:
        Shape (N, g, r).
    """
    gaps = np.asarray(gaps, float)
    earlier, when, widest = np.full_like(gaps[:1], np.inf), -np.inf, gaps[:1]
    if before is not None:
        when, earlier, widest = before[0], before[1][None], before[2][None]
    previous = np.concatenate([earlier, gaps[:-1]])
    elapsed = np.diff(np.concatenate([[when], t]))[:, None]
    change = gaps - previous
    closing = np.where(np.isinf(previous), gaps > 0, change < -STILL * elapsed)
    ahead = gaps + np.where(np.isfinite(change), change, 0.0)
    seen = np.maximum.accumulate(np.concatenate([widest, gaps]), axis=0)[1:]
    wide = opened[None, :, None] | (seen[..., None] >= thickness)
    return np.asarray(closing[..., None] & (ahead[..., None] <= thickness) & wide)


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
