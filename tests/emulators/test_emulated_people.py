"""``seerob emulate`` of devices for people: their arguments make a server, mistakes are named."""

import pytest

from seerob.app.commands.emulate import options_of
from seerob.core.errors import InputError

KINDS = {
    "headset": ["--port", "1"],
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


def test_what_hands_take_is_read_in_words_and_mistakes_are_named():
    emulated("headset", "--grabs", "4.5 right_hand blank_1, 8 right_hand")
    for wrong in ("right_hand blank", "soon right_hand blank", "1 right_hand a b"):
        with pytest.raises(InputError, match=r"--grabs: .* SECONDS HAND PIECE"):
            emulated("headset", "--grabs", wrong)
    with pytest.raises(InputError, match="network of their own"):
        emulated("headset", "--drop", "0.1")
