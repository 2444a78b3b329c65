"""Versions of what makes the numbers, for recordings and reports."""

from __future__ import annotations

import platform
from importlib.metadata import PackageNotFoundError, version


def versions() -> dict[str, str]:
    """Name → version of Python and of the packages that results depend on; absent ones are left out."""
    found = {"python": platform.python_version()}
    for name in ("seerob", "mujoco", "mujoco-core", "numpy", "numba", "scipy"):
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found
