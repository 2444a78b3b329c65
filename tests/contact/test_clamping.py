"""Gaps that clamp: their rule, live and batch, and on moving shapes."""

from __future__ import annotations

import numpy as np
import trimesh

from made_cell import UR10, made
from seerob.core.shapes import Mesh, Solid, capsule
from seerob.criteria.contact.clamping import STILL, clamps, pinch_pairs, robot_pinch_pairs, thickest
from seerob.distance.least import Shapes

HAND, BODY = 0.1, 0.5
THICKNESS = np.array([[HAND, BODY]])


def one(gaps: np.ndarray, *, speed: float = 0.1) -> np.ndarray:
    column = gaps[:, None]
    return clamps(column, np.full_like(column, speed), THICKNESS)[:, 0]


def test_gap_no_wider_than_the_body_part_clamps_it_whether_it_closes_or_opens() -> None:
    gaps = np.array([0.6, 0.5, 0.3, 0.1, 0.05, 0.05, 0.0, -0.02, 0.1, 0.11])
    found = one(gaps)
    np.testing.assert_array_equal(found[:, 0], gaps <= HAND)
    np.testing.assert_array_equal(found[:, 1], gaps <= BODY)


def test_what_stands_still_clamps_nobody() -> None:
    """Rounding alone; whatever is slower than any noise is no licence."""
    for speed, found in ((0.95e-3, True), (1.05e-6, True), (STILL, False), (0.95e-6, False)):
        assert one(np.full(3, 0.05), speed=speed).any() == found


def test_between_own_parts_a_body_part_counts_as_thick_as_what_fits() -> None:
    """Of a hand, 4 to 100 mm, and a body, 180 to 500 mm; nothing is clamped before it could close."""
    fits, thickness, sizes = np.array([0.004, 0.18]), THICKNESS[0], (0.025, 0.05, 0.1, 0.18, 0.3, 0.5)
    widest = np.array([0.0, 0.02, 0.03, 0.085, 0.3, 0.9, np.inf])
    found = thickest(widest, fits, thickness, sizes, least=0.004)
    np.testing.assert_allclose(found[:, 0], [-np.inf, -np.inf, 0.025, 0.05, 0.1, 0.1, 0.1])
    np.testing.assert_allclose(found[:, 1], [-np.inf, -np.inf, -np.inf, -np.inf, 0.296, 0.5, 0.5])
    # Wider open never lets less in.
    rising = thickest(np.linspace(0, 1, 200), fits, thickness, sizes, least=0.004)
    assert (np.diff(np.nan_to_num(rising, neginf=-1), axis=0) >= 0).all()


def slotted() -> Mesh:
    """A block with a slot 0.2 m wide along y, open on top: its convex hull has none."""
    walls = [trimesh.creation.box([0.1, 1, 0.4]) for _ in range(2)]
    walls[0].apply_translation([-0.15, 0, 0])
    walls[1].apply_translation([0.15, 0, 0])
    floor = trimesh.creation.box([0.4, 1, 0.1])
    floor.apply_translation([0, 0, -0.25])
    made = trimesh.util.concatenate([*walls, floor])
    return Mesh(np.array(made.vertices), np.array(made.faces, np.int32))


def test_gap_in_a_slot_is_found_where_a_hull_has_none() -> None:
    rod = Solid(points=np.array([[0, 0, 0], [0, 0, 0.5]]), radius=0.02)
    shapes = Shapes.build([("block", [Solid(mesh=slotted())]), ("rod", [rod])])
    pairs = pinch_pairs(shapes, [1], [0], frozenset(), cap=0.6)
    x = np.linspace(0.0, 0.06, 7)
    positions = np.zeros((7, 2, 3))
    positions[:, 1, 0] = x
    rotations = np.broadcast_to(np.eye(3), (7, 2, 3, 3))
    gaps = pairs.batch(rotations, positions)
    np.testing.assert_allclose(gaps[:, 0], 0.1 - 0.02 - x, atol=1e-12)
    live = [pairs.gaps(r, p)[0] for r, p in zip(rotations, positions, strict=True)]
    np.testing.assert_array_equal(live, gaps)
    assert pairs.gaps(rotations[0], positions[0])[1].tolist() == [0]
    found = clamps(gaps, np.full_like(gaps, 1.0), np.array([[0.05]]))
    np.testing.assert_array_equal(found[:, 0, 0], gaps[:, 0] <= 0.05)


def test_own_links_are_paired_except_those_left_out_and_both_sides_clamp() -> None:
    bodies = [(n, [capsule(np.zeros(3), np.array([0.0, 0, 0.1]), 0.02)]) for n in "abcd"]
    neighbours = frozenset({(0, 1), (1, 2)})
    pairs = pinch_pairs(Shapes.build(bodies), [0, 1, 2], [], neighbours, still=[3], cap=1.0)
    assert sorted(zip(pairs.first.tolist(), pairs.second.tolist(), strict=True)) == [
        (0, -1), (0, 2), (1, -1), (2, -1),
    ]  # fmt: skip
    assert pairs.inner.all()
    clamped = ((pairs.first == 0) & (pairs.second == 2))[:, None]
    assert pairs.per_body(clamped)[:, 0].tolist() == [True, False, True]


def test_other_things_are_on_the_far_side_of_a_gap_and_flags_are_those_of_each_moving_body() -> None:
    bodies = [(n, [capsule(np.zeros(3), np.array([0.0, 0, 0.1]), 0.02)]) for n in "abcd"]
    pairs = pinch_pairs(Shapes.build(bodies), [1, 2, 3], [0], frozenset(), cap=1.0)
    assert pairs.first.tolist() == [0, 1, 2, 0, 0, 1]
    assert pairs.second.tolist() == [-1, -1, -1, 1, 2, 2]
    assert pairs.across.tolist() == [-1, -1, -1, 2, 3, 3]
    flags = np.random.default_rng(0).random((5, 6, 2)) < 0.3
    expected = np.zeros((5, 3, 2), bool)
    for n, gap, part in np.argwhere(flags):
        for body in {pairs.first[gap], pairs.second[gap]} - {-1}:
            expected[n, body, part] = True
    np.testing.assert_array_equal(pairs.per_body(flags), expected)


def test_own_links_of_a_robot_are_paired_by_the_joints_between_them(tmp_path) -> None:
    """A tool is one with the last link; the parts around count as surfaces, areas and people do not."""
    text = UR10 + '[[parts]]\nname = "wall"\nshape = { box = [0.1, 1, 1] }\nat = { position = [2, 0, 0] }\n'
    text += '[[areas]]\nname = "zone"\nshape = { sphere = 0.5 }\n'
    model = made(tmp_path, text).model
    robot = model.robot("arm")
    pairs, widest, placed = robot_pinch_pairs(model, robot, cap=0.6, thinnest=0.1)
    own = [
        {model.bodies[query.a[i]].name, model.bodies[query.b[0]].name}
        for query, _ in pairs.queries[1:]
        for i in range(len(query.a))
    ]
    chain = ["base", "shoulder", "upper_arm", "forearm", "wrist_1", "wrist_2", "wrist_3", "load"]

    def link(name):
        return next(k for k, word in enumerate(chain) if word in name)

    solid = [b.name for b in model.bodies if b.index in (*robot.bodies, *robot.carried)]
    # The load is welded to the last link.
    place = {name: min(link(name), 6) for name in solid}
    expected = [{a, b} for a in solid for b in solid if a < b and abs(place[a] - place[b]) > 1]
    moving = {model.bodies[i].name for i in pairs.moving}
    assert sorted(map(sorted, own)) == sorted(sorted(p) for p in expected if p & moving)
    one = [{a, b} for a in solid for b in solid if a < b and abs(place[a] - place[b]) == 1]
    found = [sorted((model.bodies[i].name, model.bodies[j].name)) for i, j, _ in placed]
    assert sorted(found) == sorted(sorted(p) for p in one)
    # A hand is thicker than what is between these wherever their two joints stand: near, they clamp.
    near = {
        tuple(sorted((place[model.bodies[pairs.moving[row]].name], place[model.bodies[other].name])))
        for row, other, inner, room in zip(pairs.first, pairs.across, pairs.inner, widest, strict=True)
        if inner and np.isinf(room)
    }
    assert near == {(0, 2), (3, 5), (3, 6), (4, 6)}
    assert len(widest) == len(pairs.first)
    assert np.isinf(widest[~pairs.inner]).all()
    assert ((widest[pairs.inner] <= 0.6) | np.isinf(widest[pairs.inner])).all()
    (surfaces, _), *_ = pairs.queries
    assert [model.bodies[i].name for i in surfaces.a] == ["wall"]
