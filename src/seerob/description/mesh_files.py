"""Polygons with more than three corners cut into triangles, concave ones too.

What every mesh reader gets and gives: bounded bytes in, raw triangles out.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NoReturn
from urllib.parse import unquote, urlsplit

import numpy as np
from numpy.typing import NDArray

from seerob.core.errors import InputError, SeerobError
from seerob.core.files.bounded import TooLarge, content
from seerob.core.files.parser_process import parsed
from seerob.core.snapshot import Finding
from seerob.core.transforms import Array

Indices = NDArray[np.int64]


def triangles(vertices: Array, polygons: Sequence[Sequence[int]]) -> Indices:
    """Triangles (m, 3) that cover the polygons, in their order and with their sense.

    Args:
        vertices: Shape (n, 3).
        polygons: Vertex indices of each, at least three; checked by the caller.
    """
    sizes = np.fromiter((len(p) for p in polygons), np.int64, len(polygons))
    if not len(sizes):
        return np.empty((0, 3), np.int64)
    if (sizes == sizes[0]).all():
        table = np.array(polygons, np.int64)
        return table if sizes[0] == 3 else _equal_polygons(vertices, table)
    pieces: list[Indices | None] = [None] * len(polygons)
    for size in np.unique(sizes):
        which = np.flatnonzero(sizes == size)
        table = np.array([polygons[int(i)] for i in which], np.int64)
        cut = table if size == 3 else _equal_polygons(vertices, table)
        for i, piece in zip(which, cut.reshape(len(which), -1, 3), strict=True):
            pieces[i] = piece
    return np.vstack([p for p in pieces if p is not None])


def _equal_polygons(vertices: Array, table: Indices) -> Indices:
    """Polygons (k, s) as fans, (k (s - 2), 3); those a fan would leave are cut one by one."""
    count, size = table.shape
    first = np.repeat(table[:, :1], size - 2, axis=1)
    fans = np.stack([first, table[:, 1:-1], table[:, 2:]], axis=2)
    a, b, c = np.moveaxis(vertices[fans], 2, 0)
    with np.errstate(all="ignore"):  # corners that are no numbers, or too large, are refused later
        cross = np.cross(b - a, c - a)
        normal = cross.sum(axis=1)
        backward = (np.einsum("ksi,ki->ks", cross, normal) < 0).any(axis=1)
    for i in np.flatnonzero(backward):
        cut = _concave(vertices[table[i]], normal[i])
        if cut is not None and len(cut) == size - 2:
            fans[i] = table[i][cut]
    return fans.reshape(count * (size - 2), 3)


def _concave(corners: Array, normal: Array) -> Indices | None:
    import manifold3d

    length = np.linalg.norm(normal)
    if not (np.isfinite(length) and length > 0):
        return None
    z = normal / length
    x = np.cross(np.eye(3)[int(np.abs(z).argmin())], z)
    x /= np.linalg.norm(x)
    flat = np.column_stack([corners @ x, corners @ np.cross(z, x)])
    return np.asarray(manifold3d.triangulate([flat], allow_convex=False), np.int64)


MAX_LINE = 4 << 20
"""Longest line of a text file that is read [byte]."""

Color = tuple[float, float, float, float]


@dataclass(frozen=True, eq=False)
class RawMesh:
    """One mesh as the file has it: its own unit and axes."""

    name: str
    """Path in the file's scene graph, joined with ``/``; empty when the file names nothing."""
    vertices: Array
    """Shape (n, 3), in the file's unit."""
    faces: NDArray[np.int64]
    """Shape (m, 3)."""
    color: Color | None = None
    file_from_mesh: Array | None = None
    """Where this instance is, (4, 4), in the file's unit, perhaps scaled or mirrored; None: as it is."""
    geometry: str = ""
    """Equal for instances of one geometry; empty when there are none."""
    part: int | None = None
    """Equal for meshes that are one part, split by colour; None for a part of one mesh."""
    nodes: tuple[str, ...] = ()
    """Of COLLADA, identifiers of the nodes that lead to it, by which kinematics name it."""

    def placed(self) -> RawMesh:
        """The mesh where its instance is; what is mirrored keeps its outside."""
        if self.file_from_mesh is None:
            return self
        matrix = self.file_from_mesh
        with np.errstate(all="ignore"):  # what is no number, or too large, is refused later
            vertices = self.vertices.astype(float) @ matrix[:3, :3].T + matrix[:3, 3]
            faces = self.faces[:, ::-1] if np.linalg.det(matrix[:3, :3]) < 0 else self.faces
        return replace(self, vertices=vertices, faces=faces, file_from_mesh=None, geometry="")


@dataclass(frozen=True, eq=False)
class RawFile:
    """What a reader found: meshes and what the file itself says of its unit and its axes."""

    meshes: tuple[RawMesh, ...]
    meters: float | None = None
    """Metres per unit of the file; None when the format or the file does not say."""
    up: str | None = None
    """``x``, ``y`` or ``z``; None when the format does not say."""


@dataclass(eq=False)
class MeshSource:
    """A mesh file's bytes, the files beside it that it names, and what was noticed on the way."""

    path: Path
    data: bytes
    max_bytes: int
    max_faces: int
    files: dict[str, bytes] = field(default_factory=dict)
    findings: list[Finding] = field(default_factory=list)

    def fail(self, what: str, remedy: str = "", key: str = "") -> NoReturn:
        """Raise the `InputError` that names this file."""
        raise InputError.at(self.path, key, what, remedy)

    def note(self, text: str, *, level: str = "note") -> None:
        """Remember something the reader of a result must know."""
        self.findings.append(Finding(level=level, subject=self.path.name, text=text))

    def text(self, data: bytes) -> str:
        """Content of a text file, with � for what is none.

        Raises:
            InputError: A line is longer than any that a program writes.
        """
        at = 0
        while len(data) - at > MAX_LINE:
            end = data.rfind(b"\n", at, at + MAX_LINE)
            if end < 0:
                line = data.count(b"\n", 0, at) + 1
                self.fail(f"is longer than {MAX_LINE} bytes", "export it again", f"line {line}")
            at = end + 1
        return data.decode("utf-8", errors="replace")

    def beside(self, uri: str) -> bytes | None:
        """Content of a file that this one names, or None, with a finding, when it is not there.

        Only files in the mesh file's own folder, or below, are read; nothing is fetched.

        Raises:
            InputError: for a URL, or a path that leaves the folder.
        """
        name = unquote(uri.strip()).replace("\\", "/")
        split = urlsplit(name)
        if len(split.scheme) > 1 and "://" in name:
            self.fail(f"refers to {uri[:200]!r}: nothing is fetched", "put the file beside it")
        folder = self.path.resolve().parent
        try:
            target = (folder / name).resolve()
            inside = target.is_relative_to(folder)
        except (ValueError, OSError):
            inside = False
        if not inside:
            self.fail(f"refers to {uri[:200]!r}, outside its own folder", "copy that file beside this one")
        if not target.is_file():
            self.note(f"refers to {uri[:200]!r}, which is not there", level="warning")
            return None
        left = self.max_bytes - sum(map(len, self.files.values()))
        try:
            held = content(target, max(left, 0))
        except TooLarge:
            self.fail(f"with {name!r} it is larger than {self.max_bytes} bytes", "raise max_bytes")
        except OSError as error:
            self.fail(
                f"refers to {uri[:200]!r}, which cannot be read: {error.strerror}", "check its permissions"
            )
        self.files[target.relative_to(folder).as_posix()] = held
        return held

    @contextmanager
    def parsing(self, what: str) -> Iterator[None]:
        """Turn whatever a third-party parser throws at a broken file into one `InputError`."""
        try:
            yield
        except (SeerobError, KeyboardInterrupt, SystemExit):
            raise
        except MemoryError:
            self.fail(f"{what}: it asks for more memory than there is")
        except RecursionError:
            self.fail(f"{what}: it is nested too deeply")
        except Exception as error:
            detail = f"{type(error).__name__}: {error}".splitlines()[0][:200]
            self.fail(f"is not a readable {what} ({detail})", "export it again")


# -- in the parsers' process: a file ends that one and no run ---------------------------------

Reader = Callable[[MeshSource], RawFile]


def in_parser_process(read: Reader) -> Reader:
    """A reader that works in the parsers' process.

    Args:
        read: A function of a module, which that process calls by its name.
    """

    def read_in_process(source: MeshSource) -> RawFile:
        given = source.path, source.data, source.max_bytes, source.max_faces
        meshes, meters, up, findings, files = parsed(_plain, read, *given, file=str(source.path))
        source.findings.extend(
            Finding(level=level, subject=subject, text=text) for level, subject, text in findings
        )
        source.files.update(files)
        return RawFile(tuple(_mesh(*mesh) for mesh in meshes), meters, up)

    return read_in_process


def _plain(read: Reader, path: Path, data: bytes, max_bytes: int, max_faces: int) -> tuple[Any, ...]:
    source = MeshSource(path, data, max_bytes, max_faces)
    raw = read(source)
    meshes = []
    for m in raw.meshes:
        where = None if m.file_from_mesh is None else m.file_from_mesh.tolist()
        arrays = np.asarray(m.vertices, "<f8").tobytes(), np.asarray(m.faces, "<i8").tobytes()
        meshes.append((m.name, *arrays, m.color, where, m.geometry, m.part, m.nodes))
    findings = [(finding.level, finding.subject, finding.text) for finding in source.findings]
    return meshes, raw.meters, raw.up, findings, source.files


def _mesh(
    name: str,
    vertices: bytes,
    faces: bytes,
    color: Any,
    where: Any,
    geometry: str,
    part: int | None,
    nodes: tuple[str, ...],
) -> RawMesh:
    return RawMesh(
        name,
        np.frombuffer(vertices, "<f8").reshape(-1, 3),
        np.frombuffer(faces, "<i8").reshape(-1, 3),
        color,
        None if where is None else np.array(where, float),
        geometry,
        part,
        nodes,
    )
