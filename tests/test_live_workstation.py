"""The live workstation that ships, with the emulator that ships, as the command line runs both."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from seerob.app import cli
from seerob.app.console.terminal import Exit
from seerob.app.emulation.motions import swing
from seerob.app.emulation.options import read, target_of
from seerob.app.emulators.rtde import HOME, RtdeServer
from seerob.core.errors import InputError
from seerob.recording.recording import Recording
from seerob.session.station import load

FOLDER = Path(__file__).parents[1] / "workstations" / "ur10_rtde"
ATTEMPTS = 20
"""On a machine that is so busy that nothing is decided of a whole run."""
SLOW = "run time fell behind", "its clock is being found", "not heard for", "later than at its best"
"""What a machine that cannot keep up says of itself, or of when it hears; nothing else may be undecided."""
MOTION = FOLDER.parent / "ur10_assembly" / "motion" / "cycle.xlsx"


@contextmanager
def emulator(*more: str) -> Iterator[int]:
    """The port of an emulator that was started as a user starts it."""
    command = [sys.executable, "-m", "seerob.app.cli", "emulate", "rtde", "--port", "0", *more]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            lines = [process.stdout.readline(), process.stdout.readline()]
            found = re.search(r"127\.0\.0\.1:(\d+)", lines[1])
            assert found, lines
            yield int(found[1])
        finally:
            process.terminate()
            assert process.wait(10) == Exit.WITHIN


def at_port(folder: Path, port: int) -> Path:
    """The workstation that ships, with another port."""
    text = (FOLDER / "workstation.toml").read_text(encoding="utf-8")
    file = folder / "workstation.toml"
    file.write_text(text.replace('kind = "rtde"\n', f'kind = "rtde"\nport = {port}\n'), encoding="utf-8")
    return file


def test_the_live_workstation_runs_decided_and_is_reported(tmp_path, capsys):
    with emulator() as port:
        file = at_port(tmp_path, port)
        for attempt in range(ATTEMPTS):
            folder = tmp_path / f"run {attempt}"
            ended = cli.main(["run", str(file), "--port", "0", "--seconds", "1", "-o", str(folder)])
            said = capsys.readouterr().out
            recording = Recording.open(folder / "run.mcap")
            judged = (result for snapshot in recording.snapshots() for result in snapshot.results)
            results = [result for result in judged if result.verdict is not None]
            undecided = [result for result in results if result.verdict != "within"]
            for result in undecided:
                assert result.verdict == "undecided"
                assert any(words in result.reason for words in SLOW), result.reason
            assert ended == (Exit.UNDECIDED if undecided else Exit.WITHIN)
            if len(undecided) < len(results):
                break
    assert len(undecided) < len(results)
    assert "preliminary until it is confirmed on the controller" in said
    assert {type(s).__name__ for tick in recording.ticks() for s in tick.samples} == {
        "JointSample",
        "SignalSample",
    }
    assert cli.main(["report", str(folder / "run.mcap"), "-o", str(tmp_path / "again")]) == ended
    assert "changed" not in capsys.readouterr().out


def test_assess_says_that_it_takes_real_time(tmp_path, capsys):
    with RtdeServer(swing(HOME)) as server:
        file = at_port(tmp_path, server.port)
        assert cli.main(["assess", str(file), "-o", str(tmp_path / "run")]) == Exit.ERROR
    assert "heard in real time only; use seerob run" in capsys.readouterr().err
    assert not (tmp_path / "run").exists()


def test_a_probe_says_what_is_heard_and_what_to_write(tmp_path, capsys):
    with RtdeServer(swing(HOME)) as server:
        probe = [
            "probe",
            "rtde",
            "127.0.0.1",
            "--port",
            str(server.port),
            "--robot",
            "ur10",
            "--seconds",
            "0.5",
        ]
        assert cli.main(probe) == Exit.WITHIN
    said = capsys.readouterr().out
    for text in (
        "controller software 5.12.4.0",
        "does not have actual_current_as_torque",
        "samples at",
        "jitter",
    ):
        assert text in said
    snippet = said[said.index("[[sources]]") :]
    (tmp_path / "workstation.toml").write_text(
        '[[robots]]\nname = "ur10"\nmodel = "library:ur10"\n' + snippet, encoding="utf-8"
    )
    (source,) = load(tmp_path).workstation.sources
    assert (source.host, source.port) == ("127.0.0.1", server.port)


def test_a_probe_of_nobody_is_an_error_with_a_remedy(capsys):
    with RtdeServer(swing(HOME)) as server:
        port = server.port
    assert cli.main(["probe", "rtde", "127.0.0.1", "--port", str(port)]) == Exit.ERROR
    assert "Connection refused; is it switched on" in capsys.readouterr().err
    assert cli.main(["probe", "rtde", "127.0.0.1", "--frequency", "9999"]) == Exit.ERROR
    assert "frequency" in capsys.readouterr().err


def test_a_port_that_is_taken_is_an_error(capsys):
    with RtdeServer(swing(HOME)) as server:
        assert cli.main(["emulate", "rtde", "--port", str(server.port)]) == Exit.ERROR
    assert "Address already in use; choose another" in capsys.readouterr().err


def test_an_emulator_plays_a_file_within_the_limits_of_its_robot(tmp_path):
    motion = read(MOTION, target_of("ur10"))
    q, qd = motion(1.0)
    assert len(q) == len(qd) == 6
    rows = "".join(f"{0.1 * k:.1f},{k}.0,0,0,0,0,0\n" for k in range(20))
    wild = tmp_path / "wild.csv"
    wild.write_text("t [s]," + ",".join(f"J{k} [rad]" for k in range(1, 7)) + "\n" + rows)
    with pytest.raises(InputError, match="beyond"):
        read(wild, target_of("ur10"))


def test_another_robot_than_the_controller_s_is_not_within(tmp_path):
    """It says itself where its tool centre point is: a UR5 that drives the twin of a UR10."""
    with emulator("--robot", "ur5", "--primary-port", "0") as port:
        file = at_port(tmp_path, port)
        folder = tmp_path / "run"
        ended = cli.main(["run", str(file), "--port", "0", "--seconds", "1", "-o", str(folder)])
    assert ended == Exit.UNDECIDED
    snapshots = Recording.open(folder / "run.mcap").snapshots()
    reasons = [result.reason for snapshot in snapshots for result in snapshot.results]
    assert any("its source has its own tool centre point" in reason for reason in reasons)
