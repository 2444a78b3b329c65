"""Hulls, graphs, grids, splines and angles that the wheel computes without SciPy, against SciPy."""

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline, PchipInterpolator
from scipy.ndimage import distance_transform_edt, label
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull, cKDTree
from scipy.spatial.transform import Rotation

from seerob.core.transforms import angles_from_rotation
from seerob.description.humans.keyframes import interpolated
from seerob.description.shapes import mass_properties
from seerob.description.shapes.detail import _lost
from seerob.description.shapes.hull import convex_hull, hull_volume
from seerob.description.shapes.mesh_bodies import components
from seerob.description.shapes.mesh_mending import near_pairs
from seerob.distance.voxels import dilated

rng = np.random.default_rng(5)
TURN = Rotation.from_rotvec([0.4, -1.1, 0.7]).as_matrix()
ANGLES = np.linspace(0, 2 * np.pi, 60, endpoint=False)
RINGS = np.array([[np.cos(a), np.sin(a), z] for z in np.linspace(0, 1, 4) for a in ANGLES])
GRID = np.stack(np.meshgrid(*[np.arange(5.0)] * 3), -1).reshape(-1, 3)
BALL = rng.normal(size=(300, 3)) / np.linalg.norm(rng.normal(size=(300, 3)), axis=1)[:, None]
CLOUDS = {
    "cloud": rng.normal(size=(400, 3)),
    "ball": BALL / np.linalg.norm(BALL, axis=1)[:, None],
    "grid": GRID,
    "turned grid": 0.1 * GRID @ TURN + 3,
    "far grid": 0.01 * GRID @ TURN + 300,
    "cylinder": RINGS,
    "turned cylinder": RINGS @ TURN + [1, 2, 3],
    "cylinder in single precision": (RINGS @ TURN).astype(np.float32).astype(float),
    "zonotope": np.array([[(k >> i) & 1 for i in range(7)] for k in range(128)]) @ rng.normal(size=(7, 3)),
    "each point five times": np.repeat(rng.normal(size=(40, 3)), 5, axis=0),
    "tiny": 1e-9 * rng.normal(size=(60, 3)),
    "thin": rng.normal(size=(100, 3)) * [1, 1, 1e-9],
}


@pytest.mark.parametrize("name", CLOUDS)
def test_a_hull_is_closed_holds_every_point_and_is_that_of_qhull(name):
    points = CLOUDS[name]
    faces, peer = convex_hull(points), ConvexHull(points)
    edges = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    forth = {tuple(e) for e in edges.tolist()}
    assert len(forth) == len(edges) == 3 * len(faces)
    assert forth == {(b, a) for a, b in forth}
    assert len(faces) == 2 * len(np.unique(faces)) - 4  # Euler: of one piece, without a hole
    size = np.abs(points).max()
    assert hull_volume(points) == pytest.approx(peer.volume, rel=1e-11, abs=1e-12 * size**3)
    # Every corner that Qhull finds is one, and those beside are in its facets' planes but for rounding.
    corners = {tuple(p) for p in points[np.unique(faces)].tolist()}
    assert {tuple(p) for p in points[peer.vertices].tolist()} <= corners
    over = np.array(list(corners)) @ peer.equations[:, :3].T + peer.equations[:, 3]
    assert over.max() <= 1e-12 * size
    assert np.abs(over.max(axis=1)).max() <= 1e-12 * size


@pytest.mark.parametrize(
    "points",
    [
        np.zeros((0, 3)),
        np.zeros((9, 3)),
        rng.normal(size=(3, 3)),
        np.outer(rng.normal(size=9), [1, 2, 3]),
        rng.normal(size=(50, 2)) @ rng.normal(size=(2, 3)) + 7,
        np.vstack([rng.normal(size=(9, 3)), [np.nan, 0, 0]]),
    ],
)
def test_what_is_flat_has_no_hull(points):
    assert convex_hull(points) is None
    assert hull_volume(points) == 0.0


def test_a_hull_is_that_of_qhull_over_any_cloud_of_small_whole_numbers():
    for _ in range(60):
        points = rng.integers(-2, 3, (rng.integers(4, 30), 3)).astype(float)
        faces = convex_hull(points)
        if faces is None:
            assert np.linalg.matrix_rank(points[1:] - points[0]) < 3
        else:
            assert hull_volume(points) == pytest.approx(ConvexHull(points).volume, rel=1e-12)


def test_components_are_numbered_as_they_come():
    for _ in range(30):
        n, k = rng.integers(1, 200), rng.integers(0, 200)
        pairs = rng.integers(0, n, (k, 2))
        graph = coo_array((np.ones(k), (pairs[:, 0], pairs[:, 1])), shape=(n, n))
        count, labels = connected_components(graph, directed=False)
        found, own = components(int(n), pairs)
        assert found == count
        np.testing.assert_array_equal(own, labels)


@pytest.mark.parametrize("distance", [1e-6, 0.03, 0.2])
def test_pairs_within_a_distance_are_all_found(distance):
    points = np.vstack([rng.uniform(-1, 1, (400, 3)), rng.uniform(-1, 1, (30, 3)).repeat(2, axis=0)])
    points[400::2] += 0.9 * distance * np.array([0.6, 0, 0.8])
    peer = cKDTree(points).query_pairs(distance, output_type="ndarray")
    own = np.sort(near_pairs(points, distance), axis=1)
    assert {tuple(p) for p in own.tolist()} == {tuple(p) for p in peer.tolist()}
    assert len(own) == len(peer)


def test_what_a_simplified_mesh_lost_is_as_far_as_the_nearest_corner_that_remains():
    vertices = rng.uniform(-1, 1, (60, 3))
    faces = np.vstack([rng.permutation(40)[:39].reshape(-1, 3), [[k, k + 1, k] for k in range(40, 59, 2)]])
    ends = vertices[40:60].reshape(-1, 2, 3)
    away = cKDTree(vertices[np.unique(faces[:13])]).query(ends.reshape(-1, 3))[0].reshape(-1, 2).max(axis=1)
    expected = (away + np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1) / 2).max()
    assert _lost(vertices, faces) == pytest.approx(expected, rel=1e-12)


def test_what_is_around_a_body_is_the_region_of_the_first_cell():
    for share in (0.1, 0.4, 0.6):
        free = rng.uniform(size=(12, 9, 14)) > share
        free[0, 0, 0] = True
        regions, _ = label(free)
        np.testing.assert_array_equal(mass_properties._around(free), regions == regions[0, 0, 0])


@pytest.mark.parametrize("radius", [0.0, 0.99, 1.0, np.sqrt(3), 2.5, 7.2, 40.0])
def test_cells_are_dilated_by_a_ball(radius):
    for marked in (0, 1, 6):
        cells = np.zeros((17, 11, 23), np.uint8)
        cells.ravel()[rng.choice(cells.size, marked, replace=False)] = 3
        expected = distance_transform_edt(cells == 0) <= radius if marked else np.zeros(cells.shape, bool)
        np.testing.assert_array_equal(dilated(cells, radius), expected)


def test_keys_are_interpolated_as_by_pchip():
    for count in (2, 3, 9):
        t = np.cumsum(rng.uniform(0.1, 1, count))
        q = np.round(rng.normal(size=(count, 6)), 1)
        q[1:, 0] = q[:-1, 0]  # a joint that rests
        slopes = PchipInterpolator(t, q, axis=0).derivative()(t)
        slopes[[0, -1]] = 0.0
        spline = CubicHermiteSpline(t, q, slopes, axis=0)
        at = np.sort(np.append(rng.uniform(t[0], t[-1], 200), t))
        values, speeds = interpolated(t, q, at)
        np.testing.assert_allclose(values, spline(at), rtol=0, atol=1e-14)
        np.testing.assert_allclose(speeds, spline(at, 1), rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize("order", ["ZYX", "ZXY", "YXZ", "XYZ", "XZY", "YZX"])
def test_angles_are_those_of_the_rotation_also_where_two_axes_fall_together(order):
    free = rng.uniform(-np.pi, np.pi, (300, 3)) * [1, 0.49, 1]
    locked = rng.uniform(-np.pi, np.pi, (40, 3))
    locked[:, 1] = np.where(np.arange(40) % 2, np.pi / 2, -np.pi / 2)
    turns = Rotation.from_euler(order, free).as_matrix()
    np.testing.assert_allclose(angles_from_rotation(order, turns), free, atol=1e-10)
    turns = Rotation.from_euler(order, locked).as_matrix()
    found = angles_from_rotation(order, turns)
    np.testing.assert_allclose(Rotation.from_euler(order, found).as_matrix(), turns, atol=1e-10)
