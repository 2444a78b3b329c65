"""``seerob robots``: which robots can be named, what is known of each, and what that leaves undecided."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from importlib import metadata
from typing import TYPE_CHECKING

from seerob.app.console.terminal import OUT, Exit, line

if TYPE_CHECKING:
    from seerob.description.description import Description
    from seerob.description.robots.library import Entry

HELP = "list robots that can be named, with what is known of each; fetch a published description"
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


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments."""
    sub.add_argument("--all", action="store_true", help="published descriptions of hands and walkers, too")
    actions = sub.add_subparsers(dest="action", metavar="action", parser_class=type(sub))
    text = "clone what a published description needs into the cache of robot_descriptions"
    fetch = actions.add_parser("fetch", help=text, description=text)
    fetch.add_argument("name", help="description as the package has it: ur5e_description")


def run(options: argparse.Namespace) -> int:
    """List, or fetch."""
    if options.action == "fetch":
        return _fetch(options.name)
    _library()
    _descriptions(options.all)
    _packages()
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


def _figures(entry: Entry, robot: Description) -> str:
    masses = [link.inertial.mass for link in robot.links if link.inertial is not None]
    texts = (
        "?" if entry.reach is None else f"{entry.reach.value:.3g} m",
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
