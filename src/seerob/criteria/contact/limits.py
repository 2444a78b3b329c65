r"""Permissible speeds of many surfaces against many body regions at once, and at the ends of tolerances.

From a table of limits and the contact areas, the least of the speeds at which force, pressure and energy
reach their limits (`seerob.criteria.contact.collision`): transient limits and :math:`m_H` when the body part
is free, quasi-static ones and :math:`m_H \to \infty` when it is clamped.

The contact area grows with the force. The force that a pressure allows is the one up to which the
pressure is never above it, :math:`F = p A(F)`, not the area at the largest force: at every force below
that the area is smaller.

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

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from seerob.core.domains import at_least, number
from seerob.core.snapshot import Input, Origin, Verdict
from seerob.core.tolerances import Shifts, Spread, Tolerance, spread
from seerob.core.transforms import Array
from seerob.core.verdict import ROUNDING
from seerob.criteria.contact.impact_mass import masses_along_motion
from seerob.criteria.contact.shape import ContactShape, force_at_pressure
from seerob.description.norms.body_limits import BodyLimits, BodyRegion
from seerob.kernels import contact_speeds as kernel
from seerob.kernels.contact_speeds import permissible_speeds
from seerob.model.model import Mechanism, Model
from seerob.twin.accuracy.mass_tolerances import MassTolerances
from seerob.twin.state import State


@dataclass(frozen=True, eq=False)
class RegionArrays:
    """The regions of a table where contact is permitted, as arrays of shape (r,), SI, quasi-static."""

    regions: tuple[BodyRegion, ...]
    force: Array
    pressure: Array
    """Pressure limit of every specific area of every region in turn, shape (a,)."""
    owner: NDArray[np.int64]
    """Row of the region of each of them, shape (a,)."""
    multiplier: Array
    stiffness: Array
    mass: Array
    energy: Array
    """Printed transient energy; NaN when the table has none."""

    @classmethod
    def of(cls, limits: BodyLimits, *, multiplier: float | None = None) -> RegionArrays:
        """Arrays of a table.

        Args:
            limits: The table.
            multiplier: Transient over quasi-static, instead of the table's; never raises it.
        """
        regions = tuple(r for r in limits.regions.values() if r.permitted)
        most = math.inf if multiplier is None else multiplier
        return cls(
            regions,
            np.array([r.force.value for r in regions]),
            np.array([area.pressure.value for r in regions for area in r.areas]),
            np.array([k for k, r in enumerate(regions) for _ in r.areas], np.int64),
            np.array([min(r.multiplier.value, most) if r.multiplier else 1.0 for r in regions]),
            np.array([r.stiffness.value for r in regions]),
            np.array([r.mass.value for r in regions]),
            np.array([math.nan if r.energy is None else r.energy.value for r in regions]),
        )

    def pressures(self) -> Array:
        """Limits of every specific area, free and clamped [Pa], shape (2, a)."""
        return self.pressure * np.stack([self.multiplier[self.owner], np.ones_like(self.pressure)])

    def pressure_force(self, shape: ContactShape, cap: float) -> Array:
        """Largest force of a surface that keeps the pressure on each specific area [N], shape (2, a).

        Free and clamped. NaN where the mesh does not tell, 0 where no force does.

        Args:
            shape: The surface.
            cap: Area above which a contact is not credited [m²].
        """
        p = self.pressures()
        if shape.unknown:
            return np.full(p.shape, np.nan)
        radii = shape.radii[np.isfinite(shape.radii[:, 0])]
        if not len(radii):
            return p * cap
        # What both a smaller and a flatter radius than another patch has is never the least.
        radii = np.unique(np.sort(radii, axis=1), axis=0)
        keep = np.concatenate([[True], radii[1:, 1] < np.minimum.accumulate(radii[:-1, 1])])
        k = self.stiffness[self.owner]
        return np.asarray(force_at_pressure(radii[keep][:, None, None, :], p, k, cap).min(axis=0))

    def by_region(self, forces: Array) -> Array:
        """The least over the specific areas of each region, (..., a) to (..., r); NaN stays."""
        found = np.full((*forces.shape[:-1], len(self.regions)), np.inf)
        for column, owner in enumerate(self.owner):
            found[..., owner] = np.minimum(found[..., owner], forces[..., column])
        return found

    def speeds(self, m_R: Array, forces: Array, clamped: NDArray[np.bool_]) -> Speeds:
        """Permissible relative speeds.

        Args:
            m_R: Effective mass of the robot at each surface [kg], shape (b,).
            forces: That the pressure limits allow each surface, free and clamped, NaN when unknown [N],
                shape (b, 2, r).
            clamped: Whether the body part cannot recoil, shape (b, r).
        """
        return Speeds(
            *permissible_speeds(
                np.ascontiguousarray(m_R, float), forces, np.ascontiguousarray(clamped), self.force,
                self.multiplier, self.stiffness, self.mass, self.energy,
            )
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class Speeds:
    """Permissible relative speeds [m/s], shape (b, r)."""

    permissible: Array
    """The least of those that are known."""
    governing: NDArray[np.int64]
    """`seerob.criteria.contact.collision.Governing`."""
    force: Array
    pressure: Array
    """NaN where the contact area is unknown: then ``permissible`` is only an upper bound; 0 where the shape
    exceeds the pressure at every force."""
    energy: Array
    mu: Array
    """Reduced mass [kg]."""


@dataclass(frozen=True, eq=False)
class Judged:
    """Moving surfaces (b) against all that a person can be hit at (k, the regions of a table among them)."""

    v_r: Array
    """Bounds on the speeds of the surfaces [m/s], shape (b,)."""
    moves: NDArray[np.bool_]
    """Which of them move, shape (b,)."""
    v_h: Array
    """Bounds on the speeds of the person [m/s], shape (k,)."""
    near: NDArray[np.bool_]
    """What could be hit by what, shape (b, k)."""
    projected: Array
    """Effective mass of each surface along its motion [kg], NaN where it stands still, shape (b,)."""
    speeds: Speeds
    clamped: NDArray[np.bool_]
    """Shape (b, r)."""
    rows: NDArray[np.int64]
    """Surface that governs, shape (k,)."""
    ranks: NDArray[np.int64]
    """2 exceeded, 1 open, 0 within, shape (k,)."""
    ends: Spread | None = None
    """Of the permissible speeds, shape (b, r), where something that they are made from may be off."""
    on_floor: NDArray[np.bool_] | None = None
    """Which of ``clamped`` are against the floor, shape (b, r)."""
    closing: Array | None = None
    """How fast surfaces come against others that move too, where these clamp [m/s], shape (b, k)."""
    simplified: float = math.nan
    """Mass behind the surfaces by the norm, or the whole mass of what moves them as one [kg]."""
    pushed: str = ""
    """Which drive may press on after the impact, in words; empty where joints of a robot alone move."""
    whole: bool = False
    """Whether all of the mass of what moves as one is behind it."""

    @property
    def least(self) -> Array:
        """Permissible speeds that hold whatever is off [m/s], shape (b, r)."""
        return self.speeds.permissible if self.ends is None else self.ends.low

    @property
    def v(self) -> Array:
        """Bounds on the relative speed [m/s], shape (b, k)."""
        return relative(self.v_r, self.v_h, self.closing)


def relative(v_r: Array, v_h: Array, closing: Array | None) -> Array:
    """Bounds on relative speeds [m/s], shape (b, k).

    Args:
        v_r: Of surfaces [m/s], shape (b,).
        v_h: Of parts of a person, shape (k,).
        closing: See `Judged.closing`: of two sides that come against each other both may be slower.
    """
    hits = v_r[:, None] + v_h
    return hits if closing is None else np.maximum(hits, closing)


def credited_input(largest: float, cap: float) -> Input:
    """The area above which a contact is not credited [m²], and where it is from."""
    own = largest != cap
    return Input(
        name="largest contact area",
        value=largest,
        unit="m²",
        origin=Origin.GIVEN if own else Origin.STATED,
        source="workstation file" if own else "k belongs to about 1 cm² (1S)",
    )


def contact_input(
    name: str, shape: ContactShape, *, radius: float | None = None, area: float | None = None, by: str = ""
) -> Input:
    """Where the contact area of a part is from.

    Args:
        name: Of the part.
        shape: By which it touches.
        radius: That the workstation file gives [m].
        area: Likewise, instead [m²].
        by: Name by which it gives it.
    """
    what, sharpest = f"contact radius of {name}", shape.sharpest[0]
    file = f"workstation file, of {by}" if by else "workstation file"
    if area is not None:
        return Input(name=f"contact area of {name}", value=area, unit="m²", origin=Origin.GIVEN, source=file)
    if radius is not None:
        return Input(name=what, value=radius, unit="m", origin=Origin.GIVEN, source=file)
    if shape.unknown:
        return Input(name=what, origin=Origin.MISSING, source=shape.unknown)
    value, unit = (sharpest, "m") if np.isfinite(sharpest) else ("flat", "")
    return Input(name=what, value=value, unit=unit, origin=Origin.COMPUTED, source="its mesh")


NOT_GIVEN = "how hard its drive keeps pushing is not given: drive_force"
PressureForces = Callable[[RegionArrays], Array]
"""Force of each surface that keeps the pressure of each region [N], shape (b, 2, r)."""


def robot_masses(which: str, simplified: float, projected: Array) -> Array:
    """Mass of the robot at each surface [kg], shape (b,).

    Args:
        which: ``larger``, ``simplified`` or ``projected``.
        simplified: M/2 + m_L [kg].
        projected: Effective mass along the motion [kg]; NaN where it stands still, and hits nobody.

    Raises:
        ValueError: Another word, or a simplified mass that is none.
    """
    number("simplified", simplified, 0.0, unit="kg")
    if which == "simplified":
        return np.full(len(projected), simplified)
    if which not in ("larger", "projected"):
        raise ValueError(f"which is {which!r}, it is 'larger', 'simplified' or 'projected'")
    known = np.maximum(simplified, projected) if which == "larger" else projected
    return np.where(np.isnan(projected), simplified, known)


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
