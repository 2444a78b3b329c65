"""Mass matrices at the ends of what centres of mass may be off: closed forms of one joint, bounds of two."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest
import trimesh

from made_cell import FLOATING, TWO_R, judged, made, state_at, two_r
from seerob.core.snapshot import Origin, Verdict
from seerob.core.tolerances import Tolerance
from seerob.criteria.scoring.handled import heavier
from seerob.description.description import Inertial, rigid
from seerob.twin.accuracy.mass_tolerances import MassTolerances, _Part

M, I_Z = 2.0, 0.05


def one(kind, x):
    """A link of 2 kg whose centre is x from its joint, with 0.05 kg·m² about itself."""
    return (
        '<robot name="one"><link name="base"/><link name="l1"><inertial>'
        f'<origin xyz="{x} 0 0"/><mass value="{M}"/>'
        f'<inertia ixx="{I_Z}" iyy="{I_Z}" izz="{I_Z}" ixy="0" ixz="0" iyz="0"/></inertial>'
        '<collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision></link>'
        f'<joint name="j1" type="{kind}"><parent link="base"/><child link="l1"/><axis xyz="0 0 1"/>'
        '<limit effort="100" velocity="10" lower="-1" upper="1"/></joint></robot>'
    )


@pytest.mark.parametrize("qd", [0.0, 1.0, -3.0])
@pytest.mark.parametrize(
    ("kind", "x", "way", "least", "most"),
    [
        ("revolute", 0.5, 0.1, M * 0.4**2 + I_Z, M * 0.6**2 + I_Z),
        ("revolute", 0.0, 0.1, I_Z, M * 0.1**2 + I_Z),
        ("revolute", 0.08, 0.1, I_Z, M * 0.18**2 + I_Z),
        ("prismatic", 0.5, 0.1, 0.0, M),
    ],
)
def test_one_joint_has_the_moment_of_a_centre_nearer_to_it_or_farther(
    tmp_path, kind, x, way, least, most, qd
):
    """The lesser is never less than a body that weighs nothing; what slides does not ask where it is."""
    cell = made(tmp_path, FLOATING + TWO_R + f"com_tolerance = {way}\n", {"arm.urdf": one(kind, x)})
    robot = cell.model.robot("arm")
    found = MassTolerances(cell.model, robot)
    assert found.tolerances == (Tolerance("com_tolerance of arm", way, "m"),)
    assert found.simplified(3.0, (1,)) == 3.0
    at = found.matrices(state_at(cell, arm=([0.3], [qd]))).at
    nominal = M if kind == "prismatic" else M * x**2 + I_Z
    assert [at((side,))[0, 0] for side in (-1, 0, 1)] == pytest.approx([least, nominal, most], abs=1e-12)


EVEN = "uniform_density = true\n"
TOOL = '[[tools]]\nname = "grip"\non = "arm/tip"\nshape = {{ sphere = 0.02 }}\n{}\n'
DENSITY = 0.7 / (4 / 3 * np.pi * 0.02**3)


@pytest.mark.parametrize("name", ["grip", "arm/grip"])
def test_links_count_by_half_and_what_is_mounted_in_full_whatever_it_is_called(tmp_path, name):
    """10 % of M/2 = 1 kg, and 10 % of the tool's 3 kg."""
    tool = TOOL.replace("grip", name).format(f"mass = 3\n{EVEN}mass_tolerance = 0.1")
    cell = made(tmp_path, FLOATING + TWO_R + "mass_tolerance = 0.1\n" + tool, {"arm.urdf": two_r()})
    found = MassTolerances(cell.model, cell.model.robot("arm"))
    assert [found.simplified(4.0, shifts) for shifts in ((1, 0), (0, 1))] == pytest.approx([4.1, 4.3])
    assert found.heaviest_load() == pytest.approx(3.3)


def young(state, name, way, lighter, heavier):
    """What is lost, lost at most and gained by the inequality of the module, with ε of the motion."""
    model, robot = state.model, state.model.robot("arm")
    body = model.mj.body(name).id
    rows = np.zeros((2, 3, model.mj.nv))
    mujoco.mj_jacBodyCom(model.mj, state.data, *rows, body)
    J_c, J_w = rows[:, :, robot.v_address]
    moved, turned = J_c.T @ J_c, way**2 * J_w.T @ J_w
    v, w = np.linalg.norm(J_c @ state.qd(robot)), way * np.linalg.norm(J_w @ state.qd(robot))
    if min(v, w) < 1e-12:
        v, w = np.sqrt(np.trace(moved)), np.sqrt(np.trace(turned))
    eps, m = w / v, float(model.mj.body_mass[body])
    less = eps * moved + (1 / eps - 1) * turned if eps < 1 else moved
    return (
        lighter * m * less,
        lighter * m * moved,
        heavier * m * (eps * moved + (1 + 1 / eps) * turned),
    )


@pytest.mark.parametrize("qd", [(1.0, -2.5), (0.0, 0.0), (1.0, -1.0), (1.0, -1.999), (1.0, -2.0), (3.0, 1.0)])
@pytest.mark.parametrize("q2", [0.0, np.pi / 2])
def test_two_joints_are_within_youngs_inequality_for_their_motion(tool_cells, q2, qd):
    """At rest, without turning, turning about itself, and nearly so; masses off as well."""
    for cell, shares in tool_cells:
        robot = cell.model.robot("arm")
        state = state_at(cell, arm=((0.2, q2), qd))
        found = MassTolerances(cell.model, robot)
        assert [(str(t).split(" of")[0], t.unit) for t in found.tolerances] == [
            *((key, "%") for key in shares), ("com_tolerance", "m"),
        ]  # fmt: skip
        off = sum(shares.values())
        lost, at_most, gained = young(state, "grip", 0.02, 1 - off, 1 + off)
        matrices, still, plain = found.matrices(state), (0,) * len(shares), state.mass_matrix(robot)
        np.testing.assert_allclose(matrices.at((*still, 1)), plain + gained, atol=1e-12)
        least = plain - lost
        least = plain - at_most if np.linalg.eigvalsh(least)[0] <= 0 else least
        np.testing.assert_allclose(matrices.at((*still, -1)), least, atol=1e-12)
        if shares:
            assert found.tolerances[0].half == pytest.approx(100 * off)
            assert found.simplified(2.0, (1, 1)) == pytest.approx(2.0 + off * 0.7)


@pytest.fixture(scope="module")
def tool_cells(tmp_path_factory):
    cells = []
    for k, (mass, shares) in enumerate(
        [
            (f"mass = 0.7\n{EVEN}", {}),
            (f"mass = 0.7\n{EVEN}", {"mass_tolerance": 0.2}),
            (f"density = {DENSITY}", {"density_tolerance": 0.3}),
        ]
    ):
        more = "\n".join([mass, "com_tolerance = 0.02", *(f"{key} = {s}" for key, s in shares.items())])
        folder = tmp_path_factory.mktemp(str(k))
        text = FLOATING + TWO_R + TOOL.format(more)
        cells.append((made(folder, text, {"arm.urdf": two_r()}), shares))
    return cells


def test_a_bound_that_no_robot_can_have_gives_way_to_one_without_the_body(tmp_path):
    """A heavy grip on light links that may be 0.6 m off: the lesser of the first bounds has no inverse."""
    text = FLOATING + TWO_R + TOOL.format(f"mass = 3\n{EVEN}com_tolerance = 0.6")
    cell = made(tmp_path, text, {"arm.urdf": two_r(masses=(0.1, 0.1))})
    state = state_at(cell, arm=((0.2, 0.3), (1.0, -1.2)))
    plain = state.mass_matrix(cell.model.robot("arm"))
    lost, at_most, _ = young(state, "grip", 0.6, 1, 1)
    assert np.linalg.eigvalsh(plain - lost)[0] < 0 < np.linalg.eigvalsh(plain - at_most)[0]
    least = MassTolerances(cell.model, cell.model.robot("arm")).matrices(state).at((-1,))
    np.testing.assert_allclose(least, plain - at_most, atol=1e-12)


def test_a_link_that_is_heavier_has_more_of_its_own_inertia_too(tmp_path):
    cell = made(tmp_path, FLOATING + TWO_R + "mass_tolerance = 0.2\n", {"arm.urdf": one("revolute", 0.5)})
    robot = cell.model.robot("arm")
    found = MassTolerances(cell.model, robot)
    at = found.matrices(state_at(cell, arm=([0.3], [1.0]))).at
    nominal = M * 0.5**2 + I_Z
    assert [at((side,))[0, 0] for side in (-1, 0, 1)] == pytest.approx(
        [0.8 * nominal, nominal, 1.2 * nominal]
    )
    assert [found.simplified(1.0, (side,)) for side in (-1, 0, 1)] == pytest.approx([0.8, 1.0, 1.2])


def test_bodies_weigh_what_their_own_tolerances_say_and_no_other(tmp_path):
    """A grip of 3 kg ± 20 % on links ± 10 %, its centre within 2 cm: factors, ways, and the shifted model."""
    tool = TOOL.format(f"mass = 3\n{EVEN}mass_tolerance = 0.2\ncom_tolerance = 0.02")
    other = '[[parts]]\nname = "post"\nshape = { sphere = 0.1 }\nat = { position = [9, 0, 0] }\nmass = 1\n'
    text = FLOATING + TWO_R + "mass_tolerance = 0.1\n" + tool + other
    cell = made(tmp_path, text, {"arm.urdf": two_r()})
    mj = cell.model.mj
    found = MassTolerances(cell.model, cell.model.robot("arm"))
    links, grip = [mj.body(name).id for name in ("arm/l1", "arm/l2")], mj.body("grip").id
    assert [found.heaviest(body) for body in links] == [(pytest.approx(1.1), 0)] * 2
    assert found.heaviest(grip) == (pytest.approx(1.2), 0.02)
    assert found.heaviest(0) == (1.0, 0)
    assert len(found) == len(found.tolerances) == 3
    assert found.moved == (str(Tolerance("com_tolerance of grip", 0.02, "m")),)
    for shifts, link, load in (
        ((0, 0, 1), 1, 1),
        ((1, 0, 0), 1.1, 1),
        ((-1, 1, 0), 0.9, 1.2),
        ((0, -1, 1), 1, 0.8),
    ):
        weighed = found.weighed(mj, shifts)
        factors = np.ones(mj.nbody)
        factors[links], factors[grip] = link, load
        np.testing.assert_allclose(weighed.body_mass, mj.body_mass * factors, rtol=1e-12)
        np.testing.assert_allclose(weighed.body_inertia, mj.body_inertia * factors[:, None], rtol=1e-12)
        # What follows from masses follows from these.
        assert weighed.body_subtreemass[0] == pytest.approx(weighed.body_mass.sum())


@pytest.mark.parametrize(
    ("error", "dense", "told"),
    [(1e-4, 0.3, []), (1.05e-4, 0.3, [0.01365]), (0.05, 0.3, [6.5]), (0.05, None, [5.0])],
)
def test_a_volume_that_is_known_to_a_ten_thousandth_is_exact(tmp_path, error, dense, told):
    """Else its error, which is more of what may be denser, too, is told in percent."""
    more = f"density_tolerance = {dense}" if dense else ""
    text = FLOATING + TWO_R + TOOL.format(f"density = {DENSITY}\n{more}")
    cell = made(tmp_path, text, {"arm.urdf": two_r()})
    bodies = tuple(
        replace(body, mass=replace(body.mass, error=error)) if body.name == "grip" else body
        for body in cell.model.bodies
    )
    model = replace(cell.model, bodies=bodies)
    found = MassTolerances(model, model.robot("arm")).tolerances
    if dense:
        assert found[0] == Tolerance("density_tolerance of grip", 30.0, "%")
        found = found[1:]
    assert [tolerance.half for tolerance in found] == pytest.approx(told)
    assert all(t.name == "volume of grip" and t.unit == "%" for t in found)


def test_wherever_masses_are_in_the_shapes_of_links_figures_are_within_their_bounds(tmp_path):
    """Of the Niryo only masses are published, and roughly: 60 ways to lump them at corners of its shapes."""
    cell = made(tmp_path, FLOATING + '[[robots]]\nname = "arm"\nmodel = "library:niryo_one"\n')
    model, rng = cell.model, np.random.default_rng(0)
    robot = model.robot("arm")
    found = MassTolerances(model, robot)
    assert [str(t) for t in found.tolerances] == [
        "masses of links of arm ± 70 %", "where masses are in links of arm ± 193.2 mm",
    ]  # fmt: skip
    assert found.own
    assert found.moved == (str(found.tolerances[1]),)
    links = [b for b in model.bodies if b.mj in robot.mj_bodies]
    assert len(links) == 6
    q, qd = rng.uniform(-1, 0.6, 6), rng.uniform(-1, 1, 6)
    state = state_at(cell, arm=(q, qd))
    data, mj = state.data, model.mj

    def lumped():
        """Mass matrix of a robot whose links weigh 30 to 170 %, each in one to three points of its shape."""
        M = np.zeros((6, 6))
        for b in links:
            rows = np.zeros((3, mj.nv))
            k, mass = rng.integers(1, 4), float(mj.body_mass[b.mj]) * rng.choice([0.3, 1.7])
            for corner in rng.choice(b.corners, k):
                at = data.xpos[b.mj] + data.xmat[b.mj].reshape(3, 3) @ corner
                mujoco.mj_jac(mj, data, rows, None, at, b.mj)
                M += mass / k * rows[:, robot.v_address].T @ rows[:, robot.v_address]
        return M

    J, u = state.jacobian(robot.tip, robot, np.zeros(3))[:3], np.array([0.6, 0.0, 0.8])
    plain = state.mass_matrix(robot)
    moving, pushed = found.matrices(state), found.matrices(state, np.linalg.solve(plain, J.T @ u))

    def felt(M):
        return 1 / (u @ J @ np.linalg.solve(M, J.T @ u))

    def energy(M):
        return 0.5 * qd @ M @ qd

    every = [lumped() for _ in range(60)]
    for figure, matrices in ((energy, moving), (felt, pushed)):
        low, high = figure(matrices.at((-1, -1))), figure(matrices.at((1, 1)))
        figures = [figure(M + 1e-9 * np.eye(6)) for M in (*every, plain)]
        assert low <= min(figures)
        assert max(figures) <= high < 8 * figure(plain)
        assert max(figures) > 2 * figure(plain), "it is no bound of nothing"


@pytest.mark.parametrize("said", ["", "mass_tolerance = 0.1\n"])
def test_a_centre_of_a_mass_that_is_estimated_is_off_with_all_that_it_may_weigh(tmp_path, said):
    """A box by density, half a metre from the joint: heaviest and farthest at once."""
    body = trimesh.creation.box((0.1, 0.1, 0.1)).apply_translation((0.5, 0, 0))
    tool = '[[tools]]\nname = "grip"\non = "arm/l1"\nmesh = "grip.stl"\nunits = "m"\ndensity = 1000\n'
    more = tool + f"deviation_mm = 5\ncom_tolerance = 0.05\n{said}"
    files = {"arm.urdf": one("revolute", 0.0), "grip.stl": body.export(file_type="stl")}
    cell = made(tmp_path, FLOATING + TWO_R + more, files)
    robot = cell.model.robot("arm")
    found = MassTolerances(cell.model, robot)
    matrices = found.matrices(state_at(cell, arm=([0.3], [1.0])))
    (of,) = (body.mass for body in cell.model.bodies if body.owner == "grip")
    factor = (1 + of.spread_error) * (1.1 if said else 1.0)
    heaviest = I_Z + factor * of.value * (0.55**2 + 0.1**2 / 6)
    ends = (1,) * len(found)
    assert heaviest <= matrices.at(ends)[0, 0] * (1 + 1e-9) < 1.2 * heaviest
    # What its file says of a link's spread alone counts too.
    files["arm.urdf"] = files["arm.urdf"].replace('value="2.0"', 'value="2.0" spread_error="0.3"')
    off = made(tmp_path / "link", FLOATING + TWO_R, files)
    found = MassTolerances(off.model, off.model.robot("arm"))
    assert found.tolerances == (Tolerance("masses of links of arm", pytest.approx(30), "%"),)
    assert found.matrices(state_at(off, arm=([0.3], [1.0]))).at((1,))[0, 0] == pytest.approx(1.3 * I_Z)
    assert "within bounds alone" in off.model.robot("arm").roughly_weighed


def test_the_centre_of_several_bodies_is_open_where_each_may_weigh_more_or_less():
    def ball(x, error):
        of = np.diag([0.01] * 3)
        return Inertial(1.0, np.array([x, 0, 0]), of, Origin.ESTIMATED, "", error=error), np.eye(4)

    two = rigid([ball(-1.0, 0.05), ball(1.0, 0.05)])
    assert (two.mass, two.error, two.spread_error) == (2.0, 0.05, 0.05)
    assert rigid([ball(0.0, 0.05)]).spread_error == 0
    uneven = rigid([ball(-1.0, 0.1), ball(1.0, 0.0)])
    assert (uneven.error, uneven.spread_error) == (0.05, 0.1)
    assert rigid([ball(-1.0, 0.0), ball(1.0, 0.0)]).spread_error == 0


def test_what_is_off_by_its_mass_and_its_density_is_off_by_their_product(tmp_path):
    """7850 kg/m³ ± 20 %, of which the mass may be off by 25 % besides: 1.5 times as heavy, not 1.45."""
    more = f"density = {DENSITY!r}\ndensity_tolerance = 0.2\nmass_tolerance = 0.25"
    cell = made(tmp_path, FLOATING + TWO_R + TOOL.format(more), {"arm.urdf": two_r()})
    found = MassTolerances(cell.model, cell.model.robot("arm"))
    assert found.heaviest_load() == pytest.approx(1.5 * 0.7)
    body = next(body for body in cell.model.bodies if body.owner == "grip")
    assert heavier(cell.model, body) == pytest.approx(1.5)
    assert found.heaviest(body.mj)[0] == pytest.approx(1.5)


def test_of_a_body_that_several_inputs_leave_open_no_less_is_left_than_nothing(tmp_path):
    """Its centre may be elsewhere, and so may its surface: together more than it weighs."""
    box = trimesh.creation.box((0.05, 0.05, 0.05)).export(file_type="stl")
    tool = TOOL.replace("shape = {{ sphere = 0.02 }}", 'mesh = "box.stl"\nunits = "m"\ndeviation_mm = 2')
    more = f"mass = 4\n{EVEN}com_tolerance = 0.02\n"
    more += '[[safety]]\nkind = "effective_mass"\nat = "arm"\nlimit = 900'
    text = FLOATING + TWO_R + tool.format(more)
    cell = made(tmp_path, text, {"arm.urdf": two_r(masses=(0.1, 0.1)), "box.stl": box})
    state = state_at(cell, arm=((0.2, 1.0), (1.0, -2.0)))
    found = MassTolerances(cell.model, cell.model.robot("arm"))
    least = found.matrices(state).at((-1,) * len(found))
    assert np.linalg.eigvalsh(least)[0] > 0
    (result,) = judged(cell.bound, state)
    assert result.interval is not None
    assert 0 < result.interval[0] < result.value < result.interval[1]


BLOCK = np.array([0.2, 0.12, 0.3])
"""Edges of a tool [m]."""


def lumps(rng, com):
    """Masses that sum to 1 in a block about the origin, at random, whose centre is a point [m]."""
    while True:
        at = rng.uniform(-0.5, 0.5, (rng.integers(2, 6), 3)) * BLOCK
        at = np.where(rng.random(at.shape) < 0.5, np.sign(at) * BLOCK / 2, at)
        share = rng.dirichlet(np.ones(len(at)))
        # One more, which brings the centre to where it is to be, if that lies in the block.
        weight = rng.uniform(0.05, 0.6)
        last = (com - (1 - weight) * share @ at) / weight
        if (np.abs(last) <= BLOCK / 2).all():
            return np.vstack([at, last]), np.append((1 - weight) * share, weight)


@pytest.mark.parametrize("link", [False, True])
@pytest.mark.parametrize("more", ["", "mass_tolerance = 0.2"])
def test_wherever_mass_is_about_a_known_centre_figures_are_within_their_bounds(tmp_path, link, more):
    """2 kg in a block, whose centre is given and whose moments are not: who leaves them out is not relieved.

    Against point masses anywhere in it that have that centre.
    """
    com, rng = np.array([0.06, -0.02, 0.1]), np.random.default_rng(4)
    said = f"mass = 2\ncom = {com.tolist()}\n{more}\n"
    block = f"shape = {{ box = {BLOCK.tolist()} }}\n"
    files, text = {"arm.urdf": two_r(masses=(0.3, 0.1))}, FLOATING + TWO_R
    if link:
        files["arm.urdf"] = one("revolute", 0.0).replace("0.1 0.1 0.1", " ".join(map(str, BLOCK)))
        text += f'{more}\n[robots.masses.l1]\nmass = 2\ncom = {com.tolist()}\nsource = "a scale"\n'
    else:
        text += f'[[tools]]\nname = "grip"\non = "arm/tip"\n{block}{said}'
    cell = made(tmp_path, text, files)
    robot = cell.model.robot("arm")
    n = len(robot.joints)
    found = MassTolerances(cell.model, robot)
    name = "arm/l1" if link else "grip"
    assert str(found.tolerances[-1]).startswith(f"radius of gyration of {name} ± ")
    assert found.moved == (str(found.tolerances[-1]),)
    q, qd = rng.uniform(-1, 1, n), rng.uniform(-1, 1, n)
    state = state_at(cell, arm=(q, qd))
    mj, data, body = cell.model.mj, state.data, state.model.mj.body(name).id
    plain = state.mass_matrix(robot)
    without, parts = plain - _Part.of(state, robot, body).matrix, []
    for _ in range(300):
        M, rows, mass = without.copy(), np.zeros((3, mj.nv)), 2 * (rng.uniform(0.8, 1.2) if more else 1.0)
        for at, share in zip(*lumps(rng, com), strict=True):
            mujoco.mj_jac(mj, data, rows, None, data.xpos[body] + data.xmat[body].reshape(3, 3) @ at, body)
            M += mass * share * rows[:, robot.v_address].T @ rows[:, robot.v_address]
        parts.append(qd @ M @ qd)
    at, ends = found.matrices(state).at, len(found)
    low, high = (qd @ at((side,) * ends) @ qd for side in (-1, 1))
    assert low <= min(parts) < max(parts) <= high
    assert low <= qd @ plain @ qd <= high
    assert max(parts) - min(parts) > 0.15 * (high - low), "it is no bound of nothing"
    # Who gives them has no interval.
    given = text.replace(
        f"com = {com.tolist()}\n", f"com = {com.tolist()}\ninertia = [0.02, 0.02, 0.01, 0, 0, 0]\n"
    )
    sure = made(tmp_path / "given", given, files)
    assert len(MassTolerances(sure.model, sure.model.robot("arm"))) == ends - 1


@pytest.mark.parametrize("link", [False, True])
def test_what_has_its_centre_of_mass_beside_its_shape_is_within_nothing_without_inertia(tmp_path, link):
    """5 cm beside the end of a block: its moments passed for those of nearly a point."""
    beside = [0.0, 0.0, float(BLOCK[2]) / 2 + 0.05]
    energy = '[[safety]]\nkind = "kinetic_energy"\nname = "energy"\nrobot = "arm"\nlimit = 100.0\n'
    verdicts = []
    for inertia in ("", "inertia = [0.02, 0.02, 0.005, 0, 0, 0]\n"):
        files, text = {"arm.urdf": two_r(masses=(0.3, 0.1))}, FLOATING + TWO_R
        said = f"mass = 2\ncom = {beside}\n{inertia}"
        if link:
            files["arm.urdf"] = one("revolute", 0.0).replace("0.1 0.1 0.1", " ".join(map(str, BLOCK)))
            text += f'[robots.masses.l1]\n{said}source = "a scale"\n'
        else:
            text += f'[[tools]]\nname = "grip"\non = "arm/tip"\nshape = {{ box = {BLOCK.tolist()} }}\n{said}'
        (tmp_path / f"cell{len(verdicts)}").mkdir()
        cell = made(tmp_path / f"cell{len(verdicts)}", text + energy, files)
        n = len(cell.model.robot("arm").joints)
        found = cell.batch({"arm": np.zeros((1, n))}, {"arm": np.ones((1, n))})["energy"]
        verdicts.append(found.verdict)
        assert ("give inertia" in str(found.reasons[0])) == (not inertia)
    assert verdicts == [Verdict.UNDECIDED, Verdict.WITHIN]
