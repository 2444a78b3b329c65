"""A live run whose packets a test sends as it likes: tests import it as ``from live_stream import …``.

Everything between socket and verdict is what a run has: the listener with its clock and its checks, the
mailbox in which the newest wins, run time, the engine, the criteria. Only the time is the test's own.
"""

from __future__ import annotations

from types import SimpleNamespace

from seerob.core.samples import JointSample, Mailbox
from seerob.devices.live import receivers
from seerob.devices.live.listening import Listener, delay_of
from seerob.devices.live.receivers import Clock, hear
from seerob.session.run import Judge, bind, engine_of

BEGIN = 1000.0
"""Host's monotonic time when packets begin [s]."""
OFFSET = -900.0
"""Device time less the host's [s]."""
COMPUTES = 0.003
"""How long a tick takes [s]."""


class Stream:
    """One live source of a run.

    Args:
        station: With that source alone.
        patch: pytest's, for the time.
        target: Who it moves.
        packets: Arrival [s], device time [s] and what is said, in order of arrival.
        pauses: Tick → how long the run is held still in front of it [s].
        again: When the connection is made anew [s].
    """

    def __init__(self, station, patch, target, packets, *, pauses=None, again=()):
        self.now = BEGIN
        patch.setattr(receivers, "time", SimpleNamespace(monotonic=lambda: self.now, sleep=self._sleep))
        (source,) = station.workstation.sources
        self.box = Mailbox()
        self.listener = Listener(source, None, self.box.post, waits=self.box.waits)
        self.delay = delay_of([source])
        self.target, self.packets, self.again = target, list(packets), list(again)
        self.pauses = pauses or {}
        self.clock = Clock()
        self.station = station

    def _sleep(self, seconds):
        self.now += seconds

    def first(self):
        self.now += 0.05
        return self.take()

    def take(self):
        while self.packets and self.packets[0][0] <= self.now - BEGIN:
            arrived, device, (q, qd) = self.packets.pop(0)
            while self.again and self.again[0] <= arrived:
                self.again.pop(0)
                self.listener._clock.reconnect()
            self.listener.take(
                JointSample(
                    source="", seq=0, target=self.target, t=BEGIN + arrived, t_device=device,
                    q=tuple(q), qd=None if qd is None else tuple(qd),
                )
            )  # fmt: skip
        return self.box.take()

    def ticks(self, count):
        """Per tick: the twin, what every criterion says, and the device time of what it shows [s]."""
        model = self.station.model
        tick = model.workstation.engine.tick
        engine, judge = engine_of(model), Judge(bind(model))
        feed = hear(iter(lambda: (), None), self, self.clock)
        for k in range(count):
            self.now += self.pauses.get(k, 0.0)
            engine.take(next(feed))
            state = engine.tick() if k else engine.start()
            yield state, judge(state), self.clock.start - self.delay + state.t + OFFSET
            self.now += COMPUTES
            self.clock.wait(state.t + tick)
