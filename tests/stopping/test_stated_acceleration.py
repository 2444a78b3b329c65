"""A stated ``stop.acceleration`` that a robot's own motion contradicts keeps nothing within."""

from __future__ import annotations

import numpy as np
import pytest

from made_cell import TWO_R, heard, made, person, two_r
from seerob.core.snapshot import Verdict
from seerob.criteria.judging import Judge
from seerob.criteria.stopping.stated_acceleration import explains, largest_gain
from seerob.recording.series import CODES
from seerob.twin.engine import Engine

ENGINE = "[engine]\nphysics = false\ngravity = [0, 0, 0]\n"
SOURCE = '[[sources]]\nkind = "csv"\nrobot = "arm"\nfile = "motion.csv"\n'
SAFE = """
[[safety]]
kind = "separation"
name = "s"
between = ["arm", "op"]
stop = {{ reaction = 0.2, stopping = 0.3, acceleration = {a} }}
human_speed = 1.6
intrusion = 0
human_uncertainty = 0
robot_uncertainty = 0
[[safety]]
kind = "separation_area"
name = "around"
separation = "s"
of = "op"
[[safety]]
kind = "velocity"
name = "v"
of = "arm"
limit = 10
"""
CONFIRMED = (
    '[[confirmed]]\nkey = "safety[0].stop.acceleration"\nof = "s"\nvalue = {value}\nwhy = "monitored"\n'
)
T = np.arange(0, 0.6 + 1e-9, 0.005)
LEVER = float(np.hypot(2, 0.05))
"""Of the farthest corner of two links in line [m]."""


def faster(rate, begin=0.2, end=0.4):
    """Angle and speed of a joint that turns at 0.5 rad/s, and gets faster between two instants."""
    gained = rate * (np.clip(T, begin, end) - begin)
    qd = 0.5 + gained
    return np.concatenate([[0], np.cumsum((qd[1:] + qd[:-1]) / 2 * np.diff(T))]), qd


def csv(q, qd=None):
    head = "t [s],j1 [rad],j2 [rad]" + ("" if qd is None else ",qd_j1 [rad/s],qd_j2 [rad/s]")
    every = (T, q, 0 * q) if qd is None else (T, q, 0 * q, qd, 0 * q)
    return "\n".join([head, *(",".join(f"{x:.9g}" for x in row) for row in zip(*every, strict=True))]) + "\n"


def cell(folder, motion, a=0.0, at=5.5, more=""):
    text = ENGINE + TWO_R + person("op", at, 0, 0) + SOURCE + SAFE.format(a=a) + more
    return made(folder, text, {"arm.urdf": two_r(), "motion.csv": csv(*motion)})


def told(station):
    return [f.text for f in station.scene().findings if "contradicted" in f.text and "s" in f.holds]


def test_nothing_that_rests_on_what_the_motion_contradicts_is_within(tmp_path):
    """12 m/s² at the outermost corner: 2.4 m/s more at the end of the reaction time than S_p counts."""
    station = cell(tmp_path, faster(12 / LEVER))
    (text,) = told(station)
    assert text.startswith(
        "safety[0].stop.acceleration = 0 m/s² is contradicted by the robot's own motion: in "
    )
    assert "arm/l2 gets faster by 2.4 m/s from 0.200 s to 0.400 s" in text
    assert 'confirm it: [[confirmed]] key = "safety[0].stop.acceleration", of = "s", value = 0.0' in text
    results = station.run().results
    for name in ("s", "around"):
        assert results[name].verdict is Verdict.UNDECIDED
        assert not (results[name].verdicts == 0).any()
    assert results["v"].verdict is Verdict.WITHIN
    # What the message asks for is enough, and no more than that.
    right = float(text.partition("give ")[2].partition(" ")[0])
    assert right == pytest.approx(12, rel=0.02)
    assert not told(cell(tmp_path / "right", faster(12 / LEVER), right))
    assert told(cell(tmp_path / "less", faster(12 / LEVER), 0.98 * right))


def test_what_is_exceeded_stays_exceeded_and_what_is_confirmed_counts(tmp_path):
    near = cell(tmp_path / "near", faster(6.0), at=2.6)
    assert near.run().results["s"].verdict is Verdict.EXCEEDED
    meant = cell(tmp_path / "meant", faster(6.0), more=CONFIRMED.format(value=0))
    assert not told(meant)
    assert any(f.text.endswith("; confirmed: monitored") for f in meant.scene().findings)
    assert meant.run().results["s"].verdict is Verdict.WITHIN
    other = cell(tmp_path / "other", faster(6.0), a=1.0, more=CONFIRMED.format(value=0))
    assert "the file confirms 0.0, another value" in told(other)[0]


@pytest.mark.parametrize("velocities", [True, False])
def test_noise_of_a_steady_motion_contradicts_nothing(tmp_path, velocities):
    rng = np.random.default_rng(1)
    q, qd = faster(0.0)
    q = q + rng.normal(0, 2e-5, len(q))
    assert not told(cell(tmp_path, (q, qd + rng.normal(0, 1e-3, len(qd))) if velocities else (q,)))


def test_whom_only_the_run_shows_is_held_from_when_it_is_seen(tmp_path):
    text = ENGINE + TWO_R + person("op", 5.5, 0, 0) + SAFE.format(a=0)
    station = made(tmp_path, text, {"arm.urdf": two_r()})
    engine, judge = Engine(station.model, driven={"arm": 1.0}), Judge(station.bound)
    q, qd = faster(6.0)
    engine.take([heard("arm", t, (a, 0), (b, 0)) for t, a, b in zip(T.tolist(), q, qd, strict=True)])
    verdicts = [judge(engine.tick() if k else engine.start())[0].verdict for k in range(55)]
    seen = verdicts.index(Verdict.UNDECIDED)
    # 0.02 m/s more than before, within two ticks of when it begins; then for good.
    assert 20 < seen <= 22
    assert set(verdicts[1:seen]) == {Verdict.WITHIN}
    assert set(verdicts[seen:]) == {Verdict.UNDECIDED}


def test_arrays_are_held_against_it_too(tmp_path):
    text = ENGINE + TWO_R + person("op", 5.5, 0, 0) + SAFE.format(a=0)
    station = made(tmp_path, text, {"arm.urdf": two_r()})
    for rate, verdict in ((6.0, Verdict.UNDECIDED), (0.0, Verdict.WITHIN)):
        q, qd = (np.column_stack([x, 0 * x]) for x in faster(rate))
        assert station.batch({"arm": q}, {"arm": qd}, t=T)["s"].verdict is verdict


UNSTATED = SAFE.replace(", acceleration = {a}", "").format()
LIMITED = TWO_R + "acceleration_limits = {}\n"


@pytest.mark.parametrize(
    ("rate", "limits", "refuted"),
    [(12.0, "[5, 5]", True), (-12.0, "[5, 5]", True), (12.0, "[5]", True), (12.0, "[11, 5]", False)],
)
def test_acceleration_limits_that_a_recorded_motion_contradicts_hold_what_may_rest_on_them(
    tmp_path, rate, limits, refuted
):
    """A joint that gets faster or slower by 2.4 rad/s in 0.2 s."""

    def of(folder, more=""):
        text = ENGINE + LIMITED.format(limits) + person("op", 9.0, 0, 0) + SOURCE + UNSTATED + more
        q, qd = faster(rate)
        motion = csv(*(faster(rate) if rate > 0 else (q + 3 * T, qd + 3)))
        return made(folder, text, {"arm.urdf": two_r(), "motion.csv": motion})

    station = of(tmp_path)
    (text,) = told(station) or ("",)
    results = station.run().results
    assert results["v"].verdict is Verdict.WITHIN
    for name in ("s", "around"):
        # Of a log that ends in motion nobody knows what comes next.
        assert set(results[name].verdicts[:40]) == {2 if refuted else 0}
    if not refuted:
        assert not text
        return
    assert text.startswith("robots[0].acceleration_limits is contradicted by the robot's own motion: in ")
    assert (
        "j1 changes its speed by 2.4 rad/s from 0.200 s to 0.400 s, which is 12 rad/s², and the limit 5"
        in text
    )
    confirmed = of(
        tmp_path / "meant",
        '[[confirmed]]\nkey = "robots[0].acceleration_limits"\nof = "arm"\n'
        f'value = {limits}\nwhy = "monitored"\n',
    )
    assert not told(confirmed)
    assert set(confirmed.run().results["s"].verdicts[:40]) == {0}


def test_arrays_that_contradict_acceleration_limits_are_not_within(tmp_path):
    """Of arrays with instants it is known what comes next, as of a log, until they end in motion."""
    text = ENGINE + LIMITED.format("[5, 5]") + person("op", 9.0, 0, 0) + UNSTATED
    station = made(tmp_path, text, {"arm.urdf": two_r()})
    for rate, verdict in ((12.0, Verdict.UNDECIDED), (4.0, Verdict.WITHIN)):
        q, qd = (np.column_stack([x, 0 * x]) for x in faster(rate))
        found = station.batch({"arm": q}, {"arm": qd}, t=T)["s"]
        assert set(found.answers.verdict[:60].tolist()) == {CODES[verdict]}
        assert found.reasons[-1]
        assert found.verdict is Verdict.UNDECIDED


@pytest.mark.parametrize("seed", range(5))
def test_largest_gain_is_that_of_every_pair_of_instants(seed):
    rng = np.random.default_rng(seed)
    t, v = np.cumsum(rng.uniform(0.01, 0.05, 60)), np.abs(np.cumsum(rng.normal(size=(60, 3)) * 0.2, axis=0))
    a, window, noise = rng.uniform(0, 4), rng.uniform(0.05, 0.5), rng.uniform(0, 0.1, 3)
    i, j = np.triu_indices(60)
    i, j = (each[t[j] - t[i] <= window] for each in (i, j))
    beyond = v[j] - v[i] - a * (t[j] - t[i])[:, None] - noise
    found = largest_gain(t, v, a, window, noise)
    pair, part = np.unravel_index(beyond.argmax(), beyond.shape)
    assert found[:3] == (part, t[i[pair]], t[j[pair]])
    apart = i < j
    needed = ((v[j] - v[i] - noise)[apart] / (t[j] - t[i])[apart, None]).max()
    assert explains(t, v, window, noise) == pytest.approx(needed, rel=2e-3)
    assert largest_gain(t, v, explains(t, v, window, noise), window, noise) is None
