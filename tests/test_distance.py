"""Distances of whole bodies, against a second library, analytic solids and proofs."""

import coal
import manifold3d
import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from seerob.distance import Per, Query, Reach, Shapes
from seerob.errors import InputError, SimulationDiverged, UnknownName
from seerob.geometry import Mesh, Solid, capsule, dilated_rectangle

RNG = np.random.default_rng(3)
IDENTITY = np.eye(3)


def bumpy_ball(seed: int, size: float = 1.0, subdivisions: int = 2) -> Mesh:
    """A concave star about the origin."""
    ball = trimesh.creation.icosphere(subdivisions=subdivisions)
    noise = np.random.default_rng(seed).uniform(0.4, 1.2, len(ball.vertices)) * size
    return Mesh(np.array(ball.vertices * noise[:, None]), np.array(ball.faces, np.int32))


def boxes(*bounds) -> Mesh:
    """Overlapping boxes, each its own shell."""
    mesh = trimesh.util.concatenate([trimesh.creation.box(bounds=np.array(b, float)) for b in bounds])
    return Mesh(np.array(mesh.vertices), np.array(mesh.faces, np.int32))


def cut(solid: manifold3d.Manifold) -> Mesh:
    mesh = solid.to_mesh64()
    return Mesh(np.array(mesh.vert_properties[:, :3], float), np.array(mesh.tri_verts, np.int32))


def cube(x, y, z):
    return manifold3d.Manifold.cube((x, y, z), True)


SLOT = cut(cube(0.6, 0.4, 0.3) - cube(0.7, 0.1, 0.2).translate((0, 0, 0.1)))
U_BOXES = [
    ((-0.4, -0.4, 0), (-0.3, 0.4, 0.2)),
    ((0.3, -0.4, 0), (0.4, 0.4, 0.2)),
    ((-0.4, -0.4, 0), (0.4, -0.3, 0.2)),
]


def poses(n: int, bodies: int, spread: float, seed: int = 0):
    rng = np.random.default_rng(seed)
    R = Rotation.random(n * bodies, rng).as_matrix().reshape(n, bodies, 3, 3)
    return R, rng.uniform(-spread, spread, (n, bodies, 3))


def walk(n: int, bodies: int, spread: float, seed: int = 0):
    """Poses that follow each other closely."""
    rng = np.random.default_rng(seed)
    turn = np.cumsum(rng.normal(size=(n, bodies, 3)) * 0.05, axis=0)
    x = np.cumsum(rng.normal(size=(n, bodies, 3)) * 0.02, axis=0) + rng.uniform(-spread, spread, (bodies, 3))
    return Rotation.from_rotvec(turn.reshape(-1, 3)).as_matrix().reshape(n, bodies, 3, 3), x


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


SOLIDS = {
    "concave mesh": Solid(mesh=bumpy_ball(5, 0.7)),
    "dilated mesh": Solid(mesh=bumpy_ball(6, 0.5), radius=0.05),
    "capsule": capsule([-0.2, 0.1, 0], [0.4, 0.2, 0.1], 0.07),
    "ball": capsule([0.1, 0, 0], [0.1, 0, 0], 0.1),
    "rectangle": dilated_rectangle([0.1, 0, 0.2], [0.5, 0, 0], [0, 0.2, 0.3], 0.06),
    "narrow rectangle": dilated_rectangle([0, 0, 0], [0, 0, 0], [0, 0.6, 0], 0.03),
}


@pytest.mark.parametrize("first", SOLIDS)
@pytest.mark.parametrize("second", SOLIDS)
def test_apart_it_is_what_coal_says_of_the_cores_less_the_radii(first, second):
    a, b = SOLIDS[first], SOLIDS[second]
    query = Query(Shapes.build([("a", [a]), ("b", [b])]), [0], [1])
    R, x = poses(60, 2, 1.0)
    found = query.batch(R, x)
    theirs = coal_distance(as_mesh(a), as_mesh(b), R, x)
    apart = found.reach[:, 0] == Reach.EXACT
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
    for k in np.flatnonzero(found.reach[:, 0] == Reach.EXACT):
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


@pytest.mark.parametrize(
    ("y", "true"),
    [(0, 0.01), (0.01, 0.01), (0.02, 0), (0.03, -0.01), (0.045, -0.025), (0.049, -0.029), (0.1, -0.06)],
)
def test_a_hand_in_a_slot_is_where_it_is(y, true):
    """Hull distances say -170 mm at y = 0; Coal says -4 mm at 49 mm and +30 mm inside the wall."""
    shapes = Shapes.build(
        [("part", [Solid(mesh=SLOT)]), ("hand", [capsule([0, 0, -0.04], [0, 0, 0.04], 0.03)])]
    )
    found = Query(shapes, [0], [1]).minimum(np.tile(IDENTITY, (2, 1, 1)), [[0, 0, 0], [0, y, 0.08]])
    assert found.distance == pytest.approx(true, abs=1e-12)
    assert found.reach == (Reach.EXACT if y < 0.05 else Reach.DEPTH_AT_LEAST)
    assert np.linalg.norm(found.point_a - found.point_b) == pytest.approx(abs(true), abs=1e-12)


def test_between_the_legs_of_a_frame_is_outside():
    shapes = Shapes.build(
        [("frame", [Solid(mesh=boxes(*U_BOXES))]), ("hand", [capsule([0, 0, 0], [0, 0, 0.1], 0.02)])]
    )
    found = Query(shapes, [0], [1]).minimum(np.tile(IDENTITY, (2, 1, 1)), [[0, 0, 0], [0, 0, 0.05]])
    assert found.distance == pytest.approx(0.28, abs=1e-12)


def test_no_wrong_sign_in_a_hundred_thousand_poses():
    """A point in overlapping shells is inside exactly when it is in one of the boxes."""
    R, x = poses(100_000, 2, 0.0)
    x[:, 1] = np.random.default_rng(7).uniform(-0.5, 0.5, (len(R), 3))
    shapes = Shapes.build(
        [("frame", [Solid(mesh=boxes(*U_BOXES))]), ("tip", [capsule([0, 0, 0], [0, 0, 0], 0)])]
    )
    found = Query(shapes, [0], [1]).batch(R, x).distance[:, 0]
    local = np.einsum("nba,nb->na", R[:, 0], x[:, 1])
    inside = np.zeros(len(R), bool)
    for low, high in U_BOXES:
        inside |= ((local > low) & (local < high)).all(axis=1)
    assert 1000 < inside.sum() < len(R) / 2
    assert (np.signbit(found) == inside).all()


def segment_meets_box(a, b, low, high):
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.sort(np.stack([(low - a) / (b - a), (high - a) / (b - a)]), axis=0)
    return np.maximum(t[0].max(-1), 0) <= np.minimum(t[1].min(-1), 1)


def test_a_rod_overlaps_exactly_when_it_meets_the_solid():
    n = 20_000
    R, x = poses(n, 2, 0.0, 2)
    x[:, 1] = np.random.default_rng(8).uniform(-0.5, 0.5, (n, 3))
    ends = np.array([[-0.06, 0, 0], [0.06, 0, 0]])
    shapes = Shapes.build([("frame", [Solid(mesh=boxes(*U_BOXES))]), ("rod", [capsule(*ends, 0)])])
    found = Query(shapes, [0], [1]).batch(R, x).distance[:, 0]
    world = np.einsum("nab,kb->nka", R[:, 1], ends) + x[:, 1, None]
    local = np.einsum("nba,nkb->nka", R[:, 0], world)
    meets = np.zeros(n, bool)
    for low, high in U_BOXES:
        meets |= segment_meets_box(local[:, 0], local[:, 1], np.array(low), np.array(high))
    assert meets.sum() > 500
    assert ((found <= 0) == meets).all()


def test_two_meshes_overlap_exactly_when_their_boxes_do():
    """Whole inside, crossing, in the mouth of the U: separating axes of each pair of boxes decide."""
    n = 10_000
    half = np.array([0.03, 0.02, 0.01])
    R, x = poses(n, 2, 0.0, 3)
    x[:, 1] = np.random.default_rng(9).uniform(-0.5, 0.5, (n, 3))
    shapes = Shapes.build(
        [("frame", [Solid(mesh=boxes(*U_BOXES))]), ("nut", [Solid(mesh=boxes((-half, half)))])]
    )
    found = Query(shapes, [0], [1]).batch(R, x)
    turn = np.einsum("nba,nbc->nac", R[:, 0], R[:, 1])
    at = np.einsum("nba,nb->na", R[:, 0], x[:, 1])
    overlap, whole = np.zeros(n, bool), np.zeros(n, bool)
    for low, high in np.array(U_BOXES):
        g = at - (low + high) / 2
        axes = [np.tile(e, (n, 1)) for e in IDENTITY] + list(np.moveaxis(turn, 2, 0))
        axes += [np.cross(axes[i], axes[3 + j]) for i in range(3) for j in range(3)]
        apart = np.zeros(n, bool)
        for axis in axes:
            reach = abs(axis) @ ((high - low) / 2) + abs(np.einsum("na,nab->nb", axis, turn)) @ half
            apart |= abs((axis * g).sum(1)) > reach
        overlap |= ~apart
        whole |= (abs(g) + abs(turn) @ half < (high - low) / 2).all(1)
    assert whole.sum() > 50
    assert ((found.distance[:, 0] <= 0) == overlap).all()
    assert (found.reach[overlap, 0] == Reach.DEPTH_AT_LEAST).all()
    swapped = Query(shapes, [1], [0]).batch(R, x)
    assert (swapped.distance == found.distance).all()


def test_a_body_wholly_inside_a_machine_is_as_deep_as_the_nearest_wall():
    machine = boxes(((-1, -1, -1), (1, 1, 1)))
    inner = Solid(mesh=bumpy_ball(1, 0.1))
    solids = [[Solid(mesh=machine)], [capsule([0, 0, 0], [0, 0, 0.2], 0.05)], [inner], [SOLIDS["rectangle"]]]
    shapes = Shapes.build([(f"body {i}", s) for i, s in enumerate(solids)])
    x = np.array([[0, 0, 0], [0.6, 0, 0], [0, -0.5, 0], [-0.4, 0, 0]])
    found = Query(shapes, [0], [1, 2, 3]).per_body(np.tile(IDENTITY, (4, 1, 1)), x)
    reach = 0.5 + abs(inner.mesh.vertices[:, 1].min())
    np.testing.assert_allclose(found.distance, [-0.4 - 0.05, -(1 - reach), -0.5 - 0.06], atol=1e-12)
    assert (found.reach == Reach.DEPTH_AT_LEAST).all()
    span = np.linalg.norm(found.point_a - found.point_b, axis=1)
    np.testing.assert_allclose(span, -found.distance, atol=1e-12)


def test_a_shell_apart_from_its_mesh_is_found_inside():
    """Two screws as one mesh, the one named last inside the machine."""
    screws = boxes(((4, 4, 4), (4.1, 4.1, 4.1)), ((0, 0, 0), (0.1, 0.1, 0.1)))
    shapes = Shapes.build(
        [("machine", [Solid(mesh=boxes(((-1, -1, -1), (1, 1, 1))))]), ("screws", [Solid(mesh=screws)])]
    )
    found = Query(shapes, [0], [1]).minimum(np.tile(IDENTITY, (2, 1, 1)), np.zeros((2, 3)))
    assert found.distance <= -0.9 + 1e-12


@pytest.fixture(scope="module")
def crowd() -> Shapes:
    """Two robots' worth of meshes, one of them open, and a few parts of a person."""
    open_ball = bumpy_ball(12, 0.5)
    open_ball = Mesh(open_ball.vertices, open_ball.faces[: len(open_ball.faces) * 2 // 3])
    return Shapes.build(
        [
            ("link 0", [Solid(mesh=bumpy_ball(10, 0.4))]),
            ("link 1", [Solid(mesh=bumpy_ball(11, 0.3)), Solid(mesh=boxes(*U_BOXES), radius=0.01)]),
            ("link 2", [Solid(mesh=open_ball)]),
            ("hand", [SOLIDS["capsule"], SOLIDS["ball"]]),
            ("chest", [SOLIDS["rectangle"]]),
            ("ghost", []),
            ("tool", [Solid(mesh=bumpy_ball(13, 0.2, 1))]),
        ]
    )


SETS = (0, 1, 2), (3, 4, 6)


def fields(found):
    return [found.distance, found.point_a, found.point_b, found.body_a, found.body_b, found.reach]


@pytest.mark.parametrize("cap", [np.inf, 0.3])
def test_the_answer_is_a_function_of_the_poses_alone(crowd, cap):
    """Fresh, in order, shuffled, in one call or after other questions: the same bits."""
    R, x = walk(150, 7, 0.6)
    once = Query(crowd, *SETS, cap=cap)
    in_order = [once.per_body(R[k], x[k]) for k in range(len(R))]
    batch = Query(crowd, *SETS, cap=cap).batch(R, x, Per.BODY)
    mixed = Query(crowd, *SETS, cap=cap)
    for k in np.random.default_rng(4).permutation(len(R)):
        mixed.minimum(R[k], x[k])
        if k % 3 == 0:
            mixed.per_pair(R[k], x[k])
        fresh = Query(crowd, *SETS, cap=cap).per_body(R[k], x[k])
        answers = [in_order[k], mixed.per_body(R[k], x[k]), fresh]
        for answer in answers:
            for one, other in zip(fields(answer), fields(batch), strict=True):
                np.testing.assert_array_equal(one, other[k])


def test_the_least_of_all_is_the_least_of_each(crowd):
    R, x = walk(200, 7, 0.6, 1)
    query = Query(crowd, *SETS)
    pairs = query.batch(R, x, Per.PAIR)
    by_body = query.batch(R, x, Per.BODY)
    least = query.batch(R, x)
    assert (pairs.distance.reshape(-1, 3, 3).min(1) == by_body.distance).all()
    assert (by_body.distance.min(1) == least.distance[:, 0]).all()
    assert (pairs.reach == Reach.DEPTH_AT_LEAST).any()
    assert (pairs.body_a == np.repeat(SETS[0], 3)).all()
    assert (pairs.body_b == np.tile(SETS[1], 3)).all()


def test_a_cap_changes_nothing_below_it(crowd):
    R, x = walk(200, 7, 1.5, 2)
    free = Query(crowd, *SETS).batch(R, x, Per.BODY)
    capped = Query(crowd, *SETS, cap=0.2).batch(R, x, Per.BODY)
    near = free.distance < 0.2
    assert 50 < near.sum() < near.size - 50
    for one, other in zip(fields(free), fields(capped), strict=True):
        np.testing.assert_array_equal(one[near], other[near])
    assert (capped.distance[~near] == 0.2).all()
    assert (capped.reach[~near] == Reach.BEYOND_CAP).all()
    assert (capped.body_a[~near] == -1).all()
    assert np.isnan(capped.point_a[~near]).all()


def test_swapping_the_sets_swaps_the_points(crowd):
    R, x = walk(100, 7, 0.6, 3)
    one = Query(crowd, *SETS).batch(R, x)
    other = Query(crowd, *SETS[::-1]).batch(R, x)
    assert (one.distance == other.distance).all()
    single = one.reach[:, 0] == Reach.EXACT
    np.testing.assert_array_equal(one.point_a[single], other.point_b[single])
    np.testing.assert_array_equal(one.body_a[single], other.body_b[single])


def test_a_common_motion_changes_nothing(crowd):
    R, x = walk(100, 7, 0.6, 4)
    turn, shift = Rotation.random(rng=5).as_matrix(), np.array([3.0, -2.0, 1.0])
    one = Query(crowd, *SETS).batch(R, x, Per.PAIR)
    moved = Query(crowd, *SETS).batch(turn @ R, x @ turn.T + shift, Per.PAIR)
    np.testing.assert_allclose(moved.distance, one.distance, atol=1e-12)
    exact = one.reach == Reach.EXACT
    away = exact & (abs(one.distance) > 1e-6)
    close = abs(one.point_a @ turn.T + shift - moved.point_a).max(-1)[away]
    assert (close < 1e-9).mean() > 0.99  # The rest: two equally near points.


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
    apart = found.reach[:, 0] == Reach.EXACT
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


def test_sets_that_cannot_be_are_told_apart(crowd):
    for a, b, words in [
        ([], [1], "an empty set"),
        ([0], [5], "none of ghost has a shape"),
        ([0], [99], "no body has index 99"),
        ([0, 1], [1], "'link 1' is in both sets"),
    ]:
        with pytest.raises(InputError, match=words):
            Query(crowd, a, b)
    with pytest.raises(InputError, match="nan is not a distance"):
        Query(crowd, [0], [1], cap=np.nan)
    with pytest.raises(UnknownName, match="did you mean 'link 1'"):
        crowd.index("link1")
    assert crowd.index("hand") == 3


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


def test_a_pose_that_is_not_finite_is_refused_and_forgotten(crowd):
    R, x = walk(3, 7, 0.6, 5)
    query = Query(crowd, *SETS)
    query.minimum(R[0], x[0])
    broken = x[1].copy()
    broken[4, 2] = np.nan
    with pytest.raises(SimulationDiverged, match="'chest'"):
        query.minimum(R[1], broken)
    assert query.minimum(R[2], x[2]).distance == Query(crowd, *SETS).minimum(R[2], x[2]).distance
    with pytest.raises(ValueError, match="poses of 7 bodies"):
        query.minimum(R[0, :6], x[0, :6])
