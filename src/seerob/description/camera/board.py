"""Printed boards by which cameras are calibrated: chessboards with markers of ArUco (ChArUco), to scale.

A board is told as ``charuco 8x6 40 30``: squares across and up, edge of a square and of a marker [mm].
Markers are of OpenCV's dictionary of 250 with 4x4 bits. What a printer makes of it is measured, not believed.
"""

from __future__ import annotations

import re
from typing import Any, NamedTuple

from seerob.core.errors import InputError
from seerob.core.extras import need

MARGIN = 10.0
"""White around the board [mm]."""
_TEXT = re.compile(r"charuco (\d{1,2})x(\d{1,2}) (\d+(?:\.\d+)?) (\d+(?:\.\d+)?)")


class Board(NamedTuple):
    """A chessboard with markers in its white squares."""

    across: int
    up: int
    square: float
    """[m]"""
    marker: float
    """[m]"""

    def __str__(self) -> str:
        return f"charuco {self.across}x{self.up} {1e3 * self.square:g} {1e3 * self.marker:g}"


def read(text: str) -> Board:
    """A board as it is told.

    Raises:
        InputError: It is none, or cannot be.
    """
    found = _TEXT.fullmatch(text)
    if found is None:
        raise InputError.at("board", "", f"{text!r} is no board", "say charuco 8x6 40 30 (squares, mm, mm)")
    across, up, square, marker = int(found[1]), int(found[2]), float(found[3]), float(found[4])
    if not (
        3 <= across <= 20 and 3 <= up <= 20 and 5 <= square <= 300 and 0.4 * square <= marker <= 0.85 * square
    ):
        what = f"{text!r} cannot be seen well: 3 to 20 squares of 5 to 300 mm, markers of 0.4 to 0.85 of one"
        raise InputError.at("board", "", what, "say charuco 8x6 40 30")
    return Board(across, up, square / 1e3, marker / 1e3)


def made(board: Board) -> Any:
    """OpenCV's own board.

    Raises:
        MissingPackage: OpenCV is not installed.
    """
    need("cv2")
    import cv2

    words = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_250)
    return cv2.aruco.CharucoBoard((board.across, board.up), board.square, board.marker, words)


def rectangles(board: Board) -> list[tuple[float, float, float, float]]:
    """Black rectangles: left, top, width, height from the top left corner of the board [mm].

    Raises:
        MissingPackage: OpenCV is not installed.
    """
    cell = 12
    drawn = made(board).generateImage((6 * cell * board.across, 6 * cell * board.up), marginSize=0)
    square, marker = 1e3 * board.square, 1e3 * board.marker
    bit, edge = marker / 6, (square - marker) / 2
    found = []
    pixels = 6 * cell
    for row in range(board.up):
        for column in range(board.across):
            x, y = column * square, row * square
            patch = drawn[row * pixels : (row + 1) * pixels, column * pixels : (column + 1) * pixels]
            if patch.mean() < 8:
                found.append((x, y, square, square))
                continue
            scale = board.marker / board.square * pixels
            for j in range(6):
                for i in range(6):
                    at = [int((pixels - scale) / 2 + scale * (k + 0.5) / 6) for k in (j, i)]
                    if patch[at[0], at[1]] < 128:
                        found.append((x + edge + i * bit, y + edge + j * bit, bit, bit))
    return found


def _size(board: Board) -> tuple[float, float]:
    return 1e3 * board.square * board.across + 2 * MARGIN, 1e3 * board.square * board.up + 2 * MARGIN


def svg(board: Board) -> str:
    """The board as a drawing to scale."""
    width, height = _size(board)
    shapes = "".join(
        f'<rect x="{x + MARGIN:.4f}" y="{y + MARGIN:.4f}" width="{w:.4f}" height="{h:.4f}"/>'
        for x, y, w, h in rectangles(board)
    )
    text = f'<text x="{MARGIN}" y="{height - 2:.1f}" font-size="4">{board}, print at 100 %</text>'
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:g}mm" height="{height:g}mm" '
        f'viewBox="0 0 {width:g} {height:g}" shape-rendering="crispEdges">'
        f'<rect width="{width:g}" height="{height:g}" fill="white"/>{shapes}{text}</svg>\n'
    )


def pdf(board: Board) -> bytes:
    """The board as a page of its own size, to scale."""
    point = 72 / 25.4
    width, height = (size * point for size in _size(board))
    scaled = (
        ((x + MARGIN) * point, height - (y + h + MARGIN) * point, w * point, h * point)
        for x, y, w, h in rectangles(board)
    )
    drawn = "".join(f"{x:.4f} {y:.4f} {w:.4f} {h:.4f} re\n" for x, y, w, h in scaled)
    text = f"BT /F 10 Tf {MARGIN * point:.2f} 5 Td ({board}, print at 100 %) Tj ET\n"
    stream = f"0 g\n{drawn}f\n{text}".encode("ascii")
    parts = [
        b"<< /Type /Catalog /Pages 2 0 R >>",
        b"<< /Type /Pages /Kids [3 0 R] /Count 1 >>",
        f"<< /Type /Page /Parent 2 0 R /MediaBox [0 0 {width:.4f} {height:.4f}] /Contents 4 0 R /Resources "
        "<< /Font << /F << /Type /Font /Subtype /Type1 /BaseFont /Helvetica >> >> >> >>".encode("ascii"),
        b"<< /Length %d >>\nstream\n%sendstream" % (len(stream), stream),
    ]
    out, places = b"%PDF-1.4\n", []
    for k, part in enumerate(parts, 1):
        places.append(len(out))
        out += b"%d 0 obj\n%s\nendobj\n" % (k, part)
    table = "".join(f"{place:010d} 00000 n \n" for place in places)
    tail = f"xref\n0 {len(parts) + 1}\n0000000000 65535 f \n{table}trailer\n"
    tail += f"<< /Size {len(parts) + 1} /Root 1 0 R >>\nstartxref\n{len(out)}\n%%EOF\n"
    return out + tail.encode("ascii")
