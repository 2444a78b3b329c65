"""The workbook says what the arrays say."""

import math

import made_run
import msgspec
import openpyxl
import pytest

from seerob.core.errors import InputError
from seerob.core.figures import DECIMALS
from seerob.core.snapshot import Verdict
from seerob.description.norms.editions import editions
from seerob.outputs import workbook as sheets_module
from seerob.outputs.sinks.excel import Excel
from seerob.recording.result_log import log_of
from seerob.recording.series import CODES

N = 120
WORDS = {code: "" if v is None else v.value for v, code in CODES.items()}


def write(folder, n=N, scene=None, **options):
    with Excel(**options).open(scene or made_run.scene(), {}, {}, folder) as writer:
        for k in range(n):
            writer.write(made_run.snapshot(k), made_run.samples(k))
    return openpyxl.load_workbook(folder / "results.xlsx")


def exactly(numbers):
    """As far as the format goes: Excel keeps 15 digits, openpyxl writes 16."""
    return pytest.approx(numbers, rel=1e-15, abs=1e-300)


def rows(sheet):
    return [list(row) for row in sheet.iter_rows(values_only=True)]


@pytest.fixture(scope="module")
def book(tmp_path_factory):
    return write(tmp_path_factory.mktemp("excel"))


def test_sheets_hold_the_arrays_of_the_log(book):
    log = log_of((made_run.snapshot(k) for k in range(N)), made_run.scene().criteria)
    series = log["separation"]
    head, *data = rows(book["separation"])
    assert head[:7] == [
        "t [s]",
        "value [m]",
        "limit [m]",
        "verdict",
        "reason",
        "head: value [m]",
        "head: verdict",
    ]
    assert [r[0] for r in data] == exactly(series.t.tolist())
    assert [r[1] for r in data] == exactly(series.values.tolist())
    assert [r[2] for r in data] == exactly(series.limits.tolist())
    assert [r[3] for r in data] == [WORDS[c] for c in series.verdicts.tolist()]
    assert [r[4] for r in data] == list(series.reasons)
    assert [r[7] for r in data] == exactly(series.parts["hand"].values.tolist())


def test_joints_and_tracking_are_there(book):
    head, *data = rows(book["joints ur10"])
    assert head == ["t [s]", "j1 [rad]", "j2 [rad]", "tracking error [rad or m]"]
    expected = [made_run.snapshot(k) for k in range(N)]
    assert [r[1] for r in data] == exactly([s.joints["ur10"][0] for s in expected])
    assert [r[2] for r in data] == exactly([s.joints["ur10"][1] for s in expected])
    assert [r[3] for r in data] == exactly([s.tracking["ur10"] for s in expected])


def test_the_summary_has_every_criterion_with_verdict_and_basis(book):
    data = {r[0]: r for r in rows(book["Summary"])[1:] if r[0]}
    assert [data[c.name][1] for c in made_run.scene().criteria] == [
        "exceeded",
        "within",
        "undecided",
        "undecided",
    ]
    assert data["separation"][2] == exactly(made_run.snapshot(50).results[0].value)
    assert data["separation"][6] == 0.5
    assert data["separation"][9:] == [
        made_run.SEPARATION.formula,
        made_run.SEPARATION.source,
        ", ".join(editions([made_run.SEPARATION])) or None,
    ]
    assert data["never heard"][7] == "never gave a result"
    assert data["inputs, SHA-256"][1] == "f" * 64


def test_what_is_missing_is_an_empty_cell_and_findings_are_all_there(book):
    hostile = next(s for s in book.worksheets if s.title.startswith("<script>"))
    assert [r[1] for r in rows(hostile)[1:4]] == [None] * 3
    assert rows(book["Findings"])[1:] == [[f.level, f.subject, f.text] for f in made_run.scene().findings]
    inputs = [r[1] for r in rows(book["Inputs"])[1:] if r[0] == "separation"]
    assert inputs == [i.name for i in made_run.SEPARATION.inputs]


@pytest.mark.parametrize(
    "text", ["=1+1", "+1", "-1", "@x", "=cmd|' /C calc'!A0", "#REF!", "\t=1", "a\x00b", "x" * 40_000]
)
def test_text_from_files_never_becomes_a_formula(tmp_path, text):
    scene = made_run.scene(title=text)
    cell = next(r[1] for r in write(tmp_path, 1, scene)["Summary"].iter_rows() if r[0].value == "workstation")
    assert cell.data_type == "s"
    assert cell.value == text.replace("\x00", "\ufffd")[: 32_767 if len(text) < 32_768 else 32_766] + (
        "…" if len(text) > 32_767 else ""
    )
    assert cell.quotePrefix == (text[0] in "=+-@\t")


def test_a_long_run_goes_on_in_further_sheets(tmp_path, monkeypatch):
    monkeypatch.setattr(sheets_module, "EXCEL_ROWS", 51)
    book = write(tmp_path)
    names = ["separation", "separation (2)", "separation (3)"]
    assert [book[n].max_row for n in names] == [51, 51, 21]
    values = [r[1] for n in names for r in rows(book[n])[1:]]
    assert values == exactly([made_run.snapshot(k).results[0].value for k in range(N)])


def test_thinning_keeps_the_extremum_and_is_said(tmp_path):
    book = write(tmp_path, rows=20)
    values = [r[1] for r in rows(book["separation"])[1:]]
    assert len(values) <= 20
    assert min(values) == exactly(made_run.snapshot(50).results[0].value)
    notes = {r[0]: r[1] for r in rows(book["Summary"])}
    assert "thinned from 120 ticks to at most 20" in next(v for v in notes.values() if "thinned" in str(v))


def test_numbers_that_excel_does_not_have_are_not_invented(tmp_path):
    def odd(value):
        return msgspec.structs.replace(
            made_run.snapshot(0),
            results=(
                msgspec.structs.replace(
                    made_run.snapshot(0).results[1], value=value, verdict=Verdict.UNDECIDED
                ),
            ),
        )

    with Excel().open(made_run.scene(), {}, {}, tmp_path) as writer:
        for value in (math.nan, math.inf, -math.inf):
            writer.write(odd(value), ())
    book = openpyxl.load_workbook(tmp_path / "results.xlsx")
    assert [r[1] for r in rows(book["tool speed"])[1:]] == [None, "inf", "-inf"]


def test_names_that_excel_refuses_or_confuses_become_distinct_sheets(tmp_path):
    names = ["a/b", "a:b", "History", "x" * 40, "x" * 41, "X" * 40]
    result = made_run.snapshot(0).results[1]
    results = tuple(msgspec.structs.replace(result, name=n, markers=()) for n in names)
    with Excel().open(made_run.scene(criteria=()), {}, {}, tmp_path) as writer:
        writer.write(msgspec.structs.replace(made_run.snapshot(0), results=results), ())
    titles = openpyxl.load_workbook(tmp_path / "results.xlsx").sheetnames
    assert len({t.casefold() for t in titles}) == len(titles) == len(names) + 4
    assert max(map(len, titles)) <= 31


def test_a_folder_that_is_not_there_is_one_clear_error(tmp_path):
    with pytest.raises(InputError, match="cannot be written"):
        write(tmp_path / "none")
    with pytest.raises(InputError, match="not a file name"):
        Excel(file="../x.xlsx").open(made_run.scene(), {}, {}, tmp_path)


def test_a_reader_finds_units_widths_and_a_header_that_stays(tmp_path):
    book = write(tmp_path)
    for sheet in book:
        assert sheet.freeze_panes == "B2"
        for cell in sheet[1]:
            assert cell.font.bold
            assert sheet.column_dimensions[cell.column_letter].width >= min(len(str(cell.value)), 60)
    summary = book["Summary"]
    head = [c.value for c in summary[1]]
    for row in summary.iter_rows(min_row=2, max_row=1 + len(made_run.scene().criteria)):
        cells = dict(zip(head, row, strict=False))
        if cells["worst value"].value is not None and cells["unit"].value in DECIMALS:
            places = len(cells["worst value"].number_format.partition(".")[2])
            assert places > DECIMALS[cells["unit"].value]
    # Colour is the second channel: the word is there, and only what is judged has it.
    colors = {
        c.value: c.font.color.rgb for c in summary["B"] if c.value in ("within", "exceeded", "undecided")
    }
    assert len(set(colors.values())) == len(colors) >= 2
    assert all(c.number_format == "0.000" for c in book["separation"]["A"][1:])


def test_progress_is_told_sheet_by_sheet(tmp_path):
    told = []
    with Excel().open(made_run.scene(), {}, {}, tmp_path) as writer:
        writer.progress = lambda done, total: told.append((done, total))
        writer.write(made_run.snapshot(50), ())
    assert told == [(k + 1, 6) for k in range(6)]
