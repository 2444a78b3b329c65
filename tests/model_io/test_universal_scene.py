"""USD scenes that OpenUSD wrote, against OpenUSD's own boxes and transforms; damaged and hostile ones."""

import random
import tomllib
import zipfile

import numpy as np
import pytest

from seerob.app import cli
from seerob.app.console.terminal import Exit
from seerob.core.errors import InputError
from seerob.core.shapes import Mesh
from seerob.core.snapshot import Origin
from seerob.description.cad import usd
from seerob.description.cad.assembly import baked
from seerob.description.cad.containing import ball, cylinder, rounded
from seerob.description.description import base_from_links
from seerob.description.loader import load_robot
from seerob.description.mesh_files import MeshSource
from soak.mutations import mutated

pxr = pytest.importorskip("pxr")
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics  # noqa: E402


def read(path):
    return usd.read(MeshSource(path, path.read_bytes(), 1 << 20, 10**6))


def block(stage, path, at=(0, 0, 0), size=(1, 2, 3), turn=0.0, scale=None):
    mesh = UsdGeom.Mesh.Define(stage, path)
    x, y, z = size
    mesh.CreatePointsAttr([(i * x, j * y, k * z) for k in (0, 1) for j in (0, 1) for i in (0, 1)])
    mesh.CreateFaceVertexCountsAttr([4] * 6)
    mesh.CreateFaceVertexIndicesAttr([0, 2, 3, 1, 4, 5, 7, 6, 0, 1, 5, 4, 2, 6, 7, 3, 0, 4, 6, 2, 1, 3, 7, 5])
    mesh.CreateSubdivisionSchemeAttr("none")
    mesh.CreateDisplayColorAttr([(1, 0, 0)])
    api = UsdGeom.XformCommonAPI(mesh)
    api.SetTranslate(at)
    api.SetRotate((0, 0, turn))
    if scale:
        api.SetScale(scale)
    return mesh


def scene(path, up="Y", meters=0.01):
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, up)
    UsdGeom.SetStageMetersPerUnit(stage, meters)
    return stage


@pytest.mark.parametrize("ending", ["usda", "usdc", "usdz"])
@pytest.mark.parametrize("up", ["Y", "Z"])
def test_boxes_and_names_are_those_that_openusd_says(tmp_path, ending, up):
    path = tmp_path / f"a.{'usda' if ending == 'usdz' else ending}"
    stage = scene(path, up)
    UsdGeom.Xform.Define(stage, "/World")
    stage.SetDefaultPrim(stage.GetPrimAtPath("/World"))
    line = UsdGeom.Xform.Define(stage, "/World/line")
    UsdGeom.XformCommonAPI(line).SetTranslate((10, 20, 30))
    UsdGeom.XformCommonAPI(line).SetRotate((0, 0, 30))
    block(stage, "/World/line/left", (100, 0, 0), turn=20)
    block(stage, "/World/line/right", (200, 0, 0), scale=(2, -1, 3)).GetPrim().SetDisplayName("rechts ä")
    UsdGeom.Cylinder.Define(stage, "/World/line/drum").CreateRadiusAttr(5)
    UsdGeom.Sphere.Define(stage, "/World/hidden").CreateVisibilityAttr("invisible")
    UsdGeom.PointInstancer.Define(stage, "/World/many")
    stage.Save()
    if ending == "usdz":
        from pxr import UsdUtils

        assert UsdUtils.CreateNewUsdzPackage(Sdf.AssetPath(str(path)), str(tmp_path / "a.usdz"))
        path = tmp_path / "a.usdz"
    found = baked(read(path))
    assert found.names() == ["line/left", "line/rechts_a", "line/drum"]
    cache = UsdGeom.BBoxCache(Usd.TimeCode.Default(), ["default"])
    turned = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]) if up == "Y" else np.eye(3)
    for instance, name in zip(found.instances, ("left", "right"), strict=False):
        prim = stage.GetPrimAtPath(f"/World/line/{name}")
        bound = cache.ComputeWorldBound(prim)
        corners = np.array([bound.GetBox().GetCorner(i) for i in range(8)], float)
        matrix = np.array(bound.GetMatrix(), float)
        peer = (corners @ matrix[:3, :3] + matrix[3, :3]) @ turned.T * 0.01
        ours = np.vstack(
            [m.moved(instance.world_from_shape).vertices for m in found.shapes[instance.shape].pieces]
        )
        assert ours.min(axis=0) == pytest.approx(peer.min(axis=0), abs=1e-9)
        assert ours.max(axis=0) == pytest.approx(peer.max(axis=0), abs=1e-9)
    assert found.shapes[0].pieces[0].color == (1, 0, 0, 1)
    assert any("point instancer" in why for _, why in found.left_out)


def arm(path):
    """A pedestal, a link turned by 30° and a slide that is out by 0.1, in centimetres and grams."""
    stage = scene(path, "Z")
    UsdPhysics.SetStageKilogramsPerUnit(stage, 0.001)
    UsdGeom.Xform.Define(stage, "/arm")
    stage.SetDefaultPrim(stage.GetPrimAtPath("/arm"))
    places = {"base": (100, 0, 0), "upper": (100, 0, 50), "tip": (100, 0, 80)}
    for name, at in places.items():
        xform = UsdGeom.Xform.Define(stage, f"/arm/{name}")
        xform.AddTranslateOp().Set(Gf.Vec3d(*at))
        if name != "base":
            xform.AddOrientOp(UsdGeom.XformOp.PrecisionDouble).Set(
                Gf.Quatd(np.cos(np.pi / 12), 0, 0, np.sin(np.pi / 12))
            )
        UsdPhysics.RigidBodyAPI.Apply(xform.GetPrim())
        mass = UsdPhysics.MassAPI.Apply(xform.GetPrim())
        mass.CreateMassAttr(2000)
        mass.CreateCenterOfMassAttr((1, 2, 3))
        mass.CreateDiagonalInertiaAttr((4e5, 5e5, 6e5))
        mass.CreatePrincipalAxesAttr(Gf.Quatf(1, 0, 0, 0))
        UsdPhysics.CollisionAPI.Apply(block(stage, f"/arm/{name}/shape", size=(10, 10, 20)).GetPrim())
    UsdPhysics.ArticulationRootAPI.Apply(stage.GetPrimAtPath("/arm/base"))
    hinge = UsdPhysics.RevoluteJoint.Define(stage, "/arm/hinge")
    hinge.CreateBody0Rel().SetTargets(["/arm/base"])
    hinge.CreateBody1Rel().SetTargets(["/arm/upper"])
    hinge.CreateLocalPos0Attr((0, 0, 50))
    hinge.CreateAxisAttr("Z")
    hinge.CreateLowerLimitAttr(-90)
    hinge.CreateUpperLimitAttr(45)
    # Told from the far side: the tip comes first, so the axis is turned round.
    slide = UsdPhysics.PrismaticJoint.Define(stage, "/arm/slide")
    slide.CreateBody0Rel().SetTargets(["/arm/tip"])
    slide.CreateBody1Rel().SetTargets(["/arm/upper"])
    slide.CreateLocalPos1Attr((0, 0, 20))
    slide.CreateAxisAttr("Z")
    slide.CreateLowerLimitAttr(-30)
    slide.CreateUpperLimitAttr(5)
    loop = UsdPhysics.FixedJoint.Define(stage, "/arm/loop")
    loop.CreateBody0Rel().SetTargets(["/arm/base"])
    loop.CreateBody1Rel().SetTargets(["/arm/tip"])
    loop.CreateExcludeFromArticulationAttr(True)
    stage.Save()
    return stage, places


def test_an_articulation_moves_weighs_and_stands_as_the_scene_shows_it(tmp_path):
    stage, places = arm(tmp_path / "a.usda")
    assert cli.main(["import", str(tmp_path / "a.usda"), str(tmp_path / "cell")]) == Exit.WITHIN
    assert cli.main(["check-file", str(tmp_path / "cell")]) == Exit.WITHIN
    (robot,) = tomllib.loads((tmp_path / "cell/workstation.toml").read_text())["robots"]
    made = load_robot(robot["model"], folder=tmp_path / "cell")
    hinge, slide = made.joints()
    assert robot["q"] == pytest.approx([np.pi / 6, -0.1], abs=1e-7)
    assert [hinge.lower, hinge.upper] == pytest.approx([-np.pi / 2, np.pi / 4])
    assert [slide.lower, slide.upper] == pytest.approx([-0.3, 0.05])
    assert made.link("tip").inertial.mass == pytest.approx(2.0)
    assert made.link("tip").inertial.com == pytest.approx([0.01, 0.02, 0.03])
    assert np.diag(made.link("tip").inertial.inertia) == pytest.approx([0.04, 0.05, 0.06])
    cache = UsdGeom.XformCache()
    base = np.eye(4)
    base[:3, 3] = robot["base"]["position"]
    poses = base_from_links(made, dict(zip(("hinge", "slide"), robot["q"], strict=True)))
    for name in places:
        peer = np.array(cache.GetLocalToWorldTransform(stage.GetPrimAtPath(f"/arm/{name}"))).T
        peer[:3, 3] *= 0.01
        assert base @ poses[name] == pytest.approx(peer, abs=1e-7)


def test_layers_beside_the_file_are_followed_and_others_are_named(tmp_path):
    folder = tmp_path / "cell"
    (folder / "parts").mkdir(parents=True)
    for path in (folder / "parts/pin.usda", tmp_path / "secret.usda"):
        stage = scene(path)
        block(stage, "/pin")
        stage.SetDefaultPrim(stage.GetPrimAtPath("/pin"))
        stage.Save()
    stage = scene(folder / "a.usda")
    for number, name in enumerate(
        ("./parts/pin.usda", "../secret.usda", str(tmp_path / "secret.usda"), "no.usda")
    ):
        stage.DefinePrim(f"/pin_{number}").GetReferences().AddReference(name)
    # What is in the layer itself is no file that could be missing.
    stage.DefinePrim("/pin_again").GetReferences().AddInternalReference("/pin_0")
    stage.Save()
    found = read(folder / "a.usda")
    assert found.names() == ["pin_0", "pin_again"]
    assert sorted(name for name, _ in found.left_out) == sorted(
        ["../secret.usda", str(tmp_path / "secret.usda"), "no.usda"]
    )
    assert set(found.files) == {"parts/pin.usda"}


@pytest.mark.parametrize("axis", ["", "ZZ"])
def test_an_up_axis_that_is_none_is_named(tmp_path, axis):
    path = tmp_path / "a.usda"
    path.write_text(f'#usda 1.0\n( upAxis = "{axis}" )\ndef Cube "c" {{\n}}\n')
    with pytest.raises(InputError, match="upAxis is"):
        read(path)


def test_a_package_that_leads_out_of_itself_is_refused(tmp_path):
    stage = Usd.Stage.CreateInMemory()
    block(stage, "/pin")
    with zipfile.ZipFile(tmp_path / "a.usdz", "w") as archive:
        archive.writestr("../b.usda", stage.GetRootLayer().ExportToString())
    with pytest.raises(InputError, match="leads out"):
        read(tmp_path / "a.usdz")
    with zipfile.ZipFile(tmp_path / "b.usdz", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("b.usda", b"#usda 1.0\n" + bytes(2 << 20))
    with pytest.raises(InputError):
        read(tmp_path / "b.usdz")


def test_simple_shapes_lie_outside_what_they_stand_for():
    ends = np.array([[0, 0, -0.3], [0, 0.1, 0.5]])
    rng = np.random.default_rng(2)
    weights = rng.dirichlet([1, 1, 1], 40)

    def points(mesh: Mesh):
        return (mesh.vertices[mesh.faces][:, None] * weights[None, :, :, None]).sum(axis=2).reshape(-1, 3)

    assert np.linalg.norm(points(ball(1.0)), axis=1).min() > 1
    along = ends[1] - ends[0]

    def away(at):
        t = np.clip((at - ends[0]) @ along / (along @ along), 0, 1)
        return np.linalg.norm(at - ends[0] - t[:, None] * along, axis=1), t

    assert away(points(rounded(*ends, 0.2)))[0].min() > 0.2
    distance, t = away(points(cylinder(*ends, 0.2)))
    assert distance[(t > 0.01) & (t < 0.99)].min() > 0.2 - 1e-9


@pytest.mark.parametrize("count", [24, pytest.param(10_000, marks=pytest.mark.soak)])
def test_damaged_scenes_are_parts_or_a_sentence(tmp_path, count):
    rng = random.Random(count)
    arm(tmp_path / "a.usda")
    Usd.Stage.Open(str(tmp_path / "a.usda")).Export(str(tmp_path / "a.usdc"))
    wholes = [(tmp_path / name).read_bytes() for name in ("a.usda", "a.usdc")]
    outcomes = set()
    path = tmp_path / "inner/b.usd"
    path.parent.mkdir()
    for number in range(count):
        path.write_bytes(mutated(wholes[number % 2], rng))
        try:
            found = read(path)
        except InputError:
            outcomes.add("refused")
            continue
        outcomes.add("read")
        for instance in found.instances:
            assert np.isfinite(instance.world_from_shape).all()
    assert outcomes == {"read", "refused"}
    assert [p.name for p in path.parent.iterdir()] == ["b.usd"]


def test_simple_shapes_of_a_density_weigh_what_they_do_and_not_what_is_around_them(tmp_path):
    """A ball came 3.7 % too heavy: the mesh that stands for it contains it."""
    file = tmp_path / "two.usda"
    stage = Usd.Stage.CreateNew(str(file))
    UsdGeom.SetStageMetersPerUnit(stage, 0.01)
    UsdGeom.SetStageUpAxis(stage, "Z")
    for name, apart in (("apart", 30.0), ("overlapping", 6.0)):
        body = UsdGeom.Xform.Define(stage, f"/{name}")
        UsdPhysics.RigidBodyAPI.Apply(body.GetPrim())
        # Kilograms per cubic centimetre.
        UsdPhysics.MassAPI.Apply(body.GetPrim()).CreateDensityAttr(0.0027)
        ball = UsdGeom.Sphere.Define(stage, f"/{name}/ball")
        ball.CreateRadiusAttr(5.0)
        rod = UsdGeom.Cylinder.Define(stage, f"/{name}/rod")
        rod.CreateRadiusAttr(2.0)
        rod.CreateHeightAttr(10.0)
        rod.CreateAxisAttr("X")
        rod.AddTranslateOp().Set(Gf.Vec3d(apart, 0, 0))
        rod.AddScaleOp().Set(Gf.Vec3f(2, 1, 1))
    stage.Save()
    apart, over = (instance.inertial for instance in read(file).instances)
    ball, rod = 4 / 3 * np.pi * 0.05**3, np.pi * 0.02**2 * 0.2
    assert apart.mass == pytest.approx(2700 * (ball + rod), rel=1e-6)
    assert apart.com == pytest.approx([0.3 * rod / (ball + rod), 0, 0], abs=1e-9)
    about_x = 2700 * (ball * 0.4 * 0.05**2 + rod * 0.02**2 / 2)
    assert apart.inertia[0, 0] == pytest.approx(about_x, rel=1e-6)
    assert apart.error == 0
    # What overlaps counts once, by the meshes, and says by how much they are larger.
    assert over.mass < 2700 * (ball + rod)
    assert 2700 * ball < over.mass * (1 + over.error)
    assert over.error > 0.01


@pytest.mark.parametrize("what", ["density", "mass"])
def test_what_a_simple_shape_cannot_weigh_is_nobodys_mass_and_a_given_one_is_given(tmp_path, what):
    for number, value in enumerate((2.0, float("inf"))):
        file = tmp_path / f"{number}.usda"
        stage = scene(file, "Z")
        body = UsdGeom.Xform.Define(stage, "/ball")
        UsdPhysics.RigidBodyAPI.Apply(body.GetPrim())
        mass = UsdPhysics.MassAPI.Apply(body.GetPrim())
        (mass.CreateMassAttr if what == "mass" else mass.CreateDensityAttr)(value)
        UsdGeom.Sphere.Define(stage, "/ball/shape").CreateRadiusAttr(5.0)
        stage.Save()
        (instance,) = read(file).instances
        if value == 2.0:
            assert instance.inertial.origin is (Origin.GIVEN if what == "mass" else Origin.ESTIMATED)
        else:
            assert instance.inertial is None
