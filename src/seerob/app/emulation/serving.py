"""Being a device: what the options of an emulator ask for, served until whoever asked has had enough."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple

from msgspec.structs import fields, replace

from seerob.app.emulation.background import CannotListen
from seerob.app.emulation.options import COMMAND, EmulatorOptions, Ready, Server
from seerob.app.emulation.wire import FaultyWire
from seerob.core.errors import InputError
from seerob.core.host_name import is_loopback
from seerob.core.plugin import kinds, load
from seerob.workstation.source import Source


class Served(NamedTuple):
    """A device that serves."""

    server: Server
    what: str
    """What it plays."""
    at: str
    """``listens at`` or ``sends to`` an address."""
    commands: tuple[str, ...]
    """That hear it."""
    ports: dict[str, int]
    """Where it listens, by option."""


@contextmanager
def served(kind: str, asked: EmulatorOptions) -> Iterator[Served]:
    """Be a device meanwhile.

    Args:
        kind: What it is.
        asked: Its options.

    Raises:
        InputError: What it shall play is wrong, or it cannot listen there.
    """
    from seerob.devices.live.listening import because

    made = with_faults(asked) if asked.faults().any else asked.ready()
    server, where = made.server, made.where
    try:
        server.start()
    except OSError as error:
        option = "port"
        if isinstance(error, CannotListen):
            option, where = error.option, error.where
        found, key = f"cannot listen on {where}: {because(error)}", f"--{option.replace('_', '-')}"
        raise InputError.at(COMMAND, key, found, "choose another, or 0 for any free one") from error
    try:
        to = getattr(server, "to", None)
        host, port = to or (getattr(server, "host", asked.host), getattr(server, "port", 0))
        commands = probes_of(kind, host, port, sends=bool(to), commands=made.commands)
        at = f"sends to {host}:{port}" if to else f"listens at {host}:{port}"
        ports = {option: getattr(server, option, 0) for option in asked.listens}
        yield Served(server, made.what, at, commands, ports)
    finally:
        server.stop()


class _Behind:
    """An emulator and the bad network before it."""

    def __init__(self, asked: EmulatorOptions) -> None:
        self._asked, self._sends = asked, asked.sends
        self.to: tuple[str, int] | None = None
        if self._sends:
            self.to = asked.to, asked.port  # type: ignore[attr-defined]
            self._wire = FaultyWire(
                asked.faults(), at=("127.0.0.1", 0), to=self.to, device_listens=False
            ).start()
            self.made = replace(asked, to="127.0.0.1", port=self._wire.port).ready()
        else:
            self.made = replace(asked, host="127.0.0.1", port=0).ready()
        self.host, self.port = asked.host, getattr(asked, "port", 0)
        self.primary_port = 0
        """Of a controller's kinematics, which no network spoils."""

    def start(self) -> None:
        """Begin both.

        Raises:
            OSError: The address cannot be listened on.
        """
        self.made.server.start()
        self.primary_port = getattr(self.made.server, "primary_port", 0)
        if not self._sends:
            inner = "127.0.0.1", getattr(self.made.server, "port", 0)
            at = self.host, self.port
            self._wire = FaultyWire(self._asked.faults(), at=at, to=inner, device_listens=True)
            try:
                self.port = self._wire.start().port
            except OSError:
                self.made.server.stop()
                raise

    def stop(self) -> None:
        """End both."""
        self._wire.stop()
        self.made.server.stop()


def with_faults(asked: EmulatorOptions) -> Ready:
    """The device that the options ask for, behind a bad network.

    Raises:
        InputError: What it shall play is missing or wrong.
        OSError: The network cannot be had.
    """
    behind = _Behind(asked)
    faults = asked.faults()
    said = (
        f"{faults.drop:.3g} of its packets lost, {faults.garble:.3g} damaged, late by {faults.delay:g} s "
        f"and up to {faults.jitter:g} s more"
    )
    where = f"{asked.host}:{getattr(asked, 'port', 0)}"
    return behind.made._replace(server=behind, what=f"{behind.made.what}; {said}", where=where)


# -- what to type to hear it ----------------------------------------------------------------------

ANYWHERE = ("0.0.0.0", "::", "")  # noqa: S104 - compared with, not listened on


def probes_of(kind: str, host: str, port: int, *, sends: bool, commands: tuple[str, ...]) -> tuple[str, ...]:
    """Commands that hear it.

    Args:
        kind: What is emulated.
        host: Where it listens, or whom it sends to.
        port: The same.
        sends: Whether it sends by itself, so that its source listens.
        commands: Given when its own kind with the address is not the way to hear it; with ``{at}`` for
            both, ``{host}``, ``{port}``, and ``{option}`` for a port that its source does not expect.
    """
    option = _port_option(kind, port)
    if sends:
        option += "" if is_loopback(host) else f" --set bind={host}"
    host = "127.0.0.1" if host in ANYWHERE else host
    at = f"[{host}]:{port}" if ":" in host else f"{host}:{port}"
    if commands:
        return tuple(command.format(at=at, host=host, port=port, option=option) for command in commands)
    address = "" if sends else f" {host}"
    return (f"seerob probe {kind}{address}{option}",)


def _port_option(kind: str, port: int) -> str:
    """The port, where the source expects another one."""
    if kind not in kinds("sources"):  # what is looked at, such as a camera's picture
        return ""
    usual = {field.name: field.default for field in fields(load("sources", kind, Source))}.get("port", port)
    return "" if port == usual else f" --port {port}"
