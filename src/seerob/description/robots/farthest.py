"""How far an arm reaches, computed from its kinematics and limits."""

from __future__ import annotations

import numpy as np

from seerob.core.transforms import Array
from seerob.description.description import Description, JointKind, Link

TRIED, BEST, ROUNDS = 1024, 8, 30
"""Joint positions that are tried at random; of which so many are bettered, so often."""
FIRST_STEP, SHRINKS = 0.5, 0.8
"""First step of bettering [rad or m], and what it is multiplied by each time."""
UNLIMITED = np.pi
"""Taken for a turn without limits, either way [rad]."""


def farthest(robot: Description) -> float:
    """How far the origin of the tip gets from the first axis [m].

    It is reached, by joint positions within their limits; a maker's figure may be to another point.
    """
    chain = _chain(robot)
    joints = [joint for link in chain for joint in link.joints][1:]
    low = np.array([-UNLIMITED if joint.lower is None else joint.lower for joint in joints])
    high = np.array([UNLIMITED if joint.upper is None else joint.upper for joint in joints])
    tried = np.random.default_rng(0).uniform(low, high, (TRIED, len(joints)))
    found = _from_first_axis(chain, tried)
    steps = np.concatenate([np.eye(len(joints)), -np.eye(len(joints))]) * FIRST_STEP
    for k in range(ROUNDS):
        best = np.argsort(-found)[:BEST]
        moved = tried[best, None] + steps * SHRINKS**k
        moved = np.clip(moved, low, high).reshape(-1, len(joints))
        tried = np.concatenate([tried[best], moved])
        found = np.concatenate([found[best], _from_first_axis(chain, moved)])
    return float(found.max())


def _chain(robot: Description) -> list[Link]:
    """Links from that of the first joint to the tip."""
    named = {link.name: link for link in robot.links}
    chain: list[Link] = []
    name: str | None = robot.tip
    while name is not None:
        chain.insert(0, named[name])
        name = named[name].parent
    while not chain[0].joints:
        del chain[0]
    return chain


def _from_first_axis(chain: list[Link], q: Array) -> Array:
    """Distance of the tip from the first axis [m], shape (n,), at positions (n, joints) of the others."""
    where, number = np.zeros((len(q), 3)), q.shape[1]
    for link in reversed(chain):
        for joint in reversed(link.joints):
            if link is chain[0] and joint is link.joints[0]:
                away = where - joint.anchor
                return np.asarray(np.linalg.norm(away - np.outer(away @ joint.axis, joint.axis), axis=1))
            number -= 1
            if joint.kind is JointKind.PRISMATIC:
                where = where + np.outer(q[:, number], joint.axis)
            else:
                where = joint.anchor + _turned(where - joint.anchor, joint.axis, q[:, number])
        where = where @ link.parent_from_link[:3, :3].T + link.parent_from_link[:3, 3]
    raise ValueError("a chain begins with a joint")


def _turned(points: Array, axis: Array, by: Array) -> Array:
    """Points (n, 3) turned about a unit axis through the origin by angles (n,) [rad]."""
    cos, sin = np.cos(by)[:, None], np.sin(by)[:, None]
    return np.asarray(points * cos + np.cross(axis, points) * sin + np.outer(points @ axis, axis) * (1 - cos))
