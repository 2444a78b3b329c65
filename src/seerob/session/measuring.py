"""How far two things of a workstation are from one another where a snapshot has them: to look, not to judge.

The distance is of the shapes that criteria judge and by the same kernels; poses are those of the snapshot, in
single precision, which moves nothing within 10 m by more than a micrometre.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np

from seerob.core import figures
from seerob.core.errors import InputError, Undecided
from seerob.core.snapshot import Result, Segment, Snapshot
from seerob.core.transforms import rotation_from_wxyz
from seerob.distance.least import Query
from seerob.model.model import Model


class Ruler:
    """Measures in one workstation; threads may share it.

    Args:
        model_of: Gives the compiled workstation; called when something is measured first.
    """

    def __init__(self, model_of: Callable[[], Model]) -> None:
        self._model_of = model_of
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
        if len(seen.poses) != 28 * len(model.bodies):
            raise InputError.at("measure", "", "what is shown is of another workstation", "pick again")
        for i in query.bodies:
            body = model.bodies[i]
            if reason := seen.doubts.get(body.name) or seen.doubts.get(body.mover):
                raise Undecided(f"{body.name} may be elsewhere: {reason}")
        poses = np.frombuffer(seen.poses, "<f4").reshape(-1, 7).astype(float)
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
