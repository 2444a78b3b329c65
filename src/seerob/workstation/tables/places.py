"""Where loose workpieces are put down, in the workstation file: boxes, fixtures, places on what moves."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta

from seerob.core.quantities import Length, Name, Pose, Table, unit


class Place(Table, frozen=True, kw_only=True):
    """A place where loose workpieces are put: in a box, into a fixture, onto what a belt carries."""

    name: Name
    """Its name in the list of events."""
    on: str | None = None
    """Part, machine or link that it moves with; stands in the world when not given."""
    at: Pose = Pose()
    """Pose in the world, or in the frame of what it is on: the middle of the place."""
    size: Annotated[tuple[Length, Length, Length], unit("m")]
    """Box about that middle [m]: a workpiece whose origin comes to rest in it lies there."""
    snap: bool = False
    """Whether a workpiece that is let go in it is pulled into its pose: a fixture. It takes one at a time."""
    of: Annotated[str, Meta(min_length=1, max_length=300)] = "*"
    """Names of the workpieces that belong here, wildcards allowed."""
    returns: str | None = None
    """Place in whose pose a workpiece that comes to rest here is at the next tick: an endless supply."""
    ends_round: bool = False
    """Whether a workpiece that is put here ends a round, of which the cycle time is told."""
    full: Annotated[int, Meta(ge=1, le=1000)] | None = None
    """How many workpieces fill it: then an event says so, how often it was filled and how long that took."""
