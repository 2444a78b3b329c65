"""``seerob new``: a commented workstation folder to start from."""

from __future__ import annotations

import argparse
import json
from importlib import resources
from pathlib import Path

from seerob.app.commands import demo, edit
from seerob.app.commands.schema import schema
from seerob.app.console.terminal import Exit, line
from seerob.core.errors import InputError, UnknownName
from seerob.core.files.whole_file import whole_folder

HELP = "make a commented workstation folder to start from"
EXAMPLE = "seerob new my_cell --from niryo_picking"
README = "README.md"

SCHEMA = "workstation.schema.json"
"""What the first line of the starter tells editors to check and complete it by."""


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments."""
    sub.add_argument("folder", type=Path, help="folder to make")
    text = "begin with one of the workstations that seerob demo --list names, instead of the starter"
    sub.add_argument("--from", dest="template", metavar="NAME", help=text)
    sub.add_argument("--edit", action="store_true", help="open it in the page then, as seerob edit does")


def run(options: argparse.Namespace) -> int:
    """Copy a workstation and write its schema beside it; nothing that exists is touched.

    Raises:
        UnknownName: No workstation of that name comes with seerob.
        InputError: The folder exists and is not empty, or cannot be made.
    """
    folder: Path = options.folder
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError.at(folder, "", "exists already", "give the name of a new folder")
    name = options.template
    if name not in (None, *demo.SHIPPED):
        raise UnknownName("workstation", name, demo.SHIPPED)
    with whole_folder(folder) as working:
        if name is None:
            starter = resources.files("seerob.app.commands") / "starter"
            for entry in starter.iterdir():
                (working / entry.name).write_bytes(entry.read_bytes())
        else:
            demo.copied(name, working)
            (working / README).unlink(missing_ok=True)  # whose commands and links are of the original
            file = working / "workstation.toml"
            text = file.read_text("utf-8").replace(f"workstations/{name}", folder.name)
            file.write_text(f"#:schema {SCHEMA}\n{text}", encoding="utf-8")
        text = json.dumps(schema(), ensure_ascii=False, separators=(",", ":"))
        (working / SCHEMA).write_text(f"{text}\n", encoding="utf-8")
    for entry in sorted(folder.iterdir()):
        line("wrote", str(entry))
    if options.edit:
        parser = argparse.ArgumentParser()
        edit.add(parser)
        return edit.run(parser.parse_args(["--", str(folder)]))
    live = "[[emulators]]" in (folder / "workstation.toml").read_text("utf-8")
    assess, emulated = f"seerob assess {folder}   or   ", " --emulated"
    line("next", f"{'' if live else assess}seerob run {folder}{emulated if live else ''}")
    return Exit.WITHIN
