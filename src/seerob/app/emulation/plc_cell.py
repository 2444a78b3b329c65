"""The program of an emulated PLC: a belt that brings parts and stops, a light curtain, a sliding door.

Every emulated PLC plays it, whatever it speaks; times are from its start, so a restart begins anew.
"""

from __future__ import annotations

CYCLE = 10.0
"""Of the belt [s]."""
RUN = 6.0
"""Of it, how long the belt runs [s]."""
SPEED = 250.0
"""Of the belt [mm/s]."""
INTERRUPTED = (17.0, 18.0)
"""When the light curtain is interrupted within each `ROUND` [s]."""
ROUND = 20.0
"""[s]"""


def running(t: float) -> bool:
    """Whether the belt runs at ``t`` [s]."""
    return t % CYCLE < RUN


def speed(t: float) -> float:
    """Of the belt [mm/s]."""
    return SPEED if running(t) else 0.0


def position(t: float) -> float:
    """How far the belt has run [mm]."""
    return SPEED * (RUN * (t // CYCLE) + min(t % CYCLE, RUN))


def clear(t: float) -> bool:
    """Whether the light curtain is free."""
    return not INTERRUPTED[0] <= t % ROUND < INTERRUPTED[1]


def door_open(t: float) -> bool:
    """Whether the door is told to be open: while the belt stands."""
    return not running(t)
