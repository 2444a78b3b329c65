"""``seerob new``: a commented workstation folder to start from."""

from __future__ import annotations

import argparse
from importlib import resources
from pathlib import Path

from seerob.commands import Exit, line
from seerob.errors import InputError

HELP = "make a commented workstation folder to start from"
EXAMPLE = "seerob new my_cell"


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments."""
    sub.add_argument("folder", type=Path, help="folder to make")


def run(options: argparse.Namespace) -> int:
    """Copy the starter; nothing that exists is touched.

    Raises:
        InputError: The folder exists and is not empty, or cannot be made.
    """
    folder: Path = options.folder
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError.at(folder, "", "exists already", "give the name of a new folder")
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        what = f"cannot be made: {error.strerror}"
        raise InputError.at(folder, "", what, "give a folder that may be written") from error
    starter = resources.files("seerob.commands") / "starter"
    for entry in starter.iterdir():
        (folder / entry.name).write_bytes(entry.read_bytes())
        line("wrote", str(folder / entry.name))
    line("next", f"seerob assess {folder}   or   seerob run {folder}")
    return Exit.WITHIN
