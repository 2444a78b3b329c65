"""A parser that crashes, hangs or takes all memory ends its own process and becomes a message."""

from __future__ import annotations

import builtins
import gc
import itertools
import operator
import os
import sys
import time
from datetime import date, timedelta
from decimal import Decimal
from threading import Thread

import pytest

from seerob.core.errors import InputError
from seerob.core.files import parser_process
from seerob.core.files.parser_process import parsed, parsed_one_by_one
from seerob.core.files.toml_file import read_toml


def test_a_process_answers_for_one_file_after_the_other_and_is_not_this_one():
    parser_process._end_all()
    taken = bytearray(b"x") * (
        parser_process.TIRED + (64 << 20)
    )  # what this process has is not what that one has
    assert parsed(operator.add, [1, b"\0"], ["é", None], file="a") == [1, b"\0", "é", None]
    first = parsed(os.getpid, file="a")
    assert first == parsed(os.getpid, file="b") != os.getpid()
    assert taken


def test_one_that_was_begun_ahead_has_imported_what_it_will_need_and_is_asked_first():
    parser_process._end_all()
    parser_process.begin("colorsys", "no_such_module")
    begun = parser_process._idle[-1].process.pid
    assert parsed(os.getpid, file="a") == begun
    assert parsed(eval, "'colorsys' in __import__('sys').modules", file="a")
    assert parsed(os.getpid, file="a") == begun


def test_dates_come_back_as_they_are_and_no_class_does():
    assert parsed(operator.sub, date(2026, 1, 2), date(2026, 1, 1), file="a") == timedelta(1)
    with pytest.raises(InputError, match=r"a: ends the process that reads it \(decimal.Decimal is no plain"):
        parsed(Decimal, 1, file="a")


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ((os.abort,), r"ends the process that reads it \(SIGABRT\)"),
        ((os._exit, 3), r"ends the process that reads it \(exit code 3\)"),
        ((bytes, 1 << 30), "takes more than 256 MiB of memory to read"),
        ((int, "x"), "cannot be read: ValueError: invalid literal"),
    ],
)
def test_what_ends_a_parser_is_told_with_file_and_remedy_and_the_next_file_is_read(asked, said):
    for _ in range(2):
        with pytest.raises(InputError, match=f"^cell/a.dae: {said}.*; save it anew$"):
            parsed(*asked, file="cell/a.dae", remedy="save it anew", memory=256 << 20)
        assert parsed(operator.add, 1, 2, file="b") == 3


def test_one_that_computes_without_end_and_one_that_waits_for_nothing_are_ended():
    with pytest.raises(InputError, match=r"takes more than 0.5 s to read"):
        parsed(sum, itertools.repeat(1), file="a", seconds=0.5)
    with pytest.raises(InputError, match=r"takes more than 0.05 s to read"):
        parsed(time.sleep, 1000, file="a", seconds=0.05)


def test_mistakes_that_a_parser_finds_are_the_same_as_here(tmp_path):
    file = tmp_path / "a.toml"
    file.write_bytes(b"a = 1\nb = \xff")
    with pytest.raises(InputError) as here:
        read_toml(file)
    with pytest.raises(InputError) as there:
        parsed(read_toml, file, file="a")
    assert here.value.problems == there.value.problems


def test_relative_paths_are_from_where_this_process_is(tmp_path, monkeypatch):
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        (tmp_path / name / f"{name}.txt").touch()
        monkeypatch.chdir(tmp_path / name)
        assert parsed(os.listdir, ".", file="a") == [f"{name}.txt"]


def test_nothing_of_the_environment_is_there(monkeypatch):
    monkeypatch.setenv("SEEROB_PRESS_TOKEN", "secret")
    parser_process._end_all()
    assert parsed(os.getenv, "SEEROB_PRESS_TOKEN", file="a") is None


def test_items_come_as_they_are_asked_for_and_the_process_is_used_again():
    parser_process._end_all()
    counted = parsed_one_by_one(itertools.count, file="a")
    assert list(itertools.islice(counted, 5000)) == list(range(5000))
    waiting = {child.process.pid for child in parser_process._idle}
    counted.close()
    assert len(waiting) < len(parser_process._idle) <= parser_process.KEPT
    assert list(parsed_one_by_one(builtins.iter, range(16), file="a")) == list(range(16))
    with pytest.raises(InputError, match="a: cannot be read: TypeError"):
        list(parsed_one_by_one(map, len, [[1], [2], 3], file="a"))


def test_one_that_ended_while_it_waited_is_not_held_against_the_next_file():
    parser_process._end_all()
    ended = parsed(os.getpid, file="a")
    (child,) = (c for c in parser_process._idle if c.process.pid == ended)
    child.process.kill()
    assert parsed(operator.add, 1, 2, file="a") == 3


def test_several_threads_ask_at_once():
    answers = {}
    threads = [
        Thread(target=lambda k=k: answers.update({k: parsed(operator.mul, k, 2, file="a")})) for k in range(6)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert answers == {k: 2 * k for k in range(6)}
    assert len(parser_process._idle) <= parser_process.KEPT


@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")
def test_a_forked_process_neither_asks_nor_ends_nor_complains_of_those_of_before(monkeypatch):
    """Each test that read a file of a stranger failed in a forked process, as `scripts/mutate` has them."""
    asked, told = parsed(os.getpid, file="a"), []
    monkeypatch.setattr(sys, "unraisablehook", told.append)
    if not (fork := os.fork()):
        own = parsed(os.getpid, file="a")
        parser_process._end_all()
        gc.collect()
        os._exit(own == asked or bool(told))
    assert os.waitpid(fork, 0)[1] == 0
    assert parsed(os.getpid, file="a") == asked
