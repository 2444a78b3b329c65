"""Writers that keep what a run says: tests import them as ``from kept_run import …``."""

from __future__ import annotations

import math
import time

from seerob.outputs.sink import Closing


class Kept(Closing):
    """Keeps every snapshot, and what was heard for it."""

    def __init__(self):
        self.snapshots, self.heard = [], []

    def write(self, snapshot, samples):
        self.snapshots.append(snapshot)
        self.heard.append(samples)


class Chapters(Closing):
    """Waits for what a chapter is to show, then does what begins the next.

    Args:
        chapters: Pairs of a condition, asked with each snapshot, and a deed once it is so.
        patience: With one chapter [s], on the slowest machine; the first begins with the run, after all
            that is compiled for it.
    """

    def __init__(self, *chapters, patience=120.0):
        self._chapters, self._patience = list(chapters), patience
        self._end = math.inf
        self._last = ()
        self.reasons = {}

    def write(self, snapshot, samples):
        self._last = snapshot.results
        self._end = min(self._end, time.monotonic() + self._patience)
        if self._chapters and self._chapters[0][0](snapshot):
            _, deed = self._chapters.pop(0)
            self.reasons |= {r.name: r.reason for r in self._last if r.verdict == "undecided"}
            deed()
            self._end = time.monotonic() + self._patience

    def stop(self):
        now = [(r.name, r.value, r.verdict, r.reason) for r in self._last]
        assert time.monotonic() < self._end, now
        return not self._chapters
