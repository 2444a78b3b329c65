"""Runs that are killed while they record: the file opens, and less than a second is lost."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import seerob.core.errors
from seerob.recording.recording import Recording

CELL = """
title = "Soak"

[[robots]]
name = "arm"
model = "library:ur10"

[[parts]]
name = "post"
shape = { box = [0.2, 0.2, 1.0] }
at = { position = [1.0, 0.3, 0.5] }

[[safety]]
kind = "minimum_distance"
name = "arm – post"
between = ["arm", "post"]
limit = 0.05

[[safety]]
kind = "velocity"
name = "speed"
at = "arm"
limit = 1.0
"""


def workstation(folder):
    """A small workstation in a new folder."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "workstation.toml").write_text(CELL)
    return folder


def run_and_kill(cell, folder, seconds):
    """Start ``seerob run``, kill it ``seconds`` after the first tick is on disk; seconds lost at the end.

    What was on disk at the last write to the file was complete then, so what is lost is younger than
    that write; unless the kill cut that write in two, and then the clock of the run tells.
    """
    environment = dict(os.environ, PYTHONPATH=str(Path(seerob.__file__).parents[1]))
    command = [sys.executable, "-m", "seerob.app.cli", "run", str(cell), "-o", str(folder), "--port", "0"]
    process = subprocess.Popen(
        command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, start_new_session=True
    )
    path = folder / "run.mcap"
    try:
        zero = first_tick(path, process)
        time.sleep(seconds)
        process.send_signal(signal.SIGKILL)
        monotonic, wall = time.monotonic(), time.time()
    finally:
        process.kill()
        _, errors = process.communicate()
    assert process.returncode == -signal.SIGKILL, errors.decode()
    recording = Recording.open(path)
    assert not recording.complete
    snapshots = list(recording.snapshots())
    assert [s.seq for s in snapshots] == list(range(len(snapshots)))
    assert [tick.seq for tick in recording.ticks()] == [s.seq for s in snapshots]
    assert recording.scene.title == "Soak"
    by_clock = monotonic - zero - recording.end
    cut = "(0 bytes at the end" not in recording.findings[0].text
    return by_clock if cut else min(by_clock, wall - path.stat().st_mtime + recording.scene.period)


def first_tick(path, process, patience=120.0):
    """Earliest moment at which run time can have been 0, told from the first tick on disk."""
    end = time.monotonic() + patience
    before = time.monotonic()
    while time.monotonic() < end:
        assert process.poll() is None, process.stderr.read().decode()
        now = time.monotonic()
        try:
            recording = Recording.open(path)
        except seerob.core.errors.InputError:
            recording = None
        if recording is not None and any(True for _ in recording.snapshots()):
            return before - recording.end - 2 * recording.scene.period
        before = now
        time.sleep(0.02)
    raise AssertionError(f"no tick in {path} after {patience} s")
