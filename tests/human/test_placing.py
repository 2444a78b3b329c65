"""How well it is known where a device's world lies in the cell: what widens, and what is undecided."""

from dataclasses import replace as changed
from itertools import pairwise

import msgspec
import numpy as np
import pytest
from made_capture import captured, frames_of, source, walking, workstation
from msgspec.structs import replace

from seerob.core.samples import BodyPoint, BodySample, Placing, Sample
from seerob.core.snapshot import Verdict
from seerob.criteria.ergonomics.rula import Rula
from seerob.criteria.safety.minimum_distance import MinimumDistance
from seerob.description.capture.registration import CHI, bound
from seerob.devices.sources.headset import at_scale
from seerob.session import run as road
from seerob.session.run import Judge
from seerob.session.station import Station
from seerob.twin.engine import Engine

WHY = "nobody registered the room of this headset in the cell"
POST = {"name": "post", "at": {"position": [3.0, 0.0, 1.0]}, "shape": {"box": [0.1, 0.1, 0.1]}}
DISTANCE = MinimumDistance(name="post", between=("operator", "post"), limit=0.3)
POSTURE = Rula(name="rula", human="operator")


def covariance(metres, radians=0.0):
    return tuple(np.diag([metres**2] * 3 + [radians**2] * 3).ravel().tolist())


def told(placing, *, person=None, criteria=(DISTANCE,)):
    """What criteria say while a device that sees every bone says how well its world is known to lie."""
    frames = [changed(frame, placing=placing) for frame in frames_of(*walking(0.2))]
    station = workstation(source(captured(frames)), person=person, parts=[POST])
    stage = Station(replace(station, safety=tuple(criteria)))
    engine, judge, results = Engine(stage.model, driven={"operator": 0.2}), Judge(stage.bound), ()
    for seq, samples in enumerate(road.pump(stage.sources, 0.01)):
        engine.take(samples)
        results = judge(engine.tick() if seq else engine.start())
        if seq == 4:
            break
    return results


def width(placing):
    (result,) = told(placing)
    assert result.verdict is Verdict.WITHIN
    return result.value - result.interval[0]


def test_what_is_known_exactly_widens_nothing_and_an_error_widens_by_what_95_percent_stay_within():
    exact = width(None)
    assert width(Placing(covariance=covariance(0.0))) == pytest.approx(exact, abs=1e-9)
    assert width(Placing(covariance=covariance(0.01))) == pytest.approx(exact + CHI * 0.01, abs=1e-6)


def test_a_larger_error_of_place_or_turn_or_a_farther_origin_never_narrows():
    widths = [
        width(Placing(covariance=covariance(m, r), about=(x, 0, 0)))
        for m, r, x in ((0.005, 0.0, 0), (0.01, 0.0, 0), (0.01, 0.01, 0), (0.01, 0.02, 0), (0.01, 0.02, -4))
    ]
    assert all(b > a + 1e-3 for a, b in pairwise(widths))


def test_a_turn_counts_by_how_far_away_it_is():
    flat = np.diag([0, 0, 0, 0, 0, 0.01**2])
    np.testing.assert_allclose(bound(flat, np.zeros(3), np.array([2.0, 0, 1.5]), 0.1), CHI * 0.01 * 2.1)


@pytest.mark.parametrize("accepted", [{}, {"unseen_uncertainty": 0.1}])
def test_a_missing_registration_leaves_places_undecided_and_postures_as_they_are(accepted):
    distance, posture = told(Placing(reason=WHY), person=accepted, criteria=(DISTANCE, POSTURE))
    assert distance.verdict is Verdict.UNDECIDED
    assert WHY in distance.reason
    (_, known) = told(None, person=accepted, criteria=(DISTANCE, POSTURE))
    assert (posture.value, posture.verdict, posture.reason) == (known.value, known.verdict, known.reason)
    values = [row.value for row in posture.rows]
    assert values == [row.value for row in known.rows]
    assert sum(value is not None for value in values) > 4


@pytest.mark.parametrize("scale", [0.1, 10.0])
def test_a_person_at_another_scale_is_judged_for_posture_and_refused_against_limits(scale):
    distance, posture = told(at_scale(scale), criteria=(DISTANCE, POSTURE))
    assert distance.verdict is Verdict.UNDECIDED
    assert f"works at scale {scale:g}" in distance.reason
    same, own = told(at_scale(1.0), criteria=(DISTANCE, POSTURE))
    assert same.verdict is Verdict.WITHIN
    assert [row.value for row in posture.rows] == [row.value for row in own.rows]
    assert sum(row.value is not None for row in posture.rows) > 4


def test_it_is_recorded_with_the_sample():
    placing = Placing(covariance=covariance(0.01, 0.02), about=(1.0, 2.0, 0.0))
    point = BodyPoint(name="viewer", bone="head", position=(0.0, 0.0, 1.7))
    sample = BodySample(source="h", target="op", seq=1, t=0.5, points=(point,), placing=placing)
    assert msgspec.msgpack.decode(msgspec.msgpack.encode(sample), type=Sample) == sample
