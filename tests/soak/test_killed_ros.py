"""Servers of ROS that are killed and restarted: always heard again, and nothing is left behind."""

from __future__ import annotations

import os
import sys
import threading

import pytest

from live_story import open_files, wait_for
from seerob.emulators.motions import swing
from seerob.emulators.ros_tcp import RosTcpEndpoint
from seerob.emulators.rosbridge import RosbridgeServer
from seerob.live import Listener
from seerob.sources.ros_tcp import RosTcp
from seerob.sources.rosbridge import Rosbridge

LONG = int(os.environ.get("SEEROB_SOAK_KILLS", "1000"))
COUNTS = [pytest.param(5, id="short"), pytest.param(LONG, id="long", marks=pytest.mark.soak)]
KINDS = {"rosbridge": (RosbridgeServer, Rosbridge), "ros_tcp": (RosTcpEndpoint, RosTcp)}


@pytest.mark.skipif(sys.platform != "linux", reason="counts open files in /proc")
@pytest.mark.parametrize("kills", COUNTS)
@pytest.mark.parametrize("kind", KINDS)
def test_every_kill_of_a_ros_server_is_survived(monkeypatch, kind, kills):
    monkeypatch.setattr("seerob.live.FIRST_PAUSE", 0.002)
    monkeypatch.setattr("seerob.live.LONGEST_PAUSE", 0.02)
    emulator, source = KINDS[kind]
    server = emulator(swing((0.0, 0.0)), ("a", "b"), rate=250.0).start()
    count = [0]

    def hear(_):
        count[0] += 1

    files, threads = open_files(), threading.active_count()
    listener = Listener(source(robot="arm", host="127.0.0.1", port=server.port), None, hear)
    listener.start()
    try:
        for _ in range(kills):
            heard = count[0]
            wait_for(lambda heard=heard: count[0] > heard + 2, 30.0)
            server.stop()
            server.start()
    finally:
        listener.ask_to_stop()
        assert listener.join(10.0)
    assert listener.statistics().losses >= kills - 1
    wait_for(lambda: threading.active_count() <= threads and open_files() <= files + 1, 30.0)
    server.stop()
