"""Grippers that take loose workpieces: from where they lie, on whom they weigh, and when nobody knows."""

import numpy as np
import pytest
import trimesh

from seerob import load
from seerob.core.errors import Undecided
from seerob.core.samples import GrabSample, JointSample, SignalSample
from seerob.twin.accuracy.mass_tolerances import MassTolerances
from seerob.twin.engine import Engine

ARM = """
[[machines]]
name = "lift"
shape = { box = [0.1, 0.1, 0.1] }
mass = 20
uniform_density = true
slide = { along = [0, 0, 1] }
at = { position = [0, 0, 1.23] }
[[machines]]
name = "hand"
on = "lift"
at = { position = [0, 0, -0.3] }
shape = { box = [0.02, 0.01, 0.06] }
mass = 0.2
uniform_density = true
grip = { along = [0, 1, 0], upper = 0.12 }
[[parts]]
name = "table"
shape = { box = [1.0, 1.0, 0.8] }
at = { position = [0, 0, 0.4] }
"""
BLANK = """
[[workpieces]]
name = "blank"
shape = { box = [0.10, 0.05, 0.04] }
mass = 0.8
uniform_density = true
at = { position = [0, 0, 0.821] }
"""
BOX = """
[[places]]
name = "tray"
at = { position = [0, 0, 0.85] }
size = [0.5, 0.5, 0.2]
"""
WIDE, SHUT, DOWN, UP = 0.09, 0.05, -0.08, 0.1
SILENT = None
BELT = 0.06
"""Speed of the table where it is one [m/s]."""
TICK = 0.01


class Cell:
    """A gripper on a lift, told where to be at each tick, in steps that a drive could do."""

    def __init__(self, folder, text=ARM + BLANK + BOX, q=0.0, opening=WIDE):
        (folder / "workstation.toml").write_text(text)
        self.model = load(folder).model
        people = {h.name: 9.0 for h in self.model.workstation.humans}
        belts = {"plc": 0.2} if self.model.dictionary else {}
        self.engine = Engine(self.model, driven={"lift": 0.05, "hand": 0.05} | people, signals=belts)
        self.k, self.q, self.opening, self.events = 0, q, opening, []
        self.bodies = {body.name: body.index for body in self.model.bodies}
        self._hear()
        self.state = self.engine.start()

    def _hear(self, *, silent=False):
        said = {"lift": self.q} | ({} if silent else {"hand": self.opening / 2})
        said = {name: (q,) for name, q in said.items()}
        said |= {h.name: self.model.mechanisms[h.name].home for h in self.model.workstation.humans}
        self.engine.take(
            JointSample(source=name, seq=self.k, t=self.k * TICK, target=name, q=tuple(q))
            for name, q in said.items()
        )
        if self.model.dictionary:
            values = {"belt/speed": BELT}
            self.engine.take([SignalSample(source="plc", seq=self.k, t=self.k * TICK, values=values)])

    def go(self, ticks, q=None, opening=None, *, silent=False):
        """Evenly to a height and an opening."""
        end = self.q if q is None else q, self.opening if opening is None else opening
        steps = (end[0] - self.q) / ticks, (end[1] - self.opening) / ticks
        for _ in range(ticks):
            self.k += 1
            self.q, self.opening = self.q + steps[0], self.opening + steps[1]
            self._hear(silent=silent)
            self.state = self.engine.tick()
            self.events += self.state.events
        return self

    def held(self):
        return self.go(20, DOWN).go(20, opening=SHUT)

    def at(self, name="blank/body"):
        return self.state.positions[self.bodies[name]].copy()

    def said(self):
        return [(event.what, event.by, event.where) for event in self.events]

    def mass(self):
        return float(self.state.mass_matrix(self.model.mechanisms["lift"])[0, 0])


def test_it_is_taken_lifted_and_put_down_with_events(tmp_path):
    cell = Cell(tmp_path).held()
    assert cell.said() == [("taken", "hand", "")]
    lying = cell.at()
    cell.go(60, UP)
    assert cell.at() - lying == pytest.approx([0, 0, UP - DOWN], abs=2e-3)
    assert cell.at("hand/blank") == pytest.approx(cell.at(), abs=2e-4), "and the gripper has it there"
    cell.go(60, DOWN).go(20, opening=WIDE).go(60, UP)
    assert cell.said() == [("taken", "hand", ""), ("placed", "hand", "tray")]
    taken, placed = cell.events
    assert placed.took == pytest.approx(placed.t - taken.t)
    assert cell.at()[2] == pytest.approx(0.82, abs=2e-3)


def test_it_is_taken_from_a_belt_that_runs_and_rides_on_once_it_is_put_back(tmp_path):
    plc = 'variables = "variables.toml"\n[[sources]]\nkind = "opcua"\nname = "plc"\n'
    plc += 'url = "opc.tcp://127.0.0.1:4840"\n'
    variable = '[[variables]]\nname = "belt/speed"\nsource = "plc"\naddress = "ns=1;s=v"\nunit = "m/s"\n'
    (tmp_path / "variables.toml").write_text(variable)
    belt = ARM + 'conveyor = { along = [1, 0, 0], speed = "belt/speed" }\n'
    cell = Cell(tmp_path, plc + belt + BLANK.replace("[0, 0, 0.821]", "[-0.03, 0, 0.821]"))
    cell.go(20, DOWN)
    rode = cell.at()[0]
    assert -0.025 < rode < -0.01
    cell.go(20, opening=SHUT)
    assert cell.said() == [("taken", "hand", "")]
    held = cell.at()
    cell.go(60)
    assert cell.at() == pytest.approx(held, abs=2e-3), "the belt runs on below it"
    cell.go(60, UP)
    assert cell.at() - held == pytest.approx([0, 0, UP - DOWN], abs=2e-3)
    cell.go(60, DOWN).go(20, opening=WIDE).go(20)
    put = cell.at()
    cell.go(50)
    assert cell.at() - put == pytest.approx([50 * TICK * BELT, 0, 0], abs=2e-3)


def test_what_is_held_may_weigh_more_by_its_tolerance_and_by_what_its_volume_may_be_off(tmp_path):
    trimesh.creation.box((0.10, 0.05, 0.04)).export(tmp_path / "blank.stl")
    mesh = 'mesh = "blank.stl"\nunits = "m"\ndeviation_mm = 1\n'
    given = BLANK.replace("mass", "mass_tolerance = 0.25\nmass")
    dense = BLANK.replace("shape = { box = [0.10, 0.05, 0.04] }\n", mesh).replace(
        "mass = 0.8\nuniform_density = true", "density = 4000"
    )
    for blank, off in ((given, 0.25), (dense, None)):
        cell = Cell(tmp_path, ARM + blank).held().go(60, UP)
        lift = cell.model.mechanisms["lift"]
        found = MassTolerances(cell.model, lift)
        (piece,) = (body.mass for body in cell.model.bodies if body.owner == "blank")
        share = piece.spread_error if off is None else off
        most = found.matrices(cell.state).at((1,) * len(found))[0, 0]
        assert len(found) == 1
        assert most - cell.mass() == pytest.approx(share * 0.8, rel=1e-6)
        assert share > 0.1


def test_it_is_part_of_the_gripper_while_it_is_held(tmp_path):
    cell = Cell(tmp_path, ARM + BLANK.replace("mass", "mass_tolerance = 0.25\nmass"))
    empty = cell.go(20, DOWN).mass()
    assert cell.go(20, opening=SHUT).mass() - empty == pytest.approx(0.8, rel=1e-6)
    cell.go(60, UP)
    wide = ARM + BLANK.replace("[0.10, 0.05, 0.04]", "[0.10, 0.05, 0.20]").replace("0.821", "0.9005")
    cell = Cell(tmp_path, wide).held().go(60, UP)
    gap = cell.model.gap(cell.model.select("hand"), cell.model.select("table"))
    assert cell.state.closest(gap).distance == pytest.approx(UP - DOWN, abs=1e-3)
    cell.go(60, DOWN).go(20, opening=WIDE).go(60, UP)
    assert cell.mass() == pytest.approx(empty, rel=1e-6)
    assert cell.state.closest(gap).distance == pytest.approx(0.2, abs=1e-3), "the fingers are nearest"


def test_the_drive_carries_its_weight(tmp_path):
    """The lift is pulled by a spring, which the weight of what it holds bends."""
    force = {}
    for mass in (1e-3, 0.8, 3.2):
        cell = Cell(tmp_path, ARM + BLANK.replace("mass = 0.8", f"mass = {mass}")).held().go(60, UP).go(60)
        address = cell.model.mechanisms["lift"].q_address[0]
        force[mass] = float(cell.engine._kp[0]) * (UP - float(cell.engine._data.qpos[address]))
    assert force[0.8] - force[1e-3] == pytest.approx(0.8 * 9.81, rel=0.02)
    assert force[3.2] - force[1e-3] == pytest.approx(3.2 * 9.81, rel=0.02)


SHELF = """
[[parts]]
name = "shelf"
shape = { box = [0.2, 0.4, 0.02] }
at = { position = [0, 0, 0.92] }
"""


def test_what_is_in_the_way_tears_it_out(tmp_path):
    cell = Cell(tmp_path, ARM + BLANK + SHELF).held().go(60, 0.3)
    assert [event.what for event in cell.events][:2] == ["taken", "torn"]
    assert cell.at()[2] < 0.9
    assert cell.mass() == pytest.approx(Cell(tmp_path).mass(), rel=1e-6)


def test_of_what_was_torn_out_and_is_at_the_fingers_nobody_knows_whether_it_is_held(tmp_path):
    cell = Cell(tmp_path, ARM + BLANK.replace("mass", "torn = 0.02\nmass") + SHELF).held().go(30, 0.03)
    assert [event.what for event in cell.events] == ["taken", "torn"]
    with pytest.raises(Undecided, match="torn out of hand, and still between its fingers"):
        cell.mass()


def test_fingers_that_close_beside_it_take_nothing(tmp_path):
    cell = Cell(tmp_path).go(20, 0.0).go(20, opening=SHUT).go(20, UP)
    assert cell.said() == []
    assert cell.at()[2] == pytest.approx(0.82, abs=2e-3)
    other = Cell(tmp_path, ARM.replace("upper = 0.12", 'upper = 0.12, takes = "nut*"') + BLANK).held()
    assert other.said() == []


def test_of_two_between_the_fingers_nobody_knows_which_is_held(tmp_path):
    other = (
        BLANK.replace('"blank"', '"other"').replace("0, 0, 0.821", "0, 0, 0.8402").replace("0.04]", "0.02]")
    )
    text = ARM + BLANK.replace("0.821", "0.8151").replace("0.04]", "0.03]") + other
    cell = Cell(tmp_path, text).held()
    assert cell.said() == []
    with pytest.raises(Undecided, match="nobody knows which it holds"):
        cell.mass()
    for piece in ("blank", "other"):
        with pytest.raises(Undecided, match="nobody knows which it holds"):
            cell.state.closest(cell.model.gap(cell.model.select(piece), cell.model.select("table")))


def test_while_the_gripper_is_not_heard_nobody_knows_where_it_is(tmp_path):
    cell = Cell(tmp_path).held().go(60, UP)
    gap = cell.model.gap(cell.model.select("blank"), cell.model.select("table"))
    assert cell.state.closest(gap).distance > 0.1
    cell.go(10, silent=True)
    with pytest.raises(Undecided, match="hand: "):
        cell.state.closest(gap)
    cell.go(10)
    assert cell.state.closest(gap).distance > 0.1, "heard again, and it is still held"
    cell.go(10, silent=True).opening = WIDE
    cell.go(20)
    with pytest.raises(Undecided, match="let go while its gripper was not relied on"):
        cell.state.closest(gap)


def test_a_hand_takes_it_out_of_a_gripper(tmp_path):
    person = '[[humans]]\nname = "operator"\nstature = 1.75\nmass = 75\nsex = "male"\n'
    person += "at = { position = [-0.4, 0.25, 0] }\n"
    cell = Cell(tmp_path, ARM + BLANK + person).held().go(40, UP)
    cell.engine.take(
        [GrabSample(source="room", seq=0, t=cell.k * TICK, target="operator/right_hand", piece="blank")]
    )
    cell.go(10).go(20, opening=WIDE).go(100)
    assert cell.said()[:2] == [("taken", "hand", ""), ("handed", "operator/right_hand", "")]
    assert [event.what for event in cell.events[2:]] in ([], ["torn"]), "while the fingers are still shut"
    assert np.linalg.norm(cell.at() - cell.at("operator/right_hand")) < 0.3, "it came to the hand"
    assert cell.mass() == pytest.approx(Cell(tmp_path).mass(), rel=1e-6)


def test_one_that_lies_between_shut_fingers_is_held_from_the_begin(tmp_path):
    cell = Cell(tmp_path, q=DOWN, opening=SHUT).go(1)
    assert cell.said() == [("taken", "hand", "")]
