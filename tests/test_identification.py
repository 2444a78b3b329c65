"""Identification: torques and regressors by Pinocchio, with friction and noise that are known."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import seerob as sr
from oracles.pinocchio_oracle import index_of, pinocchio_model
from seerob.app import cli
from seerob.core.errors import InputError
from seerob.description.robots import library
from seerob.session.identification.identify import Known, identify
from seerob.session.identification.regressor import Regressor, base_parameters
from seerob.session.identification.robot_file import parameters, weighed
from seerob.twin.controller_check import ControllerLog
from test_explanation import motion

GRAVITY = np.array([0, 0, -9.81])
COULOMB, VISCOUS = np.array([6, 6, 5, 2, 2, 1.5]), np.array([8, 8, 6, 2, 2, 1.5])
NOISE = np.array([1, 1, 1, 0.3, 0.3, 0.3])
ROTORS = np.array([1.2, 1.1, 0.8, 0.15, 0.12, 0.1])


def of_pinocchio(model, q, qd, qdd):
    data = model.createData()
    return np.array([pin.computeJointTorqueRegressor(model, data, *x) for x in zip(q, qd, qdd, strict=True)])


def own_parameters(robot):
    """Ten parameters of each moving body about its frame, in the order of `PARAMETERS`."""
    model = pinocchio_model(robot)
    found = []
    for inertia in list(model.inertias)[1:]:
        m, c = inertia.mass, inertia.lever
        about = inertia.inertia + m * (c @ c * np.eye(3) - np.outer(c, c))
        found.append(
            [m, *(m * c), *(about[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)))]
        )
    return np.array(found)


def simulated(seed, n=800, payload=None, noise=1.0, of=motion):
    """A log of a UR5e with rotors: torques by Pinocchio's inverse dynamics."""
    model = pinocchio_model(library.load("ur5e"))
    if payload is not None:
        model.appendBodyToJoint(model.njoints - 1, payload, pin.SE3.Identity())
    data = model.createData()
    t, q, qd, qdd = of(seed, n)
    tau = np.array([pin.rnea(model, data, *x) for x in zip(q, qd, qdd, strict=True)])
    tau = tau + ROTORS * qdd + COULOMB * np.sign(qd) + VISCOUS * qd
    random = np.random.default_rng(seed + 1000).normal(size=q.shape) * NOISE * noise
    return ControllerLog("log.csv", t, q, qd, tau + random, None, True)


@pytest.mark.parametrize("name", ["ur5e", "iiwa14"])
def test_torques_are_pinocchios_and_so_is_the_space_that_motions_tell(name):
    robot = library.load(name)
    model = pinocchio_model(robot)
    rng, n = np.random.default_rng(1), len(robot.joints())
    assert (index_of(model, robot) == np.arange(n)).all()
    q, qd, qdd = rng.normal(0, 1, (3, 30, n))
    regressor = Regressor(robot, GRAVITY)
    Y = regressor(q, qd, qdd)
    data = model.createData()
    tau = np.array([pin.rnea(model, data, *x) for x in zip(q, qd, qdd, strict=True)])
    bodies = 10 * n
    np.testing.assert_allclose(Y[..., :bodies] @ own_parameters(robot).ravel(), tau, atol=1e-9)
    theirs = of_pinocchio(model, q, qd, qdd).reshape(30 * n, -1)
    ours = Y[..., :bodies].reshape(30 * n, -1)
    rank = np.linalg.matrix_rank(theirs, tol=1e-8)
    both = np.linalg.matrix_rank(np.concatenate([ours, theirs], axis=1), tol=1e-8)
    assert np.linalg.matrix_rank(ours, tol=1e-8) == rank == both
    base = base_parameters(regressor)
    links = [c for c in base.columns if c < bodies]
    # With rotors there are as many more as do not merge with a link's moment of inertia about its joint.
    with_rotors = np.linalg.matrix_rank(Y.reshape(30 * n, -1), tol=1e-8)
    assert len(base.columns) == with_rotors
    assert len(links) == rank
    np.testing.assert_allclose(Y[..., list(base.columns)] @ base.regrouped, Y, atol=1e-7)


def test_a_tilted_base_and_a_slide():
    """Gravity from aside, and a prismatic joint, against Pinocchio."""
    from dataclasses import replace

    robot = library.load("ur5e")
    links = list(robot.links)
    for i, link in enumerate(links):
        if link.name == "forearm_link":
            links[i] = replace(
                link, joints=(replace(link.joints[0], kind=link.joints[0].kind.__class__("prismatic")),)
            )
    robot = replace(robot, links=tuple(links))
    model = pinocchio_model(robot)
    gravity = np.array([3.0, -4.0, 8.0])
    model.gravity.linear = gravity
    q, qd, qdd = np.random.default_rng(2).normal(0, 1, (3, 10, 6))
    tau = np.array([pin.rnea(model, model.createData(), *x) for x in zip(q, qd, qdd, strict=True)])
    Y = Regressor(robot, gravity)(q, qd, qdd)
    np.testing.assert_allclose(Y[..., :60] @ own_parameters(robot).ravel(), tau, atol=1e-9)


def test_the_truth_lies_in_95_of_100_intervals_of_base_parameters_and_of_the_mass_matrix():
    robot = library.load("ur5e")
    truth_of_all = np.concatenate([own_parameters(robot).ravel(), ROTORS])
    inside, held, seeds = [], [], range(10)
    for seed in seeds:
        found = identify(robot, GRAVITY, simulated(seed))
        assert found.hidden == ()
        truth = [*(found.base.regrouped @ truth_of_all), *COULOMB, *VISCOUS]
        figures = [*found.values, *found.coulomb, *found.viscous]
        inside += [abs(f.value - x) <= f.half for f, x in zip(figures, truth, strict=True)]
        if seed < 3:
            made = weighed(found, 20.6)
            held.append(_within(robot, made, truth_of_all))
            assert made.distance < 2
            assert made.bodies[:, 0].sum() == pytest.approx(20.6, rel=1e-3)
    assert 0.91 <= np.mean(inside) <= 0.99
    assert sum(held) >= 2


def _within(robot, made, truth):
    """Whether the true mass matrix is between (1 ∓ s) M in postures that were not looked at."""
    regressor = Regressor(robot, GRAVITY)
    q = np.random.default_rng(77).uniform(-np.pi, np.pi, (100, 6))
    every = regressor.mass_matrices(q)
    M = np.einsum("npij,p->nij", every, np.concatenate([made.bodies.ravel(), made.rotors]))
    true = np.einsum("npij,p->nij", every, truth)
    lower, upper = true - (1 - made.error) * M, (1 + made.error) * M - true
    return bool((np.linalg.eigvalsh(lower)[:, 0] > 0).all() and (np.linalg.eigvalsh(upper)[:, 0] > 0).all())


def test_less_noise_leaves_less_error_and_a_poor_motion_none():
    robot = library.load("ur5e")
    loud, quiet = (weighed(identify(robot, GRAVITY, simulated(3, noise=x)), 20.6).error for x in (1.0, 0.05))
    assert quiet < 0.3 * loud

    def slow(seed, n):
        t, q, qd, qdd = motion(seed, n, joints="111111")
        keep = np.zeros(6)
        keep[0] = 1
        return t, q * keep, qd * keep, qdd * keep

    with pytest.raises(InputError, match="never move"):
        identify(robot, GRAVITY, simulated(3, of=slow))


def test_a_payload_is_found_from_a_second_log():
    robot = library.load("ur5e")
    mass, com = 3.0, np.array([0.02, -0.01, 0.09])
    payload = pin.Inertia(mass, com, np.diag([0.01, 0.01, 0.006]))
    inside = []
    for seed in range(4):
        found = identify(robot, GRAVITY, simulated(seed), simulated(seed + 50, payload=payload))
        truth = [mass, *(mass * com)]
        inside += [abs(f.value - x) <= f.half for f, x in zip(found.payload[:4], truth, strict=True)]
        assert found.payload[0].half < 0.3
    assert np.mean(inside) >= 0.8


CONSTANTS = np.array([13.2, 13.2, 9.4, 8.1, 8.0, 7.9])


def in_ampere(said):
    return said._replace(tau=None, current=said.tau / CONSTANTS)


def test_currents_tell_as_much_as_what_makes_torques_of_them():
    """By constants that are off by as much as is said, and by a known mass; alone they tell no mass."""
    robot = library.load("ur5e")
    truth_of_all = np.concatenate([own_parameters(robot).ravel(), ROTORS])
    mass, tolerance = 3.0, 0.01
    payload = pin.Inertia(mass, np.array([0.02, -0.01, 0.09]), np.diag([0.01, 0.01, 0.006]))
    for seed in range(2):
        said = in_ampere(simulated(seed))
        off = np.random.default_rng(seed).choice([-0.05, 0.05], 6)
        stated = Known(constants=tuple(CONSTANTS / (1 + off)), tolerance=0.05)
        each = [identify(robot, GRAVITY, said, None, stated)]
        if seed == 1:
            carrying = in_ampere(simulated(seed + 50, payload=payload))
            weight = Known(payload=mass / (1 + tolerance), tolerance=tolerance)
            each.append(identify(robot, GRAVITY, said, carrying, weight))
        for found in each:
            assert found.hidden == ()
            truth = [*(found.base.regrouped @ truth_of_all), *COULOMB, *VISCOUS, *CONSTANTS]
            figures = [*found.values, *found.coulomb, *found.viscous, *found.constants]
            inside = [abs(f.value - x) <= f.half + 1e-9 for f, x in zip(figures, truth, strict=True)]
            assert np.mean(inside) >= 0.88
            assert found.constants[1].half < 0.1 * CONSTANTS[1]
    for known, more in ((Known(), None), (Known(), carrying), (weight, None)):
        with pytest.raises(InputError, match="common factor"):
            identify(robot, GRAVITY, said, more, known)
    with pytest.raises(InputError, match="5 torque constants for 6 joints"):
        identify(robot, GRAVITY, said, None, Known(constants=(1.0,) * 5))
    with pytest.raises(InputError, match="measured already"):
        identify(robot, GRAVITY, simulated(0), None, stated)
    said, feather = (in_ampere(simulated(k, n=200)) for k in (1, 60))
    with pytest.raises(InputError, match="does not show in them"):
        identify(robot, GRAVITY, said, feather, Known(payload=0.5))


def test_every_set_of_logarithms_is_a_body():
    theta = np.random.default_rng(4).normal(0, 1, (200, 10))
    for m, hx, hy, hz, xx, yy, zz, xy, xz, yz in parameters(theta):
        c = np.array([hx, hy, hz]) / m
        about = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) - m * (
            c @ c * np.eye(3) - np.outer(c, c)
        )
        a, b, largest = np.linalg.eigvalsh(about)
        assert m > 0
        assert a > 0
        assert a + b > largest


CELL = """[[robots]]
name = "arm"
model = "library:ur5e"
q = [0, 0, 0, 0, 0, 0]
"""
SOURCE = """
[[sources]]
kind = "csv"
robot = "arm"
file = "log.csv"
"""
ENERGY = """
[[safety]]
kind = "kinetic_energy"
robot = "arm"
limit = 1000
"""


def test_keys_for_a_cell_hold_the_true_energy_between_their_ends(tmp_path, capsys):
    """From a log in RTDE's columns to masses, rotors and tolerances that kinetic_energy uses."""
    said = simulated(5, noise=0.02)
    columns = ("actual_q", "actual_qd", "actual_current_as_torque")
    head = ["timestamp", *(f"{what}_{i}" for what in columns for i in range(6))]
    rows = np.column_stack([said.t, said.q, said.qd, said.tau])
    bare, made = tmp_path / "bare", tmp_path / "made"
    for folder in (bare, made):
        folder.mkdir()
        np.savetxt(folder / "log.csv", rows, header=" ".join(head), comments="", fmt="%.9f")
    source = SOURCE.replace('kind = "csv"', 'kind = "ur_record"')
    (bare / "workstation.toml").write_text(CELL + source)
    command = ["robots", "identify", str(bare), "-o", str(tmp_path / "arm.toml")]
    assert cli.main(command) == 3
    assert "--mass" in "".join(capsys.readouterr())
    assert cli.main([*command, "--mass", "20.6", "--mass-source", "data sheet, page 1"]) == 0
    out = capsys.readouterr().out
    assert "never told" in out
    assert "Coulomb" in out
    table = (tmp_path / "arm.toml").read_text()
    (made / "workstation.toml").write_text(CELL + table + source + ENERGY)
    run = sr.load(made).run()
    worst = run.results["kinetic energy arm"].worst()
    assert worst is not None
    low, high = worst.interval
    loud = np.column_stack([said.t, said.q, said.qd, simulated(5).tau])
    np.savetxt(bare / "log.csv", loud, header=" ".join(head), comments="", fmt="%.9f")
    other = ["robots", "identify", str(bare), "-o", str(tmp_path / "other.toml")]
    assert cli.main([*other, "--mass", "20.6", "--mass-source", "x"]) == 3
    assert "leaves the mass matrix open" in "".join(capsys.readouterr())
    amperes = np.column_stack([said.t, said.q, said.qd, said.tau / CONSTANTS])
    fields = " ".join(head).replace("actual_current_as_torque", "actual_current")
    np.savetxt(bare / "log.csv", amperes, header=fields, comments="", fmt="%.9f")
    assert cli.main(command[:3]) == 3
    assert "--constants" in "".join(capsys.readouterr())
    constants = ["--constants", ",".join(map(str, CONSTANTS)), "--tolerance", "0.01"]
    assert cli.main([*command[:3], *constants]) == 3
    assert "--known-by" in "".join(capsys.readouterr())
    assert cli.main([*command[:3], *constants, "--known-by", "test bench"]) == 0
    assert "13.2 ± 0.13 N·m/A, by test bench" in capsys.readouterr().out
    model = pinocchio_model(library.load("ur5e"))
    i = int(np.abs(said.t - said.t[0] - worst.t).argmin())
    data = model.createData()
    true = [
        pin.computeKineticEnergy(model, data, said.q[k], said.qd[k]) + 0.5 * float(ROTORS @ said.qd[k] ** 2)
        for k in (max(i - 1, 0), i, min(i + 1, len(said.t) - 1))
    ]
    assert low < max(true)
    assert min(true) < high
    assert worst.value == pytest.approx(true[1], rel=0.1)
    assert 0 < high - low < worst.value
    assert cli.main([*command, "--mass", "20.6", "--mass-source", "x"]) == 3
