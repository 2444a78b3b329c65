"""What lies outside of a range is told: the first value, its bound, and what it was taken for."""

from __future__ import annotations

import math
from typing import Any

import pytest

from seerob.workstation.plausibility.ranges import (
    Quantity,
    Range,
    converted_twice,
    how_to_confirm,
    same,
    scaled,
    sentence,
    turned_in_another_order,
)
from seerob.workstation.plausibility.ranges import implausible as implausible_of


def row(**more: Any) -> Range:
    """A range of 1 to 2 m, but for what is changed."""
    words = dict.fromkeys(("because", "right", "source", "confidence"), "w")
    return Range(**({"unit": "m", "low": 1.0, "high": 2.0} | words | more))


def quantity(*values: float, said: str = "", of: str = "") -> Quantity:
    return Quantity("parts[0].x", "parts.x", "m", values, ("a",), said, of)


ROUND_ANGLE = math.radians(math.pi)
"""180° that were typed in radians and read in degrees."""


@pytest.mark.parametrize(
    ("values", "more", "found"),
    [
        ((1.0,), {}, None), ((2.0,), {}, None), ((-1.5,), {}, None), ((1.5, 2.0), {}, None),
        ((0.999,), {}, 0.999), ((2.001,), {}, 2.001), ((1.5, -2.5), {}, -2.5), ((math.nan,), {}, math.nan),
        ((0.0,), {}, 0.0), ((0.0,), {"zero": True}, None), ((0.5,), {"zero": True}, 0.5),
        ((1.2, 1.2), {"norm": True}, None), ((1.5, 1.5), {"norm": True}, math.hypot(1.5, 1.5)),
        ((0.0, 0.0), {"norm": True, "zero": True}, None),
        ((0.1, ROUND_ANGLE), {"low": 0.0, "twice": True}, ROUND_ANGLE),
        ((-ROUND_ANGLE,), {"low": 0.0, "twice": True}, -ROUND_ANGLE),
        ((ROUND_ANGLE,), {"low": 0.0}, None),
        ((0.0, 0.0, 0.6, 0.8), {"low": 0.0, "last": True}, 0.8),
        ((0.0, 0.0, 0.6, 0.8), {"low": 0.0}, None),
    ],
)  # fmt: skip
def test_the_first_value_outside_of_a_range_is_told(values, more, found) -> None:
    assert implausible_of(values, row(**more)) == (
        found if found is None else pytest.approx(found, nan_ok=True)
    )


@pytest.mark.parametrize("sign", [1, -1])
def test_round_angles_in_radians_that_were_read_in_degrees(sign) -> None:
    """Multiples of 45° up to 360°, to 6 in 10 000 as 3.14 is."""
    for k, told in ((0, False), (1, True), (4, True), (8, True), (9, False)):
        assert converted_twice(sign * math.radians(k * math.pi / 4)) is told
    for off, told in ((5.7e-4, True), (6.3e-4, False)):
        for side in (1 + off, 1 - off):
            assert converted_twice(sign * math.radians(math.pi * side)) is told
    assert converted_twice(sign * math.radians(3.14))


def test_quaternions_about_z_with_w_last() -> None:
    told = {(0.0, 0.0, 0.6, 0.8), (0.0, 0.0, 0.0, 1.0), (0.0, 0.0, -0.6, -0.8)}
    others = {(0.0, 0.0, 1.0, 0.0), (1.0, 0.0, 0.0, 0.0), (0.0, 0.6, 0.0, 0.8), (0.6, 0.0, 0.0, 0.8)}
    assert {q for q in told | others if turned_in_another_order(q)} == told


@pytest.mark.parametrize(
    ("values", "value", "more", "words"),
    [
        ((2.5,), 2.5, {}, "parts[0].x = 2.5 m: more than 2 m, which"),
        ((-2.5,), -2.5, {"twice": True}, "parts[0].x = -2.5 m: more than 2 m, which"),
        ((0.5,), 0.5, {}, "parts[0].x = 0.5 m: less than 1 m, which"),
        ((1.5, 2.5), 2.5, {}, "parts[0].x = [1.5, 2.5] m: 2.5 is more than 2 m, which"),
        (
            (ROUND_ANGLE,),
            ROUND_ANGLE,
            {"unit": "rad", "low": 0.0, "twice": True},
            "3.14159°, which would be 180° were it in radians, which",
        ),
        (
            (0.0, 0.0, 0.6, 0.8),
            0.8,
            {"unit": "", "low": 0.0, "last": True},
            f"a turn of {2 * math.degrees(math.acos(0.8)):.4g}° about z with w last, which",
        ),
        ((0.0, 0.0, 0.0, -1.1), -1.1, {"unit": "", "low": 0.0, "last": True}, "a turn of 0° about z"),
    ],
)
def test_what_is_not_plausible_is_told_with_its_bound(values, value, more, words) -> None:
    told = sentence(quantity(*values), value, row(**more))
    assert words in told
    assert told.endswith("is not plausible: w; w")


def test_what_is_confirmed_is_the_value_to_rounding_and_of_what_was_read_off_a_message_to_its_digits() -> (
    None
):
    for said, near in (("", 1e-6), ("of others", 5e-3)):
        for share, equal in ((0.95, True), (1.05, False)):
            for side in (1 + share * near, 1 - share * near):
                assert same(2 * side, quantity(2.0, said=said)) is equal
                assert same([3.0, 2 * side], quantity(3.0, 2.0, said=said)) is equal
    assert not same([2.0, 2.0], quantity(2.0))
    assert not same(2.0, quantity(2.0, 2.0))
    assert scaled([1.0, [2.0]], 1e-3) == [1e-3, [2e-3]]
    assert "value = 2.0, why" in how_to_confirm(quantity(2.0))
    assert "of =" not in how_to_confirm(quantity(2.0))
    assert 'of = "a", value = [2.0, 3.0], why' in how_to_confirm(quantity(2.0, 3.0, of="a"))
    assert "value = 0.333333, why" in how_to_confirm(quantity(1 / 3, said="of others"))
    assert f"value = {1 / 3!r}, why" in how_to_confirm(quantity(1 / 3))
