"""Takes what a seerob server says to a WAMP router, MessagePack both ways.

    pip install autobahn websockets msgpack
    python seerob_wamp.py ws://127.0.0.1:8080/ws ws://127.0.0.1:8081/ws --realm realm1

It publishes scene, snapshots and visitors, and registers procedures that answer with the newest, for whoever
comes later. It only looks: with a token of another role than ``view`` it would do no more.
"""

from __future__ import annotations

import argparse
import asyncio
import ssl
import struct
from typing import Any

import msgpack
from autobahn.asyncio.wamp import ApplicationRunner, ApplicationSession
from autobahn.wamp.serializer import MsgPackSerializer
from websockets.asyncio.client import connect
from websockets.typing import Subprotocol

PROTOCOL = Subprotocol("seerob.v2.msgpack")
ACKNOWLEDGED = 4
"""Snapshots that are acknowledged together."""
RESULT = ("name", "value", "unit", "limit", "at_most", "verdict", "reason")
"""Of the fields of a result these, in the order in which they come."""


def told(message: dict[str, Any], nodes: list[str]) -> dict[str, Any]:
    """A snapshot with names: each body's pose (x, y, z [m], w, x, y, z), results without what is drawn."""
    poses = list(struct.iter_unpack("<7f", message["poses"]))
    return {
        "t": message["t"],
        "seq": message["seq"],
        "poses": dict(zip(nodes, poses, strict=True)),
        "joints": message.get("joints", {}),
        "results": [dict(zip(RESULT, result, strict=False)) for result in message.get("results", ())],
        "doubts": message.get("doubts", {}),
    }


class Bridge(ApplicationSession):  # type: ignore[misc]  # autobahn has no types
    """One session at the router, and one at seerob."""

    async def onJoin(self, _: object) -> None:
        """Register what others may ask for, then take along what comes."""
        extra = self.config.extra
        self._newest: dict[str, Any] = {}
        prefix = extra["prefix"]
        for what in ("scene", "snapshot", "visitors"):
            await self.register(lambda what=what: self._newest.get(what), f"{prefix}.newest.{what}")
        trusting = (
            ssl.create_default_context(cafile=extra["authority"]) if extra["seerob"][:4] == "wss:" else None
        )
        nodes: list[str] = []
        unheard = 0
        async with connect(
            extra["seerob"], ssl=trusting, subprotocols=[PROTOCOL], max_size=2**26, compression=None
        ) as page:
            await page.send(
                msgpack.packb({"type": "introduction", "name": extra["name"], "device": "program"})
            )
            async for data in page:
                message = msgpack.unpackb(data)
                kind = message.pop("type")
                if kind == "scene":
                    nodes = [node["name"] for node in message["nodes"]]
                elif kind == "snapshot":
                    unheard += 1
                    if unheard % ACKNOWLEDGED == 0:
                        ack = {"type": "command", "action": "ack", "value": message["seq"]}
                        await page.send(msgpack.packb(ack))
                    message = told(message, nodes)
                elif kind != "visitors":
                    continue
                self._newest[kind] = message
                self.publish(f"{prefix}.{kind}", message)
        self.leave()

    def onDisconnect(self) -> None:
        """There is nothing to take along any more."""
        asyncio.get_running_loop().stop()


def main() -> None:
    """Run until seerob or the router ends it."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("seerob", help="WebSocket of seerob, with its token: ws://127.0.0.1:8080/ws?token=…")
    parser.add_argument("router", help="WebSocket of the WAMP router")
    parser.add_argument("--realm", default="realm1")
    parser.add_argument("--prefix", default="seerob", help="of topics and procedures")
    parser.add_argument("--name", default="wamp bridge", help="what other visitors read")
    parser.add_argument("--authority", help="certificate of seerob's authority, from its /trust")
    options = parser.parse_args()
    runner = ApplicationRunner(
        options.router, options.realm, extra=vars(options), serializers=[MsgPackSerializer()]
    )
    runner.run(Bridge)


if __name__ == "__main__":
    main()
