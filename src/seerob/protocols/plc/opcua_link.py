"""The socket below an OPC UA session, which asyncua leaves open when it is cancelled or the link breaks."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from asyncua.client.client import Client


def hang_up(link: Any) -> None:
    """Close the socket of a link, if there is one; the loop does it next.

    Args:
        link: ``client.uaclient.protocol`` of asyncua; None before there was one.
    """
    if link is not None and link.transport is not None:
        link.transport.close()


@contextmanager
def hung_up_on_failure(client: Client) -> Iterator[None]:
    """Leave no socket open when connecting fails, or is cancelled."""
    try:
        yield
    except BaseException:
        hang_up(client.uaclient.protocol)
        raise
