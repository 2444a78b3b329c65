"""``seerob replay``: a recording in the page, with a timeline to seek in."""

from __future__ import annotations

import argparse
import time
from pathlib import Path

from seerob.commands import Exit, line, seconds
from seerob.commands.interruption import Stopped
from seerob.commands.run import add_page

HELP = "show a recording in the page: play, pause, seek"
EXAMPLE = "seerob replay runs/2026-11-21T10-12-00/run.mcap"


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments."""
    sub.add_argument("recording", type=Path, help="an MCAP file that seerob wrote")
    add_page(sub)
    sub.add_argument("--seconds", type=seconds, help="end after this time")


def run(options: argparse.Namespace) -> int:
    """Serve the recording until Ctrl-C."""
    return show(options.recording, options)


def show(path: Path, options: argparse.Namespace) -> int:
    """Serve a recording until Ctrl-C."""
    from seerob.recordings.recording import Recording
    from seerob.server.player import Player
    from seerob.server.serving import Server

    recording = Recording.open(path)
    line("recording", f"{recording.scene.title}: {recording.duration:.1f} s", "bold")
    for finding in recording.findings:
        line(finding.level, finding.text, "yellow")
    server = Server(
        scene=recording.scene,
        meshes=recording.meshes,
        feed=Player(recording),
        host=options.host,
        port=options.port,
        token=options.token,
    )
    stopped = Stopped()
    with server:
        if server.notice:
            line("note", server.notice)
        line("page", f"{server.url}  (Ctrl-C ends)", "bold")
        end = time.monotonic() + (options.seconds if options.seconds is not None else float("inf"))
        while not stopped() and time.monotonic() < end:
            time.sleep(0.1)
    return Exit.WITHIN
