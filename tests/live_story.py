"""What happens in a live run, kept tick by tick: tests import it as ``from live_story import …``."""

from __future__ import annotations

import os
import time

import numpy as np

from seerob.samples import JointSample


class Story:
    """Keeps what goes out, and does things to the server at given ticks."""

    def __init__(self, ticks, **deeds):
        self.ticks, self.deeds = ticks, {int(k.removeprefix("at_")): deed for k, deed in deeds.items()}
        self.snapshots, self.heard = [], []

    def write(self, snapshot, samples):
        self.snapshots.append(snapshot)
        self.heard.append(samples)
        self.deeds.get(len(self.snapshots), lambda: None)()

    def stop(self):
        return len(self.snapshots) >= self.ticks

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
        """Share of the ticks that are decided: a busy machine may be late for one now and then."""
        return np.mean([verdict == "within" for verdict in self.verdicts()[first:]])

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
