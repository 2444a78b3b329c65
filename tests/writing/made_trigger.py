"""A workstation whose verdict is written to a machine: tests import it as ``from made_trigger import …``."""

from __future__ import annotations

from made_cell import made
from seerob.core.snapshot import Result, Snapshot

STATION = """
allow_writing = true
variables = "variables.toml"
[[machines]]
name = "arm"
shape = { sphere = 0.1 }
slide = {}
[[sources]]
name = "plc"
SOURCE
[[safety]]
kind = "velocity"
name = "speed"
at = "arm"
limit = 1.0
[[triggers]]
variable = "twin/fast"
criterion = "speed"
every = 0.1
"""
VARIABLE = """
[[variables]]
name = "twin/fast"
source = "plc"
address = ADDRESS
type = "bool"
write = true
"""


def triggering(folder, source, address, station=STATION):
    """The workstation, with the rest of its source's table and the address of what is written."""
    return made(
        folder,
        station.replace("SOURCE", source),
        {"variables.toml": VARIABLE.replace("ADDRESS", address)},
    )


def said(verdict, seq=0):
    """A snapshot in which the criterion has this verdict."""
    result = Result(name="speed", value=1.0, verdict=verdict)
    return Snapshot(seq=seq, t=0.01 * seq, poses=b"", results=(result,))
