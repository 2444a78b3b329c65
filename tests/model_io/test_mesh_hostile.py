"""Broken and hostile mesh files end in one clear error; nothing outside their folder is touched."""

import io
import json
import struct
import zipfile

import numpy as np
import pytest
import trimesh

from seerob.core.errors import InputError
from seerob.description.mesh import load_meshes

BOX = trimesh.creation.box((1, 1, 1))


def written(form):
    if form == "dae":
        return BOX.export(file_type="dae")
    data = trimesh.Scene(BOX).export(file_type=form) if form in {"glb", "3mf"} else BOX.export(file_type=form)
    return data if isinstance(data, bytes) else data.encode()


@pytest.mark.parametrize("form", ["stl", "stl_ascii", "obj", "ply", "off", "glb", "dae", "3mf"])
@pytest.mark.parametrize("kept", [0.9, 0.5, 0.1])
def test_truncated_files_are_errors_that_name_the_file(tmp_path, form, kept):
    data = written(form)
    path = tmp_path / f"part.{form.split('_')[0]}"
    if form == "obj":
        data = data[: data.rindex(b"f ") + 4] if kept == 0.9 else data[: data.index(b"f ")]
    else:
        data = data[: int(kept * len(data))]
    path.write_bytes(data)
    with pytest.raises(InputError) as caught:
        load_meshes(path, units="m", up="z")
    assert caught.value.problems[0].file == str(path)
    assert caught.value.problems[0].what


@pytest.mark.parametrize("form", ["stl", "obj", "ply", "off", "glb", "gltf", "dae", "3mf"])
@pytest.mark.parametrize("seed", range(6))
def test_garbage_and_flipped_bytes_never_raise_anything_but_an_input_error(tmp_path, form, seed):
    rng = np.random.default_rng(seed)
    data = bytearray(rng.bytes(500) if form == "gltf" or seed == 0 else written(form))
    for at in rng.integers(0, len(data), 1 + 3 * seed):
        data[at] = rng.integers(0, 256)
    path = tmp_path / f"part.{form}"
    path.write_bytes(bytes(data))
    try:
        loaded = load_meshes(path, units="m", up="z")
    except InputError:
        return
    for mesh in loaded.plain():
        assert np.isfinite(mesh.vertices).all()
        assert mesh.faces.max() < len(mesh.vertices)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_numbers_that_are_not_finite_are_refused(tmp_path, bad):
    data = bytearray(written("stl"))
    struct.pack_into("<f", data, 84 + 50 * 3 + 12, bad)
    (tmp_path / "part.stl").write_bytes(data)
    with pytest.raises(InputError, match="not finite"):
        load_meshes(tmp_path / "part.stl", units="m")


def test_missing_empty_and_too_large_files(tmp_path):
    path = tmp_path / "part.stl"
    with pytest.raises(InputError, match="no such file"):
        load_meshes(path, units="m")
    path.write_bytes(b"")
    with pytest.raises(InputError, match="is empty"):
        load_meshes(path, units="m")
    BOX.export(path)
    with pytest.raises(InputError, match="more than 100"):
        load_meshes(path, units="m", max_bytes=100)
    with pytest.raises(InputError, match="12 triangles, more than 11"):
        load_meshes(path, units="m", max_faces=11)
    path.write_bytes(bytes(84))
    with pytest.raises(InputError, match="no triangles"):
        load_meshes(path, units="m")


@pytest.mark.parametrize("name", ["part.stl", "part.obj", "part.dae"])
def test_a_web_page_that_was_saved_instead_of_the_file_is_named(tmp_path, name):
    (tmp_path / name).write_text("\n<!DOCTYPE html>\n<html><title>Not found</title></html>")
    with pytest.raises(InputError, match=r"is a web page, not a mesh.*download the file itself"):
        load_meshes(tmp_path / name, units="m")


def test_a_path_as_another_system_writes_it_is_named(tmp_path):
    with pytest.raises(InputError, match=r"write / between folders"):
        load_meshes(tmp_path / "cad\\part.stl", units="m")


@pytest.mark.parametrize("name", ["a.sldprt", "a.CATPart", "a.jt", "a.step", "a.3dxml", "a.prt"])
def test_proprietary_files_say_which_export_to_ask_for(tmp_path, name):
    with pytest.raises(InputError) as caught:
        load_meshes(tmp_path / name)
    assert f"seerob import {name} FOLDER reads it or says what to export" in caught.value.problems[0].remedy


def test_wrong_options_name_the_right_ones(tmp_path):
    path = tmp_path / "part.stl"
    BOX.export(path)
    with pytest.raises(InputError, match="known: cm, dm, ft, inch, m, mm, um"):
        load_meshes(path, units="mn")
    with pytest.raises(InputError, match="x, y or z"):
        load_meshes(path, units="m", up="w")
    with pytest.raises(InputError, match="none of them zero"):
        load_meshes(path, units="m", scale=(1, 0, 1))


@pytest.mark.parametrize(
    "uri", ["../secret.bin", "/etc/hostname", "http://example.com/a.bin", "..%2Fsecret.bin"]
)
def test_gltf_reads_nothing_outside_its_folder(tmp_path, uri):
    (tmp_path / "secret.bin").write_bytes(bytes(1000))
    folder = tmp_path / "part"
    folder.mkdir()
    data = trimesh.Scene(BOX).export(file_type="gltf")
    tree = json.loads(data["model.gltf"])
    tree["buffers"] = [buffer | {"uri": uri} for buffer in tree["buffers"]]
    (folder / "a.gltf").write_text(json.dumps(tree))
    with pytest.raises(InputError, match=r"outside its own folder|nothing is fetched"):
        load_meshes(folder / "a.gltf")


def test_a_link_out_of_the_folder_is_not_followed(tmp_path):
    (tmp_path / "secret.mtl").write_text("newmtl red\nKd 1 0 0\n")
    folder = tmp_path / "part"
    folder.mkdir()
    (folder / "a.mtl").symlink_to(tmp_path / "secret.mtl")
    (folder / "a.obj").write_text("mtllib a.mtl\nusemtl red\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    with pytest.raises(InputError, match="outside its own folder"):
        load_meshes(folder / "a.obj", units="m")


def test_a_missing_material_library_is_told_and_the_shape_is_kept(tmp_path):
    (tmp_path / "a.obj").write_text("mtllib gone.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    loaded = load_meshes(tmp_path / "a.obj", units="m", up="z")
    assert [(f.level, "gone.mtl" in f.text) for f in loaded.findings] == [("warning", True)]


def test_an_entity_bomb_is_refused(tmp_path):
    bomb = '<!DOCTYPE COLLADA [<!ENTITY a "aaaa">]><COLLADA>&a;</COLLADA>'
    (tmp_path / "a.dae").write_text(bomb)
    with pytest.raises(InputError, match="DTDForbidden"):
        load_meshes(tmp_path / "a.dae")


def three_mf(path, model):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as package:
        package.writestr("3D/3dmodel.model", model)


def test_a_zip_bomb_is_refused_before_it_is_unpacked(tmp_path):
    three_mf(tmp_path / "a.3mf", "<model>" + " " * 5_000_000 + "</model>")
    with pytest.raises(InputError, match="unpacks to more than 1000000 bytes"):
        load_meshes(tmp_path / "a.3mf", max_bytes=1_000_000)


def test_3mf_objects_that_contain_themselves_or_multiply_are_refused(tmp_path):
    mesh = (
        "<mesh><vertices><vertex x='0' y='0' z='0'/><vertex x='1' y='0' z='0'/><vertex x='0' y='1' z='0'/>"
        "</vertices><triangles><triangle v1='0' v2='1' v3='2'/></triangles></mesh>"
    )
    loop = "<object id='1'><components><component objectid='1'/></components></object>"
    three_mf(
        tmp_path / "a.3mf", f"<model><resources>{loop}</resources><build><item objectid='1'/></build></model>"
    )
    with pytest.raises(InputError, match="contains itself"):
        load_meshes(tmp_path / "a.3mf")
    ten = "".join("<component objectid='{0}'/>" for _ in range(10))
    objects = f"<object id='0'>{mesh}</object>" + "".join(
        f"<object id='{i}'><components>{ten.format(i - 1)}</components></object>" for i in range(1, 9)
    )
    three_mf(
        tmp_path / "b.3mf",
        f"<model><resources>{objects}</resources><build><item objectid='8'/></build></model>",
    )
    with pytest.raises(InputError, match="too many instances"):
        load_meshes(tmp_path / "b.3mf", max_faces=1000)


def glb(tree, binary=b""):
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    body = struct.pack("<I4s", len(text), b"JSON") + text
    if binary:
        body += struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


def triangle(**changes):
    tree = {
        "asset": {"version": "2.0"},
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "buffers": [{"byteLength": 36}],
    }
    return tree | changes


POINTS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4").tobytes()


def test_hostile_gltf(tmp_path):
    path = tmp_path / "a.glb"
    path.write_bytes(glb(triangle(), POINTS))
    np.testing.assert_allclose(load_meshes(path).plain()[0].vertices, [[0, 0, 0], [1, 0, 0], [0, 0, 1]])
    cases = {
        "do not form a tree": triangle(
            nodes=[{"mesh": 0, "children": [1]}, {"children": [0]}], scenes=[{"nodes": [0]}]
        ),
        "reaches past its data": triangle(bufferViews=[{"buffer": 0, "byteLength": 36_000_000}]),
        "needs the extension KHR_draco": triangle(extensionsRequired=["KHR_draco_mesh_compression"]),
        "elements": triangle(accessors=[{"componentType": 5126, "count": 10**12, "type": "VEC3"}]),
        "is not glTF 2.0": triangle(asset={"version": "1.0"}),
        "not finite": triangle(nodes=[{"mesh": 0, "translation": [float("nan"), 0, 0]}]),
        "names meshes": triangle(nodes=[{"mesh": 7}]),
        "not a readable": triangle(meshes=[{"primitives": [{}]}]),
    }
    for what, tree in cases.items():
        path.write_bytes(glb(tree, POINTS))
        with pytest.raises(InputError, match=what):
            load_meshes(path)


def test_nothing_is_said_on_the_terminal(tmp_path, capfd):
    buffer = io.BytesIO(BOX.export(file_type="ply"))
    (tmp_path / "a.ply").write_bytes(buffer.getvalue()[:-5])
    with pytest.raises(InputError):
        load_meshes(tmp_path / "a.ply", units="m")
    assert capfd.readouterr() == ("", "")
