import numpy as np
import pytest
from msgspec.structs import replace

from seerob.core.errors import InputError
from seerob.files.trajectories.checks import (
    Beyond,
    larger_velocities,
    limit_check,
    sampling_findings,
    velocity_check,
)
from seerob.files.trajectories.trajectory import Trajectory, derive_velocities
from seerob.workstation.source import Target

TARGET = Target(
    name="ur10",
    joints=("pan", "lift"),
    units=("rad", "rad"),
    lower=(-3.0, -2.0),
    upper=(3.0, 2.0),
    velocity=(2.0, 2.0),
)
T = np.linspace(0, 4, 401)
Q = np.column_stack([np.sin(T), 0.5 * np.sin(2 * T)])
QD = np.column_stack([np.cos(T), np.cos(2 * T)])


def made(q=Q, qd=None, t=T):
    return Trajectory(file="a.csv", t=t, q=q, qd=qd, rows=np.arange(2, len(t) + 2))


def test_a_motion_within_limits_passes_without_findings():
    assert limit_check(made(qd=QD), TARGET) == ()
    assert velocity_check(made(qd=QD), TARGET) == ()


def test_another_number_of_joints_is_refused_with_both_counts():
    with pytest.raises(InputError, match=r"2 joints, but 'iiwa' has 7"):
        limit_check(made(), Target(
            name="iiwa", joints=tuple("abcdefg"), units=("rad",) * 7,
            lower=(-3.0,) * 7, upper=(3.0,) * 7, velocity=(None,) * 7,
        ))  # fmt: skip


def test_a_position_beyond_a_limit_names_joint_instant_value_limit_and_row():
    q = Q.copy()
    q[100, 1] = -2.5
    with pytest.raises(InputError) as error:
        limit_check(made(q), TARGET)
    for word in ("'lift'", "1.000 s", "-2.5 rad", "-2 rad", "row 102", 'beyond_limits = "report"'):
        assert word in str(error.value)
    findings = limit_check(made(q), TARGET, beyond=Beyond.REPORT)
    assert any("'lift'" in f.text and f.level == "warning" and "-2.5" in f.text for f in findings)


def test_every_joint_beyond_its_limit_is_named_at_once():
    with pytest.raises(InputError) as error:
        limit_check(made(Q * 10), TARGET)
    assert len(error.value.problems) == 2


def test_the_rounding_of_a_printed_limit_is_not_beyond_it():
    q = np.zeros_like(Q)
    q[:, 0] = 3.0 + 5e-7
    assert limit_check(made(q), TARGET) == ()


def test_speed_beyond_a_limit_is_found_at_its_instant_even_when_velocities_hide_it():
    fast = np.column_stack([1.4 * np.exp(-T) * np.sin(2 * T), np.zeros_like(T)])
    hidden = np.zeros_like(fast)
    for motion in (made(fast), made(fast, hidden)):
        (finding,) = limit_check(motion, TARGET)
        assert "'pan' reaches 2.7" in finding.text
        assert "at 0.000 s" in finding.text
        assert "limit 2 rad/s" in finding.text


def test_unknown_limits_are_said():
    unknown = replace(TARGET, velocity=(2.0, None), lower=(-3.0, -np.inf), upper=(3.0, np.inf))
    texts = " ".join(f.text for f in limit_check(made(), unknown))
    assert "no speed limit is known for lift" in texts
    assert "no position limit is known for lift" in texts


def test_an_angle_folded_into_one_turn_is_not_taken_for_a_motion():
    wide = replace(TARGET, lower=(-10.0,) * 2, upper=(10.0,) * 2)
    q = np.column_stack([(T + np.pi) % (2 * np.pi) - np.pi, np.zeros_like(T)])
    with pytest.raises(InputError, match="folded into one turn"):
        limit_check(made(q), wide)
    assert all("folded" not in f.text for f in limit_check(made(np.unwrap(q, axis=0)), wide))


@pytest.mark.parametrize(
    ("factor", "words"),
    [
        (180 / np.pi, "deg/s read as rad/s"),
        (np.pi / 180, "rad/s read as deg/s"),
        (1000, "mm/s read as m/s"),
        (1e-3, "off by 1000"),
        (0.5, "off by a factor: positions move at 2 ×"),
        (-1, "opposite sign"),
        (0, "is zero while the joint moves"),
    ],
)
def test_a_velocity_column_that_is_not_the_derivative_is_refused(factor, words):
    with pytest.raises(InputError) as error:
        velocity_check(made(qd=factor * QD), TARGET)
    assert words in str(error.value)
    assert 'velocities = "derive"' in str(error.value)


def test_velocities_of_another_joint_are_refused():
    with pytest.raises(InputError, match="does not follow"):
        velocity_check(made(qd=QD[:, ::-1]), TARGET)


def test_a_single_flattered_peak_is_a_warning_with_its_instant():
    qd = QD.copy()
    qd[300:303, 0] = 0
    (finding,) = velocity_check(made(qd=qd), TARGET)
    assert finding.level == "warning"
    assert "3.0" in finding.text


@pytest.mark.parametrize("period", [0.002, 0.05, 0.2])
def test_noise_quantisation_and_coarse_sampling_are_not_mistakes(period):
    rng = np.random.default_rng(1)
    t = np.arange(0, 6, period)
    q = np.column_stack([np.sin(t), np.full_like(t, 0.3)])
    qd = np.column_stack([np.cos(t), np.zeros_like(t)])
    noisy = np.round(q + rng.normal(0, 2e-5, q.shape), 6)
    assert velocity_check(made(noisy, np.round(qd + rng.normal(0, 1e-3, qd.shape), 6), t), TARGET) == ()


@pytest.mark.parametrize("factor", [0.9, 0.97, 1.1])
def test_columns_that_are_a_little_off_are_said_and_the_faster_of_both_counts(factor):
    motion = made(qd=factor * QD)
    derived = derive_velocities(motion.t, motion.q).qd
    qd, findings = larger_velocities(motion, TARGET, derived)
    assert [f"{factor - 1:+.1%}" in f.text for f in findings] == [True] * len(findings)
    assert findings
    np.testing.assert_array_equal(np.abs(qd) >= np.abs(motion.qd), True)
    assert np.abs(qd).max() == pytest.approx(max(1.0, factor) * np.abs(QD).max(), rel=1e-3)
    right, none = larger_velocities(made(qd=QD), TARGET, derived)
    assert none == ()
    np.testing.assert_array_equal(right, QD)


def test_gaps_beyond_the_timeout_and_odd_sampling_are_said():
    t = T.copy()
    t[200:] += 0.7
    (gap,) = sampling_findings(made(t=t), "ur10", 0.2)
    assert "gap of 0.71 s after 1.990 s" in gap.text
    assert "time unit" in sampling_findings(made(t=T * 1000), "ur10", 1e9)[0].text
    assert sampling_findings(made(), "ur10", 0.2) == ()


def test_rows_that_the_file_calls_invalid_are_not_judged():
    q, qd = Q.copy(), QD.copy()
    q[200:220], qd[200:220] = 50.0, -30.0
    invalid = np.zeros(len(T), bool)
    invalid[200:220] = True
    motion = Trajectory(file="a.csv", t=T, q=q, qd=qd, invalid=invalid)
    assert limit_check(motion, TARGET) == ()
    assert velocity_check(motion, TARGET) == ()
    assert (
        velocity_check(Trajectory(file="a.csv", t=T, q=q, qd=qd, invalid=np.ones(len(T), bool)), TARGET) == ()
    )
    with pytest.raises(InputError, match="its limit"):
        limit_check(Trajectory(file="a.csv", t=T, q=q, qd=qd), TARGET)


@pytest.mark.parametrize(
    ("q", "degrees", "doubtful"),
    [
        (np.radians(0.3 * Q), True, True),
        (np.radians(3 * Q), True, True),
        (np.radians(Q) + np.radians([90.0, 0.0]), True, False),
        (np.radians(30 * Q), True, False),
        (np.radians(1e-3 * Q), True, False),
        (0.3 * Q, False, False),
    ],
)
def test_degrees_that_look_like_radians_are_doubted(q, degrees, doubtful):
    motion = Trajectory(file="a.csv", t=T, q=q, degrees=degrees)
    texts = [f.text for f in limit_check(motion, TARGET) if f.level == "warning"]
    span = np.ptp(np.degrees(q), axis=0).max()
    wanted = [f"the whole motion spans {span:.2g}°: is the column in radians?"] if doubtful else []
    assert [t[t.index("the whole") :] for t in texts] == wanted


def test_a_clock_that_does_not_start_at_zero_is_said():
    (finding,) = sampling_findings(made(t=T + 5), "ur10", 0.2)
    assert finding.level == "note"
    assert "starts at 5.000 s on its own clock; shifted to 0" in finding.text
    assert sampling_findings(made(t=T + 1e-4), "ur10", 0.2) == ()
