"""Who may write nowhere that Numba would choose still has compiled loops, in a folder of the process."""

from __future__ import annotations

import os
import shutil
import sys
from importlib import import_module

from numba import config

from seerob.kernels import _kept_loops

LOOP = """
from numba import njit

@njit(cache=True)
def twice(x):
    return 2 * x
"""


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
