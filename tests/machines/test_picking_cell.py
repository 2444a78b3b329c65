"""The Niryo of the paper picks castings that slide, and puts them onto a belt: figures of a cycle."""

from pathlib import Path

import pytest

from seerob import load
from seerob.app.emulation import motions
from seerob.app.emulators.rosbridge import Rosbridge
from seerob.core.samples import JointSample, SignalSample
from seerob.core.snapshot import Verdict
from seerob.session.run import Judge
from seerob.twin.engine import Engine

CELL = Path(__file__).parents[2] / "workstations/niryo_picking"


class Cell:
    """What the emulators of the cell say, without their wires: those are in tests/soak."""

    def __init__(self, faster=1.0):
        station = load(CELL)
        self.model = station.model
        emulated = Rosbridge(robot="niryo_one", waypoints=str(CELL / "motion/picks.toml"))
        self.motion, _ = emulated.motion(emulated.target())
        self.table = motions.values(CELL / "motion/plc.csv")
        self.engine = Engine(self.model, driven={"niryo": 0.5, "gripper": 1.0}, signals={"plc": 1.0})
        self.judge = Judge(station.bound)
        self.faster, self.k, self.events, self.worst = faster, 0, [], {}
        self._hear()
        self.engine.start()

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
        self.engine.take([joints, SignalSample(source="plc", seq=self.k, t=t, values=values)])

    def go(self, seconds, *, judge_every=10):
        for _ in range(round(seconds / self.model.workstation.engine.tick)):
            self.k += 1
            self._hear()
            state = self.engine.tick()
            self.events += state.events
            if self.k % judge_every == 0:
                for result in self.judge(state):
                    self.worst.setdefault(result.name, set()).add(result.verdict)
        return self


def test_a_casting_is_picked_put_onto_the_belt_rides_away_and_comes_again():
    cell = Cell().go(14.5)
    found = [(e.what, e.piece, e.by, e.where) for e in cell.events]
    assert found[:5] == [
        ("taken", "casting_1", "gripper", ""),
        ("placed", "casting_1", "gripper", "on_the_belt"),
        ("placed", "casting_1", "gripper", "belt_end"),
        ("returned", "casting_1", "", "ramp_top"),
        ("round", "casting_1", "gripper", "belt_end"),
    ]
    taken, put, away, *_ = cell.events
    assert put.t - taken.t == pytest.approx(5.7, abs=0.3)
    assert away.t - taken.t == pytest.approx(10.8, abs=0.5)
    assert cell.worst["tool speed"] == {Verdict.WITHIN}
    assert cell.worst["arm energy"] == {Verdict.UNDECIDED}, "nobody published its masses"


def test_a_faster_robot_exceeds_its_speed():
    cell = Cell(faster=1.5).go(5.0)
    assert Verdict.EXCEEDED in cell.worst["tool speed"]
