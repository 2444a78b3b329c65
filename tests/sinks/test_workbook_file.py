"""What a foreign reader finds in the workbook is what was written, and the same cells are the same bytes."""

from __future__ import annotations

import errno
import io
import math
import resource
import zipfile

import numpy as np
import openpyxl
import pytest
from openpyxl.utils import column_index_from_string
from openpyxl.utils.escape import unescape

from seerob.outputs import workbook as _sheets
from seerob.outputs.workbook import workbook


def written(head, rows, **options):
    out = io.BytesIO()
    with workbook(out) as sheets:
        sheets.add("sheet", head, rows, **options)
    return out


def read(out):
    return openpyxl.load_workbook(out)["sheet"]


def cells(out):
    return [list(row) for row in read(out).iter_rows(min_row=2, values_only=True)]


def test_numbers_keep_sixteen_digits():
    random = np.random.default_rng(5)
    rows = (random.normal(size=(40, 6)) * 10.0 ** random.integers(-300, 300, (40, 6))).tolist()
    rows += [[0.1 + 0.2, -0.0, 5e-324, 9e307, 1e22, -1.0]]
    found = [
        [float(cell.value) for cell in row]
        for row in read(written(list("abcdef"), rows)).iter_rows(min_row=2)
    ]
    assert found == [[float(f"{value:.15e}") for value in row] for row in rows]


def test_rows_of_everything_are_read_as_they_are():
    rows = [[1.5, None, "x", 3, True, math.nan, math.inf, np.float64(0.25)], [2.5], [], ["<&\">'\t\n", 2.0]]
    found = [
        list(row) for row in read(written(list("abcdefgh"), rows)).iter_rows(min_row=2, values_only=True)
    ]
    assert found[0] == [1.5, None, "x", 3, True, None, "inf", 0.25]
    assert found[1] == [2.5, *[None] * 7]
    assert found[2] == [None] * 8
    assert found[3][:2] == ["<&\">'\t\n", 2.0]


@pytest.mark.parametrize("text", ["_x0041_", "a_x000D_b", "_x", "__x0041_", "\r\n"])
def test_text_that_looks_escaped_is_what_it_was(text):
    assert unescape(read(written(["a"], [[text]]))["A2"].value) == text


@pytest.mark.parametrize("text", ["<r></r>", "<r><t>x</t></r>", "<r>&</is></c></row></r>", "<r>a</r> "])
def test_text_that_looks_like_markup_of_the_library_is_what_it_was(text):
    for options in ({}, {"fit": True}):
        assert unescape(read(written(["a"], [[text]], **options))["A2"].value) == text


@pytest.mark.parametrize("text", ["\U0001f9be" * 20_000, "x" * 32_767, "x" + "\U0001f9be" * 16_383])
def test_long_text_is_cut_at_the_units_that_excel_counts(text):
    found = read(written(["a"], [[text]]))["A2"].value
    assert len(found.encode("utf-16-le")) <= 2 * 32_767
    assert found == text or (found[-1] == "…" and text.startswith(found[:-1]) and len(found) > 16_380)


@pytest.mark.parametrize("value", [1.7976931348623157e308, -1e308, 10**400, math.inf])
def test_a_number_that_excel_does_not_have_is_text(value):
    assert read(written(["a"], [[value]]))["A2"].value == str(value)


def test_a_sheet_is_no_wider_than_excel_takes_and_says_so(monkeypatch):
    assert column_index_from_string("XFD") == _sheets.MOST_COLUMNS
    monkeypatch.setattr(_sheets, "MOST_COLUMNS", 40)
    sheet = read(written([f"c{k}" for k in range(45)], [[float(k) for k in range(45)]]))
    assert sheet.max_column == 40
    assert "6 columns" in sheet.cell(1, 40).value
    assert sheet.cell(2, 40).value is None
    assert sheet.cell(2, 39).value == 38


def test_a_sheet_that_is_full_goes_on_in_another(monkeypatch):
    monkeypatch.setattr(_sheets, "FULL", 5_000)
    out = written(["a", "b"], ([float(k), 1.0] for k in range(200)))
    book = openpyxl.load_workbook(out)
    assert len(book.sheetnames) > 1
    values = [row[0] for sheet in book for row in sheet.iter_rows(min_row=2, values_only=True)]
    assert values == list(range(200))


def test_the_same_cells_are_the_same_bytes():
    rows = [[0.5, "exceeded", None], [1.5, "within", 2.0]]
    assert written(["a [m]", "b", "c"], rows).getvalue() == written(["a [m]", "b", "c"], rows).getvalue()


def test_whoever_fails_leaves_nothing_open(tmp_path):
    with pytest.raises(ZeroDivisionError), workbook(tmp_path / "x.xlsx") as sheets:
        sheets.add("sheet", ["a"], ([1 / k] for k in (1.0, 0.0)))
    assert [path.name for path in tmp_path.iterdir()] == ["x.xlsx"]


class FullDisk(io.BytesIO):
    """Takes a first part."""

    def write(self, data):
        if self.tell() > 1000:
            raise OSError(errno.ENOSPC, "No space left on device")
        return super().write(data)


def test_a_full_disk_is_one_error():
    with pytest.raises(OSError, match="No space left"), workbook(FullDisk()) as sheets:
        sheets.add("sheet", ["a"], [[float(k)] for k in range(100)])


def test_many_sheets_are_not_as_many_open_files():
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (60, before[1]))
    out = io.BytesIO()
    try:
        with workbook(out) as sheets:
            for k in range(100):
                sheets.add("sheet", ["a"], [[k]])
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, before)
    book = openpyxl.load_workbook(out)
    assert [sheet["A2"].value for sheet in book] == list(range(100))


def test_rows_are_what_the_library_would_write_itself():
    head = ["t [s]", "value [m]", "word", "more"]
    rows = [
        [0.1, 1 / 3, "within", None],
        [1e-300, -0.0, " a_x0041_<&", 7],
        [math.nan, 12, "", True],
        [],
        [2.5],
    ]
    by_library = io.BytesIO()
    with _sheets.book(by_library) as book:
        formats = _sheets.Formats(book)
        sheet = book.add_worksheet("sheet")
        sheet.freeze_panes(1, 1)
        looks = [*(formats.of(_sheets._format(unit)) for unit in ("s", "m")), None, None]
        for k, look in enumerate(looks):
            sheet.set_column(k, k, 11 if k == 1 else 9, look)
        for k, title in enumerate(head):
            sheet.write_string(0, k, title, formats.of(_sheets.HEAD))
        for n, row in enumerate(rows, 1):
            for k, value in enumerate(row):
                if isinstance(value, str) and value:
                    sheet.write_string(n, k, value, formats.of(value) if value == "within" else None)
                elif isinstance(value, bool):
                    sheet.write_boolean(n, k, value)
                elif value is not None and value == value and value != "":
                    sheet.write_number(n, k, value)
    parts = [zipfile.ZipFile(out) for out in (written(head, rows), by_library)]
    for name in ("xl/worksheets/sheet1.xml", "xl/styles.xml"):
        assert parts[0].read(name) == parts[1].read(name)
