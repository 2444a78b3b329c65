"""How regularly a device says its variables, before there is a dictionary of them."""

from __future__ import annotations

import asyncio
import time
import tomllib
from collections.abc import Sequence
from contextlib import aclosing
from pathlib import Path
from typing import Any

from seerob.app.console.terminal import line
from seerob.devices.live.arrivals import Arrivals
from seerob.devices.variables.live_source import Change, Node, VariablesSource
from seerob.workstation.variables.dictionary import Kind, Variable


def tell_heard(source: VariablesSource, nodes: Sequence[Node], wait: float) -> None:
    """Listen to variables, and print how regularly they come, which do not, and what is wrong with which.

    Args:
        source: Reads them.
        nodes: The variables.
        wait: How long [s].

    Raises:
        OSError: The device is gone.
        SeerobError: What it says cannot be understood.
    """
    arrivals, doubts = asyncio.run(_heard(source, nodes, wait))
    line("heard", f"{arrivals.statistics()}; {len(doubts)} of {len(nodes)} variables")
    for node in nodes:
        if (doubt := doubts.get(node.address, "not heard")) != "":
            line("doubt", f"{node.address}: {doubt}", "yellow")


async def _heard(
    source: VariablesSource, nodes: Sequence[Node], wait: float
) -> tuple[Arrivals, dict[str, str]]:
    """Arrivals of anything, and by address what is wrong with what was said last; empty when nothing is."""
    # As texts: no unit is asked for what is not looked at.
    variables = tuple(
        Variable(name=f"v{k}", source="probe", address=_address(node.address), type=Kind.TEXT)
        for k, node in enumerate(nodes)
    )
    addresses = {variable.name: node.address for variable, node in zip(variables, nodes, strict=True)}
    arrivals, doubts = Arrivals(), dict[str, str]()
    clock = asyncio.get_running_loop()
    try:
        async with (
            aclosing(source.changes(variables, Path())) as said,
            asyncio.timeout_at(clock.time() + wait),
        ):
            async for changes in said:
                told = [change for change in changes if isinstance(change, Change)]
                if told:
                    arrivals.add(time.monotonic(), None)
                doubts |= {addresses[change.name]: change.doubt for change in told}
    except TimeoutError:
        pass  # of the listening, or of a device that has nothing to say
    return arrivals, doubts


def _address(shown: str) -> Any:
    """An address as a dictionary has it; some are tables."""
    return tomllib.loads(f"value = {shown}")["value"] if shown.startswith("{") else shown
