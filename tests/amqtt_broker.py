"""Another maker's MQTT broker: tests import it as ``from amqtt_broker import broker``."""

from __future__ import annotations

import logging
from contextlib import contextmanager

from in_a_loop import in_a_loop


@contextmanager
def broker(port, *, anonymous=True):
    """Another maker's broker, in a thread of its own; it lets everybody in, or nobody."""
    from amqtt.broker import Broker

    logging.getLogger("amqtt").setLevel(logging.CRITICAL)
    logging.getLogger("transitions").setLevel(logging.CRITICAL)
    config = {
        "listeners": {"default": {"type": "tcp", "bind": f"127.0.0.1:{port}"}},
        "plugins": {"amqtt.plugins.authentication.AnonymousAuthPlugin": {"allow_anonymous": anonymous}},
    }

    async def serve(ready, over):
        found = Broker(config)
        await found.start()
        ready.set()
        await over.wait()
        await found.shutdown()

    with in_a_loop(serve):
        yield
