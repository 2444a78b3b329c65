"""Text of numbers keeps the side of the limit that the numbers are on, and is never kinder."""

import math
from decimal import ROUND_CEILING, ROUND_FLOOR, ROUND_HALF_EVEN, Context, Decimal

import numpy as np
import pytest

from seerob.core.figures import (
    DECIMALS,
    against,
    ends,
    figure,
    margin,
    rounded_down,
    rounded_up,
    with_unit,
    worded,
)


def back(text):
    return float(text.split(" ")[0].replace("−", "-").replace("∞", "inf"))


@pytest.mark.parametrize("unit", [*DECIMALS, "", "kN", "N/cm²"])
def test_a_value_beside_its_limit_keeps_its_side_and_is_not_kinder(unit):
    rng = np.random.default_rng(5)
    for scale in 10.0 ** np.arange(-9, 7):
        limits = rng.normal(0, scale, 30)
        near = limits + rng.normal(0, 1, 30) * scale * 10.0 ** rng.integers(-14, 1, 30)
        for value, limit in [*zip(near, limits, strict=True), (scale, scale), (scale, 0.0)]:
            for at_most in (True, False):
                shown = against(value, limit, unit, at_most=at_most)
                v, bound = back(shown.value), back(shown.limit)
                beyond = value > limit if at_most else value < limit
                assert (v > bound if at_most else v < bound) == beyond
                sign = 1 if at_most else -1
                noise = 1e-11 * max(abs(value), abs(limit)) + 1e-3 * 10.0 ** -DECIMALS.get(unit, 9)
                assert sign * (v - value) >= -noise
                assert sign * (limit - bound) >= -noise
                gap = back(margin(value, limit, unit, at_most=at_most))
                true = abs(value - limit)
                assert gap >= true * (1 - 1e-9) - noise if beyond else gap <= true * (1 + 1e-9) + noise
                assert not beyond or gap > 0


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (1.17e-26, "J", "0 J"),
        (4.92e-14, "m/s", "0 m/s"),
        (-3e-9, "m", "0 m"),
        (0.055751, "m", "0.0558 m"),
        (-0.2, "m", "−0.2 m"),
        (0.1 + 0.2, "kg", "0.3 kg"),
        (0.0, "", "0"),
        (123456.7, "kPa", "123457 kPa"),
        (0.00012344, "Nm/kg", "0.0001234 Nm/kg"),
        (None, "m", "–"),
        (math.nan, "m", "–"),
        (math.inf, "m", "∞ m"),
    ],
)
def test_figures_without_a_limit(value, unit, text):
    assert figure(value, unit) == text


def test_what_exceeds_by_a_hair_looks_exceeded_and_what_equals_looks_equal():
    assert against(1.00001, 1.0, "m/s", at_most=True) == ("1.001", "1")
    assert against(0.1499999, 0.15, "m", at_most=False) == ("0.1499", "0.15")
    assert against(0.15, 0.15, "m", at_most=False) == ("0.15", "0.15")
    assert against(0.99999, 1.0, "m/s", at_most=True) == ("1", "1")
    assert against(1e-26, 2.0, "J", at_most=True) == ("0", "2")
    assert against(0.1 + 0.2, 0.3, "m", at_most=True) == ("0.30000000000000004", "0.3")
    assert margin(1.0000001, 1.0, "m/s", at_most=True) == "0.0001 m/s"


def test_a_label_is_not_kinder_than_the_verdict_and_has_its_unit():
    assert worded(0.14996, 0.15, "m", at_most=False) == "0.1499 m"
    assert worded(0.9996, 1.0, "m/s", at_most=True) == "1 m/s"
    assert worded(1.00001, 1.0, "m/s", at_most=True) == "1.001 m/s"
    assert worded(0.055751, None, "m", at_most=False) == figure(0.055751, "m")


@pytest.mark.parametrize("unit", ["m", "m/s", "N", ""])
def test_a_label_is_the_text_of_the_pair_and_a_figure_that_of_decimal_arithmetic(unit):
    rng = np.random.default_rng(6)
    ten = Context(prec=60)
    for scale in 10.0 ** np.arange(-6, 15):
        near = np.round(rng.normal(0, scale, 40), int(rng.integers(0, 6)))
        limits = near + rng.normal(0, 1, 40) * scale * 10.0 ** rng.integers(-14, 1, 40)
        for value, limit in zip(near.tolist(), limits.tolist(), strict=True):
            for at_most in (True, False):
                shown = with_unit(against(value, limit, unit, at_most=at_most).value, unit)
                assert worded(value, limit, unit, at_most=at_most) == shown
            if unit and 1e-3 < abs(value) < 1e6:
                exact = Decimal(f"{value:.11e}").quantize(Decimal(1).scaleb(-DECIMALS[unit]), context=ten)
                assert back(figure(value, unit)) == float(exact)


@pytest.mark.parametrize("unit", DECIMALS)
def test_texts_beside_and_without_a_limit_are_those_of_decimal_arithmetic(unit):
    rng, places = np.random.default_rng(7), DECIMALS[unit]
    one = Decimal(1).scaleb(-places)

    def text(value, rounding):
        exact = Decimal(f"{value:.11e}")
        exact = Decimal(0) if abs(exact) < one / 1000 else exact.quantize(one, rounding, Context(prec=60))
        shown = f"{exact:f}".rstrip("0").rstrip(".") if places else f"{exact:f}"
        return ("0" if shown in ("-0", "") else shown).replace("-", "−")

    values = rng.normal(0, 10.0 ** rng.uniform(-places - 6, 3, 400))
    round_ones = np.round(values, places)
    for value in (*values, *round_ones, *(round_ones * (1 + 1e-14)), *(round_ones + 0.3 * 10.0**-places)):
        limit = float(round(value, places)) + 5 * 10.0**-places
        up, down = text(value, ROUND_CEILING), text(value, ROUND_FLOOR)
        assert against(value, limit, unit, at_most=True) == (up, text(limit, ROUND_FLOOR))
        assert worded(value, limit, unit, at_most=True) == f"{up} {unit}"
        assert worded(value, limit, unit, at_most=False) == f"{down} {unit}"
        assert against(value, limit, unit, at_most=False) == (down, text(limit, ROUND_CEILING))
        assert worded(value, None, unit, at_most=True) == f"{text(value, ROUND_HALF_EVEN)} {unit}"
    for value, limit in (
        (np.inf, 1.0),
        (np.inf, np.inf),
        (-np.inf, None),
        (1.0, np.inf),
        (np.nan, 1.0),
        (np.nan, None),
    ):
        shown = with_unit(against(value, limit, unit, at_most=True).value, unit)
        assert worded(value, limit, unit, at_most=True) == shown


@pytest.mark.parametrize("unit", [*DECIMALS, "", "kN"])
def test_where_a_value_lies_is_rounded_outward(unit):
    rng = np.random.default_rng(6)
    for low, high in np.sort(rng.normal(0, 10.0 ** rng.integers(-3, 3, (200, 1)), (200, 2)), axis=1):
        shown_low, shown_high = map(back, ends(low, high, unit))
        noise = 1e-11 * max(abs(low), abs(high)) + 1e-3 * 10.0 ** -DECIMALS.get(unit, 9)
        assert shown_low <= low + noise
        assert shown_high >= high - noise
    assert ends(-math.inf, 0.29, "m") == ("−∞ m", "0.29 m")


@pytest.mark.parametrize("unit", [*DECIMALS, "", "mm", "%"])
def test_a_bound_is_rounded_away_from_what_it_keeps(unit):
    rng = np.random.default_rng(7)
    for value in rng.normal(0, 10.0 ** rng.integers(-3, 3, (200, 1)), (200, 3)).ravel().tolist():
        low, high = back(rounded_down(value, unit)), back(rounded_up(value, unit))
        last = 10.0 ** -DECIMALS.get(unit, min(max(3 - math.floor(math.log10(abs(value))), 0), 9))
        noise = 1e-11 * abs(value) + 1e-3 * last
        assert value - 1.01 * last <= low <= value + noise
        assert value - noise <= high <= value + 1.01 * last
    assert (rounded_down(0.29996, "m"), rounded_up(0.29992, "m")) == ("0.2999 m", "0.3 m")
