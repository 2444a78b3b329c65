"""Every numbered example runs as it stands; what it asserts at its end holds."""

import ast
import runpy
import sys
from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_loader
from pathlib import Path

import pytest
from nbclient import NotebookClient

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


LOADER = SourceFileLoader("notebooks", str(FOLDER.parent / "scripts/notebooks"))
notebooks = module_from_spec(spec_from_loader("notebooks", LOADER))
LOADER.exec_module(notebooks)


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_a_notebook_has_all_of_its_example_in_cells_that_stand_alone(file):
    _, _, *cells = notebooks.notebook(file).cells
    code = [ast.parse(cell.source) for cell in cells]  # each is whole
    own = ast.parse(file.read_text().replace("__file__", repr(str(file)))).body[1:]
    together = [node for cell in code for node in cell.body]
    assert [ast.dump(node) for node in together] == [ast.dump(node) for node in own]
    assert len(cells) > 1


def test_a_notebook_runs_with_what_lies_beside_its_example(tmp_path):
    (file,) = (file for file in FILES if "acme" in file.read_text())
    book = notebooks.notebook(file)
    resources = {"metadata": {"path": str(tmp_path)}}
    NotebookClient(book, timeout=300, kernel_name="python3", resources=resources).execute()
    assert any(output.get("name") == "stdout" for cell in book.cells[1:] for output in cell.outputs)
