"""The two wires to ROS that targets are published on: rosbridge, and Unity's ROS-TCP."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncGenerator, Mapping
from contextlib import asynccontextmanager
from typing import Any, Protocol

from seerob.protocols.links.connection import Connection, connected
from seerob.protocols.links.websocket_link import Link, linked
from seerob.protocols.ros import ros_tcp, rosbridge
from seerob.protocols.ros.ros_messages import ros1_name
from seerob.protocols.ros.ros_serialised import Edition, store
from seerob.protocols.ros.rosbridge import Status
from seerob.workstation.tables.targets import CartesianTarget, TargetMessage, TargetWire

CONNECT_WITHIN = 2.0
"""[s]"""


class Wire(Protocol):
    """A connection on which a topic is announced."""

    async def publish(self, said: Mapping[str, Any]) -> None:
        """One message, as a table."""

    async def listen(self, patience: float) -> None:
        """Hear what the other side says; at most for a time [s].

        Raises:
            ConnectionError: It closed the connection, or says that something is wrong.
        """

    async def end(self) -> None:
        """Say that nothing more comes."""


@asynccontextmanager
async def wired(table: CartesianTarget) -> AsyncGenerator[Wire, None]:
    """Connect, and announce the topic.

    Raises:
        OSError: There is no connection.
        SeerobError: The other side is no such server.
    """
    if table.wire is TargetWire.ROSBRIDGE:
        largest, what = rosbridge.MAX_MESSAGE, "rosbridge server"
        port = table.port or rosbridge.PORT
        async with linked(table.host, port, largest=largest, what=what, tls=table.tls) as link:
            kind = str(table.message) if table.ros == 1 else str(table.message).replace("/", "/msg/")
            await link.send(rosbridge.advertise(table.topic, kind))
            yield _Rosbridge(link, table.topic)
    else:
        async with connected(table.host, table.port or ros_tcp.PORT, CONNECT_WITHIN) as connection:
            wire = _RosTcp(connection, table)
            await wire.begin()
            yield wire


class _Rosbridge:
    def __init__(self, link: Link, topic: str) -> None:
        self._link, self._topic = link, topic
        self._reader = rosbridge.Reader()

    async def publish(self, said: Mapping[str, Any]) -> None:
        await self._link.send(rosbridge.publish(self._topic, dict(said)))

    async def listen(self, patience: float) -> None:
        try:
            heard = await self._link.receive(patience)
        except TimeoutError:
            return
        if heard is None:
            raise ConnectionError("the server closed the connection")
        status = self._reader.take(heard[1])
        if isinstance(status, Status) and status.level == "error":
            raise ConnectionError(f"the server says: {status.text[:300]}")

    async def end(self) -> None:
        await self._link.send(rosbridge.unadvertise(self._topic))


class _RosTcp:
    def __init__(self, connection: Connection, table: CartesianTarget) -> None:
        self._connection, self._table = connection, table
        self._splitter = ros_tcp.Splitter()
        self._edition: Edition | None = None

    async def begin(self) -> None:
        """Hear how the endpoint serialises, and announce the topic."""
        async with asyncio.timeout(CONNECT_WITHIN):
            while self._edition is None:
                await self.listen(CONNECT_WITHIN)
        await asyncio.to_thread(store, self._edition)
        said = {"topic": self._table.topic, "message_name": ros1_name(str(self._table.message))}
        await self._connection.write(ros_tcp.command("publish", {**said, "queue_size": 1, "latch": False}))

    async def publish(self, said: Mapping[str, Any]) -> None:
        assert self._edition is not None
        body = serialised(self._table.message, said, self._edition)
        await self._connection.write(ros_tcp.pack(self._table.topic, body))

    async def listen(self, patience: float) -> None:
        try:
            _, data, _ = await self._connection.read(patience)
        except TimeoutError:
            return
        if not data:
            raise ConnectionError("the endpoint closed the connection")
        for frame in self._splitter.feed(data):
            if frame.destination == "__handshake":
                self._edition = ros_tcp.edition_of(frame)
            elif frame.destination == "__error":
                raise ConnectionError(f"the endpoint says: {str(frame.fields().get('text', ''))[:300]}")

    async def end(self) -> None:
        """Nothing: an endpoint forgets who closes the connection."""


def serialised(message: TargetMessage, said: Mapping[str, Any], edition: Edition) -> bytes:
    """A message as ROS itself serialises it.

    Args:
        message: Its type.
        said: Its fields, as `seerob.session.writing.cartesian_targets.message` has them.
        edition: Who is to read it.
    """
    types = store(edition)

    def made(name: str, /, **fields: Any) -> Any:
        return types.types[f"geometry_msgs/msg/{name}"](**fields)

    def header() -> Any:
        sec, nanosec = said["header"]["stamp"].values()
        stamp = types.types["builtin_interfaces/msg/Time"](sec=sec, nanosec=nanosec)
        more = {"seq": 0} if edition is Edition.ROS1 else {}
        frame = said["header"]["frame_id"]
        return types.types["std_msgs/msg/Header"](stamp=stamp, frame_id=frame, **more)

    def pose(fields: Mapping[str, Any]) -> Any:
        place, turn = made("Point", **fields["position"]), made("Quaternion", **fields["orientation"])
        return made("Pose", position=place, orientation=turn)

    if message is TargetMessage.POSE:
        whole = pose(said)
    elif message is TargetMessage.POSE_STAMPED:
        whole = made("PoseStamped", header=header(), pose=pose(said["pose"]))
    else:
        fields = said["transform"]
        moved = made(
            "Transform",
            translation=made("Vector3", **fields["translation"]),
            rotation=made("Quaternion", **fields["rotation"]),
        )
        whole = made(
            "TransformStamped", header=header(), child_frame_id=said["child_frame_id"], transform=moved
        )
    pack = types.serialize_ros1 if edition is Edition.ROS1 else types.serialize_cdr
    return bytes(pack(whole, str(message).replace("/", "/msg/")))
