"""Reads broken files, one after the other or in several processes, and counts what came of them."""

import faulthandler
import os
import random
import sys
import tempfile
import time
import warnings
from collections import Counter
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import ExitStack, contextmanager
from multiprocessing import get_context
from pathlib import Path
from unittest.mock import patch

from seerob.core.errors import InputError, SeerobError
from seerob.description import mesh_files as mesh_source
from seerob.files.motion_capture import ros_bag
from seerob.files.tables import table_files
from soak.corpus import corpus
from soak.made_cells import KINDS

PATIENCE = 10.0
"""Computing time [s] after which a file counts as one that hangs."""
SPARE = 512 << 20
"""Memory that a process may take beyond what it has before the first file [byte]."""
CHUNK = 2000


def hammer(kind, seed, files):
    """How many of ``files`` broken files of a kind were read and refused; anything else raises.

    The first are those of the corpus as they are, the others are changed ones.
    """
    format_ = KINDS[kind]
    counts = Counter(read=0, refused=0)
    rng = random.Random(f"{kind} {seed}")
    with tempfile.TemporaryDirectory(dir=_memory()) as folder:
        path = Path(folder) / f"f.{format_.suffix}"
        for number in range(files):
            if number < len(corpus(kind)):
                broken = corpus(kind)[number]
            else:  # half of them from the valid one
                broken = format_.change(rng.choice([corpus(kind)[0], rng.choice(corpus(kind))]), rng)
            path.write_bytes(broken)
            begun = time.thread_time()
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("error")
                    format_.read(path)
            except SeerobError:
                counts["refused"] += 1
            except BaseException as error:
                raise AssertionError(f"{kind}, seed {seed}, file {number}: {error!r}\n{broken!r}") from error
            else:
                counts["read"] += 1
            taken = time.thread_time() - begun
            assert taken < PATIENCE, f"{kind}, seed {seed}, file {number}: {taken:.0f} s\n{broken!r}"
    return counts


@contextmanager
def in_this_process():
    """Parsers that have a process of their own work in this one, where what they raise is seen."""

    def parsed(function, *arguments, file="", **_):
        try:
            return function(*arguments)
        except MemoryError:  # which is a message of that process
            raise InputError.at(file, "", "takes too much memory to read") from None

    def parsed_one_by_one(function, *arguments, file="", **_):
        try:
            yield from function(*arguments)
        except MemoryError:
            raise InputError.at(file, "", "takes too much memory to read") from None

    with ExitStack() as stack:
        for module in (mesh_source, table_files, ros_bag):
            for name, instead in (("parsed", parsed), ("parsed_one_by_one", parsed_one_by_one)):
                stack.enter_context(patch.object(module, name, instead, create=True))
        yield


def hammer_in_processes(kind, files, tell, done, keep):
    """As `hammer` does, in as many processes as there are processors.

    Args:
        kind: Of file.
        files: How many.
        tell: Hears how far it is.
        done: Seed of a chunk → what came of it, of an earlier time that was stopped.
        keep: Is given ``done`` after each chunk.
    """
    total = sum(map(Counter, done.values()), Counter())
    context = get_context("spawn")
    with ProcessPoolExecutor(os.cpu_count(), mp_context=context, initializer=_guarded) as pool:
        chunks = {
            pool.submit(_watched, kind, seed, min(CHUNK, files - seed)): str(seed)
            for seed in range(0, files, CHUNK)
            if str(seed) not in done
        }
        try:
            for chunk in as_completed(chunks):
                done[chunks[chunk]] = found = chunk.result()
                total += found
                keep(done)
                tell(f"{kind}: {total['read']} read, {total['refused']} refused of {files}")
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
    return total


def _watched(kind, seed, files):
    faulthandler.dump_traceback_later(120 * PATIENCE, exit=True)
    try:
        with in_this_process():
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
