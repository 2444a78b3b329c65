"""What a mesh lacks at its openings: nothing is within that would not be with a surface there."""

from itertools import product

import manifold3d
import numpy as np
import pytest
import trimesh

import made_cell
from made_cell import FLOATING, TWO_R, judged, made, two_r
from seerob.core.errors import InputError
from seerob.core.shapes import Mesh
from seerob.description.shapes import openings
from seerob.description.shapes.mesh_bodies import is_closed, winding_number
from seerob.twin.engine import Engine

SAID = {"": "", "open": 'openings = "open"\n', "closed": 'openings = "closed"\n'}
PROBES = 12


def cut(mesh, normal, offset):
    """What is above a plane, and without its flat lid there: manifold3d caps it."""
    whole = manifold3d.Mesh64(
        vert_properties=np.ascontiguousarray(mesh.vertices, float),
        tri_verts=np.ascontiguousarray(mesh.faces, np.uint64),
    )
    found = manifold3d.Manifold(whole).trim_by_plane(normal, offset).to_mesh64()
    vertices, faces = np.array(found.vert_properties[:, :3]), np.array(found.tri_verts)
    on = (np.abs(vertices @ normal - offset) < 1e-9)[faces].all(axis=1)
    return (trimesh.Trimesh(vertices, f, process=False) for f in (faces, faces[~on]))


def solids(rng):
    """Closed ones, convex or not, with one opening or several where they are cut."""
    yield trimesh.creation.cylinder(0.15, 0.3, sections=int(rng.integers(5, 24)))
    yield trimesh.creation.icosphere(2, 0.18)
    yield trimesh.creation.torus(0.15, 0.06, major_sections=16, minor_sections=8)
    yield trimesh.creation.annulus(0.08, 0.15, 0.25, sections=16)
    yield trimesh.creation.box((0.25, 0.2, 0.3))


def table(name, mesh, said=""):
    return f'[[parts]]\nname = "{name}"\nmesh = "{mesh}.ply"\nunits = "m"\nup = "z"\n{SAID.get(said, said)}'


def probed(folder, mesh, said, places, limits):
    """Distances of small balls to a part of that mesh, as they are judged."""
    text = table("cup", "cup", said)
    for i, (place, limit) in enumerate(zip(places.tolist(), limits.tolist(), strict=True)):
        text += (
            f'[[parts]]\nname = "p{i}"\nshape = {{ sphere = 0.02 }}\nat = {{ position = {place} }}\n'
            f'[[safety]]\nkind = "minimum_distance"\nname = "d{i}"\nbetween = ["cup", "p{i}"]\n'
            f"limit = {limit}\n"
        )
    station = made(folder, text, {"cup.ply": mesh.export(file_type="ply")})
    return judged(station.bound, Engine(station.model).start()), station


@pytest.mark.parametrize("seed", range(6))
def test_within_by_an_open_mesh_is_within_with_a_flat_lid_too(tmp_path, seed):
    """The lid is that of manifold3d; of random solids, planes, places and limits."""
    rng = np.random.default_rng(seed)
    decided = 0
    for k, solid in enumerate(solids(rng)):
        normal = rng.normal(size=3)
        normal /= np.linalg.norm(normal)
        capped, bare = cut(solid, normal, rng.uniform(-0.08, 0.05))
        assert capped.is_watertight
        assert not bare.is_watertight
        places = rng.uniform(-0.3, 0.3, (PROBES, 3))
        # Just in front of the lid, too.
        lid = capped.triangles_center[np.abs(capped.face_normals @ normal + 1) < 1e-6]
        places[: PROBES // 2] = lid[rng.integers(len(lid), size=PROBES // 2)]
        places[: PROBES // 2] += -normal * rng.uniform(-0.05, 0.1, PROBES // 2)[:, None]
        limits = rng.uniform(0.006, 0.1, PROBES)
        each = product((bare, capped), [*SAID])
        found = {
            (mesh is capped, said): probed(
                tmp_path / f"{k}{mesh is capped}{said}", mesh, said, places, limits
            )[0]
            for mesh, said in each
            if not (mesh is capped and said)
        }
        for unsaid, as_open, closed, real in zip(
            *(found[key] for key in ((False, ""), (False, "open"), (False, "closed"), (True, ""))),
            strict=True,
        ):
            if unsaid.verdict == "within":
                assert real.verdict == as_open.verdict == closed.verdict == "within"
            assert unsaid.value == as_open.value
            assert unsaid.verdict == "undecided" or unsaid.verdict == as_open.verdict
            if closed.verdict == "within":
                assert real.verdict == "within"
            if real.value > 0:
                assert min((unsaid.value, *(unsaid.interval or ()))) <= real.value + 1e-9
                assert closed.value <= real.value + 1e-9
            if unsaid.verdict == "undecided":
                assert "rests on openings of cup" in unsaid.reason
                decided += as_open.verdict == "within" and real.verdict != "within"
    assert decided  # some rest on the lid alone


@pytest.mark.parametrize("seed", range(6))
def test_triangles_left_out_of_a_closed_mesh_make_nothing_within(tmp_path, seed):
    """Of flat faces any, be it that bands and several patches are missing: rims hold what is lost."""
    rng = np.random.default_rng(seed)
    size = rng.uniform(0.1, 0.3, 3)
    box = trimesh.creation.box(size).subdivide().subdivide()
    ends = box.vertices[box.faces]
    inner = ~(np.abs(np.abs(ends) - size / 2) < 1e-9).all(axis=1).sum(axis=1).astype(bool)
    assert not inner.any()
    # Corners stay: with one of them all that is lost is in the hull of what is left.
    corners = (np.abs(np.abs(ends) - size / 2) < 1e-9).all(axis=2).any(axis=1)
    kept = corners | (rng.random(len(box.faces)) > rng.uniform(0.05, 0.9))
    bare = trimesh.Trimesh(box.vertices, box.faces[kept], process=False)
    places, limits = rng.uniform(-0.2, 0.2, (2 * PROBES, 3)), rng.uniform(0.006, 0.1, 2 * PROBES)
    real, _ = probed(tmp_path / "closed", box, "", places, limits)
    found, _ = probed(tmp_path / "bare", bare, "", places, limits)
    for less, more in zip(found, real, strict=True):
        assert less.verdict != "within" or more.verdict == "within", (less, more)


def test_a_sheet_and_slits_that_rounding_leaves_change_nothing(tmp_path):
    sheet = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    places, limits = np.array([[0.5, 0.5, 0.3], [1.2, 0.5, 0.0]]), np.array([0.2, 0.1])
    found, _ = probed(tmp_path / "sheet", sheet, "", places, limits)
    assert [each.verdict for each in found] == ["within", "within"]
    assert [each.value for each in found] == pytest.approx([0.28, 0.18])
    box = trimesh.creation.box((0.4, 0.4, 0.4))
    vertices = box.vertices[box.faces].reshape(-1, 3)
    vertices[::5] += 1e-7
    torn = Mesh(vertices, np.arange(len(vertices), dtype=np.int32).reshape(-1, 3))
    assert not is_closed(torn)
    assert openings.possibly_closed(torn) == ()


def test_a_heap_of_triangles_is_closed_by_its_hull():
    rng = np.random.default_rng(0)
    ball = trimesh.creation.icosphere(3, 0.5)
    heap = ball.vertices[ball.faces[rng.permutation(len(ball.faces))[:900]]] * rng.uniform(
        0.99, 1.01, (900, 1, 1)
    )
    mesh = Mesh(heap.reshape(-1, 3), np.arange(2700, dtype=np.int32).reshape(-1, 3))
    (lid,) = openings.possibly_closed(mesh)
    assert is_closed(lid)
    assert all(winding_number(lid, point) == pytest.approx(1) for point in 0.999 * mesh.vertices[::100])
    assert openings.closed(mesh)[0] is mesh


def test_a_depth_says_that_openings_are_closed_so_far_beyond_their_rims(tmp_path):
    box = trimesh.creation.box((0.4, 0.4, 0.4))
    bare = trimesh.Trimesh(box.vertices, box.faces[box.face_normals[:, 2] < 0.5], process=False)
    place, limit = np.array([[0.0, 0.0, 0.5]]), np.array([0.3])
    ((none,), _), ((flat,), _), ((deep,), _) = (
        probed(tmp_path / f"{i}", bare, said, place, limit)
        for i, said in enumerate(("", "hole_depth = 0\n", "hole_depth = 0.1\n"))
    )
    assert none.verdict == "undecided"
    assert none.interval == pytest.approx((0.28, np.hypot(0.2, 0.3) - 0.02))
    assert flat.value == pytest.approx(0.28)
    assert deep.value == pytest.approx(0.18)
    assert flat.verdict == deep.verdict == "exceeded"


@pytest.mark.parametrize(
    ("mesh", "said", "what"),
    [
        (True, "open", "is closed, and has no openings"),
        (True, "closed", "is closed, and has no openings"),
        (False, 'openings = "open"\nhole_depth = 0.1\n', "hole_depth is of openings that are closed"),
        (False, 'openings = "ajar"\n', "openings"),
    ],
)
def test_the_key_is_refused_where_it_says_nothing(tmp_path, mesh, said, what):
    box = trimesh.creation.box((0.4, 0.4, 0.4))
    shape = box if mesh else trimesh.Trimesh(box.vertices, box.faces[2:], process=False)
    with pytest.raises(InputError, match=what):
        probed(tmp_path, shape, said, np.zeros((0, 3)), np.zeros(0))
    with pytest.raises(InputError, match="openings are of a mesh"):
        made(tmp_path, '[[parts]]\nname = "a"\nshape = { sphere = 0.1 }\nopenings = "open"\n')


def arm_with_a_cup(folder, said, limit):
    """An arm that turns by a post, with a cup at its end whose mouth is turned outward."""
    cup = trimesh.creation.box((0.3, 0.3, 0.3))
    cup = trimesh.Trimesh(cup.vertices, cup.faces[cup.face_normals[:, 0] < 0.5], process=False)
    text = (
        FLOATING
        + TWO_R
        + f'[[tools]]\nname = "cup"\non = "arm/tip"\nmesh = "cup.ply"\nunits = "m"\nup = "z"\nmass = 1\n'
        f"at = {{ position = [0.15, 0, 0] }}\n{SAID[said]}"
        + '[[parts]]\nname = "post"\nshape = { sphere = 0.01 }\nat = { position = [2.5, 0, 0] }\n'
        + f'[[safety]]\nkind = "minimum_distance"\nname = "d"\nbetween = ["arm", "post"]\nlimit = {limit}\n'
    )
    return made(folder, text, {"arm.urdf": two_r(), "cup.ply": cup.export(file_type="ply")})


SWING = np.linspace(-0.5, 0.5, 41)


@pytest.mark.parametrize("limit", [0.2, 0.22])
def test_many_instants_are_judged_as_each_by_itself(tmp_path, limit):
    cells = {said: arm_with_a_cup(tmp_path / f"s{said}", said, limit) for said in SAID}
    q, qd = np.column_stack([SWING, -SWING]), np.tile([1.0, -1.0], (len(SWING), 1))
    said = {}
    for name, cell in cells.items():
        column = cell.batch(q={"arm": q}, qd={"arm": qd}, t=SWING)["d"]
        alone = [made_cell.results_at(cell, arm=each)["d"] for each in zip(q, qd, strict=True)]
        assert column.value == pytest.approx([each.value for each in alone])
        assert [made_cell_code(each) for each in alone] == column.answers.verdict.tolist()
        said[name] = [str(each.verdict) for each in alone]
        for each, reason in zip(alone, column.reasons, strict=True):
            assert ("openings" in reason) == (each.verdict == "undecided")
    assert {*zip(said["open"], said["closed"], said[""], strict=True)} <= {
        ("within", "within", "within"),
        ("within", "exceeded", "undecided"),
        ("exceeded", "exceeded", "exceeded"),
    }
    assert "undecided" in said[""]


def made_cell_code(result):
    from seerob.recording.series import CODES

    return CODES[result.verdict]
