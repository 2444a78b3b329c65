"""Ports of this machine that nobody has, and that nobody is given unasked."""

from __future__ import annotations

import random
import socket

_CHOICE = random.SystemRandom()  # other processes choose, too
_RANGE = range(21_000, 30_000)
"""Below those that the system gives to whoever asks for any: a server that is killed and restarted would now
and then find its port taken by a client. Between the usual ones of devices, which cells that run may have."""


def free_port(kind=socket.SOCK_DGRAM):
    """One that can be listened on now."""
    while True:
        port = _CHOICE.choice(_RANGE)
        with socket.socket(socket.AF_INET, kind) as probe:
            try:
                probe.bind(("127.0.0.1", port))
            except OSError:
                continue
            return port
