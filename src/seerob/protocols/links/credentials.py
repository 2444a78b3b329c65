"""Secrets go only where the user said, in words that a workstation file cannot write.

In the environment ``SEEROB_PLC`` holds a secret, ``SEEROB_PLC_HOST`` the host (or host:port) that may have
it, and ``SEEROB_PLC_CLEAR_TEXT=yes`` allows it to travel unencrypted. What the environment does not have is
looked for in ``credentials.toml`` in the user's configuration folder, which nobody else may read::

    [SEEROB_PLC]
    secret = "…"
    host = "192.168.0.7:8883"
    clear_text = false

Who is believed to be who they say over TLS, read once and again when the file changes.
"""

from __future__ import annotations

import os
import ssl
import stat
import tomllib
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple
from urllib.parse import urlsplit

import msgspec

from seerob.core.errors import InputError
from seerob.core.files.toml_file import read_toml
from seerob.core.host_name import is_loopback

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


PREFIX, HOST, CLEAR = "SEEROB_", "_HOST", "_CLEAR_TEXT"
PORTS = {"http": 80, "ws": 80, "https": 443, "wss": 443, "opc.tcp": 4840}


class Server(NamedTuple):
    """Who would be given a secret."""

    host: str
    port: int
    encrypted: bool


class Credential(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A secret, and who may have it."""

    secret: str
    host: str = ""
    """``192.168.0.7`` or ``192.168.0.7:443``."""
    clear_text: bool = False
    """Whether it may be sent unencrypted."""


def server_of(url: str, *, encrypted: bool) -> Server:
    """The server that a URL names."""
    parts = urlsplit(url)
    return Server(parts.hostname or "", parts.port or PORTS.get(parts.scheme, 0), encrypted)


def credentials_file() -> Path:
    """Where the user keeps secrets; it need not be there."""
    from platformdirs import user_config_path

    return user_config_path("seerob", appauthor=False) / "credentials.toml"


def credential(variable: str) -> Credential | None:
    """A secret by its name, from the environment or the user's credentials file; None when nobody gave it.

    Raises:
        InputError: The file can be read by others, belongs to somebody else, or is wrong.
    """
    if variable in os.environ:
        allowed, clear = os.environ.get(variable + HOST, ""), os.environ.get(variable + CLEAR)
        return Credential(os.environ[variable], allowed, clear == "yes")
    file = credentials_file()
    try:
        about = file.stat()
    except OSError:
        return None
    if os.name == "posix" and (about.st_uid != os.getuid() or stat.S_IMODE(about.st_mode) & 0o077):
        what = f"mode {stat.S_IMODE(about.st_mode):o} of user {about.st_uid}: others may read or change it"
        raise InputError.at(file, "", what, f"chmod 600 {file}, as its owner")
    _, raw = read_toml(file)
    table = tomllib.loads(raw.decode("utf-8-sig"))  # a secret may have any character
    if variable not in table:
        return None
    try:
        return msgspec.convert(table[variable], Credential)
    except msgspec.ValidationError as error:
        raise InputError.at(file, variable, str(error), 'secret = "…", host = "…"') from error


def refusal(variable: str, server: Server) -> tuple[str, str] | None:
    """Why a secret may not go to a server, and what would be right; or None.

    Raises:
        InputError: The credentials file can be read by others, or is wrong.
    """
    if not variable.startswith(PREFIX):
        what = f"{variable!r} is not seerob's to send: the name must begin with {PREFIX}"
        return what, f"name a variable such as {PREFIX}PLC, and set it and {PREFIX}PLC{HOST}"
    given = credential(variable)
    if given is None:
        what = f"no environment variable {variable!r}, and none of that name in {credentials_file()}"
        return what, "set it before the start"
    host = server.host.lower()
    at = f"[{host}]:{server.port}" if ":" in host else f"{host}:{server.port}"
    if not host or given.host.strip().lower() not in (host, at):
        what = f"nobody allowed {variable} to be sent to {at}"
        where = f"set {variable}{HOST}={at} before the start, or host in the credentials file"
        return what, f"if that is who it is for, {where}"
    if not (server.encrypted or is_loopback(host) or given.clear_text):
        what = f"{variable} would be sent to {at} unencrypted"
        return what, f"encrypt the connection, or set {variable}{CLEAR}=yes before the start"
    return None


def secret(key: str, variable: str, server: Server) -> str:
    """The secret of a name, for this server alone.

    Raises:
        InputError: The user did not allow it.
    """
    if refused := refusal(variable, server):
        raise InputError.at(server.host, key, *refused)
    given = credential(variable)
    assert given is not None  # else it was refused
    return given.secret
