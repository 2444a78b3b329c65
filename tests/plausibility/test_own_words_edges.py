"""Each threshold of what a source says of itself, on both sides."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from made_cell import FLOATING, TWO_R, heard, made, two_r
from seerob.core.transforms import transform
from seerob.twin.own_words import (
    LiveWords,
    SaidTool,
    _bias,
    _differ,
    _past,
    _Ways,
    bound,
    fixed_offset,
    other_speed,
    sign_or_unit,
)


def test_the_largest_distance_that_is_left_decides() -> None:
    """One place of four that is 40 mm off: what fits best leaves 30 mm there, and 10 mm at the others."""
    turned, places = np.eye(3)[None].repeat(4, 0), np.zeros((4, 3))
    said = np.array([[0, 0, 0.1]] * 3 + [[0, 0, 0.14]])
    fit = fixed_offset(turned, places, said)
    np.testing.assert_allclose(fit.offset, [0, 0, 0.11], atol=1e-12)
    assert fit.error == pytest.approx(0.03)


@pytest.mark.parametrize(
    ("said", "twin", "samples", "told"),
    [
        (1.0, 1.269, 9, False),  # 0.02 m/s and a fifth of the larger: 0.2738
        (1.0, 1.280, 9, True),  # 0.276
        (1.280, 1.0, 9, True),
        (0.0, 0.0249, 9, False),  # both stand
        (0.0, 0.049, 9, False),
        (0.0, 0.0505, 9, True),
        (0.0, 1.0, 4, False),
        (0.0, 1.0, 5, True),
    ],
)
def test_speeds_of_one_motion(said: float, twin: float, samples: int, told: bool) -> None:
    why = other_speed(np.full(samples, said), np.full(samples, twin))
    assert bool(why) is told
    if told:
        assert f"moves at {said:.3g} m/s, the twin's at {twin:.3g} m/s (means over {samples}" in why


def test_speeds_that_are_seen_for_a_while_only() -> None:
    """Five samples of many in which it moves tell; what stands is in no mean."""
    said, twin = np.zeros(50), np.zeros(50)
    twin[:5] = 0.2
    assert "means over 5 samples" in other_speed(said, twin)
    twin[4] = 0.0
    assert other_speed(said, twin) == ""


def test_torques_too_small_beside_friction_tell_no_sign() -> None:
    """Up to 2 N·m, root mean square over samples of the length over joints."""
    for size, told in ((1.99, False), (2.0, True), (2.05, True)):
        model = np.array([[size, 0.0], [0.0, size], [size, 0.0]])
        assert bool(sign_or_unit(-model, model)) is told
    assert sign_or_unit(np.zeros((3, 2)), np.full((3, 2), 9.0)) == ""


@pytest.mark.parametrize(
    ("factor", "told"), [(-1.0, True), (-0.35, True), (-0.32, False), (-2.9, True), (0.0, False)]
)
def test_torques_of_the_opposite_sign_are_told_from_half(factor: float, told: bool) -> None:
    """|1 + f| < |f − 1| / 2 between −3 and −1/3."""
    model = np.array([[10.0, -4.0], [8.0, 3.0], [-9.0, 1.0]])
    why = sign_or_unit(factor * model, model)
    assert bool(why) is told
    if factor == -1.0:
        apart = 2 * np.linalg.norm(model) / np.sqrt(3)
        assert f"they add up to 0 N·m, and differ from them by {apart:.3g} N·m" in why


@pytest.mark.parametrize(
    ("factor", "name"),
    [
        (1000.0, "N·mm"), (1390.0, "N·mm"), (1410.0, ""), (610.0, "N·mm"), (590.0, ""),
        (1e-3, "kN·m"), (1.39e-3, "kN·m"), (1.41e-3, ""), (0.61e-3, "kN·m"), (0.59e-3, ""),
        (100.0, "N·cm"), (139.0, "N·cm"), (141.0, ""), (61.0, "N·cm"), (59.0, ""), (1.0, ""), (1.3, ""),
    ],
)  # fmt: skip
def test_units_of_torques(factor: float, name: str) -> None:
    model = np.array([[10.0, -4.0], [8.0, 3.0], [-9.0, 1.0]])
    why = sign_or_unit(factor * model, model)
    assert (f"{factor:.3g} × what the model needs: {name} read as N·m" in why) if name else why == ""


@pytest.mark.parametrize(("angle", "told"), [(24.0, True), (27.0, False)])
def test_a_unit_is_told_of_torques_that_are_alike(angle: float, told: bool) -> None:
    """From a correlation of 0.9 on: cos 25.84°."""
    model = np.array([[10.0, 0.0]])
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    assert bool(sign_or_unit(1e4 * np.array([[c, s]]), model)) is told


# -- where a planar arm has its tool centre point, and how fast it is there -------------------------


@pytest.fixture
def tool(tmp_path) -> SaidTool:
    station = made(tmp_path, FLOATING + TWO_R, {"arm.urdf": two_r()})
    found = bound(station.model, "arm")
    assert found is not None
    tip = {"tool": np.array([0.0, 0.2, 0.0])}
    return SaidTool(found.arm, tip, found.bases, found.tolerance)


def test_a_place_in_another_frame_is_turned_and_shifted(tool: SaidTool) -> None:
    """0.2 m beside the tip, said in a frame at (3, 1, 0) of the root that is a quarter turn about z off."""
    base = transform(np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]), np.array([3.0, 1.0, 0.0]))
    tool = SaidTool(tool.arm, tool.tips, np.array([np.eye(4), base]), tool.tolerance)
    q = np.array([[0.3, 0.4], [-0.5, 1.0], [1.0, -0.2]])
    a, b = q[:, 0], q.sum(axis=1)
    tip = np.stack(
        [np.cos(a) + np.cos(b) - 0.2 * np.sin(b), np.sin(a) + np.sin(b) + 0.2 * np.cos(b), 0 * a], 1
    )
    said = (tip - base[:3, 3]) @ base[:3, :3]
    off, name, frame = tool.off(tool.arm.posture(q), said)
    assert (name, frame) == ("tool", 1)
    np.testing.assert_allclose(off, 0.0, atol=1e-12)
    # Of several frames the one whose farthest place is nearest: not the one that is right once.
    near = np.vstack([said[:2], tip[2:]])
    off, _, frame = tool.off(tool.arm.posture(q), near)
    each = [np.linalg.norm(near @ m[:3, :3].T + m[:3, 3] - tip, axis=1).max() for m in tool.bases]
    assert off.max() == pytest.approx(min(each))
    assert frame == int(np.argmin(each))


def test_the_speed_beside_the_tip_is_that_of_the_closed_form(tool: SaidTool) -> None:
    q, qd = np.array([[0.3, 0.4], [-0.5, 1.0]]), np.array([[0.7, -1.1], [0.2, 0.9]])
    a, b = q[:, 0], q.sum(axis=1)
    wa, wb = qd[:, 0], qd.sum(axis=1)
    x = -wa * np.sin(a) - wb * (np.sin(b) + 0.2 * np.cos(b))
    y = wa * np.cos(a) + wb * (np.cos(b) - 0.2 * np.sin(b))
    np.testing.assert_allclose(tool.speeds(tool.arm.posture(q), qd), [np.hypot(x, y)], atol=1e-12)


@pytest.mark.parametrize(
    ("said", "twins", "told"),
    [
        # 0.02 m/s over 0.5 s, a fifth of the longer way, and 30 ms of 2 m/s.
        (1.0, (0.74, 0.0), ""),
        (1.0, (0.72, 0.0), "went 1000 mm in 0.5 s, the twin's 720 mm"),
        (0.74, (1.0, 9.0), ""),
        (0.72, (1.0, 9.0), "went 720 mm in 0.5 s, the twin's 1000 mm"),
        (0.70, (9.0, 1.0), "the twin's 1000 mm"),
        (0.0, (0.0, 9.0), ""),
    ],
)
def test_ways_of_one_motion(said: float, twins: tuple[float, float], told: str) -> None:
    """Of several points where the tool centre point may be, the nearest counts."""
    before, ways = np.array([0.3, 0.4, 0.5]), np.array([said, *twins])
    speeds = np.full(3, 2.0)
    then, now = _Ways(4.0, speeds, before), _Ways(4.5, speeds, before + ways)
    why = _differ(_past([then]), now)
    assert told in why if told else why == ""
    slow = np.zeros(3)
    then, now = _Ways(4.0, slow, before), _Ways(4.5, slow, before + ways)
    assert bool(_differ(_past([then]), now)) is (
        min(abs(w - said) - 0.2 * max(w, said) for w in twins) > 0.01
    )
    # What either of both speeds was at one end may lag, not at both.
    for a, b in ((speeds, slow), (slow, speeds)):
        assert bool(_differ(_past([_Ways(4.0, a, before)]), _Ways(4.5, b, before + ways))) is bool(told)


def test_ways_begin_anew_after_half_a_second_and_of_one_instant_nothing_follows(tmp_path) -> None:
    """Of a tip at 2 m/s that is said to stand."""
    words = LiveWords(made(tmp_path, FLOATING + TWO_R, {"arm.urdf": two_r()}).model, "arm")

    def told(t: float, speed: float = 0.0) -> str:
        return words.invalid_reason(heard("arm", t, (0.0, 0.0), (1.0, 0.0), tcp_speed=speed))

    assert told(1.0) == ""
    assert "went 0 mm in 0.25 s, the twin's 500 mm" in told(1.25)
    assert told(1.75) == ""
    assert "went 0 mm in 0.25 s" in told(2.0)
    assert told(2.0) == ""
    assert "is no number" in told(2.1, float("nan"))
    assert told(2.15) == ""


DOWN = "engine = { gravity = [0, -9.81, 0] }\n"


@pytest.mark.parametrize(
    ("engine", "q", "qd", "torques"),
    [
        (DOWN, (0.0, 0.0), None, (29.43, 9.81)),  # of 1 kg at 1 and at 2 m
        (FLOATING, (0.0, np.pi / 2), (3.0, 2.0), (-16.0, 9.0)),  # q̇₂(2q̇₁ + q̇₂) and q̇₁²
    ],
)
def test_live_torques_are_judged_from_five_on_where_masses_are_known(
    tmp_path, engine, q, qd, torques
) -> None:
    """Of the opposite sign; looked at every 0.1 s."""
    known = two_r()
    unknown = known[: known.index("<inertial>")] + known[known.index("</inertial>") + len("</inertial>") :]
    for name, urdf, told in (("known", known, True), ("unknown", unknown, False)):
        words = LiveWords(made(tmp_path / name, engine + TWO_R, {"arm.urdf": urdf}).model, "arm")
        for k in range(6):
            tau = tuple(-t for t in torques)
            assert words.invalid_reason(heard("arm", 0.11 * k, q, qd, tau=tau)) == ""
            assert ("the opposite sign" in words.torque_doubt) is (told and k >= 4), k
        right = LiveWords(made(tmp_path / name, engine + TWO_R, {"arm.urdf": urdf}).model, "arm")
        for k in range(6):
            right.invalid_reason(heard("arm", 0.11 * k, q, qd, tau=torques))
        assert right.torque_doubt == ""


def test_a_speed_that_is_a_third_low_shows_over_half_a_second_only(tmp_path) -> None:
    """At 125 Hz, of a tip at 2 m/s: less than a fifth, 10 mm and 30 ms of the way it seems until then."""
    words = LiveWords(made(tmp_path, FLOATING + TWO_R, {"arm.urdf": two_r()}).model, "arm")
    told = [
        words.invalid_reason(heard("arm", k / 125, (0.0, 0.0), (1.0, 0.0), tcp_speed=1.3)) for k in range(63)
    ]
    assert told[20] == ""
    assert "its own tool centre point went" in told[-1]


def test_torques_of_a_joint_that_follows_another_with_an_offset(tmp_path) -> None:
    """Both at once: 1 kg at the ends of both links, whose second is turned by 0.3 + 0.5 rad more."""
    urdf = two_r(mimic='<mimic joint="j1" multiplier="1" offset="0.5"/>')
    model = made(tmp_path, DOWN + TWO_R, {"arm.urdf": urdf}).model
    found = _bias(model, mujoco.MjData(model.mj), model.mechanisms["arm"], np.array([0.3]), None)
    expected = 9.81 * (2 * np.cos(0.3) + np.cos(1.1) + np.cos(1.1))
    np.testing.assert_allclose(found, [expected], rtol=1e-9)
