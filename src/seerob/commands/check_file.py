"""``seerob check-file``: every mistake of a workstation file at once, and what it was read as."""

from __future__ import annotations

import argparse

from seerob.commands import Exit, add_workstation, compiled, describe, line

HELP = "explain every mistake of a workstation file at once"
EXAMPLE = "seerob check-file my_cell"


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments."""
    add_workstation(sub)


def run(options: argparse.Namespace) -> int:
    """Read, compile, bind and open everything; run nothing."""
    station = compiled(options.workstation)
    describe(station)
    for finding in station.scene().findings:
        line(finding.level, f"{finding.subject}: {finding.text}")
    line(
        "fine",
        f"{len(station.model.bodies)} bodies, {station.model.mj.nv} degrees of freedom, "
        f"{station.duration:.2f} s of motion",
    )
    return Exit.WITHIN
