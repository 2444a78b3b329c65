"""``seerob import`` from a file to a workstation that reads, and what it says on the way."""

import io
import json
import math
import runpy
import tomllib
import zipfile
from pathlib import Path

import numpy as np
import pytest
import trimesh

from seerob.app import cli
from seerob.app.console.terminal import Exit
from seerob.core.errors import InputError
from seerob.description.cad.recognised import CLOSED, recognised
from seerob.session.station import load

MADE = runpy.run_path(str(Path(__file__).parents[2] / "scripts/make-imported-line"))


def imported(file, folder, *options):
    code = cli.main(["import", str(file), str(folder), *options])
    return code, tomllib.loads((folder / "workstation.toml").read_text()) if code == Exit.WITHIN else {}


def test_a_step_file_becomes_a_workstation(tmp_path, capsys):
    file = tmp_path / "line.STP"
    file.write_text(MADE["line"]().text())
    given = ("--density", "S235JR=7850", "--density", "2700")
    code, table = imported(file, tmp_path / "cell", *given)
    assert code == Exit.WITHIN
    assert "10 parts of 5 shapes" in capsys.readouterr().out
    assert cli.main(["check-file", str(tmp_path / "cell")]) == Exit.WITHIN
    densities = {part["name"]: part["density"] for part in table["parts"]}
    assert densities["line/post"] == 7850
    assert densities["line/fixture_1/clamp_1"] == 2700
    assert len({part["mesh"] for part in table["parts"]}) == 5
    model = load(tmp_path / "cell").model
    assert sorted(body.name for body in model.bodies) == sorted(densities)
    deviations = {body.name: body.deviation for body in model.bodies}
    assert 1e-4 <= deviations["line/post"] < 1.1e-4
    assert deviations["line/table"] == 0
    # What is written is read by nobody's library of ours: two primitives, one part.
    scene = trimesh.load(tmp_path / "cell/cad/base.glb")
    assert scene.bounds == pytest.approx(np.array([[0, 0, -0.2], [0.3, 0.02, 0]]), abs=1e-6)
    assert len(scene.geometry) == 2
    rows = json.loads((tmp_path / "cell/import.json").read_text())
    turned = next(row for row in rows["parts"] if row["name"] == "line/fixture_2/base")
    # Base of 300 × 200 mm, turned by 30° about (1.15, 0.1).
    c, s = math.cos(math.pi / 6), math.sin(math.pi / 6)
    low, high = turned["box"]
    assert low == pytest.approx([1.15 - 0.2 * s, 0.1, 0.74], abs=1e-6)
    assert high == pytest.approx([1.15 + 0.3 * c, 0.1 + 0.3 * s + 0.2 * c, 0.76], abs=1e-6)


@pytest.mark.parametrize("ending", ["glb", "3mf"])
def test_instances_of_a_mesh_file_share_a_mesh_and_a_scale_is_baked(tmp_path, ending):
    scene = trimesh.Scene()
    scene.add_geometry(trimesh.creation.box((200, 100, 100)), node_name="left", geom_name="box")
    moved = trimesh.transformations.translation_matrix((1000, 0, 0))
    for name, matrix in (("right", moved), ("large", np.diag([2.0, 2.0, 2.0, 1.0]))):
        scene.graph.update(name, "world", matrix=matrix, geometry="box")
    file = tmp_path / f"a.{ending}"
    scene.export(file)
    code, table = imported(file, tmp_path / "cell")
    assert code == Exit.WITHIN
    assert [len({p["mesh"] for p in table["parts"]}), len(table["parts"])] == [2, 3]
    assert cli.main(["check-file", str(tmp_path / "cell")]) == Exit.WITHIN
    rows = json.loads((tmp_path / "cell/import.json").read_text())["parts"]
    sizes = sorted(max(np.ptp(row["box"], axis=0)) for row in rows)
    k = {"glb": 1.0, "3mf": 1e-3}[ending]
    assert sizes == pytest.approx([200 * k, 200 * k, 400 * k], rel=1e-6)
    for part, row in zip(table["parts"], rows, strict=True):
        # Places and meshes together are the box: what was baked is not placed again.
        mesh = trimesh.load(tmp_path / "cell" / part["mesh"], force="mesh")
        height = part["at"]["position"][2]
        assert mesh.bounds[:, 1] + height == pytest.approx([b[2] for b in row["box"]], abs=1e-6)


@pytest.mark.parametrize(("axis", "unit", "high"), [("Z_UP", 0.001, 3e-3), ("Y_UP", 0.0254, 2 * 0.0254)])
def test_unit_and_up_axis_of_collada_are_kept(tmp_path, axis, unit, high):
    trimesh.creation.box(bounds=[[0, 0, 0], [1, 2, 3]]).export(tmp_path / "a.dae")
    text = (tmp_path / "a.dae").read_text()
    asset = f'<unit name="x" meter="{unit}"/><up_axis>{axis}</up_axis></asset>'
    start, end = text.index("<asset>"), text.index("</asset>")
    text = text[:start] + "<asset>" + asset + text[end + len("</asset>") :]
    (tmp_path / "a.dae").write_text(text)
    assert imported(tmp_path / "a.dae", tmp_path / "cell")[0] == Exit.WITHIN
    (row,) = json.loads((tmp_path / "cell/import.json").read_text())["parts"]
    assert row["box"][1][2] == pytest.approx(high, rel=1e-6)


def test_a_collada_archive_is_its_document(tmp_path):
    trimesh.creation.box(bounds=[[0, 0, 0], [1, 2, 3]]).export(tmp_path / "a.dae")
    with zipfile.ZipFile(tmp_path / "a.zae", "w") as archive:
        archive.writestr("manifest.xml", "<dae_root>./inner/a.dae</dae_root>")
        archive.writestr("other.dae", "<COLLADA/>")
        archive.write(tmp_path / "a.dae", "inner/a.dae")
    assert imported(tmp_path / "a.zae", tmp_path / "cell")[0] == Exit.WITHIN
    (row,) = json.loads((tmp_path / "cell/import.json").read_text())["parts"]
    assert sorted(np.ptp(row["box"], axis=0)) == pytest.approx([1, 2, 3])


def step_file(path, *, clamp=60.0, moved=0.0, pin="pin", post=True):
    """A block with two clamps and a pin, as one revision or another has it."""
    made, place = MADE["Step"](), MADE["place"]
    block = made.box("block", (300.0, 200.0, 20.0), material="steel")
    jaw = made.box("jaw", (clamp, 20.0, 30.0))
    bolt = made.cylinder("bolt", 5.0, 40.0)
    parts = [(block, "base", place()), (jaw, "clamp_1", place(10, 10, 20)), (bolt, pin, place(150, 100, 20))]
    parts.append((jaw, "clamp_2", place(200.0 + moved, 10, 20)))
    if post:
        parts.append((made.box("post", (20.0, 20.0, 900.0)), "post", place(400)))
    made.assembly("line", parts)
    path.write_text(made.text())
    return path


HAND = """
# Mine: what the person must not reach.
[[safety]]
kind = "minimum_distance"   # of the clamps
name = "clamps"
between = ["line/clamp_*", "line/post"]
limit = 0.01
"""


def by_name(folder):
    parts = tomllib.loads((folder / "workstation.toml").read_text())["parts"]
    return {part["name"]: part for part in parts}


def test_a_new_revision_keeps_names_and_what_was_edited_and_says_what_is_new(tmp_path, capsys):
    file, cell = step_file(tmp_path / "line.step"), tmp_path / "cell"
    assert imported(file, cell, "--density", "steel=7850")[0] == Exit.WITHIN
    text = (cell / "workstation.toml").read_text() + HAND
    # The base is put elsewhere by hand, and remarked.
    text = text.replace('name = "line/base"', 'name = "line/base"   # bolted')
    text = text.replace("position = [0, 0, 0]", "position = [0, 0, 0.5]", 1)
    (cell / "workstation.toml").write_text(text)
    before = by_name(cell)
    step_file(file, clamp=80.0, moved=15.0, pin="dowel", post=False)
    capsys.readouterr()
    assert imported(file, cell)[0] == Exit.WITHIN
    out = " ".join(capsys.readouterr().out.split())
    for said in (
        "added line/dowel",
        "lost line/post: touches safety clamps",
        "lost line/pin",
        "resized line/clamp_1: touches safety clamps",
        "moved and resized line/clamp_2: touches safety clamps",
        "renamed? line/pin is perhaps line/dowel now: the same shape, the same place",
    ):
        assert said in out
    after = by_name(cell)
    assert list(after) == ["line/base", "line/clamp_1", "line/clamp_2", "line/dowel"]
    assert after["line/base"] == before["line/base"]
    assert after["line/base"]["density"] == 7850
    assert after["line/clamp_2"]["at"]["position"] == pytest.approx([0.215, 0.01, 0.02])
    text = (cell / "workstation.toml").read_text()
    assert 'name = "line/base"   # bolted' in text
    assert HAND.strip() in text
    assert not (cell / "cad/post.glb").exists()
    mesh = trimesh.load(cell / after["line/clamp_1"]["mesh"], force="mesh")
    assert np.ptp(mesh.bounds, axis=0)[0] == pytest.approx(0.08)
    # The criterion names a part that is gone: it is asked of nobody else.
    assert cli.main(["check-file", str(cell)]) == Exit.ERROR
    assert "line/post" in capsys.readouterr().err
    assert imported(file, cell)[0] == Exit.WITHIN
    assert "no part was added, moved, resized or lost" in capsys.readouterr().out
    assert text == (cell / "workstation.toml").read_text()


def test_where_the_hand_and_the_revision_differ_the_hand_counts_and_is_told(tmp_path, capsys):
    file, cell = step_file(tmp_path / "line.step"), tmp_path / "cell"
    imported(file, cell)
    toml = cell / "workstation.toml"
    toml.write_text(toml.read_text().replace("position = [0.2, 0.01, 0.02]", "position = [0.3, 0.01, 0.02]"))
    imported(step_file(file, moved=15.0), cell)
    assert "line/clamp_2: at as it was changed by hand" in capsys.readouterr().out
    assert by_name(cell)["line/clamp_2"]["at"]["position"] == [0.3, 0.01, 0.02]


def test_files_of_the_user_are_not_touched(tmp_path, capsys):
    file, cell = step_file(tmp_path / "line.step", pin="pin", post=False), tmp_path / "cell"
    imported(file, cell)
    (cell / "cad/post.glb").write_bytes(b"mine")
    (tmp_path / "keep.glb").write_bytes(b"mine")
    table = json.loads((cell / "import.json").read_text())
    table["parts"].append({**table["parts"][0], "name": "gone", "mesh": "cad/../../keep.glb"})
    (cell / "import.json").write_text(json.dumps(table))
    assert imported(step_file(file), cell)[0] == Exit.WITHIN
    assert (cell / "cad/post.glb").read_bytes() == b"mine"
    assert by_name(cell)["line/post"]["mesh"] == "cad/post_2.glb"
    assert (tmp_path / "keep.glb").exists()
    (cell / "import.json").write_text('{"parts": [{}]}')
    assert imported(file, cell)[0] == Exit.ERROR
    (cell / "import.json").unlink()
    assert imported(file, cell)[0] == Exit.ERROR
    assert "exists already" in capsys.readouterr().err


def test_a_file_without_a_unit_is_asked_for_it(tmp_path, capsys):
    trimesh.creation.box((200, 100, 50)).export(tmp_path / "a.stl")
    assert imported(tmp_path / "a.stl", tmp_path / "cell")[0] == Exit.ERROR
    assert 'units = "mm" would make it 0.2 m' in capsys.readouterr().err
    assert imported(tmp_path / "a.stl", tmp_path / "cell", "--units", "mm")[0] == Exit.WITHIN
    assert "guessed" in capsys.readouterr().out
    assert not [p for p in tmp_path.iterdir() if p.name.startswith(".")]


def test_options_that_a_file_has_no_use_for_are_refused(tmp_path, capsys):
    (tmp_path / "a.step").write_text(MADE["line"]().text())
    trimesh.creation.box((1, 1, 1)).export(tmp_path / "a.glb")
    for file, option, says in (
        ("a.step", ("--units", "mm"), "only a mesh file"),
        ("a.step", ("--tolerance", "0"), "from 0.001 to 50 mm"),
        ("a.glb", ("--tolerance", "1"), "has triangles already"),
        ("a.glb", ("--density", "steel"), "is no density"),
        ("a.glb", ("--density", "nan"), "is no density"),
    ):
        assert cli.main(["import", str(tmp_path / file), str(tmp_path / "cell"), *option]) == Exit.ERROR
        assert says in capsys.readouterr().err
        assert not (tmp_path / "cell").exists()


def zipped(name):
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr(name, "x")
    return buffer.getvalue()


OLE = bytes.fromhex("d0cf11e0a1b11ae1") + bytes(504)
CONTENTS = {
    "SolidWorks": OLE + "SwDocMgrTempStorage".encode("utf-16-le"),
    "Inventor": OLE + "RSeDb".encode("utf-16-le"),
    "CATIA V5": b"V5_CFV2\0\0",
    "Creo": b"#UGC:2 ASSEMBLY 1234",
    "NX": b"SPLMSSTR\0\0",
    "JT": b"Version 9.5 JT  DM 6.3.0.1",
    "Parasolid": b"**ABCDEFGHIJKLMNOPQRSTUVWXYZ***",
}


@pytest.mark.parametrize("program", CONTENTS)
def test_files_of_cad_systems_are_known_by_content_and_answered_with_the_export(program):
    with pytest.raises(InputError) as raised:
        recognised(Path("a.step"), CONTENTS[program])
    assert CLOSED[program].program in str(raised.value)
    assert CLOSED[program].export in str(raised.value)


@pytest.mark.parametrize(
    ("content", "ending"),
    [
        (b"ISO-10303-21;\nHEADER;", ".step"),
        (b"\xef\xbb\xbf\r\n/* x */ ISO-10303-21;", ".step"),
        (b" " * 72 + b"S      1\n" + b" " * 72 + b"G      1\n", ".igs"),
        (b"glTF\2\0\0\0", ".glb"),
        (b'{"asset": {"version": "2.0"}}', ".gltf"),
        (b'<?xml version="1.0"?><!-- x --><COLLADA version="1.4.1">', ".dae"),
        (b'<caex:CAEXFile xmlns:caex="x">', ".aml"),
        (b"solid a\n facet normal 0 0 1", ".stl"),
        (b"solid " + bytes(74) + b"\1\0\0\0" + bytes(50), ".stl"),
        (b"ply\nformat ascii 1.0", ".ply"),
        (b"OFF\n3 1 0", ".off"),
        (b"# x\no a\nv 0 0 0.5\n", ".obj"),
        (zipped("3D/3dmodel.model"), ".3mf"),
        (zipped("cell.aml"), ".amlx"),
        (zipped("Manifest.xml"), ".3dxml"),
        (zipped("inner/a.dae"), ".zae"),
    ],
)
def test_formats_are_known_by_content(content, ending):
    assert recognised(Path("a.sldprt"), content) == ending


@pytest.mark.parametrize("content", [b"PK\3\4damaged", b"<html/>", b"hello", zipped("a.txt"), OLE])
def test_what_nobody_knows_is_said_to_be_so(content):
    with pytest.raises(InputError):
        recognised(Path("a.bin"), content)


def test_a_picture_shows_what_became_parts_in_their_colours(tmp_path):
    from PIL import Image

    scene = trimesh.Scene()
    for name, color, x in (("red", (255, 0, 0, 255), 0.0), ("blue", (0, 0, 255, 255), 3.0)):
        box = trimesh.creation.box((1, 1, 1))
        box.visual = trimesh.visual.TextureVisuals(
            material=trimesh.visual.material.PBRMaterial(baseColorFactor=color)
        )
        scene.add_geometry(
            box, node_name=name, transform=trimesh.transformations.translation_matrix((x, 0, 0))
        )
    scene.export(tmp_path / "a.glb")
    imported(tmp_path / "a.glb", tmp_path / "cell")
    pixels = np.asarray(Image.open(tmp_path / "cell/import.png").convert("RGB")).astype(int)
    red = (pixels[..., 0] > 2 * pixels[..., 2] + 20) & (pixels[..., 0] > 80)
    blue = (pixels[..., 2] > 2 * pixels[..., 0] + 20) & (pixels[..., 2] > 80)
    assert red.sum() > 5000
    assert blue.sum() > 5000
    # Red is to the left of blue, seen from the front.
    assert np.flatnonzero(red.any(axis=0)).max() < np.flatnonzero(blue.any(axis=0)).min()


def test_what_is_left_out_on_request_is_listed_and_stays_out(tmp_path, capsys):
    file = tmp_path / "line.step"
    file.write_text(MADE["line"]().text())
    cell = tmp_path / "cell"
    code, table = imported(file, cell, "--without", "*/clamp_*", "--smaller", "50")
    assert code == Exit.WITHIN
    names = {part["name"] for part in table["parts"]}
    assert names == {"line/table", "line/post", "line/fixture_1/base", "line/fixture_2/base"}
    rows = {row["name"]: row["why"] for row in json.loads((cell / "import.json").read_text())["left_out"]}
    assert len(rows) == 6
    assert rows["line/fixture_1/clamp_1"] == "as asked: --without */clamp_*"
    # A pin of 12 mm by 45 mm.
    assert rows["line/fixture_1/pin"] == "as asked: 45 mm, smaller than 50 mm"
    assert not (cell / "cad/clamp.glb").exists()
    assert imported(file, cell)[1] == table
    capsys.readouterr()
    for options, says in (
        (("--without", "*/bolt*"), "no part is called"),
        (("--without", "*"), "no part would be left"),
        (("--smaller", "0"), "more than 0"),
    ):
        assert cli.main(["import", str(file), str(tmp_path / "new"), *options]) == Exit.ERROR
        assert says in capsys.readouterr().err
