"""CAD files broken in every way, brought as ``seerob import`` brings them: a cell or a sentence."""

import io
import math
import os
import random
import runpy
import zipfile
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from seerob.app.importing.folder import Densities, files
from seerob.app.importing.plant import Made
from seerob.core.errors import InputError
from seerob.description.cad import reading
from seerob.description.cad.recognised import recognised
from seerob.description.formats import automationml
from soak.forked import forked
from soak.made_cells import KINDS
from soak.mutations import mutated, mutated_text, mutated_zip

ROOT = Path(__file__).parents[2]
LINE = runpy.run_path(str(ROOT / "scripts/make-imported-line"))["line"]
ARM = Path(__file__).parents[1] / "model_io/files/arm.dae"
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
SDF = """<sdf version="1.9"><world name="w"><model name="t"><static>true</static><pose>1 2 0.3 0 0 1</pose>
<link name="l"><visual name="v"><geometry><box><size>0.2 0.4 0.6</size></box></geometry></visual></link>
</model><model name="door"><frame name="f" attached_to="post"><pose>0.1 0 0 0 0 0</pose></frame>
<link name="post"><collision name="c"><geometry><cylinder><radius>0.1</radius><length>1</length></cylinder>
</geometry></collision></link><link name="leaf"><pose relative_to="f">0.5 0 0 0 0 0.5</pose>
<inertial><mass>12</mass>
<inertia><ixx>1</ixx><iyy>2</iyy><izz>2.5</izz></inertia></inertial><collision name="c"><geometry>
<sphere><radius>0.2</radius></sphere></geometry></collision></link><joint name="h" type="revolute">
<parent>post</parent><child>leaf</child><axis><xyz>0 0 2</xyz><limit><lower>0</lower><upper>1.5</upper>
<velocity>3</velocity></limit></axis></joint></model></world></sdf>"""
USD = """#usda 1.0
( metersPerUnit = 0.01
  upAxis = "Z" )
def Xform "arm" ( prepend apiSchemas = ["PhysicsArticulationRootAPI"] )
{
 def Xform "base" ( prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsMassAPI"] )
 {
  float physics:mass = 2.5
  double3 xformOp:translate = (100, 0, 20)
  uniform token[] xformOpOrder = ["xformOp:translate"]
  def Mesh "m"
  {
   int[] faceVertexCounts = [3, 3, 3, 3]
   int[] faceVertexIndices = [0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3]
   point3f[] points = [(0, 0, 0), (10, 0, 0), (0, 10, 0), (0, 0, 10)]
  }
 }
 def Xform "tip" ( prepend apiSchemas = ["PhysicsRigidBodyAPI"] )
 {
  double3 xformOp:translate = (100, 0, 60)
  uniform token[] xformOpOrder = ["xformOp:translate"]
  def Cube "c"
  {
   double size = 5
  }
 }
 def PhysicsRevoluteJoint "j"
 {
  uniform token physics:axis = "Z"
  rel physics:body0 = </arm/base>
  rel physics:body1 = </arm/tip>
  point3f physics:localPos0 = (0, 0, 40)
  float physics:lowerLimit = -90
  float physics:upperLimit = 45
 }
}
def Cylinder "post"
{
 double radius = 4
 double height = 30
}
"""


def _packed(files):
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return buffer.getvalue()


def _3dxml():
    manifest = "<Manifest><Root>a.3dxml</Root></Manifest>"
    return _packed({"Manifest.xml": manifest, "a.3dxml": STRUCTURE, "s.3DRep": SURFACE})


def _small(folder):
    """A block with a hole as STEP and as IGES, by OpenCASCADE itself."""
    from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeCylinder
    from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt
    from OCP.IGESControl import IGESControl_Writer

    hole = BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(20, 10, 0), gp_Dir(0, 0, 1)), 5.0, 30.0).Shape()
    solid = BRepAlgoAPI_Cut(BRepPrimAPI_MakeBox(40.0, 20.0, 10.0).Shape(), hole).Shape()
    writer = IGESControl_Writer("MM", 1)
    writer.AddShape(solid)
    writer.ComputeModel()
    assert writer.Write(str(folder / "a.igs"))
    return (folder / "a.igs").read_bytes()


def _crate(folder):
    from pxr import Usd

    (folder / "a.usda").write_text(USD)
    Usd.Stage.Open(str(folder / "a.usda")).Export(str(folder / "a.usdc"))
    return (folder / "a.usdc").read_bytes()


def _of(kind):
    def made(folder):
        path = folder / f"f.{KINDS[kind].suffix}"
        KINDS[kind].make(path)
        return path.read_bytes()

    return made


MADE = {
    "step": (lambda _: LINE().text().encode(), mutated_text),
    "iges": (_small, mutated_text),
    "3dxml": (lambda _: _3dxml(), mutated_zip),
    "usda": (lambda _: USD.encode(), mutated_text),
    "usdc": (_crate, mutated),
    "usdz": (lambda _: _packed({"a.usda": USD}), mutated_zip),
    "sdf": (lambda _: SDF.encode(), mutated_text),
    "dae": (lambda _: ARM.read_bytes(), mutated_text),
    "zae": (lambda _: _packed({"arm.dae": ARM.read_bytes()}), mutated_zip),
    **{
        kind: (_of(kind), KINDS[kind].change) for kind in ("urdf", "mjcf", "glb", "gltf", "3mf", "obj", "off")
    },
    **{kind: (_of(kind), KINDS[kind].change) for kind in ("stl", "stl text", "ply", "ply text")},
    "aml": (_of("automationml"), mutated_text),
    "amlx": (_of("automationml container"), mutated_zip),
}
"""Format → a valid file of it, and how it is broken."""

ENDINGS = {"urdf": "urdf", "mjcf": "xml"}
"""Of descriptions, which are told by name."""


CRASHING = {"step", "iges", "usda", "usdc", "usdz"}
"""Formats whose libraries crash on damaged files: that must be a sentence here."""


def outcome(path):
    """Whether a file was read, refused, or ended the process that read it; anything else raises."""
    try:
        ending = recognised(path, path.read_bytes())
        if ending in (".aml", ".amlx"):
            Made(automationml.read(path)).files()
            return "read"
        # Formats that say no unit are asked for one.
        given = {"units": "mm", "up": "z"} if ending in (".stl", ".obj", ".ply", ".off") else {}
        assembly = reading.read(path, ending, **given)
        made = files(assembly, path, Densities(), options={})
    except InputError as error:
        return "ended" if "ends the process" in str(error) else "refused"
    assert assembly.instances or assembly.mechanisms
    for instance in assembly.instances:
        assert np.isfinite(instance.world_from_shape).all()
        pieces = assembly.shapes[instance.shape].pieces
        assert all(np.isfinite(mesh.vertices).all() for mesh in pieces)
    for name in made.meshes:
        assert ".." not in name.split("/")
        assert not name.startswith(("/", "\\"))
    for row in made.parts:
        assert all(math.isfinite(x) for corner in row["box"] for x in corner)
    return "read"


def broken(kind, whole, seed, number):
    """The file of this number; no other one needs to be made before."""
    return MADE[kind][1](whole, random.Random(f"{kind} {seed} {number}"))


def hunted(kind, folder, seed, numbers):
    """How many broken files were read, refused, or ended the reader's process; and what else came."""
    whole = MADE[kind][0](folder)
    inner = folder / "inner"
    inner.mkdir(exist_ok=True)
    for left in (*folder.glob("*.*"), *inner.iterdir()):
        left.unlink()
    path = inner / f"f.{ENDINGS.get(kind, 'cad')}"
    path.write_bytes(whole)
    assert outcome(path) == "read"
    counts, wrong, kept = Counter(), [], os.environ.get("SEEROB_KEEP_BROKEN")
    for number in numbers:
        path.write_bytes(broken(kind, whole, seed, number))
        try:
            counts[outcome(path)] += 1
            assert sorted(p.name for p in folder.rglob("*")) == sorted([path.name, "inner"])
        except Exception as error:
            wrong.append(f"{kind}, seed {seed}, file {number}: {type(error).__name__}: {error}")
            if kept:
                (Path(kept) / f"{kind}-{seed}-{number}").write_bytes(path.read_bytes())
    return counts, wrong


@pytest.mark.parametrize("kind", MADE)
def test_damaged_files_are_parts_or_a_sentence(tmp_path, kind):
    counts, wrong = hunted(kind, tmp_path, 0, range(4 if kind in CRASHING else 60))
    assert not wrong
    assert kind in CRASHING or counts["refused"] > 0


@pytest.mark.soak
@pytest.mark.parametrize("kind", MADE)
def test_ten_thousand_damaged_files_are_parts_or_a_sentence(tmp_path, kind):
    """``SEEROB_SOAK_SEED`` and ``SEEROB_SOAK_FILES``, as ``7`` and ``2000-4000``, say other ones."""
    for module in ("OCP.STEPCAFControl", "pxr.Usd") if kind in CRASHING else ():
        pytest.importorskip(module)
    seed = int(os.environ.get("SEEROB_SOAK_SEED", "1"))
    first, last = map(int, os.environ.get("SEEROB_SOAK_FILES", "0-10000").split("-"))
    with forked():
        counts, wrong = hunted(kind, tmp_path, seed, range(first, last))
    assert not wrong, "\n".join(wrong)
    print(f"{kind}, seed {seed}, files {first} to {last}: {dict(counts)}")
    assert counts["read"] > 0
    assert counts["refused"] > 0
    assert not counts["ended"] or kind in CRASHING
