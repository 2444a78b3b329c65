"""Values in JSON documents that machines send: where each is, and when it was so."""

from __future__ import annotations

from datetime import UTC, datetime

from seerob.protocols.links.json_pointer import at, parts

MILLISECONDS = 1e11
"""A time above it is in milliseconds since 1970, below in seconds."""
LATEST = 1e15
"""No clock counts further [ms]: also what is not finite is no time."""
AHEAD = 1.0
"""Of clocks that differ by more nobody knows how old a value is [s]."""


def value_and_time(
    document: object, pointer: str, time: str | None, *, now: float
) -> tuple[object, float, float | None]:
    """A value, how old it is [s], and when it was so [s since 1970]; 0 and None when nothing says it.

    Args:
        document: As it was sent.
        pointer: JSON pointer to the value.
        time: JSON pointer to when it was so.
        now: Wall clock [s since 1970].

    Raises:
        KeyError: A pointer leads nowhere.
        ValueError: What is said to be a time is none, or lies in the future.
    """
    value = at(document, parts(pointer))
    if time is None:
        return value, 0.0, None
    stamp = instant(at(document, parts(time)))
    age = now - stamp
    if age < -AHEAD:
        what = f"its time is {-age:.3g} s ahead of this computer's clock, so nobody knows how old it is"
        raise ValueError(f"{what}: set both clocks, or state the zone of a local time")
    return value, max(0.0, age), stamp


def instant(value: object) -> float:
    """Seconds since 1970 of a number of seconds or milliseconds, or of an ISO 8601 text.

    Raises:
        ValueError: It is no time.
    """
    if isinstance(value, str):
        stamp = datetime.fromisoformat(value)
        return (stamp if stamp.tzinfo else stamp.replace(tzinfo=UTC)).timestamp()
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < LATEST:
        raise ValueError(f"{str(value)[:40]!r} is no time")
    return 1e-3 * value if abs(value) > MILLISECONDS else float(value)
