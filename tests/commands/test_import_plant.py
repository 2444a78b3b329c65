"""AutomationML plants become workstation folders: both editions, containers, and hostile ones."""

from __future__ import annotations

import io
import math
import random
import re
import runpy
import tomllib
import zipfile
from pathlib import Path

import numpy as np
import pytest

from seerob.app import cli
from seerob.app.console.terminal import Exit
from seerob.core.errors import InputError
from seerob.description.formats.automationml import read
from seerob.session.station import load

REPOSITORY = Path(__file__).parents[2]
OLD = '<CAEXFile SchemaVersion="2.15" FileName="cell.aml">{}</CAEXFile>'
NEW = '<CAEXFile SchemaVersion="3.0" xmlns="http://www.dke.de/CAEX">{}</CAEXFile>'
INTERFACE = "AutomationMLBaseInterface/ExternalDataConnector"
VARIABLE = f"{INTERFACE}/PLCopenXMLInterface/VariableInterface"
ROLE = "AutomationMLDMIRoleClassLib/DiscManufacturingEquipment"


def frame(unit="m", **values):
    rows = "".join(
        f'<Attribute Name="{k}" Unit="{"deg" if k[0] == "r" else unit}"><Value>{v}</Value></Attribute>'
        for k, v in values.items()
    )
    return f'<Attribute Name="Frame">{rows}</Attribute>'


def hierarchy(text):
    return OLD.format(f'<InstanceHierarchy Name="a">{text}</InstanceHierarchy>')


def plant(*, unit="m", uri="geometry/box.dae", k=1):
    return (
        '<InstanceHierarchy Name="Plant"><InternalElement Name="Line 1" ID="{A}">'
        + frame(unit, x=1 * k, y=2 * k, rz=90)
        + '<InternalElement Name="Fixture" ID="{B}">'
        + frame(unit, x=1 * k, z=0.5 * k)
        + f'<ExternalInterface Name="Geometry" ID="{{C}}" RefBaseClassPath="{INTERFACE}/COLLADAInterface">'
        f'<Attribute Name="refURI" AttributeDataType="xs:anyURI"><Value>{uri}</Value></Attribute>'
        "</ExternalInterface></InternalElement>"
        f'<InternalElement Name="Arm" ID="{{D}}"><RoleRequirements RefBaseRoleClassPath="{ROLE}/Robot"/>'
        "</InternalElement>"
        '<InternalElement Name="Belt" ID="{E}">'
        f'<ExternalInterface Name="Speed" RefBaseClassPath="{VARIABLE}">'
        '<Attribute Name="refURI" AttributeDataType="xs:double" Unit="mm/s">'
        "<Value>DB1.Speed</Value></Attribute>"
        "</ExternalInterface>"
        f'<ExternalInterface Name="On" RefBaseClassPath="{VARIABLE}">'
        '<Attribute Name="refURI" AttributeDataType="xs:boolean"><Value>DB1.On</Value></Attribute>'
        "</ExternalInterface>"
        '<InternalLink Name="l" RefPartnerSideA="{b}:Geometry" RefPartnerSideB="{E}:Speed"/>'
        "</InternalElement></InternalElement></InstanceHierarchy>"
    )


@pytest.fixture(scope="module")
def box():
    import trimesh

    scene = trimesh.creation.box((0.2, 0.3, 0.4))
    return trimesh.exchange.dae.export_collada(scene)


def written(folder, text, box):
    (folder / "geometry").mkdir(parents=True)
    (folder / "geometry" / "box.dae").write_bytes(box)
    (folder / "cell.aml").write_text(text, encoding="utf-8")
    return folder / "cell.aml"


def packed(folder, text, box, *, name="cell.amlx"):
    folder.mkdir(parents=True, exist_ok=True)
    with zipfile.ZipFile(folder / name, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("[Content_Types].xml", "<Types/>")
        archive.writestr("libs/standard.aml", OLD.format(""))
        archive.writestr("cell.aml", text)
        archive.writestr("geometry/box.dae", box)
    return folder / name


@pytest.mark.parametrize("edition", [OLD, NEW])
@pytest.mark.parametrize("make", [written, packed])
def test_a_plant_becomes_a_workstation(tmp_path, capsys, box, edition, make):
    file = make(tmp_path / "plant", edition.format(plant()), box)
    made = tmp_path / "cell"
    assert cli.main(["import", str(file), str(made)]) == Exit.WITHIN
    assert "1 parts with a shape, 1 robots, 2 variables" in capsys.readouterr().out
    assert cli.main(["check-file", str(made)]) == Exit.WITHIN
    (body,) = load(made).model.bodies
    assert body.name == "Line_1/Fixture"
    table = tomllib.loads((made / "workstation.toml").read_text())
    # Line 1 is at (1, 2) and turned by 90°, so one metre along its x is one along y.
    assert table["parts"][0]["at"]["position"] == pytest.approx([1, 3, 0.5])
    half = math.sqrt(0.5)
    assert table["parts"][0]["at"]["wxyz"] == pytest.approx([half, 0, 0, half])
    variables = tomllib.loads((made / "variables.toml").read_text())["variables"]
    assert [(v["name"], v["address"], v.get("unit"), v.get("type")) for v in variables] == [
        ("Line_1/Belt/Speed", "DB1.Speed", "mm/s", None),
        ("Line_1/Belt/On", "DB1.On", None, "bool"),
    ]
    assert '# name = "Arm"' in (made / "workstation.toml").read_text()


def test_millimetres_are_the_same_plant(tmp_path, box):
    a = read(written(tmp_path / "a", OLD.format(plant()), box))
    b = read(written(tmp_path / "b", OLD.format(plant(unit="mm", k=1000)), box))
    for (_, _, world), (_, _, other) in zip(a.walk(), b.walk(), strict=True):
        assert np.allclose(world, other, atol=1e-12)
    assert a.links == (("b:geometry", "e:speed"),)


def test_turns_about_several_axes_are_about_fixed_ones_and_said(tmp_path):
    (tmp_path / "a.aml").write_text(hierarchy(frame(rx=90, rz=90)))
    found = read(tmp_path / "a.aml")
    *_, (_, _, world) = found.walk()
    # First about x, then about the fixed z: y goes to z and stays there.
    assert np.allclose(world[:3, :3] @ [0, 1, 0], [0, 0, 1])
    assert "fixed axes" in found.findings[0].text


ROOT = "http://schemas.automationml.org/container/relationship/RootDocument"


def related(*targets, kind=ROOT):
    rows = "".join(f'<Relationship Type="{kind}" Target="{t}" Id="R{i}"/>' for i, t in enumerate(targets))
    return f'<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">{rows}</Relationships>'


def container(file, **parts):
    with zipfile.ZipFile(file, "w") as archive:
        for name, data in parts.items():
            archive.writestr(name, data)
    return file


@pytest.mark.parametrize("kind", [ROOT, ROOT.lower()])
def test_a_container_says_which_document_is_its_root(tmp_path, kind):
    deep = NEW.format('<InstanceHierarchy Name="deep"/>')
    near = NEW.format('<InstanceHierarchy Name="near"/>')
    files = {"a.aml": near, "plants/cell.aml": deep}
    told = container(tmp_path / "a.amlx", **files, **{"_rels/.rels": related("/plants/cell.aml", kind=kind)})
    assert [root.name for root in read(told).roots] == ["deep"]
    assert read(told).findings == ()
    untold = read(container(tmp_path / "b.amlx", **files))
    assert [root.name for root in untold.roots] == ["near"]
    assert "names no root document" in untold.findings[0].text
    both = read(
        container(tmp_path / "c.amlx", **files, **{"_rels/.rels": related("a.aml", "plants/cell.aml")})
    )
    assert [root.name for root in both.roots] == ["near"]
    assert "several root documents" in both.findings[0].text
    gone = container(tmp_path / "d.amlx", **files, **{"_rels/.rels": related("/gone.aml")})
    with pytest.raises(InputError, match=r"'gone\.aml' is not in the container"):
        read(gone)


def test_names_in_brackets_other_geometry_and_paths_from_the_root_of_a_container(tmp_path, capsys, box):
    text = NEW.format(
        '<InstanceHierarchy Name="Plant"><InternalElement Name="Arm" ID="a">'
        '<RoleRequirements RefBaseRoleClassPath="[http://vendor/roles]/[Robot]"/>'
        f'<ExternalInterface Name="Shape" ID="g" RefBaseClassPath="{INTERFACE}/GeometryDataConnector">'
        '<Attribute Name="refURI"><Value>/geometry/box.dae</Value></Attribute></ExternalInterface>'
        "</InternalElement></InstanceHierarchy>"
    )
    file = container(
        tmp_path / "a.amlx",
        **{"plants/cell.aml": text, "geometry/box.dae": box, "_rels/.rels": related("plants/cell.aml")},
    )
    assert cli.main(["import", str(file), str(tmp_path / "made")]) == Exit.WITHIN
    assert "1 parts with a shape, 1 robots" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "is not XML"),
        ("<a/>", "is no CAEXFile"),
        ('<!DOCTYPE a [<!ENTITY b "c">]><CAEXFile>&b;</CAEXFile>', "declares XML entities"),
        (hierarchy("<InternalElement>" * 200 + "</InternalElement>" * 200), "nested 60 deep"),
        (hierarchy(frame(unit="furlong", x=1)), "furlong"),
        (hierarchy(frame(x="near")), "'near' is no length"),
        (hierarchy(frame(x="nan")), "is no length"),
    ],
)
def test_what_is_wrong_is_said(tmp_path, text, says):
    (tmp_path / "a.aml").write_text(text)
    with pytest.raises(InputError, match=says):
        read(tmp_path / "a.aml")


@pytest.mark.parametrize(
    "uri", ["../secret.dae", "/etc/passwd", "C:\\a.dae", "file:///etc/passwd", "gone.dae"]
)
def test_nothing_outside_the_plant_is_read(tmp_path, capsys, box, uri):
    (tmp_path / "secret.dae").write_bytes(box)
    for make in (written, packed):
        folder = tmp_path / make.__name__
        file = make(folder, OLD.format(plant(uri=uri)), box)
        assert cli.main(["import", str(file), str(folder / "made")]) == Exit.WITHIN
        assert "0 parts with a shape" in capsys.readouterr().out
        assert not list((folder / "made" / "cad").iterdir())
        # What could not be brought keeps everything from being within.
        (missing,) = tomllib.loads((folder / "made/workstation.toml").read_text())["left_out"]
        assert set(missing) == {"name", "why"}


def test_a_folder_with_something_in_it_is_not_touched(tmp_path, capsys, box):
    file = written(tmp_path / "plant", OLD.format(plant()), box)
    assert cli.main(["import", str(file), str(tmp_path / "plant")]) == Exit.ERROR
    assert "exists already" in capsys.readouterr().err


def test_damaged_containers_are_an_error_or_a_plant(tmp_path, box):
    rng, refused = random.Random(3), 0
    whole = packed(tmp_path, OLD.format(plant()), box).read_bytes()
    for _ in range(300):
        data = bytearray(whole)
        for _ in range(rng.randrange(1, 30)):
            data[rng.randrange(len(data))] = rng.randrange(256)
        file = tmp_path / "damaged.amlx"
        file.write_bytes(data)
        try:
            read(file)
        except InputError:
            refused += 1
    assert refused > 10


def test_a_container_that_unpacks_to_too_much_is_refused(tmp_path):
    file = tmp_path / "bomb.amlx"
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("cell.aml", b" " * (70 << 20))
    file.write_bytes(buffer.getvalue())
    with pytest.raises(InputError, match="larger than 64 MiB"):
        read(file)


def test_a_plant_of_structure_alone_is_said_to_be_so(tmp_path, capsys):
    inner = '<InternalElement Name="Site"><InternalElement Name="Cell"/></InternalElement>'
    (tmp_path / "plant.aml").write_text("\ufeff" + hierarchy(inner), encoding="utf-8")
    assert cli.main(["import", str(tmp_path / "plant.aml"), str(tmp_path / "made")]) == Exit.WITHIN
    said = " ".join(capsys.readouterr().out.split())
    assert "3 elements, none of which has a geometry file" in said


def test_names_of_others_are_texts_and_a_decimal_comma_is_said(tmp_path, box):
    """A file's name may hold a line break, an attribute a quote: neither may write a table of its own."""
    folder = tmp_path / "plant"
    file = written(folder, OLD.format(plant()).replace("DB1.Speed", "DB1&quot;\x7f.Speed"), box)
    file = file.rename(folder / 'a\n[[robots]]\nname = "b".aml')
    text = file.read_text(encoding="utf-8")
    file.write_text(re.sub(r"<Value>1</Value>", "<Value>1,0</Value>", text, count=1), encoding="utf-8")
    found = read(file)
    assert ["commas in numbers are read as decimal points" in f.text for f in found.findings] == [True]
    assert cli.main(["import", str(file), str(tmp_path / "cell")]) == Exit.WITHIN
    table = tomllib.loads((tmp_path / "cell" / "workstation.toml").read_text(encoding="utf-8"))
    assert "robots" not in table
    assert table["title"] == file.name
    variables = tomllib.loads((tmp_path / "cell" / "variables.toml").read_text(encoding="utf-8"))["variables"]
    assert variables[0]["address"] == 'DB1"\x7f.Speed'


def test_what_only_a_class_has_is_taken_from_it_and_mirrors_are_there_once(tmp_path, capsys, box):
    geometry = (
        f'<ExternalInterface Name="Geometry" RefBaseClassPath="{INTERFACE}/COLLADAInterface">'
        '<Attribute Name="refURI"><Value>geometry/box.dae</Value></Attribute></ExternalInterface>'
    )
    library = (
        '<SystemUnitClassLib Name="Lib"><SystemUnitClass Name="Base">'
        f"{geometry}</SystemUnitClass>"
        '<SystemUnitClass Name="Clamp" RefBaseClassPath="Lib/Base">'
        f'<SupportedRoleClass RefRoleClassPath="{ROLE}/Fixture"/></SystemUnitClass>'
        '<SystemUnitClass Name="Loop" RefBaseClassPath="Lib/Loop"/></SystemUnitClassLib>'
    )
    own = geometry.replace("Geometry", "Mine")
    elements = (
        '<InternalElement Name="One" ID="{1}" RefBaseSystemUnitPath="Lib/Clamp">'
        f"{frame(x=1)}</InternalElement>"
        f'<InternalElement Name="Two" ID="{{2}}" RefBaseSystemUnitPath="Lib/Clamp">{own}</InternalElement>'
        '<InternalElement Name="Again" ID="{3}" RefBaseSystemUnitPath="{1}"/>'
        '<InternalElement Name="Lost" ID="{4}" RefBaseSystemUnitPath="{9}"/>'
        '<InternalElement Name="Round" ID="{5}" RefBaseSystemUnitPath="Lib/Loop"/>'
        '<InternalElement Name="Far" ID="{6}" RefBaseSystemUnitPath="Other@Lib/Thing"/>'
    )
    text = OLD.format(f'<InstanceHierarchy Name="a">{elements}</InstanceHierarchy>{library}')
    file = written(tmp_path / "in", text, box)
    assert cli.main(["import", str(file), str(tmp_path / "cell")]) == Exit.WITHIN
    made = (tmp_path / "cell/workstation.toml").read_text()
    parts = tomllib.loads(made)["parts"]
    assert [part["name"] for part in parts] == ["One", "Two"]
    assert parts[0]["at"]["position"] == [1, 0, 0]
    (top,) = read(file).roots
    assert [element.has_role("Fixture") for element in top.children] == [True, True] + 4 * [False]
    said = " ".join(finding.text for finding in read(file).findings)
    assert "2 elements have from their classes what they do not state: One, Two" in said
    assert "1 elements mirror others, which are there once: Again (One)" in said
    assert "Lost mirrors an element that is not in the file" in said
    assert "Lib/Loop is derived from itself" in said
    assert "Other@Lib/Thing of 1 element is not in the file" in said


def test_kinematics_of_a_plant_are_robots_and_other_geometry_parts(tmp_path):
    """Two arms of one COLLADA 1.5 file, and a STEP file of two parts, each at the place of its element."""
    made = runpy.run_path(str(REPOSITORY / "scripts/make-imported-line"))
    step = made["Step"]()
    block = step.box("block", (40.0, 20.0, 10.0))
    step.assembly("pair", [(block, "a", made["place"]()), (block, "b", made["place"](100.0))])

    def element(name, uris, x):
        connectors = "".join(
            f'<ExternalInterface Name="g{k}" RefBaseClassPath="{INTERFACE}/COLLADAInterface">'
            f'<Attribute Name="refURI"><Value>{uri}</Value></Attribute></ExternalInterface>'
            for k, uri in enumerate(uris)
        )
        role = f'<RoleRequirements RefBaseRoleClassPath="{ROLE}/Robot"/>' if "dae" in uris[0] else ""
        inside = frame(x=x, rz=90) + connectors + role
        return f'<InternalElement Name="{name}">{inside}</InternalElement>'

    arm = ("arm.dae#kinematics", "arm.dae#visual")
    rows = [element("left", arm, 1), element("right", arm, 2), element("Bin 1", ["pair.step"], 3)]
    (tmp_path / "arm.dae").write_bytes((REPOSITORY / "tests/model_io/files/arm.dae").read_bytes())
    (tmp_path / "pair.step").write_text(step.text())
    (tmp_path / "cell.aml").write_text(hierarchy("".join(rows)))
    assert cli.main(["import", str(tmp_path / "cell.aml"), str(tmp_path / "cell")]) == Exit.WITHIN
    tables = tomllib.loads((tmp_path / "cell/workstation.toml").read_text())
    assert [robot["name"] for robot in tables["robots"]] == ["left", "right"]
    assert tables["robots"][0]["model"] == tables["robots"][1]["model"]
    for k, robot in enumerate(tables["robots"], 1):
        assert robot["base"]["position"] == pytest.approx([k, 0, 0], abs=1e-9)
        assert robot["base"]["wxyz"] == pytest.approx([math.sqrt(0.5), 0, 0, math.sqrt(0.5)])
    assert [part["name"] for part in tables["parts"]] == ["Bin_1/pair/a", "Bin_1/pair/b"]
    assert tables["parts"][1]["at"]["position"] == pytest.approx([3, 0.1, 0])
    assert "# [[robots]]" not in (tmp_path / "cell/workstation.toml").read_text()
    model = load(tmp_path / "cell").model
    assert {robot.name for robot in model.workstation.robots} == {"left", "right"}
