"""Reads broken files, one after the other or in several processes, and counts what came of them."""

import faulthandler
import os
import random
import sys
import tempfile
import warnings
from collections import Counter
from concurrent.futures import ProcessPoolExecutor, as_completed
from functools import cache
from multiprocessing import get_context
from pathlib import Path

from seerob.core.errors import InputError
from soak.made_files import KINDS

PATIENCE = 120.0
"""A file that takes longer [s] is one that hangs."""
SPARE = 2 << 30
"""Memory that a process may take beyond what it has before the first file [byte]."""
CHUNK = 2000


def hammer(kind, seed, files):
    """How many of ``files`` broken files of a kind were read and refused; anything else raises."""
    format_ = KINDS[kind]
    counts = Counter(read=0, refused=0)
    whole, rng = made(kind), random.Random(f"{kind} {seed}")
    with tempfile.TemporaryDirectory(dir=_memory()) as folder:
        path = Path(folder) / f"f.{format_.suffix}"
        for number in range(files):
            broken = format_.change(whole, rng)
            path.write_bytes(broken)
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("error")
                    format_.read(path)
            except InputError:
                counts["refused"] += 1
            except BaseException as error:
                raise AssertionError(f"{kind}, seed {seed}, file {number}: {error!r}\n{broken!r}") from error
            else:
                counts["read"] += 1
    return counts


@cache
def made(kind):
    """The valid file of a kind, made once in each process."""
    with tempfile.TemporaryDirectory(dir=_memory()) as folder:
        path = Path(folder) / f"f.{KINDS[kind].suffix}"
        KINDS[kind].make(path)
        return path.read_bytes()


def hammer_in_processes(kind, files, tell):
    """The same in as many processes as there are processors; ``tell`` hears how far it is."""
    total = Counter()
    context = get_context("spawn")
    with ProcessPoolExecutor(os.cpu_count(), mp_context=context, initializer=_guarded) as pool:
        chunks = [
            pool.submit(_watched, kind, seed, min(CHUNK, files - seed)) for seed in range(0, files, CHUNK)
        ]
        try:
            for done in as_completed(chunks):
                total += done.result()
                tell(f"{kind}: {total['read']} read, {total['refused']} refused of {files}")
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
    return total


def _watched(kind, seed, files):
    faulthandler.dump_traceback_later(PATIENCE * 10, exit=True)
    try:
        return hammer(kind, seed, files)
    finally:
        faulthandler.cancel_dump_traceback_later()


def _guarded():
    """A process whose memory ends before that of the machine does."""
    if sys.platform == "linux":
        import resource

        own = int(Path("/proc/self/statm").read_text().split()[0]) * os.sysconf("SC_PAGESIZE")
        resource.setrlimit(resource.RLIMIT_AS, (own + SPARE, own + SPARE))


def _memory():
    """A folder in memory, where there is one."""
    shared = Path("/dev/shm")
    return shared if shared.is_dir() and os.access(shared, os.W_OK) else None
