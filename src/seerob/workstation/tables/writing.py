"""What the twin may write, in the workstation file: Cartesian targets to ROS, triggers of machines."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

from msgspec import Meta

from seerob.core.host_name import check_host
from seerob.core.quantities import Metres3, PathName, Pose, Table, unit
from seerob.core.verdict import Verdict

Topic = Annotated[
    str,
    Meta(
        pattern=r"^/?[A-Za-z~][A-Za-z0-9_/]*$",
        max_length=200,
        description="a name of ROS such as /target_pose: letters, digits, _ and /",
    ),
]


class TargetMessage(StrEnum):
    """How a pose is published."""

    POSE_STAMPED = "geometry_msgs/PoseStamped"
    POSE = "geometry_msgs/Pose"
    TRANSFORM_STAMPED = "geometry_msgs/TransformStamped"


class TargetWire(StrEnum):
    """Over which server of ROS it is published."""

    ROSBRIDGE = "rosbridge"
    ROS_TCP = "ros_tcp"
    """Unity's ROS-TCP-Endpoint."""
    ZENOH = "zenoh"
    """A Zenoh router, for nodes of ROS 2 with rmw_zenoh."""


class Step(Table, frozen=True, kw_only=True):
    """Where the tool is to be next, and what is waited for there."""

    name: str = ""
    """For the log."""
    to: Pose
    """Pose of ``at`` in the world; with ``of`` its position counts from that workpiece, along world axes."""
    of: str = ""
    """Loose workpiece, or several (``casting_*``): the one that is nearest to ``near`` as the step begins."""
    near: Metres3 | None = None
    """Where it is looked for in the world; there must be one before the tool goes anywhere."""
    within: Annotated[float, unit("m", gt=0, le=1)] = 0.05
    """How far from there it may be [m]."""
    variable: str = ""
    """Variable of the dictionary that the tool waits for once it is there."""
    above: float | None = None
    """It is to be more than that, in SI; a bool counts as 0 or 1."""
    below: float | None = None
    """It is to be less than that."""
    pause: Annotated[float, unit("s", ge=0, le=600)] = 0.0
    """How long all of it is to hold [s]."""

    def __post_init__(self) -> None:
        if bool(self.of) != (self.near is not None):
            raise ValueError("of and near go together: which workpiece, and where it is looked for")
        if bool(self.variable) == (self.above is None and self.below is None):
            raise ValueError("a variable is waited for with above, below, or both")


class CartesianTarget(Table, frozen=True, kw_only=True):
    """Where a tool of the twin is to go, published to ROS for a controller that listens to that."""

    at: PathName
    """Full name of the link or tool that goes there (``ur10/tool0``), or the robot's: a source moves it by
    poses, or ``steps`` say where to."""
    host: str
    """Name or address of the computer with the rosbridge server, ROS-TCP endpoint or Zenoh router."""
    wire: TargetWire = TargetWire.ROSBRIDGE
    """Which of them it is."""
    port: Annotated[int, Meta(ge=1, le=65535)] | None = None
    """9090 of rosbridge, 10000 of an endpoint and 7447 of a router when not given."""
    domain: Annotated[int, Meta(ge=0, le=232)] = 0
    """With ``zenoh``: ``ROS_DOMAIN_ID``."""
    tls: bool = False
    """The connection to rosbridge is encrypted, and the server's certificate is checked."""
    topic: Topic
    """Such as ``/target_pose``; there is no usual one."""
    message: TargetMessage = TargetMessage.POSE_STAMPED
    """Type of the messages that are published."""
    ros: Annotated[int, Meta(ge=1, le=2)] = 2
    """1 for a rosbridge server of ROS 1; an endpoint says it by itself."""
    frame_id: str = "base_link"
    """Frame of ROS that poses are in."""
    link: PathName | None = None
    """Full name of the link of the twin that stands where ``frame_id`` is; the world when not given."""
    every: Annotated[float, unit("s", ge=0.01, le=60)] = 0.1
    """Least time between two targets [s]; of what comes faster, the newest is published."""
    steps: tuple[Step, ...] = ()
    """Where to, one after the other and round and round, instead of a source: the next is published once the
    twin, which hears the robot, is where the one before said."""

    def __post_init__(self) -> None:
        check_host("host", self.host)
        if self.tls and self.wire is not TargetWire.ROSBRIDGE:
            raise ValueError(f"{self.wire} is not encrypted here: leave out tls, or use rosbridge")
        if self.wire is TargetWire.ZENOH and self.ros == 1:
            raise ValueError("nodes of ROS 1 do not speak Zenoh: leave out ros, or use rosbridge")
        if self.domain and self.wire is not TargetWire.ZENOH:
            raise ValueError(f"domain does nothing with wire = {self.wire}")


# -- one bool of a machine per trigger ------------------------------------------------------------


class When(StrEnum):
    """Which verdict of a criterion makes a trigger true."""

    EXCEEDED = "exceeded"
    NOT_WITHIN = "not_within"
    """Exceeded, or undecided."""

    def holds(self, verdict: Verdict | None) -> bool:
        """Whether a verdict is one of those; no verdict is none."""
        if self is When.EXCEEDED:
            return verdict is Verdict.EXCEEDED
        return verdict in (Verdict.EXCEEDED, Verdict.UNDECIDED)


class Trigger(Table, frozen=True, kw_only=True):
    """A bool that is written to a machine when a verdict comes or goes: a lamp, a log, never a protection."""

    variable: str
    """Variable of the dictionary, a bool with ``write = true``."""
    criterion: str = ""
    """Name of the criterion whose verdict it follows."""
    control: str | None = None
    """Instead: control that it follows, a switch, button or enabling switch; true while that is."""
    when: When = When.EXCEEDED
    """Which verdicts set the variable."""
    every: Annotated[float, unit("s", ge=0.1, le=3600)] = 0.5
    """Least time between two writings [s]; what changes faster is written as it is then."""

    def __post_init__(self) -> None:
        if (self.control is None) == (not self.criterion):
            raise ValueError("it follows a verdict or a control: give criterion or control")
