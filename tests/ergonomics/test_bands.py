"""Postures in the same bands have the same scores: what is looked up is what would be scored."""

from bisect import bisect_right
from dataclasses import fields

import numpy as np
import pytest

from seerob.criteria.ergonomics.reba import Reba, RebaPhase
from seerob.criteria.ergonomics.rula import Rula, RulaPhase
from seerob.criteria.scoring.bands import Bands, _cuts
from seerob.criteria.scoring.spans import Thresholds, reached
from seerob.description.humans.angles import SIDED, Angles

HALF_TURN = ("shoulder_flexion", "shoulder_elevation", "knee_flexion", "elbow_flexion", "shank_tilt")


def thresholds(rng):
    """Angles that a file might enter, now and then 0 or that of another band."""
    names = Thresholds.__struct_fields__
    return Thresholds(**{name: float(np.radians(rng.choice([0, 2, 5, 15, 20, 45]))) for name in names})


def drawn(rng, name, edges):
    """One value of an angle [rad]: anywhere, by an edge, or not measured."""
    anywhere = np.pi * rng.uniform(-0.5, 1.5 if name in HALF_TURN else 0.5)
    near = rng.choice([0.0, 1e-10, 5e-7, 9.9e-7, 1.1e-6, 1e-4, 0.05]) * rng.choice([-1, 1])
    by_an_edge = rng.choice([-1, 1]) * rng.choice(edges) + near
    return rng.choice([anywhere, by_an_edge, np.nan], p=[0.55, 0.4, 0.05])


def ends(components):
    return {name: (span.low.tolist(), span.high.tolist()) for name, span in components.items()}


@pytest.mark.parametrize("seed", range(15))
@pytest.mark.parametrize(("kind", "phase"), [(Rula, RulaPhase), (Reba, RebaPhase)])
def test_scores_are_the_same_in_the_same_bands(kind, phase, seed):
    rng = np.random.default_rng(seed)
    rule = kind(name="x", human="op", thresholds=thresholds(rng))
    entered = phase(legs=rng.choice(["posture", None]))
    joints = ("trunk_flexion", "shoulder_flexion", "wrist_flexion", "neck_twist", "knee_flexion")
    errors = {name: rng.uniform(0, 0.4) for name in joints}
    accuracy = (None, float(rng.choice([0.0, 0.01, np.radians(20.6)])), errors)[seed % 3]
    edges = rule.METHOD.edges(rule.thresholds)
    bands = Bands(edges, rule.thresholds, accuracy)
    every = np.array(sorted({*(e for own in edges.values() for e in own), rule.thresholds.knee_difference}))
    here = {
        field.name: np.full((2,) if field.name in SIDED else (), 0.1 * rng.normal())
        for field in fields(Angles)
    }
    found = []

    def scored():
        posture = Angles(**{name: value.copy() for name, value in here.items()})
        scores = [ends(rule.components(posture, entered))]
        if accuracy is not None:
            scores.append(ends(rule.components(posture, entered, accuracy)))
        return bands.of(posture), scores

    for _ in range(12):
        for name, value in here.items():  # another posture
            value[...] = (
                [drawn(rng, name, every) for _ in range(value.size)] if value.ndim else 0.3 * rng.normal()
            )
        cells, scores = scored()
        if cells is None:
            continue
        for name, value in here.items():  # that goes as far as its bands reach
            for _ in range(4):
                before = value.copy()
                value[rng.integers(2) if value.ndim else ...] = drawn(rng, name, every)
                if bands.of(Angles(**here)) != cells:
                    value[...] = before
        again, others = scored()
        assert again == cells
        assert others == scores
        found.append(cells)
    assert found


@pytest.mark.parametrize("edge", [1.5 - 2e-6, 1.5 - 5e-10, 1.5, 1.5 + 1e-6, 1.5 + 1e-6 + 5e-10, 1.55])
def test_an_edge_by_the_limit_of_what_is_looked_up_hides_no_score(edge):
    """Of either sign, values around the limit are scored themselves, or do not reach the edge."""
    cuts = _cuts((-edge, edge), most=1.5)
    assert cuts == sorted(cuts)
    for size in edge + np.array([-2e-6, -1e-6, -5e-10, -1e-16, 0, 1e-16, 5e-10, 1e-9, 1e-6]):
        for value in (size, -size):
            inside = bisect_right(cuts, 0.3 * np.sign(value))
            assert bisect_right(cuts, value) != inside or not reached(abs(value), edge), value
    assert bisect_right(cuts, np.nan) % 2 == 0
