"""AutomationML plants (CAEX 2.15 and 3.0, ``.aml`` and ``.amlx``): structure, frames, geometry, variables.

CAEX by IEC 62424, the roles and interfaces by IEC 62714. The reader goes by the names of elements and
does not mind namespaces, so that both editions are read by the same lines. What it does not know it
leaves alone.
"""

from __future__ import annotations

import math
import posixpath
import zipfile
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import unquote
from xml.etree.ElementTree import Element as Node

import numpy as np

from seerob.core.errors import InputError
from seerob.core.files.bounded import TooLarge, content, unpacked
from seerob.core.snapshot import Finding
from seerob.core.transforms import Array, rotation_from_rpy, transform
from seerob.description.xml_values import MAX_BYTES, parse_xml

MAX_ELEMENTS = 200_000
MAX_DEPTH = 60
MAX_ENTRIES = 20_000
"""Files in a container."""
MAX_UNPACKED = 1 << 30
"""All of them together [byte]."""
RELATIONSHIPS = "_rels/.rels"
"""Where a container says what its files are."""
LENGTHS = {"": 1.0, "m": 1.0, "cm": 1e-2, "mm": 1e-3}
ANGLES = {"": math.pi / 180, "deg": math.pi / 180, "degree": math.pi / 180, "°": math.pi / 180, "rad": 1.0}


@dataclass(frozen=True)
class Attribute:
    """A value, with values of its own below it."""

    value: str
    unit: str = ""
    type: str = ""
    children: dict[str, Attribute] = field(default_factory=dict)


@dataclass(frozen=True)
class Interface:
    """Where an element meets others: a geometry file, a PLC variable, a signal."""

    name: str
    id: str
    classes: str
    """Path of its class: ``…/ExternalDataConnector/COLLADAInterface``."""
    attributes: dict[str, Attribute]

    @property
    def kind(self) -> str:
        """Last part of the path."""
        return _last(self.classes)


@dataclass(frozen=True, eq=False)
class Element:
    """One element of the plant."""

    name: str
    id: str
    roles: tuple[str, ...]
    """Paths of its roles: ``…/DiscManufacturingEquipment/Robot``."""
    attributes: dict[str, Attribute]
    interfaces: tuple[Interface, ...]
    children: tuple[Element, ...]
    parent_from_element: Array
    """By its ``Frame`` attribute, shape (4, 4)."""

    def has_role(self, role: str) -> bool:
        """Whether one of its roles is, or ends with, a name."""
        return any(_last(path) == role for path in self.roles)


@dataclass(frozen=True, eq=False)
class Plant:
    """A file as it was read."""

    file: Path
    version: str
    """Version of CAEX."""
    roots: tuple[Element, ...]
    """Instance hierarchies."""
    links: tuple[tuple[str, str], ...]
    """Interfaces that are linked, as ``element id:name`` or as interface id."""
    findings: tuple[Finding, ...]
    container: Path | None = None
    """The ``.amlx`` that it came from."""
    inside: str = ""
    """Folder of the file in the container."""

    def walk(self) -> Iterator[tuple[tuple[str, ...], Element, Array]]:
        """Every element with the names that lead to it and ``world_from_element``, parents first."""
        for root in self.roots:
            yield from _walk((), root, np.eye(4))

    def load(self, uri: str) -> bytes:
        """Content of a file that the plant refers to.

        Raises:
            InputError: It is not there, leads out of the plant's folder, or is too large.
        """
        path = unquote(uri.partition("#")[0]).replace("\\", "/").removeprefix("file:///")
        # In a container a path from the root is one from the container's own.
        inside = "" if self.container is not None and path.startswith("/") else self.inside
        path = path.lstrip("/") if self.container is not None else path
        name = posixpath.normpath(posixpath.join(inside, path))
        if path.startswith("/") or ":" in path or name.startswith(".."):
            what = "leads out of the plant's folder"
            raise InputError.at(
                self.file, uri, what, "put the file beside the plant and refer to it relatively"
            )
        if self.container is not None:
            return _unpack(self.container, name)
        file = self.file.parent / name
        if not file.resolve().is_relative_to(self.file.parent.resolve()) or not file.is_file():
            raise InputError.at(self.file, uri, "no such file", "put it beside the plant")
        try:
            return content(file, MAX_BYTES)
        except TooLarge:
            what = f"larger than {MAX_BYTES >> 20} MiB"
            raise InputError.at(self.file, uri, what, "simplify it first") from None


def _walk(
    names: tuple[str, ...], element: Element, world_from_parent: Array
) -> Iterator[tuple[tuple[str, ...], Element, Array]]:
    names, world = (*names, element.name), world_from_parent @ element.parent_from_element
    yield names, element, world
    for child in element.children:
        yield from _walk(names, child, world)


def read(path: Path) -> Plant:
    """The plant of a file.

    Raises:
        InputError: It is missing, too large, no CAEX, or hostile.
    """
    if not path.is_file():
        what = "is a folder" if path.is_dir() else "no such file"
        raise InputError.at(path, "", what, "give an .aml or .amlx file")
    container, inside = None, ""
    reader = _Reader(str(path))
    if path.suffix.lower() == ".amlx" or zipfile.is_zipfile(path):
        container = path
        name = _main_part(path, reader)
        data, inside = _unpack(path, name), posixpath.dirname(name)
    else:
        try:
            data = content(path, MAX_BYTES)
        except TooLarge:
            what = f"larger than {MAX_BYTES >> 20} MiB"
            raise InputError.at(path, "", what, "export the cell alone") from None
    root = parse_xml(data, str(path))
    if _local(root.tag) != "CAEXFile":
        raise InputError.at(path, _local(root.tag), "is no CAEXFile", "give an AutomationML file")
    reader.know(root)
    roots = tuple(
        reader.element(node, MAX_DEPTH, group=True)
        for node in root
        if _local(node.tag) == "InstanceHierarchy"
    )
    reader.tell()
    if not roots:
        reader.note("warning", "has no instance hierarchy: it describes classes, not a plant")
    version = str(root.get("SchemaVersion", "unknown"))
    return Plant(path, version, roots, tuple(reader.links), tuple(reader.findings), container, inside)


# -- the container ------------------------------------------------------------------------------


def _open(path: Path) -> zipfile.ZipFile:
    try:
        return zipfile.ZipFile(path)
    except (zipfile.BadZipFile, OSError, ValueError, NotImplementedError) as error:
        raise InputError.at(path, "", f"no readable container: {error}", "export it again") from error


def _main_part(path: Path, reader: _Reader) -> str:
    """The document that the container says is its root, else the one nearest the top."""
    with _open(path) as archive:
        entries = archive.infolist()
        if len(entries) > MAX_ENTRIES or sum(e.file_size for e in entries) > MAX_UNPACKED:
            what = f"{len(entries)} files of {sum(e.file_size for e in entries) >> 20} MiB"
            raise InputError.at(path, "", what, f"at most {MAX_ENTRIES} of {MAX_UNPACKED >> 20} MiB")
        names = {e.filename for e in entries}
    roots = _root_documents(path) if RELATIONSHIPS in names else []
    if missing := [name for name in roots if name not in names]:
        what = f"its root document {missing[0]!r} is not in the container"
        raise InputError.at(path, RELATIONSHIPS, what, "export it again")
    if len(roots) > 1:
        reader.note("warning", f"has several root documents, read is the first: {', '.join(roots)}")
    if roots:
        return roots[0]
    found = sorted((name for name in names if name.lower().endswith(".aml")), key=lambda n: (len(n), n))
    if not found:
        raise InputError.at(path, "", "contains no .aml file", "export it again")
    if len(found) > 1:
        # Libraries lie in folders below; the plant is the one nearest the top.
        text = f"names no root document; of {len(found)} files the one nearest the top is read: {found[0]}"
        reader.note("assumed", text)
    return found[0]


def _root_documents(path: Path) -> list[str]:
    """What the relationships of a container call its root ([OPC-10000-83]_, 7.4), in any case of letters."""
    root = parse_xml(_unpack(path, RELATIONSHIPS), f"{path}: {RELATIONSHIPS}")
    targets = [
        unquote(str(node.get("Target", ""))).lstrip("/")
        for node in root
        if str(node.get("Type", "")).lower().endswith("/relationship/rootdocument")
    ]
    return list(dict.fromkeys(posixpath.normpath(target) for target in targets if target))


def _unpack(path: Path, name: str) -> bytes:
    with _open(path) as archive:
        try:
            entry = archive.getinfo(name.lstrip("/"))
            if entry.file_size > MAX_BYTES:
                raise InputError.at(path, name, f"larger than {MAX_BYTES >> 20} MiB", "simplify it first")
            return unpacked(archive, entry, MAX_BYTES)
        except TooLarge:
            raise InputError.at(
                path, name, f"larger than {MAX_BYTES >> 20} MiB", "simplify it first"
            ) from None
        except KeyError:
            raise InputError.at(path, name, "is not in the container", "export it again") from None
        except (
            zipfile.BadZipFile,
            zlib.error,
            RuntimeError,
            OSError,
            EOFError,
            ValueError,
        ) as error:
            raise InputError.at(path, name, f"cannot be unpacked: {error}", "export it again") from error


# -- the tree -----------------------------------------------------------------------------------


def _local(tag: object) -> str:
    return tag.rpartition("}")[2] if isinstance(tag, str) else ""


class _Reader:
    def __init__(self, file: str) -> None:
        self.file = file
        self.links: list[tuple[str, str]] = []
        self.findings: list[Finding] = []
        self._count = 0
        self._turned = self._comma = False
        self._classes: dict[str, Node] = {}
        self._masters: dict[str, str] = {}
        self._inherited: list[str] = []
        self._mirrors: list[str] = []
        self._unknown: dict[str, int] = {}

    def know(self, root: Node) -> None:
        """Remember classes by their path, and elements by their identifier."""
        waiting = [(lib, str(lib.get("Name", ""))) for lib in root if _local(lib.tag) == "SystemUnitClassLib"]
        while waiting:
            node, path = waiting.pop()
            if _local(node.tag) == "SystemUnitClass":
                self._classes.setdefault(path, node)
            inner = (child for child in node if _local(child.tag) == "SystemUnitClass")
            waiting += [(child, f"{path}/{child.get('Name', '')}") for child in inner]
            if len(self._classes) > MAX_ELEMENTS:
                what = f"more than {MAX_ELEMENTS} classes"
                raise InputError.at(self.file, "", what, "export the cell alone")
        for node in root.iter():
            if _local(node.tag) == "InternalElement" and node.get("ID"):
                self._masters[_plain(str(node.get("ID")))] = str(node.get("Name", ""))

    def tell(self) -> None:
        """Say how many elements have something from their class, and which are others once more."""
        if self._inherited:
            names = ", ".join(self._inherited[:5])
            text = f"{len(self._inherited)} elements have from their classes what they do not state: {names}"
            self.note("note", text)
        if self._mirrors:
            names = ", ".join(self._mirrors[:5])
            text = f"{len(self._mirrors)} elements mirror others, which are there once: {names}"
            self.note("note", text)
        for path, count in sorted(self._unknown.items())[:20]:
            many = f"{count} element{'' if count == 1 else 's'}"
            self.note("note", f"the class {path} of {many} is not in the file: nothing is taken from it")

    def _class_nodes(self, node: Node) -> list[Node]:
        """Classes of an element, its own first, then what that one is derived from."""
        found: list[Node] = []
        path = str(node.get("RefBaseSystemUnitPath", "")).replace("[", "").replace("]", "")
        while path and len(found) < MAX_DEPTH:
            known = self._classes.get(path)
            if known is None:
                self._unknown[path[:120]] = self._unknown.get(path[:120], 0) + 1
                break
            if any(known is other for other in found):
                self.note("warning", f"the class {path[:120]} is derived from itself")
                break
            found.append(known)
            path = str(known.get("RefBaseClassPath", "")).replace("[", "").replace("]", "")
        return found

    def note(self, level: str, text: str) -> None:
        """Add a finding."""
        self.findings.append(Finding(level=level, subject=Path(self.file).name, text=text))

    def element(self, node: Node, depth: int, *, group: bool = False) -> Element:
        """An internal element, or a hierarchy as one."""
        self._count += 1
        if self._count > MAX_ELEMENTS:
            raise InputError.at(self.file, "", f"more than {MAX_ELEMENTS} elements", "export the cell alone")
        if depth == 0:
            raise InputError.at(self.file, node.get("Name", ""), f"nested {MAX_DEPTH} deep", "flatten it")
        attributes = self._attributes(node, depth)
        roles: list[str] = []
        interfaces: list[Interface] = []
        children: list[Element] = []
        for child in node:
            tag = _local(child.tag)
            if tag == "InternalElement":
                children.append(self.element(child, depth - 1))
            elif tag == "ExternalInterface":
                interfaces += self._interfaces(child, depth)
            elif tag in ("RoleRequirements", "SupportedRoleClass"):
                roles.append(child.get("RefBaseRoleClassPath") or child.get("RefRoleClassPath") or "")
            elif tag == "InternalLink":
                a, b = child.get("RefPartnerSideA", ""), child.get("RefPartnerSideB", "")
                self.links.append((_plain(a), _plain(b)))
        base = str(node.get("RefBaseSystemUnitPath", ""))
        master = _plain(base).partition(":")[0]
        if base and (master in self._masters or "/" not in base):
            # The same thing in another tree: where it is and what it looks like is said at the master.
            if master in self._masters:
                self._mirrors.append(f"{node.get('Name', '')} ({self._masters[master]})")
            else:
                what = f"{node.get('Name', '')} mirrors an element that is not in the file"
                self.note("warning", what)
        else:
            self._inherit(node, depth, attributes, roles, interfaces, children)
        name = str(node.get("Name", "")).strip() or ("plant" if group else "unnamed")
        frame = self._frame(attributes.get("Frame"), name)
        where = str(node.get("ID", ""))
        return Element(
            name, _plain(where), tuple(roles), attributes, tuple(interfaces), tuple(children), frame
        )

    def _inherit(
        self,
        node: Node,
        depth: int,
        attributes: dict[str, Attribute],
        roles: list[str],
        interfaces: list[Interface],
        children: list[Element],
    ) -> None:
        """Add what only the classes of an element have.

        An instance is a copy of its class, of which tools may have taken something out: so interfaces and
        inner elements are taken from the class only where the instance has none at all.
        """
        bare = not interfaces, not children
        before = len(attributes), len(roles), len(interfaces), len(children)
        for known in self._class_nodes(node):
            for key, attribute in self._attributes(known, depth).items():
                attributes.setdefault(key, attribute)
            for child in known:
                tag = _local(child.tag)
                if tag == "ExternalInterface" and bare[0]:
                    names = {interface.name for interface in interfaces}
                    interfaces += [i for i in self._interfaces(child, depth) if i.name not in names]
                elif tag == "InternalElement" and bare[1]:
                    if child.get("Name") not in {element.name for element in children}:
                        children.append(self.element(child, depth - 1))
                elif tag == "SupportedRoleClass":
                    role = child.get("RefRoleClassPath") or ""
                    if role not in roles:
                        roles.append(role)
        if (len(attributes), len(roles), len(interfaces), len(children)) != before:
            self._inherited.append(str(node.get("Name", "")))

    def _interfaces(self, node: Node, depth: int) -> Iterator[Interface]:
        """The interface and, in CAEX 3.0, those nested in it."""
        if depth == 0:
            raise InputError.at(self.file, node.get("Name", ""), f"nested {MAX_DEPTH} deep", "flatten it")
        yield Interface(
            str(node.get("Name", "")),
            _plain(str(node.get("ID", ""))),
            str(node.get("RefBaseClassPath", "")),
            self._attributes(node, depth),
        )
        for child in node:
            if _local(child.tag) == "ExternalInterface":
                yield from self._interfaces(child, depth - 1)

    def _attributes(self, node: Node, depth: int) -> dict[str, Attribute]:
        if depth == 0:
            raise InputError.at(self.file, node.get("Name", ""), f"nested {MAX_DEPTH} deep", "flatten it")
        found: dict[str, Attribute] = {}
        for child in node:
            if _local(child.tag) != "Attribute":
                continue
            values = {_local(x.tag): (x.text or "").strip() for x in child if _local(x.tag) != "Attribute"}
            value = values.get("Value") or values.get("DefaultValue") or ""
            found[str(child.get("Name", ""))] = Attribute(
                value,
                str(child.get("Unit", "")).strip(),
                str(child.get("AttributeDataType", "")),
                self._attributes(child, depth - 1),
            )
        return found

    def _frame(self, frame: Attribute | None, name: str) -> Array:
        """``parent_from_element`` of a ``Frame`` attribute."""
        if frame is None:
            return np.eye(4)
        position = [self._number(frame, axis, LENGTHS, name) for axis in ("x", "y", "z")]
        angles = [self._number(frame, axis, ANGLES, name) for axis in ("rx", "ry", "rz")]
        if sum(abs(a) > 0 for a in angles) > 1 and not self._turned:
            self._turned = True
            text = (
                "frames that are turned about more than one axis are read as turns about the fixed axes x, "
                "then y, then z; the norm's text was not at hand: check one of them"
            )
            self.note("assumed", text)
        return transform(rotation_from_rpy(angles), position)

    def _number(self, frame: Attribute, axis: str, units: dict[str, float], name: str) -> float:
        attribute = frame.children.get(axis)
        if attribute is None or not attribute.value:
            return 0.0
        key = f"{name}.Frame.{axis}"
        if attribute.unit not in units:
            known = ", ".join(unit for unit in units if unit)
            raise InputError.at(self.file, key, f"unknown unit {attribute.unit!r}", f"known: {known}")
        if "," in attribute.value and not self._comma:
            self._comma = True
            self.note(
                "assumed", f"{key} = {attribute.value[:40]!r}: commas in numbers are read as decimal points"
            )
        try:
            value = float(attribute.value.replace(",", ".")) * units[attribute.unit]
        except ValueError:
            value = math.nan
        if not abs(value) < 1e5:
            raise InputError.at(
                self.file, key, f"{attribute.value[:40]!r} is no length or angle", "correct it"
            )
        return value


def _last(path: str) -> str:
    """The last name of a path; CAEX 3.0 puts names with a slash or the like into brackets."""
    return path.rpartition("[")[2][:-1] if path.endswith("]") else path.rpartition("/")[2]


def _plain(identifier: str) -> str:
    """An ID without braces and in one case: files differ in both, even within themselves."""
    return identifier.replace("{", "").replace("}", "").lower()
