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


@pytest.mark.parametrize(
    ("many", "median", "p95"), [(1, 1, 1), (2, 1, 2), (3, 2, 3), (20, 10, 19), (21, 11, 20)]
)
@pytest.mark.parametrize("share", [0.3, 0.9])
def test_a_percentile_is_the_middle_of_its_class_and_no_more_than_the_largest(many, median, p95, share):
    """Of so many errors in one class each, 1 % wide from a micrometre on, the so manieth."""
    errors = BoneErrors()
    for n in range(1, many + 1):
        errors.add({"head": (None, 1e-6 * 1.01 ** (100 * n + share))}, 0.1 * n)
    (found,) = errors.bones()
    assert (found.what, found.unit, found.ticks, found.t) == ("angle", "rad", many, 0.1 * many)
    for n, told in ((median, found.median), (p95, found.p95)):
        assert told == pytest.approx(1e-6 * 1.01 ** (100 * n + (min(0.5, share) if n == many else 0.5)))


def test_what_is_below_a_micrometre_is_none_and_beyond_a_kilometre_is_a_kilometre():
    errors = BoneErrors()
    for t, error in enumerate((9e-7, 1e-6, 1.005e-6, 2000.0, 5000.0, 5000.0)):
        errors.add({"head": (error, None)}, t)
    errors.add({"neck": (5000.0, 0.1)}, 1)
    head, neck, angle = errors.bones()
    assert [(e.bone, e.what, e.unit) for e in (head, neck)] == [
        (b, "position", "m") for b in ("head", "neck")
    ]
    assert (head.median, head.largest, head.t) == (0.0, 5000.0, 4)
    assert head.p95 == pytest.approx(1000, rel=0.01)
    whole, angles = errors.all()
    # Of several that are the largest, the first.
    assert (whole.bone, whole.ticks, whole.t, whole.p95) == ("", 7, 4, head.p95)
    assert (angles.what, angles.ticks, angles.t) == ("angle", 1, angle.t)
