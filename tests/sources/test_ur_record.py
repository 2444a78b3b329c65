import numpy as np
import pytest
from made_motion import arrays, motion, target, write_csv

from seerob.core.errors import InputError
from seerob.core.samples import Quality
from seerob.devices.sources.ur_record import UrRecord

START = 4029.539


def names(field):
    return [f"{field}_{i}" for i in range(6)]


def write(path, delimiter=" ", *, digits=None, extra=(), extra_values=None, fields=("actual_q", "actual_qd")):
    t, q, qd = motion(100, 0.01)
    blocks = {"actual_q": q, "actual_qd": qd, "target_q": q + 0.01, "target_qd": qd, "actual_current": q * 9}
    columns = np.column_stack([t + START, *(blocks[f] for f in fields)])
    if digits is not None:
        columns = np.round(columns, digits)
    if extra_values is not None:
        columns = np.column_stack([columns, extra_values])
    header = ["timestamp", *(n for f in fields for n in names(f)), *extra]
    write_csv(path, header, columns, delimiter=delimiter)
    return columns, q, qd


@pytest.mark.parametrize(("delimiter", "digits"), [(" ", None), (",", 6)])
def test_both_programs_recordings_are_read_to_the_printed_digit(tmp_path, delimiter, digits):
    columns, _, _ = write(tmp_path / "log.csv", delimiter, digits=digits)
    opened = UrRecord(robot="ur10", file="log.csv").open(tmp_path, target())
    t, q, qd = arrays(opened)
    np.testing.assert_array_equal(t, columns[:, 0] - columns[0, 0])
    np.testing.assert_array_equal(q, columns[:, 1:7])
    np.testing.assert_array_equal(qd, columns[:, 7:])
    assert [s.t_device for s in opened.samples] == columns[:, 0].tolist()
    assert any("logged from the controller" in f.text for f in opened.findings)
    assert all(s.tau is None for s in opened.samples)


def test_commanded_joints_are_taken_only_on_request(tmp_path):
    _, q, _ = write(tmp_path / "log.csv", fields=("actual_q", "target_q", "actual_current"))
    measured = arrays(UrRecord(robot="ur10", file="log.csv").open(tmp_path, target()))
    commanded = arrays(UrRecord(robot="ur10", file="log.csv", joints="commanded").open(tmp_path, target()))
    np.testing.assert_array_equal(measured[1], q)
    np.testing.assert_array_equal(commanded[1], q + 0.01)


def test_a_recording_without_measured_joints_says_what_it_has(tmp_path):
    write(tmp_path / "log.csv", fields=("target_q",))
    with pytest.raises(InputError, match='joints = "commanded"'):
        UrRecord(robot="ur10", file="log.csv").open(tmp_path, target())


def test_rows_with_the_robot_off_are_invalid_and_stops_are_said(tmp_path):
    mode, status = np.full(100, 7.0), np.ones(100)
    mode[10:15], mode[20:30], status[40:] = 3, 5, 3
    write(
        tmp_path / "log.csv",
        extra=("robot_mode", "safety_status"),
        extra_values=np.column_stack([mode, status]),
    )
    opened = UrRecord(robot="ur10", file="log.csv").open(tmp_path, target())
    invalid = [i for i, s in enumerate(opened.samples) if s.quality is Quality.INVALID]
    assert invalid == list(range(10, 15))
    texts = " ".join(f.text for f in opened.findings if f.level == "warning")
    assert "robot off in 5 of 100 rows, first at 0.100 s" in texts
    assert "not running in 10 of 100 rows, first at 0.200 s" in texts
    assert "protective stop (safety_status 3) in 60 rows, first at 0.400 s" in texts


def test_a_torque_is_taken_only_where_it_is_one(tmp_path):
    write(tmp_path / "log.csv", extra=names("actual_current_as_torque"), extra_values=np.ones((100, 6)) * 3)
    opened = UrRecord(robot="ur10", file="log.csv").open(tmp_path, target())
    assert {s.tau for s in opened.samples} == {(3.0,) * 6}


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("time q\n1 2\n", "no column 'timestamp'"),
        ("timestamp actual_q_0 actual_q_0\n1 2 3\n", "there twice"),
        ("timestamp actual_q_0 actual_q_2\n1 2 3\n", "no column 'actual_q_0'"),
        ("timestamp actual_q_0\n1 2\n2 x\n", "row 3 column 'actual_q_0': holds 'x'"),
        ("timestamp actual_q_0\n1 2\n0.5 2\n", "goes back"),
        ("timestamp actual_q_0\n", "0 samples"),
    ],
)
def test_other_and_damaged_files_are_refused(tmp_path, text, word):
    (tmp_path / "log.csv").write_text(text)
    with pytest.raises(InputError) as error:
        UrRecord(robot="ur10", file="log.csv").open(tmp_path, target(1))
    assert word in str(error.value)
