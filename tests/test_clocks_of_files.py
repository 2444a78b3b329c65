"""Files that begin at different instants of their clocks: whether these are one, the cell says."""

from __future__ import annotations

import numpy as np
import pytest

from made_cell import made, two_r
from seerob.core.errors import InputError
from seerob.core.snapshot import Verdict
from seerob.session.station import Station

CELL = """
engine = {{ gravity = [0, 0, 0], physics = false }}
[[robots]]
name = "a"
model = "arm.urdf"
[[robots]]
name = "b"
model = "arm.urdf"
base = {{ position = [3.5, 0, 0] }}
[[sources]]
kind = "csv"
robot = "a"
file = "a.csv"
[[sources]]
kind = "csv"
robot = "b"
file = "b.csv"
{more}
[[safety]]
kind = "minimum_distance"
name = "apart"
between = ["a", "b"]
limit = 0.05
[[safety]]
kind = "velocity"
name = "slow"
at = "b/l2"
limit = 9
[[safety]]
kind = "velocity"
name = "first"
at = "a/l2"
limit = 9
"""
AWAY, THERE = np.pi / 2, np.pi


def moved(t: float, begin: float, a: float, b: float) -> float:
    s = np.clip((t - begin) / 0.4, 0, 1)
    return float(a + (b - a) * (10 * s**3 - 15 * s**4 + 6 * s**5))


def a_comes(t: float) -> float:
    """Away from the other arm until 1.8 s, before it from 2.2 s on."""
    return moved(t, 1.8, AWAY, 0.0)


def b_goes(t: float) -> float:
    """Before the other arm from 1.5 to 2.3 s, away else."""
    return moved(t, 1.1, AWAY, THERE) if t < 2 else moved(t, 2.3, THERE, AWAY)


def table(q, start: float, end: float) -> str:
    rows = (f"{t:.3f},{q(t):.9f},0" for t in np.arange(start, end + 1e-9, 0.02).tolist())
    return "t [s],j1 [rad],j2 [rad]\n" + "\n".join(rows) + "\n"


def cell(folder, more: str = "", *, start: float = 1.0) -> Station:
    files = {"arm.urdf": two_r(), "a.csv": table(a_comes, 0, 3), "b.csv": table(b_goes, start, 4)}
    return made(folder, CELL.format(more=more), files)


def test_whether_two_files_keep_one_clock_is_undecided_until_it_is_said(tmp_path):
    found = cell(tmp_path).run().results
    assert found["apart"].verdict is Verdict.UNDECIDED
    assert found["slow"].verdict is Verdict.UNDECIDED
    assert found["first"].verdict is Verdict.WITHIN, found["first"].reasons
    reason = next(text for text in found["apart"].reasons if "one clock" in text)
    assert "begins at 1.000 s of its clock" in reason
    assert "begins = 1 in sources[1]" in reason


@pytest.mark.parametrize(("begins", "verdict"), [(1.0, Verdict.EXCEEDED), (0.0, Verdict.WITHIN)])
def test_a_file_begins_when_the_workstation_says(tmp_path, begins, verdict):
    found = cell(tmp_path, f"begins = {begins}\n").run().results
    assert found["apart"].verdict is verdict
    if begins:
        assert found["apart"].t[np.nanargmin(found["apart"].values)] == pytest.approx(2.2, abs=0.15)


def test_files_that_begin_at_the_same_instant_are_one_motion(tmp_path):
    assert cell(tmp_path, start=0.0).run().results["apart"].verdict is Verdict.EXCEEDED


def test_before_it_begins_nothing_of_it_is_known(tmp_path):
    found = cell(tmp_path, "begins = 1.0\n").run().results["slow"]
    assert found.verdict is Verdict.UNDECIDED
    assert set(found.verdicts[found.t < 0.9].tolist()) == {found.verdicts[0]}


def test_a_loop_begins_at_once(tmp_path):
    with pytest.raises(InputError, match="leave out begins or loop"):
        cell(tmp_path, "begins = 1.0\nloop = true\n").run()
