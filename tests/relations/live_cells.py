"""Random cells whose robot is heard live, through a stream that is spoiled on its way.

Tests import it as ``from live_cells import …``. What is true, the same cell says of a log without any flaw.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from random_cells import ALL, Cell, said, station, truth

from live_stream import BEGIN, OFFSET, Stream
from seerob.core.snapshot import Verdict

SECONDS = 1.6
"""Of the stream [s]."""
WAY = 0.001
"""From the device to here [s]."""
SILENT = 0.2
"""How long a robot may go on as it went, while nobody hears it, before it is not relied on [s]."""
FIGURES = "speed", "fastest", "energy", "distance", "separation"
"""Criteria whose figures are compared."""
LIMITED = {"speed": "speed", "fastest": "speed", "energy": "energy", "distance": "distance"}
"""By which limit of a cell."""
CLEARLY = 0.05
"""Share of a limit beyond which a figure exceeds it, whatever little a live twin is off [1]."""
Packets = list[tuple[float, float, tuple[np.ndarray, np.ndarray | None]]]


class Spoiling(NamedTuple):
    """A stream on its way, and what else happens to the run."""

    packets: Packets
    pauses: dict[int, float] = {}  # noqa: RUF012
    again: tuple[float, ...] = ()


def dropped(rng: np.random.Generator, packets: Packets) -> Spoiling:
    share = rng.uniform(0.1, 0.95)
    return Spoiling([p for p in packets if rng.random() > share])


def delayed(rng: np.random.Generator, packets: Packets) -> Spoiling:
    """For good or for a while, growing, or by chance; each stays in its order."""
    since, by, grows = rng.uniform(0.2, 1.0), rng.choice([0.05, 0.15, 0.5]), rng.uniform(0.0, 0.3)
    scale = rng.choice([0.0, 0.003, 0.02])
    for_good = bool(rng.random() < 0.5)
    found, last = [], 0.0
    for at, device, words in packets:
        late = by * (at > since and (for_good or at < since + 0.3)) + grows * max(0.0, at - since)
        last = max(last, at + late + rng.exponential(1.0) * scale)
        found.append((last, device, words))
    return Spoiling(found, again=(since + 0.1,) if rng.random() < 0.3 else ())


def doubled(rng: np.random.Generator, packets: Packets) -> Spoiling:
    late = rng.uniform(0.0, 0.2)
    return Spoiling(sorted([*packets, *((p[0] + late, *p[1:]) for p in packets)], key=lambda p: p[0]))


def shuffled(rng: np.random.Generator, packets: Packets) -> Spoiling:
    found = list(packets)
    for k in range(0, len(found) - 4, 4):
        four = found[k : k + 4]
        found[k : k + 4] = [(four[3][0], *four[j][1:]) for j in rng.permutation(4)]
    return Spoiling(found)


def noisy(rng: np.random.Generator, packets: Packets) -> Spoiling:
    """Of half of the devices the velocities are not heard."""
    sigma, rates = 10 ** rng.uniform(-5, -3.5), bool(rng.random() < 0.5)
    found: Packets = []
    for at, device, (q, qd) in packets:
        found.append((at, device, (q + rng.normal(0.0, sigma, q.shape), qd if rates else None)))
    return Spoiling(found)


def paused(rng: np.random.Generator, packets: Packets) -> Spoiling:
    ticks = rng.integers(20, 140, 3)
    return Spoiling(packets, {int(k): float(rng.uniform(0.05, 0.5)) for k in ticks})


def played_again(rng: np.random.Generator, packets: Packets) -> Spoiling:
    """By whoever connects in the place of the device: what was said, stamped as it was or as of now."""
    cut = rng.uniform(0.4, 0.9)
    before, now = [p for p in packets if p[0] < cut], rng.random() < 0.5
    again = [(at + cut, device + cut * now, words) for at, device, words in before]
    return Spoiling(before + again, again=(cut,))


def everything(rng: np.random.Generator, packets: Packets) -> Spoiling:
    for spoil in (noisy, shuffled, doubled):
        packets = spoil(rng, packets).packets
    share = rng.uniform(0.1, 0.6)
    late = delayed(rng, [p for p in packets if rng.random() > share])
    return late._replace(pauses=paused(rng, packets).pauses)


SPOILED = {
    "dropped": dropped,
    "delayed": delayed,
    "doubled": doubled,
    "in another order": shuffled,
    "noisy": noisy,
    "paused": paused,
    "played again in a new connection": played_again,
    "all of that": everything,
}


def lived(cell: Cell) -> Cell:
    """The robot and the person alone: machines have sources of their own."""
    return replace(
        cell, machine=None, walks=False, duration=SECONDS + 0.3, speeds=True, rate=125.0, anyone=False
    )


def greener_than_the_truth(what: str, seed: int, cell: Cell, folder: Path) -> tuple[list[str], int]:
    """Where a live run is within of what was exceeded ever since it was heard, and how often that could be.

    Limits are such that half of the true figures exceed them.
    """
    cell = replace(lived(cell), left_out=frozenset(ALL) - set(FIGURES))
    log = said(replace(cell, rate=500.0), folder / "truth")
    limits = dict(cell.limits)
    for name, of in (("fastest", "speed"), ("energy", "energy"), ("distance", "distance")):
        if np.isfinite(log[name].values).any():
            limits[of] = max(float(np.nanmedian(log[name].values)), 1e-3)  # parts may lie in one another
    beyond = {}
    for name in FIGURES:
        limit = log[name].limits if name == "separation" else limits[LIMITED[name]]
        more = (log[name].values - limit) * (1 if log[name].at_most else -1)
        beyond[name] = log[name].t, more > CLEARLY * np.abs(limit) + 0.01
    cell = replace(cell, live=True, limits=limits)
    rng = np.random.default_rng([seed, 3])
    t = np.arange(round(SECONDS * cell.rate)) / cell.rate
    q, qd = truth(cell, t)
    packets = [
        (float(at) + WAY, BEGIN + float(at) + OFFSET, (a, b)) for at, a, b in zip(t, q, qd, strict=True)
    ]
    spoiling = SPOILED[what](rng, packets)
    found, could = [], 0
    with pytest.MonkeyPatch.context() as patch:
        stream = Stream(
            station(cell, folder / "live"), patch, cell.names[0], spoiling.packets,
            pauses=spoiling.pauses, again=spoiling.again,
        )  # fmt: skip
        for _, results, there in stream.ticks(round((SECONDS - 0.1) / cell.tick)):
            now = there - BEGIN - OFFSET
            for result in results:
                at, exceeded = beyond[result.name]
                # Since it was last heard, and for as long as its own clock may be off.
                since = (at >= now - SILENT - 2 * cell.tick) & (at <= now + cell.tick)
                if since.sum() > 1 and exceeded[since].all():
                    could += 1
                    if result.verdict is Verdict.WITHIN:
                        found.append(f"{result.name} at {now:.3f} s: {result.value} of {result.limit}")
    return found, could
