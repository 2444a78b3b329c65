"""Another maker's MQTT broker: tests import it as ``from amqtt_broker import broker``."""

from __future__ import annotations

import asyncio
import logging
import threading
from contextlib import contextmanager


@contextmanager
def broker(port):
    """Another maker's broker, in a thread of its own."""
    from amqtt.broker import Broker

    logging.getLogger("amqtt").setLevel(logging.CRITICAL)
    logging.getLogger("transitions").setLevel(logging.CRITICAL)
    config = {
        "listeners": {"default": {"type": "tcp", "bind": f"127.0.0.1:{port}"}},
        "plugins": {"amqtt.plugins.authentication.AnonymousAuthPlugin": {"allow_anonymous": True}},
    }
    up, over, loops = threading.Event(), [], []

    async def serve():
        found = Broker(config)
        await found.start()
        stop = asyncio.Event()
        loops.append(asyncio.get_running_loop())
        over.append(stop)
        up.set()
        await stop.wait()
        await found.shutdown()

    thread = threading.Thread(target=lambda: asyncio.run(serve()), daemon=True)
    thread.start()
    assert up.wait(20)
    try:
        yield
    finally:
        loops[0].call_soon_threadsafe(over[0].set)
        thread.join(20)
        assert not thread.is_alive()
