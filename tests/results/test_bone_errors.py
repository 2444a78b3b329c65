"""Percentiles in bounded memory are those of all values, to half a per cent."""

import numpy as np
import pytest

from seerob.recording.bone_errors import BoneErrors


def test_percentiles_are_those_of_numpy_to_the_width_of_a_class():
    random = np.random.default_rng(1)
    values = {bone: random.lognormal(-5 + k, 1.0, 4001) for k, bone in enumerate(("head", "neck"))}
    errors = BoneErrors()
    for i in range(4001):
        errors.add({bone: (float(v[i]), None) for bone, v in values.items()}, 0.1 * i)
    for found in errors.bones():
        every = values[found.bone]
        assert found.median == pytest.approx(np.median(every), rel=0.006)
        assert found.p95 == pytest.approx(np.percentile(every, 95, method="inverted_cdf"), rel=0.006)
        assert (found.largest, found.t) == (every.max(), 0.1 * every.argmax())
    (whole,) = errors.all()
    assert whole.median == pytest.approx(np.median(np.concatenate(list(values.values()))), rel=0.006)


def test_what_is_no_number_is_not_counted_and_extremes_are_kept():
    errors = BoneErrors()
    errors.add({"head": (float("nan"), 0.0), "neck": (None, 1e9)}, 1.0)
    assert [(e.bone, e.what, e.largest, e.ticks) for e in errors.bones()] == [
        ("head", "angle", 0.0, 1),
        ("neck", "angle", 1e9, 1),
    ]
    assert errors.all()[0].median == 0.0
    assert not BoneErrors().all()
