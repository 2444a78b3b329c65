"""USD, USDA, USDC and USDZ: parts, articulations, masses; its library runs in the parsers' process."""

from __future__ import annotations

from seerob.core.extras import need
from seerob.core.files.parser_process import parsed
from seerob.description.cad.assembly import Assembly
from seerob.description.cad.linked import assembled
from seerob.description.cad.universal_scene import plain
from seerob.description.mesh import Z_FROM
from seerob.description.mesh_files import MeshSource

SECONDS = 300.0
"""Computing time that reading may take [s]."""


def read(source: MeshSource) -> Assembly:
    """The assembly of a USD file.

    Raises:
        InputError: It cannot be read, or holds no surface.
        MissingPackage: OpenUSD is not installed.
    """
    need("pxr")
    arguments = source.path, source.data, source.max_bytes, source.max_faces
    told = parsed(plain, *arguments, file=str(source.path), seconds=SECONDS)
    if told["up"] not in Z_FROM:
        source.fail(f"upAxis is {told['up']!r}", 'write upAxis = "Y" or "Z"', "upAxis")
    return assembled(source, told, "USD", Z_FROM[told["up"]], told["meters"])
