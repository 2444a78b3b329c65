"""``seerob import`` from a file to a workstation that reads, and what it says on the way."""

import io
import json
import math
import re
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
    rows = json.loads((tmp_path / "cell/import.json").read_text())
    densities = {row["name"]: row["density"] for row in rows["parts"]}
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


def step_file(path, *, root="line", clamp=60.0, moved=0.0, pin="pin", post=True):
    """A block with two clamps and a pin, as one revision or another has it."""
    made, place = MADE["Step"](), MADE["place"]
    block = made.box("block", (300.0, 200.0, 20.0), material="steel")
    jaw = made.box("jaw", (clamp, 20.0, 30.0))
    bolt = made.cylinder("bolt", 5.0, 40.0)
    parts = [(block, "base", place()), (jaw, "clamp_1", place(10, 10, 20)), (bolt, pin, place(150, 100, 20))]
    parts.append((jaw, "clamp_2", place(200.0 + moved, 10, 20)))
    if post:
        parts.append((made.box("post", (20.0, 20.0, 900.0)), "post", place(400)))
    made.assembly(root, parts)
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
    # CAD systems call the root as the file.
    file, root = tmp_path / "line_v2.step", "line_v2"
    step_file(file, root=root, clamp=80.0, moved=15.0, pin="dowel", post=False)
    capsys.readouterr()
    assert imported(file, cell)[0] == Exit.WITHIN
    out = " ".join(capsys.readouterr().out.split())
    for said in (
        "renamed line_v2 is taken as line, for 3 of 5 names below it are the same",
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
    "Fusion": zipped("FusionAssetName[Active]/Design1.f3d"),
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
    assert rows["line/fixture_1/clamp_1"].startswith("as asked: --without */clamp_*; ")
    # A pin of 12 mm by 45 mm.
    assert rows["line/fixture_1/pin"] == "as asked: --smaller 50; 45 mm"
    assert [(one["name"], one["why"].split()[0], "accepted" in one) for one in table["left_out"]] == [
        ("--without */clamp_*", "4", True),
        ("--smaller 50", "2", True),
    ]
    said = [f for f in load(cell).model.findings if "left out" in f.text]
    assert [(f.level, f.holds) for f in said] == [("assumed", ()), ("assumed", ())]
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


def test_what_is_missing_keeps_everything_from_being_within_until_somebody_accepts_it(tmp_path, capsys):
    made = MADE["Step"]()
    block = made.box("block", (4.0, 2.0, 1.0))
    made.assembly("line", [(block, "base", MADE["place"]())])
    text = made.text().replace(
        "ENDSEC;\nEND-ISO", "#9001=DOCUMENT_FILE('gone.stp','','',#9002,'','');\nENDSEC;\nEND-ISO"
    )
    (tmp_path / "a.step").write_text(text)
    cell = tmp_path / "cell"
    _, table = imported(tmp_path / "a.step", cell)
    (row,) = table["left_out"]
    assert row == {"name": "gone.stp", "why": "a file that is not there"}
    (said,) = (f for f in load(cell).model.findings if f.subject == "gone.stp")
    assert (said.level, said.holds) == ("warning", ("*",))
    assert "accepted" in said.text
    # What somebody writes there stays with the next revision, which has nothing new.
    file = cell / "workstation.toml"
    file.write_text(file.read_text() + 'accepted = "stands in the next hall"\n')
    capsys.readouterr()
    again = imported(tmp_path / "a.step", cell)[1]
    assert again["left_out"][0]["accepted"] == "stands in the next hall"
    (said,) = (f for f in load(cell).model.findings if f.subject == "gone.stp")
    assert (said.level, said.holds) == ("assumed", ())
    # The file came: it is not missing any more.
    (tmp_path / "gone.stp").write_text(made.text())
    assert "left_out" not in imported(tmp_path / "a.step", cell)[1]


@pytest.fixture
def kept_in(tmp_path, monkeypatch):
    """A folder of its own for what is kept, and how often OpenCASCADE is asked."""
    from seerob.app.commands import import_
    from seerob.description.cad import step

    asked, parsed = [], step.parsed_one_by_one

    def counted(*arguments, **more):
        asked.append(more["file"])
        return parsed(*arguments, **more)

    monkeypatch.setattr(import_, "cache_folder", lambda: tmp_path / "kept")
    monkeypatch.setattr(step, "parsed_one_by_one", counted)
    return asked


def test_the_second_import_of_a_content_asks_nobody_and_makes_the_same(tmp_path, kept_in):
    file = tmp_path / "line.step"
    file.write_text(MADE["line"]().text())
    for name in ("one", "two"):
        assert imported(file, tmp_path / name)[0] == Exit.WITHIN
    assert len(kept_in) == 1
    for path in (tmp_path / "one").rglob("*.*"):
        assert path.read_bytes() == (tmp_path / "two" / path.relative_to(tmp_path / "one")).read_bytes()
    imported(file, tmp_path / "finer", "--tolerance", "0.05")
    assert len(kept_in) == 2
    # Axes come from what is kept, too; a damaged entry is none.
    imported(file, tmp_path / "axes", "--axes", "--density", "2700")
    assert len(kept_in) == 2
    for entry in (tmp_path / "kept").iterdir():
        entry.write_bytes(entry.read_bytes()[:-200])
    imported(file, tmp_path / "three")
    assert len(kept_in) == 3
    file.write_text(file.read_text().replace("'post'", "'pole'"))
    assert "line/pole" in str(imported(file, tmp_path / "four")[1])
    assert len(kept_in) == 4


def test_what_a_file_names_is_part_of_its_content(tmp_path, kept_in):
    def part(size):
        made = MADE["Step"]()
        made.box("block", (size, 2.0, 1.0))
        return made.text()

    named = part(4.0).replace(
        "ENDSEC;\nEND-ISO", "#9001=DOCUMENT_FILE('b.stp','','',#9002,'','');\nENDSEC;\nEND-ISO"
    )
    (tmp_path / "a.step").write_text(named)
    for number in (1, 2):
        # It is missing today; tomorrow it may be there.
        imported(tmp_path / "a.step", tmp_path / f"missing_{number}")
        assert len(kept_in) == number
    for number, size, folder in ((3, 5.0, "five"), (3, 5.0, "again"), (4, 6.0, "six")):
        (tmp_path / "b.stp").write_text(part(size))
        imported(tmp_path / "a.step", tmp_path / folder)
        assert len(kept_in) == number


def test_ctrl_c_leaves_nothing_half_written_and_no_process(tmp_path, monkeypatch, kept_in):
    from contextlib import contextmanager

    from seerob.app.commands import import_
    from seerob.core.files import parser_process

    said, children, made = [], [], parser_process._Child

    class Watched(made):
        def __init__(self, *arguments):
            super().__init__(*arguments)
            children.append(self)

    @contextmanager
    def until_cut():
        def say(text):
            said.append(text)
            if "triangles: 2 of 5" in text:
                raise KeyboardInterrupt

        yield say

    parser_process._end_all()
    monkeypatch.setattr(parser_process, "_Child", Watched)
    monkeypatch.setattr(import_, "spinner", until_cut)
    file = tmp_path / "line.step"
    file.write_text(MADE["line"]().text())
    with pytest.raises((KeyboardInterrupt, SystemExit)):
        import_.run(cli.parser().parse_args(["import", str(file), str(tmp_path / "cell")]))
    assert said[:2] == ["reading line.step", "cutting line.step into triangles: 1 of 5 products"]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["line.step"]
    parser_process._end_all()
    assert children
    assert all(child.process.poll() is not None for child in children)


def test_a_revision_that_is_interrupted_is_there_whole_or_not_at_all(tmp_path, monkeypatch, kept_in):
    file, cell = tmp_path / "line.step", tmp_path / "cell"
    file.write_text(MADE["line"]().text())
    imported(file, cell)
    before = (cell / "workstation.toml").read_bytes()
    replace, count = Path.replace, [0]

    def interrupted(self, target):
        count[0] += 1
        if count[0] == 3:
            raise KeyboardInterrupt
        return replace(self, target)

    file.write_text(file.read_text().replace("'post'", "'pole'"))
    monkeypatch.setattr(Path, "replace", interrupted)
    cli.main(["import", str(file), str(cell)])
    monkeypatch.undo()
    assert (cell / "workstation.toml").read_bytes() != before
    table = json.loads((cell / "import.json").read_text())
    assert {row["mesh"] for row in table["parts"]} <= {f"cad/{p.name}" for p in (cell / "cad").iterdir()}
    assert cli.main(["check-file", str(cell)]) == Exit.WITHIN
    assert not [path for path in cell.iterdir() if path.name.startswith(".")]


def test_densities_of_a_table_go_by_material_and_their_masses_are_summed(tmp_path, capsys):
    file, table = tmp_path / "line.step", tmp_path / "ours.toml"
    file.write_text(MADE["line"]().text())
    table.write_text('S235JR = 7850\n"AlMgSi1" = 2700.5\nUnobtainium = 1\n')
    code, made = imported(file, tmp_path / "cell", "--densities", str(table), "--density", "AlMgSi1=2700")
    assert code == Exit.WITHIN
    rows = json.loads((tmp_path / "cell/import.json").read_text())["parts"]
    densities = {row["name"]: row["density"] for row in rows}
    assert {densities["line/post"], densities["line/fixture_1/base"]} == {7850, 2700}
    own = sum(
        trimesh.load(tmp_path / "cell" / row["mesh"], force="mesh").volume * row["density"]
        for row in rows
        if row["density"]
    )
    said = re.search(r"([\d.]+) kg in (\d+) of 10 parts", capsys.readouterr().out)
    assert float(said[1]) == pytest.approx(own, rel=1e-3)
    assert int(said[2]) == sum(row["density"] is not None for row in rows)
    # A new revision needs the table no more.
    table.unlink()
    assert imported(file, tmp_path / "cell")[1] == made
    for text in ("S235JR = 0", 'S235JR = "heavy"', "S235JR = true", "[S235JR]", "="):
        table.write_text(text)
        assert cli.main(["import", str(file), str(tmp_path / "new"), "--densities", str(table)]) == Exit.ERROR
        assert "ours.toml" in capsys.readouterr().err


@pytest.fixture(scope="module")
def housing(tmp_path_factory):
    """A box of 400 mm with walls of 10 mm and a hole of 60 mm in its lid, a part inside, one beside it."""
    scene = trimesh.Scene()
    box = trimesh.creation.box((0.4, 0.4, 0.4)).difference(trimesh.creation.box((0.38, 0.38, 0.38)))
    hole = trimesh.creation.cylinder(
        0.03, 0.1, transform=trimesh.transformations.translation_matrix((0, 0, 0.2))
    )
    scene.add_geometry(box.difference(hole), node_name="housing", geom_name="housing")
    ball = trimesh.creation.icosphere(5, 0.05)
    scene.add_geometry(ball, node_name="inside", geom_name="ball")
    moved = trimesh.transformations.translation_matrix((0, 0.6, 0))
    scene.graph.update("beside", "world", matrix=moved, geometry="ball")
    file = tmp_path_factory.mktemp("housing") / "h.glb"
    scene.export(file)
    return file


@pytest.mark.parametrize(
    ("width", "left"), [("40", ["beside", "housing", "inside"]), ("100", ["beside", "housing"])]
)
def test_what_nothing_can_touch_is_left_out_on_request_and_told(tmp_path, housing, capsys, width, left):
    code, table = imported(housing, tmp_path / "cell", "--unreachable", width, "--triangles", "500")
    assert code == Exit.WITHIN
    assert sorted(part["name"].rpartition("/")[2] for part in table["parts"]) == left
    out = " ".join(capsys.readouterr().out.split())
    assert ("inside: as asked: --unreachable 100; inside of others" in out) == (width == "100")
    assert len(table.get("left_out", [])) == 3 - len(left)
    if width == "100":
        assert cli.main(["import", str(housing), str(tmp_path / "b"), "--unreachable", "1"]) == Exit.ERROR
        assert "for an assembly of this size" in capsys.readouterr().err


def test_a_budget_of_triangles_is_of_the_screen_alone_and_what_is_shown_says_how_far_it_is_off(
    tmp_path, housing
):
    _, table = imported(housing, tmp_path / "cell", "--triangles", "500")
    assert {part["triangles"] for part in table["parts"]} == {500}
    station = load(tmp_path / "cell")
    found = [f.text for f in station.scene().findings if "beside" in f.subject and "is shown with" in f.text]
    assert len(found) == 1
    off = float(re.search(r"at most ([\d.]+) mm off", found[0])[1])
    body = next(body for body in station.model.bodies if body.name.endswith("beside"))
    assert max(len(solid.mesh.faces) for solid in body.solids) == 20480
    shown = next(node.mesh for node in station.scene().nodes if node.name == body.name)
    drawn = trimesh.load(io.BytesIO(station.model.meshes[shown]), file_type="glb", force="mesh")
    assert len(drawn.faces) <= 500
    assert 0 < 50 - np.linalg.norm(drawn.triangles_center, axis=1).min() * 1e3 <= off + 0.1
