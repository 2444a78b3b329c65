r"""Permissible speeds of many surfaces against many body regions at once.

From a table of limits and the contact areas, the least of the speeds at which force, pressure and energy
reach their limits (`seerob.collision`): transient limits and :math:`m_H` when the body part is free,
quasi-static ones and :math:`m_H \to \infty` when it is clamped.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from seerob import collision
from seerob.contact_shape import ContactShape, patch_area
from seerob.norms.body_limits import BodyLimits, BodyRegion
from seerob.transforms import Array


@dataclass(frozen=True, eq=False)
class RegionArrays:
    """The regions of a table where contact is permitted, as arrays of shape (r,), SI, quasi-static."""

    regions: tuple[BodyRegion, ...]
    force: Array
    pressure: Array
    """Least of the areas of each region."""
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
            np.array([r.pressure.value for r in regions]),
            np.array([min(r.multiplier.value, most) if r.multiplier else 1.0 for r in regions]),
            np.array([r.stiffness.value for r in regions]),
            np.array([r.mass.value for r in regions]),
            np.array([math.nan if r.energy is None else r.energy.value for r in regions]),
        )

    def contact_area(self, shape: ContactShape, cap: float) -> Array:
        """Least contact area of a surface with each region, free and clamped [m²], shape (2, r).

        NaN where the mesh does not tell.
        """
        if shape.unknown:
            return np.full((2, len(self.regions)), np.nan)
        indentation = self.force / self.stiffness * np.stack([self.multiplier, np.ones_like(self.force)])
        area = np.full(indentation.shape, cap)
        radii = shape.radii[np.isfinite(shape.radii[:, 0])]
        if len(radii):
            # What both a smaller and a flatter radius than another patch has is never the least.
            radii = np.unique(np.sort(radii, axis=1), axis=0)
            keep = np.concatenate([[True], radii[1:, 1] < np.minimum.accumulate(radii[:-1, 1])])
            areas = patch_area(radii[keep][:, None, None, :], indentation[None], cap)
            area = areas.min(axis=0)
        return collision.contact_area(area, cap, cap)

    def speeds(self, m_R: Array, areas: Array, clamped: NDArray[np.bool_]) -> Speeds:
        """Permissible relative speeds.

        Args:
            m_R: Effective mass of the robot at each surface [kg], shape (b,).
            areas: Of each surface, free and clamped, NaN when unknown [m²], shape (b, 2, r).
            clamped: Whether the body part cannot recoil, shape (b, r).
        """
        k = self.stiffness
        factor = np.where(clamped, 1.0, self.multiplier)
        m = np.broadcast_to(np.asarray(m_R, float)[:, None], clamped.shape)
        mu = np.where(clamped, m, collision.reduced_mass(self.mass, m))
        A = np.where(clamped, areas[:, 1], areas[:, 0])
        printed = np.where(clamped, np.nan, self.energy)
        F = factor * self.force
        v_F = collision.speed_at_force(F, mu, k)
        v_P = collision.speed_at_pressure(factor * self.pressure, A, mu, k)
        v_E = collision.speed_at_energy(collision.energy_limit(F, k, printed), mu)
        v, which = collision.permissible_speed(v_F, v_P, v_E)
        return Speeds(v, which, v_F, v_P, v_E, mu)


@dataclass(frozen=True, eq=False)
class Speeds:
    """Permissible relative speeds [m/s], shape (b, r)."""

    permissible: Array
    """The least of those that are known."""
    governing: NDArray[np.int64]
    """`seerob.collision.Governing`."""
    force: Array
    pressure: Array
    """NaN where the contact area is unknown: then ``permissible`` is only an upper bound."""
    energy: Array
    mu: Array
    """Reduced mass [kg]."""
