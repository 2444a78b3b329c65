"""A criterion of one's own that asks for speeds and says nothing of their noise: ``own.joint_speed``."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from seerob.api import Basis, Criterion, Evaluate, Model, Result, State, judge


class JointSpeed(Criterion, frozen=True, kw_only=True):
    """Norm of a robot's joint velocities."""

    unit: ClassVar[str] = "rad/s"
    by_shape: ClassVar[bool] = False

    robot: str
    limit: float

    def subjects(self) -> tuple[str, ...]:
        """The robot."""
        return (self.robot,)

    def bind(self, model: Model) -> Evaluate:
        """See `Criterion.bind`."""
        robot = model.robot(self.robot)

        def evaluate(state: State) -> Result:
            speed = float(np.linalg.norm(state.qd(robot)))
            verdict = judge(speed, self.limit)
            return Result(name=self.name, value=speed, unit=self.unit, limit=self.limit, verdict=verdict)

        return evaluate

    def basis(self, model: Model) -> Basis:
        """See `Criterion.basis`."""
        return Basis(formula="|q̇|", source="here")
