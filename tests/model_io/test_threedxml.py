"""3DXML with triangles: instances, several documents, what only CATIA reads, and damaged archives."""

import random
import zipfile

import numpy as np
import pytest
import trimesh

from seerob.core.errors import InputError
from seerob.description.cad import threedxml
from seerob.description.mesh_files import MeshSource
from seerob.description.shapes.mesh_bodies import is_closed, joined
from seerob.description.shapes.moments import signed_volume

XSI = 'xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" xmlns="http://www.3ds.com/xsd/3DXML"'
UNTURNED = "1 0 0 0 1 0 0 0 1"
TURNED = "0 1 0 -1 0 0 0 0 1"
"""By 90° about z: the first three numbers are where x goes."""


def surface(box, ways=("triangles",)):
    points = ",".join(" ".join(f"{x:g}" for x in row) for row in box.vertices)
    halves = np.array_split(box.faces, 2)
    faces = ""
    for half, color in zip(halves, ("1", "0"), strict=True):
        way = ways[0]
        text = (
            " ".join(map(str, half.ravel()))
            if way == "triangles"
            else ",".join(" ".join(map(str, f)) for f in half)
        )
        faces += (
            f'<Face {way}="{text}"><SurfaceAttributes xsi:type="SurfaceAttributesType">'
            f'<Color xsi:type="RGBAColorType" red="{color}" green="0" blue="0"/></SurfaceAttributes></Face>'
        )
    return (
        f'<XMLRepresentation {XSI}><Root xsi:type="BagRepType"><Rep xsi:type="PolygonalRepType">'
        f"<Faces>{faces}</Faces><VertexBuffer><Positions>{points}</Positions></VertexBuffer>"
        "</Rep></Root></XMLRepresentation>"
    )


def structure(inner, root="1"):
    return f'<Model_3dxml {XSI}><ProductStructure root="{root}">{inner}</ProductStructure></Model_3dxml>'


def product(number, name):
    return f'<Reference3D xsi:type="Reference3DType" id="{number}" name="{name}"/>'


def instance(number, name, parent, child, place):
    return (
        f'<Instance3D id="{number}" name="{name}"><IsAggregatedBy>{parent}</IsAggregatedBy>'
        f"<IsInstanceOf>{child}</IsInstanceOf><RelativeMatrix>{place}</RelativeMatrix></Instance3D>"
    )


def shape(number, parent, file):
    return (
        f'<ReferenceRep id="{number}" format="TESSELLATED" associatedFile="urn:3DXML:{file}"/>'
        f'<InstanceRep id="{number}0"><IsAggregatedBy>{parent}</IsAggregatedBy>'
        f"<IsInstanceOf>{number}</IsInstanceOf></InstanceRep>"
    )


BOX = trimesh.creation.box(bounds=[[0, 0, 0], [40, 20, 10]])
PART = product(2, "block") + shape(5, 2, "block.3DRep")
LINE = (
    product(1, "line") + PART + instance(3, "left", 1, 2, f"{UNTURNED} 100 0 0")
    + instance(4, "right", 1, 2, f"{TURNED} 0 0 500")
)  # fmt: skip


def packed(file, **members):
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("Manifest.xml", "<Manifest><Root>main.3dxml</Root></Manifest>")
        for name, data in members.items():
            archive.writestr(name.replace("__", "."), data)
    return file


def read(file):
    return threedxml.read(MeshSource(file, file.read_bytes(), 1 << 26, 10**6))


def corners(found):
    for instance in found.instances:
        moved = [m.moved(instance.world_from_shape).vertices for m in found.shapes[instance.shape].pieces]
        yield np.vstack(moved)


@pytest.mark.parametrize("way", ["triangles", "strips", "fans"])
def test_instances_places_and_surfaces(tmp_path, way):
    found = read(packed(tmp_path / "a.3dxml", main__3dxml=structure(LINE), block__3DRep=surface(BOX, (way,))))
    assert found.names() == ["line/left", "line/right"]
    left, right = corners(found)
    assert np.ptp(left, axis=0) == pytest.approx([0.04, 0.02, 0.01])
    assert left.min(axis=0) == pytest.approx([0.1, 0, 0], abs=1e-12)
    assert right.min(axis=0) == pytest.approx([-0.02, 0, 0.5])
    (shape,) = found.shapes
    assert {piece.color[0] for piece in shape.pieces} == {0.0, 1.0}
    whole, _ = joined(shape.pieces)
    assert is_closed(whole)
    assert signed_volume(whole) == pytest.approx(8e-6)


def test_documents_that_name_others_are_followed(tmp_path):
    other = structure(product(1, "block") + shape(5, 1, "block.3DRep"))
    line = product(1, "line") + instance(3, "left", 1, "urn:3DXML:part.3dxml#1", f"{UNTURNED} 0 0 0")
    file = tmp_path / "a.3dxml"
    found = read(packed(file, main__3dxml=structure(line), part__3dxml=other, block__3DRep=surface(BOX)))
    assert found.names() == ["line/left"]
    line += instance(4, "right", 1, "urn:3DXML:gone.3dxml#1", f"{UNTURNED} 0 0 0")
    found = read(packed(file, main__3dxml=structure(line), part__3dxml=other, block__3DRep=surface(BOX)))
    assert found.names() == ["line/left"]
    assert {name for name, _ in found.left_out} == {"gone.3dxml", "line/right"}


def test_until_edition_3_a_format_of_its_own_says_where_the_surface_is(tmp_path):
    """As converters still write it, with the surface in the document of its product."""
    polygons = surface(BOX).partition("<Root")[2].replace("</Root></XMLRepresentation>", "</AssociatedXML>")
    part = (
        product(1, "block") + '<ReferenceRep id="5"/><InstanceRep id="4"><IsAggregatedBy>1</IsAggregatedBy>'
        "<IsInstanceOf>urn:3DXML:Reference:loc:5</IsInstanceOf></InstanceRep>"
        '<RepFormat format="TESSELLATED" owner="5" associatedFile="urn:3DXML:Representation:loc:9"/>'
    )
    inner = f'<GeometricRepresentationSet><Representation id="9"><AssociatedXML{polygons}</Representation>'
    part = structure(part).replace("</Model_3dxml>", f"{inner}</GeometricRepresentationSet></Model_3dxml>")
    place = f"{UNTURNED} 100 0 0"
    line = product(1, "line") + instance(2, "left", 1, "urn:3DXML:Reference:ext:part.3dxml#1", place)
    found = read(packed(tmp_path / "a.3dxml", main__3dxml=structure(line), part__3dxml=part))
    assert (found.names(), found.left_out) == (["line/left"], ())
    assert np.vstack(list(corners(found))).min(axis=0) == pytest.approx([0.1, 0, 0], abs=1e-12)


def test_an_unpacked_document_has_its_surfaces_beside_it(tmp_path):
    file = tmp_path / "a.3dxml"
    file.write_text(structure(LINE))
    with pytest.raises(InputError, match="holds no triangles"):
        read(file)
    (tmp_path / "block.3DRep").write_text(surface(BOX))
    assert read(file).names() == ["line/left", "line/right"]
    file.write_text(structure(LINE.replace("block.3DRep", "../block.3DRep")))
    with pytest.raises(InputError, match="outside its own folder"):
        read(file)


def test_what_only_catia_reads_is_answered_with_the_export(tmp_path):
    file = tmp_path / "a.3dxml"
    with pytest.raises(InputError, match="XML tessellation"):
        read(packed(file, main__3dxml=structure(LINE), block__3DRep=b"V5_CFV2\0\1\2"))
    two = LINE + product(7, "pin") + shape(8, 7, "pin.3DRep") + instance(9, "pin", 1, 7, f"{UNTURNED} 0 0 0")
    found = read(packed(file, main__3dxml=structure(two), block__3DRep=surface(BOX), pin__3DRep=b"\0\1"))
    assert found.names() == ["line/left", "line/right"]
    ((name, why),) = found.left_out
    assert name == "line/pin"
    assert "CATIA's own" in why


@pytest.mark.parametrize(
    ("inner", "rep", "says"),
    [
        (LINE + instance(6, "again", 2, 1, f"{UNTURNED} 0 0 0"), None, "contains itself"),
        (LINE.replace("100 0 0<", "nan 0 0<"), None, "twelve numbers"),
        (LINE.replace(" 100 0 0<", "<"), None, "twelve numbers"),
        (LINE, surface(BOX).replace('triangles="', 'triangles="99 0 1 '), "of 8"),
        (LINE, surface(BOX).replace("<Positions>", "<Positions>1e300 "), "triples of numbers"),
        (LINE, "<!DOCTYPE a [<!ENTITY b 'c'>]><a>&b;</a>", "not a readable 3DXML"),
        (product(1, "line"), None, "holds no triangles"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said(tmp_path, inner, rep, says):
    with pytest.raises(InputError, match=says):
        read(packed(tmp_path / "a.3dxml", main__3dxml=structure(inner), block__3DRep=rep or surface(BOX)))


def test_an_archive_that_unpacks_to_too_much_is_refused(tmp_path):
    with pytest.raises(InputError, match="unpacks to more"):
        read(packed(tmp_path / "a.3dxml", main__3dxml=structure(LINE), block__3DRep=b" " * (70 << 20)))


def test_damaged_files_are_parts_or_a_sentence(tmp_path):
    file = packed(tmp_path / "a.3dxml", main__3dxml=structure(LINE), block__3DRep=surface(BOX))
    whole, rng, refused = file.read_bytes(), random.Random(4), 0
    texts = structure(LINE), surface(BOX)
    for k in range(300):
        if k % 2:
            data = bytearray(whole)
            for _ in range(rng.randrange(1, 20)):
                data[rng.randrange(len(data))] = rng.randrange(256)
            file.write_bytes(data)
        else:
            spoiled = [list(text) for text in texts]
            for text in spoiled:
                for _ in range(rng.randrange(3)):
                    text[rng.randrange(len(text))] = rng.choice('<>"/ #9-e.&')
            packed(file, main__3dxml="".join(spoiled[0]), block__3DRep="".join(spoiled[1]))
        try:
            assert all(np.isfinite(points).all() for points in corners(read(file)))
        except InputError:
            refused += 1
    assert refused > 50


def _many(folder, files):
    """An unpacked document with a surface in each of these files, of which one of 10 kB has no triangles."""
    rows = "".join(shape(1000 + k, 1, file) for k, file in enumerate(files))
    (folder / "a.3dxml").write_text(structure(product(1, "g") + rows))
    (folder / "big.3DRep").write_text(f"<X>{'<a/>' * 2500}</X>")
    (folder / "block.3DRep").write_text(surface(BOX))
    source = MeshSource(folder / "a.3dxml", (folder / "a.3dxml").read_bytes(), 200_000, 10**6)
    source.files["a.3dxml"] = source.data
    return threedxml._Archive(source)


def test_a_file_of_an_unpacked_document_is_parsed_once(tmp_path, monkeypatch):
    archive = _many(tmp_path, ["big.3DRep"] * 300 + ["block.3DRep"] * 2)
    read = []
    content = archive.content
    monkeypatch.setattr(archive, "content", lambda name: read.append(name) or content(name))
    assembly = archive.assembly()
    assert read == ["a.3dxml", "big.3DRep", "block.3DRep"]
    assert [instance.shape for instance in assembly.instances] == [0, 0]
    assert len(assembly.left_out) == 300


def test_files_of_an_unpacked_document_have_one_budget(tmp_path):
    archive = _many(tmp_path, ["./" * k + "big.3DRep" for k in range(30)])
    with pytest.raises(InputError, match="larger than 200000 bytes"):
        archive.assembly()
