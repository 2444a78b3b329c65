"""A rosbridge server with the joint states of one robot, as the server of ROS 1 or of ROS 2 has them.

It speaks for a robot that does what a motion says or, with a `Follower`, goes where clients say by poses.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import math
import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Annotated, Any

from seerob.app.emulation.follower import Follower
from seerob.app.emulation.motions import Motion
from seerob.app.emulation.options import CALM, Ready, option, port
from seerob.app.emulation.ros_robot import LATE, RosOptions, RosRobot
from seerob.core.extras import need
from seerob.files.waypoints.arm import Arm
from seerob.protocols.links.tcp_server import stop_accepting
from seerob.protocols.ros.ros_messages import Edition, Joints, Plan, RosMessage, Transform, encode, ros1_name
from seerob.protocols.ros.rosbridge import MAX_MESSAGE, Compression

if TYPE_CHECKING:
    from websockets.asyncio.server import ServerConnection

    from seerob.workstation.source import Target

_log = logging.getLogger(__name__)

TF_STATIC = "/tf_static"


class RosbridgeServer(RosRobot):
    """The server, in a thread of its own; that of ROS 1 fails at ``cbor`` without a word."""

    def __init__(self, motion: Motion, names: tuple[str, ...], **more: Any) -> None:
        """Take the arguments of `RosRobot`."""
        super().__init__(motion, names, **more)
        self._follower = motion if isinstance(motion, Follower) else None
        self.received: deque[dict[str, Any]] = deque(maxlen=1000)
        """What clients advertised and published, oldest first."""

    async def serve(self, ready: Callable[[], None], over: asyncio.Event) -> None:
        """Listen, and serve whoever connects."""
        from websockets.asyncio.server import serve

        server = await serve(
            self._welcome, self.host, self.port, compression=None, max_size=MAX_MESSAGE, close_timeout=0.1
        )
        self.port = next(iter(server.sockets)).getsockname()[1]
        self._begun = time.monotonic()
        ready()
        await over.wait()
        await stop_accepting(server.server)
        server.close()
        await server.wait_closed()

    async def _welcome(self, connection: ServerConnection) -> None:
        from websockets.exceptions import ConnectionClosed

        sending: dict[str, asyncio.Task[None]] = {}
        try:
            async for data in connection:
                try:
                    asked = json.loads(data)
                    op, topic = asked["op"], str(asked.get("topic", ""))
                except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
                    await connection.send(_status("error", "no operation of rosbridge"))
                    continue
                if op == "subscribe":
                    _end(sending.pop(topic, None))
                    if refusal := self._refusal(topic, str(asked.get("type", ""))):
                        await connection.send(_status("error", refusal))
                        continue
                    sending[topic] = asyncio.create_task(self._publish(connection, topic, asked))
                elif op == "unsubscribe":
                    _end(sending.pop(topic, None))
                elif op in ("advertise", "publish", "unadvertise"):
                    self.received.append(asked)
                    if op == "publish" and self._follower is not None and topic == self._follower.topic:
                        self._follower.hear(asked.get("msg"))
                elif op == "call_service":
                    await connection.send(self._answer(asked))
        except ConnectionClosed:
            pass
        finally:
            for task in sending.values():
                task.cancel()

    def _refusal(self, topic: str, type_name: str) -> str:
        if topic not in self.topics:
            return f"Cannot infer topic type for topic {topic} as it is not yet advertised"
        own = self._type(topic)
        if type_name and ros1_name(type_name) != ros1_name(own):
            return f"Tried to register topic {topic} with type {type_name} but it is already {own}"
        return ""

    def _type(self, topic: str) -> str:
        name = self.topics[topic][0].message_type
        return ros1_name(name) if self.edition is Edition.ROS1 else name

    def _answer(self, asked: dict[str, object]) -> str:
        service = str(asked.get("service", ""))
        values: dict[str, object] = {}
        if service == "/rosapi/topics":
            values = {"topics": list(self.topics), "types": [self._type(t) for t in self.topics]}
        known = bool(values)
        return json.dumps(
            {
                "op": "service_response",
                "id": asked.get("id", ""),
                "service": service,
                "values": values if known else f"Service {service} does not exist",
                "result": known,
            }
        )

    async def _publish(self, connection: ServerConnection, topic: str, asked: dict[str, object]) -> None:
        from websockets.exceptions import ConnectionClosed

        compression = str(asked.get("compression", "none"))
        pause = asked.get("throttle_rate", 0)
        least = 1e-3 * pause if isinstance(pause, int | float) else 0.0
        step = max(1, math.ceil(least * self.rate - 1e-9))
        with contextlib.suppress(ConnectionClosed):
            if topic == TF_STATIC:
                await connection.send(self._message(topic, 0.0, compression) or "")
                return
            k = math.ceil((time.monotonic() - self._begun) * self.rate)
            while True:
                late = time.monotonic() - self._begun - k / self.rate
                if late < 0:
                    await asyncio.sleep(-late)
                elif late > LATE:
                    k += math.ceil(late * self.rate)
                if topic in self.topics and (said := self._message(topic, k / self.rate, compression)):
                    await connection.send(said)
                k += step

    def _message(self, topic: str, t: float, compression: str) -> str | bytes | None:
        content, says = self.topics[topic]
        said = says(t)
        if compression == Compression.NONE:
            return json.dumps({"op": "publish", "topic": topic, "msg": document(said, self.edition)})
        import cbor2

        if compression == Compression.CBOR_RAW:
            raw = encode(content, said, self.edition)
            now, part = divmod(round((self.epoch + t) * 1e9), 10**9)
            message: object = {"secs": now, "nsecs": part, "bytes": raw}
        elif self.edition is Edition.ROS1:
            return None  # as the server of ROS 1 does with lists of texts
        else:
            message = _typed(document(said, self.edition))
        return cbor2.dumps({"op": "publish", "topic": topic, "msg": message})


def document(said: RosMessage, edition: Edition) -> dict[str, object]:
    """A message as rosbridge writes it in JSON: what is not finite is null."""

    def span(t: float | None) -> dict[str, int]:
        sec, nano = divmod(round((t or 0.0) * 1e9), 10**9)
        return {"secs": sec, "nsecs": nano} if edition is Edition.ROS1 else {"sec": sec, "nanosec": nano}

    def numbers(values: tuple[float, ...]) -> list[float | None]:
        return [x if math.isfinite(x) else None for x in values]

    def header(stamp: float | None, frame: str = "") -> dict[str, object]:
        more = {"seq": 0} if edition is Edition.ROS1 else {}
        return {**more, "stamp": span(stamp), "frame_id": frame}

    def edge(t: Transform) -> dict[str, Any]:
        place = dict(zip("xyz", numbers(t.position), strict=True))
        turn = dict(zip("wxyz", numbers(t.wxyz), strict=True))
        moved = {"translation": place, "rotation": turn}
        return {"header": header(t.stamp, t.parent), "child_frame_id": t.child, "transform": moved}

    if isinstance(said, Joints):
        values = {key: numbers(getattr(said, key)) for key in ("position", "velocity", "effort")}
        return {"header": header(said.stamp), "name": list(said.names), **values}
    if isinstance(said, Plan):
        points = [
            {
                "positions": numbers(p.position),
                "velocities": numbers(p.velocity),
                "accelerations": [],
                "effort": [],
                "time_from_start": span(p.t),
            }
            for p in said.points
        ]
        return {"header": header(said.stamp), "joint_names": list(said.names), "points": points}
    return {"transforms": [edge(t) for t in said]}


def _typed(value: object) -> object:
    """With lists of numbers as typed arrays of doubles."""
    import struct

    import cbor2

    if isinstance(value, dict):
        return {key: _typed(item) for key, item in value.items()}
    if isinstance(value, list) and value and all(x is None or isinstance(x, float) for x in value):
        doubles = [math.nan if x is None else x for x in value]
        return cbor2.CBORTag(86, struct.pack(f"<{len(doubles)}d", *doubles))
    return [_typed(item) for item in value] if isinstance(value, list) else value


def _status(level: str, text: str) -> str:
    return json.dumps({"op": "status", "level": level, "msg": text})


def _end(task: asyncio.Task[None] | None) -> None:
    if task is not None:
        task.cancel()


# -- options ------------------------------------------------------------------------------------


class Rosbridge(RosOptions, frozen=True, kw_only=True):
    """A rosbridge server (ROS 1 or 2) with the joint states of a robot."""

    port: Annotated[int, port()] = 9090
    follows: Annotated[str, option("topic of poses of its tool that it goes to, from the first one on")] = ""
    joint_speed: Annotated[float, option("on the way there", "rad/s", gt=0, le=10)] = CALM["joint_speed"]
    joint_acceleration: Annotated[float, option("on the way there", "rad/s²", gt=0, le=50)] = CALM[
        "joint_acceleration"
    ]

    def motion(self, target: Target, home: Sequence[float] | None = None) -> tuple[Motion, str]:
        """What it plays, until it is told where to go when it follows; and that in words.

        Raises:
            InputError: The file is missing or wrong, or the robot cannot do what it says.
        """
        motion, what = super().motion(target, home)
        if not self.follows:
            return motion, what
        arm = Arm(target.description) if target.description is not None else None
        assert arm is not None  # of the library
        limits = {"speed": self.joint_speed, "acceleration": self.joint_acceleration}
        return Follower(motion, arm, self.follows, **limits), f"{what}, until {self.follows} says where to go"

    def ready(self) -> Ready:
        """The server."""
        need("cbor2")
        return self.served(RosbridgeServer)
