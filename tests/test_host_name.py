"""What can be a computer's name or address, and what is a slip of the pen."""

from __future__ import annotations

import socket
from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from seerob.app import cli
from seerob.app.console.terminal import Exit
from seerob.core.host_name import check_host, check_url
from seerob.devices.sources.rtde import Rtde


@pytest.mark.parametrize(
    "host",
    ["192.168.0.10", "::1", "fe80::1%eth0", "localhost", "cell-3.plant.example", "bücher.de", "a_b", "a."],
)
def test_names_and_addresses(host):
    check_host("host", host)
    check_url("url", f"http://{f'[{host}]' if ':' in host else host}:8080/x")


@pytest.mark.parametrize(
    ("host", "why"),
    [
        ("192.168..10", "such as"),
        (".plant", "such as"),
        ("x" * 64, "such as"),
        ("a." * 127, "such as"),
        ("a b", "such as"),
        ("a\n", "such as"),
        ("192.168.0.10:30004", "port = "),
        ("http://192.168.0.10", "alone"),
        ("[::1]", "alone"),
    ],
)
def test_slips_are_told(host, why):
    with pytest.raises(ValueError, match=f"host = .* is no name or address.*{why}"):
        check_host("host", host)


@pytest.mark.parametrize("url", ["http://[::1/x", "opc.tcp://a:99999", "ws://192.168..10/x"])
def test_slips_in_a_url_are_told(url):
    with pytest.raises(ValueError, match="url = "):
        check_url("url", url)


@given(st.text(min_size=1, max_size=300))
def test_what_is_taken_can_be_looked_up(host):
    """Else looking it up fails with an error that is none of the network's."""
    try:
        check_host("host", host)
    except ValueError:
        return
    with suppress(socket.gaierror):
        socket.getaddrinfo(host, 1, flags=socket.AI_NUMERICHOST)


@pytest.mark.parametrize(
    "command",
    [
        ["probe", "rtde", "192.168..10"],
        ["probe", "opcua", "opc.tcp://192.168..10:4840"],
        ["probe", "fri", "127.0.0.1", "--set", "bind=1..2"],
        ["emulate", "rtde", "--host", "127..1"],
        ["emulate", "mvn", "--to", "127..1"],
    ],
)
def test_a_slip_is_one_line_and_no_traceback(capsys, command):
    assert cli.main(command) == Exit.ERROR
    (line,) = capsys.readouterr().err.splitlines()
    assert "is no name or address" in line


def test_sources_check_theirs():
    with pytest.raises(ValueError, match="a port is an option of its own"):
        Rtde(robot="arm", host="192.168.0.10:30004")
