"""Where a live source puts a person is looked at when it is heard, and held until it is plausible once."""

from __future__ import annotations

import numpy as np
import pytest

from made_cell import FLOATING, TWO_R, heard, made, person, two_r
from seerob.core.verdict import Verdict
from seerob.criteria.judging import Judge
from seerob.twin.engine import Engine

CELL = (
    FLOATING.replace("{ ", "{ physics = false, ")
    + TWO_R
    + "q = [0, 0]\n"
    + person("op", 3.0, 0, 0)
    + """
[[parts]]
name = "table"
shape = { box = [0.8, 1.4, 0.74] }
at = { position = [5.5, 0, 0.37] }
[[sources]]
kind = "mvn"
human = "op"
[[safety]]
kind = "minimum_distance"
name = "distance"
between = ["arm", "op"]
limit = 0.1
"""
)


def results(folder, shifts, *, more=""):
    """Verdicts and reasons with the person moved by each of the shifts [m] for 1.2 s each."""
    station = made(folder, CELL + more, {"arm.urdf": two_r()})
    human = station.model.mechanisms["op"]
    engine = Engine(station.model, driven={"op": 1.0}, live={"op"})
    judge, found, state = Judge(station.bound, station.model.findings), [], None
    for shift in shifts:
        for _ in range(120):
            t = 0.01 * len(found)
            q = human.home + np.concatenate([shift, np.zeros(len(human.home) - 3)])
            engine.take([heard("op", t, q, np.zeros(len(q)))])
            state = engine.start() if state is None else engine.tick()
            (result,) = judge(state)
            found.append((result.verdict, result.reason))
    return found


@pytest.mark.parametrize(
    ("shift", "why"),
    [
        ([0, 0, 0], ""),
        ([15, 0, 0], "robots[0].nobody_within"),
        ([0, 0, 1.0], "humans[0].feet"),
        ([2.5, 0, 0], "humans[0].inside.table"),
    ],
)
def test_where_a_device_puts_somebody_is_looked_at(tmp_path, shift, why):
    found = results(tmp_path, [shift])
    assert {verdict for verdict, _ in found} == {Verdict.UNDECIDED if why else Verdict.WITHIN}
    assert all(why in reason for _, reason in found)


def test_what_is_plausible_once_is_not_held_any_more(tmp_path):
    """Who comes in from far away, and then stands on something that is not drawn."""
    found = results(tmp_path, [[15, 0, 0], [1, 0, 0], [1, 0, 1.0]])
    verdicts = [verdict for verdict, _ in found]
    assert set(verdicts[:120]) == {Verdict.UNDECIDED}
    assert set(verdicts[210:240]) == set(verdicts[330:]) == {Verdict.WITHIN}


@pytest.mark.parametrize(("value", "verdict"), [(20.0, Verdict.WITHIN), (12.0, Verdict.UNDECIDED)])
def test_it_is_confirmed_up_to_a_value(tmp_path, value, verdict):
    own = f'[[confirmed]]\nkey = "robots[0].nobody_within"\nvalue = {value}\nwhy = "a long hall"\n'
    assert {v for v, _ in results(tmp_path, [[15, 0, 0]], more=own)} == {verdict}
