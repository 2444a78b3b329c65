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


def test_a_port_that_is_taken_is_named_and_nothing_is_left_behind(tmp_path):
    free = free_port(socket.SOCK_STREAM)
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        file = station(tmp_path, rtde(free) + rtde(port))
        said = rf"emulators\[1\]: rtde: .*127.0.0.1:{port}"
        with pytest.raises(InputError, match=said), emulated(read(file).emulators, file):
            pass
    assert not listens(free)


def test_options_of_a_kind_are_checked_as_the_file_is_read(tmp_path):
    with pytest.raises(InputError, match=r"emulators\[0\].drop") as raised:
        read(station(tmp_path, rtde(1, "drop = 2") + '[[emulators]]\nkind = "rtdee"\n'))
    assert "emulators[1].kind" in str(raised.value)


def test_a_run_says_so_when_there_is_none(tmp_path, capsys):
    file = station(tmp_path, "")
    assert cli.main(["run", str(file), "--emulated"]) == Exit.ERROR
    assert "emulators: none is named" in capsys.readouterr().err


@pytest.mark.xdist_group("cells")  # their devices have their usual ports
@pytest.mark.parametrize(
    ("cell", "sources", "emulators"),
    [
        ("motor_station", {"iiwa", "operator"}, 2),
        ("assembly_line", {"ur10", "operator"}, 2),
        ("empty_room", {"ur5", "visitor"}, 2),
        ("three_robots", {"iiwa_left", "ur10", "iiwa_right", "visitor"}, 1),
        ("giant_niryo", {"niryo", "operator"}, 2),
    ],
)
def test_cells_of_the_paper_run_without_their_devices(tmp_path, capsys, cell, sources, emulators):
    folder = tmp_path / "run"
    ended = cli.main(
        ["run", str(CELLS / cell), "--emulated", "--port", "0", "--seconds", "2", "-o", str(folder)]
    )
    assert ended != Exit.ERROR
    recording = Recording.open(folder / "run.mcap")
    samples = [sample for tick in recording.ticks() for sample in tick.samples]
    heard = {sample.target for sample in samples if isinstance(sample, JointSample | BodySample)}
    assert heard == sources
    said = [f for f in recording.scene.findings if f.subject.startswith("emulators[")]
    assert len(said) == emulators
    assert all("no device, an emulator" in finding.text for finding in said)
