r"""Permissible speeds of many surfaces against many body regions at once.

From a table of limits and the contact areas, the least of the speeds at which force, pressure and energy
reach their limits (`seerob.criteria.contact.collision`): transient limits and :math:`m_H` when the body part
is free, quasi-static ones and :math:`m_H \to \infty` when it is clamped.

The contact area grows with the force. The force that a pressure allows is the one up to which the
pressure is never above it, :math:`F = p A(F)`, not the area at the largest force: at every force below
that the area is smaller.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from seerob.core.snapshot import Input, Origin
from seerob.core.tolerances import Spread
from seerob.core.transforms import Array
from seerob.criteria.contact.shape import ContactShape, force_at_pressure
from seerob.description.norms.body_limits import BodyLimits, BodyRegion
from seerob.kernels.contact_speeds import permissible_speeds


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
