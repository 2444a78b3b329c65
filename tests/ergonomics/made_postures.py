"""Angles and postures for tests: ``from made_postures import …``."""

from __future__ import annotations

from dataclasses import fields

import numpy as np

from seerob.criteria.scoring.spans import Span, exactly
from seerob.description.humans import manikin
from seerob.description.humans.angles import SIDED, Angles, angles
from seerob.description.humans.posture import posture
from seerob.description.humans.skeleton import JOINTS, bone_poses, resolve

PERSON = manikin.build(name="op", stature=1.75, mass=75, sex="male")
NEUTRAL = {"elbow_flexion": 80.0, "wrist_across": -20.0, "arm_rise": -80.0}
"""Angles [deg] of a posture that scores least; all others are 0."""
UNSUPPORTED = exactly([0, 0])


def made_angles(**given):
    """Angles [deg] by name, the same on both sides unless two are given; neutral where nothing is said."""
    values = {}
    for field in fields(Angles):
        value = np.radians(np.asarray(given.pop(field.name, NEUTRAL.get(field.name, 0.0)), float))
        values[field.name] = np.broadcast_to(value, (2,)).copy() if field.name in SIDED else value
    assert not given, f"no such angles: {sorted(given)}"
    return Angles(**values)


def posed(name="anatomical", **joints):
    """Angles of a posture of the person, joints [deg] on top."""
    q = posture(PERSON, name, joints={f"{key}_deg": value for key, value in joints.items()})
    return angles(*bone_poses(PERSON, q))


def degrees(found, name):
    return np.degrees(getattr(found, name))


def random_q(count, seed=0, scale=0.8):
    """Joint values inside the limits, shape (count, 53), the pelvis tilted and turned as well."""
    rng = np.random.default_rng(seed)
    joints = PERSON.joints()
    low = np.array([-0.6 if j.lower is None else j.lower for j in joints])
    high = np.array([0.6 if j.upper is None else j.upper for j in joints])
    q = scale * rng.uniform(low, high, (count, len(joints)))
    q[:, resolve("pelvis_turn_left")[0][0]] = rng.uniform(-np.pi, np.pi, count)
    q[:, : JOINTS.index("pelvis_z") + 1] = 0.0
    return q


def known(components: dict[str, Span]) -> dict[str, list[int]]:
    """Scores that are known, of the right side."""
    for span in components.values():
        assert span.known
    return {key: int(np.atleast_1d(span.low)[0]) for key, span in components.items()}
