"""Secrets go only where the user said, in words that a workstation file cannot write: the environment.

``SEEROB_PLC`` holds a secret, ``SEEROB_PLC_HOST`` the host (or host:port) that may have it, and
``SEEROB_PLC_CLEAR_TEXT=yes`` allows it to travel unencrypted.
"""

from __future__ import annotations

import os
from typing import NamedTuple
from urllib.parse import urlsplit

from seerob.core.errors import InputError
from seerob.core.host_name import is_loopback

PREFIX, HOST, CLEAR = "SEEROB_", "_HOST", "_CLEAR_TEXT"
PORTS = {"http": 80, "ws": 80, "https": 443, "wss": 443, "opc.tcp": 4840}


class Server(NamedTuple):
    """Who would be given a secret."""

    host: str
    port: int
    encrypted: bool


def server_of(url: str, *, encrypted: bool) -> Server:
    """The server that a URL names."""
    parts = urlsplit(url)
    return Server(parts.hostname or "", parts.port or PORTS.get(parts.scheme, 0), encrypted)


def refusal(variable: str, server: Server) -> tuple[str, str] | None:
    """Why the secret in an environment variable may not go to a server, and what would be right; or None."""
    if not variable.startswith(PREFIX):
        what = f"{variable!r} is not seerob's to send: the name must begin with {PREFIX}"
        return what, f"name a variable such as {PREFIX}PLC, and set it and {PREFIX}PLC{HOST}"
    if variable not in os.environ:
        return f"no environment variable {variable!r}", "set it before the start"
    host = server.host.lower()
    at = f"[{host}]:{server.port}" if ":" in host else f"{host}:{server.port}"
    allowed = os.environ.get(variable + HOST, "").strip().lower()
    if not host or allowed not in (host, at):
        what = f"nobody allowed {variable} to be sent to {at}"
        return what, f"if that is who it is for, set {variable}{HOST}={at} before the start"
    if not (server.encrypted or is_loopback(host) or os.environ.get(variable + CLEAR) == "yes"):
        what = f"{variable} would be sent to {at} unencrypted"
        return what, f"encrypt the connection, or set {variable}{CLEAR}=yes before the start"
    return None


def secret(key: str, variable: str, server: Server) -> str:
    """The secret in an environment variable, for this server alone.

    Raises:
        InputError: The user did not allow it.
    """
    if refused := refusal(variable, server):
        raise InputError.at(server.host, key, *refused)
    return os.environ[variable]
