"""Is it plausible? Every check on what a robot or a thing is said to be, each a small function of numbers.

Checks of one value return what may be used of it and a sentence for the reader of a result; checks
of a whole description return findings. What cannot be used at all is the readers' business.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from seerob.core.errors import Problem
from seerob.core.quantities import LENGTHS
from seerob.core.remembered import remembered
from seerob.core.shapes import Solid
from seerob.core.snapshot import Origin
from seerob.core.transforms import Array
from seerob.description.description import Description, Inertial, Joint, JointKind, Link, groups
from seerob.description.shapes import moments
from seerob.description.shapes.mesh_bodies import is_closed
from seerob.description.xml_values import Reader

MAX_LIMIT = {"effort": 1e5, "velocity": 1e3}
"""Beyond these a limit means "none" [N·m or N; rad/s or m/s]."""
EXTENTS = (1e-4, 20.0)
"""Largest edge of the box around a link, tool, workpiece or part, outside of which a unit is wrong [m]."""
LIKELY = (0.01, 10.0)
"""Within these a unit is worth proposing [m]."""
MAX_MASS = 1e4
"""Largest mass of one thing [kg]."""
NOTHING = 1e-9
"""Up to this a mass is none [kg]."""
POINT = 1e-8
"""A radius of gyration up to this is none [m]."""
DENSITIES = (10.0, 25_000.0)
"""From foam to the heaviest metals [kg/m³]."""
LARGEST = 1e12
"""No body here has an inertia beyond this [kg·m²]."""
REPAIRABLE = 0.02
"""Violation of A + B >= C, relative to the largest moment, that rounding in a file explains."""
CONCENTRATED = 0.04
"""Least radius of gyration over the diagonal of the box around a shape: a rod has 0.29, a ball 0.18."""
ASIDE = 0.25
"""So far from the frame's origin is the middle of a box, of its diagonal, where no centre of mass is."""
LIGHT = 0.05
"""Up to this what nobody weighed, and is as small in the heaviest metal, is a marker [kg]."""
FRAME = 1e-3
"""Up to this a link without a shape is a frame to which a simulator's mass was given [kg]: it is told."""
TIPS = (
    "tool0",
    "tcp",
    "tool_link",
    "tool_tip",
    "attachment_site",
    "ee_link",
    "link_ee",
    "end_effector",
    "flange",
)
"""Endings of names that point out the link a tool is mounted on, the best first."""
FLANGES = ("flange", "tool0", "attachment_site", "ee_link", "link_ee")
"""Of those the ones beyond which a file has no robot any more, but what is mounted on it."""
OPEN = (
    "mesh is open: distances are to its surface alone, as if nothing closed its holes, and what counts as "
    "inside goes by the winding number"
)
INSIDE = "mesh is open, and what counts as inside goes by the winding number"
CLOSED = "mesh is open: each opening counts as closed in the convex hull of its rim"
PERHAPS_OPEN = (
    "mesh is open, and nobody says whether its openings are closed in reality: nothing is within that would "
    "not be with a surface anywhere in the convex hull of their rims, and one that bulges beyond is not "
    'looked for; give openings = "open" or "closed"'
)
ROTOR = (
    "rotor inertia unknown, nobody published it: mass matrix and effective mass are those of the links alone"
)


def openings(said: str | None, solids: Iterable[Solid]) -> tuple[str, str]:
    """Level and text of a finding about an open mesh.

    Args:
        said: What the user says of its openings.
        solids: With what may close them where nobody says that; of slits that rounding left, nothing.
    """
    if any(solid.lids for solid in solids):
        return "warning", PERHAPS_OPEN
    return "note", CLOSED if said == "closed" else OPEN


def plausible_limit(which: str, value: float | None) -> tuple[float | None, str]:
    """A joint limit that can be used, and why not otherwise.

    Args:
        which: ``effort`` or ``velocity``.
        value: What the file says; None when it says nothing.
    """
    if value is None:
        return None, ""
    if value <= 0:
        return None, f"{which} limit is {value:g}, expected more than 0: unknown"
    if value >= MAX_LIMIT[which]:
        return (
            None,
            f"{which} limit is {value:g}, expected less than {MAX_LIMIT[which]:g}: a placeholder, unknown",
        )
    return value, ""


def plausible_inertial(inertial: Inertial, *, body: bool) -> tuple[Inertial | None, str, str]:
    """Mass properties that a body can have, with the level and text of a finding (empty when all is well).

    A rigid body's second moment ``Σ = ½ tr(I) 1 - I`` has no negative eigenvalue; that is the triangle
    inequality A + B >= C of its principal moments. Small violations are mended by clipping Σ.

    Args:
        inertial: What the file says.
        body: Whether it is one: a joint moves it, or it has a shape. It then has a mass and an inertia.
    """
    mass, inertia = inertial.mass, inertial.inertia
    if mass <= NOTHING and (body or mass <= 0):
        if not body and not inertia.any():
            return None, "", ""
        least = NOTHING if mass > 0 else 0
        return None, "warning", f"mass is {mass:g} kg, expected more than {least:g}: mass and inertia unknown"
    with np.errstate(over="ignore"):
        far = float(np.abs(inertia).sum())
    if not far <= LARGEST:
        return (
            None,
            "warning",
            f"has an inertia of {far:.4g} kg·m², which nothing has: mass and inertia unknown",
        )
    moments = np.linalg.eigvalsh(inertia)
    largest = float(np.abs(moments).max())
    shown = ", ".join(f"{m:.4g}" for m in moments)
    if largest <= mass * POINT**2:
        of = f"mass {mass:g} kg with an inertia of {largest:.4g}" + (" kg·m²" if largest else "")
        if body:
            return None, "warning", f"{of}: mass and inertia unknown"
        return inertial, "note", f"{of}: a point mass"
    second = 0.5 * np.trace(inertia) * np.eye(3) - inertia
    values, vectors = np.linalg.eigh(second)
    violation = -float(values[0]) / largest
    if violation <= -1e-9:
        return inertial, "", ""
    if violation > REPAIRABLE:
        text = f"principal moments {shown} kg·m² break A + B ≥ C by {violation:.0%}: mass and inertia unknown"
        return None, "warning", text
    second = (vectors * np.maximum(values, 1e-6 * largest)) @ vectors.T
    mended = np.trace(second) * np.eye(3) - second
    text = f"principal moments {shown} kg·m² break A + B ≥ C by {max(violation, 0):.2%}: rounding, mended"
    return replace(inertial, inertia=0.5 * (mended + mended.T)), "note", text


def no_mass(mass: float, *, file: str, key: str, moves: bool) -> Problem | None:
    """What is wrong with a link to which its file gives no mass [kg]; None when it has one, or stands still.

    Only a figure that rests on it needs a better one, see `seerob.model.model.Mechanism.require_masses`: a
    frame between two joints weighs nothing either.
    """
    if not moves or mass > NOTHING:
        return None
    return Problem(file, key, f"is {mass:g} kg, and it moves", "a mass is greater than 0")


def impossible_inertia(inertia: Array) -> str:
    """Why no body has this inertia (3, 3) [kg·m²]; empty when one does, but for rounding."""
    a, b, c = np.linalg.eigvalsh(inertia)
    shown = f"principal moments {a:.4g}, {b:.4g}, {c:.4g} kg·m²"
    if a <= 0:
        return f"{shown} are not all greater than 0"
    if c - a - b > 2 * REPAIRABLE * c:
        return f"{shown} break A + B ≥ C"
    return ""


def odd_extent(extent: float, *, unit: str | None = None) -> str:
    """What is odd about the largest edge [m] of something, and which unit would fit; empty when nothing is.

    Args:
        extent: As read.
        unit: Unit that it was read in; None when the file itself said it.
    """
    if EXTENTS[0] <= extent <= EXTENTS[1]:
        return ""
    raw = extent / LENGTHS[unit or "m"]
    fits = [u for u in ("m", "mm", "inch", "cm", "um") if LIKELY[0] <= raw * LENGTHS[u] <= LIKELY[1]]
    what = f"largest extent {extent:.4g} m, expected {EXTENTS[0]:g} m to {EXTENTS[1]:g} m: check the unit"
    return what + (f"; read as {fits[0]} it would be {raw * LENGTHS[fits[0]]:.4g} m" if fits else "")


def odd_mass(mass: float, volume: float, *, exact: bool) -> str:
    """What is odd about a mass [kg] in a shape; empty when nothing is.

    Args:
        mass: As given.
        volume: Of the shape [m³].
        exact: Whether the shape fills its volume; otherwise it is a bound from above.
    """
    if mass > MAX_MASS:
        return f"mass is {mass:.4g} kg, expected at most {MAX_MASS:g} kg: check the unit"
    density = mass / volume if volume > 0 else 0.0
    if density > DENSITIES[1] or (exact and 0 < density < DENSITIES[0]):
        at = "" if exact else "at least "
        return f"mass {mass:.4g} kg in {volume:.3g} m³ is {at}{odd_density(density)}"
    return ""


def odd_density(density: float) -> str:
    """A density [kg/m³] that no solid has, in words; empty when one has it."""
    if DENSITIES[0] <= density <= DENSITIES[1]:
        return ""
    low, high = DENSITIES
    return (
        f"{density:.4g} kg/m³, expected {low:g} to {high:g} kg/m³: check the units of mass, density and size"
    )


@remembered
def too_light(link: Link) -> str:
    """Why a body of a link's shape weighs more than is said; empty when it may not, or has no volume."""
    if link.inertial is None or not link.solids or link.inertial.origin is Origin.GIVEN:
        return ""  # what the user writes is looked at where the workstation file is
    volume = sum(filled(solid) for solid in link.solids)
    if link.inertial.mass >= DENSITIES[0] * volume * (1 - 1e-9):
        return ""
    return f"{link.inertial.mass:.3g} kg in {volume:.3g} m³ is lighter than any foam: give it in masses"


@remembered
def as_good_as_a_point(link: Link) -> str:
    """Why the mass of a link is spread farther than its file says; empty when it need not be, or is little.

    Of a body that is said to be as good as a point energies and effective masses may be far too low. One that
    is said to be spread too far has them too high, which is only told.
    """
    inertial = link.inertial
    if inertial is None or inertial.mass <= LIGHT or inertial.origin is Origin.GIVEN or not link.solids:
        return ""
    size, gyration = float(np.linalg.norm(np.subtract(*box(link.solids)))), _gyration(inertial)
    if gyration >= CONCENTRATED * size:
        return ""
    return f"radius of gyration {gyration:.3g} m in a shape of {size:.3g} m: give it in masses"


def _gyration(inertial: Inertial) -> float:
    return float(np.sqrt(np.linalg.eigvalsh(inertial.inertia).max() / inertial.mass))


@remembered
def filled(solid: Solid) -> float:
    """What a solid encloses [m³]; 0 where its mesh is open."""
    if solid.mesh is None:
        return moments.of_solid(solid).volume if solid.radius > 0 else 0.0
    return max(moments.signed_volume(solid.mesh), 0.0) if is_closed(solid.mesh) else 0.0


def misplaced_com(com: Array, low: Array, high: Array) -> str:
    """Why a centre of mass [m] cannot belong to the box from ``low`` to ``high``; empty when it can."""
    size = float(np.linalg.norm(high - low))
    if ((low - size <= com) & (com <= high + size)).all():
        return ""
    return f"centre of mass {com.tolist()} m lies more than {size:.3g} m, the size of the shape, outside it"


def box(solids: Sequence[Solid]) -> tuple[Array, Array]:
    """Lowest and highest corner [m] of the box around solids, of which there is at least one."""
    points = np.concatenate([extreme_points(solid) for solid in solids])
    return points.min(axis=0), points.max(axis=0)


def guessed_tip(links: Sequence[Link]) -> str:
    """The link a tool is most likely mounted on: a customary name, else the end of the longest chain."""
    for ending in TIPS:
        for link in links:
            if link.name.lower().endswith(ending):
                return link.name
    depth: dict[str, tuple[int, int]] = {}
    for link in links:
        joints, steps = depth[link.parent] if link.parent else (0, 0)
        depth[link.name] = (joints + len(link.joints), steps + 1)
    return max(depth, key=lambda name: depth[name]) if depth else ""


def checked(description: Description, reader: Reader) -> Description:
    """The description with placeholders marked as such, and every finding of the reader and of this file."""
    description = _placeholder_inertias_marked(description, reader)
    description = _placeholder_centres_marked(description, reader)
    for level, subject, text in _findings(description):
        reader.finding(level, subject, text)
    return replace(description, findings=(*description.findings, *reader.findings))


def _findings(description: Description) -> Iterator[tuple[str, str, str]]:
    joints = description.joints()
    if not description.tip.lower().endswith(TIPS):
        yield "note", "", f"tip taken as {description.tip}, the end of the longest chain"
    for which in ("effort", "velocity"):
        yield from flat_limits(which, joints)
        unknown = [joint.name for joint in joints if getattr(joint, which) is None]
        if unknown:
            yield "warning", "", f"{which} limit unknown: {', '.join(unknown)}"
    yield from massless(description)
    yield from open_meshes(description)
    for link in description.links:
        if link.solids:
            text = odd_extent(float(np.subtract(*box(link.solids)[::-1]).max()))
            if text:
                yield "warning", link.name, text
        yield from misplaced_mass(link)
        if link.inertial is not None and not link.solids and link.inertial.mass > NOTHING:
            frame = link.inertial.mass <= FRAME
            text = f"has a mass of {link.inertial.mass:g} kg but no shape: no distance sees it"
            text += f"; up to {1e3 * FRAME:g} g it is taken for a frame" if frame else ""
            yield "assumed" if frame else "warning", link.name, text
    if joints and all(joint.armature is None for joint in joints):
        yield "assumed", "", ROTOR
    yield from rotors(joints)


def flat_limits(which: str, joints: Iterable[Joint]) -> Iterator[tuple[str, str, str]]:
    """One finding when four or more joints of one kind carry the same limit: often a placeholder."""
    quantities = [(joint, getattr(joint, which)) for joint in joints]
    for kind in JointKind:
        values = [q.value for joint, q in quantities if joint.kind is kind and q is not None]
        if len(values) >= 4 and all(a == b for a, b in pairwise(values)):
            same = f"{values[0]:g} for all {len(values)} {kind.value} joints alike"
            yield (
                ("warning" if which == "effort" else "note"),
                "",
                f"{which} limit is {same}: check the source",
            )


def rotors(joints: Iterable[Joint]) -> Iterator[tuple[str, str, str]]:
    """What a file says of rotor inertias, which are in every energy and effective mass that follows."""
    given = [(joint.name, joint.armature) for joint in joints if joint.armature is not None]
    if not given:
        return
    shown = ", ".join(f"{name} {armature.value:g}" for name, armature in given)
    yield "note", "", f"rotor inertia (armature) from the file is in the mass matrix [kg·m² or kg]: {shown}"
    if len(given) >= 4 and len({armature.value for _, armature in given}) == 1:
        same = f"{given[0][1].value:g} for all {len(given)} joints alike"
        text = f"rotor inertia is {same}: check the source, it may have been chosen for a stable simulation"
        yield "warning", "", text


def massless(description: Description) -> Iterator[tuple[str, str, str]]:
    """A finding for each joint that moves nothing with a known mass, before the next joint."""
    for group in groups(description.links):
        if group[0].joints and not any(link.inertial for link in group):
            yield "warning", group[0].name, "moved by a joint, but mass and inertia unknown"


def open_meshes(description: Description) -> Iterator[tuple[str, str, str]]:
    """A finding with the links whose surface has a hole, so that what is inside of them is a convention."""
    if found := open_links(description):
        yield "note", "", f"{', '.join(found)}: {INSIDE}"


def open_links(description: Description) -> list[str]:
    """Names of links whose surface has a hole."""
    return [
        link.name
        for link in description.links
        if any(solid.mesh is not None and not is_closed(solid.mesh) for solid in link.solids)
    ]


def misplaced_mass(link: Link) -> Iterator[tuple[str, str, str]]:
    """Findings when centre of mass or radius of gyration do not fit the link's shape."""
    if link.inertial is None or not link.solids:
        return
    low, high = box(link.solids)
    size = float(np.linalg.norm(high - low))
    com = link.inertial.com
    outside = float(np.linalg.norm(np.maximum(np.maximum(low - com, com - high), 0)))
    if outside > 0.25 * size:
        text = f"centre of mass {np.round(com, 4).tolist()} m lies {outside:.3g} m outside the shape's box"
        yield "warning", link.name, text
    gyration = _gyration(link.inertial)
    if gyration > size or 0 < gyration < CONCENTRATED * size:
        text = f"radius of gyration {gyration:.3g} m does not fit a shape of {size:.3g} m"
        yield "warning", link.name, text


def extreme_points(solid: Solid) -> Array:
    """Points [m], shape (n, 3), whose bounding box is that of the solid."""
    if solid.mesh is not None:
        return solid.mesh.vertices
    assert solid.points is not None
    points = solid.points
    if len(points) == 3:
        points = np.vstack([points, points[1] + points[2] - points[0]])
    return np.concatenate([points - solid.radius, points + solid.radius])


def _placeholder_inertias_marked(description: Description, reader: Reader) -> Description:
    """Three or more links of different mass with one and the same ``a·1`` inertia were never measured."""
    same: dict[float, list[Link]] = {}
    for link in description.links:
        if link.inertial is not None:
            a = float(link.inertial.inertia[0, 0])
            if np.array_equal(link.inertial.inertia, a * np.eye(3)):
                same.setdefault(a, []).append(link)
    marked: dict[str, Link] = {}
    for a, links in same.items():
        masses = {link.inertial.mass for link in links if link.inertial}
        if len(links) < 3 or (len(masses) == 1 and len(links) < 4):
            continue
        text = (
            f"inertia {a:g}·1 kg·m² on {len(links)} links alike is a placeholder: masses and inertias assumed"
        )
        reader.finding("warning", "", text)
        for link in links:
            assert link.inertial is not None
            source = f"{link.inertial.source}: placeholder inertia"
            marked[link.name] = replace(
                link, inertial=replace(link.inertial, origin=Origin.ASSUMED, source=source)
            )
    links_now = tuple(marked.get(link.name, link) for link in description.links)
    return replace(description, links=links_now)


def centres_at_origins(links: Sequence[Link]) -> str:
    """Why centres of mass were never stated: four or more moving links have theirs at their frame's origin.

    At least one of their shapes reaches far to one side of it; empty where nothing shows it.
    """
    moving = [link for link in links if link.joints and link.inertial is not None]
    if len(moving) < 4 or any(link.inertial.com.any() for link in moving if link.inertial):
        return ""
    for link in moving:
        if link.solids:
            low, high = box(link.solids)
            if np.linalg.norm(0.5 * (low + high)) > ASIDE * np.linalg.norm(high - low):
                return f"centres of mass of {len(moving)} links are all at the origins of their frames"
    return ""


def _placeholder_centres_marked(description: Description, reader: Reader) -> Description:
    why = centres_at_origins(description.links)
    if not why:
        return description
    reader.finding("warning", "", f"{why}: nobody stated them, masses and inertias assumed")

    def marked(link: Link) -> Link:
        if not link.joints or link.inertial is None:
            return link
        source = f"{link.inertial.source}: placeholder centre of mass"
        return replace(link, inertial=replace(link.inertial, origin=Origin.ASSUMED, source=source))

    return replace(description, links=tuple(marked(link) for link in description.links))
