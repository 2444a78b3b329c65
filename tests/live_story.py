"""What happens in a live run, kept tick by tick: tests import it as ``from live_story import …``."""

from __future__ import annotations

import math
import os
import time

import numpy as np

from seerob.samples import JointSample


class Story:
    """Keeps what goes out, and does things to the server at given ticks."""

    def __init__(self, ticks, enough=lambda story: True, **deeds):
        self.ticks, self.deeds = ticks, {int(k.removeprefix("at_")): deed for k, deed in deeds.items()}
        self.snapshots, self.heard, self.enough = [], [], enough

    def write(self, snapshot, samples):
        self.snapshots.append(snapshot)
        self.heard.append(samples)
        self.deeds.get(len(self.snapshots), lambda: None)()

    def stop(self):
        ticks = len(self.snapshots)
        return ticks >= self.ticks and (self.enough(self) or ticks >= 30 * self.ticks)

    def close(self):
        pass

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def joints(self):
        return [s for samples in self.heard for s in samples if isinstance(s, JointSample)]

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
        """Per tick, whether it lies between samples and the device's clock is known well by then."""
        # The first samples may have waited for a busy machine.
        offset = np.median([s.t - s.t_device for s in self.joints()])
        settled = next(s.t for s in self.joints() if s.t - s.t_device < offset + 0.002)
        return self.ahead() & np.array([s.t > settled for s in self.snapshots]), offset

    def seen_enough(self):
        """Whether many ticks lie between samples: on a busy machine that takes longer."""
        return bool(self.joints()) and self.between()[0].sum() > 20

    def check_that_it_follows(self, motion):
        """What lies between samples is where the device was, and what is decided is never far from it."""
        between, offset = self.between()
        joints = np.array([s.joints["arm"] for s in self.snapshots])
        there = np.array([motion(s.t - offset)[0] for s in self.snapshots])
        errors = np.abs(there - joints).max(axis=1)
        first = int(np.argmax(between))
        decided = np.array(self.verdicts()[first:]) == "within"
        assert between.sum() > 20
        assert decided.any()
        assert np.median(errors[between]) < 1e-3
        # At 0.5 rad/s it is the time-out of 0.2 s: what is later is undecided.
        assert errors[first:][decided].max() < 0.11

    def fastest(self, first=0):
        """Largest speed that was claimed [m/s]."""
        return max(s.results[0].value or 0.0 for s in self.snapshots[first:])


def lived(station, story, **more):
    station.run(live=True, writers=[story], stop=story.stop, **more)
    return story


def open_files():
    return len(os.listdir("/proc/self/fd"))


def wait_for(true, seconds=10.0):
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end
        time.sleep(0.002)
