"""How far things are from one another where a snapshot has them, and how far they reach: only to look.

The distance is of the shapes that criteria judge and by the same kernels; poses are those of the snapshot, in
single precision, which moves nothing within 10 m by more than a micrometre.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import mujoco
import numpy as np

from seerob.core import figures
from seerob.core.errors import InputError, Undecided
from seerob.core.snapshot import Hull, Result, Segment, Snapshot
from seerob.core.transforms import Array, rotation_from_wxyz
from seerob.distance.least import Query
from seerob.model.model import Model
from seerob.model.volumes.moving import joints_above
from seerob.model.volumes.reach_outline import Carried, reach_outline

MOST_OUTLINES = 16
"""That are kept."""


class Ruler:
    """Measures in one workstation; threads may share it.

    Args:
        model_of: Gives the compiled workstation; called when something is measured first.
    """

    def __init__(self, model_of: Callable[[], Model]) -> None:
        self._model_of = model_of
        self._reached: dict[str, tuple[Carried, ...]] = {}
        self._bound: tuple[tuple[str, str], Query, float] | None = None

    @cached_property
    def _model(self) -> Model:
        return self._model_of()

    def measure(self, between: tuple[str, str], seen: Snapshot) -> Result:
        """Least distance of the surfaces of two things, with the line between them [m].

        Args:
            between: Full names of bodies, or of robots, people and other entries, as of a criterion.
            seen: Where everything is.

        Raises:
            InputError: A name leads nowhere, both share a body, or the snapshot is of another workstation.
            Undecided: One of them may be elsewhere, or has a part that no shape shows.
        """
        query, deviation = self._query(between)
        model = self._model
        poses = self._poses(seen)
        for i in query.bodies:
            body = model.bodies[i]
            if reason := seen.doubts.get(body.name) or seen.doubts.get(body.mover):
                raise Undecided(f"{body.name} may be elsewhere: {reason}")
        closest = query.batch(rotation_from_wxyz(poses[:, 3:])[None], poses[None, :, :3]).at(0, 0)
        start, end = tuple(closest.point_a.tolist()), tuple(closest.point_b.tolist())
        label = figures.rounded_down(closest.distance, "m")
        return Result(
            name=f"measured {between[0]} – {between[1]}",
            value=closest.distance,
            unit="m",
            at_most=False,
            reason=f"{model.bodies[closest.body_a].name} ↔ {model.bodies[closest.body_b].name}",
            interval=(closest.distance - deviation, closest.distance) if deviation else None,
            markers=(Segment(start=start, end=end, label=label, verdict=None),),
            t=seen.t,
        )

    def reach(self, of: str, seen: Snapshot) -> Result:
        """Outline of where the working point of a robot, the hands of a person, or a body of them can be.

        What carries the first joint stays where the snapshot has it: a robot's base, a person's pelvis.

        Args:
            of: A robot, a person, or the full name of a body of them.
            seen: Where everything is.

        Returns:
            Its value is how far outside of the outline places can be [m] (`Outline.beyond`).

        Raises:
            InputError: A name leads nowhere, nothing moves it, or the snapshot is of another workstation.
            Undecided: Who reaches may be elsewhere.
        """
        model, poses = self._model, self._poses(seen)
        hulls, beyond = [], 0.0
        for each in self._outlines(of):
            beyond = max(beyond, each.outline.beyond)
            points = each.outline.points
            on = next((body for body in model.bodies if body.mj == each.base), None)
            if on is not None:
                if reason := seen.doubts.get(on.name) or seen.doubts.get(on.mover):
                    raise Undecided(f"{on.name} may be elsewhere: {reason}")
                pose = poses[on.index]
                points = each.points(rotation_from_wxyz(pose[3:]), pose[:3])
            elif joints_above(model.mj, each.base):
                raise Undecided(f"{of}: no shape shows what carries it, so nobody knows where that is")
            vertices = tuple(map(tuple, points.tolist()))
            hulls.append(Hull(vertices=vertices, faces=tuple(map(tuple, each.outline.faces.tolist()))))
        return Result(name=f"reach of {of}", value=beyond, unit="m", markers=tuple(hulls), t=seen.t)

    def _outlines(self, of: str) -> tuple[Carried, ...]:
        if of not in self._reached:
            found = []
            for mj, point in self._points(of):
                one = reach_outline(self._model, mj, point, still=self._still(mj))
                if one is None:
                    raise InputError.at(
                        "reach", "of", "what it reaches lies in one plane", "pick another body"
                    )
                found.append(one)
            if len(self._reached) >= MOST_OUTLINES:
                self._reached.clear()
            self._reached[of] = tuple(found)
        return self._reached[of]

    def _still(self, mj: int) -> tuple[int, ...]:
        """Joints above a body that move more than who reaches: where a person stands, what a robot is on."""
        owners = [(self._joint(j).split("/")[0], j) for j in joints_above(self._model.mj, mj)]
        who = owners[-1][0] if owners else ""
        model = self._model
        stands: tuple[int, ...] = ()
        if who in model.mechanisms and model.mechanisms[who].role == "human":
            own = model.mechanisms[who].bodies
            stands = min((joints_above(model.mj, model.bodies[i].mj) for i in own), key=len)
        return tuple(j for name, j in owners if name != who or j in stands)

    def _joint(self, j: int) -> str:
        return mujoco.mj_id2name(self._model.mj, mujoco.mjtObj.mjOBJ_JOINT, j) or ""

    def _points(self, of: str) -> list[tuple[int, Array]]:
        """Bodies of MuJoCo whose points reach, and the points in their frames [m]."""
        model = self._model
        mechanism = model.mechanisms.get(of)
        if mechanism is not None and mechanism.role != "human":
            return [(mechanism.tip.mj, mechanism.tip.body_from_frame[:3, 3])]
        names = (of,) if mechanism is None else (f"{of}/right_hand", f"{of}/left_hand")
        bodies = [model.bodies[i] for name in names for i in model.select(name)[:1]]
        return [(body.mj, (body.corners.min(axis=0) + body.corners.max(axis=0)) / 2) for body in bodies]

    def _poses(self, seen: Snapshot) -> Array:
        if len(seen.poses) != 28 * len(self._model.bodies):
            raise InputError.at("measure", "", "what is shown is of another workstation", "pick again")
        return np.frombuffer(seen.poses, "<f4").reshape(-1, 7).astype(float)

    def _query(self, between: tuple[str, str]) -> tuple[Query, float]:
        # One of its own: those of the model belong to the thread that judges.
        bound = self._bound
        if bound is None or bound[0] != between:
            bodies = self._model.bodies
            a, b = (self._model.select(name) for name in between)
            if unshaped := self._model.unshaped(between):
                raise Undecided(unshaped)
            if both := set(a) & set(b):
                what = f"{bodies[min(both)].name} is in both"
                raise InputError.at("measure", "between", what, "pick two things that share nothing")
            deviation = sum(max(bodies[i].deviation for i in side) for side in (a, b))
            bound = self._bound = between, Query(self._model.shapes, a, b), deviation
        return bound[1:]
