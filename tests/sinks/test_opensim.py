"""TRC and MOT files, read back by line as OpenSim's format has it, and by our own readers."""

from pathlib import Path

import made_person_run as run
import made_run
import numpy as np
import pytest
from msgspec.structs import replace

from seerob.core.errors import InputError
from seerob.description.humans.skeleton import BONES, JOINTS
from seerob.files.motion_capture import joint_angles, trc
from seerob.outputs.sinks import opensim
from seerob.outputs.sinks.opensim import EstimatedCoordinates, OpenSim
from seerob.outputs.tables.people import people

N = 100


def write(folder: Path, n: int = N, **options: object) -> Path:
    with OpenSim(**options).open(run.scene(), {}, {}, folder) as writer:
        for k in range(n):
            writer.write(run.snapshot(k), run.samples(k))
    return folder / "opensim"


def plain(path: Path) -> tuple[list[str], np.ndarray]:
    """Names and values of a TRC by nothing but its own rules: y up, millimetres."""
    lines = path.read_text(encoding="utf-8").split("\n")
    head = dict(zip(lines[1].split("\t"), lines[2].split("\t"), strict=True))
    names = [cell for cell in lines[3].split("\t")[2:] if cell]
    data = np.array([[float(cell) for cell in line.split("\t")] for line in lines[6:-1]])
    assert head["Units"] == "mm"
    assert (int(head["NumFrames"]), int(head["NumMarkers"])) == (len(data), len(names))
    assert data[:, 0].tolist() == list(range(1, len(data) + 1))
    assert float(head["DataRate"]) == pytest.approx((len(data) - 1) / (data[-1, 1] - data[0, 1]), rel=1e-5)
    return names, data


def test_joint_centres_are_those_of_the_snapshots_y_up_in_millimetres(tmp_path):
    names, data = plain(write(tmp_path) / "op_bones.trc")
    assert names == list(BONES)
    for k in (0, N - 1):
        x, y, z = np.frombuffer(run.snapshot(k).poses, "<f4").reshape(-1, 7)[1:, :3].T * 1e3
        assert data[k, 2::3] == pytest.approx(x, abs=1e-2)
        assert data[k, 3::3] == pytest.approx(z, abs=1e-2)
        assert data[k, 4::3] == pytest.approx(-y, abs=1e-2)


def test_what_a_device_saw_is_there_with_nan_where_it_saw_nothing(tmp_path):
    folder = write(tmp_path)
    names, data = plain(folder / "op_seen_by_camera_op.trc")
    assert names == ["RIGHT_HAND", "HEAD"]
    assert np.isnan(data[:10, 5:]).all()
    assert np.isfinite(data[10:]).all()
    points, _ = trc.read_points(folder / "op_seen_by_camera_op.trc", file="x")
    assert points.values[:, 0, 2] == pytest.approx([1e3 * k / 3 for k in range(0, N, 5)], abs=1e-4)


def test_coordinates_come_back_as_the_joints_they_were(tmp_path, monkeypatch):
    # More than one batch, and one that is not full.
    monkeypatch.setattr(opensim, "TOGETHER", 32)
    found = joint_angles.from_storage(write(tmp_path) / "op_coordinates.mot", file="x")
    assert found.t == pytest.approx(0.01 * np.arange(N), abs=1e-6)
    assert found.q[:, run.KNEE] == pytest.approx([run.joints(k)[run.KNEE] for k in range(N)], abs=1e-7)
    rest = [i for i, name in enumerate(JOINTS) if i != run.KNEE and not name.startswith("pelvis_")]
    assert np.abs(found.q[:, rest]).max() < 1e-6
    pelvis = np.frombuffer(run.snapshot(0).poses, "<f4").reshape(-1, 7)[1, :3]
    assert found.pelvis[0] == pytest.approx(pelvis, abs=1e-6)


def test_every_keeps_rows_evenly_spaced(tmp_path):
    _, data = plain(write(tmp_path, every=0.03) / "op_bones.trc")
    assert data[:, 1] == pytest.approx(0.03 * np.arange(34))


def test_a_run_of_one_tick_is_a_file_too(tmp_path):
    with OpenSim().open(run.scene(), {}, {}, tmp_path) as writer:
        writer.write(run.snapshot(0), ())
    assert "NumFrames" in (tmp_path / "opensim/op_bones.trc").read_text(encoding="utf-8")


def test_without_a_person_there_is_nothing_to_write(tmp_path):
    with pytest.raises(InputError, match="no person"):
        OpenSim().open(made_run.scene(), {}, {}, tmp_path)


def test_coordinates_that_nobody_measured_are_named_in_the_header(tmp_path):
    told = EstimatedCoordinates()
    person = people(run.scene())[0]
    seen = {bone: (1e-3, None) for bone in BONES if bone not in ("right_shank", "right_foot")}
    for k in range(4):
        told.add(person.joints_measured(replace(run.snapshot(k), bones={"op": seen} if k else {})))
    text = "".join(told.lines())
    named = {name for name in joint_angles.coordinates() if f"{name} (75 % of the rows)" in text}
    assert named == {"knee_angle_r", "ankle_angle_r", "subtalar_angle_r", "mtp_angle_r"}
    assert "in 1 of 4 rows" in text
    told = EstimatedCoordinates()
    for k in range(300):
        bones = {"op": dict.fromkeys(BONES, (1e-3, None)) if k == 7 else seen}
        told.add(person.joints_measured(replace(run.snapshot(1), bones=bones)))
    assert "knee_angle_r (99.7 % of the rows)" in "".join(told.lines())
    path = write(tmp_path) / "op_coordinates.mot"
    assert "estimated, no device saw the bones: pelvis_tilt (95 % of the rows)" in path.read_text("utf-8")
    assert len(joint_angles.from_storage(path, file="x").t) == N
