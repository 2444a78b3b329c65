"""A server of asyncua alone, nothing of ours: tests import it as ``from foreign_opcua import …``."""

from __future__ import annotations

import socket
from contextlib import contextmanager

URI = "urn:another:maker"


@contextmanager
def foreign_opcua(values, writable=(), more=lambda server: None, port=0):
    """A PLC of another maker.

    Args:
        values: First value of each node, by name.
        writable: Those that clients may write.
        more: Adds what else there is to the server (`asyncua.sync.Server`).
        port: Where it listens; any that is free when 0.

    Yields:
        Address, and nodes by name: ``nodes["lamp"].write_value(True)``.
    """
    from asyncua.sync import Server

    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = port or free.getsockname()[1]
    server = Server()
    try:
        server.set_endpoint(f"opc.tcp://127.0.0.1:{port}/")
        index = server.register_namespace(URI)
        nodes = {}
        for name, value in values.items():
            nodes[name] = server.nodes.objects.add_variable(f"ns={index};s={name}", f"{index}:{name}", value)
            if name in writable:
                nodes[name].set_writable()
        more(server)
        server.start()
        yield f"opc.tcp://127.0.0.1:{port}", nodes
    finally:
        server.stop()
