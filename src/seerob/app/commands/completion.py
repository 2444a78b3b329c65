"""``seerob completion``: the script with which a shell completes commands, options and files."""

from __future__ import annotations

import argparse
from pathlib import Path

from seerob.app.console.terminal import OUT, Exit

HELP = "print the script with which a shell completes commands, options and files"
EXAMPLE = "seerob completion bash   (its output to ~/.local/share/bash-completion/completions/seerob)"


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments."""
    from shtab import SUPPORTED_SHELLS

    sub.add_argument("shell", choices=SUPPORTED_SHELLS, help="the shell")


def run(options: argparse.Namespace) -> int:
    """Print it."""
    import shtab

    from seerob.app.cli import parser

    whole = parser()
    _complete_files(whole, shtab.FILE)
    OUT.print(shtab.complete(whole, options.shell), markup=False, end="")
    return Exit.WITHIN


def _complete_files(parser: argparse.ArgumentParser, how: object) -> None:
    """Arguments that are paths, of every command, are completed as such."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for inner in action.choices.values():
                _complete_files(inner, how)
        elif action.type is Path:
            action.complete = how  # type: ignore[attr-defined]
