"""``seerob emulate siemens_web``: a PLC with a web server, and a belt that starts and stops."""

from __future__ import annotations

import argparse

from seerob.commands import port
from seerob.commands.emulating import Emulated

HELP = "a Siemens PLC's web server (S7 web API): a belt that starts and stops"
PERIOD = 10.0
"""Of the belt [s]; it runs for the first half."""
SPEED = 250.0
"""[mm/s]"""


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments."""
    sub.add_argument("--port", type=port, default=8081, help="port; 0 is any free one (default: 8081)")
    sub.add_argument("--user", default="seerob", help="who may log in (default: seerob)")
    sub.add_argument("--password", default="seerob", help="with which (default: seerob)")


def emulated(options: argparse.Namespace) -> Emulated:
    """The PLC."""
    from seerob.emulators.siemens_web import SiemensWebServer

    def runs(t: float) -> bool:
        return t % PERIOD < PERIOD / 2

    program = {'"Belt".running': runs, '"Belt".speed': lambda t: SPEED if runs(t) else 0.0}
    server = SiemensWebServer(
        program, user=options.user, password=options.password, host=options.host, port=options.port
    )
    return Emulated(server, 'variables "Belt".running, "Belt".speed [mm/s]', f"{options.host}:{options.port}")
