"""``seerob emulate modbus``: a robot's controller with its joints in registers, or a PLC with a belt."""

from __future__ import annotations

import argparse
from pathlib import Path

from seerob.app.console.terminal import port
from seerob.app.emulating import Emulated
from seerob.app.emulating._motions import add_motion, motion_of, target_of

HELP = "a controller that has a robot's joints in Modbus registers, with a belt beside them"
HOME = (0.0, 0.3, 1.2, 0.0, 1.2, 0.0)
"""What it swings about when no motion is given [rad]."""
BELT = 128
"""Registers of the belt: speed, bits, position."""


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments."""
    sub.add_argument("--robot", default="doosan_m1013", help="robot of the library (default: doosan_m1013)")
    add_motion(sub)
    sub.add_argument("--map", default="doosan", help="register map, or a file of one (default: doosan)")
    sub.add_argument("--port", type=port, default=5020, help="port; 0 is any free one (default: 5020)")


def emulated(options: argparse.Namespace) -> Emulated:
    """The controller.

    Raises:
        InputError: No such robot or map, or a motion that it cannot do.
    """
    from seerob.app.emulators import plc_cell
    from seerob.app.emulators.modbus import ModbusServer
    from seerob.app.emulators.modbus_robot import program
    from seerob.protocols.plc.modbus import Place, Table, Type, Words
    from seerob.protocols.plc.modbus_map import load

    found = load(options.map, Path())
    target = target_of(options.robot, joints=found.joints, whose=f"the map {options.map}")
    home = (*HOME, *(0.0,) * found.joints)[: found.joints]
    motion, what = motion_of(options, target, home)
    states: dict[str, str | bool | float] = {"robot_state": "moving", "servo_on": True}
    known = {s.name for s in found.signals}
    played = {
        **program(found, motion, {name: state for name, state in states.items() if name in known}),
        Place(table=Table.HOLDING, at=BELT, type=Type.I16): plc_cell.speed,
        Place(table=Table.HOLDING, at=BELT + 1, type=Type.BIT, bit=0): plc_cell.running,
        Place(table=Table.HOLDING, at=BELT + 1, type=Type.BIT, bit=1): plc_cell.clear,
        Place(table=Table.HOLDING, at=BELT + 2, type=Type.F32, words=Words.HIGH_FIRST): plc_cell.position,
    }
    server = ModbusServer(played, host=options.host, port=options.port, refresh=found.refresh)
    belt = f"a belt in the holding registers {BELT} (i16, mm/s) to {BELT + 3}"
    chosen = "" if options.map == "doosan" else f" --set map={options.map}"
    hear = (
        f"seerob probe modbus_robot {{host}} --port {{port}}{chosen}",
        "seerob probe modbus {host} --port {port}",
    )
    return Emulated(server, f"{target.name}, {what}; {belt}", f"{options.host}:{options.port}", hear)
