"""The files of a workstation folder that an AutomationML plant becomes, to be completed by hand."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from seerob.app.importing.folder import Densities, Files, files, place, table_text
from seerob.core.errors import InputError
from seerob.core.extras import MissingPackage
from seerob.core.printable import printable
from seerob.core.snapshot import Finding
from seerob.description.cad import reading
from seerob.description.cad.collada_kinematics import MARK
from seerob.description.cad.names import plain_name
from seerob.description.cad.recognised import recognised
from seerob.files.tables.mapping import toml_value
from seerob.workstation.editing import literal

if TYPE_CHECKING:
    from seerob.core.transforms import Array
    from seerob.description.cad.assembly import Assembly
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
        self._assemblies: dict[str, tuple[Assembly, Files]] = {}
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
        moving, shown, whole = self.robots, list[str](), set[str]()
        for interface in element.interfaces:
            if interface.kind in GEOMETRY or _is_mesh(_value(interface, "refURI")):
                shown += self._part(path, interface, world, whole)
            elif interface.kind in VARIABLES:
                self.variables.append("\n".join(self._variable(path, interface)))
        if element.has_role("Robot") and self.robots == moving:
            self.robots += 1
            yield from self._robot(self._unique(path.rpartition("/")[2]), world)
        yield from shown

    def _robot(self, name: str, world: Array) -> Iterator[str]:
        yield "# [[robots]]              # which one it is the plant does not say in a way that can be read"
        yield f"# name = {toml_value(name)}"
        yield '# model = "library:…"     # `seerob kinds` lists the library; or a path to its URDF'
        yield f"# base = {literal(place(world))}"
        yield ""

    def _part(self, path: str, interface: Interface, world: Array, whole: set[str]) -> Iterator[str]:
        """Tables of what an interface refers to; files that an element has as a whole are known already."""
        uri = _value(interface, "refURI")
        name = uri.partition("#")[0]
        if name in whole:
            return
        try:
            data = self._loaded[uri] if uri in self._loaded else self.plant.load(uri)
            if not _is_mesh(uri) or MARK in data:
                tables = list(self._assembly(path, name, data, world))
                whole.add(name)
                yield from tables
                return
        except (InputError, MissingPackage) as error:
            self.findings.append(Finding(level="warning", subject=path, text=str(error)))
            problems = error.problems if isinstance(error, InputError) else ()
            why = "; ".join(problem.what for problem in problems)[:1000] or str(error)
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

    def _assembly(self, path: str, uri: str, data: bytes, world: Array) -> Iterator[str]:
        """Tables of a file of several parts, or of mechanisms: STEP, COLLADA with kinematics, USD."""
        if uri not in self._assemblies:
            with TemporaryDirectory() as folder:
                name = PurePosixPath(uri.replace("\\", "/")).name
                file = Path(folder) / f"{plain_name(Path(name).stem)}{Path(name).suffix.lower()}"
                file.write_bytes(data)
                ending = recognised(file, data)
                found = reading.read(file, ending)
                made = files(found, file, Densities(), options={}, taken=self.meshes)
            self._assemblies[uri] = found, made
            folders = {row["name"]: self._unique(f"{row['name']}_of_plant") for row in made.robots}
            for file_name, content in made.meshes.items():
                self.meshes[_moved(file_name, folders)] = content
            for row in made.robots:
                row["written"]["model"] = _moved(row["written"]["model"], folders)
            for finding in found.findings:
                subject = f"{path}/{finding.subject}"
                self.findings.append(Finding(level=finding.level, subject=subject, text=finding.text))
        found, made = self._assemblies[uri]
        for row, instance in zip(made.parts, found.instances, strict=True):
            full = path if len(made.parts) == 1 else f"{path}/{row['name']}"
            where = place(world @ instance.world_from_shape)
            yield table_text("parts", row["written"] | {"name": self._unique(full), "at": where})
            self.parts += 1
        for row, moving in zip(made.robots, found.mechanisms, strict=True):
            own = path.rpartition("/")[2]
            name = self._unique(own if len(made.robots) == 1 else f"{own}_{row['name']}")
            where = place(world @ moving.world_from_base)
            yield table_text("robots", row["written"] | {"name": name, "base": where})
            self.robots += 1
        for row in made.missing:
            yield table_text("left_out", row["written"] | {"name": f"{path}: {row['name']}"[:500]})

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


def _moved(name: str, folders: dict[str, str]) -> str:
    """The name of a mechanism's file in a folder that no other mechanism of the plant has."""
    head, _, rest = name.partition("/")
    folder, _, rest = rest.partition("/")
    return f"{head}/{folders[folder]}/{rest}" if head == "robots" else name


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
