"""Gaps that close: their rule, live and batch, and on moving shapes."""

from __future__ import annotations

import numpy as np
import trimesh

from made_cell import UR10, made
from seerob.clamping import clamps, pinch_pairs, robot_pinch_pairs
from seerob.distance import Shapes
from seerob.geometry import Mesh, Solid, capsule

T = np.arange(11) * 0.1
HAND, BODY = 0.1, 0.5
THICKNESS = np.array([HAND, BODY])


def one(gaps: np.ndarray, *, opened: bool = True) -> np.ndarray:
    return clamps(gaps[:, None], T[: len(gaps)], THICKNESS, opened=np.array([opened]))[:, 0]


def test_closing_gap_clamps_from_the_body_parts_thickness_on() -> None:
    gaps = np.linspace(0.35, 0.05, 11)
    found = one(gaps)
    # One step of 0.03 m ahead of 0.1 m.
    np.testing.assert_array_equal(found[1:, 0], gaps[1:] - 0.03 <= HAND + 1e-12)
    assert found[:, 1].all()


def test_wide_opening_and_still_gaps_clamp_nobody() -> None:
    assert not one(np.linspace(0.9, 0.6, 11))[:, 1].any()
    assert not one(np.linspace(0.05, 0.3, 11))[1:].any()
    assert not one(np.full(11, 0.05))[1:].any()
    assert not one(np.linspace(0.05, 0.05 - 0.9e-3, 11))[1:].any()


def test_what_happened_before_the_first_instant_is_not_known() -> None:
    assert one(np.full(3, 0.05))[0].all()
    assert not one(np.full(3, -0.01))[0].any()


def test_parts_of_one_robot_clamp_only_what_once_had_room() -> None:
    gaps = np.array([0.08, 0.06, 0.04, 0.12, 0.08, 0.04])
    found = one(gaps, opened=False)
    assert not found[:3].any()
    assert found[4:, 0].all()
    assert not found[:, 1].any()


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
    found = clamps(gaps, np.arange(7) * 0.1, np.array([0.05]), opened=pairs.opened)
    np.testing.assert_array_equal(found[1:, 0, 0], gaps[1:, 0] - 0.01 <= 0.05 + 1e-12)


def test_own_links_are_paired_except_neighbours_and_both_sides_clamp() -> None:
    bodies = [(n, [capsule(np.zeros(3), np.array([0.0, 0, 0.1]), 0.02)]) for n in "abcd"]
    neighbours = frozenset({(0, 1), (1, 2)})
    pairs = pinch_pairs(Shapes.build(bodies), [0, 1, 2], [], neighbours, still=[3], cap=1.0)
    assert sorted(zip(pairs.first.tolist(), pairs.second.tolist(), strict=True)) == [
        (0, -1), (0, 2), (1, -1), (2, -1),
    ]  # fmt: skip
    assert not pairs.opened.any()
    clamped = ((pairs.first == 0) & (pairs.second == 2))[:, None]
    assert pairs.per_body(clamped)[:, 0].tolist() == [True, False, True]


def test_what_closes_faster_than_1_mm_per_s_closes() -> None:
    for rate, found in ((1.05e-3, True), (0.95e-3, False)):
        assert one(0.05 - rate * T)[1:].any() == found


def test_what_was_wide_before_the_first_instant_counts() -> None:
    """And how fast it closes since then."""
    gaps, opened = np.array([[0.08, 0.08], [0.07, 0.07]]), np.zeros(2, bool)
    before = (-0.1, np.array([0.09, 0.09]), np.array([0.2, 0.09]))
    found = clamps(gaps, T[:2], THICKNESS, opened=opened, before=before)
    assert found[:, :, 0].tolist() == [[True, False], [True, False]]
    opening = clamps(gaps, T[:2], THICKNESS, opened=opened, before=(-0.1, gaps[0] - 0.01, before[2]))
    assert opening[:, 0, 0].tolist() == [False, True]


def test_the_rest_of_the_way_is_looked_at_before_it_is_gone() -> None:
    """From 0.19 m to 0.14 m in an instant: 0.09 m at the next one, less than a hand."""
    assert one(np.array([0.3, 0.19, 0.14, 0.08]))[:, 0].tolist() == [False, True, True, True]
    assert one(np.array([0.17, 0.14, 0.125]))[:, 0].tolist() == [False, False, False]


def test_other_things_are_on_the_far_side_of_a_gap_and_flags_are_those_of_each_moving_body() -> None:
    bodies = [(n, [capsule(np.zeros(3), np.array([0.0, 0, 0.1]), 0.02)]) for n in "abcd"]
    pairs = pinch_pairs(Shapes.build(bodies), [1, 2, 3], [0], frozenset(), cap=1.0)
    assert pairs.first.tolist() == [0, 1, 2, 0, 0, 1]
    assert pairs.second.tolist() == [-1, -1, -1, 1, 2, 2]
    assert pairs.opened.tolist() == [True] * 3 + [False] * 3
    flags = np.random.default_rng(0).random((5, 6, 2)) < 0.3
    expected = np.zeros((5, 3, 2), bool)
    for n, gap, part in np.argwhere(flags):
        for body in {pairs.first[gap], pairs.second[gap]} - {-1}:
            expected[n, body, part] = True
    np.testing.assert_array_equal(pairs.per_body(flags), expected)


def test_own_links_of_a_robot_that_no_joint_connects_are_paired(tmp_path) -> None:
    """A tool is one with the last link; the parts around count as surfaces, areas and people do not."""
    text = UR10 + '[[parts]]\nname = "wall"\nshape = { box = [0.1, 1, 1] }\nat = { position = [2, 0, 0] }\n'
    text += '[[areas]]\nname = "zone"\nshape = { sphere = 0.5 }\n'
    model = made(tmp_path, text).model
    robot = model.robot("arm")
    pairs = robot_pinch_pairs(model, robot, cap=0.6)
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
    (surfaces, _), *_ = pairs.queries
    assert [model.bodies[i].name for i in surfaces.a] == ["wall"]
