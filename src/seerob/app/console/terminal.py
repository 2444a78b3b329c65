"""The commands of the command line, one file each, and the words they share.

What is logged, as a terminal may have it.
"""

from __future__ import annotations

import argparse
import json
import logging
import math
import re
import sys
from collections import Counter
from collections.abc import Iterable, Sequence
from datetime import datetime
from enum import IntEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import msgspec
from rich.console import Console as RichConsole

from seerob.core.figures import against, with_unit
from seerob.core.printable import printable
from seerob.core.snapshot import Event, Finding, Verdict
from seerob.workstation.allowed import Allowed

if TYPE_CHECKING:
    from seerob.recording.bone_errors import BoneErrors
    from seerob.recording.result_log import Series
    from seerob.session.run import Summary
    from seerob.session.station import Station


class PrintableLines(logging.Formatter):
    """What is logged, which may quote a device, `printable`."""

    def format(self, record: logging.LogRecord) -> str:
        """The line, and the traceback where there is one."""
        return printable(super().format(record))


class Console(RichConsole):
    """A console that leaves a closed pipe to `seerob.app.cli.main`: rich would exit with 1, exceeded."""

    def on_broken_pipe(self) -> None:
        """Called while a `BrokenPipeError` is handled."""
        raise BrokenPipeError


OUT = Console(highlight=False, soft_wrap=True, emoji=False)
STATUS = Console(highlight=False, soft_wrap=True, emoji=False, stderr=True)
"""For progress: what is piped on stays clean."""

WORDS = {
    Verdict.WITHIN: ("within", "cyan"),
    Verdict.EXCEEDED: ("EXCEEDED", "bold red"),
    Verdict.UNDECIDED: ("undecided", "yellow"),
    None: ("", "dim"),
}

_WIDEST_NAME = 60
"""Characters of a name that results are lined up behind; a longer one moves only its own."""


_NEGATIVE, _OPTION = re.compile(r"-\.?\d"), re.compile(r"--[a-z][a-z-]*")


class Exit(IntEnum):
    """Exit codes."""

    WITHIN = 0
    EXCEEDED = 1
    UNDECIDED = 2
    ERROR = 3


class Leaves(SystemExit):
    """The words of the command line end the program, by ``--help`` or a mistake: no plug-in does."""


class Parser(argparse.ArgumentParser):
    """A parser whose mistakes end with `Exit.ERROR`: argparse's own 2 means undecided here."""

    def error(self, message: str) -> NoReturn:
        """Print the usage and the mistake, and leave."""
        self.print_usage(sys.stderr)
        self.exit(Exit.ERROR, f"{self.prog}: {message}\n")

    def exit(self, status: int = 0, message: str | None = None) -> NoReturn:
        """Print the message, and leave."""
        if message:
            sys.stderr.write(message)
        raise Leaves(status)

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Also values that begin with a minus, ``--to -60,70``: argparse takes them for options."""
        return super().parse_known_args(_joined(sys.argv[1:] if args is None else args), namespace)


def _joined(words: Sequence[str]) -> list[str]:
    """Words of which a negative number is one with the option before it; no option begins with a digit."""
    found: list[str] = []
    for word in words:
        if found and _NEGATIVE.match(word) and _OPTION.fullmatch(found[-1]) and "--" not in found:
            found[-1] += f"={word}"
        else:
            found.append(word)
    return found


def seconds(text: str) -> float:
    """A duration on the command line [s]; more than nothing, and finite."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0 < value < math.inf:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of seconds above 0")
    return value


def port(text: str) -> int:
    """A TCP port on the command line; 0 is any free one."""
    if not text.isascii() or not text.isdigit() or int(text) > 65535:
        raise argparse.ArgumentTypeError(f"{text!r} is not a port: give 1…65535, or 0 for any free one")
    return int(text)


def exit_code(verdict: Verdict | None) -> Exit:
    """Exit code of a verdict; a run in which nothing is judged is not within."""
    return {
        Verdict.WITHIN: Exit.WITHIN,
        Verdict.EXCEEDED: Exit.EXCEEDED,
        Verdict.UNDECIDED: Exit.UNDECIDED,
        None: Exit.UNDECIDED,
    }[verdict]


def line(word: str, text: str, style: str = "") -> None:
    """One line of calm output: a word, then what it is about."""
    OUT.print(f"{word:<12} ", style=style, end="", markup=False)
    OUT.print(printable(" ".join(text.splitlines())), markup=False)


def cache_folder() -> Path:
    """Where distance trees and convex pieces are kept between starts."""
    from platformdirs import user_cache_path

    return user_cache_path("seerob", appauthor=False)


def add_workstation(sub: argparse.ArgumentParser) -> None:
    """The argument that nearly every command takes."""
    sub.add_argument("workstation", type=Path, help="folder with a workstation.toml, or the file itself")
    add_allowed(sub)


def add_allowed(sub: argparse.ArgumentParser) -> None:
    """Options by which a file that is trusted may do more."""
    text = "import kinds of the file by their dotted names, which runs their code"
    sub.add_argument("--allow-plugins", action="store_true", help=text)
    text = "read files outside the folder of the workstation file that it or a description in it names"
    sub.add_argument("--allow-outside", action="store_true", help=text)


def allowed(options: argparse.Namespace) -> Allowed:
    """What the command line allows the workstation file to do."""
    return Allowed(options.allow_plugins, options.allow_outside)


def add_verbose(sub: argparse.ArgumentParser) -> None:
    """The option of commands that begin with what was found."""
    text = f"every finding, notes too; without it the first {MOST_FINDINGS}, and whatever warns"
    sub.add_argument("-v", "--verbose", action="store_true", help=text)


def add_output(sub: argparse.ArgumentParser, *, beside: str = "workstation") -> None:
    """Options of commands that write files."""
    text = f"folder to write to (default: runs/<time> beside the {beside})"
    sub.add_argument("-o", "--output", type=Path, help=text)
    sub.add_argument("--json", action="store_true", help="results as JSON on standard output")


def run_folder(near: Path, wanted: Path | None) -> Path:
    """A new folder for the files of one run: in ``runs``, of which ``near`` is one or has one."""
    if wanted is not None:
        return wanted
    # A recording lies in the folder of its run.
    runs = near.parent if near.absolute().parent.name == "runs" else near / "runs"
    stamp = datetime.now().strftime("%Y-%m-%dT%H-%M-%S")
    folder = runs / stamp
    n = 1
    while folder.exists():
        n += 1
        folder = runs / f"{stamp}-{n}"
    return folder


def describe(station: Station) -> None:
    """What was loaded, and what was assumed."""
    w = station.workstation
    parts = [
        f"{len(entries)} {noun}{'' if len(entries) == 1 else 's'}"
        for entries, noun in (
            (w.robots, "robot"),
            (w.humans, "human"),
            (w.tools, "tool"),
            (w.workpieces, "workpiece"),
            (w.parts, "part"),
            (w.machines, "machine"),
            (w.areas, "area"),
            (w.sensors, "sensor"),
            (w.sources, "source"),
        )
        if entries
    ]
    n = len(w.safety) + len(w.ergonomics)
    parts.append("1 criterion" if n == 1 else f"{n} criteria")
    line("workstation", f"{w.title}: {', '.join(parts)}", "bold")


MOST_FINDINGS = 10
"""Lines at the start, where nobody asks for more."""
_ABOUT = 6
"""Names before a finding there."""


def tell(findings: Iterable[Finding], *, verbose: bool = False) -> None:
    """Warnings and assumptions, equal ones in a line; notes are in the report.

    What holds a verdict and what warns stands there, however much it is.
    """
    from seerob.outputs.sentences import grouped

    found = [one for one in grouped(findings, None if verbose else _ABOUT) if verbose or one.level != "note"]
    least = sum(one.level == "warning" or bool(one.holds) for one in found)
    shown = found if verbose or len(found) <= MOST_FINDINGS else found[: max(least, MOST_FINDINGS - 1)]
    for one in shown:
        line(one.level, f"{one.subject}: {one.text}", "yellow" if one.level == "warning" else "dim")
    if len(shown) < len(found):
        line(
            "", f"and {len(found) - len(shown)} more assumptions, which check-file and the report list", "dim"
        )


def tell_results(summary: Summary) -> None:
    """One line per criterion, in the order of the file; and when none of them has a verdict."""
    from seerob.outputs.sentences import covered

    width = min(max((len(name) for name in summary.results), default=0), _WIDEST_NAME)
    for name, series in summary.results.items():
        word, style = WORDS[series.verdict]
        text = extreme(series)
        if "of the time" not in text and (share := covered(series)):
            text += f"; {share}"
        line(word, f"{name:<{width}}  {text}", style)
    for person, errors in summary.results.bones.items():
        line("bones", f"{person}: {_missing(errors)}")
    if summary.results.events:
        line("events", _happened(summary.results.events))
    if summary.verdict is None:
        line("nothing judged", _why_nothing(summary), WORDS[Verdict.UNDECIDED][1])


def _happened(events: Sequence[Event]) -> str:
    """How often what happened to workpieces: ``3 taken, 2 placed, 2 rounds of 4.1 s on average``."""
    count = Counter(event.what for event in events)
    rounds = [event.took or 0.0 for event in events if event.what == "round"]
    parts = [f"{n} {what}" for what, n in count.items() if what != "round"]
    if rounds:
        parts.append(f"{len(rounds)} rounds of {sum(rounds) / len(rounds):.1f} s on average")
    return ", ".join(parts)


def _why_nothing(summary: Summary) -> str:
    """What is missing where no criterion has a verdict: what those without a value say, else a limit."""
    known = {name: series for name, series in summary.results.items() if series.known}
    if known and all(series.worst().value is None for series in known.values()):
        reasons = {name: list(dict.fromkeys(series.reasons))[:3] for name, series in known.items()}
        said = [f"{name}: {', '.join(texts)}" for name, texts in reasons.items()]
        return f"no criterion has a verdict: {'; '.join(said)}"
    return "no criterion has a verdict: give one a limit"


def _missing(errors: BoneErrors) -> str:
    """How far bones are from where devices see them: ``9.2 mm median, P95 23 mm, worst right_hand …``."""
    parts = []
    for whole in errors.all():
        worst = max((e for e in errors.bones() if e.what == whole.what), key=lambda e: e.median)
        unit, factor = ("mm", 1e3) if whole.unit == "m" else ("°", math.degrees(1.0))
        shown = [f"{factor * value:.3g} {unit}" for value in (whole.median, whole.p95, worst.median)]
        parts.append(
            f"{whole.what} {shown[0]} median, {shown[1]} P95, worst {worst.bone} with {shown[2]} median"
        )
    return "; ".join(parts)


def extreme(series: Series) -> str:
    """The figure that matters: ``max 0.84 m/s at 12.31 s, limit 1``.

    It is ``worst`` where a limit that moves decides at another instant than that of the extreme value.
    """
    if not series.known:
        return "never gave a result"
    worst = series.worst()
    if worst.reason and (worst.value is None or series.verdict is Verdict.UNDECIDED):
        first = f"{worst.reason} (first at {worst.t:.2f} s)" if worst.t is not None else worst.reason
        return first + _otherwise(series)
    if worst.value is None:
        return "no value"
    what, most = ("max", series.max()) if series.at_most else ("min", series.min())
    what = what if worst.value == most else "worst"
    shown = against(worst.value, worst.limit, series.unit, at_most=series.at_most)
    text = f"{what} {with_unit(shown.value, series.unit)} at {worst.t:.2f} s"
    if worst.limit is not None:
        text += f", limit {shown.limit}"
    if series.asked:
        text += f", {series.asked}"
    return text + (f" ({worst.reason})" if worst.reason else "")


def _otherwise(series: Series) -> str:
    """Say the rest of a result that is undecided at times: ``; where decided, max 0.84 m/s at 12.31 s``."""
    import numpy as np

    from seerob.recording.series import CODES

    values = np.where(series.verdicts == CODES[Verdict.UNDECIDED], np.nan, series.values)
    if series.verdict is not Verdict.UNDECIDED or np.isnan(values).all():
        return ""
    what, k = ("max", np.nanargmax(values)) if series.at_most else ("min", np.nanargmin(values))
    shown = against(float(values[k]), None, series.unit, at_most=series.at_most).value
    text = f"{what} {with_unit(shown, series.unit)} at {series.t[k]:.2f} s"
    return f"; where decided, {text}"


def results_json(summary: Summary, **more: object) -> str:
    """The results for machines."""
    criteria = []
    for name, series in summary.results.items():
        worst = series.worst() if series.known else None
        criteria.append(
            {
                "name": name,
                "verdict": series.verdict,
                "times": series.times()._asdict(),
                "between": series.between,
                "asked": len(series),
                "unit": series.unit,
                "worst": worst
                and {
                    "t": worst.t,
                    "value": worst.value,
                    "limit": worst.limit,
                    "interval": worst.interval
                    and [end if math.isfinite(end) else None for end in worst.interval],
                    "reason": worst.reason,
                },
            }
        )
    whole = {
        "verdict": summary.verdict,
        "decided": summary.results.decided,
        "duration": summary.duration,
        "ticks": summary.ticks,
        "workstation_hash": summary.scene.workstation_hash,
        "criteria": criteria,
        "bones": {
            name: [error._asdict() for error in (*errors.all(), *errors.bones())]
            for name, errors in summary.results.bones.items()
        },
        "events": [msgspec.to_builtins(event) for event in summary.results.events],
        "findings": [
            {"level": f.level, "subject": f.subject, "text": f.text} for f in summary.scene.findings
        ],
        **more,
    }
    return json.dumps(whole, ensure_ascii=False, indent=1, allow_nan=False)
