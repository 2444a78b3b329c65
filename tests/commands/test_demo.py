"""What comes with seerob: listed, copied, and run."""

import base64
import filecmp
import re
import tomllib
from pathlib import Path

import pytest
from made_cells import seerob

from seerob.app.commands.demo import SHIPPED, addresses, copy, inline
from seerob.session.reading import read

PAPER = (
    "motor_station",
    "assembly_line",
    "empty_room",
    "niryo_picking",
    "three_robots",
    "giant_niryo",
    "two_places",
)
"""The seven cells of Weistroffer et al. 2022."""
HOME = Path(__file__).parents[2] / "workstations"


def files(folder):
    return {p.relative_to(folder) for p in folder.rglob("*") if p.is_file() and "runs" not in p.parts}


def test_it_lists_what_there_is(capsys):
    code, out, _ = seerob(capsys, "demo", "--list")
    assert code == 0
    lines = [line.split() for line in out.splitlines()]
    assert [words[1] for words in lines if words[0] == "demo"] == list(SHIPPED)
    pictures = [words[0] for words in lines if words[0] != "demo"]
    assert {Path(path).parent.name for path in pictures} >= set(PAPER)
    assert all(Path(path).is_file() for path in pictures)
    assert set(SHIPPED) == {folder.name for folder in HOME.iterdir() if folder.is_dir()}


@pytest.mark.parametrize("name", SHIPPED)
def test_a_copy_is_all_of_it(name, tmp_path):
    copy(name, tmp_path / name)
    names = files(HOME / name)
    assert files(tmp_path / name) == names
    same, other, lost = filecmp.cmpfiles(HOME / name, tmp_path / name, names, shallow=False)
    assert (len(same), other, lost) == (len(names), [], [])
    assert not list((tmp_path / name).glob("runs"))


def test_a_copy_is_run_and_never_written_over(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    command = ("demo", "iiwa_bench", "--port", "0", "--seconds", "0.2", "--no-record")
    code, out, err = seerob(capsys, *command)
    assert (code in (0, 1, 2), err) == (True, "")
    assert "wrote        iiwa_bench: yours to change" in out
    assert "page         http://" in out
    file = tmp_path / "iiwa_bench/workstation.toml"
    file.write_text("title = 'mine'\n" + file.read_text().replace("title =", "# title =", 1))
    code, out, _ = seerob(capsys, *command)
    assert "found        iiwa_bench, which is run as it is" in out
    assert "mine" in out
    (tmp_path / "taken").mkdir()
    (tmp_path / "taken/file").touch()
    code, _, err = seerob(capsys, "demo", "iiwa_bench", "taken")
    assert (code, err) == (3, "taken: exists already; give the name of a new folder\n")


def test_another_name_is_refused_with_the_nearest(capsys):
    code, _, err = seerob(capsys, "demo", "ur10_asembly")
    assert code == 3
    assert "did you mean 'ur10_assembly'?" in err


@pytest.mark.parametrize(
    ("terminal", "begins"),
    [
        ({"TERM_PROGRAM": "WezTerm"}, "\033]1337;File=inline=1;"),
        ({"TERM": "xterm-kitty"}, "\033_Ga=T,f=100,"),
    ],
)
def test_a_terminal_that_can_shows_the_picture_itself(terminal, begins):
    png = bytes(range(256)) * 40
    said = inline(png, terminal)
    assert said.startswith(begins)
    parts = re.findall(r"m=[01];([^\033]+)\033", said) or re.findall(r":([^:]+)\a", said)
    assert base64.b64decode("".join(parts)) == png
    assert inline(png, {"TERM": "xterm-256color"}) == ""


@pytest.mark.parametrize("name", PAPER)
def test_of_real_devices_every_address_of_this_machine_is_named(name):
    tables = tomllib.loads((HOME / name / "workstation.toml").read_text())
    said = "\n".join(addresses(tables))
    for table in ("sources", "targets", "cameras"):
        for i, entry in enumerate(tables.get(table, ())):
            assert ("127.0.0.1" in str(entry)) <= (f"{table}[{i}]." in said)


@pytest.mark.parametrize("name", PAPER)
def test_a_new_cell_from_one_of_the_paper_is_one_that_reads(capsys, tmp_path, name):
    code, out, err = seerob(capsys, "new", str(tmp_path / "mine"), "--from", name)
    assert (code, err) == (0, "")
    assert f"seerob run {tmp_path / 'mine'} --emulated" in out
    made, whole = read(tmp_path / "mine"), read(HOME / name)
    assert (made.emulators, made.sources, made.safety) == (whole.emulators, whole.sources, whole.safety)
    first = (tmp_path / "mine/workstation.toml").read_text().splitlines()[0]
    assert first == "#:schema workstation.schema.json"
    assert (tmp_path / "mine/workstation.schema.json").is_file()


def test_a_new_cell_from_nobody_knows_what_is_refused(capsys, tmp_path):
    code, _, err = seerob(capsys, "new", str(tmp_path / "mine"), "--from", "niryo_piking")
    assert code == 3
    assert "did you mean 'niryo_picking'?" in err
    assert not (tmp_path / "mine").exists()
