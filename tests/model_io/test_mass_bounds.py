"""Mass properties of what a mesh stands for lie within the bounds that are stated of it, in every motion."""

import json
import math
import re

import numpy as np
import pytest
import trimesh

import made_cell
from seerob.app import cli
from seerob.app.console.terminal import Exit
from seerob.core.errors import InputError
from seerob.core.shapes import Mesh
from seerob.description.cad import containing, step
from seerob.description.mesh_files import MeshSource
from seerob.description.shapes import moments
from seerob.description.shapes.mass_bounds import off_by
from seerob.description.shapes.mass_properties import from_shape


def mesh_of(body):
    return Mesh(np.array(body.vertices), np.array(body.faces, np.int32))


def spatial(of, about):
    """Spatial inertia (6, 6) about a point."""
    x, y, z = d = of.com - about
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    turns = of.inertia + of.volume * (d @ d * np.eye(3) - np.outer(d, d))
    return np.block([[of.volume * np.eye(3), -of.volume * cross], [of.volume * cross, turns]])


def holds(of, truth, share):
    """Whether a truth is between 1 - share and 1 + share times something, in every motion."""
    a, b = spatial(of, of.com), spatial(truth, of.com)
    least = min(np.linalg.eigvalsh((1 + share) * a - b)[0], np.linalg.eigvalsh(b - (1 - share) * a)[0])
    return least >= -1e-12 * np.trace(a)


@pytest.mark.parametrize("count", [1, 2, 4])
@pytest.mark.parametrize("outside", [False, True])
def test_a_ball_is_within_the_bounds_of_its_triangles_inside_and_around(count, outside):
    ball = trimesh.creation.icosphere(count, 1.0)
    inner = float(np.linalg.norm(ball.triangles_center, axis=1).min())
    size = 0.05 / inner if outside else 0.05
    mesh = mesh_of(ball.apply_scale(size))
    found, truth = moments.of_closed_mesh(mesh), moments.of_capsule(np.zeros(3), np.zeros(3), 0.05)
    off = off_by(mesh, size * (1 - inner), found)
    assert holds(found, truth, off.inertia)
    assert abs(truth.volume / found.volume - 1) <= off.volume <= off.inertia
    # It is no larger than it must be: the layer of a ball is 3 δ/R of its volume, and 5 δ/R of its turn.
    share = (1 - inner) * size / 0.05
    assert off.volume < 3.2 * share / (1 - share) ** 3
    assert off.inertia < 5.5 * share / (1 - share) ** 5


@pytest.mark.parametrize("seed", range(6))
def test_whatever_lies_within_the_deviation_is_within_the_bounds(seed):
    """Steps, ribs and dents all over a bracket with a hole: each layer as thick as the deviation."""
    rng = np.random.default_rng(seed)
    bodies = [
        trimesh.creation.torus(0.06, 0.02, 24, 16),
        trimesh.creation.annulus(0.03, 0.05, 0.1, sections=24),
        trimesh.creation.box((0.2, 0.05, 0.01)),
    ]
    body = bodies[seed % 3].apply_translation(rng.uniform(-0.3, 0.3, 3))
    mesh, deviation = mesh_of(body), rng.uniform(1e-4, 2e-3)
    found = moments.of_closed_mesh(mesh)
    off = off_by(mesh, deviation, found)
    fine = body.subdivide().subdivide()
    for _ in range(10):
        which = (
            np.sign(rng.uniform(-1, 1)) if rng.random() < 0.3 else rng.choice([-1, 0, 1], len(fine.vertices))
        )
        moved = fine.vertices + deviation * np.asarray(which).reshape(-1, 1) * fine.vertex_normals
        assert holds(found, moments.of_closed_mesh(Mesh(moved, mesh_of(fine).faces)), off.inertia)


def test_the_steiner_formula_of_a_box_is_met_exactly():
    a, b, c, d = 0.2, 0.3, 0.4, 0.01
    mesh = mesh_of(trimesh.creation.box((a, b, c)))
    layer = 2 * (a * b + b * c + a * c) * d + math.pi * (a + b + c) * d**2 + 4 / 3 * math.pi * d**3
    found = off_by(mesh, d, moments.of_closed_mesh(mesh)).volume * a * b * c
    assert layer <= found < layer + 20 * d**3
    assert off_by(mesh, 0.0, moments.of_closed_mesh(mesh)) == (0.0, 0.0)


def test_sides_that_contradict_each_other_bound_no_less():
    body = trimesh.creation.icosphere(2, 0.05)
    odd = np.where(np.arange(len(body.faces))[:, None] % 3 == 0, body.faces[:, ::-1], body.faces)
    of = moments.of_closed_mesh(mesh_of(body))
    turned = off_by(Mesh(np.array(body.vertices), odd.astype(np.int32)), 1e-3, of)
    assert turned.volume >= off_by(mesh_of(body), 1e-3, of).volume * (1 - 1e-12)


def test_a_volume_that_its_deviation_leaves_open_is_refused():
    plate = mesh_of(trimesh.creation.box((0.2, 0.2, 0.001)))
    with pytest.raises(InputError, match=r"known within 0\.3 mm") as caught:
        from_shape([plate], density=7850, deviation=3e-4, subject="plate")
    assert "give the mass" in caught.value.problems[0].remedy
    assert from_shape([plate], mass=1.0, deviation=3e-4)[0].mass == 1.0


def test_simple_shapes_have_the_moments_of_what_they_stand_for():
    a, b = np.array([0.1, 0.2, 0.3]), np.array([0.3, -0.1, 0.5])
    for made in (
        containing.box(0.1),
        containing.ball_within(0.05),
        containing.capsule_within(a, b, 0.05),
        containing.cylinder_within(a, b, 0.05),
        containing.cone_within(a, b, 0.05),
    ):
        around = moments.of_closed_mesh(made.mesh)
        assert around.volume >= made.moments.volume * (1 - 1e-12)
        if made.off:
            assert holds(around, made.moments, off_by(made.mesh, 1.01 * made.off, around).inertia)
        scaled = np.diag([1.0, -2.0, 3.0, 1.0])
        stretched = Mesh(made.mesh.vertices @ scaled[:3, :3], made.mesh.faces[:, ::-1])
        expected, got = moments.of_closed_mesh(stretched), around.moved(scaled)
        assert got.volume == pytest.approx(expected.volume, rel=1e-9)
        np.testing.assert_allclose(got.com, expected.com, atol=1e-12)
        np.testing.assert_allclose(got.inertia, expected.inertia, rtol=1e-9, atol=1e-14)


def solids(path):
    """Balls, cylinders, rings and cones, also of splines: volume [m³], two moments [m⁵], how near."""
    pytest.importorskip("OCP")
    from OCP.BRepBuilderAPI import BRepBuilderAPI_NurbsConvert
    from OCP.BRepPrimAPI import (
        BRepPrimAPI_MakeCone,
        BRepPrimAPI_MakeCylinder,
        BRepPrimAPI_MakeSphere,
        BRepPrimAPI_MakeTorus,
    )
    from OCP.STEPControl import STEPControl_StepModelType, STEPControl_Writer

    r, h, R = 0.05, 0.12, 0.08
    ball, rod, cone = 4 / 3 * math.pi * r**3, math.pi * r**2 * h, math.pi * r**2 * h / 3
    ring = 2 * math.pi**2 * R * 0.02**2
    for name, made, volume, across, along in (
        ("ball", BRepPrimAPI_MakeSphere(50.0), ball, 0.4 * r**2, 0.4 * r**2),
        ("rod", BRepPrimAPI_MakeCylinder(50.0, 120.0), rod, r**2 / 4 + h**2 / 12, r**2 / 2),
        ("ring", BRepPrimAPI_MakeTorus(80.0, 20.0), ring, R**2 / 2 + 5 / 8 * 4e-4, R**2 + 3 / 4 * 4e-4),
        ("cone", BRepPrimAPI_MakeCone(50.0, 0.0, 120.0), cone, 0.15 * r**2 + 3 / 80 * h**2, 0.3 * r**2),
    ):
        for splines in (False, True):
            shape = BRepBuilderAPI_NurbsConvert(made.Shape(), True).Shape() if splines else made.Shape()
            file = path / f"{name}{splines}.step"
            writer = STEPControl_Writer()
            writer.Transfer(shape, STEPControl_StepModelType.STEPControl_AsIs)
            writer.Write(str(file))
            yield file, volume, volume * across, volume * along, 5e-5 if splines else 1e-6


def test_analytic_solids_of_step_weigh_what_they_do_to_a_millionth(tmp_path):
    for file, volume, across, along, near in solids(tmp_path):
        assembly = step.read(MeshSource(file, file.read_bytes(), 1 << 26, 1 << 20))
        (shape,) = assembly.shapes
        assert shape.solid is not None, file.name
        assert shape.solid.volume == pytest.approx(volume, rel=1e-6)
        np.testing.assert_allclose(
            np.linalg.eigvalsh(shape.solid.inertia), sorted([across, across, along]), rtol=near
        )
        # Its triangles say themselves by how much they are off.
        made, _ = from_shape(shape.pieces, density=1.0, deviation=shape.deviation)
        assert abs(made.mass / volume - 1) > 1e-6
        triangles = moments.Moments(made.mass, made.com, made.inertia)
        assert holds(triangles, shape.solid, max(made.error, made.spread_error))


def test_what_is_written_of_a_round_solid_is_its_own_mass(tmp_path):
    for file, volume, across, along, near in solids(tmp_path):
        cell = tmp_path / file.stem
        assert cli.main(["import", str(file), str(cell), "--density", "7850"]) == Exit.WITHIN
        (row,) = json.loads((cell / "import.json").read_text())["parts"]
        assert row["mass"] == pytest.approx(7850 * volume, rel=1e-6)
        assert row["mass_error"] == 0
        assert row["written"]["mass"] == row["mass"]
        expected = 7850 * np.array(sorted([across, across, along]))
        assert sorted(row["written"]["inertia"][:3]) == pytest.approx(expected, rel=near)
        assert cli.main(["check-file", str(cell)]) == Exit.WITHIN


def block_with_a_density(file, unit, figure="7.85", solid=None):
    """A cube of 0.1 m of steel, or another solid, by OpenCASCADE, the unit of its density written anew."""
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox
    from OCP.STEPCAFControl import STEPCAFControl_Writer
    from OCP.TCollection import TCollection_ExtendedString, TCollection_HAsciiString
    from OCP.TDocStd import TDocStd_Document
    from OCP.XCAFDoc import XCAFDoc_DocumentTool

    document = TDocStd_Document(TCollection_ExtendedString("XmlXCAF"))
    shapes = XCAFDoc_DocumentTool.ShapeTool_s(document.Main())
    label = shapes.AddShape(solid or BRepPrimAPI_MakeBox(100.0, 100.0, 100.0).Shape(), False)
    words = (
        TCollection_HAsciiString(text)
        for text in ("steel", "S235", "density measure", "POSITIVE_RATIO_MEASURE")
    )
    name, about, *kind = words
    XCAFDoc_DocumentTool.MaterialTool_s(document.Main()).SetMaterial(label, name, about, 7.85, *kind)
    writer = STEPCAFControl_Writer()
    writer.Transfer(document)
    writer.Write(str(file))
    mass, per, length, power = unit
    text = file.read_text().replace("POSITIVE_RATIO_MEASURE(7.85)", f"POSITIVE_RATIO_MEASURE({figure})")
    text, n = re.subn(r"(MASS_UNIT\(\) NAMED_UNIT\(\*\) SI_UNIT\()\$", rf"\g<1>{mass}", text)
    text, k = re.subn(r"(DERIVED_UNIT_ELEMENT\(#\d+,)3\.", rf"\g<1>{per}", text)
    text, m = re.subn(r"(DERIVED_UNIT_ELEMENT\(#\d+,)2\.", rf"\g<1>{power}", text)
    text, c = re.subn(r"SI_UNIT\(\.CENTI\.,\.METRE\.\)", f"SI_UNIT({length},.METRE.)", text)
    assert n == k == m == c == 1
    file.write_text(text)


KILO, GRAM, METRE, CENTI, MILLI = ".KILO.", "$", "$", ".CENTI.", ".MILLI."


@pytest.mark.parametrize(
    ("unit", "figure", "density"),
    [
        ((GRAM, "3.", CENTI, "2."), "7.85", 7850.0),  # as OpenCASCADE writes g/cm³
        ((GRAM, "1.", CENTI, "-3."), "7.85", 7850.0),
        ((KILO, "1.", METRE, "-3."), "7850.", 7850.0),
        ((KILO, "1.", MILLI, "-3."), "7.85E-6", 7850.0),
        ((GRAM, "1.", MILLI, "-3."), "7.85E-3", 7850.0),
        ((KILO, "1.", CENTI, "-3."), "7.85", None),  # denser than anything
        ((KILO, "1.", METRE, "-2."), "7850.", None),  # of an area
        ((KILO, "3.", METRE, "2."), "7850.", None),
        ((KILO, "1.", METRE, "-3."), "-7850.", None),
        ((KILO, "1.", METRE, "-3."), "0.", None),
    ],
)
def test_a_density_that_a_step_file_states_is_taken_in_its_own_unit(tmp_path, unit, figure, density):
    pytest.importorskip("OCP")
    file = tmp_path / "block.step"
    block_with_a_density(file, unit, figure)
    assembly = step.read(MeshSource(file, file.read_bytes(), 1 << 26, 1 << 20))
    shape = assembly.shapes[0]
    assert shape.material == "steel"
    said = " ".join(finding.text for finding in assembly.findings)
    if density is None:
        assert shape.density is None
        assert "states a density of steel that is not understood, and not taken" in said
    else:
        assert shape.density == pytest.approx(density)
        assert "states a density of steel: 7850 kg/m³" in said
    for more, mass in (
        ((), None if density is None else 7.85),
        (("--density", "2700"), 2.7),
        (("--density", "steel=8000"), 8.0),
    ):
        folder = tmp_path / f"cell{len(more)}{more[-1:]}"
        assert cli.main(["import", str(file), str(folder), *more]) == Exit.WITHIN
        (row,) = json.loads((folder / "import.json").read_text())["parts"]
        assert row["mass"] == (None if mass is None else pytest.approx(mass, rel=1e-6))


def test_one_material_of_two_densities_has_none(tmp_path):
    pytest.importorskip("OCP")
    file = tmp_path / "block.step"
    block_with_a_density(file, (KILO, "1.", METRE, "-3."), "7850.")
    text = file.read_text()
    measure = re.search(r"#(\d+) = MEASURE_REPRESENTATION_ITEM\('density measure',\s*[^;]*;", text)
    shown = re.search(rf"REPRESENTATION\('density',\(#{measure[1]}\)", text)
    other = measure[0].replace(f"#{measure[1]} =", "#99999 =").replace("7850.", "7900.")
    text = text.replace(measure[0], f"{measure[0]}\n{other}")
    file.write_text(text.replace(shown[0], shown[0][:-1] + ",#99999)"))
    assembly = step.read(MeshSource(file, file.read_bytes(), 1 << 26, 1 << 20))
    assert assembly.shapes[0].density is None
    assert any("is not understood" in finding.text for finding in assembly.findings)


@pytest.mark.parametrize("seed", range(8))
def test_a_mass_that_is_given_is_spread_within_the_bounds_that_are_told(seed):
    """Steps and dents within the deviation, or all of it at one corner of what is half missing."""
    rng = np.random.default_rng(seed)
    body = trimesh.creation.box(rng.uniform(0.05, 0.3, 3)).subdivide()
    mesh, deviation = mesh_of(body), rng.uniform(1e-4, 2e-3)
    made, _ = from_shape([mesh], mass=2.0, deviation=deviation)
    assert made.error == 0 < made.spread_error
    told = moments.Moments(2.0, made.com, made.inertia)
    for _ in range(10):
        moved = (
            body.vertices
            + deviation * rng.choice([-1, 0, 1], len(body.vertices))[:, None] * body.vertex_normals
        )
        truth = moments.of_closed_mesh(Mesh(moved, mesh.faces))
        scaled = moments.Moments(2.0, truth.com, truth.inertia * 2.0 / truth.volume)
        assert holds(told, scaled, made.spread_error)
    trough, _ = from_shape([Mesh(mesh.vertices, mesh.faces[: len(mesh.faces) // 2])], mass=2.0)
    told = moments.Moments(2.0, trough.com, trough.inertia)
    for corner in mesh.vertices[np.unique(mesh.faces[: len(mesh.faces) // 2])]:
        assert holds(told, moments.Moments(2.0, corner, np.zeros((3, 3))), trough.spread_error)
    assert from_shape([mesh], mass=2.0)[0].spread_error == 0


def cut(rng):
    """A body, its mesh with a hole, and how far what is cut away lies from the hole's rim at most [m]."""
    bodies = [
        trimesh.creation.icosphere(3, 0.05),
        trimesh.creation.cylinder(0.04, 0.1, sections=48).subdivide().subdivide(),
        trimesh.creation.torus(0.06, 0.02, 48, 32),
        trimesh.creation.annulus(0.02, 0.05, 0.1, sections=32).subdivide(),
    ]
    body = bodies[rng.integers(len(bodies))].apply_translation(rng.uniform(-0.3, 0.3, 3))
    center = body.triangles_center[rng.integers(len(body.faces))]
    near = np.linalg.norm(body.triangles_center - center, axis=1) < rng.uniform(0.01, 0.06)
    left, gone = np.unique(body.faces[~near]), np.unique(body.faces[near])
    rim, inner = body.vertices[np.intersect1d(left, gone)], body.vertices[gone]
    if not len(rim):
        return body, None, 0.0
    depth = np.linalg.norm(inner[:, None] - rim[None], axis=2).min(axis=1).max()
    return body, Mesh(np.array(body.vertices), body.faces[~near].astype(np.int32)), float(depth)


def test_what_a_mesh_lacks_is_within_the_bounds_as_far_as_it_is_said_where_that_lies():
    """Caps, walls and bores are missing: that they are flat would often be false."""
    rng = np.random.default_rng(3)
    bounded, outside = 0, 0
    for _ in range(24):
        body, mesh, depth = cut(rng)
        if mesh is None:
            continue
        truth = moments.of_closed_mesh(mesh_of(body))
        for said in (depth, 0.0):
            try:
                made, _ = from_shape([mesh], density=1000, hole_depth=said)
            except InputError:
                continue
            told = moments.Moments(made.mass / 1000, made.com, made.inertia / 1000)
            share = max(made.error, made.spread_error)
            if said:
                assert holds(told, truth, share)
                bounded += 1
            else:
                outside += not holds(told, truth, share)
            given, _ = from_shape([mesh], mass=2.0, hole_depth=said)
            scaled = moments.Moments(2.0, truth.com, truth.inertia * 2.0 / truth.volume)
            if said:
                assert holds(moments.Moments(2.0, given.com, given.inertia), scaled, given.spread_error)
    assert bounded > 5
    assert outside > 0


def test_trays_without_lids_beside_a_block_are_not_taken_for_empty():
    """Voxels are flooded through a hole unless what closes it counts as a surface."""
    block, tray = trimesh.creation.box((0.5, 0.5, 0.5)), trimesh.creation.box((0.5, 0.5, 0.1))
    faces = tray.faces[tray.face_normals[:, 2] < 0.9].astype(np.int32)
    truth, meshes = [moments.of_closed_mesh(mesh_of(block))], [mesh_of(block)]
    for k in range(4):
        at = tray.vertices + np.array([0.7, 0, 0.15 * k])
        truth.append(moments.of_closed_mesh(Mesh(at, tray.faces.astype(np.int32))))
        meshes.append(Mesh(at, faces))
    made, findings = from_shape(meshes, density=1000, hole_depth=0.0)
    assert any("filled with voxels" in finding.text for finding in findings)
    told = moments.Moments(made.mass / 1000, made.com, made.inertia / 1000)
    assert holds(told, moments.combined(truth), made.spread_error)
    assert abs(225 - made.mass) < made.error * made.mass


def box_with_a_hole():
    box = trimesh.creation.box((0.1, 0.2, 0.3)).subdivide().subdivide()
    return Mesh(np.array(box.vertices), box.faces[1:].astype(np.int32))


def test_where_nobody_says_what_a_mesh_lacks_nobody_knows_what_it_weighs_and_a_mass_is_anywhere_in_the_hull():
    mesh = box_with_a_hole()
    guessed, findings = from_shape([mesh], density=1000)
    assert guessed.mass == pytest.approx(6.0)
    assert np.isinf(guessed.spread_error)
    assert any("nobody says that (hole_depth)" in finding.text for finding in findings)
    assert from_shape([mesh], density=1000, hole_depth=0.0)[0].spread_error < 1e-9
    given, findings = from_shape([mesh], mass=2.0)
    assert any("the mass may be anywhere in its convex hull" in finding.text for finding in findings)
    told = moments.Moments(2.0, given.com, given.inertia)
    for corner in mesh.vertices:
        assert holds(told, moments.Moments(2.0, corner, np.zeros((3, 3))), given.spread_error)
    assert from_shape([mesh], mass=2.0, hole_depth=0.0)[0].spread_error < 1e-9


@pytest.mark.parametrize(
    ("limit", "said", "verdict"),
    [(200, "", "undecided"), (200, "hole_depth = 0\n", "within"), (1e-9, "", "exceeded")],
)
def test_a_tool_of_a_mesh_with_a_hole_has_a_mass_by_density_only_with_a_depth(tmp_path, limit, said, verdict):
    mesh = box_with_a_hole()
    trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).export(tmp_path / "open.stl")
    table = (
        f'[[tools]]\nname = "grip"\non = "arm/tip"\nmesh = "open.stl"\nunits = "m"\ndensity = 1000\n{said}'
        f'[[safety]]\nkind = "kinetic_energy"\nname = "energy"\nrobot = "arm"\nlimit = {limit}\n'
    )
    cell = made_cell.made(
        tmp_path, made_cell.FLOATING + made_cell.TWO_R + table, {"arm.urdf": made_cell.two_r()}
    )
    one = made_cell.results_at(cell, arm=([0.1, 0.2], [1.0, 1.0]))["energy"]
    assert one.verdict == verdict, one.reason


@pytest.mark.parametrize("said", ["", "hole_depth = 0\n"])
def test_a_loose_workpiece_of_a_mesh_with_a_hole_is_refused_without_a_depth(tmp_path, said):
    """Its mass is that of what a hand holds, and a placeholder would be less than it may be."""
    mesh = box_with_a_hole()
    trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).export(tmp_path / "open.stl")
    text = f'[[workpieces]]\nname = "blank"\nmesh = "open.stl"\nunits = "m"\ndensity = 1000\n{said}'
    if said:
        model = made_cell.made(tmp_path, text).model
        assert model.mj.body_mass.sum() == pytest.approx(6.0)
    else:
        with pytest.raises(InputError, match="nobody knows its mass") as caught:
            made_cell.made(tmp_path, text)
        assert "hole_depth" in caught.value.problems[0].remedy


def test_edges_of_unequal_length_that_meet_are_no_hole():
    box = trimesh.creation.box((0.1, 0.2, 0.3))
    a, b, c = box.faces[0]
    middle = len(box.vertices)
    faces = np.vstack([box.faces[1:], [[a, middle, c], [middle, b, c]]])
    vertices = np.vstack([box.vertices, box.vertices[[a, b]].mean(axis=0)])
    mesh = Mesh(vertices, faces.astype(np.int32))
    made, _ = from_shape([mesh], density=1000)
    assert made.mass == pytest.approx(6.0)
    assert made.error < 1e-9
