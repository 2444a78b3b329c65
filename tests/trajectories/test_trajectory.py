import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from seerob.core.errors import InputError
from seerob.core.motion_origin import MotionOrigin, origin_finding
from seerob.core.samples import Quality
from seerob.files.trajectories.trajectory import (
    QUIET,
    Trajectory,
    TrajectorySamples,
    derive_velocities,
    derived_noise,
    handed_on,
)


def made(**changes):
    t = np.arange(5) * 0.1
    return Trajectory(**{"file": "a.csv", "t": t, "q": np.outer(t, [1.0, 2.0]), **changes})


def test_samples_start_at_zero_keep_the_device_time_and_can_be_iterated_twice():
    motion = made(t=np.arange(5) * 0.1 + 4029.5, invalid=np.array([0, 0, 1, 0, 0], bool))
    samples = TrajectorySamples(motion, "excel ur10", "ur10", None)
    first = list(samples)
    assert first == list(samples)
    assert [s.t for s in first] == pytest.approx([0, 0.1, 0.2, 0.3, 0.4], abs=1e-9)
    assert [s.t_device for s in first] == motion.t.tolist()
    assert [s.seq for s in first] == list(range(5))
    assert [s.quality for s in first].count(Quality.INVALID) == 1
    assert first[2].quality is Quality.INVALID


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"t": np.array([0, 0.1, 0.1, 0.2, 0.3])}, ["repeats", "0.1 s", "sample 2"]),
        ({"t": np.array([0, 0.1, 0.05, 0.2, 0.3])}, ["goes back", "0.05 s after 0.1 s"]),
        ({"t": np.array([0, 0.1, np.nan, 0.2, 0.3])}, ["time is nan", "sample 2"]),
        ({"qd": np.zeros((5, 3))}, ["qd", "(5, 3)", "(5, 2)"]),
        ({"t": np.arange(5) * 1e13}, ["sample 1", "1e+13 s", "time unit"]),
        ({"t": np.array([-1e308, 0, 1, 2, 1e308])}, ["sample 0", "beyond 1e+12 s (2 such"]),
        ({"q": np.array([[0, 0], [0, -1e200], [0, 0], [0, 0], [2e6, 0]])}, ["q[1] is -1e+200", "2 such"]),
        ({"q": np.zeros((5, 2)), "tcp_wxyz": np.full((5, 4), 1e200)}, ["tcp_wxyz[0] is 1e+200"]),
        ({"qd": np.full((5, 2), np.inf)}, ["qd[0] is inf", "10 such"]),
        ({"tcp_wxyz": np.zeros((5, 3))}, ["tcp_wxyz"]),
        ({"t": np.zeros(1), "q": np.zeros((1, 2))}, ["1 sample;", "at least 2"]),
        ({"t": np.zeros(0), "q": np.zeros((0, 2))}, ["0 samples;"]),
        ({"q": np.zeros((5, 0))}, ["not a table"]),
    ],
)
def test_what_is_no_trajectory_is_refused_with_place_and_value(changes, words):
    with pytest.raises(InputError) as error:
        made(**changes)
    for word in words:
        assert word in str(error.value)


def test_places_name_sheet_row_and_column():
    motion = made(rows=np.arange(10, 15), sheet="Joints")
    assert motion.place(2, "J1") == "sheet 'Joints' row 12 column 'J1'"


@given(
    st.lists(st.floats(0.001, 1.0), min_size=3, max_size=30),
    st.tuples(st.floats(-3, 3), st.floats(-3, 3), st.floats(-3, 3)),
)
def test_derived_velocities_are_exact_for_parabolas_at_any_spacing(steps, c):
    t = np.concatenate([[0], np.cumsum(steps)])
    q = (c[0] + c[1] * t + c[2] * t**2)[:, None]
    np.testing.assert_allclose(derive_velocities(t, q).qd[:, 0], c[1] + 2 * c[2] * t, atol=1e-7)


def test_error_of_derived_velocities_is_estimated_within_a_factor_of_two():
    t = np.linspace(0, 6, 301)
    derived = derive_velocities(t, np.sin(3 * t)[:, None])
    # At interior points; the one-sided ends are worse and are not estimated.
    true = np.abs(derived.qd[2:-2, 0] - 3 * np.cos(3 * t)[2:-2]).max()
    assert derived.error is not None
    assert true / 2 < derived.error < true * 2


def test_two_samples_give_the_slope_and_no_error_estimate():
    derived = derive_velocities(np.array([0.0, 2.0]), np.array([[0.0], [1.0]]))
    np.testing.assert_array_equal(derived.qd, [[0.5], [0.5]])
    assert derived.error is None


@pytest.mark.parametrize("origin", MotionOrigin)
def test_all_but_the_controller_and_recordings_are_preliminary(origin):
    finding = origin_finding(origin, "ur10", "a.csv")
    preliminary = origin not in (MotionOrigin.CONTROLLER, MotionOrigin.RECORDING)
    assert ("preliminary" in finding.text) == preliminary
    assert (finding.level == "assumed") == preliminary


def test_beside_a_gap_velocities_are_as_good_as_at_the_ends():
    """A gap of 15 rows; central differences across it would be off by 2.5 %."""
    h, omega = 0.02, 5.0
    t = h * np.array([*range(11), *range(25, 36)])
    found = derive_velocities(t, np.sin(omega * t)[:, None]).qd[:, 0]
    # The one-sided difference is off by h² q⃛ / 3, the central one by h² q⃛ / 6.
    bound = np.full(len(t), 1 / 6)
    bound[[0, 10, 11, -1]] = 1 / 3
    assert (np.abs(found - omega * np.cos(omega * t)) <= 1.1 * bound * h**2 * omega**3).all()


@pytest.mark.parametrize("lost", ["none", "one row", "an invalid row", "every fifth", "even instants"])
def test_noise_of_a_log_is_told_whatever_it_lacks(lost):
    """Of a swing: no less than of the whole log, and errors are within it."""
    rng = np.random.default_rng(3)

    def told(lost):
        t, known = 0.008 * np.arange(600), np.ones(600, bool)
        if lost == "even instants":
            t = t + rng.uniform(-2e-3, 2e-3, len(t))
        t = t[(np.arange(len(t)) != 300) | (lost != "one row")]
        t = t[rng.random(len(t)) < 0.8] if lost == "every fifth" else t
        known = np.arange(len(t)) != (300 if lost == "an invalid row" else -1)
        q = 0.3 * np.sin(1.5 * t) + 1e-4 * rng.standard_normal(len(t))
        error = derived_noise(t, q[:, None], known) * handed_on(t, known)
        off = np.abs(derive_velocities(t, q[:, None], known=known).qd[:, 0] - 0.45 * np.cos(1.5 * t))
        assert np.mean((off <= error)[known]) > 0.99
        return float(np.median(error))

    assert told(lost) > 0.9 * told("none")


def test_uneven_instants_of_a_smooth_motion_are_no_noise():
    t = np.cumsum(np.random.default_rng(1).uniform(0.004, 0.012, 400))
    q = 0.3 * np.sin(1.5 * t)[:, None]
    assert (derived_noise(t, q) * handed_on(t)).max() < QUIET
