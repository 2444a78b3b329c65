"""CAD files broken in every way: parts or a sentence; nothing else ends, nothing is written elsewhere."""

import io
import random
import runpy
import zipfile
from pathlib import Path

import numpy as np
import pytest

from seerob.core.errors import InputError
from seerob.description.cad import step, threedxml
from seerob.description.mesh_files import MeshSource
from soak.mutations import mutated

ROOT = Path(__file__).parents[2]
LINE = runpy.run_path(str(ROOT / "scripts/make-imported-line"))["line"]
SURFACE = (
    '<X xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance"><Rep xsi:type="PolygonalRepType">'
    '<Faces><Face triangles="0 1 2 0 2 3" strips="0 1 2 3,1 2 3" fans="0 1 2 3"/></Faces>'
    "<VertexBuffer><Positions>0 0 0,1 0 0,1 1 0,0 1 2</Positions></VertexBuffer></Rep></X>"
)
STRUCTURE = (
    '<Model_3dxml><ProductStructure root="1"><Reference3D id="1" name="a"/><Reference3D id="2" name="b"/>'
    '<Instance3D id="3" name="c"><IsAggregatedBy>1</IsAggregatedBy><IsInstanceOf>2</IsInstanceOf>'
    "<RelativeMatrix>1 0 0 0 1 0 0 0 1 5 6 7</RelativeMatrix></Instance3D>"
    '<ReferenceRep id="5" associatedFile="urn:3DXML:s.3DRep"/><InstanceRep id="6">'
    "<IsAggregatedBy>2</IsAggregatedBy><IsInstanceOf>5</IsInstanceOf></InstanceRep>"
    "</ProductStructure></Model_3dxml>"
)


def packed(structure, surface):
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr("Manifest.xml", "<Manifest><Root>a.3dxml</Root></Manifest>")
        archive.writestr("a.3dxml", structure)
        archive.writestr("s.3DRep", surface)
    return buffer.getvalue()


def surfaces(rng):
    inner = [mutated(text.encode(), rng) if rng.random() < 0.6 else text for text in (STRUCTURE, SURFACE)]
    data = packed(*inner)
    return mutated(data, rng) if rng.random() < 0.3 else data


def outcome(read, path, data):
    """Whether it was read or refused."""
    try:
        found = read(MeshSource(path, data, 1 << 26, 10**6))
    except InputError as error:
        return "ended" if "ends the process" in str(error) else "refused"
    assert found.instances
    for instance in found.instances:
        assert np.isfinite(instance.world_from_shape).all()
        assert all(np.isfinite(mesh.vertices).all() for mesh in found.shapes[instance.shape].pieces)
    return "read"


@pytest.mark.soak
def test_damaged_step_files_end_no_program_but_the_readers(tmp_path):
    rng, whole = random.Random(11), LINE().text().encode()
    (tmp_path / "inner").mkdir()
    path = tmp_path / "inner" / "a.step"
    counts = [outcome(step.read, path, mutated(whole, rng)) for _ in range(200)]
    assert {"read", "refused", "ended"} <= set(counts)
    assert [p.name for p in tmp_path.rglob("*")] == ["inner"]


@pytest.mark.parametrize("count", [500, pytest.param(10_000, marks=pytest.mark.soak)])
def test_damaged_3dxml_files_are_parts_or_a_sentence(tmp_path, count):
    rng = random.Random(count)
    counts = [outcome(threedxml.read, tmp_path / "a.3dxml", surfaces(rng)) for _ in range(count)]
    assert {"read", "refused"} == set(counts)
