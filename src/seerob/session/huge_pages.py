"""Memory in pages of 2 MB for what a loop goes through again and again, where Linux grants them.

A tick visits objects all over the interpreter's memory. In pages of 4 kB those are more pages than a
processor knows the places of, and to look one up takes a virtual machine several times as long as a real one.
Most distributions give larger pages to those alone who ask (``madvise`` in
``/sys/kernel/mm/transparent_hugepage/enabled``), and neither Python nor MuJoCo asks.
"""

from __future__ import annotations

import ctypes
import functools
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

PAGE, HUGE = 1 << 12, 1 << 21
"""Bytes of a page and of a large one, where a page is described by eight bytes."""
MOSTLY = 0.75
"""Share of a large page that is in use before it is made one: all of it is, then."""
ALLOWED = Path("/sys/kernel/mm/transparent_hugepage/enabled")
_COLLAPSE = 25
"""``MADV_COLLAPSE`` of Linux 6.1; earlier ones refuse."""
_PRESENT = np.uint64(63)
"""Bit of a page's description."""


@functools.cache
def use_huge_pages() -> int:
    """Have what this process uses now in large pages, once; how many bytes are.

    It takes about a tenth of a second, changes no byte and no address, and asks for no privilege. Where the
    machine's owner allows none, or the kernel has none left, everything stays as it is.
    """
    if sys.platform != "linux":
        return 0
    try:
        if "[never]" in ALLOWED.read_text():
            return 0
        advise = ctypes.CDLL(None).madvise
        advise.argtypes = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int
        made = 0
        for place in _mostly_used():
            made += HUGE * (advise(place, HUGE, _COLLAPSE) == 0)
    except (OSError, AttributeError, ValueError):  # a container without these files, another C library
        return 0
    return made


def _mostly_used() -> Iterator[int]:
    """Addresses of large pages of this process's own memory that are mostly in use.

    Raises:
        OSError: The kernel does not say.
    """
    with open("/proc/self/maps") as file:
        regions = [line.split(None, 5)[:5] for line in file]
    per = HUGE // PAGE
    with open("/proc/self/pagemap", "rb", buffering=0) as pages:
        for span, access, _, _, inode in regions:
            begin, end = (int(address, 16) for address in span.split("-"))
            first, last = -(-begin // HUGE), end // HUGE
            if inode != "0" or access != "rw-p" or last <= first:
                continue
            pages.seek(first * per * 8)
            described = np.frombuffer(pages.read((last - first) * per * 8), np.uint64)
            used = (described >> _PRESENT).reshape(last - first, per).sum(axis=1)
            yield from ((first + np.flatnonzero(used >= MOSTLY * per)) * HUGE).tolist()
