"""Live source of a company: a controller that sends a line of JSON per instant over TCP."""

from __future__ import annotations

import asyncio
import json
import time
from collections.abc import AsyncGenerator
from typing import Annotated

from msgspec import Meta

from seerob.api import JointSample, LiveSource, Sample, SeerobError, Target

LARGEST_LINE = 4096
"""Longest line that is waited for [bytes]."""
SILENCE = 1.0
"""Longest pause before the controller is taken for gone [s]."""


class CellController(LiveSource, frozen=True, kw_only=True):
    """A robot whose controller sends ``{"t": 12.34, "q": […], "qd": […]}``, in seconds, rad and rad/s."""

    robot: str
    """The robot it drives."""
    port: Annotated[int, Meta(ge=1, le=65535)]
    """Where it listens."""
    host: str = "127.0.0.1"
    """Its address."""
    frequency: Annotated[float, Meta(ge=1, le=1000, extra={"unit": "Hz"})] = 100.0
    """Lines per second [Hz]."""

    def target(self) -> str:
        """Name the robot: who is driven is checked before anybody listens."""
        return self.robot

    def period(self) -> float:
        """Interval between samples that is expected [s]."""
        return 1 / self.frequency

    async def listen(self, target: Target | None) -> AsyncGenerator[Sample, None]:
        """Connect, and yield what is heard until the connection ends; then it is called again.

        Raises:
            OSError: There is no connection, or no longer, or nothing is heard for a second.
            SeerobError: A line cannot be understood.
        """
        reader, writer = await asyncio.open_connection(self.host, self.port, limit=LARGEST_LINE)
        try:
            while line := await asyncio.wait_for(reader.readline(), SILENCE):
                arrived = time.monotonic()
                try:
                    said = json.loads(line)
                    t, q, qd = float(said["t"]), tuple(map(float, said["q"])), tuple(map(float, said["qd"]))
                except (ValueError, TypeError, KeyError) as error:
                    raise SeerobError(f"not a line of this controller: {error}") from error
                # Numbers that are none, too few of them, and time that goes back are looked at in every run.
                yield JointSample(source="", seq=0, t=arrived, t_device=t, target=self.robot, q=q, qd=qd)
            raise ConnectionError("the controller closed the connection")
        finally:
            writer.close()
