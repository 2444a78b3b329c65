"""What a source of waypoints is for those who draw them; they do not know the source."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol, runtime_checkable

from seerob.source import Target
from seerob.waypoints.arm import Arm
from seerob.waypoints.continuous import Continuous
from seerob.waypoints.joint_limits import JointLimits
from seerob.waypoints.waypoint import Program


@runtime_checkable
class Programmed(Protocol):
    """A source whose motion goes through waypoints; see `seerob.sources.waypoints`."""

    robot: str
    file: str

    def program(self, path: Path) -> Program:
        """The waypoints."""

    def arm(self, program: Program, target: Target) -> tuple[Arm, tuple[str, ...]]:
        """The robot up to its tool point, and what is assumed of both."""

    def motion(self, program: Program, arm: Arm, limits: JointLimits) -> Continuous:
        """The continuous motion."""
