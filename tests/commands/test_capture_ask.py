"""``seerob capture --ask`` on a real terminal: answers stand in the file, what nobody answers does not."""

import io
import os
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from seerob.app.cli import main
from seerob.app.console.phase_questions import QUESTIONS, ask_phases, needed
from seerob.criteria.ergonomics.reba import Reba
from seerob.criteria.ergonomics.rula import Rula
from seerob.workstation.tables.task_phase import TaskPhase

sys.path.insert(0, str(Path(__file__).parents[1] / "motion_io"))
from made_recordings import bvh, reaching

ANSWERS = {
    "length of a cycle": ["0.5"],
    "phase 1": ["pick"],
    "phase 2": ["place"],
    "until [s]": ["9", "0.2", ""],
    "mass that is handled": ["heavy", "-1", "2,5", "0"],
    "how does the load act": ["st", "inter"],
    "how well can the load": ["good"],
    "which arms are supported": ["none"],
    "is the trunk well supported": ["n"],
    "how are the legs used": ["stand", "standing"],
    "are legs and feet": ["y"],
    "are the arms mainly": ["n"],
    "are neck, trunk": ["n"],
    "is a part of the body": ["n"],
    "are small movements": ["n"],
    "are there rapid": ["n"],
}


class Answers:
    """Answers each question with what comes next of it; the last one again and again.

    Args:
        given: Part of a question → answers.
    """

    def __init__(self, given):
        self._given = {part: list(answers) for part, answers in given.items()}
        self.asked = []

    def __call__(self, question):
        self.asked.append(question)
        for part, answers in self._given.items():
            if part in question:
                return answers.pop(0) if len(answers) > 1 else answers[0]
        return ""


def test_what_is_asked_is_what_rules_read():
    fields = needed([Rula, Reba])
    assert set(fields) == {
        *("load", "load_use", "hand", "coupling", "supported_arms", "back_supported", "legs", "balanced"),
        *("muscle_arms", "muscle_body", "static", "repeated", "rapid"),
    }
    assert "coupling" not in needed([Rula])
    own = {"title", "start", "end", "cycle", "human"}
    assert set(QUESTIONS) == set(TaskPhase.__struct_fields__) - own  # a new one needs its question


def test_answers_become_phases_and_mistakes_are_asked_again():
    told, answers = [], Answers(ANSWERS)
    pick, place = ask_phases(needed([Rula, Reba]), 3.0, answers, told.append)
    assert (pick["start"], pick["end"], pick["cycle"], pick["load"]) == (0.0, 0.2, 0.5, 2.5)
    # "st" begins "static" alone, "stand" "standing".
    assert (pick["load_use"], pick["legs"], pick["back_supported"]) == ("static", "standing", False)
    assert (place["start"], place["end"], place["load"]) == (0.2, 0.5, 0.0)
    assert "load_use" not in place
    assert "coupling" not in place
    assert {"  'heavy' is no number", "pick: 40 % of the cycle", "place: 60 % of the cycle"} <= set(told)
    assert sum(">= 0" in line for line in told) == 1
    assert sum("beyond its cycle" in line for line in told) == 1


def test_what_nobody_answers_is_left_out():
    (only,) = ask_phases(needed([Rula]), 3.0, Answers({"phase 1": ["work"]}), lambda _: None)
    assert only == {"title": "work", "start": 0.0}
    assert ask_phases(needed([Rula]), 3.0, Answers({}), lambda _: None) == []


@pytest.mark.skipif(sys.platform == "win32", reason="has no such terminals")
def test_on_a_terminal_a_recording_gets_its_phases_and_scores(tmp_path):
    import pty

    kind, file = bvh(tmp_path, reaching(24))
    command = [sys.executable, "-m", "seerob", "capture", kind, str(file), "--mass", "75", "--sex", "male"]
    command += ["--stature", "1.75", "-o", str(tmp_path / "made"), "--ask"]
    ours, theirs = pty.openpty()
    with subprocess.Popen(command, stdin=theirs, stdout=theirs, stderr=theirs, close_fds=True) as process:
        os.close(theirs)
        answers, said = Answers(ANSWERS), ""
        while True:
            try:
                said += os.read(ours, 4096).decode(errors="replace")
            except OSError:  # it has closed its terminal
                break
            if said.endswith("> "):
                os.write(ours, answers(said.rpartition("\n")[2]).encode() + b"\n")
                said += "\n"
    os.close(ours)
    text = (tmp_path / "made/workstation.toml").read_text()
    phases = tomllib.loads(text)["phases"]
    assert [(p["title"], p["human"], p["load"]) for p in phases] == [
        ("pick", "operator", 2.5),
        ("place", "operator", 0.0),
    ]
    assert "# Scores ask for what no posture shows" in text
    assert process.returncode in (0, 1, 2), said
    assert (tmp_path / "made/runs").is_dir()


def test_without_anybody_to_answer_nothing_is_made(tmp_path, capsys, monkeypatch):
    kind, file = bvh(tmp_path, reaching(24))
    monkeypatch.setattr("sys.stdin", io.StringIO())
    given = ["--mass", "75", "--sex", "male", "--stature", "1.75", "-o", str(tmp_path / "made"), "--ask"]
    assert main(["capture", kind, str(file), *given]) == 3
    assert "the entry ended before all was asked" in "".join(capsys.readouterr())
    assert not (tmp_path / "made").exists()
