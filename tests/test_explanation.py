"""Whether the model explains a log: torques by Pinocchio, with payload, friction and noise that are known."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from oracles.pinocchio_oracle import pinocchio_model
from seerob.app import cli
from seerob.app.commands.explain import sentence
from seerob.core.errors import InputError
from seerob.description.robots import library
from seerob.session.explanation import NORMAL_95, SLOW, Dynamics, explain, fit, friction, slopes, wider
from seerob.session.station import load
from seerob.twin.controller_check import ControllerLog

CELL = '[[robots]]\nname = "arm"\nmodel = "library:ur5e"\nq = [0, 0, 0, 0, 0, 0]\n'
MASS, COM, INERTIA = 2.0, np.array([0.03, -0.02, 0.08]), np.array([0.004, 0.005, 0.003])
COULOMB, VISCOUS = np.array([6, 6, 5, 2, 2, 1.5]), np.array([8, 8, 6, 2, 2, 1.5])
NOISE = np.array([1, 1, 1, 0.3, 0.3, 0.3])
TRUTH = np.array([MASS, *COM, *COULOMB, *VISCOUS])


@cache
def cell() -> tuple:
    import tempfile

    folder = Path(tempfile.mkdtemp())
    (folder / "workstation.toml").write_text(CELL)
    model = load(folder).model
    return model, Dynamics(model, model.robot("arm"))


def motion(seed: int, n: int, joints: str = "111111", since: float = 0.0) -> tuple[np.ndarray, ...]:
    """t, q, q̇ and q̈ of three sines per joint, 125 Hz, so much earlier [s]; joints that are 0 stand."""
    rng = np.random.default_rng(seed)
    t = 0.008 * np.arange(n) - since
    f = 2 * np.pi * rng.uniform(0.1, 0.5, (6, 3))
    a = 0.7 * rng.uniform(0.3, 1, (6, 3)) / f * np.array([float(c) for c in joints])[:, None]
    angle = t[:, None, None] * f + rng.uniform(0, 2 * np.pi, (6, 3))
    q = np.array([0, -1.3, 1.4, -1.2, -1.5, 0.3]) + (a * np.sin(angle)).sum(-1)
    return t, q, (a * f * np.cos(angle)).sum(-1), -(a * f * f * np.sin(angle)).sum(-1)


def needed(q: np.ndarray, qd: np.ndarray, qdd: np.ndarray, mass: float = MASS) -> np.ndarray:
    """Torques of the arm with the payload, by Pinocchio."""
    model = pinocchio_model(library.load("ur5e"))
    flange = model.frames[model.getFrameId("tool0", pin.FrameType.BODY)]
    payload = pin.Inertia(mass, COM, np.diag(INERTIA))
    if mass:
        model.appendBodyToJoint(flange.parentJoint, payload, flange.placement)
    data = model.createData()
    return np.array([pin.rnea(model, data, *x) for x in zip(q, qd, qdd, strict=True)])


def said(seed: int, n: int = 400, mass: float = MASS, joints: str = "111111") -> ControllerLog:
    t, q, qd, qdd = motion(seed, n, joints)
    noise = np.random.default_rng(seed + 1000).normal(size=q.shape) * NOISE
    tau = needed(q, qd, qdd, mass) + COULOMB * np.sign(qd) + VISCOUS * qd + noise
    return ControllerLog("log.csv", t, q, qd, tau, None, True)


def figures(found) -> list:
    return [found.payload, *found.com, *(j.coulomb for j in found.joints), *(j.viscous for j in found.joints)]


def test_torques_and_those_of_a_payload_are_pinocchios() -> None:
    _, q, qd, qdd = motion(3, 20)
    without, columns = cell()[1](q, qd, qdd)
    np.testing.assert_allclose(without, needed(q, qd, qdd, 0.0), atol=1e-9)
    second = 0.5 * np.trace(np.diag(INERTIA)) * np.eye(3) - np.diag(INERTIA) + MASS * np.outer(COM, COM)
    payload = [MASS, *(MASS * COM), *second[np.triu_indices(3)]]
    np.testing.assert_allclose(without + columns @ payload, needed(q, qd, qdd), atol=1e-9)


def test_a_payload_that_the_file_does_not_have_is_found() -> None:
    found = explain(cell()[0], "arm", said(0))
    assert found.explains is False
    assert found.unexplained == ()
    for figure, truth in zip(figures(found), TRUTH, strict=True):
        assert abs(figure.value - truth) <= 2 * figure.half
    assert found.payload.half < 0.15
    assert found.joints[0].left == pytest.approx(1.0, rel=0.2)


def test_the_model_explains_the_log_of_its_own_robot() -> None:
    found = explain(cell()[0], "arm", said(1, 500, mass=0.0))
    assert found.explains is True
    assert abs(found.payload.value) <= found.slack


def _moved(t: np.ndarray, by: np.ndarray, qd: np.ndarray) -> dict[str, np.ndarray]:
    """Torques that a model of the right mass and any friction does not explain."""
    return {
        "another centre of mass": t + by @ np.array([0, 0.5, 0, 0, 0, 0, 0, 0, 0, 0]),
        "another centre of mass along the axis": t + by @ np.array([0, 0, 0, 1.0, 0, 0, 0, 0, 0, 0]),
        "another inertia": t + by @ np.array([0, 0, 0, 0, 5.0, 0, 0, 5.0, 0, 5.0]),
        "friction that drives": t - 2 * (COULOMB * np.sign(qd) + VISCOUS * qd),
        "an offset": t + np.array([0, 60.0, 0, 0, 0, 0]),
    }


@pytest.mark.parametrize(
    "what",
    [
        "another centre of mass",
        "another centre of mass along the axis",
        "another inertia",
        "friction that drives",
        "an offset",
    ],
)
def test_the_mass_alone_explains_no_log(what) -> None:
    words = said(1, 500, mass=0.0)
    _, q, qd, qdd = motion(1, 500)
    _, columns = cell()[1](q, qd, qdd)
    found = explain(cell()[0], "arm", words._replace(tau=_moved(words.tau, columns, qd)[what]))
    assert found.explains is False
    assert found.unexplained == ()
    assert abs(found.payload.value) <= found.slack
    assert ("centres of mass" in sentence(found)) is not bool(found.driven)


def test_the_truth_lies_in_95_of_100_intervals() -> None:
    """Many noises on one motion; white, and such that neighbours are alike."""
    from scipy.signal import lfilter

    _, q, qd, qdd = motion(5, 1000)
    without, columns = cell()[1](q, qd, qdd)
    both = np.concatenate([columns, friction(qd)], axis=-1)
    clean = needed(q, qd, qdd) - without + COULOMB * np.sign(qd) + VISCOUS * qd
    used = np.abs(qd) > SLOW["rad"]
    truth = np.array([MASS, *(MASS * COM), *COULOMB, *VISCOUS])
    asked = [0, 1, 2, 3, *range(10, 22)]
    rng = np.random.default_rng(6)
    for alike in (0.0, 0.7):
        inside = []
        for _ in range(20):
            noise = rng.normal(size=q.shape)
            noise = lfilter([np.sqrt(1 - alike**2)], [1, -alike], noise, axis=0)
            found = fit(both, clean + noise * NOISE, used)
            half = NORMAL_95 * np.sqrt(np.diag(found.covariance))
            assert found.determined[asked].all()
            inside.append(np.abs(found.values[asked] - truth) <= half[asked])
        assert 0.93 <= np.mean(inside) <= 0.99, alike


def test_errors_that_are_much_alike_do_not_make_a_payload_surer_than_it_is() -> None:
    """400 samples of 2 motions: 28 smooth columns make residuals look less alike than errors are."""
    from scipy.signal import lfilter

    alike, inside = 0.95, []
    for seed in (5, 6):
        _, q, qd, qdd = motion(seed, 400)
        without, columns = cell()[1](q, qd, qdd)
        both = np.concatenate([columns, friction(qd)], axis=-1)
        clean = needed(q, qd, qdd) - without + COULOMB * np.sign(qd) + VISCOUS * qd
        rng = np.random.default_rng(seed)
        for _ in range(10):
            noise = rng.normal(size=(600, 6))
            noise = lfilter([np.sqrt(1 - alike**2)], [1, -alike], noise, axis=0)[200:]
            found = fit(both, clean + noise * NOISE, np.abs(qd) > SLOW["rad"])
            half = NORMAL_95 * np.sqrt(np.diag(found.covariance))
            inside.append(np.abs(found.values - [MASS, *(MASS * COM), *np.zeros(24)])[:4] <= half[:4])
    assert np.mean(inside) >= 0.93


def test_torques_that_come_late_do_not_make_a_payload_surer_than_it_is() -> None:
    """By one sample of 125 Hz, and by two and a half, as a filter of a controller makes it."""
    for late in (0.008, 0.02):
        inside = []
        for seed in range(6):
            there = said(seed, 1000)
            # As said says, of a motion that was earlier: three sines are known at any instant.
            then = motion(seed, 1000, since=late)[1:]
            noise = np.random.default_rng(seed + 1000).normal(size=then[0].shape) * NOISE
            tau = needed(*then) + COULOMB * np.sign(then[1]) + VISCOUS * then[1] + noise
            found = explain(cell()[0], "arm", there._replace(tau=tau))
            assert abs(found.delay.value - late) <= 1.5 * found.delay.half < 0.006
            inside += [
                abs(figure.value - truth) <= figure.half
                for figure, truth in zip(figures(found), TRUTH, strict=True)
                if figure.determined
            ]
        assert np.mean(inside) >= 0.88, late


def test_few_rows_make_wide_intervals() -> None:
    """Student's distribution, by SciPy."""
    from scipy.stats import t as student

    for freedom in (4, 5, 10, 30, 1000):
        assert wider(freedom) * NORMAL_95 == pytest.approx(student.ppf(0.975, freedom), rel=0.02)
    assert wider(1.0) * NORMAL_95 == pytest.approx(student.ppf(0.975, 1), rel=1e-4)
    assert wider(-3.0) == wider(3.9) == wider(1.0)


def test_what_a_motion_does_not_tell_is_not_told() -> None:
    # About the vertical axis of the base nothing is lifted: the weight of a payload does not show.
    found = explain(cell()[0], "arm", said(2, joints="100000"))
    assert found.explains is not True
    assert not found.payload.determined
    assert not any(figure.determined for figure in found.com)
    assert [joint.moves for joint in found.joints] == [True] + [False] * 5
    assert found.joints[0].coulomb.determined


def test_a_log_of_another_arm_is_not_explained() -> None:
    words = said(4)
    assert words.tau is not None
    found = explain(cell()[0], "arm", words._replace(tau=-words.tau))
    assert found.explains is False


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (lambda s: s._replace(tau=None), "measures none"),
        (lambda s: s._replace(q=s.q[:1].repeat(len(s.t), 0), qd=0 * s.q), "moves in 0 of"),
        (
            lambda s: ControllerLog(s.file, s.t[:5], s.q[:5], s.qd[:5], s.tau[:5], None, True),
            "5 valid samples",
        ),
    ],
)
def test_too_little_is_refused(words, why) -> None:
    with pytest.raises(InputError, match=why):
        explain(cell()[0], "arm", words(said(0, 40)))


def test_slopes_of_a_parabola_are_exact_inside() -> None:
    t = np.arange(50) * 0.01
    values = np.column_stack([3 * t, 1 + t**2])
    found = slopes(t, values, 0.02)
    np.testing.assert_allclose(found[:, 0], 3, rtol=1e-9)
    np.testing.assert_allclose(found[2:-2, 1], 2 * t[2:-2], atol=1e-9)
    odd = np.sort(np.random.default_rng(1).uniform(0, 1, 40))
    np.testing.assert_allclose(slopes(odd, odd[:, None] * 5 + 2, 1e-9)[:, 0], 5, rtol=1e-6)


TOOL = """
[[tools]]
name = "load"
on = "arm/tool0"
shape = { box = [0.2, 0.2, 0.2] }
mass = 2.0
com = [0.03, -0.02, 0.08]
inertia = [0.004, 0.005, 0.003, 0, 0, 0]
"""


def test_on_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = said(7, 400)
    assert words.tau is not None
    names = [
        f"{what}_{i}" for what in ("actual_q", "actual_qd", "actual_current_as_torque") for i in range(6)
    ]
    table = np.hstack([words.t[:, None], words.q, words.qd, words.tau])
    np.savetxt(tmp_path / "log.csv", table, header=" ".join(["timestamp", *names]), comments="", fmt="%.9g")
    source = '[[sources]]\nkind = "ur_record"\nrobot = "arm"\nfile = "log.csv"\n'
    codes = []
    for tool in ("", TOOL):
        (tmp_path / "workstation.toml").write_text(CELL + tool + source)
        codes.append(cli.main(["explain", str(tmp_path), "--json"]))
        (found,) = json.loads(capsys.readouterr().out)
        missing = 0.0 if tool else MASS
        assert abs(found["payload [kg]"]["value"] - missing) <= 2 * found["payload [kg]"]["half"]
        assert found["carried [kg]"] == MASS - missing
    assert codes == [1, 0]
    assert cli.main(["explain", str(tmp_path)]) == 0
    assert "the model of the file and friction explain the log" in capsys.readouterr().out
