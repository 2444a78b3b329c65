"""Memory that a loop goes through, in large pages: as the kernel itself describes it."""

import ctypes
import mmap
import sys

import numpy as np
import pytest

from seerob.session import huge_pages
from seerob.session.huge_pages import HUGE, PAGE, use_huge_pages

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="Linux alone is asked for large pages")


def described(address: int, key: str) -> int:
    """What the kernel says of the region with an address [byte]."""
    inside = False
    with open("/proc/self/smaps") as file:
        for line in file:
            word, *rest = line.split()
            if not word.endswith(":"):
                begin, end = (int(part, 16) for part in word.split("-"))
                inside = begin <= address < end
            elif inside and word == f"{key}:":
                return int(rest[0]) * 1024
    raise AssertionError("no such memory")


@pytest.fixture
def memory():
    """Bytes that nothing uses yet, and their address, in a region of its own."""
    made = mmap.mmap(-1, 16 * HUGE, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    made.madvise(mmap.MADV_DONTDUMP)  # or the kernel makes one region of it and its neighbours
    found = np.frombuffer(made, np.uint8)
    use_huge_pages.cache_clear()
    yield found, found.ctypes.data
    use_huge_pages.cache_clear()


def refused(address):
    """Whether the kernel, asked for one large page here, gives none."""
    advise = ctypes.CDLL(None).madvise
    advise.argtypes = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int
    return advise(address, HUGE, 25) != 0


def test_what_is_used_is_in_large_pages_and_reads_as_before(memory):
    used, at = memory
    used[:] = np.arange(len(used), dtype=np.uint32).astype(np.uint8)
    before = used.copy()
    use_huge_pages()
    if not described(at, "AnonHugePages") and refused(at + HUGE - at % HUGE):
        pytest.skip("this kernel gives none, or has none left")
    assert described(at, "AnonHugePages") >= 8 * HUGE
    assert (used == before).all()
    assert use_huge_pages() == use_huge_pages()


def test_what_is_not_used_takes_no_room(memory):
    unused, at = memory
    unused[::HUGE] = 1  # a page of each
    before = described(at, "Rss")
    use_huge_pages()
    assert described(at, "Rss") == before
    assert PAGE * 16 <= before < 16 * HUGE


def test_who_forbids_them_gets_none(memory, tmp_path, monkeypatch):
    used, at = memory
    used[:] = 1
    forbidden = tmp_path / "enabled"
    forbidden.write_text("always madvise [never]\n")
    monkeypatch.setattr(huge_pages, "ALLOWED", forbidden)
    assert use_huge_pages() == 0
    monkeypatch.setattr(huge_pages, "ALLOWED", tmp_path / "none")
    use_huge_pages.cache_clear()
    assert use_huge_pages() == 0
    assert described(at, "AnonHugePages") == 0
