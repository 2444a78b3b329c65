r"""A device's clock on the host's: the offset between both, from what arrives, and what it is worth.

A sample that the device stamped :math:`t_d` arrives at host time :math:`t_h = t_d + o + \lambda` with an
offset :math:`o` and a latency :math:`\lambda \ge 0`. The smallest :math:`t_h - t_d` bounds the offset from
above by the least latency, so :math:`t_d + \min(t_h - t_d)` is when the sample was taken, free of the jitter
of the way, and never later than it arrived. What is over that least one is how late a sample is.

The minimum may fall at once, by whatever came faster than anything before. It rises no faster than clocks
drift (`DRIFT`), through silences and connections alike: a delay that lasts stays a delay. What is made of it
moves smoothly (`SLEW`), so that intervals between samples never collapse.

Time that goes back, by which a sample would be late by less than `BUFFERED`, is that of the same clock: it
comes out of a buffer on the way, and is no news until it is newer than what was heard. Whoever started again
so soon looks the same, but for one thing: at an instant that was heard the old clock said one thing and the
new one says another (`OTHERWISE`). Without that proof it stays as late as it seems. Time that goes back
farther is a restart once, and a loop after that; datagrams that say again what was said at that time are a
recording.
"""

from __future__ import annotations

import math
import random
from typing import NamedTuple

DRIFT = 2e-4
"""Fastest rise of the offset [s/s]: the quartz clocks of controllers and computers are each within 100 ppm of
true time (usual data sheets: 20 to 100 ppm), two of them drift apart by 200 ppm at most. A delay that grows
more slowly than this cannot be told from drift."""
SLEW = 0.01
"""How fast the instants of samples are shifted after the offset fell, by the device's time [s/s]: speeds are
off by as much."""
SETTLED = 0.005
"""Nearer to what the offset was found to be, instants are relied on [s]: a quarter of a tick's usual delay
behind the world. Farther away they are shifted ten times as fast, and nothing is relied on."""
STEP = 0.02
"""Above it the offset does not slew but step, and only when the next sample says so too [s]: no sample of an
ordinary network is so much faster than all before, one stamp that is wrong looks just so."""
REORDERED = 0.25
"""A stamp that lies back by less was overtaken on the way, or sent twice [s]; it is no news."""
HOLD = 0.5
"""Nothing is relied on for so long after a clock stepped or went back [s]: the twin swings to where the
device is, as after a slip (`seerob.devices.live.receivers.SETTLE`)."""
RESTART_HOLD = 2.5
"""Nothing is relied on for so long after a device started again [s]. A recording that starts again and
repeats what it said in the last seconds goes back once more within it; a device that was switched on does
not."""
AGAIN = 60.0
"""A clock that starts again twice within this time is followed, and not relied on for as long [s]: no
controller is switched on so often."""
BUFFERED = 10.0
"""What is late by less, by the clock from before, comes out of a buffer on the way [s]: controllers take
longer to be switched on. No time that passes tells both apart: whoever takes from a queue as fast as it is
filled stays behind for good."""
MAY_BE_LATE = ": a buffer on the way, or has it started again?"
OTHERWISE = 5
"""So many samples one after another that say something else than was said at their instants are of another
clock [-]: one that is garbled, or has the stamp of its neighbour, does now and then."""
KEPT = 16384
"""Stamps of which it is known what was said with them: half a minute of the fastest source."""
MARKED, MARK_EVERY = 1 << 15, 1.0
"""Of so many stamps that is known for hours, one within that time [s], which is below `RESTART_HOLD`: a
recording of what was heard is found out however long it is."""
LATEST = 1e12
"""No clock counts further [s]: what is later or not finite is no instant."""
AFTER = 1e-6
"""Between an instant and the next one where the clock has stepped back [s]."""


class Instant(NamedTuple):
    """When a sample was taken."""

    t: float | None
    """On the host's clock [s]; None for what is no news: not newer than what was heard before."""
    invalid_reason: str = ""
    """Why the device's time may not be relied on now; empty when it may."""


class ClockState(NamedTuple):
    """What is known of a device's clock, for whoever listens to it next."""

    offset: float
    """Host time less device time [s]."""
    device: float
    """Newest stamp [s]."""
    host: float
    """When that was, on the host's monotonic clock [s]."""


class DeviceClock:
    """Estimates when, on the host's clock, a device took its samples.

    Args:
        known: What another listener knew of it: a delay that lasts stays one.

    Attributes:
        latency: How much later than the fastest one of late the newest sample arrived [s].
    """

    def __init__(self, known: ClockState | None = None) -> None:
        self._newest = -math.inf
        """Stamp of the newest sample."""
        self._host = 0.0
        """When the last one arrived."""
        self._offset = math.inf
        """Least host time less device time, as far as clocks do not drift."""
        self._applied = math.inf
        """What samples are shifted by: it follows the offset."""
        self._last = -math.inf
        """Instant of the newest sample."""
        self._ahead: float | None = None
        """Host time less device time of a sample that was ahead of its time, and not yet believed."""
        self._connected = True
        """Nothing was heard since it has connected."""
        self._restarted = -math.inf
        """When it last started again."""
        self._before: ClockState | None = None
        """Its clock before that, while it may be the same one."""
        self._otherwise, self._last_otherwise = 0, -math.inf
        """How often it said something else at an instant that was heard, since there was news; when last."""
        self._content = 0
        """What was said last."""
        self._said: dict[float, int] = {}
        self._marks: dict[float, int] = {}
        """What `_said` has, of a few."""
        self._next_mark = -math.inf
        self._reason, self._until = "", -math.inf
        self.latency = 0.0
        if known is not None:
            self._offset = self._applied = known.offset
            self._newest, self._host = known.device, known.host

    def reconnect(self) -> None:
        """It has connected anew: its clock may have started again, and else goes on."""
        self._connected = True

    @property
    def offset(self) -> float | None:
        """Host time less device time [s], too large by the least latency; None before anything arrived."""
        return self._offset if math.isfinite(self._offset) else None

    def hear(self, device: float, host: float, said: int = 0, *, forgeable: bool = False) -> Instant:
        """When a sample was taken.

        Args:
            device: Its device time [s].
            host: When it arrived, on the host's monotonic clock [s].
            said: What tells its content from that of others: a hash.
            forgeable: Whether anybody can send it, as with datagrams: who says again what was said is then no
                device that starts again, also after a silence.

        Returns:
            At most ``host``, but for `SETTLED` where the offset fell just now.
        """
        if not abs(device) <= LATEST:
            return Instant(None)
        if device <= self._newest and not self._is_restart(device, host, said):
            return Instant(None, self._standing(host))
        raw = host - device
        if not math.isfinite(self._offset):
            self._offset = self._applied = raw
        elif not self._follow(raw, host, device - self._newest):
            return Instant(None, self._standing(host))
        elif self._ahead is not None and device - self._newest > REORDERED:
            # What came very late over a new connection looked like a restart: time leaps on from it.
            self._resume(raw, host)
        elif host - self._restarted < AGAIN:
            self._resume(raw, host)
        self._connected = False
        self._otherwise, self._last_otherwise = 0, -math.inf
        self._newest, self._host = device, max(host, self._host)
        again = said in (self._said.get(device), self._marks.get(device))
        if again and (forgeable or said != self._content):
            # Of a connection that nobody forges, what stands may say the same; what moves does not.
            self._hold(host, AGAIN, "says again what it said before: is a recording played to it?")
        self.latency = raw - self._offset
        self._remember(device, said)
        t = device + self._applied
        if t <= self._last:
            # The clock has stepped back: what comes is news all the same, and nothing is relied on.
            t = self._last + AFTER
            self._hold(host, HOLD, self._standing(host))
        self._last = max(self._last, t)
        return Instant(t, self._standing(host))

    def _resume(self, raw: float, host: float) -> None:
        """Go on by the clock from before: it has not started again, what it says came out of a buffer."""
        if self._before is None:
            return
        risen = self._before.offset + DRIFT * (host - self._before.host)
        if raw - risen < BUFFERED - STEP:
            self._before = None
            self._offset = self._applied = min(self._offset, risen)

    def _remember(self, device: float, said: int) -> None:
        """Keep what is said at a time for a while, and now and then for hours: when, no player can know."""
        self._content = said
        _keep(self._said, KEPT, device, said)
        if device >= self._next_mark:
            _keep(self._marks, MARKED, device, said)
            self._next_mark = device + MARK_EVERY * random.uniform(0.5, 1.0)  # noqa: S311 - no secret

    def _follow(self, raw: float, host: float, interval: float) -> bool:
        """Let the offset follow; False for a sample that is ahead of its time and is not believed yet.

        Args:
            raw: Host time less device time [s].
            host: When it arrived [s].
            interval: On the device's clock, since the newest sample [s]: what was held back on the way comes
                all at once, and is not shifted for the time that it waited.
        """
        passed = max(0.0, host - self._host)
        risen = self._offset + DRIFT * passed
        if raw < self._offset - STEP:
            ahead, self._ahead = self._ahead, raw
            why = f"its time stamps are {self._offset - raw:.3g} s ahead of what its clock was"
            self._hold(host, HOLD, why)
            if ahead is None:
                return False
            raw = max(ahead, raw)
        else:
            self._ahead = None
        self._offset = min(risen, raw)
        off = self._applied - self._offset
        if off > STEP:
            self._applied = self._offset
            if self._ahead is None:
                self._hold(host, HOLD, f"its clock was found {1e3 * off:.0f} ms off")
        elif off > SETTLED:
            self._applied -= min(off, 10 * SLEW * interval)
            self._hold(host, 0.0, f"its clock is being found: {1e3 * off:.0f} ms off")
        elif off > 0:
            self._applied -= min(off, SLEW * interval)
        else:
            self._applied = self._offset
        return True

    def _is_restart(self, device: float, host: float, said: int) -> bool:
        """Whether time that does not go on is that of a device which started again; else it is no news."""
        back = self._newest - device
        if back <= REORDERED:
            return False
        before = self._said.get(device)
        if before == said:
            self._otherwise = 0
            if not self._connected:
                why = f"says again what it said {back:.3g} s before: is a recording played to it?"
                self._hold(host, HOLD, why)
                return False
        elif before is not None and device > self._last_otherwise:
            self._otherwise, self._last_otherwise = self._otherwise + 1, device
        late = host - device - self._offset - DRIFT * max(0.0, host - self._host)
        if late < BUFFERED and self._otherwise < OTHERWISE:
            # Who is told of it is told once.
            why = f"its time went back by {back:.3g} s{MAY_BE_LATE}"
            standing = self._standing(host)
            self._hold(host, HOLD, standing if standing.endswith(MAY_BE_LATE) else why)
            return False
        if host - self._restarted < AGAIN:
            why = f"its time went back by {back:.3g} s, not for the first time within {AGAIN:g} s: a loop?"
            self._hold(host, AGAIN, why)
        else:
            why = f"its time went back by {back:.3g} s: it seems to have started again"
            self._hold(host, RESTART_HOLD, why)
        if late < BUFFERED:
            self._before = None
        elif self._before is None or host - self._restarted > RESTART_HOLD:
            self._before = ClockState(self._offset, self._newest, self._host)
        self._restarted = host
        self._offset = self._applied = math.inf
        self._ahead = None
        self._next_mark = -math.inf
        return True

    def _hold(self, host: float, seconds: float, why: str) -> None:
        if not self._standing(host) or host + seconds >= self._until:
            self._reason, self._until = why, host + seconds

    def _standing(self, host: float) -> str:
        """The doubt that holds at ``host`` [s]."""
        return self._reason if host <= self._until else ""


def _keep(known: dict[float, int], most: int, device: float, said: int) -> None:
    known.pop(device, None)
    if len(known) >= most:
        del known[next(iter(known))]
    known[device] = said
