"""``seerob emulate kinect``: the sender beside a depth camera, with a moving person."""

from __future__ import annotations

import argparse
from pathlib import Path

from seerob.app.console.terminal import port
from seerob.app.emulating import Emulated

HELP = "the sender beside a depth camera (Azure Kinect, Orbbec), which sees a moving person"
LIBRARY = "library:reach"
"""What is played when nothing is given."""
PORT = 9871

CONNECT = "seerob probe kinect --set link=websocket --set host={host} --port {port}"
"""How one that listens is heard."""


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments."""
    what = "a recording of a body tracker (.json, .bag, .csv …), or keyframes (.toml, library:…)"
    sub.add_argument("--file", default=LIBRARY, help=f"{what}; default: {LIBRARY}")
    sub.add_argument("--subject", default="", help="which body of a recording")
    sub.add_argument("--to", default="127.0.0.1", help="address to send datagrams to (default: this machine)")
    sub.add_argument("--port", type=port, default=PORT, help=f"port (default: {PORT})")
    sub.add_argument("--rate", type=float, default=30.0, help="pictures per second (default: 30)")
    sub.add_argument("--websocket", action="store_true", help="let listeners connect; else UDP")


def emulated(options: argparse.Namespace) -> Emulated:
    """The sender.

    Raises:
        InputError: The motion is missing or wrong, or the rate is none of a camera's.
    """
    from seerob.app.emulators.kinect import KinectSender
    from seerob.app.emulators.kinect_person import animated, recorded
    from seerob.core.errors import InputError

    if not 1 <= options.rate <= 60:
        raise InputError.at("seerob emulate", "--rate", f"{options.rate:g} Hz", "a camera does 1 to 60 Hz")
    keyframes = options.file.startswith("library:") or options.file.endswith(".toml")
    scene = animated(options.file) if keyframes else recorded(Path(options.file), options.subject)
    to = None if options.websocket else (options.to, options.port)
    server = KinectSender(scene, to=to, host=options.host, port=options.port, rate=options.rate)
    where = options.host if options.websocket else options.to
    hear = (CONNECT,) if options.websocket else ()
    return Emulated(server, f"a person, {options.file}", f"{where}:{options.port}", hear)
