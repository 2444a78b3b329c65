"""MJCF in: MuJoCo reads and compiles the file (`mjcf_compiled`), this turns the result into a description.

The files that a model names are checked before MuJoCo opens any of them. A geom whose contype and conaffinity
are both 0 never touches anything: it is for the screen. The others are for contacts and distances; they are
also drawn where a body has nothing else.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np

from seerob.core.errors import InputError, Problem
from seerob.core.files.bounded import TooLarge, content
from seerob.core.shapes import Mesh, Solid, capsule
from seerob.core.snapshot import Origin
from seerob.core.transforms import Array, rotation_from_wxyz, transform
from seerob.description import lint
from seerob.description.description import (
    Description,
    Inertial,
    Joint,
    JointKind,
    Link,
    Mimic,
    Quantity,
    displacement,
)
from seerob.description.formats.mimic import flattened
from seerob.description.formats.mjcf_compiled import Compiled, compiled
from seerob.description.formats.resolve import Resolver
from seerob.description.formats.urdf import moved
from seerob.description.mesh import MAX_BYTES as MAX_MESH_BYTES
from seerob.description.shapes import shapes
from seerob.description.shapes.detail import physics_mesh
from seerob.description.shapes.mesh_mending import with_insides
from seerob.description.xml_values import FARTHEST, HEAVIEST, MAX_BYTES, SMALLEST, Reader, parse_xml

UNSHAPED = "cannot be part of a robot here: left out"
"""Ends what is told of a plane or a height field."""


def shapes_of_body(
    reader: Reader, model: Compiled, body: int, name: str
) -> tuple[tuple[Mesh, ...], tuple[Solid, ...]]:
    """Display meshes and solids of one body, in its frame.

    Args:
        reader: Collects findings.
        model: Of the file.
        body: Index of the body.
        name: Its name, for messages.
    """
    drawn: list[Mesh] = []
    touched: list[tuple[Solid, Mesh]] = []
    for geom in range(model.body_geomadr[body], model.body_geomadr[body] + model.body_geomnum[body]):
        made = _geom(reader, model, geom, name)
        if made is None:
            continue
        if model.geom_contype[geom] or model.geom_conaffinity[geom]:
            touched.append(made)
        else:
            drawn.append(made[1])
    if not touched and drawn:
        reader.finding(
            "note", name, "nothing that collides in the file: distances and contacts use what is drawn"
        )
        solids = tuple(Solid(mesh=physics_mesh(mesh), name=f"visual_{i}") for i, mesh in enumerate(drawn))
        return tuple(drawn), with_insides(solids)
    solids = tuple(replace(solid, name=solid.name or f"geom_{i}") for i, (solid, _) in enumerate(touched))
    return tuple(drawn) or tuple(mesh for _, mesh in touched), with_insides(solids)


def _geom(reader: Reader, model: Compiled, geom: int, body: str) -> tuple[Solid, Mesh] | None:
    import mujoco

    kinds = mujoco.mjtGeom
    kind = kinds(int(model.geom_type[geom]))
    name = model.names["geom"][geom]
    body_from_geom = transform(rotation_from_wxyz(model.geom_quat[geom]), model.geom_pos[geom])
    material = int(model.geom_matid[geom])
    default = np.allclose(model.geom_rgba[geom], 0.5 * np.array([1, 1, 1, 2]))
    rgba = model.mat_rgba[material] if material >= 0 and default else model.geom_rgba[geom]
    r, g, b, a = (float(v) for v in np.clip(rgba, 0, 1))
    size = model.geom_size[geom].astype(float)
    end = np.array([0.0, 0.0, size[1]])
    if kind == kinds.mjGEOM_MESH:
        shown = _mesh(model, int(model.geom_dataid[geom]))
        solid = Solid(mesh=physics_mesh(shown))
        name = name or model.names["mesh"][int(model.geom_dataid[geom])]
    elif kind == kinds.mjGEOM_BOX:
        shown = shapes.box_mesh(-size, size)
        solid = Solid(mesh=shown)
    elif kind == kinds.mjGEOM_SPHERE:
        shown = shapes.sphere_mesh(np.zeros(3), size[0])
        solid = shapes.sphere_solid(np.zeros(3), float(size[0]))
    elif kind == kinds.mjGEOM_CAPSULE:
        shown = shapes.capsule_mesh(-end, end, size[0])
        solid = capsule(-end, end, float(size[0]))
    elif kind == kinds.mjGEOM_CYLINDER:
        shown = shapes.cylinder_mesh(-end, end, size[0])
        solid = shapes.cylinder_solid(-end, end, float(size[0]))
    elif kind == kinds.mjGEOM_ELLIPSOID:
        shown, solid = _ellipsoid(size)
    else:
        what = str(kind.name).removeprefix("mjGEOM_").lower()
        reader.finding("warning", body, f"a {what} {UNSHAPED}")
        return None
    placed = moved(solid, body_from_geom)
    return replace(placed, name=name), replace(shown.moved(body_from_geom), color=(r, g, b, a))


def _mesh(model: Compiled, mesh: int) -> Mesh:
    v, n = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
    f, m = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
    return Mesh(model.mesh_vert[v : v + n].astype(float), model.mesh_face[f : f + m].astype(np.int32))


def _ellipsoid(radii: Any) -> tuple[Mesh, Solid]:
    """A sphere's mesh stretched; the solid is enlarged until it contains the ellipsoid."""
    unit = shapes.sphere_mesh(np.zeros(3), 1.0)
    a, b, c = (unit.vertices[unit.faces[:, i]] for i in range(3))
    normals = np.cross(b - a, c - a)
    inner = float((np.einsum("ij,ij->i", normals, a) / np.linalg.norm(normals, axis=1)).min())
    factor = 1 / inner
    note = f"ellipsoid as a mesh around it, at most {(factor - 1) * float(max(radii)) * 1e3:.2g} mm larger"
    if not math.isfinite(factor):
        raise ValueError(f"not an ellipsoid: {radii}")
    outer = Mesh(unit.vertices * radii * factor, unit.faces)
    return Mesh(unit.vertices * radii, unit.faces), Solid(mesh=outer, note=note)


DIRECTORIES = {"mesh": "meshdir", "texture": "texturedir", "skin": "meshdir", "hfield": "meshdir"}
"""Element → attribute of ``<compiler>`` that says where its files are; ``assetdir`` says it for all."""
FILE_ATTRIBUTES = ("file", "fileright", "fileleft", "fileup", "filedown", "filefront", "fileback")


def checked_files(path: Path) -> dict[str, bytes]:
    """The model and every file it names, by path relative to its folder.

    A name may be meant from several folders, and which of them MuJoCo takes it from is its own affair: all
    are looked at.

    Raises:
        InputError: A file is missing, too large, or outside the folder of the model; all of them at once.
    """
    problems: list[Problem] = []
    folder = path.parent.resolve()
    files: dict[str, bytes] = {}
    naming: list[tuple[Element, Path]] = []
    waiting = [path.resolve()]
    while waiting:
        current = waiting.pop()
        name = current.relative_to(folder).as_posix()
        if name in files:
            continue
        try:
            files[name] = content(current, MAX_BYTES)
        except (TooLarge, OSError) as error:
            raise InputError.at(path, name, str(error), f"at most {MAX_BYTES} are read") from None
        for element in parse_xml(files[name], str(current)).iter():
            naming.append((element, current.parent))
            # Included, or attached with assets of its own.
            if element.tag in {"include", "model"} and element.get("file") is not None:
                near = [folder / element.attrib["file"], current.parent / element.attrib["file"]]
                waiting += _inside(path, folder, element, near, problems)
    compilers = [element for element, _ in naming if element.tag == "compiler"]
    for element, parent in naming:
        for attribute in FILE_ATTRIBUTES:
            if element.tag in {"include", "model"} or element.get(attribute) is None:
                continue
            roots = _roots(dict.fromkeys((folder, parent)), compilers, str(element.tag))
            # The last part alone: the compiler's ``strippath``.
            named = dict.fromkeys((element.attrib[attribute], Path(element.attrib[attribute]).name))
            near = [root / name for name in named for root in roots]
            for found in _inside(path, folder, element, near, problems):
                try:
                    files[found.relative_to(folder).as_posix()] = content(found, MAX_MESH_BYTES)
                except (TooLarge, OSError) as error:
                    problems.append(Problem(str(path), found.name, str(error), f"at most {MAX_MESH_BYTES}"))
    if problems:
        raise InputError(problems)
    return files


def _roots(folders: Iterable[Path], compilers: list[Element], tag: str) -> list[Path]:
    said = [c.get(name) for c in compilers for name in (DIRECTORIES.get(tag, ""), "assetdir") if name]
    return [folder / directory for folder in folders for directory in (*filter(None, said), "")]


def _inside(
    path: Path, folder: Path, element: Element, near: list[Path], problems: list[Problem]
) -> list[Path]:
    """The candidates that exist; a problem when one of them lies outside the folder, or there is none."""
    key = f"<{element.tag} {element.get('name', '')}".strip() + ">"
    found: dict[Path, None] = {}
    for candidate in near:
        try:
            resolved = candidate.resolve()
            there = resolved.exists()
        except (OSError, ValueError):  # no name of a file
            continue
        if there and not resolved.is_relative_to(folder):
            what = f"{candidate} is outside the model's folder"
            problems.append(Problem(str(path), key, what, "keep its files together"))
            return []
        if resolved.is_file():
            found[resolved] = None
    if not found:
        searched = ", ".join(dict.fromkeys(str(c) for c in near))
        problems.append(Problem(str(path), key, "no such file", f"searched {searched}"))
    return list(found)


DEFAULT_DENSITY = 1000.0
"""What MuJoCo takes where a file gives neither mass nor density [kg/m³]."""


def read_mjcf(path: Path, *, resolver: Resolver, name: str = "robot") -> Description:
    """A robot from a MJCF file.

    Args:
        path: The file; everything it includes or names is in its folder or below.
        resolver: Carries the name of the file for messages.
        name: Name of the robot; findings speak of ``name/link``.

    Raises:
        InputError: What MuJoCo refuses, files outside the folder, ball and free joints.
    """
    files = checked_files(path)
    reader = Reader(resolver.file, name)
    model = compiled(path, resolver.file)
    for said in model.warned:
        reader.finding("warning", "", f"MuJoCo says: {said}")
    _check_figures(reader, model)
    _remarks(reader, model)
    names = _body_names(reader, model)
    links = [_link(reader, model, body, names) for body in range(model.nbody)]
    links = _without_empty_world(links)
    links += _sites(model, names, {link.name for link in links})
    reader.raise_problems()
    left_out = ["a rotor inertia (armature) that joints share"] if model.coupled else []
    made = flattened(reader, tuple(_mimicking(model, links, left_out)))
    for each in left_out:
        reader.finding("warning", "", f"{each} cannot be carried over: left out")
    reader.raise_problems()
    description = Description(
        name=name,
        links=made,
        tip=lint.guessed_tip(made),
        source=resolver.file,
        left_out=tuple(left_out),
        files=files,
    )
    return lint.checked(description, reader)


def _check_figures(reader: Reader, model: Compiled) -> None:
    """Raise `InputError` where a place or a size is no number, or none that a robot has."""
    far, heavy = f"must be within {FARTHEST:g} m", f"must be within {HEAVIEST:g} kg or kg·m²"
    turned = "must be a finite rotation"
    names = model.names
    for figures, most, named, key, remedy in (
        (model.body_pos, FARTHEST, names["body"], "body[{}].pos", far),
        (model.body_ipos, FARTHEST, names["body"], "body[{}].inertial.pos", far),
        (model.body_mass[:, None], HEAVIEST, names["body"], "body[{}].inertial.mass", heavy),
        (model.body_inertia, HEAVIEST, names["body"], "body[{}].inertial", heavy),
        (model.body_quat, 2, names["body"], "body[{}]", turned),
        (model.body_iquat, 2, names["body"], "body[{}].inertial", turned),
        (model.jnt_pos, FARTHEST, names["joint"], "joint[{}].pos", far),
        (model.qpos0[:, None], FARTHEST, names["joint"], "joint[{}].ref", "must be a position"),
        (model.geom_pos, FARTHEST, names["geom"], "geom[{}].pos", far),
        (model.geom_quat, 2, names["geom"], "geom[{}]", turned),
        (model.site_pos, FARTHEST, names["site"], "site[{}].pos", far),
        (model.site_quat, 2, names["site"], "site[{}]", turned),
    ):
        for i in np.flatnonzero(~(np.abs(figures) <= most).all(axis=1)).tolist():
            name = named[i] if i < len(named) else ""
            reader.problem(key.format(name or i), f"is {figures[i].tolist()}", remedy)
    for i in np.flatnonzero(~(np.abs(np.linalg.norm(model.jnt_axis, axis=1) - 1) <= 1e-6)).tolist():
        key = f"joint[{model.names['joint'][i] or i}].axis"
        reader.problem(key, f"is {model.jnt_axis[i].tolist()}", "must be a direction")
    sizes = model.geom_size
    import mujoco

    # That of a mesh is its box, which may be flat.
    flat = (model.geom_type == int(mujoco.mjtGeom.mjGEOM_MESH))[:, None] & (sizes < SMALLEST)
    fit = (sizes == 0) | ((sizes >= SMALLEST) & (sizes <= FARTHEST)) | flat
    for i in np.flatnonzero(~fit.all(axis=1)).tolist():
        remedy = f"must be from {SMALLEST:g} m to {FARTHEST:g} m"
        reader.problem(f"geom[{model.names['geom'][i] or i}].size", f"is {sizes[i].tolist()}", remedy)
    reader.raise_problems()


def _remarks(reader: Reader, model: Compiled) -> None:
    left_out = {
        "tendons": model.ntendon,
        "flexes": model.nflex,
        "contact pairs and exclusions": model.npair + model.nexclude,
        "plugins": model.nplugin,
    }
    for what, count in left_out.items():
        if count:
            reader.finding("warning" if what == "tendons" else "note", "", f"{count} {what} left out")
    if model.nu:
        reader.finding(
            "note",
            "",
            f"{model.nu} actuators: only their force limits and rotors are taken over, the gains are not",
        )
    if np.any(model.jnt_stiffness):
        reader.finding("note", "", "springs in joints are left out")


def _body_names(reader: Reader, model: Compiled) -> list[str]:
    names = []
    for body in range(model.nbody):
        name = model.names["body"][body]
        if not name:
            name = f"body_{body}"
            reader.finding("note", name, "a body without a name was given this one")
        names.append(name)
    return names


def _link(reader: Reader, model: Compiled, body: int, names: list[str]) -> Link:
    name = names[body]
    parent_from_link = transform(rotation_from_wxyz(model.body_quat[body]), model.body_pos[body])
    adr, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
    joints = [_joint(reader, model, joint) for joint in range(adr, adr + count)]
    made = tuple(joint for joint in joints if joint)
    visual, solids = shapes_of_body(reader, model, body, name)
    inertial, refused = _inertial(reader, model, body, name, shown=bool(made or visual or solids))
    return Link(
        name=name,
        parent=names[int(model.body_parentid[body])] if body else None,
        parent_from_link=_at_zero(reader, model, adr, made, parent_from_link),
        joints=made,
        inertial=inertial,
        refused_mass=refused,
        visual=visual,
        solids=solids,
    )


def _joint(reader: Reader, model: Compiled, joint: int) -> Joint | None:
    import mujoco

    name = model.names["joint"][joint] or f"joint_{joint}"
    kind = mujoco.mjtJoint(int(model.jnt_type[joint]))
    kinds = {
        mujoco.mjtJoint.mjJNT_HINGE: JointKind.REVOLUTE,
        mujoco.mjtJoint.mjJNT_SLIDE: JointKind.PRISMATIC,
    }
    if kind not in kinds:
        what = str(kind.name).removeprefix("mjJNT_").lower()
        remedy = "a joint has one degree of freedom: chain several, or place the robot with base"
        reader.problem(f"joint[{name}].type", f"is {what!r}", remedy)
        return None
    dof = int(model.jnt_dofadr[joint])
    limited = bool(model.jnt_limited[joint])
    armature = model.rotors[dof]
    effort = min(_force_limits(model, joint), default=None)
    value, text = lint.plausible_limit("effort", effort)
    if text:
        reader.finding("warning", name, text)
    source = f"{reader.file}: joint {name}"
    return Joint(
        name=name,
        kind=kinds[kind],
        axis=model.jnt_axis[joint].astype(float) / np.linalg.norm(model.jnt_axis[joint]),
        anchor=model.jnt_pos[joint].astype(float),
        lower=float(model.jnt_range[joint, 0]) if limited else None,
        upper=float(model.jnt_range[joint, 1]) if limited else None,
        effort=None if value is None else Quantity(value, Origin.STATED, source),
        armature=Quantity(armature, Origin.STATED, source) if armature > 0 else None,
        damping=float(model.dof_damping[dof].flat[0]),
        friction=float(model.dof_frictionloss[dof]),
    )


def _force_limits(model: Compiled, joint: int) -> Iterator[float]:
    """Every bound on the force of a joint: its own, and those of motors that drive it alone."""
    import mujoco

    if model.jnt_actfrclimited[joint]:
        yield float(np.abs(model.jnt_actfrcrange[joint]).min())
    for actuator in range(model.nu):
        on_joint = int(model.actuator_trntype[actuator]) in {
            int(mujoco.mjtTrn.mjTRN_JOINT),
            int(mujoco.mjtTrn.mjTRN_JOINTINPARENT),
        }
        if not on_joint or int(model.actuator_trnid[actuator, 0]) != joint:
            continue
        gear = abs(float(model.actuator_gear[actuator, 0]))
        if model.actuator_forcelimited[actuator]:
            yield gear * float(np.abs(model.actuator_forcerange[actuator]).min())
        fixed = int(model.actuator_gaintype[actuator]) == int(mujoco.mjtGain.mjGAIN_FIXED)
        direct = fixed and int(model.actuator_biastype[actuator]) == int(mujoco.mjtBias.mjBIAS_NONE)
        if direct and model.actuator_ctrllimited[actuator]:
            gain = abs(float(model.actuator_gainprm[actuator, 0]))
            yield gear * gain * float(np.abs(model.actuator_ctrlrange[actuator]).min())


def _at_zero(
    reader: Reader, model: Compiled, adr: int, joints: tuple[Joint, ...], parent_from_link: Array
) -> Array:
    """MuJoCo's bodies are given with every joint at its ``ref``; descriptions are with every joint at 0."""
    references = [float(model.qpos0[model.jnt_qposadr[adr + i]]) for i in range(len(joints))]
    if not any(references):
        return parent_from_link
    if len(joints) > 1:
        key = f"joint[{joints[0].name}].ref"
        reader.problem(key, "several joints of one body with a ref", "make them 0 or give each joint a body")
        return parent_from_link
    return parent_from_link @ displacement(joints[0], -references[0])


def _inertial(
    reader: Reader, model: Compiled, body: int, name: str, *, shown: bool
) -> tuple[Inertial | None, str]:
    """Mass properties that can be used, and why they cannot."""
    mass = float(model.body_mass[body])
    if mass == 0.0:
        return None, ""
    rotation = rotation_from_wxyz(model.body_iquat[body])
    inertia = rotation @ np.diag(model.body_inertia[body].astype(float)) @ rotation.T
    origin, source = Origin.STATED, f"{reader.file}: body {name}"
    options, changed = model.changed
    if body in changed:
        text = f"{mass:.4g} kg are not what the file gives: it asks MuJoCo to change masses ({options})"
        reader.finding("warning", name, f"{text}: mass and inertia unknown")
        return None, text
    own, geoms = model.written[body]
    low, high = model.compiler["inertiagrouprange"]
    if not own or model.compiler["inertiafromgeom"] == 1:
        left_out = [geom.mass for geom in geoms if not low <= geom.group <= high and geom.mass > 0]
        if left_out:
            text = f"{sum(left_out):.4g} kg of its shapes are outside inertiagrouprange and count nowhere"
            reader.finding("warning", name, f"{text}: mass and inertia unknown")
            return None, text
        weighed = [geom for geom in geoms if np.isnan(geom.mass)]
        if any(geom.density == DEFAULT_DENSITY for geom in weighed):
            origin, source = Origin.ASSUMED, f"{source}: shapes at MuJoCo's default of 1000 kg/m³"
            reader.finding(
                "assumed", name, f"no mass given: {mass:.4g} kg from its shapes at MuJoCo's 1000 kg/m³"
            )
        else:
            origin, source = Origin.COMPUTED, f"{source}: shapes with the mass or density in the file"
    made = Inertial(
        mass=mass,
        com=model.body_ipos[body].astype(float),
        inertia=0.5 * (inertia + inertia.T),
        origin=origin,
        source=source,
    )
    kept, level, text = lint.plausible_inertial(made, body=shown)
    if text:
        reader.finding(level, name, text)
    return kept, "" if kept is not None else text


def _without_empty_world(links: list[Link]) -> list[Link]:
    """The world body is the root only where it has shapes or several bodies hang on it."""
    world = links[0]
    first = [link for link in links if link.parent == world.name]
    if (
        world.solids
        or world.visual
        or len(first) != 1
        or first[0].joints
        or not np.allclose(first[0].parent_from_link, np.eye(4), atol=0)
    ):
        return links
    root = first[0]
    return [replace(root, parent=None), *(link for link in links[1:] if link is not root)]


def _sites(model: Compiled, names: list[str], taken: set[str]) -> list[Link]:
    """Sites are frames without mass: a tool may be mounted on one."""
    sites = []
    for site in range(model.nsite):
        name = model.names["site"][site]
        parent = names[int(model.site_bodyid[site])]
        if not name or parent not in taken:
            continue
        unique = name if name not in taken else f"{name}_site"
        if unique in taken:
            continue
        taken.add(unique)
        matrix = transform(rotation_from_wxyz(model.site_quat[site]), model.site_pos[site])
        sites.append(Link(name=unique, parent=parent, parent_from_link=matrix))
    return sites


def _mimicking(model: Compiled, links: list[Link], left_out: list[str]) -> Iterator[Link]:
    """Joint equalities as mimic joints; what other equalities there are is appended to ``left_out``."""
    import mujoco

    mimics: dict[str, Mimic] = {}
    for equality in range(model.neq):
        first, second = int(model.eq_obj1id[equality]), int(model.eq_obj2id[equality])
        a0, a1, *higher = model.eq_data[equality, :5].astype(float)
        joint = int(model.eq_type[equality]) == int(mujoco.mjtEq.mjEQ_JOINT)
        if not model.eq_active0[equality]:
            continue
        if not joint or second < 0 or any(higher):
            kind = mujoco.mjtEq(int(model.eq_type[equality])).name.removeprefix("mjEQ_").lower()
            left_out.append(f"an equality of kind {kind}")
            continue
        y0, x0 = (float(model.qpos0[model.jnt_qposadr[j]]) for j in (first, second))
        driven, driver = (model.names["joint"][j] or f"joint_{j}" for j in (first, second))
        mimics[driven] = Mimic(driver, float(a1), float(y0 + a0 - a1 * x0))
    for link in links:
        joints = tuple(replace(joint, mimic=mimics.get(joint.name)) for joint in link.joints)
        yield replace(link, joints=joints)
