"""Emulators of a workstation file, each in a process of its own."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest

from free_ports import free_port
from seerob.app import cli
from seerob.app.console.terminal import Exit
from seerob.app.emulation.processes import emulated
from seerob.core.errors import InputError
from seerob.core.samples import BodySample, JointSample
from seerob.recording.recording import Recording
from seerob.session.reading import read

CELLS = Path(__file__).parents[2] / "workstations"
ROBOT = '[[robots]]\nname = "ur10"\nmodel = "library:ur10"\n'


def station(folder: Path, tables: str) -> Path:
    file = folder / "workstation.toml"
    file.write_text(ROBOT + tables, encoding="utf-8")
    return file


def rtde(port: int, more: str = "") -> str:
    return f'[[emulators]]\nkind = "rtde"\nport = {port}\nprimary_port = 0\n{more}\n'


def listens(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


def over(process: int) -> bool:
    """Whether a process ends within 10 s."""
    end = time.monotonic() + 10
    while time.monotonic() < end:
        try:
            os.kill(process, 0)
        except ProcessLookupError:
            return True
        if Path(f"/proc/{process}/stat").exists() and ") Z " in Path(f"/proc/{process}/stat").read_text():
            return True
        time.sleep(0.02)
    return False


def test_they_serve_until_the_run_is_over(tmp_path):
    port = free_port(socket.SOCK_STREAM)
    # A module of the workstation's folder is not imported, whatever its name.
    (tmp_path / "json.py").write_text("raise SystemExit('taken from the folder')\n")
    file = station(tmp_path, rtde(port))
    with emulated(read(file).emulators, file) as (running,):
        assert running.kind == "rtde"
        assert running.at == f"listens at 127.0.0.1:{port}"
        assert listens(port)
        assert not running.ended
    assert running.ended
    assert not listens(port)


def test_they_end_with_whoever_started_them(tmp_path):
    port = free_port(socket.SOCK_STREAM)
    file = station(tmp_path, rtde(port))
    program = (
        "import sys, time; from pathlib import Path; from seerob.session.reading import read\n"
        "from seerob.app.emulation.processes import emulated; file = Path(sys.argv[1])\n"
        "with emulated(read(file).emulators, file) as (one,):\n"
        "    print(one.process.pid, flush=True); time.sleep(99)"
    )
    with subprocess.Popen([sys.executable, "-c", program, file], stdout=subprocess.PIPE, text=True) as parent:
        assert parent.stdout is not None
        child = int(parent.stdout.readline())
        assert listens(port)
        parent.send_signal(signal.SIGKILL)
        parent.wait()
    assert over(child)


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ('kind = "rtde"\nhost = "0.0.0.0"\n', r"emulators\[0\].host: 0.0.0.0 is not this machine"),
        ('kind = "kinect"\nto = "192.0.2.1"\n', r"emulators\[0\].to: 192.0.2.1 is not this machine"),
        ('kind = "natnet"\nmulticast = "239.255.42.99"\n', r"emulators\[0\].multicast: .* not this machine"),
        ('kind = "rtde"\nfile = "none.csv"\n', r"emulators\[0\]: rtde: none.csv"),
    ],
)
def test_what_cannot_or_must_not_be_is_refused_with_its_key(tmp_path, table, said):
    file = station(tmp_path, f"[[emulators]]\n{table}")
    with pytest.raises(InputError, match=said), emulated(read(file).emulators, file):
        pass


def test_two_at_one_port_are_refused(tmp_path):
    file = station(tmp_path, rtde(1234) + rtde(1234))
    said = r"emulators\[1\].port: emulators\[0\] listens at 127.0.0.1:1234, too"
    with pytest.raises(InputError, match=said), emulated(read(file).emulators, file):
        pass


def test_where_its_port_is_taken_it_says_which_it_has_instead(tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        file = station(tmp_path, rtde(port))
        with emulated(read(file).emulators, file) as (running,):
            (move,) = running.moves
            assert move.taken == port
            assert running.at == f"listens at 127.0.0.1:{move.port}"
            assert listens(move.port)


def test_options_of_a_kind_are_checked_as_the_file_is_read(tmp_path):
    with pytest.raises(InputError, match=r"emulators\[0\].drop") as raised:
        read(station(tmp_path, rtde(1, "drop = 2") + '[[emulators]]\nkind = "rtdee"\n'))
    assert "emulators[1].kind" in str(raised.value)


def test_a_run_says_so_when_there_is_none(tmp_path, capsys):
    file = station(tmp_path, "")
    assert cli.main(["run", str(file), "--emulated"]) == Exit.ERROR
    assert "emulators: none is named" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("cell", "sources", "emulators"),
    [
        ("assembly_line", {"ur10", "operator"}, 3),
        ("empty_room", {"ur5", "visitor"}, 2),
        ("three_robots", {"iiwa_left", "ur10", "iiwa_right", "visitor"}, 1),
        ("giant_niryo", {"niryo", "operator"}, 3),
        ("niryo_picking", {"niryo"}, 2),
        ("two_places", {"niryo", "operator"}, 5),
    ],
)
def test_cells_of_the_paper_run_without_their_devices(tmp_path, cell, sources, emulators):
    folder = tmp_path / "run"
    assert cli.main(emulated_run(cell, folder)) != Exit.ERROR
    recording = Recording.open(folder / "run.mcap")
    assert heard(recording) == sources
    said = [f for f in recording.scene.findings if f.subject.startswith("emulators[")]
    assert len(said) == emulators
    assert all("no device, an emulator" in finding.text for finding in said)
    if cell == "two_places":
        # What devices see at B is in the result that every page is told, A's too.
        assert "RULA at B" in {result.name for s in recording.snapshots() for result in s.results}


def emulated_run(cell: str, folder: Path) -> list[str]:
    return ["run", str(CELLS / cell), "--emulated", "--port", "0", "--seconds", "2", "-o", str(folder)]


def heard(recording: Recording) -> set[str]:
    samples = [sample for tick in recording.ticks() for sample in tick.samples]
    return {sample.target for sample in samples if isinstance(sample, JointSample | BodySample)}


def test_another_cell_of_the_paper_runs_twice_at_once(tmp_path, capfd):
    """Neither hears the other's devices: of two who send to one port both would be told."""
    command = [sys.executable, "-m", "seerob", *emulated_run("motor_station", tmp_path / "one")]
    with subprocess.Popen(command, stdin=subprocess.DEVNULL) as other:
        ended = cli.main(emulated_run("motor_station", tmp_path / "two"))
        assert Exit.ERROR not in (ended, other.wait(300))
    said = "".join(capfd.readouterr())
    for name in ("one", "two"):
        assert heard(Recording.open(tmp_path / name / "run.mcap")) == {"iiwa", "operator"}
    assert "sends to port" not in said
