"""Published descriptions: a local git repository stands where robot_descriptions clones one to."""

from __future__ import annotations

import shutil
import subprocess
import sys
from importlib import import_module

import numpy as np
import pytest
from test_urdf import INERTIAL, joint, robot

import seerob as sr
from seerob.app.cli import main
from seerob.core.errors import InputError, UnknownName
from seerob.description.loader import load_robot
from seerob.description.robots import published

NAME = "edo_description"
"""Comau's e.DO: one URDF at a fixed place of its repository."""

BOX = "<geometry><box size='0.1 0.1 0.1'/></geometry>"


def git(folder, *words):
    who = ("-c", "user.name=a", "-c", "user.email=a@b", "-c", "commit.gpgsign=false")
    done = subprocess.run(["git", "-C", folder, *who, *words], capture_output=True, text=True, check=True)
    return done.stdout.strip()


@pytest.fixture(scope="module")
def origin(tmp_path_factory):
    """A repository as its maker has it, and its commit; where the package says, there is a URDF."""
    entry = import_module("robot_descriptions._repositories").REPOSITORIES
    descriptions = import_module("robot_descriptions._descriptions").DESCRIPTIONS
    kept = entry[descriptions[NAME].repository]
    folder = tmp_path_factory.mktemp("origin")
    said = published._paths(NAME, str(folder), None)
    path = (folder / kept.cache_path).joinpath(said["path"].partition(f"{kept.cache_path}/")[2])
    home = folder / kept.cache_path
    path.parent.mkdir(parents=True)
    arm = f"{INERTIAL}<collision>{BOX}</collision><visual>{BOX}</visual>"
    path.write_text(robot('<link name="base"/>', f'<link name="arm">{arm}</link>', joint("j", "base", "arm")))
    if said["licence_file"]:
        (home / said["licence_file"]).parent.mkdir(parents=True, exist_ok=True)
        (home / said["licence_file"]).write_text("Do as you like.\n")
    git(home, "init", "-q")
    git(home, "add", ".")
    git(home, "commit", "-qm", "one")
    return home, git(home, "rev-parse", "HEAD"), kept


@pytest.fixture
def cached(origin, tmp_path, monkeypatch):
    """The cache, as the package fills it for a commit that is asked for."""
    home, commit, kept = origin
    monkeypatch.setenv(published.CACHE, str(tmp_path / "cache"))
    monkeypatch.setenv(published.COMMIT, commit)
    clone = tmp_path / "cache" / f"{kept.cache_path}-{commit}" / kept.cache_path
    shutil.copytree(home, clone)
    return clone


def test_a_description_in_the_cache_is_a_robot_with_commit_and_licence(cached, origin, tmp_path):
    made = load_robot(f"description:{NAME}", folder=tmp_path, name="left")
    assert [j.name for j in made.joints()] == ["j"]
    assert origin[1][:12] in made.source
    (note,) = [f.text for f in made.findings if "licence" in f.text]
    assert "BSD-3-Clause" in note
    assert origin[2].url in note
    assert made.files[f"{NAME}/LICENSE"] == b"Do as you like.\n"
    assert not [name for name in made.files if ":" in name.replace("package://", "")]


def test_a_cell_records_where_its_robot_is_from(cached, tmp_path):
    text = f'[[robots]]\nname = "left"\nmodel = "description:{NAME}"\n'
    (tmp_path / "workstation.toml").write_text(text)
    station = sr.load(tmp_path)
    assert any(origin in f.text for f in station.model.findings for origin in ("licence BSD-3-Clause",))
    assert any(name.endswith("LICENSE") for name in station.model.files)


def test_nothing_is_fetched_on_opening(tmp_path, monkeypatch):
    """What is not in the cache is named with the command that fetches it, and no process of git clones."""
    monkeypatch.setenv(published.CACHE, str(tmp_path / "empty"))
    monkeypatch.delenv(published.COMMIT, raising=False)
    with pytest.raises(InputError, match=f"not in the cache.*seerob robots fetch {NAME}"):
        load_robot(f"description:{NAME}", folder=tmp_path)
    assert not (tmp_path / "empty").exists()
    assert "robot_descriptions._cache" not in sys.modules
    with pytest.raises(UnknownName, match="did you mean 'edo_description'"):
        load_robot("description:edo_descriptio", folder=tmp_path)
    for hostile in ("../x", "__main__", "os;x_description", "_repositories"):
        with pytest.raises(UnknownName):
            published.find(hostile)


def test_another_commit_is_refused(cached, tmp_path):
    (cached / "more").write_text("x")
    git(cached, "add", ".")
    git(cached, "commit", "-qm", "two")
    with pytest.raises(InputError, match="is asked for"):
        load_robot(f"description:{NAME}", folder=tmp_path)


def test_a_link_out_of_the_repository_is_refused(cached, tmp_path):
    path = published.find(NAME).path
    elsewhere = tmp_path / "elsewhere.urdf"
    shutil.move(path, elsewhere)
    path.symlink_to(elsewhere)
    with pytest.raises(InputError, match="is not a file of"):
        load_robot(f"description:{NAME}", folder=tmp_path)


def test_fetch_clones_through_the_package_and_shows_the_licence(origin, tmp_path, monkeypatch, capsys):
    """Git takes the local repository for the address: the package clones it as it would from the network."""
    home, commit, kept = origin
    monkeypatch.setenv(published.CACHE, str(tmp_path / "cache"))
    monkeypatch.setenv(published.COMMIT, commit)
    monkeypatch.setenv("GIT_CONFIG_COUNT", "1")
    monkeypatch.setenv("GIT_CONFIG_KEY_0", f"url.file://{home}.insteadOf")
    monkeypatch.setenv("GIT_CONFIG_VALUE_0", kept.url)
    assert main(["robots", "fetch", f"description:{NAME}"]) == 0
    out = capsys.readouterr().out
    assert commit[:12] in out
    assert "BSD-3-Clause" in out
    made = load_robot(f"description:{NAME}", folder=tmp_path)
    np.testing.assert_array_equal(made.joints()[0].axis, [0, 0, 1])


def test_a_fetch_that_fails_says_so(origin, tmp_path, monkeypatch, capsys):
    monkeypatch.setenv(published.CACHE, str(tmp_path / "cache"))
    monkeypatch.setenv("GIT_CONFIG_COUNT", "1")
    monkeypatch.setenv("GIT_CONFIG_KEY_0", f"url.file://{tmp_path / 'nowhere'}.insteadOf")
    monkeypatch.setenv("GIT_CONFIG_VALUE_0", origin[2].url)
    assert main(["robots", "fetch", NAME]) == 3
    assert "not fetched" in "".join(capsys.readouterr())


def test_the_list_says_what_is_known_and_what_is_missing(capsys):
    assert main(["robots"]) == 0
    lines = capsys.readouterr().out.splitlines()
    (ur10,) = [line for line in lines if "library:ur10 " in line]
    assert "32.4 kg" in ur10
    assert ur10.endswith("nothing")
    (doosan,) = [line for line in lines if "library:doosan_m1013 " in line]
    assert "masses" in doosan
    assert any("description:ur5e_description" in line and "BSD-3-Clause" in line for line in lines)
    assert any("package:example-robot-data/" in line for line in lines)
    assert not any("description:a1_description" in line for line in lines)
