"""A run that is happening: snapshots come from the run loop's thread, the newest goes to the pages.

What happened so far is kept in bounded memory and without losing an extremum.
"""

from __future__ import annotations

import asyncio
from array import array
from bisect import bisect_right
from collections import deque
from math import ceil, inf, log2, nan
from time import monotonic

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from seerob.app.server.access import Tokens
from seerob.app.server.certificates import Tls
from seerob.app.server.feed import Audience
from seerob.app.server.serving import Server
from seerob.core.samples import Sample
from seerob.core.snapshot import Command, History, Result, Scene, Snapshot, SoFar, Trace, Transport
from seerob.core.transforms import Array
from seerob.devices.live.camera_pictures import Cameras
from seerob.devices.live.headset_offers import Offers
from seerob.outputs.sink import Closing
from seerob.recording.result_log import ResultLog
from seerob.recording.series import CODES
from seerob.session.measuring import Ruler

KEPT_PER_BUCKET = 7
"""Smallest, largest, smallest margin, and the first of each verdict; the first of all is one of those."""


def width_of(span: float, buckets: int) -> float:
    """Length of a bucket [s]: the smallest power of two of which ``buckets`` cover the span [s].

    Powers of two nest: thinning again what was thinned loses nothing that the first did not.
    """
    return 2.0 ** ceil(log2(max(span, 1e-6) / buckets))


def keep(
    t: Array, values: Array, limits: Array, verdicts: NDArray[np.uint8], *, at_most: bool, width: float
) -> NDArray[np.int64]:
    """Indices of the points that keep the picture true, ascending.

    Time is cut into buckets that begin at multiples of ``width``. Of each stay the first point, the
    smallest and the largest value, the smallest margin, and one point of each verdict in it.

    Args:
        t: Times [s], ascending, shape (n,), n > 0.
        values: Shape (n,); nan where there was none.
        limits: Shape (n,); nan where there was none.
        verdicts: Codes as in `snapshot.Trace`, shape (n,).
        at_most: Whether limits bound from above.
        width: Length of a bucket [s]; at most `KEPT_PER_BUCKET` points stay of each, and the last.
    """
    bucket = np.floor(t / width).astype(np.int64)
    starts = np.flatnonzero(np.diff(bucket, prepend=bucket[0] - 1))
    margins = limits - values if at_most else values - limits
    kept = [starts, np.array([len(t) - 1])]
    # Stable sort by bucket, then by key: the first of each bucket is its smallest; nan comes last.
    for sort_key in (values, -values, margins):
        kept.append(np.lexsort((sort_key, bucket))[starts])
    for code in np.unique(verdicts):
        where = np.flatnonzero(verdicts == code)
        kept.append(where[np.flatnonzero(np.diff(bucket[where], prepend=bucket[0] - 1))])
    return np.unique(np.concatenate(kept))


class _Past:
    """One criterion."""

    def __init__(self, *, at_most: bool) -> None:
        self.at_most = at_most
        self.t, self.values, self.limits, self.verdicts = array("d"), array("d"), array("d"), array("B")
        self._last_t: float | None = None

    def append(self, result: Result, t: float) -> None:
        if result.t is not None and result.t == self._last_t:
            return  # a criterion with a period, shown again
        self._last_t = result.t
        self.t.append(t)
        self.values.append(nan if result.value is None else result.value)
        self.limits.append(nan if result.limit is None else result.limit)
        self.verdicts.append(CODES[result.verdict])

    def thin(self, buckets: int) -> None:
        t, values, limits = (np.array(a, np.float64) for a in (self.t, self.values, self.limits))
        verdicts = np.array(self.verdicts, np.uint8)
        width = width_of(float(t[-1] - t[0]), buckets)
        i = keep(t, values, limits, verdicts, at_most=self.at_most, width=width)
        self.t, self.values, self.limits = (array("d", a[i].tobytes()) for a in (t, values, limits))
        self.verdicts = array("B", verdicts[i].tobytes())

    def trace(self, name: str) -> Trace:
        return Trace(
            name=name,
            t=np.array(self.t, "<f8").tobytes(),
            values=np.array(self.values, "<f8").tobytes(),
            limits=np.array(self.limits, "<f8").tobytes(),
            verdicts=self.verdicts.tobytes(),
        )


class Past:
    """The results of a run that has no end yet.

    Args:
        buckets: Stretches of equal length that old points are thinned to, at most; per criterion
            about three times `KEPT_PER_BUCKET` as many points are held, the newest of them whole.
    """

    def __init__(self, *, buckets: int = 600) -> None:
        self._buckets = buckets
        self._most = 3 * KEPT_PER_BUCKET * buckets
        self._of: dict[str, _Past] = {}

    def add(self, snapshot: Snapshot) -> None:
        """Take the results of one tick."""
        for result in snapshot.results:
            past = self._of.get(result.name)
            if past is None:
                past = self._of[result.name] = _Past(at_most=result.at_most)
            past.append(result, snapshot.t)

    def tidy(self) -> None:
        """Thin the longest series if it is due; one at a time, so that nobody waits for all of them."""
        longest = max(self._of.values(), key=lambda past: len(past.t), default=None)
        if longest is not None and len(longest.t) > self._most:
            longest.thin(self._buckets)

    def history(self) -> History:
        """What a page that comes late is told."""
        return History(traces=tuple(past.trace(name) for name, past in self._of.items()))


class _Seen:
    """Where everybody was in the last minutes of a run, as pages were shown it: what one measures in."""

    def __init__(self, most: int = 16 * 2**20) -> None:
        """Most bytes of poses that are kept."""
        self._kept: list[Snapshot] = []
        self._bytes, self._most = 0, most

    def add(self, snapshot: Snapshot) -> None:
        self._kept.append(replace(snapshot, results=()))
        self._bytes += len(snapshot.poses)
        if self._bytes > self._most:
            gone = max(len(self._kept) // 10, 1)
            self._bytes -= sum(len(each.poses) for each in self._kept[:gone])
            del self._kept[:gone]

    def at(self, t: float | None) -> Snapshot | None:
        if t is None:
            return self._kept[-1] if self._kept else None
        k = bisect_right(self._kept, t, key=lambda each: each.t)
        return self._kept[k - 1] if k else None


WAITING = 8192
"""Snapshots that wait for the server's thread; more than that are missing in the history only."""

TELL_EVERY = 1.0
"""How often pages are told the shares of a run that goes on [s]; a verdict that changes, at once."""


RATE = 100.0
"""Snapshots that a page is sent a second: each tick of an ordinary run."""
AFTER, LATE = 5e-4, 2e-3
"""So long after a tick is expected its snapshot is looked for, and so often while it is late [s]."""
OLD = 0.25
"""A snapshot that waited longer before it could be shown, or was computed across such a pause of the whole
process, is not the present any more [s]: it goes into the history only."""


class Live:
    """Takes snapshots from any one thread without ever making it wait.

    A live view cannot be paused, sought or slowed down: the world does not wait. A page may hold
    its own picture still. Whoever asks is told the truth, `Transport.live`.

    Args:
        rate: Frames sent per second at most [1/s].
    """

    mode = "live"
    duration = None

    def __init__(self, *, rate: float = RATE) -> None:
        self._pause = 1.0 / rate
        self._inbox: deque[tuple[Snapshot, float]] = deque(maxlen=WAITING)
        self._published: tuple[float, float] | None = None
        self._every = inf
        """Run time from the last snapshot but one to the last [s]."""
        self._slow = 0.0
        self._past = Past()
        self._seen = _Seen()
        self._newest = 0.0
        self._finished = False
        self.log: ResultLog | None = None
        """Of the run, which adds to it in its own thread."""

    def publish(self, snapshot: Snapshot) -> None:
        """Hand over what is now; returns at once."""
        # The server's thread comes and looks. Waking it would be a system call, after which this
        # thread may have to wait for the interpreter's lock: 5 ms of a 10 ms tick.
        now, interrupted = monotonic(), False
        if self._published is not None:
            pause = now - self._published[1] - max(snapshot.t - self._published[0], 0.0)
            # One that always takes about so long is slow, not interrupted.
            interrupted, self._slow = pause > max(OLD, 2 * self._slow), pause
            self._every = snapshot.t - self._published[0]
        self._published = snapshot.t, now
        self._inbox.append((snapshot, -inf if interrupted else now))

    def finish(self) -> None:
        """Say that no more will come, so that no page takes the last picture for the present."""
        self._finished = True

    def history(self) -> History:
        """What happened so far."""
        return self._past.history()

    def so_far(self) -> SoFar | None:
        """What the run came to by now."""
        return None if self.log is None else self.log.so_far(whole=self._finished)

    def seen_at(self, t: float | None) -> Snapshot | None:
        """What was shown at an instant of the last minutes, or is now."""
        return self._seen.at(t)

    def transport(self) -> Transport:
        """Always live; not playing once the run has ended."""
        return Transport(playing=not self._finished, t=self._newest, live=True)

    def command(self, command: Command) -> None:
        """Nothing that a page asks for can be done to the present."""

    async def run(self, audience: Audience) -> None:
        """Show the newest, at most ``rate`` times a second, until cancelled."""
        said_finished = False
        last: Snapshot | None = None
        sent: tuple[object, ...] = ()
        again = 0.0
        while True:
            finished = self._finished  # before looking: what was published earlier comes first
            newest, then = None, -inf
            for _ in range(len(self._inbox)):
                newest, then = self._inbox.popleft()
                self._past.add(newest)
            if newest is not None:
                last = newest
                self._newest = newest.t
                if finished or monotonic() - then <= OLD:
                    self._seen.add(newest)
                    audience.show(newest, inf if finished else then + OLD)
                self._past.tidy()
            now = monotonic()
            if (
                self.log is not None
                and (verdicts := (*self.log.verdicts(), len(self.log.events))) != (0,)
                and (verdicts != sent or now > again or (finished and not said_finished))
            ):
                sent, again = verdicts, now + TELL_EVERY
                audience.tell(self.log.so_far(whole=finished))
            if finished and not said_finished:
                audience.tell(self.transport())
                if last is not None:
                    audience.show(last)
                said_finished = True
            await asyncio.sleep(self._next_look())

    def _next_look(self) -> float:
        """How long until the next snapshot is likely to be there [s].

        Whoever looks soon after each tick shows it young, and mostly while the run waits for its next one.
        """
        if self._published is None:
            return self._pause
        wait = self._published[1] + max(self._every, self._pause) + AFTER - monotonic()
        if wait > 0.0:
            return min(wait, 2 * self._pause)
        return min(LATE, self._pause) if wait > -self._pause else 2 * self._pause


class Shown(Closing):
    """A run as pages see it: an open `seerob.outputs.sink.Writer` that hands each tick to a feed.

    Args:
        live: The feed.
        offers: What headsets that show a page see: `Station.run` hands it to the sources that take it.
    """

    def __init__(self, live: Live, offers: Offers) -> None:
        self._live = live
        self.offers = offers

    def write(self, snapshot: Snapshot, samples: tuple[Sample, ...]) -> None:
        """Show one tick; never waits for a page."""
        self._live.publish(snapshot)

    def share(self, log: ResultLog) -> None:
        """Show what the run comes to, too."""
        self._live.log = log

    def close(self) -> None:
        """Say that no more comes."""
        self._live.finish()


class LiveView(Shown):
    """The live view as a sink: an open `seerob.outputs.sink.Writer` that pages in a browser look at.

    Args:
        scene: What does not change during the run.
        meshes: Binary glTF per mesh hash of the scene's nodes.
        host: Address to listen on; anything but this machine's own needs tokens, and TLS or ``clear_text``.
        port: Port; 0 is any free one, a taken one moves to the next free.
        tokens: What visitors must know, by role.
        tls: Encrypts.
        clear_text: Whether others may be served unencrypted.
        ruler: By which pages measure; None where they do not.
        cameras: Network cameras whose pictures are handed on.

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
        tokens: Tokens | None = None,
        tls: Tls | None = None,
        clear_text: bool = False,
        ruler: Ruler | None = None,
        cameras: Cameras | None = None,
    ) -> None:
        live = Live()
        self.server = Server(
            scene=scene,
            meshes=meshes,
            feed=live,
            host=host,
            port=port,
            tokens=tokens,
            tls=tls,
            clear_text=clear_text,
            ruler=None if ruler is None else lambda: ruler,
            cameras=cameras,
        )
        super().__init__(live, self.server.offers)
        self.url = self.server.start()
        """What to open in a browser."""

    def finish(self) -> None:
        """The run is over; pages may go on looking at what happened until `close`."""
        self._live.finish()

    def close(self) -> None:
        """Stop the server."""
        self.server.stop()
