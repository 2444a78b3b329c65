"""Writing to machines: off unless both allow it, edges only, not too often, and never in the loop's way."""

from __future__ import annotations

import asyncio
import time

import pytest
from made_trigger import STATION, said, triggering

from live_story import wait_for
from seerob.app import cli
from seerob.app.console.terminal import Exit
from seerob.app.emulators.siemens_web import SiemensWebServer
from seerob.core.errors import InputError
from seerob.core.snapshot import Verdict
from seerob.protocols import ProtocolError
from seerob.session.writing import Triggers, allowed

SOURCE = 'kind = "siemens_web"\nurl = "URL"\nuser = "twin"\npassword_env = "SEEROB_PLC_PASSWORD"'


@pytest.fixture
def plc(monkeypatch):
    monkeypatch.setenv("SEEROB_PLC_PASSWORD", "secret")
    monkeypatch.setenv("SEEROB_PLC_PASSWORD_HOST", "127.0.0.1")
    with SiemensWebServer({}, user="twin", password="secret", outputs=('"Twin".fast',)) as server:
        yield server


def made(folder, url, *, station=STATION, written="'\"Twin\".fast'"):
    return triggering(folder, SOURCE.replace("URL", url), written, station)


def test_edges_are_written_and_nothing_else(tmp_path, plc):
    written = plc.written['"Twin".fast']
    with Triggers(made(tmp_path, plc.url).model, on_command_line=True) as triggers:
        for _ in range(5):
            triggers.write(said(Verdict.WITHIN), ())
        triggers.write(said(Verdict.UNDECIDED), ())
        triggers.write(said(Verdict.EXCEEDED), ())
        wait_for(lambda: written == [True])
        for _ in range(5):
            triggers.write(said(Verdict.EXCEEDED), ())
        triggers.write(said(Verdict.WITHIN), ())
        wait_for(lambda: written == [True, False])


def test_how_it_is_at_the_start_is_no_edge(tmp_path, plc):
    written = plc.written['"Twin".fast']
    with Triggers(made(tmp_path, plc.url).model, on_command_line=True) as triggers:
        triggers.write(said(Verdict.EXCEEDED), ())
        triggers.write(said(Verdict.WITHIN), ())
        wait_for(lambda: written == [False])


def test_a_flutter_is_written_no_faster_than_allowed(tmp_path, plc):
    station = made(tmp_path, plc.url)
    begun = time.monotonic()
    with Triggers(station.model, on_command_line=True) as triggers:
        for seq in range(300):
            triggers.write(said((Verdict.WITHIN, Verdict.EXCEEDED)[seq % 2]), ())
            time.sleep(0.002)
        wait_for(lambda: plc.written['"Twin".fast'][-1:] == [True])
    assert len(plc.written['"Twin".fast']) <= 1 + (time.monotonic() - begun) / 0.1


def test_what_a_dead_plc_missed_is_written_when_it_is_back(tmp_path, plc, caplog):
    station = made(tmp_path, plc.url)
    plc.stop()
    with Triggers(station.model, on_command_line=True) as triggers:
        triggers.write(said(Verdict.WITHIN), ())
        triggers.write(said(Verdict.EXCEEDED), ())
        wait_for(lambda: "could not be written" in caplog.text)
        plc.start()
        wait_for(lambda: plc.written['"Twin".fast'] == [True])
    assert caplog.text.count("could not be written") == 1


@pytest.mark.parametrize("file", [True, False])
@pytest.mark.parametrize("line", [True, False])
def test_it_takes_the_file_and_the_command_line(tmp_path, file, line, monkeypatch):
    monkeypatch.setenv("SEEROB_PLC_PASSWORD", "secret")
    monkeypatch.setenv("SEEROB_PLC_PASSWORD_HOST", "127.0.0.1")
    text = STATION if file else STATION.replace("allow_writing = true\n", "")
    model = made(tmp_path, "http://127.0.0.1:1", station=text).model
    assert allowed(model, on_command_line=line) is (file and line)
    if not (file and line):
        with pytest.raises(InputError, match="not allowed"):
            Triggers(model, on_command_line=line)


def test_the_command_line_says_what_it_does_not_write(tmp_path, plc, capsys):
    made(tmp_path, plc.url)
    run = ["run", str(tmp_path), "--port", "0", "--seconds", "0.2", "--no-record"]
    assert cli.main(run) == Exit.WITHIN
    assert "writes nothing: twin/fast would need --allow-writing" in capsys.readouterr().out
    assert cli.main([*run, "--allow-writing"]) == Exit.WITHIN
    assert "both allow it" in capsys.readouterr().out
    assert plc.written == {'"Twin".fast': []}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (('"twin/fast"\ncriterion', '"twin/last"\ncriterion'), "no variable 'twin/last' that is a bool"),
        (('criterion = "speed"', 'criterion = "sped"'), "no criterion named 'sped'; did you mean 'speed'"),
        (("every = 0.1", "every = 0"), "every"),
    ],
)
def test_mistakes_are_told(tmp_path, change, message):
    with pytest.raises(InputError, match=message):
        made(tmp_path, "http://127.0.0.1:1", station=STATION.replace(*change))


def test_a_plc_refuses_what_it_does_not_have(tmp_path, plc):
    station = made(tmp_path, plc.url, written="'\"Twain\".fast'")
    (source,) = station.workstation.sources
    variable = station.model.dictionary["twin/fast"]
    with pytest.raises(ProtocolError, match="Address does not exist"):
        asyncio.run(source.write(variable, True, tmp_path))
