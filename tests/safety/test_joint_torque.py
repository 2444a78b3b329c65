"""Joint torques against their limits: gravity of an arm by Pinocchio, and what is put on top of it."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from made_cell import heard, made
from oracles.pinocchio_oracle import pinocchio_model
from seerob.core.errors import InputError
from seerob.core.snapshot import Verdict
from seerob.criteria.safety.joint_torque import shares
from seerob.description.robots import library
from seerob.session.run import Judge
from seerob.twin.engine import Engine

CELL = '[[robots]]\nname = "arm"\nmodel = "library:ur5e"\n[[safety]]\nkind = "joint_torque"\nrobot = "arm"\n'
Q = np.array([0.3, -1.2, 1.3, -0.9, 0.7, 0.2])
LIMITS = np.array([150.0, 150, 150, 28, 28, 28])


def gravity(q=Q):
    model = pinocchio_model(library.load("ur5e"))
    return pin.computeGeneralizedGravity(model, model.createData(), q)


def run(folder, options="", tau=None, *, ticks=3, qd=0.0):
    """The last result of an arm that is heard standing (or turning about its base) with these torques."""
    station = made(folder, CELL + options)
    engine, judge, result = Engine(station.model, driven={"arm": 0.2}), Judge(station.bound), None
    for k in range(ticks):
        said = {} if tau is None else {"tau": tuple(tau)}
        q = Q + np.array([qd * 0.01 * k, 0, 0, 0, 0, 0])
        engine.take([heard("arm", 0.01 * k, q, np.array([qd, 0, 0, 0, 0, 0]), **said)])
        result = judge(engine.tick() if k else engine.start())[0]
    return result


def test_share_of_the_worst_joint_is_the_value(tmp_path):
    tau = gravity() + np.array([0, 0, 0, 5, 0, 0])
    result = run(tmp_path, "", tau)
    assert result.value == pytest.approx(np.abs(tau / LIMITS).max(), rel=1e-12)
    assert result.verdict is Verdict.WITHIN
    by_name = {part.name: part for part in result.parts}
    assert by_name["shoulder_lift_joint"].limit == 150
    assert by_name["residual of wrist_1_joint"].value == pytest.approx(5, abs=2e-3)
    assert abs(by_name["residual of elbow_joint"].value) < 2e-3


@pytest.mark.parametrize(
    ("options", "added", "verdict"),
    [
        ("", 29, Verdict.EXCEEDED),
        ("limit = 0.1\n", 0, Verdict.EXCEEDED),
        ("limits = [330, 330, 150, 56, 56, 56]\n", 29, Verdict.WITHIN),
        ("largest_residual = [5, 5, 5, 2, 2, 2]\n", 1.9, Verdict.WITHIN),
        ("largest_residual = [5, 5, 5, 2, 2, 2]\n", 2.1, Verdict.UNDECIDED),
        ("largest_residual = [5, 5, 5, 2, 2, 2]\n", 29, Verdict.EXCEEDED),
        ("torque_uncertainty = [5, 5, 5, 2, 2, 2]\n", 24, Verdict.WITHIN),
        ("torque_uncertainty = [5, 5, 5, 2, 2, 2]\n", 27, Verdict.UNDECIDED),
        ("torque_uncertainty = [5, 5, 5, 2, 2, 2]\n", 31, Verdict.EXCEEDED),
    ],
)
def test_verdict(tmp_path, options, added, verdict):
    # The last joint holds nothing against gravity.
    assert run(tmp_path, options, gravity() + np.array([0, 0, 0, 0, 0, added])).verdict is verdict


def test_what_the_model_needs_is_never_within_without_what_it_leaves_out(tmp_path):
    assert run(tmp_path, 'torques = "model"\n').verdict is Verdict.UNDECIDED
    given = 'torques = "model"\ntorque_uncertainty = [9, 9, 9, 3, 3, 3]\n'
    result = run(tmp_path, given)
    assert result.verdict is Verdict.WITHIN
    assert result.value == pytest.approx(np.abs(gravity() / LIMITS).max(), rel=1e-3)
    assert run(tmp_path, given + "limit = 0.05\n").verdict is Verdict.EXCEEDED


def test_torques_that_nobody_measures_are_undecided(tmp_path):
    assert run(tmp_path, "").verdict is Verdict.UNDECIDED


def test_a_residual_needs_an_acceleration(tmp_path):
    first = run(tmp_path, "largest_residual = [5, 5, 5, 2, 2, 2]\n", gravity(), ticks=1)
    assert first.verdict is Verdict.UNDECIDED
    assert "two evaluations" in first.reason


def test_a_robot_without_limits_is_undecided(tmp_path):
    cell = CELL.replace("library:ur5e", "library:niryo_one")
    station = made(tmp_path, cell)
    engine = Engine(station.model, driven={"arm": 0.2})
    engine.take([heard("arm", 0.0, np.zeros(6), np.zeros(6), tau=(0.0,) * 6)])
    limits = station.model.robot("arm").effort_limits
    result = Judge(station.bound)(engine.start())[0]
    unknown = any(q is None for q in limits)
    assert result.verdict is (Verdict.UNDECIDED if unknown else Verdict.WITHIN)
    assert unknown


def test_as_many_values_as_joints(tmp_path):
    with pytest.raises(InputError, match=r"limits: .* does not fit"):
        run(tmp_path, "limits = [1, 2]\n", gravity())


def test_shares_of_an_interval_hold_the_truth():
    rng = np.random.default_rng(3)
    tau, limits, off = rng.normal(0, 20, (200, 6)), LIMITS, np.array([5, 5, 5, 1, 1, 1.0])
    share, low, high = shares(tau, limits, off)
    for truth in (tau + rng.uniform(-1, 1, tau.shape) * off for _ in range(20)):
        true = np.abs(truth) / limits
        assert (low <= true + 1e-12).all()
        assert (true <= high + 1e-12).all()
    np.testing.assert_allclose(share, np.abs(tau) / limits)
