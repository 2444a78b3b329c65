"""What the state numbers of a Universal Robots controller mean, and what they mean for a sample.

Numbers as in ``datatypes.h`` of the maker's client library, 2.14.0.
"""

from __future__ import annotations

from enum import IntEnum
from functools import cache

from seerob.core.samples import Quality


class RobotMode(IntEnum):
    """Field ``robot_mode``."""

    NO_CONTROLLER = -1
    DISCONNECTED = 0
    CONFIRM_SAFETY = 1
    BOOTING = 2
    POWER_OFF = 3
    POWER_ON = 4
    IDLE = 5
    BACKDRIVE = 6
    RUNNING = 7
    UPDATING_FIRMWARE = 8


class SafetyStatus(IntEnum):
    """Fields ``safety_status`` and ``safety_mode``."""

    NORMAL = 1
    REDUCED = 2
    PROTECTIVE_STOP = 3
    RECOVERY = 4
    SAFEGUARD_STOP = 5
    SYSTEM_EMERGENCY_STOP = 6
    ROBOT_EMERGENCY_STOP = 7
    VIOLATION = 8
    FAULT = 9
    VALIDATE_JOINT_ID = 10
    UNDEFINED = 11
    AUTOMATIC_MODE_SAFEGUARD_STOP = 12
    SYSTEM_THREE_POSITION_ENABLING_STOP = 13
    TP_THREE_POSITION_ENABLING_STOP = 14
    IMMI_EMERGENCY_STOP = 15
    IMMI_SAFEGUARD_STOP = 16
    PROFISAFE_WAITING_FOR_PARAMETERS = 17
    PROFISAFE_AUTOMATIC_MODE_SAFEGUARD_STOP = 18
    PROFISAFE_SAFEGUARD_STOP = 19
    PROFISAFE_EMERGENCY_STOP = 20
    SAFETY_API_SAFEGUARD_STOP = 22


LIVE_ENCODERS = frozenset({RobotMode.POWER_ON, RobotMode.IDLE, RobotMode.BACKDRIVE, RobotMode.RUNNING})
"""Robot modes in which the joints are powered and say where they are."""
UNSURE_OF_ITSELF = frozenset({SafetyStatus.VALIDATE_JOINT_ID, SafetyStatus.UNDEFINED})
"""The controller does not know its joints."""
DOUBTFUL = frozenset({SafetyStatus.VIOLATION, SafetyStatus.FAULT})
"""Something is broken; what it says of itself may be too."""


def quality(robot_mode: int | None, safety_status: int | None) -> Quality:
    """Whether the joint positions of a sample are the truth.

    A stop, even an emergency stop, is no reason for doubt: the joints stand where they say. The way of
    speaking of an unknown number is doubt.

    Args:
        robot_mode: None when the controller has no such field, which leaves in doubt whether it is on.
        safety_status: None when it has no such field.
    """
    if safety_status in UNSURE_OF_ITSELF:
        return Quality.INVALID
    if robot_mode is None:
        return Quality.DEGRADED
    if robot_mode not in LIVE_ENCODERS:
        return Quality.INVALID
    if safety_status is not None and (safety_status in DOUBTFUL or name(SafetyStatus, safety_status) is None):
        return Quality.DEGRADED
    return Quality.GOOD


def name(numbers: type[IntEnum], number: int) -> str | None:
    """Name of a number; None for one that nobody explained."""
    return _names(numbers).get(number)


@cache
def _names(numbers: type[IntEnum]) -> dict[int, str]:
    return {int(one): one.name for one in numbers}
