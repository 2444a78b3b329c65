"""An elbow that nobody sees is no farther from the twin's than the lengths of the bones allow."""

from __future__ import annotations

import numpy as np
import pytest

from seerob.description.humans.skeleton import BONES, PARENTS
from seerob.twin.accuracy.tracking_error import inferred_between, inferred_bound, inferred_errors


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
        bound = inferred_bound(P, J, C, e)
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
    assert inferred_bound(P, np.array([0.3, 0, 0]), C, 0.0) == pytest.approx(0, abs=1e-9)
    bent = np.array([0.2, 0.2, 0])
    assert inferred_bound(P, bent, np.array([0.4, 0, 0]), 0.0) == pytest.approx(0.4, rel=1e-12)


def test_how_the_upper_arm_is_turned_tells_the_elbow():
    seen = set(BONES) - {"left_forearm"}
    assert inferred_between(seen) == {"left_forearm": ("left_hand",)}
    joints = {bone: np.zeros(3) for bone in BONES}
    joints |= {"left_forearm": np.array([0.2, 0.2, 0]), "left_hand": np.array([0.4, 0, 0])}
    errors = dict.fromkeys(seen, (0.0, None))
    found = inferred_errors(seen, errors, joints)
    assert found == pytest.approx({"left_upper_arm": 0.4, "left_forearm": 0.4}, rel=1e-9)
    turned = inferred_errors(seen, {**errors, "left_upper_arm": (0.01, 0.1)}, joints)
    assert turned == pytest.approx({"left_forearm": 0.01 + 0.1 * np.hypot(0.2, 0.2)})
    assert not inferred_errors(BONES, errors, joints)
    assert PARENTS["left_hand"] == "left_forearm"


def sampled_bound(a, b, d, e):
    """The bound as the module's text has it, its maxima over many lengths."""
    lengths = np.linspace(d - e, d + e, 20001)
    t = 0.5 * lengths - abs(a * a - b * b) / (2 * lengths)  # the steeper of both orders of the bones
    inside = np.clip([d, *lengths, np.clip(np.sqrt(abs(a * a - b * b)), d - e, d + e)], abs(a - b), a + b)
    along = (inside**2 + a * a - b * b) / (2 * inside)
    heights = np.sqrt(np.maximum(a * a - along**2, 0.0))
    return heights[0] + heights.max() + e * (1 + 2 * a / d + np.abs(np.gradient(t, lengths)).max())


def test_the_bound_is_the_formula():
    rng = np.random.default_rng(8)
    capped = free = 0
    for _ in range(300):
        a, b = rng.uniform(0.1, 0.4, 2)
        d = rng.uniform(abs(a - b) + 1e-3, a + b - 1e-6)
        e = min(rng.choice([1e-4, 0.005, 0.05]), 0.9 * d)
        P = rng.normal(size=3)
        C = P + d * unit(rng)
        bound, cap = inferred_bound(P, elbow(P, C, a, b, 1.0, rng), C, e), 2 * min(a, b) + e
        formula = sampled_bound(a, b, d, e)
        assert bound == pytest.approx(min(cap, formula), rel=2e-3 * e / d + 1e-7)
        capped, free = capped + (formula > cap), free + (formula < cap)
    assert min(capped, free) > 30


@pytest.mark.parametrize("d", [0.01, 0.01 + 1e-9])
def test_ends_that_may_meet_tell_nothing_but_the_lengths(d):
    J = np.array([d / 2, 0.2, 0])
    assert inferred_bound(np.zeros(3), J, np.array([d, 0, 0]), 0.01) == pytest.approx(
        2 * np.hypot(d / 2, 0.2) + 0.01, rel=1e-12
    )


def forked():
    """A bone with two children, of which no device sees it, and where each joint is."""
    bone = next(b for b in BONES if PARENTS[b] in BONES and list(PARENTS.values()).count(b) > 1)
    children = [child for child, above in PARENTS.items() if above == bone]
    rng = np.random.default_rng(4)
    joints = {name: rng.normal(size=3) * 0.2 for name in BONES}
    return bone, PARENTS[bone], children, joints


def test_what_the_ends_are_off_by_adds_and_the_best_child_tells():
    bone, parent, children, joints = forked()
    seen = {parent, *children}
    off = {parent: (0.02, None)} | {child: (0.005 * k or None, None) for k, child in enumerate(children)}
    P, J = joints[parent], joints[bone]
    bounds = [inferred_bound(P, J, joints[c], 0.02 + (off[c][0] or 0.0)) for c in children]
    assert len(set(bounds)) == len(bounds)
    found = inferred_errors(seen, off, joints)
    assert found == pytest.approx({parent: min(bounds), bone: min(bounds)}, rel=1e-12)
    nothing = inferred_errors(seen, {**off, parent: (None, None)}, joints)
    bounds = [inferred_bound(P, J, joints[c], off[c][0] or 0.0) for c in children]
    assert nothing[bone] == pytest.approx(min(bounds), rel=1e-12)


def test_a_bone_is_off_by_no_less_than_its_worst_child():
    bone, parent, children, joints = forked()
    off = {parent: (None, 0.1)} | {child: (2.0 + k, None) for k, child in enumerate(children)}
    assert inferred_errors({parent, *children}, off, joints) == {bone: 2.0 + len(children) - 1}
    turned = inferred_errors({parent, *children}, {**off, **dict.fromkeys(children, (None, None))}, joints)
    assert turned == {bone: pytest.approx(0.1 * np.linalg.norm(joints[bone] - joints[parent]), rel=1e-12)}
