"""``seerob repair``: what is whole of a recording gets the end and the index that readers need."""

from __future__ import annotations

import argparse
from pathlib import Path

from seerob.app.console.terminal import Exit, line
from seerob.core.errors import InputError

HELP = "write a recording that was cut off anew, with the end and the index that other readers need"
EXAMPLE = "seerob repair runs/2026-11-21T10-12-00/run.mcap"


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments."""
    sub.add_argument("recording", type=Path, help="an MCAP file that seerob wrote")
    text = "file to write (default: beside it, <name>.repaired.mcap); must not exist"
    sub.add_argument("-o", "--output", type=Path, metavar="FILE", help=text)


def run(options: argparse.Namespace) -> int:
    """Copy what is whole, and end it; 2 because the rest of the run is not known.

    Raises:
        InputError: It is no recording, needs no repair, or the copy cannot be written.
    """
    from seerob.core.files.whole_file import whole_file
    from seerob.outputs.mcap import mend
    from seerob.recording.recording import Recording

    recording = Recording.open(options.recording)
    recording.check()
    if recording.complete:
        raise InputError.at(options.recording, "", "is whole", "read it as it is")
    to = options.output or options.recording.with_suffix(".repaired.mcap")
    if to.exists():
        raise InputError.at(to, "", "exists already", "give another file with -o")
    with whole_file(to) as hidden:
        messages = mend(options.recording, hidden)
        end = Recording.open(hidden).end
    line("wrote", f"{to}: {messages} messages, to {end:.2f} s; what came after that is lost")
    return Exit.UNDECIDED
