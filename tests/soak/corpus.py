"""Broken files of each format that reach lines of its reader which no smaller one reaches.

``python -m soak.corpus SECONDS [KIND …]`` in tests/ looks for more of them and keeps as many as are needed
for every line that any of them reaches.
"""

import random
import sys
import tempfile
import time
import zipfile
from collections import Counter
from functools import cache
from pathlib import Path

import seerob
from soak.made_cells import KINDS

FILE = Path(__file__).parent / "corpus.zip"
LARGEST = 16 << 10
"""A larger file is not kept [byte]."""
STAMP = (2026, 1, 1, 0, 0, 0)
OURS = str(Path(seerob.__file__).parent)


@cache
def corpus(kind):
    """The valid file of a kind, then the broken ones that are kept."""
    return [_made(kind), *_kept(kind)]


def _made(kind):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"f.{KINDS[kind].suffix}"
        KINDS[kind].make(path)
        return path.read_bytes()


def _kept(kind):
    if not FILE.exists():
        return []
    with zipfile.ZipFile(FILE) as archive:
        return [archive.read(name) for name in archive.namelist() if name.startswith(f"{kind}/")]


def reached(kind, data, path):
    """Lines of this package that run while a file is read, and whether it ended as it may."""
    path.write_bytes(data)
    lines = set()

    def inside(frame, event, _):
        if event == "line":
            lines.add((frame.f_code.co_filename, frame.f_lineno))
        return inside

    def outside(frame, _, __):
        return inside if frame.f_code.co_filename.startswith(OURS) else None

    sys.settrace(outside)
    try:
        KINDS[kind].read(path)
    except Exception as error:  # what else than mistakes it raises is for the tests to find
        lines.add((type(error).__name__, 0))
    finally:
        sys.settrace(None)
    return frozenset(lines)


def grown(kind, seconds, seed):
    """The broken files that are worth keeping after so much looking."""
    rng, found = random.Random(f"{kind} {seed}"), {}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"f.{KINDS[kind].suffix}"
        whole = _made(kind)
        known = set(reached(kind, whole, path) | reached(kind, whole, path))
        first = set(known)
        for data in _kept(kind):
            found[data] = reached(kind, data, path)
            known |= found[data]
        until = time.thread_time() + seconds
        while time.thread_time() < until:
            data = KINDS[kind].change(rng.choice([whole, whole, *found]), rng)
            if not data or len(data) > LARGEST:
                continue
            lines = reached(kind, data, path)
            if lines - known:
                found[data] = lines
                known |= lines
    return _few(found, first)


def _few(found, known):
    """So many of the files that together they reach what all of them do, the smallest first."""
    times = Counter(line for lines in found.values() for line in lines)
    order = sorted(found, key=lambda data: (-sum(times[line] == 1 for line in found[data]), len(data)))
    kept, covered = [], set(known)
    for data in order:
        if found[data] - covered:
            kept.append(data)
            covered |= found[data]
    return kept


def main(seconds, *kinds):
    """Look for more of each kind, and keep what is worth it."""
    from soak.hammering import in_this_process

    held = {kind: _kept(kind) for kind in KINDS}
    for kind in kinds or KINDS:
        with in_this_process():
            held[kind] = grown(kind, float(seconds), time.time())
        print(f"{kind}: {len(held[kind])} files", flush=True)
        with zipfile.ZipFile(FILE, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, files in held.items():
                for number, data in enumerate(files):
                    archive.writestr(zipfile.ZipInfo(f"{name}/{number}", STAMP), data, zipfile.ZIP_DEFLATED)


if __name__ == "__main__":
    main(*sys.argv[1:])
