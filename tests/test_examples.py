"""Every numbered example runs as it stands; what it asserts at its end holds."""

import runpy
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[1] / "examples"
FILES = sorted(FOLDER.glob("[0-9]*.py"))


def test_there_are_examples():
    assert [file.name[:2] for file in FILES] == [f"{i:02}" for i in range(1, len(FILES) + 1)]
    assert len(FILES) >= 10


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_an_example_runs(file, monkeypatch, capsys, tmp_path):
    monkeypatch.chdir(tmp_path)  # an example needs nothing of where it is started
    monkeypatch.syspath_prepend(str(FOLDER))
    monkeypatch.setattr(sys, "argv", [str(file)])
    runpy.run_path(str(file), run_name="__main__")
    assert capsys.readouterr().out.strip()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_an_example_starts_with_what_it_shows(file):
    lines = file.read_text().splitlines()
    assert lines[0].startswith('"""')
    assert any(line.startswith("assert ") for line in lines[-8:])
