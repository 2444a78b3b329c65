"""A mailbox between two processes: the newest sample of each kind, in memory that both see.

Nothing queues and nobody waits: who writes replaces, who reads takes what is there. A kind of sample
(`seerob.core.samples.key`) has a slot of two halves, written in turn; a number says which is the newer one.
What is copied while it is overwritten is found by that half's own number and checksum, and copied again.
"""

from __future__ import annotations

import contextlib
import mmap
import os
import struct
import tempfile
import zlib
from typing import Any

import msgspec
import numpy as np

from seerob.core.errors import SeerobError
from seerob.core.samples import Sample, key

SLOTS = 256
"""Kinds of samples."""
LARGEST = 1 << 17
"""Of an encoded sample [byte]; memory that is never written takes no room."""
AGAIN = 20
"""Times that a slot is read which is being overwritten; then it waits for the next call."""

_COUNT = struct.Struct("<Q")
_HALF = struct.Struct("<QII")
"""Number of the sample, length [byte], checksum."""
_HEAD = 64
_ROOM = _HALF.size + LARGEST
_SLOT = _HEAD + 2 * _ROOM
_WHOLE = _HEAD + SLOTS * _SLOT


def memory() -> int:
    """A descriptor of memory for one mailbox; another process inherits it, and whoever has it closes it.

    Raises:
        OSError: There is none.
    """
    file = _nameless()
    try:
        os.ftruncate(file, _WHOLE)
    except BaseException:
        os.close(file)
        raise
    return file


def _nameless() -> int:
    if hasattr(os, "memfd_create"):
        with contextlib.suppress(OSError):  # some containers forbid it
            return os.memfd_create("seerob-mailbox")
    with tempfile.TemporaryFile() as found:
        return os.dup(found.fileno())


class SharedMailbox:
    """One end; one thread may `post`, of the process that writes, and one `take`, of that which reads.

    Args:
        file: From `memory`; may be closed afterwards.
    """

    def __init__(self, file: int) -> None:
        self._memory = mmap.mmap(file, _WHOLE)
        self._places: dict[tuple[str, ...], int] = {}
        self._written: list[int] = []
        """Samples so far, by slot."""
        self._encoder = msgspec.msgpack.Encoder(enc_hook=_plain)
        self._decoder = msgspec.msgpack.Decoder(Sample)
        self._seen: list[int] = []

    def post(self, sample: Sample) -> None:
        """Put a sample; it replaces an earlier one about the same target that nobody took.

        Raises:
            SeerobError: It is too large, or one kind too many.
            TypeError: A mistake of the source: what it says is no sample.
        """
        data = self._encoder.encode(sample)
        try:
            self._decoder.decode(data)
        except msgspec.ValidationError as error:
            raise TypeError(f"no {type(sample).__name__}: {error}") from None
        if len(data) > LARGEST:
            raise SeerobError(f"a sample of {len(data)} bytes; the most is {LARGEST}")
        index = self._places.setdefault(key(sample), len(self._places))
        if index == SLOTS:
            del self._places[key(sample)]
            raise SeerobError(f"more than {SLOTS} different things are told")
        if index == len(self._written):
            self._written.append(0)
        number = self._written[index] = self._written[index] + 1
        start = _HEAD + index * _SLOT
        half = start + _HEAD + (number & 1) * _ROOM
        _HALF.pack_into(self._memory, half, number, len(data), zlib.crc32(data))
        self._memory[half + _HALF.size : half + _HALF.size + len(data)] = data
        _COUNT.pack_into(self._memory, start, number)
        if number == 1:
            _COUNT.pack_into(self._memory, 0, index + 1)

    def take(self) -> tuple[Sample, ...]:
        """The samples posted since the last call, in order of the first one of their kind."""
        (count,) = _COUNT.unpack_from(self._memory, 0)
        self._seen += [0] * (count - len(self._seen))
        taken = []
        for index in range(count):
            data = self._newest(index)
            if data is not None:
                taken.append(self._decoder.decode(data))
        return tuple(taken)

    def _newest(self, index: int) -> bytes | None:
        """What a slot holds; None when it was taken, or for now."""
        start = _HEAD + index * _SLOT
        for _ in range(AGAIN):
            (number,) = _COUNT.unpack_from(self._memory, start)
            if number == self._seen[index]:
                return None
            half = start + _HEAD + (number & 1) * _ROOM
            wrote, length, checksum = _HALF.unpack_from(self._memory, half)
            if wrote != number or length > LARGEST:
                continue
            data = self._memory[half + _HALF.size : half + _HALF.size + length]
            if zlib.crc32(data) == checksum:
                self._seen[index] = number
                return data
        return None


def _plain(value: Any) -> float | bool | int:
    """Numbers of numpy, which some libraries give."""
    if isinstance(value, np.generic):
        return value.item()  # type: ignore[no-any-return]
    raise TypeError(f"a {type(value).__name__} in a sample")
