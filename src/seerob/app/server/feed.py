"""What the server shows: a run that is happening, or a recording that is played."""

from __future__ import annotations

from math import inf
from typing import Protocol

from seerob.core.snapshot import (
    Command,
    History,
    Snapshot,
    SoFar,
    Transport,
    VisitorInfo,
    VisitorPresence,
)


class Audience(Protocol):
    """The pages that are connected. Only to be called in the server's own loop."""

    def show(self, snapshot: Snapshot, until: float = inf) -> None:
        """Send a snapshot; a page that is behind gets the newest only, and none that is sent later.

        Args:
            snapshot: It.
            until: Monotonic time from which on it is not the present any more [s].
        """

    def recall(self, visitors: tuple[VisitorInfo, ...], presences: tuple[VisitorPresence, ...]) -> None:
        """Show who was there when it was recorded, among those who are there now."""

    def tell(self, message: Transport | History | SoFar) -> None:
        """Send what changed; of each kind the newest only."""


class Feed(Protocol):
    """Where snapshots come from. Called in the server's loop."""

    @property
    def mode(self) -> str:
        """``live``, ``replay`` or ``edit``."""

    @property
    def duration(self) -> float | None:
        """Length of the recording [s]; None when live."""

    def history(self) -> History:
        """What a page is told of the past when it connects."""

    def so_far(self) -> SoFar | None:
        """What the run came to; None when nobody judges it here."""

    def transport(self) -> Transport:
        """State of the player."""

    def seen_at(self, t: float | None) -> Snapshot | None:
        """Where everybody was when a page showed an instant [s], or is now; None when that is not kept."""

    def command(self, command: Command) -> None:
        """Do what a page asks, if it can be done; the page is told `transport` afterwards.

        Raises:
            ValueError: The command makes no sense; the page that sent it is turned away.
        """

    async def run(self, audience: Audience) -> None:
        """Show snapshots until cancelled."""


KNOWN_ACTIONS = frozenset({"play", "pause", "seek", "speed", "step", "loop", "beside"})
"""What a page may ask for; ``ack`` is between the page and the server only."""
