r"""Forces that torque limits allow at a point, [Weistroffer2022]_ section 2.2.2.4, [Chiacchio1997]_.

The sets themselves are in `seerob.criteria.polytope`.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, ClassVar, Literal, cast

import mujoco
import numpy as np
from msgspec import Meta
from msgspec.structs import replace

from seerob.core import figures
from seerob.core.errors import InputError, Undecided
from seerob.core.quantities import Metres3
from seerob.core.snapshot import Arrow, Basis, Hull, Input, Marker, Origin, Result, Sphere
from seerob.core.transforms import Array
from seerob.core.verdict import Verdict
from seerob.criteria.criterion import Criterion
from seerob.criteria.figure import Compute, Figure, Present, Shown, Twin
from seerob.criteria.polytope import Polytope, free_moment, torque_box, zero_moment
from seerob.description.norms import body_limits
from seerob.description.norms.limit_inputs import force_inputs, pushed_region
from seerob.kernels.contact_forces import drawn_corners
from seerob.kernels.polytope import largest
from seerob.model import provenance
from seerob.model.model import Mechanism, Model
from seerob.twin import joint_torques
from seerob.twin.accuracy.mass_tolerances import loose_torques
from seerob.twin.spans import ROUNDING, UNBOUNDED, Fall, Falls, Points, Span, coupling_of, down_to
from seerob.twin.state import State
from seerob.twin.states import States

DRAWN = 0.001
"""Length drawn for 1 N [m]."""
LARGEST_DRAWN = 2.0
"""Corners farther than this are drawn here [m]."""

FORMULA = {
    "zero_moment": "{f : τ_min ≤ J_vᵀ f + b ≤ τ_max}: a point contact, without moment",
    "free_moment": "{f : some m with τ_min ≤ J_vᵀ f + J_ωᵀ m + b ≤ τ_max}: a contact that bears a moment",
    "torque_box": "{(J_vᵀ)⁺ (τ − b) : τ_min ≤ τ ≤ τ_max}: image of the 2ⁿ extreme torques",
}
LOAD = {
    "gravity": "b = g(q): gravity, tools and workpieces included",
    "motion": "b = c(q, q̇) + g(q): gravity and the velocity products",
    "none": "b = 0: gravity is balanced by something else",
}


class ForcePolytope(Criterion, frozen=True, kw_only=True):
    """Largest force that the robot's torque limits allow at a point, in any direction."""

    unit: ClassVar[str] = "N"
    by_shape: ClassVar[bool] = False

    at: str
    """Point: a robot (its tool's working point) or the full name of a link."""
    offset: Metres3 = (0.0, 0.0, 0.0)
    """The point in that frame [m]."""
    limit: Annotated[float, Meta(gt=0, extra={"unit": "N"})] | None = None
    """Largest admissible force [N]: the radius of the sphere that the polytope is compared with."""
    body_region: str | None = None
    """Instead of a limit: a body region, whose quasi-static limit F_s is the radius of the sphere."""
    limits: str | None = None
    """File with other limits of body regions, of the form of the one that ships."""
    definition: Literal["zero_moment", "free_moment", "torque_box"] = "zero_moment"
    """Which set: forces at a point contact, forces of a contact that also bears a moment, or the image of
    all extreme torques under the pseudo-inverse. Each of the last two contains the first."""
    load: Literal["gravity", "motion", "none"] = "gravity"
    """What the torques must hold beside the force."""
    torque_limits: tuple[tuple[float, float], ...] | None = None
    """Least and largest torque of each joint [N·m or N] instead of the robot's own limits."""

    def __post_init__(self) -> None:
        if self.limit is not None and self.body_region is not None:
            raise ValueError("give either limit or body_region")
        if self.limits is not None and self.body_region is None:
            raise ValueError("limits are of a body_region: name one")

    def subjects(self) -> tuple[str, ...]:
        """The point."""
        return (self.at,)

    def _table(self, model: Model) -> body_limits.BodyLimits:
        own = self.limits
        return body_limits.shipped() if own is None else body_limits.read(Path(model.folder, own))

    def _against(self, model: Model) -> ForcePolytope:
        """Return this criterion with the limit of its body region as ``limit``."""
        if self.body_region is None:
            return self
        force = pushed_region(self._table(model), self.body_region).force
        return replace(self, limit=force.value, body_region=None, limits=None)

    def compute(self, model: Model) -> Compute:
        """Look up every name in the model once and return the function that computes the largest force."""
        frame, limit = model.frame(self.at), self._against(model).limit
        robot = model.carrier(frame)
        if self.load != "none":
            robot.require_masses(self.name)
        offset = np.array(self.offset)
        lower, upper, unknown = self._torques(model, robot)
        loose = bool(self._loose(model))

        def compute(twin: Twin) -> Figure:
            twin.require(robot.name)
            if unknown:
                raise Undecided(unknown)
            held, J = self._held(twin, robot), twin.jacobian(frame, robot, offset)
            if twin.many:
                # Without the surface, which only one instant draws. Empty is nan, and undecided.
                left = (np.broadcast_to(side - held, (len(J), len(lower))).copy() for side in (lower, upper))
                norm, _, _ = largest(np.ascontiguousarray(J[:, :3]), *left)
                return Figure(norm, limit, open=loose)
            polytope = self._polytope(J, lower - held, upper - held)
            if polytope.empty:
                raise Undecided(
                    f"{robot.name}: the torque limits cannot hold it in this pose, with any force"
                )
            # Unbounded is infinite: no force is too large for the structure then, so it exceeds any limit.
            return Figure(polytope.largest, limit, open=loose, beside=polytope)

        return compute

    def one_by_one(self, model: Model) -> str:
        """Say so unless it is ``zero_moment``, whose corners are found without a hull."""
        if self.definition != "zero_moment" or self.load == "motion":
            return "only zero_moment without velocity products is made for batches"
        return ""

    def present(self, model: Model) -> Present:
        """Return the function that names the direction of the largest force, and draws the polytope."""
        frame, offset, limit = model.frame(self.at), np.array(self.offset), self._against(model).limit
        loose = self._loose(model)

        def present(state: State, figure: Figure, verdict: Verdict | None) -> Shown:
            polytope: Polytope = figure.beside
            rotation, position = state.pose(frame)
            at, unbounded, farthest = (
                position + rotation @ offset,
                polytope.free.shape[1] > 0,
                polytope.farthest,
            )
            across = math.sqrt(float(farthest @ farthest))
            if unbounded:
                direction = polytope.free[:, 0]
                along = f"along ±{_vector(direction)}, only the structure does"
                reason = f"singular: no torque limits the force {along}"
            else:
                direction = farthest / across if across > 0 else np.zeros(3)
                reason = f"largest along {_vector(direction)}"
                if polytope.inscribed < 0:
                    reason += "; without any force the torque limits cannot hold the robot"
            if loose and verdict is Verdict.UNDECIDED:
                reason = f"{loose}; {reason}"
            inscribed = polytope.inscribed if np.isfinite(polytope.inscribed) else None

            def draw() -> tuple[Marker, ...]:
                return self._markers(polytope, at, direction, None if unbounded else across, limit, verdict)

            parts = (
                Result(name="in every direction", value=inscribed, unit="N"),
                *((Result(name="across that direction", value=across, unit="N"),) if unbounded else ()),
                *(
                    Result(name=f"direction {axis}", value=u, unit="")
                    for axis, u in zip("xyz", direction.tolist(), strict=True)
                ),
            )
            return Shown(reason, draw, parts)

        return present

    def falls(self, model: Model, points: Points) -> Falls | None:
        r"""Bound the force between instants; only of ``zero_moment``, without velocity products in the load.

        What the torques allow in one pose, made smaller by a share, they allow in the other. With columns of
        the Jacobian that differ by :math:`\epsilon_j`, torques of gravity that differ by :math:`\delta_j` and
        at least :math:`r_j` left for the force either way, the largest force F, near one of which it is
        :math:`F_e`, is

        .. math:: F \le F_e (1 + \max_j (\delta_j + \epsilon_j F) / r_j).
        """
        frame, limit = model.frame(self.at), self._against(model).limit
        robot = model.carrier(frame)
        if self.definition != "zero_moment" or self.load == "motion" or limit is None or robot.holders:
            return None
        lower, upper, _ = self._torques(model, robot)
        local = frame.body_from_frame[:3, :3] @ np.array(self.offset) + frame.body_from_frame[:3, 3]
        point = points.add(frame.mj, local)
        coupling = coupling_of(model, robot)
        heavy = [int(b) for b in robot.mj_bodies if model.mj.body_mass[b] > 0 and self.load == "gravity"]
        weights = np.linalg.norm(model.mj.opt.gravity) * model.mj.body_mass[heavy]
        centres = [points.add(b, model.mj.body_ipos[b]) for b in heavy]
        data, every = mujoco.MjData(model.mj), np.zeros(model.mj.nv)

        def held(q: Array) -> Array:
            data.qpos[:] = q
            mujoco.mj_kinematics(model.mj, data)
            mujoco.mj_comPos(model.mj, data)
            mujoco.mj_comVel(model.mj, data)
            mujoco.mj_rne(model.mj, data, 0, every)
            return np.asarray(robot.coupling.T @ every[robot.v_address])

        def falls(span: Span, least: Array | float) -> Fall:
            # At any instant, the nearer end is half the span away at most.
            half = span.T / 2
            moved = points.column_changes(point, span, coupling) * half + ROUNDING
            gained, left = np.zeros(len(moved)), np.minimum(upper, -lower)
            for weight, centre in zip(weights, centres, strict=True):
                gained += weight * points.column_changes(centre, span, coupling) * half
            if heavy:
                loads = [held(span.path.at(t)[0]) for t in (span.begin, span.end)]
                left = np.min([np.minimum(upper - load, load - lower) for load in loads], axis=0)
            largest = limit - float(least)
            if not (np.all(left > 0) and np.isfinite(moved).all() and np.isfinite(gained).all()):
                return UNBOUNDED
            shrinks = 1 - largest * float((moved / left).max())
            if shrinks <= 0:
                return UNBOUNDED
            return down_to(least, limit - largest * (1 + float((gained / left).max())) / shrinks)

        return falls

    def _loose(self, model: Model) -> str:
        """Why what the torques must hold may be more; empty where it may not."""
        robot, at_rest = model.carrier(model.frame(self.at)), self.load == "gravity"
        return "" if self.load == "none" else loose_torques(model, robot, at_rest=at_rest)

    def _held(self, twin: Twin, robot: Mechanism) -> Array:
        if self.load == "gravity":
            many, one = cast("States", twin), cast("State", twin)
            return many.held(robot) if twin.many else joint_torques.gravity(one, robot)
        n = len(robot.joints)
        return joint_torques.bias(cast("State", twin), robot) if self.load == "motion" else np.zeros(n)

    def _polytope(self, J: Array, low: Array, high: Array) -> Polytope:
        if self.definition == "zero_moment":
            return zero_moment(J[:3], low, high)
        return free_moment(J, low, high) if self.definition == "free_moment" else torque_box(J[:3], low, high)

    def _markers(
        self,
        polytope: Polytope,
        at: Array,
        direction: Array,
        value: float | None,
        limit: float | None,
        verdict: Verdict | None,
    ) -> tuple[Marker, ...]:
        center = tuple(at.tolist())
        markers: list[Marker] = []
        if len(polytope.triangles):
            corners, cut = drawn_corners(polytope.corners, at, DRAWN, LARGEST_DRAWN)
            markers.append(
                Hull(
                    vertices=tuple(map(tuple, corners.tolist())),
                    faces=tuple(map(tuple, polytope.triangles.tolist())),
                    label="cut off where it is drawn too large" if cut else "",
                    verdict=verdict,
                )
            )
        if limit is not None:
            radius = min(DRAWN * limit, LARGEST_DRAWN)
            markers.append(Sphere(center=center, radius=radius, label=f"limit {limit:g} N"))
        length = LARGEST_DRAWN if value is None else min(DRAWN * value, LARGEST_DRAWN)
        label = "unbounded" if value is None else figures.worded(value, limit, self.unit, at_most=True)
        arrow = tuple((length * direction).tolist())
        markers.append(Arrow(origin=center, vector=arrow, label=label, verdict=verdict))
        return tuple(markers)

    def _torques(self, model: Model, robot: Mechanism) -> tuple[Array, Array, str]:
        """Lower and upper torque limits, and what of them is unknown."""
        names = [joint.name for joint in robot.joints]
        if self.torque_limits is not None:
            file = next(iter(model.workstation.files), "workstation")
            pairs = np.array(self.torque_limits, float).reshape(-1, 2)
            if len(pairs) != len(names) or not np.isfinite(pairs).all() or (pairs[:, 0] > pairs[:, 1]).any():
                raise InputError.at(
                    file,
                    "torque_limits",
                    f"{[list(pair) for pair in self.torque_limits]} does not fit",
                    f"give [least, largest] in N·m or N for each of {', '.join(names)}",
                )
            return pairs[:, 0], pairs[:, 1], ""
        unknown = [
            name
            for name, limit in zip(names, robot.effort_limits, strict=True)
            # A limit of 0 in a description means that nobody filled it in.
            if limit is None or limit.value <= 0 or limit.origin in (Origin.ASSUMED, Origin.MISSING)
        ]
        upper = np.array([0.0 if limit is None else limit.value for limit in robot.effort_limits])
        text = f"{robot.name}: nobody gave the torque limit of {', '.join(unknown)}" if unknown else ""
        return -upper, upper, text

    def basis(self, model: Model) -> Basis:
        """State the formula, its source, the inputs with their origin, and what is not modelled."""
        robot = model.carrier(model.frame(self.at))
        limit = provenance.limit(self.limit, "N")
        undecided_reasons: tuple[str, ...] = ()
        if self.body_region is not None:
            edition, own = model.workstation.edition, self.limits is not None
            limit, undecided_reasons = force_inputs(self._table(model), self.body_region, edition, own=own)
        return Basis(
            formula=f"largest |f| of {FORMULA[self.definition]}; {LOAD[self.load]}",
            source="Weistroffer et al. 2022, section 2.2.2.4; Chiacchio et al. 1997",
            inputs=provenance.motion(model, robot.name)
            + self._limits_given(robot)
            + (() if self.load == "none" else provenance.masses(model, robot))
            + limit,
            not_modelled=(
                *undecided_reasons,
                "static: no force of an impact, no inertia of the moving robot",
                "friction in joints and gears, which a pushing robot must overcome and a pushed one adds",
                "torques beyond the stated limits, and force monitoring of the controller below them",
            ),
        )

    def _limits_given(self, robot: Mechanism) -> tuple[Input, ...]:
        if self.torque_limits is not None:
            return tuple(
                Input(
                    name=f"torque limits of {joint.name}",
                    value=f"{low:g} … {high:g}",
                    unit="N·m" if unit == "rad" else "N",
                    origin=Origin.GIVEN,
                    source="workstation file",
                )
                for joint, unit, (low, high) in zip(
                    robot.joints, robot.units, self.torque_limits, strict=True
                )
            )
        return tuple(
            Input(name=f"torque limit of {joint.name}", origin=Origin.MISSING)
            if limit is None or limit.value <= 0
            else Input(
                name=f"torque limit of {joint.name}, either way",
                value=limit.value,
                unit="N·m" if unit == "rad" else "N",
                origin=limit.origin,
                source=limit.source,
            )
            for joint, unit, limit in zip(robot.joints, robot.units, robot.effort_limits, strict=True)
        )


def _vector(u: Array) -> str:
    return "(" + ", ".join(f"{0.0 if abs(x) < 5e-3 else x:.2f}" for x in u.tolist()) + ")"
