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

from emulated_rounds import rounds, standing_at
from seerob.core.snapshot import Verdict
from seerob.description.humans.posture import posture
from seerob.session.reading import read
from seerob.session.station import Station

CELLS = Path(__file__).parents[1] / "workstations"
TOLERANCE = 0.1
"""Of figures, as READMEs say."""


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
    "niryo_picking": Cell(12, {"tool speed": 0.23, "arm energy": 0.017}, "tool speed", 3),
    "three_robots": Cell(
        12,
        {"ur10 tool speed": 0.39, "ur10 elbow energy": 0.42, "iiwa_left energy": 0.57},
        "ur10 tool speed",
        3,
    ),
    "giant_niryo": Cell(8, {"fastest point": 2.1}, "robot – operator", nearer=(-0.8, 1.0, 0.0)),
    "two_places": Cell(12, {"tool speed": 0.23}, "tool speed", 3),
}


def judged(name, *, mutated):
    """What the criteria of a cell come to that are asked here, of a round as it is or of a mutation."""
    cell, file = ROUNDS[name], read(CELLS / name)
    pace = cell.faster if mutated else 1.0
    safety = tuple(c for c in file.safety if c.name in {*cell.most, cell.kept})
    engine = replace(file.engine, physics=False)
    bare = replace(file, safety=safety, ergonomics=(), engine=engine, workpieces=(), places=(), targets=())
    station, people = Station(bare), {}
    for source in file.sources if any(cell.nearer) else ():
        if human := getattr(source, "human", ""):
            still = posture(station.model.mechanisms[human].description, "standing").copy()
            at = tuple(np.add(source.at.position, cell.nearer if mutated else 0.0).tolist())
            stands = standing_at(still, replace(source.at, position=at))
            people[human] = lambda _, stands=stands: stands
    end = cell.seconds / pace
    return station.run(feed=rounds(station, end, pace=pace, people=people), end=end).results


@pytest.mark.parametrize("name", ROUNDS)
def test_a_round_has_the_figures_of_the_readme_and_a_mutation_turns_the_verdict(name):
    cell, whole = ROUNDS[name], judged(name, mutated=False)
    found = {criterion: whole[criterion].max() for criterion in cell.most}
    assert found == pytest.approx(cell.most, rel=TOLERANCE)
    assert whole[cell.kept].verdict is Verdict.WITHIN, whole[cell.kept].reason
    assert judged(name, mutated=True)[cell.kept].verdict is Verdict.EXCEEDED
