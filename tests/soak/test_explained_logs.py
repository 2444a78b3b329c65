"""Random motions, payloads and frictions: how often the truth lies in the interval."""

import numpy as np
import pytest

from seerob.session.explanation import explain
from test_explanation import COULOMB, TRUTH, VISCOUS, cell, figures, said

pytestmark = pytest.mark.soak


def test_the_truth_lies_in_95_of_100_intervals_of_random_motions():
    inside = []
    for seed in range(200):
        found = explain(cell()[0], "arm", said(seed, 1500))
        told = [figure.determined for figure in figures(found)]
        inside += [
            abs(figure.value - truth) <= figure.half
            for figure, truth, there in zip(figures(found), TRUTH, told, strict=True)
            if there
        ]
        # Coulomb friction of a joint that never turns round is not told apart from its offset.
        assert np.mean(told) > 0.8
    assert len(TRUTH) == 4 + len(COULOMB) + len(VISCOUS)
    assert 0.93 <= np.mean(inside) <= 0.98
