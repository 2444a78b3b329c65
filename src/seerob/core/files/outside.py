"""Whether a path leads out of a folder, and what to do about it where it may not."""

from __future__ import annotations

from pathlib import Path

REMEDY = (
    "copy it into the folder of the workstation file, or, if you trust the file, --allow-outside (in Python "
    "allow_outside=True)"
)


def leads_outside(path: Path, folder: Path) -> Path | None:
    """Where a path leads when that exists outside a folder; None when it does not."""
    try:
        real = path.resolve(strict=True)
        inside = real.is_relative_to(folder.resolve())
    except (OSError, RuntimeError, ValueError):  # no such file, links in a circle, no name of a file
        return None
    return None if inside or real == Path(real.anchor) else real
