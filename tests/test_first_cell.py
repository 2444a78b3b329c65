"""The walk of docs/first_cell.md: every file it shows is written, every command it names is run."""

import re
import shlex
from pathlib import Path

import pytest

import seerob as sr
from seerob.app import cli

PAGE = (Path(__file__).parents[1] / "docs/first_cell.md").read_text(encoding="utf-8")
STEPS = re.findall(r"^```(\w*)\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)
SHORT = {"run": ["--port", "0", "--seconds", "0.5", "--no-record"]}
"""What keeps a command from waiting for Ctrl-C."""


@pytest.fixture(scope="module")
def walked(tmp_path_factory):
    """The folder after the whole walk, and what was run with how it ended."""
    folder = tmp_path_factory.mktemp("walk")
    ended = []
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for kind, text in STEPS:
            if kind == "toml":
                file = Path(text.splitlines()[0].removeprefix("# "))
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_text(text, encoding="utf-8")
            elif kind == "diff":
                old, new = (line[1:] for line in text.splitlines())
                file = Path("my_cell/workstation.toml")
                before = file.read_text(encoding="utf-8")
                assert before.count(old) == 1
                file.write_text(before.replace(old, new), encoding="utf-8")
            else:
                for line in text.splitlines():
                    command, _, wanted = line.partition("# ends with ")
                    if command.startswith("seerob "):
                        words = shlex.split(command)[1:]
                        code = cli.main([*words, *SHORT.get(words[0], [])])
                        ended.append((words[0], code, wanted[:1]))
    return folder, ended


def test_every_command_ends_as_the_page_says(walked):
    _, ended = walked
    assert [command for command, _, _ in ended] == ["check-file", "assess", "assess", "compare", "run"]
    for command, code, wanted in ended:
        assert str(code) == wanted if wanted else code in (0, 1, 2), command


def test_figures_of_the_page_are_those_of_the_run(walked):
    folder, _ = walked
    far, near = (sr.Recording.open(folder / f"my_cell/runs/{n}/run.mcap").results for n in ("far", "near"))
    said = [float(text) for text in re.findall(r"(\d\.\d\d) m", PAGE)]
    inside, beyond = far["distance"].min() - 0.25, 0.25 - near["distance"].min()
    found = [far["tcp speed"].max(), far["distance"].min(), inside, beyond]
    assert said == pytest.approx(found, abs=0.006)
    assert (folder / "my_cell/runs/far/report.html").stat().st_size > 1e5
    compared = (folder / "my_cell/compared.html").read_text()
    assert compared.count("<img") == 2
    # Both runs on one axis, each criterion with both limits.
    assert re.findall(r'aria-label="(.*?) over time"', compared) == ["distance", "tcp speed"]
    for which in ("before", "after"):
        sides = re.findall(rf">limit \(at (most|least)\), {which}<", compared)
        assert sorted(sides) == ["least", "most"]


def test_points_by_hand_name_no_file(walked):
    """The folder itself would be one, and with it every run that lies in it."""
    folder, _ = walked
    station = sr.load(folder / "my_cell")
    assert not [name for name in station.files if "sha256" in name]
    assert all("()" not in finding.text for finding in station.scene().findings)
