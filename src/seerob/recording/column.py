"""Numbers that come one by one for hours: the newest in memory, the rest in a file without a name.

What a run of eight hours says of one criterion is 80 MB. A `Column` keeps a block of it in memory, and a
`Spill` takes the full blocks of many columns; nothing is rounded or left out, and reading a column puts it
together again.
"""

from __future__ import annotations

import logging
import os
import tempfile
import weakref
from array import array
from pathlib import Path
from threading import Lock
from typing import IO, Any

_log = logging.getLogger(__name__)

BLOCK = 1 << 13
"""Numbers of a column in memory: over a minute of ticks."""
DISK = Path("/var/tmp")  # noqa: S108 - files without a name
"""For temporary files that are large, where there is such a folder: the usual one may be memory."""


class Spill:
    """A file without a name for full blocks; gone with the process, however that ends."""

    def __init__(self) -> None:
        self.lock = Lock()
        """Held while a block goes from memory to the file, and while a column is put together."""
        self._file: IO[bytes] | None = None
        self._full = False

    def write(self, data: bytes) -> int | None:
        """Append a block; call it with the lock held.

        Returns:
            Where it begins; None when it could not be written, and has to stay in memory.
        """
        if self._full:
            return None
        try:
            if self._file is None:
                roomy = DISK.is_dir() and os.access(DISK, os.W_OK)
                self._file = tempfile.TemporaryFile(buffering=0, dir=DISK if roomy else None)  # noqa: SIM115
                weakref.finalize(self, self._file.close)
            begin = self._file.seek(0, os.SEEK_END)
            written = self._file.write(data)
        except OSError as error:
            written, reason = -1, error.strerror
        else:
            reason = "no space left"
        if written == len(data):
            return begin
        self._full = True
        _log.warning("results stay in memory, which grows: a temporary file cannot be written: %s", reason)
        return None

    def read(self, begin: int, size: int) -> bytes:
        """A block [byte]; call it with the lock held.

        Raises:
            OSError: The file cannot be read.
        """
        if self._file is None:
            raise OSError("nothing was written")
        self._file.seek(begin)
        parts = []
        while size > 0 and (part := self._file.read(size)):
            parts.append(part)
            size -= len(part)
        if size:
            raise OSError("a temporary file of results has become shorter")
        return b"".join(parts)


class Column:
    """Numbers of one type, appended one by one, by one thread; any thread may read.

    Args:
        typecode: As of `array.array`.
        spill: Takes full blocks.
    """

    def __init__(self, typecode: str, spill: Spill) -> None:
        self._typecode, self._spill = typecode, spill
        self._blocks: list[int | bytes] = []
        """Full ones: where each begins in the file, or itself."""
        self._newest: array[Any] = array(typecode)
        self._count = 0
        self._size = BLOCK * self._newest.itemsize

    def __len__(self) -> int:
        return self._count

    def append(self, number: float) -> None:
        """Add one."""
        self._newest.append(number)
        if len(self._newest) == BLOCK:
            with self._spill.lock:
                data = self._newest.tobytes()
                begin = self._spill.write(data)
                self._blocks.append(data if begin is None else begin)
                self._newest = array(self._typecode)
        self._count += 1

    def tobytes(self) -> bytes:
        """All of them, in the machine's own form."""
        if not self._blocks:
            # One step under the interpreter's lock: a reader never sees an array that is being grown.
            newest = self._newest.tobytes()
            if not self._blocks:
                return newest
        with self._spill.lock:
            old = [b if isinstance(b, bytes) else self._spill.read(b, self._size) for b in self._blocks]
            return b"".join((*old, self._newest.tobytes()))
