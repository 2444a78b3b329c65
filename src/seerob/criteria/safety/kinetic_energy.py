r"""Kinetic energy of a robot, [Weistroffer2022]_ Eq. 5."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Annotated, Any, ClassVar, cast

import mujoco
import numpy as np
from msgspec import Meta

from seerob.core import figures
from seerob.core.domains import at_least
from seerob.core.snapshot import Basis, Result, Sphere
from seerob.core.tolerances import Shifts, Spread, deciding, spread
from seerob.core.transforms import Array
from seerob.core.verdict import Verdict
from seerob.criteria.criterion import Criterion
from seerob.criteria.figure import Compute, Figure, Present, Shown, Twin
from seerob.criteria.noisy_speeds import NOISE, others_noisy
from seerob.criteria.plan import Draw, Rows, Together
from seerob.model import provenance
from seerob.model.model import Frame, Mechanism, Model
from seerob.twin.accuracy.mass_tolerances import MassTolerances
from seerob.twin.moving_base import energy_of
from seerob.twin.spans import UNBOUNDED, Fall, Falls, Margin, Points, Span, change_of_motion
from seerob.twin.state import State

ORIGIN = np.zeros(3)
DRAWN = 0.1
"""Radius of the sphere of 1 J [m]; the volume is proportional to the energy."""


LEAST = 1e-9
"""What rounding may make of no energy [J]."""


def kinetic_energy(M: Array, qd: Array) -> Array:
    r"""Kinetic energy :math:`E = \frac{1}{2} \dot{q}^T M(q) \dot{q}`.

    Args:
        M: Joint-space mass matrix [kg, kg·m or kg·m²], shape (..., n, n).
        qd: Joint velocities [rad/s or m/s], shape (..., n).

    Returns:
        Energy [J], shape (...).
    """
    # Of one instant the same products, bit by bit, in a third of the time.
    single = M.ndim == 2 and qd.ndim == 1
    energy = 0.5 * (qd.dot(M.dot(qd)) if single else np.vecdot(qd, np.matvec(M, qd)))
    return at_least("energy of M, a mass matrix,", energy, -LEAST, "J")


class KineticEnergy(Criterion, frozen=True, kw_only=True):
    """Kinetic energy of a whole robot or machine with everything mounted on it."""

    unit: ClassVar[str] = "J"
    heavier_is_worse: ClassVar[bool] = True
    by_speed: ClassVar[bool] = True
    by_shape: ClassVar[bool] = False

    robot: str
    """A robot, with the speed that what carries it gives it; or a machine."""
    limit: Annotated[float, Meta(gt=0, extra={"unit": "J"})] | None = None
    """Largest admissible energy [J]."""

    def subjects(self) -> tuple[str, ...]:
        """The robot."""
        return (self.robot,)

    def depends(self, model: Model) -> tuple[str, ...]:
        """The robot, and whoever rides on it."""
        robot = model.mover(self.robot)
        return tuple(
            dict.fromkeys((robot.name, *robot.riders, *(each.name for each in _aboard(model, robot))))
        )

    def compute(self, model: Model) -> Compute:
        """Look up every name in the model once and return the function that computes the energy."""
        robot = model.mover(self.robot)
        aboard = _aboard(model, robot)
        for each in (robot, *aboard):
            each.require_masses(self.name)
        alone = robot.alone and not aboard
        masses = tuple(MassTolerances(model, each) for each in (robot, *aboard))
        beside = (*robot.riders, *(each.name for each in aboard))
        others = tuple(dict.fromkeys((*model.carriers_of(robot.name), *beside)))

        def compute(twin: Twin) -> Figure:
            qd = twin.qd(robot)
            energy: float | Array
            if alone:
                energy = kinetic_energy(twin.mass_matrix(robot), qd)
            else:
                energy = sum(energy_of(cast("State", twin), each) for each in (robot, *aboard))
            low = high = energy
            if any(map(len, masses)):
                ends = self._ends(masses, cast("State", twin), energy)
                low, high = ends.low, ends.high
            error = twin.speed_error(robot)
            if error is not None:
                # √(2E) is a norm of the velocities: it is off by no more than that of their errors.
                M = twin.mass_matrix(robot)
                if len(masses[0]):
                    M = masses[0].matrices(cast("State", twin)).at((1,) * len(masses[0]))
                off = np.sqrt(np.einsum("...ii,...i->...", M, error**2))
                low = 0.5 * np.maximum(np.sqrt(2 * np.maximum(low, 0.0)) - off, 0.0) ** 2
                high = 0.5 * (np.sqrt(2 * np.maximum(high, 0.0)) + off) ** 2
            interval, open_ = None if low is high else (low, high), others_noisy(twin, others)
            return Figure(energy, self.limit, interval, open=open_)

        return compute

    @staticmethod
    def _ends(masses: tuple[MassTolerances, ...], state: State, energy: float | Array) -> Spread:
        """Of the energy: by the mass matrix where its own joints move all, else by each body's motion."""
        first = masses[0]
        if len(masses) == 1 and first.own:
            matrices, qd = first.matrices(state), state.qd(first.robot)
            beside = energy - kinetic_energy(matrices.M, qd)
            return spread(lambda shifts: kinetic_energy(matrices.at(shifts), qd) + beside, len(first))
        more = [(len(each), each.energies(state)) for each in masses]

        def shifted(shifts: Shifts) -> Array:
            found, begin = np.asarray(energy, float), 0
            for count, each in more:
                found, begin = found + each(shifts[begin : begin + count]), begin + count
            return np.asarray(np.maximum(found, 0.0))

        return spread(shifted, sum(map(len, masses)))

    def present(self, model: Model) -> Present:
        """Return the function that draws a sphere at the tool's working point."""
        robot = model.mover(self.robot)
        masses = tuple(MassTolerances(model, each) for each in (robot, *_aboard(model, robot)))
        tolerances = [tolerance for each in masses for tolerance in each.tolerances]

        def present(state: State, figure: Figure, verdict: Verdict | None) -> Shown:
            place, energy, reason = state.drawn_point(robot.tip, ORIGIN), figure.number, ""
            if verdict is Verdict.UNDECIDED:
                widths = self._ends(masses, state, energy).widths if tolerances else np.zeros(0)
                reason = deciding(tolerances, widths) or NOISE

            return Shown(reason, partial(_sphere, self, place, energy, verdict))

        return present

    def planned(self, model: Model) -> Callable[[Sequence[Any], Model], Together] | None:
        """Return what computes energies together: of robots alone, whose masses have no tolerances."""
        robot = model.mover(self.robot)
        alone = robot.alone and not _aboard(model, robot) and not len(MassTolerances(model, robot))
        return _Energies if alone else None

    def one_by_one(self, model: Model) -> str:
        """Say so where a mass has a tolerance or something else moves it."""
        robot = model.mover(self.robot)
        if len(MassTolerances(model, robot)):
            return "a mass has a tolerance"
        return "" if robot.alone and not _aboard(model, robot) else "something moves it, or is on it"

    def falls(self, model: Model, points: Points) -> Falls | None:
        r"""Bound between instants the largest energy that tolerances of masses allow.

        :math:`\sqrt{2E}` is a norm of the velocities of all that has a mass, so it changes by no more than
        the norm of how much they change. The largest is one too: of heavier masses, with centres that may
        be d away, :math:`m (|v| + d |\omega|)^2 + \omega^T I \omega`
        (`seerob.twin.accuracy.mass_tolerances`).
        """
        robot = model.mover(self.robot)
        if self.limit is None:
            return None
        every = (robot, *_aboard(model, robot))
        tolerances = [MassTolerances(model, each) for each in every]
        bodies = [int(b) for each in every for b in each.mj_bodies]
        dofs = np.concatenate([each.v_address for each in every])

        def most_of(body: int) -> tuple[float, float]:
            factors, ways = zip(*(each.heaviest(body) for each in tolerances), strict=True)
            return max(factors), max(ways)

        limit, changes = self.limit, change_of_motion(model, bodies, dofs, points, most_of)
        mj, data, full = model.mj, mujoco.MjData(model.mj), np.zeros((model.mj.nv, model.mj.nv))
        heaviest = np.array([most_of(body) for body in bodies]).reshape(-1, 2)
        total = math.sqrt(float(heaviest[:, 0] @ mj.body_mass[bodies]))

        def noise(span: Span) -> float:
            """How much of √(2E) noise of speeds may make at any instant [√J]: no more than joint by joint."""
            error = span.joint_noise[dofs]
            if not error.any():
                return 0.0
            data.qpos[:] = span.path.at(span.end)[0]
            mujoco.mj_kinematics(mj, data)
            mujoco.mj_comPos(mj, data)
            mujoco.mj_makeM(mj, data)
            mujoco.mj_fullM(mj, data, full)
            # Levers are longer by what a centre of mass may be off, and by what moves until then.
            longer = float(heaviest[:, 1].max(initial=0.0)) + 2 * float(span.fast.max(initial=0.0)) * span.T
            each = np.sqrt(np.diagonal(full)[dofs] * heaviest[:, 0].max(initial=1.0)) + total * longer
            return float(each @ error)

        def falls(span: Span, least: Array | float) -> Fall:
            change, bend = changes(span)
            if not np.isfinite(change):
                return UNBOUNDED  # who jumps
            # At the other end there may have been none.
            off = noise(span)
            change, bend = change + 2 * off, bend + off
            most = np.sqrt(2 * max(limit - float(least), 0.0))
            return Fall(float((most + change) * change), float(most * bend + bend**2 / 2))

        return falls

    def margin(self, result: Result) -> Margin:
        """Tell how far the largest energy that tolerances allow is from the limit [J]."""
        far, off = super().margin(result)
        return far - off, 0.0

    def basis(self, model: Model) -> Basis:
        """State the formula, its source, the inputs with their origin, and what is not modelled."""
        robot = model.mover(self.robot)
        aboard = _aboard(model, robot)
        alone = robot.alone and not aboard
        return Basis(
            formula="E = ½ q̇ᵀ M(q) q̇, whole robot" if alone else "E = ½ Σ (m v² + ωᵀ I ω), whole robot",
            source="Weistroffer et al. 2022, Eq. 5",
            inputs=provenance.motion(model, robot.name, *(each.name for each in aboard))
            + tuple(given for each in (robot, *aboard) for given in provenance.masses(model, each))
            + provenance.limit(self.limit, "J"),
            not_modelled=(
                "not the energy of an impact, ½ μ v_rel², that ISO/TS 15066 limits per body region",
                *(() if robot.rotor_inertia_known else ("energy of rotors and gears",)),
            ),
        )


class _Energies:
    """Energies of robots at one instant, of a tick's plan."""

    intervals = False
    _place: Callable[[Frame, Array], Array]

    def __init__(self, criteria: Sequence[KineticEnergy], model: Model) -> None:
        self._robots = [model.mover(each.robot) for each in criteria]
        self._criteria = criteria

    def compute(self, state: State, rows: Rows) -> None:
        """Write the energy of every robot."""
        self._place = state.drawn_points()
        rows.value[:] = [kinetic_energy(state.mass_matrix(robot), state.qd(robot)) for robot in self._robots]

    def present(
        self, state: State, k: int, value: float, verdict: Verdict | None
    ) -> tuple[str, Draw, tuple[Result, ...]]:
        """Say and draw what `KineticEnergy.present` does of one that is decided."""
        place = partial(self._place, self._robots[k].tip, ORIGIN)
        return "", partial(_sphere, self._criteria[k], place, value, verdict), ()


def _sphere(
    of: KineticEnergy, place: Callable[[], Array], energy: float, verdict: Verdict | None
) -> tuple[Sphere, ...]:
    label = figures.worded(energy, of.limit, of.unit, at_most=True)
    radius = DRAWN * max(energy, 0.0) ** (1 / 3)
    return (Sphere(center=tuple(place().tolist()), radius=radius, label=label, verdict=verdict),)


def _aboard(model: Model, machine: Mechanism) -> tuple[Mechanism, ...]:
    """Robots that a machine carries: they have joints and speeds of their own."""
    robots = (m for m in model.mechanisms.values() if m.role == "robot")
    return tuple(m for m in robots if machine.name in model.carriers_of(m.name))
