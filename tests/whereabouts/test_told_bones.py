"""An elbow that nobody sees is no farther from the twin's than the lengths of the bones allow."""

from __future__ import annotations

import numpy as np
import pytest

from seerob.human.skeleton import BONES, PARENTS
from seerob.whereabouts.told_bones import told_between, told_bound, told_errors


def elbow(P, C, a, b, angle, rng):
    """A joint at distance a from P and b from C, somewhere on their circle."""
    d = np.linalg.norm(C - P)
    u = (C - P) / d
    across = np.linalg.svd(u[None])[2][1:]
    t = (d * d + a * a - b * b) / (2 * d)
    h = np.sqrt(max(a * a - t * t, 0.0))
    return P + t * u + h * (np.cos(angle) * across[0] + np.sin(angle) * across[1])


def unit(rng):
    way = rng.normal(size=3)
    return way / np.linalg.norm(way)


@pytest.mark.parametrize("e", [0.0, 0.01, 0.05])
def test_no_elbow_with_the_same_bones_is_farther_than_the_bound(e):
    rng = np.random.default_rng(3)
    closest = 0.0
    for _ in range(4000):
        a, b = rng.uniform(0.1, 0.4, 2)
        d = rng.uniform(abs(a - b) + 1e-3, a + b - 1e-6)
        P, C = np.zeros(3), d * unit(rng)
        J = elbow(P, C, a, b, rng.uniform(0, 7), rng)
        bound = told_bound(P, J, C, e)
        # The error shared between both ends.
        share = rng.uniform()
        P2, C2 = P + share * e * unit(rng), C + (1 - share) * e * unit(rng)
        if not abs(a - b) < np.linalg.norm(C2 - P2) < a + b:
            continue
        far = np.linalg.norm(elbow(P2, C2, a, b, rng.uniform(0, 7), rng) - J)
        assert far <= bound + 1e-12
        closest = max(closest, far / bound)
    assert closest > 0.9


def test_a_straight_arm_tells_its_elbow_and_a_bent_one_the_circle():
    P, C = np.zeros(3), np.array([0.6, 0, 0])
    assert told_bound(P, np.array([0.3, 0, 0]), C, 0.0) == pytest.approx(0, abs=1e-9)
    bent = np.array([0.2, 0.2, 0])
    assert told_bound(P, bent, np.array([0.4, 0, 0]), 0.0) == pytest.approx(0.4, rel=1e-12)


def test_how_the_upper_arm_is_turned_tells_the_elbow():
    seen = set(BONES) - {"left_forearm"}
    assert told_between(seen) == {"left_forearm": ("left_hand",)}
    joints = {bone: np.zeros(3) for bone in BONES}
    joints |= {"left_forearm": np.array([0.2, 0.2, 0]), "left_hand": np.array([0.4, 0, 0])}
    errors = dict.fromkeys(seen, (0.0, None))
    found = told_errors(seen, errors, joints)
    assert found == pytest.approx({"left_upper_arm": 0.4, "left_forearm": 0.4}, rel=1e-9)
    turned = told_errors(seen, {**errors, "left_upper_arm": (0.01, 0.1)}, joints)
    assert turned == pytest.approx({"left_forearm": 0.01 + 0.1 * np.hypot(0.2, 0.2)})
    assert not told_errors(BONES, errors, joints)
    assert PARENTS["left_hand"] == "left_forearm"
