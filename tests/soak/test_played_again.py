"""The last two seconds of a real stream in a loop, alone or among what is live: nothing of it is relied on.

What is played again has time stamps that were heard before; a sample without a doubt has one that is new.
"""

from __future__ import annotations

import time

import pytest

from free_ports import free_port
from live_story import listening, wait_for
from relay import HERE, LOOP, Datagrams, Garbled, Stream
from seerob.app.emulation.motions import swing
from seerob.app.emulation.mvn_person import animated
from seerob.app.emulators.kinect import KinectSender
from seerob.app.emulators.kinect import animated as seen
from seerob.app.emulators.mvn import MvnSender
from seerob.app.emulators.rokoko import RokokoSender
from seerob.app.emulators.rtde import RtdeServer
from seerob.core.samples import SignalSample
from seerob.devices.sources.kinect import Kinect
from seerob.devices.sources.mvn import Mvn
from seerob.devices.sources.rokoko import Rokoko
from seerob.devices.sources.rtde import Rtde
from seerob.workstation.workstation import Pose

SOME = 60
"""Samples before anything is wrong."""


def rtde():
    server = RtdeServer(swing((0.0, -1.2, 1.4, -1.5, -1.5, 0.0)))
    server.start()
    wire = Stream(server.port)
    return server, wire, Rtde(robot="arm", host=HERE, port=wire.port, frequency=60)


def kinect():
    port = free_port()
    wire = Datagrams(port)
    server = KinectSender(seen("library:reach"), to=(HERE, wire.port), rate=60.0).start()
    at = Pose(position=(3.0, 0.0, 1.2))
    return server, wire, Kinect(human="anna", bind=HERE, port=port, frequency=60, timeout=1.0, at=at)


def mvn():
    port = free_port()
    wire = Datagrams(port)
    server = MvnSender({0: animated("library:reach")}, to=(HERE, wire.port)).start()
    return server, wire, Mvn(human="anna", port=port, timeout=1.0)


def rokoko():
    port = free_port()
    wire = Datagrams(port)
    server = RokokoSender({"Anna": animated("library:reach")}, to=(HERE, wire.port)).start()
    return server, wire, Rokoko(human="anna", bind=HERE, port=port, timeout=1.0)


def undoubted(heard):
    """Device times and arrivals of what is relied on."""
    return [(s.t_device, s.t) for s in list(heard) if not isinstance(s, SignalSample) and not s.reason]


@pytest.mark.soak
@pytest.mark.parametrize("how", [Garbled.AGAIN, Garbled.AMONG])
@pytest.mark.parametrize("made", [rtde, kinect, mvn, rokoko])
def test_what_is_played_again_is_not_relied_on(made, how):
    server, wire, source = made()
    try:
        with listening(source) as heard:
            wait_for(lambda: wire.passed > LOOP and len(undoubted(heard)) > SOME)
            before = len(undoubted(heard))
            wire.how = how
            time.sleep(6.0)
    finally:
        server.stop()
        wire.close()
    told = undoubted(heard)
    newest = -1.0
    for device, _ in told:
        assert device > newest
        newest = device
    # The first ones show how late the very first was.
    offsets = [t - device for device, t in told[10:]]
    assert max(offsets) - min(offsets) < 0.05
    if how is Garbled.AGAIN:
        assert len(told) < before + 30
