"""Cancellations as asyncio knows them, of libraries that raise a kind of their own."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def plainly_cancelled() -> Iterator[None]:
    """Pass on any cancellation as `asyncio.CancelledError` itself.

    In Python 3.11 `asyncio.timeout` takes no other for its own. wait_for2, which asyncua waits with, raises a
    subclass where an answer comes together with the cancellation: no time-out would follow, and the program
    would end.
    """
    try:
        yield
    except asyncio.CancelledError as error:
        if type(error) is asyncio.CancelledError:
            raise
        raise asyncio.CancelledError(*error.args) from error
