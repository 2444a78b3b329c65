"""The verdict of a run covers the time that was asked, bounded or accepted; nothing else is within."""

from __future__ import annotations

import json
import math
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

from made_cell import FLOATING, TWO_R, made, two_r
from seerob.app.console.terminal import extreme, results_json
from seerob.core.snapshot import CriterionInfo, Result, Snapshot, Verdict
from seerob.criteria.question import UNBOUNDED
from seerob.outputs.notebook import results_html
from seerob.outputs.sentences import about, summary
from seerob.recording.recording import Recording
from seerob.recording.result_log import ResultLog
from seerob.recording.series import INFORMS, STILL
from seerob.session.run import pump

W, E, U = Verdict.WITHIN, Verdict.EXCEEDED, Verdict.UNDECIDED
EXAMPLES = Path(__file__).parent.parent.parent / "examples"


def told(rows, between="", limit=2.0):
    """A log of (t, verdict); ``muted``, ``absent`` and ``idle`` (nothing to judge) stand for those."""
    log = ResultLog([CriterionInfo(name="v", kind="k", group="safety", title="", between=between)])
    for k, (t, verdict) in enumerate(rows):
        none = verdict in ("muted", "idle")
        said = Result(
            name="v",
            value=None if none else 1.0,
            limit=None if none else limit,
            verdict=None if none else verdict,
            muted=verdict == "muted",
            nothing=verdict == "idle",
        )
        log.add(Snapshot(seq=k, t=t, poses=b"", results=() if verdict == "absent" else (said,)))
    return log


def test_no_headline_says_throughout_of_a_criterion_that_was_muted_for_a_while():
    always, *_ = summary(told([(0, W), (4, W)]))[1:]
    assert always == "One criterion stayed within the limit throughout."
    partly, *_ = summary(told([(0, "muted"), (3, "muted"), (4, W)]))[1:]
    assert "not throughout the run" in partly
    assert "v (25 % of the run)" in partly


@pytest.mark.parametrize(
    ("rows", "between", "verdict"),
    [
        ([(0, W), (4, W)], "", W),
        ([(0, W), (4, W)], "accepted: slow", W),
        ([(0, W), (4, W)], UNBOUNDED, U),  # nobody knows what was in these four seconds
        ([(0, W), (4, E)], UNBOUNDED, E),
        ([(0, W)], "", U),  # one instant of something that moves is no run
        ([(0, W)], STILL, W),
        ([(0, E)], "", E),
        ([(0, "muted"), (4, "muted")], "", U),  # it never decided
        ([(0, "muted"), (3, "muted"), (4, W)], "", W),
        ([(0, None), (4, None)], "", U),  # it has a limit, and never judged by it
        ([(0, W), (1, "absent"), (4, W)], "", U),
        ([(0, "idle"), (4, "idle")], UNBOUNDED, U),  # nor who was near meanwhile
        ([(0, "idle"), (4, "idle")], INFORMS, None),
        ([(0, "idle"), (4, "idle")], "", None),
        ([(0, "idle"), (4, "idle")], "accepted: slow", None),
        ([(0, "idle"), (2, E), (4, "idle")], UNBOUNDED, E),
        ([], "", U),
    ],
)
def test_a_run_is_within_only_where_it_was_asked_bounded_or_accepted(rows, between, verdict):
    log = told(rows, between)
    assert (log.verdict, log["v"].verdict) == (verdict, verdict)
    if rows and "muted" not in dict(rows).values():
        worst = log["v"].worst()
        assert worst.verdict is verdict
        assert (log["v"].gap() in worst.reason) or verdict is E


def test_what_has_a_limit_and_never_judged_by_it_decided_nothing():
    assert told([(0, None), (4, None)]).decided == 0.0
    assert told([(0, W), (4, W)]).decided == 1.0
    assert told([(0, "idle"), (4, "idle")]).decided is None


def test_what_has_no_limit_informs_and_holds_nobody():
    log = told([(0, None), (4, None)], UNBOUNDED, limit=None)
    assert (log.verdict, log["v"].times().nothing) == (None, 1.0)


def test_shares_of_time_are_of_time():
    rows = [(0, W), (1, W), (3, U), (3.5, "muted"), (4, E), (10, "absent")]
    times = told(rows).get("v").times()
    assert times == pytest.approx((0.1, 0.05, 0.2, 0.05, 0.0, 0.6))
    assert times.decided == pytest.approx(0.15)
    assert sum(times) == pytest.approx(1.0)
    assert told([(0, W)], STILL)["v"].times().decided == 1.0
    # Of a run that nobody announced its instants are all there is.
    plain = ResultLog()
    for k, verdict in enumerate((W, E, U, None)):
        plain.add(Snapshot(seq=k, t=0.0, poses=b"", results=(Result(name="v", verdict=verdict),)))
    assert plain["v"].times() == (0.25, 0.25, 0.25, 0.0, 0.25, 0.0)


def test_no_headline_says_that_more_was_decided_than_the_rows_below_it():
    """A criterion that is muted for nearly all of a run, and within in the rest."""
    log = told([(0, W), (0.1, W), (5, "muted")])
    assert log.verdict is W
    assert log.decided == pytest.approx(log["v"].times().decided) == pytest.approx(0.02)
    assert log.so_far(whole=True).decided == log.decided
    assert "decided 2 % of the time" in results_html(log)
    # That nobody was near is no time in which nobody looked.
    assert told([(0, W), (0.1, W), (5, "idle")]).decided == pytest.approx(1.0)


ROWS = "t [s],J1 [rad],J2 [rad]\n" + "".join(f"{k / 10:.1f},{0.01 * k:.2f},0\n" for k in range(41))
OWN = """
from acme.work_height import WorkHeight as _WorkHeight

class Height(_WorkHeight, frozen=True, kw_only=True):
    '''Height of which nothing is known between two instants.'''
    def falls(self, model, points): return None
"""
SOMETIMES = """
from acme.work_height import WorkHeight as _WorkHeight
from seerob.api import Result, judge

class Height(_WorkHeight, frozen=True, kw_only=True):
    '''Height, where the first joint has turned by 0.1 to 0.3 rad; elsewhere there is nothing to judge.'''
    def bind(self, model):
        robot, own = model.mover(self.at), super().bind(model)
        def evaluate(state):
            if 0.1 < float(state.q(robot)[0]) < 0.3:
                return own(state)
            return Result(name=self.name, nothing=True, reason="turned away")
        return evaluate
"""
HEIGHT = '[[safety]]\nkind = "heights.unbounded"\nname = "height"\nat = "arm"\nlimit = 9\n'
RECORD = '[[sinks]]\nkind = "recorder"\n'
ARM = '[[sources]]\nkind = "csv"\nrobot = "arm"\nfile = "m.csv"\n'


@pytest.fixture(scope="module")
def heights(tmp_path_factory):
    """Folder of a package with a criterion of which nothing is known between two instants."""
    folder = tmp_path_factory.mktemp("own")
    (folder / "heights").mkdir()
    (folder / "heights" / "__init__.py").touch()
    (folder / "heights" / "unbounded.py").write_text(OWN)
    (folder / "heights" / "sometimes.py").write_text(SOMETIMES)
    return folder


@pytest.mark.parametrize(
    ("more", "verdict", "decided"),
    [
        ("every = 4\n", U, 0.0),
        ("", U, 0.0),
        ('every = 4\nbetween_samples = "accepted: it goes along a rail"\n', W, 1.0),
        ('between_samples = "accepted: it goes along a rail"\n', W, 1.0),
    ],
)
def test_what_is_asked_once_in_four_seconds_is_not_within_throughout(
    tmp_path, monkeypatch, heights, more, verdict, decided
):
    """Nothing bounds a criterion of one's own between its instants, unless it says what does."""
    monkeypatch.syspath_prepend(str(EXAMPLES))
    monkeypatch.syspath_prepend(str(heights))
    cell = FLOATING + TWO_R + ARM + HEIGHT + more
    found = made(tmp_path, cell, {"m.csv": ROWS, "arm.urdf": two_r()}).run().results["height"]
    assert (found.verdict, found.times().decided) == (verdict, decided)
    worst = found.worst()
    assert (worst.value, worst.verdict) == (0.0, verdict)
    assert ("nothing bounds it between" in worst.reason) is (verdict is U)


@pytest.mark.parametrize("every", ["", "every = 4\n"])
def test_that_there_was_nothing_to_judge_hides_nothing_until_it_is_asked_again(
    tmp_path, monkeypatch, heights, every
):
    """It is bounded where it judges, and turned away at both ends of four seconds."""
    monkeypatch.syspath_prepend(str(EXAMPLES))
    monkeypatch.syspath_prepend(str(heights))
    own = HEIGHT.replace("unbounded", "sometimes").replace("limit = 9", "limit = -1") + every
    station = made(tmp_path, FLOATING + TWO_R + ARM + own, {"m.csv": ROWS, "arm.urdf": two_r()})
    assert station.run().verdict is E


def test_samples_of_no_source_of_the_workstation_move_somebody(tmp_path, monkeypatch, heights):
    """A recording judged by a workstation without sources: nobody knows what was between its instants."""
    monkeypatch.syspath_prepend(str(EXAMPLES))
    monkeypatch.syspath_prepend(str(heights))
    files = {"m.csv": ROWS, "arm.urdf": two_r()}
    driven = made(tmp_path / "a", FLOATING + TWO_R + ARM + HEIGHT + RECORD, files)
    bare = made(tmp_path / "b", FLOATING + TWO_R + HEIGHT, files)
    fed = bare.run(feed=pump(driven.sources, 0.01))
    assert (fed.verdict, fed.results["height"].times().open) == (U, 1.0)
    driven.run(folder=tmp_path / "out", sinks=driven.workstation.sinks)
    (file,) = (tmp_path / "out").glob("*.mcap")
    again = bare.replay(Recording.open(file))
    assert (again.verdict, again.results["height"].times().open) == (U, 1.0)


@pytest.mark.parametrize(("last", "verdict"), [("0.005,0.001", W), ("0.0000000005,0", U)])
def test_a_batch_of_one_instant_of_what_moves_is_undecided_as_the_run_is(tmp_path, last, verdict):
    """A motion that is shorter than a tick is judged to its end; one that has no length is an instant."""
    rows = f"t [s],J1 [rad],J2 [rad]\n0,0,0\n{last},0\n"
    speed = '[[safety]]\nkind = "velocity"\nname = "v"\nat = "arm"\nlimit = 9\n'
    station = made(tmp_path, FLOATING + TWO_R + ARM + speed, {"m.csv": rows, "arm.urdf": two_r()})
    assert (station.run().verdict, station.batch(threads=1)["v"].verdict) == (verdict, verdict)
    assert station.run(stop=lambda: True).verdict is U


def test_what_is_taken_back_while_it_is_shown_again_counts():
    log = ResultLog()
    for k, verdict in enumerate((W, W, U, W)):
        said = Result(name="v", value=1.0, limit=2.0, verdict=verdict, t=0.0)
        log.add(Snapshot(seq=k, t=0.01 * k, poses=b"", results=(said,)))
    assert log.verdict is U


def test_a_bound_covers_what_is_not_asked(tmp_path):
    """A speed is bounded from instant to instant, so that a long period decides all of it."""
    speed = '[[safety]]\nkind = "velocity"\nname = "v"\nat = "arm"\nlimit = 9\nevery = 4\n'
    found = made(tmp_path, FLOATING + TWO_R + ARM + speed, {"m.csv": ROWS, "arm.urdf": two_r()}).run()
    v = found.results["v"]
    assert (found.verdict, v.times().decided) == (W, 1.0)
    assert len(v) < found.ticks
    said = f"sked at {len(v)} of {found.ticks} ticks"  # its largest figure is not that of the run
    assert said in " ".join(about(v))
    assert said in extreme(v)
    (machines,) = json.loads(results_json(found))["criteria"]
    assert machines["asked"] == len(v)


def test_the_share_is_told_to_people_and_to_machines_and_the_exit_code_follows(tmp_path, heights):
    for name, text in (
        ("workstation.toml", FLOATING + TWO_R + ARM + HEIGHT + "every = 4\n"),
        ("m.csv", ROWS),
        ("arm.urdf", two_r()),
    ):
        (tmp_path / name).write_text(text)
    env = {"PYTHONPATH": f"{EXAMPLES}:{heights}", "PATH": "/usr/bin:/bin"}
    asked = [sys.executable, "-m", "seerob", "assess", str(tmp_path), "-o", str(tmp_path / "out")]
    asked += ["--allow-plugins", "--json"]
    done = subprocess.run(asked, capture_output=True, text=True, check=False, env=env)
    assert done.returncode == 2, done.stderr
    told = json.loads(done.stdout)
    (criterion,) = told["criteria"]
    assert (told["verdict"], told["decided"]) == ("undecided", 0.0)
    assert (criterion["verdict"], criterion["times"]["open"], criterion["times"]["within"]) == (
        "undecided",
        1,
        0,
    )
    page = next((tmp_path / "out").rglob("*.html")).read_text()
    assert "nothing bounds it between" in page
    assert "Decided 0 % of the run, not asked in 100 %" in page


def test_a_figure_that_is_no_number_any_more_is_a_difference():
    """`scripts/compare-results` took what became NaN, or infinite, for equal."""
    differences = runpy.run_path(str(EXAMPLES.parent / "scripts/compare-results"))["differences"]
    found = [
        size for _, size, _ in differences([1.0, math.inf, 1.0, math.nan], [math.nan, 1.0, 1.5, math.nan])
    ]
    assert found == [math.inf, math.inf, pytest.approx(1 / 3)]
