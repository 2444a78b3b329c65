"""Build hook: a wheel brings the workstations of `seerob demo`, and loops.

The latter are what `scripts/compile-loops` left in the folder of `SEEROB_LOOPS`. Without that variable, or
with an empty folder, the wheel is for every platform, and loops are compiled by who runs them.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface
from packaging.tags import sys_tags

PLATFORM = "manylinux_2_27_"
"""What Numba's own wheel for Linux asks: the loops call nothing but what Numba brings and the C library's
mathematics."""


class Brought(BuildHookInterface[Any]):
    """Adds them, and names the Python and the platform that loops are for."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Of a wheel that is installed; one that points here (`editable`) keeps its own."""
        if version != "standard":
            return
        top = Path(self.root) / "workstations"
        shown = [path for path in top.rglob("*") if path.is_file() and "runs" not in path.parts]
        build_data["force_include"] |= {
            str(path): f"seerob/app/commands/workstations/{path.relative_to(top)}" for path in shown
        }
        folder = os.environ.get("SEEROB_LOOPS")
        files = sorted(Path(folder).glob("*.nb?")) if folder else []
        if files:
            tags = list(sys_tags())
            tag = next((tag for tag in tags if tag.platform.startswith(PLATFORM)), tags[0])
            build_data["pure_python"], build_data["tag"] = False, str(tag)
            build_data["force_include"] |= {
                str(file.resolve()): f"seerob/kernels/compiled/{file.name}" for file in files
            }
