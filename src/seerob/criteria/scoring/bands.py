"""Which bands the angles of a posture fall into: all that the scores of a method can depend on.

A score changes only where an angle, or an end of what its accuracy leaves, passes an edge of the method. So
what was scored once holds for every posture in the same bands, and is looked up instead of scored again.
Whoever is at an edge, within rounding, or seen under a short lever is scored as ever.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from functools import partial
from itertools import chain
from operator import add, itemgetter, sub

from seerob.criteria.scoring.measured import SHORT, Accuracy, error_of
from seerob.criteria.scoring.score_rows import Edges
from seerob.criteria.scoring.spans import ROUNDING, Thresholds
from seerob.description.humans.angles import SIDED, Angles
from seerob.description.humans.skeleton import SIDES

NEAR = 1e-9
"""Nearer to where a score changes [rad], the last bit may decide: more than any rounding of what is added."""
_UPRIGHT = 1.5
"""A plane in which something is seen is this far away at most [rad]: its lever is `SHORT` nowhere."""
_RAISED = 2.99
"""An arm is above the hanging one by so much at most [rad], where its lever is `SHORT` nowhere."""
assert math.cos(_UPRIGHT) > SHORT
assert 1.0 + math.cos(_RAISED) > SHORT
_LIMITS = {
    "trunk_side_bend": _UPRIGHT,
    "neck_side_bend": _UPRIGHT,
    "wrist_deviation": _UPRIGHT,
    "shoulder_abduction": _UPRIGHT,
    "shoulder_elevation": _RAISED,
}
"""Name of an angle → beyond which size a lever is short [rad]."""
_odd = (1).__and__


def _cuts(edges: Sequence[float], *others: float, most: float = math.inf) -> list[float]:
    """Ends of what is near to where a score may change [rad], increasing, none inside another.

    An edge is looked at from either side, of an angle or of its size, and within `ROUNDING`. Between two
    cuts are even numbers of them, and of an angle that is not measured; odd ones where it is to be scored
    itself, near to a change or beyond ``most``.
    """
    at = set(others)
    for edge in map(abs, edges):
        at |= {edge - ROUNDING, edge + ROUNDING, ROUNDING - edge, -ROUNDING - edge}
    bounded = most < math.inf
    if bounded:
        at = {min(max(each, -most), most) for each in at} | {-most, most}
    found: list[float] = []
    for each in sorted(at):
        if found and each - NEAR <= found[-1]:
            found[-1] = each + NEAR
        else:
            found += [each - NEAR, each + NEAR]
    if bounded:
        found[0], found[-1] = -math.inf, math.inf
    # A NaN is sorted behind all others.
    return [*found, math.inf, math.inf]


class Bands:
    """Looks up the bands of postures, one at a time, whose arms are judged by their projection.

    Args:
        edges: Where scores of each angle change [rad].
        thresholds: Of those that no angle alone decides.
        accuracy: Of each angle [rad]; None when nobody knows it.
    """

    def __init__(self, edges: Edges, thresholds: Thresholds, accuracy: Accuracy | None) -> None:
        error = partial(error_of, 0.0 if accuracy is None else accuracy)
        names = sorted({*edges, *_LIMITS} - {"shoulder_flexion"}, key=lambda name: name in SIDED)
        central = [name for name in names if name not in SIDED]
        sided = names[len(central) :]
        self._central, self._sided = itemgetter(*central), itemgetter(*sided)
        every = [*central, *(name for name in sided for _ in SIDES)]
        self._cuts = [_cuts(edges.get(name, ()), most=_LIMITS.get(name, math.inf)) for name in every] + [
            _cuts((thresholds.knee_difference,))
        ]
        self._off = [*map(error, every), 2 * error("knee_flexion")]
        if accuracy is not None:
            ends = [_cuts(edges.get(name, ())) for name in every]
            self._cuts += 2 * [*ends, self._cuts[-1]]
        self._exact = accuracy is None
        self._arms = _cuts(edges["shoulder_flexion"], -math.pi / 2, 3 * math.pi / 2)
        self._of_arms = error("shoulder_flexion", "shoulder_elevation")

    def of(self, angles: Angles) -> tuple[int, ...] | None:
        """Bands of one posture; None where it is to be scored itself."""
        listed = angles.listed
        right, left = listed["knee_flexion"]
        every = [*self._central(listed), *chain.from_iterable(self._sided(listed)), right - left]
        if self._exact:
            found = list(map(bisect_right, self._cuts, every))
        else:
            off = self._off
            ends = chain(every, map(sub, every, off), map(add, every, off))
            found = list(map(bisect_right, self._cuts, ends))
        if any(map(_odd, found)):
            return None
        for flexion, side in zip(listed["shoulder_flexion"], listed["shoulder_abduction"], strict=True):
            arm = self._of_arm(flexion, side)
            if arm is None:
                return None
            found += arm
        return tuple(found)

    def _of_arm(self, flexion: float, side: float) -> list[int] | None:
        """Bands of an upper arm, whose direction widens what may be [rad]; None likewise."""
        if flexion != flexion:  # noqa: PLR0124 - a NaN
            return [-1]
        if side != side:  # noqa: PLR0124 - likewise
            return None
        lever, cuts = math.cos(side), self._arms
        rounding = math.asin(math.sin(ROUNDING) / lever)
        ends = [flexion, flexion - rounding, flexion + rounding]
        if self._of_arms:
            sine = math.sin(min(self._of_arms, math.pi / 2)) / lever
            if 0.9999 < sine < 1.0001:
                return None
            off = math.pi if sine > 1 else math.asin(sine)
            both = off + rounding
            ends += [flexion - off, flexion + off, flexion - both, flexion + both]
        found = [bisect_right(cuts, end) for end in ends]
        return None if any(map(_odd, found)) else found
