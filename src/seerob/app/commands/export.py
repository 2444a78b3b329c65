"""``seerob export``: the cell of a workstation for ROS, MuJoCo, Isaac Sim and whatever reads glTF."""

from __future__ import annotations

import argparse
from pathlib import Path

from seerob.app.console.terminal import Exit, line
from seerob.core.errors import InputError
from seerob.core.files.whole_file import whole_folder

HELP = "write the cell of a workstation as URDF, MJCF, USD or glTF"
EXAMPLE = "seerob export my_line --to mjcf"

KINDS = {"urdf": "cell.urdf", "mjcf": "cell.xml", "usd": "cell.usda", "glb": "cell.glb"}
"""What is written, and the file's name."""


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments."""
    sub.add_argument("workstation", type=Path, help="folder with a workstation.toml, or the file itself")
    sub.add_argument("--to", choices=tuple(KINDS), required=True, help="what to write")
    text = "folder to make (default: exported_KIND beside the workstation file)"
    sub.add_argument("-o", "--output", type=Path, metavar="FOLDER", help=text)


def run(options: argparse.Namespace) -> int:
    """Write a new folder.

    Raises:
        InputError: The workstation cannot be read, or the folder exists.
        MissingPackage: USD needs its library.
    """
    from seerob.app.exporting.cell import cell_of
    from seerob.description.formats import gltf_writing, mjcf_writing, urdf_writing, usd_writing
    from seerob.session.station import load

    home: Path = options.workstation
    beside = home if home.is_dir() else home.parent
    folder: Path = options.output or beside / f"exported_{options.to}"
    if folder.exists():
        raise InputError.at(folder, "", "exists already", "give the name of a new folder with -o")
    cell = cell_of(load(home).model)
    name = KINDS[options.to]
    with whole_folder(folder) as working:
        files: dict[str, bytes] = {}
        if options.to == "urdf":
            text, files = urdf_writing.written(cell.description, plain=True)
            (working / name).write_text(text, encoding="utf-8")
        elif options.to == "mjcf":
            text, files = mjcf_writing.written(cell.description, cell.home)
            (working / name).write_text(text, encoding="utf-8")
        elif options.to == "usd":
            usd_writing.write(working / name, cell.description, cell.home, cell.placed())
        else:
            (working / name).write_bytes(gltf_writing.written(cell.description, cell.placed()))
        for relative, content in files.items():
            (working / relative).parent.mkdir(parents=True, exist_ok=True)
            (working / relative).write_bytes(content)
    links = cell.description.links
    joints = sum(len(link.joints) for link in links)
    masses = [link.inertial.mass for link in links if link.inertial is not None]
    line("wrote", str(folder / name))
    line("found", f"{len(links) - 1} bodies, {joints} joints, {sum(masses):.4g} kg in {len(masses)} of them")
    if options.to == "glb" and joints:
        line("note", "glTF knows no joints: everything is where it stands when nothing drives it", "dim")
    if options.to == "urdf" and any(cell.home.values()):
        line("note", "URDF knows no pose: joints are at 0 there", "dim")
    for text in cell.notes:
        line("note", text, "dim")
    return Exit.WITHIN
