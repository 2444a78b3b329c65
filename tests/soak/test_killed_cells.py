"""Cells of the paper at real speed: the emulator of each device is killed in the middle of a run.

What depends on whom it moves is undecided within the time-out of its source, and nothing else is.
"""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import seerob as sr
from seerob.app.console.terminal import Exit
from seerob.core.samples import BodySample, JointSample, SignalSample
from seerob.core.snapshot import Verdict
from seerob.devices.live.listening import LiveSource
from seerob.recording.recording import Recording

CELLS = Path(__file__).parents[2] / "workstations"
SECONDS, KILLED_AFTER = 16.0, 7.0
SLACK = 0.15
"""Beside the time-out: a tick, and what a live twin runs behind [s]."""


def emulators_of(process):
    """Processes of the emulators, in the order of the file."""
    children = Path(f"/proc/{process}/task/{process}/children").read_text().split()
    known = [int(child) for child in children if "emulation.processes" in command_of(child)]
    return sorted(known)


def command_of(process):
    return Path(f"/proc/{process}/cmdline").read_text().replace("\0", " ")


def asked_of(criterion, carried):
    """Owners that a criterion names, with who carries what it names."""
    named = [
        value
        for key in criterion.__struct_fields__
        if key != "name"
        for value in texts(getattr(criterion, key))
    ]
    owners = {name.split("/")[0] for name in named}
    return owners | {carried[name] for name in (*named, *owners) if name in carried}


def texts(value):
    if isinstance(value, str):
        return [value]
    if isinstance(value, tuple | list):
        return [text for one in value for text in texts(one)]
    return []


def run_and_kill(cell, which, folder):
    """The recording of a run, one of whose emulators was killed."""
    environment = dict(os.environ, PYTHONPATH=str(Path(sr.__file__).parents[1]))
    command = [sys.executable, "-m", "seerob.app.cli", "run", str(CELLS / cell), "--emulated"]
    command += ["--port", "0", "--seconds", str(SECONDS), "-o", str(folder)]
    with subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL) as process:
        while not (folder / "run.mcap").exists():
            assert process.poll() is None
            time.sleep(0.1)
        time.sleep(KILLED_AFTER)
        os.kill(emulators_of(process.pid)[which], signal.SIGKILL)
        assert process.wait(300) != Exit.ERROR
    return Recording.open(folder / "run.mcap")


def decided(recording, until, begin):
    """Names of results that say something before an instant [s]; of those that do after one, when last."""
    before, after = set(), {}
    for snapshot in recording.snapshots():
        for result in snapshot.results:
            if result.verdict is Verdict.UNDECIDED or (result.verdict is None and result.value is None):
                continue
            if snapshot.t < until:
                before.add(result.name)
            elif snapshot.t > begin:
                after[result.name] = snapshot.t
    return before, after


@pytest.mark.soak
@pytest.mark.skipif(sys.platform != "linux", reason="processes are found in /proc")
@pytest.mark.parametrize(
    ("cell", "which", "whom"),
    [
        ("motor_station", 0, "iiwa"),
        ("motor_station", 1, "operator"),
        ("assembly_line", 0, "ur10"),
        ("assembly_line", 1, "operator"),
        ("empty_room", 0, "ur5"),
        ("empty_room", 1, "visitor"),
        ("three_robots", 0, "visitor"),
        ("giant_niryo", 0, "niryo"),
        ("giant_niryo", 2, "operator"),
        ("niryo_picking", 0, "niryo"),
        ("two_places", 0, "niryo"),
        ("two_places", 2, "operator"),
    ],
)
def test_what_depends_on_a_killed_device_is_undecided_within_its_time_out_and_nothing_else(
    tmp_path, cell, which, whom
):
    station = sr.load(CELLS / cell)
    file = station.workstation
    (source,) = (
        s
        for s in file.sources
        if isinstance(s, LiveSource) and whom in (getattr(s, "robot", ""), getattr(s, "human", ""))
    )
    carried = {each.name: each.on.split("/")[0] for each in (*file.tools, *file.areas) if each.on}
    carried |= {name: carried[on] for name, on in carried.items() if on in carried}
    recording = run_and_kill(cell, which, tmp_path / "run")
    heard = [
        s.t
        for tick in recording.ticks()
        for s in tick.samples
        if isinstance(s, JointSample | BodySample) and s.target == whom
    ]
    end = max(heard) + source.timeout
    before, late = decided(recording, max(heard), end + SLACK)
    after = set(late)
    asked = {c.name for c in (*file.safety, *file.ergonomics)}
    before, after = before & asked, after & asked
    assert recording.duration - end > 3.0
    assert before
    for criterion in (*file.safety, *file.ergonomics):
        if whom in asked_of(criterion, carried):
            assert criterion.name not in after, (criterion.name, late[criterion.name], end)
        elif criterion.name in before:
            assert criterion.name in after


@pytest.mark.soak
@pytest.mark.skipif(sys.platform != "linux", reason="processes are found in /proc")
@pytest.mark.parametrize(
    ("cell", "relies"),
    [
        ("niryo_picking", {"tool speed", "arm energy", "effective mass"}),
        ("two_places", {"tool speed"}),
        ("giant_niryo", {"fastest point", "robot – operator", "robot over the belt"}),
    ],
)
def test_a_killed_plc_leaves_undecided_what_reaches_as_far_as_the_gripper_and_nothing_else(
    tmp_path, cell, relies
):
    recording = run_and_kill(cell, 1, tmp_path / "run")
    (plc,) = (s for s in sr.load(CELLS / cell).workstation.sources if s.name == "plc")
    samples = [s for tick in recording.ticks() for s in tick.samples if isinstance(s, SignalSample)]
    heard = max(s.t for s in samples if s.source == plc.name)
    end = heard + plc.timeout
    assert recording.duration - end > 3.0
    before, after = decided(recording, heard, end + SLACK)
    assert relies <= before
    assert not relies & after.keys(), (after, end)
    assert before - relies <= after.keys()


@pytest.mark.soak
@pytest.mark.skipif(sys.platform != "linux", reason="processes are found in /proc")
@pytest.mark.parametrize("which", [3, 4])
def test_a_killed_headset_of_one_who_looks_on_changes_nothing_but_who_is_there(tmp_path, which):
    recording = run_and_kill("two_places", which, tmp_path / "run")
    (gone,) = (t for t, visitor in recording.visits() if visitor.event == "left")
    before, after = decided(recording, gone, gone)
    assert {"tool speed", "manipulability"} <= before
    assert before <= after.keys()
    there = {visitor.device for _, visitor in recording.visits() if visitor.event == "there"}
    assert there == {"ar", "vr"} - {("ar", "vr")[which - 3]}


@pytest.mark.soak
@pytest.mark.skipif(sys.platform != "linux", reason="processes are found in /proc")
@pytest.mark.parametrize("cell", ["motor_station", "assembly_line"])
def test_a_killed_camera_changes_nothing_that_is_said(tmp_path, cell):
    recording = run_and_kill(cell, 2, tmp_path / "run")
    before, after = decided(recording, KILLED_AFTER, KILLED_AFTER)
    assert {"tool speed", "arm energy"} <= before
    assert before <= after.keys()
