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


def run(folder, options="", tau=None, *, ticks=3, qd=0.0, live=()):
    """The last result of an arm that is heard standing (or turning about its base) with these torques."""
    station = made(folder, CELL + options)
    engine, judge, result = Engine(station.model, driven={"arm": 0.2}, live=live), Judge(station.bound), None
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
    assert [part.interval[1] - part.value for part in result.parts] == pytest.approx([9, 9, 9, 3, 3, 3])
    assert run(tmp_path, given + "limit = 0.05\n").verdict is Verdict.EXCEEDED


def test_torques_that_nobody_measures_are_undecided(tmp_path):
    assert run(tmp_path, "").verdict is Verdict.UNDECIDED


RESIDUAL = "largest_residual = [5, 5, 5, 2, 2, 2]\n"


def test_a_residual_needs_an_acceleration(tmp_path):
    """Live, nobody knows it at the first instant; of a file that ends at rest it is none."""
    first = run(tmp_path, RESIDUAL, gravity(), ticks=1, live=["arm"])
    assert first.verdict is Verdict.UNDECIDED
    assert "two evaluations" in first.reason
    assert run(tmp_path, RESIDUAL, gravity(), ticks=1).verdict is Verdict.WITHIN


def recorded(folder, options, tau, end=0.3):
    """Verdict of a whole run over a log of the arm in motion, at 500 Hz, with torques of its state."""
    t = np.arange(0, end, 0.002)
    f, a = 2 * np.pi * np.array([0.3, 0.25, 0.2, 0.4, 0.3, 0.5]), 0.2
    q = Q + a * np.sin(f * t[:, None])
    qd, qdd = a * f * np.cos(f * t[:, None]), -a * f * f * np.sin(f * t[:, None])
    model = pinocchio_model(library.load("ur5e"))
    data = model.createData()
    needed = np.array([pin.rnea(model, data, *x) for x in zip(q, qd, qdd, strict=True)])
    names = [f"actual_{what}_{i}" for what in ("q", "qd", "current_as_torque") for i in range(6)]
    table = np.hstack([t[:, None], q, qd, tau(t, needed)])
    text = "\n".join([" ".join(["timestamp", *names]), *(" ".join(map(repr, row.tolist())) for row in table)])
    source = '[[sources]]\nkind = "ur_record"\nrobot = "arm"\nfile = "log.csv"\n'
    station = made(folder, CELL + options + source, {"log.csv": text})
    return station.run().verdict


MODEL = 'torques = "model"\ntorque_uncertainty = [5, 5, 5, 2, 2, 2]\n'


@pytest.mark.parametrize("options", [RESIDUAL, MODEL])
def test_a_whole_run_can_be_within(tmp_path, options):
    """Its first instant, and what lies between two ticks, are decided too."""
    assert recorded(tmp_path, options, lambda _, needed: needed) is Verdict.WITHIN


def test_what_no_model_explains_between_two_ticks_is_not_within(tmp_path):
    """A push of 20 N·m in one sample, 2 ms from the nearest tick."""

    def pushed(t, needed):
        return needed + (np.abs(t - 0.152) < 1e-6)[:, None] * np.array([20.0, 0, 0, 0, 0, 0])

    assert recorded(tmp_path, RESIDUAL, pushed) is Verdict.UNDECIDED


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
