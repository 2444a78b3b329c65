"""A draft of a workstation that is tried while it is edited: every edit begins its run anew.

A trial is no run that is handed over: nothing is recorded or reported, nothing is sent to a machine, and what
it came to is of a draft. What an edit begins anew is everything: run time, everybody's motion, the
connections to live sources, what criteria counted, and the past that pages plot.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping
from math import inf
from threading import Condition
from typing import NamedTuple

from msgspec.structs import replace

from seerob.app.server.feed import Audience, Feed
from seerob.app.server.live import Live
from seerob.core.snapshot import (
    Command,
    History,
    Scene,
    Snapshot,
    SoFar,
    Transport,
    VisitorInfo,
    VisitorPresence,
)
from seerob.session.measuring import Ruler
from seerob.session.station import Station


class Still:
    """A feed that shows one snapshot: a workstation that is edited and not run.

    Args:
        snapshot: What is shown.
    """

    mode = "edit"
    duration = None

    def __init__(self, snapshot: Snapshot) -> None:
        self._snapshot = snapshot

    def history(self) -> History:
        """Nothing happened."""
        return History(traces=())

    def so_far(self) -> SoFar | None:
        """Nothing was run."""
        return None

    def transport(self) -> Transport:
        """Not playing."""
        return Transport(playing=False, t=self._snapshot.t)

    def seen_at(self, t: float | None) -> Snapshot:
        """The snapshot."""
        return self._snapshot

    def command(self, command: Command) -> None:
        """Nothing can be played."""

    async def run(self, audience: Audience) -> None:
        """Show the snapshot."""
        audience.show(self._snapshot, inf)
        await asyncio.Event().wait()


class Begun(NamedTuple):
    """A draft that is right, and where everybody begins in it."""

    station: Station
    scene: Scene
    first: Snapshot


class Job(NamedTuple):
    """A run that somebody has to do."""

    begun: Begun
    live: Live


Begin = Callable[[Scene, Mapping[str, bytes]], None]
"""Shows another scene, and tells pages of the mode; called in the server's loop."""


class Trial:
    """A feed of a draft: where everybody begins, or its run while it is tried.

    All but `take`, `superseded` and `failed` is called in the server's loop.

    Args:
        begun: The draft now.
        running: Whether it is tried from the start.
        refusal: Why a draft cannot be tried here, empty when it can.
    """

    duration = None

    def __init__(
        self, begun: Begun, *, running: bool = False, refusal: Callable[[Station], str] = lambda _: ""
    ) -> None:
        self._begun, self._refusal = begun, refusal
        self._ruler = Ruler(lambda: begun.station.model)
        self._seq = begun.first.seq
        self._feed: Feed = Still(begun.first)
        self._turned = asyncio.Event()
        self._job: Job | None = None
        self._taken = False
        self._news = Condition()
        self._begin: Begin = lambda scene, meshes: None
        self._tell: Callable[[], None] = lambda: None
        self._call: Callable[[Callable[[], None]], None] = lambda act: act()
        self.ended = ""
        """Why the newest run ended, or was not begun; empty while it goes on or nobody asked for one."""
        if running:
            self._turn(running=True)

    def connect(
        self, begin: Begin, tell: Callable[[], None], call: Callable[[Callable[[], None]], None]
    ) -> None:
        """Say how pages are shown a scene, told of a run's end, and how to call into the server's loop."""
        self._begin, self._tell, self._call = begin, tell, call

    @property
    def running(self) -> bool:
        """Whether the draft is tried."""
        return isinstance(self._feed, Live)

    @property
    def mode(self) -> str:
        """``live`` while the draft is tried, ``edit`` otherwise."""
        return self._feed.mode

    # -- what pages ask for -----------------------------------------------------------------------

    def put(self, begun: Begun) -> None:
        """Another draft: shown where everybody begins, and tried from there when the one before it was."""
        self._begun, self._ruler = begun, Ruler(lambda: begun.station.model)
        self._turn(running=self.running)

    def start(self) -> str:
        """Try the draft from its beginning; why not, empty when it is done."""
        if not (refusal := self._refusal(self._begun.station)):
            self._turn(running=True)
        return refusal

    def stop(self) -> None:
        """End the run, and show where everybody begins."""
        self._turn(running=False)

    def _turn(self, *, running: bool) -> None:
        begun, self.ended = self._begun, ""
        if running and (refusal := self._refusal(begun.station)):
            running, self.ended = False, refusal
        live = Live() if running else None
        with self._news:
            self._job = None if live is None else Job(begun, live)
            self._taken = False
            self._news.notify_all()
        self._seq += 1
        self._feed = Still(replace(begun.first, seq=self._seq)) if live is None else live
        self._begin(begun.scene, begun.station.model.meshes)
        self._turned.set()

    # -- who runs it, in a thread of its own --------------------------------------------------------

    def take(self, patience: float) -> Job | None:
        """The run that is to be done now, once; None when none was asked for within so long [s]."""
        with self._news:
            self._news.wait_for(lambda: self._job is not None and not self._taken, patience)
            if self._job is None or self._taken:
                return None
            self._taken = True
            return self._job

    def superseded(self, job: Job) -> bool:
        """Whether another draft, or nothing, is to be run by now."""
        return self._job is not job

    def failed(self, job: Job, reason: str) -> None:
        """The run has ended by itself: pages are told why and shown where everybody begins."""

        def end() -> None:
            if self.superseded(job):
                return
            self._turn(running=False)
            self.ended = reason
            self._tell()

        self._call(end)

    # -- what pages see -----------------------------------------------------------------------------

    def history(self) -> History:
        """What the run has so far."""
        return self._feed.history()

    def so_far(self) -> SoFar | None:
        """What the run came to by now."""
        return self._feed.so_far()

    def transport(self) -> Transport:
        """Of the run, or that nothing plays."""
        return self._feed.transport()

    def seen_at(self, t: float | None) -> Snapshot | None:
        """Where everybody was in the run, or begins."""
        return self._feed.seen_at(t)

    @property
    def ruler(self) -> Ruler:
        """Measures in the draft."""
        return self._ruler

    def command(self, command: Command) -> None:
        """The present cannot be played otherwise."""

    async def run(self, audience: Audience) -> None:
        """Show the run or the beginning, whichever it is now."""
        while True:
            self._turned.clear()
            feed = self._feed
            showing = asyncio.create_task(feed.run(_While(audience, lambda feed=feed: self._feed is feed)))  # type: ignore[misc]
            turned = asyncio.create_task(self._turned.wait())
            try:
                await asyncio.wait((showing, turned), return_when=asyncio.FIRST_COMPLETED)
                if showing.done():
                    showing.result()
            finally:
                showing.cancel()
                turned.cancel()
                await asyncio.gather(showing, turned, return_exceptions=True)


class _While:
    """An audience that hears a feed as long as that is the one to be shown."""

    def __init__(self, audience: Audience, holds: Callable[[], bool]) -> None:
        self._audience, self._holds = audience, holds

    def show(self, snapshot: Snapshot, until: float = inf) -> None:
        if self._holds():
            self._audience.show(snapshot, until)

    def recall(self, visitors: tuple[VisitorInfo, ...], presences: tuple[VisitorPresence, ...]) -> None:
        if self._holds():
            self._audience.recall(visitors, presences)

    def tell(self, message: Transport | History | SoFar) -> None:
        if self._holds():
            self._audience.tell(message)
