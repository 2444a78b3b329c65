"""The Niryo of the paper picks castings that slide, and puts them onto a belt: figures of a cycle."""

from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

from seerob import load
from seerob.app.emulation import motions
from seerob.app.emulators.rosbridge import Rosbridge
from seerob.core.samples import JointSample, SignalSample
from seerob.core.snapshot import Snapshot, Verdict
from seerob.core.transforms import rotation_from_wxyz, transform
from seerob.files.waypoints.arm import Arm
from seerob.session.run import Judge
from seerob.session.steps import Steps
from seerob.session.writing import message
from seerob.twin.engine import Engine

BASE_FROM_WORLD = np.linalg.inv(transform(np.eye(3), (0.0, 0.0, 0.75)))
CELL = Path(__file__).parents[2] / "workstations/niryo_picking"


class Cell:
    """What the emulators of the cell say, without their wires: those are in tests/soak."""

    def __init__(self, faster=1.0, *, targets=False, **emulator):
        station = load(CELL)
        self.model = station.model
        asked = {"waypoints": str(CELL / "motion/picks.toml"), **emulator}
        if targets:
            asked |= {"follows": "/target_pose", "joint_speed": 0.8, "joint_acceleration": 1.5}
        emulated = Rosbridge(robot="niryo_one", **asked)
        self.motion, _ = emulated.motion(emulated.target())
        (self.table_of_targets,) = station.workstation.targets
        self.steps = Steps(self.model, self.table_of_targets, {}) if targets else None
        self.said = []
        self.table = motions.values(CELL / "motion/plc.csv")
        self.engine = Engine(self.model, driven={"niryo": 0.5, "gripper": 1.0}, signals={"plc": 1.0})
        self.judge = Judge(station.bound)
        self.faster, self.k, self.events, self.worst = faster, 0, [], {}
        self._hear()
        self.engine.start()
        self.first = b""

    def _hear(self):
        t = self.k * self.model.workstation.engine.tick
        q, qd = self.motion(self.faster * t)
        joints = JointSample(
            source="r", seq=self.k, t=t, target="niryo", q=q, qd=tuple(self.faster * v for v in qd)
        )
        values = {
            "belt/speed": 1e-3 * self.table.value("Belt/speed", self.faster * t),
            "gripper/opening": 1e-3 * self.table.value("Gripper/opening", self.faster * t),
        }
        self.signals = SignalSample(source="plc", seq=self.k, t=t, values=values)
        self.engine.take([joints, self.signals])

    def _tell(self, state):
        """What the twin publishes, to the robot that follows it."""
        snapshot = Snapshot(seq=self.k, t=state.t, poses=state.poses())
        if (pose := self.steps.next(snapshot, (self.signals,))) is not None:
            world = transform(rotation_from_wxyz(pose.wxyz), pose.position)
            self.motion.hear(message(self.table_of_targets, BASE_FROM_WORLD @ world, 0.0))
            self.said.append(self.steps.word)

    def go(self, seconds, *, judge_every=10):
        for _ in range(round(seconds / self.model.workstation.engine.tick)):
            self.k += 1
            self._hear()
            state = self.engine.tick()
            self.events += state.events
            self.first = self.first or state.poses()
            if self.steps is not None and self.k % 10 == 0:
                self._tell(state)
            if self.k % judge_every == 0:
                for result in self.judge(state):
                    self.worst.setdefault(result.name, set()).add(result.verdict)
        return self


@pytest.fixture(scope="module")
def told():
    """The robot follows targets, as the file of the cell asks for; a first round."""
    return Cell(targets=True).go(14.5)


def test_a_casting_is_picked_put_onto_the_belt_rides_away_and_comes_again(told):
    found = [(e.what, e.piece, e.by, e.where) for e in told.events]
    assert found[:5] == [
        ("taken", "casting_1", "gripper", ""),
        ("placed", "casting_1", "gripper", "on_the_belt"),
        ("placed", "casting_1", "gripper", "belt_end"),
        ("returned", "casting_1", "", "ramp_top"),
        ("round", "casting_1", "gripper", "belt_end"),
    ]
    taken, put, away, *_ = told.events
    assert put.t - taken.t == pytest.approx(5.7, abs=0.3)
    assert away.t - taken.t == pytest.approx(10.8, abs=0.5)
    assert told.worst["tool speed"] == {Verdict.WITHIN}
    assert told.worst["arm energy"] == {Verdict.WITHIN}, "with the heaviest links that it may have"
    # It had to be there, and the gripper had to have moved, before the robot was told to go on.
    waits = dict.fromkeys(word for word in told.said if "waits for" in word)
    assert list(waits) == ["at the casting waits for gripper/opening", "put down waits for gripper/opening"]


def test_without_a_casting_or_a_robot_that_is_heard_nothing_is_said(told):
    steps = Steps(told.model, told.table_of_targets, {})
    there = Snapshot(seq=0, t=0.0, poses=told.first)
    assert steps.next(there, ()) is not None
    steps = Steps(told.model, told.table_of_targets, {})
    assert steps.next(replace(there, doubts={"niryo": "not heard"}), ()) is None
    assert steps.word == "not heard"
    poses = np.frombuffer(told.first, "<f4").reshape(-1, 7).copy()
    for body in told.model.bodies:
        if body.name.startswith("casting"):
            poses[body.index, :3] += 0.5
    assert steps.next(replace(there, poses=poses.tobytes()), ()) is None
    assert steps.word == "above the casting waits for casting_*"


def test_a_target_out_of_reach_is_not_gone_to_and_another_is_at_bounded_speed():
    emulated = Rosbridge(robot="niryo_one", follows="/target_pose")
    follower, _ = emulated.motion(emulated.target())
    q, _ = follower(0.0)

    def pose(x):
        turn = {"w": 0.7071068, "x": 0.0, "y": 0.7071068, "z": 0.0}
        return {"header": {}, "pose": {"position": {"x": x, "y": 0.0, "z": 0.2}, "orientation": turn}}

    follower.hear(pose(2.0))
    assert "out of reach" in follower.refused
    follower.hear({"data": "no pose"})
    assert follower.refused == "no pose of geometry_msgs"
    follower.hear(pose(0.26))
    way = [np.concatenate(follower(0.02 * k)).reshape(2, -1) for k in range(1, 400)]
    q, qd = np.array(way).swapaxes(0, 1)
    assert np.abs(qd).max() == pytest.approx(emulated.joint_speed, rel=1e-6)
    assert np.abs(np.diff(qd, axis=0)).max() <= 0.02 * emulated.joint_acceleration * (1 + 1e-9)
    at = Arm(emulated.target().description).posture(q[-1])
    np.testing.assert_allclose(at.position, (0.26, 0.0, 0.2), atol=1e-6)


def test_a_faster_robot_exceeds_its_speed():
    cell = Cell(faster=1.5).go(5.0)
    assert Verdict.EXCEEDED in cell.worst["tool speed"]
