"""Options of commands that serve the page: who may visit, with what token, and how it is encrypted."""

from __future__ import annotations

import argparse
import shutil
import socket
import subprocess
import sys
from collections.abc import Sequence
from getpass import getpass
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn, TypedDict

from seerob.app.console.terminal import line, port
from seerob.core.errors import InputError
from seerob.core.extras import need
from seerob.core.host_name import is_loopback

if TYPE_CHECKING:
    from seerob.app.server.access import Tokens
    from seerob.app.server.certificates import Tls
    from seerob.app.server.serving import Server


class Visiting(TypedDict):
    """Arguments of a server."""

    tokens: Tokens | None
    tls: Tls | None
    clear_text: bool


def add_page(sub: argparse.ArgumentParser) -> None:
    """Arguments of commands that serve the page."""
    sub.add_argument("--host", default="127.0.0.1", help="address to listen on (default: this machine only)")
    text = "also serve other devices, encrypted, and show a picture of the address for this role's camera"
    sub.add_argument(
        "--lan", action=_Lan, nargs="?", const="track", choices=("view", "track", "control"), help=text
    )
    sub.add_argument(
        "--adb", action="store_true", help="make the port one of a headset on a cable, by adb reverse"
    )
    sub.add_argument("--port", type=port, default=8080, help="port of the page; 0 is any free one")
    text = "tokens of visitors, by role; made when it does not exist; - asks (default: new ones for each run)"
    sub.add_argument("--token-file", type=Path, metavar="FILE", help=text)
    text = "the server's own, PEM (default: one that is made here, for other machines than this one)"
    sub.add_argument("--certificate", type=Path, metavar="FILE", help=text)
    sub.add_argument("--key", type=Path, metavar="FILE", help="its private key, PEM, without a password")
    text = "serve other machines unencrypted: whoever is on the way can read and change what they see"
    sub.add_argument("--clear-text", action="store_true", help=text)
    sub.add_argument("--token", type=_refused, help=argparse.SUPPRESS)


class _Lan(argparse.Action):
    """Listens on every address of this machine, unless another was named."""

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: object,
        option_string: str | None = None,
    ) -> None:
        setattr(namespace, self.dest, values)
        if is_loopback(namespace.host):
            namespace.host = "0.0.0.0"  # noqa: S104 - as asked for, with tokens and TLS


def _refused(text: str) -> NoReturn:
    what = "others on this machine see the command line, and the shell keeps it"
    raise argparse.ArgumentTypeError(f"{what}; use --token-file FILE, or - to be asked")


def visiting(options: argparse.Namespace) -> Visiting:
    """What the options of `add_page` ask for.

    Raises:
        InputError: A token is weak, a certificate cannot be used, or options contradict one another.
        MissingPackage: A certificate has to be made, and the extra ``tls`` is not installed.
    """
    from seerob.app.server import certificates
    from seerob.app.server.access import Tokens, read_tokens

    alone = is_loopback(options.host)
    tokens = None
    if options.token_file == Path("-"):
        tokens = _asked()
    elif options.token_file is not None:
        tokens = read_tokens(options.token_file)
    elif not alone:
        tokens = Tokens.made()
    if options.key is not None and options.certificate is None:
        raise InputError.at("", "--key", "is of no use alone", "give --certificate, too")
    if options.clear_text and options.certificate is not None:
        raise InputError.at("", "--clear-text", "contradicts --certificate", "leave out one of them")
    tls = None
    if options.certificate is not None:
        tls = certificates.given(options.certificate, options.key)
    elif not (alone or options.clear_text):
        from platformdirs import user_config_path

        tls = certificates.own(user_config_path("seerob", appauthor=False) / "tls", options.host)
    return Visiting(tokens=tokens, tls=tls, clear_text=options.clear_text)


def _asked() -> Tokens:
    from seerob.app.server.access import Role, Tokens

    if not sys.stdin.isatty():
        raise InputError.at("", "--token-file", "- asks, and there is no terminal", "name a file")
    given = {str(role): getpass(f"token to {role} (nothing: a new one): ") for role in Role}
    return Tokens.checked({role: token for role, token in given.items() if token}, "prompt")


def tell_pages(server: Server, end: str, options: argparse.Namespace) -> None:
    """Say which address to open for what, and what visitors have to trust.

    Raises:
        InputError: A headset was to be reached by adb, which is not there.
    """
    from seerob.app.server.access import Role

    names = () if server.tls is None else server.tls.names
    addresses = server.urls_at(name_for_others(names) if options.lan else "")
    line("page", f"{addresses[Role.VIEW]}  ({end})", "bold")
    if len(set(addresses.values())) > 1:
        line("  track", f"{addresses[Role.TRACK]}  (and may offer what a headset sees)")
        line("  control", f"{addresses[Role.CONTROL]}  (and may play, pause and seek)")
    tls = server.tls
    if tls is not None and tls.authority is not None:
        line("trust", f"{tls.authority} on each visitor's device; SHA-256 {tls.fingerprint}")
        where = addresses[Role.VIEW].partition("?")[0]
        line("  how", f"{where}trust has it, with the steps for each device")
    elif tls is None and server.clear_text:
        line("warning", "unencrypted: whoever is on the way can read and change what visitors see", "yellow")
    if options.lan:
        show_qr_code(addresses[Role(options.lan)])
    if options.adb:
        failure = reverse_port(server.port)
        if failure:
            line("warning", f"adb: {failure}", "yellow")
        else:
            line("headset", f"{server.urls_at('localhost')[Role.TRACK]}  (in the headset on the cable)")


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
