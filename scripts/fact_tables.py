"""Tables of facts for docs/, as Markdown: robots of the library, axes of the person, statures, headers."""

from __future__ import annotations

from seerob.description.humans import anthropometry
from seerob.description.humans.anthropometry import table
from seerob.description.humans.skeleton import AXES
from seerob.description.robots import library
from seerob.workstation.plausibility.ranges import data


def plain(text: str) -> str:
    """Docstring text in one Markdown cell."""
    return text.replace("``", "`").replace("|", "\\|")


def markdown(head: tuple[str, ...], rows: list[tuple[str, ...]]) -> str:
    """A Markdown table."""
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return "\n".join([*lines, *("| " + " | ".join(row) + " |" for row in rows)]) + "\n"


def library_table() -> str:
    """Robots of the library: joints, moving mass, where the figures come from."""
    rows = []
    for name in library.names():
        robot = library.load(name)
        joints = robot.joints()
        inertials = [link.inertial for link in robot.links if link.inertial is not None]
        origin = ", ".join(sorted({i.origin.value for i in inertials})) or "none: energies are UNDECIDED"
        mass = f"{sum(i.mass for i in inertials):.3g} kg" if inertials else "not published"
        known = [
            f"{what} {sum(getattr(j, key) is not None for j in joints)} of {len(joints)}"
            for what, key in (("speed", "velocity"), ("torque", "effort"))
        ]
        rows.append((f"`library:{name}`", str(len(joints)), mass, origin, ", ".join(known)))
    return markdown(("model", "joints", "mass of all links", "origin of the masses", "limits known"), rows)


def plausible_table() -> str:
    """Quantities of a workstation file, in which range each is plausible, and why."""
    rows = [
        (
            "anything else" if row.key == "*" else f"`{row.key}`",
            row.unit,
            ("0, or " * row.zero * (row.low > 0)) + f"{row.low:g} to {row.high:g}",
            f"{row.because}; {row.right}",
            f"{row.source} ({row.confidence})",
        )
        for row in data().ranges
    ]
    return markdown(("key", "unit", "plausible", "because; what was probably meant", "source"), rows)


def joints_table() -> str:
    """Axes of the person: name, opposite, range and where it comes from."""
    limits = table("limits")
    rows, seen = [], set()
    for axis in AXES:
        if axis.name.startswith("left_") or axis.name in seen:
            continue
        seen.add(axis.name)
        name = axis.name.replace("right_", "", 1) if axis.name.startswith("right_") else axis.name
        other = (
            axis.opposite.replace("right_", "", 1) if axis.opposite.startswith("right_") else axis.opposite
        )
        if axis.group == "pelvis":
            span, source = "none", "" if axis.opposite else "a length [m]"
        else:
            ranges = limits[axis.group]
            plus, minus = axis.senses
            low = f"−{ranges[f'{minus}_deg']:g}" if ranges[f"{minus}_deg"] else "0"
            span, source = f"{low}° … {ranges[f'{plus}_deg']:g}°", ranges["source"]
        side = "right_, left_, both_" if axis.name.startswith("right_") else ""
        rows.append((f"`{name}`", side, f"`{other}`" if other else "", span, plain(source)))
    return markdown(("positive", "with side", "negative", "range", "source of the range"), rows)


def statures_table() -> str:
    """Published statures by population."""
    rows = []
    for name, people in table("statures").items():
        cells = [
            " / ".join(str(people[sex][p]) if p in people[sex] else "–" for p in ("p5", "p50", "p95"))
            for sex in (s.value for s in anthropometry.Sex)
        ]
        rows.append((f"`{name}`", *cells, people["source"], people["confidence"]))
    return markdown(("population", "men P5 / P50 / P95 [mm]", "women [mm]", "source", "confidence"), rows)


def headers_table() -> str:
    """Headers on every answer of the server."""
    from seerob.app.server.door import HEADERS

    return markdown(("header", "value"), [(f"`{name}`", f"`{value}`") for name, value in HEADERS.items()])
