"""A cell as USD: metres, z up, an articulation for each mechanism (UsdPhysics), meshes in their colours."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from seerob.core.extras import need
from seerob.core.shapes import Mesh
from seerob.core.transforms import Array, wxyz_from_rotation
from seerob.description.description import Description, JointKind, Link
from seerob.description.shapes.glb import solid_mesh
from seerob.description.shapes.mesh_bodies import joined


def write(path: Path, cell: Description, home: Mapping[str, float], world: Mapping[str, Array]) -> None:
    """Write a layer of USD.

    Args:
        path: The file: ``.usda`` or ``.usdc``.
        cell: Its first link is the world.
        home: Positions of joints [rad or m].
        world: Pose of each link in the world (4, 4), joints as in ``home``.

    Raises:
        MissingPackage: OpenUSD is not installed.
    """
    need("pxr")
    from pxr import Usd, UsdGeom, UsdPhysics

    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdPhysics.SetStageKilogramsPerUnit(stage, 1.0)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/World").GetPrim())
    UsdPhysics.Scene.Define(stage, "/World/PhysicsScene")
    _Writer(stage, cell, world).write()
    stage.Save()


class _Writer:
    def __init__(self, stage: Any, cell: Description, world: Mapping[str, Array]) -> None:
        self.stage, self.cell, self.world = stage, cell, world
        self.paths: dict[str, str] = {}
        self.taken: set[str] = {"/World/PhysicsScene"}
        self.groups: dict[tuple[str, ...], str] = {(): "/World"}
        below: dict[str, list[Link]] = {}
        for link in cell.links[1:]:
            below.setdefault(link.parent or "", []).append(link)
        self.linked: set[str] = set()
        self.roots: set[str] = set()
        for link in below.get(cell.links[0].name, ()):
            tree = [link]
            for other in tree:
                tree += below.get(other.name, ())
            if any(other.joints for other in tree):
                self.linked |= {other.name for other in tree}
                self.roots.add(link.name)

    def write(self) -> None:
        from pxr import UsdGeom

        for link in self.cell.links[1:]:
            *above, name = link.name.split("/")
            path = self._path(self._group(tuple(above)), name)
            self.paths[link.name] = path
            prim = UsdGeom.Xform.Define(self.stage, path)
            self.groups.setdefault(tuple(link.name.split("/")), path)
            prim.GetPrim().SetDisplayName(name)
            # A group that is itself a link, as a tool that others are named under, moves what is below it.
            parent = self._placed_above(path)
            self._place(prim, np.linalg.inv(parent) @ self.world[link.name])
            self._shapes(link, path)
            self._physics(link, prim.GetPrim())
        for link in self.cell.links[1:]:
            if link.name in self.linked:
                self._joint(link)

    def _placed_above(self, path: str) -> Array:
        best = ""
        for name, known in self.paths.items():
            if path.startswith(f"{known}/") and len(known) > len(self.paths.get(best, "")):
                best = name
        return self.world[best] if best else np.eye(4)

    def _group(self, names: tuple[str, ...]) -> str:
        from pxr import UsdGeom

        if names not in self.groups:
            path = self._path(self._group(names[:-1]), names[-1])
            UsdGeom.Xform.Define(self.stage, path).GetPrim().SetDisplayName(names[-1])
            self.groups[names] = path
        return self.groups[names]

    def _path(self, above: str, name: str) -> str:
        plain = re.sub(r"[^A-Za-z0-9_]", "_", name)
        plain = plain if plain and not plain[0].isdigit() else f"_{plain}"
        found, number = f"{above}/{plain}", 1
        while found in self.taken:
            number += 1
            found = f"{above}/{plain}_{number}"
        self.taken.add(found)
        return found

    def _place(self, prim: Any, at: Array) -> None:
        from pxr import Gf, UsdGeom

        prim.AddTranslateOp().Set(Gf.Vec3d(*map(float, at[:3, 3])))
        w, x, y, z = map(float, wxyz_from_rotation(at[:3, :3]))
        prim.AddOrientOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Quatd(w, x, y, z))

    def _shapes(self, link: Link, path: str) -> None:
        from pxr import UsdGeom

        shown = list(link.visual)
        measured = [solid_mesh(s) if s.mesh is None or s.radius else s.mesh for s in link.solids]
        same = len(shown) and sum(len(m.faces) for m in shown) == sum(len(m.faces) for m in measured)
        if not shown:
            shown, same = measured, True
        for number, mesh in enumerate(shown):
            prim = self._mesh(self._path(path, f"shape_{number}"), mesh)
            if same:
                self._collides(prim)
        if not same and measured:
            prim = self._mesh(self._path(path, "collision"), joined(measured)[0])
            self._collides(prim)
            UsdGeom.Imageable(prim).CreatePurposeAttr(UsdGeom.Tokens.guide)

    def _collides(self, prim: Any) -> None:
        from pxr import UsdPhysics

        UsdPhysics.CollisionAPI.Apply(prim)
        # A triangle mesh as it is, not its hull, for what stands; movers of PhysX take their hull anyway.
        UsdPhysics.MeshCollisionAPI.Apply(prim).CreateApproximationAttr(UsdPhysics.Tokens.none)

    def _mesh(self, path: str, mesh: Mesh) -> Any:
        from pxr import Gf, UsdGeom, Vt

        made = UsdGeom.Mesh.Define(self.stage, path)
        points = np.ascontiguousarray(mesh.vertices, np.float32)
        made.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points))
        made.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(mesh.faces), 3, np.int32)))
        made.CreateFaceVertexIndicesAttr(
            Vt.IntArray.FromNumpy(np.ascontiguousarray(mesh.faces.ravel(), np.int32))
        )
        made.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
        made.CreateExtentAttr([Gf.Vec3f(*map(float, p)) for p in (points.min(axis=0), points.max(axis=0))])
        rgba = np.clip(mesh.color, 0, 1)
        linear = np.where(rgba <= 0.04045, rgba / 12.92, ((rgba + 0.055) / 1.055) ** 2.4)
        made.CreateDisplayColorAttr([Gf.Vec3f(*map(float, linear[:3]))])
        if rgba[3] < 1:
            made.CreateDisplayOpacityAttr([float(rgba[3])])
        return made.GetPrim()

    def _physics(self, link: Link, prim: Any) -> None:
        from pxr import Gf, Usd, UsdPhysics

        if link.name in self.linked:
            UsdPhysics.RigidBodyAPI.Apply(prim)
        elif link.solids or link.visual:
            Usd.ModelAPI(prim).SetKind("component")
        if link.inertial is None:
            return
        moments, axes = np.linalg.eigh(link.inertial.inertia)
        axes = axes * np.sign(np.linalg.det(axes))
        w, x, y, z = map(float, wxyz_from_rotation(axes))
        api = UsdPhysics.MassAPI.Apply(prim)
        api.CreateMassAttr(float(link.inertial.mass))
        api.CreateCenterOfMassAttr(Gf.Vec3f(*map(float, link.inertial.com)))
        api.CreateDiagonalInertiaAttr(Gf.Vec3f(*map(float, moments)))
        api.CreatePrincipalAxesAttr(Gf.Quatf(w, x, y, z))

    def _joint(self, link: Link) -> None:
        """Joints of a link; a mechanism's base is fixed to the world, and an articulation begins there."""
        from pxr import UsdPhysics

        path = self.paths[link.name]
        if link.name in self.roots:
            if not link.joints:
                fixed = UsdPhysics.FixedJoint.Define(self.stage, self._path(path, "fixed_to_world"))
                fixed.CreateBody1Rel().SetTargets([path])
                self._frames(fixed, self.world[link.name], np.eye(4))
                UsdPhysics.ArticulationRootAPI.Apply(self.stage.GetPrimAtPath(path))
                return
            parent = ""
        else:
            parent = self.paths[link.parent or ""]
        if not link.joints:
            fixed = UsdPhysics.FixedJoint.Define(self.stage, self._path(path, "fixed"))
            fixed.CreateBody0Rel().SetTargets([parent])
            fixed.CreateBody1Rel().SetTargets([path])
            self._frames(fixed, link.parent_from_link, np.eye(4))
            return
        joint = link.joints[-1]
        turns = joint.kind is JointKind.REVOLUTE
        kind = UsdPhysics.RevoluteJoint if turns else UsdPhysics.PrismaticJoint
        made = kind.Define(self.stage, self._path(path, joint.name.rpartition("/")[2]))
        made.GetPrim().SetDisplayName(joint.name.rpartition("/")[2])
        if parent:
            made.CreateBody0Rel().SetTargets([parent])
        made.CreateBody1Rel().SetTargets([path])
        made.CreateAxisAttr("X")
        below = np.eye(4)
        below[:3, :3] = _along_x(joint.axis)
        below[:3, 3] = joint.anchor
        self._frames(made, link.parent_from_link @ below, below)
        k = 180 / math.pi if turns else 1.0
        if joint.lower is not None and joint.upper is not None:
            made.CreateLowerLimitAttr(float(joint.lower * k))
            made.CreateUpperLimitAttr(float(joint.upper * k))
        if joint.effort is not None:
            drive = UsdPhysics.DriveAPI.Apply(made.GetPrim(), "angular" if turns else "linear")
            drive.CreateMaxForceAttr(float(joint.effort.value))
        if joint.velocity is not None:
            from pxr import Sdf

            name = "physxJoint:maxJointVelocity"
            made.GetPrim().CreateAttribute(name, Sdf.ValueTypeNames.Float).Set(
                float(joint.velocity.value * k)
            )

    def _frames(self, joint: Any, above: Array, below: Array) -> None:
        from pxr import Gf

        for number, frame in enumerate((above, below)):
            w, x, y, z = map(float, wxyz_from_rotation(frame[:3, :3]))
            at = Gf.Vec3f(*map(float, frame[:3, 3]))
            (joint.CreateLocalPos1Attr if number else joint.CreateLocalPos0Attr)(at)
            (joint.CreateLocalRot1Attr if number else joint.CreateLocalRot0Attr)(Gf.Quatf(w, x, y, z))


def _along_x(axis: Array) -> Array:
    """A rotation (3, 3) whose first column is an axis."""
    y = np.cross(axis, np.eye(3)[int(np.abs(axis).argmin())])
    y /= np.linalg.norm(y)
    return np.column_stack([axis, y, np.cross(axis, y)])
