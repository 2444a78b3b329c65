"""Gaps that clamp: their rule, live and batch, and on moving shapes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from made_cell import FLOATING, UR10, made, person, state_at, two_r
from seerob.core.shapes import Mesh, Solid, capsule
from seerob.criteria.contact.clamped_regions import Clamping
from seerob.criteria.contact.clamping import (
    MISSED,
    STILL,
    RelativeJoints,
    clamps,
    distances_from,
    getting_in,
    pinch_pairs,
    robot_pinch_pairs,
)
from seerob.distance.least import Shapes
from seerob.model.model import Model

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


def test_between_own_parts_a_body_part_clamps_where_its_thinnest_gets_in() -> None:
    """Of a hand, 4 to 100 mm, and a body, 180 to 500 mm."""
    found = getting_in(np.array([0.0, 0.02, 0.15, 0.18, np.inf]), np.array([0.004, 0.18]), THICKNESS[0])
    np.testing.assert_array_equal(found[:, 0], [-np.inf, 0.1, 0.1, 0.1, 0.1])
    np.testing.assert_array_equal(found[:, 1], [-np.inf, -np.inf, -np.inf, 0.5, 0.5])


def double_elbow() -> str:
    """Two beams of 1 m with a joint each at the ends of a link between them, 0.25 m long, without a shape."""
    links, joints = ['<link name="base"/>'], []
    for k, (length, x) in enumerate(((1.0, 0.0), (0.25, 1.0), (1.0, 0.25))):
        box = f'<origin xyz="{length / 2} 0 0"/><geometry><box size="1 0.05 0.05"/></geometry>'
        links.append(
            f'<link name="l{k}"><inertial><mass value="2"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" '
            f'iyz="0"/></inertial>{"" if k == 1 else f"<collision>{box}</collision>"}</link>'
        )
        joints.append(
            f'<joint name="j{k}" type="revolute"><parent link="{f"l{k - 1}" if k else "base"}"/>'
            f'<child link="l{k}"/><origin xyz="{x} 0 0"/><axis xyz="0 0 1"/>'
            '<limit lower="-2" upper="2" effort="99" velocity="9"/></joint>'
        )
    return f'<robot name="d">{"".join(links + joints)}</robot>'


def test_two_beams_that_fold_on_a_body_clamp_it_however_near_they_are_at_their_double_elbow(
    tmp_path,
) -> None:
    """There they are 0.2 to 0.25 m apart, less than a body is thick, wherever their joints stand."""
    text = '[[robots]]\nname = "arm"\nmodel = "arm.urdf"\n'
    station = made(tmp_path, FLOATING + text, {"arm.urdf": double_elbow()})
    robot = station.model.robot("arm")
    bound = Clamping(station.model, robot, {}, ("Hands and fingers", "Chest"), None)
    ends = np.column_stack([np.linspace(0.1, 1, 40), np.full(40, 0.0254), np.zeros(40)])
    seen = 0
    for q in np.linspace(0.3, 1.57, 8):
        state = state_at(station, arm=([0.0, q, q], [0.0, 0.3, 0.3]))
        flags, *_ = bound.at(state, np.ones((len(robot.moving), 2), bool))
        first, last = (
            next(i for i in robot.moving if station.model.bodies[i].name == n) for n in ("arm/l0", "arm/l2")
        )
        R, x = state.rotations, state.positions
        # Places on the last beam above the first one, seen from it, and how fast they come down.
        seen_from = ((ends @ R[last].T + x[last]) - x[first]) @ R[first]
        gap = seen_from[:, 1] - 0.025
        narrow = (gap > 0.2) & (gap < 0.49) & (seen_from[:, 0] > 0) & (seen_from[:, 0] < 1)
        if narrow.any():
            seen += 1
            assert flags[list(robot.moving).index(last), 1], q
    assert seen >= 2


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
    pairs, opens, placed = robot_pinch_pairs(model, robot, cap=0.6, enough=0.18)
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
    # Wherever two links are, a body gets between somewhere; a wrist lets in no more than some of it.
    assert len(opens) == len(pairs.first)
    assert np.isinf(opens[~pairs.inner]).all()
    assert (opens[pairs.inner] >= 0.18).all()
    assert np.isfinite(opens[pairs.inner]).all()
    (surfaces, _), *_ = pairs.queries
    assert [model.bodies[i].name for i in surfaces.a] == ["wall"]


def test_what_is_not_a_number_clamps() -> None:
    assert clamps(np.array([np.nan, 0.3]), np.array([0.1, np.nan]), np.full((2, 1), 0.5)).all()
    assert not clamps(np.array([np.nan, 0.3]), np.zeros(2), np.full((2, 1), 0.5)).any()


def test_parts_may_open_a_tenth_wider_than_they_were_found_in_any_position() -> None:
    least = 0.18 / (1 + MISSED)
    found = getting_in(np.array([least - 1e-9, least + 1e-9]), np.array([0.18]), np.array([0.5]))
    np.testing.assert_array_equal(found[:, 0], [-np.inf, 0.5])


def test_the_fastest_gap_that_clamps_counts_for_both_of_its_sides_but_not_those_to_what_stands() -> None:
    bodies = [(n, [capsule(np.zeros(3), np.array([0.0, 0, 0.1]), 0.02)]) for n in "abcd"]
    # Gaps of b and c to the floor a, of both to d, which moves, and between them.
    pairs = pinch_pairs(Shapes.build(bodies), [1, 2], [0], frozenset(), others=[3], cap=1.0)
    assert pairs.across.tolist() == [-1, -1, 3, 3, 2]
    assert pairs.second.tolist() == [-1, -1, -1, -1, 1]
    assert pairs.inner.tolist() == [False] * 4 + [True]
    speed = np.array([9.0, 9.0, 0.2, 0.3, 0.7])
    clamped = np.array([[1, 1], [1, 1], [1, 0], [1, 0], [0, 1]], bool)
    np.testing.assert_array_equal(pairs.fastest(clamped, speed), [[0.2, 0.7], [0.3, 0.7]])
    clamped[4, 0] = True
    np.testing.assert_array_equal(pairs.fastest(clamped, speed), [[0.7, 0.7], [0.7, 0.7]])
    # Of a body whose number is 0, too.
    pairs = pinch_pairs(Shapes.build(bodies), [1, 2], [], frozenset(), others=[0], cap=1.0)
    np.testing.assert_array_equal(pairs.fastest(np.ones((3, 1), bool), speed[:3]), [[9.0], [9.0]])
    assert pairs.per_body(np.array([[False, True], [False, False], [False, False]])).tolist() == [
        [False, True],
        [False, False],
    ]


FOLDED = ((-0.4, 1.2), (2.4, 3.0), (-0.2, 0.2))


DOOR = (
    '[[machines]]\nname = "door"\nshape = { box = [0.1, 0.1, 0.1] }\nat = { position = [0, 3, 0] }\n'
    "mass = 5\nslide = { along = [1, 0, 0], lower = 0, upper = 0.5 }\n"
)


def folded(folder: Path, more: str = "") -> Model:
    """Three links of 1 m × 0.1 m in a plane, the second always folded back; and who is around."""
    links, joints = (
        ['<link name="base"><collision><geometry><sphere radius="0.05"/></geometry></collision></link>'],
        [],
    )
    for k, (low, high) in enumerate(FOLDED):
        links.append(
            f'<link name="l{k}"><inertial><origin xyz="0.5 0 0"/><mass value="1"/><inertia ixx="1" iyy="1" '
            'izz="1" ixy="0" ixz="0" iyz="0"/></inertial><collision><origin xyz="0.5 0 0"/><geometry>'
            '<box size="1 0.1 0.1"/></geometry></collision></link>'
        )
        parent, x = ("base", 0) if k == 0 else (f"l{k - 1}", 1)
        joints.append(
            f'<joint name="j{k}" type="revolute"><parent link="{parent}"/><child link="l{k}"/>'
            f'<origin xyz="{x} 0 0"/><axis xyz="0 0 1"/>'
            f'<limit lower="{low}" upper="{high}" effort="100" velocity="2"/></joint>'
        )
    text = (
        f'{FLOATING}[[robots]]\nname = "arm"\nmodel = "arm.urdf"\n{person("op", 5, 0, 0)}'
        '[[parts]]\nname = "wall"\nshape = { box = [0.1, 1, 1] }\nat = { position = [4, 0, 0] }\n'
        '[[areas]]\nname = "zone"\nshape = { sphere = 0.5 }\n'
    )
    return made(
        folder, text + DOOR + more, {"arm.urdf": f'<robot name="r">{"".join(links + joints)}</robot>'}
    ).model


def gaps_of(model: Model, enough: float) -> tuple[dict[tuple[str, str], float], set[frozenset[str]]]:
    """How wide each gap opens anywhere, and which of its own parts are looked at by place."""
    pairs, opens, placed = robot_pinch_pairs(model, model.robot("arm"), cap=0.6, enough=enough)
    names = [body.name for body in model.bodies]
    gaps = [
        (names[pairs.moving[row]].split("/")[1], "around" if other < 0 else names[other])
        for row, other in zip(pairs.first.tolist(), pairs.across.tolist(), strict=True)
    ]
    assert len({*gaps}) == len(gaps)
    (around, _), *_ = pairs.queries
    assert [names[i] for i in around.a] == ["wall"]
    places = {frozenset((names[i].split("/")[1], names[j].split("/")[1])) for i, j, _ in placed}
    return dict(zip(gaps, opens.tolist(), strict=True)), places


def test_own_parts_open_as_wide_as_any_place_gets_from_the_other_part(tmp_path: Path) -> None:
    """By places all over a folded arm, in positions of its joints that nobody else looked at."""
    model = folded(tmp_path)
    found, places = gaps_of(model, 9.0)
    assert places == {frozenset(pair) for pair in (("base", "l0"), ("l0", "l1"), ("l1", "l2"))}
    around = {(f"l{k}", each) for k in range(3) for each in ("around", "door/body")}
    assert {*found} == around | {("l1", "arm/base"), ("l2", "arm/base"), ("l0", "arm/l2")}
    assert all(np.isinf(found[gap]) for gap in around)
    index, rng = {body.name: body.index for body in model.bodies}, np.random.default_rng(5)
    joints = RelativeJoints(model)
    R, x = joints.poses({("arm", k): rng.uniform(*ends, 40) for k, ends in enumerate(FOLDED)})
    for one, other in (("arm/l1", "arm/base"), ("arm/l0", "arm/l2")):
        i, j = index[one], index[other]
        far = 0.0
        for a, b in ((i, j), (j, i)):
            points = rng.uniform(
                model.bodies[a].corners.min(axis=0), model.bodies[a].corners.max(axis=0), (60, 3)
            )
            seen = np.einsum("nij,kj->nki", R[:, a], points) + (x[:, a] - x[:, b])[:, None]
            seen = np.einsum("nki,nij->nkj", seen, R[:, b]).reshape(-1, 3)
            far = max(far, float(distances_from(model.bodies[b].solids)(seen)[0].max()))
        opens = found[one.split("/")[1], other]
        assert far <= opens <= far + 0.75
        # Where that is enough, nobody looks for more.
        assert 0.5 <= gaps_of(model, 0.5)[0][one.split("/")[1], other] <= opens


HAND_OF = (
    '[[machines]]\nname = "{}"\non = "arm/l2"\nat = {{ position = [1.1, 0, 0] }}\n'
    "shape = {{ box = [0.02, 0.02, 0.02] }}\nmass = 0.2\ngrip = {{ {} }}\n"
)


@pytest.mark.parametrize(
    ("ends", "endless"), [("lower = 0, upper = 0.05", False), ("upper = 0.05", True), ("", True)]
)
def test_fingers_without_ends_clamp_wherever_they_are_near_and_others_by_their_stroke(
    tmp_path: Path, ends: str, endless: bool
) -> None:
    model = folded(tmp_path, HAND_OF.format("hand", ends))
    found, places = gaps_of(model, 0.1)
    fingers = {frozenset(("l2", "left")), frozenset(("l2", "right")), frozenset(("left", "right"))}
    assert (fingers <= places) is not endless
    assert not (fingers & places) or not endless
    inner = {gap: width for gap, width in found.items() if gap[1] not in ("around", "door/body")}
    by_fingers = {
        gap: width for gap, width in inner.items() if {"left", "right"} & {gap[0], gap[1].split("/")[1]}
    }
    assert len(by_fingers) == (9 if endless else 6)
    assert all(np.isinf(width) for width in by_fingers.values()) == endless
    assert all(np.isfinite(width) for gap, width in inner.items() if gap not in by_fingers)


def test_joints_between_bodies_are_those_of_one_way_only_and_poses_are_where_they_bring_them(
    tmp_path: Path,
) -> None:
    """A planar arm of which the second joint follows the first, and a gripper that opens without end."""
    mimic = '<mimic joint="j1" multiplier="2" offset="0.3"/>'
    text = FLOATING + '[[robots]]\nname = "zarm"\nmodel = "arm.urdf"\n' + HAND_OF.format("ahand", "")
    model = made(tmp_path, text.replace("arm/l2", "zarm/l2"), {"arm.urdf": two_r(mimic=mimic)}).model
    joints, index = RelativeJoints(model), {body.name: body.index for body in model.bodies}
    turn, grip = ("zarm", 0), ("ahand", 0)
    expected = {
        ("zarm/l1", "zarm/l2"): {turn},
        ("zarm/l2", "ahand/left"): {grip},
        ("ahand/left", "ahand/right"): {grip},
        ("zarm/l1", "ahand/left"): {turn, grip},
        ("zarm/l1", "zarm/l1"): set(),
    }
    for (a, b), between in expected.items():
        assert joints.between(index[a], index[b]) == joints.between(index[b], index[a]) == between
    assert joints.in_order([grip, turn]) == joints.in_order([turn, grip]) == [turn, grip]
    assert joints.range(turn) == (-np.pi, np.pi)
    assert joints.range(grip) == (-1.0, 1.0)
    assert (joints.endless(turn), joints.endless(grip)) == (False, True)
    q, opening = np.array([0.0, 0.4, -1.1]), np.array([0.0, 0.1, 0.3])
    rotations, positions = joints.poses({turn: q, grip: opening})
    np.testing.assert_allclose(
        positions[:, index["zarm/l2"]], np.stack([np.cos(q), np.sin(q), 0 * q], axis=1), atol=1e-12
    )
    x = rotations[:, index["zarm/l2"], :, 0]
    np.testing.assert_allclose(
        np.arctan2(x[:, 1], x[:, 0]), (3 * q + 0.3 + np.pi) % (2 * np.pi) - np.pi, atol=1e-12
    )
    apart = positions[:, index["ahand/left"]] - positions[:, index["ahand/right"]]
    np.testing.assert_allclose(
        np.linalg.norm(apart, axis=1) - np.linalg.norm(apart[0]), 2 * opening, atol=1e-12
    )


def test_ends_of_joints_are_those_of_the_file_and_one_side_without_any_goes_some_way(tmp_path: Path) -> None:
    text = HAND_OF.format("hand", "lower = 0, upper = 0.05") + HAND_OF.format("other", "").replace(
        "1.1", "1.3"
    )
    model = folded(tmp_path, text)
    joints = RelativeJoints(model)
    assert [joints.range(("arm", k)) for k in range(3)] == [*FOLDED]
    assert not any(joints.endless(("arm", k)) for k in range(3))
    assert joints.range(("hand", 0)) == (0.0, 0.025)  # of each finger
    assert not joints.endless(("hand", 0))
    assert joints.range(("other", 0)) == (-1.0, 1.0)
    assert joints.in_order([("other", 0), ("arm", 2), ("arm", 0), ("arm", 1)]) == [
        ("arm", 0),
        ("arm", 1),
        ("arm", 2),
        ("other", 0),
    ]
