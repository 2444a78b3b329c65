"""The maker's shapes on the library's figures: links are matched by name and their frames are checked.

Two descriptions of one robot may put their link frames differently. The frame of a link in the one,
seen from the frame of its namesake in the other, must then be the same wherever the joints are; that
transform carries the shapes over. Where it is not the same, the two are different robots.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np
from msgspec import structs

from seerob.core.errors import InputError
from seerob.core.shapes import Mesh, Solid
from seerob.core.snapshot import Finding
from seerob.core.transforms import Array, inverse
from seerob.description.description import Description, Link, base_from_links, groups
from seerob.description.formats.urdf import moved
from seerob.description.shapes.mesh_bodies import components
from seerob.kernels.signed_distance import outside
from seerob.kernels.tree_file import tree_of

TOLERANCE = 2e-3
"""How far the frames of one link may differ between poses [m and rad]: figures differ between releases."""


def with_geometry_of(robot: Description, maker: Description) -> Description:
    """``robot`` with the shapes of ``maker`` wherever both have a link of the same name.

    Shapes of links that move as one with such a link, and would be there twice, are dropped. Base frames
    are taken to be the same where the root of ``maker`` has a namesake, else the two roots.

    Raises:
        InputError: No joint in common, or joints that do not turn about the same lines.
    """
    ours = {joint.name for joint in robot.joints()}
    common = [joint.name for joint in maker.joints() if joint.name in ours]
    if not common:
        what = (
            f"has no joint in common with {robot.name}: {', '.join(j.name for j in maker.joints()) or 'none'}"
        )
        raise InputError.at(maker.source, "", what, "joints of " + ", ".join(sorted(ours)))
    offsets = _offsets(robot, maker, common)
    shaped = {
        link.name: link for link in maker.links if link.name in offsets and (link.solids or link.visual)
    }
    replaced = _move_with(robot, shaped)
    links = tuple(_dressed(link, shaped, offsets, replaced) for link in robot.links)
    return replace(
        robot,
        links=links,
        source=f"{robot.source}; geometry: {maker.source}",
        findings=(*_kept(robot, replaced), *_said(robot, maker, shaped, replaced)),
        files={**robot.files, **maker.files},
    )


def _offsets(robot: Description, maker: Description, common: list[str]) -> dict[str, Array]:
    """``ours_from_theirs`` (4, 4) of every link of one name."""
    names = [link.name for link in maker.links if any(link.name == mine.name for mine in robot.links)]
    rng = np.random.default_rng(0)
    poses = [np.zeros(len(common)), *(rng.uniform(-2, 2, len(common)) for _ in range(3))]
    found: list[dict[str, Array]] = []
    for q in poses:
        at = dict(zip(common, q.tolist(), strict=True))
        ours, theirs = base_from_links(robot, at), base_from_links(maker, at)
        root = maker.links[0].name
        start = ours.get(root, np.eye(4))
        found.append({name: inverse(ours[name]) @ start @ theirs[name] for name in names})
    wrong = {
        name: max(float(np.abs(one[name] - found[0][name]).max()) for one in found[1:]) for name in names
    }
    strangers = [name for name in names if wrong[name] > TOLERANCE]
    if strangers:
        far = f"by up to {max(wrong.values()):.3g} m"
        what = f"moves {', '.join(strangers)} differently from {robot.source}, {far}"
        raise InputError.at(
            maker.source, "", what, "name the description of the same robot in the same version"
        )
    return found[0]


def _move_with(robot: Description, shaped: Mapping[str, Link]) -> set[str]:
    """Links of ours whose own shapes give way."""
    return {
        link.name for group in groups(robot.links) if any(m.name in shaped for m in group) for link in group
    }


def _dressed(
    link: Link, shaped: Mapping[str, Link], offsets: Mapping[str, Array], replaced: set[str]
) -> Link:
    if link.name not in replaced:
        return link
    if link.name not in shaped:
        return replace(link, visual=(), solids=())
    theirs, ours_from_theirs = shaped[link.name], offsets[link.name]
    visual = tuple(mesh.moved(ours_from_theirs) for mesh in theirs.visual)
    solids = tuple(moved(solid, ours_from_theirs) for solid in theirs.solids)
    return replace(link, visual=visual, solids=solids)


def _kept(robot: Description, replaced: set[str]) -> tuple[Finding, ...]:
    """Our findings, without the one on the envelope when nothing of it is left."""
    left = [link for link in robot.links if link.solids and link.name not in replaced]
    return tuple(f for f in robot.findings if left or "envelope" not in f.text)


def _said(
    robot: Description, maker: Description, shaped: Mapping[str, Link], replaced: set[str]
) -> list[Finding]:
    """What carried over, what did not, and the maker's findings about shapes."""
    said = []
    left = [link.name for link in robot.links if link.solids and link.name not in replaced]
    if left:
        text = f"no shapes for {', '.join(left)} in {maker.source}: the envelope stays there"
        said.append(Finding(level="warning", subject=robot.name, text=text))
    names = {link.name for link in robot.links}
    lost = [link.name for link in maker.links if link.solids and link.name not in names]
    if lost:
        text = f"shapes of {', '.join(lost)} in {maker.source} left out: no link of that name"
        said.append(Finding(level="warning", subject=robot.name, text=text))
    about = {f"{robot.name}/{name}" for name in shaped}
    for finding in maker.findings:
        subject = f"{robot.name}/{finding.subject.partition('/')[2]}"
        of_a_file = finding.text.partition(": ")[0] in maker.files
        # What holds the robot holds it in these shapes, too.
        if finding.holds or (subject in about and (of_a_file or "sticks out" in finding.text)):
            said.append(structs.replace(finding, subject=subject))
    return said


# -- how far what is shown sticks out of what distances see ---------------------------------------

WORTH_SAYING = 1e-4
"""Protrusions below this are not reported [m]."""
SAMPLES = 2000
"""Vertices looked at per link, besides the extreme ones."""
CRUMB = 1e-5
"""A loose piece of one or two triangles of at most this area [m²] is a slip of the export, no surface."""


def with_protrusions(description: Description) -> Description:
    """The description with the figure on each solid that a shown shape sticks out of, and a finding.

    Distances carry the figure as an interval, so a verdict that hangs on it is UNDECIDED.
    """
    found = []
    deviating: dict[str, float] = {}
    for link, depths in _depths(description):
        crumbs = sum(without_crumbs(mesh)[1] for mesh in link.visual)
        if crumbs:
            text = (
                f"{crumbs} loose pieces of one or two triangles and at most {CRUMB * 1e6:.0f} mm² are shown "
                "but not taken for surface"
            )
            found.append(Finding(level="note", subject=f"{description.name}/{link.name}", text=text))
        if depths.max(initial=0.0) > WORTH_SAYING:
            text = (
                f"the shape shown sticks out of the collision shape by up to {depths.max() * 1e3:.1f} mm "
                f"(99 % of it by at most {np.quantile(depths, 0.99) * 1e3:.1f} mm; sampled): "
                "distances may be that much too long"
            )
            found.append(Finding(level="warning", subject=f"{description.name}/{link.name}", text=text))
            deviating[link.name] = float(depths.max())
    links = tuple(
        replace(link, solids=tuple(_deviating(solid, deviating[link.name]) for solid in link.solids))
        if link.name in deviating
        else link
        for link in description.links
    )
    return replace(description, links=links, findings=(*description.findings, *found))


def _deviating(solid: Solid, far: float) -> Solid:
    return replace(solid, deviation=max(solid.deviation, far))


def _depths(description: Description) -> Iterator[tuple[Link, Array]]:
    for link in description.links:
        if link.visual and link.solids:
            yield link, outside_distances(link)


def outside_distances(link: Link) -> Array:
    """Distance [m] of sampled display vertices to the nearest solid, 0 inside, shape (n,)."""
    points = np.concatenate(
        [_sampled(without_crumbs(mesh)[0], SAMPLES // len(link.visual) + 1) for mesh in link.visual]
    )
    least = np.full(len(points), np.inf)
    for solid in link.solids:
        # Points that some solid contains need not be looked at again.
        rest = least > 0
        least[rest] = np.minimum(least[rest], _from_solid(solid, points[rest]))
    return least


def without_crumbs(mesh: Mesh) -> tuple[Array, int]:
    """Vertices of a mesh without those of loose crumbs, shape (n, 3) [m], and how many crumbs there were.

    Makers' display meshes carry stray triangles far from the surface; one of 5 mm² would otherwise
    make every distance of its link uncertain by centimetres.
    """
    _, place = np.unique(np.round(mesh.vertices, 7), axis=0, return_inverse=True)
    faces = place.ravel()[mesh.faces]
    n = int(place.max()) + 1
    ends = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]]])
    count, piece = components(n, ends)
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
    area = np.bincount(piece[faces[:, 0]], np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2, count)
    triangles = np.bincount(piece[faces[:, 0]], minlength=count)
    crumb = (triangles > 0) & (triangles <= 2) & (area <= CRUMB)
    if not crumb.any() or crumb.all():
        return mesh.vertices, 0
    return mesh.vertices[~crumb[piece[place.ravel()]]], int(crumb.sum())


def _from_solid(solid: Solid, points: Array) -> Array:
    if solid.mesh is not None:
        tree = tree_of(solid.mesh.vertices, solid.mesh.faces)
        depth = outside(tree.nodes, tree.links, tree.triangles, np.ascontiguousarray(points))
        return np.asarray(np.maximum(depth - solid.radius, 0.0))
    assert solid.points is not None
    corner, *ends = solid.points
    offset = points - corner
    nearest = np.zeros_like(points)
    for end in ends:
        edge = end - corner
        squared = float(edge @ edge)
        share = np.clip(offset @ edge / squared, 0, 1) if squared else np.zeros(len(points))
        nearest += share[:, None] * edge
    return np.asarray(np.maximum(np.linalg.norm(offset - nearest, axis=1) - solid.radius, 0.0))


def _sampled(vertices: Array, count: int) -> Array:
    """Every so-many-th vertex, and the outermost along 13 directions."""
    grid = np.stack(np.meshgrid([-1, 0, 1], [-1, 0, 1], [-1, 0, 1], indexing="ij"), axis=-1).reshape(-1, 3)
    along = vertices @ grid[14:].T
    outer = np.concatenate([along.argmax(axis=0), along.argmin(axis=0)])
    step = max(1, len(vertices) // count)
    chosen = np.unique(np.concatenate([np.arange(0, len(vertices), step), outer]))
    return np.asarray(vertices[chosen])
