"""Force polytope of robots: closed form of the planar arm, Qhull, Pinocchio, limits, what is unknown."""

from __future__ import annotations

from importlib.resources import files

import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import linprog
from scipy.spatial import HalfspaceIntersection

from made_cell import FLOATING, TWO_R, UR10, basis_in, made, results_at, state_at, two_r
from oracles import pinocchio_oracle as oracle
from seerob.core.errors import InputError, UnknownName
from seerob.core.snapshot import Hull, Origin, Sphere, Verdict
from seerob.criteria.polytope import zero_moment
from seerob.description.norms.body_limits import SHIPPED
from seerob.description.robots import library
from seerob.session.station import load
from seerob.twin import joint_torques

J = np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 0.0]])
"""Of the planar arm at (0, 90°)."""
ARM = '[[safety]]\nkind = "force_polytope"\nat = "arm"\n'
HAND = 'tool = "tip"\n'
ELBOW = ((0.0, np.pi / 2), (0.0, 0.0))
SPATIAL = """<robot name="crane"><link name="base"/>{links}{joints}</robot>"""


def crane() -> str:
    """A slide along x, one along y and one along z with 2 kg at the end: Cartesian, J_v = 1."""
    links = "".join(
        f'<link name="l{i}"><inertial><mass value="2"/>'
        '<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        for i in range(3)
    )
    joints = "".join(
        f'<joint name="j{i}" type="prismatic"><parent link="{"base" if i == 0 else f"l{i - 1}"}"/>'
        f'<child link="l{i}"/><axis xyz="{axis}"/>'
        '<limit lower="-1" upper="1" effort="100" velocity="1"/></joint>'
        for i, axis in enumerate(("1 0 0", "0 1 0", "0 0 1"))
    )
    return SPATIAL.format(links=links, joints=joints)


def arm(folder, options, robot=TWO_R + HAND, pose=ELBOW, urdf=None, more=FLOATING):
    station = made(folder, more + robot + ARM + options, {"arm.urdf": urdf or two_r()})
    return next(iter(results_at(station, arm=pose).values()))


def parts(result):
    return {part.name: part.value for part in result.parts}


# -- mathematics --------------------------------------------------------------------------------


def test_planar_arm_in_closed_form():
    p = zero_moment(J, np.array([-10.0, -5.0]), np.array([10.0, 5.0]))
    corners = sorted(map(tuple, np.round(p.corners, 12).tolist()))
    assert corners == [(-5, -15, 0), (-5, 5, 0), (5, -5, 0), (5, 15, 0)]
    assert np.linalg.norm(p.farthest) == pytest.approx(15.811388, abs=5e-7)
    assert np.abs(p.free).ravel().tolist() == [0, 0, 1]
    # |τ2| ≤ 5 bounds F_x, with a row of length 1; |τ1| ≤ 10 allows 10 / √2 across.
    assert p.inscribed == pytest.approx(5)


def states(folder, name, count, seed):
    model = oracle.pinocchio_model(library.load(name))
    rng = np.random.default_rng(seed)
    tip = library.load(name).tip
    for _ in range(count):
        q = rng.uniform(-3, 3, model.nq)
        yield oracle.jacobian(model, q, tip), pin.computeGeneralizedGravity(model, model.createData(), q), rng


@pytest.mark.parametrize("name", ["ur10e", "ur5", "iiwa14"])
def test_real_arms_with_asymmetric_limits_and_gravity_agree_with_qhull(tmp_path, name):
    for J6, gravity, rng in states(tmp_path, name, 70, 1):
        n = len(gravity)
        low, high = -rng.uniform(60, 330, n) - gravity, rng.uniform(60, 330, n) - gravity
        p = zero_moment(J6[:3], low, high)
        slabs = np.block([[J6[:3].T, -high[:, None]], [-J6[:3].T, low[:, None]]])
        slabs = slabs[np.linalg.norm(slabs[:, :3], axis=1) > 1e-9]
        lengths = np.linalg.norm(slabs[:, :3], axis=1, keepdims=True)
        ball = linprog([0, 0, 0, -1], np.hstack([slabs[:, :3], lengths]), -slabs[:, 3], bounds=(None, None))
        if np.linalg.cond(J6[:3]) > 50:  # Qhull itself loses digits there
            continue
        V = HalfspaceIntersection(slabs, ball.x[:3]).intersections
        assert p.largest == pytest.approx(np.linalg.norm(V, axis=1).max(), rel=1e-12)
        apart = np.linalg.norm(V[:, None] - p.corners[None], axis=-1)
        assert max(apart.min(axis=0).max(), apart.min(axis=1).max()) < 1e-8 * p.largest


@pytest.mark.parametrize("name", ["ur10e", "ur5"])
def test_gravity_and_bias_torques_are_pinocchios(tmp_path, name):
    text = f'[[robots]]\nname = "arm"\nmodel = "library:{name}"\n'
    station = made(tmp_path, text)
    robot, model = station.model.robot("arm"), oracle.pinocchio_model(library.load(name))
    rng = np.random.default_rng(2)
    for _ in range(5):
        q, qd = rng.uniform(-3, 3, 6), rng.normal(size=6)
        state = state_at(station, arm=(q, qd))
        data = model.createData()
        model.gravity.linear = np.array(station.workstation.engine.gravity)
        theirs = pin.computeGeneralizedGravity(model, data, q).copy()
        np.testing.assert_allclose(joint_torques.gravity(state, robot), theirs, atol=1e-9)
        np.testing.assert_allclose(
            joint_torques.bias(state, robot), pin.nonLinearEffects(model, data, q, qd), atol=1e-9
        )


def test_gravity_of_a_tool_is_the_slope_of_the_potential_energy(tmp_path):
    station = made(tmp_path, UR10)
    model, robot = station.model, station.model.robot("arm")
    q = np.array([0.3, -1.1, 1.2, -0.4, 0.8, 0.1])

    def energy(q):
        state = state_at(station, arm=(q, np.zeros(6)))
        return -float(model.mj.body_mass @ (state.data.xipos @ model.mj.opt.gravity))

    h = 1e-5
    slope = [(energy(q + h * e) - energy(q - h * e)) / (2 * h) for e in np.eye(6)]
    state = state_at(station, arm=(q, np.zeros(6)))
    np.testing.assert_allclose(joint_torques.gravity(state, robot), slope, atol=1e-6)


# -- the criterion ------------------------------------------------------------------------------


def test_planar_arm_is_unbounded_across_its_plane_and_says_so(tmp_path):
    result = arm(tmp_path, "torque_limits = [[-10, 10], [-5, 5]]\nlimit = 1e6\n")
    assert result.verdict is Verdict.EXCEEDED
    assert result.value is None
    assert "singular" in result.reason
    assert "(0.00, 0.00, 1.00)" in result.reason
    assert parts(result)["across that direction"] == pytest.approx(15.811388, abs=5e-7)


def test_cartesian_crane_pushes_down_more_by_its_weight(tmp_path):
    options = "torque_limits = [[-10, 20], [-30, 40], [-50, 60]]\n"
    robot = '[[robots]]\nname = "arm"\nmodel = "arm.urdf"\n'
    result = arm(tmp_path, options, robot, ((0, 0, 0), (0, 0, 0)), crane(), more="")
    g = 2 * 9.81
    assert result.value == pytest.approx(np.linalg.norm([20, 40, 50 + g]))
    assert parts(result)["in every direction"] == 10
    u = np.array([20, 40, -50 - g])
    u /= np.linalg.norm(u)
    assert [parts(result)[f"direction {a}"] for a in "xyz"] == pytest.approx(u)
    lifted = arm(tmp_path, options + 'load = "none"\n', robot, ((0, 0, 0), (0, 0, 0)), crane(), more="")
    assert lifted.value == pytest.approx(np.linalg.norm([20, 40, 60]))


def test_centripetal_torque_counts_when_asked(tmp_path):
    options = "torque_limits = [[-10, 10], [-5, 5]]\n"
    pose = ((0.0, np.pi / 2), (1.0, 0.0))
    # c of the planar arm at q2 = 90°: (-l² m (2 q̇1 q̇2 + q̇2²), l² m q̇1²) = (0, 1) N·m.
    still = arm(tmp_path, options, pose=pose)
    moving = arm(tmp_path, options + 'load = "motion"\n', pose=pose)
    assert parts(still)["across that direction"] == pytest.approx(np.hypot(5, 15))
    assert parts(moving)["across that direction"] == pytest.approx(np.hypot(6, 16), abs=1e-6)


@pytest.mark.parametrize(("factor", "verdict"), [(1 - 1e-9, Verdict.EXCEEDED), (1 + 1e-8, Verdict.WITHIN)])
def test_limit_bounds_from_above(tmp_path, factor, verdict):
    robot = '[[robots]]\nname = "arm"\nmodel = "arm.urdf"\n'
    limit = float(np.linalg.norm([100, 100, 100 + 2 * 9.81])) * factor
    result = arm(tmp_path, f"limit = {limit!r}\n", robot, ((0, 0, 0), (0, 0, 0)), crane(), more="")
    assert result.verdict is verdict
    sphere = next(m for m in result.markers if isinstance(m, Sphere))
    hull = next(m for m in result.markers if isinstance(m, Hull))
    # Drawn to one scale: the sphere of the limit just touches or just holds the farthest corner.
    reach = max(float(np.linalg.norm(np.subtract(v, sphere.center))) for v in hull.vertices)
    assert (reach > sphere.radius) is (verdict is Verdict.EXCEEDED)


def test_the_three_sets_of_a_real_arm_contain_each_other(tmp_path):
    kinds = ("zero_moment", "free_moment", "torque_box")
    tables = "".join(f'{ARM}name = "{k}"\ndefinition = "{k}"\n' for k in kinds)
    station = made(tmp_path, UR10 + tables)
    results = results_at(station, arm=((0.2, -1.2, 1.4, -1.5, -1.5, 0.3), np.zeros(6)))
    assert results["zero_moment"].value < results["free_moment"].value
    assert results["zero_moment"].value < results["torque_box"].value


@pytest.mark.parametrize("name", ["iiwa14", "doosan_m1013", "niryo_one"])
def test_unknown_torque_limits_are_undecided(tmp_path, name):
    n = len(library.load(name).joints())
    station = made(tmp_path, f'[[robots]]\nname = "arm"\nmodel = "library:{name}"\n{ARM}limit = 1e9\n')
    result = next(iter(results_at(station, arm=(np.full(n, 0.3), np.zeros(n))).values()))
    assert result.verdict is Verdict.UNDECIDED
    assert "torque limit" in result.reason
    assert any(i.origin is Origin.MISSING and "torque limit" in i.name for i in station.bound[0].basis.inputs)


def test_weights_that_are_roughly_known_leave_forces_undecided(tmp_path):
    """Of the Niryo One's links only round masses are published, anywhere in their shapes."""
    robot = '[[robots]]\nname = "arm"\nmodel = "library:niryo_one"\n'
    robot += f"torque_limits = {[9.0] * 6}\n"
    for k, (name, why) in enumerate(
        (
            ("gravity", "masses are known within bounds"),
            ("motion", "masses are known within bounds"),
            ("none", ""),
        )
    ):
        station = made(tmp_path / str(k), f'{robot}{ARM}limit = 1e6\nload = "{name}"\n')
        result = next(iter(results_at(station, arm=(np.full(6, 0.3), np.zeros(6))).values()))
        assert (result.value is None) == bool(why), name
        assert why in result.reason


def test_torque_limit_of_zero_is_one_that_nobody_filled_in(tmp_path):
    result = arm(tmp_path, "limit = 1e6\n", TWO_R + HAND + "torque_limits = [10, 0]\n")
    assert result.verdict is Verdict.UNDECIDED
    assert result.reason.endswith("torque limit of j2")


def test_robot_too_weak_for_its_own_weight_is_undecided_or_says_so(tmp_path):
    robot = '[[robots]]\nname = "arm"\nmodel = "arm.urdf"\n'
    pose = ((0, 0, 0), (0, 0, 0))
    weak = "torque_limits = [[-10, 10], [-10, 10], [-10, 10]]\n"
    result = arm(tmp_path, weak, robot, pose, crane(), more="")
    assert parts(result)["in every direction"] == pytest.approx(10 - 2 * 9.81)
    assert "cannot hold" in result.reason


@pytest.mark.parametrize("wrong", ["[[-1, 1]]", "[[1, -1], [-1, 1]]", "[[-1, 1], [-1, 1], [-1, 1]]"])
def test_torque_limits_that_cannot_be_are_named(tmp_path, wrong):
    station = made(tmp_path, FLOATING + TWO_R + ARM + f"torque_limits = {wrong}\n", {"arm.urdf": two_r()})
    with pytest.raises(InputError, match=r"torque_limits.*j1, j2"):
        _ = station.bound


# -- the sphere of a body region ----------------------------------------------------------------

LIMITS = files("seerob.description.norms").joinpath(SHIPPED).read_text("utf-8")


@pytest.mark.parametrize(
    ("region", "limit", "verdict"),
    [("Face", None, None), ("Lower legs", 130, "exceeded"), ("Neck", 150, "within")],
)
def test_the_sphere_of_a_body_region_is_its_quasi_static_force(tmp_path, region, limit, verdict):
    """The crane pushes 80 N along each axis: up to √3 · 80 N = 138.6 N."""
    options = f'body_region = "{region}"\ntorque_limits = [[-80, 80], [-80, 80], [-80, 80]]\nload = "none"\n'
    if limit is None:
        with pytest.raises(InputError, match=r"Face.*contact is not permitted"):
            arm(tmp_path, options, TWO_R, ((0,) * 3, (0,) * 3), crane())
        return
    found = arm(tmp_path, options, TWO_R, ((0,) * 3, (0,) * 3), crane())
    assert found.value == pytest.approx(80 * np.sqrt(3))
    assert (found.limit, found.verdict) == (limit, verdict)
    assert f"limit {limit} N" in [m.label for m in found.markers if isinstance(m, Sphere)]
    sources = {i.name: (i.value, i.unit, i.origin) for i in basis_in(tmp_path).inputs}
    assert sources[f"{region}: F_s"] == (limit, "N", Origin.STATED)
    assert sources["limits"][0] == SHIPPED
    batch = load(tmp_path).batch({"arm": np.zeros((2, 3))}, {"arm": np.zeros((2, 3))})
    (answer,) = batch.values()
    assert answer.answers.limit.tolist() == [limit, limit]


def test_limits_of_body_regions_can_be_ones_own(tmp_path):
    tmp_path.joinpath("own.toml").write_text(LIMITS.replace("[150, ", "[120, "))
    options = 'body_region = "Neck"\nlimits = "own.toml"\nload = "none"\n'
    options += "torque_limits = [[-80, 80], [-80, 80], [-80, 80]]\n"
    found = arm(tmp_path, options, TWO_R, ((0,) * 3, (0,) * 3), crane())
    assert (found.limit, found.verdict) == (120, "exceeded")
    assert {i.name: i.origin for i in basis_in(tmp_path).inputs}["Neck: F_s"] is Origin.GIVEN


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ('body_region = "Chest"\nlimit = 140', "either limit or body_region"),
        ('limits = "own.toml"', "name one"),
        ('body_region = "Feet"', "no body region"),
        ('body_region = "Elbow"', "no body region"),
    ],
)
def test_spheres_that_cannot_be_are_refused(tmp_path, options, words):
    with pytest.raises((InputError, UnknownName), match=words):
        arm(tmp_path, options + "\n")
