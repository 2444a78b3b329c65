"""The report on paper: printed to PDF by a browser that is installed, or by WeasyPrint where none is."""

from __future__ import annotations

import logging
import os
import shutil
import subprocess
from pathlib import Path
from tempfile import TemporaryDirectory

from seerob.core.errors import InputError
from seerob.core.extras import MissingPackage, need

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome", "msedge")
"""That print by the same options, as they are found on the path; ``CHROMIUM`` names another."""
QUIETLY = (
    "--headless",
    "--disable-gpu",
    "--no-first-run",
    "--disable-extensions",
    "--disable-sync",
    "--disable-background-networking",
    "--disable-component-update",
    "--no-pdf-header-footer",
)
_TAIL = 1024
"""Of a file in which its end mark is [bytes]."""
_NARROWER = ".overview td:last-child { min-width: 0 !important; width: 34%; }"
"""WeasyPrint lets a table grow beyond the page for what its columns want at least."""
LONGEST = 180.0
"""After which a browser does not print any more [s]."""


def browser() -> str | None:
    """Path of a browser that prints; None where WeasyPrint does.

    Raises:
        InputError: Neither is installed, or WeasyPrint lacks a library of the system.
    """
    named = os.environ.get("CHROMIUM", "")
    for name in (named, *BROWSERS):
        if name and (found := shutil.which(name)):
            return found
    try:
        need("weasyprint")
    except MissingPackage:
        remedy = (
            "install one, name it by CHROMIUM=/path/to/chromium, pip install 'seerob[print]', "
            "or print report.html from any browser"
        )
        raise InputError.at("report", "pdf", "no Chromium, Chrome or Edge is installed", remedy) from None
    except OSError as error:
        remedy = "install Pango by your system's packages, or a Chromium, Chrome or Edge"
        raise InputError.at("report", "pdf", f"WeasyPrint cannot be loaded: {error}", remedy) from error
    return None


def _printed_without_browser(page: bytes) -> bytes:
    from weasyprint import CSS, HTML
    from weasyprint.urls import URLFetcher

    # What it does not know of the style is none of the reader's; what it fails to load is.
    logging.getLogger("weasyprint").setLevel(logging.ERROR)
    # Everything is in the page; nothing else is read or fetched.
    html = HTML(string=page.decode(), url_fetcher=URLFetcher(allowed_protocols={"data"}))
    pdf: bytes = html.write_pdf(stylesheets=[CSS(string=_NARROWER)])
    return pdf


def printed(page: bytes) -> bytes:
    """PDF of a page that needs nothing else.

    Raises:
        InputError: Neither a browser nor WeasyPrint is there, or the browser prints nothing.
    """
    path = browser()
    if path is None:
        return _printed_without_browser(page)
    with TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "report.html").write_bytes(page)
        command = [
            path,
            *QUIETLY,
            f"--user-data-dir={folder}/profile",
            f"--print-to-pdf={folder}/report.pdf",
        ]
        if hasattr(os, "geteuid") and os.geteuid() == 0:
            # It refuses to be root with one; the page is ours and runs nothing.
            command.append("--no-sandbox")
        try:
            done = subprocess.run(  # noqa: S603 - a browser of the user's, and a file of ours
                [*command, (folder / "report.html").as_uri()],
                capture_output=True,
                timeout=LONGEST,
                check=False,
                cwd=folder,
            )
        except subprocess.TimeoutExpired as error:
            what = f"{command[0]} did not print within {LONGEST:g} s"
            raise InputError.at("report", "pdf", what, "print the report from it by hand") from error
        made = folder / "report.pdf"
        pdf = made.read_bytes() if made.is_file() else b""
        # One that is killed, or whose disk is full, leaves a beginning.
        whole = pdf.startswith(b"%PDF") and b"%%EOF" in pdf[-_TAIL:] and not done.returncode
        if not whole:
            said = done.stderr.decode(errors="replace").strip().splitlines()[-1:] or ["without a word"]
            what = f"{command[0]} ended with {done.returncode} and no whole PDF ({said[0][:200]})"
            raise InputError.at("report", "pdf", what, "print the report from a browser by hand")
        return pdf
