"""What to type to hear an emulated device: its port is not always the one that its source expects."""

from __future__ import annotations

from seerob.core.host_name import is_loopback

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
    option = _option(kind, port)
    if sends:
        option += "" if is_loopback(host) else f" --set bind={host}"
    host = "127.0.0.1" if host in ANYWHERE else host
    at = f"[{host}]:{port}" if ":" in host else f"{host}:{port}"
    if commands:
        return tuple(command.format(at=at, host=host, port=port, option=option) for command in commands)
    address = "" if sends else f" {host}"
    return (f"seerob probe {kind}{address}{option}",)


def _option(kind: str, port: int) -> str:
    """The port, where the source expects another one."""
    from msgspec.structs import fields

    from seerob.core.plugin import load
    from seerob.workstation.source import Source

    usual = {field.name: field.default for field in fields(load("sources", kind, Source))}.get("port", port)
    return "" if port == usual else f" --port {port}"
