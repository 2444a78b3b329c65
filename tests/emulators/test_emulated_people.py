"""``seerob emulate`` of devices for people: their arguments make a server, mistakes are named."""

import pytest

from seerob.app.commands.emulate import options_of
from seerob.core.errors import InputError

KINDS = {
    "natnet": ["--port", "0", "--version", "3.1"],
    "rokoko": ["--port", "1", "--lz4", "--version", "2"],
    "vive": ["--port", "0", "--websocket", "--trackers", "all"],
    "vrpn": ["--port", "0"],
}


def emulated(kind, *more):
    return options_of(kind, [*KINDS[kind], *more]).ready()


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
    with pytest.raises(InputError, match=r"--rate: .* (a number (>=|<=)|a finite number)"):
        emulated(kind, "--rate", rate)


@pytest.mark.parametrize("kind", KINDS)
def test_a_motion_that_is_not_there_is_named(kind):
    with pytest.raises(InputError, match=r"nothing_there\.toml"):
        emulated(kind, "--file", "nothing_there.toml")
