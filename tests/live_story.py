"""What happens in a live run, kept tick by tick: tests import it as ``from live_story import …``."""

from __future__ import annotations

import math
import os
import threading
import time
from contextlib import contextmanager

import numpy as np

from kept_run import Kept
from seerob.core.samples import JointSample
from seerob.devices.live.listening import Listener
from seerob.devices.live.receivers import SETTLE


class Story(Kept):
    """Keeps what goes out, and does things to the server at given ticks, or once it is within a limit."""

    def __init__(self, ticks, enough=lambda story: True, *, once_within=None, **deeds):
        self.ticks, self.deeds = ticks, {int(k.removeprefix("at_")): deed for k, deed in deeds.items()}
        super().__init__()
        self.enough, self.once_within, self.done = enough, once_within, 0
        """The tick in which that was done; those asked for are counted from there."""

    def write(self, snapshot, samples):
        super().write(snapshot, samples)
        self.deeds.get(len(self.snapshots), lambda: None)()
        if self.once_within and snapshot.results[0].verdict == "within":
            self.once_within()
            self.once_within, self.done = None, len(self.snapshots)

    def stop(self):
        ticks = len(self.snapshots) - self.done
        if ticks < self.ticks:
            return False
        # Asked now and then: it looks at everything that was heard.
        enough = ticks % 20 == 0 and not self.once_within and self.enough(self)
        return ticks >= 30 * self.ticks or enough

    def joints(self):
        return [s for samples in self.heard for s in samples if isinstance(s, JointSample)]

    def lost(self, stopped):
        """First tick from this one on that says so; on a busy machine what comes late is lost before, too."""
        return next(
            k for k, s in enumerate(self.snapshots) if k >= stopped and "not heard for" in s.results[0].reason
        )

    def verdicts(self):
        return [s.results[0].verdict for s in self.snapshots]

    def decided(self, first=0):
        """How many ticks are decided: on a busy machine samples are late, and it must not matter how many."""
        return sum(verdict == "within" for verdict in self.verdicts()[first:])

    def ahead(self):
        """Per tick, whether a sample lies behind what is shown and one ahead of it."""
        newest, found = -math.inf, []
        for snapshot, samples in zip(self.snapshots, self.heard, strict=True):
            newest = max([newest, *(s.t for s in samples if isinstance(s, JointSample))])
            found.append(newest >= snapshot.t)
        return np.array(found)

    def between(self):
        """Per tick: whether samples lie on either side that agree about the device's clock, and its time.

        The offset between both clocks becomes better known as a run goes on, and run time may slip on a
        busy machine: only what the samples on either side say holds for a tick, once the twin has had the
        time to swing to it.
        """
        heard = []
        found = np.zeros(len(self.snapshots), bool)
        device = np.full(len(self.snapshots), np.nan)
        for k, (snapshot, samples) in enumerate(zip(self.snapshots, self.heard, strict=True)):
            heard += [(s.t, s.t - s.t_device) for s in samples if isinstance(s, JointSample)]
            before = next((offset for t, offset in reversed(heard) if t <= snapshot.t), None)
            after = next((offset for t, offset in heard[-50:] if t >= snapshot.t), None)
            if before is not None:
                device[k] = snapshot.t - before
                of_late = [offset for t, offset in heard if t >= snapshot.t - SETTLE]
                found[k] = after is not None and max(of_late) - min(of_late) < 5e-4
        return found, device

    def seen_enough(self):
        """Whether many ticks lie between samples: on a busy machine that takes longer."""
        return self.between()[0].sum() > 20 and self.decided() > 0

    def check_that_it_follows(self, motion):
        """What lies between samples is where the device was, and what is decided is never far from it."""
        between, device = self.between()
        joints = np.array([s.joints["arm"] for s in self.snapshots])
        known = np.isfinite(device)
        errors = np.full(len(known), np.nan)
        there = np.array([motion(t)[0] for t in device[known]])
        errors[known] = np.abs(there - joints[known]).max(axis=1)
        decided = np.array(self.verdicts()) == "within"
        assert between.sum() > 20
        assert decided.any()
        assert known[decided].all()
        assert np.median(errors[between]) < 1e-3
        # At 0.5 rad/s it is the time-out of 0.2 s: what is later is undecided.
        assert errors[decided].max() < 0.11

    def fastest(self, first=0):
        """Largest speed that was claimed [m/s]."""
        return max(s.results[0].value or 0.0 for s in self.snapshots[first:])


def lived(station, story, **more):
    station.run(live=True, writers=[story], stop=story.stop, **more)
    return story


@contextmanager
def listening(source, target=None):
    """What a source says while it is listened to; its end is waited for."""
    heard = []
    listener = Listener(source, target, heard.append)
    listener.start()
    try:
        yield heard
    finally:
        listener.ask_to_stop()
        assert listener.join(30)


def elsewhere(server, motion):
    """Switch a device on whose robot was moved meanwhile: at the same times of its clock it is elsewhere."""
    server.motion = lambda t: motion(t + 1.0)
    server.start()


def open_files():
    return len(os.listdir("/proc/self/fd"))


def own_threads():
    """How many there are, but for those in which a loop resolves names: it keeps up to six."""
    return sum(not thread.name.startswith("asyncio_") for thread in threading.enumerate())


def wait_for(true, seconds=120.0):
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end
        time.sleep(0.002)
