"""Grippers that pick up and let go: where a workpiece is, on whom it weighs, and when nobody knows."""

from __future__ import annotations

import numpy as np
import pytest

from made_cell import heard, made, two_r
from seerob import load
from seerob.core.errors import InputError, Undecided
from seerob.core.samples import JointSample
from seerob.core.snapshot import Verdict
from seerob.criteria.contact.clamped_regions import Clamping
from seerob.criteria.stopping.onset import Foreseen, _Window
from seerob.session.run import Judge, engine_of, pump, ticks
from seerob.twin.engine import Engine

AXIS = """
[[machines]]
name = "axis"
shape = { box = [0.2, 0.2, 0.1] }
mass = 5
uniform_density = true
turn = { about = [0, 1, 0] }
[[machines]]
name = "hand"
on = "axis"
at = { position = [1.0, 0, 0] }
shape = { box = [0.02, 0.02, 0.06] }
mass = 0.2
uniform_density = true
grip = { upper = 0.1 }
[[parts]]
name = "post"
shape = { sphere = 0.1 }
at = { position = [1.0, 0, -2.0] }
"""
NUT = """
[[workpieces]]
name = "nut"
on = "hand"
shape = { box = [0.04, 0.04, 0.04] }
mass = 2.0
uniform_density = true
rest = { position = [1.0, 0, 0.01], rpy = [0.3, 0, 0] }
"""
STATION = "[engine]\nphysics = false\n" + AXIS + NUT
WIDE, SHUT, LIFTED = 0.1, 0.05, -0.5
SILENT = None
TICK = 0.01


class Cell:
    """A gripper on an arm of one joint, told where to be at each tick."""

    def __init__(self, folder, text=STATION, angle=0.0, opening=WIDE):
        (folder / "workstation.toml").write_text(text)
        self.station = load(folder)
        self.model = self.station.model
        self.engine = Engine(self.model, driven={"axis": 0.05, "hand": 0.05})
        self.k = 0
        self._hear(angle, opening)
        self.state = self.engine.start()

    def _hear(self, angle, opening, speed=0.0):
        said = {"axis": (angle, speed)}
        if opening is not SILENT:
            said["hand"] = (opening / 2, 0.0)
        self.engine.take(
            JointSample(source=name, seq=self.k, t=self.k * TICK, target=name, q=(q,), qd=(qd,))
            for name, (q, qd) in said.items()
        )

    def go(self, *steps, speed=0.0):
        """Through angles and openings, one a tick."""
        for angle, opening in steps:
            self.k += 1
            self._hear(angle, opening, speed)
            self.state = self.engine.tick()
        return self

    def pose(self, name="nut/resting"):
        index = next(b.index for b in self.model.bodies if b.name == name)
        return self.state.rotations[index].copy(), self.state.positions[index].copy()

    def between(self, a, b):
        return self.state.closest(self.model.gap(self.model.select(a), self.model.select(b))).distance

    def picked(self):
        return self.go((0.0, WIDE), (0.0, SHUT))


def turned(angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


@pytest.fixture
def cell(tmp_path):
    return Cell(tmp_path)


def test_what_lies_there_is_no_part_of_the_gripper(cell):
    cell.go((0.0, WIDE))
    box = np.abs(cell.pose()[0] @ np.diag([0.02] * 3)).sum(axis=1)
    assert cell.pose()[1] == pytest.approx([1.0, 0, 0.01])
    # As far as from the box to the sphere below it, which the gripper, higher up, does not come near.
    assert cell.between("nut", "post") == pytest.approx(2.01 - box[2] - 0.1, abs=2e-3)
    assert cell.between("hand", "post") == pytest.approx(2.0 - 0.03 - 0.1, abs=2e-3)


def test_it_keeps_its_place_in_the_hand_until_it_is_let_go(cell):
    R, x = cell.pose()
    cell.picked()
    for angle in np.linspace(0, LIFTED, 11):
        cell.go((angle, SHUT))
        held = cell.pose("nut")
        np.testing.assert_allclose(held[0], turned(angle) @ R, atol=1e-6)
        np.testing.assert_allclose(held[1], turned(angle) @ x, atol=1e-6)
    cell.go((LIFTED, WIDE), (0.0, WIDE))
    np.testing.assert_allclose(cell.pose()[0], held[0], atol=1e-6)
    np.testing.assert_allclose(cell.pose()[1], held[1], atol=1e-6)
    # And it is picked up from there again.
    cell.go((LIFTED, WIDE), (LIFTED, SHUT), (0.0, SHUT))
    np.testing.assert_allclose(cell.pose("nut")[1], x, atol=1e-6)


def test_it_weighs_on_the_gripper_while_it_is_held(cell):
    axis = cell.model.mechanisms["axis"]
    empty = cell.go((0.0, WIDE)).state.mass_matrix(axis)[0, 0]
    cell.picked()
    # Steiner: m (x² + z²) about the axis, and the box about its own y axis.
    added = 2.0 * (1.0**2 + 0.01**2) + 2.0 * (0.04**2 + 0.04**2) / 12
    empty_shut = cell.state.mass_matrix(axis)[0, 0] - added
    assert empty_shut == pytest.approx(empty, rel=1e-6)
    assert cell.go((0.0, WIDE)).state.mass_matrix(axis)[0, 0] == pytest.approx(empty, rel=1e-6)


def test_gravity_and_energy_go_with_it(tmp_path):
    energy = '[[safety]]\nkind = "velocity"\nname = "v"\nof = "nut"\nlimit = 1.0\n'
    cell = Cell(tmp_path, STATION + energy)
    from seerob.twin.joint_torques import gravity

    axis = cell.model.mechanisms["axis"]
    (speed,) = cell.station.bound
    empty = gravity(cell.state, axis)
    cell.picked()
    weight = 2.0 * 9.80665
    assert abs(gravity(cell.state, axis) - empty)[0] == pytest.approx(weight * 1.0, rel=5e-3)
    cell.go((-0.01, SHUT), (-0.02, SHUT), speed=-1.0)
    corner = np.linalg.norm([1.0 + 0.02 * 1.5, 0.02 * 1.5 + 0.01])
    assert 1.0 < speed.evaluate(cell.state).value < corner + 1e-6
    cell.go((-0.02, WIDE), (-0.03, WIDE), speed=-1.0)
    assert speed.evaluate(cell.state).value == 0.0


@pytest.mark.parametrize(
    ("rest", "why"),
    [
        ([1.0, 0.06, 0.0], "beside a finger"),
        ([1.0, 0.0, 0.056], "above both fingertips"),
        ([1.05, 0.0, 0.0], "in front of them"),
    ],
)
def test_what_is_not_between_the_fingers_stays(tmp_path, rest, why):
    cell = Cell(tmp_path, STATION.replace("[1.0, 0, 0.01], rpy = [0.3, 0, 0]", str(rest)))
    cell.go((0.0, WIDE), (0.0, 0.04), (0.0, 0.0), (LIFTED, 0.0))
    np.testing.assert_allclose(cell.pose()[1], rest, atol=1e-12, err_msg=why)


def test_a_silent_gripper_leaves_it_undecided(cell):
    cell.go((0.0, WIDE), *[(0.0, SILENT)] * 8)
    with pytest.raises(Undecided, match="hand: not heard"):
        cell.between("nut/resting", "post")
    with pytest.raises(Undecided, match="hand: not heard"):
        cell.state.mass_matrix(cell.model.mechanisms["axis"])
    assert cell.go((0.0, WIDE), (0.0, WIDE)).between("nut", "post") > 0


def test_let_go_in_silence_means_nobody_knows_where(cell):
    cell.picked().go(*[(LIFTED, SILENT)] * 8)
    # Still held after the silence: nothing was missed.
    assert cell.go((LIFTED, SHUT), (LIFTED, SHUT)).between("nut", "post") > 0
    cell.go(*[(0.0, SILENT)] * 8)
    cell.go((0.0, WIDE), (0.0, WIDE))
    with pytest.raises(
        Undecided, match=r"nut: let go while its gripper was not relied on .*nobody knows where"
    ):
        cell.between("nut/resting", "post")
    assert cell.between("hand", "post") > 0
    with pytest.raises(Undecided, match="nobody knows where"):
        cell.between("nut", "post")


SECOND = """
[[machines]]
name = "lift"
shape = { box = [0.1, 0.1, 0.1] }
mass = 5
uniform_density = true
at = { position = [1.0, 0.5, 0] }
slide = { along = [0, 0, 1], lower = -1, upper = 1 }
[[machines]]
name = "second"
on = "lift"
at = { position = [0, -0.5, 0] }
shape = { box = [0.02, 0.02, 0.06] }
mass = 0.2
uniform_density = true
grip = { upper = 0.1, along = [0, 1, 0] }
"""


@pytest.mark.parametrize("held", [True, False])
def test_what_another_gripper_takes_is_where_nobody_knows(tmp_path, held):
    """Handed over, or taken from where it lies: it stayed in mid-air, and weighed on nobody."""
    cell = Cell(tmp_path, STATION + SECOND)
    cell.engine = Engine(cell.model, driven=dict.fromkeys(("axis", "hand", "lift", "second"), 0.05))
    cell.k, lift = 0, cell.model.mechanisms["lift"]

    def go(opening, other, height=0.0):
        said = {"axis": 0.0, "hand": opening / 2, "lift": height, "second": other / 2}
        cell.engine.take(
            JointSample(source=name, seq=cell.k, t=cell.k * TICK, target=name, q=(q,), qd=(0.0,))
            for name, q in said.items()
        )
        cell.state = cell.engine.tick() if cell.k else cell.engine.start()
        cell.k += 1

    go(WIDE, WIDE)
    if held:
        go(SHUT, WIDE)
        go(SHUT, 0.04)
        assert cell.between("nut", "post") > 0
        assert cell.state.mass_matrix(lift) is not None
    go(WIDE, WIDE if held else 0.04)
    if held:
        # Who opens too is not there to take it.
        assert cell.between("nut", "post") > 0
        go(SHUT, 0.04)
        go(WIDE, 0.04)
    go(WIDE, 0.04, 0.01)
    with pytest.raises(Undecided, match="nut: the fingers of second are at it"):
        cell.between("nut", "post")
    with pytest.raises(Undecided, match="nut: the fingers of second are at it"):
        cell.state.mass_matrix(lift)


def test_the_picture_shows_it_where_it_is(cell):
    names = [b.name for b in cell.model.bodies]
    for steps in [(0.0, WIDE)], [(0.0, SHUT), (LIFTED, SHUT)]:
        cell.go(*steps)
        rows = np.frombuffer(cell.state.poses(), "<f4").reshape(-1, 7)
        one, other = rows[names.index("nut")], rows[names.index("nut/resting")]
        np.testing.assert_array_equal(one, other)
        assert abs(one[:3]).max() < 2


def test_two_runs_of_one_model_do_not_share_what_they_hold(tmp_path):
    one = Cell(tmp_path)
    mass = one.model.mj.body_mass.copy()
    other = Cell(tmp_path)
    other.picked()
    one.go((0.0, WIDE))
    assert one.pose()[1] == pytest.approx([1.0, 0, 0.01])
    np.testing.assert_array_equal(one.model.mj.body_mass, mass)


def test_a_person_beside_it_is_not_beside_the_robot(tmp_path):
    text = STATION.replace("[1.0, 0, -2.0]", "[1.0, 0, -0.2]")
    rest = text.replace("position = [1.0, 0, 0.01], rpy = [0.3, 0, 0]", "position = [3.0, 0, 0]")
    far = Cell(tmp_path, rest).go((0.0, WIDE))
    without = Cell(tmp_path, text.replace(NUT, "")).go((0.0, WIDE))
    assert far.between("hand", "post") == without.between("hand", "post")


@pytest.mark.parametrize(("who", "verdict"), [("nut", "undecided"), ("axis/body", "within")])
def test_many_instants_at_once_do_not_tell_where_it_is(tmp_path, who, verdict):
    asked = f'kind = "minimum_distance"\nname = "d"\nbetween = ["{who}", "post"]\nlimit = 0.1\n'
    (tmp_path / "workstation.toml").write_text(f"{STATION}[[safety]]\n{asked}")
    found = load(tmp_path).batch({"axis": [[0.0]]}, {"axis": [[0.0]]})["d"]
    assert found.verdict == verdict
    assert verdict == "within" or "hand picks it up and lets it go" in found.reasons[0]


def test_with_physics_it_is_carried_too(tmp_path):
    cell = Cell(tmp_path, AXIS + NUT)
    cell.picked()
    angles = 0.5 * LIFTED * (1 - np.cos(np.linspace(0, np.pi, 60)))
    cell.go(*((angle, SHUT) for angle in angles), *[(LIFTED, SHUT)] * 20)
    x = cell.pose("nut")[1]
    np.testing.assert_allclose(x, turned(LIFTED) @ [1.0, 0, 0.01], atol=2e-3)
    assert cell.state.hearings["axis"].error < 5e-3


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (('on = "hand"', 'on = "axis"'), "axis has no fingers to pick nut up with"),
        (
            (
                "shape = { box = [0.02, 0.02, 0.06] }",
                "shape = { polygon = [[0.1, 0], [0.2, 0], [0.2, 0.1]], height = [0, 0.1] }",
            ),
            "its fingers do not face each other",
        ),
    ],
)
def test_mistakes_are_said(tmp_path, wrong, message):
    with pytest.raises(InputError, match=message):
        Cell(tmp_path, STATION.replace(*wrong))


ARM = """
[[robots]]
name = "arm"
model = "arm.urdf"
[[machines]]
name = "hand"
on = "arm/tip"
shape = { box = [0.02, 0.02, 0.06] }
mass = 0.2
uniform_density = true
grip = { upper = 0.1 }
"""
WEIGHED = "".join(
    f'[[safety]]\nkind = "{kind}"\nname = "{kind}"\n{key} = "arm"\nlimit = 100\n'
    for kind, key in (("kinetic_energy", "robot"), ("effective_mass", "at"), ("force_polytope", "at"))
)


def weighed(folder):
    # What a cube of 4 cm may weigh.
    nut = NUT.replace('on = "hand"', 'on = "hand"\nat = { position = [0, 0, 0.5] }').replace("2.0", "1.2")
    return made(
        folder,
        ARM + nut + WEIGHED,
        {"arm.urdf": two_r()},
    )


def test_without_a_run_nobody_knows_what_a_robot_weighs_that_picks_things_up(tmp_path):
    still = {"arm": np.zeros((3, 2)), "hand": np.zeros((3, 1))}
    found = weighed(tmp_path).batch(still, {name: q + 0.1 for name, q in still.items()})
    for kind in ("kinetic_energy", "effective_mass", "force_polytope"):
        assert found[kind].answers.verdict.tolist() == [2, 2, 2]
        assert "only a run tells" in found[kind].reasons[0]


def test_nor_while_its_gripper_is_silent(tmp_path):
    station = weighed(tmp_path)
    engine, judge = Engine(station.model, driven={"arm": 0.5, "hand": 0.05}), Judge(station.bound)
    engine.take([heard("arm", 0.4 * k, (0.3 + 0.04 * k, 1.2 + 0.08 * k), (0.1, 0.2)) for k in range(2)])
    engine.take([heard("hand", 0.0, (0.04,), (0.0,))])
    known = judge(engine.start())
    for _ in range(8):
        state = engine.tick()
    for before, after in zip(known, judge(state), strict=True):
        assert before.verdict in ("within", "exceeded")
        assert after.verdict == "undecided"
        assert "hand: not heard" in after.reason


@pytest.mark.parametrize("every", ["", "every = 1.0\n"])
def test_what_is_picked_up_in_motion_is_as_fast_as_the_hand_at_once(tmp_path, every):
    t = np.arange(81) * TICK
    speed = np.clip(0.6 - 4 * (t - 0.2), 0, 0.6)
    angle = np.concatenate([[0.0], np.cumsum((speed[1:] + speed[:-1]) / 2 * TICK)]) - 0.12
    opening = np.clip(WIDE - 0.3 * t, 0.04, WIDE)
    files = {"axis.csv": ("rad", angle), "hand.csv": ("m", opening / 2)}
    tables = {
        name: f"time [s],J1 [{unit}]\n" + "".join(f"{a!r},{b!r}\n" for a, b in zip(*pair, strict=True))
        for name, (unit, q) in files.items()
        for pair in ((t.tolist(), q.tolist()),)
    }
    sources = "".join(
        f'[[sources]]\nkind = "csv"\nrobot = "{name}"\nfile = "{name}.csv"\n' for name in ("axis", "hand")
    )
    limit = f'[[safety]]\nkind = "velocity"\nname = "v"\nof = "nut"\nlimit = 0.5\n{every}'
    light = STATION.replace("mass = 2.0", "mass = 0.2")
    assert made(tmp_path, light + sources + limit, tables).run().verdict is Verdict.EXCEEDED


ROD = """
[engine]
physics = false
[[robots]]
name = "arm"
model = "arm.urdf"
[[machines]]
name = "hand"
on = "arm/tip"
at = { position = [0, 0, 0.12] }
shape = { box = [0.02, 0.02, 0.06] }
mass = 0.2
uniform_density = true
grip = { upper = 0.1 }
[[workpieces]]
name = "rod"
on = "hand"
shape = { box = [1.6, 0.04, 0.04] }
mass = 1.0
uniform_density = true
rest = { position = [1.2, 0, 0.12] }
"""


def test_what_was_picked_up_clamps_where_it_was_taken_not_where_the_file_has_it_in_the_hand(tmp_path):
    """A rod that reaches back over the inner link, 5 cm above it; held in its middle it would not."""
    model = made(tmp_path, ROD, {"arm.urdf": two_r()}).model
    engine = Engine(model, driven={"arm": 0.05, "hand": 0.05})
    clamping = Clamping(model, model.robot("arm"), {}, ("Hands and fingers",), None)

    def clamps(k, opening, speed):
        """Bodies that clamp a hand while the elbow turns."""
        said = {"arm": ((0.0, 0.0), (0.0, speed)), "hand": ((opening / 2,), (0.0,))}
        engine.take(
            JointSample(source=name, seq=k, t=k * TICK, target=name, q=q, qd=qd)
            for name, (q, qd) in said.items()
        )
        state = engine.tick() if k else engine.start()
        moving = model.robot("arm").moving
        flags, *_ = clamping.at(state, np.ones((len(moving), 1), bool))
        return {model.bodies[i].name for i, flag in zip(moving, flags[:, 0], strict=True) if flag}

    assert "rod" not in clamps(0, WIDE, 0.3)
    clamps(1, 0.041, 0.3)
    assert {"rod", "arm/l1"} <= clamps(2, 0.041, 0.3)
    assert "rod" in clamps(3, 0.041, -0.3)
    assert "rod" not in clamps(4, 0.041, 0.0)


@pytest.mark.parametrize(("opening", "known"), [(WIDE, True), (0.041, False), (0.0, True)])
def test_a_run_that_begins_with_it_in_the_hand_does_not_know_where_it_is(tmp_path, opening, known):
    """Shut or wide open it is not held; lying between the fingers it is, and keeps its place."""
    cell = Cell(tmp_path, STATION, angle=LIFTED, opening=opening)
    hand = cell.model.mechanisms["hand"]
    for _ in range(3):
        if known:
            assert cell.between("nut", "post") > 1
            cell.state.weigh(hand)
        else:
            for ask in (lambda: cell.between("nut", "post"), lambda: cell.state.weigh(hand)):
                with pytest.raises(
                    Undecided, match="nut: the run begins with the fingers of hand as if they held it"
                ):
                    ask()
        # However it goes on.
        cell.go((LIFTED, opening), (LIFTED, WIDE))
    assert not Cell(tmp_path, STATION, angle=0.0, opening=SHUT).state.attachments.unknown


def test_what_is_picked_up_speeds_up_with_the_hand_until_it_brakes(tmp_path):
    """What was found of coming ticks while it lay there is forgotten."""
    t = np.arange(61) * TICK
    speed = np.clip(4 * (t - 0.3), 0, 0.8)
    angle = np.cumsum(speed) * TICK
    opening = np.clip(WIDE - 0.3 * t, 0.04, WIDE)
    tables = {
        f"{name}.csv": f"time [s],{head}\n"
        + "".join(",".join(map(repr, row)) + "\n" for row in rows.tolist())
        for name, head, rows in (
            ("arm", "J1 [rad],J2 [rad]", np.stack([t, angle, 0 * t], axis=1)),
            ("hand", "J1 [m]", np.stack([t, opening / 2], axis=1)),
        )
    }
    sources = "".join(
        f'[[sources]]\nkind = "csv"\nrobot = "{name}"\nfile = "{name}.csv"\n' for name in ("arm", "hand")
    )
    post = '[[parts]]\nname = "post"\nshape = { sphere = 0.1 }\nat = { position = [0, 3, 0] }\n'
    station = made(
        tmp_path,
        ROD.replace("1.2, 0, 0.12", "1.9, 0, 0.12") + post + sources,
        {"arm.urdf": two_r(), **tables},
    )
    model = station.model
    robot, held = model.robot("arm"), []
    gap = model.gap(model.select("post"), robot.moving)
    rod = gap.b.index(next(body.index for body in model.bodies if body.name == "rod"))
    kept = Foreseen(model, robot, gap, 0.2, joints=False)
    # Memory that was somebody else's, with the motion that comes: nothing of it is taken for a tick before.
    kept._window = _Window(64, 4, len(gap.b), 2)
    for array in kept._window._arrays[2:]:
        array[:] = 0.0
    kept._window._arrays.last[:] = 9.0

    def judge(state):
        known, anew = (each.at(state)(1.0) for each in (kept, Foreseen(model, robot, gap, 0.2, joints=False)))
        # Fingers that slow down were faster when the ticks were looked at.
        assert (known.S_r >= anew.S_r - 1e-4).all()
        assert (known.v_s >= anew.v_s - 1e-4).all()
        held.append(known.v_s[rod])
        return ()

    for _ in ticks(engine_of(model), judge, pump(station.sources, TICK, ahead={"arm": 0.3})):
        pass
    assert held[0] < 1e-6
    assert max(held) > 0.5
