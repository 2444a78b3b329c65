"""What files and zip archives hold, bounded by the bytes that are read and never by what they declare.

`zipfile.ZipFile.read` unpacks a member as far as it goes before it looks at the size that was declared; here
it is unpacked piece by piece, so that one that declares less than it holds fails after a piece.

Whether a path leads out of a folder, and what to do about it where it may not.
"""

from __future__ import annotations

import errno
import stat
from collections.abc import Iterator
from pathlib import Path
from zipfile import ZipFile, ZipInfo

REMEDY = (
    "copy it into the folder of the workstation file, or, if you trust the file, --allow-outside (in Python "
    "allow_outside=True)"
)


def missing_file(name: str | Path, remedy: str) -> str:
    """What to do about a file that is not there."""
    return f"write / between folders, not \\; {remedy}" if "\\" in str(name) else remedy


def leads_outside(path: Path, folder: Path) -> Path | None:
    """Where a path leads when that exists outside a folder; None when it does not."""
    try:
        path.stat()  # most texts of a workstation are no files: one call tells that
        real = path.resolve(strict=True)
        inside = real.is_relative_to(folder.resolve())
    except (OSError, RuntimeError, ValueError):  # no such file, links in a circle, no name of a file
        return None
    return None if inside or real == Path(real.anchor) else real


PIECE = 1 << 16
"""[byte]"""


class TooLarge(ValueError):
    """More was read or unpacked than is taken."""


def regular(path: Path) -> int:
    """How many bytes a file says that it has.

    Raises:
        OSError: It is not there, or a pipe or a device, which may never end.
    """
    there = path.stat()
    if not stat.S_ISREG(there.st_mode) and not stat.S_ISDIR(there.st_mode):
        raise OSError(errno.EINVAL, "is a pipe or a device and no file")
    return there.st_size


def content(path: Path, most: int) -> bytes:
    """A file whole.

    Args:
        path: The file.
        most: How much of it is taken [byte].

    Raises:
        TooLarge: It holds more.
        OSError: It cannot be read.
    """
    said = regular(path)
    if said <= most:
        with path.open("rb") as file:
            held = file.read(said + 1)
            # One may grow, or be of a system that tells no sizes.
            while len(held) <= most and (piece := file.read(PIECE)):
                held += piece
        if len(held) <= most:
            return held
    raise TooLarge(f"has more than {most} bytes")


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
