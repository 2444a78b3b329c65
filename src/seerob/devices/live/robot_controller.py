"""What controllers of one robot share, which say its joints at a rate that is known."""

from __future__ import annotations

from enum import IntEnum
from pathlib import Path
from typing import ClassVar

from seerob.core.motion_origin import MotionOrigin
from seerob.core.plugin import kind_of
from seerob.devices.live.listening import LiveSource
from seerob.workstation.source import Opened, Target, driven_robot


def state_name(kind: type[IntEnum], number: int) -> str:
    """Name of a state as the maker has it; the number of one that nobody explained."""
    return kind(number).name if number in kind.__members__.values() else str(number)


class RobotController(LiveSource, frozen=True, kw_only=True):
    """Base of the sources that are the controller of one robot."""

    links: ClassVar[bool] = False
    joints: ClassVar[int]
    """As many as every such robot has."""
    whose: ClassVar[str]
    """Who says so many, with the verb: ``an LBR has``."""
    robot: str
    """The robot it drives."""
    host: str
    """Name or address of the controller."""
    frequency: float
    """Samples per second [Hz]."""
    origin: MotionOrigin = MotionOrigin.CONTROLLER
    """``vendor_emulator`` when it is the maker's simulator."""

    def target(self) -> str:
        """The robot."""
        return self.robot

    def period(self) -> float:
        """Interval between samples that is expected [s]."""
        return 1 / self.frequency

    def open(self, folder: Path, target: Target | None) -> Opened:
        """Check the robot; connects to nothing.

        Raises:
            InputError: The robot has another number of joints.
        """
        where = f"{kind_of('sources', self)} {self.host}"
        robot = driven_robot(target, self.robot, where, joints=self.joints, whose=self.whose)
        return super().open(folder, robot)
