"""Distances of whole bodies, against a second library and closed forms."""

import coal
import numpy as np
import pytest
import trimesh

from concave import IDENTITY, SLOT, SOLIDS, bumpy_ball, poses
from seerob.core.errors import InputError
from seerob.core.shapes import Mesh, Solid, capsule
from seerob.distance.least import DistanceKind, Query, Shapes


def coal_distance(a: Mesh, b: Mesh, R, x) -> float:
    def tree(mesh):
        made = coal.BVHModelOBBRSS()
        made.beginModel(len(mesh.faces), len(mesh.vertices))
        points, triangles = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
        for v in mesh.vertices:
            points.append(np.asarray(v, float))
        for f in mesh.faces:
            triangles.append(coal.Triangle(*map(int, f)))
        made.addSubModel(points, triangles)
        made.endModel()
        return made

    request = coal.DistanceRequest(True)
    request.rel_err = request.abs_err = 0
    trees = tree(a), tree(b)
    at = [[coal.Transform3s(R[k, i], x[k, i]) for i in range(2)] for k in range(len(R))]
    return np.array([coal.distance(trees[0], p, trees[1], q, request, coal.DistanceResult()) for p, q in at])


def as_mesh(solid: Solid) -> Mesh:
    """The core of a solid, as triangles."""
    if solid.mesh is not None:
        return solid.mesh
    p = solid.points
    if len(p) == 2:
        return Mesh(np.array([p[0], p[1], p[1]]), np.array([[0, 1, 2]], np.int32))
    return Mesh(np.array([*p, p[1] + p[2] - p[0]]), np.array([[0, 1, 2], [1, 3, 2]], np.int32))


@pytest.mark.parametrize("first", SOLIDS)
@pytest.mark.parametrize("second", SOLIDS)
def test_apart_it_is_what_coal_says_of_the_cores_less_the_radii(first, second):
    a, b = SOLIDS[first], SOLIDS[second]
    query = Query(Shapes.build([("a", [a]), ("b", [b])]), [0], [1])
    R, x = poses(60, 2, 1.0)
    found = query.batch(R, x)
    theirs = coal_distance(as_mesh(a), as_mesh(b), R, x)
    apart = found.kind[:, 0] == DistanceKind.EXACT
    assert apart.sum() > 20
    np.testing.assert_allclose(found.distance[apart, 0], theirs[apart] - a.radius - b.radius, atol=1e-9)
    assert (found.distance[~apart, 0] <= -a.radius - b.radius + 1e-12).all()
    # The points are as far apart as the value says, and on the surfaces.
    span = np.linalg.norm(found.point_a[:, 0] - found.point_b[:, 0], axis=1)
    np.testing.assert_allclose(span[apart], abs(found.distance[apart, 0]), atol=1e-12)


def test_points_lie_on_the_surfaces():
    shapes = Shapes.build([("a", [SOLIDS["dilated mesh"]]), ("b", [SOLIDS["capsule"]])])
    R, x = poses(100, 2, 1.0, 1)
    found = Query(shapes, [0], [1]).batch(R, x)
    for k in np.flatnonzero(found.kind[:, 0] == DistanceKind.EXACT):
        p = Mesh(found.point_a[k, [0, 0, 0]], np.array([[0, 1, 2]], np.int32))
        still = np.stack([R[k, 0], IDENTITY])[None], np.stack([x[k, 0], np.zeros(3)])[None]
        assert coal_distance(SOLIDS["dilated mesh"].mesh, p, *still) == pytest.approx(0.05, abs=1e-9)
        a, b = SOLIDS["capsule"].points
        q = R[k, 1].T @ (found.point_b[k, 0] - x[k, 1]) - a
        t = np.clip(q @ (b - a) / ((b - a) @ (b - a)), 0, 1)
        assert np.linalg.norm(q - t * (b - a)) == pytest.approx(0.07, abs=1e-12)


def test_capsules_have_a_closed_form():
    shapes = Shapes.build(
        [("a", [capsule([0, 0, 0], [1, 0, 0], 0.1)]), ("b", [capsule([0, -1, 0], [0, 1, 0], 0.2)])]
    )
    R = np.tile(IDENTITY, (2, 1, 1))
    query = Query(shapes, [0], [1])
    found = query.minimum(R, [[0, 0, 0], [0.5, 0, 0.7]])
    assert found.distance == pytest.approx(0.4, abs=1e-15)
    np.testing.assert_allclose([found.point_a, found.point_b], [[0.5, 0, 0.1], [0.5, 0, 0.5]], atol=1e-15)
    assert query.minimum(R, [[0, 0, 0], [0.5, 0, 0.25]]).distance == pytest.approx(-0.05, abs=1e-15)


def test_degenerate_triangles_neither_add_nor_hide_anything():
    mesh = bumpy_ball(20, 0.5)
    n = len(mesh.vertices)
    first = mesh.faces[0]
    vertices = np.vstack([mesh.vertices, mesh.vertices[first[:2]].mean(0)])
    slivers = [[first[0], first[0], first[0]], [first[0], first[1], first[1]], [first[0], n, first[1]]]
    dirty = Mesh(vertices, np.vstack([mesh.faces, slivers]).astype(np.int32))
    R, x = poses(200, 2, 0.8, 6)
    rod = capsule([0, 0, 0], [0.1, 0.2, 0], 0.02)
    clean, other = (
        Query(Shapes.build([("a", [Solid(mesh=m)]), ("b", [rod])]), [0], [1]).batch(R, x)
        for m in (mesh, dirty)
    )
    np.testing.assert_allclose(other.distance, clean.distance, atol=1e-12)


def test_robots_of_the_library_of_examples_agree_with_coal():
    """Collision meshes of a real UR10 against a slotted part."""
    from pathlib import Path

    folder = (
        Path(coal.__file__).parents[4]
        / "share/example-robot-data/robots/ur_description/meshes/ur10/collision"
    )
    loaded = trimesh.load(folder / "forearm.stl", force="mesh")
    link = Mesh(np.array(loaded.vertices, float), np.array(loaded.faces, np.int32))
    query = Query(Shapes.build([("part", [Solid(mesh=SLOT)]), ("link", [Solid(mesh=link)])]), [0], [1])
    R, x = poses(100, 2, 0.6, 7)
    found = query.batch(R, x)
    apart = found.kind[:, 0] == DistanceKind.EXACT
    theirs = coal_distance(SLOT, link, R, x)
    np.testing.assert_allclose(found.distance[apart, 0], theirs[apart], atol=1e-12)
    assert (found.distance[~apart, 0] <= 0).all()
    assert apart.sum() > 50


def test_trees_from_disk_answer_alike(tmp_path):
    bodies = [("a", [Solid(mesh=bumpy_ball(5))]), ("b", [SOLIDS["capsule"]])]
    R, x = poses(20, 2, 1.0, 8)
    answers = [Query(Shapes.build(bodies, cache=tmp_path), [0], [1]).batch(R, x) for _ in range(2)]
    assert (answers[0].distance == answers[1].distance).all()
    assert len(list(tmp_path.iterdir())) == 1


def test_meshes_that_cannot_be_are_all_named():
    good = bumpy_ball(0)
    broken = good.vertices.copy()
    broken[3, 1] = np.nan
    with pytest.raises(InputError) as error:
        Shapes.build(
            [
                ("a", [Solid(mesh=Mesh(broken, good.faces), name="hull")]),
                ("b", [Solid(mesh=Mesh(good.vertices, good.faces[:0]))]),
                ("c", [Solid(mesh=Mesh(good.vertices[:9], good.faces))]),
            ]
        )
    assert [(p.file, p.key) for p in error.value.problems] == [
        ("a", "hull"),
        ("b", "shape 0"),
        ("c", "shape 0"),
    ]
    assert "point 3 is" in str(error.value)
    assert "no triangles" in str(error.value)
