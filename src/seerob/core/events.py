"""What happens to loose workpieces, with times: the list that a run, its report and its page show."""

from __future__ import annotations

from msgspec import Struct


class Event(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """What happened to a loose workpiece."""

    t: float
    """Run time [s]."""
    what: str
    """``taken``, ``handed`` (another hand has it now), ``torn`` (out of a hand or gripper), ``placed``,
    ``dropped``, ``returned`` (to where it begins again), ``refused`` (a hand could not take it), ``round``
    (a round of work ended) or ``filled`` (it was the last that a place takes)."""
    piece: str
    by: str = ""
    """Hand or gripper that did it, such as ``operator/right_hand``."""
    where: str = ""
    """Place where it was put, or from which it was taken; empty where it is none."""
    took: float | None = None
    """Of ``placed`` and ``dropped`` the time since it was taken [s], of ``round`` its cycle time [s], of
    ``filled`` the time since a place was filled before, or since anything was taken first [s]."""
    count: int = 0
    """Of ``filled`` how many places have been filled so far, in all."""
    reason: str = ""
    """Why it was refused or torn out."""
