"""``seerob emulate web``: a machine that tells a cell's variables as a JSON document."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from seerob.app.console.terminal import port
from seerob.app.emulating import Emulated

if TYPE_CHECKING:
    from collections.abc import Mapping

HELP = (
    "a web server with a JSON document: a belt, a light curtain and a door (/state, and /live by WebSocket)"
)


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments."""
    sub.add_argument("--port", type=port, default=8090, help="port; 0 is any free one (default: 8090)")


def emulated(options: argparse.Namespace) -> Emulated:
    """The server."""
    from seerob.app.emulators.web import LIVE, STATE, WebServer

    server = WebServer(_cell, host=options.host, port=options.port)
    what = f"a belt, a light curtain and a door at {STATE}, and at {LIVE} by WebSocket"
    hear = (f"seerob probe web http://{{at}}{STATE}", f"seerob probe web ws://{{at}}{LIVE}")
    return Emulated(server, what, f"{options.host}:{options.port}", hear)


def _cell(t: float) -> Mapping[str, Any]:
    from seerob.app.emulators import plc_cell

    return {
        "belt": {
            "running": plc_cell.running(t),
            "speed": plc_cell.speed(t),
            "position": plc_cell.position(t),
        },
        "curtain": {"clear": plc_cell.clear(t)},
        "door": {"open": plc_cell.door_open(t)},
    }
