"""No loop of another source or processor is run; who may write nowhere that Numba would choose has loops."""

from __future__ import annotations

import ast
import os
import shutil
import subprocess
import sys
import zlib
from importlib import import_module

import numpy as np
import pytest
from llvmlite import binding
from numba import config, njit

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


def test_what_is_kept_of_a_loop_beside_machine_code_is_read_by_who_calls_it_in_a_new_one(
    kernels, monkeypatch
):
    kernels(2).scaled(21)
    read, parse = [], binding.parse_bitcode
    monkeypatch.setattr(binding, "parse_bitcode", lambda code: read.append(code) or parse(code))
    scaled = kernels(2).scaled
    assert scaled(21) == 42
    assert sum(scaled.stats.cache_hits.values()) == 1
    assert read == []
    assert njit(lambda x: scaled(x) + 1)(21) == 43
    assert len(read) == 1
    assert njit(lambda x: scaled(x) + 2)(21) == 44
    assert len(read) == 1


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


ASKED = """
import sys
from importlib import import_module
from pathlib import Path
import seerob.kernels
from seerob.kernels import _kept_loops

_kept_loops.FOLDER, _kept_loops.BROUGHT = Path(sys.argv[1]), Path(sys.argv[2])
seerob.kernels.__path__.append(sys.argv[1])
scaled = import_module("seerob.kernels.outer_of_two").scaled
print(scaled(21), sum(scaled.stats.cache_hits.values()), len(_kept_loops.stood_in_for()))
"""
AVX2 = "x86-64-v3"


@pytest.fixture
def asked(tmp_path):
    """Writes two modules of loops and asks the outer, in a process of its own that keeps loops in a folder;
    what it gave, whether it was compiled already, and how many processors this one stands in for."""
    (tmp_path / "source").mkdir()
    (tmp_path / "source" / "outer_of_two.py").write_text(OUTER)

    def ask(kept, factor=2, **environment):
        (tmp_path / "source" / "inner_of_two.py").write_text(INNER.format(factor=factor))
        done = subprocess.run(
            [sys.executable, "-P", "-B", "-c", ASKED, str(tmp_path / "source"), str(tmp_path / "brought")],
            env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / kept), **environment},
            check=True,
            capture_output=True,
            text=True,
        )
        return tuple(map(int, done.stdout.split()))

    return ask


def test_loops_that_are_brought_are_run_only_of_this_source_and_by_a_processor_that_is_able(tmp_path, asked):
    made = {"NUMBA_CPU_NAME": AVX2, "NUMBA_CPU_FEATURES": ""}
    assert asked("made", **made) == (42, 0, 0)
    assert asked("made", **made) == (42, 1, 0)  # as Numba itself keeps it
    (kept,) = (tmp_path / "made").iterdir()
    shutil.copytree(kept, tmp_path / "brought")
    assert asked("not_packed")[:2] == (42, 0)
    for file in (tmp_path / "brought").glob("*.nbc"):
        file.write_bytes(zlib.compress(file.read_bytes()))
    value, hits, able = asked("own")
    assert (value, hits) == (42, able > 0)
    assert bool(list(tmp_path.glob("own/*/*.nbi"))) == (able == 0)  # nothing is compiled and kept then
    assert asked("edited", factor=3)[:2] == (63, 0)
    assert asked("unable", NUMBA_ENABLE_AVX="0") == (42, 0, 0)
    assert asked("told", NUMBA_CPU_NAME="x86-64") == (42, 0, 0)
    assert sorted(file.name for file in (tmp_path / "brought").iterdir()) == sorted(
        file.name for file in kept.iterdir()
    )


ROUNDED = """
import sys
import numpy as np
from numba import njit
from seerob.kernels.lanes import of_rows

fused = of_rows(3, 1, lambda row, given: row[0].plus_product(row[1], row[2]))

@njit
def rounded(rows, given, out):
    fused(rows, 0, given, 1e9, out)

out = np.empty(8, np.float32)
rows = np.frombuffer(bytes.fromhex(sys.argv[1]), np.float32).reshape(1, 24)
rounded(rows, np.zeros(1, np.float32), out)
print(out.tobytes().hex())
"""


def test_a_fused_product_is_rounded_alike_by_loops_that_are_compiled_here_and_that_are_brought():
    """Of 1 + 2⁻¹² and its square: what rounding twice takes is all that is left."""
    factor = np.float32(1 + 2**-12)
    rows = np.repeat([-factor * factor, factor, factor], 8).astype(np.float32)
    exact = np.full(8, 2.0**-24, np.float32)
    assert factor * factor - factor * factor == 0
    processors = _kept_loops.stood_in_for()
    for names in ({}, *({"NUMBA_CPU_NAME": name, "NUMBA_CPU_FEATURES": ""} for name in processors)):
        done = subprocess.run(
            [sys.executable, "-P", "-c", ROUNDED, rows.tobytes().hex()],
            env={**os.environ, **names},
            check=True,
            capture_output=True,
            text=True,
        )
        if processors:  # which all fuse
            assert np.frombuffer(bytes.fromhex(done.stdout.strip()), np.float32).tolist() == exact.tolist()
