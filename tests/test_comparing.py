"""Two runs beside each other: what changed, which verdicts turned, and nothing that flatters the second."""

import json
import math
import shutil
import tomllib
from dataclasses import replace

import pytest

import seerob as sr
from seerob.app import cli
from seerob.core.snapshot import CriterionInfo, Finding, Scene, Snapshot
from seerob.outputs.comparison import Comparison, Side, Turn, compared, conditions
from seerob.outputs.sinks.recorder import Recorder
from seerob.recording.result_log import log_of
from seerob.session.comparing import _differing

WITHIN, EXCEEDED, UNDECIDED = sr.Verdict.WITHIN, sr.Verdict.EXCEEDED, sr.Verdict.UNDECIDED


def result(verdict, *, value=1.0, limit=2.0, name="a", **more):
    reason = "nobody knows" if verdict is UNDECIDED else ""
    limit = None if verdict is None else limit
    return sr.Result(name=name, value=value, limit=limit, verdict=verdict, reason=reason, unit="m", **more)


def side(*results, title="one", **more):
    scene = Scene(
        **{
            "title": title,
            "edition": "e",
            "version": "v",
            "workstation_hash": "h",
            "period": 0.1,
            "nodes": (),
        }
        | {key: value for key, value in more.items() if key != "duration"}
    )
    log = log_of([Snapshot(seq=0, t=0.0, poses=b"", results=results)])
    return Side(title, scene, log, more.get("duration", 1.0), scene.findings)


STATES = {
    "within": result(WITHIN),
    "exceeded": result(EXCEEDED, value=3.0),
    "undecided": result(UNDECIDED, value=None),
    "informs": result(None),
    "not asked": None,
}
TURNS = """
            within     exceeded  undecided  informs    not asked
within      same       exceeded  undecided  undecided  undecided
exceeded    within     same      undecided  undecided  undecided
undecided   within     exceeded  same       undecided  undecided
informs     within     exceeded  undecided  same       same
not asked   new        exceeded  undecided  new        -
"""


def test_a_criterion_is_better_only_where_it_is_within_and_was_not():
    head, *rows = (line.replace("not asked", "not_asked").split() for line in TURNS.strip().splitlines())
    for was, *turns in rows:
        for is_, turn in zip(head, turns, strict=True):
            pair = [STATES[key.replace("_", " ")] for key in (was, is_)]
            found = compared(*(side(*([] if r is None else [r])) for r in pair))
            assert [one.turn.value for one in found] == ([] if turn == "-" else [turn]), (was, is_)


def test_a_part_that_turns_counts_as_its_whole_does():
    def whole(left, right):
        return result(EXCEEDED, value=3.0, parts=(result(left, name="left"), result(right, name="right")))

    (one,) = compared(side(whole(EXCEEDED, WITHIN)), side(whole(WITHIN, EXCEEDED)))
    assert (one.turn, one.parts) == (Turn.EXCEEDED, ("right",))
    (one,) = compared(side(whole(EXCEEDED, EXCEEDED)), side(whole(WITHIN, EXCEEDED)))
    assert (one.turn, one.parts) == (Turn.SAME, ())


def test_what_is_not_one_question_is_said():
    (one,) = compared(side(result(WITHIN)), side(result(WITHIN, at_most=False, limit=0.5)))
    assert one.notes == ("another side of the limit: at most → at least, margins do not compare",)
    said = conditions(
        side(title="long", duration=9.0, edition="2016"),
        side(
            title="short",
            duration=3.0,
            edition="2025",
            findings=(Finding(level="warning", subject="arm", text="moved", holds=("arm",)),),
        ),
    )
    assert said == (
        "edition: 2016 → 2025",
        "run time: 9 s → 3 s",
        "the second run is shorter: what would come after its end is not judged",
        "only short: arm: moved",
    )


def test_what_json_cannot_say_is_said_in_words():
    changes = tuple(_differing(tomllib.loads("a = nan\nb = 2026-01-01"), {"a": [math.inf]}))
    both = side(result(WITHIN))
    said = Comparison(both, both, (), changes, (), compared(both, both)).json()
    assert json.loads(json.dumps(said, allow_nan=False))["changes"] == [
        {"key": "a", "before": "nan", "after": ["inf"]},
        {"key": "b", "before": "2026-01-01", "after": None},
    ]


def test_keys_that_differ_are_named_as_they_are_written():
    then = {"title": "a", "engine": {"tick": 0.01}, "safety": [{"kind": "velocity", "name": "s", "limit": 1}]}
    now = {
        "title": "a",
        "engine": {"physics": False},
        "safety": [{"kind": "velocity", "name": "s", "limit": 2}, {"kind": "energy", "limit": 0}],
        "loop": True,
    }
    assert {str(change) for change in _differing(then, now)} == {
        "engine.tick: 0.01 → not there",
        "engine.physics: not there → false",
        'safety["s"].limit: 1 → 2',
        'safety[energy 1]: not there → {"kind": "energy", "limit": 0}',
        "loop: not there → true",
    }
    assert [str(c) for c in _differing({"a": 1}, {"a": True})] == ["a: 1 → true"]
    assert not list(_differing({"a": 1}, {"a": 1.0}))


CELL = """
title = "cell"
# a comment
[[robots]]
name = "arm"
model = "library:ur5e"
q_deg = [0, -90, 0, -90, 0, 0]
[[humans]]
name = "op"
stature = 1.75
mass = 75
sex = "male"
at = { position = [1.0, 0, 0] }
[[safety]]
kind = "minimum_distance"
name = "gap"
between = ["arm", "op"]
limit = 0.3
[[safety]]
kind = "velocity"
name = "speed"
at = "arm"
limit = 0.5
"""


@pytest.fixture(scope="module")
def cells(tmp_path_factory):
    """Three workstations, and the folder of a run of each."""
    root = tmp_path_factory.mktemp("compared")
    for name, text in (
        ("far", CELL),
        ("near", CELL.replace("[1.0, 0, 0]", "[0.4, 0, 0]")),
        ("worded", CELL.replace("# a comment", "# another comment")),
    ):
        (root / name).mkdir()
        (root / name / "workstation.toml").write_text(text)
        sr.load(root / name).run(folder=root / f"run_{name}", sinks=[Recorder(lossless=True)])
    return root


def test_recordings_and_what_python_has_of_them_compare_alike(cells):
    found = sr.compare(cells / "run_far", cells / "run_near/run.mcap")
    assert [str(change) for change in found.changes] == [
        'humans["op"].at.position: [1.0, 0, 0] → [0.4, 0, 0]'
    ]
    assert {one.name: one.turn for one in found.criteria} == {"gap": Turn.EXCEEDED, "speed": Turn.SAME}
    assert found.turn is Turn.EXCEEDED
    gap = found.json()["criteria"][0]
    series = sr.Recording.open(cells / "run_near/run.mcap").results["gap"]
    assert gap["after"]["margin"] == series.min() - 0.3
    back = sr.compare(sr.load(cells / "near").run(), sr.load(cells / "far").run())
    assert back.criteria[0].turn is Turn.WITHIN
    assert back.changes is None
    assert "keeps no file" in back.html()
    assert "gap" in back._repr_html_()


def test_a_workstation_is_run_and_comments_are_no_change(cells):
    found = sr.compare(cells / "run_far", cells / "worded")
    assert found.turn is Turn.SAME
    assert (found.changes, found.files) == ((), ("workstation.toml: only comments, order or layout differ",))


def test_the_command_says_it_and_ends_with_what_turned(cells, capsys):
    page = cells / "compared.html"
    assert cli.main(["compare", str(cells / "run_far"), str(cells / "run_near"), "--html", str(page)]) == 1
    said = capsys.readouterr().out
    assert "exceeded     gap: within → exceeded; " in said
    text = page.read_text()
    assert text.count("data:image/png;base64,") == 2  # one criterion turned, seen from one viewpoint
    assert "<svg" not in text  # there is one instant
    assert "<script" not in text
    assert cli.main(["compare", str(cells / "run_near"), str(cells / "run_far")]) == 0
    capsys.readouterr()
    assert cli.main(["compare", str(cells / "run_far"), str(cells / "run_far"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["changes"] == []


def test_a_recording_that_is_not_whole_turns_undecided(cells, tmp_path, capsys):
    shutil.copytree(cells / "run_far", tmp_path / "joined")
    with (tmp_path / "joined/run.mcap").open("ab") as file:
        file.write(b"more")
    assert cli.main(["compare", str(cells / "run_far"), str(tmp_path / "joined")]) == 2
    assert "lie behind its end" in capsys.readouterr().out


def test_what_never_gave_a_result_is_not_what_it_was():
    """Its series is empty, and false as such: it counted as unchanged, and nothing as worse."""
    asked = (CriterionInfo(name="a", kind="velocity", group="safety", title="v", unit="m"),)
    never = replace(side(title="two"), results=log_of([], asked))
    for was, turn in ((WITHIN, Turn.UNDECIDED), (EXCEEDED, Turn.UNDECIDED), (UNDECIDED, Turn.SAME)):
        value = {WITHIN: 1.0, EXCEEDED: 3.0, UNDECIDED: None}[was]
        (one,) = compared(side(result(was, value=value)), never)
        assert one.turn is turn
    (one,) = compared(never, side(result(WITHIN)))
    assert one.turn is Turn.WITHIN


def test_a_folder_with_two_recordings_is_asked_which(cells, tmp_path, capsys):
    for name in ("a", "b"):
        shutil.copy(cells / "run_far/run.mcap", tmp_path / f"{name}.mcap")
    assert cli.main(["compare", str(tmp_path), str(cells / "far")]) == 3
    assert "holds several recordings: a.mcap, b.mcap" in capsys.readouterr().err
