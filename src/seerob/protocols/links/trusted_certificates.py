"""Who is believed to be who they say over TLS, read once and again when the file changes."""

from __future__ import annotations

import ssl
from functools import lru_cache
from pathlib import Path

MOST = 32
"""Servers whose certificates stay read."""


def trusting(ca: Path | None, *, server: str) -> ssl.SSLContext:
    """What a client needs to check a server's certificate.

    A system trusts more than a hundred signers: to read them at each of many attempts to reach a machine
    that is switched off takes more time than the attempts, and memory that is given back late.

    Args:
        ca: Certificates that are trusted instead of the system's (PEM).
        server: Its URL or name: what a library sets for one server is not set for another.

    Raises:
        OSError: The file cannot be read, or is no certificate (`ssl.SSLError` is one).
    """
    if ca is None:
        return _read(None, server, 0, 0)
    about = ca.stat()
    return _read(ca, server, about.st_mtime_ns, about.st_size)


@lru_cache(MOST)
def _read(ca: Path | None, server: str, changed: int, size: int) -> ssl.SSLContext:
    return ssl.create_default_context(cafile=ca)
