"""What the sources of ROS share: joints by name, transforms, and the way from live messages to samples."""

from __future__ import annotations

import asyncio
import math
import time
from bisect import bisect_right
from collections.abc import AsyncGenerator
from contextlib import aclosing
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
from msgspec import Meta
from msgspec.structs import replace

from seerob.core.errors import InputError, suggestion
from seerob.core.motion_origin import MotionOrigin, origin_finding
from seerob.core.samples import JointSample, PoseSample, Quality, Sample
from seerob.core.snapshot import Finding
from seerob.core.transforms import Array, rotation_from_wxyz, transform, wxyz_from_rotation
from seerob.devices.live.listening import LiveSource
from seerob.devices.motion_files import PoseFrame, fixed_links
from seerob.protocols import ProtocolError
from seerob.protocols.ros.ros_messages import Content, Joints, Plan, RosMessage, Transform
from seerob.protocols.ros.rosbridge import SILENCE, ReceivedMessage
from seerob.workstation.source import Opened, Target

STATIC = "/tf_static"
"""Where frames are said that never change."""
LONGEST = 64
"""Edges of a chain."""
MOST_FRAMES = 4096
UNIT = 1e-2
"""A quaternion whose length is off by more is none."""


class FrameTree:
    """What is known of the frames.

    Args:
        parent: Frame that is wanted as parent.
        child: Frame whose pose is wanted.
    """

    def __init__(self, parent: str, child: str) -> None:
        self._parent, self._child = parent, child
        self._edges: dict[str, tuple[str, float | None, Array, bool]] = {}

    def take(self, transforms: tuple[Transform, ...], *, fixed: bool) -> bool:
        """Note them; whether one of the chain is among them.

        Args:
            transforms: What a message says.
            fixed: Whether they never change (``/tf_static``).
        """
        for said in transforms:
            if said.child in self._edges or len(self._edges) < MOST_FRAMES:
                self._edges[said.child] = (said.parent, said.stamp, _matrix(said), fixed)
        on = {child for child, _ in self._chain()}
        return any(said.child in on for said in transforms)

    def pose(self) -> tuple[Array, float | None] | None:
        """Parent from child (4, 4), NaN where one edge is none, and the stamp of the oldest moving edge [s].

        None when the chain is not known, or nothing in it moves and nobody says when that was.
        """
        chain = self._chain()
        if not chain or self._edges[chain[-1][0]][0] != self._parent:
            return None
        matrix = np.eye(4)
        stamps: list[float | None] = []
        for child, _ in reversed(chain):
            _, stamp, edge, fixed = self._edges[child]
            matrix = matrix @ edge
            if not fixed:
                stamps.append(stamp)
        known = [s for s in stamps if s is not None]
        return matrix, min(known) if known and len(known) == len(stamps) else None

    def at_once(self) -> bool:
        """Whether what moves in the chain was last said of one instant."""
        edges = [self._edges[child] for child, _ in self._chain()]
        return len({stamp for _, stamp, _, fixed in edges if not fixed}) == 1

    def lacking(self) -> str:
        """Why there is no pose, for a message."""
        frames = sorted({*self._edges, *(e[0] for e in self._edges.values())})
        shown = ", ".join(frames[:16]) or "none"
        return f"nothing leads from {self._parent!r} to {self._child!r}; frames that are heard: {shown}"

    def _chain(self) -> list[tuple[str, str]]:
        """Child and parent of each edge, from the child upwards, as far as the parent or as is known."""
        found: list[tuple[str, str]] = []
        frame = self._child
        while frame in self._edges and frame != self._parent and len(found) < LONGEST:
            found.append((frame, self._edges[frame][0]))
            frame = self._edges[frame][0]
        return found


def _matrix(said: Transform) -> Array:
    length = math.hypot(*said.wxyz)
    if not (math.isfinite(length) and abs(length - 1) < UNIT):
        return np.full((4, 4), np.nan)
    return transform(rotation_from_wxyz(np.array(said.wxyz) / length), said.position)


def world_from_parent(target: Target, parent: str, frame: PoseFrame, where: str) -> Array:
    """Where the parent stands in the workstation, (4, 4).

    Args:
        target: The robot.
        parent: Frame of ROS, which is a link of the robot of the same name or the workstation's origin.
        frame: Which of both.
        where: The other end or the file, for messages.

    Raises:
        InputError: The robot has no such link that stands still.
    """
    if frame is PoseFrame.WORLD:
        return np.eye(4)
    fixed = fixed_links(target)
    name = f"{target.name}/{parent}"
    if name not in fixed or target.world_from_base is None:
        what = f"no link {name!r} that stands still with {target.name}"
        remedy = f'{suggestion(name, fixed)}; or frame = "world" when {parent!r} is its origin'
        raise InputError.at(where, "parent", what, remedy)
    return np.array(target.world_from_base) @ fixed[name]


def driven(target: Target, at: str, where: str) -> str:
    """Full name of what a pose drives.

    Args:
        target: The robot.
        at: What it should be.
        where: The other end or the file, for messages.

    Raises:
        InputError: The robot does not move it.
    """
    if target.frames and at not in (*target.frames, target.name):
        what = f"no link or tool {at!r} that {target.name} moves"
        raise InputError.at(where, "at", what, suggestion(at, target.frames))
    return at


MOST_SKEW = 2.0
"""Periods by which the joints of one sample may be apart before it is no longer judged."""


class _Last(NamedTuple):
    arrived: float
    stamp: float | None
    q: float
    qd: float | None
    tau: float | None


class JointGather:
    """Puts together what is said of a robot's joints.

    Several publishers may share a topic, an arm and a gripper for instance, and no message need have all
    joints: there is a sample whenever each joint was heard since the last one. It speaks of the instant of
    the oldest of them.

    Args:
        target: The robot.
        names: Its joints as ROS calls them, in the robot's order; those of the first message when empty.
        period: Expected between messages [s].
    """

    def __init__(self, target: str, names: tuple[str, ...], period: float) -> None:
        self._target, self._names, self._period = target, names, period
        self._last: dict[str, _Last] = {}
        self._others: dict[str, None] = {}

    def take(self, arrived: float, said: Joints) -> JointSample | None:
        """A sample, when a message completes one.

        Args:
            arrived: Host's monotonic time [s].
            said: The message.
        """
        if not said.position:
            return None
        names = self._names = self._names or said.names
        for k, name in enumerate(said.names):
            if name in names:
                self._last[name] = _Last(
                    arrived,
                    said.stamp,
                    said.position[k],
                    said.velocity[k] if said.velocity else None,
                    said.effort[k] if said.effort else None,
                )
            elif len(self._others) < 16:
                self._others[name] = None
        if len(self._last) < len(names):
            return None
        every = [self._last[name] for name in names]
        self._last.clear()
        stamps = [last.stamp for last in every if last.stamp is not None]
        stamped = len(stamps) == len(every)
        instants = stamps if stamped else [last.arrived for last in every]
        q = tuple(last.q for last in every)
        quality = Quality.GOOD
        if max(instants) - min(instants) > MOST_SKEW * self._period:
            quality = Quality.DEGRADED
        if not all(map(math.isfinite, q)):
            quality = Quality.INVALID
        return JointSample(
            source="",
            seq=0,
            t=arrived,
            t_device=min(stamps) if stamped else None,
            target=self._target,
            q=q,
            qd=_all([last.qd for last in every]),
            tau=_all([last.tau for last in every]),
            quality=quality,
        )

    def lacking(self) -> str:
        """Why there is no sample, for a message."""
        lost = [name for name in self._names if name not in self._last]
        others = ", ".join(self._others) or "none"
        return f"nothing is said of {', '.join(lost[:12]) or 'any joint'}; other joints that are: {others}"


def _all(values: list[float | None]) -> tuple[float, ...] | None:
    """None when one is not known: half of the speeds are no speeds."""
    known = tuple(v for v in values if v is not None and math.isfinite(v))
    return known if len(known) == len(values) else None


class PlayedPlan:
    """A trajectory that somebody commanded, as if a robot followed it exactly.

    Between points it is the cubic with their positions and speeds, or a straight line when there are none.

    Args:
        plan: The trajectory.
        names: The robot's joints as ROS calls them, in its order; those of the plan when empty.

    Raises:
        ProtocolError: It has no points, not all joints, or values that are not finite.
    """

    def __init__(self, plan: Plan, names: tuple[str, ...]) -> None:
        names = names or plan.names
        lost = [name for name in names if name not in plan.names]
        if lost or not plan.points:
            raise ProtocolError(f"a trajectory without {', '.join(lost[:12]) or 'points'}")
        order = [plan.names.index(name) for name in names]
        self.times = [p.t for p in plan.points]
        self._q = [tuple(p.position[k] for k in order) for p in plan.points]
        self._qd = [tuple(p.velocity[k] for k in order) if p.velocity else None for p in plan.points]
        if not all(math.isfinite(x) for row in [*self._q, *(v for v in self._qd if v)] for x in row):
            raise ProtocolError("a trajectory with values that are not finite")

    def at(self, t: float) -> tuple[tuple[float, ...], tuple[float, ...]] | None:
        """Positions and speeds at a time since its start [s]; None before its first point."""
        if t < self.times[0]:
            return None
        if t >= self.times[-1]:
            return self._q[-1], (0.0,) * len(self._q[-1])
        k = bisect_right(self.times, t) - 1
        T = self.times[k + 1] - self.times[k]
        s = (t - self.times[k]) / T
        a, b, va, vb = self._q[k], self._q[k + 1], self._qd[k], self._qd[k + 1]
        if va is None or vb is None:
            q = tuple(x + s * (y - x) for x, y in zip(a, b, strict=True))
            return q, tuple((y - x) / T for x, y in zip(a, b, strict=True))
        # Cubic Hermite polynomial.
        h = (1 - 3 * s**2 + 2 * s**3, 3 * s**2 - 2 * s**3, T * s * (1 - s) ** 2, T * s**2 * (s - 1))
        d = (6 * s * (s - 1) / T, 6 * s * (1 - s) / T, (1 - s) * (1 - 3 * s), s * (3 * s - 2))
        rows = list(zip(a, b, va, vb, strict=True))
        return (
            tuple(sum(w * x for w, x in zip(h, row, strict=True)) for row in rows),
            tuple(sum(w * x for w, x in zip(d, row, strict=True)) for row in rows),
        )


LISTEN_AT_START = 1.2
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

    def heard(self) -> AsyncGenerator[ReceivedMessage, None]:
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
        at = None
        if self.content is Content.TF:
            self._world_from_parent(target)
            at = self._driven(target)
        opened = LiveSource.open(replace(self, joints=self.joints or target.joints), folder, target)
        return replace(opened, poses_of=at)

    async def ask(self) -> tuple[Finding, ...]:
        """Whose motion it is, and what the first message says and leaves out."""
        origin = MotionOrigin.PLANNED if self.content is Content.TRAJECTORY else self.origin
        first: RosMessage | None = None
        try:
            async with asyncio.timeout(LISTEN_AT_START), aclosing(self.heard()) as messages:
                async for heard in messages:
                    if heard.topic == self.topics()[0]:
                        first = heard.said
                        break
        except TimeoutError:
            if self.content is not Content.TRAJECTORY:
                raise TimeoutError(
                    f"nothing came on {self.topics()[0]} within {LISTEN_AT_START:g} s"
                ) from None
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
        doubt = ""

        async def noted(
            messages: AsyncGenerator[ReceivedMessage, None],
        ) -> AsyncGenerator[ReceivedMessage, None]:
            nonlocal doubt
            async for heard in messages:
                doubt = heard.doubt
                yield heard

        async with aclosing(self.heard()) as every, aclosing(noted(every)) as messages:
            match self.content:
                case Content.JOINT_STATE:
                    samples: AsyncGenerator[Sample, None] = self._joint_samples(messages, target)
                case Content.TF:
                    samples = self._poses(messages, target)
                case Content.TRAJECTORY:
                    samples = self._played(messages, target)
            async with aclosing(samples):
                async for sample in samples:
                    yield replace(sample, reason=doubt) if doubt else sample

    def _names(self, target: Target | None) -> tuple[str, ...]:
        return self.joints or (() if target is None else target.joints)

    async def _joint_samples(
        self, messages: AsyncGenerator[ReceivedMessage, None], target: Target | None
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
        self, messages: AsyncGenerator[ReceivedMessage, None], target: Target | None
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
        self, messages: AsyncGenerator[ReceivedMessage, None], target: Target | None
    ) -> AsyncGenerator[Sample, None]:
        names = self._names(target)
        plan: PlayedPlan | None = None
        begun = 0.0
        waiting: asyncio.Task[ReceivedMessage] | None = None
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
