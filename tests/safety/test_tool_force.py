"""Force from measured torques: put a known force on a known arm and find it again."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import minimize

from made_cell import FLOATING, TWO_R, heard, judged, made, two_r
from oracles import pinocchio_oracle as oracle
from seerob.core.errors import InputError
from seerob.core.snapshot import Verdict
from seerob.criteria.figure import verdict_of
from seerob.criteria.safety.tool_force import (
    ToolForce,
    largest_error,
    pseudo_inverse_change,
    wrench_from_torques,
)
from seerob.description.robots import library
from seerob.session.run import Judge
from seerob.twin.engine import Engine

TOOL = '[[safety]]\nkind = "tool_force"\nname = "force"\nat = "arm"\n'
UR5E = '[[robots]]\nname = "arm"\nmodel = "library:ur5e"\n'
Q = np.array([0.3, -1.2, 1.3, -0.9, 0.7, 0.2])
FORCE = np.array([30.0, -40.0, 120.0])
MOMENT = np.array([1.0, 2.0, -3.0])


def random_jacobian(rows: int, n: int, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(rows, n))


# -- mathematics --------------------------------------------------------------------------------


@pytest.mark.parametrize(("rows", "n"), [(3, 6), (3, 7), (6, 6), (6, 7)])
def test_force_is_found_again_without_residual(rows, n):
    J, w = random_jacobian(rows, n, 0), np.arange(1.0, rows + 1)
    found = wrench_from_torques(J, J.T @ w, damped_below=1e-3)
    np.testing.assert_allclose(found.wrench, w, rtol=1e-10)
    np.testing.assert_allclose(found.residual, 0, atol=1e-12)
    assert found.hidden.tolist() == [0] * rows


def test_residual_is_what_least_squares_leaves():
    J, tau = random_jacobian(3, 6, 1), np.arange(6.0)
    found = wrench_from_torques(J, tau, damped_below=1e-3)
    f, squares, _, _ = np.linalg.lstsq(J.T, tau, rcond=None)
    np.testing.assert_allclose(found.wrench, f, rtol=1e-10)
    assert found.residual @ found.residual == pytest.approx(squares[0])
    np.testing.assert_allclose(J @ found.residual, 0, atol=1e-12)


def test_damping_bounds_the_force_and_is_continuous_where_it_sets_in():
    tau, epsilon = np.array([0.0, 0, 1]), 0.02
    sizes = {
        s: float(np.linalg.norm(wrench_from_torques(np.diag([1, 1, s]), tau, damped_below=epsilon).wrench))
        for s in (0.0, 1e-6, 0.01, epsilon * (1 - 1e-12), epsilon, 0.04)
    }
    assert sizes[0.0] == 0
    assert sizes[0.01] == pytest.approx(0.01 / epsilon**2)
    assert sizes[epsilon * (1 - 1e-12)] == pytest.approx(sizes[epsilon], rel=1e-9)
    assert sizes[epsilon] == pytest.approx(1 / epsilon)
    assert sizes[0.04] == pytest.approx(1 / 0.04)
    assert max(sizes.values()) <= 1 / epsilon + 1e-12


def test_hidden_share_is_what_the_estimate_loses():
    J = np.diag([1.0, 0.5, 0.01])
    found = wrench_from_torques(J, J.T @ np.array([1.0, 1, 1]), damped_below=0.02)
    assert found.hidden.tolist() == pytest.approx([0, 0, 0.75])
    assert found.wrench.tolist() == pytest.approx([1, 1, 0.25])
    assert np.abs(found.axes[:, 2]).tolist() == [0, 0, 1]


def test_batches():
    rng = np.random.default_rng(2)
    J, tau = rng.normal(size=(5, 4, 3, 6)), rng.normal(size=(5, 4, 6))
    found = wrench_from_torques(J, tau, damped_below=0.5)
    for i in np.ndindex(5, 4):
        one = wrench_from_torques(J[i], tau[i], damped_below=0.5)
        np.testing.assert_allclose(found.wrench[i], one.wrench, atol=1e-12)
        np.testing.assert_allclose(found.residual[i], one.residual, atol=1e-12)
        np.testing.assert_allclose(found.hidden[i], one.hidden, atol=1e-12)


def used(pair):
    """Share of the bound that a matrix and another one of full rank, 3 by 4 each, use; from 24 numbers."""
    a, b = pair.reshape(2, 3, 4)
    least, change = np.linalg.svd(a, compute_uv=False)[-1], np.linalg.norm(b - a, 2)
    bound = pseudo_inverse_change(least, min(change, 0.999 * least))
    return np.linalg.norm(np.linalg.pinv(b) - np.linalg.pinv(a), 2) / bound if change < 0.999 * least else 0.0


def test_no_change_of_a_jacobian_changes_its_pseudo_inverse_by_more_than_the_bound():
    rng = np.random.default_rng(3)
    a = rng.normal(size=(4000, 12)) * rng.uniform(0.05, 2, (4000, 12))
    pairs = np.hstack([a, a + rng.normal(size=a.shape) * 10 ** rng.uniform(-3, 0, (4000, 1))])
    shares = np.array([used(pair) for pair in pairs])
    worst = pairs[np.argsort(shares)[-3:]]
    sought = [minimize(lambda x: -used(x), x, method="Nelder-Mead", options={"maxfev": 2000}) for x in worst]
    top = max(shares.max(), *(-each.fun for each in sought))
    assert 0.6 < top <= 1


def test_a_jacobian_that_may_lose_its_rank_has_no_bound():
    assert pseudo_inverse_change(0.1, 0.1) == np.inf


def test_error_bound_holds_for_every_corner_of_the_uncertainty_and_one_joint_reaches_it():
    J, delta = random_jacobian(3, 6, 3), np.array([1, 2, 0.5, 3, 0.1, 1])
    gain = wrench_from_torques(J, np.zeros(6), damped_below=1e-3).gain
    signs = np.array(np.meshgrid(*[[-1, 1]] * 6)).reshape(6, -1)
    assert np.linalg.norm(gain @ (delta[:, None] * signs), axis=0).max() <= largest_error(gain, delta)
    alone = np.array([0, 0, 0, 3.0, 0, 0])
    assert largest_error(gain, alone) == pytest.approx(np.linalg.norm(gain @ alone))


# -- the criterion ------------------------------------------------------------------------------


def run(folder, options, tau, *, q=Q, robot=UR5E, ticks=3, files=None, live=()):
    """Results of the ticks of an arm that stands at q and measures tau."""
    station = made(folder, robot + TOOL + options, files)
    engine = Engine(station.model, driven={"arm": 0.2}, live=live)
    judge, results = Judge(station.bound), []
    for k in range(ticks):
        engine.take(
            [heard("arm", 0.01 * k, q, np.zeros(len(q)), **({} if tau is None else {"tau": tuple(tau)}))]
        )
        state = engine.tick() if k else engine.start()
        results.append(judge(state)[0])
    return results


def held(q=Q, force=FORCE, moment=(0, 0, 0), name="ur5e"):
    """Motor torques of an arm at rest that exerts a force at its tip, by Pinocchio."""
    description = library.load(name)
    model = oracle.pinocchio_model(description)
    J = oracle.jacobian(model, q, description.tip)
    return pin.computeGeneralizedGravity(model, model.createData(), q) + J.T @ np.concatenate([force, moment])


def parts(result):
    return {part.name: part.value for part in result.parts}


def test_pressing_arm_at_rest(tmp_path):
    first, *_, last = run(tmp_path, "", held(), live=["arm"])
    assert first.verdict is Verdict.UNDECIDED
    assert "acceleration" in first.reason
    assert last.value == pytest.approx(130, abs=0.05)
    assert [parts(last)[f"F{a}"] for a in "xyz"] == pytest.approx(FORCE, abs=0.05)
    assert parts(last)["residual"] < 0.05


def test_external_torques_need_no_dynamics(tmp_path):
    tau = held(force=FORCE) - held(force=np.zeros(3))
    first = run(tmp_path, 'torques = "external"\n', tau, ticks=1)[0]
    assert first.value == pytest.approx(130, rel=1e-6)
    assert "moment" not in parts(first)


def test_moment_is_residual_for_a_point_contact_and_found_by_a_grip(tmp_path):
    tau = held(moment=MOMENT) - held(force=np.zeros(3))
    external = 'torques = "external"\nlimit = 1000\n'
    point = run(tmp_path / "a", external, tau, ticks=1)[0]
    grip = run(tmp_path / "b", external + 'contact = "free_moment"\n', tau, ticks=1)[0]
    elsewhere = run(tmp_path / "c", external + "largest_residual = 0.1\n", tau, ticks=1)[0]
    assert parts(point)["residual"] > 0.1
    assert point.verdict is Verdict.WITHIN
    assert grip.value == pytest.approx(130, rel=1e-6)
    assert parts(grip)["moment"] == pytest.approx(np.linalg.norm(MOMENT), rel=1e-6)
    assert elsewhere.verdict is Verdict.UNDECIDED
    assert "elsewhere" in elsewhere.reason
    # Known torques say nothing of a force that is elsewhere, nor that it is beyond a limit.
    known = f"{external}largest_residual = 0.1\ntorque_uncertainty = {[0.1] * 6}\n".replace("1000", "0.1")
    anywhere = run(tmp_path / "f", known, tau, ticks=1)[0]
    assert (anywhere.verdict, anywhere.interval) == (Verdict.UNDECIDED, None)
    residual = parts(point)["residual"]
    on_it = run(tmp_path / "d", f"{external}largest_residual = {residual!r}\n", tau, ticks=1)[0]
    assert on_it.verdict is Verdict.WITHIN
    for k, factor in enumerate((1.0, 1e-3, 0.0)):
        share = parts(run(tmp_path / f"e{k}", external, factor * tau, ticks=1)[0])["residual share"]
        assert share == pytest.approx(residual / np.linalg.norm(tau) if factor else 0.0)


@pytest.mark.parametrize(("limit", "verdict"), [(129.999, Verdict.EXCEEDED), (130.001, Verdict.WITHIN)])
def test_limit_bounds_from_above(tmp_path, limit, verdict):
    tau = held() - held(force=np.zeros(3))
    assert run(tmp_path, f'torques = "external"\nlimit = {limit}\n', tau, ticks=1)[0].verdict is verdict


@pytest.mark.parametrize(
    ("limit", "verdict"), [(60, Verdict.EXCEEDED), (130.5, Verdict.UNDECIDED), (300, Verdict.WITHIN)]
)
def test_uncertain_torques_give_an_interval(tmp_path, limit, verdict):
    tau = held() - held(force=np.zeros(3))
    options = f'torques = "external"\nlimit = {limit}\ntorque_uncertainty = [1, 1, 1, 1, 1, 1]\n'
    result = run(tmp_path, options, tau, ticks=1)[0]
    assert result.verdict is verdict
    low, high = result.interval
    assert low < 130 < high
    assert high - low < 100
    assert ("across the limit" in result.reason) is (verdict is Verdict.UNDECIDED)


def test_no_torques_are_undecided(tmp_path):
    result = run(tmp_path, "limit = 1e6\n", None)[-1]
    assert result.verdict is Verdict.UNDECIDED
    assert "no joint torques" in result.reason


def test_torques_that_are_no_numbers_are_undecided(tmp_path):
    result = run(tmp_path, "limit = 1e6\n", [np.nan] * 6)[-1]
    assert result.verdict is Verdict.UNDECIDED


def test_wrong_number_of_torques_is_named(tmp_path):
    with pytest.raises(InputError, match=r"5 torques.*6 joints"):
        run(tmp_path, "", [1.0] * 5)


@pytest.mark.parametrize(("limit", "verdict"), [(1.0, Verdict.EXCEEDED), (1e6, Verdict.UNDECIDED)])
def test_force_that_the_joints_cannot_feel_is_never_within(tmp_path, limit, verdict):
    # The planar arm feels nothing across its plane.
    robot = FLOATING + TWO_R + 'tool = "tip"\n'
    options = f'torques = "external"\nlimit = {limit}\n'
    files = {"arm.urdf": two_r()}
    q = np.array([0.0, np.pi / 2])
    result = run(tmp_path, options, [10.0, -5.0], q=q, robot=robot, ticks=1, files=files)[0]
    # F = J⁻ᵀ τ: F_x = −τ2, F_y = τ1 − τ2.
    assert [parts(result)[f"F{a}"] for a in "xyz"] == pytest.approx([5, 15, 0])
    assert result.verdict is verdict
    assert "100% of a force along ±(0.00, 0.00, 1.00)" in result.reason


def test_moving_arm_in_the_air_exerts_no_force(tmp_path):
    description = library.load("ur5e")
    model = oracle.pinocchio_model(description)
    model.armature[:] = 0
    station = made(tmp_path, UR5E + TOOL)
    assert not np.any(station.model.mj.dof_armature)
    swing = np.array([0.6, 0.4, -0.5, 0.5, -0.6, 0.8])

    def motion(t):
        s, c = np.sin(2 * t), np.cos(2 * t)
        return Q + swing * s, 2 * swing * c, -4 * swing * s

    engine = Engine(station.model, driven={"arm": 0.2})
    sizes, gross = [], []
    for k in range(60):
        q, qd, qdd = motion(0.01 * k)
        tau = pin.rnea(model, model.createData(), q, qd, qdd)
        engine.take([heard("arm", 0.01 * k, q, qd, tau=tuple(tau.tolist()))])
        state = engine.tick() if k else engine.start()
        result = judged(station.bound, state)[0]
        if k > 2:
            sizes.append(result.value)
            J = oracle.jacobian(model, q, description.tip)[:3]
            gross.append(np.linalg.norm(wrench_from_torques(J, tau, damped_below=0.02).wrench))
    # Acceleration is the mean of the last tick: half a tick late.
    assert max(sizes) < 0.03 * max(gross)


def test_acceleration_never_bridges_a_tick_that_is_undecided(tmp_path):
    station = made(tmp_path, UR5E + TOOL)
    engine = Engine(station.model, driven={"arm": 0.2}, live=["arm"])
    judge, reasons = Judge(station.bound), []
    for k in range(6):
        torques = {} if k == 3 else {"tau": tuple(held())}
        engine.take([heard("arm", 0.01 * k, Q, np.zeros(6), **torques)])
        reasons.append(judge(engine.tick() if k else engine.start())[0].reason)
    assert ["acceleration" in reason for reason in reasons] == [True, False, False, False, True, False]
    assert "no joint torques" in reasons[3]


def test_long_period_cannot_know_an_acceleration(tmp_path):
    """Live; a file says what comes next."""
    options = "every = 0.1\nlimit = 1e6\n"
    last = run(tmp_path / "live", options, held(), ticks=12, live=["arm"])[-1]
    assert last.verdict is Verdict.UNDECIDED
    assert "acceleration" in last.reason
    known = run(tmp_path / "file", options, held(), ticks=12)[-1]
    assert known.value == pytest.approx(130, abs=0.05)


@pytest.mark.parametrize("wrong", ["[1.0]", "[1, 1, 1, 1, 1, 1, 1]"])
def test_uncertainty_that_does_not_fit_is_named(tmp_path, wrong):
    station = made(tmp_path, UR5E + TOOL + f"torque_uncertainty = {wrong}\n")
    with pytest.raises(InputError, match="torque_uncertainty"):
        _ = station.bound


PLANAR = {"robot": TWO_R, "q": np.array([0.0, np.pi / 2]), "files": {"arm.urdf": two_r()}}


def test_units_of_force_moment_and_residual(tmp_path):
    options = 'torques = "external"\ncontact = "free_moment"\n'
    (found,) = run(tmp_path, options, (1.0, 2.0), ticks=1, **PLANAR)
    assert {"": found.unit, **{part.name: part.unit for part in found.parts}} == {
        "": "N", "Fx": "N", "Fy": "N", "Fz": "N", "moment": "N·m", "residual": "N·m", "residual share": "",
    }  # fmt: skip


@pytest.mark.parametrize(("every", "known"), [(0.04, True), (0.05, True), (0.06, False)])
def test_speeds_up_to_50_ms_apart_make_an_acceleration(tmp_path, every, known):
    last = run(tmp_path, f"every = {every}\n", (0.0, 0.0), ticks=14, live=["arm"], **PLANAR)[-1]
    assert (last.value is not None) is known


def test_the_same_instant_twice_makes_no_acceleration(tmp_path):
    station = made(tmp_path, TWO_R + TOOL, PLANAR["files"])
    engine, judge = Engine(station.model, driven={"arm": 0.2}, live=["arm"]), Judge(station.bound)
    engine.take([heard("arm", 0.0, np.zeros(2), np.zeros(2), tau=(0.0, 0.0))])
    state = engine.start()
    for _ in range(2):
        (found,) = judge(state)
        assert found.verdict is Verdict.UNDECIDED
        assert "two evaluations" in found.reason


def test_the_force_is_drawn_where_it_acts(tmp_path):
    """0.3 m beyond the tip at (1, 1), along the second link."""
    options = 'torques = "external"\noffset = [0.3, 0, 0]\n'
    (found,) = run(tmp_path, options, (1.0, 2.0), ticks=1, **PLANAR)
    assert found.markers[0].origin == pytest.approx((1, 1.3, 0), abs=1e-6)


def test_a_moment_that_no_torque_shows_hides_no_force():
    found = wrench_from_torques(np.diag([1.0, 1, 1, 1, 1, 0]), np.ones(6), damped_below=0.02)
    figure = ToolForce(name="f", at="arm", limit=2.0)._figure(found, np.ones(6), None)
    assert (verdict_of(figure, at_most=True), figure.interval) == (Verdict.WITHIN, None)
    assert figure.value == pytest.approx(np.sqrt(3))


def test_a_force_is_no_less_than_nothing():
    """0.1 N, each torque known to ± 1 N·m: up to 3.1 N."""
    tau = np.array([0.1, 0, 0])
    found = wrench_from_torques(np.eye(3), tau, damped_below=0.02)
    for limit, verdict in ((3.11, "within"), (3.09, "undecided")):
        figure = ToolForce(name="f", at="arm", limit=limit)._figure(found, tau, np.ones(3))
        assert figure.interval == pytest.approx((0.0, 3.1))
        assert verdict_of(figure, at_most=True) == verdict


def test_an_uncertainty_that_is_no_number_is_refused_whoever_gives_it(tmp_path):
    model = made(tmp_path, TWO_R, PLANAR["files"]).model
    with pytest.raises(InputError, match="torque_uncertainty"):
        ToolForce(name="f", at="arm", torque_uncertainty=(1.0, np.nan)).bind(model)


def test_masses_that_cannot_be_are_refused_where_torques_hold_them_and_only_there(tmp_path):
    arm = {**PLANAR, "files": {"arm.urdf": two_r(masses=(0.0, 1.0))}}
    with pytest.raises(InputError, match="force needs it"):
        run(tmp_path / "a", "", (1.0, 2.0), **arm)
    (found,) = run(tmp_path / "b", 'torques = "external"\n', (1.0, 2.0), ticks=1, **arm)
    # F = J⁻ᵀ τ: F_x = −τ2, F_y = τ1 − τ2.
    assert found.value == pytest.approx(np.hypot(2.0, 1.0), rel=1e-6)
