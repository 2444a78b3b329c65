"""``seerob variables``: what the dictionary covers, what is heard of it, and a skeleton by browsing.

The skeleton is a variable dictionary to begin with: what a device does not say of itself stays open.
"""

from __future__ import annotations

import argparse
import re
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from seerob.app.console.interruption import Stopped
from seerob.app.console.loading import compiled
from seerob.app.console.terminal import OUT, Exit, add_workstation, allowed, line, seconds, tell
from seerob.core.errors import InputError, SeerobError
from seerob.devices.variables.live_source import Node
from seerob.files.tables.mapping import toml_value
from seerob.workstation.variables import unit

if TYPE_CHECKING:
    from seerob.core.samples import Sample
    from seerob.devices.variables.live_source import Node, VariablesSource
    from seerob.session.station import Station
    from seerob.workstation.allowed import Allowed
    from seerob.workstation.variables import Variable


BOOLS = ("bool", "boolean")
TEXTS = ("string", "wstring", "char", "wchar", "text", "bytestring", "localizedtext")
_NEVER = re.compile(r"[^A-Za-z0-9_.\-]+")
LONGEST = 120
"""Characters of a name."""


def skeleton(nodes: Iterable[Node], source: str) -> str:
    """Entries of a dictionary, as TOML.

    A number whose unit the device does not state has none: the file cannot be read until somebody says it.

    Args:
        nodes: What was found.
        source: Name of the source that reads them.
    """
    taken: set[str] = set()
    entries = ["\n".join(_entry(node, _name(node.address, taken), source)) for node in nodes]
    head = f"# Variables that {source} has. Take out what the twin does not use, and state the units.\n"
    return "\n\n".join([head, *entries]) + "\n"


def _entry(node: Node, name: str, source: str) -> Iterator[str]:
    yield "[[variables]]"
    yield f'name = "{name}"'
    yield f"source = {toml_value(source)}"
    yield f"address = {node.address if node.address.startswith('{') else toml_value(node.address)}"
    kind = node.type.lower()
    if kind in BOOLS or node.value in ("True", "False", "true", "false"):
        yield 'type = "bool"'
    elif kind in TEXTS:
        yield 'type = "text"'
    elif node.unit and unit(node.unit) is not None:
        yield f"unit = {toml_value(node.unit)}"
    elif node.unit:
        yield f"# unit = …   the device says {toml_value(node.unit)}, not known: give unit, scale, offset"
    else:
        yield "# unit = …   the device does not say it; 1 for none"
    if node.type or node.value:
        said = " ".join(part for part in (node.type, node.value and f"was {node.value}") if part)
        yield f"comment = {toml_value(said[:200])}"


def _name(address: str, taken: set[str]) -> str:
    plain = "/".join(part for part in _NEVER.split(address[-LONGEST:]) if part.strip("./-")) or "variable"
    name, n = plain, 1
    while name in taken:
        n += 1
        name = f"{plain}_{n}"
    taken.add(name)
    return name


HELP = "what the variable dictionary covers, what is heard of it, and a skeleton by browsing a device"
EXAMPLE = "seerob variables my_cell --browse plc   > variables.toml"
WITHIN = 60.0
"""For browsing [s]."""


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments."""
    add_workstation(sub)
    sub.add_argument("--listen", type=seconds, metavar="SECONDS", help="connect, and tell what is heard")
    sub.add_argument("--browse", metavar="SOURCE", help="print a dictionary of what this source has")


def run(options: argparse.Namespace) -> int:
    """Print the coverage; `Exit.UNDECIDED` when something of it is not heard.

    Raises:
        InputError: The workstation is wrong, or the device cannot be browsed.
    """
    if options.browse is not None:
        return _browse(options.workstation, options.browse, allowed(options))
    station = compiled(options.workstation, allowed(options))
    variables = tuple(station.model.dictionary.values())
    if not variables:
        what = "the workstation names no dictionary"
        raise InputError.at(options.workstation, "variables", what, 'add variables = "variables.toml"')
    from seerob.model.variables import uses

    used: dict[str, list[str]] = {}
    for key, name, _ in uses(station.workstation):
        used.setdefault(name, []).append(key)
    heard = {} if options.listen is None else _listen(station, options.listen)
    for variable in variables:
        by = ", ".join(used.get(variable.name, ())) or ("a trigger" if variable.write else "nothing")
        line(variable.source, f"{variable.name} = {variable.address}, {_sort(variable)}; used by {by}")
        if options.listen is not None and not variable.write:
            text = heard.get(variable.name, "nothing heard")
            line("", text, "" if text.startswith("heard") else "yellow")
    tell(station.model.findings)
    return Exit.UNDECIDED if any(not text.startswith("heard") for text in heard.values()) else Exit.WITHIN


def _sort(variable: Variable) -> str:
    return str(variable.type) if variable.unit is None else f"[{variable.unit}]"


def _listen(station: Station, wait: float) -> dict[str, str]:
    """What was heard of each variable, in words."""
    from seerob.core.samples import SignalSample
    from seerob.devices.live.listening import Listener, LiveSource
    from seerob.session.opening import source_target

    newest: dict[str, SignalSample] = {}

    def hear(sample: Sample) -> None:
        if isinstance(sample, SignalSample):
            newest[sample.source] = sample

    listeners = [
        Listener(source, source_target(station.model, source), hear)
        for source in station.workstation.sources
        if isinstance(source, LiveSource) and source.reads_variables
    ]
    stopped = Stopped()
    for listener in listeners:
        listener.start()
    end = time.monotonic() + wait
    while time.monotonic() < end and not stopped():
        time.sleep(0.02)
    for listener in listeners:
        listener.ask_to_stop()
    for listener in listeners:
        listener.join(1.0)
    values: dict[str, str] = {}
    for variable in station.model.dictionary.values():
        picture = newest.get(variable.source)
        if variable.write:
            continue
        if picture is None:
            values[variable.name] = f"nothing heard from {variable.source}"
        elif variable.name in picture.doubts:
            values[variable.name] = picture.doubts[variable.name]
        else:
            value = picture.values[variable.name]
            figure = f"{value:.6g}" if isinstance(value, float) else str(value)
            values[variable.name] = f"heard: {figure} {variable.si_unit}".rstrip()
    return values


def _browse(path: Path, name: str, allow: Allowed) -> int:
    import asyncio

    from seerob.core.errors import suggestion
    from seerob.devices.live.listening import because
    from seerob.devices.variables.live_source import VariablesSource
    from seerob.session.reading import readable

    # The dictionary may not be there yet, or may not be right yet.
    found = readable(path, allow)
    sources = {s.name: s for s in found.entries["sources"].values() if isinstance(s, VariablesSource)}
    if name not in sources:
        what = f"no source named {name!r} that can be browsed"
        raise InputError.at(path, "--browse", what, suggestion(name, sources))
    source = sources[name].beside(Path(found.head.folder))
    try:
        nodes = asyncio.run(asyncio.wait_for(nodes_of(source), WITHIN))
    except InputError:
        raise
    except (OSError, EOFError, SeerobError, NotImplementedError) as error:
        raise InputError.at(name, "", because(error), "is it switched on, is the address right?") from error
    OUT.print(skeleton(nodes, name), markup=False, end="")
    return Exit.WITHIN


async def nodes_of(source: VariablesSource) -> list[Node]:
    """What a device says it has; raises as `VariablesSource.browse` does."""
    from contextlib import aclosing

    from seerob.workstation.variables import MOST_VARIABLES

    nodes: list[Node] = []
    async with aclosing(source.browse()) as found:
        async for node in found:
            nodes.append(node)
            if len(nodes) >= MOST_VARIABLES:
                break
    return nodes
