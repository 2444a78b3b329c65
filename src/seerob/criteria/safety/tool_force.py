r"""Force at the tool from measured joint torques, [Weistroffer2022]_ Eq. 6.

.. math:: \tau_{ext} = J_v^T F,\qquad \tau_{ext} = \tau - (M \ddot q + c + g)

F is the force that the robot exerts on its surroundings.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal, NamedTuple, cast

import numpy as np
from msgspec import Meta

from seerob.core import figures
from seerob.core.domains import agree, at_least, number
from seerob.core.errors import InputError, Undecided
from seerob.core.quantities import Metres3
from seerob.core.snapshot import Arrow, Basis, Input, Marker, Origin, Result, Sphere
from seerob.core.transforms import Array
from seerob.core.verdict import Verdict, judge_interval
from seerob.criteria.criterion import Criterion, Lowest
from seerob.criteria.figure import Compute, Figure, Present, Shown, Twin
from seerob.model import provenance
from seerob.model.model import Mechanism, Model
from seerob.twin import joint_torques
from seerob.twin.accuracy.mass_tolerances import loose_torques
from seerob.twin.spans import Points, Span, coupling_of
from seerob.twin.state import State

DRAWN = 0.002
"""Arrow drawn for 1 N [m]."""
LARGEST_DRAWN = 1.0
NOTHING = 1e-9
"""Share of a force that may be hidden without a word."""


class Wrench(NamedTuple):
    """What force explains torques best."""

    wrench: Array
    """Force, and moment if there was one to find, shape (..., 3) or (..., 6) [N, N·m]."""
    residual: Array
    """Torques that it does not explain, shape (..., n) [N·m or N]."""
    gain: Array
    """Damped pseudo-inverse: wrench = gain @ torques, shape (..., 3 or 6, n)."""
    hidden: Array
    """Share of a unit force that the torques do not show, along each axis in order of visibility,
    0 (fully seen) … 1 (not at all), shape (..., 3 or 6)."""
    axes: Array
    """The axes as columns, best seen first, shape (..., 3 or 6, 3 or 6)."""


class _Found(NamedTuple):
    """What a force follows from."""

    wrench: Wrench
    residual: float
    """Norm of the torques that it does not explain [N·m]."""
    torques: float
    """Norm of all external torques [N·m]."""
    hidden: Array
    """Share of a unit force that the torques do not show, along the axes of ``wrench``."""
    error: float | None
    """How far the force may be off by the uncertainty of the torques [N]."""


LARGEST = 1e3
"""No arm moves its point so fast for the speed of a joint [m/rad]."""


def wrench_from_torques(J: Array, tau: Array, *, damped_below: float) -> Wrench:
    r"""Solve :math:`\tau = J^T w` by singular values, damped only near singularities.

    With :math:`J = \sum_i \sigma_i u_i v_i^T`, the estimate is
    :math:`w = \sum_i u_i \frac{\sigma_i}{\sigma_i^2 + \lambda_i^2} v_i^T \tau` where
    :math:`\lambda_i^2 = \varepsilon^2 - \sigma_i^2` below :math:`\varepsilon`, else 0: least squares far from
    singularities, and never more than :math:`|\tau| / \varepsilon` along an axis near them [Nakamura1986]_,
    [Maciejewski1988]_.

    Args:
        J: Jacobian of the point, linear rows first: those alone (..., 3, n) for a contact without moment,
            else all (..., 6, n).
        tau: External joint torques, shape (..., n) [N·m or N].
        damped_below: ε, singular value below which an axis is damped [m/rad].
    """
    J, tau = number("J", J), np.asarray(tau, float)
    number("damped_below", damped_below, 0.0, LARGEST, "m/rad")
    rows, n = J.shape[-2:]
    agree(n=(n, tau.shape[-1]))
    axes, sigma, Vt = np.linalg.svd(J, full_matrices=True)
    sigma = np.concatenate([sigma, np.zeros((*sigma.shape[:-1], rows - sigma.shape[-1]))], axis=-1)
    squares = np.maximum(sigma**2, damped_below**2)
    k = min(rows, n)
    gain = (axes[..., :k] * (sigma / squares)[..., None, :k]) @ Vt[..., :k, :]
    wrench = np.einsum("...ij,...j->...i", gain, tau)
    residual = tau - np.einsum("...ij,...i->...j", J, wrench)
    return Wrench(wrench, residual, gain, 1.0 - sigma**2 / squares, axes)


def largest_error(gain: Array, uncertainty: Array) -> Array:
    r"""Bound on the error of a force when each torque is known to ± ``uncertainty``.

    :math:`|\delta F| \le \sum_j |K_j| \delta_j`, K_j the columns of the gain's force rows.

    Args:
        gain: From `wrench_from_torques`, shape (..., 3 or 6, n).
        uncertainty: δ, shape (n,) [N·m or N].

    Returns:
        Shape (...) [N].
    """
    uncertainty = at_least("uncertainty", uncertainty, unit="N·m or N")
    return np.asarray(np.linalg.norm(gain[..., :3, :], axis=-2) @ uncertainty)


def pseudo_inverse_change(least: float, change: float) -> float:
    r"""Bound on the change of a pseudo-inverse by a change E of a matrix A of full column rank, in 2-norms.

    With :math:`B = A + E` of full column rank too, and P, :math:`P_\perp` the projectors on the range of A
    and off it, :math:`A^+ = A^+ P`, :math:`B^+ B = 1`, so that

    .. math:: B^+ - A^+ = -B^+ E A^+ P + B^+ P_\perp .

    With Q on the range of B, of the same dimension, :math:`\|Q P_\perp\| = \|Q_\perp P\|`, which is
    :math:`\|Q_\perp A A^+\| = \|Q_\perp E A^+\| \le \|E\| \|A^+\|`. So both terms are at most
    :math:`g = \|A^+\| \|B^+\| \|E\|`, of parts of a vector that are at right angles:
    :math:`\|B^+ - A^+\| \le \sqrt 2\, g`, as Wedin 1973 has it.

    Args:
        least: Least singular value of A.
        change: Bound on the norm of E; infinity comes out where it is not less than ``least``.
    """
    number("least", least, 0.0)
    number("change", change, 0.0)
    if not least > change:
        return math.inf
    return math.sqrt(2) * change / (least * (least - change))


class ToolForce(Criterion, frozen=True, kw_only=True):
    """Force that the robot exerts at its tool, from the joint torques that its source measures."""

    by_torque: ClassVar[bool] = True
    unit: ClassVar[str] = "N"
    by_shape: ClassVar[bool] = False

    at: str
    """Point of contact: a robot (its tool's working point) or the full name of a link."""
    offset: Metres3 = (0.0, 0.0, 0.0)
    """The point in that frame [m]."""
    limit: Annotated[float, Meta(gt=0, extra={"unit": "N"})] | None = None
    """Largest admissible force [N]."""
    torques: Literal["measured", "external"] = "measured"
    """What the source sends: the torques of the motors, or the part of them that contacts cause, as some
    controllers estimate it."""
    contact: Literal["zero_moment", "free_moment"] = "zero_moment"
    """Whether the contact is a point, or also bears a moment, which is then found too."""
    damped_below: Annotated[float, Meta(gt=0, extra={"unit": "m/rad"})] = 0.02
    """Singular value of the Jacobian below which a direction is damped [m/rad]."""
    torque_uncertainty: tuple[Annotated[float, Meta(ge=0)], ...] | None = None
    """How far each torque may be off, friction included [N·m or N]; gives the interval of the force."""
    largest_residual: Annotated[float, Meta(gt=0, extra={"unit": "N·m"})] | None = None
    """Norm of the torques that no force at this point explains, above which the contact is elsewhere and
    the force undecided [N·m]."""

    def subjects(self) -> tuple[str, ...]:
        """The point."""
        return (self.at,)

    def remembers(self, model: Model) -> bool:
        """Say whether it rests on accelerations, which are differences of speeds from tick to tick."""
        return self.torques == "measured"

    def looks_ahead(self, model: Model) -> Mapping[str, float]:
        """Look ahead to the next tick [s], for an acceleration where there was no tick before."""
        if self.torques == "external":
            return {}
        return {model.carrier(model.frame(self.at)).name: model.workstation.engine.tick}

    def compute(self, model: Model) -> Compute:
        """Look up every name in the model once and return the function that computes the force."""
        frame = model.frame(self.at)
        robot = model.carrier(frame)
        if self.torques == "measured":
            robot.require_masses(self.name)
        offset = np.array(self.offset)
        uncertainty = self._uncertainty(model, robot)
        rows = 3 if self.contact == "zero_moment" else 6
        needed = joint_torques.Needed(robot, model.workstation.engine.tick)
        loose = self._loose(model)

        def external(state: State) -> Array:
            try:
                tau = state.measured_torques(robot)
            except Undecided:
                needed.forget()
                raise
            return tau if self.torques == "external" else tau - needed(state)

        def compute(twin: Twin) -> Figure:
            state = cast("State", twin)
            tau = external(state)
            J = state.jacobian(frame, robot, offset)[:rows]
            wrench = wrench_from_torques(J, tau, damped_below=self.damped_below)
            return self._figure(wrench, tau, uncertainty, open_=bool(loose))

        return compute

    def _loose(self, model: Model) -> str:
        """Why what the model needs, which is taken off, may be another torque; empty where it may not."""
        if self.torques == "external":
            return ""
        return loose_torques(model, model.carrier(model.frame(self.at)))

    def _figure(self, found: Wrench, tau: Array, uncertainty: Array | None, *, open_: bool = False) -> Figure:
        size, residual = _length(found.wrench[:3]), _length(found.residual)
        error = None if uncertainty is None else float(largest_error(found.gain, uncertainty))
        interval = None if error is None else (max(size - error, 0.0), size + error)
        hidden = found.hidden * np.linalg.norm(found.axes[:3], axis=0)
        if hidden.max() > NOTHING:
            # What is seen of a force may exceed a limit; what is not seen cannot be within one.
            interval = (size if interval is None else interval[0]), math.inf
        if self.largest_residual is not None and residual > self.largest_residual:
            # Where torques fit no force at this point, it may be any.
            interval = 0.0, math.inf
        beside = _Found(found, residual, _length(tau), hidden, error)
        return Figure(size, self.limit, interval, open=open_, beside=beside)

    def present(self, model: Model) -> Present:
        """Return the function that says what is not known of the force, and draws it."""
        frame, offset, loose = model.frame(self.at), np.array(self.offset), self._loose(model)

        def present(state: State, figure: Figure, verdict: Verdict | None) -> Shown:
            told: _Found = figure.beside
            force, size, moment = told.wrench.wrench[:3], figure.number, told.wrench.wrench[3:]
            place = state.drawn_point(frame, offset)

            def draw() -> tuple[Marker, ...]:
                return self._markers(force, size, place(), verdict)

            parts = [
                Result(name=f"F{axis}", value=f, unit="N")
                for axis, f in zip("xyz", force.tolist(), strict=True)
            ]
            if len(moment):
                parts.append(Result(name="moment", value=_length(moment), unit="N·m"))
            share = told.residual / told.torques if told.torques > 0 else 0.0
            parts.append(Result(name="residual", value=told.residual, unit="N·m"))
            parts.append(Result(name="residual share", value=share, unit=""))
            reason = self._reason(told, size)
            if loose and verdict is Verdict.UNDECIDED:
                reason = "; ".join(filter(None, (loose, reason)))
            return Shown(reason, draw, tuple(parts))

        return present

    def _reason(self, told: _Found, size: float) -> str:
        reasons, hidden, error = [], told.hidden, told.error
        if error is not None:
            ends = max(size - error, 0.0), size + error
            if judge_interval(ends, self.limit) is Verdict.UNDECIDED:
                reasons.append(f"the torques' uncertainty is ± {error:.3g} N, across the limit")
        if hidden.max() > NOTHING:
            k = int(hidden.argmax())
            share, unseen = told.wrench.hidden[k], told.wrench.axes[:3, k]
            reasons.append(
                f"singular: {share:.0%} of a force along ±{_vector(unseen)} does not show in the torques"
            )
        if self.largest_residual is not None and told.residual > self.largest_residual:
            reasons.append(f"{told.residual:.3g} N·m fit no force at this point: the contact is elsewhere")
        return "; ".join(reasons)

    def lowest(self, model: Model, points: Points) -> Lowest | None:
        r"""Least margin in a span of a force without moment, from external torques that are measured.

        Torques lie on straight lines between samples, and with a Jacobian that stays above where it is damped
        its pseudo-inverse changes by at most `pseudo_inverse_change`.
        """
        limit = self.limit
        if limit is None or self.torques != "external" or self.contact != "zero_moment":
            return None
        if self.largest_residual is not None:
            return None
        frame = model.frame(self.at)
        robot, offset = model.carrier(frame), np.array(self.offset)
        given = self._uncertainty(model, robot)
        uncertainty = np.zeros(len(robot.joints)) if given is None else given
        point = points.add(frame.mj, frame.body_from_frame[:3, :3] @ offset + frame.body_from_frame[:3, 3])
        coupling = coupling_of(model, robot)

        def lowest(state: State, span: Span) -> float:
            J = state.jacobian(frame, robot, offset)[:3]
            least = float(np.linalg.svd(J, compute_uv=False)[-1]) if J.shape[1] >= 3 else 0.0
            change = float(np.linalg.norm(points.column_changes(point, span, coupling))) * span.T
            if not least - change > self.damped_below:
                return -math.inf
            tau = state.torques_within(robot, span.begin, span.end)
            found = wrench_from_torques(J, tau, damped_below=self.damped_below)
            forces = np.linalg.norm(found.wrench, axis=1) + largest_error(found.gain, uncertainty)
            more = pseudo_inverse_change(least, change)
            errors = np.linalg.norm(tau, axis=1) + float(uncertainty.sum())
            return limit - float((forces + more * errors).max())

        return lowest

    def _markers(self, force: Array, size: float, at: Array, verdict: Verdict | None) -> tuple[Marker, ...]:
        center = tuple(at.tolist())
        drawn = DRAWN * force * min(1.0, LARGEST_DRAWN / max(DRAWN * size, 1e-12))
        shown = figures.worded(size, self.limit, self.unit, at_most=True)
        arrow = Arrow(origin=center, vector=tuple(drawn.tolist()), label=shown, verdict=verdict)
        if self.limit is None:
            return (arrow,)
        radius = min(DRAWN * self.limit, LARGEST_DRAWN)
        return (arrow, Sphere(center=center, radius=radius, label=f"limit {self.limit:g} N"))

    def _uncertainty(self, model: Model, robot: Mechanism) -> Array | None:
        if self.torque_uncertainty is None:
            return None
        values = np.array(self.torque_uncertainty, float)
        names = [joint.name for joint in robot.joints]
        if len(values) != len(names) or not np.isfinite(values).all():
            raise InputError.at(
                next(iter(model.workstation.files), "workstation"),
                "torque_uncertainty",
                f"{list(self.torque_uncertainty)} does not fit",
                f"give one value of 0 or more in N·m or N for each of {', '.join(names)}",
            )
        return values

    def basis(self, model: Model) -> Basis:
        """State the formula, its source, the inputs with their origin, and what is not modelled."""
        robot = model.carrier(model.frame(self.at))
        source = next((s for s in model.workstation.sources if s.target() == robot.name), None)
        measured = getattr(source, "origin", None) == "controller"
        unknown = Origin.MISSING if source is None else Origin.GIVEN
        left = "τ_ext = τ" if self.torques == "external" else "τ_ext = τ − (M q̈ + c + g)"
        way = "τ_ext = J_vᵀ F" if self.contact == "zero_moment" else "τ_ext = J_vᵀ F + J_ωᵀ m"
        return Basis(
            formula=f"F from {way}, {left}; least squares by SVD, damped below {self.damped_below:g} m/rad",
            source="Weistroffer et al. 2022, Eq. 6; damping: Nakamura and Hanafusa 1986",
            inputs=(
                *provenance.motion(model, robot.name),
                Input(
                    name=f"joint torques of {robot.name}",
                    origin=Origin.MEASURED if measured else unknown,
                    source="" if source is None else source.name,
                ),
                *(provenance.masses(model, robot) if self.torques == "measured" else ()),
                *(
                    provenance.given(f"uncertainty of the torque of {joint.name}", value, "N·m or N")
                    for joint, value in zip(robot.joints, self.torque_uncertainty or (), strict=False)
                ),
                *provenance.limit(self.limit, "N"),
            ),
            not_modelled=(
                "contacts at any other point: they show as residual, or as a wrong force",
                *(
                    ("friction in joints and gears: it counts as force unless the source has taken it out",)
                    if self.torques == "measured"
                    else ()
                ),
                *(
                    ()
                    if robot.rotor_inertia_known or self.torques == "external"
                    else ("rotor inertia: torques that accelerate rotors count as force",)
                ),
                *(() if self.torque_uncertainty else ("uncertainty of the torques: nobody gave it",)),
            ),
        )


def _length(u: Array) -> float:
    return float(np.linalg.norm(u))


def _vector(u: Array) -> str:
    return "(" + ", ".join(f"{0.0 if abs(x) < 5e-3 else x:.2f}" for x in u[:3]) + ")"
