r"""Permissible speeds of contact at the ends of what masses, stiffness and contact area may be off.

With :math:`v = F/\sqrt{\mu k}`, :math:`v = F_P/\sqrt{\mu k}` and :math:`v = \sqrt{2E/\mu}`, each falls with
the reduced mass μ, which rises with the mass of the robot, and that with every mass
(`seerob.twin.accuracy.mass_tolerances`).
Each falls with k or does not know it: :math:`E = F^2/2k`, and :math:`F_P`, the force that keeps a pressure,
falls with k because a stiffer body part is less indented and the area smaller. :math:`F_P` rises with the
area; an area off by a share is the pressure limit off by that share. So is the least of the three monotone in
every input, and its ends are at their ends.

The norm's model of a robot's blow is a mass that a spring stops. Behind a door, a cart or a belt a drive goes
on: with no more than a force :math:`F_d`, a clamped body part, of stiffness k, is pressed at most by

.. math:: F = F_d + \sqrt{F_d^2 + k m_R v^2} \quad\Rightarrow\quad v \le \sqrt{F (F - 2 F_d) / (k m_R)}

which is that of the whole force from the first touch on and of nothing that damps. One that is free gives
way, and feels less of it: the same counts for it, with μ for :math:`m_R`. At least it is the blow alone, and
where somebody is clamped, :math:`F_d` in the end. Between the two ends it is open. Derived here (D), from the
formulae of `seerob.criteria.contact.collision`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from seerob.core.domains import at_least, number
from seerob.core.snapshot import Verdict
from seerob.core.tolerances import Shifts, Spread, Tolerance, spread
from seerob.core.transforms import Array
from seerob.core.verdict import ROUNDING
from seerob.criteria.contact.impact_mass import masses_along_motion
from seerob.criteria.contact.limits import RegionArrays, Speeds
from seerob.kernels import contact_speeds as kernel
from seerob.model.model import Mechanism, Model
from seerob.twin.accuracy.mass_tolerances import MassTolerances
from seerob.twin.state import State

NOT_GIVEN = "how hard its drive keeps pushing is not given: drive_force"
PressureForces = Callable[[RegionArrays], Array]
"""Force of each surface that keeps the pressure of each region [N], shape (b, 2, r)."""


def robot_masses(which: str, simplified: float, projected: Array) -> Array:
    """Mass of the robot at each surface [kg], shape (b,).

    Args:
        which: ``larger``, ``simplified`` or ``projected``.
        simplified: M/2 + m_L [kg].
        projected: Effective mass along the motion [kg]; NaN where it stands still, and hits nobody.
    """
    if which == "simplified":
        return np.full(len(projected), simplified)
    if which == "larger":
        return np.asarray(np.fmax(simplified, projected))
    return np.where(np.isnan(projected), simplified, projected)


class ContactEnds:
    """Permissible speeds of every surface against every region at the ends of the tolerances.

    Args:
        model: The compiled workstation.
        robot: The robot.
        arrays: The limits.
        forces: How to ask what keeps the pressure, for changed limits.
        stiffness: How far k may be off, as a share.
        area: Likewise the contact area.
    """

    def __init__(
        self,
        model: Model,
        robot: Mechanism,
        arrays: RegionArrays,
        forces: PressureForces,
        *,
        stiffness: float,
        area: float,
    ) -> None:
        self.masses = MassTolerances(model, robot)
        self._shares = {"stiffness_tolerance": stiffness, "area_tolerance": area}
        own = [Tolerance(key, 100 * share, "%") for key, share in self._shares.items() if share]
        self.tolerances = (*self.masses.tolerances, *own)
        self._robot, self._arrays, self._forces = robot, arrays, forces
        self._limits: dict[tuple[int, int], tuple[RegionArrays, Array]] = {}

    def _changed(self, stiffness: int, area: int) -> tuple[RegionArrays, Array]:
        """Limits and forces with k and A at an end; 1 where speeds are largest."""
        if (stiffness, area) not in self._limits:
            arrays = replace(
                self._arrays,
                stiffness=self._arrays.stiffness * (1 - stiffness * self._shares["stiffness_tolerance"]),
            )
            wider = replace(arrays, pressure=arrays.pressure * (1 + area * self._shares["area_tolerance"]))
            self._limits[stiffness, area] = arrays, self._forces(wider)
        return self._limits[stiffness, area]

    def at(
        self,
        state: State,
        bodies: tuple[int, ...],
        which: str,
        simplified: float,
        clamped: NDArray[np.bool_],
        still: float,
        given: Array | None = None,
    ) -> Spread:
        """Ends of the permissible speeds [m/s], shape (b, r).

        Args:
            state: The twin.
            bodies: The surfaces.
            which: Which mass of the robot counts.
            simplified: M/2 + m_L as given [kg].
            clamped: Whether the body part cannot recoil, shape (b, r).
            still: Speed below which a motion has no direction [m/s].
            given: Mass behind each surface [kg], shape (b,), instead of one that tolerances of masses change.
        """
        matrices, n = self.masses.matrices(state), len(self.masses)
        own = [tolerance.name for tolerance in self.tolerances[n:]]

        def speeds(shifts: Shifts) -> Array:
            # A lighter robot may be faster.
            lighter = tuple(-shift for shift in shifts[:n])
            m_R = given
            if m_R is None:
                M = matrices.at(lighter)
                projected = masses_along_motion(state, (self._robot,), bodies, standstill=still, M=M)
                m_R = robot_masses(which, self.masses.simplified(simplified, lighter), projected)
            sides = dict(zip(own, shifts[n:], strict=True))
            arrays, forces = self._changed(
                sides.get("stiffness_tolerance", 0), sides.get("area_tolerance", 0)
            )
            return arrays.speeds(m_R, forces, clamped).permissible

        return spread(speeds, len(self.tolerances))


def ranks(v: Array, speeds: Speeds, ends: Spread | None) -> NDArray[np.int64]:
    """2 exceeded, 1 open, 0 within, of relative speeds [m/s] (b, r)."""
    low, high = (speeds.permissible,) * 2 if ends is None else (ends.low, ends.high)
    found = np.empty(v.shape, np.int64)
    kernel.ranks(v, speeds.pressure, low, high, ROUNDING, found)
    return found


def area_verdict(verdict: Verdict, region: Verdict | None, ends: Spread | None) -> Verdict:
    """Verdict of a specific area as given, left open by tolerances where its region does not settle it."""
    if ends is None or verdict is Verdict.UNDECIDED or verdict is region:
        return verdict
    return Verdict.UNDECIDED


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
    v, root = at_least("v", v, unit="m/s"), np.sqrt(mu * k)
    return np.asarray(np.sqrt(np.maximum(v * (v - 2 * F / root), 0.0)))


def pushed(
    speeds: Speeds,
    ends: Spread | None,
    k: Array,
    force: Array,
    clamped: NDArray[np.bool_],
    drive: float | None,
    *,
    where: NDArray[np.bool_] | None = None,
) -> Spread:
    """Ends of the permissible speeds with a drive that keeps pushing.

    Args:
        speeds: Of the blow alone, shape (b, r).
        ends: Theirs, where an input may be off.
        k: Least stiffness of each region [N/m], shape (r,).
        force: Quasi-static limit of each region [N], shape (r,).
        clamped: Whether the body part cannot recoil, shape (b, r).
        drive: Largest force of the drive [N]; None: nobody knows, and no speed is known to be permitted.
        where: It pushes, shape (b, r); everywhere when not given.
    """
    low, high = alone = (speeds.permissible,) * 2 if ends is None else (ends.low, ends.high)
    if drive is None:
        low = np.zeros_like(low)
    else:
        low = permissible_while_pushed(low, speeds.mu, k, drive)
        high = np.where(clamped & (drive > force), 0.0, high)
    widths = np.zeros((0, *low.shape)) if ends is None else lambda: ends.widths
    low = np.minimum(low, high)
    if where is not None:
        low, high = (np.where(where, end, other) for end, other in zip((low, high), alone, strict=True))
    return Spread(low, high, widths)
