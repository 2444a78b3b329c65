"""What ``seerob emulate`` says to type and ``seerob probe`` to paste is what they read themselves."""

from __future__ import annotations

import argparse
import re
import shlex
import tomllib

import pytest

from seerob.app.commands import emulate, probe
from seerob.app.emulation.serving import probes_of
from seerob.core.plugin import kinds, load
from seerob.devices.live.listening import LiveSource
from seerob.devices.sources.fri import Fri
from seerob.devices.sources.kinect import Kinect
from seerob.devices.sources.rtde import Rtde
from seerob.workstation.source import Source

KINDS = [kind for kind in kinds(emulate.PACKAGE) if kind not in ("headset", "camera")]
"""All but what comes to the page of a run and what that shows, which no probe hears."""


def words(module, line):
    parser = argparse.ArgumentParser()
    module.add(parser)
    return parser.parse_args(shlex.split(line))


@pytest.mark.parametrize("port", [None, 23456])
@pytest.mark.parametrize("kind", KINDS)
def test_what_hears_an_emulated_device_is_understood_and_goes_where_it_is(kind, port):
    asked = emulate.options_of(kind, [] if port is None else ["--port", str(port)])
    made = asked.ready()
    to = getattr(made.server, "to", None)
    host, port = to or (asked.host, asked.port)
    commands = probes_of(kind, host, port, sends=bool(to), commands=made.commands)
    assert commands
    for command in commands:
        *environment, line = command.partition("seerob probe ")[::2]
        assert environment in ([""], ["SEEROB_PLC_PASSWORD=seerob SEEROB_PLC_PASSWORD_HOST=127.0.0.1 "])
        source, _ = probe._source(words(probe, line))
        where = getattr(source, "url", None) or f"{getattr(source, 'host', host) or host}:{source.port}"
        assert f"127.0.0.1:{port}" in where


def test_senders_to_another_machine_are_heard_there():
    (command,) = probes_of("mvn", "192.168.0.4", 9763, sends=True, commands=())
    assert command == "seerob probe mvn --set bind=192.168.0.4"
    (command,) = probes_of("rtde", "0.0.0.0", 30004, sends=False, commands=())
    assert command == "seerob probe rtde 127.0.0.1"


def test_a_snippet_is_read_as_it_was_given():
    given = {
        "host": 'a"b\\c\n',
        "tls": True,
        "frequency": 100,
        "timeout": 0.5,
        "at": {"position": [1.0, 2, -3e-9], "rpy_deg": [0, 0, 90]},
        "mapping": {"a b": "", "ä": "pelvis"},
    }
    (source,) = tomllib.loads(probe._snippet("mvn", given))["sources"]
    assert source == {"kind": "mvn"} | given


@pytest.mark.parametrize(
    ("given", "heard", "rate"),
    [
        ({}, 100.2, 100),
        ({}, 190.0, None),
        ({}, None, None),
        ({"frequency": 500}, 100.0, None),
        ({}, 9.0, None),  # no session has so long a period
        ({"timeout": 0.1}, 10.0, None),  # the twin would be behind by more than the time-out
    ],
)
def test_the_rate_that_is_heard_is_in_the_snippet(given, heard, rate):
    source = Fri(robot="arm", host="127.0.0.1", timeout=given.get("timeout", 0.2))
    said = {"robot": "arm", "host": "127.0.0.1"} | given
    assert probe.heard_rate(source, said, heard) == rate
    assert probe.heard_rate(Rtde(robot="arm", host="a"), said | {"frequency": 125}, 10.0) is None


def test_what_no_device_can_say_is_shown_as_an_option_to_fill_in():
    for kind in kinds("sources"):
        source = load("sources", kind, Source)
        if issubclass(source, LiveSource) and source.asks:
            mark, option, *_ = source.asks.split()
            assert (mark, option in source.__struct_fields__) == ("#", True)
    numbers = {"x": "1", "y": "2", "z": "3", "roll": "0", "pitch": "12", "yaw": "90"}
    line = re.sub(
        "|".join(rf"\b{n}\b" for n in numbers), lambda m: numbers[m[0]], Kinect.asks.removeprefix("# ")
    )
    given = tomllib.loads(line)["at"]
    assert given == {"position": [1, 2, 3], "rpy_deg": [0, 12, 90]}
