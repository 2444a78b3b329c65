r"""Kinetic energy of a robot at a point of it: that of its effective mass there, along its motion."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, cast

import numpy as np
from msgspec import Meta

from seerob.core import figures
from seerob.core.domains import at_least
from seerob.core.errors import Undecided
from seerob.core.quantities import Metres3
from seerob.core.snapshot import Basis, Sphere
from seerob.core.tolerances import Shifts, Spread, deciding, spread
from seerob.core.transforms import Array
from seerob.core.verdict import Verdict
from seerob.criteria.criterion import Criterion, Lowest
from seerob.criteria.figure import Compute, Figure, Present, Shown, Twin
from seerob.criteria.noisy_speeds import NOISE
from seerob.model import provenance
from seerob.model.model import Frame, Model
from seerob.twin.accuracy.mass_tolerances import MassTolerances
from seerob.twin.moving_base import velocity_of
from seerob.twin.spans import Points, Span, change_of_motion
from seerob.twin.state import State

DRAWN = 0.1
"""Radius of the sphere of 1 J [m]; the volume is proportional to the energy."""


def point_energy(inverse: Array, velocity: Array) -> Array:
    r"""Energy of the effective mass of a point.

    .. math:: E = \tfrac{1}{2} m_u v^2 = \frac{|v|^4}{2 v^T \Lambda^{-1} v}

    is the least kinetic energy that the robot can have while the point moves so along its direction, and so
    never more than that of the whole robot.

    Args:
        inverse: Inverse effective mass matrix of the point, shape (..., 3, 3) [1/kg].
        velocity: Of the point [m/s], shape (..., 3).

    Returns:
        Energy [J], shape (...); 0 of a point that stands still.

    Raises:
        ValueError: The matrix is none of an inverse mass.
    """
    square = np.vecdot(velocity, velocity)
    pushed = np.vecdot(velocity, np.matvec(inverse, velocity))
    stands = square == 0
    with np.errstate(divide="ignore"):  # what cannot be pushed that way, and moves so all the same
        energy = np.where(stands, 0.0, 0.5 * square**2 / np.where(stands, 1.0, pushed))
    return at_least("energy of Λ⁻¹, an inverse mass matrix,", energy, 0.0, "J")


class PointEnergy(Criterion, frozen=True, kw_only=True):
    """Kinetic energy that a robot has at a point, of its elbow or tool: of the effective mass there."""

    unit: ClassVar[str] = "J"
    heavier_is_worse: ClassVar[bool] = True
    by_shape: ClassVar[bool] = False

    at: str
    """Point: a robot (its tool's working point) or the full name of a link."""
    offset: Metres3 = (0.0, 0.0, 0.0)
    """The point in that frame [m]."""
    limit: Annotated[float, Meta(gt=0, extra={"unit": "J"})] | None = None
    """Largest admissible energy [J]."""

    def subjects(self) -> tuple[str, ...]:
        """The point."""
        return (self.at,)

    def compute(self, model: Model) -> Compute:
        """Look up every name in the model once and return the function that computes the energy."""
        frame = model.frame(self.at)
        robot = model.carrier(frame)
        robot.require_masses(self.name)
        offset, masses = np.array(self.offset), MassTolerances(model, robot)

        def compute(twin: Twin) -> Figure:
            if not robot.alone:
                raise Undecided(
                    f"{robot.name}: what carries it or rides on it is not followed here: take kinetic_energy"
                )
            velocity = velocity_of(twin, frame, robot, offset)[..., :3]
            energy = point_energy(twin.inverse_effective_mass(frame, robot, offset), velocity)
            if not len(masses):
                return Figure(energy if twin.many else float(energy), self.limit)
            ends = self._ends(masses, cast("State", twin), frame, velocity)
            return Figure(float(energy), self.limit, (ends.low, ends.high))

        return compute

    def _ends(self, masses: MassTolerances, state: State, frame: Frame, velocity: Array) -> Spread:
        """Of the energy: the velocity is that of the joints, whatever they move weighs."""
        J_v = state.jacobian(frame, masses.robot, np.array(self.offset))[:3]
        pushed = np.asarray(np.linalg.solve(state.mass_matrix(masses.robot), J_v.T @ velocity), float)
        matrices = masses.matrices(state, pushed)

        def at(shifts: Shifts) -> Array:
            return point_energy(J_v @ np.linalg.solve(matrices.at(shifts), J_v.T), velocity)

        return spread(at, len(masses))

    def present(self, model: Model) -> Present:
        """Return the function that draws a sphere at the point."""
        frame, offset = model.frame(self.at), np.array(self.offset)
        robot = model.carrier(frame)
        masses = MassTolerances(model, robot)

        def present(state: State, figure: Figure, verdict: Verdict | None) -> Shown:
            place, energy, reason = state.drawn_point(frame, offset), figure.number, ""

            def draw() -> tuple[Sphere, ...]:
                label = figures.worded(energy, self.limit, self.unit, at_most=True)
                radius = DRAWN * max(energy, 0.0) ** (1 / 3)
                return (Sphere(center=tuple(place().tolist()), radius=radius, label=label, verdict=verdict),)

            if verdict is Verdict.UNDECIDED:
                widths = np.zeros(0)
                if len(masses):
                    velocity = velocity_of(state, frame, robot, offset)[:3]
                    widths = self._ends(masses, state, frame, velocity).widths
                reason = deciding(masses.tolerances, widths) or NOISE
            return Shown(reason, draw)

        return present

    def one_by_one(self, model: Model) -> str:
        """Say so where a mass has a tolerance or something else moves it."""
        robot = model.carrier(model.frame(self.at))
        if len(MassTolerances(model, robot)):
            return "a mass has a tolerance"
        return "" if robot.alone else "something moves it, or is on it"

    def lowest(self, model: Model, points: Points) -> Lowest | None:
        r"""Least margin in a span, by the energy of the whole robot, which is never less than at a point.

        :math:`\sqrt{2E}` of the whole is a norm of its velocities, and changes by no more than the norm of
        how much these do (`seerob.twin.spans.change_of_motion`), with the heaviest masses there may be.
        """
        robot, limit = model.carrier(model.frame(self.at)), self.limit
        if limit is None or not robot.alone:
            return None
        masses = MassTolerances(model, robot)
        changes = change_of_motion(model, robot.mj_bodies, robot.v_address, points, masses.heaviest)
        dofs = robot.v_address

        def lowest(state: State, span: Span) -> float:
            change, _ = changes(span)
            if not math.isfinite(change) or span.joint_noise[dofs].any():
                return -math.inf
            qd, M = state.qd(robot), state.mass_matrix(robot)
            if len(masses):
                M = masses.matrices(state).at((1,) * len(masses))
            whole = math.sqrt(max(float(qd @ M @ qd), 0.0))
            return limit - 0.5 * (whole + change) ** 2

        return lowest

    def basis(self, model: Model) -> Basis:
        """State the formula, its source, the inputs with their origin, and what is not modelled."""
        robot = model.carrier(model.frame(self.at))
        return Basis(
            formula="E = ½ m_u v², 1/m_u = uᵀ J_v M⁻¹ J_vᵀ u, u along the motion of the point",
            source="Weistroffer et al. 2022, section 3.3, Eqs. 4, 7 and 8; Khatib 1995",
            inputs=(
                provenance.point(model, self.at, self.offset),
                *provenance.motion(model, robot.name),
                *provenance.masses(model, robot),
                *provenance.limit(self.limit, "J"),
            ),
            not_modelled=(
                "what of the robot's energy does not move the point: kinetic_energy has the whole",
                "not the energy of an impact, ½ μ v_rel², that ISO/TS 15066 limits per body region",
                *(() if robot.rotor_inertia_known else ("energy of rotors and gears",)),
            ),
        )
