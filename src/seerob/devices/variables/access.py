"""What a source needs beside an address, a password and files, is there before a run starts."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

from msgspec import Struct

from seerob.core.errors import Problem

CA = ("ca",)


def missing_access(
    source: Struct,
    folder: Path,
    *,
    where: str,
    env: str = "password_env",
    files: tuple[str, ...] = CA,
) -> Iterator[Problem]:
    """What is named and not there.

    Args:
        source: Whose keys these are.
        folder: The workstation's.
        where: For messages.
        env: Key that names an environment variable.
        files: Keys that name files beside the workstation.
    """
    variable = getattr(source, env)
    if variable is not None and variable not in os.environ:
        yield Problem(where, env, f"no environment variable {variable!r}", "set it before the start")
    for key in files:
        name = getattr(source, key)
        if name is not None and not (folder / name).is_file():
            yield Problem(where, key, f"no such file: {name}", "put a PEM file beside the workstation")
