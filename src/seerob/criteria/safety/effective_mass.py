r"""Effective mass of a point of a robot, [Weistroffer2022]_ Eqs. 7 and 8, [Khatib1995]_."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Literal

import numpy as np
from msgspec import Meta

from seerob.core import figures
from seerob.core.markers import Marker, drawn
from seerob.core.quantities import Metres3
from seerob.core.snapshot import Arrow, Basis, Ellipsoid, Result, Verdict
from seerob.core.tolerances import Shifts, Spread, deciding, spread
from seerob.core.transforms import Array
from seerob.criteria.contact.impact_mass import simplified_mass
from seerob.criteria.criterion import Criterion, Evaluate, EvaluateMany, judge, judge_interval
from seerob.kernels.axes import mobility, principal_axes, reciprocals
from seerob.model import provenance
from seerob.model.model import Mechanism, Model
from seerob.recording.answers import Answers
from seerob.twin.accuracy.mass_tolerances import MassTolerances, Matrices
from seerob.twin.moving_base import velocity_of
from seerob.twin.state import State
from seerob.twin.states import States

DRAWN = 0.02
"""Half axis, or arrow, drawn for 1 kg [m]."""
LARGEST_DRAWN = 0.6
TOUCHING = 1e-9
"""Length below which a line to a person has no direction [m]."""
NAMES = "m1", "m2", "m3"
"""Of the principal masses."""
STANDSTILL = 1e-3
"""Speed below which a motion has no direction [m/s]."""


def inverse_effective_mass(J_v: Array, M: Array) -> Array:
    r"""Inverse of the effective mass matrix, :math:`\Lambda^{-1} = J_v M^{-1} J_v^T` (Eq. 7).

    Args:
        J_v: Linear Jacobian of the point, shape (..., 3, n).
        M: Joint-space mass matrix, positive definite, shape (..., n, n).

    Returns:
        Symmetric matrix, shape (..., 3, 3) [1/kg]; singular where the point cannot be pushed.
    """
    J_v, M = np.asarray(J_v, float), np.asarray(M, float)
    rows, n = J_v.shape[-2:]
    if batch := np.broadcast_shapes(J_v.shape[:-2], M.shape[:-2]):
        J_v, M = np.broadcast_to(J_v, (*batch, rows, n)), np.broadcast_to(M, (*batch, n, n))
    points, masses = np.array(J_v).reshape(-1, rows, n), np.array(M).reshape(-1, n, n)
    found = np.empty((len(points), rows, rows))
    if not mobility(points, masses, found):
        raise np.linalg.LinAlgError("M, a mass matrix, is not positive definite")
    return found.reshape(*batch, rows, rows)


def projected_mass(inverse: Array, u: Array) -> Array:
    r"""Mass felt along a direction, :math:`1/m_u = u^T \Lambda^{-1} u` (Eq. 8).

    Args:
        inverse: Λ⁻¹, shape (..., 3, 3) [1/kg].
        u: Unit directions, shape (..., 3).

    Returns:
        Mass [kg], shape (...); inf where the point cannot be pushed that way.
    """
    along = np.asarray((u[..., None, :] @ inverse @ u[..., :, None])[..., 0, 0])
    return reciprocals(along.reshape(-1)).reshape(along.shape)


def _mass_along(inverse: Array, u: Array) -> float:
    """`projected_mass` of one direction."""
    along = float(u @ inverse @ u)
    return math.inf if along <= 0.0 else 1.0 / along


def principal_masses(inverse: Array) -> tuple[Array, Array]:
    """Effective masses along the principal axes, smallest first [kg], and the axes as columns.

    The columns are a right-handed frame.
    """
    batch = inverse.shape[:-2]
    used_up = inverse.reshape(-1, 3, 3).copy()
    values, axes = np.empty((len(used_up), 3)), np.empty_like(used_up)
    # Of a symmetric matrix without negative eigenvalues they are its singular values.
    principal_axes(used_up, values, axes)
    values[np.isnan(values).any(axis=-1)] = np.nan
    return reciprocals(values.reshape(-1)).reshape(*batch, 3), axes.reshape(*batch, 3, 3)


class EffectiveMass(Criterion, frozen=True, kw_only=True):
    """Mass that somebody hit by a point of the robot would feel, along its motion or toward a person."""

    unit: ClassVar[str] = "kg"
    heavier_is_worse: ClassVar[bool] = True
    whole: ClassVar[bool] = False

    at: str
    """Point: a robot (its tool's working point) or the full name of a link."""
    offset: Metres3 = (0.0, 0.0, 0.0)
    """The point in that frame [m]."""
    along: Literal["motion", "worst"] = "motion"
    """Direction: of the point's motion, or the heaviest one."""
    toward: str | None = None
    """Instead: the direction of the shortest line from the robot to this human or set."""
    limit: Annotated[float, Meta(gt=0, extra={"unit": "kg"})] | None = None
    """Largest admissible mass [kg]."""

    def subjects(self) -> tuple[str, ...]:
        """The point, and whom it faces."""
        return (self.at,) if self.toward is None else (self.at, self.toward)

    def unshaped(self, model: Model) -> str:
        """Say what no shape shows of the robot; a direction that is not toward somebody needs no shape."""
        return "" if self.toward is None else super().unshaped(model)

    def bind(self, model: Model) -> Evaluate:
        """Look up every name in the model once and return the function that judges one instant."""
        frame = model.frame(self.at)
        robot = model.carrier(frame)
        robot.require_masses(self.name)
        offset = np.array(self.offset)
        gap = None if self.toward is None else model.gap(robot.moving, model.select(self.toward))
        tolerances = MassTolerances(model, robot)
        simplified = self._simplified(model, robot, tolerances)

        def direction(state: State, axes: Array) -> tuple[Array | None, str]:
            if gap is not None:
                closest = state.closest(gap)
                line = closest.point_b - closest.point_a
                length = math.sqrt(float(line @ line))
                if length < TOUCHING:
                    return None, "touching: the line to the person has no direction"
                return line / length, ""
            if self.along == "worst":
                return axes[:, -1], ""
            v = velocity_of(state, frame, robot, offset)[:3]
            speed = math.sqrt(float(v @ v))
            return (v / speed, "") if speed > STANDSTILL else (None, "stands still: no direction of motion")

        def evaluate(state: State) -> Result:
            inverse, axes, masses, wxyz = state.mass_ellipsoid(frame, robot, offset)
            u, reason = direction(state, axes)
            mass = None if u is None else _mass_along(inverse, u)
            verdict, interval, open_ = self._verdict(mass), None, ""
            if len(tolerances) and u is not None and mass is not None and math.isfinite(mass):
                ends = self._ends(
                    tolerances.matrices(state), len(tolerances), state.jacobian(frame, robot, offset)[:3], u
                )
                interval = float(ends.low), float(ends.high)
                verdict = judge_interval(interval, self.limit)
                open_ = deciding(tolerances.tolerances, ends.widths) if verdict is Verdict.UNDECIDED else ""
            if u is None and gap is not None and self.limit is not None:
                verdict = Verdict.UNDECIDED
            place = state.drawn_point(frame, offset)

            def draw() -> tuple[Marker, ...]:
                center = tuple(place().tolist())
                ellipsoid = Ellipsoid(
                    center=center,
                    wxyz=(wxyz[0], wxyz[1], wxyz[2], wxyz[3]),
                    radii=tuple(np.minimum(DRAWN * masses, LARGEST_DRAWN).tolist()),
                    verdict=verdict,
                )
                if u is None or mass is None:
                    return (ellipsoid,)
                vector = tuple((min(DRAWN * mass, LARGEST_DRAWN) * u).tolist())
                label = figures.worded(mass, self.limit, self.unit, at_most=True)
                return ellipsoid, Arrow(origin=center, vector=vector, label=label, verdict=verdict)

            return Result(
                name=self.name,
                value=mass if mass is not None and math.isfinite(mass) else None,
                unit=self.unit,
                limit=self.limit,
                verdict=verdict,
                nothing=verdict is None and (mass is None or not math.isfinite(mass)),
                interval=interval,
                reason=reason
                or open_
                or ("" if mass is None or math.isfinite(mass) else "cannot be pushed that way: infinite"),
                parts=(
                    *(
                        Result(name=name, value=m if math.isfinite(m) else None, unit="kg")
                        for name, m in zip(NAMES, masses.tolist(), strict=True)
                    ),
                    simplified,
                ),
                markers=drawn(draw),
            )

        return evaluate

    def _ends(self, matrices: Matrices, inputs: int, J_v: Array, u: Array) -> Spread:
        """Of the mass along u, or of the heaviest direction there is at each end."""

        def at(shifts: Shifts) -> Array:
            inverse = inverse_effective_mass(J_v, matrices.at(shifts))
            heaviest = self.along == "worst" and self.toward is None
            return principal_masses(inverse)[0][-1] if heaviest else projected_mass(inverse, u)

        return spread(at, inputs)

    @staticmethod
    def _simplified(model: Model, robot: Mechanism, tolerances: MassTolerances) -> Result:
        mass = simplified_mass(model, robot)
        interval = None
        if len(tolerances):
            ends = spread(lambda shifts: np.array(tolerances.simplified(mass, shifts)), len(tolerances))
            interval = float(ends.low), float(ends.high)
        return Result(name="M/2 + m_L", value=mass, unit="kg", interval=interval)

    def batch(self, model: Model) -> EvaluateMany | None:
        """Judge many instants at once; None where a mass has a tolerance or something else moves it."""
        frame, offset = model.frame(self.at), np.array(self.offset)
        robot = model.carrier(frame)
        if len(MassTolerances(model, robot)) or not robot.alone:
            return None
        gap = None if self.toward is None else model.gap(robot.moving, model.select(self.toward))

        def evaluate(states: States) -> Answers:
            J_v = states.jacobian(frame, robot, offset)[:, :3]
            inverse = inverse_effective_mass(J_v, states.mass_matrix(robot))
            if gap is not None:
                closest = states.closest(gap)
                along = closest.point_b - closest.point_a
            elif self.along == "worst":
                along = principal_masses(inverse)[1][..., -1]
            else:
                along = (J_v @ states.qd(robot)[..., None])[..., 0]
            length = np.sqrt(np.einsum("ij,ij->i", along, along))
            known = length > STANDSTILL if gap is None else length >= TOUCHING
            u = along / np.where(known, length, 1.0)[:, None]
            mass = np.where(known, projected_mass(inverse, u), np.nan)
            found = Answers.against(mass, self.limit, at_most=self.at_most).finite()
            # Without a direction there is nothing to judge, unless a limit was to hold toward somebody.
            return found if gap is not None else found.without_verdict(~known)

        return evaluate

    def _verdict(self, mass: float | None) -> Verdict | None:
        return None if mass is None else judge(mass, self.limit)

    def basis(self, model: Model) -> Basis:
        """State the formula, its source, the inputs with their origin, and what is not modelled."""
        robot = model.carrier(model.frame(self.at))
        gap = None if self.toward is None else model.gap(robot.moving, model.select(self.toward))
        which = (
            f"toward {self.toward}"
            if self.toward
            else {"motion": "along the motion", "worst": "worst"}[self.along]
        )
        return Basis(
            formula=f"1/m_u = uᵀ J_v M⁻¹ J_vᵀ u, u {which}",
            source="Weistroffer et al. 2022, Eqs. 7 and 8; Khatib 1995",
            inputs=(
                provenance.point(model, self.at, self.offset),
                *provenance.motion(model, robot.name, *(gap.carriers if gap is not None else ())),
                *provenance.masses(model, robot),
                *(provenance.shapes(gap) if gap is not None else ()),
                *provenance.limit(self.limit, "kg"),
            ),
            not_modelled=(
                "joints held by brakes, friction or position control, which make the robot heavier",
                *(
                    ()
                    if robot.rotor_inertia_known
                    else ("rotor inertia: link side only, too light in some directions",)
                ),
                "does not replace M/2 + m_L of ISO/TS 15066 Annex A, shown beside it",
            ),
        )
