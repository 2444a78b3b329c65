"""Scores: from published tables, at thresholds, and where only a span of them is known.

The least score and the greatest are carried along side by side. A sum of spans and a table that grows in
each argument keep them exact, as long as what goes in varies independently.

An angle at a threshold follows one rule for all methods, on the stricter side: what is measured is never
exactly 45°. What is computed may be, and then the last bit decides, which changes
with where a person stands and faces. So an angle within rounding of a threshold counts as beyond it, away
from the neutral posture, whatever side a method's wording gives the edge itself to.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable
from functools import cache, reduce
from importlib.resources import files
from typing import Annotated, Any, NamedTuple, overload

import numpy as np
from msgspec import Meta, Struct
from numpy.typing import ArrayLike, NDArray

from seerob.core.domains import whole
from seerob.core.transforms import Array

Ints = NDArray[np.int64]


@cache
def published(name: str) -> dict[str, Any]:
    """One of the files in ``data/``, by name without ending."""
    return tomllib.loads(files("seerob.criteria.scoring").joinpath(f"data/{name}.toml").read_text("utf-8"))


@cache
def cells(name: str, key: str) -> Ints:
    """A table of whole numbers as a read-only array."""
    array = np.array(published(name)[key], np.int64)
    array.flags.writeable = False
    return array


Angle = Annotated[float, Meta(ge=0, le=math.pi, extra={"unit": "rad"}, extra_json_schema={"x-unit": "rad"})]


def _deg(angle: float) -> float:
    return math.radians(angle)


class Thresholds(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Angles at which a posture counts as upright, twisted, bent, raised and so on; all are choices."""

    trunk_upright: Angle = _deg(5)
    """Trunk within this of the vertical is upright [rad]; published: 2 to 7°."""
    trunk_twist: Angle = _deg(10)
    """Trunk twisted beyond [rad]; published: 15 to 25°."""
    trunk_side_bend: Angle = _deg(10)
    """Trunk bent sideways beyond [rad]; published: 3 to 30°."""
    neck_extension: Angle = _deg(5)
    """Neck in extension beyond [rad]; published: 0 to 5°."""
    neck_twist: Angle = _deg(10)
    """Neck twisted beyond [rad]; published: 15 to 20°."""
    neck_side_bend: Angle = _deg(10)
    """Neck bent sideways beyond [rad]; published: 8 to 20°."""
    arm_abducted: Angle = _deg(20)
    """Upper arm abducted beyond [rad]; published: 20 to 45°."""
    arm_rotated: Angle = _deg(45)
    """Upper arm rotated about its long axis beyond [rad], REBA only; no published value was found."""
    shoulder_raised: Angle = _deg(5)
    """Shoulder raised: clavicle above its place in the upright posture by more [rad]; published: 5°."""
    forearm_out: Angle = _deg(45)
    """Forearm out to the side beyond [rad], RULA only; a choice."""
    wrist_across: Angle = 0.0
    """Wrist beyond the middle of the trunk, seen from the shoulder, by more [rad], RULA only."""
    wrist_neutral: Angle = _deg(5)
    """Wrist within this of straight is neutral [rad], RULA only; published: 1 to 5°."""
    wrist_deviation: Angle = _deg(10)
    """Wrist deviated beyond [rad]; published: 5 to 10°."""
    forearm_rotation: Angle = _deg(45)
    """Forearm turned from thumb up beyond [rad]: near the end of its range; published: 30 to 45°."""
    foot_rise: Angle = _deg(7)
    """One foot above the other, over the length of the leg, beyond [rad]: on one leg; published: 100 mm."""
    knee_difference: Angle = _deg(15)
    """Knees bent by different angles beyond [rad]: weight not even, RULA only; published: 15°."""


LARGEST = 10**9
"""No method has a score beyond."""
ROUNDING = 1e-6
"""Angles that differ by less [rad] are the same: no device is as good, and no rounding of ours as bad."""


@overload
def reached(angle: float, edge: float) -> bool: ...


@overload
def reached(angle: Array, edge: float) -> NDArray[np.bool_]: ...


def reached(angle: Array | float, edge: float) -> NDArray[np.bool_] | bool:
    """Whether an angle is at an edge or beyond it [rad]; at an edge of 0, which is neutral, only beyond.

    What is not a number is, so that it never scores least.
    """
    below = angle < (edge - ROUNDING if edge else ROUNDING)
    return not below if type(angle) is float else np.asarray(~np.asarray(below))


@overload
def fallen(angle: float, edge: float) -> bool: ...


@overload
def fallen(angle: Array, edge: float) -> NDArray[np.bool_]: ...


def fallen(angle: Array | float, edge: float) -> NDArray[np.bool_] | bool:
    """Whether an angle is at an edge or below it [rad]; at an edge of 0 only below."""
    return reached(-angle, -edge)


def any_of(values: Array | float) -> bool:
    """Whether any of some numbers is not 0."""
    return bool(values) if type(values) is float else bool(np.count_nonzero(values))


class Span(NamedTuple):
    """Least and greatest score; equal when it is known."""

    low: Ints
    high: Ints

    def __add__(self, other: object) -> Span:
        """Sum of two independent scores."""
        if not isinstance(other, Span):
            return NotImplemented
        return Span(self.low + other.low, self.high + other.high)

    def at_least(self, least: int) -> Span:
        """Raise both ends of the span to at least ``least``."""
        return Span(np.maximum(self.low, least), np.maximum(self.high, least))

    @property
    def known(self) -> bool:
        """Whether least and greatest agree everywhere."""
        return bool(np.array_equal(self.low, self.high))


def exactly(score: ArrayLike) -> Span:
    """A score that is known, a whole number; ValueError for what is none."""
    array = _scores(score)
    return Span(array, array)


def between(low: ArrayLike, high: ArrayLike) -> Span:
    """A score of which the ends are known, whole numbers; ValueError for what are none, or fall."""
    span = Span(_scores(low), _scores(high))
    if np.count_nonzero(span.low > span.high):
        raise ValueError("a score is at least more than it is at most")
    return span


def _scores(given: ArrayLike) -> Ints:
    found = np.asarray(given)
    if found.dtype.kind in "iub":
        return np.asarray(found, np.int64)
    return whole("score", found, -LARGEST, LARGEST)


def answer(yes: bool | None) -> Span:
    """1 for yes, 0 for no, both when nobody said."""
    return between(0, 1) if yes is None else exactly(int(yes))


def graded(
    angle: Array,
    score: Callable[[Array], Ints],
    *,
    within: tuple[int, int],
    accuracy: Array | float = 0.0,
    neutral: float = 0.0,
    rounding: Array | float = 0.0,
) -> Span:
    """Score of an angle that is known to ± ``accuracy``.

    Args:
        angle: [rad], shape (...); NaN is not assessed and may be any score.
        score: Least at ``neutral`` and never less further away from it, on either side.
        within: Least and greatest score that there is.
        accuracy: [rad], of a shape that fits ``angle``.
        neutral: [rad]
        rounding: How far rounding alone may turn it [rad], shaped likewise: the worst of that counts.
    """
    if any_of(accuracy) or any_of(rounding):
        first, last = angle - accuracy, angle + accuracy
        high = np.maximum(score(first - rounding), score(last + rounding))
        high = np.where(np.asarray(rounding) >= np.pi, within[1], high)
        low = score(np.clip(neutral, first, last)) if any_of(accuracy) else high
    else:
        low = high = score(angle)
    missing = np.isnan(angle)
    if np.count_nonzero(missing):  # several times as fast as any() of a single angle
        low, high = np.where(missing, within[0], low), np.where(missing, within[1], high)
    return Span(low, high)


def beyond(
    angle: Array,
    threshold: float,
    *,
    accuracy: Array | float = 0.0,
    signed: bool = False,
    rounding: Array | float = 0.0,
) -> Span:
    """1 where an angle, or its size unless ``signed``, is at a threshold or beyond it; else 0."""
    if signed:
        return graded(
            angle,
            lambda x: reached(x, threshold).astype(np.int64),
            within=(0, 1),
            accuracy=accuracy,
            neutral=-np.inf,
            rounding=rounding,
        )
    return graded(
        angle,
        lambda x: reached(np.abs(x), threshold).astype(np.int64),
        within=(0, 1),
        accuracy=accuracy,
        rounding=rounding,
    )


def either(*spans: Span) -> Span:
    """The greatest of several scores: ``twisted or bent`` counts once."""
    return Span(reduce(np.maximum, [s.low for s in spans]), reduce(np.maximum, [s.high for s in spans]))
