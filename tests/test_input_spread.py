"""Ends of a figure whose inputs have tolerances, and which of them makes it widest: in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from seerob.core.tolerances import Spread, Tolerance, deciding, spread


@pytest.mark.parametrize(
    ("half", "unit", "told"),
    [
        (0.02, "s", "± 20 ms"),
        (0.0123, "m", "± 12.3 mm"),
        (0.25, "kg", "± 0.25 kg"),
        (10.0, "%", "± 10 %"),
        (0.5, "rad/s", "± 0.5 rad/s"),
        (1 / 3, "m", "± 333.3 mm"),
    ],
)
def test_a_tolerance_is_told_in_the_unit_that_people_use(half, unit, told):
    assert str(Tolerance("it", half, unit)) == f"it {told}"


def test_ends_and_widths_of_a_product_and_of_a_sum():
    """(2 ± 0.5)(3 ± 1) + (0 ± 4) is 1.5 · 2 - 4 … 2.5 · 4 + 4; each alone ± 0.5 · 3, ± 2 · 1 and ± 4."""
    asked = []

    def figure(shifts):
        asked.append(shifts)
        a, b, c = shifts
        product = (2 + 0.5 * a) * (3 + b)
        return np.array([[product + 4 * c], [product]])

    found = spread(figure, 3)
    assert asked == [(-1, -1, -1), (1, 1, 1)]
    assert found.low.tolist() == [[-1], [3]]
    assert found.high.tolist() == [[14], [10]]
    assert found.widths.tolist() == [[[3], [3]], [[4], [4]], [[8], [0]]]
    assert found.widths is found.widths
    assert sorted(asked[2:]) == sorted(
        tuple(side * (i == k) for i in range(3)) for k in range(3) for side in (1, -1)
    )


def test_what_has_no_tolerance_is_as_wide_as_nothing():
    found = spread(lambda shifts: np.array([7.0 + sum(shifts)]), 0)
    assert (found.low, found.high, found.widths.shape) == (7, 7, (0, 1))
    widths = np.eye(2)
    assert Spread(found.low, found.high, widths).widths is widths


def test_the_widest_decides_and_what_is_not_known_is_wider_than_all():
    inputs = [Tolerance("a", 1.0, "m"), Tolerance("b", 2.0, "s"), Tolerance("c", 3.0, "%")]
    for widths, told in (
        ([3, 2, 1], "a ± 1000 mm"),
        ([1, 2, 1], "b ± 2000 ms"),
        ([1, 2, 3], "c ± 3 %"),
        ([1, np.nan, 3], "b ± 2000 ms"),
        ([1, np.inf, np.nan], "b ± 2000 ms"),
    ):
        assert deciding(inputs, np.array(widths, float)) == f"decided by {told}"
    assert deciding([], np.zeros(0)) == ""
