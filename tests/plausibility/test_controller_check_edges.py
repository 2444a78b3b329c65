"""Each threshold of what a source says of itself, on both sides."""

from __future__ import annotations

import math

import mujoco
import numpy as np
import pytest

from made_cell import FLOATING, TWO_R, heard, made, person, two_r
from seerob.core.samples import Quality
from seerob.core.transforms import transform
from seerob.files.trajectories.trajectory import Trajectory, TrajectorySamples
from seerob.twin.controller_check import (
    ControllerCheck,
    ControllerLog,
    ControllerTool,
    _bias,
    _differ,
    _past,
    _Ways,
    bound,
    compared,
    controller_log,
    fixed_offset,
    heavier,
    other_speed,
    rigid_error,
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
        (600.0, ""), (60.0, ""),
    ],
)  # fmt: skip
def test_units_of_torques(factor: float, name: str) -> None:
    model = np.array([[10.0, -4.0], [8.0, 3.0], [-9.0, 1.0]])
    why = sign_or_unit(factor * model, model)
    assert (f"{factor:.3g} × what the model needs: {name} read as N·m" in why) if name else why == ""


def test_at_exactly_the_thresholds_torques_are_those_of_the_model() -> None:
    """A third of the opposite, and a correlation of 0.9: 9 of (9, 3, 3, 1), whose length is 10."""
    assert sign_or_unit(np.array([[-3.0]]), np.array([[9.0]])) == ""
    assert sign_or_unit(1000 * np.array([[9.0, 3, 3, 1]]), np.array([[10.0, 0, 0, 0]])) == ""


@pytest.mark.parametrize(("angle", "told"), [(24.0, True), (27.0, False)])
def test_a_unit_is_told_of_torques_that_are_alike(angle: float, told: bool) -> None:
    """From a correlation of 0.9 on: cos 25.84°."""
    model = np.array([[10.0, 0.0]])
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    assert bool(sign_or_unit(1e4 * np.array([[c, s]]), model)) is told


# -- where a planar arm has its tool centre point, and how fast it is there -------------------------


@pytest.fixture
def tool(tmp_path) -> ControllerTool:
    station = made(tmp_path, FLOATING + TWO_R, {"arm.urdf": two_r()})
    found = bound(station.model, "arm")
    assert found is not None
    tip = {"tool": np.array([0.0, 0.2, 0.0])}
    return ControllerTool(found.arm, tip, found.bases, found.tolerance)


def test_a_place_in_another_frame_is_turned_and_shifted(tool: ControllerTool) -> None:
    """0.2 m beside the tip, said in a frame at (3, 1, 0) of the root that is a quarter turn about z off."""
    base = transform(np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]), np.array([3.0, 1.0, 0.0]))
    tool = ControllerTool(tool.arm, tool.tips, np.array([np.eye(4), base]), tool.tolerance)
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


def test_the_speed_beside_the_tip_is_that_of_the_closed_form(tool: ControllerTool) -> None:
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
    words = ControllerCheck(made(tmp_path, FLOATING + TWO_R, {"arm.urdf": two_r()}).model, "arm")

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
        words = ControllerCheck(made(tmp_path / name, engine + TWO_R, {"arm.urdf": urdf}).model, "arm")
        for k in range(12):  # every second of which is looked at
            tau = tuple(-t for t in torques)
            assert words.invalid_reason(heard("arm", 0.0625 * k, q, qd, tau=tau)) == ""
            assert ("the opposite sign" in words.invalid_torque_reason) is (told and k >= 8), k
        right = ControllerCheck(made(tmp_path / name, engine + TWO_R, {"arm.urdf": urdf}).model, "arm")
        for k in range(6):
            right.invalid_reason(heard("arm", 0.11 * k, q, qd, tau=torques))
        assert right.invalid_torque_reason == ""


def test_a_speed_that_is_a_third_low_shows_over_half_a_second_only(tmp_path) -> None:
    """At 125 Hz, of a tip at 2 m/s: less than a fifth, 10 mm and 30 ms of the way it seems until then."""
    words = ControllerCheck(made(tmp_path, FLOATING + TWO_R, {"arm.urdf": two_r()}).model, "arm")
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


@pytest.mark.parametrize(("twin", "most"), [(0.0, 0.15), (1.0, 1.15), (1.5, 1.65), (5.0, 5.5), (20.0, 22.0)])
def test_a_controller_may_have_a_tenth_or_150_grams_more_at_its_flange_than_the_twin(
    twin: float, most: float
) -> None:
    assert heavier(most - 1e-6, twin) == heavier(0.0, twin) == ""
    assert f"has {most + 0.01:.4g} kg at its flange, and the twin carries {twin:.4g} kg" in heavier(
        most + 0.01, twin
    )
    assert heavier(0.15, 0.0) == ""
    assert heavier(22.0, 20.0) == ""


def test_at_exactly_the_thresholds_speeds_are_of_one_motion() -> None:
    """Of binary fractions and of what a float makes of a fifth."""
    a = next(a for a in np.arange(0.5, 2.0, 1e-3) if a - (a - (0.02 + 0.2 * a)) == 0.02 + 0.2 * a)
    assert other_speed(np.full(8, a), np.full(8, a - (0.02 + 0.2 * a))) == ""
    assert other_speed(np.full(8, a), np.full(8, a - (0.021 + 0.2 * a))) != ""
    assert other_speed(np.zeros(9), np.full(9, 0.05)) == ""
    # Too fast and too slow do not cancel.
    assert other_speed(np.tile([0.5, 1.5], 5), np.ones(10)) != ""


def test_points_are_laid_on_others_as_one_rigid_body() -> None:
    """Turned and shifted nothing is left; of a mirror image, and of one place that is off, something is."""
    rng = np.random.default_rng(2)
    a = rng.normal(size=(7, 3)) + np.array([5.0, -3.0, 2.0])
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    b = a @ turn.T + [1.0, 2.0, 3.0]
    assert rigid_error(a, b) == pytest.approx(0.0, abs=1e-12)
    assert rigid_error(a, b * [1, 1, -1]) > 0.5
    flat = np.array([[0.0, 0, 0], [1, 0, 0], [0, 2, 0], [1, 2, 0]])
    # The tallest side is longer by 0.2 m: at both of its ends a tenth, at the others, too.
    assert rigid_error(flat, flat * [1.0, 1.1, 1.0]) == pytest.approx(0.1)
    off = b.copy()
    off[3] += [0.0, 0.0, 0.7]
    assert 0.3 < rigid_error(a, off) < 0.7


def log(samples: int = 4, **words: object) -> TrajectorySamples:
    """Rows of a file from 2 s on, of which the second is invalid."""
    t = 2.0 + 0.1 * np.arange(samples)
    q = np.stack([np.arange(samples), -np.arange(samples)], axis=1).astype(float)
    motion = Trajectory(file="log.csv", t=t, q=q, **words)
    return TrajectorySamples(motion, "s", "arm", qd=10 * q)


WORDS = {
    "tau": np.arange(8.0).reshape(4, 2),
    "tcp_position": np.arange(12.0).reshape(4, 3),
    "tcp_speed": np.arange(4.0),
}


@pytest.mark.parametrize("which", [*WORDS, ""])
@pytest.mark.parametrize("invalid", [None, np.array([False, True, False, False])])
def test_of_a_file_its_valid_rows_are_compared(which: str, invalid: np.ndarray | None) -> None:
    words = {which: WORDS[which]} if which else {}
    said = controller_log(log(**words, invalid=invalid, tcp_in_base=True), "log.csv")
    if not which:
        assert said is None
        return
    rows = [0, 1, 2, 3] if invalid is None else [0, 2, 3]
    assert said is not None
    np.testing.assert_allclose(said.t, 0.1 * np.array(rows))
    np.testing.assert_array_equal(said.q[:, 0], rows)
    np.testing.assert_array_equal(said.qd, 10 * said.q)
    for name, field in (("tau", "tau"), ("tcp_position", "tcp"), ("tcp_speed", "tcp_speed")):
        found = getattr(said, field)
        if name == which:
            np.testing.assert_array_equal(found, WORDS[name][rows])
        else:
            assert found is None
    assert said.frame_known
    assert controller_log(log(**words, invalid=np.ones(4, bool)), "log.csv") is None
    heard_of = np.array([True, True, False, True])
    now_and_then = controller_log(log(**words, invalid=invalid, tcp_said=heard_of), "log.csv")
    assert now_and_then is not None
    if now_and_then.tcp is not None:
        np.testing.assert_array_equal(np.isfinite(now_and_then.tcp), heard_of[rows, None].repeat(3, 1))


@pytest.mark.parametrize("which", ["tau", "tcp", "tcp_speed", ""])
def test_of_samples_one_by_one_the_good_ones_are_compared(which: str) -> None:
    words = {"tau": (1.0, 2.0), "tcp": (0.1, 0.2, 0.3), "tcp_speed": 0.4}
    word = {which: words[which]} if which else {}
    qualities = (Quality.GOOD, Quality.DEGRADED, Quality.GOOD)
    samples = [
        heard("arm", 0.1 * k, (0.0, float(k)), (1.0, 2.0), quality=quality, **word)
        for k, quality in enumerate(qualities)
    ]
    said = controller_log(samples, "its stream")
    if not which:
        assert said is None
        assert controller_log([], "its stream") is None
        return
    assert said is not None
    np.testing.assert_allclose(said.t, [0.0, 0.2])
    np.testing.assert_array_equal(said.q, [[0.0, 0.0], [0.0, 2.0]])
    np.testing.assert_array_equal(said.qd, [[1.0, 2.0]] * 2)
    for field in words:
        found = getattr(said, field)
        if field == which:
            np.testing.assert_array_equal(found, [words[which]] * 2)
        else:
            assert found is None or np.isnan(found).all()
    assert said.frame_known
    # A place that one of them does not say is compared in the others; torques are those of all or none.
    partly = controller_log([*samples, heard("arm", 0.3, (0.0, 3.0))], "its stream")
    assert partly is not None
    assert partly.qd is None
    told = getattr(partly, which)
    assert (told is None) if which == "tau" else np.isnan(told[2]).all() and not np.isnan(told[:2]).any()
    bad = [heard("arm", 0.0, (0.0, 0.0), quality=Quality.DEGRADED, **word)]
    assert controller_log(bad, "its stream") is None


def test_of_a_long_file_rows_are_looked_at_evenly() -> None:
    t = np.arange(10.0)
    said = ControllerLog("f", t, t[:, None], None, t[:, None], None, True, t)
    for most, rows in (
        (10, range(10)),
        (20, range(10)),
        (9, range(0, 10, 2)),
        (5, range(0, 10, 2)),
        (4, range(0, 10, 3)),
    ):
        thin = said.thinned(most)
        for part in (thin.t, thin.q[:, 0], thin.tau[:, 0], thin.tcp_speed):
            np.testing.assert_array_equal(part, [*rows])
        assert (thin.qd, thin.tcp) == (None, None)
    # Of those alone in which all of it is said.
    tcp = np.zeros((10, 3))
    tcp[:6, 0], tcp[9, 2] = math.nan, math.inf
    np.testing.assert_array_equal(said.thinned(2, tcp).t, [6, 8])


def told_by(folder, text: str = "", **words: object) -> list[str]:
    """What is found of a planar arm whose source says something of itself."""
    model = made(folder, DOWN + TWO_R + text, {"arm.urdf": two_r()}).model
    t = np.arange(8.0)
    q = np.stack([0.3 + 0.2 * t, 0.1 * t], axis=1)
    a, b = q[:, 0], q.sum(axis=1)
    tip = np.stack([np.cos(a) + np.cos(b), np.sin(a) + np.sin(b), 0 * a], 1)
    qd = np.tile([0.2, 0.1], (8, 1))
    speed = np.hypot(0.2 * np.sin(a) + 0.3 * np.sin(b), 0.2 * np.cos(a) + 0.3 * np.cos(b))
    weight = 9.81 * np.stack([2 * np.cos(a) + np.cos(b), np.cos(b)], axis=1)
    said = ControllerLog("f", t, q, qd, None, None, True)
    for name, of in words.items():
        said = said._replace(**{name: of({"tcp": tip, "tcp_speed": speed, "tau": weight, "qd": qd}[name])})
    return [f.text for f in compared(model, "arm", said)]


def test_each_word_that_a_file_says_is_compared_by_itself(tmp_path) -> None:
    twice, same = (lambda x: 2 * x), (lambda x: x)
    assert told_by(tmp_path) == []
    (right,) = told_by(tmp_path, tcp=same)
    assert right == "f: its own tool centre point is where the twin has its flange, to 0.0 mm"
    (wrong,) = told_by(
        tmp_path, tcp=lambda x: np.where(np.arange(8)[:, None] == 5, x + np.array([0, 0, 0.05]), x)
    )
    assert "50 mm from its flange in the twin at 5.000 s, more than 10 mm" in wrong
    assert told_by(tmp_path, tcp_speed=same) == []
    (wrong,) = told_by(tmp_path, tcp_speed=twice)
    assert "its own tool centre point moves at" in wrong
    assert told_by(tmp_path, tcp_speed=twice, qd=lambda _: None) == []
    assert told_by(tmp_path, tau=same) == []
    (wrong,) = told_by(tmp_path, tau=lambda x: -x)
    assert "the opposite sign" in wrong
    # Without speeds gravity alone is compared.
    assert told_by(tmp_path, tau=same, qd=lambda _: None) == []
    (wrong,) = told_by(tmp_path, tau=lambda x: -x, qd=lambda _: None)
    assert "the opposite sign" in wrong
    assert len(told_by(tmp_path, tcp=same, tcp_speed=twice, tau=lambda x: -x)) == 3


@pytest.mark.parametrize(("off", "told"), [(0.0099, False), (0.0101, True)])
def test_a_tool_centre_point_may_be_ten_millimetres_off(tmp_path, off: float, told: bool) -> None:
    (found,) = told_by(tmp_path, tcp=lambda x: x + np.array([0, 0, off]))
    assert ("more than 10 mm" in found) is told


def test_who_is_no_robot_says_nothing(tmp_path) -> None:
    model = made(tmp_path, FLOATING + TWO_R + person("op", 3, 0, 0), {"arm.urdf": two_r()}).model
    words = ControllerLog(
        "f",
        np.zeros(9),
        np.zeros((9, 2)),
        np.ones((9, 2)),
        -np.ones((9, 2)),
        np.ones((9, 3)),
        True,
        np.ones(9),
    )
    assert [*compared(model, "op", words)] == []
    assert bound(model, "op") is None
    words = ControllerCheck(model, "op")
    assert words.invalid_reason(heard("op", 0.0, (0.0,), (0.0,), tcp_speed=9.0)) == ""


def test_live_words_are_looked_at_ten_times_a_second_and_place_and_speed_by_themselves(tmp_path) -> None:
    """A stretched arm whose source has its tool 50 mm beside the tip, and then says which tool would fit."""
    model = made(tmp_path, FLOATING + TWO_R, {"arm.urdf": two_r()}).model
    words, found = ControllerCheck(model, "arm"), []
    for k in range(12):
        a = 0.05 * k
        place = (2 * np.cos(a) - 0.05 * np.sin(a), 2 * np.sin(a) + 0.05 * np.cos(a), 0.0)
        found.append(words.invalid_reason(heard("arm", 0.05 * k, (a, 0.0), (1.0, 0.0), tcp=place)))
        assert "50 mm from the twin's, more than 10 mm (tcp_tolerance)" in found[-1]
    # Every second one is kept: five at 0.4 s, of which the flange has turned by 0.4 rad.
    fits = ["a tool centre point at [0, 50, 0] mm" in why for why in found]
    assert fits == [k >= 8 for k in range(12)]
    assert all("another robot, tool or calibration" in why for why in found[:8])
    right = ControllerCheck(model, "arm")
    assert right.invalid_reason(heard("arm", 0.0, (0.0, 0.0), (1.0, 0.0), tcp=(2.0, 0.0, 0.0))) == ""
    assert right.invalid_reason(heard("arm", 0.1, (0.0, 0.0), (1.0, 0.0), tcp=(2.0, 0.0099, 0.0))) == ""
    assert right.invalid_reason(heard("arm", 0.2, (0.0, 0.0), (1.0, 0.0), tcp=(2.0, 0.0101, 0.0))) != ""
    assert right.invalid_reason(heard("arm", 0.3, (0.0, 0.0), (1.0, 0.0))) == ""
    wide = TWO_R + "tcp_tolerance_mm = 125\n"
    words = ControllerCheck(made(tmp_path, FLOATING + wide, {"arm.urdf": two_r()}).model, "arm")
    for off, told in ((0.125, False), (0.126, True)):
        found = words.invalid_reason(heard("arm", 0.0, (0.0, 0.0), (1.0, 0.0), tcp=(2.0, off, 0.0)))
        assert bool(found) is told


@pytest.mark.parametrize(
    ("turned", "off", "fits"), [(0.13, 0.0, False), (0.15, 0.0, True), (0.5, 0.03, False)]
)
def test_a_tool_is_told_of_a_flange_that_turned_and_of_places_that_fit(
    tmp_path, turned: float, off: float, fits: bool
) -> None:
    """0.2 of the norm is √8 sin(α/2): 0.1415 rad."""
    words = ControllerCheck(made(tmp_path, FLOATING + TWO_R, {"arm.urdf": two_r()}).model, "arm")
    for k in range(5):
        a = turned * k / 4
        place = (2 * np.cos(a) - 0.05 * np.sin(a), 2 * np.sin(a) + 0.05 * np.cos(a), off * (k == 2))
        why = words.invalid_reason(heard("arm", 0.11 * k, (a, 0.0), (1.0, 0.0), tcp=place))
    assert ("would fit" in why) is fits


# -- which points, in which frames -------------------------------------------------------------------

TOOLS = (
    '[[tools]]\nname = "pen"\non = "arm/tip"\nmass = 0.1\nshape = { sphere = 0.01 }\n'
    "at = { position = [0.1, 0, 0] }\ntcp = { position = [0, 0.2, 0] }\n"
    '[[tools]]\nname = "bare"\non = "arm/l2"\nmass = 0.2\nshape = { sphere = 0.01 }\n'
)
OTHER = TWO_R.replace('"arm"', '"other"') + "base = { position = [0, 9, 0] }\n"
OTHERS = (
    '[[tools]]\nname = "away"\non = "other/tip"\nmass = 0.4\nshape = { sphere = 0.01 }\n'
    "tcp = { position = [0.3, 0, 0] }\n"
)
BASE = "base = { position = [0.5, -0.3, 0.2], rpy = [0, 0, 0.7] }\n"


def told_of(folder, text: str, place, *, frame_known: bool = True, on: str = "", spread: float = 0.2) -> str:
    """What is found of an arm whose TCP is said to be somewhere: a function of the tip's pose in the root."""
    model = made(folder, FLOATING + on + TWO_R + text, {"arm.urdf": two_r()}).model
    t = np.arange(8.0)
    q = np.stack([0.3 + spread * t, 0.5 * spread * t], axis=1)
    a, b = q[:, 0], q.sum(axis=1)
    x = np.stack([np.cos(b), np.sin(b), 0 * b], 1)
    y = np.stack([-np.sin(b), np.cos(b), 0 * b], 1)
    tip = np.stack([np.cos(a), np.sin(a), 0 * a], 1) + x
    said = ControllerLog("f", t, q, None, None, place(tip, x, y), frame_known)
    (found,) = compared(model, "arm", said)
    assert (found.level == "warning") is (found.holds == ("arm",)) is ("more than" in found.text)
    return found.text


def test_the_tool_centre_point_may_be_at_the_flange_or_at_a_tool_that_the_robot_has(tmp_path) -> None:
    text = TOOLS + OTHER + OTHERS
    pen = told_of(tmp_path, text, lambda tip, x, y: tip + 0.1 * x + 0.2 * y)
    assert pen.endswith("is where the twin has the tcp of pen, to 0.0 mm")
    flange = told_of(tmp_path, text, lambda tip, x, y: tip)
    assert flange.endswith(
        "has its flange, to 0.0 mm: its controller knows of no tool, and says nothing of the twin's"
    )
    alone = told_of(tmp_path, "", lambda tip, x, y: tip)
    assert alone.endswith("has its flange, to 0.0 mm")
    for away in (0.3, 0.1):  # where another robot has a tool, and where a tool without a tcp is
        wrong = told_of(tmp_path, text, lambda tip, x, y, away=away: tip + away * x)
        assert (
            f"a tool centre point at [{1e3 * away:.0f}, 0, 0] mm of the flange would fit to 0.0 mm" in wrong
        )
    given = told_of(
        tmp_path, "controller_tcp = { position = [0.3, 0, 0] }\n", lambda tip, x, y: tip + 0.3 * x
    )
    assert given.endswith("has controller_tcp, to 0.0 mm")


def test_a_controller_may_speak_in_its_base_in_that_turned_by_half_a_turn_and_in_the_world(tmp_path) -> None:
    c, s = np.cos(0.7), np.sin(0.7)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    frames = {
        "base": lambda p: p,
        "turned": lambda p: p * [-1, -1, 1],
        "world": lambda p: p @ turn.T + np.array([0.5, -0.3, 0.2]),
    }
    for frame in frames.values():
        assert "is where the twin has" in told_of(tmp_path, BASE, lambda tip, x, y, f=frame: f(tip))
        fits = told_of(tmp_path, BASE, lambda tip, x, y, f=frame: f(tip + 0.4 * x - 0.1 * y))
        assert "a tool centre point at [400, -100, 0] mm of the flange would fit to 0.0 mm" in fits
    mirrored = told_of(tmp_path, BASE, lambda tip, x, y: tip * [1, -1, 1])
    assert "no robot of the library and no tool would fit" in mirrored
    # Of a robot on a machine the world says nothing: the machine moves.
    cart = '[[machines]]\nname = "cart"\nshape = { box = [0.6, 0.6, 0.1] }\nmass = 50\nslide = { }\n'
    text = BASE + 'on = "cart"\n'
    assert "is where the twin has" in told_of(tmp_path, text, lambda tip, x, y: tip, on=cart)
    assert "more than 10 mm" in told_of(tmp_path, text, lambda tip, x, y: frames["world"](tip), on=cart)


def test_a_table_in_a_frame_that_nobody_gave_is_compared_as_one_rigid_body(tmp_path) -> None:
    turn = np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])

    def anywhere(tip, x, y):
        return (tip + 0.1 * x + 0.2 * y) @ turn.T + np.array([3.0, 1.0, -2.0])

    found = told_of(tmp_path, TOOLS, anywhere, frame_known=False)
    assert found == "f: its tool positions are those of the tcp of pen in a frame of their own, to 0.0 mm"
    assert "more than 10 mm" in told_of(tmp_path, TOOLS, anywhere)
    other = told_of(tmp_path, TOOLS, lambda *at: 1.1 * anywhere(*at), frame_known=False)
    assert "more than 10 mm" in other
    # From a tenth of a metre on, along any axis.
    for size, little in ((0.0999, True), (0.1, False)):
        places = lambda tip, x, y, size=size: np.outer(np.linspace(0, size, 8), [0.2, 1.0, 0.5])  # noqa: E731
        found = told_of(tmp_path, "", places, frame_known=False)
        assert ("move too little to be compared" in found) is little


def test_a_speed_that_fits_at_one_of_the_points_is_that_of_the_twin(tmp_path) -> None:
    model = made(tmp_path, FLOATING + TWO_R + TOOLS, {"arm.urdf": two_r()}).model
    t, q, qd = np.arange(8.0), np.zeros((8, 2)), np.tile([0.0, 1.0], (8, 1))
    far = made(
        tmp_path / "far",
        FLOATING + TWO_R + TOOLS.replace("[0, 0.2, 0]", "[0, 2.0, 0]"),
        {"arm.urdf": two_r()},
    ).model
    for of, speed, told in (
        (model, 1.0, False), (model, np.hypot(1.1, 0.2), False), (model, 1.8, True), (model, 0.5, True),
        (far, 1.0, False), (far, np.hypot(1.1, 2.0), False), (far, 1.6, True),
    ):  # fmt: skip
        said = ControllerLog("f", t, q, qd, None, None, True, np.full(8, speed))
        assert bool([*compared(of, "arm", said)]) is told


def test_external_torques_of_a_robot_are_not_those_of_its_model(tmp_path) -> None:
    """Nor are they compared, of whatever moves with it; those of another robot are."""

    def told(at: str, torques: str) -> tuple[tuple[str, ...], ...]:
        force = f'[[safety]]\nkind = "tool_force"\nname = "force"\nat = "{at}"\nlimit = 100\n'
        force += f'torques = "{torques}"\n'
        text = DOWN + TWO_R + OTHER + TOOLS + force
        model = made(tmp_path, text, {"arm.urdf": two_r()}).model
        q = np.zeros((8, 2))
        said = ControllerLog("f", np.arange(8.0), q, None, np.tile([-30.0, -10.0], (8, 1)), None, True)
        return tuple(f.holds for f in compared(model, "arm", said))

    assert told("arm", "external") == told("pen", "external") == ()
    assert told("other", "external") == ((),)
    assert told("arm", "measured") == told("pen", "measured") == (("force",),)
    assert told("other", "measured") == ((),)


def test_live_words_in_a_turned_base_say_which_tool_would_fit_and_torques_are_heard_by_themselves(
    tmp_path,
) -> None:
    words = ControllerCheck(made(tmp_path, FLOATING + TWO_R + BASE, {"arm.urdf": two_r()}).model, "arm")
    c, s = np.cos(0.7), np.sin(0.7)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    for k in range(6):
        a = 0.3 * k
        tip = np.array([2 * np.cos(a) - 0.4 * np.sin(a), 2 * np.sin(a) + 0.4 * np.cos(a), 0.3])
        place = tuple(turn @ tip + [0.5, -0.3, 0.2])
        why = words.invalid_reason(heard("arm", 0.11 * k, (a, 0.0), (1.0, 0.0), tcp=place))
    assert "a tool centre point at [0, 400, 300] mm of the flange would fit" in why
    assert words.invalid_torque_reason == ""
