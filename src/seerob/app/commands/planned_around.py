"""Where those who move beside a planned robot are: still, at an instant, or all that they sweep."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from seerob.app.console.terminal import cache_folder, seconds
from seerob.core.errors import InputError

if TYPE_CHECKING:
    from seerob.core.transforms import Array
    from seerob.session.station import Station

STILL, SWEPT = "still", "swept"
OTHERS = (
    "where robots, people and machines that sources move are taken to be: still (where the file puts them), "
    "swept (everywhere that their recorded motion takes them) or an instant of that motion [s] "
    "(default: still)"
)


@dataclass(frozen=True, eq=False)
class Around:
    """What a path is planned in."""

    station: Station
    keep_out: tuple[str, ...]
    places: dict[str, Array] = field(default_factory=dict)
    """Joint positions of others by name [rad or m], (n,) each."""
    swept: tuple[str, ...] = ()
    """Others that an area stands for."""


def others(text: str) -> str | float:
    """``still``, ``swept``, or an instant [s]."""
    if text in (STILL, SWEPT):
        return text
    try:
        return 0.0 if text.strip() in ("0", "0.0") else seconds(text)
    except argparse.ArgumentTypeError:
        raise argparse.ArgumentTypeError(f"{text!r} is not still, swept or a number of seconds") from None


def around(
    station: Station,
    robot: str,
    how: str | float,
    keep_out: Sequence[str],
    *,
    voxel: float,
    stopped: Callable[[], bool],
    say: Callable[[str], None],
) -> Around:
    """The others of a workstation.

    Args:
        station: As compiled.
        robot: Whose path is planned.
        how: As `others` gives it.
        keep_out: Areas to keep away from.
        voxel: Of what is swept [m].
        stopped: Whether to stop.
        say: Told what is done.

    Raises:
        InputError: Live sources, an instant after the end, or a motion that is not known throughout.
        Stopped: ``stopped`` said so.
    """
    from seerob.session.planning.others import Witness, alone, made_for, movers, with_sweeps
    from seerob.session.planning.search import Stopped
    from seerob.session.station import Station

    def tell(text: str) -> None:
        if stopped():
            raise Stopped("stopped before anything was planned")
        say(text)

    who = movers(station.workstation, robot)
    if how == STILL or not who:
        return Around(station, tuple(keep_out))
    instant = None if how == SWEPT else float(how)
    carrier = next((r.on for r in station.workstation.robots if r.name == robot and r.on is not None), "")
    if instant is None and carrier.partition("/")[0] in who:
        what = f"{robot} stands on {carrier}, which moves: where it plans from would move too"
        raise InputError.at("plan", "--others", what, "give an instant [s]")
    bare = Station(alone(station.workstation, robot, who, keep_out), cache=cache_folder(), progress=tell)
    witness = Witness(instant)
    tell("following the others")
    bare.run(writers=[witness], stop=lambda: stopped() or witness.done)
    tell("following the others")
    witness.require()
    if instant is not None:
        return Around(station, tuple(keep_out), places={name: witness.places[name] for name in who})
    whole = Station(with_sweeps(bare.workstation, who, voxel), cache=cache_folder(), progress=tell)
    return Around(whole, (*keep_out, *made_for(who)), swept=who)
