"""Whenever Ctrl-C comes: a file or folder is there whole or as it was before, and nothing lies beside it."""

from __future__ import annotations

import os
import shutil

import numpy as np
import pytest

from interrupted_anywhere import interrupted_anywhere
from seerob.core.errors import InputError
from seerob.core.files.whole_file import whole_file, whole_folder
from seerob.core.shapes import Mesh
from seerob.description.shapes.glb import stl_bytes, write_mesh
from seerob.outputs.sinks.dossier import write_whole
from seerob.outputs.tables.growing_table import GrowingTable, WholeFolder
from seerob.outputs.workbook import workbook

MESH = Mesh(np.eye(3), np.array([[0, 1, 2]]))


@pytest.mark.parametrize(
    ("write", "whole"),
    [
        (lambda path: write_whole(path, b"new"), b"new"),
        (lambda path: write_mesh(path, MESH), stl_bytes(MESH)),
    ],
)
def test_a_file_is_new_or_old_and_never_half(tmp_path, write, whole):
    path = tmp_path / "a.stl"
    path.write_bytes(b"old")
    found = []
    for _ in interrupted_anywhere(lambda: write(path)):
        assert os.listdir(tmp_path) == [path.name]
        found.append(path.read_bytes())
    assert set(found) == {b"old", whole}
    assert found == sorted(found, key=whole.__eq__)
    assert path.read_bytes() == whole


@pytest.mark.parametrize("there", [False, True])
def test_a_folder_has_all_its_files_or_none(tmp_path, there):
    folder = tmp_path / "runs" / "first"

    def work():
        with whole_folder(folder) as working:
            (working / "a").touch()
            (working / "b").touch()

    if there:
        folder.mkdir(parents=True)
    found = []
    for _ in interrupted_anywhere(work):
        if os.listdir(tmp_path):
            assert os.listdir(tmp_path / "runs") == ["first"]
            found.append(sorted(os.listdir(folder)))
            for name in found[-1]:
                (folder / name).unlink()
        else:
            assert not there
            found.append([])
        if not there and found[-1]:
            shutil.rmtree(tmp_path / "runs")
    assert found == sorted(found)
    assert [list(names) for names in dict.fromkeys(map(tuple, found))] == [[], ["a", "b"]]


def test_a_workbook_is_there_at_the_end_or_not_at_all(tmp_path):
    path = tmp_path / "a.xlsx"

    def work():
        with whole_file(path) as hidden, workbook(hidden) as sheets:
            sheets.add("a", ["b"], [[1.0]])

    work()
    whole = path.read_bytes()
    path.unlink()
    instants = 0
    for _ in interrupted_anywhere(work, step=131):
        assert os.listdir(tmp_path) == []
        instants += 1
    assert instants > 20
    assert path.read_bytes() == whole


def test_a_folder_of_tables_is_there_at_the_end_or_not_at_all(tmp_path):
    class Tables(WholeFolder):
        def take(self, snapshot, samples):
            make = lambda path: GrowingTable(path, separator=",", missing="", columns=("t",))  # noqa: E731
            self.table("a", ".csv", make).append(["1"])

        def finish(self):
            for table in self.tables.values():
                table.finish(["t\n"])

    path = tmp_path / "tables"

    def work():
        with Tables(path) as writer:
            writer.write(None, ())

    seen = set()
    for _ in interrupted_anywhere(work):
        found = os.listdir(tmp_path)
        assert found in ([], ["tables"])
        if found:
            assert (path / "a.csv").read_text() == "t\n1\n"
            assert os.listdir(path) == ["a.csv"]
        seen.add(bool(found))
        shutil.rmtree(path, ignore_errors=True)
    assert seen == {False, True}


def test_what_cannot_be_written_leaves_nothing(tmp_path):
    with pytest.raises(FileNotFoundError), whole_file(tmp_path / "none" / "a") as hidden:
        hidden.write_text("a")
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be made"), whole_folder(tmp_path / "file" / "a"):
        raise AssertionError("there is no place to work in")
    assert os.listdir(tmp_path) == ["file"]


def test_who_may_write_into_a_folder_need_not_be_allowed_to_write_beside_it(tmp_path):
    with whole_folder(tmp_path) as working:
        assert working.parent == tmp_path
    assert os.listdir(tmp_path) == []


def test_the_longest_name_that_a_file_may_have_is_written(tmp_path):
    path = tmp_path / ("a" * 251 + ".stl")
    write_mesh(path, MESH)
    assert path.read_bytes() == stl_bytes(MESH)
