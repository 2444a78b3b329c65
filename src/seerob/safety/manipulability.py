r"""Manipulability of a point of a robot, [Weistroffer2022]_ section 2.2.2.2."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar

import numpy as np
from msgspec import Meta

from seerob import provenance
from seerob.criterion import Criterion, Evaluate, judge
from seerob.kernels.axes import principal_axes
from seerob.model import Model
from seerob.quantities import Metres3
from seerob.snapshot import Basis, Ellipsoid, Result
from seerob.state import State
from seerob.transforms import Array, wxyz_from_rotation

DRAWN = 0.3
"""Half axis drawn for a singular value of 1 m/rad [m]."""


def singular_values(J_v: Array) -> tuple[Array, Array]:
    r"""Half axes of the velocity ellipsoid :math:`\{J_v \dot q : |\dot q| \le 1\}`.

    They are the roots of the eigenvalues of :math:`J_v J_v^T`; found by SVD, which does not square
    the condition number.

    Args:
        J_v: Linear Jacobian, shape (..., 3, n) [m/rad for revolute joints].

    Returns:
        Singular values, largest first, shape (..., 3) [m/rad], and the directions as columns of a
        right-handed frame in the same order, shape (..., 3, 3).
    """
    J_v = np.asarray(J_v, float)
    batch = J_v.shape[:-2]
    rows = J_v.reshape(-1, *J_v.shape[-2:]).copy()
    values, directions = np.empty((len(rows), 3)), np.empty((len(rows), 3, 3))
    principal_axes(rows, values, directions)
    return values.reshape(*batch, 3), directions.reshape(*batch, 3, 3)


class Manipulability(Criterion, frozen=True, kw_only=True):
    """How well a point can move in its worst direction; near zero the robot is near a singularity."""

    unit: ClassVar[str] = "m/rad"
    at_most: ClassVar[bool] = False

    at: str
    """Point: a robot (its tool's working point) or the full name of a link."""
    offset: Metres3 = (0.0, 0.0, 0.0)
    """The point in that frame [m]."""
    limit: Annotated[float, Meta(ge=0, extra={"unit": "m/rad"})] | None = None
    """Least admissible smallest singular value of J_v [m/rad]."""

    def subjects(self) -> tuple[str, ...]:
        """The point."""
        return (self.at,)

    def bind(self, model: Model) -> Evaluate:
        """See `Criterion.bind`."""
        frame = model.frame(self.at)
        mechanism = model.carrier(frame)
        offset = np.array(self.offset)

        def evaluate(state: State) -> Result:
            state.require(mechanism.name)
            J_v = state.jacobian(frame, mechanism, offset)[:3]
            sigma, axes = singular_values(J_v)
            smallest = float(sigma[2])
            verdict = judge(smallest, self.limit, at_most=False)
            rotation, position = state.pose(frame)
            ellipsoid = Ellipsoid(
                center=tuple((position + rotation @ offset).tolist()),
                wxyz=tuple(wxyz_from_rotation(axes).tolist()),
                radii=tuple((DRAWN * sigma).tolist()),
                label=f"σ₃ {smallest:.3f}",
                verdict=verdict,
            )
            parts = (
                Result(name="σ₁", value=float(sigma[0]), unit="m/rad"),
                Result(name="σ₂", value=float(sigma[1]), unit="m/rad"),
                Result(name="√det J_v J_vᵀ", value=math.prod(sigma.tolist()), unit="m³/rad³"),
            )
            return Result(
                name=self.name,
                value=smallest,
                unit=self.unit,
                limit=self.limit,
                at_most=False,
                verdict=verdict,
                parts=parts,
                markers=(ellipsoid,),
            )

        return evaluate

    def basis(self, model: Model) -> Basis:
        """See `Criterion.basis`."""
        carrier = model.carrier(model.frame(self.at))
        return Basis(
            formula="smallest singular value of J_v(q); ellipsoid of J_v J_vᵀ",
            source="Weistroffer et al. 2022, section 2.2.2.2",
            inputs=(
                provenance.point(model, self.at, self.offset),
                *provenance.motion(model, carrier.name),
                *provenance.limit(self.limit, "m/rad"),
            ),
            not_modelled=("orientation: only the linear rows of the Jacobian count",),
        )
