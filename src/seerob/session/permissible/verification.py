"""The criteria asked of the rescaled motion itself, between the stations of its map.

Between two stations the lesser of their speeds counts, which is a convention. So the plan is looked at again:
at a fixed period, far shorter than the time from station to station, the twin is put where the plan has it,
with the speed that the plan has there, and every criterion that counts is asked which share of that speed it
permits. Where that is less than 1 the map gets a station, and the timing is made anew. What is stated in the
end is what was found at those instants: it is a dense sampling with a known period, not a bound.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from seerob.core.errors import InputError
from seerob.core.transforms import Array
from seerob.session.permissible.rescaled import Rescaled
from seerob.session.permissible.survey import Survey

MOST = 400_000
"""Instants that are looked at."""
RESTS = 1e-3
"""Share of the permissible path speed below which the robot is taken to rest."""


@dataclass(frozen=True, eq=False)
class Verified:
    """What was found at a fixed period."""

    period: float
    """[s]"""
    asked: int
    """Instants at which the robot moves."""
    use: float
    """Largest share of a permitted speed that is used; 1 is all of it, inf where none is permitted."""
    at: float
    """When that is [s]."""
    what: str
    """What governs then."""
    undecided: int
    """Instants at which it cannot be told."""
    over: tuple[Array, ...]
    """Path coordinates of each piece where more than 1 is used."""

    @property
    def kept(self) -> bool:
        """Whether the plan keeps to the criteria at every instant looked at."""
        return self.use <= 1 + 1e-9 and not self.undecided


def verify(
    motion: Rescaled,
    survey: Survey,
    *,
    period: float,
    progress: Callable[[float], None] = lambda _: None,
) -> Verified:
    """Look at every instant.

    Args:
        motion: The plan.
        survey: The criteria.
        period: Between two looks [s].
        progress: Told the share done; what it raises stops the work.

    Raises:
        InputError: A period that gives too many looks.
    """
    if not period > 0 or motion.duration / period > MOST:
        what = f"{period} s of a motion of {motion.duration:.3f} s"
        raise InputError.at("permissible speed", "verify", what, f"give one that is looked at {MOST} times")
    asked = undecided = 0
    use, at, what_then = 0.0, 0.0, ""
    over: list[Array] = []
    for piece, start, stations in zip(motion.pieces, motion.starts, motion.of.stations, strict=True):
        t = np.arange(0.0, piece.duration, period)
        moment = piece.profile.at(t)
        q, qd, _, _ = piece.at(t)
        moving = moment.speed > RESTS * stations.between(moment.s)
        given = piece.piece.when(moment.s)
        wrong = []
        for k in np.flatnonzero(moving).tolist():
            own = float(start + t[k])
            # The others do not wait: they are where they are at the plan's own time.
            ceiling = survey.share(q[k], qd[k], given=float(given[k]), others_at=own)
            asked += 1
            progress(own / motion.duration)
            if ceiling is None:
                continue
            if ceiling.undecided:
                undecided += 1
                wrong.append(moment.s[k])
                continue
            used = np.inf if ceiling.share == 0 else 1 / ceiling.share
            if used > 1:
                wrong.append(moment.s[k])
            if used > use:
                use, at, what_then = used, own, ceiling.words()
        over.append(np.array(wrong))
    return Verified(period, asked, float(use), at, what_then, undecided, tuple(over))
