"""Certificates and passwords of OPC UA sources: what is named must be there before a run starts."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from msgspec.structs import replace

from seerob.core.errors import Problem
from seerob.devices.variables.access import missing_access
from seerob.protocols.plc.opcua_client import Security

FILES = ("certificate", "key", "server_certificate")


def missing(where: str, source: Any, folder: Path) -> list[Problem]:
    """What a way to a server needs and is not there."""
    problems = []
    if source.security is not Security.NONE:
        for key in ("certificate", "key"):
            if getattr(source, key) is None:
                what = f"security = {source.security.value!r} needs one"
                problems.append(Problem(where, key, what, "name a file beside the workstation"))
    return [*problems, *missing_access(source, folder, where=where, files=FILES)]


def at_home(source: Any, folder: Path) -> Any:
    """The source with paths that do not depend on where the process stands."""
    named = {key: getattr(source, key) for key in FILES}
    return replace(source, **{key: str(folder / name) for key, name in named.items() if name is not None})
