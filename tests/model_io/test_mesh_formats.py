"""Every format read back equals what was written, in metres, z up."""

import io
import json

import numpy as np
import pytest
import trimesh

from seerob.core.errors import InputError
from seerob.core.transforms import rotation_from_rpy, transform
from seerob.description.mesh import load_meshes
from seerob.description.shapes.moments import combined, of_closed_mesh

L_SHAPE = trimesh.creation.box((0.3, 0.1, 0.1)).union(
    trimesh.creation.box((0.1, 0.1, 0.3)).apply_translation([-0.1, 0.02, 0.1])
)


def moments(loaded):
    return combined(of_closed_mesh(m) for m in loaded.plain())


def assert_same_body(loaded, body, tolerance=1e-6):
    """Volume, centre and inertia tell position, orientation, unit, handedness and winding at once."""
    found = moments(loaded)
    assert found.volume == pytest.approx(body.volume, rel=tolerance)
    np.testing.assert_allclose(found.com, body.center_mass, atol=tolerance)
    np.testing.assert_allclose(found.inertia, body.moment_inertia, rtol=1e-4, atol=tolerance**2)


@pytest.mark.parametrize("form", ["stl", "stl_ascii", "obj", "ply", "ply_ascii", "off"])
@pytest.mark.parametrize(("units", "meters"), [("m", 1.0), ("mm", 1e-3), ("inch", 0.0254)])
def test_formats_without_a_unit_are_read_in_the_one_that_is_said(tmp_path, form, units, meters):
    body = L_SHAPE.copy().apply_scale(1 / meters)
    path = tmp_path / f"part.{form.split('_')[0]}"
    if form == "ply_ascii":
        path.write_bytes(trimesh.exchange.ply.export_ply(body, encoding="ascii"))
    else:
        body.export(path, file_type=form)
    loaded = load_meshes(path, units=units)
    assert_same_body(loaded, L_SHAPE, 1e-5)
    assert len(loaded.plain()[0].vertices) == len(L_SHAPE.vertices)
    assert [f.level for f in loaded.findings if "up" in f.text] == ["assumed"]
    assert loaded.files == {path.name: path.read_bytes()}


@pytest.mark.parametrize(
    ("up", "rpy"), [("z", (0, 0, 0)), ("y", (np.pi / 2, 0, 0)), ("x", (0, -np.pi / 2, np.pi / 2))]
)
def test_the_up_axis_of_the_file_becomes_z(tmp_path, up, rpy):
    L_SHAPE.export(tmp_path / "part.stl")
    turned = L_SHAPE.copy().apply_transform(transform(rotation_from_rpy(rpy)))
    loaded = load_meshes(tmp_path / "part.stl", units="m", up=up)
    assert_same_body(loaded, turned)
    axis = np.eye(3)["xyz".index(up)]
    np.testing.assert_allclose(rotation_from_rpy(rpy) @ axis, [0, 0, 1], atol=1e-12)
    assert not loaded.findings


def test_a_mirroring_scale_keeps_normals_outward(tmp_path):
    L_SHAPE.export(tmp_path / "part.stl")
    mirrored = L_SHAPE.copy().apply_transform(np.diag([1, -2, 1, 1]))
    assert_same_body(load_meshes(tmp_path / "part.stl", units="m", up="z", scale=(1, -2, 1)), mirrored)


@pytest.mark.parametrize(
    ("extent", "proposal"), [(1250, '"mm"'), (1.25, '"m"'), (49.2, '"mm"'), (1e5, '"um"'), (1e-9, "one of m")]
)
def test_a_missing_unit_is_an_error_that_proposes_a_plausible_one(tmp_path, extent, proposal):
    trimesh.creation.box((extent, extent / 2, extent / 3)).export(tmp_path / "part.stl")
    with pytest.raises(InputError, match="does not say its unit") as caught:
        load_meshes(tmp_path / "part.stl")
    assert proposal in caught.value.problems[0].remedy
    assert caught.value.problems[0].key == "units"


def scene_with_instances():
    scene = trimesh.Scene(base_frame="world")
    scene.graph.update("fixture", "world", matrix=transform(rotation_from_rpy((0.3, 0.4, 0.5)), (1, 2, 3)))
    pin = trimesh.creation.cylinder(0.01, 0.1)
    scene.add_geometry(
        pin, "pin_1", "pin", parent_node_name="fixture", transform=transform(None, (0.1, 0, 0))
    )
    scene.graph.update("pin_2", "fixture", matrix=np.diag([-2.0, 1, 1, 1]), geometry="pin")
    plate = L_SHAPE.copy()  # without the normals that other tests had computed, which would be exported
    scene.add_geometry(plate, "plate", "plate", parent_node_name="fixture")
    return scene


@pytest.mark.parametrize("form", ["glb", "gltf"])
def test_gltf_instances_keep_their_places_and_full_names_and_turn_z_up_once(tmp_path, form):
    scene = scene_with_instances()
    if form == "glb":
        (tmp_path / "line.glb").write_bytes(scene.export(file_type="glb"))
    else:
        for name, content in scene.export(file_type="gltf").items():
            (tmp_path / name.replace("model", "line")).write_bytes(content)
    loaded = load_meshes(tmp_path / f"line.{form}")
    whole = scene.to_geometry().apply_transform(transform(rotation_from_rpy((np.pi / 2, 0, 0))))
    assert_same_body(loaded, whole)
    last = {"/".join(m.name.split("/")[-2:]) for m in loaded.meshes}
    assert {"fixture/plate", "fixture/pin_2"} <= last
    assert len(last) == len(loaded.meshes) == 3
    # The text form keeps its data in files beside it: they are part of what was read.
    assert len(loaded.files) == (1 if form == "glb" else 1 + len(list(tmp_path.glob("*.bin"))))
    assert all(len(h) == 64 for h in loaded.hashes().values())
    assert not loaded.findings


def test_a_unit_that_contradicts_the_file_wins_and_is_told(tmp_path):
    (tmp_path / "a.glb").write_bytes(L_SHAPE.export(file_type="glb"))
    loaded = load_meshes(tmp_path / "a.glb", units="mm", up="y")
    assert moments(loaded).volume == pytest.approx(L_SHAPE.volume * 1e-9, rel=1e-4)
    assert [f.level for f in loaded.findings] == ["warning"]


@pytest.mark.parametrize("up", ["X_UP", "Y_UP", "Z_UP"])
def test_collada_says_its_unit_and_axis(tmp_path, up):
    text = L_SHAPE.copy().apply_scale(1000).export(file_type="dae").decode()
    assert "<up_axis>" in text
    start, end = text.index("<up_axis>"), text.index("</up_axis>")
    text = text[:start] + f'<unit name="millimeter" meter="0.001"/><up_axis>{up}' + text[end:]
    (tmp_path / "part.dae").write_text(text)
    L_SHAPE.export(tmp_path / "part.stl")
    loaded = load_meshes(tmp_path / "part.dae")
    expected = load_meshes(tmp_path / "part.stl", units="m", up=up[0].lower())
    assert moments(loaded).volume == pytest.approx(L_SHAPE.volume, rel=1e-5)
    np.testing.assert_allclose(moments(loaded).inertia, moments(expected).inertia, atol=1e-8)
    assert not loaded.findings
    assert moments(load_meshes(tmp_path / "part.dae", units="m")).volume == pytest.approx(
        L_SHAPE.volume * 1e9, rel=1e-5
    )


def test_collada_without_asset_is_assumed_to_be_what_the_standard_says(tmp_path):
    text = L_SHAPE.export(file_type="dae").decode()
    start, end = text.index("<up_axis>"), text.index("</up_axis>") + len("</up_axis>")
    (tmp_path / "part.dae").write_text(text[:start] + text[end:])
    loaded = load_meshes(tmp_path / "part.dae")
    assert sorted(f.level for f in loaded.findings) == ["assumed", "assumed"]
    assert moments(loaded).volume == pytest.approx(L_SHAPE.volume, rel=1e-5)


@pytest.mark.parametrize(("unit", "meters"), [(None, 1e-3), ("inch", 0.0254), ("meter", 1.0)])
def test_3mf_components_and_units(tmp_path, unit, meters):
    scene = trimesh.Scene()
    scene.add_geometry(L_SHAPE, "plate", transform=transform(rotation_from_rpy((0.1, 0.2, 0.3)), (4, 5, 6)))
    scene.add_geometry(L_SHAPE.copy(), "other", transform=transform(None, (-1, 0, 0)))
    data = io.BytesIO(scene.export(file_type="3mf"))
    import zipfile

    path = tmp_path / "part.3mf"
    with zipfile.ZipFile(data) as old, zipfile.ZipFile(path, "w") as new:
        for name in old.namelist():
            content = old.read(name)
            if name.endswith(".model"):
                head, _, rest = content.partition(b">")
                while b"<model" not in head:
                    more, _, rest = rest.partition(b">")
                    head += b">" + more
                start = head.find(b' unit="')
                if start >= 0:
                    end = head.index(b'"', start + 7) + 1
                    head = head[:start] + head[end:]
                content = head + (b"" if unit is None else f' unit="{unit}"'.encode()) + b">" + rest
            new.writestr(name, content)
    whole = scene.to_geometry().apply_scale(meters)
    loaded = load_meshes(path)
    assert moments(loaded).volume == pytest.approx(whole.volume, rel=1e-6)
    np.testing.assert_allclose(moments(loaded).com, whole.center_mass, atol=1e-6 * meters)
    assert len({m.name for m in loaded.meshes}) == 2


def test_obj_colours_objects_negative_indices_and_concave_polygons(tmp_path):
    (tmp_path / "part.mtl").write_text("newmtl red\nKd 1 0 0\nd 0.5\nnewmtl blue\nKd 0 0 1\n")
    (tmp_path / "part.obj").write_text(
        "mtllib part.mtl\no first\nusemtl red\n"
        # A concave quadrilateral, an arrow head: a fan from its first corner would leave it.
        "v 0 0 0\nv 2 -1 0\nv 0.5 0 0\nv 2 1 0\nf 4 1 2 3\n"
        "o second\nusemtl blue\nv 0 0 1\nv 1 0 1\nv 0 1 1\nf -3/1/1 -2//2 \\\n-1\n"
    )
    first, second = load_meshes(tmp_path / "part.obj", units="m", up="z").meshes
    assert (first.name, second.name) == ("first/red", "second/blue")
    assert first.mesh.color == (1, 0, 0, 0.5)
    assert second.mesh.color == (0, 0, 1, 1)
    a, b, c = np.moveaxis(first.mesh.vertices[first.mesh.faces], 1, 0)
    areas = np.cross(b - a, c - a)[:, 2] / 2
    assert (areas > 0).all()
    assert areas.sum() == pytest.approx(0.5)
    np.testing.assert_array_equal(second.mesh.vertices, [[0, 0, 1], [1, 0, 1], [0, 1, 1]])


TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"


def test_obj_is_read_here_because_trimesh_changes_its_surface_without_a_word(tmp_path):
    def by_trimesh(text):
        return trimesh.load_scene(io.BytesIO(text.encode()), file_type="obj").to_mesh()

    def by_us(text):
        (tmp_path / "part.obj").write_text(text)
        return load_meshes(tmp_path / "part.obj", units="m", up="z").meshes

    arrow = "v 0 0 0\nv 2 -1 0\nv 0.5 0 0\nv 2 1 0\nf 4 1 2 3\n"
    assert by_trimesh(arrow).area == pytest.approx(3.5)
    (mesh,) = by_us(arrow)
    a, b, c = np.moveaxis(mesh.mesh.vertices[mesh.mesh.faces], 1, 0)
    assert np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2 == pytest.approx(0.5)
    for broken, message in (("f 1 2 3\nf 1 2\n", "2 corners"), ("f 1 2 0\n", "names vertex")):
        assert len(by_trimesh(TRIANGLE + broken).faces) == 1
        with pytest.raises(InputError, match=message):
            by_us(TRIANGLE + broken)
    objects = f"o a\n{TRIANGLE}f 1 2 3\no b\n{TRIANGLE}f 4 5 6\n"
    assert len(trimesh.load_scene(io.BytesIO(objects.encode()), file_type="obj").geometry) == 1
    assert [m.name for m in by_us(objects)] == ["a", "b"]


def test_gltf_colours_are_linear_in_the_file_and_srgb_here(tmp_path):
    scene = trimesh.Scene(trimesh.creation.box((1, 1, 1)))
    data = scene.export(file_type="gltf")
    tree = json.loads(data["model.gltf"])
    tree["materials"] = [{"pbrMetallicRoughness": {"baseColorFactor": [0.2140411, 0, 1, 1]}}]
    tree["meshes"][0]["primitives"][0]["material"] = 0
    for name, content in data.items():
        (tmp_path / name).write_bytes(json.dumps(tree).encode() if name.endswith("gltf") else content)
    assert load_meshes(tmp_path / "model.gltf").plain()[0].color == pytest.approx((0.5, 0, 1, 1), abs=1e-6)


def test_more_faces_than_mujoco_reads_from_an_stl(tmp_path):
    sphere = trimesh.creation.icosphere(7, 0.5)
    sphere.export(tmp_path / "ball.stl")
    loaded = load_meshes(tmp_path / "ball.stl", units="m", up="z").plain()[0]
    assert (len(loaded.vertices), len(loaded.faces)) == (len(sphere.vertices), 327_680)


def test_what_says_nothing_is_dropped_and_told(tmp_path):
    box = trimesh.creation.box((1, 1, 1))
    faces = np.vstack([box.faces, box.faces[:3, [1, 2, 0]], [[0, 0, 1]]])
    trimesh.Trimesh(box.vertices, faces, process=False).export(tmp_path / "box.stl")
    loaded = load_meshes(tmp_path / "box.stl", units="m", up="z")
    assert len(loaded.plain()[0].faces) == 12
    (finding,) = loaded.findings
    assert "1 triangles without area" in finding.text
    assert "3 repeated triangles" in finding.text


def test_ascii_solids_have_their_names_and_equal_names_become_unique(tmp_path):
    text = trimesh.creation.box((1, 1, 1)).export(file_type="stl_ascii")
    body = text[text.index("\n") : text.rindex("endsolid")]
    (tmp_path / "a.stl").write_text("".join(f"solid pin\n{body}endsolid pin\n" for _ in range(2)))
    assert [m.name for m in load_meshes(tmp_path / "a.stl", units="m").meshes] == ["pin", "pin_2"]
