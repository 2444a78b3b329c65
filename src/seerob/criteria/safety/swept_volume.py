"""Volume swept by a robot with tool and workpiece, [Weistroffer2022]_ section 2.2.2.1."""

from __future__ import annotations

from typing import Annotated, ClassVar, cast

from msgspec import Meta

from seerob.core import figures
from seerob.core.errors import InputError, Undecided
from seerob.core.snapshot import Basis, Hull, Input, Origin, Result
from seerob.core.verdict import Verdict
from seerob.criteria.criterion import Criterion
from seerob.criteria.figure import Compute, Figure, Present, Shown, Twin
from seerob.distance.voxels import check_room
from seerob.model import provenance
from seerob.model.model import Model
from seerob.model.volumes.moving import reach_box
from seerob.model.volumes.swept import Sweep
from seerob.twin.state import State

DRAWN = 2000
"""Triangles of the surface as drawn, about; it still contains every voxel."""
VOXEL = 0.02
"""Edge of a voxel, when nobody says [m]."""


class SweptVolume(Criterion, frozen=True, kw_only=True):
    """Volume that a set has swept so far; no voxel that any of its points crossed is missing."""

    unit: ClassVar[str] = "m³"
    by_speed: ClassVar[bool] = True
    instants: ClassVar[str] = "accepted: what is crossed between two instants is in the figure of the second"

    of: str
    """What sweeps: a robot with everything on it, a tool, a human, a link; wildcards allowed."""
    voxel: Annotated[float, Meta(gt=0, extra={"unit": "m"})] = VOXEL
    """Edge of a voxel [m]."""
    limit: Annotated[float, Meta(ge=0, extra={"unit": "m³"})] | None = None
    """Largest admissible volume [m³]."""
    redraw: Annotated[float, Meta(gt=0, extra={"unit": "s"})] = 1.0
    """Time between two pictures of the surface [s]; the figure itself is of every tick."""

    def subjects(self) -> tuple[str, ...]:
        """What sweeps."""
        return (self.of,)

    def remembers(self, model: Model) -> bool:
        """What was swept before counts."""
        return True

    def compute(self, model: Model) -> Compute:
        """Look up the bodies and return the function that marks voxels; refuses more than memory allows."""
        bodies = model.select(self.of)
        carriers = _carriers(model, bodies)
        low, high = reach_box(model, bodies)
        try:
            check_room(low, high, self.voxel)
        except InputError as error:
            raise InputError([p._replace(file=self.name or self.of) for p in error.problems]) from None
        way = _Way(
            carriers,
            Sweep(model, bodies, voxel=self.voxel),
            max(model.workstation.engine.tick, self.every or 0.0),
        )
        unshaped = self.every is not None and self.every > model.workstation.engine.tick * 1.5

        def compute(twin: Twin) -> Figure:
            state = cast("State", twin)
            state.require(*carriers)
            way.follow(state)
            swept, undecided_reasons = way.sweep.swept, list(way.unheard)
            if unshaped:
                undecided_reasons.append(f"seen every {self.every:g} s only: what lies between is not known")
            return Figure(
                swept.volume,
                self.limit,
                open=bool(undecided_reasons),
                beside=(way, swept.dilation, undecided_reasons),
            )

        return compute

    def present(self, model: Model) -> Present:
        """Return the function that says what is not known of it, and draws its hull."""

        def present(state: State, figure: Figure, verdict: Verdict | None) -> Shown:
            way, dilation, undecided_reasons = figure.beside
            how = f"not more than this; dilated by up to {dilation * 1e3:.1f} mm for motion between ticks"
            hull = way.hull(state.t, self.redraw, verdict)
            parts = (Result(name="dilation for motion", value=dilation, unit="m"),)
            return Shown("; ".join([*undecided_reasons[:3], how]), lambda: (hull,), parts)

        return present

    def basis(self, model: Model) -> Basis:
        """State the formula, its source, the inputs with their origin, and what is not modelled."""
        bodies = [model.bodies[i] for i in model.select(self.of)]
        notes = dict.fromkeys(f"{body.owner}: {body.note}" for body in bodies if body.note)
        not_modelled = ["cables, hoses and clothing that are not in the model"]
        if self.every is not None:
            not_modelled.append("the way between two evaluations, taken as a cubic of joint positions")
        return Basis(
            formula="voxels that touch the shapes at the middle of each piece, dilated by Σ ρ_i |Δq_i|/2",
            source="Weistroffer et al. 2022, section 2.2.2.1",
            inputs=(
                *provenance.motion(model, *_carriers(model, model.select(self.of))),
                *(Input(name="shape", value=note, origin=Origin.ESTIMATED, source="model") for note in notes),
                provenance.option("voxel", self.voxel, VOXEL, "m"),
                *provenance.limit(self.limit, "m³"),
            ),
            not_modelled=tuple(not_modelled),
        )


class _Way:
    """What has been swept since the run began, and its last picture."""

    def __init__(self, carriers: tuple[str, ...], sweep: Sweep, period: float) -> None:
        self.carriers, self.sweep, self.period = carriers, sweep, period
        self.unheard: list[str] = []
        self._t: float | None = None
        self._drawn: tuple[float, Hull] | None = None

    def follow(self, state: State) -> None:
        """Sweep from the last tick to this one; what was not heard in between is a gap, not a way."""
        if self._t is not None and state.t <= self._t:
            self.sweep.clear()
            self.unheard, self._t, self._drawn = [], None, None
        data = state.data_of(*self.carriers)
        # What a gripper holds is where it was taken, not where the file has it in the hand.
        self.sweep.moving.mj = state.model.mj
        try:
            if self._t is None or state.t - self._t > 1.5 * self.period:
                if self._t is not None:
                    self.unheard.append(f"not known where it went from {self._t:.2f} s to {state.t:.2f} s")
                self.sweep.start(data.qpos, data.qvel)
            else:
                self.sweep.advance(data.qpos, data.qvel, state.t - self._t, state.joint_noise())
        except InputError as error:
            raise Undecided(str(error)) from error
        self._t = state.t

    def hull(self, t: float, redraw: float, verdict: Verdict | None) -> Hull:
        """The surface, made anew when the last one is old."""
        if (
            self._drawn is None
            or t - self._drawn[0] >= redraw - 1e-9
            or self._drawn[1].verdict is not verdict
        ):
            mesh = self.sweep.grid.mesh(most=DRAWN)
            hull = Hull(
                vertices=tuple((x, y, z) for x, y, z in mesh.vertices.round(4).tolist()),
                faces=tuple((a, b, c) for a, b, c in mesh.faces.tolist()),
                label=figures.rounded_up(self.sweep.grid.volume * 1e3, "L"),
                verdict=verdict,
            )
            self._drawn = t, hull
        return self._drawn[1]


def _carriers(model: Model, bodies: tuple[int, ...]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(model.bodies[i].carrier for i in bodies if model.bodies[i].carrier))
