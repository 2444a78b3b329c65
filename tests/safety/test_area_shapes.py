"""Areas of every shape, several per criterion, on anything; areas made of what something sweeps."""

from __future__ import annotations

import numpy as np
import pytest

from made_cell import FLOATING, TWO_R, made, results_at, two_r
from seerob.core.errors import InputError
from seerob.distance.voxels import VoxelGrid
from seerob.model.model import Model
from seerob.session.station import load

BOX = '[[parts]]\nname = "{name}"\nshape = {{ box = [0.2, 0.2, 0.2] }}\nat = {{ position = {at} }}\n'
AREA = '[[areas]]\nname = "{name}"\n{shape}\n'
WATCH = '[[safety]]\nkind = "safety_area"\nname = "a"\narea = {area}\nof = {of}\ntolerance = 0.001\n'
POLYGON = "shape = { polygon = [[0, 0], [3, 0], [3, 1], [1, 1], [1, 3], [0, 3]], height = [0, 2] }"


def area_at(folder, shape, at):
    text = AREA.format(name="zone", shape=shape) + BOX.format(name="box", at=at)
    return results_at(made(folder, text + WATCH.format(area='"zone"', of='"box"')))["a"]


@pytest.mark.parametrize(
    ("shape", "at", "value"),
    [
        ("shape = { capsule = [0.5, 1.0] }", [0.7, 0, 0.3], 0.1),
        ("shape = { capsule = [0.5, 1.0] }", [0, 0, 1.3], 0.2),
        ("shape = { capsule = [0.5, 1.0] }", [0.5, 0, 0], -0.1),
        (POLYGON, [2, 2, 1], np.hypot(0, 0.9)),
        (POLYGON, [1.3, 1.4, 1], 0.2),
        (POLYGON, [0.05, 2.5, 1], -0.15),
        (POLYGON, [0.5, 0.5, 2.05], -0.05),
        (POLYGON, [0.5, 0.5, -0.2], 0.1),
    ],
)
def test_distance_and_depth_in_closed_form(tmp_path, shape, at, value):
    a = area_at(tmp_path, shape, at)
    if value > 0:
        assert (a.value, a.verdict) == (pytest.approx(value, abs=1e-9), "within")
        return
    assert a.verdict == "exceeded"
    (box,) = a.parts
    assert box.interval[0] - 1e-9 <= value <= box.interval[1] + 1e-9
    assert box.interval[1] == box.value == a.value == pytest.approx(value, abs=0.01)


def test_several_areas_and_sets_say_who_is_in_which(tmp_path):
    text = AREA.format(name="low", shape=POLYGON) + AREA.format(name="far", shape="shape = { sphere = 0.5 }")
    text += BOX.format(name="one", at=[2, 0.5, 1]) + BOX.format(name="two", at=[0.2, 0.2, 0.2])
    a = results_at(made(tmp_path, text + WATCH.format(area='["low", "far"]', of='["one", "two"]')))["a"]
    assert [p.name for p in a.parts] == ["one in low", "two in low", "two in far"]
    assert a.value == min(p.value for p in a.parts)


def test_an_area_on_a_person_goes_with_the_person(tmp_path):
    person = (
        '[[humans]]\nname = "p"\nstature = 1.75\nmass = 75\nsex = "male"\nat = { position = [5, 0, 0] }\n'
    )
    zone = 'shape = { capsule = [0.6, 0.5] }\non = "p/pelvis"'
    text = person + AREA.format(name="zone", shape=zone)
    for name, at in (("near", [5.5, 0, 0.9]), ("off", [0, 0, 0.9])):
        text += BOX.format(name=name, at=at)
    a = results_at(made(tmp_path, text + WATCH.format(area='"zone"', of='["near", "off"]')))["a"]
    assert [p.name for p in a.parts] == ["near"]


@pytest.mark.parametrize(
    ("shape", "words"),
    [
        (
            "shape = { polygon = [[0, 0], [1, 1], [1, 0], [0, 1]], height = [0, 1] }",
            "crosses or touches itself",
        ),
        ("shape = { polygon = [[0, 0], [1, 0]], height = [0, 1] }", "polygon"),
        ("shape = { polygon = [[0, 0], [1, 0], [1, 1]], height = [1, 1] }", "the lower end comes first"),
        ("shape = { polygon = [[0, 0], [1, 0], [1, 1]] }", "belong together"),
        ("shape = { capsule = [0, 1] }", "larger than 0"),
        ("shape = { capsule = [0.1, 1], sphere = 1 }", "exactly one"),
        ('swept = { of = "arm", start = 3, end = 1 }', "before start"),
        ('swept = { of = "arm", reach = true, end = 1 }', "reach takes no part"),
        ('swept = { of = "arm" }\non = "arm/l1"', "lies in the world"),
        ('swept = { of = "arm", voxel = 1e-6 }', "needs .* MB"),
        ('swept = { of = "arms" }', "'arms'"),
        ('swept = { of = "arm", separation = "gap" }', "criterion of kind separation named 'gap'"),
    ],
)
def test_mistakes_name_the_area_before_the_run(tmp_path, shape, words):
    text = FLOATING + TWO_R + "q = [0, 0]\n" + AREA.format(name="zone", shape=shape)
    with pytest.raises(InputError, match=words) as error:
        made(tmp_path, text, {"arm.urdf": two_r()})
    assert all("areas[0]" in p.key for p in error.value.problems)
    assert all(p.file.endswith("workstation.toml") for p in error.value.problems)


def moving(folder, shape, more="", cache=None):
    """The arm turns from 0 to 90° at its shoulder in two seconds."""
    t = np.linspace(0, 2, 101)
    rows = "".join(f"{x:.4f},{np.pi / 2 * (x / 2) ** 2 * (3 - x):.6f},0\n" for x in t)
    csv = "time [s],j1 [rad],j2 [rad]\n" + rows
    source = '[[sources]]\nkind = "csv"\nrobot = "arm"\nfile = "way.csv"\n'
    text = FLOATING + TWO_R + source + AREA.format(name="zone", shape=shape) + more
    files = {"workstation.toml": text, "arm.urdf": two_r(), "way.csv": csv}
    for name, content in files.items():
        (folder / name).write_text(content)
    return load(folder, cache=cache)


def inside(model: Model, points):
    """Whether points are inside the area, by the winding number of its mesh."""
    from seerob.kernels.tree_file import tree_of
    from seerob.kernels.winding import contains

    (body,) = (b for b in model.bodies if b.name == "zone")
    mesh = body.solids[0].mesh
    tree = tree_of(np.ascontiguousarray(mesh.vertices, float), np.ascontiguousarray(mesh.faces, np.int32))
    assert tree.closed
    return np.array([contains(tree.nodes, tree.links, tree.triangles, *p) for p in points])


def of_the_arm(q, n=400, seed=0):
    rng = np.random.default_rng(seed)
    local = rng.uniform([0, -0.05, -0.05], [2, 0.05, 0.05], (n, 3))
    c, s = np.cos(q), np.sin(q)
    return local @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])


@pytest.mark.parametrize(("part", "reached"), [("", (0, 0.8, np.pi / 2)), (", end = 1.0", (0, 0.4, 0.78))])
def test_a_swept_area_holds_what_the_arm_sweeps_and_little_else(tmp_path, part, reached):
    model = moving(tmp_path, f'swept = {{ of = "arm", voxel = 0.04{part} }}').model
    for q in reached:
        assert inside(model, of_the_arm(q, 200)).all()
    for q in (-0.25, reached[-1] + 0.25):
        assert not inside(model, [[1.8 * np.cos(q), 1.8 * np.sin(q), 0.0]]).any()
    assert any("not less than the truth" in f.text for f in model.findings if f.subject == "zone")


def test_a_swept_area_is_kept_until_a_file_changes(tmp_path):
    shape = 'swept = { of = "arm", voxel = 0.05 }'
    first = moving(tmp_path, shape, cache=tmp_path / "cache").model
    (kept,) = (tmp_path / "cache" / "areas").iterdir()
    stamp = kept.stat().st_mtime_ns
    again = moving(tmp_path, shape, cache=tmp_path / "cache").model
    assert kept.stat().st_mtime_ns == stamp
    same = [next(b for b in m.bodies if b.name == "zone").mesh for m in (first, again)]
    assert same[0] == same[1]
    kept.write_bytes(kept.read_bytes()[:-1] + b"x")
    mended = moving(tmp_path, shape, cache=tmp_path / "cache").model
    assert next(b for b in mended.bodies if b.name == "zone").mesh == same[0]
    moving(tmp_path, shape, more="# another file\n", cache=tmp_path / "cache")
    assert len(list((tmp_path / "cache" / "areas").iterdir())) == 2


def test_the_reachable_area_is_a_disc_and_a_margin_makes_it_wider(tmp_path):
    angle = np.linspace(0, 2 * np.pi, 24)
    rim = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    plain = moving(tmp_path, 'swept = { of = "arm", voxel = 0.05, reach = true }').model
    assert inside(plain, 1.99 * rim).all()
    assert not inside(plain, 2.5 * rim).any()
    wide = moving(tmp_path, 'swept = { of = "arm", voxel = 0.05, reach = true, margin = 0.4 }').model
    assert inside(wide, 2.39 * rim).all()


PERSON = '[[humans]]\nname = "p"\nstature = 1.75\nmass = 75\nsex = "male"\nat = { position = [9, 0, 0] }\n'
GAP = """
[[safety]]
kind = "separation"
name = "gap"
between = ["arm", "p"]
human_speed = 1.6
intrusion = 0.1
stop = { acceleration = 0, reaction = 0.1, stopping = 0.1 }
human_uncertainty = 0.05
"""


def test_an_s_p_hull_holds_every_point_nearer_than_s_p(tmp_path):
    """At rest S_p = 1.6 (0.1 + 0.1) + 0.1 + 0.05 = 0.47 m; in motion it is more."""
    shape = 'swept = { of = "arm", voxel = 0.05, separation = "gap" }'
    model = moving(tmp_path, shape, PERSON + GAP + "robot_uncertainty = 0\n").model
    rng = np.random.default_rng(3)
    away = rng.normal(size=(300, 3))
    away *= 0.46 / np.linalg.norm(away, axis=1, keepdims=True)
    for q in (0.0, np.pi / 2):
        assert inside(model, of_the_arm(q, 300) + away).all()
    middle = np.array([[np.cos(np.pi / 4), np.sin(np.pi / 4), 0.0]])
    # Peak speed of the shoulder 1.18 rad/s: at the tip S_p gains 2.36 · 0.2 m.
    assert inside(model, middle * (2 + 0.47 + 0.4)).all()
    assert not inside(model, middle * (2 + 0.47 + 0.48 + 0.4)).any()


def test_an_s_p_that_is_not_complete_makes_no_hull(tmp_path):
    shape = 'swept = { of = "arm", voxel = 0.05, separation = "gap" }'
    with pytest.raises(InputError, match="Z_r not given") as error:
        moving(tmp_path, shape, PERSON + GAP)
    assert error.value.problems[0].key == "areas[0].swept.separation"


def test_a_grid_is_dilated_by_at_least_the_margin():
    from seerob.model.volumes.swept import Swept
    from seerob.session.areas import _wider

    grid = VoxelGrid(0.05)
    grid.cover(np.zeros(3), np.full(3, 0.2))
    grid.cells[tuple(np.array([2, 2, 2]))] = 1
    grid.count = 1
    corner = (grid.first + 2) * 0.05
    wide = _wider(Swept(grid, 0.0, 0.0, 1, ""), 0.13).grid
    rng = np.random.default_rng(0)
    out = rng.normal(size=(2000, 3))
    out *= 0.129 / np.linalg.norm(out, axis=1, keepdims=True)
    assert wide.contains(corner + rng.uniform(0, 0.05, (2000, 3)) + out).all()


def test_mistakes_behind_a_swept_area_are_told_at_their_own_place_together_with_its_own(tmp_path):
    swept = AREA.format(name="s", shape='swept = { of = "arm", separation = "nosep" }')
    lost = AREA.format(name="l", shape='shape = { box = [1, 1, 1] }\non = "arm/nolink"')
    with pytest.raises(InputError) as error:
        made(tmp_path, TWO_R + swept + lost, {"arm.urdf": two_r()})
    texts = {p.key: p.what for p in error.value.problems}
    assert "nolink" in texts["areas[1]"]
    assert "'nosep'" in texts["areas[0].swept.separation"]
    assert len(texts) == 2
