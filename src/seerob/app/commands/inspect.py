"""``seerob inspect``: what opening, checking, assessing, running and serving would do, without doing it."""

from __future__ import annotations

import argparse
from pathlib import Path

from seerob.app.console.terminal import Exit, line

HELP = "tell what a folder, a file or a recording would read, start, import, connect to and write"
EXAMPLE = "seerob inspect my_cell"

_STYLES = {
    "outside": "yellow",
    "refused": "yellow",
    "imports": "bold",
    "connects": "bold",
    "sends": "bold red",
}


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments."""
    text = "folder with a workstation.toml, the file itself, or a recording (.mcap)"
    sub.add_argument("workstation", type=Path, help=text)


def run(options: argparse.Namespace) -> int:
    """Read the workstation file and descriptions beside it as text; open, start and import nothing.

    Raises:
        InputError: There is no such file, or it is not what it should be.
    """
    from seerob.session.inspection import inspected

    for fact in inspected(options.workstation):
        line(fact.does, fact.what, _STYLES.get(fact.does, ""))
    return Exit.WITHIN
