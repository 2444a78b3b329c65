r"""Effective mass of a point of a robot, [Weistroffer2022]_ Eqs. 7 and 8, [Khatib1995]_."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Annotated, Any, ClassVar, Literal, cast

import mujoco
import numpy as np
from msgspec import Meta

from seerob.core import figures
from seerob.core.domains import agree, number
from seerob.core.markers import Marker
from seerob.core.quantities import Metres3
from seerob.core.snapshot import Arrow, Basis, Ellipsoid, Result
from seerob.core.tolerances import Shifts, Spread, deciding, spread
from seerob.core.transforms import Array
from seerob.core.verdict import Verdict
from seerob.criteria.contact.impact_mass import simplified_mass
from seerob.criteria.criterion import Criterion, Lowest
from seerob.criteria.figure import Compute, Figure, Present, Shown, Twin
from seerob.criteria.plan import Draw, Rows, Together
from seerob.distance.least import Per
from seerob.kernels.axes import mass_along, masses_along, mobility, principal_axes, reciprocals
from seerob.model import provenance
from seerob.model.model import Frame, Mechanism, Model
from seerob.twin.accuracy.mass_tolerances import MassTolerances
from seerob.twin.moving_base import velocity_of
from seerob.twin.moving_points import Point, commanded
from seerob.twin.spans import Points, Span, coupling_of
from seerob.twin.state import State

DRAWN = 0.02
"""Half axis, or arrow, drawn for 1 kg, at least [m]."""
LARGEST_DRAWN = 0.6
LEAST_DRAWN = 0.1
"""Half axis drawn for M/2 + m_L, at least [m]: that of a small robot would be hidden in its hand."""
TOUCHING = 1e-9
"""Length below which a line to a person has no direction [m]."""
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
    agree(n=(n, *M.shape[-2:]))
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

    Raises:
        ValueError: A direction is not of length 1, to 10⁻⁶.
    """
    number("length of u", np.linalg.norm(u[~np.isnan(u).any(axis=-1)], axis=-1), 1 - 1e-6, 1 + 1e-6)
    along = np.asarray((u[..., None, :] @ inverse @ u[..., :, None])[..., 0, 0])
    return reciprocals(along.reshape(-1)).reshape(along.shape)


def felt_toward(inverse: Array, along: Array, least: float) -> Array:
    """Mass felt along directions [kg], shape (...).

    Args:
        inverse: Λ⁻¹, shape (..., 3, 3) [1/kg].
        along: Directions of any length, shape (..., 3).
        least: Up to this length there is no direction, and the mass is NaN.
    """
    masses, rows = np.empty(along.shape[:-1]), np.ascontiguousarray(along).reshape(-1, 3)
    masses_along(inverse.reshape(-1, 3, 3), rows, least, masses.reshape(-1))
    return masses


def principal_masses(inverse: Array) -> tuple[Array, Array]:
    """Effective masses along the principal axes, smallest first [kg], and the axes as columns.

    The columns are a right-handed frame.
    """
    batch = inverse.shape[:-2]
    used_up = inverse.reshape(-1, 3, 3).copy()
    values, axes = np.empty((len(used_up), 3)), np.empty_like(used_up)
    # Of a symmetric matrix without negative eigenvalues they are its singular values.
    principal_axes(used_up, values, axes)
    values[~np.isfinite(values).all(axis=-1)] = np.nan
    return reciprocals(values.reshape(-1)).reshape(*batch, 3), axes.reshape(*batch, 3, 3)


def _principal(masses: Sequence[float]) -> tuple[Result, ...]:
    one, two, three = masses[:3]
    return _of("m1", one), _of("m2", two), _of("m3", three)


def _of(name: str, mass: float) -> Result:
    """A principal mass, by name."""
    return Result(name=name, value=mass if math.isfinite(mass) else None, unit="kg")


def _turned(before: Array, after: Array, off: float) -> tuple[Array, float]:
    r"""A direction, and how far that of a motion is from it wherever that is faster than `STANDSTILL`.

    Two unit vectors are no farther apart than :math:`\sqrt 2 \sin` of their angle up to a right angle.

    Args:
        before: A velocity [m/s], shape (3,).
        after: Another one.
        off: By how much the velocity may be off the straight line between both [m/s].

    Returns:
        Unit vector, and 2 where it may be opposite.
    """
    slow, fast = sorted((before, after), key=lambda v: float(v @ v))
    slowest, speed = math.sqrt(float(slow @ slow)), math.sqrt(float(fast @ fast))
    if speed == 0:
        return np.array([1.0, 0, 0]), 2.0
    u = fast / speed

    def chord(error: float, least: float) -> float:
        return math.sqrt(2) * error / least if error < least else 2.0

    # Either the slower one is an error too, or all between both is in their cone.
    along = float(slow @ u)
    in_cone = math.sqrt(max(2 - 2 * along / slowest, 0.0)) if along > 0 else 2.0
    in_cone += chord(off, max(along - off, STANDSTILL))
    return u, min(chord(off + slowest, STANDSTILL), in_cone, 2.0)


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

    def compute(self, model: Model) -> Compute:
        """Look up every name in the model once and return the function that computes the mass."""
        frame = model.frame(self.at)
        robot = model.carrier(frame)
        robot.require_masses(self.name)
        offset, tolerances = np.array(self.offset), MassTolerances(model, robot)
        direction = self._direction(model, frame, robot)
        least = STANDSTILL if self.toward is None else TOUCHING
        # Without a direction there is nothing to judge, unless a limit was to hold toward somebody.
        silent = self.toward is None or self.limit is None

        def compute(twin: Twin) -> Figure:
            if twin.many:
                inverse = twin.inverse_effective_mass(frame, robot, offset)
                found = felt_toward(inverse, direction(twin, inverse), least)
                return Figure(found, self.limit, None, np.isnan(found) & silent)
            ellipsoid = cast("State", twin).mass_ellipsoid(frame, robot, offset)
            *u, mass = mass_along(ellipsoid.inverse, direction(twin, ellipsoid.inverse), least)
            known, interval = not math.isnan(mass), None
            if len(tolerances) and math.isfinite(mass):
                ends = self._ends(tolerances, cast("State", twin), frame, offset, np.array(u))
                interval = ends.low, ends.high
            nothing = silent and not known
            return Figure(
                mass if known else None, self.limit, interval, nothing, beside=(u, known, ellipsoid)
            )

        return compute

    def _direction(self, model: Model, frame: Frame, robot: Mechanism) -> Callable[[Twin, Array], Array]:
        """Return the function that tells directions of any length, shape (..., 3), given Λ⁻¹."""
        gap = None if self.toward is None else model.gap(robot.moving, model.select(self.toward))
        offset = np.array(self.offset)

        def direction(twin: Twin, inverse: Array) -> Array:
            if gap is not None:
                closest = twin.closest(gap)
                return closest.point_b - closest.point_a
            if self.along == "worst":
                return np.asarray(principal_masses(inverse)[1][..., -1])
            return velocity_of(twin, frame, robot, offset)[..., :3]

        return direction

    def present(self, model: Model) -> Present:
        """Return the function that draws the ellipsoid, and says why there is no direction."""
        frame, offset = model.frame(self.at), np.array(self.offset)
        robot = model.carrier(frame)
        tolerances = MassTolerances(model, robot)
        simplified = self._simplified(model, robot, tolerances)
        size = _half_axis(simplified)

        def present(state: State, figure: Figure, verdict: Verdict | None) -> Shown:
            u, known, (_, _, masses, wxyz) = figure.beside
            mass, reason = None if figure.value is None else float(figure.value), ""
            if not known:
                touching = "touching: the line to the person has no direction"
                reason = "stands still: no direction of motion" if self.toward is None else touching
            elif mass is not None and math.isinf(mass):
                reason = "cannot be pushed that way: infinite"
            elif figure.interval is not None and verdict is Verdict.UNDECIDED:
                ends = self._ends(tolerances, state, frame, offset, np.array(u))
                reason = deciding(tolerances.tolerances, ends.widths)
            interval = None if figure.interval is None else tuple(float(end) for end in figure.interval)
            place = state.drawn_point(frame, offset)
            draw = partial(_drawn, self, place, size, masses, wxyz, u, mass, verdict, interval)
            return Shown(reason, draw, (*_principal(masses.tolist()), simplified))

        return present

    def one_by_one(self, model: Model) -> str:
        """Say so where a mass has a tolerance or something else moves it."""
        robot = model.carrier(model.frame(self.at))
        if len(MassTolerances(model, robot)):
            return "a mass has a tolerance"
        return "" if robot.alone else "something that moves carries the robot"

    def planned(self, model: Model) -> Callable[[Sequence[Any], Model], Together] | None:
        """Return what computes masses together: in one known direction, without tolerances."""
        robot = model.carrier(model.frame(self.at))
        directed = self.toward is not None or (self.along == "motion" and robot.alone)
        together = directed and commanded(robot) and not len(MassTolerances(model, robot))
        return _Masses if together else None

    def lowest(self, model: Model, points: Points) -> Lowest | None:
        r"""Least margin in a span; None of what moves something else too.

        Of tolerances of masses only along the motion: any rates x bound the mass, by the heaviest matrix.

        :math:`m_u = \min_x x^T M x` over joint rates with :math:`u^T J x = 1`, at one end of the span by
        :math:`x^* = m_u M^{-1} J^T u`. Elsewhere in the span these rates are no longer the best, so

        .. math:: m_{u'}(q') \le \frac{x^{*T} M(q') x^*}{(u'^T J(q') x^*)^2}
            \le \Big(\frac{\sqrt{m_u} + a}{1 - |u' - u| |J x^*| - b}\Big)^2

        where :math:`\sqrt{x^T M x}` is a norm of the velocities of all masses that the rates x make, each
        of which changes by no more than its columns do: :math:`a^2 = T^2 \sum_b m_b (\sum_j |x_j| c_{bj})^2`,
        and :math:`b = T \sum_j |x_j| c_{pj}` (`seerob.kernels.spans.column_changes`; a body counts at its
        radius of gyration, as in `seerob.twin.spans.change_of_motion`; rotors turn with the rates
        alone). Of the heaviest direction, with :math:`|x_j| \le \sqrt{m\,(M^{-1})_{jj}}` by Cauchy and
        Schwarz,

        .. math:: m(q')^{-1/2} \ge \frac{m^{-1/2} - b'}{1 + a'}

        with :math:`\sqrt{(M^{-1})_{jj}}` for x in a and b. The velocity of the point is within ``bend`` of
        the line between those at both ends, which says how far its direction turns where it is faster than
        `STANDSTILL`; the direction toward somebody may be any.
        """
        limit, frame = self.limit, model.frame(self.at)
        robot = model.carrier(frame)
        tolerances = MassTolerances(model, robot)
        moves = self.toward is None and self.along == "motion"
        if limit is None or not robot.alone or (len(tolerances) and not moves):
            return None
        if any(body.holder for body in model.bodies):
            return None
        mj, coupling, own = model.mj, coupling_of(model, robot), robot.v_address[robot.own]
        offset = np.array(self.offset)
        local = frame.body_from_frame[:3, :3] @ offset + frame.body_from_frame[:3, 3]
        point = points.add(frame.mj, local)
        heavy = [int(b) for b in robot.mj_bodies if mj.body_mass[b] > 0]
        most = np.array([tolerances.heaviest(body) for body in heavy]).reshape(-1, 2)
        masses = mj.body_mass[heavy]
        radii = np.sqrt(mj.body_inertia[heavy].sum(axis=1) / 2 / masses) + most[:, 1]
        masses = most[:, 0] * masses
        rows = [points.add(b, mj.body_ipos[b], r) for b, r in zip(heavy, radii.tolist(), strict=True)]
        data = mujoco.MjData(mj)

        def velocity(q: Array, v: Array) -> Array:
            """Of the point where the joints are so [m/s], shape (3,)."""
            data.qpos[:], data.qvel[:] = q, v
            mujoco.mj_kinematics(mj, data)
            mujoco.mj_comPos(mj, data)
            J, at = np.empty((3, mj.nv)), data.xpos[frame.mj] + data.xmat[frame.mj].reshape(3, 3) @ local
            mujoco.mj_jac(mj, data, J, None, at, frame.mj)
            return J @ v

        def lowest(state: State, span: Span) -> float:
            J, M = state.jacobian(frame, robot, offset)[:3], state.mass_matrix(robot)
            changes = span.T * points.column_changes(point, span, coupling)
            noise = float((np.linalg.norm(J, axis=0) + changes) @ span.joint_noise[own])
            if not np.isfinite(changes).all():
                return -math.inf
            if moves and span.fast[point] + noise <= STANDSTILL:
                return math.inf
            of_masses = span.T * np.array([points.column_changes(row, span, coupling) for row in rows])
            inverse = np.linalg.inv(M)

            def grown(rates: Array) -> tuple[float, float]:
                """How much more the masses move by some rates, and the point less."""
                return math.sqrt(masses @ (of_masses @ rates) ** 2), float(changes @ rates)

            if moves:
                before, after = (velocity(*span.path.at(t)) for t in (span.begin, span.end))
                u, turned = _turned(before, after, float(span.bend[point]) + noise)
                pushed = inverse @ J.T @ u
                if len(tolerances):
                    M = tolerances.matrices(state, pushed).at((1,) * len(tolerances))
                if (along := float(u @ J @ pushed)) > 0:
                    x = pushed / along
                    more, less = grown(np.abs(x))
                    left = 1 - turned * float(np.linalg.norm(J @ x)) - less
                    if left > 0:
                        return limit - ((math.sqrt(float(x @ M @ x)) + more) / left) ** 2
                return -math.inf
            more, less = grown(np.sqrt(np.diagonal(inverse)))
            heaviest = float(principal_masses(inverse_effective_mass(J, M))[0][-1])
            left = 1 / math.sqrt(heaviest) - less
            return limit - ((1 + more) / left) ** 2 if left > 0 else -math.inf

        return lowest

    def _ends(
        self, tolerances: MassTolerances, state: State, frame: Frame, offset: Array, u: Array
    ) -> Spread:
        """Of the mass along u, or of the heaviest direction there is at each end."""
        J_v = state.jacobian(frame, tolerances.robot, offset)[:3]
        # Among rates with uᵀ J q̇ = 1 those of M⁻¹ Jᵀ u have the least energy, which is the effective mass.
        pushed = np.asarray(np.linalg.solve(state.mass_matrix(tolerances.robot), J_v.T @ u), float)
        matrices = tolerances.matrices(state, pushed)

        def at(shifts: Shifts) -> Array:
            inverse = inverse_effective_mass(J_v, matrices.at(shifts))
            heaviest = self.along == "worst" and self.toward is None
            return principal_masses(inverse)[0][-1] if heaviest else projected_mass(inverse, u)

        return spread(at, len(tolerances))

    @staticmethod
    def _simplified(model: Model, robot: Mechanism, tolerances: MassTolerances) -> Result:
        mass = simplified_mass(model, robot)
        interval = None
        if len(tolerances):
            ends = spread(lambda shifts: np.array(tolerances.simplified(mass, shifts)), len(tolerances))
            interval = float(ends.low), float(ends.high)
        return Result(name="M/2 + m_L", value=mass, unit="kg", interval=interval)

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


class _Masses:
    """Effective masses of points at one instant, of a tick's plan."""

    intervals = False
    _place: Callable[[Frame, Array], Array]

    def __init__(self, criteria: Sequence[EffectiveMass], model: Model) -> None:
        self._criteria = criteria
        frames = [model.frame(each.at) for each in criteria]
        self._points = tuple(
            Point(frame, model.carrier(frame), each.offset, weighed=True)
            for each, frame in zip(criteria, frames, strict=True)
        )
        self._offsets = [np.array(each.offset) for each in criteria]
        self._simplified = [
            EffectiveMass._simplified(model, robot, MassTolerances(model, robot))
            for _, robot, _, _ in self._points
        ]
        self._facing = [k for k, each in enumerate(criteria) if each.toward is not None]
        """Which face somebody."""
        gaps = [
            model.gap(self._points[k][1].moving, model.select(criteria[k].toward or "")) for k in self._facing
        ]
        self._asked = tuple((gap.query, Per.SETS) for gap in gaps)
        self._found: list[tuple[list[float], tuple[float, ...]]] = []
        """Of each the principal masses with their axes, and the direction."""

    def compute(self, state: State, rows: Rows) -> None:
        """Write the mass of every point; NaN where there is no direction, or it cannot be pushed that way."""
        self._place = state.drawn_points()
        facing, values, ways = self._facing, [0.0] * len(self._points), dict[int, Array]()
        if facing:
            found, at = state.nearest(self._asked)
            for k, row in zip(facing, at, strict=True):
                ways[k] = found.point_b[row] - found.point_a[row]
        moved, own = state.moving(self._points)
        self._found = []
        for k, row in enumerate(own):
            way, least = ways.get(k), TOUCHING
            if way is None:
                way, least = moved.velocity[row, :3], STANDSTILL
            x, y, z, values[k] = mass_along(moved.inverse[row], way, least)
            self._found.append((moved.masses[row], (x, y, z)))
        rows.value[:] = values

    def present(
        self, state: State, k: int, value: float, verdict: Verdict | None
    ) -> tuple[str, Draw, tuple[Result, ...]]:
        """Say and draw what `EffectiveMass.present` does of one that is decided."""
        masses, u = self._found[k]
        place = partial(self._place, self._points[k].frame, self._offsets[k])
        size = _half_axis(self._simplified[k])
        draw = partial(_drawn, self._criteria[k], place, size, masses[:3], masses[3:], u, value, verdict)
        return "", draw, (*_principal(masses), self._simplified[k])


def _half_axis(simplified: Result) -> float:
    """Drawn for 1 kg [m]."""
    return max(DRAWN, LEAST_DRAWN / simplified.value) if simplified.value else DRAWN


def _drawn(
    of: EffectiveMass,
    place: Callable[[], Array],
    size: float,
    masses: Array | Sequence[float],
    wxyz: Sequence[float],
    u: Sequence[float],
    mass: float | None,
    verdict: Verdict | None,
    interval: tuple[float, ...] | None = None,
) -> tuple[Marker, ...]:
    center = tuple(place().tolist())
    ellipsoid = Ellipsoid(
        center=center,
        wxyz=(wxyz[0], wxyz[1], wxyz[2], wxyz[3]),
        radii=tuple(np.minimum(size * np.asarray(masses), LARGEST_DRAWN).tolist()),
        verdict=verdict,
    )
    if mass is None:
        return (ellipsoid,)
    x, y, z = (min(size * mass, LARGEST_DRAWN) * each for each in u)
    label = figures.worded(mass, of.limit, of.unit, at_most=True)
    label += "" if interval is None else f" (≤ {figures.rounded_up(interval[1], of.unit)})"
    return ellipsoid, Arrow(origin=center, vector=(x, y, z), label=label, verdict=verdict)
