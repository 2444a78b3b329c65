"""The maker's shapes on the library's figures: links are matched by name and their frames are checked.

Two descriptions of one robot may put their link frames differently. The frame of a link in the one,
seen from the frame of its namesake in the other, must then be the same wherever the joints are; that
transform carries the shapes over. Where it is not the same, the two are different robots.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from seerob.core.errors import InputError
from seerob.core.snapshot import Finding
from seerob.core.transforms import Array, inverse
from seerob.description.description import Description, Link
from seerob.description.formats.urdf_geometry import moved
from seerob.description.pose import base_from_links, groups

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
        if subject in about and (of_a_file or "sticks out" in finding.text):
            said.append(Finding(level=finding.level, subject=subject, text=finding.text))
    return said
