"""Compiled separation distances are those of the norm's own formulas."""

import numpy as np
import pytest

from seerob.criteria.stopping.terms import Course, assumed_speed, separation_distance
from seerob.description.norms.iso_13855 import WALKING, least_distance
from seerob.kernels.separation import separations

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
    found = np.empty((1, 50))
    separations(S_r[None], S_s[None], T_R + T_S, K, assumed_speed(given), np.array([seen]), found)
    assert found[0].tobytes() == wanted.tobytes()


@pytest.mark.parametrize("bad", [0, 1, 2])
def test_what_is_not_a_number_gives_no_separation(bad):
    values = [np.array([[0.1]]), np.array([[0.1]]), np.array([0.5])]
    values[bad] = np.full_like(values[bad], np.nan)
    found = np.empty((1, 1))
    S_r, S_s, seen = values
    separations(S_r, S_s, T_R + T_S, K, assumed_speed(None), seen, found)
    assert np.isnan(found).all()
