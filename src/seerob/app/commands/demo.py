"""``seerob demo``: the workstations that come with seerob; one of them copied, and run live."""

from __future__ import annotations

import argparse
import json
import os
import sys
import tomllib
from base64 import b64encode
from collections.abc import Iterator, Mapping
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any

from seerob.app.commands import run as live
from seerob.app.console.terminal import Exit, line
from seerob.core.errors import InputError, UnknownName
from seerob.core.files.whole_file import whole_folder

HELP = "list the workstations that come with seerob, copy one and run it live"
EXAMPLE = "seerob demo ur10_assembly            (then open the address it prints; Ctrl-C ends the run)"

SHIPPED = {
    "ur10_assembly": "a UR10 brings a plate to a fixture, an operator across the table secures it",
    "captured_operator": "an operator whom a depth camera recorded, beside a UR10: RULA, REBA, contact",
    "guarded_cell": "a UR5e behind a laser scanner and a light curtain",
    "two_robots": "a UR10 and a UR5e share a table with a person",
    "iiwa_bench": "an LBR iiwa 14 hands parts over a bench",
    "imported_line": "a UR5e over the fixtures of a line that came as a STEP file",
    "ur10_rtde": "live: a UR10, emulated",
    "motor_station": "live: an LBR iiwa and a person with trackers, both emulated",
    "assembly_line": "live: a UR10 and a person whom a depth camera sees, both emulated",
    "empty_room": "live: a UR5 in an empty room, its line virtual, a tracker on a hand; emulated",
    "giant_niryo": "live: a Niryo One ten times as large, a person in VR who fills boxes; emulated",
    "three_robots": "live: two LBR iiwa and a UR10 on a line, a visitor with a headset, who is emulated",
    "niryo_picking": "live: a Niryo One and a conveyor; virtual castings are picked and ride away; emulated",
    "two_places": "live: a robot at one place, a captured person at another, visitors of both; emulated",
    "plc_cell": "live: a UR10 and a PLC with a belt, a light curtain and a door, both emulated",
}
"""What each shows; the first is run when none is named."""
PICTURE = "picture.png"
"""File in the folder of each cell of the paper, which shows it (`scripts/make-cells`)."""
ADDRESSES = ("host", "bind", "url", "port", "address")


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments."""
    text = f"which one (default: {next(iter(SHIPPED))}): {', '.join(SHIPPED)}"
    sub.add_argument("name", nargs="?", metavar="name", help=text)
    text = "where to copy it (default: its name, here); one that is there is run as it is"
    sub.add_argument("folder", type=Path, nargs="?", help=text)
    sub.add_argument("--list", action="store_true", help="list them, and run none")
    text = "its devices are there: start no emulators, and say where the addresses stand"
    sub.add_argument("--real", action="store_true", help=text)
    live.add_live(sub)
    text = (
        "let it write to its devices, where its file allows it too: niryo_picking tells the robot its targets"
    )
    sub.add_argument("--allow-writing", action="store_true", help=text)
    sub.set_defaults(allow_plugins=False, allow_outside=False, replay=None, edit=False)


def run(options: argparse.Namespace) -> int:
    """List what there is, copy one, and run it until Ctrl-C.

    Raises:
        UnknownName: There is none of that name.
        InputError: The folder is something else, or cannot be made.
    """
    if options.name not in (None, *SHIPPED):
        raise UnknownName("workstation", options.name, SHIPPED)
    if options.name is None:
        width = max(map(len, SHIPPED))
        for name, text in SHIPPED.items():
            line("demo", f"{name:<{width}}  {text}")
            picture = _home() / name / PICTURE
            if picture.is_file():
                shown(picture.read_bytes(), str(picture))
    if options.list:
        return Exit.WITHIN
    name = options.name or next(iter(SHIPPED))
    folder: Path = options.folder or Path(name)
    if (folder / "workstation.toml").is_file():
        line("found", f"{folder}, which is run as it is")
    else:
        copy(name, folder)
        line("wrote", f"{folder}: yours to change; seerob run {folder} runs it again")
    options.workstation = folder
    file = folder / "workstation.toml"
    tables = tomllib.loads(file.read_text("utf-8"))
    named = "emulators" in tables
    options.emulated = named and not options.real
    if named and options.real:
        line("real", f"put the addresses of your devices into {file}:")
        for text in addresses(tables):
            line("", text)
    return live.run(options)


def addresses(tables: dict[str, Any]) -> Iterator[str]:
    """What of a workstation file is different where devices are real, a line for each key.

    Args:
        tables: The file.
    """
    for table in ("sources", "targets", "cameras"):
        for i, entry in enumerate(tables.get(table, ())):
            whose = (
                f"{entry.get('kind', table[:-1])} {entry.get('name') or entry.get('robot') or ''}".rstrip()
            )
            for key in ADDRESSES:
                if key in entry:
                    yield f"{table}[{i}].{key} = {json.dumps(entry[key])}  {whose}"
            if "origin" in entry:
                yield f"{table}[{i}].origin: leave it out for a real robot  {whose}"
            if table == "cameras" and "calibration" in entry:
                said = f"{table}[{i}].calibration = {json.dumps(entry['calibration'])}"
                yield f"{said}  seerob calibrate camera finds it  {whose}"
            if entry.get("kind") == "headset":
                yield f"{table}[{i}]: no address; open the page in the headset's browser  {whose}"


def shown(png: bytes, path: str) -> None:
    """Draw a picture where the terminal can, and say where it lies where it cannot."""
    if not (sys.stdout.isatty() and (said := inline(png, os.environ))):
        line("", path)
        return
    sys.stdout.write(f"{said}\n")
    sys.stdout.flush()


def inline(png: bytes, environment: Mapping[str, str]) -> str:
    """Draw a picture in the text of a terminal, 36 columns wide; empty where the terminal has no way to.

    iTerm2's sequence, which WezTerm knows, and the graphics protocol of kitty, which Ghostty knows.

    Args:
        png: The picture.
        environment: Of the process, which names the terminal.
    """
    coded, program = b64encode(png).decode(), environment.get("TERM_PROGRAM", "")
    if program in ("iTerm.app", "WezTerm"):
        return f"\033]1337;File=inline=1;width=36;size={len(png)}:{coded}\a"
    if program != "ghostty" and environment.get("TERM") != "xterm-kitty":
        return ""
    parts = [coded[i : i + 4096] for i in range(0, len(coded), 4096)]
    heads = ["a=T,f=100,c=36,", *[""] * (len(parts) - 1)]
    more = [f"{head}m={int(i < len(parts) - 1)}" for i, head in enumerate(heads)]
    return "".join(f"\033_G{head};{part}\033\\" for head, part in zip(more, parts, strict=True))


def copy(name: str, folder: Path) -> None:
    """Copy a workstation that comes with seerob.

    Raises:
        InputError: The folder exists and is not empty, or cannot be made.
    """
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError.at(folder, "", "exists already", "give the name of a new folder")
    with whole_folder(folder) as working:
        copied(name, working)


def copied(name: str, folder: Path) -> None:
    """Copy a workstation that comes with seerob into a folder."""
    _copied(_home() / name, folder)


def _home() -> Traversable:
    """Where they are: in the package, or, where that is a checkout, at its top."""
    packed = resources.files("seerob.app.commands") / "workstations"
    return packed if packed.is_dir() else Path(__file__).parents[4] / "workstations"


def _copied(source: Traversable, target: Path) -> None:
    target.mkdir(exist_ok=True)
    for entry in source.iterdir():
        if not entry.is_dir():
            (target / entry.name).write_bytes(entry.read_bytes())
        elif entry.name != "runs":
            _copied(entry, target / entry.name)
