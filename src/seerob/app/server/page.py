"""The built page's files: only what is listed is served, so that no path can lead elsewhere."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from time import monotonic

from starlette.responses import HTMLResponse, PlainTextResponse, Response

FOLDER = Path(__file__).parent / "page"

_TYPES = {
    # Written down: some systems' own tables call JavaScript text/plain, which a browser refuses.
    ".css": "text/css; charset=utf-8",
    ".html": "text/html; charset=utf-8",
    ".ico": "image/x-icon",
    ".js": "text/javascript; charset=utf-8",
    ".json": "application/json",
    ".map": "application/json",
    ".mjs": "text/javascript; charset=utf-8",
    ".png": "image/png",
    ".svg": "image/svg+xml",
    ".txt": "text/plain; charset=utf-8",
    ".webmanifest": "application/manifest+json",
    ".woff2": "font/woff2",
}

_NOT_BUILT = """<!doctype html><html lang="en"><meta charset="utf-8"><title>seerob: page not built</title>
<h1>The page is not built</h1>
<p>The server runs, but the files of its page are not there. In a checkout of the repository, run</p>
<pre>make web</pre><p>and reload. A released package contains them.</p></html>
"""


def files(folder: Path) -> dict[str, Path]:
    """Files below a folder by path as asked for, without links and hidden ones."""
    return {
        path.relative_to(folder).as_posix(): path
        for path in folder.rglob("*")
        if path.is_file() and not path.is_symlink() and not path.name.startswith(".")
    }


LISTED = 1.0
"""How long the list of a folder's files counts [s]: long enough that requests without end do not read it
each time, short enough for a page that is built anew."""


@lru_cache(8)
def _files(folder: Path, _: int) -> dict[str, Path]:
    return files(folder)


def answer(folder: Path, path: str) -> Response:
    """The file at ``path`` (the page itself when empty); 503 when the page was not built."""
    listed = _files(folder, int(monotonic() / LISTED))
    if "index.html" not in listed:
        return HTMLResponse(_NOT_BUILT, 503)
    file = listed.get(path or "index.html")
    if file is None:
        return PlainTextResponse("no such file\n", 404)
    kind = _TYPES.get(file.suffix.lower(), "application/octet-stream")
    return Response(file.read_bytes(), media_type=kind, headers={"Cache-Control": "no-store"})
