"""``seerob compare``: what differs between two runs or workstations, and which verdicts turned."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING

from seerob.app.console.loading import compiled
from seerob.app.console.progress import lines
from seerob.app.console.terminal import OUT, Exit, add_allowed, allowed, line

if TYPE_CHECKING:
    from seerob.outputs.comparison import Comparison
    from seerob.session.station import Station

HELP = "compare two runs or workstations: what changed, which verdicts turned, margins side by side"
EXAMPLE = "seerob compare runs/monday runs/tuesday --html compared.html"

_ENDS = (
    "ends with 0 when no verdict became worse, 1 when one turned to exceeded, 2 when one turned to undecided "
    "or is not judged any more"
)
_STYLE = {"exceeded": "bold red", "undecided": "yellow", "within": "cyan", "same": "dim", "new": ""}


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments, and how it ends, which is not as a verdict does."""
    sub.description = f"{HELP}; {_ENDS}"
    for name, which in (("before", "a"), ("after", "the other")):
        text = f"{which} recording, folder of a run, or workstation, which is run"
        sub.add_argument(name, type=Path, help=text)
    sub.add_argument("--json", action="store_true", help="all of it as JSON on standard output")
    sub.add_argument("--html", type=Path, metavar="FILE", help="write a page, with pictures")
    text = "pictures of so many criteria that turned, each pair from one viewpoint (default: 4)"
    sub.add_argument("--pictures", type=int, default=4, metavar="N", help=text)
    add_allowed(sub)


def run(options: argparse.Namespace) -> int:
    """Compare; 0 when no verdict became worse, 1 when one turned to EXCEEDED, 2 when one to UNDECIDED."""
    from seerob.outputs.sinks.dossier import write_whole
    from seerob.session.comparing import compare

    def opened(path: Path) -> Station:
        return compiled(path, allowed(options), quiet=options.json)

    tell = lines()
    found = compare(
        options.before,
        options.after,
        pictures=options.pictures if options.html else 0,
        opened=opened,
        say=lambda what, t: None if options.json else tell(f"{what}: {t:.1f} s"),
    )
    if options.html:
        write_whole(options.html, found.html().encode())
    if options.json:
        OUT.print(json.dumps(found.json(), ensure_ascii=False, indent=1, allow_nan=False), markup=False)
    else:
        _tell(found)
        if options.html:
            line("wrote", str(options.html))
    codes = {"exceeded": Exit.EXCEEDED, "undecided": Exit.UNDECIDED}
    return codes.get(found.turn.value, Exit.WITHIN)


def _tell(found: Comparison) -> None:
    from seerob.outputs.comparison import decided_words, margin_words

    line("before", found.before.title, "bold")
    line("after", found.after.title, "bold")
    for text in found.conditions:
        line("differs", text, "yellow")
    if found.changes is None:
        line("file", "one of the two keeps none", "yellow")
    for change in found.changes or ():
        line("changed", str(change))
    for text in found.files:
        line("file", text)
    for one in found.criteria:
        then, now = one.verdicts
        words = now if then == now else f"{then} → {now}"
        margins = [margin_words(series) for series in (one.before, one.after)]
        text = f"{one.name}: {words}; {margins[0] if margins[0] == margins[1] else ' → '.join(margins)}"
        if (share := decided_words(one)) not in ("100 %", "–"):
            text += f"; decided {share}"
        line(one.turn.value, "; ".join((text, *one.notes)), _STYLE[one.turn.value])
    line("", found.sentence())
