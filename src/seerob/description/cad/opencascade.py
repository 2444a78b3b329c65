"""OpenCASCADE asked for products, usages, colours, materials and triangles; in the parsers' process alone.

Answers with plain data. It reads copies in a folder of their own; other files that a STEP file names are put
there when they lie in its folder or below, and are named as missing when they do not: OpenCASCADE itself
would follow a path to anywhere.
"""

from __future__ import annotations

import math
import re
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seerob.core.errors import InputError
from seerob.core.transforms import Array
from seerob.description.cad.names import told_apart
from seerob.description.mesh_files import MeshSource

TURN = 0.35
"""Largest angle between neighbouring triangles of a curved surface [rad]: small holes stay round."""
COLOR = (0.7, 0.72, 0.75, 1.0)
"""Shown of a face without a colour: red, green, blue, alpha in 0…1."""
MAX_INSTANCES = 200_000
MAX_DEPTH = 100
COARSE, FINE = 1e-8, 1e-11
"""Relative errors that volumes are integrated to, of which the first tells how good the second is."""
MAX_CORNERS = 64
"""Corners of a plane face that are told."""
MAX_SAMPLES = 40_000
"""Points of a shape's curved surfaces at which its triangles are compared with it."""
AMID = np.array([[1, 1, 1], [1.5, 1.5, 0], [0, 1.5, 1.5], [1.5, 0, 1.5]]) / 3
"""Shares of a triangle's corners at its middle and those of its edges."""
ALL_OVER = np.array([(i, j, 8 - i - j) for i in range(9) for j in range(9 - i)]) / 8
"""Shares of its corners at points an eighth of its edges apart."""
_REFERENCES = re.compile(
    rb"(?:APPLIED_EXTERNAL_IDENTIFICATION_ASSIGNMENT|DOCUMENT_FILE)\s*\(\s*'((?:[^']|'')*)'", re.I
)
_NAMELESS = re.compile(rb"NEXT_ASSEMBLY_USAGE_OCCURRENCE\s*\(\s*'((?:[^']|'')*)'\s*,\s*'\s*'", re.I)
_FILE = re.compile(rb"(?i)\.(stp|step|p21|igs|iges|ste)$")
_SCHEMAS = {"CONFIG_CONTROL_DESIGN": "AP203", "AP203": "AP203", "AUTOMOTIVE": "AP214", "AP242": "AP242"}


def plain(
    path: Path, data: bytes, max_bytes: int, max_faces: int, iges: bool, tolerance: float
) -> Iterator[dict[str, Any]]:
    """What a file holds, in numbers, texts and bytes: how many products, each of them, and all the rest."""
    source = MeshSource(path, data, max_bytes, max_faces)
    with source.parsing("IGES file" if iges else "STEP file"), tempfile.TemporaryDirectory() as folder:
        yield from _Document(source, Path(folder), iges, tolerance).described()


_DENSITY = re.compile(rb"density", re.I)
_PREFIXES = {
    "spKilo": 3,
    "spHecto": 2,
    "spDeca": 1,
    "spDeci": -1,
    "spCenti": -2,
    "spMilli": -3,
    "spMicro": -6,
}
"""Powers of ten."""
_LIGHTEST, _DENSEST = 1.0, 23e3
"""Densities of solids, from aerogel to osmium [kg/m³]; a figure beyond them has another unit than it says."""


class _Document:
    """One file as OpenCASCADE has read it."""

    def __init__(self, source: MeshSource, folder: Path, iges: bool, tolerance: float) -> None:
        from OCP.TCollection import TCollection_ExtendedString
        from OCP.TDocStd import TDocStd_Document
        from OCP.XCAFDoc import XCAFDoc_DocumentTool

        self.source, self.tolerance = source, tolerance
        self.missing: list[str] = []
        self.copies: dict[bytes, bytes] = {}
        self.nameless: set[str] = set()
        self.densities: dict[str, float | None] = {}
        """Of materials, by name, as the file states them [kg/m³]; None of one that is not understood."""
        self.document = TDocStd_Document(TCollection_ExtendedString("XmlXCAF"))
        self.format, self.unit = ("IGES", "in the file") if iges else (_schema(source.data), "mm")
        if iges:
            self._read_iges(folder)
        else:
            self._read_step(folder)
        self.labels = XCAFDoc_DocumentTool.ShapeTool_s(self.document.Main())
        self.products: dict[str, tuple[Any, str]] = {}
        """Label and name of each that is no assembly, by its entry."""
        self.placed: list[tuple[tuple[str, ...], str, list[list[float]], Any]] = []
        """Names, entry of the product, place [m] and colour of each part."""
        self.left_out: list[tuple[str, str]] = []
        self.faces = 0

    def _read_iges(self, folder: Path) -> None:
        from OCP.IFSelect import IFSelect_ReturnStatus
        from OCP.IGESCAFControl import IGESCAFControl_Reader

        file = folder / "part.igs"
        file.write_bytes(self.source.data)
        reader = IGESCAFControl_Reader()
        reader.SetNameMode(True)
        reader.SetColorMode(True)
        done = reader.ReadFile(str(file)) == IFSelect_ReturnStatus.IFSelect_RetDone
        if not done or not reader.Transfer(self.document):
            self.source.fail("is not a readable IGES file", "export it as STEP")
        unit = reader.IGESModel().GlobalSection().UnitName()
        self.unit = "" if unit is None else str(unit.ToCString()).lower()
        self.source.note("IGES keeps neither assemblies nor instances; export STEP where there is a choice")

    def _read_step(self, folder: Path) -> None:
        from OCP.collections import Sequence_TCollection_AsciiString
        from OCP.IFSelect import IFSelect_ReturnStatus
        from OCP.STEPCAFControl import STEPCAFControl_Reader

        file = folder / "assembly.step"
        file.write_bytes(self._local(self.source.data, folder, 0))
        reader = STEPCAFControl_Reader()
        for mode in (
            reader.SetNameMode,
            reader.SetColorMode,
            reader.SetMatMode,
            reader.SetLayerMode,
            reader.SetPropsMode,
        ):
            mode(True)
        if reader.ReadFile(str(file)) != IFSelect_ReturnStatus.IFSelect_RetDone:
            self.source.fail("is not a readable STEP file", "export it again")
        lengths, angles, solids = (Sequence_TCollection_AsciiString() for _ in range(3))
        reader.Reader().FileUnits(lengths, angles, solids)
        found = [str(lengths.Value(i).ToCString()).lower() for i in range(1, lengths.Length() + 1)]
        self.unit = ", ".join(sorted(set(found))) or "mm, for the file does not say"
        if not found:
            self.source.note("the file does not say its unit of length: millimetres", level="assumed")
        if not reader.Transfer(self.document):
            self.source.fail("holds nothing that can be taken over", "export solids or surfaces")
        if _DENSITY.search(self.source.data):
            self.densities = _densities(reader.Reader().StepModel())

    def _local(self, data: bytes, folder: Path, depth: int) -> bytes:
        """Content whose references lead into a folder, to copies of the files they mean."""
        self.nameless |= {name.decode("latin-1") for name in _NAMELESS.findall(data)}

        def found(match: re.Match[bytes]) -> bytes:
            name = match[1]
            if not _FILE.search(name):
                return match[0]
            if name not in self.copies:
                self.copies[name] = f"{folder.name}_{len(self.copies)}.stp".encode()
                self._copy(name.decode("utf-8", "replace"), folder / self.copies[name].decode(), depth)
            start, end = match.span(1)
            whole = match[0]
            return whole[: start - match.start()] + self.copies[name] + whole[end - match.start() :]

        return _REFERENCES.sub(found, data)

    def _copy(self, name: str, to: Path, depth: int) -> None:
        try:
            held = self.source.beside(name) if depth < MAX_DEPTH else None
        except InputError:
            held = None
        if held is None:
            self.missing.append(name)
            text = f"refers to {name!r}, which is not beside it or below: what is in there is missing"
            self.source.findings = [f for f in self.source.findings if repr(name) not in f.text]
            self.source.note(text, level="warning")
            return
        to.write_bytes(self._local(held, to.parent, depth + 1))

    def described(self) -> Iterator[dict[str, Any]]:
        """How many products there are, plain data of each as it is cut into triangles, and of the whole."""
        from OCP.collections import Sequence_TDF_Label

        roots = Sequence_TDF_Label()
        self.labels.GetFreeShapes(roots)
        found = [roots.Value(i) for i in range(1, roots.Length() + 1)]
        for name, label in zip(told_apart(map(_label_name, found)), found, strict=True):
            self._walk(label, (name,), np.eye(4), None)
        yield {"products": len(self.products)}
        numbers: dict[str, int | str] = {}
        count = 0
        for entry, (label, name) in self.products.items():
            row = self._row(label, name)
            if isinstance(row, str):
                numbers[entry] = row
            else:
                numbers[entry] = count
                count += 1
            yield {"shape": None if isinstance(row, str) else row}
        instances = []
        for path, entry, world, color in self.placed:
            number = numbers[entry]
            if isinstance(number, str):
                self.left_out.append(("/".join(path), number))
            else:
                instances.append((list(path), number, world, color))
        self.left_out += [(name, "a file that is not there") for name in self.missing]
        if not instances:
            missing = f"; it refers to {', '.join(self.missing[:5])}" if self.missing else ""
            self.source.fail(
                f"holds no surface{missing}",
                "put the files that it names beside it" if missing else "export solids or surfaces",
            )
        if len(found) > 1:
            self.source.note(f"has {len(found)} roots, which stand beside each other")
        yield {
            "format": self.format,
            "unit": self.unit,
            "instances": instances,
            "left_out": self.left_out,
            "missing": self.missing,
            "findings": [(f.level, f.subject, f.text) for f in self.source.findings],
            "files": self.source.files,
        }

    def _walk(self, label: Any, path: tuple[str, ...], above: Array, color: Any) -> None:
        from OCP.XCAFDoc import XCAFDoc_ShapeTool

        if len(path) > MAX_DEPTH or len(self.placed) > MAX_INSTANCES:
            what = f"nests deeper than {MAX_DEPTH} or has more than {MAX_INSTANCES} parts"
            self.source.fail(what, "export the cell alone")
        if XCAFDoc_ShapeTool.IsAssembly_s(label):
            self._components(label, path, above, color)
            return
        entry = _entry(label)
        self.products.setdefault(entry, (label, path[-1]))
        self.placed.append((path, entry, above.tolist(), color))

    def _components(self, label: Any, path: tuple[str, ...], above: Array, color: Any) -> None:
        from OCP.collections import Sequence_TDF_Label
        from OCP.TDF import TDF_Label
        from OCP.XCAFDoc import XCAFDoc_ShapeTool

        components = Sequence_TDF_Label()
        XCAFDoc_ShapeTool.GetComponents_s(label, components, False)
        if not components.Length():
            self.left_out.append(("/".join(path), "an assembly of nothing"))
        children = []
        for i in range(1, components.Length() + 1):
            component, product = components.Value(i), TDF_Label()
            if not XCAFDoc_ShapeTool.GetReferredShape_s(component, product):
                product = component
            own = _label_name(component, empty="")
            name = own if own and own not in self.nameless else _label_name(product)
            children.append((name, component, product))
        names = told_apart(name for name, _, _ in children)
        for name, (_, component, product) in zip(names, children, strict=True):
            placed = above @ _matrix(XCAFDoc_ShapeTool.GetLocation_s(component).Transformation())
            self._walk(product, (*path, name), placed, _color(component) or color)

    def _row(self, label: Any, name: str) -> dict[str, Any] | str:
        """Plain data of a product's shape; or why it has none."""
        from OCP.BRepGProp import BRepGProp
        from OCP.BRepMesh import BRepMesh_IncrementalMesh
        from OCP.GProp import GProp_GProps
        from OCP.TopAbs import TopAbs_ShapeEnum
        from OCP.XCAFDoc import XCAFDoc_ShapeTool

        shape = XCAFDoc_ShapeTool.GetShape_s(label)
        name = _label_name(label, empty=name)
        if shape is None or shape.IsNull():
            return "has no shape"
        solids = sum(1 for _ in _explored(shape, TopAbs_ShapeEnum.TopAbs_SOLID))
        faces = list(_explored(shape, TopAbs_ShapeEnum.TopAbs_FACE))
        colors = _colors(label)
        whole = _color(label)
        if not solids and len(faces) > 1:
            shape, faces, colors = _sewn(shape, faces, colors)
        if not faces:
            return "has no surface: points or curves only"
        BRepMesh_IncrementalMesh(shape, self.tolerance * 1e3, False, TURN, False)
        by_color: dict[Any, list[tuple[NDArray[np.float64], NDArray[np.int32]]]] = {}
        points: list[Array] = []
        lost = 0
        most = max(20, MAX_SAMPLES // len(faces))
        for face in faces:
            vertices, triangles, uv = _triangles(face)
            points.append(_samples(face, vertices, triangles, uv, most))
            if not len(triangles):
                lost += 1
                continue
            self.faces += len(triangles)
            if self.faces > self.source.max_faces:
                self.source.fail(
                    f"has more than {self.source.max_faces} triangles", "give a larger tolerance"
                )
            color = _of_face(colors, face) or whole or COLOR
            by_color.setdefault(color, []).append((vertices, triangles))
        if not by_color:
            return "none of its faces could be cut into triangles"
        area = GProp_GProps()
        BRepGProp.SurfaceProperties_s(shape, area)
        material = _material(label)
        volume, off = _volume(shape) if solids else (GProp_GProps(), 0.0)
        return {
            "name": name,
            "pieces": [(*_merged(parts), color) for color, parts in by_color.items()],
            "points": (np.vstack(points) * 1e-3).tobytes() if points else b"",
            "solids": solids,
            "faces": len(faces),
            "lost": lost,
            "flat": not lost and _is_flat(faces),
            "area": float(area.Mass()) * 1e-6,
            "volume": float(volume.Mass()) * 1e-9 if solids else 0.0,
            "material": material,
            "dense": material in self.densities,
            "density": self.densities.get(material),
            "stated": _validation(label),
            "inertia": _inertia(volume) if solids else None,
            "off": off,
            "center": (np.array(volume.CentreOfMass().Coord()) * 1e-3).tolist() if solids else None,
            "surfaces": [found for face in faces if (found := _analytic(face)) is not None],
        }


def _volume(shape: Any) -> tuple[Any, float]:
    """Volume, centre and moments of solids, and by which share they differ between two integrations.

    Without a tolerance OpenCASCADE takes so few points that of a ball made of splines 1 % is missing.
    """
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps

    coarse, fine = GProp_GProps(), GProp_GProps()
    BRepGProp.VolumeProperties_s(shape, coarse, COARSE, False, False)
    said = BRepGProp.VolumeProperties_s(shape, fine, FINE, False, False)
    volume = float(fine.Mass())
    if not volume > 0:
        return fine, 0.0
    inertia, other = (np.array(_inertia(props)) for props in (fine, coarse))
    off = np.linalg.norm(inertia - other) / max(float(np.linalg.norm(inertia)), 1e-300)
    return fine, max(abs(float(coarse.Mass()) / volume - 1), float(off), float(said))


def _inertia(volume: Any) -> list[list[float]]:
    """Moments about the centre at density 1 [m⁵], shape (3, 3)."""
    matrix = volume.MatrixOfInertia()
    return [[matrix.Value(i, j) * 1e-15 for j in range(1, 4)] for i in range(1, 4)]


def _schema(data: bytes) -> str:
    head = re.search(rb"FILE_SCHEMA\s*\(\s*\(\s*'([^']*)'", data[:100_000], re.I)
    said = "" if head is None else head[1].decode("latin-1").upper()
    return "STEP " + next((ap for word, ap in _SCHEMAS.items() if word in said), said[:40])


def _entry(label: Any) -> str:
    from OCP.TCollection import TCollection_AsciiString
    from OCP.TDF import TDF_Tool

    text = TCollection_AsciiString()
    TDF_Tool.Entry_s(label, text)
    return str(text.ToCString())


def _label_name(label: Any, empty: str = "part") -> str:
    """What a label is called; ``=>[0:1:1:3]`` is what OpenCASCADE calls one without a name."""
    from OCP.TDataStd import TDataStd_Name

    attribute = TDataStd_Name()
    if not label.FindAttribute(TDataStd_Name.GetID_s(), attribute):
        return empty
    name = str(attribute.Get().ToExtString()).strip()
    return empty if not name or re.fullmatch(r"=>\[[\d:]*\]", name) else name


def _matrix(trsf: Any) -> Array:
    """A placement (4, 4), its translation in metres."""
    matrix = np.eye(4)
    matrix[:3] = [[trsf.Value(i, j) for j in range(1, 5)] for i in range(1, 4)]
    matrix[:3, 3] *= 1e-3
    return matrix


def _explored(shape: Any, kind: Any) -> Iterator[Any]:
    from OCP.TopAbs import TopAbs_ShapeEnum
    from OCP.TopExp import TopExp_Explorer
    from OCP.TopoDS import TopoDS

    explorer = TopExp_Explorer(shape, kind)
    while explorer.More():
        found = explorer.Current()
        # An explorer knows no kinds of shapes; functions do.
        if kind == TopAbs_ShapeEnum.TopAbs_FACE:
            found = TopoDS.Face(found)
        elif kind == TopAbs_ShapeEnum.TopAbs_EDGE:
            found = TopoDS.Edge(found)
        yield found
        explorer.Next()


def _color(label: Any) -> tuple[float, float, float, float] | None:
    from OCP.Quantity import Quantity_ColorRGBA, Quantity_TypeOfColor
    from OCP.XCAFDoc import XCAFDoc_ColorTool, XCAFDoc_ColorType

    found = Quantity_ColorRGBA()
    for kind in (XCAFDoc_ColorType.XCAFDoc_ColorSurf, XCAFDoc_ColorType.XCAFDoc_ColorGen):
        if XCAFDoc_ColorTool.GetColor_s(label, kind, found):
            r, g, b = found.GetRGB().Values(Quantity_TypeOfColor.Quantity_TOC_sRGB)
            return round(r, 6), round(g, 6), round(b, 6), round(float(found.Alpha()), 6)
    return None


_Colors = dict[int, list[tuple[Any, Any]]]


def _colors(label: Any) -> _Colors:
    """Colours of single faces, by the hash of the face: those of solids, then of what lies in them."""
    from OCP.collections import Sequence_TDF_Label
    from OCP.TopAbs import TopAbs_ShapeEnum
    from OCP.XCAFDoc import XCAFDoc_ShapeTool

    labels = Sequence_TDF_Label()
    XCAFDoc_ShapeTool.GetSubShapes_s(label, labels)
    colored = []
    for i in range(1, labels.Length() + 1):
        color = _color(labels.Value(i))
        if color is not None:
            colored.append((XCAFDoc_ShapeTool.GetShape_s(labels.Value(i)), color))
    found: _Colors = {}
    # Kinds of shapes are numbered from compounds to vertices.
    for shape, color in sorted(colored, key=lambda one: int(one[0].ShapeType())):
        for face in _explored(shape, TopAbs_ShapeEnum.TopAbs_FACE):
            found.setdefault(hash(face), []).append((face, color))
    return found


def _of_face(colors: _Colors, face: Any) -> Any:
    same = [color for other, color in colors.get(hash(face), ()) if other.IsSame(face)]
    return same[-1] if same else None


def _sewn(shape: Any, faces: list[Any], colors: _Colors) -> tuple[Any, list[Any], _Colors]:
    """Loose faces with common edges, so that their triangles meet."""
    from OCP.BRepBuilderAPI import BRepBuilderAPI_Sewing
    from OCP.TopAbs import TopAbs_ShapeEnum

    sewing = BRepBuilderAPI_Sewing(1e-3)
    sewing.Add(shape)
    sewing.Perform()
    new = sewing.SewedShape()
    if new is None or new.IsNull():
        return shape, faces, colors
    moved: _Colors = {}
    for face in faces:
        color = _of_face(colors, face)
        if color is not None:
            after = sewing.ModifiedSubShape(face)
            moved.setdefault(hash(after), []).append((after, color))
    return new, list(_explored(new, TopAbs_ShapeEnum.TopAbs_FACE)), moved


def _triangles(face: Any) -> tuple[Array, NDArray[np.int32], Array]:
    """Vertices [mm] (n, 3), triangles (m, 3) and parameters of the vertices (n, 2) of a face."""
    from OCP.BRep import BRep_Tool
    from OCP.TopAbs import TopAbs_Orientation
    from OCP.TopLoc import TopLoc_Location

    where = TopLoc_Location()
    found = BRep_Tool.Triangulation_s(face, where)
    if found is None or not found.NbTriangles():
        return np.empty((0, 3)), np.empty((0, 3), np.int32), np.empty((0, 2))
    count = found.NbNodes()
    nodes = (found.Node(i) for i in range(1, count + 1))
    vertices = np.array([(p.X(), p.Y(), p.Z()) for p in nodes], float)
    if not where.IsIdentity():
        matrix = _matrix(where.Transformation())
        vertices = vertices @ matrix[:3, :3].T + matrix[:3, 3] * 1e3
    triangles = np.array([found.Triangle(i).Get() for i in range(1, found.NbTriangles() + 1)], np.int32) - 1
    if face.Orientation() == TopAbs_Orientation.TopAbs_REVERSED:
        triangles = triangles[:, ::-1]
    if not found.HasUVNodes():
        return vertices, triangles, np.empty((0, 2))
    pairs = (found.UVNode(i) for i in range(1, count + 1))
    return vertices, triangles, np.array([(p.X(), p.Y()) for p in pairs], float)


def _samples(face: Any, vertices: Array, triangles: NDArray[np.int32], uv: Array, most: int) -> Array:
    """Points [mm] of a curved face: amid its triangles and their edges, many where it is farthest from them.

    All over it when it has no triangles.
    """
    from OCP.BRepAdaptor import BRepAdaptor_Surface
    from OCP.GeomAbs import GeomAbs_SurfaceType

    surface = BRepAdaptor_Surface(face, True)
    if len(triangles) and (surface.GetType() == GeomAbs_SurfaceType.GeomAbs_Plane or not len(uv)):
        return np.empty((0, 3))
    if not len(triangles):
        u = surface.FirstUParameter(), surface.LastUParameter()
        v = surface.FirstVParameter(), surface.LastVParameter()
        # A surface that ends nowhere is looked at within 100 m.
        (u0, u1), (v0, v1) = np.clip([u, v], -1e5, 1e5).tolist()
        grid = np.meshgrid(np.linspace(u0, u1, 9), np.linspace(v0, v1, 9))
        return _at(surface, np.column_stack([axis.ravel() for axis in grid]))
    some = triangles[:: max(1, 4 * len(triangles) // most)]
    first = _at(surface, AMID @ uv[some]).reshape(len(some), -1, 3)
    a, b, c = np.moveaxis(vertices[some], 1, 0)
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=1)
    away = np.abs(np.einsum("tki,ti->tk", first - a[:, None], normal)).max(axis=1) / np.maximum(length, 1e-30)
    worst = some[np.argsort(-away)[: max(4, most // (20 * len(ALL_OVER)))]]
    return np.vstack([first.reshape(-1, 3), _at(surface, ALL_OVER @ uv[worst])])


def _at(surface: Any, uv: Array) -> Array:
    """Points [mm] of a surface at parameters, (n, 3)."""
    found = [surface.Value(u, v) for u, v in uv.reshape(-1, 2).tolist()]
    return np.array([(p.X(), p.Y(), p.Z()) for p in found], float).reshape(-1, 3)


def _is_flat(faces: list[Any]) -> bool:
    """Whether faces are plane and their edges straight, so that triangles are the surface itself."""
    from OCP.BRepAdaptor import BRepAdaptor_Curve, BRepAdaptor_Surface
    from OCP.GeomAbs import GeomAbs_CurveType, GeomAbs_SurfaceType
    from OCP.TopAbs import TopAbs_ShapeEnum

    plane, straight = GeomAbs_SurfaceType.GeomAbs_Plane, GeomAbs_CurveType.GeomAbs_Line
    return all(BRepAdaptor_Surface(face, False).GetType() == plane for face in faces) and all(
        BRepAdaptor_Curve(edge).GetType() == straight
        for face in faces
        for edge in _explored(face, TopAbs_ShapeEnum.TopAbs_EDGE)
    )


def _validation(label: Any) -> dict[str, Any]:
    """Area, volume and centroid that the file states of a shape [m, m², m³], where it does (AP242, AP214)."""
    from OCP.XCAFDoc import XCAFDoc_Area, XCAFDoc_Centroid, XCAFDoc_Volume

    found: dict[str, Any] = {}
    for attribute in _attributes(label):
        if isinstance(attribute, XCAFDoc_Volume):
            found["volume"] = float(attribute.Get()) * 1e-9
        elif isinstance(attribute, XCAFDoc_Area):
            found["area"] = float(attribute.Get()) * 1e-6
        elif isinstance(attribute, XCAFDoc_Centroid):
            found["center"] = (np.array(attribute.Get().Coord()) * 1e-3).tolist()
    return found


def _analytic(face: Any) -> tuple[Any, ...] | None:
    """A cylinder, a cone or a plane of a face in metres: kind, point, axis, figures, corners.

    Of a cylinder or cone: a point of its axis, the axis, radius at the point, slope of the radius along the
    axis, whether matter is inside (a shaft), the ends along the axis from the point, and the angle that it
    covers. Of a plane: a point, its normal away from matter, and corners of its triangles.
    """
    from OCP.BRepAdaptor import BRepAdaptor_Surface
    from OCP.GeomAbs import GeomAbs_SurfaceType
    from OCP.TopAbs import TopAbs_Orientation

    surface = BRepAdaptor_Surface(face, True)
    kind = surface.GetType()
    forward = face.Orientation() != TopAbs_Orientation.TopAbs_REVERSED
    if kind == GeomAbs_SurfaceType.GeomAbs_Plane:
        plane = surface.Plane()
        normal = np.array(plane.Axis().Direction().Coord())
        if forward != plane.Position().Direct():
            normal = -normal
        corners = _triangles(face)[0] * 1e-3
        step = max(1, len(corners) // MAX_CORNERS)
        at = np.array(plane.Location().Coord()) * 1e-3
        return "plane", at.tolist(), normal.tolist(), (), corners[::step].tolist()
    if kind == GeomAbs_SurfaceType.GeomAbs_Cylinder:
        shape, slope, along = surface.Cylinder(), 0.0, 1.0
        radius = shape.Radius() * 1e-3
    elif kind == GeomAbs_SurfaceType.GeomAbs_Cone:
        shape = surface.Cone()
        slope, along = float(np.tan(shape.SemiAngle())), float(np.cos(shape.SemiAngle()))
        radius = shape.RefRadius() * 1e-3
    else:
        return None
    ends = sorted((surface.FirstVParameter() * along * 1e-3, surface.LastVParameter() * along * 1e-3))
    covered = abs(surface.LastUParameter() - surface.FirstUParameter())
    at = np.array(shape.Axis().Location().Coord()) * 1e-3
    axis = np.array(shape.Axis().Direction().Coord())
    inside = forward == shape.Position().Direct()
    if not np.isfinite([radius, slope, *ends, covered]).all():
        return None
    return "round", at.tolist(), axis.tolist(), (radius, slope, inside, *ends, covered), []


def _merged(parts: list[tuple[Array, NDArray[np.int32]]]) -> tuple[bytes, bytes]:
    """Vertices [m] and triangles of faces together, as bytes."""
    offsets = np.cumsum([0, *(len(vertices) for vertices, _ in parts)])
    faces = np.vstack([triangles + offset for (_, triangles), offset in zip(parts, offsets, strict=False)])
    vertices = np.vstack([vertices for vertices, _ in parts]) * 1e-3
    return np.ascontiguousarray(vertices, "<f8").tobytes(), np.ascontiguousarray(faces, "<i4").tobytes()


def _material(label: Any) -> str:
    """Name of a shape's material; empty where it has none."""
    from OCP.TDataStd import TDataStd_TreeNode
    from OCP.XCAFDoc import XCAFDoc, XCAFDoc_Material

    for node in _attributes(label):
        # Its tree of materials, as XCAFDoc_MaterialTool follows it.
        if isinstance(node, TDataStd_TreeNode) and node.ID().IsSame(XCAFDoc.MaterialRefGUID_s()):
            for attribute in _attributes(node.Father().Label()) if node.HasFather() else ():
                if isinstance(attribute, XCAFDoc_Material) and attribute.GetName() is not None:
                    return str(attribute.GetName().ToCString()).strip()
    return ""


def _densities(model: Any) -> dict[str, float | None]:
    """Densities of materials as a STEP file states them, by name [kg/m³]; None of one that is not understood.

    OpenCASCADE itself hands them over without their unit: what is in kilograms is a thousand times too light.

    Args:
        model: OpenCASCADE's ``StepData_StepModel``.
    """
    from OCP.StepRepr import (
        StepRepr_DescriptiveRepresentationItem,
        StepRepr_MeasureRepresentationItem,
        StepRepr_PropertyDefinitionRepresentation,
    )

    owners: list[Any] = []
    """Kept, so that the same one is known again."""
    names, said = dict[int, str](), list[tuple[int, float | None]]()
    for k in range(1, model.NbEntities() + 1):
        entity = model.Value(k)
        if not isinstance(entity, StepRepr_PropertyDefinitionRepresentation):
            continue
        defined, shown = entity.Definition().PropertyDefinition(), entity.UsedRepresentation()
        owner = None if defined is None else defined.Definition().Value()
        if owner is None or shown is None or _text(defined.Name()).lower() != "material property":
            continue
        owners.append(owner)
        for i in range(1, shown.NbItems() + 1):
            item = shown.ItemsValue(i)
            if isinstance(item, StepRepr_DescriptiveRepresentationItem):
                names[id(owner)] = _text(item.Name())
            elif isinstance(item, StepRepr_MeasureRepresentationItem) and "density" in " ".join(
                _text(words.Name()).lower() for words in (item, shown, defined)
            ):
                said.append((id(owner), _kilograms_per_cubic_metre(item.Measure())))
    found: dict[str, float | None] = {}
    for owner, density in said:
        name = names.get(owner, "")
        same = name not in found or found[name] == density
        found[name] = density if same else None
    return found


def _text(said: Any) -> str:
    return "" if said is None else str(said.ToCString()).strip()


def _kilograms_per_cubic_metre(measure: Any) -> float | None:
    """A density with its unit; None where the unit is none of density, or the figure that of no material."""
    from OCP.StepBasic import StepBasic_SiUnitAndLengthUnit, StepBasic_SiUnitAndMassUnit

    unit = measure.UnitComponent().DerivedUnit()
    if unit is None:
        return None
    powers: dict[str, float] = {}
    scale = 1e-3  # of a gram
    for i in range(1, unit.NbElements() + 1):
        element = unit.ElementsValue(i)
        kind = element.Unit()
        what = {StepBasic_SiUnitAndMassUnit: "mass", StepBasic_SiUnitAndLengthUnit: "length"}.get(type(kind))
        if what is None or what in powers:
            return None
        powers[what] = float(element.Exponent())
        prefix = _PREFIXES.get(kind.Prefix().name.rpartition("_")[2]) if kind.HasPrefix() else 0
        if prefix is None:
            return None
        scale *= 10.0 ** (prefix * (1 if what == "mass" else -3))
    # OpenCASCADE writes 3 and 2 and means g/cm³.
    written = powers == {"mass": 3.0, "length": 2.0} and math.isclose(scale, 1e3)
    if not (written or powers == {"mass": 1.0, "length": -3.0}):
        return None
    density = scale * float(measure.ValueComponent())
    return density if _LIGHTEST <= density <= _DENSEST else None


def _attributes(label: Any) -> Iterator[Any]:
    from OCP.TDF import TDF_AttributeIterator

    found = TDF_AttributeIterator(label)
    while found.More():
        yield found.Value()
        found.Next()
