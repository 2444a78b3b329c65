"""What a source needs beside an address, a password and files, is there before a run starts.

So it is with certificates and passwords of OPC UA sources: what is named must be there.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from msgspec import Struct
from msgspec.structs import replace

from seerob.core.errors import Problem
from seerob.protocols.links.credentials import Server, refusal
from seerob.protocols.plc.opcua_client import Security, server

CA = ("ca",)


def missing_access(
    source: Struct,
    folder: Path,
    *,
    where: str,
    server: Server,
    env: str = "password_env",
    files: tuple[str, ...] = CA,
) -> Iterator[Problem]:
    """What is named and not there.

    Args:
        source: Whose keys these are.
        folder: The workstation's.
        where: For messages.
        server: Who would be given the secret.
        env: Key that names an environment variable.
        files: Keys that name files beside the workstation.
    """
    variable = getattr(source, env)
    if variable is not None and (refused := refusal(variable, server)):
        yield Problem(where, env, *refused)
    for key in files:
        name = getattr(source, key)
        if name is not None and not (folder / name).is_file():
            yield Problem(where, key, f"no such file: {name}", "put a PEM file beside the workstation")


FILES = ("certificate", "key", "server_certificate")


def missing(where: str, source: Any, folder: Path) -> list[Problem]:
    """What a way to a server needs and is not there."""
    problems = []
    if source.security is not Security.NONE:
        for key in ("certificate", "key"):
            if getattr(source, key) is None:
                what = f"security = {source.security.value!r} needs one"
                problems.append(Problem(where, key, what, "name a file beside the workstation"))
    return [*problems, *missing_access(source, folder, where=where, server=server(source), files=FILES)]


def with_absolute_paths(source: Any, folder: Path) -> Any:
    """The source with paths that do not depend on where the process stands."""
    named = {key: getattr(source, key) for key in FILES}
    return replace(source, **{key: str(folder / name) for key, name in named.items() if name is not None})
