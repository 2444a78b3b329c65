"""The inner loops: whether Numba has compiled them before, and what to say when it has not."""

from __future__ import annotations

import hashlib
import os
from importlib.util import find_spec
from pathlib import Path

from seerob.app.console.terminal import STATUS

COMPILING = "compiling the inner loops (once)"


def tell_compiling() -> None:
    """One line that stays during the wait, when nothing is compiled yet of the loops as they are now."""
    from seerob.kernels._kept_loops import FOLDER, key_of

    kept = {found.name for folder in cache_folders() if folder.is_dir() for found in folder.glob("*.nbi")}
    keys = {key_of(module.stem) for module in FOLDER.glob("*.py")} if kept else ()
    if not any(f"-{key}." in name for key in keys for name in kept):
        STATUS.print(COMPILING, markup=False)


def cache_folders() -> list[Path]:
    """Where Numba keeps, or looks for, what it compiled of `seerob.kernels`."""
    spec = find_spec("seerob.kernels")
    assert spec is not None
    assert spec.origin is not None
    package = os.path.dirname(os.path.abspath(spec.origin))
    # As numba.core.caching names the folder of a package in a cache for all of them.
    inner = f"{os.path.basename(package)}_{hashlib.sha1(package.encode(), usedforsecurity=False).hexdigest()}"
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    if chosen:
        return [Path(chosen) / inner]
    from platformdirs import user_cache_path

    return [Path(package) / "__pycache__", user_cache_path("numba", appauthor=False) / inner]
