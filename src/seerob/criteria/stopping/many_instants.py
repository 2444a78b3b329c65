"""Distances of the moving parts of a robot against S_p, of many instants."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from seerob.core.transforms import Array
from seerob.criteria.criterion import EvaluateMany
from seerob.criteria.stopping.models import SHARES, Stop
from seerob.criteria.stopping.onset import accelerated
from seerob.criteria.stopping.terms import Course, braking
from seerob.model.model import Gap
from seerob.recording.answers import Answers
from seerob.twin.states import States


def separations(
    stop: Stop, gap: Gap, S_p: Callable[[Course, float, Array], Array], K: float, *, incomplete: bool
) -> EvaluateMany | None:
    """What the part that governs comes to; None where the stopping time is not given, or has a tolerance.

    Args:
        stop: How the robot stops.
        gap: From whom to its moving parts.
        S_p: Of a course, K and the speed that a person is seen to have [m/s] (N,), shape (N, b) [m].
        K: C + Z_d + Z_r [m].
        incomplete: Whether S_p may be larger than what is computed.
    """
    if stop.model not in SHARES or stop.stopping is None or stop.tolerance is not None:
        return None
    if stop.acceleration is None:
        # What the motion does ahead is asked instant by instant.
        return None
    a = stop.acceleration
    T_s, share = stop.stopping, SHARES[stop.model]

    def evaluate(states: States) -> Answers:
        distance = states.closest_per_body(gap).distance
        v_r, _, _ = states.fastest_points(gap.b)
        seen = states.fastest_points(gap.a)[0].max(axis=1, initial=0.0)
        least = S_p(braking(accelerated(v_r, stop.reaction, a, np.zeros(0)), T_s, share), K, seen)
        k = (distance - least).argmin(axis=1)[:, None]
        value, limit = (np.take_along_axis(found, k, axis=1)[:, 0] for found in (distance, least))
        found = Answers.against(value, limit, at_most=False)
        return found.open() if incomplete else found

    return evaluate
