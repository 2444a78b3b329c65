"""What a source says of its tool and its torques is compared with the twin. The arms that speak are foreign:
Denavit–Hartenberg parameters of their maker, and Pinocchio's dynamics."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from oracles.pinocchio_oracle import pinocchio_model
from seerob.app.emulation.ur_fields import ControllerState
from seerob.core.samples import JointSample
from seerob.core.snapshot import Finding, Verdict
from seerob.core.transforms import rotation_from_rpy
from seerob.description.robots import library
from seerob.devices.sources.fri import joint_sample as fri_sample
from seerob.devices.sources.modbus_robot import joint_sample as modbus_sample
from seerob.devices.sources.modbus_robot import standing
from seerob.devices.sources.rtde import joint_sample as rtde_sample
from seerob.files.trajectories.trajectory import position_noise
from seerob.protocols.plc.modbus import load as load_map
from seerob.protocols.robots.fri import Edition, Monitoring, decode_monitoring, encode_monitoring
from seerob.protocols.ros.ros_messages import Content, Joints, Transform, encode, store
from seerob.protocols.ros.ros_messages import Edition as RosEdition
from seerob.session.run import Judge, bind, engine_of
from seerob.session.station import Station, load
from seerob.twin.controller_check import (
    ControllerCheck,
    compared,
    controller_log,
    fixed_offset,
    heavier,
    rigid_error,
    sign_or_unit,
)
from seerob.twin.engine import Engine

DH = {
    # a2, a3, d1, d4, d5, d6 [m]: Universal Robots, "DH Parameters for calculations of kinematics"
    "ur5e": (-0.425, -0.3922, 0.1625, 0.1333, 0.0997, 0.0996),
    "ur10e": (-0.6127, -0.57155, 0.1807, 0.17415, 0.11985, 0.11655),
    "ur3e": (-0.24355, -0.2132, 0.15185, 0.13105, 0.08535, 0.0921),
    "ur10": (-0.612, -0.5723, 0.1273, 0.163941, 0.1157, 0.0922),
}
TURN = np.pi / 2


def dh_tcp(robot: str, q: np.ndarray, tool: tuple[float, float, float] = (0, 0, 0)) -> np.ndarray:
    """TCP in the controller's base [m], shape (N, 3): standard DH, multiplied out by hand."""
    a2, a3, d1, d4, d5, d6 = DH[robot]
    found = []
    for angles in q:
        T = np.eye(4)
        for theta, d, a, alpha in zip(
            angles, (d1, 0, 0, d4, d5, d6), (0, a2, a3, 0, 0, 0), (TURN, 0, 0, TURN, -TURN, 0), strict=True
        ):
            c, s, ca, sa = np.cos(theta), np.sin(theta), np.cos(alpha), np.sin(alpha)
            T = T @ [[c, -s * ca, s * sa, a * c], [s, c * ca, -c * sa, a * s], [0, sa, ca, d], [0, 0, 0, 1]]
        found.append(T[:3, :3] @ tool + T[:3, 3])
    return np.array(found)


T = np.arange(0, 1, 0.05)
MOVING = np.array([0.3, -1.2, 1.1, -1.4, -1.5, 0.2]) + 0.4 * np.sin(np.outer(T, [1.0, 1.5, 2, 2.5, 3, 3.5]))
STANDING = np.tile(MOVING[0], (len(T), 1))


def log_of(
    folder: Path,
    q: np.ndarray,
    tcp: np.ndarray | None,
    tau: np.ndarray | None = None,
    speed: np.ndarray | None = None,
) -> None:
    """As ``record.py`` of Universal Robots writes it."""
    names = ["timestamp", *(f"actual_q_{i}" for i in range(6))]
    table = [T[:, None], q]
    if tcp is not None:
        names += [f"actual_TCP_pose_{i}" for i in range(6)]
        table += [tcp, np.zeros((len(T), 3))]
    if tau is not None:
        names += [f"actual_current_as_torque_{i}" for i in range(6)]
        table.append(tau)
    if speed is not None:
        names += [f"actual_TCP_speed_{i}" for i in range(6)]
        table.append(np.hstack([speed, np.zeros((len(T), 3))]))
    np.savetxt(folder / "log.csv", np.hstack(table), header=" ".join(names), comments="")


def station(
    folder: Path, model: str = "ur5e", robot: str = "", tools: str = "", source: str = "ur_record"
) -> Station:
    """One arm that follows the log, and a distance that is within."""
    (folder / "workstation.toml").write_text(f"""
[[robots]]
name = "arm"
model = "library:{model}"
base = {{ position = [0.3, -0.2, 0.8], rpy_deg = [0, 0, 37] }}
{robot}
{tools}
[[humans]]
name = "operator"
sex = "female"
stature = 1.65
mass = 60
at = {{ position = [3.5, 0, 0] }}
[[sources]]
kind = "{source}"
robot = "arm"
file = "log.csv"
[[safety]]
kind = "minimum_distance"
name = "distance"
between = ["arm", "operator"]
limit = 0.05
[[safety]]
kind = "tool_force"
name = "force"
at = "arm"
limit = 100
""")
    return load(folder)


def about_tool(station: Station) -> Finding:
    """The one finding about the tool centre point."""
    (found,) = (f for _, o in station.sources for f in o.findings if "tool centre point" in f.text)
    return found


TOOL = """
[[tools]]
name = "gripper"
on = "arm/tool0"
shape = { box = [0.05, 0.05, 0.15] }
mass = 0.5
at = { position = [0, 0, 0.075] }
tcp = { position = [0, 0, 0.075] }
"""


@pytest.mark.parametrize("q", [MOVING, STANDING], ids=["moving", "standing"])
@pytest.mark.parametrize("model", ["ur5e", "ur10e"])
def test_the_log_of_another_robot_is_not_within_and_its_robot_is_named(
    tmp_path: Path, model: str, q: np.ndarray
) -> None:
    log_of(tmp_path, q, dh_tcp("ur5e", q))
    found = about_tool(station(tmp_path, model))
    if model == "ur5e":
        assert (found.level, found.holds) == ("note", ())
        return
    assert (found.level, found.holds) == ("warning", ("arm",))
    assert "library:ur5e would fit, with its flange, to 0.0 mm" in found.text


def test_a_verdict_of_the_wrong_robot_is_undecided(tmp_path: Path) -> None:
    log_of(tmp_path, MOVING, dh_tcp("ur5e", MOVING))
    right, wrong = (station(tmp_path, model).run().results["distance"].verdict for model in ("ur5e", "ur10e"))
    assert (right, wrong) == (Verdict.WITHIN, Verdict.UNDECIDED)


def test_a_tool_that_the_file_forgets_is_missed(tmp_path: Path) -> None:
    log_of(tmp_path, MOVING, dh_tcp("ur5e", MOVING, (0, 0, 0.15)))
    found = about_tool(station(tmp_path))
    assert found.holds == ("arm",)
    assert "a tool centre point at [0, 0, 150] mm of the flange would fit" in found.text
    assert about_tool(station(tmp_path, tools=TOOL)).text.endswith("the tcp of gripper, to 0.0 mm")
    given = "controller_tcp = { position = [0, 0, 0.15] }"
    assert about_tool(station(tmp_path, robot=given)).level == "note"
    typed = "controller_tcp = { position = [0, 0, 0.12] }"
    assert about_tool(station(tmp_path, robot=typed)).holds == ("arm",)


def test_a_controller_without_a_tool_says_nothing_of_the_twins(tmp_path: Path) -> None:
    log_of(tmp_path, MOVING, dh_tcp("ur5e", MOVING))
    found = about_tool(station(tmp_path, tools=TOOL))
    assert found.level == "note"
    assert "its controller knows of no tool" in found.text


@pytest.mark.parametrize(("robot", "tcp", "payload", "words"), [
    ("ur5e", 0.15, 0.5, ""), ("ur5e", 0.0, 0.0, ""), ("ur10e", 0.15, 0.5, "another robot, tool"),
    ("ur5e", 0.25, 0.5, "tool centre point"), ("ur5e", -0.15, 0.5, "tool centre point"),
    ("ur5e", 0.15, 3.0, "3 kg at its flange"),
])  # fmt: skip
def test_what_the_emulated_controller_says_of_another_arm_is_found(
    tmp_path: Path, robot: str, tcp: float, payload: float, words: str
) -> None:
    """The emulator's tool is where the maker's parameters have it, and a live twin of another arm is told."""
    said = ControllerState(library.load(robot), tcp=tcp, payload=payload)
    assert np.array([said(tuple(q), (0.0,) * 6)["actual_TCP_pose"][:3] for q in MOVING]) == pytest.approx(
        dh_tcp(robot, MOVING, (0, 0, tcp)), abs=1e-12
    )
    log_of(tmp_path, MOVING, None)
    listening = ControllerCheck(station(tmp_path, tools=TOOL).model, "arm")
    reasons = []
    for t, q, qd in zip(T, MOVING, np.gradient(MOVING, T, axis=0), strict=True):
        fields = {"timestamp": t, "actual_q": tuple(q), "actual_qd": tuple(qd), **said(tuple(q), tuple(qd))}
        sample = rtde_sample(fields, target="arm", arrived=t)
        reasons.append(listening.invalid_reason(sample) or heavier(sample.payload, 0.5))
    assert all(words in reason for reason in reasons)
    assert any(reasons) == bool(words)


@pytest.mark.parametrize(("off", "robot", "holds"), [
    (0.008, "", ()), (0.013, "", ("arm",)), (0.013, "tcp_tolerance_mm = 15", ()),
    (0.008, "tcp_tolerance_mm = 2", ("arm",)),
])  # fmt: skip
def test_calibration_of_an_arm_has_a_tolerance_that_the_file_can_give(
    tmp_path: Path, off: float, robot: str, holds: tuple[str, ...]
) -> None:
    log_of(tmp_path, MOVING, dh_tcp("ur5e", MOVING) + np.array([0, 0, off]))
    assert about_tool(station(tmp_path, robot=robot)).holds == holds


TOOL_VELOCITY = np.gradient(dh_tcp("ur5e", MOVING, (0, 0, 0.15)), T, axis=0, edge_order=2)
"""Of the tool [m/s]: differences of places that the maker's parameters say."""


@pytest.mark.parametrize(
    ("factor", "holds"), [(1.0, ()), (0.85, ()), (0.5, ("arm",)), (2.0, ("arm",)), (0, ("arm",))]
)
def test_the_speed_that_a_log_says_of_its_tool_must_be_that_of_its_joints(
    tmp_path: Path, factor: float, holds: tuple[str, ...]
) -> None:
    """As when the file's times are in another unit than they seem, or its joints stand still in it."""
    log_of(tmp_path, MOVING, None, speed=factor * TOOL_VELOCITY)
    found = [
        f
        for _, o in station(tmp_path, tools=TOOL).sources
        for f in o.findings
        if "centre point moves" in f.text
    ]
    assert [f.holds for f in found] == [holds] * bool(holds)


def live(made: Station, samples: list[JointSample]) -> list[str]:
    """What is said of each when it is heard live."""
    engine, found = Engine(made.model, driven={"arm": 0.2}, live={"arm"}), []
    for sample in samples:
        engine.take([sample])
        found.append(engine.state.hearings["arm"].heard[-1].reason)
    return found


@pytest.mark.parametrize(("factor", "doubt"), [(1.0, False), (0.85, False), (0.5, True), (0.0, True)])
def test_the_speed_of_the_tool_that_a_live_source_says_is_compared(
    tmp_path: Path, factor: float, doubt: bool
) -> None:
    log_of(tmp_path, MOVING, None)
    made = station(tmp_path, tools=TOOL)
    qd = np.gradient(MOVING, T, axis=0, edge_order=2)
    said = factor * np.linalg.norm(TOOL_VELOCITY, axis=1)
    found = live(made, [
        JointSample(source="s", seq=i, t=t, target="arm", q=tuple(MOVING[i]), qd=tuple(qd[i]),
                    tcp_speed=said[i])
        for i, t in enumerate(T.tolist())
    ])  # fmt: skip
    assert ["of no one motion" in text for text in found[6:]] == [doubt] * (len(T) - 6)
    assert not any(found[:1])


def lbr_flange(lengths: tuple[float, ...], q: np.ndarray) -> np.ndarray:
    """Flange of an LBR in its base [m]: its maker's lengths between seven axes that meet in three points."""
    place, turn = np.zeros(3), np.eye(3)
    for k, angle in enumerate(q):
        place = place + turn @ [0, 0, lengths[k]]
        about_y = (0, (-1) ** (k // 2) * angle, 0)
        turn = turn @ rotation_from_rpy(about_y if k % 2 else (0, 0, angle))
    return place + turn @ [0, 0, lengths[7]]


IIWA_14 = (0.36, 0.0, 0.42, 0.0, 0.4, 0.0, 0.0, 0.126)
IIWA_7 = (0.34, 0.0, 0.4, 0.0, 0.4, 0.0, 0.0, 0.126)


@pytest.mark.parametrize(("lengths", "doubt"), [(IIWA_14, False), (IIWA_7, True)])
def test_the_pose_that_fri_says_is_compared(tmp_path: Path, lengths: tuple[float, ...], doubt: bool) -> None:
    """In millimetres on the wire."""
    model = station(tmp_path, "iiwa14").model  # the file is not opened
    q = (0.3, 0.7, -0.4, -1.2, 0.5, 0.9, 0.2)
    said = 1e3 * lbr_flange(lengths, np.array(q))
    message = Monitoring(edition=Edition.V2_7, sequence=0, q=q, tcp=(*said.tolist(), 1.0, 0.0, 0.0, 0.0))
    heard = decode_monitoring(encode_monitoring(message))
    sample = fri_sample(heard, target="arm", arrived=0.0, device=0.0, qd=None)
    assert bool(ControllerCheck(model, "arm").invalid_reason(sample)) == doubt


def test_modbus_says_where_the_tool_is_while_the_robot_stands() -> None:
    doosan = load_map("doosan", Path())
    values = {f"q{k}": 100 * k for k in range(6)} | {f"qd{k}": 0 for k in range(6)}
    values |= {"tcp0": 1234, "tcp1": -5000, "tcp2": 10}

    def said(**more: int) -> JointSample:
        return modbus_sample(doosan, values | more, {"robot_state": "moving"}, target="arm", arrived=0.0)

    assert said().tcp == pytest.approx((0.1234, -0.5, 0.001))
    assert standing(said(), said()).tcp == said().tcp
    for before, now in (
        (None, said()),
        (said(q1=101), said()),
        (said(tcp0=1), said()),
        (said(), said(qd2=1)),
    ):
        assert standing(before, now).tcp is None


def test_a_live_source_with_another_tool_says_which_would_fit(tmp_path: Path) -> None:
    log_of(tmp_path, MOVING, None)
    said = dh_tcp("ur5e", MOVING, (0, 0, 0.15))
    found = live(station(tmp_path), [
        JointSample(source="s", seq=i, t=0.2 * i, target="arm", q=tuple(MOVING[i]), tcp=tuple(said[i]))
        for i in range(len(T))
    ])  # fmt: skip
    assert found[0].endswith("another robot, tool or calibration")
    assert "a tool centre point at [0, 0, 150] mm of the flange would fit to 0.0 mm" in found[-1]


@pytest.mark.parametrize("sign", [1, -1])
def test_live_torques_of_the_opposite_sign_are_not_relied_on(tmp_path: Path, sign: int) -> None:
    log_of(tmp_path, STANDING, None)
    oracle = pinocchio_model(library.load("ur5e"))
    tau = sign * pin.computeGeneralizedGravity(oracle, oracle.createData(), STANDING[0])
    made = station(tmp_path)
    engine, judge = Engine(made.model, driven={"arm": 0.2}, live={"arm"}), Judge(bind(made.model))
    for i in range(60):
        engine.take([JointSample(source="s", seq=i, t=0.01 * i, target="arm", q=tuple(STANDING[0]),
                                 qd=(0.0,) * 6, tau=tuple(tau))])  # fmt: skip
        state = engine.tick() if i else engine.start()
    reasons = {r.name: r.reason for r in judge(state)}
    assert ("opposite sign" in reasons["force"]) == (sign < 0)
    assert "opposite" not in reasons["distance"]


def csv_of(folder: Path, tcp: np.ndarray) -> None:
    """A table of a simulator that says nothing of the frame."""
    names = ["t [s]", *(f"J{i + 1} [rad]" for i in range(6)), "X [m]", "Y [m]", "Z [m]"]
    np.savetxt(
        folder / "log.csv",
        np.column_stack([T, MOVING, tcp]),
        header=",".join(names),
        comments="",
        delimiter=",",
    )


def test_a_table_may_speak_of_any_frame_but_not_of_another_robot(tmp_path: Path) -> None:
    own, turned = dh_tcp("ur5e", MOVING), rotation_from_rpy((0.3, -0.4, 2.0))
    for tcp in (own, own @ turned.T + [5, -3, 1]):
        csv_of(tmp_path, tcp)
        found = [f for _, o in station(tmp_path, source="csv").sources for f in o.findings if f.holds]
        assert found == []
    csv_of(tmp_path, dh_tcp("ur10e", MOVING) @ turned.T)
    assert about_tool(station(tmp_path, source="csv")).holds == ("arm",)


def test_a_live_controller_says_where_its_tool_is() -> None:
    values = {"timestamp": 1.0, "actual_q": (0.0,) * 6, "actual_TCP_pose": (0.1, 0.2, 0.3, 1.0, 2.0, 3.0)}
    assert rtde_sample(values, target="arm", arrived=0.0).tcp == (0.1, 0.2, 0.3)
    del values["actual_TCP_pose"]
    assert rtde_sample(values, target="arm", arrived=0.0).tcp is None


def test_each_live_sample_is_compared(tmp_path: Path) -> None:
    log_of(tmp_path, MOVING, None)
    made = station(tmp_path)
    said = dh_tcp("ur5e", MOVING)
    doubts = []
    for tcp in (None, said, said + np.array([0, 0.02, 0])):
        engine = Engine(made.model, driven={"arm": 0.2}, live={"arm"})
        for i in range(3):
            engine.take([JointSample(source="s", seq=i, t=0.05 * i, target="arm", q=tuple(MOVING[i]),
                                     tcp=None if tcp is None else tuple(tcp[i]))])  # fmt: skip
        doubts.append(engine.start().invalid_reason("arm"))
    assert doubts[:2] == ["", ""]
    assert "20 mm from the twin's, more than 10 mm (tcp_tolerance)" in doubts[2]
    result = Judge(bind(made.model))(engine.start())[0]
    assert result.verdict is Verdict.UNDECIDED


@pytest.mark.parametrize(
    ("factor", "said"), [(1.0, ""), (-1.0, "opposite sign"), (1000.0, "N·mm read as N·m")]
)
def test_torques_of_the_opposite_sign_are_told(tmp_path: Path, factor: float, said: str) -> None:
    oracle = pinocchio_model(library.load("ur5e"))
    data = oracle.createData()
    tau = np.array([pin.computeGeneralizedGravity(oracle, data, q) for q in STANDING])
    log_of(tmp_path, STANDING, None, factor * tau + [0.5, -1, 0.8, 0.1, -0.1, 0.05])
    found = [f for _, o in station(tmp_path).sources for f in o.findings if "its torques" in f.text]
    assert [f.holds for f in found] == [("force",)] * bool(said)
    assert all(said in f.text for f in found)


def test_what_fits_exactly_is_found_exactly() -> None:
    rng = np.random.default_rng(4)
    rotations = np.array([rotation_from_rpy(rng.uniform(-3, 3, 3)) for _ in range(30)])
    positions, offset = rng.uniform(-1, 1, (30, 3)), np.array([0.1, -0.2, 0.3])
    fit = fixed_offset(rotations, positions, rotations @ offset + positions)
    np.testing.assert_allclose(fit.offset, offset, atol=1e-12)
    assert fit.error < 1e-12
    mirrored = positions * [1, 1, -1]
    assert rigid_error(positions, positions @ rotations[0].T + 2) < 1e-12
    assert rigid_error(positions, mirrored) > 0.1


def test_a_standing_robot_that_seems_to_move_is_told(tmp_path: Path) -> None:
    rng = np.random.default_rng(2)
    t = 0.008 * np.arange(500)
    q = np.tile(MOVING[0], (500, 1)) + rng.normal(0, 1e-4, (500, 6))
    smooth = np.sin(np.outer(t, np.arange(1, 7)))
    np.testing.assert_allclose(position_noise(q), 1e-4, rtol=0.2)
    np.testing.assert_allclose(position_noise(q + smooth), 1e-4, rtol=0.25)
    assert position_noise(smooth).max() < 3e-5
    names = ["timestamp", *(f"actual_q_{i}" for i in range(6))]
    # The rate of change of the noise of two samples 16 ms apart, at levers of some decimetres.
    for positions, low, high in ((q, 15, 60), (np.tile(MOVING[0], (500, 1)), None, None)):
        np.savetxt(tmp_path / "log.csv", np.column_stack([t, positions]), header=" ".join(names), comments="")
        texts = [
            f.text for _, o in station(tmp_path).sources for f in o.findings if "seems to move" in f.text
        ]
        assert len(texts) == (low is not None)
        assert all(low < float(re.findall(r"at up to (\d+) mm/s", text)[0]) < high for text in texts)


def test_noise_of_derived_speeds_is_an_interval(tmp_path: Path) -> None:
    """A standing robot that seems to move by noise neither keeps a small limit nor exceeds it."""
    rng = np.random.default_rng(2)
    t = 0.008 * np.arange(60)
    q = np.tile(MOVING[0], (len(t), 1)) + rng.normal(0, 1e-4, (len(t), 6))
    names = ["timestamp", *(f"actual_q_{i}" for i in range(6))]
    limits = {0.001: Verdict.UNDECIDED, 0.02: Verdict.UNDECIDED, 0.5: Verdict.WITHIN}
    more = "[engine]\nphysics = false\n"
    for k, limit in enumerate(limits):
        for name, rest in (("velocity", 'at = "arm"'), ("velocity", 'of = "arm"'), ("kinetic_energy", "")):
            of = f"limit = {limit}" if rest else f'robot = "arm"\nlimit = {20 * limit**2}'
            more += f'[[safety]]\nkind = "{name}"\nname = "{name}{rest[:2]}{k}"\n{rest}\n{of}\n'
    log_of(tmp_path, MOVING, None)
    station(tmp_path)
    file = tmp_path / "workstation.toml"
    file.write_text(file.read_text() + more)
    np.savetxt(tmp_path / "log.csv", np.column_stack([t, q]), header=" ".join(names), comments="")
    made = load(tmp_path)
    log, batch = made.run(), made.batch()
    for k, verdict in enumerate(limits.values()):
        for name in ("velocityat", "velocityof", "kinetic_energy"):
            assert log.results[f"{name}{k}"].verdict is verdict
            assert batch[f"{name}{k}"].verdict is verdict
    engine, judge = engine_of(made.model), Judge(bind(made.model))
    engine.take(list(made.sources[0][1].samples)[:2])
    (point,) = (r for r in judge(engine.start()) if r.name == "velocityat0")
    assert point.interval is not None
    arm = made.model.mechanisms["arm"]
    J = engine.state.jacobian(arm.tip, arm)[:3]
    # Of the first sample the difference is one-sided: (−3, 4, −1)/2.
    sigma = 3 * 1e-4 * np.sqrt(26) / (2 * 0.008)
    expected = np.sqrt((J**2).sum()) * sigma
    assert point.interval[1] - (point.value or 0.0) == pytest.approx(expected, rel=0.3)


def test_small_torques_tell_no_sign() -> None:
    assert sign_or_unit(np.array([[1.0, -1.0]]), np.array([[-1.0, 1.0]])) == ""
    assert "opposite" in sign_or_unit(np.array([[10.0, -10.0]]), np.array([[-10.0, 10.0]]))


@pytest.mark.parametrize(
    ("payload", "share"),
    [
        (0.0, 0.0),
        (1.5, 0.0),
        (1.6, 0.0),
        (1.7, 1.0),
        (np.where(np.arange(len(T)) < len(T) // 2, 1.5, 4), 0.5),
    ],
)
@pytest.mark.parametrize("asked", ["run", "batch"])
def test_what_a_log_has_at_the_flange_and_the_twin_has_not(tmp_path, payload, share, asked) -> None:
    """From where on it says more than the twin carries, nothing that rests on the robot is within."""
    log_of(tmp_path, MOVING, None)
    lines = (tmp_path / "log.csv").read_text().splitlines()
    figures = ["payload", *np.broadcast_to(payload, len(T))]
    (tmp_path / "log.csv").write_text("".join(f"{a} {b}\n" for a, b in zip(lines, figures, strict=True)))
    tool = '[[tools]]\nname = "gripper"\non = "arm/tool0"\nshape = { box = [0.1, 0.1, 0.1] }\nmass = 1.5\n'
    made = station(tmp_path, tools=tool)
    if asked == "batch":
        found = made.batch()["distance"]
        said, reasons = found.answers.verdict, found.reasons
    else:
        found = made.run().results["distance"]
        said, reasons = found.verdicts, found.reasons
    undecided = np.asarray(said) == 2
    assert abs(undecided.mean() - share) < 0.05
    assert all(
        "kg at its flange, and the twin carries 1.5 kg" in reasons[k] for k in np.flatnonzero(undecided)
    )


@pytest.mark.parametrize("robot", ["ur5e", "ur10e"])
def test_a_source_that_says_where_its_tool_is_now_and_then_is_compared_then(
    tmp_path: Path, robot: str
) -> None:
    """As registers do, while the robot stands: the first sample and the last say nothing."""
    log_of(tmp_path, MOVING, None)
    model = station(tmp_path).model
    said = [
        JointSample(
            source="s", seq=i, t=t, target="arm", q=tuple(q), qd=(0.0,) * 6,
            **({"tcp": tuple(tcp), "tcp_speed": 0.0} if i % 3 == 1 else {}),
        )
        for i, (t, q, tcp) in enumerate(zip(T.tolist(), MOVING.tolist(), dh_tcp(robot, MOVING), strict=True))
    ]  # fmt: skip
    words = controller_log(said, "run.mcap")
    assert words is not None
    (found,) = compared(model, "arm", words)
    assert found.holds == (() if robot == "ur5e" else ("arm",))
    assert controller_log(said[:1], "run.mcap") is None


@pytest.mark.parametrize(("recorded", "apart"), [("ur5e", 0.0), ("ur10e", 0.0), ("ur10e", 0.003)])
def test_transforms_of_a_bag_tell_another_robot(tmp_path: Path, recorded: str, apart: float) -> None:
    """Whoever recorded them had a robot_description of their own; by Pinocchio. Joint names are the same.

    Edges of two instants are of no pose.
    """
    from rosbags.rosbag1 import Writer

    robot = pinocchio_model(library.load(recorded))
    data, types = robot.createData(), {"typestore": store(RosEdition.ROS1)}
    names = tuple(robot.names)[1:]
    with Writer(tmp_path / "log.bag") as writer:
        every = {
            topic: (writer.add_connection(topic, content.message_type, **types), content)
            for topic, content in (("/joint_states", Content.JOINT_STATE), ("/tf", Content.TF))
        }
        for t, q in zip(T.tolist(), MOVING, strict=True):
            pin.framesForwardKinematics(robot, data, q)
            elbow, tool = (data.oMf[robot.getFrameId(name)] for name in ("forearm_link", "tool0"))
            edges = []
            for parent, child, pose, stamp in (
                ("base_link", "forearm_link", elbow, t - apart),
                ("forearm_link", "tool0", elbow.actInv(tool), t),
            ):
                x, y, z, w = pin.Quaternion(pose.rotation).coeffs().tolist()
                edges.append(Transform(100 + stamp, parent, child, tuple(pose.translation), (w, x, y, z)))
            said = {
                "/joint_states": Joints(100 + t, names, tuple(q), (), ()),
                "/tf": tuple(edges),
            }
            for topic, (connection, content) in every.items():
                writer.write(
                    connection, round(1e9 * (100 + t)), encode(content, said[topic], RosEdition.ROS1)
                )
    (tmp_path / "workstation.toml").write_text(
        '[[robots]]\nname = "arm"\nmodel = "library:ur5e"\n'
        '[[sources]]\nkind = "bag"\nrobot = "arm"\nfile = "log.bag"\n'
    )
    found = [f for _, o in load(tmp_path).sources for f in o.findings if "tool centre point" in f.text]
    assert [f.holds for f in found] == ([] if apart else [() if recorded == "ur5e" else ("arm",)])
    assert all("library:ur10e would fit" in f.text for f in found if f.holds)
