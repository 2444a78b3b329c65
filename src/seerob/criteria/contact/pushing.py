r"""What a drive that keeps pushing takes from the permissible speed of contact of a machine.

The norm's model of a robot's blow is a mass that a spring stops. Behind a door, a cart or a belt a drive goes
on: with no more than a force :math:`F_d`, a clamped body part, of stiffness k, is pressed at most by

.. math:: F = F_d + \sqrt{F_d^2 + k m_R v^2} \quad\Rightarrow\quad v \le \sqrt{F (F - 2 F_d) / (k m_R)}

which is that of the whole force from the first touch on and of nothing that damps. One that is free gives
way, and feels less of it: the same counts for it, with μ for :math:`m_R`. At least it is the blow alone, and
where somebody is clamped, :math:`F_d` in the end. Between the two ends it is open. Derived here (D), from the
formulae of `seerob.criteria.contact.collision`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from seerob.core.domains import number
from seerob.core.tolerances import Spread
from seerob.core.transforms import Array
from seerob.criteria.contact.limits import Speeds

NOT_GIVEN = "how hard its drive keeps pushing is not given: drive_force"


def permissible_while_pushed(v: Array, mu: Array, k: Array, F: float) -> Array:
    """Speed at which a force is reached with a drive behind it [m/s].

    Args:
        v: At which the blow alone reaches it [m/s].
        mu: Reduced mass [kg].
        k: Stiffness of the body region [N/m].
        F: Of the drive [N].

    Returns:
        0 where the drive alone may reach it.
    """
    number("F", F, 0.0, unit="N")
    root = np.sqrt(mu * k)
    return np.asarray(np.sqrt(np.maximum(v * (v - 2 * F / root), 0.0)))


def pushed(
    speeds: Speeds,
    ends: Spread | None,
    k: Array,
    force: Array,
    clamped: NDArray[np.bool_],
    drive: float | None,
) -> Spread:
    """Ends of the permissible speeds with a drive that keeps pushing.

    Args:
        speeds: Of the blow alone, shape (b, r).
        ends: Theirs, where an input may be off.
        k: Least stiffness of each region [N/m], shape (r,).
        force: Quasi-static limit of each region [N], shape (r,).
        clamped: Whether the body part cannot recoil, shape (b, r).
        drive: Largest force of the drive [N]; None: nobody knows, and no speed is known to be permitted.
    """
    low, high = (speeds.permissible,) * 2 if ends is None else (ends.low, ends.high)
    if drive is None:
        low = np.zeros_like(low)
    else:
        low = permissible_while_pushed(low, speeds.mu, k, drive)
        high = np.where(clamped & (drive > force), 0.0, high)
    widths = np.zeros((0, *low.shape)) if ends is None else lambda: ends.widths
    return Spread(np.minimum(low, high), high, widths)
