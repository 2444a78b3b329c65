"""Everybody who moves beside the robot whose path is planned: who, where they are, what they sweep."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import ClassVar

import numpy as np
from msgspec.structs import replace

from seerob.core.errors import InputError, Problem
from seerob.core.samples import Sample
from seerob.core.snapshot import Basis, Result, Snapshot, Verdict
from seerob.core.transforms import Array
from seerob.criteria.criterion import Criterion, Evaluate
from seerob.model.model import Model
from seerob.outputs.sink import Closing
from seerob.twin.state import State
from seerob.workstation.workstation import Area, SweptArea, Workstation

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
        reason = next(
            (r.reason for r in snapshot.results if r.name == KNOWN and r.verdict is not Verdict.WITHIN), ""
        )
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


class _Known(Criterion, frozen=True, kw_only=True):
    """Whether it is known where everybody of interest is: within where nothing of theirs is in doubt."""

    unit: ClassVar[str] = ""
    limit: ClassVar[float] = 1.0

    who: tuple[str, ...]

    def subjects(self) -> tuple[str, ...]:
        return self.who

    def bind(self, model: Model) -> Evaluate:
        def evaluate(state: State) -> Result:
            for name in self.who:
                state.require(name)
            return Result(name=self.name, value=0.0, unit=self.unit, limit=self.limit, verdict=Verdict.WITHIN)

        return evaluate

    def basis(self, model: Model) -> Basis:
        return Basis(formula="", source="")
