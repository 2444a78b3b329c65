"""What a CAD file is, by its content and not by its name; and how to export what nobody else can read."""

from __future__ import annotations

import io
import re
import zipfile
from pathlib import Path
from typing import NamedTuple

from seerob.core.errors import InputError

HEAD = 1 << 16
"""Bytes at the begin of a file that tell what it is."""


class Closed(NamedTuple):
    """A format that only the program that wrote it can read."""

    program: str
    export: str


_STEP = "STEP AP242 (or AP214)"
CLOSED = {
    "SolidWorks": Closed(
        "SolidWorks",
        f"open the assembly, File > Save As > {_STEP}; Options: export as one file, with appearances",
    ),
    "CATIA V5": Closed(
        "CATIA V5",
        f"open the product, File > Save As > stp ({_STEP}; Tools > Options > Compatibility > STEP: "
        "one file, names of instances) or > 3dxml with tessellated (XML) representation",
    ),
    "CATIA 3DEXPERIENCE": Closed(
        "CATIA or 3DEXPERIENCE", f"export the root product as {_STEP}, or as 3DXML with the XML tessellation"
    ),
    "Creo": Closed("Creo", f"open the assembly, File > Save a Copy > {_STEP}, one file, solids and colours"),
    "NX": Closed("NX", f"open the assembly, File > Export > {_STEP}, structure and solids in one file"),
    "Inventor": Closed("Inventor", f"open the assembly, File > Export > CAD Format > {_STEP}"),
    "Solid Edge": Closed("Solid Edge", f"open the assembly, File > Save As > {_STEP}"),
    "JT": Closed("JT", f"in NX or Teamcenter Visualization: File > Export > {_STEP}"),
    "Parasolid": Closed("Parasolid", f"in the CAD system that has the assembly: export it as {_STEP}"),
    "ACIS": Closed("ACIS", f"in the CAD system that has the part: export it as {_STEP}"),
    "DWG": Closed("AutoCAD", f"export the solids as {_STEP}, or as STL with the unit in the name"),
    "FBX": Closed("FBX", "in Blender or the program that wrote it: export as glTF 2.0 (.glb)"),
    "Blender": Closed("Blender", "File > Export > glTF 2.0 (.glb)"),
    "SketchUp": Closed("SketchUp", "File > Export > 3D Model > COLLADA (.dae) or glTF"),
    "FreeCAD": Closed("FreeCAD", f"select the assembly, File > Export > {_STEP}"),
    "Fusion": Closed("Fusion", f"open the assembly, File > Export > {_STEP}"),
    "Rhino": Closed("Rhino", f"File > Export Selected > {_STEP}"),
}
_BEGINS = (
    (b"V5_CFV2", "CATIA V5"),
    (b"V5_CATIA", "CATIA V5"),
    (b"#UGC:2", "Creo"),
    (b"SPLMSSTR", "NX"),
    (b"**ABCDEFGHIJKLMNOPQRSTUVWXYZ", "Parasolid"),
    (b"ACIS BinaryFile", "ACIS"),
    (b"AC10", "DWG"),
    (b"Kaydara FBX Binary", "FBX"),
    (b"BLENDER", "Blender"),
    (b"\xff\xfe\xff\x0eS\x00k\x00e\x00t\x00c\x00h", "SketchUp"),
    (b"3D Geometry File Format", "Rhino"),
)
_OLE = b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"
_STREAMS = (
    ("SwDoc", "SolidWorks"),
    ("SolidWorks", "SolidWorks"),
    ("ISolidWorksInformation", "SolidWorks"),
    ("RSeStorage", "Inventor"),
    ("RSeDb", "Inventor"),
    ("UFRxDoc", "Inventor"),
    ("Solid Edge", "Solid Edge"),
    ("PARASOLID", "Solid Edge"),
    ("UG_PART", "NX"),
    ("images/preview", "NX"),
)
"""Names of streams in compound files of Microsoft's structured storage."""
_ENDINGS = {
    **dict.fromkeys((".sldprt", ".sldasm"), "SolidWorks"),
    **dict.fromkeys((".catpart", ".catproduct", ".cgr"), "CATIA V5"),
    **dict.fromkeys((".ipt", ".iam"), "Inventor"),
    **dict.fromkeys((".par", ".psm"), "Solid Edge"),
    ".prt": "NX",
    ".asm": "Creo",
    ".jt": "JT",
    ".x_t": "Parasolid",
    ".x_b": "Parasolid",
    ".sat": "ACIS",
    ".dwg": "DWG",
}
"""Where the content says nothing; some programs leave no mark."""
_XML = {
    "COLLADA": ".dae",
    "CAEXFile": ".aml",
    "Model_3dxml": ".3dxml",
    "sdf": ".sdf",
    "robot": ".urdf",
    "mujoco": ".mjcf",
}
_NUMBER = rb"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"


def recognised(path: Path, data: bytes) -> str:
    """Ending of the format that a content is: ``.step``, ``.igs``, ``.glb``, ``.3dxml`` and so on.

    Args:
        path: The file, for messages, and for its ending where the content alone does not tell.
        data: Its content.

    Raises:
        InputError: Only the program that wrote it can read it, whose export steps are said; or it is nothing
            that is known.
    """
    head = data[:HEAD]
    start = head.lstrip(b"\xef\xbb\xbf \t\r\n")
    for begin, program in _BEGINS:
        if head.startswith(begin):
            raise refused(path, program)
    if head.startswith(_OLE):
        raise refused(path, _compound(path, data))
    if re.match(rb"Version \d+\.\d+ JT", head):
        raise refused(path, "JT")
    if head.startswith((b"PXR-USDC", b"#usda")):
        return ".usd"
    if head.startswith(b"PK"):
        return _zipped(path, data)
    if b"ISO-10303-21;" in start[:2000]:
        return ".step"
    if len(head) > 81 and re.match(rb"[\x20-\x7e]{72}S[ 0]*1\r?\n", head[:84]):
        return ".igs"
    if head.startswith(b"glTF"):
        return ".glb"
    if start.startswith(b"<"):
        root = re.search(rb"<\s*(?:[\w.-]+:)?([A-Za-z_][\w.-]*)", re.sub(rb"<[?!][^>]*>", b"", start))
        name = "" if root is None else root[1].decode()
        if name in _XML:
            return _XML[name]
        raise InputError.at(path, "", f"is XML of an unknown kind ({name[:40]})", _known())
    if start.startswith(b"{"):
        return ".gltf"
    if start.startswith(b"ply"):
        return ".ply"
    if re.match(rb"(?:ST|C|N|4|n)*OFF\b", start):
        return ".off"
    if re.match(rb"solid\b", start, re.I) and re.search(rb"\bfacet\b|\bendsolid\b", head, re.I):
        return ".stl"
    if len(data) >= 84 and len(data) >= 84 + 50 * int.from_bytes(data[80:84], "little") > 84:
        return ".stl"
    if re.search(rb"(?m)^v\s+" + _NUMBER + rb"\s+" + _NUMBER, head):
        return ".obj"
    if path.suffix.lower() in _ENDINGS:
        raise refused(path, _ENDINGS[path.suffix.lower()])
    raise InputError.at(path, "", "is no CAD file that is known, by its content", _known())


def refused(path: Path, program: str) -> InputError:
    """What to do about a file that only its own program can read."""
    closed = CLOSED[program]
    return InputError.at(
        path, "", f"is a file of {closed.program}, which no other program reads", closed.export
    )


def _known() -> str:
    return (
        "STEP, IGES, glTF, OBJ, STL, PLY, OFF, 3MF, COLLADA, 3DXML, USD, SDF, URDF, MJCF and AutomationML "
        "are read"
    )


def _compound(path: Path, data: bytes) -> str:
    """Which program wrote a compound file, by the names of its streams."""
    for text, program in _STREAMS:
        if text.encode("utf-16-le") in data or text.encode() in data:
            return program
    found = _ENDINGS.get(path.suffix.lower())
    if found is None:
        raise InputError.at(path, "", "is a compound file of an unknown program", _known())
    return found


def _zipped(path: Path, data: bytes) -> str:
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            names = [entry.filename.lower() for entry in archive.infolist()]
    except (zipfile.BadZipFile, ValueError, NotImplementedError, OSError) as error:
        raise InputError.at(path, "", f"is a damaged archive ({error})", "export it again") from error
    # A plant may contain files of any other kind, a COLLADA archive a manifest.
    if any(name.endswith(".aml") for name in names):
        return ".amlx"
    if any(name.endswith(".model") for name in names):
        return ".3mf"
    if any(name.endswith(".dae") for name in names):
        return ".zae"
    if any(name.endswith(".3dxml") for name in names) or "manifest.xml" in names:
        return ".3dxml"
    if any(name.endswith((".usd", ".usda", ".usdc")) for name in names):
        return ".usd"
    if "document.xml" in names and path.suffix.lower() == ".fcstd":
        raise refused(path, "FreeCAD")
    if any(name.endswith((".f3d", ".f3z")) for name in names) or path.suffix.lower() in (".f3d", ".f3z"):
        raise refused(path, "Fusion")
    raise InputError.at(path, "", f"is an archive without a CAD file ({', '.join(names[:3])})", _known())
