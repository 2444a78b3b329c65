import tomllib
from pathlib import Path

import msgspec
import numpy as np
import pinocchio as pin
import pytest
from made_motion import target, write_csv, write_sheet
from scipy.spatial.transform import Rotation

import seerob as sr
from kept_run import Kept
from oracles.pinocchio_oracle import pinocchio_model
from seerob.core.errors import InputError
from seerob.core.plugin import load
from seerob.core.samples import PoseSample
from seerob.core.snapshot import Verdict
from seerob.description.loader import load_robot
from seerob.devices.sources.tool_path import ToolPath
from seerob.files.tables.mapping import Mapping
from seerob.files.tables.motion import read_motion, read_tool_motion
from seerob.session.run import pump
from seerob.workstation.source import Source

HEADER = ["Time [s]", "X [m]", "Y [m]", "Z [m]", "qw", "qx", "qy", "qz"]
IDENTITY = tuple(tuple(row) for row in np.eye(4).tolist())


def path(n=50, period=0.01):
    """t [s], position [m] and rotations of a motion with a closed form."""
    t = np.arange(n) * period
    position = np.column_stack([0.6 + 0.1 * np.sin(t), 0.2 * np.cos(t), 0.5 + 0.1 * t])
    return t, position, Rotation.from_euler("ZYX", np.column_stack([t, 0.3 - t, 3 * t]))


def rows(n=50, period=0.01):
    t, position, rotation = path(n, period)
    return np.column_stack([t, position, rotation.as_quat(scalar_first=True)])


def standing(world_from_base=IDENTITY, **changes):
    return msgspec.structs.replace(target(), world_from_base=world_from_base, **changes)


def heard(opened):
    samples = list(opened.samples)
    assert all(isinstance(s, PoseSample) for s in samples)
    wxyz = np.array([s.wxyz for s in samples])
    return (
        np.array([s.t for s in samples]),
        np.array([s.position for s in samples]),
        Rotation.from_quat(wxyz, scalar_first=True),
    )


def refused(folder, to=None, **changes):
    given = {"robot": "ur10", "file": "a.csv", "frame": "world"} | changes
    with pytest.raises(InputError) as error:
        msgspec.convert(given, ToolPath).open(folder, to or standing())
    return str(error.value)


def same(a, b, atol=1e-12):
    np.testing.assert_allclose((a.inv() * b).magnitude(), 0, atol=atol)


# -- tables -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("convention", "names", "columns"),
    [
        ("wxyz", ["qw", "qx", "qy", "qz"], lambda r: r.as_quat(scalar_first=True)),
        ("xyzw", ["a1", "a2", "a3", "a4"], lambda r: r.as_quat()),
        ("ZYX", ["A [deg]", "B [deg]", "C [deg]"], lambda r: r.as_euler("ZYX", degrees=True)),
        ("rpy", ["Roll [deg]", "Pitch [deg]", "Yaw [deg]"], lambda r: r.as_euler("xyz", degrees=True)),
        ("XYZ", ["RX [rad]", "RY [rad]", "RZ [rad]"], lambda r: r.as_euler("XYZ")),
        ("rotation_vector", ["RX [rad]", "RY [rad]", "RZ [rad]"], lambda r: r.as_rotvec()),
    ],
)
@pytest.mark.parametrize("book", [False, True])
def test_every_convention_and_unit_in_text_and_workbook_gives_the_same_poses(
    tmp_path, convention, names, columns, book
):
    t, position, rotation = path()
    header = ["Zeit [ms]", "X [mm]", "Y [mm]", "Z [mm]", *names]
    cells = np.column_stack([1000 * t, 1000 * position, columns(rotation)])
    file = "a.xlsx" if book else "a.csv"
    if book:
        write_sheet(tmp_path / file, [header, *cells.tolist()])
    else:
        write_csv(tmp_path / file, header, cells, delimiter=";", comma=True)
    mapping = {"tcp_convention": convention, "tcp_orientation": names}
    source = msgspec.convert({"robot": "ur10", "file": file, "frame": "world", "mapping": mapping}, ToolPath)
    opened = source.open(tmp_path, standing())
    ours = heard(opened)
    np.testing.assert_allclose(ours[0], t, atol=1e-15)
    np.testing.assert_allclose(ours[1], position, atol=1e-15)
    same(ours[2], rotation)
    assert opened.duration == pytest.approx(t[-1], abs=1e-15)


def test_a_table_that_declares_everything_is_read_without_a_question_and_without_joints(tmp_path):
    write_csv(tmp_path / "a.csv", HEADER, rows())
    opened = ToolPath(robot="ur10", file="a.csv", frame="world").open(tmp_path, standing())
    texts = " ".join(f.text for f in opened.findings if f.level == "assumed")
    assert "preliminary" in texts
    assert "may differ from the controller's" in texts
    with pytest.raises(InputError, match="no row names a time and joints"):
        read_motion(tmp_path / "a.csv")


def test_a_doubtful_convention_or_unit_is_asked_with_the_text_to_paste(tmp_path):
    t, position, rotation = path()
    cells = np.column_stack([t, position, rotation.as_rotvec()])
    write_csv(tmp_path / "a.csv", ["Time [s]", "X", "Y", "Z", "RX", "RY", "RZ"], cells)
    text = refused(tmp_path)
    for key in ("tcp_position_unit", "tcp_convention", "tcp_orientation_unit"):
        assert f"mapping.{key}" in text
    pasted = tomllib.loads(text[text.index("[sources.mapping]") :])["sources"]["mapping"]
    assert pasted["tcp_position_unit"] == "m"
    sure = msgspec.convert(pasted | {"tcp_convention": "rotation_vector"}, Mapping)
    motion, _, _ = read_tool_motion(tmp_path / "a.csv", sure)
    same(Rotation.from_quat(motion.wxyz, scalar_first=True), rotation)


def test_the_log_of_a_controller_needs_but_its_unit_of_time(tmp_path):
    t, position, rotation = path()
    names = ["timestamp", *[f"{k}_TCP_pose_{i}" for k in ("target", "actual") for i in range(6)]]
    pose = np.column_stack([position, rotation.as_rotvec()])
    cells = np.column_stack([t + 1e5, pose + 1, pose, t])
    write_csv(tmp_path / "a.csv", [*names, "actual_q_0"], cells, delimiter=" ")
    asked = [line.split(":")[1].strip() for line in refused(tmp_path).splitlines() if "a.csv:" in line]
    assert asked == ["mapping.time_unit"]
    motion, used, notes = read_tool_motion(tmp_path / "a.csv", Mapping(time_unit="s"))
    assert used.mapping.tcp_convention == "rotation_vector"
    np.testing.assert_array_equal(motion.position, position)
    same(Rotation.from_quat(motion.wxyz, scalar_first=True), rotation)
    assert "actual_q_0" in " ".join(notes)


def test_joint_columns_and_a_mapping_of_them_do_no_harm(tmp_path):
    cells = np.column_stack([rows(), np.sin(np.arange(50))[:, None] * np.ones(6)])
    write_csv(tmp_path / "a.csv", [*HEADER, *[f"J{i}" for i in range(1, 7)]], cells)
    mapping = {"joints": [f"J{i}" for i in range(1, 7)], "joint_unit": "rad"}
    source = {"robot": "ur10", "file": "a.csv", "frame": "world", "mapping": mapping}
    opened = msgspec.convert(source, ToolPath).open(tmp_path, standing())
    np.testing.assert_array_equal(heard(opened)[1], rows()[:, 1:4])
    assert any("not used: J1" in f.text for f in opened.findings)
    assert not any("joint_unit" in f.text for f in opened.findings)


def test_the_rows_of_another_robot_are_left_out(tmp_path):
    named = [["ur10", *row] for row in rows().tolist()] + [["left", *row] for row in (rows() + 3).tolist()]
    write_csv(tmp_path / "a.csv", ["Robot", *HEADER], named)
    opened = ToolPath(robot="ur10", file="a.csv", frame="world").open(tmp_path, standing())
    np.testing.assert_array_equal(heard(opened)[1], rows()[:, 1:4])


# -- mistakes -----------------------------------------------------------------------------------


def test_every_mistake_in_a_file_names_its_row_value_and_remedy(tmp_path):
    def edited(row, column, value):
        cells = rows().tolist()
        cells[row][column] = value
        write_csv(tmp_path / "a.csv", HEADER, cells)
        return refused(tmp_path)

    assert "row 12: time goes back" in edited(10, 0, 0.001)
    assert "row 12 column 'X [m]': holds '#REF!'" in edited(10, 1, "#REF!")
    assert "row 12 column 'qw'" in edited(10, 4, "nan")
    assert "row 12: quaternion of length" in edited(10, 4, 2.0)
    assert "row 12: the tool moves at" in edited(10, 2, 5.0)
    flipped = rows()
    flipped[10:, 4:] = -flipped[10:, 4:]
    write_csv(tmp_path / "a.csv", HEADER, flipped)
    ToolPath(robot="ur10", file="a.csv", frame="world").open(tmp_path, standing())
    write_csv(tmp_path / "a.csv", HEADER[:4], rows()[:, :4])
    assert "no tool orientation column" in refused(tmp_path)
    write_csv(tmp_path / "a.csv", ["Time [s]", *HEADER[4:]], rows()[:, [0, 4, 5, 6, 7]])
    assert "a time and tool positions" in refused(tmp_path)
    write_csv(tmp_path / "a.csv", HEADER, rows()[:1])
    assert "at least 2" in refused(tmp_path)
    assert "no such file" in refused(tmp_path, file="b.csv")


def test_millimetres_read_as_metres_are_refused_moving_or_not(tmp_path):
    header = ["Time [s]", "X", "Y", "Z", *HEADER[4:]]
    cells = rows()
    cells[:, 1:4] *= 1000
    write_csv(tmp_path / "a.csv", header, cells)
    assert "m/s" in refused(tmp_path, mapping={"tcp_position_unit": "m"})
    cells[:, 1:4] = cells[0, 1:4]
    write_csv(tmp_path / "a.csv", header, cells)
    assert "away from the base" in refused(tmp_path, mapping={"tcp_position_unit": "m"})


def test_the_frame_of_the_poses_is_never_guessed(tmp_path):
    with pytest.raises(msgspec.ValidationError, match="frame"):
        msgspec.convert({"robot": "ur10", "file": "a.csv"}, ToolPath)
    with pytest.raises(msgspec.ValidationError, match="frame"):
        msgspec.convert({"robot": "ur10", "file": "a.csv", "frame": "tool"}, ToolPath)
    write_csv(tmp_path / "a.csv", HEADER, rows())
    assert "nobody says where ur10 stands" in refused(tmp_path, target(), frame="base")
    assert 'beside frame = "world"' in refused(tmp_path, base="ur10/base")
    assert "did you mean 'ur10/tool0'" in refused(
        tmp_path, standing(frames=("ur10/tool0", "gripper")), at="ur10/tool"
    )


def test_a_base_that_could_be_two_frames_is_asked_and_each_answer_is_another_half_turn(tmp_path):
    write_csv(tmp_path / "a.csv", HEADER, rows())
    place = np.eye(4)
    place[:3, :3] = Rotation.from_euler("z", 30, degrees=True).as_matrix()
    place[:3, 3] = 0.1, 0.2, 0.75
    description = load_robot("library:ur10", folder=tmp_path, name="ur10")
    to = standing(tuple(map(tuple, place.tolist())), description=description)
    text = refused(tmp_path, to, frame="base")
    assert 'base = "ur10/base"' in text
    assert 'base = "ur10/world"' in text
    assert "no link 'ur10/wrist_1_link' that stands still" in refused(
        tmp_path, to, frame="base", base="ur10/wrist_1_link"
    )
    _, position, rotation = path()
    for base, turn in (("ur10/world", 30), ("ur10/base", 210)):
        source = ToolPath(robot="ur10", file="a.csv", frame="base", base=base)
        _, ours, turned = heard(source.open(tmp_path, to))
        about_z = Rotation.from_euler("z", turn, degrees=True)
        np.testing.assert_allclose(ours, about_z.apply(position) + place[:3, 3], atol=1e-14)
        same(turned, about_z * rotation)


def test_the_kind_is_found_by_its_name():
    assert load("sources", "tool_path", Source).__name__ == "ToolPath"


# -- the whole road -----------------------------------------------------------------------------

Q = np.array([0.3, -1.2, 1.5, -1.8, -1.5, 0.4])
PHASES = np.arange(6.0)
PLACE = pin.SE3(Rotation.from_euler("z", 30, degrees=True).as_matrix(), np.array([0.1, 0.2, 0.75]))
TCP = pin.SE3(np.eye(3), np.array([0, 0, 0.13]))
CELL = """
[[robots]]
name = "ur10"
model = "library:ur10"
base = {{ position = [0.1, 0.2, 0.75], rpy_deg = [0, 0, 30] }}
q = {q}

[[tools]]
name = "gripper"
shape = {{ box = [0.05, 0.05, 0.13] }}
on = "ur10/tool0"
mass = 1.2
tcp = {{ position_mm = [0, 0, 130] }}

[[sources]]
kind = "tool_path"
robot = "ur10"
file = "a.csv"
{source}

[[safety]]
kind = "velocity"
name = "speed"
at = "ur10"
limit = 10
"""


def joints(t):
    """A motion that keeps clear of singular positions, shape (..., 6)."""
    t = np.asarray(t)[..., None]
    return Q + 0.5 * np.sin(1.3 * t + PHASES) - 0.5 * np.sin(PHASES)


class Arm:
    """Poses of the library's arm by Pinocchio."""

    def __init__(self):
        self.model = pinocchio_model(load_robot("library:ur10", folder=Path(), name="ur10"))
        self.data = self.model.createData()

    def base_from(self, q, link):
        pin.framesForwardKinematics(self.model, self.data, q)
        return self.data.oMf[self.model.getFrameId(link)]


def station(folder, poses, times, source, q=Q):
    """A cell whose arm is driven by these poses."""
    quaternions = Rotation.from_matrix([p.rotation for p in poses]).as_quat(scalar_first=True)
    cells = np.column_stack([times, [p.translation for p in poses], quaternions])
    write_csv(folder / "a.csv", HEADER, cells)
    (folder / "workstation.toml").write_text(CELL.format(source=source, q=q.tolist()))
    return sr.load(folder)


def run(*args, **changes):
    kept = Kept()
    station(*args, **changes).run(writers=[kept])
    return kept.snapshots


@pytest.mark.parametrize(
    ("period", "source", "at"),
    [
        (0.01, 'frame = "base"\nbase = "ur10/base"', "base"),
        (0.008, 'frame = "world"', "world"),
        (0.002, 'frame = "world"\nat = "ur10/wrist_3_link"', "wrist"),
    ],
)
def test_the_twin_follows_the_path_and_keeps_the_branch_it_starts_near(tmp_path, period, source, at):
    arm = Arm()
    times = np.arange(0, 1.6 + 1e-9, period)

    def wanted(q):
        world_from_tool = PLACE * arm.base_from(q, "tool0") * TCP
        if at == "base":
            return (PLACE * arm.base_from(q, "base")).inverse() * world_from_tool
        return PLACE * arm.base_from(q, "wrist_3_link") if at == "wrist" else world_from_tool

    poses = [wanted(q).copy() for q in joints(times)]
    snapshots = run(tmp_path, poses, times, source, q=Q + 0.05)
    assert len(snapshots) == 161
    for out in snapshots:
        q, exact = np.array(out.joints["ur10"]), joints(out.t)
        ours = PLACE * arm.base_from(q, "tool0") * TCP
        ours = ours.copy()
        theirs = PLACE * arm.base_from(exact, "tool0") * TCP
        assert np.linalg.norm(ours.translation - theirs.translation) < 1e-4
        np.testing.assert_allclose(q, exact, atol=2e-4)
        assert out.results[0].verdict is Verdict.WITHIN, (out.t, out.results[0].reason)


def test_what_the_arm_cannot_reach_is_undecided_and_what_it_can_is_not(tmp_path):
    arm = Arm()
    start = (PLACE * arm.base_from(Q, "tool0") * TCP).copy()
    away = start.translation - PLACE.translation
    away /= np.linalg.norm(away)
    times = np.arange(0, 2, 0.01)
    poses = [pin.SE3(start.rotation, start.translation + 0.6 * t * away) for t in times]
    snapshots = run(tmp_path, poses, times, 'frame = "world"')
    verdicts = np.array([out.results[0].verdict.value for out in snapshots])
    reach = np.array([np.linalg.norm(p.translation - PLACE.translation) for p in poses])
    links = load_robot("library:ur10", folder=tmp_path, name="ur10").links
    longest = sum(np.linalg.norm(link.parent_from_link[:3, 3]) for link in links) + TCP.translation[2]
    assert (verdicts[reach > longest] == "undecided").all()
    assert (reach > longest).sum() > 20
    assert (verdicts[:20] == "within").all()
    assert "cannot reach the pose" in snapshots[-1].results[0].reason


@pytest.mark.parametrize("at", ["ur10/base_link", "ur10/tool1", "nothing"])
def test_a_frame_that_the_robot_does_not_move_is_refused_before_the_run(tmp_path, at):
    write_csv(tmp_path / "a.csv", HEADER, rows())
    source = f'frame = "world"\nat = "{at}"'
    (tmp_path / "workstation.toml").write_text(CELL.format(source=source, q=Q.tolist()))
    with pytest.raises(InputError, match=f"no link or tool '{at}' that ur10 moves"):
        _ = sr.load(tmp_path).sources


def test_a_loop_of_a_path_whose_ends_meet_is_judged_throughout(tmp_path):
    arm = Arm()
    times = np.arange(0, 0.5001, 0.01)
    start = (PLACE * arm.base_from(Q, "tool0") * TCP).copy()
    circle = [np.array([0, 0.05 * np.sin(4 * np.pi * t), 0.05 - 0.05 * np.cos(4 * np.pi * t)]) for t in times]
    poses = [pin.SE3(start.rotation, start.translation + c) for c in circle]
    source = 'frame = "world"\nloop = true\nloop_pause = 0.1'
    for closed in (True, False):
        chosen = poses if closed else poses[:-10]
        cell, kept = station(tmp_path, chosen, times[: len(chosen)], source), Kept()
        cell.run(
            writers=[kept],
            feed=pump(cell.sources, 0.01, endless=True),
            stop=lambda kept=kept: bool(kept.snapshots) and kept.snapshots[-1].t >= 1.2,
        )
        verdicts = {out.results[0].verdict for out in kept.snapshots}
        assert verdicts == ({Verdict.WITHIN} if closed else {Verdict.WITHIN, Verdict.UNDECIDED})
