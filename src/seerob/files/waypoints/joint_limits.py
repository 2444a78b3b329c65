r"""What joints may do, and how much a way has to be slowed so that none exceeds it.

Along a way :math:`q(s)` a joint has the acceleration :math:`q'' v^2 + q' a` and the jerk
:math:`q''' v^3 + 3 q'' v a + q' j`. With the largest speed, acceleration and jerk along the way in place of
:math:`v, a, j`, and every term by its size, both are bounds at each place, whatever the timing. Time that
is stretched by *k* divides them by :math:`k^2` and :math:`k^3`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from seerob.core.transforms import Array
from seerob.files.waypoints.pieces import Piece
from seerob.files.waypoints.timing import Limits

BETWEEN = 4
"""Places that are looked at from knot to knot of a curve."""
SHARE = 0.99
"""Share of the limits that is used at those places; the rest is for what lies between them."""


@dataclass(frozen=True, eq=False)
class JointLimits:
    """Largest speed, acceleration and jerk of each joint, (n,) each; infinite where nobody stated one."""

    speed: Array
    """[rad/s or m/s]"""
    acceleration: Array
    """[rad/s² or m/s²]"""
    jerk: Array
    """[rad/s³ or m/s³]"""

    @classmethod
    def of(
        cls,
        n: int,
        *,
        speed: Sequence[float | None] = (),
        acceleration: Sequence[float] = (),
        jerk: Sequence[float] = (),
    ) -> Self:
        """Limits of ``n`` joints: one for each, one for all, or none."""

        def each(values: Sequence[float | None]) -> Array:
            found = [np.inf if v is None else v for v in values] or [np.inf]
            return np.broadcast_to(np.array(found, float), (n,))

        return cls(each(speed), each(acceleration), each(jerk))

    def stretch(self, piece: Piece, limits: Limits) -> tuple[float, str, int]:
        """How much longer a way has to take, at least 1; which limit that is for, and of which joint.

        Args:
            piece: The way.
            limits: Along it.
        """
        if np.isinf(self.acceleration).all() and np.isinf(self.jerk).all():
            return 1.0, "", 0
        s = piece.places(BETWEEN)
        first, second, third = (np.abs(piece.derivative(s, order)) for order in (1, 2, 3))
        v, a, j = limits.speed, limits.acceleration, limits.jerk
        needs = {
            "acceleration": ((second * v**2 + first * a).max(axis=0) / self.acceleration / SHARE) ** (1 / 2),
            "jerk": ((third * v**3 + 3 * second * v * a + first * j).max(axis=0) / self.jerk / SHARE)
            ** (1 / 3),
        }
        what = max(needs, key=lambda name: float(needs[name].max()))
        joint = int(np.argmax(needs[what]))
        return max(1.0, float(needs[what][joint])), what, joint

    def rate(self, sizes: Sequence[Array]) -> float:
        """Largest rate of a curve whose parameter advances evenly.

        Args:
            sizes: Largest of each joint's first, second and third derivative by the parameter, (n,) each.
        """
        given = (self.speed, self.acceleration, self.jerk)
        return min(
            float(np.min(limit / np.maximum(size, 1e-12)) ** (1 / order))
            for order, (limit, size) in enumerate(zip(given, sizes, strict=True), start=1)
        )
