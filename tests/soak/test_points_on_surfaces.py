"""Points all over surfaces of OpenCASCADE: none lies farther outside of what distances use than is said."""

import math

import numpy as np
import pytest
import trimesh

from seerob.description.cad import step
from seerob.description.mesh_files import MeshSource
from seerob.description.shapes.detail import physics_mesh
from seerob.description.shapes.mesh_bodies import is_closed, joined
from seerob.kernels.signed_distance import outside
from seerob.kernels.tree import build_tree


def _cylinder(radius, height, at=(0, 0, 0), along=(0, 0, 1)):
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeCylinder
    from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt

    axis = gp_Ax2(gp_Pnt(*map(float, at)), gp_Dir(*map(float, along)))
    return BRepPrimAPI_MakeCylinder(axis, float(radius), float(height)).Shape()


def bracket():
    """A block with crossing holes and rounded edges."""
    from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut
    from OCP.BRepFilletAPI import BRepFilletAPI_MakeFillet
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox
    from OCP.TopAbs import TopAbs_ShapeEnum
    from OCP.TopExp import TopExp_Explorer
    from OCP.TopoDS import TopoDS

    block = BRepPrimAPI_MakeBox(120.0, 60.0, 40.0).Shape()
    rounded = BRepFilletAPI_MakeFillet(block)
    edges = TopExp_Explorer(block, TopAbs_ShapeEnum.TopAbs_EDGE)
    while edges.More():
        rounded.Add(7.0, TopoDS.Edge(edges.Current()))
        edges.Next()
    shape = rounded.Shape()
    for hole in (_cylinder(11, 80, (40, 30, -10)), _cylinder(9, 140, (-10, 30, 20), (1, 0, 0))):
        shape = BRepAlgoAPI_Cut(shape, hole).Shape()
    return shape


def funnel():
    """A cone on a torus."""
    from OCP.BRepAlgoAPI import BRepAlgoAPI_Fuse
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeCone, BRepPrimAPI_MakeTorus

    cone = BRepPrimAPI_MakeCone(80.0, 15.0, 150.0).Shape()
    return BRepAlgoAPI_Fuse(cone, BRepPrimAPI_MakeTorus(80.0, 20.0).Shape()).Shape()


def hull():
    """A free-form surface through a square, a circle and a smaller square."""
    from OCP.BRepBuilderAPI import (
        BRepBuilderAPI_MakeEdge,
        BRepBuilderAPI_MakePolygon,
        BRepBuilderAPI_MakeWire,
    )
    from OCP.BRepOffsetAPI import BRepOffsetAPI_ThruSections
    from OCP.gp import gp_Ax2, gp_Circ, gp_Dir, gp_Pnt

    loft = BRepOffsetAPI_ThruSections(True)

    def square(half, z):
        polygon = BRepBuilderAPI_MakePolygon()
        for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
            polygon.Add(gp_Pnt(half * x, half * y, z))
        polygon.Close()
        return polygon.Wire()

    circle = gp_Circ(gp_Ax2(gp_Pnt(0, 0, 60), gp_Dir(0, 0, 1)), 90.0)
    for wire in (square(50.0, 0.0), BRepBuilderAPI_MakeWire(BRepBuilderAPI_MakeEdge(circle).Edge()).Wire()):
        loft.AddWire(wire)
    loft.AddWire(square(30.0, 200.0))
    return loft.Shape()


def ball():
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeSphere

    return BRepPrimAPI_MakeSphere(75.0).Shape()


SHAPES = {"bracket": bracket, "funnel": funnel, "hull": hull, "ball": ball}


def points_on(shape, count, seed):
    """Points of the faces, within their edges, evenly in their parameters [m], (n, 3)."""
    from OCP.BRepAdaptor import BRepAdaptor_Surface
    from OCP.BRepClass import BRepClass_FaceClassifier
    from OCP.gp import gp_Pnt2d
    from OCP.TopAbs import TopAbs_ShapeEnum, TopAbs_State
    from OCP.TopExp import TopExp_Explorer
    from OCP.TopoDS import TopoDS

    rng, found = np.random.default_rng(seed), []
    faces, explorer = [], TopExp_Explorer(shape, TopAbs_ShapeEnum.TopAbs_FACE)
    while explorer.More():
        faces.append(TopoDS.Face(explorer.Current()))
        explorer.Next()
    for face in faces:
        surface = BRepAdaptor_Surface(face, True)
        u = rng.uniform(surface.FirstUParameter(), surface.LastUParameter(), 2 * count // len(faces))
        v = rng.uniform(surface.FirstVParameter(), surface.LastVParameter(), len(u))
        for a, b in zip(u.tolist(), v.tolist(), strict=True):
            if BRepClass_FaceClassifier(face, gp_Pnt2d(a, b), 1e-9).State() != TopAbs_State.TopAbs_OUT:
                p = surface.Value(a, b)
                found.append((p.X(), p.Y(), p.Z()))
    return np.array(found) * 1e-3


def written(shape, path):
    from OCP.STEPControl import STEPControl_StepModelType, STEPControl_Writer

    writer = STEPControl_Writer()
    writer.Transfer(shape, STEPControl_StepModelType.STEPControl_AsIs)
    writer.Write(str(path))
    return path


def check(shape, path, tolerance, count):
    """How far the farthest point lies outside, and how far is said [m]."""
    file = written(shape, path)
    (found,) = step.read(MeshSource(file, file.read_bytes(), 1 << 28, 10**7), tolerance=tolerance).shapes
    mesh, _ = joined(found.pieces)
    assert is_closed(mesh)
    exact = physics_mesh(mesh)
    points = points_on(shape, count, 5)
    nodes, links, T = build_tree(np.ascontiguousarray(exact.vertices), np.ascontiguousarray(exact.faces))
    far = outside(nodes, links, T, np.ascontiguousarray(points))
    # Another's distance to the triangles, of the farthest.
    peer = trimesh.Trimesh(exact.vertices, exact.faces, process=False)
    for k in np.argsort(-far)[:20]:
        near = trimesh.triangles.closest_point(peer.triangles, np.tile(points[k], (len(peer.faces), 1)))
        distance = np.linalg.norm(near - points[k], axis=1).min()
        assert far[k] == pytest.approx(distance, abs=1e-9)
    return len(points), far.max(), found.deviation + exact.deviation


@pytest.mark.parametrize("count", [1_500, pytest.param(100_000, marks=pytest.mark.soak)], ids=["few", "many"])
@pytest.mark.parametrize("tolerance", [1e-3, 1e-4])
@pytest.mark.parametrize("name", SHAPES)
def test_no_point_of_a_surface_is_farther_outside_than_said(tmp_path, name, tolerance, count):
    seen, far, said = check(SHAPES[name](), tmp_path / "a.step", tolerance, count)
    assert seen > count / 3
    assert 0 < far <= said
    # Nor is more said than is needed to be told from a rough guess.
    assert said < 3 * tolerance
    assert math.isfinite(said)
