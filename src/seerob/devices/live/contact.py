"""Whom a live source connects to and as whom, in words, before anything does."""

from __future__ import annotations

from typing import Any, NamedTuple
from urllib.parse import urlsplit

SECRETS = ("password_env", "token_env")
"""Options that name a secret."""
ENCRYPTED = ("https", "wss")


class Contact(NamedTuple):
    """The other end of a live source."""

    where: str
    """``connects to 192.168.0.7:30004``, ``listens on 0.0.0.0:9763``."""
    user: str = ""
    """As whom; empty for nobody."""
    secret: str = ""
    """Name of the secret that is sent; empty for none."""
    encrypted: bool = False

    def __str__(self) -> str:
        """One line."""
        who = f" as {self.user!r}" if self.user else ""
        what = f" with the secret {self.secret}" if self.secret else ""
        return f"{self.where}{who}{what}, {'encrypted' if self.encrypted else 'not encrypted'}"


def contact_of(source: Any, *, listens: bool) -> Contact:
    """The other end by the options of a source.

    Args:
        source: With ``url``, or with ``host``, ``bind`` and ``port``.
        listens: Whether it waits on ``bind`` for what is sent, instead of connecting to ``host``.
    """
    url, port = getattr(source, "url", ""), getattr(source, "port", "")
    host = getattr(source, "host", "") or getattr(source, "sender", "")
    if url:
        where = f"connects to {url}"
    elif listens:
        where = f"listens on {source.bind}:{port}" + (f" for {host}" if host else " for anybody")
    else:
        where = f"connects to {host}:{port}"
    secrets = (getattr(source, key, None) for key in SECRETS)
    security = str(getattr(source, "security", "none"))
    return Contact(
        where,
        getattr(source, "user", None) or "",
        next(filter(None, secrets), ""),
        getattr(source, "tls", False) or security != "none" or urlsplit(url).scheme in ENCRYPTED,
    )
