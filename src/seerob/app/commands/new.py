"""``seerob new``: a commented workstation folder to start from."""

from __future__ import annotations

import argparse
import json
from importlib import resources
from pathlib import Path

from seerob.app.commands.schema import schema
from seerob.app.console.terminal import Exit, line
from seerob.core.errors import InputError
from seerob.core.files.whole_file import whole_folder

HELP = "make a commented workstation folder to start from"
EXAMPLE = "seerob new my_cell"

SCHEMA = "workstation.schema.json"
"""What the first line of the starter tells editors to check and complete it by."""


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments."""
    sub.add_argument("folder", type=Path, help="folder to make")


def run(options: argparse.Namespace) -> int:
    """Copy the starter and write its schema beside it; nothing that exists is touched.

    Raises:
        InputError: The folder exists and is not empty, or cannot be made.
    """
    folder: Path = options.folder
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError.at(folder, "", "exists already", "give the name of a new folder")
    starter = resources.files("seerob.app.commands") / "starter"
    with whole_folder(folder) as working:
        for entry in starter.iterdir():
            (working / entry.name).write_bytes(entry.read_bytes())
        text = json.dumps(schema(), ensure_ascii=False, separators=(",", ":"))
        (working / SCHEMA).write_text(f"{text}\n", encoding="utf-8")
    for name in (*(entry.name for entry in starter.iterdir()), SCHEMA):
        line("wrote", str(folder / name))
    line("next", f"seerob assess {folder}   or   seerob run {folder}")
    return Exit.WITHIN
