"""For visitors on other devices: a picture of the address to point a camera at, and a cable to a headset."""

from __future__ import annotations

import shutil
import socket
import subprocess
import sys
from collections.abc import Sequence
from io import StringIO

from seerob.core.errors import InputError
from seerob.core.extras import need
from seerob.core.host_name import is_loopback


def name_for_others(names: Sequence[str]) -> str:
    """What others call this machine: its address, but where a certificate is for names and not for that.

    Args:
        names: Of the certificate.
    """
    address = address_for_others()
    told = (name for name in names if not is_loopback(name) and address not in names)
    return next(told, address)


def address_for_others() -> str:
    """Address under which this machine is found on its network; its own where there is none."""
    # Nothing is sent: the system says from which address it would be.
    for family, far in ((socket.AF_INET, "192.0.2.1"), (socket.AF_INET6, "2001:db8::1")):
        try:
            with socket.socket(family, socket.SOCK_DGRAM) as link:
                link.connect((far, 9))
                return str(link.getsockname()[0]).partition("%")[0]
        except OSError:
            continue
    return "127.0.0.1"


def qr_code(address: str) -> str:
    """An address as a QR code of half blocks, for a terminal.

    Raises:
        MissingPackage: The extra ``tls`` is not installed.
    """
    need("segno")
    import segno

    text = StringIO()
    segno.make(address, error="l", micro=False).terminal(text, border=2, compact=True)
    return text.getvalue()


def show_qr_code(address: str) -> None:
    """Write it, where there is a terminal: in a file it would only be a copy of the token."""
    if sys.stdout.isatty():
        sys.stdout.write(qr_code(address) + "\n")
        sys.stdout.flush()


def reverse_port(port: int, adb: str = "adb") -> str:
    """Make this machine's port one of a headset on a cable; what adb says when it does not.

    Args:
        port: The port of the page.
        adb: Program of the Android platform tools.

    Raises:
        InputError: There is no such program.
    """
    program = shutil.which(adb)
    if program is None:
        remedy = "install the Android platform tools (Debian: adb), or leave out --adb"
        raise InputError.at("", "--adb", "there is no program adb", remedy)
    command = [program, "reverse", f"tcp:{port}", f"tcp:{port}"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=20, check=False)  # noqa: S603
    except subprocess.TimeoutExpired:
        return "adb did not answer within 20 s"
    return (
        ""
        if done.returncode == 0
        else (done.stderr or done.stdout).strip() or f"adb ended with {done.returncode}"
    )
