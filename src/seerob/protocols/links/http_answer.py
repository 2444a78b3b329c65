"""Answers of web servers that are machines: bounded in size and time, errors in words."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from seerob.protocols import NotLetIn, ProtocolError

if TYPE_CHECKING:
    import httpx

LARGEST = 1 << 20
"""Answer [byte]."""


class Question:
    """A request, to be sent once or again and again; redirections are not followed.

    Args:
        client: With its time-out and its trusted certificates.
        method: ``GET`` or ``POST``.
        url: Where to.
        who: Answers, for messages: ``the PLC``.
        headers: Of the request.
        content: Of the request.
    """

    def __init__(
        self,
        client: httpx.AsyncClient,
        method: str,
        url: str,
        *,
        who: str,
        headers: Mapping[str, str],
        content: bytes | None = None,
    ) -> None:
        self._client, self._method, self._url, self._who = client, method, url, who
        self._headers, self._content = headers, content
        self._request: httpx.Request | None = None

    async def answer(self) -> bytes:
        """Ask.

        Raises:
            OSError: There is no answer.
            NotLetIn: Who asks is not known, or may not.
            ProtocolError: It is too large, or no success.
        """
        import httpx

        try:
            said = await self._client.send(self._asked(), stream=True)
            try:
                return await self._whole(said)
            finally:
                await said.aclose()
        except httpx.TimeoutException as error:
            raise TimeoutError("no answer in time") from error
        except (httpx.HTTPError, httpx.InvalidURL) as error:
            raise ConnectionError(str(error) or type(error).__name__) from error

    def _asked(self) -> httpx.Request:
        # Made once, but for a server that gives cookies, or has taken them back.
        if self._request is None or self._client.cookies or "Cookie" in self._request.headers:
            self._request = self._client.build_request(
                self._method, self._url, headers=self._headers, content=self._content
            )
        return self._request

    async def _whole(self, said: httpx.Response) -> bytes:
        import httpx

        if said.status_code in (httpx.codes.UNAUTHORIZED, httpx.codes.FORBIDDEN):
            code = said.status_code
            raise NotLetIn(f"{self._who} answers with HTTP {code}: it wants another login or token")
        if said.status_code != httpx.codes.OK:
            raise ProtocolError(f"{self._who} answers with HTTP {said.status_code}")
        found = bytearray()
        async for chunk in said.aiter_bytes():
            found += chunk
            if len(found) > LARGEST:
                raise ProtocolError(f"an answer of more than {LARGEST >> 20} MiB")
        return bytes(found)
