"""The workstation of a recorded person: its recording says what it is, and what it shows is true."""

import json
import math
import runpy
from pathlib import Path

import numpy as np
import pytest

from kept_run import Kept
from seerob.core.snapshot import Verdict
from seerob.outputs.report import posture_safety as _posture_safety
from seerob.recording.result_log import log_of
from seerob.session.station import load

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "workstations/captured_operator"


@pytest.fixture(scope="module")
def script():
    return runpy.run_path(str(ROOT / "scripts/make-captured-operator"))


def test_the_recording_says_that_it_is_generated_and_is_what_the_script_makes(script):
    kept = json.loads((FOLDER / "motion/operator.json").read_text(encoding="utf-8"))
    made = json.loads(script["seen"]())
    assert "no person was recorded" in kept["note"]
    assert [f["num_bodies"] for f in kept["frames"]] == [f["num_bodies"] for f in made["frames"]]
    for one, other in zip(kept["frames"], made["frames"], strict=True):
        if one["bodies"]:
            a, b = (np.array(f["bodies"][0]["joint_positions"]) for f in (one, other))
            assert np.abs(a - b).max() <= 1  # rounded to millimetres
    assert (FOLDER / "motion/cycle.csv").read_text(encoding="utf-8") == script["cycle"]()


def test_the_twin_follows_and_each_instant_has_posture_and_safety():
    station = load(FOLDER)
    kept = Kept()
    summary = station.run(writers=[kept], stop=lambda: bool(kept.snapshots and kept.snapshots[-1].t >= 2.9))
    (position,) = summary.results.bones["operator"].all()
    assert position.median < 0.02
    scene = station.scene()
    log = log_of(kept.snapshots, scene.criteria)
    (one,) = _posture_safety.sides(scene, log)
    assert [s.name for s in one.scores] == ["RULA", "REBA"]
    assert [s.name for s in one.measures] == ["robot – operator", "separation", "contact"]
    rows = {round(row[1], 2): row for row in _posture_safety.rows(one, 10_000)}
    upright, low = rows[0.5], rows[2.3]
    # Hands that the camera has only predicted for longer than half a second are not scored.
    assert math.isnan(rows[2.8][2])
    assert low[2] > upright[2]
    assert low[3] > upright[3]
    # The posture that is worse for the back also brings the person nearer to the robot.
    assert low[4] < upright[4]
    for row in (upright, low):
        assert row[5] == pytest.approx(0.15 / row[4])
        assert (row[6] == "exceeded") == (row[5] > 1)
        assert row[7]
        assert ", front" in row[8] or ", rear" in row[8]
    assert not any(math.isnan(row[4]) for row in rows.values())
    assert log["RULA"].verdict is not Verdict.WITHIN
