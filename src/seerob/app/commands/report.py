"""``seerob report``: a recording computed again from its samples, into a report and tables."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
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
from seerob.app.console.progress import compile_loops, progress
from seerob.app.console.sinks import add_pdf, refuse_existing, sinks_of, tell_files
from seerob.app.console.terminal import (
    OUT,
    WORDS,
    add_allowed,
    add_output,
    allowed,
    cache_folder,
    exit_code,
    extreme,
    line,
    results_json,
    run_folder,
    tell_results,
)

if TYPE_CHECKING:
    from seerob.recording.result_log import Series

HELP = "compute a recording again from its samples; write report and tables"
EXAMPLE = "seerob report runs/2026-11-21T10-12-00/run.mcap"


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments."""
    sub.add_argument("recording", type=Path, help="an MCAP file that seerob wrote")
    sub.add_argument("--workstation", type=Path, help="judge by this workstation instead of the recorded one")
    add_allowed(sub)
    add_permissible(sub)
    add_output(sub, beside="recording")
    add_pdf(sub)


def run(options: argparse.Namespace) -> int:
    """Recompute, write, print what changed, and return the exit code of the verdict."""
    from seerob.recording.recording import Recording
    from seerob.recording.result_log import log_of

    recording = Recording.open(options.recording)
    if options.workstation is not None:
        station = compiled(options.workstation, allowed(options), quiet=options.json, sources=False)
    else:
        compile_loops()
        from seerob.session.station import load_recorded

        station = load_recorded(
            recording,
            cache=cache_folder(),
            allow_plugins=options.allow_plugins,
            allow_outside=options.allow_outside,
        )
    folder = run_folder(options.recording.parent, options.output)
    sinks = sinks_of(station.workstation, lossless=True, record=False, pdf=options.pdf)
    refuse_existing(sinks, folder)
    every = []
    if options.permissible:
        from seerob.session.station import recorded_sources

        samples = (sample for tick in recording.ticks() for sample in tick.samples)
        sources = recorded_sources(station.workstation.sources, samples, recording.duration)
        with work_progress(quiet=options.json) as say:
            every = permissible_found(station, options.permissible, say, sources)
    with progress(recording.duration, f"{recording.duration:.1f} s recorded") as tick:
        opened = station.open_sinks(sinks, folder, station.replay_scene(recording)) if every else []
        for found, cut in every:
            add_sections(opened, station, found, cut)
        summary = station.replay(
            recording, folder=folder, sinks=() if every else sinks, writers=opened, progress=tick
        )
    before = log_of(recording.snapshots(), recording.scene.criteria)
    changes = changes_since(before, summary.results)
    if recording.scene.workstation_hash != summary.scene.workstation_hash:
        changes.insert(0, "the workstation is not the one that was recorded")
    if options.json:
        more: dict[str, Any] = {}
        if every:
            more["permissible"] = [permissible_json(found, cut, [], folder) for found, cut in every]
        OUT.print(results_json(summary, folder=str(folder), changes=changes, **more), markup=False)
        return exit_code(summary.verdict)
    line("recording", f"{recording.scene.title}: {summary.duration:.1f} s", "bold")
    for finding in recording.findings:
        line(finding.level, finding.text, "yellow")
    tell_results(summary)
    for found, cut in every:
        tell_plan(found, cut)
    for change in changes:
        line("changed", change, "yellow")
    tell_files(sinks, folder)
    return exit_code(summary.verdict)


def changes_since(before: Mapping[str, Series], now: Mapping[str, Series]) -> list[str]:
    """What is judged differently than when it was recorded, one sentence each.

    Args:
        before: Results as they were recorded.
        now: Results as they were computed again.
    """
    changes = []
    for name, series in now.items():
        then = before.get(name)
        if then is None:
            changes.append(f"{name}: was not asked when this was recorded")
        elif (_verdict(then), extreme(then)) != (_verdict(series), extreme(series)):
            changes.append(f"{name}: was {_verdict(then)}, {extreme(then)}")
    gone = [name for name in before if name not in now]
    changes += [f"{name}: is asked no more, was {_verdict(before[name])}" for name in gone]
    return changes


def _verdict(series: Series) -> str:
    return "not judged" if series.verdict is None else WORDS[series.verdict][0]
