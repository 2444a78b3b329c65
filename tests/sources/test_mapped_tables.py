import datetime
import subprocess
import sys
import zipfile

import msgspec
import numpy as np
import pytest
from made_motion import DOF, arrays, motion, target, write_csv, write_delmia_like, write_sheet

from seerob.core.errors import InputError
from seerob.core.plugin import load
from seerob.devices.sources.csv import Csv
from seerob.devices.sources.excel import Excel
from seerob.files.tables.mapping import Mapping
from seerob.workstation.source import Source

HEADER = ["Time [s]", *[f"J{i + 1} [rad]" for i in range(DOF)]]


def rows(n=20):
    t, q, _ = motion(n)
    return [[t[k], *q[k]] for k in range(n)]


def refused(source, folder, **changes):
    with pytest.raises(InputError) as error:
        source(robot="ur10", **changes).open(folder, target())
    return str(error.value)


@pytest.mark.parametrize("joint_unit", ["deg", "rad"])
@pytest.mark.parametrize("units_row", [False, True])
def test_a_delmia_like_workbook_is_read_without_a_question(tmp_path, joint_unit, units_row):
    t, q, qd = write_delmia_like(tmp_path / "cycle.xlsx", joint_unit=joint_unit, units_row=units_row)
    opened = Excel(robot="ur10", file="cycle.xlsx").open(tmp_path, target())
    heard = arrays(opened)
    for ours, theirs in zip(heard, (t, q, qd), strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-15 if joint_unit == "rad" else 1e-14)
    assert opened.duration == t[-1]
    texts = " ".join(f.text for f in opened.findings)
    assert "preliminary" in texts
    assert f'joint_unit = "{joint_unit}"' in texts


def test_rows_of_several_robots_are_told_apart_by_name_or_asked(tmp_path):
    _, q, _ = write_delmia_like(tmp_path / "cycle.xlsx", robots=("left", "ur10"))
    opened = Excel(robot="ur10", file="cycle.xlsx").open(tmp_path, target())
    np.testing.assert_allclose(arrays(opened)[1], q + 0.1, atol=1e-14)
    with pytest.raises(InputError, match="2 robots: 'left', 'ur10'"):
        Excel(robot="iiwa", file="cycle.xlsx").open(tmp_path, target(name="iiwa"))
    left = Excel(robot="iiwa", file="cycle.xlsx", mapping=Mapping(robot="left"))
    np.testing.assert_allclose(arrays(left.open(tmp_path, target(name="iiwa")))[1], q, atol=1e-14)
    assert "no row of robot 'middle'" in refused(
        Excel, tmp_path, file="cycle.xlsx", mapping=Mapping(robot="middle")
    )


def test_a_second_robot_that_only_comes_late_is_not_mixed_in(tmp_path):
    names = ["a"] * 900 + ["b"] * 20
    table = [[n, 0.01 * k, 0.0] for k, n in enumerate(names)]
    write_csv(tmp_path / "a.csv", ["Robot", "Time [s]", "J1 [rad]"], table)
    opened = Csv(robot="ur10", file="a.csv").open(tmp_path, target(1))
    assert len(list(opened.samples)) == 900


def test_several_sheets_with_motion_are_asked(tmp_path):
    table = [HEADER, *rows()]
    write_sheet(tmp_path / "a.xlsx", table, more={"Notes": [["hello"]], "Slow": table})
    text = refused(Excel, tmp_path, file="a.xlsx")
    assert "2 sheets hold joints over time: 'Sheet1', 'Slow'" in text
    assert 'sheet = "Sheet1"' in text
    assert "no sheet 'Fast'" in refused(Excel, tmp_path, file="a.xlsx", mapping=Mapping(sheet="Fast"))
    Excel(robot="ur10", file="a.xlsx", mapping=Mapping(sheet="Slow")).open(tmp_path, target())


@pytest.mark.parametrize(
    ("delimiter", "comma", "encoding", "newline"),
    [
        (",", False, "utf-8", "\n"),
        (";", True, "utf-8-sig", "\r\n"),
        ("\t", True, "utf-16", "\r\n"),
        ("|", False, "cp1252", "\r"),
        (" ", False, "utf-8", "\n"),
    ],
)
def test_text_is_read_to_the_last_digit_whatever_its_dialect(tmp_path, delimiter, comma, encoding, newline):
    t, q, qd = motion(30)
    header = ["Time_s", *[f"J{i + 1}_°" for i in range(DOF)], *[f"Speed_J{i + 1}_°/s" for i in range(DOF)]]
    table = [[t[k], *np.degrees(q[k]), *np.degrees(qd[k])] for k in range(30)]
    write_csv(
        tmp_path / "a.csv",
        header,
        table,
        delimiter=delimiter,
        comma=comma,
        encoding=encoding,
        newline=newline,
    )
    heard = arrays(Csv(robot="ur10", file="a.csv").open(tmp_path, target()))
    np.testing.assert_array_equal(heard[0], t)
    np.testing.assert_array_equal(heard[1], np.degrees(q) * (np.pi / 180))
    np.testing.assert_array_equal(heard[2], np.degrees(qd) * (np.pi / 180))


def test_trailing_and_inner_blank_rows_are_skipped_and_inner_ones_said(tmp_path):
    body = rows()
    write_sheet(tmp_path / "a.xlsx", [HEADER, *body[:5], [], [""], *body[5:], [], [None, ""], []])
    opened = Excel(robot="ur10", file="a.xlsx").open(tmp_path, target())
    assert len(list(opened.samples)) == len(body)
    assert any("2 blank rows" in f.text for f in opened.findings)


@pytest.mark.parametrize(
    ("cell", "word"),
    [
        ("#REF!", "'#REF!'"),
        ("n/a", "'n/a'"),
        ("NaN", "'NaN'"),
        ("inf", "'inf'"),
        ("1_0", "'1_0'"),
        (None, "is empty"),
        (True, "bool"),
        (datetime.datetime(2026, 1, 1), "datetime"),
    ],
)
def test_a_cell_without_a_number_is_named_with_sheet_row_column_and_value(tmp_path, cell, word):
    body = rows()
    body[7][3] = cell
    write_sheet(tmp_path / "a.xlsx", [HEADER, *body], title="Move")
    text = refused(Excel, tmp_path, file="a.xlsx")
    assert "a.xlsx: sheet 'Move' row 9 column 'J3 [rad]'" in text
    assert word in text


def test_mistakes_are_collected_but_not_without_end(tmp_path):
    body = [["x"] * (DOF + 1) for _ in range(1000)]
    write_csv(tmp_path / "a.csv", HEADER, body)
    with pytest.raises(InputError) as error:
        Csv(robot="ur10", file="a.csv").open(tmp_path, target())
    assert 10 <= len(error.value.problems) < 30


@pytest.mark.parametrize(("second", "word"), [(0.0, "repeats"), (-1.0, "goes back")])
def test_time_that_does_not_advance_is_refused(tmp_path, second, word):
    body = rows()
    body[5][0] = body[4][0] + second
    write_csv(tmp_path / "a.csv", HEADER, body)
    text = refused(Csv, tmp_path, file="a.csv")
    assert word in text
    assert "row 7" in text


def test_a_file_of_another_robot_is_refused_with_both_counts(tmp_path):
    write_csv(tmp_path / "a.csv", HEADER, rows())
    with pytest.raises(InputError, match="6 joints, but 'iiwa' has 7"):
        Csv(robot="iiwa", file="a.csv").open(tmp_path, target(7, name="iiwa"))


def test_a_wrong_velocity_column_is_refused_and_can_be_derived_instead(tmp_path):
    t, q, qd = motion()
    header = [*HEADER, *[f"Speed J{i + 1} [rad/s]" for i in range(DOF)]]
    write_csv(tmp_path / "a.csv", header, [[t[k], *q[k], *(0.5 * qd[k])] for k in range(len(t))])
    assert "positions move at 2 × the velocity" in refused(Csv, tmp_path, file="a.csv")
    opened = Csv(robot="ur10", file="a.csv", velocities="derive").open(tmp_path, target())
    np.testing.assert_allclose(arrays(opened)[2], qd, atol=2e-3)
    assert any("derived by central differences" in f.text for f in opened.findings)


def test_positions_beyond_a_limit_stop_or_are_reported(tmp_path):
    write_csv(tmp_path / "a.csv", HEADER, rows(200))
    assert 'beyond_limits = "report"' in _narrow(tmp_path)
    source = msgspec.convert({"robot": "ur10", "file": "a.csv", "beyond_limits": "report"}, Csv)
    opened = source.open(tmp_path, target(limit=1.0))
    beyond = [f for f in opened.findings if "its limit" in f.text]
    _, q, _ = motion(200)
    assert len(beyond) == int((np.abs(q).max(0) > 1).sum()) > 0
    assert {f.level for f in beyond} == {"warning"}


def _narrow(folder):
    with pytest.raises(InputError) as error:
        Csv(robot="ur10", file="a.csv").open(folder, target(limit=1.0))
    return str(error.value)


def test_files_that_are_something_else_say_so(tmp_path):
    (tmp_path / "empty.csv").write_bytes(b"")
    (tmp_path / "binary.csv").write_bytes(b"Time,J1\0\0\1\2")
    (tmp_path / "zip.csv").write_bytes(b"PK\x03\x04....")
    (tmp_path / "old.xls").write_bytes(b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1")
    (tmp_path / "broken.xlsx").write_bytes(b"PK\x03\x04....")
    (tmp_path / "text.xlsx").write_text("Time,J1\n")
    (tmp_path / "poem.csv").write_text("Rose is a rose\nis a rose, is a rose\n")
    with zipfile.ZipFile(tmp_path / "other.xlsx", "w") as archive:
        archive.writestr("a.txt", "hello")
    for source, file, word in (
        (Csv, "missing.csv", "no such file"),
        (Csv, "data\\missing.csv", "write / between folders, not \\; looked for"),
        (Csv, ".", "is a folder"),
        (Csv, "empty.csv", "is empty"),
        (Csv, "binary.csv", "binary data"),
        (Csv, "zip.csv", 'kind = "excel"'),
        (Csv, "poem.csv", "no row names a time and joints"),
        (Csv, "old.xls", 'kind = "excel"'),
        (Excel, "old.xls", "save it as .xlsx"),
        (Excel, "broken.xlsx", "not a workbook"),
        (Excel, "text.xlsx", "not a workbook"),
        (Excel, "other.xlsx", "not a workbook"),
        (Excel, "poem.csv", 'kind = "csv"'),
    ):
        assert word in refused(source, tmp_path, file=file), file


def test_a_workbook_with_a_broken_sheet_or_a_document_type_is_refused(tmp_path):
    write_sheet(tmp_path / "good.xlsx", [HEADER, *rows()])
    for name, edit in (
        ("cut", lambda xml: xml[: len(xml) // 2]),
        ("bomb", lambda xml: xml.replace(b"<worksheet", b'<!DOCTYPE x [<!ENTITY a "a">]><worksheet', 1)),
    ):
        with (
            zipfile.ZipFile(tmp_path / "good.xlsx") as good,
            zipfile.ZipFile(tmp_path / f"{name}.xlsx", "w") as bad,
        ):
            for part in good.namelist():
                content = good.read(part)
                bad.writestr(part, edit(content) if part.endswith("sheet1.xml") else content)
        assert "sheet" in refused(Excel, tmp_path, file=f"{name}.xlsx")


def test_thousands_of_columns_are_no_trouble_and_more_are_refused(tmp_path):
    wide = [f"signal {i}" for i in range(3000)]
    body = [[*r, *[0.5] * 3000] for r in rows(3)]
    write_csv(tmp_path / "a.csv", [*HEADER, *wide], body)
    opened = Csv(robot="ur10", file="a.csv").open(tmp_path, target())
    assert any("and 2988 more" in f.text for f in opened.findings)
    (tmp_path / "b.csv").write_text(",".join(HEADER) + "\n" + "1," * 20_000 + "\n")
    assert "more than 16384" in refused(Csv, tmp_path, file="b.csv")


def test_more_rows_than_are_taken_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("seerob.files.tables.grid.MAX_SAMPLES", 10)
    write_csv(tmp_path / "a.csv", HEADER, rows(20))
    assert "more than 10 rows" in refused(Csv, tmp_path, file="a.csv")


def test_larger_files_and_longer_lines_than_are_taken_are_refused(tmp_path, monkeypatch):
    write_csv(tmp_path / "a.csv", HEADER, rows(20))
    monkeypatch.setattr("seerob.files.tables.table_files.MAX_LINE", 50)
    assert "longer than 50 characters" in refused(Csv, tmp_path, file="a.csv")
    write_sheet(tmp_path / "a.xlsx", [HEADER, *rows(20)])
    monkeypatch.setattr("seerob.files.tables.table_files.MAX_UNPACKED", 1000)
    assert "more than is taken" in refused(Excel, tmp_path, file="a.xlsx")
    monkeypatch.setattr("seerob.files.tables.table_files.LARGEST_WORKBOOK", 1000)
    assert "bytes, more than 1000" in refused(Excel, tmp_path, file="a.xlsx")


def test_the_names_of_the_robots_own_joints_are_understood_in_any_order(tmp_path):
    named = msgspec.structs.replace(target(3), joints=("shoulder_pan_joint", "elbow_joint", "wrist_1_joint"))
    t, q, _ = motion(30, dof=3)
    header = ["time", "wrist_1_joint", "shoulder_pan_joint", "elbow_joint"]
    write_csv(tmp_path / "a.csv", header, np.column_stack([t, q[:, [2, 0, 1]]]))
    source = Csv(robot="ur10", file="a.csv")
    with pytest.raises(InputError, match=r"mapping\.joint_unit"):
        source.open(tmp_path, named)
    sure = Csv(robot="ur10", file="a.csv", mapping=Mapping(time_unit="s", joint_unit="rad"))
    np.testing.assert_array_equal(arrays(sure.open(tmp_path, named))[1], q)


def test_group_and_header_rows_of_numbers_can_be_named(tmp_path):
    t, q, _ = motion(30)
    table = [["Zeit [s]", "Achse [rad]", *[None] * (DOF - 1)], [None, *range(1, DOF + 1)]]
    write_sheet(tmp_path / "a.xlsx", [*table, *np.column_stack([t, q]).tolist()])
    mapping = Mapping(header_row=2, group_row=1, time=1)
    opened = Excel(robot="ur10", file="a.xlsx", mapping=msgspec.structs.replace(mapping, time_unit="s"))
    # openpyxl prints 16 digits.
    np.testing.assert_allclose(arrays(opened.open(tmp_path, target()))[1], q, rtol=1e-15)


@pytest.mark.parametrize("kind", ["excel", "csv", "robodk", "ur_record", "kuka_log", "recording"])
def test_every_kind_is_found_by_its_name_and_describes_its_table(kind):
    source = load("sources", kind, Source)
    assert source.__doc__
    schema = msgspec.json.schema(source)
    assert "file" in str(schema)
    with pytest.raises(msgspec.ValidationError, match="nonsense"):
        msgspec.convert(
            {"drives" if kind == "recording" else "robot": "a", "file": "b", "nonsense": 1}, source
        )


def test_naming_a_kind_loads_no_heavy_package():
    code = (
        "import sys, seerob; before = set(sys.modules)\n"
        "from seerob.core.plugin import kinds, load; from seerob.workstation.source import Source\n"
        "for kind in kinds('sources'): load('sources', kind, Source)\n"
        "heavy = {'openpyxl', 'mcap', 'scipy', 'mujoco', 'trimesh', 'numba'}\n"
        "print(sorted(heavy & (set(sys.modules) - before)))"
    )
    assert subprocess.check_output([sys.executable, "-c", code], text=True).strip() == "[]"


@pytest.mark.parametrize("source", [Csv, Excel])
def test_no_damage_to_a_file_ends_in_anything_but_samples_or_an_input_error(tmp_path, source):
    rng = np.random.default_rng(0)
    path = tmp_path / ("a.csv" if source is Csv else "a.xlsx")
    if source is Csv:
        write_csv(path, HEADER, rows(), delimiter=";", comma=True)
    else:
        write_delmia_like(path)
    whole, read = path.read_bytes(), 0
    for seed in range(30):
        data = bytearray(whole)
        for place in rng.integers(0, len(data), 1 + seed // 4):
            # Of a table mostly by what stands in tables: any bytes are no text.
            data[place] = rng.choice(list(b"0123456789,;\n")) if seed % 3 else rng.integers(256)
        path.write_bytes(bytes(data[: rng.integers(1, len(data) + 1)] if seed % 3 == 0 else data))
        try:
            opened = source(robot="ur10", file=path.name).open(tmp_path, target())
        except InputError:
            continue
        assert all(np.isfinite(s.q).all() for s in opened.samples)
        read += 1
    # A workbook has a checksum: little that is damaged can be read.
    assert read < 30
    assert source is Excel or read > 3
