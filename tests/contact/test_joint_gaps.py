"""Gaps between parts that one joint moves against each other: elbows, fingers, bearings."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import trimesh

from made_cell import FLOATING, Q0, UR10, made, results_at, state_at, two_r
from seerob.core.shapes import Mesh, Solid, capsule
from seerob.core.snapshot import Verdict
from seerob.criteria.contact import joint_gaps
from seerob.criteria.contact.clamped_regions import Clamping
from seerob.criteria.contact.clamping import STILL, RelativeJoints
from seerob.criteria.contact.joint_gaps import Looks, _Joint, closing, places
from seerob.session.station import Station, load
from seerob.twin.spans import Path as Way
from seerob.twin.spans import Points, Span

HAND, CHEST = "Hands and fingers", "Chest"
ARM = '[[robots]]\nname = "arm"\nmodel = "arm.urdf"\n'


def clamped(station: Station, regions: tuple[str, ...] = (HAND, CHEST), **motion) -> dict[str, set[str]]:
    """Which bodies clamp each region."""
    robot = station.model.robot("arm")
    state = state_at(station, **motion)
    flags, *_ = Clamping(station.model, robot, {}, regions, None).at(
        state, np.ones((len(robot.moving), len(regions)), bool)
    )
    names = [station.model.bodies[i].name for i in robot.moving]
    return {
        region: {name for name, flag in zip(names, flags[:, k], strict=True) if flag}
        for k, region in enumerate(regions)
    }


def elbow(folder: Path, base: str = "") -> Station:
    """Two links of 1 m × 0.1 m × 0.1 m, joined at the end of the first."""
    return made(folder, FLOATING + ARM + base, {"arm.urdf": two_r()})


BOTH = {"arm/l1", "arm/l2"}


def test_rates_are_kept_between_starts_and_none_that_are_damaged(tmp_path: Path, monkeypatch) -> None:
    elbow(tmp_path)

    def rates(cache: Path | None) -> list[bytes]:
        monkeypatch.setattr(joint_gaps, "_KNOWN", {})
        model = load(tmp_path, cache=cache).model
        bound = Clamping(model, model.robot("arm"), {}, (HAND, CHEST), None)
        return [table.rates.tobytes() for table in bound._joints._tables]

    anew = rates(None)
    assert anew
    cache = tmp_path / "cache"
    assert rates(cache) == anew
    (kept,) = cache.glob("*.gaps")
    whole = kept.read_bytes()
    with monkeypatch.context() as none_is_made:
        none_is_made.setattr(joint_gaps, "places", None)
        assert rates(cache) == anew
    for damaged in (whole[:-8], whole[:40] + bytes([whole[40] ^ 1]) + whole[41:], b""):
        kept.write_bytes(damaged)
        assert rates(cache) == anew
        assert kept.read_bytes() == whole
    kept.unlink()
    kept.mkdir()  # may neither be read nor written
    assert rates(cache) == anew


@pytest.mark.parametrize(
    ("q", "qd", "hand"),
    [
        (2.7, 0.3, BOTH),  # folds
        (2.7, -0.3, set()),  # opens
        (-2.7, -0.3, BOTH),  # folds to the other side
        (0.0, 0.3, set()),  # stretched out
        (1.0, 0.3, set()),
        (2.7, 0.0, set()),  # stands still
        (2.7, 1e-4, set()),  # as a servo that keeps its place
        (2.7, 3e-4, BOTH),  # creeps
        (2.7 + 2 * math.pi, 0.3, BOTH),  # a turn farther
    ],
)
def test_an_elbow_that_folds_clamps_a_hand(tmp_path: Path, q: float, qd: float, hand: set[str]) -> None:
    assert clamped(elbow(tmp_path), arm=((0.3, q), (0.0, qd)))[HAND] == hand


@pytest.mark.parametrize(
    ("joint", "q", "folds"),
    [
        ('type="continuous"', 5.4, True),  # the elbow at 2.7
        ('type="continuous"', 5.4 + 4 * math.pi, True),
        ('type="revolute"', 5.4, True),
        ('type="revolute"', 1.0, False),
    ],
)
def test_an_elbow_that_follows_by_half_a_turn_clamps_wherever_it_folds(
    tmp_path: Path, joint: str, q: float, folds: bool
) -> None:
    """Without ends nobody knows how often it went round; with them all of the range is looked at."""
    urdf = two_r(mimic='<mimic joint="j1" multiplier="0.5"/>').replace('type="continuous"', joint)
    urdf = urdf.replace('velocity="10"', 'velocity="10" lower="-6.2" upper="6.2"') if "rev" in joint else urdf
    station = made(tmp_path, FLOATING + ARM, {"arm.urdf": urdf})
    assert (clamped(station, (HAND,), arm=([q], [0.6]))[HAND] == BOTH) is folds


def test_a_turn_with_one_end_goes_round_once_from_there(tmp_path: Path) -> None:
    text = '[[machines]]\nname = "door"\nmass = 5\nturn = { lower = -0.2 }\nshape = { box = [1, 0.1, 1] }\n'
    joints = RelativeJoints(made(tmp_path, FLOATING + text).model)
    assert joints.range(("door", 0)) == (-0.2, -0.2 + 2 * math.pi)
    assert not joints.endless(("door", 0))


def test_an_elbow_that_folds_on_a_hand_is_not_within_where_a_free_hand_would_be(tmp_path: Path) -> None:
    text = (
        f'{FLOATING}{ARM}[[safety]]\nkind = "power_and_force"\nname = "pfl"\nrobot = "arm"\nfloor = false\n'
        'mass = "simplified"\ncontact_area = { arm = 1e-4 }\n'
    )
    station = made(tmp_path, text, {"arm.urdf": two_r(masses=(8.0, 8.0))})

    def hand(q, speed):
        found = results_at(station, arm=((0.0, q), (0.0, speed)))["pfl"]
        return next(part for part in found.parts if part.name == HAND)

    folding, stretched = hand(2.8, 0.6), hand(0.0, 0.6)
    assert stretched.verdict is Verdict.WITHIN
    assert ", free, " in stretched.reason
    assert folding.verdict is Verdict.EXCEEDED
    assert ", clamped, " in folding.reason
    # 140 N against M/2 = 8 kg alone.
    assert folding.limit <= 140 / math.sqrt(8 * 75e3) + 1e-12


COLUMN = '<collision><origin xyz="0 0 0.5"/><geometry><box size="0.2 0.2 1"/></geometry></collision>'
BALL = '<collision><geometry><sphere radius="0.05"/></geometry></collision>'
BEAM = '<collision><origin xyz="0.5 0 0"/><geometry><box size="1 0.06 0.06"/></geometry></collision>'


def on_column(folder: Path, axes: tuple[str, ...]) -> Station:
    """A beam of 1 m beside a column, 1 cm from it at its shoulder; the last of its axes lowers it."""
    links = [f'<link name="base">{COLUMN}</link>']
    for k, axis in enumerate(axes):
        shape = BALL + BEAM if k == len(axes) - 1 else ""
        inertia = '<inertia ixx="1e-2" iyy="1e-2" izz="1e-2" ixy="0" ixz="0" iyz="0"/>'
        links.append(f'<link name="l{k}">{shape}<inertial><mass value="1"/>{inertia}</inertial></link>')
        links.append(
            f'<joint name="j{k}" type="revolute"><parent link="{f"l{k - 1}" if k else "base"}"/>'
            f'<child link="l{k}"/><origin xyz="{"0 0 0" if k else "0.16 0 0.9"}"/><axis xyz="{axis}"/>'
            '<limit lower="-1.5" upper="1.5" effort="9" velocity="9"/></joint>'
        )
    return made(folder, FLOATING + ARM, {"arm.urdf": f'<robot name="c">{"".join(links)}</robot>'})


@pytest.mark.parametrize("axes", [("0 0 1", "0 1 0"), ("0 0 1", "1 0 0", "0 0 1", "0 1 0")])
def test_a_beam_that_folds_on_its_column_clamps_a_hand_whatever_else_is_at_its_shoulder(
    tmp_path: Path, axes: tuple[str, ...]
) -> None:
    """Beam and column are near at the shoulder wherever its joints stand: that hid all other places."""
    station, others = on_column(tmp_path, axes), [0.0] * (len(axes) - 1)
    beam = f"arm/l{len(axes) - 1}"

    def folds(lift: float, qd: list[float]) -> bool:
        return beam in clamped(station, (HAND,), arm=([*others, lift], qd))[HAND]

    # Whatever moves there: the other shoulder joints shear what lies between.
    for k in range(len(axes)):
        for speed in (0.3, -0.3, 0.02):
            qd = np.zeros(len(axes))
            qd[k] = speed
            assert folds(1.3, qd.tolist())
    assert not folds(1.3, [0.0] * len(axes))


def test_two_links_that_come_against_each_other_count_with_how_fast_they_close(tmp_path: Path) -> None:
    """The outer link stands in the world while the inner one folds onto it, at half the speed each."""
    station = made(
        tmp_path,
        f'{FLOATING}{ARM}[[safety]]\nkind = "power_and_force"\nname = "pfl"\nrobot = "arm"\nfloor = false\n'
        'mass = "simplified"\ncontact_area = { arm = 1e-4 }\n',
        {"arm.urdf": two_r()},
    )
    q, w = 2.9, 0.2
    found = results_at(station, arm=((0.0, q), (-w, 2 * w)))["pfl"]
    part = next(part for part in found.parts if part.name == HAND)
    assert ", clamped, " in part.reason
    # l1 turns at w about its base, and its own end by about 1 m · w; l2 comes against it at 2 w.
    assert part.value >= 0.9 * 2 * w * 0.7


def test_once_folded_enough_it_stays_so_until_it_is_shut(tmp_path: Path) -> None:
    """A narrower gap never relieves: as the angle grows, free turns into clamped once."""
    station = elbow(tmp_path)
    for region in (HAND, CHEST):
        found = [
            bool(clamped(station, (region,), arm=((0, q), (0, 0.3)))[region]) for q in np.linspace(1, 3, 25)
        ]
        assert found == sorted(found), region
        assert found[-1]


def test_turned_and_shifted_it_says_the_same(tmp_path: Path) -> None:
    base = "base = { position = [3, -2, 1.5], rpy = [0.4, -1.1, 2.0] }\n"
    here, there = elbow(tmp_path / "a"), elbow(tmp_path / "b", base)
    for q in np.linspace(-3.1, 3.1, 12):
        for qd in (0.3, -0.3):
            motion = ((0.2, q), (0.5, qd))
            assert clamped(here, arm=motion) == clamped(there, arm=motion), (q, qd)


def rolls(radius: float) -> str:
    """A forearm that turns about its own axis in a sleeve."""
    cylinder = '<geometry><cylinder radius="{}" length="0.3"/></geometry>'
    inertial = (
        '<inertial><mass value="2"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    )
    links = "".join(
        f'<link name="{name}">{inertial}<collision><origin xyz="0 0 {z}"/>{cylinder.format(r)}</collision>'
        "</link>"
        for name, z, r in (("a", 0.15, 0.06), ("b", 0.17, radius))
    )
    return (
        f'<robot name="r"><link name="base"/>{links}'
        '<joint name="j1" type="continuous"><parent link="base"/><child link="a"/><axis xyz="1 0 0"/></joint>'
        '<joint name="j2" type="continuous"><parent link="a"/><child link="b"/><origin xyz="0 0 0.3"/>'
        '<axis xyz="0 0 1"/></joint></robot>'
    )


@pytest.mark.parametrize("radius", [0.04, 0.06, 0.09])
def test_what_turns_in_its_bearing_clamps_nobody(tmp_path: Path, radius: float) -> None:
    station = made(tmp_path, FLOATING + ARM, {"arm.urdf": rolls(radius)})
    for q in (0.0, 0.7, 2.9):
        assert clamped(station, arm=((0.0, q), (0.0, 1.0))) == {HAND: set(), CHEST: set()}


MIMIC = '<mimic joint="left"/>'


def gripper(opening: float) -> str:
    finger = (
        '<link name="{n}"><inertial><mass value="0.2"/>'
        '<inertia ixx="1e-3" iyy="1e-3" izz="1e-3" ixy="0" ixz="0" iyz="0"/></inertial>'
        '<collision><origin xyz="0 {y} 0.16"/><geometry><box size="0.02 0.01 0.12"/></geometry>'
        "</collision></link>"
    )
    links = finger.format(n="left", y=0.005) + finger.format(n="right", y=-0.005)
    joint = (
        '<joint name="{n}" type="prismatic"><parent link="palm"/><child link="{n}"/><axis xyz="0 {s} 0"/>'
        f'<limit lower="0" upper="{opening / 2}" effort="50" velocity="1"/>{{m}}</joint>'
    )
    return (
        '<robot name="g"><link name="base"/><link name="palm"><inertial><mass value="1"/>'
        '<inertia ixx="1e-2" iyy="1e-2" izz="1e-2" ixy="0" ixz="0" iyz="0"/></inertial>'
        "</link>"
        f'{links}<joint name="turn" type="continuous"><parent link="base"/><child link="palm"/>'
        f'<axis xyz="0 0 1"/></joint>{joint.format(n="left", s=1, m="")}'
        f"{joint.format(n='right', s=-1, m=MIMIC)}</robot>"
    )


@pytest.mark.parametrize("opening", [0.02, 0.085, 0.3])
@pytest.mark.parametrize("share", [0.05, 0.5, 0.95])
def test_fingers_that_close_clamp_a_hand_however_the_recording_begins(
    tmp_path: Path, opening: float, share: float
) -> None:
    """An 85 mm gripper never was as wide as a hand; a finger it takes."""
    station = made(tmp_path, FLOATING + ARM, {"arm.urdf": gripper(opening)})
    fingers = {"arm/left", "arm/right"}
    closes = clamped(station, (HAND,), arm=((0.0, share * opening / 2), (0.0, -0.05)))[HAND]
    assert (closes >= fingers) == (share * opening <= 0.1)
    if opening < 0.18:
        assert not clamped(station, (CHEST,), arm=((0.0, share * opening / 2), (0.0, -0.05)))[CHEST]
    opens = clamped(station, (HAND,), arm=((0.0, share * opening / 2), (0.0, 0.05)))[HAND]
    assert not opens & fingers


def test_wider_fingers_never_relieve(tmp_path: Path) -> None:
    stations = [made(tmp_path / str(k), FLOATING + ARM, {"arm.urdf": gripper(k)}) for k in (0.03, 0.06, 0.12)]
    for gap in (0.005, 0.015, 0.028):
        found = [bool(clamped(s, (HAND,), arm=((0, gap / 2), (0, -0.1)))[HAND]) for s in stations]
        assert found == sorted(found)
        assert found[-1]


def test_a_slide_without_ends_clamps_wherever_it_is_near(tmp_path: Path) -> None:
    """Two fingers that nobody gave a stroke: nobody knows what gets between."""
    tool = UR10.replace("tcp = { position = [0, 0, 0.1] }\n", "")
    grip = (
        '[[machines]]\nname = "hand"\non = "arm/tool0"\nat = {{ position = [0, 0, 0.2] }}\n'
        "shape = {{ box = [0.02, 0.01, 0.1] }}\nmass = 0.2\ngrip = {{ {} }}\n"
    )
    for options, q, expected in (("upper = 0.9", 0.2, False), ("", 0.2, False), ("", 0.03, True)):
        station = made(tmp_path / f"{options}{q}", FLOATING + tool + grip.format(options))
        found = clamped(station, (HAND,), arm=(Q0, np.zeros(6)), hand=([q], [-0.05]))[HAND]
        assert ({"hand/left", "hand/right"} <= found) == expected


# -- the mathematics ----------------------------------------------------------------------------


@pytest.mark.parametrize("turns", [False, True])
def test_the_steps_that_a_way_sees_are_all_between_its_ends(turns: bool) -> None:
    """Also of a way longer than the whole stroke of fast fingers, that begins before its end."""
    low, step, rng = -0.3, 0.01, np.random.default_rng(3)
    joint = _Joint("hand", 0, low, step, turns)
    for _ in range(200):
        start, way = rng.uniform(-2, 2), rng.choice([-1, 1]) * rng.uniform(0, 3) ** 2
        cells = np.floor((np.linspace(start, start + way, 5000) - low) / step).astype(int)
        seen = cells % joint_gaps.STEPS if turns else np.clip(cells, 0, joint_gaps.STEPS - 1)
        assert set(seen.tolist()) == set(joint.seen(start, start + way).tolist())


def test_a_place_closes_where_it_faces_is_narrow_and_opens_wide_enough() -> None:
    q = np.linspace(0.0, 1.0, 11)
    gaps = np.stack([0.3 * (1 - q), 0.3 * (1 - q), 0.003 * (1 - q), np.full(11, 0.05), 0.02 * q], axis=1)
    faces = np.ones(gaps.shape, bool)
    faces[:, 1] = False
    thickness, fits, step = np.array([0.1, 0.5]), np.array([0.004, 0.18]), np.diff(q)

    def rates(columns: list[int], about: float = 0.0) -> np.ndarray:
        g = gaps[:, columns]
        falls, near = -np.gradient(g, q, axis=0), np.minimum(g[1:], g[:-1])
        looks = Looks(g, faces[:, columns], falls, near)
        return closing(looks, np.full((len(columns), 2), about), step, thickness, fits, least=0.004)

    for columns, growing, falling in (
        ([0], [4, 10], 0),
        ([1], [0, 0], 0),
        ([2], [0, 0], 0),
        ([3], [0, 0], 0),
    ):
        np.testing.assert_array_equal((rates(columns)[0] > 0).sum(axis=0), growing)
        assert (rates(columns)[1] > 0).sum() == falling
    # 2 cm in a metre: it shuts on a fingertip; on a wider gap it only slides.
    assert (rates([4])[1, :, 0] > 0).all()
    gaps[:, 4] += 0.03
    assert not rates([4]).any()
    assert rates([0]).max() == pytest.approx(0.3)
    together = np.max([rates([k]) for k in range(5)], axis=0)
    np.testing.assert_array_equal(rates([0, 1, 2, 3, 4]), together)
    assert together.any()
    # A piece of surface as large as that may be narrower than the place that stands for it.
    assert (rates([0], about=0.03)[0] > 0).sum(axis=0).tolist() == [5, 10]


def test_places_lie_on_the_surface_and_their_normals_point_outward() -> None:
    box = trimesh.creation.box([0.4, 0.1, 0.2])
    mesh = Mesh(np.array(box.vertices), np.array(box.faces, np.int32))
    on = places([Solid(mesh=mesh)])
    half = np.array([0.2, 0.05, 0.1])
    np.testing.assert_allclose(np.max(np.abs(on.points) - half, axis=1), 0.0, atol=1e-12)
    np.testing.assert_allclose(np.max(np.abs(on.points + 1e-3 * on.normals) - half, axis=1), 1e-3)
    rod = capsule(np.zeros(3), np.array([0.0, 0, 0.5]), 0.05)
    on = places([rod])
    assert len(on.points) > 500
    axis = np.clip(on.points[:, 2], 0, 0.5)[:, None] * [0, 0, 1]
    np.testing.assert_allclose(np.linalg.norm(on.points - axis, axis=1), 0.05)
    np.testing.assert_allclose(on.points - axis, 0.05 * on.normals, atol=1e-12)
    # None of the rod's lie inside the box, and all others are there; so are those where both are the same.
    alone, both = len(places([Solid(mesh=mesh)]).points), len(on.points)
    on = places([Solid(mesh=mesh), rod])
    assert (np.max(np.abs(on.points) - half, axis=1) > -1e-9).all()
    assert 0.7 * (alone + both) < len(on.points) < alone + both
    assert len(places([Solid(mesh=mesh)] * 2).points) > 0


def _spread(on: joint_gaps.Places, surface: np.ndarray) -> float:
    """How far the farthest of some points of a surface is from a place [m]."""
    return max(float(np.linalg.norm(on.points - point, axis=1).min()) for point in surface)


def test_no_point_of_a_surface_is_farther_from_a_place_than_its_piece_is_large() -> None:
    """And there are hardly more places than pieces; of what is large pieces are larger."""
    h, rng = joint_gaps.PIECE, np.random.default_rng(5)
    half = np.array([0.1, 0.05, 0.025])
    box = trimesh.creation.box(2 * half)
    solid = Solid(mesh=Mesh(np.array(box.vertices), np.array(box.faces, np.int32)))
    surface = rng.uniform(-1, 1, (300, 3)) * half
    sides = rng.integers(0, 3, 300)
    surface[np.arange(300), sides] = rng.choice([-1, 1], 300) * half[sides]
    on = places([solid])
    assert on.about == h / 2
    assert _spread(on, surface) < 1.2 * h
    assert len(on.points) < 1.5 * box.area / h**2
    start, axis = np.array([0.7, -0.2, 0.1]), np.array([0.2, 0.3, -0.4])
    rod = capsule(start, start + axis, 0.05)
    out = rng.normal(size=(300, 3))
    out /= np.linalg.norm(out, axis=1)[:, None]
    across = np.cross(axis, out)
    across /= np.linalg.norm(across, axis=1)[:, None]
    on = places([rod])
    assert _spread(on, start + rng.random((300, 1)) * axis + 0.05 * across) < 0.75 * h
    ends = np.where((out @ axis > 0)[:, None], start + axis, start)
    assert _spread(on, ends + 0.05 * out) < 0.75 * h
    poles = 0.05 * axis / np.linalg.norm(axis)
    assert _spread(on, np.array([start - poles, start + axis + poles])) < 1e-9
    length = np.linalg.norm(axis)
    assert len(on.points) < 1.3 * (length * 2 * np.pi * 0.05 + 4 * np.pi * 0.05**2) / h**2
    a, b, c = np.array([[0.3, -0.2, 0.0], [0.5, -0.2, 0.0], [0.3, -0.1, 0.0]])
    pad = Solid(points=np.array([a, b, c]), radius=0.02)
    uv = rng.random((300, 2))
    flat = a + uv[:, :1] * (b - a) + uv[:, 1:] * (c - a)
    on = places([pad])
    assert _spread(on, flat + rng.choice([-0.02, 0.02], (300, 1)) * [0.0, 0.0, 1.0]) < 1.2 * h
    np.testing.assert_allclose(np.abs(on.points[:, 2]), 0.02)
    np.testing.assert_allclose(on.normals[:, 2], np.sign(on.points[:, 2]))
    # A thin needle is as round as eight places say; a point has an axis, too.
    for way in (1.0, -1.0):
        needle = places([capsule(np.zeros(3), np.array([0.0, 0.0, 0.05 * way]), 1e-3)])
        assert len(needle.points) == 8 * 5 + 2
    # Around and along there is one more than whole pieces.
    pin = places([capsule(np.zeros(3), np.array([0.0, 0.0, 4.4 * h]), 2.45 * h)])
    rings, counts = np.unique(pin.points[(pin.normals[:, 2] == 0)][:, 2].round(9), return_counts=True)
    assert rings == pytest.approx(np.arange(6) / 5 * 4.4 * h, abs=1e-8)
    assert set(counts.tolist()) == {16}
    _, counts = np.unique(pin.points[pin.normals[:, 2] > 0][:, 2].round(9), return_counts=True)
    assert counts.tolist() == [15, 11, 6, 1]
    ball = places([Solid(points=np.zeros((2, 3)), radius=0.1)])
    np.testing.assert_allclose(np.linalg.norm(ball.points, axis=1), 0.1)
    assert _spread(ball, 0.1 * out) < 0.75 * h
    for long, thick in ((5.0, 0.5), (10.0, 0.1)):
        half = np.array([0.0, 0.0, long / 2])
        large = [capsule(-half, half, thick), capsule(np.zeros(3), axis, 0.01)]
        assert places(large).about == pytest.approx((long + 2 * thick) / joint_gaps.MOST_PIECES / 2)


@pytest.mark.parametrize(
    ("limits", "share", "first", "last", "turns"),
    [
        ("", None, -math.pi, math.pi, True),
        ('lower="-6.2" upper="6.2"', None, -6.2, 2 * math.pi - 6.2, True),
        ('lower="-3.141592653589793" upper="3.141592653589793"', None, -math.pi, math.pi, True),
        ('lower="-3.1" upper="3.1"', None, -3.1, 3.1, False),
        ('lower="-0.4" upper="1.5"', None, -0.4, 1.5, False),
        ('lower="-6.2" upper="6.2"', 0.5, -6.2, 6.2, False),  # what follows by a half is elsewhere a turn on
        ('lower="-6.2" upper="6.2"', 2, -6.2, 2 * math.pi - 6.2, True),
    ],
)
def test_a_joint_is_looked_at_once_round_or_from_end_to_end(
    tmp_path: Path, limits: str, share: float | None, first: float, last: float, turns: bool
) -> None:
    urdf = two_r(mimic="" if share is None else f'<mimic joint="j1" multiplier="{share}"/>')
    if limits:
        urdf = urdf.replace("continuous", "revolute").replace('velocity="10"', f'velocity="10" {limits}')
    model = made(tmp_path, FLOATING + ARM, {"arm.urdf": urdf}).model
    joint = _Joint.of(model, RelativeJoints(model), ("arm", 0))
    assert joint.turns is turns
    assert [joint.grid[0], joint.grid[-1]] == pytest.approx([first, last])


def spanned(station: Station, before: tuple, after: tuple, T: float, noise: float = 0.0) -> Span:
    """The arm on a cubic from positions and speeds of its joints to others, within a time."""
    model, points = station.model, Points(station.model)
    q, v = (np.array(both, float) for both in zip(before, after, strict=True))
    ids = np.array([body.mj for body in model.bodies])
    span = points.span(Way(np.array([0.0, T]), q, v), 0.0, T, ids, model.mj)
    span.derived(np.zeros(len(model.bodies)), np.full(model.mj.nv, noise))
    return span


def test_at_no_instant_of_a_span_a_joint_clamps_faster_than_is_known_at_either_end(tmp_path: Path) -> None:
    """Elbows that fold, unfold, turn back and fly through within 0.2 s."""
    chance, T, station = np.random.default_rng(1), 0.2, elbow(tmp_path)
    robot = station.model.robot("arm")
    gaps = Clamping(station.model, robot, {}, (HAND, CHEST), None)._joints
    every, some = np.ones((len(robot.moving), 2), bool), 0
    for _ in range(30):
        q0 = np.array([0.0, chance.choice([-1, 1]) * chance.uniform(2.2, 3.0)])
        v0, v1 = np.array([[0.0, chance.uniform(-3, 3)] for _ in range(2)])
        ends = (q0, v0), (q0 + T * (v0 + v1) / 2 + [0, chance.uniform(-0.2, 0.2)], v1)
        span, met = spanned(station, *ends, T), np.zeros(every.shape)
        for t in np.linspace(0, T, 20).tolist():
            met = np.maximum(met, gaps.speeds(state_at(station, arm=span.path.at(t)), every))
        for end in ends:
            assert (met <= gaps.speeds(state_at(station, arm=end), every, span) + 1e-9).all()
        some += bool(met.any())
    assert 5 < some < 30


def test_a_joint_that_cannot_get_there_in_a_span_clamps_nothing(tmp_path: Path) -> None:
    """By its speed it gets 3 mrad on, and by noise of its speed alone it closes as fast as that noise."""
    station = elbow(tmp_path)
    robot = station.model.robot("arm")
    gaps = Clamping(station.model, robot, {}, (HAND,), None)._joints
    every = np.ones((len(robot.moving), 1), bool)

    def ever(q: float, qd: float, then: float, noise: float = 0.0) -> float:
        T = 0.01
        before, after = ((0.0, q), (0.0, qd)), ((0.0, q + T * (qd + then) / 2), (0.0, then))
        span = spanned(station, before, after, T, noise)
        return float(gaps.speeds(state_at(station, arm=before), every, span).max())

    assert ever(1.0, 0.3, 0.3) == 0.0
    assert ever(2.7, -0.3, -0.3) == 0.0  # opens, and goes on opening
    at_once = float(gaps.speeds(state_at(station, arm=((0.0, 2.7), (0.0, 0.3))), every).max())
    assert ever(2.7, 0.3, 0.3) == pytest.approx(at_once, rel=0.05)
    assert ever(2.7, -0.1, 0.3) == pytest.approx(at_once, rel=0.05)  # turns back
    assert ever(2.7, 0.0, 0.0, noise=0.3) == pytest.approx(at_once, rel=0.05)


def test_a_pair_clamps_as_fast_as_its_joint_closes_it_where_it_is_and_no_slower_joint_does() -> None:
    rates = np.zeros((2, joint_gaps.STEPS, 3))
    rates[0, 10, 0], rates[1, 20, 1], rates[0, 12, 2] = 5.0, 3.0, 100.0
    table = joint_gaps._Table(_Joint("hand", 0, 0.0, 0.01, False), (0,), rates)
    assert table.at((0.105, 0.105), (-0.1, 0.2)).tolist() == pytest.approx([1.0, 0.0, 0.0])
    assert table.at((0.105, 0.205), (-0.1, 0.2)).tolist() == pytest.approx([1.0, 0.3, 20.0])
    assert table.at((0.205, 0.205), (-0.4, -0.1)).tolist() == pytest.approx([0.0, 1.2, 0.0])
    assert not table.at((0.205, 0.205), (0.1, 0.4)).any()
    assert not table.at((0.125, 0.125), (0.0, joint_gaps.RIPPLE)).any()
    assert table.at((0.125, 0.125), (0.0, 1.05 * joint_gaps.RIPPLE))[2] == pytest.approx(0.021)
    # What closes by no more than a hair stands still.
    rates[0, 12, 2] = STILL / 0.5
    assert not table.at((0.125, 0.125), (0.0, 0.5)).any()
    assert table.at((0.125, 0.125), (0.0, 0.51))[2] == pytest.approx(STILL * 1.02)


@pytest.mark.parametrize("off", [-1e-6, 0.0, 1e-6])
def test_each_threshold_of_what_clamps_is_where_it_is_said_to_be(off: float) -> None:
    """A gap that closes evenly from a width: how much it opens, how wide, how narrow, and how fast."""
    step = np.full(4, 0.25)

    def clamps(
        gaps: list[float], thick: float, thin: float, least: float = 0.004, about: float = 0.0
    ) -> list[bool]:
        g = np.array(gaps)[:, None]
        near = np.minimum(g[1:], g[:-1])
        looks = Looks(g, np.ones(g.shape, bool), -np.gradient(g, 0.25, axis=0), near)
        found = closing(looks, np.full((1, 1), about), step, np.array([thick]), np.array([thin]), least=least)
        assert found.shape == (2, 4, 1)
        assert not found[1].any()
        return (found[0, :, 0] > 0).tolist()

    even = [0.1, 0.075, 0.05, 0.025, 0.0]
    assert any(clamps(even, 0.5, 0.1 - off)) is (off >= 0)  # opens as wide as the thinnest
    assert any(clamps(even, 0.5, 0.12 - off, about=0.02)) is (off >= 0)
    wider = [0.02 + x for x in even]
    assert any(clamps(wider, 0.5, 0.05, least=0.1 - off)) is (off >= 0)  # and by more than a fingertip
    assert clamps(even, 0.05 + off, 0.05) == [False, off >= 0, True, True]
    assert clamps(even, 0.03 + off, 0.05, about=0.02) == [False, off >= 0, True, True]
    slow = [0.5 - x for x in np.cumsum([0, *[0.25 * (joint_gaps.SLOWEST + off)] * 4])]
    assert all(clamps(slow, 0.6, 0.05)) is any(clamps(slow, 0.6, 0.05)) is (off >= 0)
    # In a narrower gap what would shut it within a radian is fast enough, down to a fingertip.
    least = 0.004
    narrow = [0.01 * (1 - (1 + off) * x) for x in (0, 0.25, 0.5, 0.75, 1.0)]
    assert clamps(narrow, 0.6, 0.005, least=least)[0] is True
    crawling = [0.004 + off * 5 - x * (0.004 + off) for x in (0, 0.25, 0.5, 0.75, 1.0)]
    assert clamps(crawling, 0.6, 0.003, least=least)[-1] is (off >= 0)


def test_a_place_between_two_that_it_faces_from_one_only_closes_with_the_faster_of_all() -> None:
    gaps = np.array([[0.3], [0.2], [0.0]])
    near, step = np.zeros((2, 1)), np.array([0.5, 0.5])
    for faces, growing in (
        ([1, 0, 0], [True, False]),
        ([0, 1, 0], [True, True]),
        ([0, 0, 0], [False, False]),
    ):
        looks = Looks(gaps, np.array(faces, bool)[:, None], np.array([[0.1], [0.9], [0.0]]), near)
        found = closing(looks, np.zeros((1, 1)), step, np.array([1.0]), np.array([0.1]), least=0.004)[..., 0]
        np.testing.assert_allclose(found[0], np.where(growing, 0.9, 0.0))
        assert not found[1].any()
        jump = Looks(gaps, np.ones((3, 1), bool), np.zeros((3, 1)), near)
        mean = closing(jump, np.zeros((1, 1)), step, np.array([1.0]), np.array([0.1]), least=0.004)[..., 0]
        np.testing.assert_allclose(mean, [[0.2, 0.4], [0.0, 0.0]])
        opening = Looks(gaps[::-1], looks.faces, -looks.falls, near)
        back = closing(opening, np.zeros((1, 1)), step, np.array([1.0]), np.array([0.1]), least=0.004)[..., 0]
        np.testing.assert_allclose(back[1], np.where(growing, 0.9, 0.0))
        assert not back[0].any()


def test_two_balls_clamp_as_early_whichever_way_they_come_together(tmp_path: Path) -> None:
    """Along their poles, across them and aslant: the gap is that between them."""
    ball = '<collision><geometry><sphere radius="0.1"/></geometry></collision>'
    mass = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    counts = []
    for k, way in enumerate(((0, 0, 1), (1, 0, 0), (1, 0, 1), (1, 1, 1))):
        x, y, z = np.array(way) / np.linalg.norm(way)
        urdf = (
            f'<robot name="r"><link name="base">{mass}{ball}</link><link name="l1">{mass}{ball}</link>'
            '<joint name="j1" type="prismatic"><parent link="base"/><child link="l1"/>'
            f'<origin xyz="{0.2 * x} {0.2 * y} {0.2 * z}"/><axis xyz="{x} {y} {z}"/>'
            '<limit effort="100" velocity="1" lower="0" upper="0.72"/></joint></robot>'
        )
        model = made(tmp_path / str(k), FLOATING + ARM, {"arm.urdf": urdf}).model
        (table,) = Clamping(model, model.robot("arm"), {}, (HAND, CHEST), None)._joints._tables
        assert not table.rates[0].any()
        counts.append((table.rates[1] > 0).sum(axis=0).tolist())
        np.testing.assert_allclose(table.rates[1].max(), 1.0, atol=0.01)
    # Of 10 mm each.
    assert np.ptp(counts, axis=0).max() <= 1
    assert np.min(counts) > 3


def test_a_triangle_without_a_surface_has_no_place() -> None:
    flat = np.array([[[0.0, 0, 0], [0.1, 0, 0], [0, 0.1, 0]]])
    thin = np.array([[[0.0, 0, 0], [0.1, 0, 0], [0.2, 0, 0]]])
    (points, normals), alone = (
        joint_gaps._on_triangles(triangles, 0.0125, 0.0) for triangles in (np.concatenate([flat, thin]), flat)
    )
    np.testing.assert_array_equal(points, alone[0])
    np.testing.assert_array_equal(normals, alone[1])
    np.testing.assert_array_equal(normals, np.tile([0.0, 0.0, 1.0], (len(points), 1)))
    assert [part.shape for part in joint_gaps._on_triangles(thin, 0.0125, 0.0)] == [(0, 3), (0, 3)]
    # One that is thinner than a piece has pieces along it all the same.
    strip = np.array([[[0.0, 0, 0], [0.4, 0, 0], [0.4, 0.01, 0]]])
    points, _ = joint_gaps._on_triangles(strip, 0.0125, 0.0)
    assert np.diff(np.sort([0.0, *points[:, 0].tolist(), 0.4])).max() < 2 * 0.0125


@pytest.mark.parametrize("seed", range(6))
def test_no_place_of_a_part_shuts_faster_than_the_part(seed: int) -> None:
    """Of random pairs of parts around a hinge, each place alone, as the others are asked for elsewhere."""
    chance = np.random.default_rng(seed)

    def part() -> list[Solid]:
        way, at = (
            chance.normal(size=3),
            np.array([chance.uniform(-0.1, 0.4), *chance.uniform(-0.08, 0.08, 2)]),
        )
        way *= chance.uniform(0.02, 0.12) / np.linalg.norm(way)
        return [Solid(points=np.array([at - way, at + way]), radius=chance.uniform(0.02, 0.07))]

    solids = [part(), part()]
    angles = np.linspace(0, 2 * np.pi, 37)
    turned = np.zeros((37, 3, 3))
    turned[:, 0, 0] = turned[:, 1, 1] = np.cos(angles)
    turned[:, 1, 0], turned[:, 0, 1] = np.sin(angles), -np.sin(angles)
    turned[:, 2, 2] = 1
    poses = [(np.tile(np.eye(3), (37, 1, 1)), np.zeros((37, 3))), (turned, np.tile([0.2, 0, 0], (37, 1)))]
    thickness, fits, step = np.array([0.06, 0.3]), np.array([0.025, 0.15]), np.diff(angles)
    rates = joint_gaps._rates(solids, poses, step, thickness, fits, joint_gaps.SLOWEST, None)
    for i, j in ((0, 1), (1, 0)):
        on = places(solids[i])
        for k in range(0, len(on.points), 7):
            alone = joint_gaps.Places(on.points[k : k + 1], on.normals[k : k + 1], on.about)
            looks = joint_gaps._looks(alone, solids[j], (poses[i], poses[j]), step)
            around = np.full((1, 2), on.about)
            found = closing(looks, around, step, thickness, fits, least=joint_gaps.SLOWEST)
            assert (found <= rates + 1e-9).all()
