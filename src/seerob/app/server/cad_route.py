"""``POST /cad/<name>``: a CAD file that a page brings to the workstation which it edits.

Who may edit the file may do it, from the page's own origin; one file at a time. Files that it names come
before it (``?beside=<its name>``), under the names that it has for them. The answer is lines of JSON:
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
MOST_BESIDE, MOST_TOGETHER = 500, 2 << 30
"""Files of one folder, and their sum [byte]."""
MOST_TOLD = 200
"""Findings, and things that changed, that are told to the page; the table has them all."""
_NAME = re.compile(r"[A-Za-z0-9_\-][A-Za-z0-9_.\-]{0,80}\.[A-Za-z0-9]{1,8}")
_BESIDE = re.compile(r"(?!\.|import-.*\.json$)[^/\\\x00-\x1f\x7f]{1,120}")
"""Names that a file may have for others; tables are this program's own."""
_VALUES = {
    "units": re.compile("[a-z]{0,4}"),
    "up": re.compile("[xyz]?"),
    "accept": re.compile(r"[\d,]{0,100}"),
    "ground": re.compile(r"[\w/.\-]{0,500}"),
    **dict.fromkeys(("tolerance", "smaller", "unreachable", "triangles"), re.compile(r"[\d.eE+\-]{0,20}")),
    **dict.fromkeys(("density", "without"), re.compile(r"[^\x00-\x1f\x7f]{0,1000}")),
}

Reading = Callable[[Path, Path, str, Mapping[str, str], Mapping[str, Any]], AsyncIterator[dict[str, Any]]]
"""Reads a file in a process of its own: `seerob.app.importing.dropped.read_apart`."""
Changes = Callable[
    [bytes, Path, str, str], tuple[tuple[Change, ...], tuple[tuple[str, str], ...], dict[str, Any]]
]
"""Says what of a workstation file changes: `seerob.app.importing.dropped.changes`."""
Former = Callable[[bytes, Path, str], Mapping[str, Any]]
"""Says the options of before: `seerob.app.importing.dropped.former`."""


class Bringing:
    """Takes files of pages, one at a time.

    Args:
        desk: Whose workstation file they are for.
        read: Reads one.
        changes: Says what of the workstation file changes.
        former: Says with which options a file was read before.
    """

    def __init__(self, desk: Desk, read: Reading, changes: Changes, former: Former) -> None:
        self._desk, self._read, self._changes, self._former = desk, read, changes, former
        self._busy = asyncio.Lock()

    async def answer(self, request: Request) -> Response:
        """Take a file, or read the one again that was taken (``?again``), as with axes that are accepted."""
        name = request.path_params["name"]
        if Role.CONTROL not in request.scope["state"]["roles"]:
            return PlainTextResponse("this page may not edit\n", 403)
        asked = dict(request.query_params)
        again = asked.pop("again", None) is not None
        main = asked.pop("beside", name)
        if not _NAME.fullmatch(main) or ".." in main:
            return PlainTextResponse("letters, digits, _ - and . with an ending, please\n", 400)
        if not _BESIDE.fullmatch(name):
            return PlainTextResponse("no such name\n", 400)
        if any(key not in _VALUES or not _VALUES[key].fullmatch(value) for key, value in asked.items()):
            return PlainTextResponse("no such option\n", 400)
        if int(request.headers.get("content-length") or 0) > MOST_BYTES:
            return PlainTextResponse(f"more than {MOST_BYTES >> 20} MiB\n", 413)
        if self._busy.locked():
            return PlainTextResponse("another file is being read\n", 409)
        async with self._busy:
            stem = Path(main).stem
            folder = self._desk.file.resolve().parent / IMPORTED / stem
            file = folder / name
            if folder.resolve() != folder:
                return PlainTextResponse("its folder is a link\n", 403)
            if again and not file.is_file():
                return PlainTextResponse("there is no such file here yet\n", 404)
            if not again and (refusal := await self._take(request, file)) is not None:
                return refusal
            if name != main:
                return Response(status_code=204)
        under = f"{IMPORTED}/{stem}"
        return StreamingResponse(self._told(file, folder, under, asked), media_type="application/x-ndjson")

    async def _take(self, request: Request, file: Path) -> Response | None:
        """Put what comes into a file, whole or not at all; the refusal, where it is one."""
        coming = file.with_name(f".{file.name}.coming")
        size = 0
        try:
            file.parent.mkdir(parents=True, exist_ok=True)
            others = [f.stat().st_size for f in file.parent.iterdir() if f.is_file() and f != file]
            if len(others) >= MOST_BESIDE or sum(others) > MOST_TOGETHER:
                return PlainTextResponse("too many files in its folder\n", 507)
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
            raw, _ = self._desk.newest
            former = await asyncio.to_thread(self._former, raw, folder, str(self._desk.file))
            reading = self._read(file, folder, under, options, former)
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
            "options": made["options"],
        }
