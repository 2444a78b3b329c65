"""``seerob import-aml``: a workstation folder from an AutomationML plant, to be completed by hand."""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterable, Iterator
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING

from seerob.app.console.terminal import Exit, line, tell
from seerob.core.errors import InputError
from seerob.core.files.whole_file import whole_folder
from seerob.core.snapshot import Finding
from seerob.files.tables.mapping import toml_value

if TYPE_CHECKING:
    from seerob.core.transforms import Array
    from seerob.description.formats.automationml import Attribute, Element, Interface, Plant

HELP = "make a workstation folder from an AutomationML plant: parts, places, robots to choose, variables"
EXAMPLE = "seerob import-aml cell.amlx my_cell"

GEOMETRY = {"COLLADAInterface", "GeometryDataConnector"}
VARIABLES = {"VariableInterface", "SignalInterface", "LogicInterface"}
ADDRESSES = ("refURI", "Address", "address", "Tag", "Variable", "Path")
"""Attributes of an interface that say where a variable is, the first that there is."""
KINDS = {
    "bool": "bool",
    "boolean": "bool",
    "string": "text",
}
"""Data types whose values are no numbers."""


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments."""
    sub.add_argument("plant", type=Path, help="the .aml or .amlx file")
    sub.add_argument("folder", type=Path, help="folder to make")


def run(options: argparse.Namespace) -> int:
    """Write the folder; nothing that exists is touched.

    Raises:
        InputError: The plant cannot be read, or the folder exists.
    """
    from seerob.description.formats.automationml import read

    folder: Path = options.folder
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError.at(folder, "", "exists already", "give the name of a new folder")
    plant = read(options.plant)
    made = Made(plant)
    try:
        with whole_folder(folder) as working:
            (working / "cad").mkdir()
            for name, data in made.meshes.items():
                (working / name).write_bytes(data)
            texts = made.files()
            for name, text in texts.items():
                (working / name).write_text(text, encoding="utf-8")
    except OSError as error:
        what = f"cannot be written: {error.strerror}"
        raise InputError.at(folder, "", what, "give a folder that may be written") from error
    for name in texts:
        line("wrote", str(folder / name))
    tell((*plant.findings, *made.findings))
    line("found", f"{made.parts} parts with a shape, {made.robots} robots, {len(made.variables)} variables")
    if not (made.parts or made.robots or made.variables):
        count = sum(1 for _ in plant.walk())
        text = (
            f"{count} elements, none of which has a geometry file ({', '.join(sorted(GEOMETRY))}), "
            f"the role Robot or a variable ({', '.join(sorted(VARIABLES))}): the folder is an empty "
            "workstation"
        )
        line("warning", text, "yellow")
    line(
        "next",
        f"choose the robots' models and give the variables their units, then seerob check-file {folder}",
    )
    return Exit.WITHIN


class Made:
    """What becomes of a plant.

    Attributes:
        meshes: Geometry files by their name in the folder.
        findings: What could not be taken over.
        variables: Entries of the dictionary, as text.
    """

    def __init__(self, plant: Plant) -> None:
        self.plant = plant
        self.meshes: dict[str, bytes] = {}
        self.findings: list[Finding] = []
        self.variables: list[str] = []
        self.parts = self.robots = 0
        self._names: set[str] = set()
        self._loaded: dict[str, bytes] = {}
        self._tables = [line for entry in plant.walk() for line in self._entry(*entry)]

    def files(self) -> dict[str, str]:
        """Content of each file by its name."""
        source = self.plant.file.name
        # Names are of others: as values they cannot end a comment.
        origin = f"{toml_value(source)} (CAEX {toml_value(self.plant.version)})"
        head = [
            f"# Made by `seerob import-aml` from {origin}; complete it by hand.",
            f"title = {toml_value(source)}",
        ]
        found = {"workstation.toml": "\n".join([*head, "", *self._tables])}
        if self.variables:
            note = [
                "# The variables that the plant names. A number needs its unit; nobody guesses it.",
                "# Name the source that reads each of them.",
                "",
            ]
            found["variables.toml"] = "\n".join([*note, *self.variables])
        return found

    def _entry(self, names: tuple[str, ...], element: Element, world: Array) -> Iterator[str]:
        path = "/".join(_plain(name) for name in names[1:]) or _plain(names[0])
        if element.has_role("Robot"):
            self.robots += 1
            yield from self._robot(self._unique(path.rpartition("/")[2]), world)
        for interface in element.interfaces:
            if interface.kind in GEOMETRY or _is_mesh(_value(interface, "refURI")):
                yield from self._part(path, interface, world)
            elif interface.kind in VARIABLES:
                self.variables.append("\n".join(self._variable(path, interface)))

    def _robot(self, name: str, world: Array) -> Iterator[str]:
        yield "# [[robots]]              # which one it is the plant does not say in a way that can be read"
        yield f"# name = {toml_value(name)}"
        yield '# model = "library:…"     # `seerob kinds` lists the library; or a path to its URDF'
        yield f"# base = {_pose(world)}"
        yield ""

    def _part(self, path: str, interface: Interface, world: Array) -> Iterator[str]:
        uri = _value(interface, "refURI")
        try:
            data = self._loaded[uri] if uri in self._loaded else self.plant.load(uri)
        except InputError as error:
            self.findings.append(Finding(level="warning", subject=path, text=str(error)))
            return
        self._loaded[uri] = data
        if "#" in uri:
            text = f"refers to a part of a file ({uri}); the whole file is taken"
            self.findings.append(Finding(level="warning", subject=path, text=text))
        file = f"cad/{_plain(PurePosixPath(uri.partition('#')[0].replace(chr(92), '/')).name)}"
        while self.meshes.get(file, data) != data:
            file = file.replace("cad/", "cad/_", 1)
        self.meshes[file] = data
        self.parts += 1
        yield "[[parts]]"
        yield f"name = {toml_value(self._unique(path))}"
        yield f"mesh = {toml_value(file)}"
        yield f"at = {_pose(world)}"
        yield ""

    def _variable(self, path: str, interface: Interface) -> Iterator[str]:
        name = self._unique(f"{path}/{_plain(interface.name)}")
        kind = next((a.type for a in interface.attributes.values() if a.type), "").rpartition(":")[2]
        address = next((v for key in ADDRESSES if (v := _value(interface, key))), "")
        unit = next((a.unit for a in _deep(interface.attributes.values()) if a.unit), "")
        yield "[[variables]]"
        yield f"name = {toml_value(name)}"
        yield 'source = "plc"'
        yield f"address = {toml_value(address)}" + ("" if address else "   # the plant does not say")
        if (known := KINDS.get(kind.lower())) is not None:
            yield f'type = "{known}"'
        elif unit:
            yield f"unit = {toml_value(unit)}   # as the plant states it"
        else:
            yield '# unit = …   # or type = "bool", "text", "choice"'
        yield ""

    def _unique(self, name: str) -> str:
        found, n = name, 1
        while found in self._names:
            n += 1
            found = f"{name}_{n}"
        self._names.add(found)
        return found


def _is_mesh(uri: str) -> bool:
    from seerob.description.mesh import READERS

    return PurePosixPath(uri.partition("#")[0].replace("\\", "/")).suffix.lower() in READERS


def _deep(attributes: Iterable[Attribute]) -> Iterator[Attribute]:
    for attribute in attributes:
        yield attribute
        yield from _deep(attribute.children.values())


def _value(interface: Interface, name: str) -> str:
    attribute = interface.attributes.get(name)
    return "" if attribute is None else attribute.value


def _plain(name: str) -> str:
    """A name with the characters that names may have here."""
    return re.sub(r"[^A-Za-z0-9_.\-]+", "_", name).strip("_.")[:60] or "unnamed"


def _pose(world: Array) -> str:
    from seerob.core.transforms import wxyz_from_rotation

    position = ", ".join(f"{x:.9g}" for x in world[:3, 3])
    wxyz = wxyz_from_rotation(world[:3, :3])
    if abs(wxyz[0]) > 1 - 1e-12:
        return f"{{ position = [{position}] }}"
    return f"{{ position = [{position}], wxyz = [{', '.join(f'{x:.9g}' for x in wxyz)}] }}"
