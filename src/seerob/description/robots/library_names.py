"""Which robots the library has, for who reads none of them: that needs meshes, and so numpy and Numba."""

from __future__ import annotations

from importlib import resources


def names() -> tuple[str, ...]:
    """Names of the robots in the library, sorted."""
    files = resources.files(__package__).iterdir()
    return tuple(sorted(f.name.removesuffix(".toml") for f in files if f.name.endswith(".toml")))
