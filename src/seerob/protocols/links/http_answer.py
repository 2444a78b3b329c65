"""Answers of web servers that are machines: bounded in size and time, errors in words."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from seerob.protocols import NotLetIn, ProtocolError

if TYPE_CHECKING:
    import httpx

LARGEST = 1 << 20
"""Answer [byte]."""


async def answer(
    client: httpx.AsyncClient,
    method: str,
    url: str,
    *,
    who: str,
    headers: Mapping[str, str],
    content: bytes | None = None,
) -> bytes:
    """The answer to a request; redirections are not followed.

    Args:
        client: With its time-out and its trusted certificates.
        method: ``GET`` or ``POST``.
        url: Where to.
        who: Answers, for messages: ``the PLC``.
        headers: Of the request.
        content: Of the request.

    Raises:
        OSError: There is none.
        NotLetIn: Who asks is not known, or may not.
        ProtocolError: It is too large, or no success.
    """
    import httpx

    try:
        async with client.stream(method, url, content=content, headers=headers) as said:
            if said.status_code in (httpx.codes.UNAUTHORIZED, httpx.codes.FORBIDDEN):
                raise NotLetIn(f"{who} answers with HTTP {said.status_code}: it wants another login or token")
            if said.status_code != httpx.codes.OK:
                raise ProtocolError(f"{who} answers with HTTP {said.status_code}")
            found = bytearray()
            async for chunk in said.aiter_bytes():
                found += chunk
                if len(found) > LARGEST:
                    raise ProtocolError(f"an answer of more than {LARGEST >> 20} MiB")
            return bytes(found)
    except httpx.TimeoutException as error:
        raise TimeoutError("no answer in time") from error
    except (httpx.HTTPError, httpx.InvalidURL) as error:
        raise ConnectionError(str(error) or type(error).__name__) from error
