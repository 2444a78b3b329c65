"""Live sources that another process can be told: of a module that it finds, and with nothing of a test."""

from __future__ import annotations

import asyncio
import logging
import os
import sys
import time
from pathlib import Path

import numpy as np

from seerob.core.samples import JointSample, SignalSample
from seerob.devices.live.listening import LiveSource
from seerob.devices.live.receivers import Receivers

_log = logging.getLogger("scripted")


class Scripted(LiveSource, frozen=True, kw_only=True):
    """Says on and on where an arm is, and in which process it listens."""

    robot: str = "arm"

    def target(self):
        return self.robot

    def period(self):
        return 0.005

    async def listen(self, target):
        _log.info("one line\nand another")
        print("a library that prints")
        yield SignalSample(source="", seq=0, t=time.monotonic(), values={"process": os.getpid()})
        while True:
            yield JointSample(source="", seq=0, target=self.robot, t=time.monotonic(), q=(np.float64(0.5),))
            await asyncio.sleep(0.001)


class Delayed(Scripted, frozen=True, kw_only=True):
    """What the next process hears is on its way for 0.8 s; a file tells that there was one before."""

    been: str

    async def listen(self, target):
        late = 0.8 * Path(self.been).exists()
        Path(self.been).touch()
        await asyncio.sleep(late)
        yield SignalSample(source="", seq=0, t=time.monotonic(), values={"process": os.getpid()})
        k = 0
        while True:
            now, k = time.monotonic(), k + 1
            yield JointSample(
                source="", seq=0, target=self.robot, t=now, t_device=now - late - 900, q=(1e-3 * (k % 2),)
            )
            await asyncio.sleep(0.002)


class AtOnce(Scripted, frozen=True, kw_only=True):
    """Says a lot before anybody can take it."""

    async def listen(self, target):
        for k in range(1000):
            yield JointSample(source="", seq=0, target="arm", t=time.monotonic(), q=(float(k),))
        await asyncio.sleep(60)


class Mistaken(Scripted, frozen=True, kw_only=True):
    """Has a mistake."""

    async def listen(self, target):
        raise KeyError("gone")
        yield


class Stubborn(Scripted, frozen=True, kw_only=True):
    """Holds the interpreter when it is to end."""

    async def listen(self, target):
        yield JointSample(source="", seq=0, target="arm", t=time.monotonic(), q=(0.0,))
        time.sleep(60)


class Large(Scripted, frozen=True, kw_only=True):
    """Says more than there is room for."""

    async def listen(self, target):
        yield SignalSample(source="", seq=0, t=time.monotonic(), values={"text": "x" * 200_000})


class Missing(Scripted, frozen=True, kw_only=True):
    """Is not known where it is told."""

    def __reduce__(self):
        return _only_here, (os.getpid(),)


def _only_here(process):
    if os.getpid() != process:
        raise ModuleNotFoundError("No module named 'of_a_notebook'")
    return Missing()


def run():
    """A run that waits to be killed; prints who listens for it."""
    with Receivers([(Scripted(), None)]) as listening:
        while not (pid := [s.values["process"] for s in listening.take() if isinstance(s, SignalSample)]):
            time.sleep(0.01)
        print(int(pid[0]), flush=True)
        sys.stdin.read()
