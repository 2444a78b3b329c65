"""How regularly a device says its variables, as ``seerob probe`` prints it before there is a dictionary."""

import re

import httpx  # noqa: F401 - what is imported late would count as silence

from seerob.app.commands.probe import tell_heard
from seerob.app.emulators.web import WebServer
from seerob.devices.sources.web import Web
from seerob.devices.variables.live_source import Node


def test_the_rate_and_what_is_missing_are_said(capsys):
    with WebServer(lambda t: {"speed": t}) as server:
        source = Web(name="plc", url=server.url + "/state", every=0.05)
        tell_heard(source, [Node("/speed", "", "", ""), Node("/gone", "", "", "")], 1.0)
    said = " ".join(capsys.readouterr().out.split())
    (rate,) = re.findall(r"heard \d+ samples at ([\d.]+)/s", said)
    # It is asked twenty times a second; a busy machine answers less often.
    assert 1 < float(rate) < 21
    assert "2 of 2 variables" in said
    assert "/gone: the document has no 'gone'" in said
    assert "/speed:" not in said
