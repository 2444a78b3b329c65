"""A visitor without a page: comes in, says who it is, walks in a circle, and prints what it sees.

    pip install websockets msgpack numpy
    python visitor.py "wss://192.0.2.7:8080/ws?token=…" --authority authority.pem --seconds 10

It needs nothing of seerob. Messages: docs/protocol.md.
"""

import argparse
import asyncio
import math
import ssl
import time
from typing import Any

import msgpack  # type: ignore[import-untyped]
import numpy as np
from websockets.asyncio.client import ClientConnection, connect
from websockets.typing import Subprotocol

PROTOCOL = Subprotocol("seerob.v2.msgpack")


async def walk(page: ClientConnection, until: float) -> None:
    """Say thirty times a second where head and right hand are, in the world: z up, metres."""
    while (now := time.monotonic()) < until:
        x, y = 2 * math.cos(now), 2 * math.sin(now)
        poses = np.full((3, 7), np.nan, "<f4")
        poses[0] = [x, y, 1.7, 1, 0, 0, 0]
        poses[2] = [x, y, 1.1, 1, 0, 0, 0]
        await page.send(msgpack.packb({"type": "presence", "poses": poses.tobytes()}))
        await asyncio.sleep(1 / 30)


async def visit(
    url: str, authority: str | None = None, name: str = "python", seconds: float = 10.0
) -> tuple[dict[str, Any], dict[str, Any], dict[int, str]]:
    """Look on for some seconds; the last of what was seen of bodies [m], results and other visitors."""
    trusting = ssl.create_default_context(cafile=authority) if url.startswith("wss:") else None
    bodies, results, others, nodes, own = {}, {}, {}, [], None
    until = time.monotonic() + seconds
    async with connect(url, ssl=trusting, subprotocols=[PROTOCOL], max_size=2**26) as page:
        await page.send(msgpack.packb({"type": "introduction", "name": name, "device": "program"}))
        walking = asyncio.create_task(walk(page, until))
        async for data in page:
            message = msgpack.unpackb(data)
            match message["type"]:
                case "hello":
                    own = message["visitor"]
                case "scene":
                    nodes = [node["name"] for node in message["nodes"]]
                case "snapshot":
                    poses = np.frombuffer(message["poses"], "<f4").reshape(-1, 7)
                    bodies = {node: tuple(pose[:3].tolist()) for node, pose in zip(nodes, poses, strict=True)}
                    # A result is an array: name, value, unit, limit, whether from above, verdict, …
                    results = {result[0]: (result[1], result[5]) for result in message.get("results", ())}
                    await page.send(
                        msgpack.packb({"type": "command", "action": "ack", "value": message["seq"]})
                    )
                case "visitors":
                    others = {v["id"]: v["name"] for v in message["visitors"] if v["id"] != own}
            if time.monotonic() > until:
                break
        walking.cancel()
    return bodies, results, others


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("url")
    parser.add_argument("--authority", help="certificate of the server's authority, from its /trust")
    parser.add_argument("--name", default="python")
    parser.add_argument("--seconds", type=float, default=10.0)
    seen: tuple[dict[Any, Any], ...] = asyncio.run(visit(**vars(parser.parse_args())))
    for what, values in zip(("body", "result", "visitor"), seen, strict=True):
        for key, value in values.items():
            print(what, key, value)
