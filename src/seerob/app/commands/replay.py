"""``seerob replay``: a recording in the page, with a timeline to seek in."""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

from seerob.app.console.interruption import Stopped
from seerob.app.console.terminal import WORDS, Exit, cache_folder, exit_code, line, seconds
from seerob.app.console.visiting import add_page, tell_pages, visiting
from seerob.core.errors import InputError
from seerob.core.snapshot import History, Verdict

if TYPE_CHECKING:
    from seerob.app.server.player import Player
    from seerob.model.model import Model
    from seerob.recording.recording import Recording

HELP = "show a recording in the page: play, pause, seek; the exit code is the verdict that was recorded"
EXAMPLE = "seerob replay runs/2026-11-21T10-12-00/run.mcap"


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments."""
    sub.add_argument("recording", type=Path, help="an MCAP file that seerob wrote")
    add_page(sub)
    text = (
        "show another recording's figures, limits and verdicts on the same axis, by names of criteria; "
        "run time 0 is that of each"
    )
    sub.add_argument("--beside", type=Path, metavar="RECORDING", help=text)
    sub.add_argument("--seconds", type=seconds, help="end after this time, once all was read")


def run(options: argparse.Namespace) -> int:
    """Serve the recording until Ctrl-C, and return the exit code of the verdict that was recorded."""
    return show(options.recording, options)


def show(path: Path, options: argparse.Namespace) -> int:
    """Serve a recording until Ctrl-C, and return the exit code of the verdict that was recorded.

    One of which something is missing, or that was not read through, is not within.
    """
    from seerob.app.server.player import Player
    from seerob.app.server.serving import Server
    from seerob.recording.recording import Recording
    from seerob.session.measuring import Ruler

    recording = Recording.open(path)
    line("recording", f"{recording.scene.title}: {recording.duration:.1f} s", "bold")
    for finding in recording.findings:
        line(finding.level, finding.text, "yellow")
    ruler = Ruler(lambda: _model(recording))
    player = Player(
        recording, beside=_beside(getattr(options, "beside", None), recording), others=_others(path)
    )
    server = Server(
        scene=recording.scene,
        meshes=recording.meshes,
        feed=player,
        ruler=lambda: ruler,
        host=options.host,
        port=options.port,
        **visiting(options),
    )
    stopped = Stopped()
    with server:
        if server.notice:
            line("note", server.notice)
        tell_pages(server, "Ctrl-C ends", options)
        end = time.monotonic() + (options.seconds if options.seconds is not None else float("inf"))
        while not stopped() and (time.monotonic() < end or player.reading):
            time.sleep(0.1)
    return _verdict(recording, player)


def _model(recording: Recording) -> Model:
    """The workstation that a recording was made with, from the files in it: what one measures in.

    Raises:
        InputError: It cannot be compiled from them, or is another one here than it was then.
    """
    from seerob.session.station import load_recorded

    model = load_recorded(recording, cache=cache_folder()).model
    if [node.name for node in recording.scene.nodes] != [body.name for body in model.bodies]:
        what = f"was recorded by seerob {recording.scene.version}, and has other bodies here"
        raise InputError.at(recording.path, "", what, "measure with the version that recorded it")
    return model


def _beside(path: Path | None, recording: Recording) -> History:
    """What another recording holds of the criteria of this one.

    Raises:
        InputError: It is no recording, or has no criterion of the same name, kind and unit.
    """
    if path is None:
        return History(traces=())
    from seerob.app.server.player import beside
    from seerob.recording.recording import Recording
    from seerob.recording.result_log import log_of

    other = Recording.open(path)
    log = log_of(other.snapshots(), other.scene.criteria)
    found = beside(recording.scene, other.scene, log, _title(path))
    same, all_ = len(found.beside), len(recording.scene.criteria)
    line("beside", f"{other.scene.title}: {other.duration:.1f} s, {same} of {all_} criteria")
    return found


MOST_OTHERS = 100
"""Runs that a page is offered."""


def _others(path: Path) -> dict[str, Callable[[], Recording]]:
    """Other recordings in the folder ``runs`` that one is in, newest first; none of another place."""
    from seerob.recording.recording import Recording

    own = path.resolve()
    runs = own.parent.parent
    if runs.name != "runs":
        return {}
    there = ((other, other.resolve()) for other in runs.glob("*/*.mcap"))
    found = sorted((a for a, b in there if b != own and b.parent.parent == runs), reverse=True)
    return {_title(other): partial(Recording.open, other) for other in found[:MOST_OTHERS]}


def _title(path: Path) -> str:
    path = path.resolve()
    return f"{path.parent.name}/{path.name}"


def _verdict(recording: Recording, player: Player) -> Exit:
    """Say what the recorded run came to, and the exit code of that."""
    found = player.so_far()
    verdict, why = found.verdict, ""
    if not found.whole:
        why = "not all of the recording was read"
    elif findings := recording.check():
        why = findings[0].text
    elif recording.scene.version != version("seerob"):
        why = f"by seerob {recording.scene.version}, and this is {version('seerob')}"
    if why and verdict is not Verdict.EXCEEDED:
        verdict = Verdict.UNDECIDED
    word, style = WORDS[verdict]
    rest = f" ({why})" if why else "; seerob report computes it again"
    line(word or "no verdict", f"as it was recorded{rest}", style)
    return exit_code(verdict)
