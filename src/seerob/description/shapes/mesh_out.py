"""Meshes out as files that CAD programs, the page and a workstation file can read: STL and binary glTF."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from seerob.core.errors import InputError
from seerob.core.files.whole_file import whole_file
from seerob.core.shapes.geometry import Mesh
from seerob.description.shapes.glb import glb_bytes

_RECORD = np.dtype([("normal", "<f4", 3), ("vertices", "<f4", (3, 3)), ("attribute", "<u2")])


def stl_bytes(mesh: Mesh) -> bytes:
    """Binary STL in metres, z up."""
    records = np.zeros(len(mesh.faces), _RECORD)
    corners = mesh.vertices[mesh.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    records["normal"] = np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0)
    records["vertices"] = corners
    return b"seerob, metres, z up".ljust(80) + len(records).to_bytes(4, "little") + records.tobytes()


def glb_y_up(mesh: Mesh) -> bytes:
    """Binary glTF as the format has it: metres, y up."""
    turned = np.column_stack([mesh.vertices[:, 0], mesh.vertices[:, 2], -mesh.vertices[:, 1]])
    return glb_bytes([Mesh(turned, mesh.faces, mesh.color)])


WRITERS = {".stl": stl_bytes, ".glb": glb_y_up}


def check_format(path: Path) -> None:
    """Refuse a file name whose ending is no format that can be written."""
    if path.suffix.lower() not in WRITERS:
        raise InputError.at(
            path, "", f"{path.suffix or 'no ending'} cannot be written", f"end it in {' or '.join(WRITERS)}"
        )


def write_mesh(path: Path, mesh: Mesh) -> None:
    """Write a mesh in the format that the file's ending says; all of it or nothing.

    Raises:
        InputError: An ending that is no format, or a file that cannot be written.
    """
    check_format(path)
    data = WRITERS[path.suffix.lower()](mesh)
    try:
        with whole_file(path) as hidden:
            hidden.write_bytes(data)
    except OSError as error:
        raise InputError.at(
            path, "", f"cannot be written: {error.strerror or error}", "choose another place"
        ) from error
