"""A rescaled motion of a UR10 against toppra alone: cycle time under the same map, and what the rest costs.

Run ``python benchmarks/permissible.py``; ``--smoke`` takes a coarse map and few looks.

toppra is the peer and what seerob is built on: it has no jerk limit, so its cycle time is a lower bound. The
rows say how much longer seerob takes with the jerk limit and with a jerk limit that does not bind, how far
each goes beyond the jerk limit, and how the time of the whole command is spent. Lengths are those of the
motions, times of the work are CPU seconds of this run.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from made_cell import FLOATING, UR10, made, wave
from seerob.core.transforms import Array
from seerob.session.permissible.evaluation import Wish
from seerob.session.permissible.rescaled import Rescaled, ceiling, rescale
from seerob.session.permissible.speed_map import SpeedMap
from seerob.session.permissible.timing import PER_WAY, fastest
from seerob.session.station import Station

PERSON = (
    '[[humans]]\nname = "op"\nstature = 1.75\nmass = 75\nsex = "male"\nat = { position = [1.9, 0, -0.9] }\n'
)
SOURCE = '[[sources]]\nkind = "csv"\nrobot = "arm"\nfile = "motion.csv"\n'
SSM = (
    '[[safety]]\nkind = "separation"\nname = "S"\nbetween = ["arm", "op"]\nhuman_speed = 1.6\n'
    "stop = { reaction = 0.05, stopping = 0.15 }\nintrusion = 0\nhuman_uncertainty = 0\n"
    "robot_uncertainty = 0\n"
)
TIP = '[[safety]]\nkind = "velocity"\nname = "V"\nof = "arm"\nlimit = 1.0\n'
ACCELERATION, JERK = 8.0, 80.0


def motion(duration: float) -> str:
    """A wave of all joints, blended from rest and into rest, at 100 Hz."""
    t = np.linspace(0.0, duration, round(duration * 100) + 1)
    x = t / duration
    way = duration * (10 * x**3 - 15 * x**4 + 6 * x**5)
    q = np.array([wave(s)[0] for s in way])
    head = ",".join(["t [s]", *(f"J{j} [rad]" for j in range(1, 7))])
    return head + "\n" + "\n".join(",".join(f"{v:.9g}" for v in (a, *b)) for a, b in zip(t, q, strict=True))


def peer(found: Rescaled) -> tuple[float, float]:
    """Of toppra alone under the same map: cycle time [s], largest use of the jerk limit at 1 kHz."""
    whole, jerk = float(found.of.path.stands.sum()), 0.0
    for piece, stations in zip(found.of.path.pieces, found.of.stations, strict=True):
        s = np.linspace(0.0, piece.length, max(100, round(piece.length / PER_WAY)) + 1)
        top = ceiling(stations, not_faster=found.not_faster, margin=found.margin)
        t, way = _timed(s, fastest(piece, s, top(s), found.of.limits))
        whole += float(t[-1])
        every = np.arange(0.0, t[-1], 1e-3)
        q = piece.at(np.interp(every, t, way))[0]
        if len(every) > 3:
            jerk = max(jerk, float((np.abs(np.diff(q, 3, axis=0)) / 1e-9 / found.of.limits.jerk).max()))
    return whole, jerk


def _timed(s: Array, speed: Array) -> tuple[Array, Array]:
    """Instants and coordinates of constant accelerations between neighbours, finely enough to interpolate."""
    width = 2 * np.diff(s) / (speed[1:] + speed[:-1])
    t = np.concatenate([[0.0], np.cumsum(width)])
    x = np.linspace(0.0, 1.0, 40, endpoint=False)
    dense = (t[:-1, None] + width[:, None] * x).ravel()
    way = s[:-1, None] + width[:, None] * x * (speed[:-1, None] + np.diff(speed)[:, None] * x / 2)
    return np.append(dense, t[-1]), np.append(way.ravel(), s[-1])


def run(station: Station, wish: Wish, jerk: float) -> tuple[Rescaled, dict[str, float]]:
    """The rescaled motion, and CPU seconds by part of the work."""
    spent: dict[str, float] = {}
    begun, doing = time.process_time(), "the start"

    def say(what: str, _: float) -> None:
        nonlocal begun, doing
        now = time.process_time()
        spent[doing] = spent.get(doing, 0.0) + now - begun
        begun, doing = now, what

    found = station.permissible_speed(wish=wish, acceleration=ACCELERATION, jerk=jerk, say=say)
    assert found.rescaled is not None, found.refused
    assert found.verified is not None
    looks = found.verified
    print(f"   {looks.asked} looks every {looks.period:g} s: at most {looks.use:.1%} used")
    return found.rescaled, spent


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--smoke", action="store_true")
    options = parser.parse_args()
    wish = Wish(spacing=0.2, verify=0.1) if options.smoke else Wish()
    with TemporaryDirectory() as folder:
        text = FLOATING.replace("}", ", physics = false }") + UR10 + PERSON + SOURCE + TIP + SSM
        station = made(Path(folder), text, {"motion.csv": motion(0.8 if options.smoke else 3.0)})
        print(
            f"UR10, speed limit of every point and separation, {ACCELERATION:g} rad/s², jerk {JERK:g} rad/s³"
        )
        found, spent = run(station, wish, JERK)
        alone, beyond = peer(found)
        print(f"seerob, with the jerk limit: {found.duration:.3f} s; toppra alone: {alone:.3f} s, which uses "
              f"{beyond:.1f} times the jerk limit; ratio {found.duration / alone:.3f}, "
              f"{found.duration - alone:+.3f} s")  # fmt: skip
        free = rescale(_without_jerk(found), not_faster=False, margin=found.margin)
        print(
            f"seerob, jerk limit that does not bind: {free.duration:.3f} s; ratio {free.duration / alone:.3f}"
        )
        for what, seconds in sorted(spent.items(), key=lambda item: -item[1]):
            print(f"   {seconds:7.2f} s of CPU  {what}")
    return 0 if free.duration < 1.05 * alone and found.duration >= alone * 0.999 else 1


def _without_jerk(found: Rescaled) -> SpeedMap:
    limits = replace(found.of.limits, jerk=np.full_like(found.of.limits.jerk, 1e6))
    return replace(found.of, limits=limits)


if __name__ == "__main__":
    sys.exit(main())
