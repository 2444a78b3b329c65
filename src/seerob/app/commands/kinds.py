"""``seerob kinds``: every source, criterion, rule, sink and emulator, one line each, with its options."""

from __future__ import annotations

import argparse
from typing import get_args

import msgspec

from seerob.app.console.terminal import OUT, Exit
from seerob.workstation.workstation import PLUGINS

HELP = "list every source, criterion, rule, sink and emulator with its options"
EXAMPLE = "seerob kinds safety"

COMMON = {
    "sources": ("name", "timeout", "loop", "loop_pause"),
    "safety": ("name", "every"),
    "ergonomics": ("name", "every"),
    "sinks": (),
    "emulators": ("host", "seconds"),
}


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments."""
    sub.add_argument("group", nargs="?", choices=PLUGINS, help="only these")


def run(options: argparse.Namespace) -> int:
    """Print them."""
    from seerob.core import plugin
    from seerob.description.robots import library
    from seerob.session.reading import BASES

    for group in [options.group] if options.group else PLUGINS:
        common = ", ".join(COMMON[group])
        title = f"[[{group}]]" + (", and seerob emulate" if group == "emulators" else "")
        OUT.print(title + (f"  (all: {common})" if common else ""), style="bold", markup=False)
        for kind in plugin.kinds(group):
            found = plugin.load(group, kind, BASES[group])
            title = (found.__doc__ or "").strip().split("\n")[0]
            OUT.print(f"  {kind:<18} {title}", markup=False)
            fields = [f for f in msgspec.structs.fields(found) if f.name not in COMMON[group]]
            shown = [f"{f.name}{_unit(f.type)}{' *' if f.required else ''}" for f in fields]
            if shown:
                OUT.print(f"  {'':<18} {', '.join(shown)}", style="dim", markup=False)
        for kind, point in plugin.offered(group).items():
            by = "" if point.dist is None else f"{point.dist.name} {point.dist.version}: "
            OUT.print(f"  {kind:<18} {by}{point.value}, not imported until a file names it", markup=False)
    OUT.print("* must be given", style="dim")
    if options.group is None:
        OUT.print("robots", style="bold")
        OUT.print("  " + ", ".join(f"library:{name}" for name in library.names()), markup=False)
    return Exit.WITHIN


def _unit(wanted: object) -> str:
    for item in (wanted, *get_args(wanted)):
        for meta in getattr(item, "__metadata__", ()):
            if isinstance(meta, msgspec.Meta) and meta.extra and "unit" in meta.extra:
                return f" [{meta.extra['unit']}]"
    return ""
