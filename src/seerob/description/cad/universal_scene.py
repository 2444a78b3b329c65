"""USD asked for parts, links, joints and masses through OpenUSD's own library; in the parsers' process alone.

It reads copies in a folder of their own: layers that a file names are put there when they lie in its folder
or below, and are named as missing when they do not; OpenUSD itself would follow a path to anywhere.
"""

from __future__ import annotations

import io
import math
import tempfile
import zipfile
from collections.abc import Iterator
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seerob.core.errors import InputError
from seerob.core.files.bounded import TooLarge, unpacked
from seerob.core.transforms import Array, rotation_from_axis_angle, rotation_from_wxyz, transform
from seerob.description.cad import containing
from seerob.description.cad.assembly import link_row, nearest_rotation
from seerob.description.mesh_files import MeshSource, triangles
from seerob.description.shapes.mass_properties import boxes_meet

MAX_PRIMS = 200_000
MAX_LAYERS = 1_000
COLOR = (0.7, 0.72, 0.75, 1.0)
ENDINGS = (".usd", ".usda", ".usdc")
_TURN = math.pi / 180
_ROUNDING = 2e-6
_OFF = 1e-4
"""Places of bodies off their joints by more are told [m or as a sine]."""

Piece = tuple[bytes, bytes, tuple[float, float, float, float]]


def plain(path: Path, data: bytes, max_bytes: int, max_faces: int) -> dict[str, Any]:
    """Parts, mechanisms, findings and files that were read, in numbers, texts and bytes."""
    source = MeshSource(path, data, max_bytes, max_faces)
    with source.parsing("USD file"), tempfile.TemporaryDirectory() as folder:
        from pxr import Tf, Usd

        try:
            layers = _Layers(source, Path(folder))
            return _Stage(source, Usd.Stage.Open(str(layers.root)), layers).described()
        except (Tf.ErrorException, UnicodeError) as error:
            said = (str(error).strip().splitlines() or [type(error).__name__])[0]
            source.fail(f"is not a readable USD file ({said[:160]})", "export it again")


class _Layers:
    """Copies of a file and of the layers that it is composed of, in a folder."""

    def __init__(self, source: MeshSource, folder: Path) -> None:
        self.source, self.folder = source, folder
        self.missing: list[str] = []
        self.count = 0
        if source.data.startswith(b"PK"):
            name = self._unpacked()
        else:
            ending = ".usdc" if source.data.startswith(b"PXR-USDC") else ".usda"
            name = f"scene{ending}"
            (folder / name).write_bytes(source.data)
        self.root = folder / name
        self._localize(self.root, PurePosixPath(""), packed=source.data.startswith(b"PK"), depth=0)

    def _unpacked(self) -> str:
        """Members of a package, whose first one is the root."""
        left, first = self.source.max_bytes, ""
        try:
            with zipfile.ZipFile(io.BytesIO(self.source.data)) as archive:
                for member in archive.infolist():
                    name = PurePosixPath(member.filename)
                    if member.is_dir():
                        continue
                    if name.is_absolute() or ".." in name.parts or "\\" in member.filename:
                        what = f"holds a member that leads out of it ({member.filename[:80]!r})"
                        self.source.fail(what, "export it again")
                    if name.suffix.lower() not in ENDINGS:
                        continue
                    self.count += 1
                    if self.count > MAX_LAYERS:
                        self.source.fail(f"has more than {MAX_LAYERS} layers", "flatten it")
                    content = unpacked(archive, member, left)
                    left -= len(content)
                    first = first or member.filename
                    (self.folder / name).parent.mkdir(parents=True, exist_ok=True)
                    (self.folder / name).write_bytes(content)
        except TooLarge as error:
            self.source.fail(str(error), "simplify it")
        if not first:
            self.source.fail("is a package without a layer of USD", "export it again")
        return first

    def _localize(self, file: Path, at: PurePosixPath, *, packed: bool, depth: int) -> None:
        """Brings the layers that one names beside it, or takes their names out of it."""
        from pxr import Sdf

        layer = Sdf.Layer.FindOrOpen(str(file))
        if layer is None:
            self.source.fail(f"{at / file.name} is not a readable layer of USD", "export it again")
        changed = False
        # The empty name is the layer itself, of which one prim is made as another is.
        for name in sorted(filter(None, layer.GetCompositionAssetDependencies())):
            self.count += 1
            if self.count > MAX_LAYERS:
                self.source.fail(f"has more than {MAX_LAYERS} layers", "flatten it")
            target = self._target(name, at, packed=packed) if depth < 50 else None
            if target is None:
                self.missing.append(name)
                text = (
                    f"refers to {name[:200]!r}, which is not beside it or below: what is in there is missing"
                )
                self.source.findings = [f for f in self.source.findings if repr(name[:200]) not in f.text]
                self.source.note(text, level="warning")
                layer.UpdateCompositionAssetDependency(name, "")
                changed = True
                continue
            copy, fresh = target
            wanted = str(self.folder / copy)
            layer.UpdateCompositionAssetDependency(name, wanted)
            changed = True
            if fresh:
                self._localize(self.folder / copy, copy.parent, packed=packed, depth=depth + 1)
        if changed:
            layer.Save()

    def _target(self, name: str, at: PurePosixPath, *, packed: bool) -> tuple[PurePosixPath, bool] | None:
        """Path of a copy from the folder, and whether it was made now."""
        relative = PurePosixPath(name.replace("\\", "/"))
        parts: list[str] = []
        for part in (at / relative).parts:
            if part == "..":
                if not parts:
                    return None
                parts.pop()
            elif part != ".":
                parts.append(part)
        if relative.is_absolute() or ":" in name or "[" in name or not parts:
            return None
        copy = PurePosixPath(*parts)
        if copy.suffix.lower() not in ENDINGS:
            return None
        if (self.folder / copy).exists():
            done = copy in self.done
            self.done.add(copy)
            return copy, not done
        if packed:
            return None
        try:
            content = self.source.beside(str(copy))
        except InputError:
            return None
        if content is None:
            return None
        (self.folder / copy).parent.mkdir(parents=True, exist_ok=True)
        (self.folder / copy).write_bytes(content)
        self.done.add(copy)
        return copy, True

    @property
    def done(self) -> set[PurePosixPath]:
        """Copies whose own names have been followed."""
        if not hasattr(self, "_done"):
            self._done: set[PurePosixPath] = set()
        return self._done


class _Stage:
    def __init__(self, source: MeshSource, stage: Any, layers: _Layers) -> None:
        from pxr import Usd, UsdGeom, UsdPhysics

        self.source, self.stage, self.layers = source, stage, layers
        self.usd, self.geom, self.physics = Usd, UsdGeom, UsdPhysics
        self.cache = UsdGeom.XformCache()
        self.faces = 0
        self.meters = float(UsdGeom.GetStageMetersPerUnit(stage))
        if not stage.HasAuthoredMetadata("metersPerUnit"):
            source.note(f"the file does not say its unit: {self.meters:g} m, as USD has it", level="assumed")
        if not (math.isfinite(self.meters) and 1e-9 <= self.meters <= 1e6):
            source.fail(
                f"its unit is {self.meters!r} metres", "a positive number is expected", "metersPerUnit"
            )
        self.up = str(UsdGeom.GetStageUpAxis(stage)).lower()
        if not stage.HasAuthoredMetadata("upAxis"):
            source.note(
                f"the file does not say which axis points up: {self.up}, as USD has it", level="assumed"
            )
        self.kilograms = float(UsdPhysics.GetStageKilogramsPerUnit(stage))
        self.left_out: list[tuple[str, str]] = []
        default = stage.GetDefaultPrim()
        roots = stage.GetPseudoRoot().GetChildren()
        named = [r for r in roots if r.IsA(UsdGeom.Xformable)]
        # One root that everything hangs on is called as the file itself, as "World": it tells nothing apart.
        self.skipped = (
            default.GetPath() if default and len(named) == 1 and not named[0].IsA(UsdGeom.Gprim) else None
        )

    def described(self) -> dict[str, Any]:
        """Plain data of it."""
        bodies: dict[Any, Any] = {}
        joints: list[Any] = []
        owned: dict[Any, list[Any]] = {}
        count = 0
        proxies = self.usd.TraverseInstanceProxies(self.usd.PrimDefaultPredicate)
        walk = iter(self.usd.PrimRange.PreAndPostVisit(self.stage.GetPseudoRoot(), proxies))
        owners: list[Any] = []
        for prim in walk:
            if walk.IsPostVisit():
                if owners and owners[-1] == prim.GetPath():
                    owners.pop()
                continue
            count += 1
            if count > MAX_PRIMS:
                self.source.fail(f"has more than {MAX_PRIMS} prims", "export the cell alone")
            if prim.HasAPI(self.physics.RigidBodyAPI):
                bodies[prim.GetPath()] = prim
                owners.append(prim.GetPath())
            elif not owners and self._is_one(prim):
                owners.append(prim.GetPath())
            if prim.IsA(self.physics.Joint):
                joints.append(prim)
            elif prim.IsA(self.geom.PointInstancer):
                self.left_out.append((str(prim.GetPath()), "a point instancer: export its instances"))
                walk.PruneChildren()
            elif prim.IsA(self.geom.Gprim):
                owned.setdefault(owners[-1] if owners else prim.GetPath(), []).append(prim)
        for path in bodies:  # those without a shape may have a mass
            owned.setdefault(path, [])
        mechanisms = list(self._mechanisms(bodies, joints, owned))
        parts = []
        for path, shapes in owned.items():
            prim = self.stage.GetPrimAtPath(path)
            world = _rigid(self._world(prim))
            row = {
                "path": self._names(prim),
                "pieces": self._pieces(prim, shapes, collision=False),
                "collision": self._pieces(prim, shapes, collision=True),
                "world": world.tolist(),
                "inertial": self._inertial(prim, shapes),
            }
            if row["pieces"] or row["collision"] or row["inertial"]:
                parts.append(row)
        groups = [p for p in self.stage.Traverse() if p.IsA(self.physics.CollisionGroup)]
        if groups:
            names = ", ".join(p.GetName() for p in groups[:8])
            text = (
                f"collision groups ({names}) are not taken over: what may touch what is said by [[contacts]]"
            )
            self.source.note(text)
        return {
            "meters": self.meters,
            "up": self.up,
            "parts": parts,
            "mechanisms": mechanisms,
            "left_out": [
                *self.left_out,
                *((name, "a file that is not there") for name in self.layers.missing),
            ],
            "findings": [(f.level, f.subject, f.text) for f in self.source.findings],
            "files": self.source.files,
        }

    def _is_one(self, prim: Any) -> bool:
        """Whether a prim says that all that is below it is one thing."""
        model = self.usd.ModelAPI(prim)
        return prim.HasAPI(self.physics.MassAPI) or str(model.GetKind()) == "component"

    def _names(self, prim: Any) -> list[str]:
        names: list[str] = []
        while prim and not prim.IsPseudoRoot() and prim.GetPath() != self.skipped:
            names.append(str(prim.GetDisplayName() or prim.GetName()))
            prim = prim.GetParent()
        return names[::-1] or ["part"]

    def _world(self, prim: Any) -> Array:
        return np.array(self.cache.GetLocalToWorldTransform(prim), float).T

    # -- shapes -------------------------------------------------------------------------------

    def _pieces(self, owner: Any, prims: list[Any], *, collision: bool) -> list[Piece]:
        """Meshes of prims, in the rigid frame of what they belong to."""
        found: list[Piece] = []
        for prim in prims:
            if not (prim.HasAPI(self.physics.CollisionAPI) if collision else self._seen(prim)):
                continue
            matrix = self._placed(owner, prim)
            for vertices, faces, color in self._mesh(prim):
                self.faces += len(faces)
                if self.faces > self.source.max_faces:
                    self.source.fail(f"has more than {self.source.max_faces} triangles", "simplify it")
                moved = vertices @ matrix[:3, :3].T + matrix[:3, 3]
                turned = faces[:, ::-1] if np.linalg.det(matrix[:3, :3]) < 0 else faces
                found.append(
                    (
                        np.ascontiguousarray(moved, "<f8").tobytes(),
                        np.ascontiguousarray(turned, "<i4").tobytes(),
                        color,
                    )
                )
        return found

    def _seen(self, prim: Any) -> bool:
        imageable = self.geom.Imageable(prim)
        hidden = imageable.ComputeVisibility() == self.geom.Tokens.invisible
        return not hidden and imageable.ComputePurpose() not in ("guide", "proxy")

    def _placed(self, owner: Any, prim: Any) -> Array:
        """The rigid frame of an owner from a prim's own, (4, 4), with every scale."""
        above = self._world(owner)
        stretch = np.linalg.inv(_rigid(above)) @ above
        if np.abs(stretch - np.eye(4)).max() < 1e-9:
            stretch = np.eye(4)
        if prim.GetPath() == owner.GetPath():
            return stretch
        relative, _ = self.cache.ComputeRelativeTransform(prim, owner)
        return np.asarray(stretch @ np.array(relative, float).T)

    def _mesh(
        self, prim: Any
    ) -> Iterator[tuple[Array, NDArray[np.int64], tuple[float, float, float, float]]]:
        geom = self.geom
        color = self._color(prim)
        if prim.IsA(geom.Mesh):
            yield from self._polygons(prim, color)
            return
        known = self._simple(prim)
        if known is None:
            self.left_out.append(
                (str(prim.GetPath()), f"{prim.GetTypeName()} has no surface that is read here")
            )
            return
        mesh = known.mesh
        yield mesh.vertices, mesh.faces.astype(np.int64), color

    def _simple(self, prim: Any) -> containing.Contained | None:
        geom = self.geom

        def size(name: str) -> float:
            value = float(prim.GetAttribute(name).Get())
            if not (math.isfinite(value) and value > 0):
                self.source.fail(f"{prim.GetPath()} has {name} = {value!r}", "a positive number is expected")
            return value

        def ends(length: float) -> tuple[Array, Array]:
            axis = np.eye(3)["XYZ".index(str(prim.GetAttribute("axis").Get()))]
            return -axis * length / 2, axis * length / 2

        if prim.IsA(geom.Cube):
            half = size("size") / 2
            return containing.box(half)
        if prim.IsA(geom.Sphere):
            return containing.ball_within(size("radius"))
        if prim.IsA(geom.Cylinder):
            return containing.cylinder_within(*ends(size("height")), size("radius"))
        if prim.IsA(geom.Capsule):
            return containing.capsule_within(*ends(size("height")), size("radius"))
        if prim.IsA(geom.Cone):
            return containing.cone_within(*ends(size("height")), size("radius"))
        return None

    def _polygons(
        self, prim: Any, color: tuple[float, float, float, float]
    ) -> Iterator[tuple[Array, NDArray[np.int64], tuple[float, float, float, float]]]:
        mesh = self.geom.Mesh(prim)
        points = np.array(mesh.GetPointsAttr().Get() or [], float).reshape(-1, 3)
        counts = np.array(mesh.GetFaceVertexCountsAttr().Get() or [], np.int64)
        indices = np.array(mesh.GetFaceVertexIndicesAttr().Get() or [], np.int64)
        name = str(prim.GetPath())
        if not len(counts):
            self.left_out.append((name, "a mesh without faces"))
            return
        if counts.min() < 3 or counts.sum() != len(indices) or len(counts) > self.source.max_faces:
            self.source.fail(f"{name}: its counts and indices of faces do not fit", "export it again")
        if indices.min() < 0 or indices.max() >= len(points) or not np.isfinite(points).all():
            self.source.fail(
                f"{name}: a face names a point that does not exist or is no number", "export it again"
            )
        if str(mesh.GetSubdivisionSchemeAttr().Get()) != "none" and self._is_subdivided(mesh):
            self.source.note(f"{name} is a subdivision surface: its cage is taken", level="warning")
        at = np.concatenate([[0], np.cumsum(counts)])
        left_handed = str(mesh.GetOrientationAttr().Get()) == "leftHanded"
        groups: list[tuple[NDArray[np.int64], tuple[float, float, float, float]]] = []
        rest = np.ones(len(counts), bool)
        for subset in self.geom.Subset.GetAllGeomSubsets(mesh):
            which = np.array(subset.GetIndicesAttr().Get() or [], np.int64)
            which = which[(which >= 0) & (which < len(counts))]
            which = which[rest[which]]
            if len(which):
                rest[which] = False
                groups.append((which, self._color(subset.GetPrim(), color)))
        if rest.any():
            groups.append((np.flatnonzero(rest), color))
        for which, own in groups:
            faces = triangles(points, [indices[at[i] : at[i + 1]].tolist() for i in which])
            yield points, faces[:, ::-1] if left_handed else faces, own

    def _is_subdivided(self, mesh: Any) -> bool:
        """Whether the file itself says that a mesh is one; the default is what most exporters forget."""
        return bool(mesh.GetSubdivisionSchemeAttr().HasAuthoredValue())

    def _color(
        self, prim: Any, instead: tuple[float, float, float, float] = COLOR
    ) -> tuple[float, float, float, float]:
        from pxr import UsdShade

        material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
        shader = material.ComputeSurfaceSource()[0] if material else None
        value = None
        if shader:
            entry = shader.GetInput("diffuseColor") or shader.GetInput("diffuse_color_constant")
            value = entry.Get() if entry else None
        if value is None and prim.IsA(self.geom.Gprim):
            shown = self.geom.Gprim(prim).GetDisplayColorAttr().Get()
            value = shown[0] if shown is not None and len(shown) else None
        if value is None:
            return instead
        linear = np.clip(np.array(value, float)[:3], 0, 1)
        r, g, b = np.where(linear <= 0.0031308, linear * 12.92, 1.055 * linear ** (1 / 2.4) - 0.055)
        return round(float(r), 6), round(float(g), 6), round(float(b), 6), 1.0

    # -- masses -------------------------------------------------------------------------------

    def _inertial(self, prim: Any, shapes: list[Any]) -> dict[str, Any] | None:
        """Mass properties in the rigid frame of a prim; None where the file states no mass."""
        if not prim.HasAPI(self.physics.MassAPI):
            return None
        api = self.physics.MassAPI(prim)
        mass = float(api.GetMassAttr().Get() or 0.0) * self.kilograms
        density = float(api.GetDensityAttr().Get() or 0.0) * self.kilograms / self.meters**3
        if mass <= 0:
            return {"density": density, **self._moments(prim, shapes)} if density > 0 else None
        scale = np.linalg.norm(self._world(prim)[:3, :3], axis=0)
        com = np.array(api.GetCenterOfMassAttr().Get(), float)
        moments = np.array(api.GetDiagonalInertiaAttr().Get(), float) * self.kilograms
        turned = _rotation(api.GetPrincipalAxesAttr().Get())
        placed = np.isfinite(com).all()
        frame = transform(turned, com * scale if placed else np.zeros(3))
        known = placed and bool((moments > 0).any())
        stated = {"mass": mass, "frame": frame.tolist(), "moments": moments.tolist() if known else None}
        return stated if known else {**stated, **self._moments(prim, shapes)}

    def _moments(self, owner: Any, prims: list[Any]) -> dict[str, Any]:
        """Moments of simple shapes at density 1 in the rigid frame of what they belong to, one by one.

        With how far their meshes are outside of them; no moments where one is no simple shape, or some may
        overlap.
        """
        chosen = [prim for prim in prims if prim.HasAPI(self.physics.CollisionAPI)] or [
            prim for prim in prims if self._seen(prim)
        ]
        found: list[Any] = []
        meshes: list[Any] = []
        off, simple = 0.0, True
        for prim in chosen:
            known = self._simple(prim)
            if known is None:
                simple = False
                continue
            matrix = self._placed(owner, prim)
            moments = known.moments.moved(matrix)
            meshes.append(known.mesh.moved(matrix))
            found.append([moments.volume, moments.com.tolist(), moments.inertia.tolist()])
            off = max(off, known.off * float(np.linalg.norm(matrix[:3, :3], 2)))
        return {"solids": found if simple and found and not boxes_meet(meshes) else None, "off": off}

    # -- joints -------------------------------------------------------------------------------

    def _mechanisms(
        self, bodies: dict[Any, Any], joints: list[Any], owned: dict[Any, list[Any]]
    ) -> Iterator[dict[str, Any]]:
        edges: dict[Any, list[tuple[Any, Any, bool]]] = {}
        fixed: set[Any] = set()
        linked: set[Any] = set()
        for prim in joints:
            joint = self.physics.Joint(prim)
            if joint.GetJointEnabledAttr().Get() is False:
                self.left_out.append((str(prim.GetPath()), "a joint that is switched off"))
                continue
            ends = [
                self._body(rel.GetTargets(), bodies) for rel in (joint.GetBody0Rel(), joint.GetBody1Rel())
            ]
            if ends[0] is None or ends[1] is None:
                if self._kind(prim) is None and prim.GetTypeName() != "PhysicsFixedJoint":
                    self.left_out.append(
                        (str(prim.GetPath()), f"{prim.GetTypeName()} is no joint of one axis")
                    )
                if prim.GetTypeName() == "PhysicsFixedJoint":
                    fixed.update(end for end in ends if end is not None)
                    continue
            edges.setdefault(ends[0], []).append((prim, ends[1], True))
            edges.setdefault(ends[1], []).append((prim, ends[0], False))
            linked.update(end for end in ends if end is not None)
        roots = [b for b in bodies if b in fixed or bodies[b].HasAPI(self.physics.ArticulationRootAPI)]
        # Joints to the world begin a mechanism whose base is the world itself.
        seen: set[Any] = set()
        used: set[Any] = set()
        for root in (None, *roots, *bodies):
            if root is None and None not in edges:
                continue
            if root is not None and (root in seen or root not in linked):
                continue
            yield from self._tree(root, bodies, edges, owned, seen, used)
        for prims in edges.values():
            for prim, _, first in prims:
                if first and prim.GetPath() not in used:
                    used.add(prim.GetPath())
                    text = "closes a loop of joints, which a tree of links has no place for"
                    self.left_out.append((str(prim.GetPath()), text))

    def _body(self, targets: Any, bodies: dict[Any, Any]) -> Any:
        """Path of the rigid body that a joint names or that its target is part of; None for the world."""
        for target in targets:
            prim = self.stage.GetPrimAtPath(target)
            while prim and not prim.IsPseudoRoot():
                if prim.GetPath() in bodies:
                    return prim.GetPath()
                prim = prim.GetParent()
        return None

    def _kind(self, prim: Any) -> str | None:
        return {"PhysicsRevoluteJoint": "revolute", "PhysicsPrismaticJoint": "prismatic"}.get(
            str(prim.GetTypeName())
        )

    def _tree(
        self,
        root: Any,
        bodies: dict[Any, Any],
        edges: dict[Any, list[tuple[Any, Any, bool]]],
        owned: dict[Any, list[Any]],
        seen: set[Any],
        used: set[Any],
    ) -> Iterator[dict[str, Any]]:
        for begin in [root] if root is not None else [None] * len(edges[None]):
            rows: list[dict[str, Any]] = []
            world = np.eye(4) if begin is None else _rigid(self._world(bodies[begin]))
            waiting: list[tuple[Any, int, Any, bool]] = [(begin, -1, None, True)]
            if begin is not None:
                seen.add(begin)
            moving = False
            while waiting:
                body, parent, joint, first = waiting.pop(0)
                row = self._row(body, parent, joint, first, bodies, owned)
                moving = moving or bool(row["joints"])
                number = len(rows)
                rows.append(row)
                for prim, other, forward in edges.get(body, ()):
                    if other is None or other in seen or prim.GetPath() in used:
                        continue
                    if self._is_excluded(prim):
                        continue
                    used.add(prim.GetPath())
                    seen.add(other)
                    waiting.append((other, number, prim, forward))
                    if body is None:
                        break  # one mechanism for each joint to the world
            if moving:
                path = None if begin is None else bodies[begin].GetPath()
                label = self._label(path, rows)
                for path_of in [row.pop("path") for row in rows]:
                    owned.pop(path_of, None)
                yield {"name": label, "world": world.tolist(), "links": rows}

    def _is_excluded(self, prim: Any) -> bool:
        return bool(self.physics.Joint(prim).GetExcludeFromArticulationAttr().Get())

    def _label(self, path: Any, rows: list[dict[str, Any]]) -> str:
        """Name of a mechanism: of the prim that all its links are under, else of the first that moves."""
        paths = [row["path"] for row in rows if row["path"] is not None]
        common = paths[0] if len(paths) > 1 else paths[0].GetParentPath()
        for other in paths[1:]:
            common = common.GetCommonPrefix(other)
        if common in (self.skipped, self.stage.GetPseudoRoot().GetPath()):
            common = paths[0].GetParentPath()  # tools that are named beside the robot that carries them
        prim = self.stage.GetPrimAtPath(common)
        while prim and not prim.IsPseudoRoot() and prim.GetTypeName() == "Scope":
            prim = prim.GetParent()
        if prim and not prim.IsPseudoRoot() and prim.GetPath() != self.skipped:
            return str(prim.GetDisplayName() or prim.GetName())
        return str(self.stage.GetPrimAtPath(paths[0]).GetName()) if path is None else str(path.name)

    def _row(
        self,
        body: Any,
        parent: int,
        joint: Any,
        first: bool,
        bodies: dict[Any, Any],
        owned: dict[Any, list[Any]],
    ) -> dict[str, Any]:
        row = {**link_row("world_link", parent), "path": body}
        if body is not None:
            prim = bodies[body]
            shapes = owned.get(body, [])
            row["name"] = str(prim.GetDisplayName() or prim.GetName())
            row["inertial"] = self._inertial(prim, shapes)
            row["pieces"] = self._pieces(prim, shapes, collision=False)
            row["collision"] = self._pieces(prim, shapes, collision=True)
        if joint is None:
            return row
        api = self.physics.Joint(joint)
        other = self._body((api.GetBody0Rel() if first else api.GetBody1Rel()).GetTargets(), bodies)
        frames = [
            self._frame(api.GetLocalPos0Attr(), api.GetLocalRot0Attr(), api.GetBody0Rel(), bodies),
            self._frame(api.GetLocalPos1Attr(), api.GetLocalRot1Attr(), api.GetBody1Rel(), bodies),
        ]
        above, below = frames if first else frames[::-1]
        parent_from_link = above @ np.linalg.inv(below)
        row["matrix"] = parent_from_link.tolist()
        kind = self._kind(joint)
        worlds = [np.eye(4) if b is None else _rigid(self._world(bodies[b])) for b in (other, body)]
        shown = np.linalg.inv(worlds[0]) @ worlds[1]
        if kind is None:
            if np.abs(shown - parent_from_link).max() < _ROUNDING:
                row["matrix"] = shown.tolist()
            if joint.GetTypeName() != "PhysicsFixedJoint":
                text = (
                    f"joint {joint.GetPath()}: {joint.GetTypeName()} is no joint of one axis: taken as fixed"
                )
                self.source.note(text, level="warning")
            return row
        axis = np.eye(3)["XYZ".index(str(joint.GetAttribute("physics:axis").Get()))]
        sign = 1.0 if first else -1.0
        rel = np.linalg.inv(above) @ shown @ below
        value, off = _value(rel, axis, kind)
        if off < _ROUNDING:
            # Frames of joints are in four bytes, places of bodies in eight: the scene's pose is kept.
            row["matrix"] = (shown @ np.linalg.inv(_moved(below, axis, kind, value))).tolist()
        if off > _OFF:
            text = f"joint {joint.GetPath()}: the bodies are {off:.3g} off where it lets them be"
            self.source.note(text, level="warning")
        k = _TURN if kind == "revolute" else 1.0
        ends = [joint.GetAttribute(f"physics:{end}Limit").Get() for end in ("lower", "upper")]
        lower, upper = (None if e is None or not math.isfinite(e) else float(e) * k for e in ends)
        row["anchor"] = below[:3, 3].tolist()
        speed = joint.GetAttribute("physxJoint:maxJointVelocity")
        force = joint.GetAttribute(f"drive:{'angular' if kind == 'revolute' else 'linear'}:physics:maxForce")
        row["joints"] = [
            {
                "name": str(joint.GetDisplayName() or joint.GetName()),
                "kind": kind,
                "axis": (sign * (below[:3, :3] @ axis)).tolist(),
                "lower": lower,
                "upper": upper,
                "velocity": _finite(speed.Get() if speed else None, k if kind == "revolute" else self.meters),
                "effort": _finite(force.Get() if force else None, self._force(kind)),
                "value": sign * value,
            }
        ]
        return row

    def _force(self, kind: str) -> float:
        """SI units in a force or a torque of the file."""
        newtons = self.kilograms * self.meters
        return newtons * self.meters if kind == "revolute" else newtons

    def _frame(self, position: Any, rotation: Any, rel: Any, bodies: dict[Any, Any]) -> Array:
        """Frame of a joint in the rigid frame of a body (4, 4)."""
        at = np.array(position.Get() or (0, 0, 0), float)
        frame = transform(_rotation(rotation.Get()), at)
        targets = rel.GetTargets()
        body = self._body(targets, bodies)
        prim = self.stage.GetPrimAtPath(targets[0]) if targets else None
        if prim:
            world = self._world(prim)
            placed = transform(_rigid(world)[:3, :3] @ frame[:3, :3], (world @ [*at, 1.0])[:3])
            if body is None:
                return placed
            return np.linalg.inv(_rigid(self._world(bodies[body]))) @ placed
        return frame


def _finite(value: Any, k: float) -> float | None:
    number = None if value is None else float(value)
    return None if number is None or not math.isfinite(number) or number > 1e30 else number * k


def _rotation(quaternion: Any) -> Array:
    if quaternion is None:
        return np.eye(3)
    wxyz = np.array([quaternion.GetReal(), *quaternion.GetImaginary()], float)
    return rotation_from_wxyz(wxyz) if np.isfinite(wxyz).all() and np.any(wxyz) else np.eye(3)


def _rigid(world: Array) -> Array:
    """The placement in a matrix that may scale and mirror (4, 4)."""
    if not np.isfinite(world).all() or abs(np.linalg.det(world[:3, :3])) < 1e-30:
        raise ValueError("a transform is no placement")
    rigid = np.eye(4)
    rigid[:3, :3] = nearest_rotation(world[:3, :3] / np.linalg.norm(world[:3, :3], axis=0))
    rigid[:3, 3] = world[:3, 3]
    return rigid


def _moved(link_from_joint: Array, axis: Array, kind: str, value: float) -> Array:
    """What a joint does to its link, in the link's frame (4, 4)."""
    turns = kind == "revolute"
    done = transform(rotation_from_axis_angle(axis, value)) if turns else transform(position=axis * value)
    return link_from_joint @ done @ np.linalg.inv(link_from_joint)


def _value(rel: Array, axis: Array, kind: str) -> tuple[float, float]:
    """How far a joint has gone, and how far the rest of the placement is from nothing."""
    if kind == "prismatic":
        value = float(rel[:3, 3] @ axis)
        rest = transform(rel[:3, :3], rel[:3, 3] - value * axis)
        return value, float(np.abs(rest - np.eye(4)).max())
    R = rel[:3, :3]
    sine = 0.5 * np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) @ axis
    cosine = 0.5 * (np.trace(R) - 1)
    value = math.atan2(float(sine), float(cosine))
    turned = transform(rotation_from_axis_angle(axis, value))
    return value, float(np.abs(np.linalg.inv(turned) @ rel - np.eye(4)).max())
