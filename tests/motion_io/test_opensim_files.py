"""TRC and storage files: what is written is read back; OpenSim's coordinates turn bones as ours do."""

import numpy as np
import pytest

from seerob.core.errors import InputError
from seerob.description.humans import manikin
from seerob.description.humans.skeleton import BONES, JOINTS, bone_poses
from seerob.files.motion_capture import joint_angles, storage, trc
from seerob.files.motion_capture import joint_angles as opensim
from seerob.files.motion_capture.markers import MarkerReading

NAMES = ("LFHD", "C 7", "LASI", "LANK")
T = 0.5 + np.arange(20) / 120


def markers():
    rng = np.random.default_rng(3)
    values = rng.normal(0, 0.03, (20, 4, 3)) + np.array([1.7, 1.45, 0.95, 0.08])[:, None] * [0.0, 0.0, 1.0]
    values[4:7, 3] = np.nan
    return values


@pytest.mark.parametrize(("up", "unit"), [("y", "mm"), ("z", "m"), ("x", "cm"), ("-y", "mm")])
def test_markers_are_read_back_as_they_were_written(tmp_path, up, unit):
    path = tmp_path / "r.trc"
    path.write_text("".join(trc.written(NAMES, T, markers(), up=up, unit=unit)))
    captured = trc.read(path, MarkerReading(file="r.trc"))
    assert captured.layout.names == ("LFHD", "C_7", "LASI", "LANK")
    found = np.stack([frame.positions for frame in captured.frames])
    np.testing.assert_allclose(found, markers(), atol=1e-5)
    np.testing.assert_allclose([frame.t for frame in captured.frames], T, atol=1e-6)
    assert captured.rate == pytest.approx(120.0, rel=1e-4)


def test_markers_lie_in_the_same_world_as_opensims_coordinates(tmp_path):
    """OpenSim's ground has x forward, y up and z to the right, in both of its files."""
    rng = np.random.default_rng(5)
    world = markers() + rng.uniform(-2, 2, (1, 1, 3)) * [1.0, 1.0, 0.0]
    path = tmp_path / "r.trc"
    lines = trc.head(NAMES, len(T), 120.0)
    rows = trc.cells(opensim.in_its_world(world))
    body = (
        "\t".join([str(k), f"{t:.6f}", *row]) + "\n" for k, (t, row) in enumerate(zip(T, rows, strict=True))
    )
    path.write_text("".join([*lines, *body]))
    captured = trc.read(path, MarkerReading(file="r.trc"))
    np.testing.assert_allclose(np.stack([f.positions for f in captured.frames]), world, atol=1e-5)


def test_no_row_ends_with_a_blank_and_every_row_is_as_wide_as_the_others():
    lines = list(trc.written(NAMES, T, markers()))
    rows = [line.rstrip("\n").split("\t") for line in lines[6:]]
    assert {len(row) for row in rows} == {2 + 3 * len(NAMES)}
    assert all(cell for row in rows for cell in row)
    assert rows[5][-1] == "NaN"
    assert lines[2].split()[2:5] == ["20", "4", "mm"]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda s: s.replace("PathFileType", "Path"), "PathFileType is expected"),
        (lambda s: s.replace("Frame#", "Bild"), "Frame#, Time"),
        (lambda s: s.replace("C_7", "LFHD"), "twice: LFHD"),
        (lambda s: s.replace("NaN", "nix"), "could not convert"),
        (lambda s: s.replace("mm", "klafter"), "give unit"),
        (lambda s: s.replace("NaN\n", "NaN\t5\n"), "1 cells more than markers"),
        (lambda s: s[: s.index("X1")], "0 frames of 4 points"),
    ],
)
def test_what_is_wrong_with_a_trc_is_said(tmp_path, change, message):
    path = tmp_path / "r.trc"
    path.write_text(change("".join(trc.written(NAMES, T, markers()))))
    with pytest.raises(InputError, match=message):
        trc.read(path, MarkerReading(file="r.trc"))


@pytest.mark.parametrize("degrees", [True, False])
def test_a_storage_file_is_read_back(tmp_path, degrees):
    values = np.random.default_rng(1).normal(0, 40, (20, 3))
    values[2, 1] = np.nan
    path = tmp_path / "r.mot"
    path.write_text("".join(storage.written(("a", "b c", "d"), T, values, degrees=degrees)))
    found = storage.read(path, file="r.mot")
    np.testing.assert_allclose(found.values, values, atol=1e-8)
    assert (found.labels, found.degrees, found.findings) == (("a", "b_c", "d"), degrees, ())


def test_counts_of_a_storage_header_that_are_wrong_are_said(tmp_path):
    path = tmp_path / "r.sto"
    path.write_text("x\nnRows=9\nnColumns=2\ninDegrees=no\nendheader\ntime a\n0 1\n1 2\n")
    found = storage.read(path, file="r.sto")
    assert [f.text for f in found.findings] == ["r.sto: its header says nrows = 9, there are 2"]
    path.write_text("x\nendheader\ntime a\n0 1\n1 2 3\n")
    with pytest.raises(InputError, match="line 5: 3 values, 2 labels"):
        storage.read(path, file="r.sto")


def random_q(seed=0, size=0.6):
    rng = np.random.default_rng(seed)
    return rng.uniform(-size, size, (50, len(JOINTS)))


def test_opensims_coordinates_come_back_and_turn_the_bones_that_both_have():
    q = random_q()
    # What OpenSim's model does not have.
    for bone in ("neck", "head", "clavicle"):
        q[:, [k for k, name in enumerate(JOINTS) if bone in name]] = 0.0
    for joint in ("knee", "ankle"):
        q[:, [k for k, n in enumerate(JOINTS) if joint in n and n.endswith("_rotation")]] = 0.0
    q[:, :3] = 0.0
    person = manikin.build(name="o", stature=1.75, mass=75, sex="male")
    there = opensim.from_joints(q, np.zeros((50, 3)))
    back, _, used = opensim.to_joints(opensim.coordinates(), there)
    assert set(used) == set(opensim.coordinates())
    before, after = bone_poses(person, q)[0], bone_poses(person, back)[0]
    same = [k for k, bone in enumerate(BONES) if bone != "lumbar"]  # one joint of the back, not two
    np.testing.assert_allclose(after[:, same], before[:, same], atol=1e-9)
    np.testing.assert_allclose(opensim.from_joints(back, np.zeros((50, 3))), there, atol=1e-9)


def test_senses_of_opensims_coordinates():
    names = opensim.coordinates()

    def q_of(**values):
        row = np.array([[values.get(name, 0.0) for name in names]])
        return dict(zip(JOINTS, opensim.to_joints(names, row)[0][0], strict=True))

    assert q_of(knee_angle_r=0.5)["right_knee_extension"] == -0.5
    assert q_of(hip_adduction_l=0.2)["left_hip_abduction"] == pytest.approx(-0.2)
    assert q_of(arm_add_l=0.2)["left_shoulder_abduction"] == pytest.approx(-0.2)
    assert q_of(arm_flex_r=0.7)["right_shoulder_flexion"] == pytest.approx(0.7)
    assert q_of(pelvis_rotation=0.4)["pelvis_turn_left"] == pytest.approx(0.4)
    back = q_of(lumbar_extension=0.6)
    assert back["lumbar_extension"] == back["thorax_extension"] == pytest.approx(0.3)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_sense_of_a_bent_knee_is_told_by_the_knees(tmp_path, sign):
    values = np.array([[0.0, 0.0], [sign * 60, sign * 5]])
    path = tmp_path / "r.mot"
    path.write_text("".join(storage.written(("knee_angle_r", "knee_angle_l"), np.arange(2.0), values)))
    found = joint_angles.from_storage(path, file="r.mot")
    assert found.q[1, JOINTS.index("right_knee_extension")] == pytest.approx(-np.radians(60))
    assert any("gait2392" in f.text for f in found.findings) == (sign < 0)


def test_a_table_of_joints_needs_units_and_known_names(tmp_path):
    path = tmp_path / "r.csv"
    path.write_text("time [s];right_knee_flexion [deg];both_elbow_flexion [rad]\n0;0;0\n1;90;0.5\n")
    found = joint_angles.from_table(path, file="r.csv")
    assert found.q[1, JOINTS.index("right_knee_extension")] == pytest.approx(-np.pi / 2)
    assert found.q[1, JOINTS.index("left_elbow_flexion")] == 0.5
    path.write_text("time;right_knee_flexion;wing [deg]\n0;0;0\n1;90;0\n")
    with pytest.raises(InputError) as caught:
        joint_angles.from_table(path, file="r.csv")
    assert "no unit in this header" in str(caught.value)
    assert "no time with a unit" in str(caught.value)


@pytest.mark.parametrize(
    ("row", "message"), [("1", "no time in this row"), ("1\t0.5", "no marker that has a name and is seen")]
)
def test_rows_that_hold_nothing(tmp_path, row, message):
    lines = list(trc.written(NAMES, T, markers()))[:6]
    path = tmp_path / "r.trc"
    path.write_text("".join(lines) + f"{row}\n{row}\n{row}\n")
    with pytest.raises(InputError, match=message):
        trc.read(path, MarkerReading(file="r.trc"))
