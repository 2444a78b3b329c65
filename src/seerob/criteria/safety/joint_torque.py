r"""Joint torques against their limits, and what of them the model does not explain.

.. math:: |\tau_j| \le s\,\tau_{j,max},\qquad r = \tau - (M \ddot q + c + g)

The residual r is friction, contact, a payload that the file does not have, or an error of the masses.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal, cast

import numpy as np
from msgspec import Meta

from seerob.core.domains import agree, at_least
from seerob.core.errors import InputError, Undecided
from seerob.core.snapshot import Basis, Input, Origin, Result
from seerob.core.transforms import Array
from seerob.core.verdict import Verdict, worst
from seerob.criteria.criterion import Criterion, Lowest
from seerob.criteria.figure import Compute, Figure, Parts, Present, Shown, Twin
from seerob.model import provenance
from seerob.model.model import Mechanism, Model
from seerob.twin import joint_torques
from seerob.twin.accuracy.mass_tolerances import loose_torques
from seerob.twin.spans import Points, Span
from seerob.twin.state import State

PerJoint = tuple[Annotated[float, Meta(ge=0)], ...]


def shares(torques: Array, limits: Array, uncertainty: Array) -> tuple[Array, Array, Array]:
    """Share of its limit that each joint holds, and the ends of the interval where the true share is.

    Args:
        torques: τ [N·m or N], shape (..., n).
        limits: τ_max, NaN where nobody knows, shape (n,).
        uncertainty: How far each torque may be off, shape (n,).

    Returns:
        Share, lowest, highest, NaN without a limit, shape (..., n) each.
    """
    limits, uncertainty = at_least("limits", limits), at_least("uncertainty", uncertainty)
    agree(n=(torques.shape[-1], *limits.shape, *uncertainty.shape))
    size = np.abs(torques)
    low = np.maximum(size - uncertainty, 0.0)
    return size / limits, low / limits, (size + uncertainty) / limits


class JointTorque(Criterion, frozen=True, kw_only=True):
    """Joint torques of a robot against their limits, as its source measures them or as a model needs them."""

    by_shape: ClassVar[bool] = False
    by_torque: ClassVar[bool] = True
    unit: ClassVar[str] = ""

    robot: str
    """The robot that is judged."""
    torques: Literal["measured", "model"] = "measured"
    """What the source measures; or what the model needs for the motion, when the source measures nothing."""
    limit: Annotated[float, Meta(gt=0, le=1)] = 1.0
    """Largest admissible share of each joint's limit."""
    limits: tuple[Annotated[float, Meta(gt=0)], ...] | None = None
    """Limit of each joint [N·m or N]; those of the robot (maker's, or ``torque_limits``) when not given."""
    torque_uncertainty: PerJoint | None = None
    """How far each torque may be off [N·m or N]; gives the interval. Without it nothing that the model needs
    is within: friction and rotors are not in it."""
    largest_residual: PerJoint | None = None
    """Largest difference between a measured torque and what the model needs that the model still explains,
    per joint [N·m or N]; beyond it, what is within is undecided."""

    def subjects(self) -> tuple[str, ...]:
        """The robot."""
        return (self.robot,)

    def remembers(self, model: Model) -> bool:
        """Say whether it rests on accelerations, which are differences of speeds from tick to tick."""
        return self.torques == "model" or self.largest_residual is not None

    def looks_ahead(self, model: Model) -> Mapping[str, float]:
        """Look ahead to the next tick [s], for an acceleration where there was no tick before."""
        return {self.robot: model.workstation.engine.tick}

    def compute(self, model: Model) -> Compute:
        """Look up every name in the model once and return the function that computes the shares."""
        robot = model.robot(self.robot)
        limits = self._limits(model, robot)
        given = self._per_joint(model, robot, "torque_uncertainty")
        uncertainty = np.zeros(len(limits)) if given is None else given
        largest = self._per_joint(model, robot, "largest_residual")
        names, admitted = [joint.name for joint in robot.joints], self.limit * limits
        units = ["N·m" if unit == "rad" else "N" for unit in robot.units]
        if self.torques == "model" or largest is not None:
            robot.require_masses(self.name)
        needed = joint_torques.Needed(robot, model.workstation.engine.tick)
        unlimited, all_unlimited = bool(np.isnan(limits).any()), bool(np.isnan(limits).all())
        # Friction and rotors are not in the model.
        inexact = bool(self._loose(model, robot)) or (self.torques == "model" and given is None)

        def compute(twin: Twin) -> Figure:
            state, why = cast("State", twin), ""
            model_torques: Array | None = None
            try:
                model_torques = needed(state)
            except Undecided as reason:
                if self.torques == "model":
                    raise
                why = str(reason)
            tau = state.measured_torques(robot) if self.torques == "measured" else model_torques
            assert tau is not None
            residual = None if self.torques == "model" or model_torques is None else tau - model_torques
            unexplained = largest is not None and (
                residual is None or bool((np.abs(residual) > largest).any())
            )
            size = np.abs(tau)
            interval = None if given is None else (np.maximum(size - given, 0.0), size + given)
            parts = Parts(names, size, admitted, interval, units=units, whole=False)
            share, low, high = shares(tau, limits, uncertainty)
            beside = share, residual, why
            if all_unlimited:
                return Figure(None, self.limit, parts=parts, beside=beside)
            ends = None if given is None else (float(np.nanmax(low)), float(np.nanmax(high)))
            open_ = unlimited or inexact or unexplained
            return Figure(np.nanmax(share), self.limit, ends, open=open_, parts=parts, beside=beside)

        return compute

    def present(self, model: Model) -> Present:
        """Return the function that says which joint decides, and what of its torque is not explained."""
        robot = model.robot(self.robot)
        names, limits = [joint.name for joint in robot.joints], self._limits(model, robot)
        units = ["N·m" if unit == "rad" else "N" for unit in robot.units]
        largest = self._per_joint(model, robot, "largest_residual")
        where = ["nobody gave its limit" if unknown else "" for unknown in np.isnan(limits).tolist()]
        ever = [f"{name}: {reason}" for name, reason in zip(names, where, strict=True) if reason]
        loose = self._loose(model, robot)

        def present(state: State, figure: Figure, verdict: Verdict | None) -> Shown:
            (share, residual, why), reasons, parts = figure.beside, list(ever), figure.parts
            assert parts is not None
            decided = worst(list(parts.verdicts))
            if decided is not Verdict.UNDECIDED and figure.value is not None:
                reasons.append(names[int(np.nanargmax(share))])
            if loose and decided is Verdict.WITHIN:
                reasons.insert(0, loose)
            if self.torques == "model" and self.torque_uncertainty is None and decided is Verdict.WITHIN:
                reasons.insert(0, "friction and rotors are not in the model: give torque_uncertainty")
            if residual is None:
                reasons[:0] = [why] * (largest is not None)
                return Shown("; ".join(reasons), where=where)
            if largest is not None and (np.abs(residual) > largest).any():
                j = int(np.argmax(np.abs(residual) - largest))
                what = f"{residual[j]:.3g} {units[j]} at {names[j]} are not explained by the model"
                reasons.insert(0, what)
            unexplained = (
                Result(name=f"residual of {name}", value=r, unit=unit)
                for name, r, unit in zip(names, residual.tolist(), units, strict=True)
            )
            return Shown("; ".join(reasons), parts=tuple(unexplained), where=where)

        return present

    def bounded_once(self, model: Model) -> bool:
        """Say that torques that a model needs are looked at at ticks alone."""
        return self.remembers(model)

    def lowest(self, model: Model, points: Points) -> Lowest | None:
        r"""Least margin in a span of torques that are measured: they lie on straight lines between samples.

        Of those that a model needs from how :math:`\tau = M \ddot q + b` can change within the span, T long.
        With :math:`c_{bj}` the largest rates of columns of the Jacobian of mass b at its radius of gyration
        (`seerob.kernels.spans.column_changes`), :math:`a_b` its largest acceleration at constant speeds of
        the joints, by up to :math:`a'_b` another one, and :math:`D_j^2 = T^2 \sum_b m_b c_{bj}^2`,

        .. math::
            |\Delta M_{jk}| &\le D_j \sqrt{M_{kk}} + \sqrt{M_{jj}} D_k + D_j D_k, \\
            |\Delta b_j| &\le T \sum_b m_b c_{bj} (a_b + g) + \sqrt{M_{jj} \sum_{b \ni j} m_b a_b'^2}

        as M is the Gram matrix of the columns, and b the product of columns with the accelerations less
        gravity, both over all masses (Cauchy and Schwarz); rotors change nothing. With M and b of the end
        that is known, :math:`M \ddot q + b` is largest at a knot of the accelerations. A residual is at most
        the largest difference between a measured torque of the span and one at a knot, and that.

        None of torques of a model where others move the robot, or it picks something up.
        """
        robot = model.robot(self.robot)
        limits, given = self._limits(model, robot), self._per_joint(model, robot, "torque_uncertainty")
        uncertainty = np.zeros(len(limits)) if given is None else given
        largest = self._per_joint(model, robot, "largest_residual")

        def measured(state: State, span: Span) -> Array:
            return state.torques_within(robot, span.begin, span.end)

        def least(torques: Array) -> float:
            _, _, high = shares(torques, limits, uncertainty)
            return self.limit - float(high.max())

        if not self.remembers(model):
            return lambda state, span: least(measured(state, span))
        if not robot.alone or any(body.holder for body in model.bodies):
            return None
        needed = joint_torques.bind_needed_in_span(model, robot, points)

        def lowest(state: State, span: Span) -> float:
            torques, off = needed(state, span)
            if self.torques == "model":
                return least(np.abs(torques).max(axis=0) + off)
            tau = measured(state, span)
            assert largest is not None
            residual = np.abs(tau[:, None] - torques).max(axis=(0, 1)) + off
            return least(tau) if (residual <= largest).all() else -math.inf

        return lowest

    def _loose(self, model: Model, robot: Mechanism) -> str:
        """Why what the model needs may be another torque, where that is asked; empty where it may not."""
        asked = self.torques == "model" or self.largest_residual is not None
        return loose_torques(model, robot) if asked else ""

    def _limits(self, model: Model, robot: Mechanism) -> Array:
        """Of every joint [N·m or N], NaN where nobody knows, shape (n,)."""
        if self.limits is not None:
            given = self._per_joint(model, robot, "limits")
            assert given is not None
            return given
        return np.array([np.nan if q is None else q.value for q in robot.effort_limits])

    def _per_joint(self, model: Model, robot: Mechanism, key: str) -> Array | None:
        """An option with one value for each joint, shape (n,); None when it is not given.

        Raises:
            InputError: It has another number of values.
        """
        given: tuple[float, ...] | None = getattr(self, key)
        if given is None:
            return None
        names = [joint.name for joint in robot.joints]
        if len(given) != len(names) or not np.isfinite(given).all():
            file = next(iter(model.workstation.files), "workstation")
            remedy = f"give one value in N·m or N for each of {', '.join(names)}"
            raise InputError.at(file, key, f"{list(given)} does not fit", remedy)
        return np.array(given, float)

    def basis(self, model: Model) -> Basis:
        """State the formula, its source, the inputs with their origin, and what is not modelled."""
        robot = model.robot(self.robot)
        source = next((s for s in model.workstation.sources if s.target() == robot.name), None)
        measured = getattr(source, "origin", None) == "controller"
        unknown = Origin.MISSING if source is None else Origin.GIVEN
        heard = Input(
            name=f"joint torques of {robot.name}",
            origin=Origin.MEASURED if measured else unknown,
            source="" if source is None else source.name,
        )
        bounds = [
            provenance.given(f"limit of {joint.name}", value, "N·m or N")
            for joint, value in zip(robot.joints, self.limits or (), strict=False)
        ] or [
            Input(
                name=f"limit of {joint.name}",
                value=None if q is None else q.value,
                unit="N·m or N",
                origin=Origin.MISSING if q is None else q.origin,
                source="" if q is None else q.source,
            )
            for joint, q in zip(robot.joints, robot.effort_limits, strict=True)
        ]
        return Basis(
            formula="largest |τ_j| / τ_j,max" + ("" if self.torques == "measured" else ", τ = M q̈ + c + g"),
            source="equation of motion of the robot; limits as the inputs say",
            inputs=(
                *provenance.motion(model, robot.name),
                *((heard,) if self.torques == "measured" else provenance.masses(model, robot)),
                *bounds,
                *provenance.limit(self.limit, ""),
            ),
            not_modelled=(
                *(
                    ("friction in joints and gears: motors give more than that",)
                    if self.torques == "model"
                    else ()
                ),
                *(
                    ()
                    if robot.rotor_inertia_known
                    else ("rotor inertia: torques that accelerate rotors are in the residual",)
                ),
                "limits that depend on speed or temperature",
                *(() if self.torque_uncertainty else ("uncertainty of the torques: nobody gave it",)),
            ),
        )
