"""The report on paper: printed to PDF by a browser that is installed."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path
from tempfile import TemporaryDirectory

from seerob.core.errors import InputError

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
LONGEST = 180.0
"""After which a browser does not print any more [s]."""


def browser() -> str:
    """Path of a browser that prints.

    Raises:
        InputError: None is installed.
    """
    named = os.environ.get("CHROMIUM", "")
    for name in (named, *BROWSERS):
        if name and (found := shutil.which(name)):
            return found
    remedy = "install one, name it by CHROMIUM=/path/to/chromium, or print report.html from any browser"
    raise InputError.at("report", "pdf", "no Chromium, Chrome or Edge is installed", remedy)


def printed(page: bytes) -> bytes:
    """PDF of a page that needs nothing else.

    Raises:
        InputError: No browser is there, or it prints nothing.
    """
    with TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "report.html").write_bytes(page)
        command = [
            browser(),
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
