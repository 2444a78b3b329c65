"""What comes with seerob: listed, copied, and run."""

import filecmp
from pathlib import Path

import pytest
from made_cells import seerob

from seerob.app.commands.demo import SHIPPED, copy

HOME = Path(__file__).parents[2] / "workstations"


def files(folder):
    return {p.relative_to(folder) for p in folder.rglob("*") if p.is_file() and "runs" not in p.parts}


def test_it_lists_what_there_is(capsys):
    code, out, _ = seerob(capsys, "demo", "--list")
    assert code == 0
    assert [line.split()[1] for line in out.splitlines()] == list(SHIPPED)
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
