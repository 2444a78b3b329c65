"""``seerob share``: a recording for others, without paths, names, hosts and what nobody asked for."""

from __future__ import annotations

import argparse
from pathlib import Path

from seerob.app.console.terminal import Exit, cache_folder, line
from seerob.core.errors import InputError

HELP = "write a recording for others: without paths, names of people and hosts, and columns nobody asked for"
EXAMPLE = "seerob share runs/2026-11-21T10-12-00/run.mcap"


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments."""
    sub.add_argument("recording", type=Path, help="an MCAP file that seerob wrote")
    text = "file to write (default: beside it, <name>.shared.mcap); must not exist"
    sub.add_argument("output", type=Path, nargs="?", help=text)
    text = "import kinds of the file by their dotted names, which runs their code"
    sub.add_argument("--allow-plugins", action="store_true", help=text)


def run(options: argparse.Namespace) -> int:
    """Compute it again without what others need not have, and say what that was.

    Raises:
        InputError: It is no whole recording, or would be judged otherwise.
    """
    from seerob.app.console.progress import compile_loops
    from seerob.recording.recording import Recording

    to = options.output or options.recording.with_suffix(".shared.mcap")
    if to.exists():
        raise InputError.at(to, "", "exists already", "give another file")
    compile_loops()
    from seerob.session.sharing import share

    recording = Recording.open(options.recording)
    made = share(recording, to, cache=cache_folder(), allow_plugins=options.allow_plugins)
    for what in made.dropped:
        line("dropped", what)
    for name in made.kept:
        line("kept", f"{name}: what is judged rests on it; look through it before you share it", "yellow")
    line("wrote", f"{to}: judged as the recording was; measures and motions of people are in it")
    return Exit.WITHIN
