"""What clamps against what: one more surface never permits more, and people stand on a floor."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from made_cell import FLOATING, TWO_R, made, results_at, state_at, two_r
from seerob.core.snapshot import Origin, Result
from seerob.criteria.contact.clamped_regions import FloorGap
from seerob.kernels.approach import lowest_points
from seerob.session.station import Station, load

HAND = "Hands and fingers"


def part(name: str, size: tuple[float, ...], at: tuple[float, ...]) -> str:
    shape = f"shape = {{ box = {list(size)} }}\nat = {{ position = {list(at)} }}\n"
    return f'[[parts]]\nname = "{name}"\n{shape}'


# The straight arm of made_cell lies along x, ± 0.05 m thick, and turns about z toward the wall.
WALL = part("wall", (1, 0.1, 1), (1.5, 0.15, 0))
TABLE = part("table", (3, 1, 0.1), (1, -0.3, -0.12))


def cell(folder: Path, more: str, options: str = "", *, base: str = "", axis: str = "0 0 1") -> Station:
    """Without a base the arm lies in the plane of the floor, which then is left out."""
    robot = TWO_R + base
    options = options if base or "floor" in options else f"{options}floor = false\n"
    text = (
        f'{FLOATING}{robot}{more}[[safety]]\nkind = "power_and_force"\nname = "pfl"\nrobot = "arm"\n'
        f'mass = "simplified"\ncontact_area = {{ arm = 1e-4 }}\n{options}'
    )
    urdf = two_r().replace('xyz="0 0 1"', f'xyz="{axis}"')
    return made(folder, text, {"arm.urdf": urdf})


def regions(station: Station, q: tuple[float, float] = (0, 0), v: tuple[float, float] = (0.2, 0.0)) -> dict:
    found = results_at(station, arm=(list(q), list(v)))["pfl"]
    return {p.name: p for p in found.parts}


def clamped(found: Result) -> bool:
    return ", clamped, " in found.reason


def test_a_nearer_surface_at_a_constant_distance_hides_no_wall_that_closes(tmp_path: Path) -> None:
    alone = regions(cell(tmp_path / "a", WALL))[HAND]
    both = regions(cell(tmp_path / "b", WALL + TABLE))[HAND]
    assert clamped(alone)
    assert clamped(both)
    assert both.limit == alone.limit
    assert not clamped(regions(cell(tmp_path / "c", ""))[HAND])


def test_wall_and_table_as_one_mesh_clamp_as_two(tmp_path: Path) -> None:
    boxes = [trimesh.creation.box([1, 0.1, 1]), trimesh.creation.box([3, 1, 0.1])]
    boxes[0].apply_translation([1.5, 0.15, 0])
    boxes[1].apply_translation([1, -0.3, -0.12])
    tmp_path.joinpath("ell.stl").write_bytes(trimesh.util.concatenate(boxes).export(file_type="stl"))
    station = cell(tmp_path, '[[parts]]\nname = "ell"\nmesh = "ell.stl"\nunits = "m"\n')
    assert clamped(regions(station)[HAND])


def test_a_part_that_tilts_clamps_though_its_nearest_edge_opens(tmp_path: Path) -> None:
    """The outer link turns about its own end: one edge leaves the wall, the other comes to it."""
    found = regions(cell(tmp_path, WALL), v=(-0.2, 0.6))
    assert clamped(found[HAND])


def test_one_more_surface_never_raises_a_permissible_speed(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    sizes, places = rng.uniform(0.05, 0.8, (6, 3)), rng.uniform(-1, 1, (6, 3)) * [2.2, 2.2, 0.4]
    surfaces = [
        part(f"box{k}", tuple(size), tuple(at))
        for k, (size, at) in enumerate(zip(sizes.tolist(), places.tolist(), strict=True))
    ]
    states = [(rng.uniform(-3, 3, 2), rng.uniform(-1, 1, 2)) for _ in range(8)]
    before: list[dict[str, float]] = []
    clamping = 0
    for count in range(len(surfaces) + 1):
        station = cell(tmp_path / str(count), "".join(surfaces[:count]))
        now = [
            {name: p.limit for name, p in regions(station, tuple(q), tuple(v)).items() if p.limit}
            for q, v in states
        ]
        for old, new in zip(before, now, strict=False):
            assert all(new[name] <= limit + 1e-12 for name, limit in old.items())
            clamping += sum(new[name] < limit for name, limit in old.items())
        before = now
    assert clamping > 5


# -- the floor ----------------------------------------------------------------------------------

DOWN = "0 1 0"
"""Axis of joints whose positive sense brings the arm down."""


def over_floor(folder: Path, z: float, options: str = "", more: str = "") -> Station:
    return cell(folder, more, options, base=f"base = {{ position = [0, 0, {z}] }}\n", axis=DOWN)


@pytest.mark.parametrize(
    ("z", "v", "options", "hand", "chest"),
    [
        (0.14, 0.2, "", True, True),  # the lowest point of the arm 0.05 m under its axis
        (0.16, 0.2, "", False, True),
        (0.56, 0.2, "", False, False),
        (0.14, -0.2, "", True, True),  # it rises, as it may from a wall
        (0.14, 0.2, "floor = false\n", False, False),
        (0.14, 0.2, "floor_height = -0.1\n", False, True),
        (0.56, 0.2, "floor_height = 0.42\n", True, True),
    ],
)
def test_arm_that_moves_near_the_floor_clamps_against_it(
    tmp_path: Path, z: float, v: float, options: str, hand: bool, chest: bool
) -> None:
    """Nothing is drawn there: who stands, stands on z = 0."""
    found = regions(over_floor(tmp_path, z, options), v=(v, 0.0))
    assert (clamped(found[HAND]), clamped(found["Chest"])) == (hand, chest)
    assert found["Chest"].reason.startswith("pressure, clamped, arm/l") == chest
    assert (", on the floor" in found["Chest"].reason) == chest


def test_floor_clamps_as_a_part_in_its_place_does(tmp_path: Path) -> None:
    slab = part("slab", (6, 6, 0.2), (0, 0, -0.1))
    plane = regions(over_floor(tmp_path / "a", 0.14))
    drawn = regions(over_floor(tmp_path / "b", 0.14, "floor = false\n", slab))
    assert {n: p.limit for n, p in plane.items()} == {n: p.limit for n, p in drawn.items()}
    assert clamped(plane[HAND])


def test_a_gap_exactly_as_wide_as_the_body_part_clamps_it(tmp_path: Path) -> None:
    station = over_floor(tmp_path, 0.16)
    state = state_at(station, arm=((0.0, 0.0), (0.2, 0.0)))
    floor = FloorGap(station.model, station.model.robot("arm").moving, 0.0)
    exactly = floor.lowest(state)[1]
    thickness, wanted = np.array([exactly, np.nextafter(exactly, 0)]), np.ones((2, 2), bool)
    assert floor.clamped(state, thickness, wanted)[1].tolist() == [True, False]


@pytest.mark.parametrize(("z", "expected"), [(0.19, True), (0.20, False)])
def test_twice_what_surfaces_may_stick_out_is_added_to_body_parts(
    tmp_path: Path, z: float, expected: bool
) -> None:
    """Of two surfaces; the arm's visual is 20 mm thicker to either side: 100 mm of the hand become 140 mm.

    The gap is z - 50 mm.
    """
    thicker = '<visual><origin xyz="0.5 0 0"/><geometry><box size="1 0.1 0.14"/></geometry></visual>'
    station = over_floor(tmp_path, z)
    urdf = tmp_path.joinpath("arm.urdf").read_text()
    at = urdf.rindex("</link>", 0, urdf.index('name="j1"'))
    tmp_path.joinpath("arm.urdf").write_text(urdf[:at] + thicker + urdf[at:])
    station = load(tmp_path)
    assert max(b.deviation for b in station.model.bodies) == pytest.approx(0.02, abs=1e-3)
    assert clamped(regions(station)[HAND]) == expected


@pytest.mark.parametrize("z", [0.06, 0.14, 0.2])
def test_what_moves_along_the_floor_clamps_as_what_moves_along_a_wall(tmp_path: Path, z: float) -> None:
    """The same arm, turning about z, beside a floor, a slab in its place, and a table top above it."""
    base = f"base = {{ position = [0, 0, {z}] }}\n"
    floor = regions(cell(tmp_path / "a", "", "", base=base))
    slab = part("slab", (6, 6, 0.2), (0, 0, -0.1))
    drawn = regions(cell(tmp_path / "b", slab, "floor = false\n", base=base))
    above = part("above", (6, 6, 0.2), (0, 0, 2 * z + 0.1))
    ceiling = regions(cell(tmp_path / "c", above, "floor = false\n", base=base))
    for other in (drawn, ceiling):
        assert {n: p.limit for n, p in floor.items()} == {n: p.limit for n, p in other.items()}
    assert clamped(floor["Chest"])
    assert clamped(floor[HAND]) == (z < 0.15)


@pytest.mark.parametrize(
    ("options", "value", "origin"),
    [
        ("", 0.0, Origin.STATED),
        ("floor_height = 0.3\n", 0.3, Origin.GIVEN),
        ("floor = false\n", "left out", Origin.GIVEN),
    ],
)
def test_basis_says_what_the_floor_is(tmp_path: Path, options: str, value: object, origin: Origin) -> None:
    station = cell(tmp_path, "", options, base="base = { position = [0, 0, 1] }\n")
    inputs = {i.name: i for i in station.bound[0].basis.inputs}
    found = inputs["floor as a surface that clamps"]
    assert (found.value, found.origin) == (value, origin)
    assert found.unit == ("" if value == "left out" else "m")


def test_lowest_point_of_a_dilated_mesh_is_that_of_its_vertices() -> None:
    """And of points all over its rounded surface none is lower."""
    rng = np.random.default_rng(5)
    points = trimesh.creation.box([0.3, 0.2, 0.1]).subdivide().vertices
    R, x = trimesh.transformations.random_rotation_matrix(rng.random(3))[:3, :3], rng.normal(size=3)
    r, found = 0.04, np.empty(2)
    lowest_points(
        np.array([0, 0]), R[None].copy(), x[None],
        np.ascontiguousarray(np.tile(points, (2, 1)), float), np.array([0, len(points), 2 * len(points)]),
        np.array([0.0, r]), found,
    )  # fmt: skip
    a = points @ R.T
    assert found[0] == pytest.approx((x + a)[:, 2].min(), abs=1e-12)
    u = rng.normal(size=(20_000, 1, 3))
    a = (a + r * u / np.linalg.norm(u, axis=2, keepdims=True)).reshape(-1, 3)
    assert found[1] <= (x + a)[:, 2].min() < found[1] + 1e-4


# -- other robots -------------------------------------------------------------------------------


def test_two_robots_that_come_against_each_other_count_with_both_speeds(tmp_path: Path) -> None:
    """Two straight arms side by side, 0.2 m apart, that turn towards each other or the same way."""
    other = TWO_R.replace('name = "arm"', 'name = "other"') + "base = { position = [0, 0.3, 0] }\n"
    station = cell(tmp_path, other)

    def hand(mine: float, others: float) -> Result:
        found = results_at(station, arm=((0, 0), (mine, 0.0)), other=((0, 0), (others, 0.0)))["pfl"]
        return next(p for p in found.parts if p.name == "Chest")

    alone, towards, along = hand(0.1, 0.0), hand(0.1, -0.1), hand(0.1, 0.1)
    assert clamped(alone)
    assert clamped(towards)
    assert towards.value == pytest.approx(2 * alone.value, rel=0.1)
    assert towards.limit == alone.limit
    # They turn about axes that lie beside each other: like one body, but for that.
    assert along.value <= alone.value * 1.001


def test_beside_a_robot_that_nobody_moves_an_arm_says_what_it_says_beside_a_wall(tmp_path: Path) -> None:
    beside = regions(cell(tmp_path / "a", part("wall", (2, 0.1, 0.1), (1, 0.3, 0))))
    other = TWO_R.replace('name = "arm"', 'name = "other"') + "base = { position = [0, 0.3, 0] }\n"
    found = results_at(cell(tmp_path / "b", other), arm=((0, 0), (0.2, 0.0)), other=((0, 0), (0, 0)))["pfl"]
    assert {p.name: p.limit for p in found.parts} == {n: p.limit for n, p in beside.items()}
