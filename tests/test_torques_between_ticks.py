"""Torques that a source measures decide between two ticks, and no bound of theirs is ever beaten."""

from __future__ import annotations

import numpy as np
import pytest

from made_cell import heard, made
from seerob.core.snapshot import Verdict
from seerob.criteria.between_ticks import SpanResult
from seerob.session.run import Judge
from seerob.twin.engine import Engine
from worst_between import one_by_one

TORQUES = """
engine = { physics = false }
[[robots]]
name = "arm"
model = "library:ur5e"
[[safety]]
kind = "joint_torque"
name = "torque"
robot = "arm"
torque_uncertainty = [5, 5, 5, 1, 1, 1]
[[safety]]
kind = "tool_force"
name = "force"
at = "arm"
limit = FORCE
torques = "external"
torque_uncertainty = [0.5, 0.5, 0.5, 0.1, 0.1, 0.1]
"""
BENT = np.array([0.3, -1.2, 1.5, -0.4, 1.2, 0.2])


def measuring(folder, tau, limit, watching=None):
    """Verdicts of an arm that moves slowly and measures torques of t [s] at 500 Hz, by criterion."""
    station = made(folder, TORQUES.replace("FORCE", str(limit)))
    engine, judge = Engine(station.model, driven={"arm": 0.2}), Judge(station.bound)
    if watching is not None:
        one_by_one(judge)._judge = watching(judge._between)
    verdicts = []
    for k in range(8):
        times = [0.01 * k] if k == 0 else [0.01 * (k - 1) + 0.002 * i for i in range(1, 6)]
        way = np.array([0.4, -0.3, 0.5, 0.2, -0.4, 0.6])
        engine.take([heard("arm", t, BENT + way * t, way, tau=tuple(tau(t))) for t in times])
        verdicts.append([result.verdict for result in judge(engine.tick() if k else engine.start())])
    return dict(zip(("torque", "force"), zip(*verdicts, strict=True), strict=True))


def test_no_torque_or_force_between_two_ticks_is_above_its_bound(tmp_path):
    noise = np.random.default_rng(3).normal(size=(6, 60)) * [[25], [25], [25], [4], [4], [4]]
    room = {"torque": [], "force": []}

    def watching(between):
        def judged(i, watch, ends, state):
            low = between._low(watch, between._way, ends, state)
            for t in np.linspace(ends[0].t, ends[1].t, 21).tolist():
                _, there, _ = between._look(i, watch, between._way, t, state)
                room[watch.criterion.name].append(there.margin[0] - there.margin[1] - low)
            return SpanResult()

        return judged

    measuring(tmp_path, lambda t: noise[:, round(t / 0.002)], 1e4, watching)
    for found in room.values():
        assert len(found) == 7 * 21
        assert min(found) >= -1e-9
        assert np.isfinite(found).all()
    assert min(room["torque"]) < 1e-9  # it is met


@pytest.mark.parametrize("at", [0.034, 0.03])
@pytest.mark.parametrize(("joint", "peak", "what"), [(1, 200.0, "torque"), (0, 120.0, "force")])
def test_a_torque_that_peaks_between_two_ticks_decides(tmp_path, joint, peak, what, at):
    """150 N·m are the limit of that joint."""
    rest = np.array([3.0, 3.0, 3.0, 1.0, 1.0, 1.0])

    def tau(share):
        more = np.eye(6)[joint] * share * peak
        return lambda t: rest + (abs(t - at) < 1e-6) * more

    low, high = (measuring(tmp_path / str(x), tau(x), 100)[what] for x in (0.3, 1.0))
    assert set(low) == {Verdict.WITHIN}
    assert high.index(Verdict.EXCEEDED) == (3 if at == 0.03 else 4)
    assert high.count(Verdict.WITHIN) >= 5
