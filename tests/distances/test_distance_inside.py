"""The sign: inside, outside and across, against solids whose inside is known."""

import numpy as np
import pytest

from concave import IDENTITY, SLOT, SOLIDS, U_BOXES, boxes, bumpy_ball, poses
from seerob.core.shapes import Solid, capsule
from seerob.distance.least import DistanceKind, Query, Shapes


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
    assert found.kind == (DistanceKind.EXACT if y < 0.05 else DistanceKind.DEPTH_AT_LEAST)
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
    assert (found.kind[overlap, 0] == DistanceKind.DEPTH_AT_LEAST).all()
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
    assert (found.kind == DistanceKind.DEPTH_AT_LEAST).all()
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
