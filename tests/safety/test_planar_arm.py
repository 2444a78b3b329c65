"""Velocity, energy, manipulability and effective mass of the planar arm of two links, in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from made_cell import FLOATING, TWO_R, basis_in, made, results_at, two_r
from seerob.core.errors import InputError, UnknownName
from seerob.core.snapshot import Verdict
from seerob.criteria.safety.effective_mass import (
    felt_toward,
    inverse_effective_mass,
    principal_masses,
    projected_mass,
)
from seerob.criteria.safety.kinetic_energy import kinetic_energy
from seerob.criteria.safety.manipulability import singular_values
from seerob.criteria.safety.point_energy import point_energy
from seerob.criteria.safety.velocity import point_velocity
from seerob.kernels.axes import mass_along

J = np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 0.0]])
M = np.array([[3.0, 1.0], [1.0, 1.0]])
POSE = ((0.0, np.pi / 2), (1.0, -2.0))


def judged(folder, criteria, pose=POSE, robot=TWO_R, urdf=None, more=""):
    tables = "".join(f"[[safety]]\n{c}\n" for c in criteria)
    station = made(folder, FLOATING + robot + tables + more, {"arm.urdf": urdf or two_r()})
    return list(results_at(station, arm=pose).values())


def test_matrices_in_closed_form():
    inverse = inverse_effective_mass(J, M)
    np.testing.assert_allclose(inverse, np.diag([1, 0.5, 0]), atol=1e-15)
    assert projected_mass(inverse, np.eye(3)[:2]).tolist() == [1.0, 2.0]
    assert projected_mass(inverse, np.array([1, 1, 0]) / np.sqrt(2)) == pytest.approx(4 / 3)
    assert np.isinf(projected_mass(inverse, np.array([0, 0, 1.0])))
    assert principal_masses(inverse)[0] == pytest.approx([1, 2, np.inf])
    assert singular_values(J)[0] == pytest.approx([1.618034, 0.618034, 0], abs=1e-6)
    assert kinetic_energy(M, np.array([1.0, -2.0])) == 1.5
    # The tip moves by (1, 1) m/s, where it feels as 4/3 kg.
    assert point_energy(inverse, J @ [1.0, -2.0]) == pytest.approx(4 / 3)
    assert point_energy(inverse, np.zeros((2, 3))).tolist() == [0.0, 0.0]


def test_energy_at_a_point_is_the_least_that_moves_it_so(tmp_path):
    rng = np.random.default_rng(3)
    Js, root, qds = rng.normal(size=(50, 3, 5)), rng.normal(size=(50, 5, 5)), rng.normal(size=(50, 5))
    Ms = root @ np.swapaxes(root, 1, 2) + 0.1 * np.eye(5)
    v = np.matvec(Js, qds)
    found = point_energy(inverse_effective_mass(Js, Ms), v)
    assert (found <= kinetic_energy(Ms, qds) * (1 + 1e-12)).all()
    # Of all joint speeds that move it as fast along u, M⁻¹ Jᵀ u has the least energy.
    u = v / np.linalg.norm(v, axis=-1, keepdims=True)
    least = np.linalg.solve(Ms, np.swapaxes(Js, 1, 2) @ u[..., None])[..., 0]
    least *= (np.linalg.norm(v, axis=-1) / np.vecdot(u, np.matvec(Js, least)))[:, None]
    np.testing.assert_allclose(found, kinetic_energy(Ms, least), rtol=1e-9)
    point, whole = judged(
        tmp_path,
        ['kind = "point_energy"\nat = "arm"\nlimit = 1.3', 'kind = "kinetic_energy"\nrobot = "arm"'],
    )
    assert point.value == pytest.approx(4 / 3)
    assert (point.verdict, whole.value) == (Verdict.EXCEEDED, pytest.approx(1.5))


def test_functions_take_batches():
    rng = np.random.default_rng(0)
    Js, root = rng.normal(size=(7, 6, 5)), rng.normal(size=(7, 5, 5))
    Ms, qds = root @ np.swapaxes(root, 1, 2) + np.eye(5), rng.normal(size=(7, 5))
    inverse = inverse_effective_mass(Js[:, :3], Ms)
    for i in range(7):
        assert kinetic_energy(Ms, qds)[i] == pytest.approx(0.5 * qds[i] @ Ms[i] @ qds[i])
        assert kinetic_energy(Ms, qds)[i] == kinetic_energy(Ms[i], qds[i])  # bit by bit
        np.testing.assert_allclose(point_velocity(Js, qds)[i], Js[i] @ qds[i], atol=1e-14)
        np.testing.assert_allclose(inverse[i], Js[i, :3] @ np.linalg.inv(Ms[i]) @ Js[i, :3].T, atol=1e-12)
        values, axes = singular_values(Js[i, :3])
        np.testing.assert_allclose(axes @ np.diag(values**2) @ axes.T, Js[i, :3] @ Js[i, :3].T, atol=1e-12)
        *u, mass = mass_along(inverse[i], qds[i, :3], 1e-9)
        assert mass == felt_toward(inverse, qds[:, :3], 1e-9)[i]
        assert mass == pytest.approx(projected_mass(inverse[i], np.array(u)))
        assert np.linalg.norm(u) == pytest.approx(1)


def test_push_of_the_effective_mass_is_newtons_law():
    """A force u at a point at rest accelerates it by 1/m along u."""
    rng = np.random.default_rng(1)
    A, root = rng.normal(size=(3, 6)), rng.normal(size=(6, 6))
    mass_matrix = root @ root.T + np.eye(6)
    u = np.array([0.6, 0.0, 0.8])
    acceleration = A @ np.linalg.solve(mass_matrix, A.T @ u)
    assert projected_mass(inverse_effective_mass(A, mass_matrix), u) == pytest.approx(1 / (u @ acceleration))


@pytest.mark.parametrize(("limit", "verdict"), [(1.4999, "exceeded"), (1.5001, "within")])
def test_energy(tmp_path, limit, verdict):
    (result,) = judged(tmp_path, [f'kind = "kinetic_energy"\nrobot = "arm"\nlimit = {limit}'])
    assert result.value == pytest.approx(1.5)
    assert (result.verdict, result.unit, result.limit) == (verdict, "J", limit)


@pytest.mark.parametrize(("limit", "verdict"), [(1.4142, "exceeded"), (1.4143, "within")])
def test_speed_of_the_tip(tmp_path, limit, verdict):
    (result,) = judged(tmp_path, [f'kind = "velocity"\nat = "arm"\nlimit = {limit}'])
    assert result.value == pytest.approx(np.sqrt(2))
    assert result.verdict == verdict
    np.testing.assert_allclose(np.array(result.markers[0].vector) / np.sqrt(2), [0.5 / np.sqrt(2)] * 2 + [0])


def test_speed_of_a_point_beside_a_link(tmp_path):
    """Link 2 points along y and turns with −1 rad/s; joint 2 moves with 1 m/s along y."""
    (result,) = judged(tmp_path, ['kind = "velocity"\nat = "arm/l2"\noffset = [2, 1, 0]'])
    assert result.value == pytest.approx(np.hypot(2, 1 + 1))


def test_fastest_point_of_the_arm_is_a_corner_of_its_last_link(tmp_path):
    (result,) = judged(tmp_path, ['kind = "velocity"\nof = "arm"\nlimit = 1.4'])
    # Corner (1, ±0.05) of link 2, whose frame is turned by 90°: r = (∓0.05, 1), v = (1, 1 ± 0.05).
    assert result.value == pytest.approx(np.hypot(1, 1.05))
    assert (result.verdict, result.reason) == ("exceeded", "arm/l2")


@pytest.mark.parametrize(
    "table",
    [
        'kind = "velocity"\nat = "arm"\n',
        'kind = "velocity"\nof = "arm"\n',
        'kind = "kinetic_energy"\nrobot = "arm"\n',
        'kind = "effective_mass"\nat = "arm"\n',
        'kind = "minimum_distance"\nbetween = ["arm", "wall"]\n',
    ],
)
def test_on_the_limit_is_beyond_it(tmp_path, table):
    (result,) = judged(tmp_path / "free", [table], more=PLATE)
    kept = result.value * (1 + 1e-8) if result.at_most else result.value * (1 - 1e-8)
    (on,) = judged(tmp_path / "on", [f"{table}limit = {result.value!r}"], more=PLATE)
    (under,) = judged(tmp_path / "under", [f"{table}limit = {kept!r}"], more=PLATE)
    assert (result.verdict, on.verdict, under.verdict) == (None, "exceeded", "within")


def test_a_speed_is_drawn_at_its_point(tmp_path):
    """The second link lies along y, from (1, 0); 1 rad/s about the base."""
    table = 'kind = "velocity"\nat = "arm/l2"\noffset = [0.5, 0.1, 0]'
    (found,) = judged(tmp_path, [table], pose=((0.0, np.pi / 2), (1.0, 0.0)))
    (arrow,) = found.markers
    assert found.value == pytest.approx(np.hypot(0.9, 0.5))
    assert arrow.origin == pytest.approx((0.9, 0.5, 0))
    assert np.divide(arrow.vector, 0.5) == pytest.approx((-0.5, 0.9, 0))


@pytest.mark.parametrize(("limit", "verdict"), [(0.1, "exceeded"), (0.0, "exceeded")])
def test_planar_arm_cannot_move_out_of_its_plane(tmp_path, limit, verdict):
    (result,) = judged(tmp_path, [f'kind = "manipulability"\nat = "arm"\nlimit = {limit}'])
    assert result.value == pytest.approx(0, abs=1e-12)
    assert result.verdict == verdict
    values = {part.name: part.value for part in result.parts}
    assert (values["σ₁"], values["σ₂"]) == pytest.approx((1.618034, 0.618034), abs=1e-6)
    assert result.reason == ""  # two joints move a point in no room: there is no way out of that


@pytest.mark.parametrize(
    ("turns", "elbow", "reason"),
    [("0 1 0", 0.0, "near a singularity: j2 leads"), ("0 0 1", 1.0, "no joint by itself leads out")],
)
def test_of_three_joints_the_one_that_leads_out_of_a_singularity_is_named(tmp_path, turns, elbow, reason):
    """A stretched arm on one that turns about z: its elbow bends it; where all turn about z, none does."""
    urdf = two_r().replace('<axis xyz="0 0 1"/>', f'<axis xyz="{turns}"/>')
    urdf = urdf.replace(
        '<link name="base"/>',
        '<link name="root"/><link name="base"/><joint name="yaw" type="continuous"><parent link="root"/>'
        '<child link="base"/><axis xyz="0 0 1"/><limit effort="1" velocity="1"/></joint>',
    )
    text = FLOATING + TWO_R + '[[safety]]\nkind = "manipulability"\nname = "m"\nat = "arm"\nlimit = 0.1\n'
    station = made(tmp_path, text, {"arm.urdf": urdf})
    found = results_at(station, arm=((0.0, 0.0, elbow), (0.0, 0.0, 0.0)))["m"]
    assert found.verdict == "exceeded"
    assert found.reason.startswith(reason)


def test_manipulability_falls_to_zero_at_the_stretched_arm(tmp_path):
    """|det J| = l1 l2 |sin q2|: the product of the two singular values in the plane."""
    for k, q2 in enumerate((0.0, 0.3, 1.2, 2.5)):
        (result,) = judged(
            tmp_path / str(k), ['kind = "manipulability"\nat = "arm"'], pose=((0.4, q2), (0, 0))
        )
        product = result.parts[0].value * result.parts[1].value
        assert product == pytest.approx(abs(np.sin(q2)), abs=1e-9)


@pytest.mark.parametrize(("limit", "verdict"), [(1.33, "exceeded"), (1.34, "within")])
def test_effective_mass_along_the_motion(tmp_path, limit, verdict):
    (result,) = judged(tmp_path, [f'kind = "effective_mass"\nat = "arm"\nlimit = {limit}'])
    assert result.value == pytest.approx(4 / 3)
    assert (result.verdict, result.unit, result.reason) == (verdict, "kg", "")
    masses = {part.name: part.value for part in result.parts}
    assert (masses["m1"], masses["m2"], masses["m3"]) == (pytest.approx(1), pytest.approx(2), None)
    assert masses["M/2 + m_L"] == pytest.approx(1.0)


def test_simplified_mass_counts_the_load_in_full_and_links_by_half(tmp_path):
    load = '[[tools]]\nname = "grip"\non = "arm/tip"\nshape = { sphere = 0.02 }\nmass = 0.7\n'
    load += '[[workpieces]]\nname = "part"\non = "grip"\nshape = { sphere = 0.02 }\nmass = 0.4\n'
    (result,) = judged(
        tmp_path, ['kind = "effective_mass"\nat = "arm"'], more=load, urdf=two_r(masses=(3, 5))
    )
    assert result.parts[-1].value == pytest.approx((3 + 5) / 2 + 0.7 + 0.4)


def test_effective_mass_has_no_direction_at_standstill(tmp_path):
    (result,) = judged(tmp_path, ['kind = "effective_mass"\nat = "arm"\nlimit = 1'], pose=((0, 1.5), (0, 0)))
    assert result.value is None
    assert result.verdict is None
    assert "stands still" in result.reason


@pytest.mark.parametrize(("speed", "known"), [(0.99e-3, False), (1.01e-3, True)])
def test_a_motion_has_a_direction_from_a_millimetre_per_second_on(tmp_path, speed, known):
    """Of a stretched arm turning about its base: the tip is 2 m out."""
    (result,) = judged(tmp_path, ['kind = "effective_mass"\nat = "arm"'], pose=((0, 0), (speed / 2, 0)))
    assert (result.value is not None) is known


@pytest.mark.parametrize(("limit", "verdict"), [(1e6, "exceeded")])
def test_mass_of_a_direction_that_gives_no_way_is_beyond_any_limit(tmp_path, limit, verdict):
    (result,) = judged(tmp_path, [f'kind = "effective_mass"\nat = "arm"\nalong = "worst"\nlimit = {limit}'])
    assert (result.value, result.verdict) == (None, verdict)
    assert "infinite" in result.reason


PLATE = '[[parts]]\nname = "wall"\nshape = { box = [0.1, 9, 9] }\nat = { position = [-3, 0, 0] }\n'


def test_effective_mass_toward_something(tmp_path):
    """Toward a wall across x: 1 kg."""
    (result,) = judged(tmp_path, ['kind = "effective_mass"\nat = "arm"\ntoward = "wall"'], more=PLATE)
    assert result.value == pytest.approx(1.0)
    assert {"stated", "missing"} <= {str(i.origin) for i in basis_in(tmp_path).inputs}


def test_touching_has_no_direction_and_no_pass(tmp_path):
    inside = PLATE.replace("-3", "0")
    (result,) = judged(
        tmp_path, ['kind = "effective_mass"\nat = "arm"\ntoward = "wall"\nlimit = 100'], more=inside
    )
    assert (result.value, result.verdict) == (None, "undecided")
    assert "no direction" in result.reason


@pytest.mark.parametrize(
    "criterion",
    [
        'kind = "kinetic_energy"\nrobot = "arm"\nlimit = 100',
        'kind = "effective_mass"\nat = "arm"\nlimit = 100',
        'kind = "effective_mass"\nat = "arm"\nlimit = 100\nalong = "worst"',
    ],
)
def test_unknown_mass_is_undecided_with_the_name_of_the_link(tmp_path, criterion):
    import re

    nobody = re.sub(r"<inertial>.*?</inertial>", "", two_r(), count=1)
    (result,) = judged(tmp_path, [criterion], urdf=nobody)
    # A stretched arm gives no way along itself, whatever it weighs.
    assert (result.value, result.verdict) == (None, "exceeded" if "worst" in criterion else "undecided")
    assert "nobody gave the mass of arm/l1" in result.reason
    assert any(i.origin == "missing" and "arm/l1" in i.name for i in basis_in(tmp_path).inputs)


def test_speed_and_manipulability_need_no_mass(tmp_path):
    import re

    nobody = re.sub(r"<inertial>.*?</inertial>", "", two_r())
    speed, way = judged(
        tmp_path,
        ['kind = "velocity"\nat = "arm"\nlimit = 2.1', 'kind = "manipulability"\nat = "arm"'],
        urdf=nobody,
    )
    assert (speed.verdict, way.verdict, way.reason) == ("within", None, "")


def test_mass_by_hand_makes_it_known(tmp_path):
    import re

    nobody = re.sub(r"<inertial>.*?</inertial>", "", two_r(), count=1)
    hand = (
        TWO_R
        + "[robots.masses]\nl1 = { mass = 1, com = [1, 0, 0], inertia = [1e-12, 1e-12, 1e-12, 0, 0, 0] }\n"
    )
    (result,) = judged(tmp_path, ['kind = "kinetic_energy"\nrobot = "arm"'], robot=hand, urdf=nobody)
    assert result.value == pytest.approx(1.5)


@pytest.mark.parametrize(
    ("criterion", "error"),
    [
        ('kind = "velocity"\nof = "wall"', "nothing of 'wall' moves"),
        ('kind = "velocity"\nat = "arm/hand"', "no link or frame named 'arm/hand'"),
        ('kind = "kinetic_energy"\nrobot = "amr"', "did you mean 'arm'"),
        ('kind = "effective_mass"\nat = "wall"', "moves"),
        ('kind = "manipulability"\nat = "nobody"', "nobody"),
    ],
)
def test_names_that_mean_nothing_are_refused_at_the_start(tmp_path, criterion, error):
    with pytest.raises((InputError, UnknownName), match=error):
        judged(tmp_path, [criterion], more=PLATE)
