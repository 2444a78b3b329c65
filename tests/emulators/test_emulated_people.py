"""``seerob emulate`` of devices for people: their arguments make a server, mistakes are named."""

import argparse
from importlib import import_module

import pytest

from seerob.core.errors import InputError

KINDS = {
    "natnet": ["--port", "0", "--version", "3.1"],
    "rokoko": ["--port", "1", "--lz4", "--version", "2"],
    "vive": ["--port", "0", "--websocket", "--all"],
    "vrpn": ["--port", "0"],
}


def emulated(kind, *more):
    module = import_module(f"seerob.app.emulating.{kind}")
    parser = argparse.ArgumentParser()
    parser.add_argument("--host", default="127.0.0.1")
    module.add(parser)
    return module.emulated(parser.parse_args([*KINDS[kind], *more]))


@pytest.mark.parametrize("kind", KINDS)
def test_it_starts_stops_and_starts_again(kind):
    made = emulated(kind)
    for _ in range(2):
        made.server.start()
        with pytest.raises(RuntimeError, match="already started"):
            made.server.start()
        made.server.stop()
    assert "library:reach" in made.what
    assert made.where.startswith("127.0.0.1:")


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("rate", ["0", "nan", "5000"])
def test_a_rate_that_the_device_does_not_have_is_refused(kind, rate):
    with pytest.raises(InputError, match="it does 1 to"):
        emulated(kind, "--rate", rate)


@pytest.mark.parametrize("kind", KINDS)
def test_a_motion_that_is_not_there_is_named(kind):
    with pytest.raises(InputError, match=r"nothing_there\.toml"):
        emulated(kind, "--file", "nothing_there.toml")
