"""Compiled separation distances and their verdicts are those of the norm's and the verdict's own formulas."""

import math

import numpy as np
import pytest

from seerob.core.verdict import ROUNDING, Verdict, judge_interval, worst
from seerob.criteria.stopping.terms import Course, separation_distance
from seerob.description.norms.iso_13855 import ARM_REACH, REACHING, WALKING, least_distance
from seerob.kernels.separation import EXCEEDED, UNDECIDED, WITHIN, judged, separations

T_R, T_S, K = 0.1, 0.3, 0.055


@pytest.mark.parametrize("given", [None, 0.4, 1.6, 2.5])
@pytest.mark.parametrize("seen", [0.0, 1.6, 1.7, 3.0])
def test_separations_are_those_of_the_norm_to_the_last_bit(given, seen):
    rng = np.random.default_rng(3)
    S_r, S_s = rng.uniform(0, 0.4, (2, 50))
    course = Course(S_r, S_r, S_s, T_S)

    def at_speed(v_h):
        return separation_distance(course, v_h, T_R, K)

    if given is None:
        wanted = np.maximum(least_distance(at_speed), at_speed(seen) if seen > WALKING else 0.0)
    else:
        wanted = at_speed(max(given, seen))
    found, v_h = np.empty((1, 50)), math.nan if given is None else given
    args = T_R + T_S, K, v_h, np.array([seen]), REACHING, WALKING, ARM_REACH
    separations(S_r[None], S_s[None], *args, found)
    assert found[0].tobytes() == wanted.tobytes()


@pytest.mark.parametrize("bad", [0, 1, 2])
def test_what_is_not_a_number_gives_no_separation(bad):
    values = [np.array([[0.1]]), np.array([[0.1]]), np.array([0.5])]
    values[bad] = np.full_like(values[bad], np.nan)
    found = np.empty((1, 1))
    S_r, S_s, seen = values
    separations(S_r, S_s, T_R + T_S, K, math.nan, seen, REACHING, WALKING, ARM_REACH, found)
    assert np.isnan(found).all()


def test_verdicts_and_who_governs_are_those_of_the_rule_for_one_part_after_the_other():
    rng = np.random.default_rng(4)
    edges = np.array([0.0, 1e-10, 5e-10, 9.9e-10, 1e-9, 1.1e-9, 1e-8, 0.1, -1e-10, np.nan, np.inf])
    names = {WITHIN: Verdict.WITHIN, UNDECIDED: Verdict.UNDECIDED, EXCEEDED: Verdict.EXCEEDED}
    seen = set()
    for _ in range(2000):
        S_p = np.where(rng.random(4) < 0.1, np.inf, rng.uniform(0, 3, 4))
        distance = np.where(rng.random(4) < 0.1, np.inf, S_p + rng.choice(edges, 4))
        off, more, less = rng.choice([0.0, 1e-9, 0.05], (3, 4)) * (rng.random() < 0.7)
        incomplete = bool(rng.random() < 0.3)
        ends, verdicts = np.empty((2, 4)), np.empty(4, np.int64)
        with np.errstate(invalid="ignore"):
            near, far, low, high = distance - off, distance + off, S_p - less, S_p + less
            wanted = np.array([(near - more) - (high - S_p), far + (S_p - low)])
        k = judged(distance, near, far, S_p, more, low, high, ROUNDING, incomplete, ends, verdicts)
        np.testing.assert_array_equal(ends, wanted)
        each = [judge_interval((a, b), s, at_most=False) for a, b, s in zip(*ends, S_p, strict=True)]
        each = [Verdict.UNDECIDED if incomplete and v is Verdict.WITHIN else v for v in each]
        assert [names[code] for code in verdicts.tolist()] == each
        assert each[k] is worst(each)
        with np.errstate(invalid="ignore"):
            margins = (distance - S_p).tolist()
        if not np.isnan(margins).any():
            assert k == min((i for i in range(4) if each[i] is each[k]), key=margins.__getitem__)
        seen |= set(each)
    assert len(seen) == 3
