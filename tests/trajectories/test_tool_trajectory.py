import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from seerob.core.errors import InputError
from seerob.core.transforms import transform
from seerob.files.trajectories.tool_trajectory import PoseSamples, ToolTrajectory, plausible

RNG = np.random.default_rng(3)


def made(n=20, period=0.01, **changes):
    t = np.arange(n) * period
    position = np.column_stack([np.sin(t), np.cos(t), t])
    wxyz = Rotation.from_rotvec(np.column_stack([t, 2 * t, -t])).as_quat(scalar_first=True)
    given = {"file": "a.csv", "t": t, "position": position, "wxyz": wxyz, "rows": np.arange(n) + 2} | changes
    return ToolTrajectory(**given)


def refused(**changes):
    with pytest.raises(InputError) as error:
        plausible(made(**changes))
    return str(error.value)


def changed(array, row, value):
    array = array.copy()
    array[row] = value
    return array


def test_the_sign_of_a_quaternion_is_no_motion():
    good = made()
    signs = RNG.choice([-1.0, 1.0], len(good.t))
    signs[0] = 1.0
    mixed = made(wxyz=good.wxyz * signs[:, None])
    np.testing.assert_array_equal(mixed.wxyz, good.wxyz)
    plausible(mixed)


def test_turns_are_the_angles_of_an_independent_library_to_the_last_digits():
    rotations = Rotation.random(200, rng=RNG)
    steps = Rotation.from_rotvec(np.geomspace(1e-9, 3.1, 199)[:, None] * [0.6, 0, 0.8])
    chain = [rotations[0]]
    for step in steps:
        chain.append(chain[-1] * step)
    wxyz = np.array([r.as_quat(scalar_first=True) for r in chain])
    path = made(200, wxyz=wxyz)
    np.testing.assert_allclose(path.turns(), np.geomspace(1e-9, 3.1, 199), rtol=1e-9, atol=1e-15)


def test_a_path_seen_from_another_frame_is_the_product_of_matrices():
    path = made()
    a_from_b = transform(Rotation.random(rng=RNG).as_matrix(), RNG.normal(size=3))
    seen = path.seen_from(a_from_b)
    for i in range(len(path.t)):
        b_from_tool = transform(
            Rotation.from_quat(path.wxyz[i], scalar_first=True).as_matrix(), path.position[i]
        )
        a_from_tool = transform(
            Rotation.from_quat(seen.wxyz[i], scalar_first=True).as_matrix(), seen.position[i]
        )
        np.testing.assert_allclose(a_from_tool, a_from_b @ b_from_tool, atol=1e-14)
    np.testing.assert_allclose(seen.speeds(), path.speeds(), atol=1e-12)
    np.testing.assert_allclose(seen.turns(), path.turns(), atol=1e-14)


def test_every_mistake_is_named_with_its_row():
    good = made()
    assert "row 7: time repeats" in refused(t=changed(good.t, 5, good.t[4]))
    assert "row 7: time goes back" in refused(t=changed(good.t, 5, good.t[3]))
    assert "row 9: position[1] is nan" in refused(position=changed(good.position, (7, 1), np.nan))
    assert "row 9: wxyz[2] is inf" in refused(wxyz=changed(good.wxyz, (7, 2), np.inf))
    assert "row 9: position[1] is 1e+300, beyond 1e+06" in refused(
        position=changed(good.position, (7, 1), 1e300)
    )
    assert "row 9: wxyz[2] is -1e+300" in refused(wxyz=changed(good.wxyz, (7, 2), -1e300))
    assert "row 5: quaternion of length 1.01, not 1" in refused(
        wxyz=changed(good.wxyz, 3, 1.01 * good.wxyz[3])
    )
    assert "at least 2" in refused(n=1)
    assert "shape (20, 3) where (20, 4)" in refused(wxyz=good.position)


def test_a_quaternion_that_was_only_rounded_comes_out_exact():
    good = made()
    rounded = made(wxyz=np.round(good.wxyz, 4))
    np.testing.assert_allclose(np.linalg.norm(rounded.wxyz, axis=1), 1, atol=1e-15)
    np.testing.assert_allclose(rounded.wxyz, good.wxyz, atol=2e-4)


def test_a_tool_that_moves_as_none_does_is_refused_with_its_row_and_speed():
    good = made()
    text = refused(position=1000 * good.position)
    speed = np.linalg.norm(1000 * (good.position[1] - good.position[0])) / 0.01
    assert f"row 3: the tool moves at {speed:.4g} m/s" in text
    assert "19 such rows" in text
    assert "tcp_position_unit" in text
    plausible(made(position=7.0 * good.position))


def test_a_jump_of_the_orientation_is_refused_and_dense_noise_is_not():
    good = made()
    turned = Rotation.from_quat(good.wxyz, scalar_first=True) * Rotation.from_rotvec([0, 0, 0.5])
    text = refused(wxyz=np.vstack([good.wxyz[:10], turned.as_quat(scalar_first=True)[10:]]))
    assert "row 12: the orientation jumps by" in text
    assert "1 such rows" in text
    about_x = np.column_stack([np.cos(RNG.normal(0, 0.02, 20)), np.zeros((20, 3))])
    about_x[:, 1] = np.sqrt(1 - about_x[:, 0] ** 2)
    plausible(made(period=1e-3, wxyz=about_x))
    half = np.array([[1.0, 0, 0, 0], [0, 1.0, 0, 0]] * 10)
    assert "jumps by 180 deg in 10 s" in refused(period=10.0, wxyz=half)


def test_samples_start_at_zero_and_can_be_heard_again():
    path = made(t=made().t + 4.5)
    samples = PoseSamples(path, "s", "ur10/tool0")
    first, again = list(samples), list(samples)
    assert first == again
    assert len(samples) == len(first)
    np.testing.assert_allclose([s.t for s in first], path.t - 4.5)
    np.testing.assert_array_equal([s.t_device for s in first], path.t)
    np.testing.assert_array_equal([s.wxyz for s in first], path.wxyz)
    np.testing.assert_array_equal([s.position for s in first], path.position)
    assert [s.seq for s in first] == list(range(20))
