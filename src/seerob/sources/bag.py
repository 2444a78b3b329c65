"""A robot's motion out of a ROS bag: ROS 1, and ROS 2 in SQLite or MCAP.

Joint states by name, a commanded trajectory, or the pose of the tool out of tf (the joints are solved then).
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from seerob.errors import InputError
from seerob.motion_io import ros_bag
from seerob.motion_io.ros_bag import Recorded, TimeBase
from seerob.protocols.ros_messages import Content, Joints, Plan
from seerob.samples import JointSample, Quality
from seerob.snapshot import Finding
from seerob.source import Target
from seerob.sources._ros_joints import JointGather
from seerob.sources._trajectory_file import TrajectoryFile
from seerob.trajectory import MAX_SAMPLES, Trajectory

SAME_INSTANT = 1e-6
"""Samples that are not later by more are dropped: a message that was recorded twice [s]."""


class Bag(TrajectoryFile, frozen=True, kw_only=True):
    """A robot's motion out of a ROS bag (ROS 1, ROS 2 in SQLite or MCAP)."""

    content: Content = Content.JOINT_STATE
    """``joint_state``, or ``trajectory``: what somebody commanded."""
    topic: str = ""
    """The usual one, or the only one of its type, when not given."""
    joints: tuple[str, ...] = ()
    """Names of its joints in ROS, in the robot's order; the robot's own names when not given."""
    time_base: TimeBase = TimeBase.HEADER
    """``header``: the stamps of the messages; ``received``: when they were recorded."""

    def read(self, path: Path, target: Target) -> tuple[Trajectory, tuple[Finding, ...]]:
        """The motion by the robot's joints.

        Raises:
            InputError: It is no bag, has no such topic or joints, or stamps that are not set.
        """
        if self.joints and len(self.joints) != len(target.joints):
            what = f"{len(self.joints)} joints for the {len(target.joints)} of {target.name}"
            raise InputError.at(self.file, "joints", what, f"name one for each of {', '.join(target.joints)}")
        if self.content is Content.TF:
            what = "transforms are read live only"
            raise InputError.at(self.file, "content", what, "take joint_state, or play the bag to rosbridge")
        topic = ros_bag.chosen(ros_bag.topics_of(path, self.file), self.content, self.topic, self.file)
        names = self.joints or target.joints
        recorded = ros_bag.messages(path, self.content, (topic,), self.file)
        note = Finding(level="note", subject=target.name, text=f"{self.file}: topic {topic}")
        if self.content is Content.TRAJECTORY:
            trajectory, said = self._commanded(recorded, names)
        else:
            trajectory, said = self._measured(recorded, names, target.name)
        return trajectory, (note, *(Finding(level=k, subject=target.name, text=t) for k, t in said))

    def _measured(
        self, recorded: Iterator[Recorded], names: tuple[str, ...], robot: str
    ) -> tuple[Trajectory, list[tuple[str, str]]]:
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
        )

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
