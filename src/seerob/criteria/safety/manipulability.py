r"""Manipulability of a point of a robot, [Weistroffer2022]_ section 2.2.2.2."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Annotated, Any, ClassVar, cast

import numpy as np
from msgspec import Meta

from seerob.core import figures
from seerob.core.errors import Undecided
from seerob.core.quantities import Metres3
from seerob.core.snapshot import Basis, Ellipsoid, Result
from seerob.core.transforms import Array
from seerob.core.verdict import Verdict
from seerob.criteria.criterion import Criterion
from seerob.criteria.figure import Compute, Figure, Present, Shown, Twin
from seerob.criteria.plan import Draw, Rows, Together
from seerob.kernels.axes import principal_axes
from seerob.model import provenance
from seerob.model.model import Frame, Model
from seerob.twin.moving_points import Point, commanded
from seerob.twin.spans import Falls, Points, Turning, coupling_of
from seerob.twin.state import State

STEP = math.radians(1)
"""How far joints are moved to see which leads out of a singularity [rad or m]."""
NOTHING = 1e-9
"""Growth of a singular value up to which a joint does not lead out [m/rad]."""
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
    values[np.isnan(values).any(axis=-1)] = np.nan
    return values.reshape(*batch, 3), directions.reshape(*batch, 3, 3)


def least_value_after(J: Array, step: float = STEP) -> Array:
    r"""Smallest singular value of J_v [m/rad] once each joint alone has moved, either way, shape (n, 2).

    Exact, not by a derivative, which at a singularity depends on which of the vectors is taken that the
    arm cannot move along. A turn of joint j by :math:`\delta` turns what is farther out, :math:`J_{v,i}` of
    i > j, and moves the point by :math:`d`, so that :math:`J_{v,i}` of the others changes by
    :math:`\omega_i \times d`.

    Args:
        J: Jacobian of a chain from its base outward, linear rows first, shape (6, n).
        step: How far each joint moves [rad or m].
    """
    linear, angular = J[:3].T, J[3:].T
    n = len(linear)
    moved = np.empty((n, 2, n, 3))
    for j in range(n):
        # 1 of a joint that turns or slides; of one that others follow, how fast all of them turn.
        rate = float(np.linalg.norm(angular[j])) or 1.0
        axis, own = angular[j] / rate, linear[j] / rate
        for k, angle in enumerate((step * rate, -step * rate)):
            sine, rest = math.sin(angle), 1 - math.cos(angle)
            d = sine * own + rest * np.cross(axis, own) if axis.any() else angle * own
            inner = linear[: j + 1] + np.cross(angular[: j + 1], d)
            once = np.cross(axis, linear[j + 1 :])
            outer = linear[j + 1 :] + sine * once + rest * np.cross(axis, once)
            moved[j, k] = np.vstack([inner, outer])
    return np.asarray(np.linalg.svd(moved, compute_uv=False)[..., -1])


class Manipulability(Criterion, frozen=True, kw_only=True):
    """How well a point can move in its worst direction; near zero the robot is near a singularity."""

    unit: ClassVar[str] = "m/rad"
    by_shape: ClassVar[bool] = False
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

    def compute(self, model: Model) -> Compute:
        """Look up every name in the model once and return the function that computes the figure."""
        frame, offset = model.frame(self.at), np.array(self.offset)
        mechanism = model.carrier(frame)

        def compute(twin: Twin) -> Figure:
            if twin.many:
                return Figure(twin.singular_values(frame, mechanism, offset)[2], self.limit)
            ellipsoid = cast("State", twin).velocity_ellipsoid(frame, mechanism, offset)
            return Figure(ellipsoid[0][2], self.limit, beside=ellipsoid)

        return compute

    def one_by_one(self, model: Model) -> str:
        """Many instants are computed together."""
        return ""

    def present(self, model: Model) -> Present:
        """Return the function that says what leads out of a singularity, and draws the ellipsoid."""
        frame, offset = model.frame(self.at), np.array(self.offset)
        mechanism = model.carrier(frame)
        names = [joint.name for joint in mechanism.joints]

        def present(state: State, figure: Figure, verdict: Verdict | None) -> Shown:
            sigma, wxyz = figure.beside
            smallest, reason = sigma[2], ""
            if verdict is Verdict.EXCEEDED and len(names) >= 3:
                after = least_value_after(state.jacobian(frame, mechanism, offset)).max(axis=1)
                joint = names[int(after.argmax())]
                reason = f"near a singularity: {joint} leads out of it the soonest"
                if after.max() <= smallest + NOTHING:
                    reason = "no joint by itself leads out of the singularity"
            place = state.drawn_point(frame, offset)
            draw = partial(_ellipsoid, self, place, sigma, wxyz, verdict)
            return Shown(reason, draw, _others(sigma))

        return present

    def planned(self, model: Model) -> Callable[[Sequence[Any], Model], Together] | None:
        """Return what computes figures of points together."""
        return _Figures if commanded(model.carrier(model.frame(self.at))) else None

    def falls(self, model: Model, points: Points) -> Falls:
        """Bound how far singular values fall between instants: by the norm of the Jacobian's change."""
        frame = model.frame(self.at)
        mechanism = model.carrier(frame)
        local = frame.body_from_frame[:3, :3] @ np.array(self.offset) + frame.body_from_frame[:3, 3]
        point = points.add(frame.mj, local)
        return Turning(points, point, coupling_of(model, mechanism))

    def basis(self, model: Model) -> Basis:
        """State the formula, its source, the inputs with their origin, and what is not modelled."""
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


class _Figures:
    """Manipulability of points at one instant, of a tick's plan."""

    intervals = False
    _place: Callable[[Frame, Array], Array]

    def __init__(self, criteria: Sequence[Manipulability], model: Model) -> None:
        frames = [model.frame(each.at) for each in criteria]
        self._points = tuple(
            Point(frame, model.carrier(frame), each.offset)
            for each, frame in zip(criteria, frames, strict=True)
        )
        self._offsets = [np.array(each.offset) for each in criteria]
        self._criteria = criteria
        self._found: list[list[float]] = []

    def compute(self, state: State, rows: Rows) -> None:
        """Write the smallest singular value of every point."""
        self._place = state.drawn_points()
        moved, own = state.moving(self._points)
        self._found = [moved.sigma[row] for row in own]
        rows.value[:] = [sigma[2] for sigma in self._found]

    def present(
        self, state: State, k: int, value: float, verdict: Verdict | None
    ) -> tuple[str, Draw, tuple[Result, ...]]:
        """Say and draw what `Manipulability.present` does of one that is decided."""
        if verdict is Verdict.EXCEEDED:
            raise Undecided("it says which joint leads out")
        sigma = self._found[k][:3]
        place = partial(self._place, self._points[k].frame, self._offsets[k])
        draw = partial(_ellipsoid, self._criteria[k], place, sigma, self._found[k][3:], verdict)
        return "", draw, _others(sigma)


def _others(sigma: Sequence[float]) -> tuple[Result, ...]:
    return (
        Result(name="σ₁", value=sigma[0], unit="m/rad"),
        Result(name="σ₂", value=sigma[1], unit="m/rad"),
        Result(name="√det J_v J_vᵀ", value=math.prod(sigma), unit="m³/rad³"),
    )


def _ellipsoid(
    of: Manipulability,
    place: Callable[[], Array],
    sigma: Sequence[float],
    wxyz: Sequence[float],
    verdict: Verdict | None,
) -> tuple[Ellipsoid, ...]:
    ellipsoid = Ellipsoid(
        center=tuple(place().tolist()),
        wxyz=(wxyz[0], wxyz[1], wxyz[2], wxyz[3]),
        radii=(DRAWN * sigma[0], DRAWN * sigma[1], DRAWN * sigma[2]),
        label=f"σ₃ {figures.worded(sigma[2], of.limit, of.unit, at_most=False)}",
        verdict=verdict,
    )
    return (ellipsoid,)
