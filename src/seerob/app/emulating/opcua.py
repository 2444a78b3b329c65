"""``seerob emulate opcua``: a PLC with a cell, and a robot as OPC 40010 has it."""

from __future__ import annotations

import argparse

from seerob.app.console.terminal import port
from seerob.app.emulating import Emulated

HELP = "an OPC UA server: a PLC with a belt, a light curtain and a door, and a robot by OPC 40010"
HOME = (0.0, -1.2, 1.4, -1.5, -1.5, 0.0)
"""What the robot swings about [rad]."""
OUTPUT = "Twin/warning"
"""A bool that a trigger may write."""


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments."""
    sub.add_argument("--port", type=port, default=4840, help="port; 0 is any free one (default: 4840)")


def emulated(options: argparse.Namespace) -> Emulated:
    """The server."""
    from seerob.app.emulators import plc_cell
    from seerob.app.emulators.motions import swing
    from seerob.app.emulators.opcua import Emulated as Variable
    from seerob.app.emulators.opcua import OpcuaServer

    variables = {
        "Belt/running": Variable(plc_cell.running),
        "Belt/speed": Variable(plc_cell.speed, "mm/s"),
        "Belt/position": Variable(plc_cell.position, "mm"),
        "Curtain/clear": Variable(plc_cell.clear),
        "Door/open": Variable(plc_cell.door_open),
    }
    server = OpcuaServer(
        variables, {"Robot": swing(HOME)}, host=options.host, port=options.port, outputs=(OUTPUT,)
    )
    what = f"variables {', '.join(variables)}; one robot; {OUTPUT} may be written"
    hear = ("seerob probe opcua_robot opc.tcp://{at}", "seerob probe opcua opc.tcp://{at}")
    return Emulated(server, what, f"{options.host}:{options.port}", hear)
