"""The elements of one array in a JSON file of any size, one after the other, without holding the file."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from seerob.core.errors import InputError

CHUNK = 1 << 20
MAX_ELEMENT = 4 << 20
"""Bytes of one element; more is refused."""
MAX_DEPTH = 32
_STRUCTURE = re.compile(rb'["{}\[\]]')
_STRING_END = re.compile(rb'["\\]')


def elements(path: Path, key: str, *, file: str) -> Iterator[bytes]:
    """The raw text of each object in the array that stands under ``key`` of the outermost object.

    Args:
        path: The file.
        key: Name of the array.
        file: As messages name it.

    Raises:
        InputError: It is no JSON object with such an array of objects, or an element is too large.
    """
    wanted = b'"' + key.encode() + b'"'
    scan = _Scan(wanted)
    try:
        with path.open("rb") as stream:
            while chunk := stream.read(CHUNK):
                yield from scan.feed(chunk, file)
                if scan.ended:
                    return
    except OSError as error:
        what = f"cannot be read: {error.strerror}"
        raise InputError.at(file, "", what, "give the path of the recording") from error
    if scan.begun:
        raise InputError.at(file, key, f"the file ends in element {scan.count}", "was it cut short?")
    raise InputError.at(file, key, f"no list {key!r} of objects in it", "is it the file of a body tracker?")


class _Scan:
    """Where in the structure the bytes are; text inside strings does not count."""

    def __init__(self, wanted: bytes) -> None:
        self.begun = self.ended = False
        self.count = 0
        self._wanted = wanted
        self._waiting = bytearray()
        self._at = 0
        self._depth = 0
        self._inside: int | None = None
        """Depth of the elements' own braces, once the array has begun."""
        self._start: int | None = None
        self._string: int | None = None
        self._last = b""
        """The newest string at depth 1."""
        self._last_end = 0

    def feed(self, chunk: bytes, file: str) -> Iterator[bytes]:
        """Elements that end in these bytes."""
        self._waiting += chunk
        while self._step(file):
            if self._element is not None:
                yield self._element
                self.count += 1
            if self.ended:
                return
        self._drop()
        if len(self._waiting) > MAX_ELEMENT:
            raise InputError.at(file, f"element {self.count}", f"longer than {MAX_ELEMENT} bytes")

    def _step(self, file: str) -> bool:
        """Go on to the next mark; whether there was one."""
        self._element: bytes | None = None
        if self._string is not None:
            return self._through_string()
        mark = _STRUCTURE.search(self._waiting, self._at)
        if mark is None:
            self._at = len(self._waiting)
            return False
        at, sign = mark.start(), mark[0]
        self._at = at + 1
        if sign == b'"':
            self._string = at
        elif sign in b"{[":
            self._open(at, sign, file)
        else:
            self._close(at, sign, file)
        return True

    def _through_string(self) -> bool:
        assert self._string is not None
        end = _STRING_END.search(self._waiting, self._at)
        if end is None:
            self._at = len(self._waiting)
            return False
        if end[0] == b"\\":
            if end.start() + 1 >= len(self._waiting):
                self._at = end.start()
                return False
            self._at = end.start() + 2
            return True
        if self._depth == 1:
            self._last = bytes(self._waiting[self._string : end.end()])
            self._last_end = end.end()
        self._string, self._at = None, end.end()
        return True

    def _open(self, at: int, sign: bytes, file: str) -> None:
        if self._depth == 0 and sign != b"{":
            raise InputError.at(file, "", "it does not begin with {", "is it the file of a body tracker?")
        self._depth += 1
        if self._depth > MAX_DEPTH:
            raise InputError.at(file, f"element {self.count}", f"nested deeper than {MAX_DEPTH}")
        if self._inside is None and self._depth == 2 and sign == b"[" and self._named(at):
            self.begun, self._inside = True, 3
        elif self._inside == self._depth and self._start is None:
            if sign != b"{":
                raise InputError.at(file, f"element {self.count}", "not an object")
            self._start = at

    def _named(self, at: int) -> bool:
        """Whether the array that begins here is the one that is looked for."""
        between = bytes(self._waiting[self._last_end : at])
        return self._last == self._wanted and between.strip() == b":"

    def _close(self, at: int, sign: bytes, file: str) -> None:
        self._depth -= 1
        if self._depth < 0:
            raise InputError.at(file, f"element {self.count}", f"{sign.decode()} without a beginning")
        if self._inside is None:
            return
        if self._depth == self._inside - 1 and self._start is not None:
            self._element = bytes(self._waiting[self._start : at + 1])
            self._start = None
        elif self._depth == self._inside - 2:
            self.ended = True

    def _drop(self) -> None:
        """Forget what is behind; a string or an element that goes on is kept."""
        keep = [self._at]
        keep += [x for x in (self._start, self._string) if x is not None]
        if self._depth == 1 and self._last:
            keep.append(self._last_end)
        cut = min(keep)
        del self._waiting[:cut]
        self._at -= cut
        self._last_end -= cut
        self._start = None if self._start is None else self._start - cut
        self._string = None if self._string is None else self._string - cut
