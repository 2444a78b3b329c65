"""Certificates and passwords of OPC UA sources: what is named must be there before a run starts."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from msgspec.structs import replace

from seerob.errors import Problem
from seerob.protocols.opcua_client import Security


def missing(where: str, source: Any, folder: Path) -> list[Problem]:
    """What a way to a server needs and is not there."""
    problems = []
    if source.security is not Security.NONE:
        for key in ("certificate", "key"):
            if getattr(source, key) is None:
                what = f"security = {source.security.value!r} needs one"
                problems.append(Problem(where, key, what, "name a file beside the workstation"))
    for key in ("certificate", "key", "server_certificate"):
        name = getattr(source, key)
        if name is not None and not (folder / name).is_file():
            problems.append(Problem(where, key, f"no such file: {name}", "put it beside the workstation"))
    if source.password_env is not None and source.password_env not in os.environ:
        what = f"no environment variable {source.password_env!r}"
        problems.append(Problem(where, "password_env", what, "set it before the start"))
    return problems


def at_home(source: Any, folder: Path) -> Any:
    """The source with paths that do not depend on where the process stands."""
    named = {k: getattr(source, k) for k in ("certificate", "key", "server_certificate")}
    return replace(source, **{k: str(folder / v) for k, v in named.items() if v is not None})
