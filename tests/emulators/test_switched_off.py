"""An emulator that is switched off leaves no socket open, even while clients connect again and again."""

import contextlib
import gc
import socket
import warnings
from threading import Event, Thread

import pytest

from seerob.app.emulation.motions import swing
from seerob.app.emulators.rosbridge import RosbridgeServer
from seerob.app.emulators.rtde import RtdeServer
from seerob.app.emulators.web import WebServer


def web():
    return WebServer(lambda t: {"speed": 250.0})


def rosbridge():
    return RosbridgeServer(swing((0.0, 0.0)), ("a", "b"))


def rtde():
    return RtdeServer(swing((0.0,) * 6))


@pytest.mark.parametrize("make", [web, rosbridge, rtde])
def test_who_connects_in_its_last_moment_is_cut(make):
    over = Event()

    def connect(port):
        while not over.is_set():
            with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port), timeout=5):
                pass

    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        for _ in range(5):
            over.clear()
            server = make().start()
            client = Thread(target=connect, args=(server.port,))
            client.start()
            server.stop()
            over.set()
            client.join()
        gc.collect()
    assert not [str(w.message) for w in caught if w.category is ResourceWarning]
