"""The seven cells of the paper, as their emulators move them, judged without waiting for it.

Robots and PLCs do what the emulators of each file do, sample by sample; a round of it has the figures of the
README, and a faster robot or a nearer person turns its verdict. At real speed, with emulators in processes of
their own and with what moves by itself, cells run in tests/soak and, for a moment, in tests/emulators.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from msgspec.structs import replace

from seerob.app.emulation.motions import played, values
from seerob.app.emulation.options import RobotOptions
from seerob.core.samples import JointSample, SignalSample
from seerob.core.snapshot import Verdict
from seerob.description.humans.posture import posture
from seerob.devices.live.listening import LiveSource
from seerob.session.reading import read
from seerob.session.station import Station

CELLS = Path(__file__).parents[1] / "workstations"
TOLERANCE = 0.1
"""Of figures, as READMEs say."""
TICK = 0.01
HEADING = 3
"""Among the joints of a person, after the place of the waist."""


class Cell(NamedTuple):
    """What a round of a cell comes to."""

    seconds: float
    most: dict[str, float]
    """Greatest value of criteria, by name, as its README says."""
    kept: str
    """Criterion that is kept …"""
    faster: float = 1.0
    """… unless the robot is so many times as fast …"""
    nearer: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """… or the person so much elsewhere [m]."""


ROUNDS = {
    "motor_station": Cell(12, {"tool speed": 0.33, "arm energy": 0.46}, "tool speed", 3),
    "assembly_line": Cell(12, {"tool speed": 0.39, "arm energy": 0.57}, "tool speed", 3),
    "empty_room": Cell(11, {"tool speed": 0.28, "arm energy": 0.18}, "tool speed", 3),
    "niryo_picking": Cell(12, {"tool speed": 0.23}, "tool speed", 3),
    "three_robots": Cell(
        12,
        {"ur10 tool speed": 0.39, "ur10 elbow energy": 0.42, "iiwa_left energy": 0.57},
        "ur10 tool speed",
        3,
    ),
    "giant_niryo": Cell(12, {"fastest point": 2.1}, "robot – operator", nearer=(-0.8, 1.0, 0.0)),
    "two_places": Cell(12, {"tool speed": 0.23}, "tool speed", 3),
}


def moved(station, cell, *, mutated):
    """What everybody does: joint values of a time [s], by name."""
    ways, emulators = {}, [e for e in station.workstation.emulators if isinstance(e, RobotOptions)]
    for source, opened in station.sources:
        if not isinstance(source, LiveSource):
            said = list(opened.samples)
            ways[source.target()] = played([s.t for s in said], [s.q for s in said], [s.qd for s in said])
        elif getattr(source, "robot", ""):
            robot = emulators.pop(0)
            path = str(station.model.folder / robot.waypoints)
            ways[source.robot], _ = replace(robot, waypoints=path, in_step=None).motion(robot.target())
        elif getattr(source, "human", "") and any(cell.nearer):
            standing = posture(station.model.mechanisms[source.human].description, "standing").copy()
            standing[:3] += np.add(source.at.position, cell.nearer if mutated else 0.0)
            standing[HEADING] = source.at.rpy[2]
            still = tuple(standing.tolist()), (0.0,) * len(standing)
            ways[source.human] = lambda _, still=still: still
    return ways


def judged(name, *, mutated):
    """What the criteria of a cell come to that are asked here, of a round as it is or of a mutation."""
    cell = ROUNDS[name]
    pace = cell.faster if mutated else 1.0
    file = read(CELLS / name)
    safety = tuple(c for c in file.safety if c.name in {*cell.most, cell.kept})
    engine = replace(file.engine, physics=False)
    bare = replace(file, safety=safety, ergonomics=(), engine=engine, workpieces=(), places=(), targets=())
    station = Station(bare)
    tables = [values(CELLS / name / e.values) for e in file.emulators if getattr(e, "values", None)]
    ways = moved(station, cell, mutated=mutated)

    def heard():
        for k in range(int(cell.seconds / pace / TICK) + 1):
            t = k * TICK
            row: list[JointSample | SignalSample] = []
            for who, way in ways.items():
                q, qd = way(pace * t)
                qd = tuple(pace * v for v in qd)
                row.append(JointSample(source="told", target=who, seq=k, t=t, q=q, qd=qd))
            for table in tables:
                said = {path.lower(): 1e-3 * table.value(path, t) for path in table.columns}
                row.append(SignalSample(source="plc", seq=k, t=t, values=said))
            yield tuple(row)

    return station.run(feed=heard(), end=cell.seconds / pace).results


@pytest.mark.parametrize("name", ROUNDS)
def test_a_round_has_the_figures_of_the_readme_and_a_mutation_turns_the_verdict(name):
    cell, whole = ROUNDS[name], judged(name, mutated=False)
    found = {criterion: whole[criterion].max() for criterion in cell.most}
    assert found == pytest.approx(cell.most, rel=TOLERANCE)
    assert whole[cell.kept].verdict is Verdict.WITHIN, whole[cell.kept].reason
    assert judged(name, mutated=True)[cell.kept].verdict is Verdict.EXCEEDED
