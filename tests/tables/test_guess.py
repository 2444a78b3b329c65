import tomllib

import msgspec
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from seerob.core.errors import InputError
from seerob.files.tables.guess import guess
from seerob.files.tables.mapping import Mapping
from seerob.files.tables.motion import read_motion


def table(path, header, columns, *, delimiter=";", comma=False, above=()):
    def text(value):
        return str(value).replace(".", ",") if comma else str(value)

    lines = [*above, delimiter.join(header)]
    lines += [delimiter.join(map(text, row)) for row in np.column_stack(columns).tolist()]
    path.write_text("\n".join(lines) + "\n")
    return path


T = np.arange(20) * 0.02
Q = np.column_stack([0.3 * np.sin(T + i) for i in range(3)])


def confirm(found):
    """What a user does with the snippet: paste it into the workstation file."""
    pasted = tomllib.loads(found.toml())["sources"]["mapping"]
    return msgspec.convert(pasted, Mapping)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    name=st.sampled_from(["J{}", "Joint {}", "Achse {}", "axe {}", "A{}", "q_{}"]),
    time=st.sampled_from(["Time", "Zeit", "temps", "t"]),
    unit=st.sampled_from([None, "deg", "rad"]),
    time_unit=st.sampled_from([None, "s", "ms"]),
    dof=st.integers(1, 8),
    first=st.integers(0, 1),
    delimiter=st.sampled_from([";", ",", "\t", "|"]),
    comma=st.booleans(),
    velocity=st.booleans(),
    seed=st.integers(0, 9),
)
def test_a_guess_is_sure_exactly_when_units_are_declared_and_its_snippet_reads_the_file_exactly(
    tmp_path, name, time, unit, time_unit, dof, first, delimiter, comma, velocity, seed
):
    comma = comma and delimiter != ","
    rng = np.random.default_rng(seed)
    t = np.arange(9) * (20.0 if time_unit == "ms" else 0.02)
    q = np.round(rng.uniform(-1, 1, (9, dof)), 5)
    order = rng.permutation(dof)
    suffix = f" [{unit}]" if unit else ""
    header = [time + (f" [{time_unit}]" if time_unit else "")]
    header += [name.format(i + first) + suffix for i in order]
    columns = [t, *(q[:, i] for i in order)]
    if velocity:
        header += [
            f"Velocity {name.format(i + first)}" + (f" [{unit}/s]" if unit else "") for i in range(dof)
        ]
        columns += [q[:, i] for i in range(dof)]
    path = table(tmp_path / "a.csv", header, columns, delimiter=delimiter, comma=comma)
    found = guess(path)
    asked = set() if unit else {"joint_unit"}
    asked |= set() if time_unit else {"time_unit"}
    asked |= {"velocity_unit"} if velocity and not unit else set()
    assert set(found.questions) == asked
    trajectory, used, _ = read_motion(path, confirm(found))
    scale = np.pi / 180 if used.mapping.joint_unit == "deg" else 1.0
    np.testing.assert_array_equal(trajectory.q, q * scale)
    np.testing.assert_array_equal(trajectory.t, t * (1e-3 if used.mapping.time_unit == "ms" else 1.0))
    assert (trajectory.qd is not None) == velocity


def test_a_doubt_is_an_error_that_holds_the_text_to_paste(tmp_path):
    path = table(tmp_path / "a.csv", ["Time [s]", "J1", "J2", "J3"], [T, Q])
    with pytest.raises(InputError) as error:
        read_motion(path)
    text = str(error.value)
    assert "mapping.joint_unit" in text
    assert "could be rad or deg" in text
    snippet = text[text.index("[sources.mapping]") :]
    pasted = msgspec.convert(tomllib.loads(snippet)["sources"]["mapping"], Mapping)
    np.testing.assert_array_equal(read_motion(path, pasted)[0].q, Q)


def test_a_range_that_cannot_be_radians_is_guessed_as_degrees_and_still_asked(tmp_path):
    path = table(tmp_path / "a.csv", ["Time [s]", "J1", "J2", "J3"], [T, np.degrees(Q)])
    found = guess(path)
    assert found.mapping.joint_unit == "deg"
    assert "too much for rad" in found.questions["joint_unit"]


@pytest.mark.parametrize(
    ("names", "convention", "sure"),
    [
        (["RX [deg]", "RY [deg]", "RZ [deg]"], "XYZ", False),
        (["Roll [deg]", "Pitch [deg]", "Yaw [deg]"], "rpy", False),
        (["A [deg]", "B [deg]", "C [deg]"], "ZYX", False),
        (["qw", "qx", "qy", "qz"], "wxyz", True),
        (["qx", "qy", "qz", "qw"], "wxyz", True),
    ],
)
def test_only_named_quaternions_are_a_sure_orientation(tmp_path, names, convention, sure):
    header = ["Time [s]", "J1 [rad]", "X [mm]", "Y [mm]", "Z [mm]", *names]
    cells = [T, Q[:, 0], *[T * 0 + 5] * 3, *[T * 0 + 0.5] * len(names)]
    found = guess(table(tmp_path / "a.csv", header, cells))
    assert found.mapping.tcp_convention == convention
    assert ("tcp_convention" not in found.questions) == sure
    motion = read_motion(tmp_path / "a.csv", confirm(found))[0]
    assert motion.tcp_wxyz is not None
    np.testing.assert_allclose(motion.tcp_position, 0.005)
    np.testing.assert_allclose(np.linalg.norm(motion.tcp_wxyz, axis=1), 1)


def test_tool_columns_that_are_not_wanted_are_left_out_without_a_question(tmp_path):
    header = ["Time [s]", "J1 [rad]", "X", "Y", "Z", "A", "B", "C"]
    path = table(tmp_path / "a.csv", header, [T, Q[:, 0], *[T] * 6])
    assert set(guess(path).questions) == {"tcp_position_unit", "tcp_convention", "tcp_orientation_unit"}
    found = guess(path, Mapping(tcp_position=(), tcp_orientation=()))
    assert found.certain
    assert "X, Y, Z" in " ".join(found.notes)


def test_two_columns_for_one_joint_and_two_kinds_of_joints_are_asked(tmp_path):
    twice = table(tmp_path / "a.csv", ["Time [s]", "J1 [rad]", "Axis 1 [rad]"], [T, Q[:, 0], Q[:, 1]])
    assert "joint 1" in guess(twice).questions["joints"]
    both = table(tmp_path / "b.csv", ["Time [s]", "J1 ist [rad]", "J1 soll [rad]"], [T, Q[:, 0], Q[:, 1]])
    found = guess(both)
    assert "measured and commanded" in found.questions["joints"]
    assert found.mapping.joints == ("J1 ist [rad]",)
    gap = table(tmp_path / "c.csv", ["Time [s]", "J1 [rad]", "J3 [rad]"], [T, Q[:, 0], Q[:, 1]])
    assert "numbered 1, 3" in guess(gap).questions["joints"]
    times = table(tmp_path / "d.csv", ["Time [s]", "t [ms]", "J1 [rad]"], [T, T * 1000, Q[:, 0]])
    assert "'Time [s]', 't [ms]'" in guess(times).questions["time"]


def test_a_mapping_by_names_numbers_or_pattern_reads_what_no_guess_understands(tmp_path):
    header = ["Uhr", "winkel_a3", "winkel_a1", "winkel_a2"]
    path = table(tmp_path / "a.csv", header, [T, Q[:, 2], Q[:, 0], Q[:, 1]], above=("Protokoll;x", ""))
    units = {"time_unit": "s", "joint_unit": "rad"}
    for joints in (r"winkel_a(\d)", ("winkel_a1", "WINKEL_A2", "winkel_a3"), (3, 4, 2)):
        mapping = Mapping(time="Uhr", joints=joints, **units)
        np.testing.assert_array_equal(read_motion(path, mapping)[0].q, Q)
    bare = tmp_path / "bare.csv"
    np.savetxt(bare, np.column_stack([T, Q]), delimiter=",")
    mapping = Mapping(header_row=0, time=1, joints=(2, 3, 4), **units)
    np.testing.assert_array_equal(read_motion(bare, mapping)[0].q, Q)


@pytest.mark.parametrize(
    ("mapping", "words"),
    [
        ({"time": "Time s"}, ["mapping.time", "'Time s'", "did you mean 'Time [s]'"]),
        ({"joints": ("J1 [rad]", "J9")}, ["mapping.joints[1]", "'J9'"]),
        ({"joints": (2, 99)}, ["mapping.joints[1]", "no column 99"]),
        ({"joints": (2, 2)}, ["twice"]),
        ({"joints": r"X(\d)"}, ["matches no header"]),
        ({"joints": r"(J\d).*"}, ["first group is not a number"]),
        ({"joints": "("}, ["not a pattern"]),
        ({"joint_unit": ("rad",)}, ["1 units for 3 columns"]),
        ({"velocities": ("J1 [rad]",)}, ["1 columns for 3 joints"]),
        ({"tcp_position": ("J1 [rad]",)}, ["name x, y and z"]),
        ({"tcp_convention": "XXZ"}, ["'XXZ'", "rotation_vector"]),
        ({"header_row": 500}, ["beyond the table"]),
        ({"delimiter": "ab"}, ["single character"]),
    ],
)
def test_a_mapping_that_does_not_fit_names_key_value_and_remedy(tmp_path, mapping, words):
    path = table(tmp_path / "a.csv", ["Time [s]", "J1 [rad]", "J2 [rad]", "J3 [rad]"], [T, Q])
    with pytest.raises(InputError) as error:
        read_motion(path, msgspec.convert(mapping, Mapping))
    for word in words:
        assert word in str(error.value)


def test_a_unit_that_contradicts_the_header_is_used_and_said(tmp_path):
    path = table(tmp_path / "a.csv", ["Time [s]", "J1 [deg]"], [T, Q[:, 0]])
    trajectory, _, notes = read_motion(path, msgspec.convert({"joint_unit": "rad"}, Mapping))
    np.testing.assert_array_equal(trajectory.q[:, 0], Q[:, 0])
    assert any("says deg, the mapping says rad" in n for n in notes)


def test_a_comma_that_could_separate_thousands_is_asked(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("Time [ms];J1 [deg]\n1,000;2,125\n2,000;2,250\n3,000;2,375\n")
    assert set(guess(path).questions) == {"decimal_comma"}
    yes = read_motion(path, Mapping(decimal_comma=True))[0]
    np.testing.assert_allclose(yes.t, [1e-3, 2e-3, 3e-3])
    with pytest.raises(InputError, match="'1,000'"):
        read_motion(path, Mapping(decimal_comma=False))


def test_linear_joints_have_their_own_unit_and_must_fit_the_robot(tmp_path):
    from seerob.workstation.source import Target

    path = table(tmp_path / "a.csv", ["Time [s]", "J1 [mm]", "J2 [deg]"], [T, Q[:, 0], Q[:, 1]])
    names = {"name": "gantry", "joints": ("x", "c"), "lower": (-9.0, -9.0), "upper": (9.0, 9.0)}
    fits = Target(units=("m", "rad"), velocity=(None, None), **names)
    q = read_motion(path, target=fits)[0].q
    np.testing.assert_array_equal(q, Q[:, :2] * [1e-3, np.pi / 180])
    turned = Target(units=("rad", "m"), velocity=(None, None), **names)
    with pytest.raises(InputError, match="'x' is in rad") as error:
        read_motion(path, target=turned)
    assert len(error.value.problems) == 2


def test_grad_is_a_degree_to_some_and_less_to_others(tmp_path):
    path = table(tmp_path / "a.csv", ["Zeit [s]", "Achse 1 [Grad]"], [T, 50 * Q[:, 0]])
    found = guess(path)
    assert "header says grad" in found.questions["joint_unit"]


def test_rows_with_more_cells_than_the_header_are_said_and_trailing_blanks_are_none(tmp_path):
    path = table(tmp_path / "a.csv", ["Time [s]", "J1 [rad]", "J2 [rad]", "J3 [rad]"], [T, Q])
    lines = path.read_text().splitlines()
    path.write_text("\n".join([*lines[:4], *(line + "; ;" for line in lines[4:])]))
    assert not any("more cells" in note for note in read_motion(path)[2])
    lines[6] += ";;7"
    lines[9] += ";x"
    path.write_text("\n".join(lines))
    trajectory, _, notes = read_motion(path)
    (note,) = (note for note in notes if "more cells" in note)
    assert "more cells than the header (4): 2, the first is row 7" in note
    np.testing.assert_array_equal(trajectory.q, Q)


def test_a_workbooks_surplus_cells_are_said_with_sheet_and_row(tmp_path):
    from openpyxl import Workbook

    book = Workbook()
    book.active.title = "Arm"
    rows = [["Time [s]", "J1 [rad]", "J2 [rad]", "J3 [rad]"], *np.column_stack([T, Q]).tolist()]
    rows[5].append("by hand")
    for row in rows:
        book.active.append(row)
    book.save(tmp_path / "a.xlsx")
    notes = read_motion(tmp_path / "a.xlsx")[2]
    assert any("more cells than the header (4): 1, the first is sheet 'Arm' row 6" in n for n in notes)


@pytest.mark.parametrize(("unit", "degrees"), [("deg", True), ("rad", False)])
def test_a_motion_knows_whether_its_table_is_in_degrees(tmp_path, unit, degrees):
    header = ["Time [s]", *(f"J{i} [{unit}]" for i in range(3))]
    assert read_motion(table(tmp_path / "a.csv", header, [T, Q]))[0].degrees is degrees


@pytest.mark.parametrize(("column", "words"), [(0, "time"), (2, "q[1] is 1e+307"), (4, "tcp_position[0]")])
def test_numbers_beyond_all_bounds_are_refused_and_not_computed_with(tmp_path, column, words):
    header = ["Time [min]", *(f"J{i} [rad]" for i in range(3)), *(f"TCP {a} [m]" for a in "XYZ")]
    values = np.column_stack([T, Q, Q])
    values[7, column] = 1e307
    with pytest.raises(InputError) as error:
        read_motion(table(tmp_path / "a.csv", header, [values]))
    assert words in str(error.value)
    assert "row 9" in str(error.value)


STRANGE = ["clk", "Sensor A", "Sensor B", "Sensor C"]


@pytest.mark.parametrize(
    ("header", "delimiter", "comma"),
    [(None, ",", False), (None, " ", False), (None, ";", True), (STRANGE, ";", True), (STRANGE, "\t", False)],
)
def test_columns_that_no_header_explains_are_proposed_in_a_snippet_that_reads_them(
    tmp_path, header, delimiter, comma
):
    """As units are that no header declares: everything is asked, and nothing is used before."""
    file = table(tmp_path / "a.csv", header or [], [T, Q], delimiter=delimiter, comma=comma)
    if header is None:
        file.write_text(file.read_text().lstrip())
    found = guess(file)
    assert {"header_row", "time", "joints", "time_unit", "joint_unit"} <= set(found.questions)
    with pytest.raises(InputError, match="no row names a time and joints") as caught:
        read_motion(file)
    assert ("header_row = 0" in str(caught.value)) is (header is None)
    motion, _, _ = read_motion(file, confirm(found))
    np.testing.assert_allclose(motion.t, T, atol=1e-9)
    np.testing.assert_allclose(motion.q, Q, atol=1e-9)


def test_what_holds_no_instants_is_not_proposed_as_a_motion(tmp_path):
    """Columns that do not grow, fewer than there are joints, and words."""
    still = table(tmp_path / "still.csv", STRANGE, [0 * T, 0 * Q])
    few = table(tmp_path / "few.csv", STRANGE[:2], [T, Q[:, :1]])
    words = table(tmp_path / "words.csv", STRANGE, [["a"] * 20] * 4)
    for file in (still, few, words):
        with pytest.raises(InputError, match=r"header_row \(0 where no row names the columns\)"):
            guess(file)


def test_a_log_of_rtde_is_told_from_any_other_table(tmp_path):
    head = ["timestamp", *(f"{which}_q_{i}" for which in ("target", "actual") for i in range(3))]
    with pytest.raises(InputError, match=r'a log of RTDE, which kind = "ur_record" reads'):
        read_motion(table(tmp_path / "a.csv", head, [T, Q, Q], delimiter=" "))


@pytest.mark.parametrize(("header", "first"), [(1, 1), (3, 1), (None, 2)])
def test_values_in_or_above_the_header_are_refused(tmp_path, header, first):
    """They were left out without a word, and nobody judged the beginning of the motion."""
    path = tmp_path / "motion.csv"
    values = "".join(f"{0.1 * k:.1f},{0.01 * k:.2f},{0.5 - 0.01 * k:.2f}\n" for k in range(20))
    path.write_text(values if header else "a,b,c\n" + values + "t [s],j1 [rad],j2 [rad]\n" + values)
    units = {"time_unit": "s", "joint_unit": "rad", "delimiter": ","}
    given = Mapping(header_row=header, time=1, joints=(2, 3), **units) if header else Mapping(delimiter=",")
    with pytest.raises(InputError, match=rf"row {first}: values up to row {header or 22}, the header"):
        read_motion(path, given)


def test_columns_that_are_numbered_have_numbers_for_names(tmp_path):
    path = tmp_path / "motion.csv"
    path.write_text("0,1,2\n" + "".join(f"{0.1 * k:.1f},{0.01 * k:.2f},0.5\n" for k in range(20)))
    units = {"time_unit": "s", "joint_unit": "rad", "delimiter": ","}
    motion, _, _ = read_motion(path, Mapping(header_row=1, time=1, joints=(2, 3), **units))
    assert len(motion.t) == 20
