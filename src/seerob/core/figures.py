"""Numbers as text that is never kinder than the number.

A value beside its limit keeps its side: what exceeds does not look equal, what is within does not look
beyond. Where rounding must choose, it chooses against whoever hopes for *within*: a value and its
excess away from the margin, a limit toward it. Noise of floating-point sums, such as 1e-26 J, is 0.
"""

from __future__ import annotations

import math
from decimal import ROUND_CEILING, ROUND_FLOOR, ROUND_HALF_EVEN, Context, Decimal
from typing import NamedTuple

DECIMALS = {
    "m": 4,
    "m/s": 3,
    "m/s²": 2,
    "m/rad": 4,
    "rad": 4,
    "rad/s": 3,
    "s": 2,
    "J": 3,
    "kg": 3,
    "N": 1,
    "N·m": 2,
    "W": 2,
}
"""Places after the point per unit: what a twin can be asked for, 0.1 mm for a distance."""
_DIGITS = 4
"""Significant digits of other units."""
_SMALLEST = 9
"""Places after the point beyond which other units count as 0 too."""
_EXACT = 12
"""Significant digits that a float is trusted for: 0.1 + 0.2 is 0.3."""
_MOST = 17
_HUGE = 1e15
_ARITHMETIC = Context(prec=60)
_UNITS = [Decimal(1).scaleb(-places) for places in range(_SMALLEST + _MOST + 1)]
"""Of the last place, by places after the point."""
_NOISE = [unit / 1000 for unit in _UNITS]
"""That directed rounding must not lift to a whole unit."""
_SCALES = [10.0**places for places in range(_SMALLEST + _MOST + 1)]
_PLAIN = 1e8
"""Units of the last place below which 12 digits leave more than `_CLEAR` of one."""
_CLEAR = 1e-3
"""Share of a unit, beside which way to round is beyond doubt without decimal arithmetic; as it is of none."""
_AS_WRITTEN = 4
"""Places after the point up to which Python writes a float without an exponent, and no zeros behind it."""
_APART = 3
"""Units of the last place beyond which rounding carries no value past its limit."""


class Pair(NamedTuple):
    """A value and its limit, without units."""

    value: str
    limit: str


def figure(value: float | None, unit: str = "") -> str:
    """A number without a limit, rounded to the nearest, with its unit; a dash for what is not there."""
    text = _alone(value, unit)
    return text if text == "–" else with_unit(text, unit)


def against(value: float | None, limit: float | None, unit: str = "", *, at_most: bool) -> Pair:
    """A value and its limit, on the same side of each other as the numbers are.

    Args:
        value: In ``unit``; None or nan when there is none.
        limit: In ``unit``.
        unit: Of both; decides the places after the point, and is not written.
        at_most: Whether the limit bounds from above.
    """
    if value is None or limit is None or not (math.isfinite(value) and math.isfinite(limit)):
        return Pair(_alone(value, unit), _alone(limit, unit))
    worse, better = (ROUND_CEILING, ROUND_FLOOR) if at_most else (ROUND_FLOOR, ROUND_CEILING)
    places = _places(unit, value, limit)
    if abs(value - limit) * _SCALES[places] > _APART and abs(value) * _SCALES[places] < _PLAIN:
        return Pair(_text(value, places, worse), _text(limit, places, better))
    for more in range(_MOST):
        shown = Pair(_text(value, places + more, worse), _text(limit, places + more, better))
        if _beyond(_back(shown.value), _back(shown.limit), at_most) == _beyond(value, limit, at_most):
            return shown
    return Pair(_signed(repr(float(value))), _signed(repr(float(limit))))


def worded(value: float, limit: float | None, unit: str = "", *, at_most: bool) -> str:
    """A value with its unit, on its side of the limit where there is one: what a label in a picture says."""
    places = DECIMALS.get(unit)
    if places is None or math.isnan(value):
        return with_unit(against(value, limit, unit, at_most=at_most).value, unit)
    if limit is None or math.isinf(limit):
        return f"{_text(value, places, ROUND_HALF_EVEN)} {unit}"
    if abs(value - limit) * _SCALES[places] > _APART and abs(value) * _SCALES[places] < _PLAIN:
        return f"{_text(value, places, ROUND_CEILING if at_most else ROUND_FLOOR)} {unit}"
    return f"{against(value, limit, unit, at_most=at_most).value} {unit}"


def rounded_down(value: float, unit: str = "") -> str:
    """A bound from below, rounded down, with its unit."""
    return with_unit(_text(value, _places(unit, value), ROUND_FLOOR), unit)


def rounded_up(value: float, unit: str = "") -> str:
    """A bound from above, rounded up, with its unit."""
    return with_unit(_text(value, _places(unit, value), ROUND_CEILING), unit)


def margin(value: float, limit: float, unit: str = "", *, at_most: bool) -> str:
    """How far a value is inside (rounded down) or beyond (rounded up) its limit, with the unit."""
    gap = limit - value if at_most else value - limit
    places = _places(unit, value, limit)
    if gap >= 0:
        return with_unit(_text(gap, places, ROUND_FLOOR), unit)
    # An excess below the column's precision is still one.
    shown = (_text(-gap, places + more, ROUND_CEILING) for more in range(_MOST))
    return with_unit(next((text for text in shown if _back(text) > 0), repr(-float(gap))), unit)


def ends(low: float, high: float, unit: str = "") -> tuple[str, str]:
    """Between which a value lies, rounded outward: ``0.29 m`` and ``0.31 m``."""
    places = _places(unit, low, high)
    return (
        with_unit(_text(low, places, ROUND_FLOOR), unit),
        with_unit(_text(high, places, ROUND_CEILING), unit),
    )


def with_unit(text: str, unit: str) -> str:
    """``0.56 m``."""
    return f"{text} {unit}".rstrip()


def _alone(value: float | None, unit: str) -> str:
    if value is None or math.isnan(value):
        return "–"
    return _text(value, _places(unit, value), ROUND_HALF_EVEN)


def _places(unit: str, *values: float) -> int:
    if unit in DECIMALS:
        return DECIMALS[unit]
    largest = max((abs(v) for v in values if math.isfinite(v)), default=0.0)
    if largest == 0:
        return 0
    return min(max(_DIGITS - 1 - math.floor(math.log10(largest)), 0), _SMALLEST)


def _text(value: float, places: int, rounding: str) -> str:
    units = value * _SCALES[places]
    if -_PLAIN < units < _PLAIN:
        whole = math.floor(units)
        rest = units - whole
        if rounding == ROUND_HALF_EVEN:
            clear, up = abs(rest - 0.5) > _CLEAR, rest > 0.5
        else:
            clear, up = _CLEAR < rest < 1 - _CLEAR or rest == 0, rest > 0 and rounding == ROUND_CEILING
        if clear:
            shown = (whole + 1 if up else whole) / _SCALES[places]
            if places > _AS_WRITTEN:
                return _short(f"{shown:.{places}f}")
            text = repr(shown).removesuffix(".0")
            return text if shown >= 0 else f"−{text[1:]}"
    if not math.isfinite(value):
        return "∞" if value > 0 else "−∞"
    if abs(value) >= _HUGE:
        return _signed(repr(float(value)))
    exact = Decimal(f"{value:.{_EXACT - 1}e}")
    if abs(exact) < _NOISE[places]:
        exact = Decimal(0)
    return _short(f"{exact.quantize(_UNITS[places], rounding, _ARITHMETIC):f}")


def _short(text: str) -> str:
    if "." in text:
        text = text.rstrip("0").rstrip(".")
    if text in ("-0", ""):
        return "0"
    return _signed(text)


def _signed(text: str) -> str:
    return text.replace("-", "−")


def _back(text: str) -> float:
    return float(text.replace("−", "-").replace("∞", "inf"))


def _beyond(value: float, limit: float, at_most: bool) -> bool:
    return value > limit if at_most else value < limit


def whatever_is_missing(what: str, low: float, high: float) -> str:
    """What a score that is not assessed in full may be: ``the score lies between 2 and 7``."""
    if low == high:
        return f"the {what} is {low:g} whatever is missing"
    return f"the {what} lies between {low:g} and {high:g}"
