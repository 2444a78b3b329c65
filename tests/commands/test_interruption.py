"""Ctrl-C: the first ends the run and writes everything, the second does not wait."""

from __future__ import annotations

import _thread
import contextlib
import signal
import subprocess
import sys
import threading
import time

import pytest
from made_cells import make_cell

from seerob.app import cli
from seerob.app.console.interruption import Stopped
from seerob.core.errors import InputError, SeerobError
from seerob.recording.recording import Recording


@pytest.fixture(autouse=True)
def heard():
    """Ctrl-C is heard, also where the tests run in the background of a shell, which ignores it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture
def live(tmp_path):
    """A live run in another process that has printed its address, and the folder it writes to."""
    cell = make_cell(tmp_path / "cell", limit=0.01)
    command = [
        sys.executable,
        "-m",
        "seerob.app.cli",
        "run",
        cell,
        "--port",
        "0",
        "--seconds",
        "60",
        "-o",
        tmp_path / "out",
    ]
    process = subprocess.Popen(
        list(map(str, command)), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    for line in process.stdout:
        if line.startswith("page"):
            break
    yield process, tmp_path / "out"
    process.kill()
    process.communicate()


def until_it_moves(out):
    """Wait until half a second of the run is in the recording; everything may have to be compiled first."""
    end = time.monotonic() + 300
    while not recorded(out) > 0.5:
        assert time.monotonic() < end
        time.sleep(0.1)


def recorded(out):
    """How much of a run that goes on can be read so far [s]."""
    try:
        return Recording.open(out / "run.mcap").duration
    except (OSError, SeerobError):
        return 0.0


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_one_signal_ends_the_run_with_recording_report_and_verdict(live, number):
    process, out = live
    until_it_moves(out)
    process.send_signal(number)
    said, errors = process.communicate(timeout=300)
    assert (process.returncode, errors) == (1, "")
    assert "EXCEEDED" in said
    assert sorted(p.name for p in out.iterdir()) == ["report.html", "results.xlsx", "run.mcap"]
    recording = Recording.open(out / "run.mcap")
    assert recording.complete
    assert recording.duration > 0.3


def test_a_second_signal_writes_no_report_but_loses_no_recording(live):
    process, out = live
    until_it_moves(out)
    process.send_signal(signal.SIGINT)
    time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=300)
    assert (process.returncode, errors) == (3, "stopped\n")
    assert not (out / "report.html").exists()
    assert Recording.open(out / "run.mcap").duration > 0.3
    assert [p.name for p in out.iterdir() if p.name.startswith(".")] == []


def interrupting(monkeypatch, command):
    """Have ``seerob kinds`` do something else."""
    from seerob.app.commands import kinds

    monkeypatch.setattr(kinds, "run", command)
    return cli.main(["kinds"])


def test_an_interrupt_that_a_library_made_an_error_of_its_own_of_is_one(monkeypatch, capsys):
    """A bare ``except`` around an import makes a TypeError of Ctrl-C, and compiled code does not say why."""

    def interrupted(options):
        with contextlib.suppress(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        raise TypeError("expected float")

    assert interrupting(monkeypatch, interrupted) == 3
    assert capsys.readouterr().err == "stopped\n"


def test_what_an_interrupt_left_half_done_is_no_mistake_of_the_user(monkeypatch, capsys):
    def interrupted(options):
        try:
            signal.raise_signal(signal.SIGINT)
        finally:
            raise InputError.at("results.xlsx", "", "cannot be written: Bad file descriptor", "close it")

    assert interrupting(monkeypatch, interrupted) == 3
    assert capsys.readouterr().err == "stopped\n"


def test_an_interrupt_while_an_object_is_destroyed_is_not_lost(monkeypatch, capsys):
    class Leaving:
        def __del__(self):
            signal.raise_signal(signal.SIGINT)

    went_on = []

    def interrupted(options):
        leaving = Leaving()
        del leaving
        threading.Event().wait(60)  # for what only a true signal wakes
        went_on.append("for a minute")

    assert interrupting(monkeypatch, interrupted) == 3
    assert capsys.readouterr().err == "stopped\n"
    assert went_on == []


def test_an_interrupt_while_the_last_one_is_told_of_is_not_lost_either(monkeypatch, capsys):
    class Leaving:
        def __del__(self):
            signal.raise_signal(signal.SIGINT)

    def interrupted(options):
        begin = _thread.start_new_thread
        told = []

        def once_more(*what):
            if not told:
                told.append(what)
                signal.raise_signal(signal.SIGINT)
            return begin(*what)

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(_thread, "start_new_thread", once_more)
            leaving = Leaving()
            del leaving
        threading.Event().wait(60)
        raise AssertionError("went on for a minute")

    assert interrupting(monkeypatch, interrupted) == 3
    assert capsys.readouterr().err == "stopped\n"


@pytest.mark.parametrize("before", [signal.default_int_handler, signal.SIG_IGN])
def test_a_command_that_asked_for_signals_leaves_them_as_they_were(monkeypatch, before):
    def asks(options):
        Stopped()
        return 0

    ends = signal.getsignal(signal.SIGTERM)
    signal.signal(signal.SIGINT, before)
    assert interrupting(monkeypatch, asks) == 0
    assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == (before, ends)


def test_other_errors_of_destroyed_objects_are_still_told(monkeypatch):
    heard = []
    monkeypatch.setattr(sys, "unraisablehook", lambda what: heard.append(what.exc_value))

    class Leaving:
        def __del__(self):
            raise ValueError("half closed")

    def fails(options):
        leaving = Leaving()
        del leaving
        return 0

    assert interrupting(monkeypatch, fails) == 0
    assert list(map(str, heard)) == ["half closed"]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def ended(folder, program):
    """Exit code and errors of a program of its own."""
    (folder / "of_its_own.py").write_text(program)
    found = subprocess.run([sys.executable, "-m", "of_its_own"], cwd=folder, capture_output=True, text=True)
    return found.returncode, found.stderr


def test_an_interrupt_in_generated_code_ends_with_the_exit_code_too(tmp_path):
    """Dataclasses and the like run text; CPython remembers an interrupt in there and ends by a signal."""
    program = (
        "import sys\n"
        "from seerob.app import cli\n"
        "from seerob.app.commands import kinds\n"
        "kinds.run = lambda options: exec('raise KeyboardInterrupt')\n"
        "sys.exit(cli.main(['kinds']))\n"
    )
    assert ended(tmp_path, program) == (3, "stopped\n")


def test_ctrl_c_before_the_command_line_is_there_and_after_its_end_needs_no_traceback(tmp_path):
    program = (
        "import atexit, signal, sys\n"
        "from seerob.__main__ import program\n"
        "def press(*_): signal.raise_signal(signal.SIGINT)\n"
        "class Finder:\n"
        "    def find_spec(self, name, path, target=None):\n"
        "        if name == 'seerob.app.cli': press()\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "sys.meta_path.insert(0, Finder())\n"
        "atexit.register(press)\n"
        "sys.exit(program())\n"
    )
    assert ended(tmp_path, program) == (3, "stopped\n")


def test_a_new_folder_is_opened_for_editing_where_that_is_asked_for(tmp_path):
    command = [sys.executable, "-m", "seerob", "new", "my_cell", "--edit"]
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=tmp_path
    )
    assert any(line.startswith("page") for line in process.stdout)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=300)
    assert (process.returncode, errors) == (0, "")
    assert (tmp_path / "my_cell" / "workstation.toml").is_file()
