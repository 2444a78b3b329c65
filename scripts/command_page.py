"""docs/commands.md: what the parser of the command line knows, as Markdown."""

from __future__ import annotations

import argparse
from collections.abc import Iterator

from fact_tables import markdown

from seerob.app import cli
from seerob.app.commands import emulate
from seerob.app.console.terminal import Exit
from seerob.core.plugin import kinds

_HEAD = (
    "<!-- Written by scripts/write-docs from the command line. Do not edit. -->\n\n"
    "# Commands\n\n"
    "Each has a `--help`, which says what stands here.\n"
    "Results, findings and files written are printed one per line; `--json` prints results for machines.\n"
    "Nothing is written over: a file that exists already is an error, and runs have folders of their own.\n\n"
)
_EXITS = {
    Exit.WITHIN: "every limit was kept",
    Exit.EXCEEDED: "at least one limit was exceeded",
    Exit.UNDECIDED: "nothing was seen exceeded, and not everything could be decided, or nothing was judged",
    Exit.ERROR: "a mistake in a file or on the command line, or it was stopped; the message says which",
}
_JSON = (
    "\n**With `--json`** `assess` and `report` print one object: `verdict`, `decided`, `duration` [s], "
    "`ticks`, `workstation_hash`, `criteria`, `bones`, `findings`, `folder`.\n"
    "Each of `criteria` has `name`, `unit`, `verdict`, `times` (shares of the run: `within`, `exceeded`, "
    "`undecided`, `muted`, `nothing` to judge, `open` where it was not asked), `between` (why nothing is "
    "known between its instants, or why that is accepted), and its `worst` instant: `t` [s], `value`, "
    "`limit`, `interval`, `reason`; null is what is not known.\n"
)


def commands_page() -> str:
    """The page."""
    rows = [(str(int(code)), text) for code, text in _EXITS.items()]
    parts = [_HEAD, "## Exit codes\n\n", markdown(("code", "means"), rows), _JSON]
    for name, sub in _subcommands(cli.parser()):
        example = (sub.epilog or "").removeprefix("example: ").split("   ")[0]
        parts += [f"\n## {name}\n\n", _sentence(sub.description), f"\n```\n{example}\n```\n", _options(sub)]
        for action, inner in _subcommands(sub):
            parts += [f"\n### {name} {action}\n\n", _sentence(inner.description), _options(inner)]
        for kind in kinds(emulate.PACKAGE) if name == "emulate" else ():
            inner = emulate.parser_of(kind)
            parts += [f"\n### {name} {kind}\n\n", _sentence(inner.description), _options(inner)]
    return "".join(parts)


def _subcommands(parser: argparse.ArgumentParser) -> Iterator[tuple[str, argparse.ArgumentParser]]:
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            yield from action.choices.items()


def _sentence(text: str | None) -> str:
    return f"{text[0].upper()}{text[1:]}.\n" if text else ""


def _options(parser: argparse.ArgumentParser) -> str:
    rows = []
    for action in parser._actions:
        hidden = action.help == argparse.SUPPRESS
        if hidden or isinstance(action, argparse._HelpAction | argparse._SubParsersAction):
            continue
        shown = ", ".join(f"`{word}`" for word in _words(action))
        text = ((action.help or "") % {"default": action.default}).replace("|", "\\|").replace("<", "\\<")
        must = " **Must be given.**" if action.required and action.option_strings else ""
        rows.append((shown, f"{text}{must}"))
    return "\n" + markdown(("option", "meaning"), rows) if rows else ""


def _words(action: argparse.Action) -> Iterator[str]:
    if not action.option_strings:
        yield action.dest if action.nargs != "?" else f"[{action.dest}]"
        return
    value = ""
    if action.nargs != 0:
        value = action.metavar if isinstance(action.metavar, str) else action.dest.upper()
        if action.choices is not None and not action.metavar:
            value = " or ".join(map(str, action.choices))
        value = f" [{value}]" if action.nargs == "?" else f" {value}"
    for word in action.option_strings:
        yield word + value
