"""RRT-Connect ([Kuffner2000]_) between two postures, and short cuts; the same seed gives the same path.

Written here because OMPL's generator of random numbers can be seeded once in a process only: the second
plan of a session would not be the one that another session finds. Tests compare with OMPL.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from itertools import pairwise

import numpy as np

from seerob.errors import SeerobError
from seerob.planning.clearance import Clearance
from seerob.transforms import Array

STRIDE = 0.6
"""Largest step of a tree in joint space [rad or m]."""
SHORT_CUTS = 60
STILL = 15
"""Short cuts in a row that do not help, after which it is enough."""


class NoPath(SeerobError):
    """No path was found; that there is none is not known."""


class Stopped(SeerobError):
    """It was asked to stop."""


class _Tree:
    def __init__(self, root: Array) -> None:
        self.q = root[None].copy()
        self.parent = [-1]

    def nearest(self, q: Array) -> int:
        return int(np.argmin(((self.q - q) ** 2).sum(axis=1)))

    def add(self, q: Array, parent: int) -> int:
        self.q = np.vstack([self.q, q])
        self.parent.append(parent)
        return len(self.parent) - 1

    def way(self, k: int) -> list[Array]:
        """From the root to a node."""
        found = []
        while k >= 0:
            found.append(self.q[k])
            k = self.parent[k]
        return found[::-1]


def search(
    clearance: Clearance,
    start: Array,
    goal: Array,
    *,
    margin: float,
    seed: int,
    most: int,
    seconds: float,
    say: Callable[[int], bool],
) -> list[Array]:
    """Postures of a path whose straight ways all keep the margin.

    Args:
        clearance: The robot among everything.
        start: Joint positions, shape (n,); clear.
        goal: Likewise.
        margin: [m].
        seed: Of what is tried.
        most: Largest number of postures tried.
        seconds: Longest time; what is found before does not depend on it [s].
        say: Told how many were tried; True stops the work.

    Raises:
        NoPath: None was found within ``most`` or ``seconds``.
        Stopped: ``say`` said so.
    """
    if clearance.clear(start, goal, margin):
        return [start, goal]
    random = np.random.default_rng(seed)
    low, high = _bounds(clearance, start, goal)
    trees = _Tree(start), _Tree(goal)
    end = time.monotonic() + seconds
    for tried in range(most):
        if say(tried):
            raise Stopped(f"stopped after {tried} postures")
        if time.monotonic() > end:
            raise NoPath(
                f"no path was found in {seconds:g} s ({tried} tried); that there is none is not known"
            )
        growing, other = trees[tried % 2], trees[1 - tried % 2]
        wanted = random.uniform(low, high)
        node = _grow(clearance, growing, wanted, margin)
        if node is None:
            continue
        reached = _connect(clearance, other, growing.q[node], margin)
        if reached is not None:
            there, back = growing.way(node), other.way(reached)
            way = there + back[-2::-1] if tried % 2 == 0 else back + there[-2::-1]
            return _shortened(clearance, way, margin, random, end, say)
    raise NoPath(f"no path was found with {most} postures tried; that there is none is not known")


def _bounds(clearance: Clearance, start: Array, goal: Array) -> tuple[Array, Array]:
    """Where postures are tried: within the limits, and where there are none half a turn around both ends."""
    robot = clearance.robot
    low, high = np.minimum(start, goal) - np.pi, np.maximum(start, goal) + np.pi
    return np.maximum(robot.lower, low), np.minimum(robot.upper, high)


def _grow(clearance: Clearance, tree: _Tree, towards: Array, margin: float) -> int | None:
    k = tree.nearest(towards)
    step = towards - tree.q[k]
    length = float(np.linalg.norm(step))
    new = tree.q[k] + step * min(1.0, STRIDE / max(length, 1e-12))
    return tree.add(new, k) if clearance.clear(tree.q[k], new, margin) else None


def _connect(clearance: Clearance, tree: _Tree, goal: Array, margin: float) -> int | None:
    while True:
        node = _grow(clearance, tree, goal, margin)
        if node is None:
            return None
        if np.abs(tree.q[node] - goal).max() < 1e-12:
            return node
        if tree.nearest(goal) != node:
            return None


def _shortened(
    clearance: Clearance,
    way: list[Array],
    margin: float,
    random: np.random.Generator,
    end: float,
    say: Callable[[int], bool],
) -> list[Array]:
    useless = 0
    for _ in range(SHORT_CUTS):
        if len(way) < 3 or useless > STILL or time.monotonic() > end or say(-1):
            break
        places = np.sort(random.uniform(0, len(way) - 1, 2))
        i, j = int(places[0]), int(places[1])
        if i == j:
            useless += 1
            continue
        a = way[i] + (places[0] - i) * (way[i + 1] - way[i])
        b = way[j] + (places[1] - j) * (way[min(j + 1, len(way) - 1)] - way[j])
        before = [a, *way[i + 1 : j + 1], b]
        shorter = float(np.linalg.norm(b - a)) < _length(before) - 1e-6
        if shorter and clearance.clear(a, b, margin):
            way = [*way[: i + 1], a, b, *way[j + 1 :]]
            useless = 0
        else:
            useless += 1
    return _plain(clearance, way, margin)


def _plain(clearance: Clearance, way: list[Array], margin: float) -> list[Array]:
    """Without postures that can be left out."""
    k = 1
    while k < len(way) - 1:
        same = np.abs(way[k] - way[k - 1]).max() < 1e-9
        if same or clearance.clear(way[k - 1], way[k + 1], margin):
            del way[k]
        else:
            k += 1
    return way


def _length(way: list[Array]) -> float:
    return float(sum(np.linalg.norm(b - a) for a, b in pairwise(way)))
