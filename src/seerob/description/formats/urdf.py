"""URDF in: every link and joint kept, every number checked, every mistake reported at once.

Not MuJoCo's own reader, which drops names of fixed links, the root's inertia, speed limits and visuals, turns
mimic joints into soft constraints and invents masses from volumes. Each link comes after its parent, depth
first, as the file has them.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePosixPath
from xml.etree.ElementTree import Element

import numpy as np

from seerob.core.errors import InputError, Problem, suggestion
from seerob.core.shapes import Mesh, Solid, capsule
from seerob.core.snapshot import Finding, Origin
from seerob.core.transforms import Array, apply
from seerob.description import lint
from seerob.description.description import Description, Inertial, Joint, JointKind, Link, Mimic, Quantity
from seerob.description.formats.mimic import flattened
from seerob.description.formats.resolve import Resolver
from seerob.description.mesh import LoadedMeshes, NamedMesh, load_meshes
from seerob.description.shapes import shapes
from seerob.description.shapes.detail import physics_mesh
from seerob.description.shapes.mesh_mending import with_insides
from seerob.description.xml_values import FARTHEST, HEAVIEST, NUMBER, SMALLEST, Reader, parse_xml

SHAPES = ("mesh", "box", "cylinder", "sphere", "capsule")
WITHOUT_UNIT = {".stl", ".obj", ".ply", ".off"}


@dataclass
class Shapes:
    """Reads the geometry of one URDF; each mesh file once."""

    reader: Reader
    resolver: Resolver
    colors: dict[str, shapes.Color] = field(default_factory=dict)
    files: dict[str, bytes] = field(default_factory=dict)
    loaded: dict[tuple[str, tuple[float, float, float]], LoadedMeshes | list[Problem]] = field(
        default_factory=dict
    )
    """By name and scale: the meshes, or what is wrong with the file."""
    visuals: bool = True
    """Whether shapes that only the eye needs are read."""

    def read_colors(self, robot: Element) -> None:
        """Remembers the materials that the robot declares for all its links."""
        for i, material in enumerate(robot.findall("material")):
            self._color(material, f"material[{i}]")

    def shown(self, link: Element, name: str) -> tuple[Mesh, ...]:
        """What can be read of the link's ``<visual>`` elements where others are there for distances.

        What cannot is left out of the pictures. How far it stands out of what distances see is unknown then,
        so a finding holds the robot. Where the user says that they are not to be read, none is.
        """
        if not self.visuals:
            return ()
        problems = self.reader.problems
        before = len(problems)
        found = self.visual(link, name)
        for problem in problems[before:]:
            text = (
                f"{problem.key.partition('.')[2]} is left out of pictures ({problem.what}), and how far it "
                "stands out of the collision shape is unknown: mend it, take it out of the description, or "
                'say visuals = "ignore" where the collision shapes hold all of the link'
            )
            about = f"{self.reader.robot}/{name}"
            held = Finding(level="warning", subject=about, text=text, holds=(self.reader.robot,))
            self.reader.findings.append(held)
        del problems[before:]
        return found

    def visual(self, link: Element, name: str) -> tuple[Mesh, ...]:
        """Everything in the link's ``<visual>`` elements, in the link's frame."""
        found: list[Mesh] = []
        for key, element, kind, link_from_shape in self._elements(link, name, "visual"):
            color = self._color(element.find("material"), key)
            if kind.tag == "mesh":
                meshes = [mesh for named in self._meshes(kind, key, name) for mesh in named.drawn]
            else:
                solid = self._primitive(kind, key)
                meshes = [] if solid is None else [solid[1]]
            for mesh in meshes:
                shown = mesh.moved(link_from_shape)
                found.append(replace(shown, color=color) if color else shown)
        return tuple(found)

    def solids(self, link: Element, name: str, tag: str) -> tuple[Solid, ...]:
        """Everything in the link's ``<collision>`` (or ``<visual>``) elements, for distances."""
        found: list[Solid] = []
        for i, (key, element, kind, link_from_shape) in enumerate(self._elements(link, name, tag)):
            label = element.get("name") or (f"{tag}_{i}" if i else tag)
            deviation = self._deviation(element, key)
            if kind.tag == "mesh":
                for named in self._meshes(kind, key, name):
                    exact = physics_mesh(named.mesh.moved(link_from_shape))
                    found.append(Solid(mesh=exact, name=f"{label}/{named.name}", deviation=deviation))
            else:
                solid = self._primitive(kind, key)
                if solid is not None:
                    found.append(moved(replace(solid[0], name=label, deviation=deviation), link_from_shape))
        return with_insides(found)

    def _deviation(self, element: Element, key: str) -> float:
        """How far the real surface may lie outside a mesh [m], as an import of ours writes it."""
        value = float(self.reader.numbers(element, "deviation", key, (0.0,))[0])
        if not 0 <= value <= 1:
            self.reader.problem(f"{key}.deviation", f"is {value:g} m", "must be from 0 to 1 m")
            return 0.0
        return value

    def _elements(self, link: Element, name: str, tag: str) -> Iterator[tuple[str, Element, Element, Array]]:
        for i, element in enumerate(link.findall(tag)):
            key = f"link[{name}].{tag}[{i}]"
            if _is_void(element):
                continue
            geometry = element.find("geometry")
            kinds = [] if geometry is None else [child for child in geometry if child.tag in SHAPES]
            if len(kinds) != 1:
                there = (
                    "nothing" if geometry is None else ", ".join(str(c.tag) for c in geometry) or "nothing"
                )
                self.reader.problem(
                    f"{key}.geometry", f"holds {there}", f"must hold one of {', '.join(SHAPES)}"
                )
                continue
            yield key, element, kinds[0], self.reader.origin(element, key)

    def _primitive(self, kind: Element, key: str) -> tuple[Solid, Mesh] | None:
        key = f"{key}.{kind.tag}"
        if kind.tag == "box":
            half = 0.5 * self._sizes(kind, "size", key, 3)
            mesh = shapes.box_mesh(-half, half)
            return (Solid(mesh=mesh), mesh) if half.all() else None
        radius = float(self._sizes(kind, "radius", key, 1)[0])
        if kind.tag == "sphere":
            return (
                (shapes.sphere_solid(np.zeros(3), radius), shapes.sphere_mesh(np.zeros(3), radius))
                if radius
                else None
            )
        length = float(self._sizes(kind, "length", key, 1)[0])
        if not radius or not length:
            return None
        end = np.array([0, 0, 0.5 * length])
        if kind.tag == "capsule":
            return capsule(-end, end, radius), shapes.capsule_mesh(-end, end, radius)
        return shapes.cylinder_solid(-end, end, radius), shapes.cylinder_mesh(-end, end, radius)

    def _sizes(self, kind: Element, attribute: str, key: str, count: int) -> Array:
        if kind.get(attribute) is None:
            self.reader.problem(f"{key}.{attribute}", "is missing", "say it in metres")
            return np.zeros(count)
        before = len(self.reader.problems)
        values = self.reader.numbers(kind, attribute, key, (0.0,) * count)
        if len(self.reader.problems) == before and not (values > 0).all():
            self.reader.problem(f"{key}.{attribute}", f"is {kind.get(attribute)}", "must be greater than 0 m")
            return np.zeros(count)
        if values.all() and not ((values >= SMALLEST) & (values <= FARTHEST)).all():
            remedy = f"must be from {SMALLEST:g} m to {FARTHEST:g} m"
            self.reader.problem(f"{key}.{attribute}", f"is {kind.get(attribute)}", remedy)
            return np.zeros(count)
        return values

    def _meshes(self, kind: Element, key: str, link: str) -> Sequence[NamedMesh]:
        uri = kind.get("filename", "")
        scale = self.reader.numbers(kind, "scale", f"{key}.mesh", (1.0, 1.0, 1.0))
        x, y, z = scale.tolist()
        if not uri or not (x and y and z):
            what = f"scale is {kind.get('scale')}" if uri else "has no filename"
            self.reader.problem(f"{key}.mesh", what, "a scale is not 0" if uri else "name a mesh file")
            return []
        if (uri, (x, y, z)) not in self.loaded:
            self.loaded[uri, (x, y, z)] = self._load(uri, (x, y, z), key, link)
        loaded = self.loaded[uri, (x, y, z)]
        if isinstance(loaded, LoadedMeshes):
            return loaded.meshes
        said = {problem.what for problem in self.reader.problems}
        self.reader.problems += [each._replace(key=f"{key}.mesh") for each in loaded if each.what not in said]
        return []

    def _load(
        self, uri: str, scale: tuple[float, float, float], key: str, link: str
    ) -> LoadedMeshes | list[Problem]:
        found = self.resolver.find(uri)
        if isinstance(found, Problem):
            return [found._replace(file=self.reader.file, what=f"{uri}: {found.what}")]
        if found.remark:
            self.reader.finding("warning", link, found.remark)
        unitless = found.path.suffix.lower() in WITHOUT_UNIT
        try:
            # URDF lengths are metres; formats that state their unit are believed.
            loaded = load_meshes(
                found.path, units="m" if unitless else None, up="z" if unitless else None, scale=scale
            )
        except InputError as error:
            return [
                Problem(self.reader.file, "", f"{uri}: {problem.key} {problem.what}", problem.remedy)
                for problem in error.problems
            ]
        for finding in loaded.findings:
            self.reader.finding(finding.level, link, f"{uri}: {finding.text}")
        folder = uri.rpartition("/")[0]
        for name, content in loaded.files.items():
            key = uri if name == found.path.name else f"{folder}/{PurePosixPath(name)}".lstrip("/")
            self.files[key] = content
        return loaded

    def _color(self, material: Element | None, key: str) -> shapes.Color | None:
        if material is None:
            return None
        name, color = material.get("name", ""), material.find("color")
        if color is None:
            return self.colors.get(name)
        before = len(self.reader.problems)
        rgba = self.reader.numbers(color, "rgba", f"{key}.color", (0.7, 0.72, 0.75, 1.0))
        for problem in self.reader.problems[before:]:
            self.reader.finding("note", "", f"{problem.key} {problem.what}, {problem.remedy}: shown in grey")
        del self.reader.problems[before:]
        r, g, b, a = np.clip(rgba, 0, 1).tolist()
        if name:
            self.colors[name] = (r, g, b, a)
        return (r, g, b, a)


def _is_void(element: Element) -> bool:
    """Whether a shape is a box, sphere or cylinder of no size at all, as frames have that nothing is at."""
    geometry = element.find("geometry")
    kinds = [] if geometry is None else [child for child in geometry if child.tag in SHAPES]
    if len(kinds) != 1 or kinds[0].tag == "mesh":
        return False
    sizes = " ".join(kinds[0].get(each, "") for each in ("size", "radius", "length")).split()
    return bool(sizes) and all(NUMBER.fullmatch(each) and float(each) == 0 for each in sizes)


def moved(solid: Solid, a_from_b: Array) -> Solid:
    """Return the solid expressed in frame ``a``, given the transform (4, 4) from its own frame ``b``."""
    if solid.mesh is not None:
        return replace(solid, mesh=solid.mesh.moved(a_from_b))
    assert solid.points is not None
    return replace(solid, points=apply(a_from_b, solid.points))


def in_order(reader: Reader, links: Sequence[str], parents: Mapping[str, str]) -> tuple[str, ...]:
    """Links after their parents; problems for several roots or a loop are left with the reader.

    Args:
        reader: Collects the problems.
        links: All links in the order of the file.
        parents: Child → parent.
    """
    roots = [link for link in links if link not in parents]
    children: dict[str, list[str]] = {}
    for link in links:
        if link in parents:
            children.setdefault(parents[link], []).append(link)
    if links and not roots:
        reader.problem(
            "", "every link hangs on another one: the joints form a loop", "remove the joint that closes it"
        )
    if len(roots) > 1:
        reader.problem(
            "",
            f"{len(roots)} links hang on nothing: {', '.join(roots[:6])}",
            "a robot is one tree: join them with fixed joints, or make them robots or parts of their own",
        )
    order: list[str] = []
    waiting = roots[:1]
    while waiting:
        link = waiting.pop()
        order.append(link)
        waiting += reversed(children.get(link, []))
    if len(roots) == 1 and len(order) < len(links):
        lost = [link for link in links if link not in set(order)]
        reader.problems.append(
            Problem(
                reader.file, "", f"a loop of joints through {', '.join(lost[:6])}", "loops cannot be read"
            )
        )
    return tuple(order)


KINDS = {"revolute": JointKind.REVOLUTE, "continuous": JointKind.REVOLUTE, "prismatic": JointKind.PRISMATIC}

ONCE = {
    "link": ("inertial",),
    "inertial": ("origin", "mass", "inertia"),
    "joint": ("origin", "parent", "child", "axis", "limit", "dynamics", "mimic"),
}
"""What a link, its mass properties or a joint has one of."""


def from_text(
    content: bytes, *, resolver: Resolver, name: str = "robot", visuals: bool = True
) -> Description:
    """A robot from the text of a URDF file.

    Args:
        content: The text.
        resolver: Finds the meshes it names.
        name: Name of the robot; findings speak of ``name/link``.
        visuals: Whether shapes that only the eye needs are read.

    Raises:
        InputError: Every mistake in the file at once.
    """
    reader = Reader(resolver.file, name)
    for remark in resolver.remarks:
        reader.finding("assumed", "", remark)
    for note in resolver.notes:
        reader.finding("note", "", note)
    root = parse_xml(content, resolver.file)
    if root.tag != "robot":
        raise InputError.at(
            resolver.file, "", f"the root element is <{root.tag}>", "a URDF starts with <robot>"
        )
    _refuse_xacro(reader, root)
    links, joints = _named(reader, root, "link"), _named(reader, root, "joint")
    if not links:
        reader.problem("", "has no <link>", "a robot has at least one")
    parents = _parents(reader, links, joints)
    order = in_order(reader, tuple(links), {child: parent for child, (parent, _) in parents.items()})
    _refuse_repeated(reader, links, joints)
    reader.raise_problems()

    geometry = Shapes(reader, resolver, visuals=visuals)
    geometry.read_colors(root)
    _say_what_is_not_read(reader, links, visuals)
    made = [_link(reader, geometry, link, links[link], parents.get(link), joints) for link in order]
    reader.raise_problems()
    if any(joint.find("safety_controller") is not None for joint in joints.values()):
        reader.finding(
            "note", "", "safety_controller of joints ignored: its limits are those of one controller"
        )
    description = Description(
        name=name,
        links=flattened(reader, tuple(made)),
        tip=lint.guessed_tip(made),
        source=resolver.file,
        files={Path(resolver.file).name: content, **geometry.files},
    )
    reader.raise_problems()
    return lint.checked(description, reader)


IGNORED_VISUALS = (
    'shapes for the eye are not read (visuals = "ignore"): how far they stand out of the collision shapes '
    "is not looked at, and distances take it that they do not"
)

UNREAD = ("gazebo", "transmission", "ros2_control", "material")
"""Elements of a robot of which nothing is read, or colours alone."""


def _say_what_is_not_read(reader: Reader, links: Mapping[str, Element], visuals: bool) -> None:
    if not visuals and any(_for_the_eye(link) for link in links.values()):
        reader.finding("assumed", "", IGNORED_VISUALS)


def _for_the_eye(link: Element) -> list[Element]:
    """Elements of a link of which no distance and no mass comes: it has collision shapes beside them."""
    return [] if all(map(_is_void, link.findall("collision"))) else link.findall("visual")


def _read_elements(root: Element) -> Iterator[Element]:
    """Elements of which something but a look comes, depth first."""
    unread = {id(each) for tag in UNREAD for each in root.findall(tag)}
    unread |= {id(visual) for link in root.findall("link") for visual in _for_the_eye(link)}
    unread |= {id(each) for each in root.findall("link/visual/material")}
    waiting = [root]
    while waiting:
        element = waiting.pop()
        if id(element) not in unread:
            yield element
            waiting += reversed(element)


def _refuse_xacro(reader: Reader, root: Element) -> None:
    for element in _read_elements(root):
        tag = str(element.tag)
        if "xacro" in tag.partition("}")[0] and "}" in tag:
            what = f"holds <xacro:{tag.rpartition('}')[2]}>"
            reader.problem("", what, "expand it, or name the file .xacro so that it is expanded here")
            break
        for attribute, value in element.attrib.items():
            if "${" in value or "$(" in value:
                key = f"{tag}[{element.get('name', '')}].{attribute}"
                remedy = "expand it with xacro, or name the file .xacro so that it is expanded here"
                reader.problem(key, f"holds the unresolved expression {value[:80]!r}", remedy)
    reader.raise_problems()


def _named(reader: Reader, root: Element, tag: str) -> dict[str, Element]:
    elements = root.findall(tag)
    for i, element in enumerate(elements):
        if not element.get("name"):
            reader.problem(f"{tag}[{i}]", "has no name", "give it one that no other carries")
    for repeated, count in Counter(e.get("name") for e in elements if e.get("name")).items():
        if count > 1:
            reader.problem(f"{tag}[{repeated}]", f"{count} {tag}s carry this name", "rename all but one")
    return {e.attrib["name"]: e for e in elements if e.get("name")}


def _refuse_repeated(reader: Reader, links: dict[str, Element], joints: dict[str, Element]) -> None:
    """Report every element that may be there once and is there twice: neither of the two is chosen."""
    every = [(f"joint[{name}]", joint, ONCE["joint"]) for name, joint in joints.items()]
    for name, link in links.items():
        every.append((f"link[{name}]", link, ONCE["link"]))
        every += [(f"link[{name}].inertial", one, ONCE["inertial"]) for one in link.findall("inertial")]
    for key, element, tags in every:
        for tag in tags:
            count = len(element.findall(tag))
            if count > 1:
                reader.problem(f"{key}.{tag}", f"is there {count} times", "keep the one that holds")


def _parents(
    reader: Reader, links: dict[str, Element], joints: dict[str, Element]
) -> dict[str, tuple[str, str]]:
    """Child link → (parent link, joint)."""
    parents: dict[str, tuple[str, str]] = {}
    for joint, element in joints.items():
        ends = []
        for tag in ("parent", "child"):
            end = element.find(tag)
            link = None if end is None else end.get("link")
            if link not in links:
                what = "is missing" if link is None else f"no link named {link!r}"
                reader.problem(f"joint[{joint}].{tag}", what, suggestion(link or "", links))
            ends.append(link)
        parent, child = ends
        if parent is None or child is None:
            continue
        if child in parents:
            what = f"{child!r} already hangs on joint {parents[child][1]!r}"
            reader.problem(f"joint[{joint}].child", what, "a link has one parent; loops cannot be read")
            continue
        parents[child] = (parent, joint)
    return parents


def _link(
    reader: Reader,
    geometry: Shapes,
    name: str,
    element: Element,
    parent: tuple[str, str] | None,
    joints: dict[str, Element],
) -> Link:
    parent_from_link: Array = np.eye(4)
    joint: tuple[Joint, ...] = ()
    if parent is not None:
        parent_from_link = reader.origin(joints[parent[1]], f"joint[{parent[1]}]")
        joint = _joint(reader, parent[1], joints[parent[1]])
    for each in ("collision", "visual"):
        for i, shape in enumerate(element.findall(each)):
            if _is_void(shape):
                reader.finding("note", name, f"{each}[{i}] has no size at all: nothing is there")
    tag = "visual" if all(map(_is_void, element.findall("collision"))) else "collision"
    visual = geometry.visual(element, name) if tag == "visual" else geometry.shown(element, name)
    if tag == "visual" and visual:
        reader.finding(
            "note", name, "no collision shape in the file: distances and contacts use the visual one"
        )
    solids = geometry.solids(element, name, tag)
    inertial, refused, impossible = _inertial(
        reader, name, element, moves=bool(joint), body=bool(joint or visual or solids)
    )
    return Link(
        name=name,
        parent=parent[0] if parent else None,
        parent_from_link=parent_from_link,
        joints=joint,
        inertial=inertial,
        refused_mass=refused,
        impossible_mass=impossible,
        visual=visual,
        solids=solids,
    )


def _joint(reader: Reader, name: str, element: Element) -> tuple[Joint, ...]:
    key, kind = f"joint[{name}]", element.get("type", "")
    if kind == "fixed":
        if element.find("mimic") is not None:
            reader.finding("note", name, "a fixed joint that mimics another: mimic ignored")
        return ()
    if kind in {"floating", "planar"}:
        remedy = "a joint has one degree of freedom: chain several, or place the robot with base"
        reader.problem(f"{key}.type", f"is {kind!r}", remedy)
        return ()
    if kind not in KINDS:
        known = (*KINDS, "fixed")
        reader.problem(f"{key}.type", f"is {kind!r}" if kind else "is missing", suggestion(kind, known))
        return ()
    axis = reader.numbers(element.find("axis"), "xyz", f"{key}.axis", (1.0, 0.0, 0.0))
    if np.abs(axis).max() > FARTHEST:
        reader.problem(f"{key}.axis", f"is {axis.tolist()}", "must be a direction, of length 1")
        return ()
    length = float(np.linalg.norm(axis))
    if length < 1e-9:
        reader.problem(f"{key}.axis", f"is {axis.tolist()}", "must not be zero")
        return ()
    if abs(length - 1) > 1e-4:
        reader.finding("note", name, f"axis of length {length:.6g} made a unit vector")
    lower, upper = _range(reader, name, element, kind)
    damping, friction = (
        _not_negative(reader, element, attribute, key) for attribute in ("damping", "friction")
    )
    return (
        Joint(
            name=name,
            kind=KINDS[kind],
            axis=axis / length,
            lower=lower,
            upper=upper,
            velocity=_limit(reader, name, element, "velocity"),
            effort=_limit(reader, name, element, "effort"),
            damping=damping,
            friction=friction,
            mimic=_mimic(reader, element, key),
        ),
    )


def _range(reader: Reader, name: str, element: Element, kind: str) -> tuple[float | None, float | None]:
    key, limit = f"joint[{name}].limit", element.find("limit")
    if kind == "continuous":
        return None, None
    if limit is None or (limit.get("lower") is None and limit.get("upper") is None):
        reader.finding("warning", name, f"no range given for a {kind} joint: taken as without limits")
        return None, None
    # URDF: an end that is not written is 0.
    lower, upper = (float(reader.numbers(limit, end, key, (0.0,))[0]) for end in ("lower", "upper"))
    if lower > upper:
        reader.problem(key, f"lower {lower:g} is greater than upper {upper:g}", "swap them or correct them")
    elif lower == upper:
        reader.finding("warning", name, f"lower and upper are both {lower:g}: the joint cannot move")
    return lower, upper


def _limit(reader: Reader, name: str, element: Element, which: str) -> Quantity | None:
    limit = element.find("limit")
    value = None if limit is None else reader.number(limit, which, f"joint[{name}].limit")
    quantity, text = lint.plausible_limit(which, value)
    if text:
        reader.finding("warning", name, text)
    return None if quantity is None else Quantity(quantity, Origin.STATED, f"{reader.file}: joint {name}")


def _not_negative(reader: Reader, element: Element, attribute: str, key: str) -> float:
    value = float(reader.numbers(element.find("dynamics"), attribute, f"{key}.dynamics", (0.0,))[0])
    if value < 0:
        reader.problem(f"{key}.dynamics.{attribute}", f"is {value:g}", "must be at least 0")
        return 0.0
    return value


def _mimic(reader: Reader, element: Element, key: str) -> Mimic | None:
    mimic = element.find("mimic")
    if mimic is None:
        return None
    multiplier = float(reader.numbers(mimic, "multiplier", f"{key}.mimic", (1.0,))[0])
    offset = float(reader.numbers(mimic, "offset", f"{key}.mimic", (0.0,))[0])
    return Mimic(mimic.get("joint", ""), multiplier, offset)


def _inertial(
    reader: Reader, name: str, link: Element, *, moves: bool, body: bool
) -> tuple[Inertial | None, str, Problem | None]:
    """Mass properties that can be used, why they cannot, and what is wrong with a mass that no body has."""
    element, key = link.find("inertial"), f"link[{name}].inertial"
    if element is None:
        return None, "", None
    before = len(reader.problems)
    link_from_inertial = reader.origin(element, key)
    mass, inertia = element.find("mass"), element.find("inertia")
    if mass is None or mass.get("value") is None:
        reader.finding("warning", name, "inertial without a mass: unknown")
        return None, "inertial without a mass", None
    kilograms = float(reader.numbers(mass, "value", f"{key}.mass", (0.0,))[0])
    # As an import of ours writes them, of a mass by density.
    told = "error", "spread_error", "within", "gyration"
    off = [float(reader.numbers(mass, key_, f"{key}.mass", (0.0,))[0]) for key_ in told]
    if not all(0 <= share <= 1e3 for share in off):
        reader.problem(
            f"{key}.mass.error", f"is {off}", "a share from 0 up, of within and gyration a length in m"
        )
    names = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
    xx, yy, zz, xy, xz, yz = (float(reader.numbers(inertia, n, f"{key}.inertia", (0.0,))[0]) for n in names)
    if kilograms < 0:
        reader.problem(f"{key}.mass.value", f"is {kilograms:g} kg", "a mass is greater than 0")
    if max(map(abs, (kilograms, xx, yy, zz, xy, xz, yz))) > HEAVIEST:
        reader.problem(key, f"has a figure beyond {HEAVIEST:g}", "give kg and kg·m²")
    if len(reader.problems) > before:
        return None, "", None
    rotation = link_from_inertial[:3, :3]
    matrix = rotation @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ rotation.T
    made = Inertial(
        mass=kilograms,
        com=link_from_inertial[:3, 3],
        inertia=0.5 * (matrix + matrix.T),
        origin=Origin.STATED,
        source=f"{reader.file}: link {name}",
        error=off[0],
        spread_error=off[1],
        within=off[2],
        gyration=off[3],
    )
    kept, level, text = lint.plausible_inertial(made, body=body)
    if text:
        reader.finding(level, name, text)
    # Of 0 kg without an inertia the file says no more than of one without <inertial>.
    refused = "" if kept is not None or (kilograms <= lint.NOTHING and not matrix.any()) else text
    return kept, refused, lint.no_mass(kilograms, file=reader.file, key=f"{key}.mass.value", moves=moves)
