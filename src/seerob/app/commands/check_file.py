"""``seerob check-file``: every mistake of a workstation file at once, and what it was read as."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from seerob.app.console.loading import compiled
from seerob.app.console.terminal import Exit, add_workstation, allowed, describe, line, tell

if TYPE_CHECKING:
    from seerob.session.station import Station

HELP = "explain every mistake of a workstation file at once"
EXAMPLE = "seerob check-file my_cell"


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments."""
    add_workstation(sub)


def _masses(station: Station) -> None:
    """The mass table of every robot; frames, which weigh nothing, in one line."""
    from seerob.outputs.report.evidence import cells, total, weighed

    for mechanism in weighed(station.scene()):
        line("mass", f"{mechanism.name}: {total(mechanism.masses)}", "bold")
        frames = [row.name for row in mechanism.masses if row.mass == 0]
        for row in mechanism.masses:
            if row.mass != 0:
                name, mass, origin, _, merged, why = cells(row)
                fixed = f", moves with {merged}" if row.merged else ""
                line("", f"{name}: {mass}, {origin}{fixed} ({why})", "yellow" if row.mass is None else "")
        if frames:
            line("", f"weigh nothing: {', '.join(frames)}", "dim")


def run(options: argparse.Namespace) -> int:
    """Read, compile, bind and open everything; run nothing, connect to nothing."""
    station = compiled(options.workstation, allowed(options))
    describe(station)
    tell(station.scene().findings, verbose=True)
    for name, contact in station.contacts().items():
        line("would", f"{name}: {contact}; checking connects to nothing, seerob probe and run do")
    _masses(station)
    line(
        "fine",
        f"{len(station.model.bodies)} bodies, {station.model.mj.nv} degrees of freedom, "
        f"{station.duration:.2f} s of motion",
    )
    return Exit.WITHIN
