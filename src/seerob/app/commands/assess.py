"""``seerob assess``: as fast as possible, from the first to the last sample."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from seerob.app.commands.permissible_result import (
    add_permissible,
    add_sections,
    permissible_found,
    permissible_json,
    tell_plan,
    work_progress,
)
from seerob.app.console.loading import compiled
from seerob.app.console.progress import announced, progress
from seerob.app.console.sinks import add_pdf, file_of, opened_sinks, refuse_existing, sinks_of, tell_files
from seerob.app.console.terminal import (
    OUT,
    Exit,
    add_output,
    add_verbose,
    add_workstation,
    allowed,
    describe,
    exit_code,
    line,
    results_json,
    run_folder,
    tell,
    tell_results,
)
from seerob.core.errors import InputError

if TYPE_CHECKING:
    from seerob.outputs.sink import Writer
    from seerob.session.permissible.between_samples import Bound
    from seerob.session.station import Station

HELP = "evaluate a workstation as fast as possible; write recording, report and tables"
EXAMPLE = "seerob assess my_cell"


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments."""
    add_workstation(sub)
    add_output(sub)
    add_verbose(sub)
    add_pdf(sub)
    text = "also least distances and largest speeds of the whole motion as bounds, in a section of the report"
    sub.add_argument("--between-samples", action="store_true", help=text)
    add_permissible(sub)


def run(options: argparse.Namespace) -> int:
    """Evaluate, print, and return the exit code of the verdict."""
    station = compiled(options.workstation, allowed(options), quiet=options.json)
    from seerob.devices.live.receivers import require_recorded

    require_recorded(station.workstation)
    folder = run_folder(station.model.folder, options.output)
    sinks = sinks_of(station.workstation, lossless=True, pdf=options.pdf)
    refuse_existing(sinks, folder)
    scene = station.scene()
    if not options.json:
        describe(station)
        tell(scene.findings, verbose=options.verbose)
    bounds = _bounds(station) if options.between_samples else []
    every = []
    if options.permissible:
        with work_progress(quiet=options.json) as say:
            every = permissible_found(station, options.permissible, say)
    with (
        progress(station.duration, f"{station.duration:.1f} s of motion") as tick,
        opened_sinks(station, sinks, folder, scene) as opened,
    ):
        for found, cut in every:
            add_sections(opened, station, found, cut)
        if bounds:
            add_section(opened, bounds)
        writers = announced(opened, list(map(file_of, sinks)), tick.say, outlived=True)
        summary = station.run(writers=writers, scene=scene, progress=tick)
        moving, writing = tick.moving, tick.writing
    if options.json:
        more: dict[str, Any] = {}
        if options.between_samples:
            more["bounds"] = [bound.figures() for bound in bounds]
        if options.permissible:
            more["permissible"] = [permissible_json(found, cut, [], folder) for found, cut in every]
        failed = {str(folder / w.file): str(w.failure) for w in writers if w.failure is not None}
        if failed:
            more["not_written"] = failed
        OUT.print(results_json(summary, folder=str(folder), **more), markup=False)
        return Exit.ERROR if failed else exit_code(summary.verdict)
    line("ran", f"{summary.duration:.1f} s of motion in {moving:.1f} s, then wrote for {writing:.1f} s")
    tell_results(summary)
    for found, cut in every:
        tell_plan(found, cut)
    for bound in bounds:
        line("bound", bound.sentence())
    return exit_code(summary.verdict) if tell_files(sinks, folder, writers) else Exit.ERROR


def _bounds(station: Station) -> list[Bound]:
    """Bounds between samples.

    Raises:
        InputError: Somebody moves by anything but joint positions, or nobody moves.
    """
    from seerob.session.permissible.between_samples import MOST, motions_of, wanted_bounds

    motions = motions_of(station.sources)
    if not motions:
        what = "no source of joint positions" if motions is None or not station.sources else "nobody moves"
        remedy = "give joint trajectories: between poses of a tool the motion is not known"
        raise InputError.at("seerob assess", "--between-samples", what, remedy)
    return wanted_bounds(station.model, motions, most=MOST)


def add_section(writers: Sequence[Writer], bounds: Sequence[Bound]) -> None:
    """Add the bounds to the report, if there is one."""
    from seerob.outputs.sinks.dossier import DossierWriter
    from seerob.session.permissible.summary import bounds_section

    for writer in writers:
        if isinstance(writer, DossierWriter):
            writer.sections.append(bounds_section(bounds))
