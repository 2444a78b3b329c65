"""``seerob run``: live, with the page, a recording, and a report at the end."""

from __future__ import annotations

import argparse
import signal
from types import FrameType

from seerob.commands import (
    STATUS,
    add_workstation,
    compiled,
    describe,
    exit_code,
    line,
    run_folder,
    tell,
    tell_results,
)
from seerob.commands.sinks import sinks_of

HELP = "run a workstation live: sources connect, the page opens, recording starts"
EXAMPLE = "seerob run my_cell            (then open the address it prints; Ctrl-C ends the run)"


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments."""
    add_workstation(sub)
    add_page(sub)
    sub.add_argument(
        "-o", "--output", help="folder to write to (default: runs/<time> beside the workstation)"
    )
    sub.add_argument("--no-record", action="store_true", help="no recording and no report")
    sub.add_argument("--seconds", type=float, help="end the run after this time")
    sub.add_argument("--replay", help="show this recording instead (the same as seerob replay)")


def add_page(sub: argparse.ArgumentParser) -> None:
    """Arguments of commands that serve the page."""
    sub.add_argument("--host", default="127.0.0.1", help="address to listen on (default: this machine only)")
    sub.add_argument("--port", type=int, default=8080, help="port of the page; 0 is any free one")
    sub.add_argument("--token", help="what visitors must know; needed when not only this machine may visit")


class Stopped:
    """Whether the user asked to stop. A second Ctrl-C does not wait."""

    def __init__(self) -> None:
        self._asked = False
        signal.signal(signal.SIGINT, self._ask)
        signal.signal(signal.SIGTERM, self._ask)

    def _ask(self, number: int, frame: FrameType | None) -> None:
        if self._asked:
            raise KeyboardInterrupt
        self._asked = True

    def __call__(self) -> bool:
        """Whether to stop."""
        return self._asked


def run(options: argparse.Namespace) -> int:
    """Run until Ctrl-C, then write the report."""
    from pathlib import Path

    if options.replay:
        from seerob.commands import replay

        return replay.show(Path(options.replay), options)
    from seerob.server.live import LiveView

    stopped = Stopped()
    station = compiled(options.workstation)
    scene = station.scene()
    describe(station)
    tell(scene.findings)
    folder = run_folder(station.model.folder, Path(options.output) if options.output else None)
    sinks = [] if options.no_record else sinks_of(station.workstation, lossless=False)
    view = LiveView(
        scene=scene, meshes=station.model.meshes, host=options.host, port=options.port, token=options.token
    )
    if view.server.notice:
        line("note", view.server.notice)
    line("page", f"{view.url}  (Ctrl-C ends the run)", "bold")
    try:
        writers = station.open_sinks(sinks, folder, scene) if sinks else []
    except BaseException:
        view.close()
        raise
    now = [0.0]

    def over() -> bool:
        return stopped() or (options.seconds is not None and now[0] >= options.seconds)

    def note(t: float) -> None:
        now[0] = t

    summary = station.run(writers=[view, *writers], live=True, scene=scene, stop=over, progress=note)
    line("ran", f"{summary.duration:.1f} s" + _slipped(summary.slipped))
    tell_results(summary)
    for sink in sinks:
        line("wrote", str(folder / str(getattr(sink, "file", ""))))
    STATUS.print("", end="")
    return exit_code(summary.verdict)


def _slipped(seconds: float) -> str:
    return (
        f", {seconds:.1f} s behind real time: this machine is too slow for the workstation" if seconds else ""
    )
