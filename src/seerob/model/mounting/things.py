"""Tools, workpieces, parts and areas: from a table of the file to named pieces with shape and mass."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from msgspec import structs

from seerob.core.errors import InputError, Problem, UnknownName
from seerob.core.shapes import Mesh, Solid, capsule, dilated_rectangle, prism_mesh
from seerob.core.snapshot import Finding, Origin
from seerob.core.transforms import Array
from seerob.description import lint
from seerob.description.description import Inertial, Link
from seerob.description.prepared import PreparedFile, PreparedMesh, prepared
from seerob.description.shapes import detail, mass_properties, openings, shapes
from seerob.description.shapes.detail import display_mesh
from seerob.description.shapes.hull import hull_volume
from seerob.description.shapes.mesh_bodies import is_closed, joined
from seerob.description.shapes.mesh_mending import enclosing
from seerob.description.shapes.moments import signed_volume
from seerob.description.tools import library
from seerob.model.mounting.specification import Mounting, extreme_points, pose_matrix
from seerob.workstation.tables.sensors import Sensor
from seerob.workstation.workstation import Area, Mounted, Shape, Thing
from seerob.workstation.workstation import Body as BodyTable

Color = tuple[float, float, float, float]
TOOL_COLOR: Color = (0.33, 0.38, 0.45, 1.0)
WORKPIECE_COLOR: Color = (0.80, 0.62, 0.36, 1.0)
PART_COLOR: Color = (0.55, 0.58, 0.62, 1.0)
AREA_COLOR: Color = (0.99, 0.92, 0.57, 0.25)

CYLINDER_SIDES = 96
NO_DEPTH = (
    "its mesh has holes, and nobody says how far beyond their rims its surface may lie: give hole_depth"
)
ROUNDING = 1e-9
"""Outside of a box by no more than this is none [m]."""
VISIBLE = 1e-4
"""How far what is shown may be off without a finding [m]."""


@dataclass(frozen=True, eq=False)
class Piece:
    """One rigid piece of a thing, in the thing's frame."""

    name: str
    """Empty for a thing of one piece, else the mesh's name in the file."""
    visual: tuple[Mesh, ...]
    solids: tuple[Solid, ...]


@dataclass(frozen=True, eq=False)
class LoadedThing:
    """A thing that has been read."""

    pieces: tuple[Piece, ...]
    inertial: Inertial | None
    """Inertial of all pieces together, in the thing's frame; None when nobody gave a mass or a density."""
    findings: tuple[Finding, ...]
    files: dict[str, bytes]
    refused_mass: str = ""
    """Why it has none though somebody gave a density."""


@dataclass(frozen=True, eq=False)
class MadeArea:
    """An area that was made from a motion, in the world's frame."""

    mesh: Mesh
    note: str
    """What of it is not as it looks."""
    findings: tuple[Finding, ...]


def load_thing(
    thing: Thing,
    folder: Path,
    color: Color,
    *,
    needs_mass: bool,
    file: str = "workstation",
    cache: Path | None = None,
) -> LoadedThing:
    """Read a tool, a workpiece or a part.

    Args:
        thing: Its table.
        folder: What its mesh path is relative to.
        color: For what has no colour of its own.
        needs_mass: Whether it moves, so that a mass from the shape is worth computing.
        file: The workstation file, for messages.
        cache: Folder that keeps meshes that were made ready.

    Raises:
        InputError: The mesh cannot be read, a mass was asked for that the shape cannot give, or no body
            of this shape has the given centre of mass or inertia.
    """
    if thing.color is not None:
        color = (*thing.color, 1.0)
    findings: tuple[Finding, ...] = ()
    files: dict[str, bytes] = {}
    has_openings = False
    known = None if thing.library is None else library.load(thing.library)
    if thing.mesh is not None:
        path = folder / thing.mesh
        most = thing.triangles or detail.SHOWN
        loaded = prepared(path, units=thing.units, up=thing.up, triangles=most, cache=cache)
        findings = tuple(replace_subject(f, thing.name) for f in loaded.findings)
        findings += _shown_coarsely(thing.name, loaded)
        files = loaded.files
        single = len(loaded.meshes) == 1
        own_color = thing.color is not None
        deviation = max(thing.deviation, loaded.deviation)
        pieces = tuple(
            _piece("" if single else m.name, m, deviation, color if own_color else None, most)
            for m in loaded.meshes
        )
        source = f"shape of {thing.mesh}"
        whole = [m.mesh for m in loaded.meshes]
        if not all(m.closed for m in loaded.meshes):
            around = enclosing(whole)
            if around is None:
                _refuse_open(thing, path)
                has_openings = True
            else:
                # Split by colour or by name, none of the pieces has an inside; all of them together do.
                inside = Solid(mesh=detail.physics_mesh(around), deviation=deviation)
                pieces = (replace(pieces[0], solids=(*pieces[0].solids, inside)), *pieces[1:])
    elif known is not None:
        visual = known.visual if thing.color is None else tuple(replace(m, color=color) for m in known.visual)
        pieces, source = (Piece("", visual, known.solids),), f"envelope of library:{thing.library}"
        whole = [solid.mesh for solid in known.solids if solid.mesh is not None]
        findings = tuple(replace_subject(f, thing.name) for f in known.findings)
        files = {f"library/{thing.library}.toml": known.content}
    else:
        assert thing.shape is not None
        piece, whole = _simple(thing.shape, color)
        pieces, source = (piece,), "shape in the workstation file"
    if thing.openings is not None and not has_openings:
        what, remedy = f"the mesh of {thing.name} is closed, and has no openings", "leave openings out"
        raise InputError.at(file, f"{thing.name}.openings", what, remedy)
    solids = tuple(solid for piece in pieces for solid in piece.solids)
    off = 0.0 if thing.mesh is None else max((solid.deviation for solid in solids), default=0.0)
    findings += _odd(thing, solids, whole)
    inertial: Inertial | None = None
    more: tuple[Finding, ...] = ()
    if needs_mass and (thing.mass is not None or thing.density is not None):
        inertial, more = _inertial(thing, whole, solids, off, source, file)
    elif needs_mass and known is not None:
        inertial = known.inertial
    elif thing.mass is not None and thing.com is not None:
        # It stands still, so only what the user wrote is looked at.
        inertial = given_inertial(thing.mass, thing.com, thing.inertia or (0.0,) * 6, source)
    findings += more
    if inertial is not None:
        inertial, noticed = _possible(
            inertial, solids, thing, thing.name, file, "", lambda: _spread(thing, whole, off)
        )
        findings += noticed
    if not needs_mass:
        inertial = None
    if has_openings:
        said, depth = _openings(thing), thing.hole_depth or 0.0
        pieces = tuple(replace(piece, solids=openings.told(piece.solids, said, depth)) for piece in pieces)
        findings += (_about_openings(thing, pieces),)
    refused = NO_DEPTH if needs_mass and inertial is None and thing.density is not None else ""
    return LoadedThing(pieces, inertial, findings, files, refused)


def replace_subject(finding: Finding, subject: str) -> Finding:
    """Return the finding about another subject."""
    return structs.replace(finding, subject=subject)


def _shown_coarsely(name: str, loaded: PreparedFile) -> tuple[Finding, ...]:
    """How far what is shown is from the mesh, where triangles were left out for the screen."""
    off = [
        (shown.deviation, len(shown.faces), len(drawn.faces))
        for each in loaded.meshes
        for shown, drawn in zip(each.shown, each.drawn, strict=True)
        if shown.deviation > VISIBLE
    ]
    if not off:
        return ()
    deviation, _, _ = max(off)
    count, of = sum(n for _, n, _ in off), sum(n for _, _, n in off)
    text = f"is shown with {count} of {of} triangles, at most {deviation * 1e3:.2g} mm off; distances use all"
    return (Finding(level="note", subject=name, text=text),)


def _piece(name: str, made: PreparedMesh, deviation: float, color: Color | None, most: int) -> Piece:
    solid = Solid(mesh=made.exact, name=name, deviation=deviation)
    if color is None:
        return Piece(name, made.shown, (solid,))
    one = made.shown[0] if len(made.shown) == 1 else detail.display_mesh(made.mesh, max_triangles=most)
    return Piece(name, (replace(one, color=color),), (solid,))


def _round(shape: Shape | None) -> tuple[float, float] | None:
    """Radius and length along z of a ball or capsule [m]; None for any other shape."""
    if shape is None:
        return None
    return (shape.sphere, 0.0) if shape.sphere is not None else shape.capsule


def _simple(shape: Shape, color: Color) -> tuple[Piece, list[Mesh]]:
    rounded = _round(shape)
    if rounded is not None:
        end = np.array([0.0, 0.0, rounded[1] / 2])
        solid = capsule(-end, end, rounded[0])
        from seerob.description.shapes.glb import solid_mesh

        mesh = solid_mesh(solid, color=color)
        return Piece("", (mesh,), (solid,)), [mesh]
    if shape.box is not None:
        half = np.array(shape.box) / 2
        mesh = shapes.box_mesh(-half, half, color=color)
        return Piece("", (mesh,), (Solid(mesh=mesh),)), [mesh]
    if shape.polygon is not None:
        assert shape.height is not None
        mesh = prism_mesh(shape.polygon, *shape.height, color)
        return Piece("", (mesh,), (Solid(mesh=mesh),)), [mesh]
    assert shape.cylinder is not None
    radius, height = shape.cylinder
    ends = np.array([[0, 0, -height / 2], [0, 0, height / 2]])
    # Corners outside the circle, sides on it: never nearer to the person than it looks.
    outer = radius / np.cos(np.pi / CYLINDER_SIDES)
    mesh = shapes.cylinder_mesh(ends[0], ends[1], outer, sides=CYLINDER_SIDES, color=color)
    note = f"prism around the cylinder, at most {(outer - radius) * 1e3:.2f} mm larger"
    return Piece("", (mesh,), (Solid(mesh=mesh, note=note),)), [mesh]


def _inertial(
    thing: Thing, meshes: list[Mesh], solids: Sequence[Solid], deviation: float, source: str, file: str
) -> tuple[Inertial | None, tuple[Finding, ...]]:
    if thing.mass is not None and thing.com is not None and thing.inertia is not None:
        return given_inertial(thing.mass, thing.com, thing.inertia, "workstation file"), ()
    inertial, findings = _spread(thing, meshes, deviation)
    if np.isinf(inertial.spread_error):
        return None, findings
    if thing.mass is not None:
        off = (thing.com_tolerance or 0.0) if isinstance(thing, Mounted) else 0.0
        inertial, told = _as_spread(
            inertial,
            thing,
            solids,
            off=off,
            beyond=thing.hole_depth or 0.0,
            subject=thing.name,
            where=(file, ""),
        )
        findings += told
    if thing.mass is not None:
        # The mass itself was given; only how it is spread follows from the shape.
        inertial = replace(inertial, origin=Origin.GIVEN, error=0.0, source=f"workstation file; {source}")
        return inertial, findings
    figure = f"mass {inertial.mass:.4g} kg"
    if not any(finding.text.startswith(figure) for finding in findings):
        text = f"{figure} estimated: {inertial.source}, error ±{100 * inertial.error:.2g} %"
        findings += (Finding(level="note", subject=thing.name, text=text),)
    return inertial, findings


def _as_spread(
    uniform: Inertial,
    table: Thing | BodyTable,
    solids: Sequence[Solid],
    *,
    off: float,
    beyond: float,
    subject: str,
    where: tuple[str, str],
) -> tuple[Inertial, tuple[Finding, ...]]:
    """Mass properties of a given mass, as far as somebody says how it is spread, and what is told of it.

    Args:
        uniform: At uniform density.
        table: What the user gave, without centre or inertia.
        solids: Its shape.
        off: How far its centre may be from where it is, as the file says [m].
        beyond: How far it may reach out of its shape at holes [m].
        subject: Full name of the body.
        where: The workstation file and the key of the table in it, for messages.

    Raises:
        InputError: Its centre of mass is said to be where no uniform density has it.
    """
    com = uniform.com if table.com is None else np.array(table.com, float)
    if table.uniform_density:
        way = float(np.linalg.norm(com - uniform.com))
        if way > mass_properties.OFF_CENTRE + off:
            file, key = where
            what = (
                f"is {1e3 * way:.3g} mm from where uniform density has it, {uniform.com.round(4).tolist()} m"
            )
            remedy = "leave out com or uniform_density"
            raise InputError.at(file, f"{key}com", what, remedy)
        return replace(uniform, com=com), ()
    points, radius = extreme_points(solids)
    margin = radius + beyond + max(solid.deviation for solid in solids)
    if table.com is None and not (off and isinstance(table, Thing)):
        inertial = mass_properties.anywhere(uniform, points, margin)
        text = (
            "nobody says where in its shape its mass is: give com and inertia, or uniform_density = true "
            "where that is so; what rests on them has an interval of all that fit into its shape"
        )
    else:
        reach = margin + off
        beside = np.maximum(points.min(axis=0) - reach - com, com - points.max(axis=0) - reach)
        if (outside := float(np.linalg.norm(np.maximum(beside, 0.0)))) > ROUNDING:
            text = (
                f"its centre of mass is {1e3 * outside:.3g} mm outside the box around its shape, and how "
                "mass is spread that no shape shows, nobody knows: give inertia"
            )
            holds = (subject.partition("/")[0],)
            found = Finding(level="warning", subject=subject, text=text, holds=holds)
            return replace(uniform, com=com), (found,)
        inertial = mass_properties.about_its_centre(uniform, com.tolist(), points, margin, off=off)
        text = (
            "nobody says how its mass is spread about its centre: give inertia; what rests on it has an "
            "interval of all moments that fit into its shape"
        )
    return inertial, (Finding(level="assumed", subject=subject, text=text),)


def _spread(thing: Thing, meshes: list[Mesh], deviation: float) -> tuple[Inertial, tuple[Finding, ...]]:
    """Mass properties at uniform density, and what was noticed."""
    closed = _closed_form(thing.shape)
    if closed is None:
        try:
            return mass_properties.from_shape(
                meshes,
                density=thing.density,
                mass=thing.mass,
                deviation=deviation,
                hole_depth=thing.hole_depth,
                subject=thing.name,
            )
        except InputError as error:
            raise InputError(
                [problem._replace(file=thing.mesh or "") for problem in error.problems]
            ) from None
    moments, what = closed
    mass, origin, source = thing.mass, Origin.GIVEN, f"{what}, shape in the workstation file"
    if mass is None:
        mass = moments.volume * (thing.density or 0.0)
        origin, source = Origin.ESTIMATED, f"{thing.density:g} kg/m³ × volume of the {what}"
    return moments.inertial(mass=mass, origin=origin, source=source), ()


def _closed_form(shape: Shape | None) -> tuple[mass_properties.Moments, str] | None:
    """Moments of a ball, a capsule or a cylinder, and what it is; None of what has flat faces alone."""
    rounded = _round(shape)
    if rounded is not None:
        end = np.array([0.0, 0.0, rounded[1] / 2])
        return mass_properties.of_capsule(-end, end, rounded[0]), "capsule" if rounded[1] else "sphere"
    if shape is not None and shape.cylinder is not None:
        end = np.array([0.0, 0.0, shape.cylinder[1] / 2])
        return mass_properties.of_cylinder(-end, end, shape.cylinder[0]), "cylinder"
    return None


def _openings(thing: Thing) -> openings.Said:
    """What a table says of openings: a hole has a depth where it is closed."""
    return "closed" if thing.hole_depth is not None else thing.openings


def _refuse_open(thing: Thing, path: Path) -> None:
    """Refuse an open mesh where only the inside matters.

    Raises:
        InputError: It is an area.
    """
    if isinstance(thing, Area):
        raise InputError.at(
            path,
            "mesh",
            "the mesh is open: nothing can be said to be inside of it",
            "close it, or give a shape",
        )


def _about_openings(thing: Thing, pieces: Sequence[Piece]) -> Finding:
    """What openings mean for distances."""
    solids = [solid for piece in pieces for solid in piece.solids]
    level, text = lint.openings(_openings(thing), solids)
    if thing.hole_depth:
        text = f"{text}, and {thing.hole_depth:g} m beyond"
    return Finding(level=level, subject=thing.name, text=text)


def _odd(thing: Thing, solids: tuple[Solid, ...], meshes: list[Mesh]) -> tuple[Finding, ...]:
    """Warnings for a size, a mass or a density that speaks of a wrong unit."""
    low, high = lint.box(solids)
    texts = [lint.odd_extent(float((high - low).max()), unit=thing.units)]
    if thing.mass is not None:
        texts.append(_odd_mass(thing.mass, thing, meshes))
    if thing.density is not None:
        odd = lint.odd_density(thing.density)
        texts.append(f"density is {odd}" if odd else "")
    return tuple(Finding(level="warning", subject=thing.name, text=text) for text in texts if text)


def _odd_mass(mass: float, thing: Thing, meshes: list[Mesh]) -> str:
    """What is odd about a mass in this shape, whose hull bounds its volume where it is not closed."""
    closed = _closed_form(thing.shape)
    if closed is not None:
        return lint.odd_mass(mass, closed[0].volume, exact=True)
    mesh, _ = joined([m for m in meshes if len(m.faces)])
    hull = hull_volume(mesh.vertices)
    volume = signed_volume(mesh) if is_closed(mesh) else 0.0
    if 1e-9 * hull < volume <= hull * (1 + 1e-9):
        return lint.odd_mass(mass, volume, exact=True)
    return lint.odd_mass(mass, hull, exact=False)


Spread = Callable[[], tuple[Inertial, tuple[Finding, ...]]]


def _possible(
    inertial: Inertial,
    solids: Sequence[Solid],
    table: Thing | BodyTable,
    subject: str,
    file: str,
    key: str,
    spread: Spread,
) -> tuple[Inertial, tuple[Finding, ...]]:
    """Mass properties that a body of this shape can have, rounding mended, and what is odd about them.

    Args:
        inertial: What follows from the table.
        solids: The shape; empty when there is none.
        table: What the user gave.
        subject: Full name of the body.
        file: The workstation file, for messages.
        key: Of the table in the file, ends in a dot; empty for the table itself.
        spread: Mass properties at uniform density, to propose.

    Raises:
        InputError: No body of this shape has the given centre of mass or inertia.
    """
    problems = []
    findings: list[Finding] = []
    if table.com is not None and solids:
        low, high = lint.box(solids)
        what = lint.misplaced_com(inertial.com, low, high)
        if what:
            remedy = f"its box is {np.round(low, 4).tolist()} to {np.round(high, 4).tolist()} m"
            problems.append(Problem(file, f"{key}com", what, f"{remedy}; millimetres go into com_mm"))
    if table.inertia is not None:
        what = lint.impossible_inertia(inertial.inertia)
        if what:
            problems.append(Problem(file, f"{key}inertia", what, _proposed(spread)))
        else:
            mended, level, text = lint.plausible_inertial(inertial, body=True)
            if mended is not None and text:
                inertial = mended
                findings.append(Finding(level=level, subject=subject, text=text))
    if problems:
        raise InputError(problems)
    if table.com is not None or table.inertia is not None:
        body = Link(subject, None, np.eye(4), inertial=inertial, solids=tuple(solids))
        findings += [Finding(level=a, subject=b, text=c) for a, b, c in lint.misplaced_mass(body)]
    return inertial, tuple(findings)


def _proposed(spread: Spread) -> str:
    """What an inertia could be, in words."""
    order = "ixx, iyy, izz, ixy, ixz, iyz about the centre of mass in kg·m²"
    try:
        inertia = spread()[0].inertia
    except InputError:
        return f"give {order}"
    six = [*np.diag(inertia), inertia[0, 1], inertia[0, 2], inertia[1, 2]]
    return f"give {order}; at uniform density [{', '.join(f'{x:.4g}' for x in six)}]"


def given_inertial(
    mass: float,
    com: tuple[float, float, float],
    inertia: tuple[float, float, float, float, float, float],
    source: str,
) -> Inertial:
    """Mass properties that the user wrote: kg, m, kg·m² as ixx, iyy, izz, ixy, ixz, iyz."""
    return Inertial(mass, np.array(com, float), symmetric(inertia), Origin.GIVEN, source)


def symmetric(six: tuple[float, float, float, float, float, float]) -> Array:
    """Matrix (3, 3) of ixx, iyy, izz, ixy, ixz, iyz."""
    xx, yy, zz, xy, xz, yz = six
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def overridden_link(
    table: BodyTable, link: Link, *, robot: str, file: str, com_tolerance: float
) -> tuple[Inertial, tuple[Finding, ...]]:
    """Mass properties of a link from its table; what the table leaves out follows from the shape.

    Args:
        table: What the user gave.
        link: The link as read.
        robot: Name of its robot.
        file: The workstation file, for messages.
        com_tolerance: How far its centre of mass may be from where it is said to be [m].

    Returns:
        The mass properties, and what is odd about them.

    Raises:
        InputError: Something was left out and the link has no shape to compute it from, or no body of
            this shape has the given centre of mass or inertia.
    """
    key, subject = f"masses.{link.name}", f"{robot}/{link.name}"

    def spread() -> tuple[Inertial, tuple[Finding, ...]]:
        from seerob.description.shapes.glb import solid_mesh

        if not link.solids:
            raise InputError.at(file, key, "has no shape to compute com and inertia from", "give both")
        meshes = [s.mesh if s.mesh is not None else solid_mesh(s) for s in link.solids]
        off = max(s.deviation for s in link.solids)
        return mass_properties.from_shape(meshes, mass=table.mass, deviation=off, subject=subject)

    findings: tuple[Finding, ...] = ()
    if table.com is not None and table.inertia is not None:
        inertial = given_inertial(table.mass, table.com, table.inertia, table.source)
    else:
        inertial, findings = spread()
        inertial, told = _as_spread(
            inertial,
            table,
            link.solids,
            off=com_tolerance,
            beyond=0.0,
            subject=subject,
            where=(file, f"{key}."),
        )
        findings += told
        if table.inertia is not None:
            inertial = replace(inertial, inertia=symmetric(table.inertia))
        inertial = replace(inertial, source=f"{table.source}; rest from the shape")
    inertial, noticed = _possible(inertial, link.solids, table, subject, file, f"{key}.", spread)
    return inertial, findings + noticed


FIELD_COLOR: Color = (0.98, 0.75, 0.35, 0.20)

HALF_THICKNESS = 1e-3
"""Of a plane of light as a body [m]."""


@dataclass(frozen=True, eq=False)
class FieldBody:
    """A field in its sensor's frame."""

    name: str
    """Empty for a device with one."""
    solid: Solid
    visual: Mesh


def fields(sensor: Sensor) -> Iterator[FieldBody]:
    """Bodies of the fields of a sensor."""
    if sensor.laser_scanner is not None:
        for field in sensor.laser_scanner.fields:
            mesh = prism_mesh(field.corners, -HALF_THICKNESS, HALF_THICKNESS, FIELD_COLOR)
            yield FieldBody(field.name, Solid(mesh=mesh), mesh)
    elif sensor.light_curtain is not None:
        a, b = (np.array(end) for end in sensor.light_curtain.ends)
        up = np.array([0.0, 0.0, sensor.light_curtain.height])
        from seerob.description.shapes.glb import solid_mesh

        solid = dilated_rectangle(a, b - a, up, HALF_THICKNESS)
        yield FieldBody("", solid, solid_mesh(solid, color=FIELD_COLOR))
    elif sensor.pressure_mat is not None:
        mat = sensor.pressure_mat
        mesh = prism_mesh(mat.corners, 0.0, mat.height, FIELD_COLOR)
        yield FieldBody("", Solid(mesh=mesh), mesh)


def about(sensor: Sensor) -> list[Finding]:
    """What nobody said of a sensor."""
    missing = [
        text
        for value, text in (
            (sensor.response, "response time"),
            (sensor.capability if sensor.pressure_mat is None else 0.0, "detection capability"),
        )
        if value is None
    ]
    found = []
    if missing:
        text = f"{' and '.join(missing)} not given: what depends on it is undecided"
        found.append(Finding(level="warning", subject=sensor.name, text=text))
    if not sensor.source and len(missing) < 2:
        text = "no source is named for its figures: take them from its data sheet"
        found.append(Finding(level="assumed", subject=sensor.name, text=text))
    return found


def mount_swept(mounting: Mounting, area: Area, made: Mapping[str, MadeArea], *, file: str) -> None:
    """Mount an area that is swept, in the world.

    Raises:
        InputError: It has not been made.
    """
    if area.name not in made:
        what = "what is swept is known only to a station that has its sources"
        raise InputError.at(file, "swept", what, "load the workstation with seerob.load")
    found = made[area.name]
    mounting.body(area.name, None, np.eye(4))
    mounting.findings += found.findings
    mounting.shape(
        area.name,
        role="area",
        owner=area.name,
        carrier="",
        solids=(Solid(mesh=found.mesh, note=found.note),),
        visual=(display_mesh(replace(found.mesh, color=AREA_COLOR)),),
        mass=None,
    )


def mount_sensor(mounting: Mounting, carriers: dict[str, str], sensor: Sensor) -> None:
    """Mount a sensor and its fields; ``carriers`` tells who carries each body, and receives those added.

    Raises:
        UnknownName: There is nothing to mount it on.
    """
    if sensor.on is not None and not mounting.has(sensor.on):
        raise UnknownName("link, tool or bone", sensor.on, carriers)
    mounting.body(sensor.name, sensor.on, pose_matrix(sensor.at))
    carrier = "" if sensor.on is None else carriers[sensor.on]
    if carrier:
        carriers[sensor.name] = carrier
    for field in fields(sensor):
        name = f"{sensor.name}/{field.name}" if field.name else sensor.name
        if field.name:
            mounting.body(name, sensor.name, np.eye(4))
        mounting.shape(
            name,
            role="area",
            owner=sensor.name,
            carrier=carrier,
            solids=(field.solid,),
            visual=(field.visual,),
            mass=None,
        )
    mounting.findings += about(sensor)
