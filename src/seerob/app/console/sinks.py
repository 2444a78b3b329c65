"""The sinks of a run: those of the workstation file, and the usual ones where it names none of a kind."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from msgspec.structs import replace

from seerob.app.console.progress import Announced
from seerob.app.console.terminal import line
from seerob.core.errors import InputError
from seerob.outputs.sink import Sink

if TYPE_CHECKING:
    from seerob.core.snapshot import Scene
    from seerob.outputs.sink import Writer
    from seerob.session.station import Station
    from seerob.workstation.workstation import Workstation


def add_pdf(sub: argparse.ArgumentParser) -> None:
    """The option of commands that write a report."""
    text = "also print the report to PDF, by a Chromium, Chrome or Edge that is installed, or WeasyPrint"
    sub.add_argument("--pdf", action="store_true", help=text)


def sinks_of(
    workstation: Workstation, *, lossless: bool, record: bool = True, pdf: bool = False
) -> list[Sink]:
    """Sinks for a run.

    Args:
        workstation: Whose ``[[sinks]]`` come first.
        lossless: Whether the recorder may hold the run up: only when the run is not live.
        record: Whether to record at all; not when a recording is computed again.
        pdf: Whether reports are printed, too.
    """
    from seerob.outputs.sinks.dossier import Dossier
    from seerob.outputs.sinks.excel import Excel
    from seerob.outputs.sinks.recorder import Recorder

    usual: list[Sink] = [Recorder(), Dossier(), Excel()]
    named = list(workstation.sinks)
    chosen = named + [sink for sink in usual if not any(type(sink) is type(other) for other in named)]
    if not record:
        chosen = [sink for sink in chosen if not isinstance(sink, Recorder)]
    # The recorder first: it alone touches the disk when it is opened, and may be refused.
    chosen.sort(key=lambda sink: not isinstance(sink, Recorder))
    chosen = [replace(s, pdf=s.pdf or pdf) if isinstance(s, Dossier) else s for s in chosen]
    return [replace(s, lossless=lossless) if isinstance(s, Recorder) else s for s in chosen]


@contextmanager
def opened_sinks(station: Station, sinks: list[Sink], folder: Path, scene: Scene) -> Iterator[list[Writer]]:
    """Sinks that are open for a run, which closes them; an interrupt may come before it takes them over.

    Raises:
        InputError: As `Station.open_sinks` does.
    """
    opened = station.open_sinks(sinks, folder, scene)
    try:
        yield opened
    except KeyboardInterrupt as error:
        for writer in opened:
            writer.__exit__(KeyboardInterrupt, error, None)
        raise


def file_of(sink: Sink) -> str:
    """Name of the file that a sink writes in the run's folder; empty when it writes none."""
    return str(getattr(sink, "file", ""))


def files_of(sink: Sink) -> list[str]:
    """Names of all files that a sink writes in the run's folder."""
    printed = str(getattr(sink, "printed", "")) if getattr(sink, "pdf", False) else ""
    return [name for name in (file_of(sink), printed) if name]


def refuse_existing(sinks: list[Sink], folder: Path) -> None:
    """Refuse a folder that holds files of another run.

    Raises:
        InputError: Naming the first of them.
    """
    for sink in sinks:
        for name in files_of(sink):
            if (folder / name).exists():
                raise InputError.at(folder / name, "", "exists already", "give another folder with -o")


def tell_files(sinks: list[Sink], folder: Path, writers: Sequence[Announced] = ()) -> bool:
    """One line per file that was written, or could not be; whether all of them are there."""
    failed = {writer.file: writer for writer in writers if writer.failure is not None}
    missing = []
    for sink in sinks:
        names = files_of(sink)
        for name in names:
            # Of several the first may be there, whole, where the next could not be made of it.
            if file_of(sink) not in failed or (len(names) > 1 and (folder / name).exists()):
                line("wrote", str(folder / name))
            else:
                missing.append((name, failed[file_of(sink)]))
    for name, writer in missing:
        line("not written", f"{folder / name}: {writer.failure}", "bold red")
    for writer in failed.values():
        if writer.elsewhere is not None:
            line("wrote", f"{writer.elsewhere}  (instead)", "yellow")
    return not failed
