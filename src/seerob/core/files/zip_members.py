"""What zip archives hold, bounded by the bytes that are unpacked and never by what the archive says of them.

`zipfile.ZipFile.read` unpacks a member as far as it goes before it looks at the size that was declared; here
it is unpacked piece by piece, so that one that declares less than it holds fails after a piece.
"""

from __future__ import annotations

from collections.abc import Iterator
from zipfile import ZipFile, ZipInfo

PIECE = 1 << 16
"""[byte]"""


class TooLarge(ValueError):
    """More was unpacked than is taken."""


def pieces(archive: ZipFile, member: str | ZipInfo, most: int) -> Iterator[bytes]:
    """A member piece by piece.

    Args:
        archive: The archive.
        member: Of it.
        most: How much of it is taken [byte].

    Raises:
        TooLarge: It holds more.
        zipfile.BadZipFile: It is not what the archive says, its size included.
    """
    left = most
    with archive.open(member) as file:
        while piece := file.read(PIECE):
            left -= len(piece)
            if left < 0:
                raise TooLarge(f"unpacks to more than {most} bytes")
            yield piece


def unpacked(archive: ZipFile, member: str | ZipInfo, most: int) -> bytes:
    """A member whole; raises as `pieces` does."""
    return b"".join(pieces(archive, member, most))


def sizes(archive: ZipFile, most: int) -> dict[str, int]:
    """How much each member holds [byte], found by unpacking all of them; raises as `pieces` does.

    Args:
        archive: The archive.
        most: How much is taken of all of them together [byte].
    """
    found: dict[str, int] = {}
    for member in archive.infolist():
        left = most - sum(found.values())
        found[member.filename] = sum(map(len, pieces(archive, member, left)))
    return found
