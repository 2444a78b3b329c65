"""MJCF in: MuJoCo reads and compiles the file, this turns the result into a description."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from seerob.core.errors import InputError
from seerob.core.snapshot import Origin
from seerob.core.transforms import Array, rotation_from_wxyz, transform
from seerob.description import lint
from seerob.description.description import Description, Inertial, Joint, JointKind, Link, Mimic, Quantity
from seerob.description.formats.mimic import flattened
from seerob.description.formats.mjcf_files import checked_files
from seerob.description.formats.mjcf_geometry import shapes_of_body
from seerob.description.formats.resolve import Resolver
from seerob.description.pose import displacement
from seerob.description.xml_values import Reader

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
    import mujoco

    files = checked_files(path)
    reader = Reader(resolver.file, name)
    try:
        spec = mujoco.MjSpec.from_file(str(path))
        # Names of fixed bodies and shapes for the screen are kept, whatever the file says.
        spec.compiler.fusestatic = False
        spec.compiler.discardvisual = False
        model = spec.compile()
    except ValueError as error:
        said = " ".join(str(error).split())
        raise InputError.at(resolver.file, "", f"MuJoCo cannot read it: {said}", _remedy(said)) from None
    _remarks(reader, spec, model)
    names = _body_names(reader, model)
    links = [_link(reader, spec, model, body, names) for body in range(model.nbody)]
    links = _without_empty_world(links)
    links += _sites(model, names, {link.name for link in links})
    reader.raise_problems()
    made = flattened(reader, tuple(_mimicking(reader, model, links)))
    reader.raise_problems()
    description = Description(
        name=name, links=made, tip=lint.guessed_tip(made), source=resolver.file, files=files
    )
    return lint.checked(description, reader)


def _remedy(said: str) -> str:
    """What would be right, where MuJoCo only says what is wrong."""
    if "mass" not in said:
        return ""
    return "give every moving body a mass greater than 0: <inertial>, or mass or density of its geoms"


def _remarks(reader: Reader, spec: Any, model: Any) -> None:
    left_out = {
        "tendons": model.ntendon,
        "flexes": model.nflex,
        "contact pairs and exclusions": model.npair + model.nexclude,
        "plugins": model.nplugin,
    }
    for what, count in left_out.items():
        if count:
            reader.finding("warning" if what == "tendons" else "note", "", f"{count} {what} left out")
    compiler = spec.compiler
    for option, on in (
        ("balanceinertia", compiler.balanceinertia),
        ("settotalmass", compiler.settotalmass > 0),
    ):
        if on:
            reader.finding("warning", "", f"the file asks MuJoCo to change masses ({option}): as changed")
    if model.nu:
        reader.finding(
            "note", "", f"{model.nu} actuators: only their force limits are taken over, the gains are not"
        )
    if np.any(model.jnt_stiffness):
        reader.finding("note", "", "springs in joints are left out")


def _body_names(reader: Reader, model: Any) -> list[str]:
    names = []
    for body in range(model.nbody):
        name = model.body(body).name
        if not name:
            name = f"body_{body}"
            reader.finding("note", name, "a body without a name was given this one")
        names.append(name)
    return names


def _link(reader: Reader, spec: Any, model: Any, body: int, names: list[str]) -> Link:
    name = names[body]
    parent_from_link = transform(rotation_from_wxyz(model.body_quat[body]), model.body_pos[body])
    adr, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
    joints = [_joint(reader, model, joint) for joint in range(adr, adr + count)]
    made = tuple(joint for joint in joints if joint)
    visual, solids = shapes_of_body(reader, model, body, name)
    inertial, refused = _inertial(reader, spec, model, body, name, shown=bool(made or visual or solids))
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


def _joint(reader: Reader, model: Any, joint: int) -> Joint | None:
    import mujoco

    name = model.joint(joint).name or f"joint_{joint}"
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
    armature = float(model.dof_armature[dof])
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


def _force_limits(model: Any, joint: int) -> Iterator[float]:
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
    reader: Reader, model: Any, adr: int, joints: tuple[Joint, ...], parent_from_link: Array
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
    reader: Reader, spec: Any, model: Any, body: int, name: str, *, shown: bool
) -> tuple[Inertial | None, str]:
    """Mass properties that can be used, and why they cannot."""
    mass = float(model.body_mass[body])
    if mass == 0.0:
        return None, ""
    rotation = rotation_from_wxyz(model.body_iquat[body])
    inertia = rotation @ np.diag(model.body_inertia[body].astype(float)) @ rotation.T
    origin, source = Origin.STATED, f"{reader.file}: body {name}"
    given = spec.bodies[body]
    low, high = spec.compiler.inertiagrouprange
    if not given.explicitinertial or int(spec.compiler.inertiafromgeom) == 1:
        left_out = [geom.mass for geom in given.geoms if not low <= geom.group <= high and geom.mass > 0]
        if left_out:
            text = f"{sum(left_out):.4g} kg of its shapes are outside inertiagrouprange and count nowhere"
            reader.finding("warning", name, f"{text}: mass and inertia unknown")
            return None, text
        weighed = [geom for geom in given.geoms if np.isnan(geom.mass)]
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


def _sites(model: Any, names: list[str], taken: set[str]) -> list[Link]:
    """Sites are frames without mass: a tool may be mounted on one."""
    sites = []
    for site in range(model.nsite):
        name = model.site(site).name
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


def _mimicking(reader: Reader, model: Any, links: list[Link]) -> Iterator[Link]:
    """Joint equalities as mimic joints; other equalities are reported."""
    import mujoco

    mimics: dict[str, Mimic] = {}
    for equality in range(model.neq):
        first, second = int(model.eq_obj1id[equality]), int(model.eq_obj2id[equality])
        a0, a1, *higher = model.eq_data[equality, :5].astype(float)
        joint = int(model.eq_type[equality]) == int(mujoco.mjtEq.mjEQ_JOINT)
        if not joint or second < 0 or any(higher) or not model.eq_active0[equality]:
            kind = mujoco.mjtEq(int(model.eq_type[equality])).name.removeprefix("mjEQ_").lower()
            reader.finding("warning", "", f"an equality of kind {kind} cannot be carried over: left out")
            continue
        y0, x0 = (float(model.qpos0[model.jnt_qposadr[j]]) for j in (first, second))
        driven, driver = (model.joint(j).name or f"joint_{j}" for j in (first, second))
        mimics[driven] = Mimic(driver, float(a1), float(y0 + a0 - a1 * x0))
    for link in links:
        joints = tuple(replace(joint, mimic=mimics.get(joint.name)) for joint in link.joints)
        yield replace(link, joints=joints)
