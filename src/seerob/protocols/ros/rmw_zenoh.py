"""ROS 2 over Zenoh: keys as ``rmw_zenoh`` and ``zenoh-bridge-ros2dds`` form them, and a session at a router.

``rmw_zenoh`` publishes a message, as CDR, under ``<domain>/<topic>/<type>/<hash>``: the type in DDS's words
(``sensor_msgs::msg::dds_::JointState_``), the hash of its definition. Who publishes what is told by
liveliness tokens, in which ``/`` is written as ``%``:

    @ros2_lv/<domain>/<session>/<node>/<entity>/MP/<enclave>/<namespace>/<name>/<topic>/<type>/<hash>/<qos>

The bridge from DDS publishes under the topic alone, whatever the domain; what it publishes bears the time at
which it did, and by whose clock. Source: design document of rmw_zenoh.
"""

from __future__ import annotations

import asyncio
import json
import math
import socket
import struct
import time
from collections import deque
from collections.abc import AsyncIterator, Iterable
from contextlib import asynccontextmanager
from threading import Lock
from typing import Any, NamedTuple

from seerob.core.extras import need

PORT = 7447
MAX_MESSAGE = 1 << 20
CONNECT_WITHIN = 2.0
"""[s]"""
LOOK = 0.25
"""How soon it is noticed that the router is gone [s]."""
ASK_WITHIN = 0.5
"""How long publishers are waited for that tell of themselves [s]."""
MOST_TOKENS = 4096
MOST_WAITING = 1024
"""Messages; of more, the oldest are left out."""
MOST_BYTES = 8 * MAX_MESSAGE
"""Of all that wait; likewise."""
MOST_KEPT = 64
"""Messages of a topic that are kept for whoever comes later."""
LONGEST_NAME = 255
"""Of a topic or a type in ROS 2 [characters]: whoever announces a longer one is not listed."""
ONE_ALONE = 2.0
"""How long one has to be alone on a topic until it is relied on after another [s]."""
NODE = "seerob"
TOKENS = "@ros2_lv"
PUBLISHER = "MP"


def dds_name(message_type: str) -> str:
    """``sensor_msgs::msg::dds_::JointState_`` for ``sensor_msgs/msg/JointState``."""
    *package, name = message_type.split("/")
    return "::".join([*package, "dds_", f"{name}_"])


def message_type(dds: str) -> str:
    """``sensor_msgs/msg/JointState`` for ``sensor_msgs::msg::dds_::JointState_``; others as they are."""
    *package, dds_, name = ["", *dds.split("::")][-4:] if dds.count("::") >= 2 else ["", "", ""]
    return "/".join([*filter(None, package), name.removesuffix("_")]) if dds_ == "dds_" else dds


def key(topic: str, message: str, domain: int, definition: str = "*") -> str:
    """Key of a topic.

    Args:
        topic: ``/joint_states``.
        message: Type of its messages, ``sensor_msgs/msg/JointState``.
        domain: ``ROS_DOMAIN_ID``.
        definition: Hash of the definition, ``RIHS01_…``; any when not given.
    """
    return f"{domain}/{topic.strip('/')}/{dds_name(message)}/{definition}"


def bridged(topic: str) -> str:
    """Key of a topic behind ``zenoh-bridge-ros2dds``."""
    return topic.strip("/")


_ATTACHMENT = struct.Struct("<QQB16s")
"""Number of the message, when it was published [ns since 1970], and who did: 16 bytes and their count."""


class Publisher:
    """Publishes on one topic, as a node of ``rmw_zenoh``.

    Args:
        session: Zenoh's.
        topic: ``/joint_states``.
        message: Type of its messages, ``sensor_msgs/msg/JointState``.
        definition: Hash of the definition, ``RIHS01_…``.
        domain: ``ROS_DOMAIN_ID``.
        kept: Whether who comes later is told what was published before.
    """

    def __init__(
        self, session: Any, topic: str, message: str, definition: str, domain: int, *, kept: bool = False
    ) -> None:
        from zenoh.ext import CacheConfig, declare_advanced_publisher

        made = declare_advanced_publisher(
            session,
            key(topic, message, domain, definition),
            cache=CacheConfig(max_samples=MOST_KEPT) if kept else None,
            publisher_detection=kept,
        )
        who, mangled = str(session.info.zid()), f"/{topic.strip('/')}".replace("/", "%")
        entity = f"{TOKENS}/{domain}/{who}/0/1/{PUBLISHER}/%/%/{NODE}/{mangled}/{dds_name(message)}"
        quality = f"{':1' if kept else ':'}:,{MOST_KEPT if kept else 10}:,:,:,,"
        self._token = session.liveliness().declare_token(f"{entity}/{definition}/{quality}")
        self._publisher, self._number = made, 0
        self._who = bytes.fromhex(who.zfill(32))[:16]

    def publish(self, raw: bytes, now: float) -> None:
        """Publish a message.

        Args:
            raw: As CDR.
            now: Wall clock [s since 1970].
        """
        self._number += 1
        said = _ATTACHMENT.pack(self._number, round(1e9 * now), len(self._who), self._who)
        self._publisher.put(raw, attachment=said)


def offered(tokens: Iterable[str]) -> dict[str, str]:
    """Topics that somebody publishes, and the types of their messages, out of liveliness tokens."""
    found: dict[str, str] = {}
    for text in tokens:
        parts = text.split("/")
        names = max(map(len, parts[9:11]), default=0)
        if len(parts) == 13 and (parts[0], parts[5]) == (TOKENS, PUBLISHER) and names <= LONGEST_NAME:
            found[parts[9].replace("%", "/")] = message_type(parts[10])
    return found


def settings(mode: str, **endpoints: str) -> Any:
    """Settings of a session that looks for nobody: it connects, or listens, where it is told.

    Args:
        mode: ``client`` or ``router``.
        endpoints: ``connect`` or ``listen``: ``tcp/127.0.0.1:7447``.
    """
    need("zenoh")
    import zenoh

    config = zenoh.Config()
    said: dict[str, Any] = {
        "mode": mode,
        "scouting/multicast/enabled": False,
        "transport/shared_memory/enabled": False,
        # Four times what is read: what is a little too long is refused with its length, and not cut off.
        "transport/link/rx/max_message_size": 4 * MAX_MESSAGE,
        "connect/timeout_ms": round(1e3 * CONNECT_WITHIN),
        **{f"{what}/endpoints": [endpoint] for what, endpoint in endpoints.items()},
    }
    for path, value in said.items():
        config.insert_json5(path, json.dumps(value))
    return config


class Put(NamedTuple):
    """What somebody published."""

    arrived: float
    """Host's monotonic time [s]."""
    topic: str
    payload: bytes
    origin: str
    """Its key, and of one without a domain by whose clock it was published: a bridge has its own."""


class Origins:
    """Whether topics are heard from one at a time: of two domains, or two bridges, nobody knows whose."""

    def __init__(self) -> None:
        self._newest: dict[str, str] = {}
        self._two: dict[str, tuple[float, str]] = {}
        """By topic, until when there is a doubt [s], and why."""

    def take(self, put: Put, *, stays: bool = False) -> str:
        """Take note of what was published: why what is known now may be of another robot; empty where not.

        Args:
            put: What was published, to any of the topics.
            stays: Whether it is relied on from now on, as frames that never change are.
        """
        before = self._newest.get(put.topic, put.origin)
        self._newest[put.topic] = put.origin
        if put.origin != before:
            one, other = sorted((before, put.origin))
            text = (
                f"{put.topic} is heard from two, {one} and {other}: give the domain, or each bridge a "
                "namespace of its own"
            )
            self._two[put.topic] = math.inf if stays else put.arrived + ONE_ALONE, text
        return next((why for until, why in self._two.values() if put.arrived <= until), "")


class Router:
    """A session at a router: what is published on topics, and publishing.

    Args:
        session: Zenoh's.
        loop: Of who waits; messages come in a thread of Zenoh's own.
    """

    def __init__(self, session: Any, loop: asyncio.AbstractEventLoop) -> None:
        self._session, self._loop = session, loop
        self._waiting, self._some = deque[Put](), asyncio.Event()
        self._bytes, self._lock = 0, Lock()
        """How much waits, and whose turn it is with that: messages come in one thread, and go in another."""
        self._declared: list[Any] = []

    def subscribe(self, topic: str, keys: Iterable[str], *, kept: bool) -> None:
        """Hear a topic under each of these keys; what was published before, too, where it is ``kept``."""
        from zenoh.ext import HistoryConfig, declare_advanced_subscriber

        def take(sample: Any) -> None:
            # What is too long is cut by one byte more than is read, so that whoever decodes it refuses it.
            payload = sample.payload
            raw = payload.to_bytes() if len(payload) <= MAX_MESSAGE else bytes(MAX_MESSAGE + 1)
            # Who has not come for what waits was called already: of a flood the loop hears once.
            if self._add(Put(time.monotonic(), topic, raw, _origin(sample, topic))):
                self._loop.call_soon_threadsafe(self._some.set)

        for one in keys:
            if kept:
                history = HistoryConfig(detect_late_publishers=True, max_samples=MOST_KEPT)
                made = declare_advanced_subscriber(self._session, one, take, history=history)
            else:
                made = self._session.declare_subscriber(one, take)
            self._declared.append(made)

    def _add(self, put: Put) -> bool:
        """Have it wait; whether nothing else did."""
        with self._lock:
            first = not self._waiting
            self._waiting.append(put)
            self._bytes += len(put.payload)
            while len(self._waiting) > MOST_WAITING or self._bytes > MOST_BYTES:
                self._bytes -= len(self._waiting.popleft().payload)
            return first

    def publisher(self, topic: str, message: str, definition: str, domain: int) -> Publisher:
        """Announce a topic; arguments as of `Publisher`."""
        return Publisher(self._session, topic, message, definition, domain)

    async def next(self, within: float | None) -> Put:
        """The next message.

        Args:
            within: How long to wait [s]; for ever when None.

        Raises:
            TimeoutError: Nothing came.
            ConnectionError: The router is gone.
        """
        until = None if within is None else time.monotonic() + within
        while not self._waiting:
            left = LOOK if until is None else min(LOOK, until - time.monotonic())
            try:
                async with asyncio.timeout(max(0.0, left)):
                    await self._some.wait()
            except TimeoutError:
                if not await asyncio.to_thread(self._at_router):
                    raise ConnectionError("the router is gone") from None
                if until is not None and time.monotonic() >= until:
                    raise
            self._some.clear()
        with self._lock:
            put = self._waiting.popleft()
            self._bytes -= len(put.payload)
        return put

    def _at_router(self) -> bool:
        info = self._session.info
        return bool(info.routers_zid() or info.peers_zid())

    async def publishers(self, domain: int) -> dict[str, str]:
        """Topics that somebody publishes with ``rmw_zenoh``, and the types of their messages."""
        return await asyncio.to_thread(self._publishers, domain)

    def _publishers(self, domain: int) -> dict[str, str]:
        found: list[str] = []
        for reply in self._session.liveliness().get(f"{TOKENS}/{domain}/**", timeout=ASK_WITHIN):
            if reply.ok is not None and len(found) < MOST_TOKENS:
                found.append(str(reply.ok.key_expr))
        return offered(found)


def _origin(sample: Any, topic: str) -> str:
    found = str(sample.key_expr)
    if found == bridged(topic) and sample.timestamp is not None:
        found = f"{found} by {sample.timestamp.get_id()}"
    return found


@asynccontextmanager
async def opened(host: str, port: int) -> AsyncIterator[Router]:
    """Connect to a router.

    Args:
        host: Name or address.
        port: TCP port.

    Raises:
        OSError: There is none, or nobody knows its name.
    """
    loop = asyncio.get_running_loop()
    (found, *_) = await loop.getaddrinfo(host, port, type=socket.SOCK_STREAM)
    address = found[4][0]
    config = settings("client", connect=f"tcp/{f'[{address}]' if ':' in str(address) else address}:{port}")
    import zenoh

    try:
        session = await asyncio.to_thread(zenoh.open, config)
    except zenoh.ZError as error:
        raise ConnectionError(f"no Zenoh router: {str(error).partition(' at ')[0][:200]}") from None
    try:
        yield Router(session, loop)
    finally:
        await asyncio.to_thread(session.close)
