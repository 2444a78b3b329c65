"""``seerob opcua certificate``: a certificate with which OPC UA servers know this application."""

from __future__ import annotations

import argparse
import os
import re
import socket
from pathlib import Path

from seerob.app.console.terminal import Exit, line
from seerob.core.errors import InputError
from seerob.core.extras import need

HELP = "make a certificate with which OPC UA servers know this application"
EXAMPLE = "seerob opcua certificate -o my_cell/twin"
URI = re.compile(r"[A-Za-z][A-Za-z0-9+.-]*:[\x21-\x7e]+")


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments."""
    sub.add_argument("what", choices=["certificate"], help="what is made")
    text = "begin of the names of the files: FILE.pem, FILE.der, FILE-key.pem (default: seerob)"
    sub.add_argument("-o", "--output", type=Path, default=Path("seerob"), metavar="FILE", help=text)
    text = "URI of the application, which the certificate names (default: urn:<this computer>:seerob)"
    sub.add_argument("--uri", help=text)
    sub.add_argument("--days", type=int, help="how long it holds (default: five years)")


def run(options: argparse.Namespace) -> int:
    """Write it and its key, and say what to do with both.

    Raises:
        InputError: The URI is none, or a file cannot be written.
    """
    need("asyncua")  # and with it what makes certificates
    from seerob.protocols.plc.opcua_client import own_uri
    from seerob.protocols.plc.opcua_security import LASTS, certificate, made

    uri = own_uri() if options.uri is None else options.uri
    if not URI.fullmatch(uri):
        raise InputError.at("seerob opcua", "--uri", f"{uri!r} is no URI", "write urn:my-company:cell-3")
    days = LASTS if options.days is None else options.days
    if not 1 <= days <= 36500:
        raise InputError.at("seerob opcua", "--days", f"{days} days", "give 1 to 36500")
    host = socket.gethostname()
    found = made(uri, f"seerob on {host}", [host], days)
    base = options.output
    pem, der, key = (base.with_name(base.name + end) for end in (".pem", ".der", "-key.pem"))
    there = [file for file in (pem, der, key) if file.exists()]
    if there:
        raise InputError.at(there[0], "", "exists already", "give another name with -o")
    for file, data, mode in ((key, found.key, 0o600), (pem, found.pem, 0o644), (der, found.der, 0o644)):
        with os.fdopen(os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode), "wb") as opened:
            opened.write(data)
    line("wrote", f"{key}: keep it to yourself", "bold")
    line("wrote", f"{pem} and {der}: {certificate(found.pem)}", "bold")
    line(
        "next", f"let the server trust {der} (its list of trusted clients), then in the table of the source:"
    )
    line("", f'security = "encrypt", certificate = "{pem.name}", key = "{key.name}"')
    return Exit.WITHIN
