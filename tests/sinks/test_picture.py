"""Pixels whose colour is known from geometry alone."""

import gzip
import math
from io import BytesIO
from pathlib import Path

import made_run
import numpy as np
import pytest
from PIL import Image, ImageDraw, ImageFont

from seerob.core.errors import InputError
from seerob.core.shapes import Mesh
from seerob.core.snapshot import (
    Arrow,
    Box,
    Highlight,
    Label,
    Node,
    Result,
    Segment,
    Snapshot,
    Sphere,
    Verdict,
)
from seerob.description.shapes.glb import glb_bytes
from seerob.kernels.paint import raster
from seerob.outputs.palette import FILL
from seerob.outputs.picture import lettering
from seerob.outputs.picture.canvas import in_front, look_along
from seerob.outputs.picture.picture import Stage
from seerob.outputs.picture.stage_bodies import creases, read_glb, tone

RED, GREEN = (0.8, 0.1, 0.1, 1), (0.1, 0.7, 0.1, 1)
SIZE = (200, 150)


def stage(*bodies):
    """A stage and a snapshot of bodies (name, glb, position)."""
    nodes = tuple(Node(name=n, role="robot", owner=n, mesh=f"m{i}") for i, (n, _, _) in enumerate(bodies))
    meshes = {f"m{i}": data for i, (_, data, _) in enumerate(bodies)}
    poses = np.array([[*p, 1, 0, 0, 0] for _, _, p in bodies], "<f4")
    return Stage(made_run.scene(nodes=nodes), meshes), Snapshot(seq=0, t=0.0, poses=poses.tobytes())


def view(points=((-1, -1, 0), (1, 1, 2)), azimuth=0.0, elevation=0.0):
    return look_along(azimuth, elevation, np.array(points, float), SIZE)


def pixels(png):
    return np.asarray(Image.open(BytesIO(png)).convert("RGB")).astype(float) / 255


def hue(color):
    color = np.asarray(color, float)[:3]
    return color / np.linalg.norm(color)


def at(image, camera, point):
    (x, y), *_ = camera.project(np.array(point, float))[0]
    return image[int(y), int(x)]


CUBE = made_run.glb(*made_run.box(), color=RED)
BALL = made_run.glb(*made_run.ball(0.4), color=GREEN)


def test_what_is_nearer_covers_what_is_farther_from_both_sides():
    made, snapshot = stage(("ball", BALL, (-2, 0, 1)), ("cube", CUBE, (0, 0, 1)))
    for azimuth, seen in ((0.0, 0), (math.pi, 1)):  # red from the front, green from behind
        camera = view(((-3, -1, 0), (1, 1, 2)), azimuth)
        image = pixels(made.picture(snapshot, camera=camera, size=SIZE))
        assert hue(at(image, camera, (-1, 0, 1))).argmax() == seen


def test_a_highlighted_body_has_the_colour_of_its_verdict_and_others_keep_theirs():
    made, snapshot = stage(("ball", BALL, (0, 1, 1)), ("cube", CUBE, (0, -1, 1)))
    camera = view(((-1, -2, 0), (1, 2, 2)))
    for verdict in (*Verdict, None):
        markers = (Highlight(body="ball", verdict=verdict), Highlight(body="nobody", verdict=verdict))
        image = pixels(made.picture(snapshot, Result(name="r", markers=markers), camera=camera, size=SIZE))
        np.testing.assert_allclose(hue(at(image, camera, (0.4, 1, 1))), hue(FILL[verdict]), atol=0.03)
        assert hue(at(image, camera, (0.5, -1, 1))).argmax() == 0


def test_a_line_in_sight_is_solid_and_a_hidden_one_dashed():
    made, snapshot = stage(("cube", CUBE, (0, 0, 1)))
    camera = look_along(0.0, 0.0, np.array([[-1, -1.2, 0], [1, 1.2, 2.0]]), (800, 600))
    dark = []
    for x in (1.0, -1.0):
        line = Segment(start=(x, -0.45, 1.2), end=(x, 0.45, 1.2), verdict=Verdict.WITHIN)
        image = pixels(
            made.picture(snapshot, Result(name="r", markers=(line,)), camera=camera, size=(800, 600))
        )
        row = [at(image, camera, (x, y, 1.2)) for y in np.linspace(-0.4, 0.4, 200)]
        dark.append(np.mean([p[0] < 0.35 for p in row]))
    assert dark[0] == 1.0
    assert 0.3 < dark[1] < 0.9


def test_a_veil_tints_what_is_behind_it_and_not_what_is_before_it():
    made, snapshot = stage(("cube", CUBE, (0, 0, 1)))
    camera = view()
    plain = pixels(made.picture(snapshot, camera=camera, size=SIZE))
    for x, changed in ((1.5, True), (-1.5, False)):
        ball = Sphere(center=(x, 0, 1), radius=0.3, verdict=Verdict.WITHIN)
        image = pixels(made.picture(snapshot, Result(name="r", markers=(ball,)), camera=camera, size=SIZE))
        assert (at(image, camera, (x, 0, 1))[2] > at(plain, camera, (x, 0, 1))[2] + 0.1) == changed


def test_the_rasteriser_agrees_with_rays_cast_one_by_one():
    rng = np.random.default_rng(3)
    points = rng.uniform(-5, 37, (60, 2))
    inverse = rng.uniform(0.2, 2.0, 60)
    faces = rng.integers(0, 60, (40, 3)).astype(np.int32)
    shape = (30, 32)
    depth, lit, owner = np.zeros(shape), np.zeros(shape), np.full(shape, -1, np.int32)
    raster(points, inverse, inverse, faces, np.arange(40, dtype=np.int32), depth, lit, owner)
    for y in range(shape[0]):
        for x in range(shape[1]):
            best, body = 0.0, -1
            for f, face in enumerate(faces):
                system = np.vstack([points[face].T, np.ones(3)])
                if abs(np.linalg.det(system)) < 1e-12:
                    continue
                weights = np.linalg.solve(system, [x + 0.5, y + 0.5, 1.0])
                if (weights >= 0).all() and weights @ inverse[face] > best:
                    best, body = weights @ inverse[face], f
            assert owner[y, x] == body
            assert depth[y, x] == pytest.approx(best, abs=1e-12)
            assert lit[y, x] == depth[y, x]


def test_triangles_that_reach_behind_the_camera_are_left_out():
    depth, owner = np.zeros((4, 4)), np.full((4, 4), -1, np.int32)
    corners = np.array([[-9.0, -9], [9, -9], [0, 9]])
    for inverse in ([1.0, 1.0, 0.0], [1.0, 1.0, -1.0], [1.0, 1.0, math.nan]):
        face = np.array([[0, 1, 2]], np.int32)
        raster(
            corners, np.array(inverse), np.ones(3), face, np.zeros(1, np.int32), depth, depth.copy(), owner
        )
    assert (owner == -1).all()


@pytest.mark.parametrize("seed", range(10))
def test_the_camera_sees_every_point_and_stands_as_near_as_it_can(seed):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(30, 3)) * rng.uniform(0.2, 5, 3)
    camera = look_along(rng.uniform(-3, 3), rng.uniform(-0.2, 1.4), points, (300, 200), margin=0.1)
    screen, inverse = camera.project(points)
    assert (inverse > 0).all()
    free = np.array([30, 20])
    assert (screen >= free - 1e-6).all()
    assert (screen <= [300, 200] - free + 1e-6).all()
    touched = np.isclose(screen.min(axis=0), free) & np.isclose(screen.max(axis=0), [300, 200] - free)
    assert touched.any() or np.isclose(1 / inverse.max(), 0.3)
    # Up in the world is up in the picture.
    assert camera.axes[1, 2] < 0
    assert np.allclose(camera.axes @ camera.axes.T, np.eye(3))
    assert np.linalg.det(camera.axes) == pytest.approx(1)


def test_the_view_is_chosen_so_that_the_segment_is_in_sight():
    wall = made_run.glb(*made_run.box((0.1, 6, 3)), color=RED)
    for side in (-1, 1):  # a segment behind the wall as seen from the other side
        made, snapshot = stage(("wall", wall, (0, 0, 1.5)))
        ends = ((side * 1.0, -0.5, 1.0), (side * 1.0, 0.5, 1.0))
        line = Segment(start=ends[0], end=ends[1], verdict=Verdict.EXCEEDED)
        vertices, _ = made._bodies.placed(snapshot)
        camera = made._view(vertices, snapshot, Result(name="r", markers=(line,)), (), SIZE)
        assert np.sign(camera.eye[0]) == side


def test_a_short_segment_gets_a_close_up_in_a_corner():
    made, snapshot = stage(("a", CUBE, (0, -0.52, 1)), ("b", CUBE, (0, 0.52, 1)), ("c", CUBE, (0, 6, 1)))
    size = (800, 500)
    looks = {}
    for name, end in (("short", 0.02), ("long", 5.5)):
        line = Segment(start=(0.5, -0.02, 1.2), end=(0.5, end, 1.2), verdict=Verdict.EXCEEDED)
        image = pixels(made.picture(snapshot, Result(name="r", markers=(line,)), size=size))
        corners = [image[:200, :250], image[:200, -250:], image[-200:, :250], image[-200:, -250:]]
        looks[name] = max(np.mean((c[..., 0] > 0.5) & (c[..., 1] < 0.35)) for c in corners)
    assert looks["short"] > 0.3 > looks["long"]


def test_our_own_meshes_come_back_with_colours():
    (v1, f1), (v2, f2) = made_run.box(), made_run.ball(0.3)
    parts = [
        Mesh(v1, f1.astype(np.int32), (0.2, 0.4, 0.6, 1)),
        Mesh(v2, f2.astype(np.int32), (0.9, 0.5, 0.1, 1)),
    ]
    back = read_glb(glb_bytes(parts), "x")
    for part, original in zip(back, parts, strict=True):
        np.testing.assert_allclose(part.color, original.color[:3], atol=1e-5)
        np.testing.assert_allclose(np.linalg.norm(part.normals, axis=1), 1, atol=1e-3)
        np.testing.assert_allclose(part.vertices.min(axis=0), original.vertices.min(axis=0), atol=1e-6)
        assert len(part.faces) <= len(original.faces)
    assert read_glb(glb_bytes([]), "x") == ()


def test_broken_meshes_end_in_one_kind_of_error():
    rng = np.random.default_rng(4)
    for cut in range(0, len(CUBE), 7):
        with pytest.raises(InputError, match="head: mesh"):
            read_glb(CUBE[:cut], "head")
    for position in rng.integers(0, len(CUBE), 300):
        data = bytearray(CUBE)
        data[position] ^= int(rng.integers(1, 256))
        try:
            read = read_glb(bytes(data), "head")
        except InputError:
            continue
        for part in read:
            assert np.isfinite(part.vertices).all()
            assert part.faces.max(initial=-1) < len(part.vertices)


def test_every_marker_and_every_odd_pose_gives_a_picture():
    made, snapshot = stage(("cube", CUBE, (0, 0, 1)))
    markers = (
        *made_run.snapshot(3).results[1].markers,
        Arrow(origin=(0, 0, 1), vector=(0, 0, 0), label="none"),
        Segment(start=(0, 0, 1), end=(0, 0, 1)),
        Segment(start=(0, 0, 1), end=(1e6, 0, 1), label="far"),
        Box(center=(0, 0, 0), wxyz=(1, 0, 0, 0), size=(0, 0, 0)),
        Label(position=(0, 0, 1), text="x" * 500),
    )
    nowhere = Snapshot(seq=0, t=0.0, poses=np.zeros((1, 7), "<f4").tobytes())
    for each in (snapshot, nowhere):
        image = pixels(made.picture(each, Result(name="r", markers=markers), size=SIZE))
        assert image.shape == (150, 200, 3)
    empty = Stage(made_run.scene(nodes=()), {})
    assert pixels(empty.picture(Snapshot(seq=0, t=0.0, poses=b""), size=SIZE)).shape == (150, 200, 3)


@pytest.mark.parametrize("size", [12, 19, 40])
@pytest.mark.parametrize("text", ["separation 0.123 m", "✓ ✕ ↔ äöéÅŁß", "Ωμ Жд", "x", " ", "\U0001f600", ""])
def test_words_are_those_that_pillow_writes(text, size):
    packed = Path(lettering.__file__).with_name("DejaVuSans-Bold.ttf.gz").read_bytes()
    peer = ImageFont.truetype(BytesIO(gzip.decompress(packed)), size, layout_engine=ImageFont.Layout.BASIC)
    # Its hinting sets letters on whole pixels.
    assert lettering.width(text, size) == pytest.approx(peer.getlength(text), abs=0.51 * max(len(text), 1))
    ours = np.full((80, 700, 3), 255, np.uint8)
    lettering.write(ours, (350, 40), text, (0.0, 0.0, 0.0), size)
    image = Image.new("RGB", (700, 80), "white")
    ImageDraw.Draw(image).text((350, 40), text, fill="black", font=peer, anchor="mm")
    ink, other = 1 - ours[..., 0] / 255, 1 - np.asarray(image)[..., 0] / 255
    assert ink.sum() == pytest.approx(other.sum(), rel=0.12)
    if other.any():
        middle, peers = ((np.argwhere(i > 0.3)).mean(axis=0) for i in (ink, other))
        np.testing.assert_allclose(middle, peers, atol=0.15 * size)


def test_words_have_a_light_rim_and_are_cut_off_at_the_edge():
    dark = np.zeros((60, 200, 3), np.uint8)
    lettering.write(dark, (100, 30), "I", (1.0, 0.0, 0.0), 30)
    row = dark[30]
    red = np.flatnonzero((row[:, 0] > 250) & (row[:, 1] < 5))
    white = np.flatnonzero((row > 250).all(axis=1))
    assert len(red) >= 4
    assert {red[0] - 2, red[-1] + 2} <= set(white.tolist())
    assert not row[red[0] - 6].any()
    for at in ((0, 0), (199, 59), (-900, 30), (100, 900)):
        lettering.write(dark, at, "words", (1.0, 1.0, 1.0), 30)


def test_a_picture_is_read_back_pixel_by_pixel():
    rng = np.random.default_rng(1)
    for shape in ((1, 1, 3), (7, 5, 3), (40, 60, 3)):
        made = rng.integers(0, 256, shape).astype(np.uint8)
        np.testing.assert_array_equal(np.asarray(Image.open(BytesIO(lettering.png(made)))), made)


def area(alpha=0.25, size=(1, 1, 1)):
    vertices, faces = made_run.box(size)
    return glb_bytes([Mesh(vertices, faces.astype(np.int32), (0.9, 0.9, 0.1, alpha))])


def test_an_area_tints_what_is_behind_it_and_hides_nothing():
    made, snapshot = stage(("cube", CUBE, (0, 0, 1)), ("area", area(), (1.5, 0, 1)))
    alone, _ = stage(("cube", CUBE, (0, 0, 1)))
    camera = view()
    center = (0.5, 0.1, 1.1)
    tinted = at(pixels(made.picture(snapshot, camera=camera, size=SIZE)), camera, center)
    plain = at(
        pixels(alone.picture(Snapshot(seq=0, t=0.0, poses=snapshot.poses[:28]), camera=camera, size=SIZE)),
        camera,
        center,
    )
    assert tinted.argmax() == plain.argmax() == 0  # still the red of the cube
    assert 0.02 < np.abs(tinted - plain).max() < 0.3
    lit = Result(name="r", markers=(Highlight(body="area", verdict=Verdict.EXCEEDED),))
    highlighted = at(pixels(made.picture(snapshot, lit, camera=camera, size=SIZE)), camera, center)
    assert hue(highlighted).argmax() == 0
    assert np.abs(highlighted - tinted).max() > 0.02


def test_an_area_moves_the_camera_only_when_it_is_a_subject():
    bodies = (("ball", BALL, (0, 0, 1)), ("area", area(size=(6, 6, 3)), (5, 0, 1)))
    made, snapshot = stage(*bodies)
    alone, only = stage(bodies[0])
    line = Result(name="r", markers=(Segment(start=(0.4, 0, 1), end=(0.6, 0, 1)),))

    def eye(made, snapshot, subjects):
        return made._view(made._bodies.placed(snapshot)[0], snapshot, line, subjects, SIZE).eye

    np.testing.assert_allclose(eye(made, snapshot, ()), eye(alone, only, ()))
    far = np.linalg.norm(eye(made, snapshot, ("ball", "area")) - [0, 0, 1])
    assert far > 2 * np.linalg.norm(eye(made, snapshot, ("ball",)) - [0, 0, 1])


def test_creases_of_a_box_are_its_twelve_edges_and_a_ball_has_none():
    vertices, faces = made_run.box((1, 2, 3))
    for v, f in ((vertices, faces), (vertices[faces].reshape(-1, 3), np.arange(36).reshape(-1, 3))):
        edges = v[creases(v, f.astype(np.int32))]
        lengths = np.linalg.norm(edges[:, 0] - edges[:, 1], axis=1)
        assert sorted(np.round(lengths, 9)) == [1.0] * 4 + [2.0] * 4 + [3.0] * 4
    ball, around = made_run.ball(0.4, 24)
    assert len(creases(ball, around.astype(np.int32))) == 0
    assert len(creases(vertices, faces[:1].astype(np.int32))) == 3  # an open end is an edge


@pytest.mark.parametrize("seed", range(5))
def test_triangles_are_cut_where_the_camera_is(seed):
    rng = np.random.default_rng(seed)
    camera = view()
    corners = camera.eye + rng.normal(size=(200, 3, 3))

    def area_in_front(triangles):
        fine = np.concatenate(list(subdivided(triangles, 4)))
        normal = np.cross(fine[:, 1] - fine[:, 0], fine[:, 2] - fine[:, 0])
        inside = camera.local(fine.mean(axis=1))[:, 2] > 0.04
        return np.linalg.norm(normal, axis=1)[inside].sum() / 2

    def subdivided(triangles, depth):
        if depth == 0:
            yield triangles
            return
        a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
        ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
        for part in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)):
            yield from subdivided(np.stack(part, 1), depth - 1)

    cut = in_front(camera, corners)
    assert (camera.local(cut)[:, 2] >= 0.04 - 1e-9).all()
    whole = np.linalg.norm(np.cross(cut[:, 1] - cut[:, 0], cut[:, 2] - cut[:, 0]), axis=1).sum() / 2
    assert whole == pytest.approx(area_in_front(corners), rel=0.01)


def test_people_look_unlike_robots_and_neighbours_unlike_each_other():
    grey = np.array([0.7, 0.72, 0.75])
    person, robot = tone("human", grey, 0), tone("robot", grey, 0)
    assert person[0] > person[1] > person[2]  # warm
    assert np.abs(person - robot).max() > 0.08
    for role in ("human", "robot"):
        assert np.abs(tone(role, grey, 0) - tone(role, grey, 1)).max() > 0.04
    np.testing.assert_array_equal(tone("tool", grey, 3), grey)
