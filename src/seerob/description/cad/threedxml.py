"""3DXML as XML with triangles: products, instances and surfaces of one or several documents of an archive.

Read here and not by trimesh 5.2.0, which loses the hierarchy and names, takes documents of several files for
empty ones and needs normals. Lengths are millimetres and z is up, as CATIA has them. CATIA's own binary or
encrypted surfaces only CATIA reads.
"""

from __future__ import annotations

import io
import zipfile
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import unquote
from xml.etree.ElementTree import Element

import numpy as np

from seerob.core.files.bounded import TooLarge, unpacked
from seerob.core.shapes import Mesh
from seerob.core.transforms import Array
from seerob.description.cad.assembly import SINGLE, Assembly, Instance, Shape
from seerob.description.cad.names import told_apart
from seerob.description.cad.recognised import refused
from seerob.description.mesh import by_color
from seerob.description.mesh_files import Color, MeshSource
from seerob.description.shapes.mesh_bodies import joined

MAX_INSTANCES = 200_000
MAX_DEPTH = 100
MAX_DOCUMENTS = 20_000
MILLIMETRE = 1e-3
FARTHEST = 1e9
"""No coordinate is larger [mm]."""

_Key = tuple[str, str]
"""A document and an identity in it."""


@dataclass(eq=False)
class _Product:
    name: str
    children: list[tuple[str, _Key, Array]] = field(default_factory=list)
    """Name, product and place of each instance."""
    surfaces: list[_Key] = field(default_factory=list)
    """Representations."""


def read(source: MeshSource) -> Assembly:
    """The assembly of a 3DXML file.

    Raises:
        InputError: It cannot be read, or its surfaces are CATIA's own.
    """
    with source.parsing("3DXML file"):
        return _Archive(source).assembly()


class _Archive:
    def __init__(self, source: MeshSource) -> None:
        self.source = source
        self.left = source.max_bytes
        """How much more is unpacked [byte]."""
        self.faces = 0
        self.archive: zipfile.ZipFile | None = None
        self.entries: dict[str, str] = {}
        if source.data[:2] == b"PK":
            self.archive = zipfile.ZipFile(io.BytesIO(source.data))
            self.entries = {name.lower(): name for name in self.archive.namelist()}
        self.products: dict[_Key, _Product] = {}
        self.files: dict[_Key, str] = {}
        """Where the surface of a representation is."""
        self.inner: dict[_Key, Element] = {}
        """Surfaces that are in the document itself."""
        self.documents: list[str] = []
        self.roots: list[_Key] = []
        self.shapes: dict[_Key | str, int | str] = {}
        """By the file of the surface, or by the representation that has it in its document."""
        self.made: list[Shape] = []
        self.instances: list[Instance] = []
        self.left_out: list[tuple[str, str]] = []

    def assembly(self) -> Assembly:
        start = self.start()
        self.document(start)
        roots = [key for key in self.roots if key in self.products] or self.unused()
        names = told_apart(self.products[key].name for key in roots)
        for name, key in zip(names, roots, strict=True):
            self.walk(key, (name,), np.eye(4), ())
        if not self.instances:
            if any("CATIA" in why for _, why in self.left_out):
                raise refused(self.source.path, "CATIA 3DEXPERIENCE")
            self.source.fail("holds no triangles", "export it as 3DXML with the XML tessellation")
        self.source.note("the unit of 3DXML is the millimetre, and z is up")
        return Assembly(
            "3DXML",
            "mm",
            tuple(self.made),
            tuple(self.instances),
            tuple(self.source.findings),
            tuple(self.left_out),
            self.source.files,
        )

    # -- documents --------------------------------------------------------------------------

    def start(self) -> str:
        """Name of the document that the manifest calls the root."""
        if self.archive is None:
            return self.source.path.name
        if "manifest.xml" in self.entries:
            root = self.xml(self.content("manifest.xml")).find(".//{*}Root")
            if root is not None and root.text:
                return root.text.strip()
        return next((name for name in self.entries.values() if name.lower().endswith(".3dxml")), "")

    def content(self, name: str) -> bytes:
        """Bytes of a file of the archive; empty when there is none of the name."""
        if self.archive is None:
            own = name == self.source.path.name
            data = self.source.data if own else self.source.beside(name) or b""
            self.left -= len(data)
            if self.left < 0:
                what = f"with {name[:200]!r} it is larger than {self.source.max_bytes} bytes"
                self.source.fail(what, "export the cell alone")
            return data
        entry = self.entries.get(name.lower())
        if entry is None:
            return b""
        try:
            data = unpacked(self.archive, entry, self.left)
        except TooLarge as error:
            self.source.fail(f"{entry[:200]}: {error}", "export the cell alone")
        except RuntimeError:  # with a password
            raise refused(self.source.path, "CATIA 3DEXPERIENCE") from None
        self.left -= len(data)
        return data

    def xml(self, data: bytes) -> Element:
        from defusedxml.ElementTree import fromstring

        root: Element = fromstring(data, forbid_dtd=True)
        return root

    def document(self, name: str) -> None:
        """Remember what a document says of products, and read those that it names."""
        waiting = [name]
        while waiting:
            name = waiting.pop()
            if name in self.documents:
                continue
            self.documents.append(name)
            if len(self.documents) > MAX_DOCUMENTS:
                self.source.fail(f"has more than {MAX_DOCUMENTS} documents", "export the cell alone")
            data = self.content(name)
            if not data:
                self.left_out.append((name or "its root document", "a document that is not in the archive"))
                continue
            if not data.lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"<"):
                raise refused(self.source.path, "CATIA 3DEXPERIENCE")
            waiting += self.told(name, self.xml(data))

    def told(self, name: str, root: Element) -> list[str]:
        """Other documents that one names."""
        others: list[str] = []

        def key(text: str | None) -> _Key:
            where, _, identity = unquote((text or "").strip()).rpartition("#")
            identity = identity.rpartition(":loc:")[2]
            file = where.rpartition(":")[2]
            if file and file not in self.documents:
                others.append(file)
            return (file or name, identity)

        structure = root.find("{*}ProductStructure")
        if structure is not None and len(self.documents) == 1:
            self.roots.append((name, structure.get("root", "")))
        for element in root.iter():
            tag = element.tag.rpartition("}")[2] if isinstance(element.tag, str) else ""
            own = (name, element.get("id", ""))
            if tag == "Reference3D":
                self.product(own).name = self.name(element)
            elif tag == "Instance3D":
                child = key(element.findtext("{*}IsInstanceOf"))
                parent = self.product(key(element.findtext("{*}IsAggregatedBy")))
                parent.children.append((self.name(element), child, self.matrix(element)))
            elif tag == "InstanceRep":
                surface = key(element.findtext("{*}IsInstanceOf"))
                self.product(key(element.findtext("{*}IsAggregatedBy"))).surfaces.append(surface)
            elif tag in ("ReferenceRep", "RepFormat") and element.get("associatedFile"):
                # Until edition 3 a format of its own said where the surface of its owner is.
                own = (name, element.get("owner", own[1]))
                where, _, inside = unquote(element.get("associatedFile", "")).rpartition("#")
                self.files[own] = (where or inside).rpartition(":")[2]
                if (where and not self.files[own]) or ":loc" in (where or inside):
                    self.files[own] = f"#{inside.rpartition(':loc:')[2]}"
            elif tag == "Representation":
                self.inner[own] = element
        return others

    def product(self, key: _Key) -> _Product:
        return self.products.setdefault(key, _Product(""))

    def name(self, element: Element) -> str:
        names = (element.get("name"), element.findtext("{*}PLM_ExternalID"))
        return next((text.strip() for text in names if text and text.strip()), "")

    def matrix(self, element: Element) -> Array:
        text = element.findtext("{*}RelativeMatrix")
        matrix = np.eye(4)
        if text is None:
            return matrix
        values = np.array(text.split(), float)
        if values.shape != (12,) or not np.isfinite(values).all():
            self.source.fail(f"a place is {text[:80]!r}", "twelve numbers are expected")
        # Three columns of the rotation, then the position.
        matrix[:3] = values.reshape(4, 3).T
        matrix[:3, 3] *= MILLIMETRE
        return matrix

    def unused(self) -> list[_Key]:
        """Products that no other has, where the document names no root."""
        used = {child for product in self.products.values() for _, child, _ in product.children}
        return [key for key in self.products if key not in used]

    # -- the tree ---------------------------------------------------------------------------

    def walk(self, key: _Key, path: tuple[str, ...], world: Array, above: tuple[_Key, ...]) -> None:
        if len(path) > MAX_DEPTH or len(self.instances) > MAX_INSTANCES or key in above:
            what = f"contains itself, nests deeper than {MAX_DEPTH} or has more than {MAX_INSTANCES} parts"
            self.source.fail(what, "export the cell alone")
        product = self.products[key]
        for surface in product.surfaces:
            number = self.shape(surface, product.name or path[-1])
            if isinstance(number, str):
                self.left_out.append(("/".join(path), number))
            else:
                self.instances.append(Instance(path, number, world))
        wanted = []
        for name, child, _ in product.children:
            there = self.products.get(child)
            wanted.append(name or ("" if there is None else there.name) or "part")
        for name, (_, child, matrix) in zip(told_apart(wanted), product.children, strict=True):
            if child in self.products:
                self.walk(child, (*path, name), world @ matrix, (*above, key))
            else:
                self.left_out.append(("/".join((*path, name)), "a product that is not in the archive"))
        if not product.surfaces and not product.children:
            self.left_out.append(("/".join(path), "has no shape"))

    def shape(self, key: _Key, name: str) -> int | str:
        file = self.files.get(key, "")
        known = (key[0], file) if file.startswith("#") else file or key
        if known not in self.shapes:
            self.shapes[known] = self.surface(key, name)
        return self.shapes[known]

    def surface(self, key: _Key, name: str) -> int | str:
        file = self.files.get(key, "")
        if file.startswith("#"):
            root: Any = self.inner.get((key[0], file[1:]))
            if root is None:
                return "a surface that is not in the document"
        else:
            data = self.content(file)
            if not data:
                return f"its surface, {file[:80]}, is not in the archive"
            if not data.lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"<"):
                return "its surface is CATIA's own, binary or encrypted: export with the XML tessellation"
            root = self.xml(data)
        pieces = [mesh for rep in root.iter() if _is_polygonal(rep) for mesh in self.meshes(rep, name)]
        if not pieces:
            return "its representation holds no triangles"
        whole, _ = joined(pieces)
        if not len(whole.faces):
            return "nothing but triangles without area"
        deviation = SINGLE * float(np.abs(whole.vertices).max())
        self.made.append(Shape(name, by_color(pieces) or (whole,), deviation))
        return len(self.made) - 1

    def meshes(self, rep: Element, name: str) -> list[Mesh]:
        """One per face, in metres, of the finest level of detail."""
        text = rep.findtext("{*}VertexBuffer/{*}Positions")
        if text is None:
            return []
        vertices = np.array(text.replace(",", " ").split(), float)
        if len(vertices) % 3 or not (np.abs(vertices) < FARTHEST).all():
            self.source.fail("its positions are no triples of numbers", "export it again", name)
        vertices = vertices.reshape(-1, 3) * MILLIMETRE
        whole = _color(rep)
        found = []
        for face in rep.iterfind("{*}Faces/{*}Face"):
            triangles = self.triangles(face, len(vertices), name)
            self.faces += len(triangles)
            if self.faces > self.source.max_faces:
                self.source.fail(f"has more than {self.source.max_faces} triangles", "export it coarser")
            if len(triangles):
                found.append(Mesh(vertices, triangles, _color(face) or whole or Mesh.color))
        return found

    def triangles(self, face: Element, count: int, name: str) -> Any:
        rows = [np.array(face.get("triangles", "").split(), np.int64)]
        rows[0] = rows[0][: len(rows[0]) // 3 * 3].reshape(-1, 3)
        for kind in ("strips", "fans"):
            for piece in face.get(kind, "").split(","):
                corners = np.array(piece.split(), np.int64)
                if len(corners) < 3:
                    continue
                if kind == "fans":
                    first = np.full(len(corners) - 2, corners[0])
                    rows.append(np.column_stack([first, corners[1:-1], corners[2:]]))
                else:
                    strip = np.column_stack([corners[:-2], corners[1:-1], corners[2:]])
                    strip[1::2] = strip[1::2, [1, 0, 2]]  # every other one runs backward
                    rows.append(strip)
        triangles = np.vstack(rows)
        if len(triangles) and (triangles.min() < 0 or triangles.max() >= count):
            self.source.fail(f"a face names vertex {triangles.max()} of {count}", "export it again", name)
        return triangles.astype(np.int32)


def _is_polygonal(element: Element) -> bool:
    kind = next((value for key, value in element.items() if key.rpartition("}")[2] == "type"), "")
    return kind.rpartition(":")[2] == "PolygonalRepType"


def _color(element: Element) -> Color | None:
    color = element.find("{*}SurfaceAttributes/{*}Color")
    if color is None:
        return None
    r, g, b = (min(max(float(color.get(key, "0.7")), 0.0), 1.0) for key in ("red", "green", "blue"))
    return r, g, b, min(max(float(color.get("alpha", "1")), 0.0), 1.0)
