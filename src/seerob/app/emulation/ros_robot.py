"""What every emulated server of ROS has: a robot that does what a motion says, and topics that tell of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Annotated, ClassVar, Literal

from seerob.app.emulation.background import LoopEmulator
from seerob.app.emulation.motions import Motion
from seerob.app.emulation.options import Rate, Ready, RobotOptions, option, port
from seerob.core.extras import need
from seerob.protocols.ros.ros_messages import Content, Edition, Joints, RosMessage

JOINT_STATES = "/joint_states"
EPOCH = 1_700_000_000.0
"""What the robot's clock begins at [s]."""
LATE = 0.5
"""Time that is not made up for when this machine was too slow [s]."""
Says = Callable[[float], RosMessage]
"""What is published at a time since the start [s]."""


def states_of(motion: Motion, names: tuple[str, ...], epoch: float) -> Says:
    """Joint states of a robot whose clock began at ``epoch`` [s]."""

    def says(t: float) -> Joints:
        q, qd = motion(t)
        return Joints(stamp=epoch + t, names=names, position=q, velocity=qd)

    return says


class RosRobot(LoopEmulator):
    """One that speaks for a robot of ROS, in a thread of its own.

    Args:
        motion: What the robot does; time counts from the start of the server.
        names: Of its joints, as ROS calls them.
        host: Address to listen on, or to connect to.
        port: 0 is any free one.
        edition: Of ROS; `usual` when not given.
        rate: Messages per second [Hz].
        more: What is published beside the joint states, by topic.
    """

    usual: ClassVar[Edition] = Edition.ROS2

    def __init__(
        self,
        motion: Motion,
        names: tuple[str, ...],
        *,
        host: str = "127.0.0.1",
        port: int = 0,
        edition: Edition | None = None,
        rate: float = 100.0,
        more: Mapping[str, tuple[Content, Says]] | None = None,
    ) -> None:
        super().__init__()
        self.host, self.port, self.rate = host, port, rate
        self.edition = self.usual if edition is None else edition
        self.epoch = EPOCH
        states = (Content.JOINT_STATE, states_of(motion, names, EPOCH))
        self.topics: dict[str, tuple[Content, Says]] = {JOINT_STATES: states, **(more or {})}
        """May be changed while it runs."""
        self._begun = 0.0


# -- options ------------------------------------------------------------------------------------


class RosOptions(RobotOptions, frozen=True, kw_only=True):
    """What emulated servers of ROS have in common."""

    port: Annotated[int, port()] = 0
    ros: Annotated[Literal["1", "2"], option("edition of ROS")] = "2"
    rate: Rate = 100.0

    def served(self, server: Callable[..., LoopEmulator]) -> Ready:
        """A server that speaks for the robot.

        Args:
            server: Made of a motion, the names of the joints, and ``host``, ``port``, ``edition``, ``rate``.

        Raises:
            InputError: No such robot, or a motion that it cannot do.
        """
        need("rosbags")
        target = self.target()
        motion, what = self.motion(target)
        made = server(
            motion,
            target.joints,
            host=self.host,
            port=self.port,
            edition=Edition(f"ros{self.ros}"),
            rate=self.rate,
        )
        return Ready(made, f"{target.name}, {what}", f"{self.host}:{self.port}")
