r"""The convex outline of where a point of a robot or a person can be, from kinematics and joint limits.

Of the set of places that a point reaches, the farthest in a direction d is found by moving one joint at a
time: with all others held, :math:`d \cdot p` is a sinusoid of a joint that turns and linear in one that
slides, so that its best position within the limits is known in closed form ([LynchPark2017]_ section 4.1 has
the screws). Joints are gone through from base to tip until nothing is gained, from random beginnings.

Each corner of the outline is a place that is reached. Between corners, places lie at most `Outline.beyond`
outside of it, if no beginning missed the farthest: the support of a convex set in any direction between three
is at most that of the point where their planes meet. That none was missed is no theorem; many random postures
are looked at, too, and one that was farther moves its plane. Inside there are places that are not reached.
Joints do not stop at other bodies, and mimic joints are free within their limits.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import NamedTuple

import mujoco
import numpy as np

from seerob.core.errors import InputError
from seerob.core.shapes import Faces
from seerob.core.transforms import Array
from seerob.description.shapes.hull import convex_hull
from seerob.model.model import Model
from seerob.model.volumes.moving import joints_above
from seerob.model.volumes.reachable import Screw, screws_of

BEGINNINGS = 8
"""Random postures from which each direction is searched."""
ROUNDS = 60
"""Times that all joints are gone through, at most."""
GAINED = 1e-6
"""Below which a round has gained nothing [m]."""
POSTURES = 20_000
"""Random postures that are looked at besides."""


@dataclass(frozen=True, eq=False)
class Outline:
    """Convex hull of places that a point reaches."""

    points: Array
    """Places that are reached [m], shape (n, 3)."""
    faces: Faces
    """Triangles of their convex hull, shape (m, 3)."""
    beyond: float
    """How far outside of the hull a place can be [m]; see above."""


class Carried(NamedTuple):
    """An outline in the world, and what carries it along."""

    outline: Outline
    base: int
    """Body of `mujoco` that carries the first joint that moves."""
    rotation: Array
    """world_from_base that the outline was made at, shape (3, 3)."""
    position: Array
    """Place of that base [m], shape (3,)."""

    def points(self, rotation: Array, position: Array) -> Array:
        """Its points where the base is at another pose [m], shape (n, 3)."""
        return (self.outline.points - self.position) @ self.rotation @ rotation.T + position


def reach_outline(model: Model, mj: int, point: Array, *, still: Collection[int] = ()) -> Carried | None:
    """Convex outline of where a point of a body can be within the joint limits.

    Args:
        model: The compiled workstation.
        mj: Body of `mujoco`.
        point: In the body's frame [m], shape (3,).
        still: Joints of `mujoco` that stay where they are, by index.

    Returns:
        None where the places are all in one plane.

    Raises:
        InputError: A slide without limits; no joint that moves it.
    """
    data = mujoco.MjData(model.mj)
    data.qpos[:] = model.mj.qpos0
    mujoco.mj_kinematics(model.mj, data)
    chain = [j for j in joints_above(model.mj, mj) if j not in still]
    if not chain:
        raise InputError.at("reach", "of", "no joint moves it", "pick a robot, a person, or a body of them")
    screws = screws_of(model, chain, data.xanchor, data.xaxis)
    tip = data.xmat[mj].reshape(3, 3) @ point + data.xpos[mj]
    base = int(model.mj.body_parentid[model.mj.jnt_bodyid[chain[0]]])
    found = outline([screws[j] for j in chain], tip)
    if found is None:
        return None
    return Carried(found, base, data.xmat[base].reshape(3, 3).copy(), data.xpos[base].copy())


def outline(chain: list[Screw], tip: Array) -> Outline | None:
    """Convex outline of where a point at the end of a chain of screws can be.

    Args:
        chain: Axes at a reference position, from base to tip, and how far each may go from there.
        tip: The point at that position [m], shape (3,).
    """
    rng = np.random.default_rng(0)
    low, high = (np.array([getattr(s, end) for s in chain]) for end in ("low", "high"))
    directions, triangles = _directions()
    many = np.repeat(directions, BEGINNINGS, axis=0)
    found = _farthest(chain, tip, many, rng.uniform(low, high, (len(many), len(chain))))
    random = _placed(chain, tip, rng.uniform(low, high, (POSTURES, len(chain))))[0]
    every = np.concatenate([found, random])
    best = every[np.argmax(directions @ every.T, axis=1)]
    faces = convex_hull(best)
    if faces is None:
        return None
    return Outline(best, faces, _beyond(directions, best, triangles))


def _placed(chain: list[Screw], tip: Array, delta: Array) -> list[Array]:
    """Where the tip is once the joints from each on have moved, shape (N, 3) each; one more, of none."""
    places = [np.broadcast_to(tip, (len(delta), 3))]
    for i in reversed(range(len(chain))):
        places.insert(0, _moved(chain[i], places[0], delta[:, i]))
    return places


def _moved(screw: Screw, points: Array, delta: Array) -> Array:
    if screw.slide:
        return points + delta[:, None] * screw.axis
    return screw.anchor + _turned(screw.axis, points - screw.anchor, delta)


def _turned(axis: Array, vectors: Array, angle: Array) -> Array:
    along = (vectors @ axis)[:, None] * axis
    cos, sin = np.cos(angle)[:, None], np.sin(angle)[:, None]
    return along + cos * (vectors - along) + sin * np.cross(axis, vectors)


def _farthest(chain: list[Screw], tip: Array, directions: Array, delta: Array) -> Array:
    """Where the tip is farthest in each direction, as found from a posture each, shape (N, 3)."""
    reached = np.full(len(directions), -np.inf)
    for _ in range(ROUNDS):
        places, seen = _placed(chain, tip, delta), directions
        now = np.einsum("ij,ij->i", places[0], directions)
        if (now - reached).max() < GAINED:
            break
        reached = now
        for i, screw in enumerate(chain):
            delta[:, i] = _best(screw, seen, places[i + 1], delta[:, i])
            if not screw.slide:  # what moves the rest sees the direction turned back
                seen = _turned(screw.axis, seen, -delta[:, i])
    return _placed(chain, tip, delta)[0]


def _best(screw: Screw, seen: Array, points: Array, now: Array) -> Array:
    """The position of a joint that takes its points farthest in directions, shape (N,)."""
    low, high = screw.low, screw.high
    if screw.slide:
        return np.where(seen @ screw.axis > 0, high, low)
    arms = points - screw.anchor
    across = arms - (arms @ screw.axis)[:, None] * screw.axis
    a = np.einsum("ij,ij->i", seen, across)
    b = np.einsum("ij,ij->i", seen, np.cross(screw.axis, arms))
    top = np.arctan2(b, a)
    top = low + np.mod(top - low, 2 * np.pi)
    ends = np.array([low, high])
    end = ends[np.argmax(np.cos(ends)[:, None] * a + np.sin(ends)[:, None] * b, axis=0)]
    best = np.where(top <= high, top, end)
    return np.where(np.hypot(a, b) > 1e-12, best, now)


def _directions() -> tuple[Array, Faces]:
    """Directions all around and the triangles that they make: an icosahedron's, edges halved three times."""
    g = (1 + np.sqrt(5)) / 2
    points = np.array([(0, a, b * g) for a in (-1, 1) for b in (-1, 1)])
    points = np.concatenate([np.roll(points, k, axis=1) for k in range(3)]).astype(float)
    points /= np.linalg.norm(points, axis=1)[:, None]
    for _ in range(3):
        faces = convex_hull(points)
        assert faces is not None
        edges = np.unique(
            np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])), axis=0
        )
        middle = points[edges].mean(axis=1)
        points = np.concatenate([points, middle / np.linalg.norm(middle, axis=1)[:, None]])
    faces = convex_hull(points)
    assert faces is not None
    return points, faces


def _beyond(directions: Array, points: Array, triangles: Faces) -> float:
    """Largest distance from where three planes meet to the triangle of the points that are on them [m]."""
    D, P = directions[triangles], points[triangles]
    heights = np.einsum("nij,nij->ni", D, P)
    corner = np.linalg.solve(D, heights[:, :, None])[:, :, 0]
    return float(np.sqrt(_squared_to_triangle(corner, P)).max())


def _squared_to_triangle(x: Array, triangle: Array) -> Array:
    """Squared distance of points (n, 3) from triangles (n, 3, 3)."""
    least = np.full(len(x), np.inf)
    for k in range(3):
        a, edge = triangle[:, k], triangle[:, (k + 1) % 3] - triangle[:, k]
        length = np.einsum("ij,ij->i", edge, edge)
        share = np.clip(np.einsum("ij,ij->i", x - a, edge) / np.where(length > 0, length, 1), 0, 1)
        apart = x - a - share[:, None] * edge
        least = np.minimum(least, np.einsum("ij,ij->i", apart, apart))
    normal = np.cross(triangle[:, 1] - triangle[:, 0], triangle[:, 2] - triangle[:, 0])
    size = np.einsum("ij,ij->i", normal, normal)
    sides = [
        np.einsum("ij,ij->i", np.cross(triangle[:, (k + 1) % 3] - triangle[:, k], x - triangle[:, k]), normal)
        for k in range(3)
    ]
    inside = (size > 0) & (np.min(sides, axis=0) >= 0)
    height = np.einsum("ij,ij->i", x - triangle[:, 0], normal) ** 2 / np.where(size > 0, size, 1)
    return np.where(inside, height, least)
