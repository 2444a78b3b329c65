"""Ports of a run whose emulators find their usual ones taken: others instead, and what points there follows.

Who listens takes its port itself: where another program has it, any free one. Who sends, sends to a source
that listens only later: its port is held for the run meanwhile, so that two runs at once have one each.
"""

from __future__ import annotations

import random
import socket
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from ipaddress import ip_address
from typing import TYPE_CHECKING, Any, NamedTuple
from urllib.parse import urlsplit

from msgspec.structs import replace

from seerob.app.emulation.options import EmulatorOptions
from seerob.core.host_name import is_loopback
from seerob.devices.live.listening import LiveSource
from seerob.protocols.ros import ros_tcp, rosbridge
from seerob.workstation.source import Source
from seerob.workstation.tables.cameras import Camera
from seerob.workstation.tables.writing import CartesianTarget, TargetWire

if TYPE_CHECKING:
    from seerob.session.station import Station

_FREE = range(21_000, 30_000)
"""Below those that systems give to whoever asks for any, and between the usual ones of devices."""
_USUAL = {"opc.tcp": 4840, "http": 80, "ws": 80, "https": 443, "wss": 443}
"""Port of a URL that has none."""
_CHOICE = random.SystemRandom()  # other runs choose, too


class Move(NamedTuple):
    """A port that was taken, and the one instead."""

    host: str
    """Where the emulator listens; empty where it sends, so that a source listens."""
    taken: int
    port: int

    def __str__(self) -> str:
        """For people."""
        return f"port {self.taken} is taken, {self.port} instead"


@contextmanager
def held(
    emulators: Sequence[EmulatorOptions], sources: Iterable[Source]
) -> Iterator[list[tuple[EmulatorOptions, Move | None]]]:
    """Hold the ports that sources of a run listen on for its emulators, as long as it lasts.

    Args:
        emulators: In the order of the file; those that listen are left as they are.
        sources: Of the same file.
    """
    listening = [source for source in sources if isinstance(source, LiveSource) and source.contact().listens]
    ports: dict[int, int] = {}
    found: list[tuple[EmulatorOptions, Move | None]] = []
    with ExitStack() as stack:
        for options in emulators:
            asked = getattr(options, "port", 0)
            binds = [str(getattr(s, "bind", "")) for s in listening if getattr(s, "port", 0) == asked]
            if options.listens or not binds:
                found.append((options, None))
                continue
            if asked not in ports:
                # A Unity project is the only one that comes by TCP.
                kind = socket.SOCK_STREAM if getattr(options, "unity", None) else socket.SOCK_DGRAM
                ports[asked] = _held(stack, binds, asked, kind)
            move = None if ports[asked] == asked else Move("", asked, ports[asked])
            found.append((replace(options, port=ports[asked]), move))
        yield found


def _held(stack: ExitStack, binds: Sequence[str], port: int, kind: socket.SocketKind) -> int:
    """The port, or a free one; nobody else who asks here has it meanwhile."""
    while True:
        with suppress(OSError):
            _hold(stack, binds, port, kind)
            return port
        port = _CHOICE.choice(_FREE)


def _hold(stack: ExitStack, binds: Sequence[str], port: int, kind: socket.SocketKind) -> None:
    """Hold a port by the same number of the other protocol, which leaves it to the source.

    Raises:
        OSError: It is taken.
    """
    other = {socket.SOCK_DGRAM: socket.SOCK_STREAM, socket.SOCK_STREAM: socket.SOCK_DGRAM}[kind]
    with ExitStack() as own:
        own.enter_context(socket.socket(socket.AF_INET, other)).bind(("127.0.0.1", port))
        for bind in binds:
            family, _, _, _, address = socket.getaddrinfo(bind, port, type=kind)[0]
            with socket.socket(family, kind) as probe:
                if kind == socket.SOCK_STREAM:  # as the source does: who has just left is not in the way
                    probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
                probe.bind(address)
        stack.push(own.pop_all())


# -- what follows -------------------------------------------------------------------------------


def at_ports(station: Station, moves: Iterable[Move]) -> Station:
    """A workstation whose sources and targets are where its emulators are.

    Args:
        station: As its file says.
        moves: Of its emulators.
    """
    to = {(_plain(move.host) if move.host else "", move.taken): move.port for move in moves}
    if not to:
        return station
    own = station.workstation
    sources = tuple([_followed(source, to) for source in own.sources])
    targets = tuple([_target(target, to) for target in own.targets])
    cameras = tuple([_camera(camera, to) for camera in own.cameras])
    return station.with_addresses(replace(own, sources=sources, targets=targets, cameras=cameras))


def _followed(source: Any, to: dict[tuple[str, int], int]) -> Any:
    if not isinstance(source, LiveSource):
        return source
    host = "" if source.contact().listens else _plain(getattr(source, "host", "") or "-")
    changed: dict[str, object] = {
        option: to[host, port]
        for option in ("port", "primary_port")
        if (host, port := getattr(source, option, 0)) in to
    }
    if url := getattr(source, "url", ""):
        changed["url"] = _moved(url, to)
    return replace(source, **changed) if changed else source


def _camera(camera: Camera, to: dict[tuple[str, int], int]) -> Camera:
    return camera if camera.address is None else replace(camera, address=_moved(camera.address, to))


def _moved(url: str, to: dict[tuple[str, int], int]) -> str:
    parts = urlsplit(url)
    own = parts.port or _USUAL.get(parts.scheme, 0)
    if (port := to.get((_plain(parts.hostname or "-"), own))) is None:
        return url
    netloc = f"{parts.netloc.removesuffix(f':{parts.port}')}:{port}"
    return parts._replace(netloc=netloc).geturl()


def _target(target: CartesianTarget, to: dict[tuple[str, int], int]) -> CartesianTarget:
    usual = rosbridge.PORT if target.wire is TargetWire.ROSBRIDGE else ros_tcp.PORT
    port = to.get((_plain(target.host), target.port or usual))
    return target if port is None else replace(target, port=port)


def _plain(host: str) -> str:
    """An address of this machine in one spelling."""
    if not is_loopback(host):
        return host
    return "127.0.0.1" if host == "localhost" else str(ip_address(host))
