"""The cell with a PLC that ships: real sockets, and the PLC is killed and comes back while it runs."""

from __future__ import annotations

import shutil
from pathlib import Path

from kept_run import Chapters
from seerob import load
from seerob.app.emulators.opcua import Opcua
from seerob.app.emulators.rtde import Rtde
from seerob.outputs.sinks.recorder import Recorder
from seerob.recording.recording import Recording

SHIPPED = Path(__file__).parents[1] / "workstations" / "plc_cell"


def here(folder, robot, plc):
    """The workstation that ships, at other ports."""
    shutil.copytree(SHIPPED, folder)
    file = folder / "workstation.toml"
    text = file.read_text(encoding="utf-8")
    text = text.replace('kind = "rtde"\n', f'kind = "rtde"\nport = {robot}\n')
    text = text.replace("127.0.0.1:4840", f"127.0.0.1:{plc}")
    # A loaded machine may be late by more than what a cell would allow.
    file.write_text(text.replace("timeout = 0.3 ", "timeout = 2.4 "), encoding="utf-8")
    return load(folder)


def known(snapshot):
    results = {r.name: r for r in snapshot.results}
    names = ("robot – operator", "crate speed", "light curtain")
    return all(results[name].verdict != "undecided" for name in names)


def only_the_robot_is_known(snapshot):
    results = {r.name: r for r in snapshot.results}
    silent = ("crate – operator", "crate speed", "door – operator", "light curtain")
    # A busy machine may fall behind just then, which is another reason.
    return results["robot – operator"].verdict == "within" and all(
        results[n].verdict == "undecided" and "not heard" in results[n].reason for n in silent
    )


def nothing():
    pass


def test_the_plc_dies_and_comes_back(tmp_path):
    robot, plc = Rtde(port=0).ready().server, Opcua(port=0).ready().server
    with robot, plc:
        station = here(tmp_path / "cell", robot.port, plc.port)
        assert not [f for f in station.scene().findings if "not reached" in f.text]
        story = Chapters(
            (known, plc.stop),
            (only_the_robot_is_known, plc.start),
            (known, nothing),
        )
        summary = station.run(
            live=True, writers=[story], sinks=[Recorder()], folder=tmp_path / "run", stop=story.stop
        )
    assert "crate: not heard" in story.reasons["crate speed"]
    assert "curtain/clear: plc not heard" in story.reasons["light curtain"]
    recording = Recording.open(tmp_path / "run" / "run.mcap")
    again = load(tmp_path / "cell").run(feed=(tick.samples for tick in recording.ticks()))
    for name, series in summary.results.items():
        assert again.results[name].worst().reason == series.worst().reason
        assert again.results[name].verdict == series.verdict


def test_its_dictionary_is_used_to_the_last_variable():
    station = load(SHIPPED)
    assert not [f for f in station.model.findings if "used by nothing" in f.text or "same variable" in f.text]
    assert {v.source for v in station.model.dictionary.values()} == {"plc"}
