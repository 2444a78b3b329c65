"""What every live source of ROS has in common: options, checks, and the way from messages to samples."""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncGenerator
from contextlib import aclosing
from pathlib import Path
from typing import Annotated

import numpy as np
from msgspec import Meta
from msgspec.structs import replace

from seerob.core.errors import InputError
from seerob.core.samples import JointSample, PoseSample, Quality, Sample
from seerob.core.snapshot import Finding
from seerob.core.transforms import Array, wxyz_from_rotation
from seerob.devices.live.listening import LiveSource
from seerob.devices.motion_files import PoseFrame
from seerob.devices.ros.frames import STATIC, FrameTree, driven, world_from_parent
from seerob.devices.ros.joints import JointGather, PlayedPlan
from seerob.files.trajectories.trajectory import MotionOrigin, origin_finding
from seerob.protocols import ProtocolError
from seerob.protocols.ros.ros_messages import Content, Joints, Plan, Said
from seerob.protocols.ros.rosbridge import SILENCE, Heard
from seerob.workstation.source import Opened, Target

ASKED = 1.2
"""How long the first message is waited for at start [s]."""


class RosSource(LiveSource, frozen=True, kw_only=True):
    """Base of the sources that hear one robot's ROS messages."""

    robot: str
    """The robot it drives."""
    content: Content = Content.JOINT_STATE
    """``joint_state``, ``tf`` (the pose of its tool; the joints are solved) or ``trajectory`` (what somebody
    commands, played from its arrival as if the robot followed it)."""
    topic: str = ""
    """``/joint_states``, ``/tf`` or ``/joint_trajectory`` when not given."""
    joints: tuple[str, ...] = ()
    """Names of its joints in ROS, in the robot's order; the robot's own names when not given."""
    parent: str = "base_link"
    """With ``tf``: frame that the pose is taken in."""
    child: str = "tool0"
    """With ``tf``: frame whose pose is taken."""
    frame: PoseFrame = PoseFrame.BASE
    """With ``tf``: ``base`` when ``parent`` is a link of the robot, ``world`` when it is the workstation's
    origin."""
    at: str | None = None
    """With ``tf``: full name of the link or tool that ``child`` is (``ur10/tool0``); the robot's link of that
    name when not given."""
    frequency: Annotated[float, Meta(ge=1, le=1000, extra={"unit": "Hz"})] = 100.0
    """Messages per second that are expected, and no more are asked for where that can be said [Hz]."""
    origin: MotionOrigin = MotionOrigin.CONTROLLER
    """``simulator`` when it is Gazebo or the like; a trajectory is ``planned`` in any case."""

    def target(self) -> str:
        """The robot."""
        return self.robot

    def period(self) -> float:
        """Interval between samples that is expected [s]."""
        return 1 / self.frequency

    def topics(self) -> tuple[str, ...]:
        """What is to be subscribed, the one that is watched first."""
        own = self.topic or self.content.topic
        return (own, STATIC) if self.content is Content.TF else (own,)

    def silence(self) -> float | None:
        """Longest pause of the watched topic [s]; commands come when they come."""
        return None if self.content is Content.TRAJECTORY else SILENCE

    def heard(self) -> AsyncGenerator[Heard, None]:
        """Connect, and yield the messages of the topics.

        Raises:
            OSError: There is no connection, or no longer.
            ProtocolError: What comes cannot be understood.
        """
        raise NotImplementedError

    def where(self) -> str:
        """The other end, for messages."""
        raise NotImplementedError

    def open(self, folder: Path, target: Target | None) -> Opened:
        """Check the names against the robot, and ask the other end, if it can be reached.

        Raises:
            InputError: A name that is not there, or messages of other joints.
        """
        if target is None:
            raise InputError.at("sources", "robot", f"no robot {self.robot!r}", "name a robot")
        if self.joints and len(self.joints) != len(target.joints):
            what = f"{len(self.joints)} joints for the {len(target.joints)} of {target.name}"
            raise InputError.at(
                self.where(), "joints", what, f"name one for each of {', '.join(target.joints)}"
            )
        if self.content is Content.TF:
            self._world_from_parent(target)
            self._driven(target)
        return LiveSource.open(replace(self, joints=self.joints or target.joints), folder, target)

    async def ask(self) -> tuple[Finding, ...]:
        """Whose motion it is, and what the first message says and leaves out."""
        origin = MotionOrigin.PLANNED if self.content is Content.TRAJECTORY else self.origin
        first: Said | None = None
        try:
            async with asyncio.timeout(ASKED), aclosing(self.heard()) as messages:
                async for heard in messages:
                    if heard.topic == self.topics()[0]:
                        first = heard.said
                        break
        except TimeoutError:
            if self.content is not Content.TRAJECTORY:
                raise TimeoutError(f"nothing came on {self.topics()[0]} within {ASKED:g} s") from None
        if origin is MotionOrigin.CONTROLLER:
            text = f"motion heard from the robot, as it happens ({self.where()})"
            said = [Finding(level="note", subject=self.robot, text=text)]
        else:
            said = [origin_finding(origin, self.robot, self.where())]
        if isinstance(first, Joints):
            self._check_names(first)
            said += [Finding(level=k, subject=self.robot, text=text) for k, text in _remarks(first)]
        if self.content is Content.TF:
            text = (
                f"joints are solved from the pose of {self.child!r} in {self.parent!r}: the branch, and what "
                "a redundant robot does beside its tool, may differ from the controller's; what depends on "
                "them is preliminary"
            )
            said.append(Finding(level="assumed", subject=self.robot, text=text))
        return tuple(said)

    def _check_names(self, first: Joints) -> None:
        """Another publisher may have the rest; but of none of the joints is another robot."""
        if self.joints and not set(self.joints) & set(first.names):
            what = f"messages of {', '.join(first.names[:12])}; {self.robot} has {', '.join(self.joints)}"
            raise InputError.at(
                self.where(), "joints", what, "give joints = [names in ROS, in the robot's order]"
            )

    async def listen(self, target: Target | None) -> AsyncGenerator[Sample, None]:
        """Samples of the robot."""
        async with aclosing(self.heard()) as messages:
            match self.content:
                case Content.JOINT_STATE:
                    samples: AsyncGenerator[Sample, None] = self._joint_samples(messages, target)
                case Content.TF:
                    samples = self._poses(messages, target)
                case Content.TRAJECTORY:
                    samples = self._played(messages, target)
            async with aclosing(samples):
                async for sample in samples:
                    yield sample

    def _names(self, target: Target | None) -> tuple[str, ...]:
        return self.joints or (() if target is None else target.joints)

    async def _joint_samples(
        self, messages: AsyncGenerator[Heard, None], target: Target | None
    ) -> AsyncGenerator[Sample, None]:
        gather = JointGather(self.robot, self._names(target), self.period())
        last = time.monotonic()
        async for heard in messages:
            sample = gather.take(heard.arrived, heard.said) if isinstance(heard.said, Joints) else None
            if sample is not None:
                last = heard.arrived
                yield sample
            elif heard.arrived - last > SILENCE:
                raise ProtocolError(f"{heard.topic}: {gather.lacking()}")

    async def _poses(
        self, messages: AsyncGenerator[Heard, None], target: Target | None
    ) -> AsyncGenerator[Sample, None]:
        tree = FrameTree(self.parent, self.child)
        world_from_parent = np.eye(4) if target is None else self._world_from_parent(target)
        driven = self.robot if target is None else self._driven(target)
        last = time.monotonic()
        async for heard in messages:
            if not isinstance(heard.said, tuple):
                continue
            concerns = tree.take(heard.said, fixed=heard.topic == STATIC)
            found = tree.pose() if concerns and heard.topic != STATIC else None
            if found is not None:
                last = heard.arrived
                yield _pose_sample(world_from_parent @ found[0], found[1], heard.arrived, driven)
            elif heard.arrived - last > SILENCE:
                raise ProtocolError(f"{heard.topic}: {tree.lacking()}")

    async def _played(
        self, messages: AsyncGenerator[Heard, None], target: Target | None
    ) -> AsyncGenerator[Sample, None]:
        names = self._names(target)
        plan: PlayedPlan | None = None
        begun = 0.0
        waiting: asyncio.Task[Heard] | None = None
        try:
            while True:
                waiting = waiting or asyncio.ensure_future(anext(messages))
                done, _ = await asyncio.wait({waiting}, timeout=None if plan is None else self.period())
                if done:
                    ended, waiting = waiting, None
                    try:
                        heard = ended.result()
                    except StopAsyncIteration:
                        return
                    if isinstance(heard.said, Plan):
                        plan, begun = PlayedPlan(heard.said, names), heard.arrived
                now = time.monotonic()
                at = None if plan is None else plan.at(now - begun)
                if at is not None:
                    yield JointSample(source="", seq=0, t=now, target=self.robot, q=at[0], qd=at[1])
        finally:
            if waiting is not None:
                waiting.cancel()
                await asyncio.gather(waiting, return_exceptions=True)

    def _world_from_parent(self, target: Target) -> Array:
        return world_from_parent(target, self.parent, self.frame, self.where())

    def _driven(self, target: Target) -> str:
        return driven(target, self.at or f"{target.name}/{self.child}", self.where())


def _pose_sample(pose: Array, stamp: float | None, arrived: float, driven: str) -> PoseSample:
    fine = bool(np.isfinite(pose).all())
    w, x, y, z = wxyz_from_rotation(pose[:3, :3]).tolist() if fine else (float("nan"),) * 4
    px, py, pz = pose[:3, 3].tolist()
    return PoseSample(
        source="",
        seq=0,
        t=arrived,
        t_device=stamp,
        target=driven,
        position=(px, py, pz),
        wxyz=(w, x, y, z),
        quality=Quality.GOOD if fine else Quality.INVALID,
    )


def _remarks(first: Joints) -> list[tuple[str, str]]:
    said = [("note", f"joints that are heard: {', '.join(first.names[:32])}")]
    if not first.velocity:
        said.append(("assumed", "no joint speeds: derived from the positions"))
    if not first.effort:
        said.append(("note", "no joint torques"))
    if first.stamp is None:
        said.append(("assumed", "messages have no stamp: they count as of their arrival"))
    return said
