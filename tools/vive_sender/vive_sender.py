#!/usr/bin/env python3
"""Sends the poses of SteamVR's trackers to seerob, and records them; runs beside SteamVR.

Needs ``pip install "seerob[vive]"`` there. ``python vive_sender.py --to 192.168.0.20``
With ``--openxr`` it asks the OpenXR runtime instead, and needs ``pip install "seerob[openxr]"``.
"""

from __future__ import annotations

import argparse
import contextlib
import socket
import sys
import time

from seerob.protocols import ProtocolError
from seerob.protocols.tracking.openvr_devices import OpenVr
from seerob.protocols.tracking.openxr_session import OpenXr, OpenXrSession, Runtime
from seerob.protocols.tracking.vive import PORT, encode


def main(arguments: list[str] | None = None, *, openvr: object = None, openxr: Runtime | None = None) -> int:
    """Send until Ctrl-C, or for so many messages; 1 when the trackers cannot be had, or not any more."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--to", default="127.0.0.1", help="address of the computer with seerob")
    parser.add_argument("--port", type=int, default=PORT, help=f"its port (default: {PORT})")
    parser.add_argument("--rate", type=float, default=90.0, help="messages per second (default: 90)")
    parser.add_argument("--record", help="also write them to this file, one per line")
    parser.add_argument("--count", type=int, default=0, help="end after so many messages (default: never)")
    parser.add_argument("--openxr", action="store_true", help="ask the OpenXR runtime, not SteamVR's OpenVR")
    options = parser.parse_args(arguments)
    with contextlib.ExitStack() as stack:
        try:
            runtime = stack.enter_context(
                OpenXr(openxr or OpenXrSession()) if options.openxr else OpenVr(openvr)
            )
        except ProtocolError as error:
            sys.stderr.write(f"{error}\n")
            return 1
        link = stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
        record = stack.enter_context(open(options.record, "wb")) if options.record else None
        begun, sent = time.monotonic(), 0
        with contextlib.suppress(KeyboardInterrupt):
            while not options.count or sent < options.count:
                try:
                    message = encode(runtime.read())
                except ProtocolError as error:
                    sys.stderr.write(f"{error}\n")
                    return 1
                with contextlib.suppress(ConnectionRefusedError):  # nobody listens yet
                    link.sendto(message, (options.to, options.port))
                if record is not None:
                    record.write(message + b"\n")
                sent += 1
                time.sleep(max(0.0, begun + sent / options.rate - time.monotonic()))
    return 0


if __name__ == "__main__":
    sys.exit(main())
