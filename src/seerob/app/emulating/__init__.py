"""What ``seerob emulate`` can be, one file per kind: the file's name is the kind.

Each has ``HELP``, ``add`` (its own options) and ``emulated`` (the server that they ask for).
"""

from __future__ import annotations

from typing import NamedTuple, Protocol


class Server(Protocol):
    """What is emulated, in a thread of its own."""

    def start(self) -> object:
        """Begin to serve or to send; returns when it does.

        Raises:
            OSError: The address cannot be listened on.
        """

    def stop(self) -> None:
        """End it."""


class Emulated(NamedTuple):
    """A server that is ready to start, and what to say of it."""

    server: Server
    what: str
    """What it plays: ``ur10, a calm swing``."""
    where: str
    """Where it listens or what it sends to, for a message when that cannot be had: ``127.0.0.1:30004``."""
    commands: tuple[str, ...] = ()
    """That hear it, where ``seerob probe`` with its kind and address is not the way; see `_hint`."""
