"""``seerob robots``: which robots can be named, what is known of each, and what that leaves undecided."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING

from seerob.app.console.loading import compiled
from seerob.app.console.terminal import OUT, Exit, add_workstation, allowed, line
from seerob.core.errors import InputError

if TYPE_CHECKING:
    from seerob.description.description import Description
    from seerob.description.robots.library import Entry
    from seerob.session.identification.identify import Known

HELP = "list robots and tools that can be named, with what is known of each; fetch a published description"
EXAMPLE = "seerob robots"

MISSING = (
    (
        "masses",
        "kinetic_energy, effective_mass, tool_force, joint_torque, force_polytope, power_and_force, "
        "separation with a stop that needs them",
    ),
    ("torque limits", "force_polytope, joint_torque, separation with a simulated stop"),
    ("speed limits", "separation and permissible speeds while the robot reacts, waypoints without speeds"),
    ("stopping table", "separation with stop.table; give the maker's"),
)
"""What may be missing, and which criteria are UNDECIDED without it."""


COMPUTED = (
    "reach that is computed from kinematics and limits: how far the origin of the tip gets from the first "
    "axis; makers measure to other points"
)


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments."""
    sub.add_argument("--all", action="store_true", help="published descriptions of hands and walkers, too")
    actions = sub.add_subparsers(dest="action", metavar="action", parser_class=type(sub))
    text = "clone what a published description needs into the cache of robot_descriptions"
    fetch = actions.add_parser("fetch", help=text, description=text)
    fetch.add_argument("name", help="description as the package has it: ur5e_description")

    text = "base inertial parameters, rotors and friction of an arm from the torques of a log"
    identify = actions.add_parser("identify", help=text, description=text)
    add_workstation(identify)
    identify.add_argument("--robot", help="whose log; the only robot when not given")
    text = "workstation of the same arm, with a log that was taken with a payload on its flange"
    identify.add_argument("--carrying", type=Path, metavar="WORKSTATION", help=text)
    text = "torque per current of each joint, gears included, from the base on [N·m/A]: 11.5,11.5,9.8,…"
    identify.add_argument("--constants", metavar="K,K,…", help=text)
    text = "mass that the log of --carrying has on the flange [kg], which makes torques of currents"
    identify.add_argument("--payload", type=float, metavar="KG", help=text)
    text = "by which share each constant, or that mass, may be off: 0.05"
    identify.add_argument("--tolerance", type=float, metavar="SHARE", help=text)
    text = "where constants are stated, or how the mass was weighed"
    identify.add_argument("--known-by", metavar="TEXT", help=text)
    text = "what the maker says that the whole arm weighs [kg]: needed for -o"
    identify.add_argument("--mass", type=float, metavar="KG", help=text)
    identify.add_argument("--mass-source", metavar="TEXT", help="where the maker says so: data sheet, page")
    text = "write masses, rotors and tolerances for the table of the robot to a new file"
    identify.add_argument("-o", "--output", type=Path, metavar="FILE", help=text)


def run(options: argparse.Namespace) -> int:
    """List, fetch or identify."""
    if options.action == "fetch":
        return _fetch(options.name)
    if options.action == "identify":
        return _identify(options)
    _library()
    _tools()
    _descriptions(options.all)
    _packages()
    OUT.print(f"~: {COMPUTED}", style="dim", markup=False)
    OUT.print("missing: what is UNDECIDED without it, unless the workstation file gives it", style="bold")
    for what, criteria in MISSING:
        OUT.print(f"  {what:<16} {criteria}", markup=False)
    return Exit.WITHIN


def missing(robot: Description, *, stops: bool) -> tuple[str, ...]:
    """What nobody published of a robot, in the words of `MISSING`.

    Args:
        robot: Its description.
        stops: Whether a table of its stops is known.
    """
    from seerob.description.description import groups

    joints = robot.joints()
    massless = any(
        group[0].joints and not any(link.inertial for link in group) for group in groups(robot.links)
    )
    there = (
        not massless,
        all(joint.effort is not None for joint in joints),
        all(joint.velocity is not None for joint in joints),
        stops,
    )
    return tuple(what for (what, _), known in zip(MISSING, there, strict=True) if not known)


def _library() -> None:
    from seerob.criteria.stopping.table import shipped, table
    from seerob.description.robots import library

    with_table = {model for stop in shipped() for model in table(stop).models}
    OUT.print("library", style="bold")
    OUT.print(
        f"  {'model':<28} {'maker':<18} {'axes':>4} {'reach':>8} {'payload':>8} {'mass':>8}  missing",
        style="dim",
        markup=False,
    )
    for name in library.names():
        robot, entry = library.load(name), library.entry(name)
        lacks = missing(robot, stops=f"library:{name}" in with_table)
        OUT.print(
            f"  {f'library:{name}':<28} {entry.maker[:18]:<18} {len(robot.joints()):>4} "
            f"{_figures(entry, robot)}  {', '.join(lacks) or 'nothing'}",
            markup=False,
        )


def _tools() -> None:
    from seerob.description.tools import library

    OUT.print("tools", style="bold")
    for name in library.names():
        tool = library.load(name)
        high = max(float(s.mesh.vertices[:, 2].max()) for s in tool.solids if s.mesh is not None)
        mass = "?" if tool.inertial is None else f"{tool.inertial.mass:.3g} kg"
        tip = "?" if tool.tcp is None else f"{tool.tcp[2, 3]:.3g} m"
        OUT.print(
            f"  {f'library:{name}':<30} {tool.maker[:16]:<16} {high:>6.3g} m long {mass:>8}  tip {tip}",
            markup=False,
        )


def _figures(entry: Entry, robot: Description) -> str:
    from seerob.description.robots.farthest import farthest

    masses = [link.inertial.mass for link in robot.links if link.inertial is not None]
    texts = (
        f"~{farthest(robot):.2f} m" if entry.reach is None else f"{entry.reach.value:.3g} m",
        "?" if entry.payload is None else f"{entry.payload.value:.3g} kg",
        f"{sum(masses):.3g} kg" if masses else "?",
    )
    return " ".join(f"{text:>8}" for text in texts)


def _descriptions(every: bool) -> None:
    from seerob.description.robots import published

    OUT.print("published descriptions (robot_descriptions)", style="bold")
    if not published.installed():
        OUT.print("  not installed: pip install 'seerob[robots]'", markup=False)
        return
    for each in published.listed():
        if each.arm or every:
            where = "in the cache" if each.cached else f"seerob robots fetch {each.name}"
            OUT.print(
                f"  {f'description:{each.name}':<38} {(each.maker or '?')[:20]:<20} {each.kind:<5} "
                f"{each.licence or 'licence not known':<14} {where}",
                markup=False,
            )


def _packages() -> None:
    """Installed distributions that bring descriptions."""
    found = sorted({text for each in metadata.distributions() for text in _of(each)})
    OUT.print("installed packages with URDF files", style="bold")
    for text in found or ["  none"]:
        OUT.print(text, markup=False)


def _of(distribution: metadata.Distribution) -> Iterator[str]:
    files = [file for file in distribution.files or () if file.suffix in {".urdf", ".xacro"}]
    if files:
        name = distribution.metadata["Name"]
        said = distribution.metadata.json
        licence = str(said.get("license_expression") or said.get("license") or "not stated")
        example = "/".join(files[0].parts[-3:])
        of = licence.splitlines()[0][:40]
        yield f"  package:{name}/{example}  and {len(files) - 1} more; licence: {of}"


def _fetch(name: str) -> int:
    from seerob.description.robots import published

    found = published.fetch(name.removeprefix("description:"))
    line("fetched", f"{found.address} at {found.commit[:12]}, in {found.repository}", "bold")
    line("licence", found.licence or "the package knows none: read the repository")
    line("next", f'model = "description:{found.name}"')
    return Exit.WITHIN


def _known(options: argparse.Namespace) -> Known:
    """What turns currents into torques.

    Raises:
        InputError: A constant, a mass, its tolerance or its source is missing or makes no sense.
    """
    from seerob.session.identification.identify import NOTHING_KNOWN, Known

    command = "seerob robots identify"
    if options.constants is None and options.payload is None:
        return NOTHING_KNOWN
    if options.constants is not None and options.payload is not None:
        raise InputError.at(command, "--constants", "and --payload are both given", "give one of them")
    if options.payload is not None and options.carrying is None:
        what = "needs the log that was taken with it"
        raise InputError.at(command, "--payload", what, "give its workstation with --carrying")
    if options.tolerance is None or not 0 <= options.tolerance < 1 or not options.known_by:
        what = "needs a tolerance from 0 to below 1, and where it is known from"
        raise InputError.at(command, "--tolerance", what, "give --tolerance 0.05 and --known-by")
    if options.payload is not None:
        if not 0.01 <= options.payload <= 1000:
            raise InputError.at(command, "--payload", f"is {options.payload:g} kg", "0.01 to 1000 kg")
        return Known(payload=options.payload, tolerance=options.tolerance)
    try:
        constants = tuple(float(text) for text in options.constants.split(","))
    except ValueError:
        constants = ()
    if not constants or not all(1e-4 < k < 1e5 for k in constants):
        what = f"{options.constants!r} are no torque constants"
        raise InputError.at(command, "--constants", what, "11.5,11.5,9.8 [N·m/A], one per joint")
    return Known(constants=constants, tolerance=options.tolerance)


def _identify(options: argparse.Namespace) -> int:
    from seerob.session.identification.robot_file import robot_table, weighed

    known = _known(options)
    if options.output is not None:
        if options.mass is None or not options.mass_source or not 0.1 <= options.mass <= 10_000:
            what = "masses for a file need the mass of the whole arm, from 0.1 kg, and where it is stated"
            raise InputError.at("seerob robots identify", "--mass", what, "give --mass and --mass-source")
        if options.output.exists():
            raise InputError.at(options.output, "", "exists already", "give another name with -o")
    station = compiled(options.workstation, allowed(options))
    names = [robot.name for robot in station.workstation.robots]
    if options.robot is None and len(names) != 1:
        raise InputError.at("seerob robots identify", "--robot", "is not given", f"one of {', '.join(names)}")
    name = options.robot or names[0]
    carrying = None if options.carrying is None else compiled(options.carrying, allowed(options))
    found = station.identify(name, carrying, known)
    line("log", f"{name}: {found.source}, {found.samples} samples; condition {found.condition:.3g}")
    for parameter, unit, value in zip(found.names, found.units, found.values, strict=True):
        line(
            "base", f"{parameter}, with what is regrouped into it: {value} {unit if value.determined else ''}"
        )
    for j, joint in enumerate(found.regressor.names):
        unit = "N·m" if found.regressor.revolute[j] else "N"
        said = f"Coulomb {found.coulomb[j]}, viscous {found.viscous[j]}, offset {found.offset[j]}"
        line("friction", f"{joint}: {said} [{unit}]; {found.left[j]:.3g} {unit} are left")
    for joint, constant in zip(found.regressor.names, found.constants, strict=bool(found.constants)):
        line("constant", f"{joint}: {constant} N·m/A, by {options.known_by}")
    if found.payload:
        line(
            "payload",
            f"mass {found.payload[0]} kg, first moments {', '.join(map(str, found.payload[1:4]))} kg·m",
        )
    if found.hidden:
        line("not told", f"by this motion: {', '.join(found.hidden)}", "yellow")
    line("never told", f"by any motion alone: {', '.join(found.never)}")
    if options.output is None:
        return Exit.UNDECIDED if found.hidden else Exit.WITHIN
    made = weighed(found, options.mass)
    text = robot_table(
        found, made, mass=options.mass, source=options.mass_source, currents=options.known_by or ""
    )
    with options.output.open("x", encoding="utf-8") as opened:
        opened.write(text)
    far = f"masses that bodies can have are {made.distance:.2g} standard deviations from the fit"
    line("wrote", f"{options.output}: mass matrix within ± {100 * made.error:.2g} % (95 %); {far}", "bold")
    line("next", "put these keys into the table of the robot in the workstation file")
    return Exit.WITHIN
