"""What is worked out once of a thing that nobody changes, and remembered for as long as the thing lives.

Cell after cell has the same robots and people of the library, link by link the same objects.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import TypeVar
from weakref import WeakKeyDictionary

T = TypeVar("T")
R = TypeVar("R")


def remembered(function: Callable[[T], R]) -> Callable[[T], R]:
    """A function of one frozen thing that is told apart by which it is, not by what it equals.

    Its answer must not refer to the thing, which would live for ever, and nobody may change it.
    """
    known: WeakKeyDictionary[T, R] = WeakKeyDictionary()

    @wraps(function)
    def once(thing: T) -> R:
        found = known.get(thing, known)
        if found is known:
            found = known[thing] = function(thing)
        return found  # type: ignore[return-value]

    return once
