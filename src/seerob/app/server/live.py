"""A run that is happening: snapshots come from the run loop's thread, the newest goes to the pages."""

from __future__ import annotations

import asyncio
from collections import deque
from time import monotonic

from seerob.app.server.feed import Audience
from seerob.app.server.past import Past
from seerob.app.server.serving import Server
from seerob.core.samples import Sample
from seerob.core.snapshot import Command, History, Scene, Snapshot, SoFar, Transport
from seerob.outputs.sink import Closing
from seerob.recording.result_log import ResultLog

WAITING = 8192
"""Snapshots that wait for the server's thread; more than that are missing in the history only."""

TELL_EVERY = 1.0
"""How often pages are told the shares of a run that goes on [s]; a verdict that changes, at once."""


class Live:
    """Takes snapshots from any one thread without ever making it wait.

    A live view cannot be paused, sought or slowed down: the world does not wait. A page may hold
    its own picture still. Whoever asks is told the truth, `Transport.live`.

    Args:
        rate: Frames sent per second at most [1/s].
    """

    mode = "live"
    duration = None

    def __init__(self, *, rate: float = 60.0) -> None:
        self._pause = 1.0 / rate
        self._inbox: deque[Snapshot] = deque(maxlen=WAITING)
        self._past = Past()
        self._newest = 0.0
        self._finished = False
        self.log: ResultLog | None = None
        """Of the run, which adds to it in its own thread."""

    def publish(self, snapshot: Snapshot) -> None:
        """Hand over what is now; returns at once."""
        # The server's thread comes and looks. Waking it would be a system call, after which this
        # thread may have to wait for the interpreter's lock: 5 ms of a 10 ms tick.
        self._inbox.append(snapshot)

    def finish(self) -> None:
        """Say that no more will come, so that no page takes the last picture for the present."""
        self._finished = True

    def history(self) -> History:
        """What happened so far."""
        return self._past.history()

    def so_far(self) -> SoFar | None:
        """What the run came to by now."""
        return None if self.log is None else self.log.so_far(whole=self._finished)

    def transport(self) -> Transport:
        """Always live; not playing once the run has ended."""
        return Transport(playing=not self._finished, t=self._newest, live=True)

    def command(self, command: Command) -> None:
        """Nothing that a page asks for can be done to the present."""

    async def run(self, audience: Audience) -> None:
        """Show the newest, at most ``rate`` times a second, until cancelled."""
        said_finished = False
        told: tuple[object, ...] = ()
        again = 0.0
        while True:
            finished = self._finished  # before looking: what was published earlier comes first
            newest = None
            for _ in range(len(self._inbox)):
                newest = self._inbox.popleft()
                self._past.add(newest)
            if newest is not None:
                self._newest = newest.t
                audience.show(newest)
                self._past.tidy()
            now = monotonic()
            if (
                self.log is not None
                and (verdicts := self.log.verdicts())
                and (verdicts != told or now > again or (finished and not said_finished))
            ):
                told, again = verdicts, now + TELL_EVERY
                audience.tell(self.log.so_far(whole=finished))
            if finished and not said_finished:
                audience.tell(self.transport())
                said_finished = True
            await asyncio.sleep(self._pause)


class LiveView(Closing):
    """The live view as a sink: an open `seerob.outputs.sink.Writer` that pages in a browser look at.

    Args:
        scene: What does not change during the run.
        meshes: Binary glTF per mesh hash of the scene's nodes.
        host: Address to listen on; anything but this machine's own needs a token.
        port: Port; 0 is any free one, a taken one moves to the next free.
        token: What a visitor must know.

    Raises:
        InputError: As `Server.start`.
    """

    def __init__(
        self,
        *,
        scene: Scene,
        meshes: dict[str, bytes],
        host: str = "127.0.0.1",
        port: int = 8080,
        token: str | None = None,
    ) -> None:
        self._live = Live()
        self.server = Server(scene=scene, meshes=meshes, host=host, port=port, token=token, feed=self._live)
        self.url = self.server.start()
        """What to open in a browser."""

    def write(self, snapshot: Snapshot, samples: tuple[Sample, ...]) -> None:
        """Show one tick; never waits for a page."""
        self._live.publish(snapshot)

    def share(self, log: ResultLog) -> None:
        """Show what the run comes to, too."""
        self._live.log = log

    def finish(self) -> None:
        """The run is over; pages may go on looking at what happened until `close`."""
        self._live.finish()

    def close(self) -> None:
        """Stop the server."""
        self.server.stop()
