"""Sheets about motion, and posture against safety: the arrays of the run, thinned without a loss."""

import tracemalloc

import made_person_run as run
import numpy as np
import openpyxl
import pytest

from seerob.core.errors import InputError
from seerob.outputs.report import posture_safety as _posture_safety
from seerob.outputs.sinks.dossier import Dossier
from seerob.outputs.sinks.excel import Excel
from seerob.outputs.tables.growing_table import GrowingTable
from seerob.outputs.workbook import ThinnedTable
from seerob.recording.result_log import log_of

N = 100


def book(folder, *, every=0.0, **options):
    with Excel(every=every, **options).open(run.scene(), {}, {}, folder) as writer:
        for k in range(N):
            writer.write(run.snapshot(k), run.samples(k))
    return openpyxl.load_workbook(folder / "results.xlsx")


def rows(sheet):
    head, *data = sheet.iter_rows(values_only=True)
    return [dict(zip(head, row, strict=True)) for row in data]


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    return book(tmp_path_factory.mktemp("excel"))


def test_bones_errors_and_samples_have_a_sheet_each(made):
    poses = [np.frombuffer(run.snapshot(k).poses, "<f4").reshape(-1, 7) for k in range(N)]
    found = rows(made["bones op"])
    # From the first sample on: the person is one whom a device sees.
    assert [r["head z [m]"] for r in found] == pytest.approx([p[5, 2] for p in poses])
    assert [r["head qw [1]"] for r in found] == pytest.approx([p[5, 3] for p in poses])
    errors = rows(made["errors op"])
    assert [r["head position [m]"] for r in errors] == pytest.approx(
        [run.error(k, "head") for k in range(5, N)]
    )
    heard = rows(made["heard camera op"])
    assert [r["RIGHT_HAND y [m]"] for r in heard] == pytest.approx([-k / 3 for k in range(0, N, 5)])
    assert heard[2]["quality"] == "degraded"
    assert [r["HEAD y [m]"] is None for r in heard] == [k < 50 for k in range(0, N, 5)]
    whole = {(r["bone"], r["what"]): r for r in rows(made["Bone errors"])}
    assert whole["all", "position"]["ticks"] == 2 * (N - 5)


def test_the_same_instant_has_score_distance_share_and_body_area(made):
    found = {round(r["t [s]"], 6): r for r in rows(made["posture, safety op"])}
    at = found[0.5]
    assert at["RULA [points]"] == 3
    assert at["distance [m]"] == pytest.approx(0.4)
    assert at["distance: share of the limit [1]"] == pytest.approx(0.5 / 0.4)
    assert at["distance: verdict"] == "exceeded"
    assert at["distance: body part"] == "right_hand"
    assert at["distance: body area"] == "Hands and fingers, front, dominant side"
    assert found[0.2]["RULA [points]"] == 7


def test_thinned_rows_keep_the_extremes_and_the_worst_instants_are_first(tmp_path):
    log = log_of((run.snapshot(k) for k in range(N)), run.scene().criteria)
    (one,) = _posture_safety.sides(run.scene(), log)
    thinned = list(_posture_safety.rows(one, 20))
    assert len(thinned) < N
    assert max(row[2] for row in thinned) == 7
    assert min(row[3] for row in thinned) == pytest.approx(0.4)
    assert [row[1] for row in _posture_safety.worst_rows(one)] == pytest.approx([0.2, 0.5])


def test_the_report_has_the_table_and_the_errors_of_bones(tmp_path):
    with Dossier().open(run.scene(), {}, {}, tmp_path) as writer:
        for k in range(N):
            writer.write(run.snapshot(k), ())
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "Posture against safety" in text
    assert "right_hand: Hands and fingers, front, dominant side" in text
    assert "Tracking of bones" in text


@pytest.mark.parametrize(
    ("value", "limit", "at_most", "share"),
    [
        (0.5, 1.0, True, 0.5),
        (0.5, 1.0, False, 2.0),
        (2.0, 1.0, False, 0.5),
        (-0.1, 1.0, False, np.inf),
        (0.0, 0.0, False, np.inf),
        (1.0, 0.0, True, np.inf),
        (np.nan, 1.0, True, np.nan),
        (0.0, 0.0, True, np.nan),
    ],
)
def test_the_share_of_a_limit(value, limit, at_most, share):
    found = _posture_safety.share(np.array([value]), np.array([limit]), at_most=at_most)
    assert found.tolist() == pytest.approx([share], nan_ok=True)


def test_sheets_of_motion_can_be_left_out_and_are_thinned_evenly(tmp_path):
    (tmp_path / "none").mkdir()
    names = book(tmp_path / "none", motion_rows=0).sheetnames
    assert not [name for name in names if name.split(" ")[0] in ("bones", "errors", "heard", "posture,")]
    found = rows(book(tmp_path, motion_rows=30)["bones op"])
    assert [r["t [s]"] for r in found] == pytest.approx(0.01 * np.arange(0, N, 4))
    with pytest.raises(InputError, match="motion_rows"):
        Excel(motion_rows=1).open(run.scene(), {}, {}, tmp_path)


@pytest.mark.parametrize("every", [0.04, 0.025])
def test_motion_of_people_has_a_stated_rate_and_nothing_else_is_thinned(tmp_path, every):
    made = book(tmp_path, every=every)
    step = round(every / run.PERIOD + 0.499)
    for name in ("joints op", "bones op"):
        assert [r["t [s]"] for r in rows(made[name])] == pytest.approx(0.01 * np.arange(0, N, step))
    assert [r["t [s]"] for r in rows(made["joints arm"])] == pytest.approx(0.01 * np.arange(N))
    assert len(rows(made["distance"])) == N
    assert len(rows(made["heard camera op"])) == N // 5
    notes = {row[0]: row[1] for row in made["Summary"].iter_rows(values_only=True)}
    assert f"every {every} s" in notes["motion of people"]
    with pytest.raises(InputError, match="every"):
        Excel(every=float("nan")).open(run.scene(), {}, {}, tmp_path)


@pytest.mark.parametrize("most", [2, 3, 7, 64])
def test_a_thinned_table_is_even_and_at_least_half_full(most):
    table = ThinnedTable(most, ["k"])
    for k in range(1000):
        if table.wants():
            table.keep_numbers([k])
        kept = [row[0] for row in table.rows()]
        assert 1 <= len(kept) <= most
        assert k < most or len(kept) >= most // 2
        assert kept == list(range(0, k + 1, int(kept[1]) if len(kept) > 1 else k + 1))


@pytest.mark.parametrize("most", [2, 5, 64])
def test_texts_and_new_columns_of_a_thinned_table_stay_with_their_rows(most):
    table, offered = ThinnedTable(most, ["k"]), []
    for k in range(300):
        cells = {"k": k} | ({"text": f"row {k}"} if k % 3 else {}) | ({"late": k / 2} if k > 70 else {})
        offered.append(cells)
        if table.wants():
            table.keep(cells)
    for row in table.rows():
        told = {title: cell for title, cell in zip(table.titles, row, strict=True) if cell == cell}
        assert told == offered[int(row[0])]


def test_a_row_of_numbers_takes_what_its_numbers_do():
    table = ThinnedTable(20_000, [f"c{k}" for k in range(8)])
    tracemalloc.start()
    try:
        for k in range(20_000):
            if table.wants():
                table.keep_numbers([float(k)] * 8)
        taken, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert taken < 1.3 * 20_000 * 8 * 8


def test_rows_of_a_growing_table_are_equally_wide(tmp_path):
    table = GrowingTable(tmp_path / "t", separator=",", missing="-")
    table.add({"a": "1"})
    table.add({"b": "2"})
    table.add({"a": "3", "c": "4"})
    table.finish(["x\n"])
    assert (tmp_path / "t").read_text(encoding="utf-8") == "x\n1,-,-\n-,2,-\n3,-,4\n"
    assert [path.name for path in tmp_path.iterdir()] == ["t"]
