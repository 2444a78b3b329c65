"""Triangles of a simple polygon, convex or not."""

from __future__ import annotations

import numpy as np

from seerob.core.transforms import Array


def cut_ears(outline: Array) -> list[tuple[int, int, int]]:
    """Triangles of a simple polygon, counter-clockwise, by cutting ears; shape (n, 2) to indices.

    What is left of an outline that crosses itself is not covered.
    """
    xy = np.asarray(outline, float)
    nxt = np.roll(xy, -1, axis=0)
    twice = float((xy[:, 0] * nxt[:, 1] - xy[:, 1] * nxt[:, 0]).sum()) if len(xy) else 0.0
    left = list(range(len(xy))) if twice > 0 else list(range(len(xy)))[::-1]
    found: list[tuple[int, int, int]] = []

    def turn(a: int, b: int, c: int) -> float:
        u, v = xy[b] - xy[a], xy[c] - xy[b]
        return float(u[0] * v[1] - u[1] * v[0])

    def is_ear(k: int) -> bool:
        a, b, c = left[k - 1], left[k], left[(k + 1) % len(left)]
        others = (p for p in left if p not in (a, b, c))
        return turn(a, b, c) > 0 and not any(
            turn(a, b, p) >= 0 and turn(b, c, p) >= 0 and turn(c, a, p) >= 0 for p in others
        )

    while len(left) > 2:
        k = next((k for k in range(len(left)) if is_ear(k)), None)
        if k is None:
            return found
        found.append((left[k - 1], left[k], left[(k + 1) % len(left)]))
        del left[k]
    return found
