"""Files outside the folder of a workstation: refused before they are read, unless whoever opens it allows."""

from __future__ import annotations

import logging
import os
import sys

import pytest

import seerob as sr
from made_cell import FLOATING, TWO_R, two_r
from seerob.app.cli import main
from seerob.core.errors import InputError
from seerob.outputs.sinks.recorder import Recorder
from seerob.workstation.allowed import named_outside

ROWS = "".join(f"{k / 20:g},{10 * k},0,PLANTED\n" for k in range(5))
MOTION = f"t [s],j1 [deg],j2 [deg],Worker\n{ROWS}"
SOURCE = '[[sources]]\nkind = "csv"\nrobot = "arm"\nfile = "{}"\n'
SPEED = '[[safety]]\nkind = "velocity"\nname = "speed"\nat = "arm"\nlimit = 1\n'
WHERE = {
    "two dots": "../away/motion.csv",
    "in full": "AWAY/motion.csv",
    "a link": "link.csv",
    "a linked folder": "folder/motion.csv",
    "a link to a link": "again.csv",
    "a detour": "x/../../away/motion.csv",
}


@pytest.fixture
def cell(tmp_path):
    """A folder with links that leave it, to a motion that is not in it."""
    away, folder = tmp_path / "away", tmp_path / "cell"
    away.mkdir()
    (folder / "x").mkdir(parents=True)
    (away / "motion.csv").write_text(MOTION)
    (folder / "link.csv").symlink_to(away / "motion.csv")
    (folder / "again.csv").symlink_to("link.csv")
    (folder / "folder").symlink_to("../away")
    (folder / "arm.urdf").write_text(two_r())
    return folder


def written(folder, name, source=SOURCE):
    name = WHERE[name].replace("AWAY", str(folder.parent / "away"))
    text = FLOATING + TWO_R + source.format(name) + SPEED
    (folder / "workstation.toml").write_text(text)
    return text


OPENED: list[str] = []
_listening: list[bool] = []


def _note(event, args):
    if _listening and event in ("open", "os.listdir", "os.scandir"):
        OPENED.append(os.path.realpath(args[0]) if isinstance(args[0], str) else "")


sys.addaudithook(_note)


@pytest.mark.parametrize("where", WHERE)
def test_it_is_refused_with_file_key_and_remedy_and_not_opened(cell, where):
    written(cell, where)
    away = os.path.realpath(cell.parent / "away")
    OPENED.clear()
    _listening.append(True)
    try:
        with pytest.raises(InputError) as caught:
            sr.load(cell)
    finally:
        _listening.clear()
    (problem,) = caught.value.problems
    assert (problem.file, problem.key) == (str(cell / "workstation.toml"), "sources[0].file")
    assert problem.what == f"leads to {away}/motion.csv, outside the folder of the workstation"
    assert "--allow-outside (in Python allow_outside=True)" in problem.remedy
    assert os.path.realpath(cell / "workstation.toml") in OPENED
    assert not [name for name in OPENED if name.startswith(away)]


@pytest.mark.parametrize("where", ["two dots", "a link"])
def test_where_it_is_allowed_it_is_said_first_and_recorded_as_what_was_used(cell, where, caplog):
    written(cell, where)
    caplog.set_level(logging.WARNING)
    station = sr.load(cell, allow_outside=True)
    away = os.path.realpath(cell.parent / "away")
    assert f"sources[0].file: reads {away}/motion.csv, outside its folder" in caplog.text
    station.run(folder=cell / "out", sinks=[Recorder(lossless=True)])
    recording = sr.Recording.open(cell / "out" / "run.mcap")
    assert not [name for name, data in recording.files.items() if b"PLANTED" in data or b"Worker" in data]
    assert [name for name in recording.files if name.startswith("outside/sources/")] == [
        f"outside/sources/{WHERE[where].rpartition('/')[2]}.sha256"
    ]
    again = sr.load_recorded(recording).replay(recording)
    assert again.results["speed"].verdict == "exceeded"
    assert recording.scene.workstation_hash == again.scene.workstation_hash


def test_on_the_command_line(cell, capsys, caplog):
    written(cell, "two dots")
    assert main(["check-file", str(cell)]) == 3
    assert "--allow-outside" in capsys.readouterr().err
    assert main(["check-file", str(cell), "--allow-outside"]) == 0
    assert "sources[0].file: reads " in caplog.text


@pytest.mark.parametrize(
    "text",
    [
        'variables = "link.csv"\n',
        'zones = "link.csv"\n',
        '[[parts]]\nname = "p"\nmesh = "../away/motion.csv"\n',
        '[[robots]]\nname = "r"\nmodel = "x"\npackages = { p = ".." }\n',
        '[[robots]]\nname = "r"\nmodel = "x"\ncalibration = "link.csv"\n',
        '[[safety]]\nkind = "acme.rule"\n[safety.more]\nwhere = ["a", "../away"]\n',
        '[[sources]]\nkind = "web"\nca = "link.csv"\n',
    ],
)
def test_whatever_key_it_stands_at(cell, text):
    (cell / "workstation.toml").write_text(text)
    with pytest.raises(InputError, match="outside the folder of the workstation"):
        sr.load(cell)


def test_a_folder_of_a_source_has_no_link_that_leaves(cell):
    (cell / "bag").mkdir()
    (cell / "bag" / "walk_0.db3").symlink_to(cell.parent / "away" / "motion.csv")
    table = {"sources": [{"file": "bag"}]}
    assert [n.key for n in named_outside(table, cell)] == ["sources[0].file"]


@pytest.mark.parametrize(
    "text",
    ["/", ".", "", "x", "none.csv", "../none.csv", "a\0b", "y" * 5000, "library:ur10", "round", "~", "h:80"],
)
def test_what_is_no_file_outside(cell, text):
    (cell / "round").symlink_to("round")
    assert not list(named_outside({"a": [{"b": text}]}, cell))


def test_the_file_itself_allows_nothing(cell):
    text = "outside = true\n" + written(cell, "two dots")
    (cell / "workstation.toml").write_text(text)
    with pytest.raises(InputError, match="outside the folder of the workstation"):
        sr.load(cell)
    with pytest.raises(InputError, match="outside: unknown key"):
        sr.load(cell, allow_outside=True)
