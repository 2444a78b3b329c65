"""Everybody who moves beside the robot whose path is planned: who, where they are, what they sweep."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import mujoco
import numpy as np
from msgspec.structs import replace

from seerob.core.errors import InputError, Problem
from seerob.core.samples import Sample
from seerob.core.snapshot import Basis, Result, Snapshot, Verdict
from seerob.core.transforms import Array
from seerob.criteria.criterion import Criterion, Evaluate
from seerob.model.model import Model
from seerob.outputs.sink import Closing
from seerob.session.recorded_motion import recorded
from seerob.session.run import pump
from seerob.twin.accuracy.tracking_error import TrackingError
from seerob.twin.spans import Path
from seerob.twin.state import State
from seerob.workstation.workstation import Area, SweptArea, Workstation

if TYPE_CHECKING:
    from seerob.session.station import Station

SWEEPS = "sweep_of_"
"""Begin of the names of areas that are made for a plan."""
KNOWN = "known where the others are"


def movers(station: Workstation, robot: str) -> tuple[str, ...]:
    """Robots, people and machines beside a robot that a source or a variable moves."""
    driven = {source.target().partition("/")[0] for source in station.sources}
    driven |= {machine.name for machine in station.machines if machine.motion.variables()}
    known = [
        *(r.name for r in station.robots),
        *(h.name for h in station.humans),
        *(m.name for m in station.machines),
    ]
    return tuple(name for name in known if name in driven and name != robot)


def alone(station: Workstation, robot: str, who: Iterable[str], keep_out: Collection[str]) -> Workstation:
    """The workstation as everybody but one robot moves in it, on the motion that their sources say.

    A criterion ``known`` says at every tick whether the motion of all of ``who`` is known. Of areas that are
    swept those of ``keep_out`` are left, with the criteria that they want.
    """
    areas = tuple(a for a in station.areas if a.swept is None or a.name in keep_out)
    wanted = {a.swept.separation for a in areas if a.swept is not None}
    return replace(
        station,
        sources=tuple(s for s in station.sources if s.target().partition("/")[0] != robot),
        areas=areas,
        safety=(*(c for c in station.safety if c.name in wanted), _Known(name=KNOWN, who=tuple(who))),
        ergonomics=(),
        sinks=(),
        engine=replace(station.engine, physics=False),
        # Areas are kept by the content of files: what is made here is none of the file's own.
        files={**station.files, "planned": robot.encode()},
    )


def with_sweeps(station: Workstation, who: Collection[str], voxel: float) -> Workstation:
    """The workstation with an area for what each of them sweeps."""
    areas = [
        Area(name=name, swept=SweptArea(of=other, voxel=voxel))
        for name, other in zip(made_for(who), who, strict=True)
    ]
    return replace(station, areas=(*station.areas, *areas))


def made_for(who: Collection[str]) -> list[str]:
    """Names of the areas that `with_sweeps` makes."""
    return [f"{SWEEPS}{name}" for name in who]


class PoseRecorder(Closing):
    """A writer that keeps where everybody is at the first tick from an instant on, and who was not known.

    Args:
        instant: [s]; None to watch all of the run instead.
    """

    def __init__(self, instant: float | None) -> None:
        self._instant = instant
        self.last = 0.0
        """Run time of the last tick that was looked at [s]."""
        self.places: dict[str, Array] = {}
        """Joint positions by name [rad or m], shape (n,)."""
        self.off = 0.0
        """How far others may be from there then [m]."""
        self._unknown = ""

    @property
    def done(self) -> bool:
        """Whether the rest of the run says nothing more."""
        return bool(self.places) if self._instant is not None else bool(self._unknown)

    def write(self, snapshot: Snapshot, samples: Iterable[Sample]) -> None:
        """Take one tick: what goes out, and what came in to make it."""
        if self.done or (self._instant is not None and snapshot.t < self._instant - 1e-9):
            self.last = snapshot.t
            return
        self.last = snapshot.t
        if self._instant is not None:
            self.places = {name: np.array(q) for name, q in snapshot.joints.items()}
        known = next((r for r in snapshot.results if r.name == KNOWN), None)
        if known is not None and known.value is not None:
            self.off = known.value
        reason = "" if known is None or known.verdict is Verdict.WITHIN else known.reason
        if reason:
            self._unknown = f"{reason} (at {snapshot.t:.2f} s)"

    def require(self) -> None:
        """InputError when somebody's motion is not known, or ends before the instant."""
        problems = []
        if self._unknown:
            remedy = "correct the source, or plan with others that stand still"
            problems.append(Problem("plan", "--others", self._unknown, remedy))
        elif self._instant is not None and not self.places:
            what = f"the motion of the others ends at {self.last:.2f} s, before {self._instant:g} s"
            problems.append(Problem("plan", "--others", what, "give an earlier instant"))
        if problems:
            raise InputError(problems)


class Watch(Closing):
    """A writer that keeps how long the motion of everybody is known, and how well."""

    def __init__(self) -> None:
        self.end = -np.inf
        """Last tick until which everything was known [s]."""
        self.why = ""
        """Why no more is known then; empty where the motion ends."""
        self.off = 0.0
        """How far others may be from where they are taken to be, at any tick [m]."""

    @property
    def done(self) -> bool:
        """Whether the rest of the run says nothing more."""
        return bool(self.why)

    def write(self, snapshot: Snapshot, samples: Iterable[Sample]) -> None:
        """Take one tick: what goes out, and what came in to make it."""
        if self.done:
            return
        known = next(r for r in snapshot.results if r.name == KNOWN)
        if known.verdict is not Verdict.WITHIN or known.value is None:
            self.why = f"{known.reason} (at {snapshot.t:.2f} s)"
            return
        self.end, self.off = snapshot.t, max(self.off, known.value)


@dataclass(frozen=True, eq=False)
class Course:
    """Where everybody beside the robot is, from 0 s on: cubics from knot to knot."""

    t: Array
    """Knots, increasing [s], shape (k,)."""
    q: Array
    """``qpos`` there, shape (k, nq)."""
    v: Array
    """``qvel`` there, shape (k, nv)."""
    end: float
    """Until when the motion is known [s]."""
    why: str
    """Why not longer."""
    off: float
    """How far others may be from there [m]."""


def course(station: Station, who: Collection[str], stopped: Callable[[], bool]) -> Course:
    """The motion of everybody, as a run without physics has it.

    Args:
        station: Of `alone`.
        who: Who may move.
        stopped: Whether to stop.

    Raises:
        InputError: It is not known when it begins, or somebody moves otherwise than by joints that a
            source says.
    """
    watch = Watch()
    station.run(writers=[watch], stop=lambda: stopped() or watch.done)
    remedy = "correct the source, or plan with others that stand still"
    if not watch.end > 0:
        what = watch.why or "the others do not move"
        raise InputError.at("plan", "--others", what, remedy)
    model = station.model
    motion = recorded(model, pump(station.sources, station.workstation.engine.tick), station.duration)
    paths = [p for p in motion.ways or () if p.t[0] < watch.end]
    for path in paths:
        if path.broken or path.captured is not None or path.gaps or path.loose:
            named = ", ".join(path.broken) or "somebody"
            what = f"{named}: how they get from one place to the next is not known (at {path.t[0]:.2f} s)"
            raise InputError.at("plan", "--others", what, remedy)
    if motion.implausible:
        raise InputError.at("plan", "--others", motion.implausible[0].text, remedy)
    whole = Path.joined(paths, ())
    dofs = [model.mechanisms[name].v_address for name in who]
    moved = (np.ptp(whole.q, axis=0) > 0) | (np.abs(whole.v).max(axis=0) > 0)
    moved[np.concatenate(dofs)] = False
    if moved.any():
        joint = mujoco.mj_id2name(
            model.mj, mujoco.mjtObj.mjOBJ_JOINT, int(model.mj.dof_jntid[np.flatnonzero(moved)[0]])
        )
        raise InputError.at("plan", "--others", f"{joint} moves, and no source says it", remedy)
    why = watch.why or "their motion ends"
    return Course(whole.t, whole.q, whole.v, min(watch.end, float(whole.t[-1])), why, watch.off)


class _Known(Criterion, frozen=True, kw_only=True):
    """Whether it is known where everybody of interest is, and how far they may be from there [m]."""

    unit: ClassVar[str] = "m"
    limit: ClassVar[float] = 1.0

    who: tuple[str, ...]

    def subjects(self) -> tuple[str, ...]:
        return self.who

    def bind(self, model: Model) -> Evaluate:
        bodies = [body.index for body in model.bodies if body.owner in self.who]
        errors = TrackingError(model, bodies)

        def evaluate(state: State) -> Result:
            for name in self.who:
                state.require(name)
            off = 0.0 if errors.none(state) else float(errors.at(state).max(initial=0.0))
            verdict = Verdict.WITHIN if off < self.limit else Verdict.EXCEEDED
            reason = "" if off < self.limit else "somebody may be a metre from where they were seen"
            return Result(
                name=self.name, value=off, unit=self.unit, limit=self.limit, verdict=verdict, reason=reason
            )

        return evaluate

    def basis(self, model: Model) -> Basis:
        return Basis(formula="", source="")
