"""``seerob edit``: the workstation in the page, to place things, add criteria, try them and save the file."""

from __future__ import annotations

import argparse
import json
import logging
import time
from typing import TYPE_CHECKING

from seerob.app.console.interruption import Stopped
from seerob.app.console.loading import compiled
from seerob.app.console.terminal import (
    Exit,
    add_verbose,
    add_workstation,
    allowed,
    describe,
    line,
    seconds,
    tell,
)
from seerob.app.console.visiting import Visiting, add_page, tell_pages, visiting
from seerob.core.errors import SeerobError

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from seerob.app.emulation.ports import Move
    from seerob.app.server.desk import Desk
    from seerob.app.server.live import Shown
    from seerob.app.server.serving import Server
    from seerob.app.server.trial import Job, Trial
    from seerob.session.station import Station
    from seerob.workstation.allowed import Allowed

_log = logging.getLogger(__name__)

HELP = "open a workstation in the page to edit its file, and to try what it would be"
EXAMPLE = "seerob edit my_cell           (then open the address it prints; Ctrl-C ends)"
ELSEWHERE = "a live source is connected to by: seerob run --edit"


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments."""
    add_workstation(sub)
    add_page(sub)
    add_verbose(sub)
    sub.add_argument("--seconds", type=seconds, help="end after this time")


def run(options: argparse.Namespace) -> int:
    """Serve the page until Ctrl-C; what was not saved by then is lost, which is said.

    Raises:
        InputError: The file has mistakes as it is.
    """
    station = compiled(options.workstation, allowed(options))
    describe(station)
    tell(station.scene().findings, verbose=options.verbose)
    edited(station, options, running=False)
    return Exit.WITHIN


def edited(
    station: Station, options: argparse.Namespace, *, running: bool, moves: Sequence[Move] = ()
) -> None:
    """Let pages edit the file, and run the draft while they want that; ends as `run` does.

    Args:
        station: As its file is now.
        options: Of the command.
        running: Whether the draft is tried from the start, and may connect to the live sources that the file
            has now; otherwise one that connects to nothing is tried when a page asks.
        moves: Of what emulates its devices, to other ports than the file says.
    """
    server, desk, trial = serving(
        station, options.workstation, allowed(options), options.host, options.port, visiting(options),
        running=running, moves=moves,
    )  # fmt: skip
    stopped = Stopped()
    with server:
        if server.notice:
            line("note", server.notice)
        tell_pages(server, "Ctrl-C ends", options)
        end = time.monotonic() + (options.seconds if options.seconds is not None else float("inf"))

        def over() -> bool:
            return stopped() or time.monotonic() > end

        keep_trying(trial, server, over)
    if desk.unsaved:
        line("warning", "what was edited and not saved is lost", "yellow")


def keep_trying(trial: Trial, server: Server, over: Callable[[], bool]) -> None:
    """Run drafts as pages ask for them, in this thread, until it is over."""
    from seerob.app.server.live import Shown

    while not over():
        job = trial.take(0.1)
        if job is not None:
            _try(job, trial, Shown(job.live, server.offers), over)


def _try(job: Job, trial: Trial, writer: Shown, over: Callable[[], bool]) -> None:
    """Run a draft until there is another, or nobody wants it any more; a failure is told to the pages."""
    begun = job.begun
    try:
        begun.station.run(
            writers=[writer], live=True, scene=begun.scene, stop=lambda: over() or trial.superseded(job)
        )
    except SeerobError as error:
        trial.failed(job, str(error))
    except Exception as error:  # of a plug-in, perhaps; the draft is as it was
        _log.exception("a trial failed")
        trial.failed(job, f"a fault of the program or of a plug-in: {error!r}")


def serving(
    station: Station,
    path: Path,
    allow: Allowed,
    host: str,
    port: int,
    visits: Visiting,
    *,
    running: bool = False,
    moves: Sequence[Move] = (),
) -> tuple[Server, Desk, Trial]:
    """A server whose pages edit a workstation, the draft that they edit, and the trial of it.

    Args:
        station: As its file is now.
        path: The file, or the folder of it.
        allow: What the file may do, edited or not.
        host: Address to listen on.
        port: Port, 0 for any.
        visits: Who may visit.
        running: See `edited`.
        moves: See `edited`.
    """
    from seerob.app.commands.schema import schema
    from seerob.app.emulation.ports import at_ports
    from seerob.app.importing import dropped
    from seerob.app.server.cad_route import Bringing
    from seerob.app.server.desk import Desk
    from seerob.app.server.serving import Server
    from seerob.app.server.trial import Begun, Trial
    from seerob.workstation.workstation import locate

    live = _live_sources(station)

    def refusal(edited: Station) -> str:
        if not running and _live_sources(edited):
            return ELSEWHERE
        if _live_sources(edited) - live:
            return (
                "its live sources are others than when the command began, and no page decides whom "
                "this machine connects to: save, and start seerob run --edit again"
            )
        return ""

    scene = station.scene()
    trial = Trial(Begun(station, scene, station.first(scene)), running=running, refusal=refusal)

    def check(raw: bytes) -> Callable[[], None]:
        edited = at_ports(compiled(path, allow, quiet=True, raw=raw), moves)
        scene = edited.scene()
        begun = Begun(edited, scene, edited.first(scene))
        return lambda: trial.put(begun)

    desk = Desk(locate(path), check, json.dumps(schema()).encode(), trial)
    server = Server(
        scene=scene,
        meshes=station.model.meshes,
        feed=trial,
        desk=desk,
        bringing=Bringing(desk, dropped.read_apart, dropped.changes, dropped.former),
        ruler=lambda: trial.ruler,
        host=host,
        port=port,
        **visits,
    )
    trial.connect(server.begin, desk.tell, server.call)
    return server, desk, trial


def _live_sources(station: Station) -> set[bytes]:
    """The live sources of a workstation, each with all that its table says."""
    from seerob.devices.live.listening import LiveSource

    live = (source for source in station.workstation.sources if isinstance(source, LiveSource))
    return {f"{type(source).__module__} {source!r}".encode() for source in live}
