"""``seerob assess``: as fast as possible, from the first to the last sample."""

from __future__ import annotations

import argparse

from seerob.commands import (
    OUT,
    add_output,
    add_workstation,
    compiled,
    describe,
    exit_code,
    line,
    results_json,
    run_folder,
    tell,
    tell_results,
)
from seerob.commands.progress import announced, progress
from seerob.commands.sinks import file_of, refuse_existing, sinks_of, tell_files

HELP = "evaluate a workstation as fast as possible; write recording, report and tables"
EXAMPLE = "seerob assess my_cell"


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments."""
    add_workstation(sub)
    add_output(sub)


def run(options: argparse.Namespace) -> int:
    """Evaluate, print, and return the exit code of the verdict."""
    station = compiled(options.workstation, quiet=options.json)
    from seerob.real_time import require_recorded

    require_recorded(station.workstation)
    folder = run_folder(station.model.folder, options.output)
    sinks = sinks_of(station.workstation, lossless=True)
    refuse_existing(sinks, folder)
    scene = station.scene()
    if not options.json:
        describe(station)
        tell(scene.findings)
    with progress(station.duration, f"{station.duration:.1f} s of motion") as tick:
        writers = announced(station.open_sinks(sinks, folder, scene), list(map(file_of, sinks)), tick.say)
        summary = station.run(writers=writers, scene=scene, progress=tick)
        moving, writing = tick.moving, tick.writing
    if options.json:
        OUT.print(results_json(summary, folder=str(folder)), markup=False)
        return exit_code(summary.verdict)
    line("ran", f"{summary.duration:.1f} s of motion in {moving:.1f} s, then wrote for {writing:.1f} s")
    tell_results(summary)
    tell_files(sinks, folder)
    return exit_code(summary.verdict)
