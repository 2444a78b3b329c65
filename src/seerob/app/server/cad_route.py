"""``POST /cad/<name>``: a CAD file that a page brings to the workstation which it edits.

Who may edit the file may do it, from the page's own origin; one file at a time. The answer is lines of JSON:
``say`` while it is read, and at last ``problems``, or what was found with the number by which the page asks
for its changes (`seerob.core.page_messages.Edit.brought`).
"""

from __future__ import annotations

import asyncio
import json
import re
from collections.abc import AsyncIterator, Callable, Mapping
from pathlib import Path
from typing import Any

from starlette.requests import ClientDisconnect, Request
from starlette.responses import PlainTextResponse, Response, StreamingResponse

from seerob.app.server.access import Role
from seerob.app.server.desk import Desk
from seerob.core.errors import InputError
from seerob.core.snapshot import Change

MOST_BYTES = 512 << 20
"""No file is larger [byte]."""
SECONDS = 600.0
"""That bringing it may take."""
IMPORTED = "imported"
"""Folder beside the workstation file."""
MOST_TOLD = 200
"""Findings, and things that changed, that are told to the page; the table has them all."""
_NAME = re.compile(r"[A-Za-z0-9_\-][A-Za-z0-9_.\-]{0,80}\.[A-Za-z0-9]{1,8}")
_VALUES = {
    "units": re.compile("[a-z]{1,4}"),
    "up": re.compile("[xyz]"),
    "accept": re.compile(r"[\d,]{1,100}"),
}

Reading = Callable[[Path, Path, str, Mapping[str, str]], AsyncIterator[dict[str, Any]]]
"""Reads a file in a process of its own: `seerob.app.importing.dropped.read_apart`."""
Changes = Callable[
    [bytes, Path, str, str], tuple[tuple[Change, ...], tuple[tuple[str, str], ...], dict[str, Any]]
]
"""Says what of a workstation file changes: `seerob.app.importing.dropped.changes`."""


class Bringing:
    """Takes files of pages, one at a time.

    Args:
        desk: Whose workstation file they are for.
        read: Reads one.
        changes: Says what of the workstation file changes.
    """

    def __init__(self, desk: Desk, read: Reading, changes: Changes) -> None:
        self._desk, self._read, self._changes = desk, read, changes
        self._busy = asyncio.Lock()

    async def answer(self, request: Request) -> Response:
        """Take a file, or read the one again that was taken (``?again``), as with axes that are accepted."""
        name = request.path_params["name"]
        if Role.CONTROL not in request.scope["state"]["roles"]:
            return PlainTextResponse("this page may not edit\n", 403)
        if not _NAME.fullmatch(name) or ".." in name:
            return PlainTextResponse("letters, digits, _ - and . with an ending, please\n", 400)
        asked = dict(request.query_params)
        again = asked.pop("again", None) is not None
        if any(key not in _VALUES or not _VALUES[key].fullmatch(value) for key, value in asked.items()):
            return PlainTextResponse("no such option\n", 400)
        if int(request.headers.get("content-length") or 0) > MOST_BYTES:
            return PlainTextResponse(f"more than {MOST_BYTES >> 20} MiB\n", 413)
        if self._busy.locked():
            return PlainTextResponse("another file is being read\n", 409)
        async with self._busy:
            stem = Path(name).stem
            folder = self._desk.file.resolve().parent / IMPORTED / stem
            file = folder / name
            if folder.resolve() != folder:
                return PlainTextResponse("its folder is a link\n", 403)
            if again and not file.is_file():
                return PlainTextResponse("there is no such file here yet\n", 404)
            if not again and (refusal := await self._take(request, file)) is not None:
                return refusal
        under = f"{IMPORTED}/{stem}"
        return StreamingResponse(self._told(file, folder, under, asked), media_type="application/x-ndjson")

    async def _take(self, request: Request, file: Path) -> Response | None:
        """Put what comes into a file, whole or not at all; the refusal, where it is one."""
        coming = file.with_name(f".{file.name}.coming")
        size = 0
        try:
            file.parent.mkdir(parents=True, exist_ok=True)
            async with asyncio.timeout(SECONDS):
                with coming.open("wb") as opened:
                    async for piece in request.stream():
                        size += len(piece)
                        if size > MOST_BYTES:
                            return PlainTextResponse(f"more than {MOST_BYTES >> 20} MiB\n", 413)
                        await asyncio.to_thread(opened.write, piece)
            if not size:
                return PlainTextResponse("an empty file\n", 400)
            coming.replace(file)
        except (TimeoutError, ClientDisconnect):
            return PlainTextResponse("did not come whole\n", 408)
        except OSError as error:
            return PlainTextResponse(f"cannot be kept: {error.strerror}\n", 507)
        finally:
            coming.unlink(missing_ok=True)
        return None

    async def _told(
        self, file: Path, folder: Path, under: str, options: Mapping[str, str]
    ) -> AsyncIterator[bytes]:
        async with self._busy:
            reading = self._read(file, folder, under, options)
            try:
                async for told in reading:
                    found = await self._found(folder, told["table"]) if "table" in told else told
                    yield json.dumps(found).encode() + b"\n"
            finally:
                await reading.aclose()  # type: ignore[attr-defined]

    async def _found(self, folder: Path, table: str) -> dict[str, Any]:
        raw, revision = self._desk.newest
        try:
            changes, told, made = await asyncio.to_thread(
                self._changes, raw, folder, table, str(self._desk.file)
            )
        except InputError as error:
            return {"problems": [tuple(problem) for problem in error.problems][:20]}
        return {
            "brought": self._desk.keep(changes, revision) if changes else 0,
            "parts": len(made["parts"]),
            "robots": len(made["robots"]),
            "told": told[:MOST_TOLD],
            "findings": made["findings"][:MOST_TOLD],
            "left_out": made["left_out"][:MOST_TOLD],
            "axes": made["axes"],
            "accepted": made["accepted"],
        }
