"""Every kind of live source beside a device that can be stopped and started again, on this machine."""

from __future__ import annotations

import json
import socket
import time
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np

from free_ports import free_port
from seerob.app.emulation.background import Emulator
from seerob.app.emulation.message_sender import MessageSender
from seerob.app.emulation.motions import swing
from seerob.core.page_messages import Tracking
from seerob.devices.live.headset_offers import Offers, read
from seerob.devices.live.listening import LiveSource
from seerob.workstation.source import Target
from seerob.workstation.variables import Variable
from soak.elsewhere import Elsewhere

SILENCE = 0.2
"""After which a sender of datagrams counts as gone here [s]: an hour less for a thousand of them."""
SIX, SEVEN = (0.0, -1.2, 1.4, -1.5, -1.5, 0.0), (0.0, 0.5, 0.0, -1.4, 0.0, 1.2, 0.0)
HERE = "127.0.0.1"


class Made(NamedTuple):
    """A device, and who listens to it."""

    server: Emulator | Elsewhere
    source: LiveSource
    target: Target | None = None


def target(name, address, unit="mm/s", **more):
    """What a source of variables is asked for."""
    return Target(variables=(Variable(name=name, source="plc", address=address, unit=unit, **more),))


def person():
    from seerob.app.emulation.mvn_person import animated, measured

    return measured(animated("library:reach"), 2e-4)


# -- controllers --------------------------------------------------------------------------------


def rtde(_):
    from seerob.app.emulators.rtde import RtdeServer
    from seerob.devices.sources.rtde import Rtde

    server = RtdeServer(swing(SIX)).start()
    return Made(server, Rtde(robot="arm", host=HERE, port=server.port))


def fri(patch):
    from seerob.app.emulators.fri import FriServer
    from seerob.devices.sources.fri import Fri

    patch.setattr("seerob.devices.sources.fri.SILENCE", SILENCE)
    port = free_port()
    return Made(FriServer(swing(SEVEN), to=(HERE, port)).start(), Fri(robot="arm", host=HERE, port=port))


def egm(patch):
    from seerob.app.emulators.egm import EgmServer
    from seerob.devices.sources.egm import Egm

    patch.setattr("seerob.devices.sources.egm.SILENCE", SILENCE)
    port = free_port()
    return Made(EgmServer(swing(SIX), to=(HERE, port)).start(), Egm(robot="arm", host=HERE, port=port))


def drfl(patch):
    from seerob.app.emulators.drfl import DrflSender
    from seerob.devices.sources.drfl import Drfl

    patch.setattr("seerob.devices.sources.drfl.SILENCE", SILENCE)
    port = free_port()
    return Made(DrflSender(swing(SIX), to=(HERE, port)).start(), Drfl(robot="arm", port=port))


def dobot(_):
    from seerob.app.emulators.dobot import DobotServer
    from seerob.devices.sources.dobot import Dobot

    server = DobotServer(swing(SIX)).start()
    return Made(server, Dobot(robot="arm", host=HERE, port=server.port))


def modbus_robot(_):
    from seerob.app.emulators.modbus import ModbusServer, program
    from seerob.devices.sources.modbus_robot import ModbusRobot
    from seerob.protocols.plc.modbus import load

    played = program(load("doosan", Path()), swing(SIX), {"robot_state": "moving", "servo_on": True})
    server = ModbusServer(played).start()
    return Made(server, ModbusRobot(robot="arm", host=HERE, port=server.port, every=0.02))


def opcua_robot(_):
    from seerob.devices.sources.opcua_robot import OpcuaRobot

    server = Elsewhere("opcua_robot").start()
    return Made(server, OpcuaRobot(robot="arm", url=f"opc.tcp://{HERE}:{server.port}"))


# -- ROS ----------------------------------------------------------------------------------------


def rosbridge(_):
    from seerob.app.emulators.rosbridge import RosbridgeServer
    from seerob.devices.sources.rosbridge import Rosbridge

    server = RosbridgeServer(swing((0.0, 0.0)), ("a", "b"), rate=250.0).start()
    return Made(server, Rosbridge(robot="arm", host=HERE, port=server.port))


def ros_tcp(_):
    from seerob.app.emulators.ros_tcp import RosTcpEndpoint
    from seerob.devices.sources.ros_tcp import RosTcp

    server = RosTcpEndpoint(swing((0.0, 0.0)), ("a", "b"), rate=250.0).start()
    return Made(server, RosTcp(robot="arm", host=HERE, port=server.port))


def ros_tcp_endpoint(patch):
    """The other side of it: Unity connects."""
    from seerob.app.emulators.ros_tcp import UnityProject
    from seerob.devices.sources.ros_tcp import RosTcp, Side

    patch.setattr("seerob.devices.ros.SILENCE", SILENCE)
    port = free_port(socket.SOCK_STREAM)
    server = UnityProject(swing((0.0, 0.0)), ("a", "b"), port=port, rate=250.0).start()
    return Made(server, RosTcp(robot="arm", side=Side.ENDPOINT, port=port))


def foxglove(_):
    from seerob.devices.sources.foxglove import Foxglove

    server = Elsewhere("foxglove").start()
    return Made(server, Foxglove(robot="arm", host=HERE, port=server.port))


def zenoh(_):
    from seerob.devices.sources.zenoh import Zenoh

    server = Elsewhere("zenoh").start()
    return Made(server, Zenoh(robot="arm", host=HERE, port=server.port))


# -- machines -----------------------------------------------------------------------------------


def modbus(_):
    from seerob.app.emulators.modbus import ModbusServer
    from seerob.devices.sources.modbus import Modbus
    from seerob.protocols.plc.modbus import Place, Table, Type

    place = {"table": "holding", "at": 128, "type": "i16"}
    server = ModbusServer({Place(table=Table.HOLDING, at=128, type=Type.I16): lambda t: 250.0}).start()
    source = Modbus(name="plc", host=HERE, port=server.port, every=0.02)
    return Made(server, source, target("speed", place))


def siemens_web(patch):
    from seerob.app.emulators.siemens_web import SiemensWebServer
    from seerob.devices.sources.siemens_web import SiemensWeb

    patch.setenv("SEEROB_PLC_PASSWORD", "secret")
    patch.setenv("SEEROB_PLC_PASSWORD_HOST", "127.0.0.1")
    server = SiemensWebServer({"speed": lambda t: 250.0}, user="twin", password="secret").start()
    options = {"user": "twin", "password_env": "SEEROB_PLC_PASSWORD", "every": 0.02}
    return Made(server, SiemensWeb(name="plc", url=server.url, **options), target("speed", "speed"))


def web(_):
    from seerob.app.emulators.web import WebServer
    from seerob.devices.sources.web import Web

    server = WebServer(lambda t: {"speed": 250.0}).start()
    return Made(server, Web(name="plc", url=server.live, timeout=1.0), target("speed", "/speed"))


def web_http(_):
    """The other way: asked again and again."""
    from seerob.app.emulators.web import STATE, WebServer
    from seerob.devices.sources.web import Web

    server = WebServer(lambda t: {"speed": 250.0}).start()
    return Made(server, Web(name="plc", url=server.url + STATE, every=0.02), target("speed", "/speed"))


def opcua(_):
    from seerob.app.emulators.opcua import URI
    from seerob.devices.sources.opcua import Opcua

    server = Elsewhere("opcua").start()
    source = Opcua(name="plc", url=f"opc.tcp://{HERE}:{server.port}")
    return Made(server, source, target("position", f"nsu={URI};s=Belt/position", "mm"))


def mqtt(_):
    from seerob.devices.sources.mqtt import Mqtt

    server = Elsewhere("mqtt").start()
    return Made(server, Mqtt(name="plc", host=HERE, port=server.port), target("speed", "belt"))


# -- people -------------------------------------------------------------------------------------


def natnet(patch):
    from seerob.app.emulators.natnet import NatnetServer
    from seerob.devices.sources.natnet import Natnet, Transmission

    patch.setattr("seerob.protocols.tracking.natnet.SILENCE", SILENCE)
    patch.setattr("seerob.protocols.tracking.natnet.ASK_AGAIN", 0.02)
    server = NatnetServer({"Anna": person()}, port=free_port()).start()
    options = {"human": "anna", "timeout": 1.0, "transmission": Transmission.UNICAST}
    return Made(server, Natnet(host=HERE, port=server.port, **options))


def vrpn(patch):
    from seerob.app.emulators.vive import FIVE, WORN
    from seerob.app.emulators.vrpn import VrpnServer
    from seerob.devices.sources.vrpn import Vrpn

    patch.setattr("seerob.devices.sources.vrpn.GATHER", 0.02)
    server = VrpnServer(person(), {role: WORN[role] for role in FIVE}, port=0).start()
    return Made(server, Vrpn(host=HERE, port=server.port, human="anna", timeout=1.0))


def mvn(patch):
    from seerob.app.emulators.mvn import MvnSender
    from seerob.devices.sources.mvn import Mvn

    patch.setattr("seerob.devices.sources.mvn.SILENCE", SILENCE)
    port = free_port()
    return Made(MvnSender({0: person()}, to=(HERE, port)).start(), Mvn(human="anna", port=port, timeout=1.0))


def rokoko(patch):
    from seerob.app.emulators.rokoko import RokokoSender
    from seerob.devices.sources.rokoko import Rokoko

    patch.setattr("seerob.devices.sources.rokoko.SILENCE", SILENCE)
    port = free_port()
    server = RokokoSender({"Anna": person()}, to=(HERE, port)).start()
    return Made(server, Rokoko(human="anna", bind=HERE, port=port, timeout=1.0))


def vive(patch):
    from seerob.app.emulators.vive import ViveSender, worn
    from seerob.devices.sources.vive import Link, Vive

    patch.setattr("seerob.devices.sources.vive.GATHER", 0.02)
    server = ViveSender(worn(person()), to=None, port=0).start()
    return Made(server, Vive(human="anna", link=Link.WEBSOCKET, host=HERE, port=server.port, timeout=1.0))


def kinect(_):
    from seerob.app.emulators.kinect import KinectSender, animated, measured
    from seerob.devices.sources.kinect import Kinect, Link

    server = KinectSender(measured(animated("library:reach"), 2e-4), to=None, port=0, rate=60.0).start()
    return Made(server, Kinect(human="anna", link=Link.WEBSOCKET, host=HERE, port=server.port, timeout=1.0))


class PoseLandmarker(MessageSender):
    """A program that runs MediaPipe on a camera, as `examples/clients/mediapipe_camera.py` does."""

    def message(self, k):
        """The result number ``k``."""
        from sources.test_mediapipe import bent, landmarks, said

        return json.dumps(said(landmarks(bent()) + 1e-5 * (k % 5), self.t(k))).encode()


def mediapipe(patch):
    from seerob.devices.sources.mediapipe import Mediapipe
    from seerob.workstation.workstation import Pose

    patch.setattr("seerob.devices.sources.mediapipe.SILENCE", SILENCE)
    port, at = free_port(), Pose(position=(0.0, 0.0, 1.0))
    source = Mediapipe(human="anna", port=port, at=at, timeout=1.0)
    return Made(PoseLandmarker(to=(HERE, port), rate=60.0).start(), source)


class Page(Emulator):
    """The page that a headset shows: offers what it sees, seventy times a second, until it is closed.

    Args:
        worn: Of whoever wears it.
    """

    def __init__(self, worn):
        super().__init__()
        self._worn, self.offers = worn, Offers()

    def begin(self):
        """Offer."""
        return self._offer

    def _offer(self):
        begun = time.monotonic()
        names = ("viewer", "left-grip", "right-grip")
        while not self._over.wait(1 / 72):
            now = time.monotonic()
            places = self._worn(now - begun).positions[:3]
            poses = np.hstack([places, np.tile([1, 0, 0, 0], (3, 1))]).astype("<f4").tobytes()
            said = Tracking(human="anna", t=0.0, names=names, poses=poses)
            self.offers.offer("anna", self, read(msgspec.structs.replace(said, t=now), now))
        self.offers.gone(self)


def headset(patch):
    from seerob.devices.sources.headset import Headset

    patch.setattr("seerob.devices.sources.headset.SILENCE", SILENCE)
    patch.setattr("seerob.devices.sources.headset.GATHER", 0.02)
    page = Page(person()).start()
    return Made(page, Headset(human="anna", timeout=1.0).taking(page.offers))


FOREIGN = (opcua, opcua_robot, mqtt, foxglove, zenoh)
"""Their servers are processes of their own, which are killed with SIGKILL."""
OWN = (
    *(rtde, fri, egm, drfl, dobot, modbus_robot, rosbridge, ros_tcp, ros_tcp_endpoint),
    *(modbus, siemens_web, web, web_http),
    *(natnet, vrpn, mvn, rokoko, vive, kinect, mediapipe, headset),
)
KINDS = {make.__name__: make for make in (*OWN, *FOREIGN)}
