"""``seerob report``: a recording computed again from its samples, into a report and tables."""

from __future__ import annotations

import argparse
from pathlib import Path

from seerob.commands import (
    OUT,
    add_output,
    cache_folder,
    compiled,
    exit_code,
    line,
    progress,
    results_json,
    run_folder,
    tell_results,
)
from seerob.commands.sinks import sinks_of

HELP = "compute a recording again from its samples; write report and tables"
EXAMPLE = "seerob report runs/2026-11-21T10-12-00/run.mcap"


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments."""
    sub.add_argument("recording", type=Path, help="an MCAP file that seerob wrote")
    sub.add_argument("--workstation", type=Path, help="judge by this workstation instead of the recorded one")
    add_output(sub)


def run(options: argparse.Namespace) -> int:
    """Recompute, write, print what changed, and return the exit code of the verdict."""
    from seerob.recording import Recording
    from seerob.results import log_of
    from seerob.station import load_recorded

    recording = Recording.open(options.recording)
    if options.workstation is not None:
        station = compiled(options.workstation, quiet=options.json)
    else:
        station = load_recorded(recording, cache=cache_folder())
    folder = run_folder(options.recording.parent, options.output)
    sinks = sinks_of(station.workstation, lossless=True, record=False)
    with progress(recording.duration, f"{recording.duration:.1f} s recorded") as tick:
        summary = station.replay(recording, folder=folder, sinks=sinks, progress=tick)
    if options.json:
        OUT.print(results_json(summary, folder=str(folder)), markup=False)
        return exit_code(summary.verdict)
    line("recording", f"{recording.scene.title}: {summary.duration:.1f} s", "bold")
    for finding in recording.findings:
        line(finding.level, finding.text, "yellow")
    tell_results(summary)
    before = log_of(recording.snapshots(), recording.scene.criteria)
    for name, series in summary.results.items():
        then = before.get(name)
        if then is None:
            line("new", f"{name} was not judged when this was recorded")
        elif then.verdict != series.verdict:
            line("changed", f"{name}: was {then.verdict or 'not judged'} when recorded", "yellow")
    for sink in sinks:
        line("wrote", str(folder / str(getattr(sink, "file", ""))))
    return exit_code(summary.verdict)
