"""What a device's clock relies on is never taken for younger than it is, however its packets come.

Random streams in closed form: each packet is taken at a known instant, and delayed for good or for a while,
lost, doubled, overtaken, held back, played again, served from a buffer, over connections that are made anew.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

from seerob.devices.live.device_clock import DRIFT, SETTLED, STEP, DeviceClock

PERIOD, WAY = 0.02, 0.001
"""Of the device, and least time from there to here [s]."""
BOUND = 0.2
"""Later than at its best, a sample is not relied on [s], as of a source's time-out."""
OFFSET = 1000.0
"""Host's time less the device's, where that begins at 0 [s]."""
FAULTS = ("delay", "grows", "lost", "copies", "overtaken", "buffer", "loop", "reconnects", "jitter", "hole")
SHORT, MANY = 40, 4000
SOONEST = 12.0, 0.3
"""From when on something may happen [s]: to a device that was heard for a while, and to one that was
switched on just now."""


class Packets(NamedTuple):
    """A stream on its way."""

    arrived: list[tuple[float, float, int]]
    """Arrival, instant at which it was taken [s], what it says."""
    again: list[float]
    """When it connects anew [s]."""
    forgeable: bool


def spoiled(rng: np.random.Generator, soonest: float) -> Packets:
    """One to five faults, one upon the other, none before ``soonest`` [s]."""
    seconds, forgeable = rng.uniform(20, 150), bool(rng.random() < 0.5)
    t = np.arange(0, seconds, PERIOD)
    late, kept = np.full(len(t), WAY), np.ones(len(t), bool)
    again: list[float] = []
    copies: list[tuple[float, int]] = []
    stands = (np.sin(t / rng.uniform(1, 5) + 1) > 0) & (rng.random() < 0.2)
    # What stands and is played again over a connection that nobody forges looks as what stands.
    faults = [each for each in FAULTS if forgeable or not stands.any() or each != "loop"]
    for _ in range(rng.integers(1, 6)):
        a, by = rng.uniform(soonest, seconds), 10 ** rng.uniform(-2, 0.6)
        w = (t >= a) & (t < a + rng.choice([0.1, 0.5, 3.0, np.inf]))
        match rng.choice(faults):
            case "delay":
                late[w] += by
            case "grows":
                late[w] += rng.choice([0.001, 0.005, 0.03, 0.3]) * (t[w] - a)
            case "lost":
                kept[w] &= rng.random(w.sum()) > rng.uniform(0.2, 0.97)
            case "copies":
                some = np.flatnonzero(w & (rng.random(len(t)) < 0.2))
                copies += [(t[i] + late[i] + rng.uniform(0, by), i) for i in some]
            case "overtaken":
                late[w] += (rng.random(w.sum()) < 0.2) * rng.uniform(0, BOUND, w.sum())
            case "buffer":
                again.append(a)
                late[t >= a] = np.maximum(late[t >= a], by + WAY)
                copies += [(t[k] + by, k) for k in np.flatnonzero((t >= a - by) & (t < a))]
            case "loop":
                long = rng.choice([0.3, 1.0, 4.0, 20.0])
                source, since = np.flatnonzero((t >= a - long) & (t < a)), a
                while len(source) and since < t[w].max(initial=a):
                    copies += [(since + t[i] - t[source[0]], i) for i in source]
                    since += long
                    again += [since] * bool(rng.random() < 0.3)
                kept[w] &= rng.random() < 0.5
            case "reconnects":
                for _ in range(rng.integers(2, 30)):
                    kept[(t >= a) & (t < a + rng.uniform(0, 0.5))] = False
                    again.append(a)
                    late[t >= a] += rng.choice([0, 0.005, 0.02, 0.1])
                    a += rng.uniform(0.1, 3)
            case "jitter":
                late[w] += rng.exponential(0.02, w.sum())
            case "hole":
                kept[(t >= a) & (t < a + by)] = False
    # In order, or overtaken by no more than networks do.
    by = rng.choice([0.0, BOUND])
    arrivals = np.maximum(t + late, np.maximum.accumulate(t + late) - by)
    every = [(arrivals[i], i) for i in np.flatnonzero(kept)]
    every += [(at, i) for at, i in copies if kept[i] and at > arrivals[i]]
    said = [(float(at), float(t[i]), 7 if stands[i] else int(i)) for at, i in every]
    return Packets(sorted(said), sorted(again), forgeable)


def younger(packets: Packets, begin: float) -> tuple[float, float]:
    """How much younger than it is a sample counts that is relied on [s], at most; and how many are.

    Args:
        packets: What comes.
        begin: Stamp of the first sample [s].
    """
    clock, again, most, relied = DeviceClock(), list(packets.again), -np.inf, 0
    for at, taken, said in packets.arrived:
        while again and again[0] <= at:
            again.pop(0)
            clock.reconnect()
        found = clock.hear(begin + taken, OFFSET + at, said, forgeable=packets.forgeable)
        if found.t is not None and not found.invalid_reason and clock.latency <= BOUND:
            # DRIFT: a delay that grows more slowly cannot be told from a clock.
            most, relied = max(most, found.t - (OFFSET + taken + WAY) - DRIFT * at), relied + 1
    return most, relied / len(packets.arrived)


@pytest.mark.parametrize(("begin", "soonest"), [(100.0, SOONEST[0]), (0.0, SOONEST[1])])
@pytest.mark.parametrize("first", [0, pytest.param(SHORT, marks=pytest.mark.soak)])
def test_what_is_relied_on_is_never_younger_than_it_is(first, begin, soonest):
    relied = []
    for seed in range(first, MANY if first else SHORT):
        most, share = younger(spoiled(np.random.default_rng([seed, 7]), soonest), begin)
        assert most < SETTLED + STEP, seed
        relied.append(share)
    assert np.mean(relied) > 0.4
