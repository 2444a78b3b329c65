"""URDF and MJCF as cells: what stands becomes parts, what moves becomes mechanisms.

A description whose root has no shape and carries things by fixed joints alone is a cell, as an export of ours
or of a simulator is; any other one with joints is one mechanism.
"""

from __future__ import annotations

import hashlib
from dataclasses import replace

import numpy as np

from seerob.core.snapshot import Origin
from seerob.core.transforms import Array, inverse
from seerob.description.cad import standing
from seerob.description.cad.assembly import SINGLE, Assembly, Instance, Moving, Shape
from seerob.description.description import Description, Inertial, Link
from seerob.description.formats.mjcf import UNSHAPED
from seerob.description.loader import load_robot
from seerob.description.mesh_files import MeshSource


def read(source: MeshSource, ending: str) -> Assembly:
    """The assembly of a URDF or MJCF file.

    Args:
        source: The file; others that it names are read in its folder and below, as of any description.
        ending: ``.urdf`` or ``.mjcf``.

    Raises:
        InputError: It cannot be read, or holds no shape.
    """
    path = source.path
    description = load_robot(path.name, folder=path.parent, name=path.stem)
    return taken_apart(description, source, "URDF" if ending == ".urdf" else "MJCF")


def taken_apart(description: Description, source: MeshSource, form: str) -> Assembly:
    """What of a description stands and what moves."""
    source.files.update({name: data for name, data in description.files.items() if name != source.path.name})
    root = description.links[0]
    below: dict[str, list[Link]] = {}
    for link in description.links:
        if link.parent is not None:
            below.setdefault(link.parent, []).append(link)
    first = below.get(root.name, [])
    whole = bool(root.solids or root.visual or root.inertial) or (
        root.name != "world" and len(first) == 1 and bool(first[0].joints)
    )
    mechanisms: list[Moving] = []
    shapes: list[Shape] = []
    known: dict[bytes, int] = {}
    instances: list[Instance] = []
    # What holds a robot holds what is made of it; what a robot cannot have may be what stands.
    left_out = [(f.subject, f.text) for f in description.findings if f.holds or f.text.endswith(UNSHAPED)]

    def subtree(link: Link) -> list[Link]:
        found = [link]
        for other in found:
            found += below.get(other.name, ())
        return found

    def stand(link: Link, world: Array) -> None:
        pieces, deviation = standing.surface(link)
        if pieces:
            key = hashlib.sha256(repr(deviation).encode())
            for mesh in pieces:
                key.update(
                    mesh.vertices.round(9).tobytes() + mesh.faces.tobytes() + repr(mesh.color).encode()
                )
            number = known.setdefault(key.digest(), len(shapes))
            if number == len(shapes):
                largest = max(float(np.abs(mesh.vertices).max()) for mesh in pieces)
                shapes.append(Shape(link.name.rpartition("/")[2], pieces, deviation + SINGLE * largest))
            path = tuple(filter(None, link.name.split("/")))
            instances.append(Instance(path, number, world, inertial=_known(link)))
        elif why := standing.unseen(replace(link, inertial=_known(link))):
            left_out.append((link.name, why))
        for other in below.get(link.name, ()):
            place(other, world @ other.parent_from_link)

    def place(link: Link, world: Array) -> None:
        if any(other.joints for other in subtree(link)):
            tree = subtree(link)
            if link.joints:
                prefix = f"{link.name.partition('/')[0]}/" if "/" in link.name else ""
                base = Link(f"{prefix}world_link", None, np.eye(4))
                tree = [base, replace(link, parent=base.name), *tree[1:]]
                world = world @ inverse(link.parent_from_link)
            mechanisms.append(_mechanism(tree, world, description))
        else:
            stand(link, world)

    if whole and description.joints():
        links = tuple(replace(link, inertial=_known(link)) for link in description.links)
        mechanisms.append(Moving(replace(description, links=links), root.parent_from_link))
    else:
        stand(root, root.parent_from_link)
    if not instances and not mechanisms:
        source.fail("holds no shape", "export meshes or simple shapes")
    findings = (*source.findings, *description.findings)
    return Assembly(
        form,
        "m",
        tuple(shapes),
        tuple(instances),
        findings,
        tuple(left_out),
        dict(source.files),
        tuple(mechanisms),
    )


def _mechanism(links: list[Link], world: Array, description: Description) -> Moving:
    """A mechanism whose base is the first of its links; names lose what all of them begin with."""
    prefix = links[0].name.partition("/")[0] + "/"
    common = links[0].name.startswith(prefix)
    joints = [joint.name for link in links for joint in link.joints]
    joined = common and all(name.startswith(prefix) for name in joints)

    def plain(name: str) -> str:
        return name.removeprefix(prefix) if common else name

    made = []
    for number, link in enumerate(links):
        own = tuple(
            replace(
                joint,
                name=joint.name.removeprefix(prefix) if joined else joint.name,
                mimic=joint.mimic
                if joint.mimic is None or not joined
                else replace(joint.mimic, joint=joint.mimic.joint.removeprefix(prefix)),
            )
            for joint in link.joints
        )
        parent = None if number == 0 else plain(link.parent or "")
        at = np.eye(4) if number == 0 else link.parent_from_link
        made.append(
            replace(
                link,
                name=plain(link.name),
                parent=parent,
                parent_from_link=at,
                joints=own,
                inertial=_known(link),
            )
        )
    name = prefix[:-1] if common else links[0].name
    tip = plain(description.tip) if description.tip in {link.name for link in links} else made[-1].name
    return Moving(Description(name, tuple(made), tip, description.source), world)


def _known(link: Link) -> Inertial | None:
    """Mass properties that the file states; what a simulator would assume is nobody's figure."""
    assumed = link.inertial is None or link.inertial.origin is Origin.ASSUMED
    return None if assumed else link.inertial
