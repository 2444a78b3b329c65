"""What a source of waypoints is for those who draw them; they do not know the source."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol, runtime_checkable

from seerob.files.waypoints.arm import Arm
from seerob.files.waypoints.continuous import Continuous
from seerob.files.waypoints.joint_limits import JointLimits
from seerob.files.waypoints.waypoint import Program
from seerob.workstation.source import Target


@runtime_checkable
class Programmed(Protocol):
    """A source whose motion goes through waypoints; see `seerob.devices.sources.waypoints`."""

    robot: str
    file: str

    def program(self, path: Path) -> Program:
        """The waypoints."""

    def arm(self, program: Program, target: Target) -> tuple[Arm, tuple[str, ...]]:
        """The robot up to its tool point, and what is assumed of both."""

    def motion(self, program: Program, arm: Arm, limits: JointLimits) -> Continuous:
        """The continuous motion."""
