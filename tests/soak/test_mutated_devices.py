"""Any bytes may come from a capture device: they are understood, or refused; nothing else happens."""

from functools import cache

import msgspec
import numpy as np
import pytest

from seerob.app.emulation.mvn_person import animated
from seerob.app.emulators import natnet as natnet_datagrams
from seerob.app.emulators.natnet import NatnetServer
from seerob.app.emulators.rokoko import RokokoSender
from seerob.app.emulators.vive import FIVE, WORN, worn
from seerob.app.emulators.vrpn import VrpnServer
from seerob.app.server.hub import read_message
from seerob.core.snapshot import Tracking
from seerob.devices.live import headset_offers
from seerob.protocols import ProtocolError
from seerob.protocols.tracking import natnet, rokoko, vive, vrpn
from soak.mutations import refusals

COUNTS = [pytest.param(1500, id="short"), pytest.param(100_000, id="long", marks=pytest.mark.soak)]


@cache
def person():
    return animated("library:reach")


def a_frame(version):
    made = NatnetServer({"A": person()}, worn={"waist": (person(), "Pelvis")}, version=version)
    return natnet_datagrams.frame(made.frame(3), version)


def a_model(version):
    made = NatnetServer({"A": person()}, worn={"waist": (person(), "Pelvis")}, version=version)
    return natnet_datagrams.models(made.models(), version)


def a_vrpn_stream():
    made = VrpnServer(person(), {role: WORN[role] for role in FIVE})
    return made.names() + made.instant(0.1)


def read_vrpn(data):
    reader = vrpn.Reader()
    for message in vrpn.Splitter().feed(data):
        pose = reader.take(message)
        assert pose is None or pose.position.shape == (3,)


def an_offer():
    poses = np.zeros((3, 7), "<f4").tobytes()
    said = Tracking(human="anna", t=1.0, names=("viewer", "left-grip", "right-grip"), poses=poses)
    return msgspec.msgpack.encode(said)


def read_offer(data):
    message = read_message(data)
    if isinstance(message, Tracking):
        assert headset_offers.read(message, 0.0).positions.shape == (len(message.names), 3)


DECODERS = {
    **{
        f"natnet {v[0]}.{v[1]}": (lambda v=v: a_frame(v), lambda data, v=v: natnet.frame(data, v))
        for v in ((2, 6), (3, 1), (4, 1))
    },
    **{
        f"models {v[0]}.{v[1]}": (lambda v=v: a_model(v), lambda data, v=v: natnet.models(data, v))
        for v in ((3, 1), (4, 1))
    },
    "server info": (
        lambda: natnet_datagrams.server_info("M", (4, 1), port=1511, group="239.0.0.1"),
        natnet.server_info,
    ),
    "vrpn": (a_vrpn_stream, read_vrpn),
    "rokoko": (lambda: RokokoSender({"A": person()}).message(0), rokoko.decode),
    "rokoko lz4": (lambda: RokokoSender({"A": person()}, compressed=True).message(0), rokoko.decode),
    "vive": (lambda: vive.encode(worn(person())(0.0)), vive.decode),
    "headset": (an_offer, read_offer),
}


@pytest.mark.parametrize("count", COUNTS)
@pytest.mark.parametrize("kind", DECODERS)
def test_mutated_datagrams_are_read_or_refused(kind, count):
    make, read = DECODERS[kind]
    refusal = ValueError if kind == "headset" else ProtocolError
    assert refusals(read, make(), seed=11, count=count, refusal=refusal) > 0
