"""Where Numba keeps what it compiled, also for a user without a home: it refuses to work without a place."""

from __future__ import annotations

import atexit
import os
import shutil
from pathlib import Path
from tempfile import TemporaryFile, mkdtemp


def keep_loops() -> None:
    """Give Numba a folder that lasts as long as this process, where it may write to none of its own.

    Nobody else may write there: what is read back from it is run.
    """
    from numba import config
    from platformdirs import user_cache_path

    if config.CACHE_DIR:  # type: ignore[attr-defined]
        return
    own = Path(__file__).parent / "__pycache__", user_cache_path("numba", appauthor=False)
    if any(map(_writable, own)):
        return
    folder = mkdtemp(prefix="seerob-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    # The former is for the processes that this one starts.
    os.environ["NUMBA_CACHE_DIR"] = config.CACHE_DIR = folder  # type: ignore[attr-defined]


def _writable(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        TemporaryFile(dir=folder).close()
    except OSError:
        return False
    return True
