"""A server in a process of its own, which is killed as a device is that loses its power, or held still.

Run as a program it is the warm process out of which the servers are forked, one after the other: what a
server needs is imported once. It does as it is told on its standard input.
"""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Self

import seerob
from free_ports import free_port

HERE = "127.0.0.1"


class Elsewhere:
    """A server of a kind of `SERVERS`; started and stopped as an emulator is.

    Args:
        kind: Which.
    """

    def __init__(self, kind: str) -> None:
        self.port = free_port(socket.SOCK_STREAM)
        places = (Path(seerob.__file__).parents[1], Path(__file__).parents[1])
        self._process = subprocess.Popen(
            [sys.executable, "-m", "soak.elsewhere", kind, str(self.port)],
            env=dict(os.environ, PYTHONPATH=os.pathsep.join(map(str, places))),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def start(self) -> Self:
        """Begin; returns when it can be reached."""
        self._tell("start")
        return self

    def stop(self) -> None:
        """Kill it."""
        self._tell("kill")

    def freeze(self) -> None:
        """Hold it still: its connections stay, and nothing is said."""
        self._tell("freeze")

    def thaw(self) -> None:
        """Let it go on."""
        self._tell("thaw")

    def close(self) -> None:
        """End it for good."""
        self._process.communicate()

    def _tell(self, what: str) -> None:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(f"{what}\n")
        self._process.stdin.flush()
        answer = self._process.stdout.readline()
        assert answer == "done\n", answer


# -- in the other process -----------------------------------------------------------------------


Start = Callable[[], object]
"""Called in the fork: returns when the server can be reached."""


def opcua(port: int) -> Start:
    from seerob.app.emulators.opcua import Emulated, OpcuaServer

    return OpcuaServer({"Belt/position": Emulated(lambda t: t, "mm")}, port=port).prepare().start


def opcua_robot(port: int) -> Start:
    from seerob.app.emulation.motions import swing
    from seerob.app.emulators.opcua import OpcuaServer

    return OpcuaServer(robots={"arm": swing((0.0,) * 6)}, port=port).prepare().start


def opcua_standing(port: int) -> Start:
    from seerob.app.emulators.opcua import OpcuaServer

    return OpcuaServer(robots={"arm": lambda t: ((0.1,) * 6, (0.0,) * 6)}, port=port).prepare().start


def mqtt(port: int) -> Start:
    """Another maker's broker, and a machine that publishes."""
    import asyncio
    import logging

    from amqtt.broker import Broker
    from paho.mqtt.client import CallbackAPIVersion, Client

    logging.disable(logging.CRITICAL)
    config = {
        "listeners": {"default": {"type": "tcp", "bind": f"{HERE}:{port}"}},
        "plugins": {"amqtt.plugins.authentication.AnonymousAuthPlugin": {"allow_anonymous": True}},
    }

    async def serve(up: threading.Event) -> None:
        await Broker(config).start()
        up.set()
        await asyncio.Event().wait()

    def publish() -> None:
        machine = Client(CallbackAPIVersion.VERSION2)
        machine.connect(HERE, port)
        machine.loop_start()
        while True:
            machine.publish("belt", b"250")
            time.sleep(0.02)

    def start() -> None:
        up = threading.Event()
        threading.Thread(target=lambda: asyncio.run(serve(up)), daemon=True).start()
        assert up.wait(60)
        threading.Thread(target=publish, daemon=True).start()

    return start


def foxglove(port: int) -> Start:
    """Foxglove's own, out of its SDK."""
    import foxglove as sdk
    from foxglove.channels import JointStatesChannel
    from foxglove.messages import JointState, JointStates, Timestamp

    def publish() -> None:
        channel = JointStatesChannel("/joint_states")
        while True:
            t = time.monotonic()
            joints = [JointState(name=name, position=0.1, velocity=0.0) for name in "ab"]
            stamp = Timestamp(sec=int(t), nsec=int(t % 1 * 1e9))
            channel.log(JointStates(timestamp=stamp, joints=joints))
            time.sleep(0.01)

    def start() -> None:
        begun = time.monotonic()
        while True:
            try:
                sdk.start_server(host=HERE, port=port)
                break
            except RuntimeError:  # the system still has connections of the one before
                assert time.monotonic() - begun < 90
                time.sleep(0.02)
        threading.Thread(target=publish, daemon=True).start()

    return start


JOINT_STATE = """std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
JOINT_STATE_HASH = "RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e"
"""As nodes of ROS 2 say it of sensor_msgs/msg/JointState."""


def zenoh(port: int) -> Start:
    """A router of Zenoh's own library, and a node of ROBOTIS' SDK that publishes over it."""
    import numpy as np
    import zenoh as library
    from zenoh_ros2_sdk import ROS2Publisher

    def publish() -> None:
        node = ROS2Publisher(
            "/joint_states",
            "sensor_msgs/msg/JointState",
            msg_definition=JOINT_STATE,
            type_hash=JOINT_STATE_HASH,
            router_ip=HERE,
            router_port=port,
        )
        types = node.session_mgr.store.types
        while True:
            t = time.monotonic()
            stamp = types["builtin_interfaces/msg/Time"](sec=int(t), nanosec=int(t % 1 * 1e9))
            node.publish(
                header=types["std_msgs/msg/Header"](stamp=stamp, frame_id=""),
                name=["a", "b"],
                position=np.array([0.1, 0.1]),
                velocity=np.array([0.0, 0.0]),
                effort=np.array([]),
            )
            time.sleep(0.01)

    def start() -> None:
        config = library.Config()
        config.insert_json5("mode", '"router"')
        config.insert_json5("scouting/multicast/enabled", "false")
        config.insert_json5("listen/endpoints", f'["tcp/{HERE}:{port}"]')
        kept.append(library.open(config))
        threading.Thread(target=publish, daemon=True).start()

    kept: list[object] = []
    return start


SERVERS = {make.__name__: make for make in (opcua, opcua_robot, opcua_standing, mqtt, foxglove, zenoh)}
"""Each imports and builds what its server needs, once, and returns what starts it in a fork."""


def forked(start: Start, kind: str) -> int:
    """A process in which the server runs; returns its number once it can be reached."""
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reading)
        start()
        os.write(writing, b"1")
        os.close(writing)
        signal.pause()
        os._exit(0)
    os.close(writing)
    said = os.read(reading, 1)
    os.close(reading)
    assert said == b"1", f"the server of {kind} did not start"
    return child


def main(kind: str, port: int) -> None:
    """Do as told, until there is no one to tell."""
    start, child = SERVERS[kind](port), 0
    try:
        for line in sys.stdin:
            match line.strip():
                case "start":
                    child = forked(start, kind)
                case "kill":
                    os.kill(child, signal.SIGKILL)
                    os.waitpid(child, 0)
                    child = 0
                case "freeze":
                    os.kill(child, signal.SIGSTOP)
                case "thaw":
                    os.kill(child, signal.SIGCONT)
            sys.stdout.write("done\n")
            sys.stdout.flush()
    finally:
        if child:
            os.kill(child, signal.SIGKILL)


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
