"""Loose workpieces: hands take, carry, hand over and put them down, and nothing but forces moves them."""

import msgspec
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from seerob import load
from seerob.core.errors import InputError
from seerob.core.samples import GrabSample, JointSample
from seerob.kernels import loose as kernel
from seerob.recording.format import Tick
from seerob.twin.engine import Engine

PERSON = """
[[humans]]
name = "operator"
stature = 1.75
mass = 75
sex = "male"
"""
TABLE = """
[[parts]]
name = "table"
shape = { box = [0.6, 1.6, 0.8] }
at = { position = [0.4, 0, 0.4] }
"""
BLANK = """
[[workpieces]]
name = "blank"
shape = { box = [0.12, 0.06, 0.05] }
mass = 0.8
at = { position = [0.25, -0.25, 0.826] }
"""
BOX = """
[[places]]
name = "box"
at = { position = [0.25, 0.35, 0.85] }
size = [0.4, 0.3, 0.2]
ends_round = true
"""
RIGHT, LEFT = "operator/right_hand", "operator/left_hand"
TICK = 0.01


class Cell:
    """A workstation in which one joint of the person is led, and hands take things."""

    def __init__(self, folder, text, joint="pelvis_y"):
        (folder / "workstation.toml").write_text(text)
        self.model = load(folder).model
        self.person = self.model.mechanisms.get("operator")
        self.engine = Engine(self.model, driven={"operator": 9.0} if self.person else {})
        self.k, self.events = 0, []
        self.bodies = {body.name: body.index for body in self.model.bodies}
        if self.person:
            self.q = self.person.home.copy()
            self.joint = [joint.name for joint in self.person.joints].index(joint)
            self._hear()
        self.state = self.engine.start()

    def _hear(self):
        if self.person:
            said = JointSample(source="p", seq=self.k, t=self.k * TICK, target="operator", q=tuple(self.q))
            self.engine.take([said])

    def go(self, ticks, way=0.0):
        """So many ticks, the joint led on by a way [m or rad] meanwhile."""
        for _ in range(ticks):
            self.k += 1
            if self.person:
                self.q[self.joint] += way / ticks
            self._hear()
            self.state = self.engine.tick()
            self.events += self.state.events
        return self

    def grab(self, hand, piece=""):
        t = self.k * TICK
        self.engine.take([GrabSample(source="room", seq=self.k, t=t, target=hand, piece=piece)])
        return self

    def at(self, name="blank/body"):
        return self.state.positions[self.bodies[name]].copy()

    def said(self):
        return [(event.what, event.by, event.where) for event in self.events]


def carried(folder, text=PERSON + TABLE + BLANK + BOX, way=0.6):
    cell = Cell(folder, text).go(20).grab(RIGHT, "blank").go(80).go(100, way).grab(RIGHT).go(60)
    return cell


def test_a_workpiece_is_taken_carried_and_put_into_a_box(tmp_path):
    cell = Cell(tmp_path, PERSON + TABLE + BLANK + BOX).go(20)
    assert cell.at() == pytest.approx([0.25, -0.25, 0.825], abs=1e-3)
    before = [cell.at()]
    for _ in range(80):
        if cell.k == 20:
            cell.grab(RIGHT, "blank")
        before.append(cell.go(1).at())
    steps = np.linalg.norm(np.diff(before, axis=0), axis=1)
    assert 0 < steps.max() < 0.03, "it comes to the hand, and is never put there"
    hand = cell.at(RIGHT) - cell.at()
    cell.go(100, 0.6)
    assert np.linalg.norm(cell.at(RIGHT) - cell.at() - hand) < 0.01
    cell.grab(RIGHT).go(60)
    assert cell.said() == [("taken", RIGHT, ""), ("placed", RIGHT, "box"), ("round", RIGHT, "box")]
    taken, placed, ended = cell.events
    assert placed.took == pytest.approx(placed.t - taken.t) == pytest.approx(ended.took)
    assert cell.at()[2] == pytest.approx(0.825, abs=2e-3), "it lies on the table"


def test_a_box_is_filled_by_as_many_as_it_takes_and_what_is_taken_out_counts_no_more(tmp_path):
    other = BLANK.replace('"blank"', '"other"').replace("0.25, -0.25", "0.38, -0.25")
    cell = carried(tmp_path, PERSON + TABLE + BLANK + other + BOX + "full = 2\n")
    cell.grab(RIGHT, "blank").go(40).grab(RIGHT).go(60)
    assert [e.what for e in cell.events] == ["taken", "placed", "round", "taken", "placed", "round"]
    cell.go(100, -0.6).grab(RIGHT, "other").go(80).go(100, 0.6).grab(RIGHT).go(80)
    assert [e.what for e in cell.events[6:]] == ["taken", "placed", "round", "filled"]
    filled = cell.events[-1]
    assert (filled.piece, filled.where, filled.count) == ("other", "box", 1)
    assert filled.took == pytest.approx(filled.t - cell.events[0].t)


def test_what_is_let_go_beside_every_place_is_dropped_where_it_lies(tmp_path):
    cell = carried(tmp_path, way=0.15)
    assert cell.said() == [("taken", RIGHT, ""), ("dropped", RIGHT, "")]
    away = carried(tmp_path, PERSON + BLANK.replace("0.826", "0.026") + BOX).go(100)
    assert 0.02 < away.at()[2] < 0.061, "there is no table, and the floor holds it, on whatever side"


def test_arms_carry_its_weight(tmp_path):
    heights = []
    for mass in (0.1, 0.8, 3.2):
        text = PERSON + BLANK.replace("mass = 0.8", f"mass = {mass}").replace("-0.25, 0.826", "-0.25, 1.3")
        cell = Cell(tmp_path, "[engine]\ngravity = [0, 0, -1e-9]\n" + text, "right_shoulder_flexion")
        cell.go(40, 1.4)
        level = float(cell.at(RIGHT)[2])
        cell.engine._mj.opt.gravity[:] = cell.model.mj.opt.gravity[:] = [0, 0, -9.81]
        cell.grab(RIGHT, "blank").go(100)
        assert cell.said() == [("taken", RIGHT, "")]
        heights.append(level - float(cell.at(RIGHT)[2]))
    nothing, light, heavy = heights
    assert light - nothing > 1e-3
    assert (heavy - nothing) / (light - nothing) == pytest.approx(3.1 / 0.7, rel=0.2)


def test_a_table_in_the_way_tears_it_out_of_the_hand(tmp_path):
    text = PERSON + BLANK + '[[parts]]\nname = "shelf"\nshape = { box = [0.6, 1.6, 0.1] }\n'
    text += "at = { position = [0.4, 0, 0.75] }\n"
    cell = Cell(tmp_path, text, "pelvis_z").go(10).grab(RIGHT, "blank").go(60)
    cell.go(100, -0.7)
    lowest = cell.at()[2]
    assert "torn" in [event.what for event in cell.events]
    assert lowest > 0.8, "it is above the shelf, and the hand below it"
    assert cell.at(RIGHT)[2] < 0.5


def test_a_hand_that_jumps_throws_nothing_away(tmp_path):
    cell = Cell(tmp_path, PERSON + TABLE + BLANK).grab(RIGHT, "blank").go(50)
    fastest, before = 0.0, cell.at()
    for way in (*[0.0] * 5, 4.0, *[0.0] * 40, -4.0, *[0.0] * 40):
        cell.go(1, way)
        fastest, before = max(fastest, float(np.linalg.norm(cell.at() - before)) / TICK), cell.at()
    assert "torn" in [event.what for event in cell.events]
    assert fastest < 6.0, "what falls from the table is as fast"


def test_hands_hand_it_over_and_farther_away_it_is_refused(tmp_path):
    cell = Cell(tmp_path, PERSON + TABLE + BLANK).grab(RIGHT, "blank").go(50)
    cell.grab(LEFT, "blank").go(30).grab(RIGHT).go(30)
    assert cell.said() == [("taken", RIGHT, ""), ("handed", LEFT, "")]
    assert cell.at()[2] > 0.83
    far = Cell(tmp_path, PERSON + BLANK.replace("0.25,", "4.0,")).grab(RIGHT, "blank").go(5)
    assert [(e.what, e.reason) for e in far.events] == [
        ("refused", "5.37 m away: nothing is taken from farther than 3 m")
    ]
    nothing = Cell(tmp_path, PERSON + BLANK).grab(RIGHT, "blanc").grab("operator/head", "blank").go(2)
    assert [e.what for e in nothing.events] == ["refused", "refused"]


@pytest.mark.parametrize(("friction", "slides"), [(0.2, True), (0.9, False)])
def test_on_a_ramp_friction_tells(tmp_path, friction, slides):
    text = '[[parts]]\nname = "ramp"\nshape = { box = [1.2, 0.4, 0.1] }\n'
    text += "at = { position = [0, 0, 0.8], rpy_deg = [0, 25, 0] }\n"
    lies = "at = { position = [-0.3, 0, 1.025], rpy_deg = [0, 25, 0] }"
    text += BLANK.replace("at = { position = [0.25, -0.25, 0.826] }", lies) + f"friction = {friction}\n"
    cell = Cell(tmp_path, text).go(10)
    begin = cell.at()
    cell.go(40)
    # After 0.4 s at g (sin − μ cos) of a quarter metre's drop more or less.
    down = float((cell.at() - begin) @ [np.cos(np.radians(25)), 0, -np.sin(np.radians(25))])
    expected = 9.81 * (np.sin(np.radians(25)) - friction * np.cos(np.radians(25))) / 2 * (0.5**2 - 0.1**2)
    assert down == pytest.approx(expected if slides else 0.0, abs=0.06)


def test_a_place_that_moves_takes_it_along(tmp_path):
    text = PERSON + BLANK.replace("0.826", "0.86")
    text += '[[machines]]\nname = "tray"\nshape = { box = [0.4, 0.4, 0.05] }\nmass = 2\n'
    text += "belt = { length = 3.0, along = [0, 1, 0] }\nat = { position = [0.25, -0.25, 0.8] }\n"
    text += '[[places]]\nname = "tray"\non = "tray"\nat = { position = [0, 0, 0.05] }\n'
    text += "size = [0.4, 0.4, 0.2]\nsnap = true\n"
    cell = Cell(tmp_path, text).go(5).grab(RIGHT, "blank").go(3).grab(RIGHT).go(60)
    assert cell.said()[-1] == ("placed", RIGHT, "tray")
    for k in range(100):
        t = (cell.k + 1) * TICK
        cell.engine.take(
            [JointSample(source="b", seq=k, t=t, target="tray", q=(0.005 * (k + 1),), qd=(0.5,))]
        )
        cell.go(1)
    assert cell.at()[1] - -0.25 == pytest.approx(0.5, abs=0.01)
    assert cell.at()[2] == pytest.approx(0.85, abs=2e-3)


def test_a_tumbling_one_goes_on_as_if_its_frame_stood(tmp_path):
    """Free of gravity it turns at a constant rate about an axis of inertia, through 90 degrees and on."""
    text = "[engine]\ngravity = [0, 0, 0]\n" + BLANK.replace("0.826", "2.0")
    cell = Cell(tmp_path, text)
    dofs = cell.model.mechanisms["blank"].v_address
    cell.engine._data.qvel[dofs] = [0.3, 0.1, 0, 0, 4.0, 0]
    cell.go(100)
    # The pitch axis is one of inertia: 4 rad in 1 s about y, at 0.3 and 0.1 m/s.
    assert cell.at() == pytest.approx([0.55, -0.15, 2.0], abs=5e-3)
    R = cell.state.rotations[cell.bodies["blank/body"]]
    c, s = np.cos(4.0), np.sin(4.0)
    assert pytest.approx(np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]), abs=0.02) == R
    assert cell.state.body_velocities((cell.bodies["blank/body"],))[1][0] == pytest.approx(
        [0, 4, 0], abs=1e-3
    )


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (BLANK + "rest = { position = [0, 0, 1] }\n", "rest is of what a gripper picks up"),
        (BLANK.replace("mass = 0.8\n", ""), "give its mass or density"),
        (BLANK.replace('"blank"', '"a/b"'), "has no /"),
        (BLANK + "[engine]\nphysics = false\n", "only physics moves it"),
        (BLANK + BOX + BOX, "'box' is taken"),
        (BLANK + BOX.replace("size", 'on = "boks"\nsize'), "boks"),
        (BLANK + BOX.replace("0.4, 0.3, 0.2", "0.4, 0.0, 0.2"), "size"),
    ],
)
def test_what_cannot_be_is_said_with_its_place(tmp_path, text, said):
    (tmp_path / "workstation.toml").write_text(text)
    with pytest.raises(InputError, match=said):
        _ = load(tmp_path).model


def test_the_same_grabs_move_everything_the_same_bit_for_bit(tmp_path):
    grab = GrabSample(source="room", seq=0, t=0.5, target=RIGHT, piece="blank")
    tick = Tick(seq=1, t=0.5, samples=(grab,))
    assert msgspec.msgpack.decode(msgspec.msgpack.encode(tick), type=Tick) == tick
    one, other = (carried(tmp_path) for _ in range(2))
    assert one.state.poses() == other.state.poses()
    assert one.events == other.events


def test_a_spring_pulls_as_its_formulae_say():
    rng, n, body, carrier, omega = np.random.default_rng(3), 4, 2, 3, 31.0
    xpos, xipos, com = rng.normal(size=(3, n, 3))
    xmat, ximat = (Rotation.random(n, rng=seed).as_matrix().reshape(n, 9).copy() for seed in (1, 2))
    cvel, gravity = rng.normal(size=(n, 6)), np.array([0.0, 0.0, -9.81])
    bodies = kernel.Bodies(
        xpos, xmat, ximat, xipos, cvel, com, np.arange(n, dtype=np.int32), np.zeros((n, 6)), gravity
    )
    ipos, moments, mass, pulled, fastest, quickest = rng.normal(size=3), rng.uniform(1, 2, 3), 1.7, 1.0, 4, 20
    figures = np.array([mass, pulled, 0.1, 0.4, 2.0, 0.1, fastest, quickest])
    piece, fixed = kernel.Piece(ipos, moments, figures), np.eye(4)
    fixed[:3, :3], fixed[:3, 3] = Rotation.random(rng=4).as_matrix(), rng.normal(size=3)
    tables = kernel.BODIES.rows(bodies), kernel.PIECE.rows(piece)
    gap, reels = kernel.pull(*tables, body, carrier, fixed, omega, True, False, 0.0)

    R = xmat[carrier].reshape(3, 3)
    wanted, to = R @ fixed[:3, :3], xpos[carrier] + R @ (fixed[:3, 3] + fixed[:3, :3] @ ipos)
    off = Rotation.from_matrix(wanted @ xmat[body].reshape(3, 3).T).as_rotvec()

    def velocity(i, at):
        return cvel[i, 3:] + np.cross(cvel[i, :3], at - com[i])

    def at_most(v, most):
        return v * min(1.0, most / np.linalg.norm(v))

    speed = at_most(velocity(carrier, to) + 0.5 * omega * (to - xipos[body]), fastest)
    spin = at_most(cvel[carrier, :3] + 0.5 * omega * off, quickest)
    force = 2 * omega * pulled * (speed - velocity(body, xipos[body])) - mass * gravity
    axes = ximat[body].reshape(3, 3)
    torque = axes @ (2 * omega * moments * (axes.T @ (spin - cvel[body, :3])))
    lever = xipos[body] - xipos[carrier]
    on_carrier = -np.concatenate([force, np.cross(lever, force) + torque])
    assert bodies.xfrc[body] == pytest.approx(np.concatenate([force, torque]), rel=1e-9, abs=1e-9)
    assert bodies.xfrc[carrier] == pytest.approx(on_carrier, rel=1e-9, abs=1e-9)
    assert not bodies.xfrc[:2].any()
    assert (gap, reels) == (pytest.approx(np.linalg.norm(to - xipos[body])), False)
