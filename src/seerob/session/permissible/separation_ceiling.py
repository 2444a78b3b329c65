r"""What speed and separation monitoring permits at a state, as a share of the robot's speed there.

With ``mode = "fixed"`` the largest :math:`S_p` of the whole run counts at every instant. It is kept when at
every place no part has an :math:`S_p` above the least distance that it has anywhere on the way,

.. math:: S_{p,i}(t) \le \min_\tau d_i(\tau)\ \text{for all } t
    \quad\Rightarrow\quad \max_{\tau \le t} S_{p,i}(\tau) \le d_i(t),

so the inverse is that of the dynamic mode with the least distance of each part instead of the present one.
That is enough, and more than is needed only before the largest :math:`S_p` has occurred.
"""

from __future__ import annotations

import math
from contextlib import suppress

import numpy as np

from seerob.core.errors import Undecided
from seerob.core.transforms import Array
from seerob.criteria.safety.separation import Separation
from seerob.model.model import Model
from seerob.session.permissible.ceiling import Answer, Ceiling, Look
from seerob.twin.accuracy.distance_ends import DistanceEnds
from seerob.twin.state import State


def separation(criterion: Separation, model: Model, robot: str) -> tuple[Answer, Look | None]:
    """How to ask for the share, and for the fixed mode how to show the places on the way before that.

    Args:
        criterion: Of the workstation; one of its sides is the robot.
        model: The compiled workstation.
        robot: Whose speed is asked about.
    """
    unknown = criterion.unknown(model)
    inverse = criterion.at_worst(model).inverse(model)
    human = next(name for name in criterion.between if name != robot)
    gap = model.gap(model.select(human), model.robot(robot).moving)
    names = [model.bodies[i].name for i in gap.b]
    ends = DistanceEnds(model, gap)
    least = np.full(len(gap.b), np.inf)
    fixed = criterion.mode == "fixed"

    def distances(state: State) -> Array:
        # As the criterion has them: the least that the errors of the twin's bones leave possible.
        return ends.of_bodies(state, state.closest_per_body(gap).distance)[0]

    def look(state: State) -> None:
        # Where somebody's place is not known the map has no number either.
        with suppress(Undecided):
            np.minimum(least, distances(state), out=least)

    def ask(state: State) -> tuple[Ceiling, ...]:
        if unknown:
            raise Undecided(unknown)
        distance = distances(state)
        if fixed:
            distance = np.minimum(distance, least)
        S_p, (speed, share) = inverse(state, distance)
        k = int((distance - S_p).argmin())
        part = f"{names[k]}: {distance[k]:.3f} m from {human}"
        part += " at the nearest place of the way" if fixed else ""
        if share.value is not None:
            at = math.nan if speed.value is None else speed.value
            reason = f"too near at any speed ({part})" if share.value == 0 else ""
            return (
                Ceiling(criterion.name, share.value, at, surface=part, governs="separation", reason=reason),
            )
        # Without a share it stands still, and then the distance alone says whether it may move.
        near = share.reason.startswith("stands still") and bool((distance < S_p).any())
        reason = f"too near at standstill ({part})" if near else ""
        return (Ceiling(criterion.name, 0.0 if near else math.inf, governs="separation", reason=reason),)

    return ask, look if fixed else None
