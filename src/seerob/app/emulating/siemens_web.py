"""``seerob emulate siemens_web``: a PLC with a web server, and a cell with a belt."""

from __future__ import annotations

import argparse

from seerob.app.console.terminal import port
from seerob.app.emulating import Emulated

HELP = "a Siemens PLC's web server (S7 web API): a belt, a light curtain and a door"
PASSWORD = "seerob"  # noqa: S105 - everybody may know it


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments."""
    sub.add_argument("--port", type=port, default=8081, help="port; 0 is any free one (default: 8081)")
    sub.add_argument("--user", default="seerob", help="who may log in (default: seerob)")
    sub.add_argument("--password", default=PASSWORD, help="with which (default: seerob)")


def emulated(options: argparse.Namespace) -> Emulated:
    """The PLC."""
    from seerob.app.emulators import plc_cell
    from seerob.app.emulators.siemens_web import SiemensWebServer

    program = {
        '"Belt".running': plc_cell.running,
        '"Belt".speed': plc_cell.speed,
        '"Belt".position': plc_cell.position,
        '"Curtain".clear': plc_cell.clear,
        '"Door".open': plc_cell.door_open,
    }
    server = SiemensWebServer(
        program,
        user=options.user,
        password=options.password,
        host=options.host,
        port=options.port,
        outputs=('"Twin".too_close',),
    )
    what = f"variables {', '.join(program)}; speeds in mm/s, positions in mm"
    password = options.password if options.password == PASSWORD else "…"
    hear = (
        f"PLC_PASSWORD={password} seerob probe siemens_web http://{{at}}"
        f" --set user={options.user} --set password_env=PLC_PASSWORD"
    )
    return Emulated(server, what, f"{options.host}:{options.port}", (hear,))
