import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_motion import DOF, arrays, motion, target, write_csv

from seerob.core.errors import InputError
from seerob.devices.sources.robodk import Robodk, error_bits

JOINTS = [f"J{i + 1}" for i in range(DOF)]
SPEEDS = [f"Speed_J{i + 1}" for i in range(DOF)]


def write(path, *, step=False, errors=(), header=True, speeds=True, delimiter=",", n=60):
    t, q, qd = motion(n, 0.02)
    time = np.concatenate([[0], np.diff(t)]) if step else t
    code = np.zeros(n)
    for row, value in dict(errors).items():
        code[row] = value
    fixed = [code, np.ones(n), np.ones(n), np.ones(n), time, *[np.full(n, 500.0)] * 3]
    columns = [np.degrees(q), *fixed, *([np.degrees(qd)] if speeds else [])]
    names = [
        *JOINTS,
        "ERROR",
        "MM_STEP",
        "DEG_STEP",
        "MOVE_ID",
        "TIME",
        "X",
        "Y",
        "Z",
        *(SPEEDS if speeds else []),
    ]
    write_csv(path, names if header else None, np.column_stack(columns), delimiter=delimiter)
    return t, q, qd


@pytest.mark.parametrize("step", [False, True])
@pytest.mark.parametrize("header", [False, True])
@pytest.mark.parametrize("delimiter", [",", ";", "\t", " "])
def test_elapsed_and_step_times_with_and_without_header(tmp_path, step, header, delimiter):
    t, q, qd = write(tmp_path / "a.csv", step=step, header=header, delimiter=delimiter)
    opened = Robodk(robot="ur10", file="a.csv").open(tmp_path, target())
    heard = arrays(opened)
    np.testing.assert_allclose(heard[0], t, rtol=0, atol=1e-14)
    np.testing.assert_allclose(heard[1], q, rtol=0, atol=1e-15)
    np.testing.assert_allclose(heard[2], qd, rtol=0, atol=1e-15)
    texts = " ".join(f.text for f in opened.findings)
    assert ("from row to row" in texts) == step
    assert ("no header" in texts) != header


def test_time_read_the_wrong_way_round_does_not_fit_the_speeds(tmp_path):
    write(tmp_path / "a.csv")
    with pytest.raises(InputError, match=r"off by a factor|does not follow"):
        Robodk(robot="ur10", file="a.csv", time="step").open(tmp_path, target())
    write(tmp_path / "b.csv", n=3, speeds=False)
    with pytest.raises(InputError, match='time = "elapsed"'):
        Robodk(robot="ur10", file="b.csv").open(tmp_path, target())


def test_a_row_that_repeats_the_one_before_is_left_out_and_said(tmp_path):
    write(tmp_path / "a.csv", step=True)
    lines = (tmp_path / "a.csv").read_text().splitlines()
    cells = lines[20].split(",")
    cells[10] = "0.0"
    lines.insert(21, ",".join(cells))
    (tmp_path / "a.csv").write_text("\n".join(lines))
    opened = Robodk(robot="ur10", file="a.csv").open(tmp_path, target())
    assert len(list(opened.samples)) == 60
    assert any("1 rows that repeat" in f.text for f in opened.findings)


@given(st.sets(st.integers(0, 15)))
def test_error_is_a_binary_number_in_decimal_digits(bits):
    assert error_bits(float(sum(10**b for b in bits))) == tuple(sorted(bits))


@pytest.mark.parametrize(
    ("code", "word"),
    [
        (1, "bit 0 (kinematic: no solution)"),
        (10, "bit 1 (joint limit or out of reach)"),
        (100, "bit 2 (singularity)"),
        (10_000_000, "bit 7 (target cannot be reached)"),
    ],
)
def test_what_robodk_cannot_perform_is_refused_or_reported(tmp_path, code, word):
    write(tmp_path / "a.csv", errors={10: code, 11: code})
    with pytest.raises(InputError) as error:
        Robodk(robot="ur10", file="a.csv").open(tmp_path, target())
    assert f"row 12: ERROR {word} in 2 rows, first at 0.200 s (row 12)" in str(error.value)
    opened = Robodk(robot="ur10", file="a.csv", error_rows="report").open(tmp_path, target())
    assert any(word in f.text and f.level == "warning" for f in opened.findings)


@pytest.mark.parametrize(
    ("code", "word"),
    [(1000, "near a singularity"), (4000, "near a singularity"), (100_000, "collision"), (20, "inaccurate")],
)
def test_what_robodk_only_warns_of_is_a_warning(tmp_path, code, word):
    write(tmp_path / "a.csv", errors={10: code})
    opened = Robodk(robot="ur10", file="a.csv").open(tmp_path, target())
    assert [f.level for f in opened.findings if word in f.text] == ["warning"]


def test_both_bits_of_one_row_are_named(tmp_path):
    write(tmp_path / "a.csv", errors={10: 11})
    with pytest.raises(InputError) as error:
        Robodk(robot="ur10", file="a.csv").open(tmp_path, target())
    assert len(error.value.problems) == 2


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("a,b\nc,d\n", "no header with J1 and ERROR"),
        ("J1,J2,ERROR,MM_STEP,DEG_STEP,MOVE_ID\n1,2,0,1,1,1\n", "no TIME column"),
        ("J1,J3,ERROR,TIME\n1,2,0,1\n", "joint columns J1, J3"),
        ("1,2,3\n", "no header, and 3 columns"),
        ("J1,ERROR,TIME\n1,0,0\n2,0,0\n", "repeats"),
        ("J1,ERROR,TIME\n1,0,0\n2,0,1\n3,0,-1\n", "goes back"),
    ],
)
def test_other_and_damaged_files_are_refused(tmp_path, text, word):
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(InputError) as error:
        Robodk(robot="ur10", file="a.csv").open(tmp_path, target(1))
    assert word in str(error.value)
