"""Sources in processes of their own: told, heard, logged, ended, and begun anew."""

from __future__ import annotations

import importlib
import logging
import os
import pickle
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import scripted_sources
from live_story import open_files, wait_for
from scripted_sources import AtOnce, Delayed, Large, Missing, Mistaken, Scripted, Stubborn
from seerob.core.plugin import kinds, load
from seerob.core.samples import JointSample, Quality, SignalSample
from seerob.description.robots import library
from seerob.devices.live import source_process
from seerob.devices.live.listening import LiveSource
from seerob.devices.live.receivers import Receivers
from seerob.devices.live.source_process import pickled_source
from seerob.devices.sources.headset import Headset
from seerob.devices.sources.natnet import Natnet
from seerob.devices.sources.rtde import Rtde
from seerob.workstation.source import Source, Target


def taken(listening, kind=JointSample):
    """The next samples of a kind."""
    found = []
    wait_for(lambda: found.extend(s for s in listening.take() if isinstance(s, kind)) or found)
    return found


def process_of(listening):
    (sample,) = taken(listening, SignalSample)
    return int(sample.values["process"])


def is_there(pid):
    try:
        state = Path(f"/proc/{pid}/stat").read_text()
    except (FileNotFoundError, ProcessLookupError):  # the latter where it ends while it is read
        return False
    return state.rpartition(")")[2].split()[0] != "Z"


def test_it_is_heard_from_another_process_whose_end_is_waited_for():
    before = open_files()
    with Receivers([(Scripted(name="controller"), None)]) as listening:
        pid = process_of(listening)
        first, later = taken(listening)[-1], taken(listening)[-1]
    assert pid != os.getpid()
    assert not is_there(pid)
    assert (later.source, later.q) == ("controller", (0.5,))
    assert later.seq > first.seq
    assert 0 <= time.monotonic() - later.t < 30
    assert open_files() == before


def test_each_has_a_process_of_its_own_and_what_drives_something_is_waited_for():
    sources = [(Scripted(name="a", robot="left"), None), (Scripted(name="b", robot="right"), None)]
    with Receivers(sources) as listening:
        heard = listening.first(patience=60.0)
        assert {s.target for s in heard if isinstance(s, JointSample)} == {"left", "right"}
        processes = {}
        wait_for(lambda: processes.update({s.source: s for s in taken(listening)}) or len(processes) == 2)
    assert {"a", "b"} == set(processes)


def test_the_newest_wins_and_nothing_queues():
    with Receivers([(AtOnce(), None)]) as listening:
        found = []
        wait_for(lambda: found.extend(listening.take()) or (found and found[-1].seq == 999))
        assert len(found) < 1000 or len(found) == len({s.seq for s in found})
        assert found[-1].q == (999.0,)
        assert listening.take() == ()


def test_what_it_logs_is_logged_here_with_its_place_and_what_a_library_prints_is_not_taken_for_it(caplog):
    with (
        caplog.at_level(logging.INFO),
        Receivers([(Scripted(name="a"), None), (Mistaken(name="b", robot="other"), None)]) as listening,
    ):
        wait_for(lambda: taken(listening)[-1].seq > 3)
        wait_for(lambda: any(r.getMessage().startswith("b: not heard") for r in caplog.records))
    lines = {r.getMessage(): r for r in caplog.records}
    assert (lines["one line\nand another"].name, lines["one line\nand another"].levelname) == (
        "scripted",
        "INFO",
    )
    assert "raise KeyError" in lines["b: a mistake in the source itself"].exc_text
    assert lines["b: not heard: KeyError: 'gone'"].levelname == "WARNING"
    assert any(line.startswith("a: ") and "samples at" in line for line in lines)  # at the end
    assert not any("nobody understands" in line for line in lines)


def test_a_process_that_is_killed_is_started_again_with_one_line_each(caplog):
    with caplog.at_level(logging.WARNING), Receivers([(Scripted(name="arm"), None)]) as listening:
        for k in range(3):
            pid = process_of(listening)
            # Its signals come first, and what drives a robot is heard by its joints: who is killed in between
            # was not heard again, and nobody says so.
            taken(listening)
            os.kill(pid, signal.SIGKILL)
            wait_for(lambda k=k: caplog.text.count("has ended (SIGKILL) and is started again") == k + 1)
        process_of(listening)
        taken(listening)
        wait_for(lambda: caplog.text.count("arm: heard again") == 3)
    assert len([r for r in caplog.records if r.name.startswith("seerob")]) == 6


def test_a_delay_that_came_while_nobody_listened_stays_one(tmp_path):
    """Whoever listens next knows the clock of the device: samples that are 0.8 s old are not of now."""
    with Receivers([(Delayed(name="arm", been=str(tmp_path / "been"), timeout=0.5), None)]) as listening:
        pid = process_of(listening)
        assert {s.quality for s in taken(listening)} == {Quality.GOOD}
        os.kill(pid, signal.SIGKILL)
        wait_for(lambda: not is_there(pid))
        assert process_of(listening) != pid
        for _ in range(5):
            late = taken(listening)[-1]
            assert late.quality is Quality.LATE
            assert late.late > 0.7


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGTERM])
def test_it_ends_with_the_run_however_that_ends(how):
    run = subprocess.Popen(
        [sys.executable, "-c", "import scripted_sources; scripted_sources.run()"],
        cwd=Path(scripted_sources.__file__).parent,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    with run:
        pid = int(run.stdout.readline())
        assert is_there(pid)
        run.send_signal(how)
        run.wait(60)
        wait_for(lambda: not is_there(pid))


def test_an_interrupt_of_the_terminal_is_not_for_it():
    with Receivers([(Scripted(), None)]) as listening:
        assert os.getpgid(process_of(listening)) != os.getpgid(0)


def test_one_that_does_not_end_is_not_waited_for_long(monkeypatch):
    monkeypatch.setattr(source_process, "SPARE", 0.5)
    begun = 0.0
    with Receivers([(Stubborn(), None)]) as listening:
        taken(listening)
        (process,) = [p._process for p in listening._processes]
        begun = time.monotonic()
    assert time.monotonic() - begun < 30
    assert process.returncode is not None


def test_one_that_is_stopped_while_it_begins_ends():
    before = open_files()
    for pause in (0.0, 0.02, 0.1):
        listening = Receivers([(Scripted(), None)])
        (process,) = listening._processes
        process.start()
        time.sleep(pause)
        process.ask_to_stop()
        process.join()
        assert not process._thread.is_alive()
    assert open_files() == before


def test_an_interrupt_while_it_begins_leaves_nothing_behind(monkeypatch):
    def interrupted(process):
        raise KeyboardInterrupt

    monkeypatch.setattr(source_process.SourceProcess, "wait", interrupted)
    listening = Receivers([(Scripted(), None), (Scripted(robot="other"), None)])
    with pytest.raises(KeyboardInterrupt), listening:
        listening.first()
    assert not any(process._thread.is_alive() for process in listening._processes)


def test_what_only_this_process_has_listens_here():
    class Local(Scripted, frozen=True, kw_only=True):
        """Defined where no other process finds it."""

    assert pickled_source(Scripted(), None)
    for source in (Local(), Headset(human="operator")):
        assert pickled_source(source, None) is None
    with Receivers([(Local(), None)]) as listening:
        assert process_of(listening) == os.getpid()


def test_modules_of_the_folder_it_is_started_in_are_not_taken(tmp_path, monkeypatch):
    for name in ("msgspec", "pickle", "seerob", "sitecustomize"):
        (tmp_path / f"{name}.py").write_text("import os\nopen('taken', 'w')\nos._exit(7)\n")
    monkeypatch.chdir(tmp_path)
    with Receivers([(Scripted(), None)]) as listening:
        taken(listening)
    assert not (tmp_path / "taken").exists()


def test_a_source_that_is_not_known_there_is_told_with_its_place(caplog):
    with caplog.at_level(logging.WARNING), Receivers([(Missing(name="odd"), None)]):
        wait_for(lambda: "odd: the process that listened has ended (exit code 1)" in caplog.text)
    assert "No module named 'of_a_notebook'" in caplog.text
    assert "a source cannot be listened to in a process of its own" in caplog.text


def test_a_sample_that_has_no_room_is_a_loss(caplog):
    with caplog.at_level(logging.WARNING), Receivers([(Large(name="odd"), None)]) as listening:
        wait_for(lambda: "odd: not heard: a sample of 200" in caplog.text)
        assert listening.take() == ()


def test_what_a_kind_loads_before_it_listens_can_be_loaded():
    """What cannot is left to the source, which loads it when it listens: a slip would only be late."""
    found = [load("sources", kind, Source) for kind in kinds("sources")]
    modules = {m for source in found if issubclass(source, LiveSource) for m in source.loads}
    assert modules >= {"asyncua", "aiomqtt", "pymodbus.client"}
    for module in sorted(modules):
        importlib.import_module(module)


def test_who_needs_no_links_listens_without_numpy():
    """A third of its process would be numpy's."""
    kinds_of = [
        kind for kind in kinds("sources") if not getattr(load("sources", kind, Source), "links", True)
    ]
    assert {"rtde", "fri", "egm", "drfl", "modbus_robot", "opcua", "mqtt"} <= set(kinds_of)
    modules = [
        "seerob.devices.live.listening_process",
        *(f"seerob.devices.sources.{kind}" for kind in kinds_of),
    ]
    code = f"""
import sys, types, {", ".join(modules)}
from seerob.workstation.source import Target
from seerob.devices.sources.opcua_robot import another_robot

assert another_robot(types.SimpleNamespace(about={{"Model": "UR3e"}}), Target(model="library:ur5e"))
print(sorted({{"numpy", "numba", "mujoco", "importlib.metadata"}} & {{*sys.modules}}))
"""
    # -S: what other packages have Python load at its start is none of ours.
    path = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    done = subprocess.run(
        [sys.executable, "-S", "-c", code], capture_output=True, text=True, check=True, env=path
    )
    assert done.stdout.strip() == "[]"


def test_links_of_the_target_are_told_to_whom_they_are_of_use():
    target = Target(name="arm", description=library.load("ur5e"))
    for kind, told in ((Rtde, False), (Natnet, True)):
        source = kind(**({"robot": "arm", "host": "127.0.0.1"} if kind is Rtde else {"human": "operator"}))
        _, there = pickle.loads(pickled_source(source, target))
        assert (there.description is not None) == told
