"""MJPEG over HTTP: pictures of a network camera, one JPEG after another in one answer.

The answer is ``multipart/x-mixed-replace`` (RFC 2046 5.1 for the parts): a boundary, a header, a JPEG. Of
cameras that leave ``Content-Length`` out a picture is read up to the next boundary, `LARGEST` at most.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from typing import Protocol

from seerob.protocols import ProtocolError

LARGEST = 4 << 20
"""Of one picture [byte]."""
LONGEST_LINE = 4096
"""Of a header [byte]."""
MOST_LINES = 64
_BOUNDARY = re.compile(r"multipart/x-mixed-replace\s*;.*?boundary=\"?([^\";]{1,200})", re.IGNORECASE)


class Answer(Protocol):
    """The body of an answer."""

    def read(self, size: int, /) -> bytes:
        """So many bytes, fewer at its end."""

    def readline(self, size: int, /) -> bytes:
        """To the end of a line, or so many bytes."""


def boundary(content_type: str) -> bytes:
    """What stands between pictures, of an answer of this type.

    Raises:
        ProtocolError: It is no stream of pictures.
    """
    found = _BOUNDARY.match(content_type)
    if found is None:
        raise ProtocolError(f"answers with {content_type[:60]!r}, not with multipart/x-mixed-replace (MJPEG)")
    # Some cameras say the dashes that precede it, too.
    return b"--" + found[1].strip().encode("latin-1", "replace").removeprefix(b"--")


def pictures(answer: Answer, between: bytes) -> Iterator[bytes]:
    """Every JPEG of an answer, to its end.

    Args:
        answer: The body.
        between: As `boundary` has it.

    Raises:
        ProtocolError: A part is too long, or no JPEG.
    """
    begun = False
    while begun or _begins(answer, between):
        length = _length(answer)
        # Without a length, what ends a picture has begun the next.
        begun = length is None
        data = _until(answer, between) if length is None else answer.read(length)
        if not data or (length is not None and len(data) < length):
            return
        if size_of(data) is None:
            raise ProtocolError("a part is no JPEG picture")
        yield data


def _begins(answer: Answer, between: bytes) -> bool:
    """Whether another part begins."""
    for _ in range(MOST_LINES):
        line = answer.readline(LONGEST_LINE)
        if not line or line.startswith(between + b"--"):
            return False
        if line.startswith(between):
            return True
    raise ProtocolError("no boundary where one has to be")


def _length(answer: Answer) -> int | None:
    """What the header of a part says."""
    found = None
    for _ in range(MOST_LINES):
        name, _, value = answer.readline(LONGEST_LINE).strip().partition(b":")
        if not name:
            return found
        if name.lower() == b"content-length":
            if not value.strip().isdigit() or len(value) > 12 or not 0 < int(value) <= LARGEST:
                raise ProtocolError(f"a picture of {value[:20].decode('latin-1').strip()} bytes")
            found = int(value)
    raise ProtocolError(f"a header of more than {MOST_LINES} lines")


def _until(answer: Answer, between: bytes) -> bytes:
    """A picture without a length; the boundary after it is read, too."""
    data = bytearray()
    while len(data) <= LARGEST:
        line = answer.readline(65536)
        if not line or (line.startswith(between) and data.endswith(b"\n")):
            return bytes(data.rstrip(b"\r\n"))
        data += line
    raise ProtocolError(f"a picture of more than {LARGEST >> 20} MiB")


def size_of(jpeg: bytes) -> tuple[int, int] | None:
    """Width and height of a JPEG picture [px]; None where it is none (ITU-T T.81, B.2.2)."""
    if jpeg[:2] != b"\xff\xd8":
        return None
    at = 2
    while at + 9 <= len(jpeg) and jpeg[at] == 0xFF:
        kind = jpeg[at + 1]
        if kind == 0xFF:
            at += 1
            continue
        if 0xC0 <= kind <= 0xCF and kind not in (0xC4, 0xC8, 0xCC):
            height, width = struct.unpack_from(">HH", jpeg, at + 5)
            return width, height
        at += 2 + int(struct.unpack_from(">H", jpeg, at + 2)[0])
    return None
