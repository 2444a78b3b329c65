"""Which bounds between samples a workstation wants: the distances it asks about, and its robots' speeds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import partial

import numpy as np

from seerob.core.errors import Undecided
from seerob.core.samples import JointSample
from seerob.criteria.safety.minimum_distance import MinimumDistance
from seerob.criteria.safety.separation import Separation
from seerob.model.model import Model
from seerob.session.permissible.between_samples import BetweenSamples, Bound
from seerob.session.permissible.evaluation import PermissibleSpeed, Sources
from seerob.session.permissible.given_motion import GivenMotion

MOST = 20
"""Distances that are bounded, and speeds."""
PERIOD = 0.008
"""At which a rescaled motion is sampled for its bounds [s]."""


def motions_of(sources: Sources, found: PermissibleSpeed | None = None) -> dict[str, GivenMotion] | None:
    """The motions of all who move; None where a source gives anything but joint positions.

    Args:
        sources: Opened.
        found: Whose rescaled motion, if any, replaces the given one.
    """
    motions: dict[str, GivenMotion] = {}
    for source, opened in sources:
        if not source.target():
            continue
        if found is not None and found.rescaled is not None and source.target() == found.map.robot:
            continue
        samples = list(opened.samples)
        joints = [s for s in samples if isinstance(s, JointSample)]
        if len(joints) != len(samples) or len(joints) < 2 or source.target() in motions:
            return None
        motions[source.target()] = GivenMotion.of(joints)
    if found is not None and found.rescaled is not None:
        planned = found.rescaled.trajectory(PERIOD)
        assert planned.qd is not None
        good = np.ones(len(planned.t), bool)
        motions[found.map.robot] = GivenMotion(found.map.robot, planned.t, planned.q, planned.qd, good)
    return motions


def wanted_bounds(
    model: Model, motions: Mapping[str, GivenMotion] | None, *, tolerance: float = 1e-3, most: int
) -> list[Bound]:
    """The bounds, none where motions are not known between samples."""
    if not motions:
        return []
    between = BetweenSamples(model, motions)
    robots = [name for name, m in model.mechanisms.items() if m.role == "robot" and name in motions]
    asked = [partial(between.distance, a, b, tolerance=tolerance) for a, b in _pairs(model)[:most]]
    asked += [partial(between.speed, name, tolerance=tolerance) for name in robots[:most]]
    bounds = []
    for ask in asked:
        with suppress(Undecided):
            bounds.append(ask())
    return bounds


def _pairs(model: Model) -> Sequence[tuple[str, str]]:
    """Sets whose distance some criterion asks about."""
    kinds = (Separation, MinimumDistance)
    found = [tuple(c.between) for c in model.workstation.safety if isinstance(c, kinds)]
    return [(a, b) for a, b in dict.fromkeys(found)]
