"""What emulated robots, PLCs and people of a workstation do, sample by sample, without waiting for it."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from msgspec.structs import replace

from seerob.app.emulation.motions import Motion, played, values
from seerob.app.emulation.options import RobotOptions
from seerob.core.samples import GrabSample, JointSample, Sample, SignalSample
from seerob.devices.live.listening import LiveSource
from seerob.session.station import Station
from seerob.workstation.workstation import Pose

TICK = 0.01
HEADING = 3
"""Among the joints of a person, after the place of the waist."""


def robots(station: Station) -> dict[str, Motion]:
    """What each robot does, by name: as its file has it, or its emulator, which begins at once."""
    ways, emulators = {}, [e for e in station.workstation.emulators if isinstance(e, RobotOptions)]
    for source, opened in station.sources:
        if not isinstance(source, LiveSource):
            said = list(opened.samples)
            ways[source.target()] = played([s.t for s in said], [s.q for s in said], [s.qd for s in said])
        elif getattr(source, "robot", ""):
            emulator = emulators.pop(0)
            path = str(station.model.folder / emulator.waypoints)
            emulator = replace(emulator, waypoints=path, in_step=None)
            ways[source.robot], _ = emulator.motion(emulator.target())
    return ways


def standing_at(q: np.ndarray, at: Pose) -> tuple[float, ...]:
    """Joint values of a person whose world lies turned about its vertical in the cell, shape (53,)."""
    turn = at.rpy[2] if at.rpy else 0.0
    found = q.copy()
    c, s = np.cos(turn), np.sin(turn)
    found[:2] = np.array([[c, -s], [s, c]]) @ q[:2] + at.position[:2]
    found[HEADING] += turn
    return tuple(found.tolist())


def rounds(
    station: Station,
    seconds: float,
    *,
    pace: float = 1.0,
    people: dict[str, Callable[[float], tuple[float, ...]]] | None = None,
    grabs: list[GrabSample] | None = None,
) -> Iterator[tuple[Sample, ...]]:
    """What is heard tick by tick.

    Args:
        station: Whose emulators these are.
        seconds: How long [s].
        pace: How many times as fast robots are.
        people: Joint values of a time [s], by name.
        grabs: What hands take and let go.
    """
    ways, waiting = robots(station), list(grabs or ())
    named = [e.values for e in station.workstation.emulators if getattr(e, "values", None)]
    tables = [values(station.model.folder / name) for name in named]
    for k in range(int(seconds / TICK) + 1):
        t = k * TICK
        row: list[Sample] = []
        for who, way in ways.items():
            q, qd = way(pace * t)
            qd = tuple(pace * v for v in qd)
            row.append(JointSample(source="told", target=who, seq=k, t=t, q=q, qd=qd))
        row += [
            JointSample(source="seen", target=who, seq=k, t=t, q=at(t)) for who, at in (people or {}).items()
        ]
        for table in tables:
            said = {path.lower(): 1e-3 * table.value(path, t) for path in table.columns}
            row.append(SignalSample(source="plc", seq=k, t=t, values=said))
        while waiting and waiting[0].t <= t:
            row.append(replace(waiting.pop(0), t=t))
        yield tuple(row)
