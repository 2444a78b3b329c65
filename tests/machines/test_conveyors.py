"""Surfaces that run: loose workpieces ride along, from gripper to belt and off its end, and come back."""

import mujoco
import numpy as np
import pytest

from seerob import load
from seerob.core.errors import InputError, Undecided
from seerob.core.samples import SignalSample
from seerob.twin.engine import Engine

STATION = """
variables = "variables.toml"
[[sources]]
kind = "opcua"
name = "plc"
url = "opc.tcp://127.0.0.1:4840"
[[parts]]
name = "belt"
shape = { box = [2.0, 0.4, 0.1] }
at = { position = [0, 0, 0.75], rpy_deg = [0, 0, TURN] }
conveyor = { along = [1, 0, 0], speed = "belt/speed" }
[[workpieces]]
name = "blank"
shape = { box = [0.10, 0.05, 0.04] }
mass = 0.8
friction = FRICTION
at = { position = [0, 0, 0.8201] }
"""
BIN = """
[[places]]
name = "bin"
at = { position = [1.4, 0, 0.2] }
size = [0.9, 0.8, 0.4]
ends_round = true
returns = "begin"
[[places]]
name = "begin"
at = { position = [-0.5, 0.1, 0.8201] }
size = [0.1, 0.1, 0.1]
"""
VARIABLES = '[[variables]]\nname = "belt/speed"\nsource = "plc"\naddress = "ns=1;s=v"\nunit = "m/s"\n'
TICK = 0.01


class Cell:
    def __init__(self, folder, text=STATION, friction=0.5, turn=0):
        text = text.replace("FRICTION", str(friction)).replace("TURN", str(turn))
        (folder / "workstation.toml").write_text(text)
        (folder / "variables.toml").write_text(VARIABLES)
        self.model = load(folder).model
        self.engine = Engine(self.model, signals={"plc": 0.2})
        self.k, self.events = 0, []
        self._hear(0.0)
        self.state = self.engine.start()
        self.body = next(b.index for b in self.model.bodies if b.name == "blank/body")

    def _hear(self, speed):
        if speed is not None:
            values = {"belt/speed": speed}
            self.engine.take([SignalSample(source="plc", seq=self.k, t=self.k * TICK, values=values)])

    def go(self, ticks, speed):
        for _ in range(ticks):
            self.k += 1
            self._hear(speed)
            self.state = self.engine.tick()
            self.events += self.state.events
        return self

    def at(self):
        return self.state.positions[self.body].copy()


@pytest.mark.parametrize("friction", [0.2, 0.5])
def test_friction_brings_it_to_the_speed_of_the_belt(tmp_path, friction):
    cell = Cell(tmp_path, friction=friction).go(20, 0.0)
    begin = cell.at()
    cell.go(50, 0.5)
    # v²/2 is lost to the belt until it is as fast: after v/(μ g).
    expected = 0.5 * 0.5 - 0.5**2 / (2 * friction * 9.81)
    assert cell.at() - begin == pytest.approx([expected, 0, 0], abs=0.012)
    before = cell.at()
    assert cell.go(10, 0.5).at() - before == pytest.approx([0.05, 0, 0], abs=1e-3)
    assert cell.go(40, 0.0).at() - before == pytest.approx(
        [0.05 + 0.5**2 / (2 * friction * 9.81), 0, 0], abs=0.012
    )


def test_it_rides_along_the_belt_whatever_way_that_lies(tmp_path):
    cell = Cell(tmp_path, turn=90).go(60, 0.3)
    assert cell.at()[1] > 0.12
    assert cell.at()[0] == pytest.approx(0.0, abs=1e-3)


def test_it_rides_off_the_end_is_counted_and_comes_back(tmp_path):
    cell = Cell(tmp_path, STATION + BIN).go(330, 0.6)
    assert [(e.what, e.by, e.where) for e in cell.events[:2]] == [
        ("placed", "belt", "bin"),
        ("returned", "", "begin"),
    ]
    assert cell.state.path.broken == () or "blank" in cell.state.path.broken
    for _ in range(20):
        cell.go(1, 0.0)
    assert cell.at()[2] == pytest.approx(0.82, abs=2e-3), "it lies on the belt again"


def test_how_far_it_rode_unheard_nobody_knows(tmp_path):
    cell = Cell(tmp_path).go(60, 0.2)
    gap = cell.model.gap(cell.model.select("blank"), cell.model.select("belt"))
    assert cell.state.closest(gap).distance < 0.01
    cell.go(40, None)
    with pytest.raises(Undecided, match="how far belt took it along nobody knows"):
        cell.state.closest(gap)
    with pytest.raises(Undecided):
        cell.go(20, 0.2).state.closest(gap)


def test_its_speed_is_a_variable_that_there_is(tmp_path):
    (tmp_path / "workstation.toml").write_text(
        STATION.replace("belt/speed", "belt/sped").replace("TURN", "0").replace("FRICTION", "0.5")
    )
    (tmp_path / "variables.toml").write_text(VARIABLES)
    with pytest.raises(InputError, match=r"parts\[0\] \(belt\).*no variable 'belt/sped'"):
        _ = load(tmp_path).model


def test_a_belt_that_stands_lets_nothing_creep(tmp_path):
    cell = Cell(tmp_path).go(20, 0.0)
    begin = cell.at()
    assert np.abs(cell.go(200, 0.0).at() - begin).max() < 2e-4


def test_what_a_belt_carries_presses_on_it_as_mujoco_tells_and_lags_no_more_than_its_step(tmp_path):
    """Contact by contact, by MuJoCo's own sums and velocities: what is compiled asks for neither."""
    engine = Cell(tmp_path).go(30, 0.2).engine
    loose, mj, data = engine._loose, engine._mj, engine._data
    assert loose._pressed() == data.ncon == 4
    force, total = np.zeros(6), np.zeros(3)
    for k in range(data.ncon):
        mujoco.mj_contactForce(mj, data, k, force)
        total += data.contact.frame[k][:3] * force[0]
    np.testing.assert_allclose(np.abs(loose._normal[0, 0]), np.abs(total), rtol=1e-12, atol=1e-12)
    assert loose._normal[0, 0, 2] == pytest.approx(0.8 * 9.81, rel=0.01), "upward, as heavy as it is"
    piece = loose._pieces["blank"]
    velocity = np.zeros(6)
    mujoco.mj_objectVelocity(mj, data, mujoco.mjtObj.mjOBJ_BODY, piece.body, velocity, 0)
    loose._xfrc[:] = 0.0
    loose._rub(piece, np.array([0.2, 0.0, 0.0]), loose._normal[0, 0], 1.0)
    slip = velocity[3:] - (0.2, 0.0, 0.0)
    np.testing.assert_allclose(loose._xfrc[piece.body, :2], -0.5 * 0.8 * slip[:2], rtol=1e-6, atol=1e-12)
