"""``seerob edit``: the workstation in the page, to place things, add criteria and save the file."""

from __future__ import annotations

import argparse
import json
import time
from functools import partial
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

if TYPE_CHECKING:
    from pathlib import Path

    from seerob.app.server.desk import Desk
    from seerob.app.server.serving import Server
    from seerob.core.snapshot import Result, Scene
    from seerob.session.station import Station
    from seerob.workstation.allowed import Allowed

HELP = "open a workstation in the page to edit its file; nothing is run, and connected to"
EXAMPLE = "seerob edit my_cell           (then open the address it prints; Ctrl-C ends)"


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
    allow = allowed(options)
    station = compiled(options.workstation, allow)
    describe(station)
    tell(station.scene().findings, verbose=options.verbose)
    server, desk = serving(station, options.workstation, allow, options.host, options.port, visiting(options))
    stopped = Stopped()
    with server:
        if server.notice:
            line("note", server.notice)
        tell_pages(server, "Ctrl-C ends")
        end = time.monotonic() + (options.seconds if options.seconds is not None else float("inf"))
        while not stopped() and time.monotonic() < end:
            time.sleep(0.1)
    if desk.unsaved:
        line("warning", "what was edited and not saved is lost", "yellow")
    return Exit.WITHIN


def serving(
    station: Station, path: Path, allow: Allowed, host: str, port: int, visits: Visiting
) -> tuple[Server, Desk]:
    """A server whose pages edit a workstation, and the draft that they edit.

    Args:
        station: As its file is now.
        path: The file, or the folder of it.
        allow: What the file may do, edited or not.
        host: Address to listen on.
        port: Port, 0 for any.
        visits: Who may visit.
    """
    from seerob.app.commands.schema import schema
    from seerob.app.server.desk import Checked, Desk, Still
    from seerob.app.server.serving import Server
    from seerob.workstation.workstation import locate

    scene = station.scene()
    still = Still(station.first(scene))

    def check(raw: bytes) -> Checked:
        edited = compiled(path, allow, quiet=True, raw=raw)
        scene = edited.scene()
        first = edited.first(scene)

        def show() -> None:
            server.begin(scene, edited.model.meshes)
            still.put(first)

        return Checked(show, partial(_distance, edited, scene))

    begun = Checked(lambda: None, partial(_distance, station, scene))
    desk = Desk(locate(path), begun, check, json.dumps(schema()).encode())
    meshes = station.model.meshes
    server = Server(scene=scene, meshes=meshes, feed=still, desk=desk, host=host, port=port, **visits)
    return server, desk


def _distance(station: Station, scene: Scene, between: tuple[str, str]) -> Result:
    """What a criterion of the least distance says of two things where everybody begins.

    Raises:
        SeerobError: A name leads nowhere, or they share a body.
    """
    from seerob.criteria.safety.minimum_distance import MinimumDistance

    name = f"measured {between[0]} – {between[1]}"
    asked = station.with_criteria(MinimumDistance(name=name, between=between))
    return next(found for found in asked.first(scene).results if found.name == name)
