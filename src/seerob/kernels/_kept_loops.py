"""Where Numba keeps what it compiled: under names that change with the source.

Also for a user without a home: it refuses to work without a place.
"""

from __future__ import annotations

import atexit
import hashlib
import os
import re
import shutil
from functools import cache
from pathlib import Path
from tempfile import TemporaryFile, mkdtemp
from typing import Any

FOLDER = Path(__file__).parent
IMPORTED = re.compile(rb"^from seerob\.kernels\.(\w+) import ", re.MULTILINE)


@cache
def key_of(module: str) -> str:
    """Hash of what a module of `seerob.kernels` is compiled from and by, and the processor it is for.

    That is its source and what it imports there, and Numba.
    """
    import numba
    from llvmlite.binding import get_host_cpu_name

    sources: dict[str, bytes] = {}
    waiting = [module]
    while waiting:
        name = waiting.pop()
        if name not in sources:
            sources[name] = (FOLDER / f"{name}.py").read_bytes()
            waiting += [found.decode() for found in IMPORTED.findall(sources[name])]
    content = hashlib.sha256(f"{numba.__version__} {get_host_cpu_name()}".encode())
    for name in sorted(sources):
        content.update(hashlib.sha256(sources[name]).digest())
    return content.hexdigest()[:16]


def keep_loops() -> None:
    """Have Numba name what it keeps of these loops by `key_of`: what other source gave is never run.

    Numba itself looks at the file of a function alone, not at those of the functions that it calls.
    Where it may write to none of its folders it gets one that lasts as long as this process; nobody else
    may write there: what is read back from it is run.
    """
    from numba import config
    from numba.core import caching
    from platformdirs import user_cache_path

    known = caching.CompileResultCacheImpl._locator_classes
    if known[0].__module__ != __name__:
        places = caching.UserProvidedCacheLocator, caching.InTreeCacheLocator, caching.UserWideCacheLocator
        known[:0] = [_keyed(place) for place in places]
    if config.CACHE_DIR:  # type: ignore[attr-defined]
        return
    own = FOLDER / "__pycache__", user_cache_path("numba", appauthor=False)
    if any(map(_writable, own)):
        return
    folder = mkdtemp(prefix="seerob-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    # The former is for the processes that this one starts.
    os.environ["NUMBA_CACHE_DIR"] = config.CACHE_DIR = folder  # type: ignore[attr-defined]


def _keyed(place: Any) -> Any:
    """A place where Numba keeps functions, for those of this package alone and under their keys."""

    class Keyed(place):  # type: ignore[misc]
        @classmethod
        def from_function(cls, function: Any, file: str) -> Any:
            path = Path(file)
            return super().from_function(function, file) if path.parent == FOLDER and path.is_file() else None

        def get_disambiguator(self) -> str:
            return f"{super().get_disambiguator()}-{key_of(Path(self._py_file).stem)}"

    return Keyed


def _writable(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        TemporaryFile(dir=folder).close()
    except OSError:
        return False
    return True
