"""The files of a workstation folder that an AutomationML plant becomes, to be completed by hand."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import PurePosixPath
from typing import TYPE_CHECKING

from seerob.app.importing.folder import place, table_text
from seerob.core.errors import InputError
from seerob.core.printable import printable
from seerob.core.snapshot import Finding
from seerob.description.cad.names import plain_name
from seerob.files.tables.mapping import toml_value
from seerob.workstation.editing import literal

if TYPE_CHECKING:
    from seerob.core.transforms import Array
    from seerob.description.formats.automationml import Attribute, Element, Interface, Plant

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
            f"# Made by `seerob import` from {origin}; complete it by hand.",
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
        path = "/".join(plain_name(name) for name in names[1:]) or plain_name(names[0])
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
        yield f"# base = {literal(place(world))}"
        yield ""

    def _part(self, path: str, interface: Interface, world: Array) -> Iterator[str]:
        uri = _value(interface, "refURI")
        try:
            data = self._loaded[uri] if uri in self._loaded else self.plant.load(uri)
        except InputError as error:
            self.findings.append(Finding(level="warning", subject=path, text=str(error)))
            why = "; ".join(problem.what for problem in error.problems)[:1000]
            yield table_text("left_out", {"name": path, "why": printable(why)})
            return
        self._loaded[uri] = data
        if "#" in uri:
            text = f"refers to a part of a file ({uri}); the whole file is taken"
            self.findings.append(Finding(level="warning", subject=path, text=text))
        file = f"cad/{plain_name(PurePosixPath(uri.partition('#')[0].replace(chr(92), '/')).name)}"
        while self.meshes.get(file, data) != data:
            file = file.replace("cad/", "cad/_", 1)
        self.meshes[file] = data
        self.parts += 1
        yield "[[parts]]"
        yield f"name = {toml_value(self._unique(path))}"
        yield f"mesh = {toml_value(file)}"
        yield f"at = {literal(place(world))}"
        yield ""

    def _variable(self, path: str, interface: Interface) -> Iterator[str]:
        name = self._unique(f"{path}/{plain_name(interface.name)}")
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
