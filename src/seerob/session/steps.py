"""Steps of a target: where a tool goes next, told by where the twin has tool, workpieces and variables.

The robot moves, the twin hears its joints, and only what the twin has decides about the next step. Nothing is
said while the robot or the workpiece may be elsewhere, nor while a variable that is waited for is not heard.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from fnmatch import fnmatchcase

import numpy as np

from seerob.core.errors import Problem
from seerob.core.samples import PoseSample, Sample, SignalSample
from seerob.core.snapshot import Snapshot
from seerob.core.transforms import Array, rotation_from_wxyz, transform, wxyz_from_rotation
from seerob.model.model import Body, Model
from seerob.model.mounting.compilation import pose_matrix
from seerob.twin.signals import Signals
from seerob.workstation.tables.writing import CartesianTarget, Step

THERE, TURNED = 0.004, math.radians(3)
"""A tool that is nearer [m, rad] is where it was to be; our choice."""


def problems_of(model: Model, table: CartesianTarget, file: str, key: str) -> list[Problem]:
    """Names in steps that are not there.

    Args:
        model: The compiled workstation.
        table: The target.
        file: For the message.
        key: Of the target in it: ``targets[0]``.
    """
    loose = [piece.name for piece in model.workstation.workpieces if piece.loose]
    found = []
    if table.steps and _seen_with(model, table) is None:
        what = f"nothing with a shape moves with {table.at}: nobody could tell when it is there"
        found.append(Problem(file, f"{key}.at", what, "name a link or tool that moves with a shape"))
    for i, step in enumerate(table.steps):
        if step.variable and step.variable not in model.dictionary:
            what = f"no variable {step.variable!r}"
            found.append(Problem(file, f"{key}.steps[{i}].variable", what, ", ".join(model.dictionary)))
        if step.of and not any(fnmatchcase(name, step.of) for name in loose):
            what = f"no loose workpiece {step.of!r}"
            found.append(Problem(file, f"{key}.steps[{i}].of", what, ", ".join(loose) or "add one"))
    return found


class Steps:
    """The steps of one target at work.

    Args:
        model: The compiled workstation.
        table: The target, with steps.
        timeouts: Of variables [s], by name.
    """

    def __init__(self, model: Model, table: CartesianTarget, timeouts: Mapping[str, float]) -> None:
        self._steps, self._frame = table.steps, model.frame(table.at)
        self._mover = model.carrier(self._frame).name
        self._model, self._name = model, self._frame.name
        seen = _seen_with(model, table)
        assert seen is not None  # `problems_of` says so before a run
        self._body, self._body_from_at = seen
        owners = {body.owner: body for body in model.bodies}
        self._pieces = [
            (piece.name, owners[piece.name]) for piece in model.workstation.workpieces if piece.loose
        ]
        self._signals = Signals(model.dictionary, timeouts)
        self._at, self._seq = 0, 0
        self._goal: Array | None = None
        self._since = math.nan
        self.word = ""
        """What is waited for, in words."""

    def next(self, snapshot: Snapshot, samples: Sequence[Sample]) -> PoseSample | None:
        """Where the tool is to be now; None while that cannot be said, which `word` explains.

        Args:
            snapshot: Of a tick.
            samples: That it consumed.
        """
        for sample in samples:
            if isinstance(sample, SignalSample):
                self._signals.take(sample)
        self._signals.forget(snapshot.t)
        step = self._steps[self._at]
        if doubt := snapshot.doubts.get(self._body.name) or snapshot.doubts.get(self._mover):
            self.word, self._since = doubt, math.nan
            return None
        if self._goal is None:
            self._goal = self._goal_of(step, snapshot)
            if self._goal is None:
                return None
        if self._over(step, self._goal, snapshot):
            self._at, self._goal, self._since = (self._at + 1) % len(self._steps), None, math.nan
            return None
        self._seq += 1
        w, x, y, z = wxyz_from_rotation(self._goal[:3, :3]).tolist()
        place = self._goal[:3, 3].tolist()
        return PoseSample(
            source="steps",
            seq=self._seq,
            t=snapshot.t,
            target=self._name,
            position=(place[0], place[1], place[2]),
            wxyz=(w, x, y, z),
        )

    def _goal_of(self, step: Step, snapshot: Snapshot) -> Array | None:
        """World from tool at the end of a step (4, 4)."""
        goal: Array = pose_matrix(step.to).copy()
        if step.near is None:
            return goal
        near = np.array(step.near)
        places = [
            _pose(snapshot, body)[:3, 3]
            for name, body in self._pieces
            if fnmatchcase(name, step.of)
            and not (snapshot.doubts.get(body.name) or snapshot.doubts.get(body.mover))
        ]
        place = min(places, key=lambda each: float(np.linalg.norm(each - near)), default=None)
        if place is None or np.linalg.norm(place - near) > step.within:
            self.word = f"{step.name or 'a step'} waits for {step.of}"
            return None
        goal[:3, 3] += place
        return goal

    def _over(self, step: Step, goal: Array, snapshot: Snapshot) -> bool:
        """Whether the tool is there, and what was waited for has come."""
        self.word = f"on the way to {step.name or 'the next step'}"
        now = _pose(snapshot, self._body) @ self._body_from_at
        turn = float(np.clip((np.trace(now[:3, :3].T @ goal[:3, :3]) - 1) / 2, -1, 1))
        if np.linalg.norm(now[:3, 3] - goal[:3, 3]) > THERE or math.acos(turn) > TURNED:
            self._since = math.nan
            return False
        if step.variable:
            known = self._signals.at(step.variable, snapshot.t)
            self.word = known.invalid_reason or f"{step.name or 'a step'} waits for {step.variable}"
            if known.invalid_reason or isinstance(known.value, str) or known.value is None:
                self._since = math.nan
                return False
            low = -math.inf if step.above is None else step.above
            high = math.inf if step.below is None else step.below
            if not low < float(known.value) < high:
                self._since = math.nan
                return False
        if math.isnan(self._since):
            self._since = snapshot.t
        return snapshot.t - self._since >= step.pause


def _seen_with(model: Model, table: CartesianTarget) -> tuple[Body, Array] | None:
    """A body of the robot that moves with what goes there, and where on it that is (4, 4); None without one.

    A link without a shape is no body of snapshots.
    """
    frame = model.frame(table.at)
    mover = model.carrier(frame).name
    for body in model.bodies:
        if body.carrier == mover and body.name in model.frames:
            between = model.between(model.frames[body.name], frame)
            if between is not None:
                return body, between
    return None


def _pose(snapshot: Snapshot, body: Body) -> Array:
    """World from a body (4, 4)."""
    row = np.frombuffer(snapshot.poses, "<f4", 7, 28 * body.index).astype(float)
    return transform(rotation_from_wxyz(row[3:] / np.linalg.norm(row[3:])), row[:3])
