"""``seerob swept``: the volume that something sweeps or can reach, as a closed mesh in a file."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING

from seerob.app.console.loading import compiled
from seerob.app.console.progress import progress
from seerob.app.console.terminal import Exit, add_workstation, allowed, describe, line, tell
from seerob.core.errors import InputError

if TYPE_CHECKING:
    from seerob.session.areas import MotionRecord
    from seerob.session.station import Station

HELP = "write the volume that a robot sweeps, or can reach, as a closed mesh (STL or GLB)"
EXAMPLE = "seerob swept my_cell --of ur10 --voxel 0.01 -o swept.stl"


def metres(text: str) -> float:
    """A length on the command line [m]; more than nothing, and finite."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0 < value < math.inf:
        raise argparse.ArgumentTypeError(f"{text!r} is not a length in m above 0")
    return value


def instant(text: str) -> float:
    """An instant on the command line [s]; 0 or more, and finite."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0 <= value < math.inf:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of seconds, 0 or more")
    return value


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments."""
    add_workstation(sub)
    sub.add_argument("--of", help="what sweeps (default: the only robot, with all that it carries)")
    sub.add_argument("--voxel", type=metres, default=0.01, help="edge of a voxel [m] (default: 0.01)")
    sub.add_argument("--reach", action="store_true", help="all that the joint limits allow, not the motion")
    sub.add_argument("--from", dest="start", type=instant, default=0.0, help="begin of the part to take [s]")
    sub.add_argument("--to", dest="end", type=instant, help="end of the part to take [s]")
    sub.add_argument("--triangles", type=int, help="about how many at most; voxels are merged to get there")
    sub.add_argument("-o", "--output", type=Path, default=Path("swept.stl"), help=".stl or .glb file")


def run(options: argparse.Namespace) -> int:
    """Sweep, write the mesh and say what is in it."""
    from seerob.description.shapes.glb import check_format, write_mesh
    from seerob.description.shapes.moments import signed_volume

    check_format(options.output)
    if not options.output.parent.is_dir():
        raise InputError.at(options.output, "", "its folder does not exist", "make it, or give another place")
    station = compiled(options.workstation, allowed(options), sources=not options.reach)
    from seerob.distance.voxels import check_room
    from seerob.model.volumes.moving import posed, reach_box
    from seerob.model.volumes.reachable import reachable_volume
    from seerob.model.volumes.swept import swept_volume
    from seerob.twin.machines.gripping import before

    model = station.model
    bodies = model.select(_subject(station, options.of))
    check_room(*reach_box(model, bodies), options.voxel)
    describe(station)
    tell(model.findings)
    if options.reach:
        with progress(1.0, "joint limits") as share:
            swept = reachable_volume(model, bodies, voxel=options.voxel, progress=share)
        assert swept is not None
    else:
        path, first = _motion(station, options.start, options.end)
        held = before(model, posed(model, path.motion())[:first])
        with progress(1.0, "sweeping") as share:
            swept = swept_volume(
                model, bodies, path.motion(first), voxel=options.voxel, held=held, progress=share
            )
    mesh = swept.mesh(most=options.triangles)
    write_mesh(options.output, mesh)
    unshaped = model.unshaped((_subject(station, options.of),))
    sure = "less than the truth" if unshaped else "not less than the truth"
    line("volume", f"{swept.volume:.4g} m³ in voxels of {options.voxel:g} m: {sure}")
    if unshaped:
        line("undecided", unshaped, "yellow")
    line("contains", swept.guarantee)
    if swept.excess is None:
        line("dilated", f"by up to {swept.dilation * 1e3:.1f} mm for motion between two stamps")
    else:
        line("larger", f"than the truth by at most {swept.excess * 1e3:.0f} mm, all roundings added up")
    line(
        "wrote", f"{options.output}: {len(mesh.faces)} triangles, metres; holds {signed_volume(mesh):.4g} m³"
    )
    return Exit.UNDECIDED if unshaped else Exit.WITHIN


def _subject(station: Station, name: str | None) -> str:
    robots = [robot.name for robot in station.workstation.robots]
    if name is not None:
        return name
    if len(robots) != 1:
        what = f"{len(robots)} robots: {', '.join(robots)}" if robots else "no robot"
        raise InputError.at("seerob swept", "--of", f"missing, and there is {what}", "say what sweeps")
    return robots[0]


def _motion(station: Station, start: float, end: float | None) -> tuple[MotionRecord, int]:
    """Where the twin's joints were at every tick up to the end of a part of the run, and its first tick."""
    last = station.duration if end is None else end
    if start > last:
        raise InputError.at(
            "seerob swept", "--from", f"{start:g} s is after {last:g} s", "begin before the end"
        )
    from seerob.session.areas import MotionRecord

    path = MotionRecord(0.0, last)
    with progress(station.duration, f"{station.duration:.1f} s of motion") as tick:
        station.run(writers=[path], progress=tick, stop=lambda: False)
    first = sum(t < start - 1e-9 for t in path.instants)
    if first == len(path.instants):
        what = f"no tick lies from {start:g} to {last:g} s"
        raise InputError.at("seerob swept", "--from", what, f"the motion takes {station.duration:g} s")
    limit = station.workstation.engine.tracking_limit
    for name, error in path.off.items():
        if error > limit:
            text = f"{name}: the twin was off by up to {error:.3g} rad or m; what is swept is the twin's way"
            line("warning", text, "yellow")
    driven = {source.target() for source in station.workstation.sources}
    for name in station.model.mechanisms:
        if name not in driven:
            line("note", f"{name}: no source drives it; it stands still", "dim")
    return path, first
