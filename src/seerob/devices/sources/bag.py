"""A robot's motion out of a ROS bag: ROS 1, and ROS 2 in SQLite or MCAP.

Joint states by name, a commanded trajectory, or the pose of the tool out of tf (the joints are solved then).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from seerob.core.errors import InputError
from seerob.core.motion_origin import origin_finding
from seerob.core.samples import JointSample, Quality
from seerob.core.snapshot import Finding
from seerob.core.transforms import Array, wxyz_from_rotation
from seerob.devices.motion_files import PoseFrame, TrajectoryFile, fixed_links
from seerob.devices.ros import STATIC, FrameTree, JointGather, driven, world_from_parent
from seerob.files.motion_capture import ros_bag
from seerob.files.motion_capture.ros_bag import Recorded, TimeBase, topics_of
from seerob.files.trajectories.checks import sampling_findings
from seerob.files.trajectories.tool_trajectory import PoseSamples, ToolTrajectory, plausible
from seerob.files.trajectories.trajectory import MAX_SAMPLES, Trajectory
from seerob.protocols.ros.ros_messages import Content, Joints, Plan
from seerob.workstation.source import Opened, Target

TF = Content.TF.topic
SAME_INSTANT = 1e-6
"""Samples that are not later by more are dropped: a message that was recorded twice [s]."""


class Bag(TrajectoryFile, frozen=True, kw_only=True):
    """A robot's motion out of a ROS bag (ROS 1, ROS 2 in SQLite or MCAP)."""

    content: Content = Content.JOINT_STATE
    """``joint_state``, ``tf`` (the pose of its tool; the joints are solved) or ``trajectory``: what somebody
    commanded."""
    topic: str = ""
    """The usual one, or the only one of its type, when not given."""
    joints: tuple[str, ...] = ()
    """Names of its joints in ROS, in the robot's order; the robot's own names when not given."""
    time_base: TimeBase = TimeBase.HEADER
    """``header``: the stamps of the messages; ``received``: when they were recorded."""
    parent: str = "base_link"
    """Frame that the pose of ``tf`` is taken in; with ``joint_state`` it is compared with the twin's, where
    it is a link of the robot that stands still."""
    child: str = "tool0"
    """With ``tf``: frame whose pose is taken."""
    frame: PoseFrame = PoseFrame.BASE
    """With ``tf``: ``base`` when ``parent`` is a link of the robot, ``world`` when it is the workstation's
    origin."""
    at: str | None = None
    """With ``tf``: full name of the link or tool that ``child`` is (``ur10/tool0``); the robot's link of that
    name when not given."""

    def open(self, folder: Path, target: Target | None) -> Opened:
        """Read the bag, and check the motion against the robot.

        Raises:
            InputError: The bag is missing or wrong, or of another robot than this could be.
        """
        if self.content is not Content.TF or target is None:
            return TrajectoryFile.open(self, folder, target)
        world = world_from_parent(target, self.parent, self.frame, self.file)
        at = driven(target, self.at or f"{target.name}/{self.child}", self.file)
        path, said = self._frames(folder / self.file)
        plausible(path)
        path = path.seen_from(world)
        text = (
            f"joints are solved from the pose of {self.child!r} in {self.parent!r}: the branch, and what "
            "a redundant robot does beside its tool, may differ from the controller's; what depends on "
            "them is preliminary"
        )
        return Opened(
            samples=PoseSamples(path, self.name or f"bag {target.name}", at),
            duration=path.duration,
            began=float(path.t[0]),
            findings=(
                origin_finding(self.origin, target.name, self.file),
                Finding(level="assumed", subject=target.name, text=text),
                *(Finding(level=k, subject=target.name, text=t) for k, t in said),
                *sampling_findings(path, target.name, self.timeout),
            ),
        )

    def _frames(self, path: Path) -> tuple[ToolTrajectory, list[tuple[str, str]]]:
        """The path of ``child`` in ``parent``."""
        topic = ros_bag.chosen(ros_bag.topics_of(path, self.file), self.content, self.topic, self.file)
        tree = FrameTree(self.parent, self.child)
        # What never changes may have been recorded late: it holds from the beginning.
        for item in ros_bag.messages(path, self.content, (STATIC,), self.file):
            if isinstance(item.said, tuple):
                tree.take(item.said, fixed=True)
        times: list[float] = []
        poses: list[Array] = []
        dropped = 0
        for item in ros_bag.messages(path, self.content, (topic,), self.file):
            if not isinstance(item.said, tuple) or not tree.take(item.said, fixed=False):
                continue
            found = tree.pose()
            if found is None:
                continue
            t = item.received if self.time_base is TimeBase.RECEIVED else found[1]
            if t is None:
                what = f"{topic}: a transform without a stamp"
                raise InputError.at(self.file, "time_base", what, 'write time_base = "received"')
            if times and t <= times[-1] + SAME_INSTANT:
                dropped += 1
                continue
            times.append(t)
            poses.append(found[0])
            if len(times) > MAX_SAMPLES:
                raise InputError.at(self.file, "", f"more than {MAX_SAMPLES} samples", "split the bag")
        if not poses:
            raise InputError.at(self.file, "child", tree.lacking(), "name parent and child")
        said = [("note", f"{self.file}: {self.child!r} in {self.parent!r} out of {topic}")]
        if dropped:
            said.append(("note", f"{dropped} transforms joined to an instant that others of the chain had"))
        return (
            ToolTrajectory(
                file=self.file,
                t=np.array(times),
                position=np.array([p[:3, 3] for p in poses]),
                wxyz=np.array([_turn(p) for p in poses]),
            ),
            said,
        )

    def read(self, path: Path, target: Target) -> tuple[Trajectory, tuple[Finding, ...]]:
        """The motion by the robot's joints.

        Raises:
            InputError: It is no bag, has no such topic or joints, or stamps that are not set.
        """
        if self.joints and len(self.joints) != len(target.joints):
            what = f"{len(self.joints)} joints for the {len(target.joints)} of {target.name}"
            raise InputError.at(self.file, "joints", what, f"name one for each of {', '.join(target.joints)}")
        topic = ros_bag.chosen(ros_bag.topics_of(path, self.file), self.content, self.topic, self.file)
        names = self.joints or target.joints
        recorded = ros_bag.messages(path, self.content, (topic,), self.file)
        note = Finding(level="note", subject=target.name, text=f"{self.file}: topic {topic}")
        if self.content is Content.TRAJECTORY:
            trajectory, said = self._commanded(recorded, names)
        else:
            trajectory, said, stamps = self._measured(recorded, names, target.name)
            tool, more = self._tool(path, target, stamps)
            said += more
            if tool is not None:
                trajectory = replace(trajectory, tcp_position=tool[0], tcp_said=tool[1], tcp_in_base=True)
        return trajectory, (note, *(Finding(level=k, subject=target.name, text=t) for k, t in said))

    def _measured(
        self, recorded: Iterator[Recorded], names: tuple[str, ...], robot: str
    ) -> tuple[Trajectory, list[tuple[str, str]], list[float | None]]:
        """The motion, what is said of it, and the stamps of its samples [s]."""
        # Publishers of parts of a robot are put together; how far apart they are, a recording shows itself.
        gather = JointGather(robot, names, float("inf"))
        rows: list[tuple[float, JointSample]] = []
        dropped = 0
        for item in recorded:
            if not isinstance(item.said, Joints):
                continue
            sample = gather.take(item.received, item.said)
            if sample is None:
                continue
            t = item.received if self.time_base is TimeBase.RECEIVED else sample.t_device
            if t is None:
                what = f"{item.topic}: a message without a stamp"
                raise InputError.at(self.file, "time_base", what, 'write time_base = "received"')
            if rows and t <= rows[-1][0] + SAME_INSTANT:
                dropped += 1
                continue
            rows.append((t, sample))
            if len(rows) > MAX_SAMPLES:
                raise InputError.at(self.file, "", f"more than {MAX_SAMPLES} samples", "split the bag")
        if not rows:
            remedy = "give joints = [names in ROS, in the robot's order]"
            raise InputError.at(self.file, "joints", gather.lacking(), remedy)
        said = []
        if dropped:
            text = f"{self.file}: {dropped} messages left out: their time does not advance"
            said.append(("warning", text))
        if self.time_base is TimeBase.RECEIVED:
            said.append(
                ("assumed", "instants are those of recording: delays of the network are in the speeds")
            )
        samples = [sample for _, sample in rows]
        speeds = [s.qd for s in samples if s.qd is not None]
        torques = [s.tau for s in samples if s.tau is not None]
        invalid = np.array([s.quality is Quality.INVALID for s in samples])
        return (
            Trajectory(
                file=self.file,
                t=np.array([t for t, _ in rows]),
                q=np.array([s.q for s in samples], float),
                qd=np.array(speeds, float) if len(speeds) == len(rows) else None,
                tau=np.array(torques, float) if len(torques) == len(rows) else None,
                invalid=invalid if invalid.any() else None,
            ),
            said,
            [s.t_device for s in samples],
        )

    def _tool(
        self, path: Path, target: Target, stamps: list[float | None]
    ) -> tuple[tuple[Array, NDArray[np.bool_]] | None, list[tuple[str, str]]]:
        """Where tf has the robot's last link [m], shape (n, 3), and at which samples; None where nowhere.

        It is made of the same joints by whoever recorded the bag, with the robot that they had.
        """
        robot, fixed = target.description, fixed_links(target)
        base = fixed.get(f"{target.name}/{self.parent}")
        if robot is None or base is None or TF not in topics_of(path, self.file):
            return None, []
        tree = FrameTree(self.parent, robot.tip)
        found: dict[int, Array] = {}
        try:
            for topic in (STATIC, TF):
                for item in ros_bag.messages(path, Content.TF, (topic,), self.file):
                    moves = isinstance(item.said, tuple) and tree.take(item.said, fixed=topic == STATIC)
                    pose = tree.pose() if moves and topic == TF and tree.at_once() else None
                    if pose is not None and pose[1] is not None and np.isfinite(pose[0]).all():
                        found[round(pose[1] / SAME_INSTANT)] = (base @ pose[0])[:3, 3]
        except InputError as error:
            return None, [("note", f"its transforms are not compared: {error.problems[0].what}")]
        at = [None if stamp is None else found.get(round(stamp / SAME_INSTANT)) for stamp in stamps]
        if all(place is None for place in at):
            return None, []
        said = np.array([place is not None for place in at])
        return (np.array([np.zeros(3) if place is None else place for place in at]), said), []

    def _commanded(
        self, recorded: Iterator[Recorded], names: tuple[str, ...]
    ) -> tuple[Trajectory, list[tuple[str, str]]]:
        plans = [item.said for item in recorded if isinstance(item.said, Plan) and item.said.points]
        if not plans:
            raise InputError.at(self.file, "topic", "no trajectory with points")
        plan = plans[0]
        lost = [name for name in names if name not in plan.names]
        if lost:
            what = f"nothing is said of {', '.join(lost[:12])}; joints that are: {', '.join(plan.names[:16])}"
            remedy = "give joints = [names in ROS, in the robot's order]"
            raise InputError.at(self.file, "joints", what, remedy)
        order = [plan.names.index(name) for name in names]
        said = [("note", "a commanded trajectory: what the robot made of it is in its joint states")]
        if len(plans) > 1:
            said.append(("warning", f"{self.file}: {len(plans)} trajectories, the first is played"))
        known = all(p.velocity for p in plan.points)
        return (
            Trajectory(
                file=self.file,
                t=np.array([p.t for p in plan.points]),
                q=np.array([p.position for p in plan.points], float)[:, order],
                qd=np.array([p.velocity for p in plan.points], float)[:, order] if known else None,
            ),
            said,
        )


def _turn(pose: Array) -> Array:
    """Unit quaternion; NaN where the pose is none, which the path refuses with its place."""
    return wxyz_from_rotation(pose[:3, :3]) if np.isfinite(pose).all() else np.full(4, np.nan)
