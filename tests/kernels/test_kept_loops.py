"""No loop of another source is run; who may write nowhere that Numba would choose still has its loops."""

from __future__ import annotations

import ast
import os
import shutil
import sys
from importlib import import_module

import pytest
from numba import config

import seerob.kernels
from seerob.kernels import _kept_loops

LOOP = """
from numba import njit

@njit(cache=True)
def twice(x):
    return 2 * x
"""

OUTER = """
from numba import njit
from seerob.kernels.inner_of_two import factor

@njit(cache=True)
def scaled(x):
    return factor() * x
"""
INNER = """
from numba import njit

@njit(cache=True)
def factor():
    return {factor}
"""


@pytest.fixture
def kernels(tmp_path, monkeypatch):
    """Two modules of loops, the outer of which calls the inner; writes and imports them."""
    monkeypatch.setattr(_kept_loops, "FOLDER", tmp_path)
    monkeypatch.setattr(seerob.kernels, "__path__", [*seerob.kernels.__path__, str(tmp_path)])
    monkeypatch.setattr(sys, "dont_write_bytecode", True)  # its stamp is of whole seconds and sizes

    def load(factor):
        (tmp_path / "outer_of_two.py").write_text(OUTER)
        (tmp_path / "inner_of_two.py").write_text(INNER.format(factor=factor))
        forget()
        return import_module("seerob.kernels.outer_of_two")

    def forget():
        _kept_loops.key_of.cache_clear()
        for name in ("outer_of_two", "inner_of_two"):
            sys.modules.pop(f"seerob.kernels.{name}", None)

    yield load
    forget()


def test_a_loop_is_never_run_as_it_was_before_one_that_it_calls_was_edited(kernels):
    assert kernels(2).scaled(21) == 42
    assert kernels(3).scaled(21) == 63
    again = kernels(2).scaled
    assert again(21) == 42
    assert sum(again.stats.cache_hits.values()) == 1  # and both are kept


def test_what_loops_import_is_of_the_form_that_their_key_follows():
    for path in _kept_loops.FOLDER.glob("*.py"):
        tree = ast.parse(path.read_text())
        names = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
        names |= {name.name for node in ast.walk(tree) if isinstance(node, ast.Import) for name in node.names}
        ours = {name for name in names if name and name.startswith("seerob")}
        followed = {
            f"seerob.kernels.{name.decode()}" for name in _kept_loops.IMPORTED.findall(path.read_bytes())
        }
        others = ours - followed
        if "njit" in path.read_text():
            assert others <= {"seerob.core.transforms"}, path  # a type


def test_loops_are_kept_in_a_folder_of_the_process_where_there_is_no_other(tmp_path, monkeypatch):
    monkeypatch.setattr(config, "CACHE_DIR", "")
    monkeypatch.setenv("NUMBA_CACHE_DIR", "")
    _kept_loops.keep_loops()
    assert config.CACHE_DIR == ""  # its own places can be written here

    monkeypatch.setattr(_kept_loops, "_writable", lambda folder: False)
    _kept_loops.keep_loops()
    folder = config.CACHE_DIR
    assert os.environ["NUMBA_CACHE_DIR"] == folder
    assert os.stat(folder).st_mode & 0o077 == 0
    _kept_loops.keep_loops()
    assert folder == config.CACHE_DIR

    (tmp_path / "loop_without_a_home.py").write_text(LOOP)
    monkeypatch.syspath_prepend(tmp_path)
    try:
        assert import_module("loop_without_a_home").twice(21) == 42
        assert [file for _, _, files in os.walk(folder) for file in files]
    finally:
        sys.modules.pop("loop_without_a_home", None)
        shutil.rmtree(folder)


def test_what_cannot_be_made_cannot_be_written(tmp_path):
    (tmp_path / "file").write_text("")
    assert not _kept_loops._writable(tmp_path / "file" / "folder")
    assert _kept_loops._writable(tmp_path / "new" / "folder")
    assert os.listdir(tmp_path / "new" / "folder") == []
