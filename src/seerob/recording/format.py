"""What our recordings hold, in one place for the writer and the reader.

A recording is an MCAP file. Per tick there is one message on `SAMPLES` (what came in) and one on `SNAPSHOT`
(what went out), both MessagePack with float64. `SCENE` is the first message, with what does not change: the
basis of each criterion is there. Attachments hold the meshes and every input file. All other channels serve
foreign viewers only and are never read back.
"""

from __future__ import annotations

from msgspec import Struct

from seerob.core.samples import BodySample, JointSample, PoseSample, SignalSample

VERSION = "1"
"""Of this layout; a reader refuses one that it does not know."""

METADATA = "seerob"
"""Name of the metadata record at the start: layout, versions, wall-clock time."""
END_METADATA = "seerob.end"
"""Name of the metadata record at the end: how many ticks, how many were left out, and `DIGEST`."""
DIGEST = "sha256"
"""Of `END_METADATA`: of all messages on `SAMPLES` and `SNAPSHOT`, one after the other. It finds what was cut
out, put in or changed since; whoever wants to deceive can write another."""

SCENE = "/seerob/scene"
SAMPLES = "/seerob/samples"
SNAPSHOT = "/seerob/snapshot"

VIEW_SCENE, VIEW_MARKERS, VIEW_FRAMES, VIEW_RESULTS = "/scene", "/markers", "/tf", "/results"
VIEW_PEOPLE = "/people"
VIEWS = (VIEW_MARKERS, VIEW_FRAMES, VIEW_RESULTS, VIEW_PEOPLE)
"""For foreign viewers; `VIEW_SCENE` is sent once, these from time to time."""
VISITORS = "/visitors"
"""Who looked on; only where somebody did."""

MESH_PREFIX = "mesh/"
"""Attachments ``mesh/<hash>.glb``."""
FILE_PREFIX = "file/"
"""Attachments ``file/<relative name>``."""


class Tick(Struct, frozen=True, kw_only=True):
    """One tick's input: what the engine consumed before it stepped."""

    seq: int
    t: float
    """Run time [s]."""
    samples: tuple[JointSample | PoseSample | BodySample | SignalSample, ...] = ()


class Visitor(Struct, frozen=True, kw_only=True):
    """A page that was connected to the run, or an address that was not let in."""

    event: str
    """``came``, ``left``, ``there`` (at the end of the recording) or ``refused``."""
    role: str
    """``view``, ``track``, ``control``; ``any`` where no token is asked for, ``none`` of strangers."""
    address: str
    since: str
    """Wall-clock time, ISO 8601 in UTC."""
    until: str | None = None
    refused: dict[str, int] = {}
    """What was asked for in vain, and how often by now."""


def nanoseconds(t: float) -> int:
    """Log time [ns] of a run time [s]."""
    return max(0, round(t * 1e9))
