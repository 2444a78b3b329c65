"""An ergonomics rule of a company, in its own package; and what a run prints of scores over time."""

import sys
from pathlib import Path

import numpy as np
import openpyxl
import pytest
from made_postures import PERSON

from made_cell import judged, made, state_at
from seerob import load
from seerob.core.snapshot import Verdict
from seerob.description.humans.posture import posture
from seerob.description.humans.skeleton import JOINTS
from seerob.outputs.sinks.dossier import Dossier
from seerob.outputs.sinks.excel import Excel

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
HUMAN = '[[humans]]\nname = "op"\nstature = 1.75\nmass = 75\nsex = "male"\n'
STILL = np.zeros(len(JOINTS))


@pytest.fixture
def acme(monkeypatch):
    monkeypatch.syspath_prepend(str(EXAMPLES))
    yield
    for name in [n for n in sys.modules if n.split(".")[0] == "acme"]:
        del sys.modules[name]


def test_a_rule_of_ones_own_counts_how_long_somebody_bends(tmp_path, acme):
    stage = made(tmp_path, HUMAN + '[[ergonomics]]\nkind = "acme.bending"\nhuman = "op"\nlimit = 2\n')
    bent = posture(PERSON, {"pelvis_tilt_forward": np.radians(50)})
    states = {
        "bent": state_at(stage, op=(bent, STILL)),
        "up": state_at(stage, op=(posture(PERSON, "standing"), STILL)),
    }
    found = []
    for k, name in enumerate(["up", "bent", "bent", "bent", "bent", "up", "bent"]):
        states[name].t = float(k)
        result = judged(stage.bound, states[name])[0]
        found.append((result.value, result.verdict))
    assert [value for value, _ in found] == [0, 0, 1, 2, 3, 0, 0]
    assert [verdict for _, verdict in found].index(Verdict.EXCEEDED) == 3  # on its limit


def test_points_of_a_rule_with_phases_are_a_span_where_nobody_said(tmp_path, acme):
    text = HUMAN + '[[ergonomics]]\nkind = "acme.bent_load"\nhuman = "op"\nlimit = 1\naccuracy_deg = 5\n'
    text += "[[phases]]\nstart = 1\nload = 3\n[[phases]]\nstart = 2\nload = 6\nend = 3\n"
    stage = made(tmp_path, text)
    found = []
    for tilt, t in ((0, 0), (50, 0), (50, 1), (50, 2), (38, 2), (50, 3)):
        state = state_at(stage, op=(posture(PERSON, {"pelvis_tilt_forward": np.radians(tilt)}), STILL))
        state.t = float(t)
        result = judged(stage.bound, state)[0]
        found.append((result.interval, result.verdict))
    within, exceeded, undecided = Verdict.WITHIN, Verdict.EXCEEDED, Verdict.UNDECIDED
    assert found == [
        ((0, 1), within), ((1, 2), undecided), ((1, 1), within), ((2, 2), exceeded), ((1, 2), undecided),
        ((1, 2), undecided),
    ]  # fmt: skip


MOTION = """
[[keyframes]]
t = 0
posture = "standing"
[[keyframes]]
t = 0.5
posture = "standing"
[[keyframes]]
t = 1.5
posture = "bend_forward"
[[keyframes]]
t = 2.0
posture = "bend_forward"
"""
STATION = (
    "engine = { physics = false }\n"
    + HUMAN
    + """
[[phases]]
title = "all"
load = 0
supported_arms = "none"
back_supported = false
legs = "posture"
balanced = true
rapid = false
muscle_arms = false
muscle_body = false
static = false
repeated = false

[[sources]]
kind = "keyframes"
human = "op"
file = "m.toml"
"""
    + "".join(
        f'[[ergonomics]]\nkind = "{kind}"\nname = "{kind}"\nhuman = "op"\n' for kind in ("rula", "owas")
    )
)


def test_a_run_prints_shares_percentiles_and_maxima_with_their_instants(tmp_path):
    (tmp_path / "m.toml").write_text(MOTION)
    (tmp_path / "workstation.toml").write_text(STATION)
    station = load(tmp_path)
    done = station.run(folder=tmp_path / "out", sinks=(Excel(), Dossier()))
    series = done.results["rula"]
    rows = list(openpyxl.load_workbook(tmp_path / "out/results.xlsx")["Time shares"].values)
    rula = {row[3]: row for row in rows if row[0] == "rula" and not row[1]}
    assert rula["largest"][4] == series.max()
    assert rula["largest"][5] == pytest.approx(series.t[np.nanargmax(series.values)])
    assert 0.5 < rula["largest"][5] < 1.6
    shares = {name: row[6] for name, row in rula.items() if row[6] is not None}
    assert sum(shares.values()) == pytest.approx(100)
    at_least = np.mean(series.values <= 2) * 100
    assert shares["action level 1"] == pytest.approx(at_least)
    assert {row[1] or "whole" for row in rows if row[0] == "rula"} == {"whole", *series.parts}
    for rule, part in (("owas", "back"), ("rula", "right upper arm")):
        values = done.results[rule].parts[part].values
        shares = {row[3]: row[6] for row in rows if row[:2] == (rule, part) and row[6] is not None}
        assert sum(shares.values()) == pytest.approx(100)
        for code in np.unique(values):
            assert shares[f"score {code:.0f}"] == pytest.approx(np.mean(values == code) * 100)
    (page,) = (tmp_path / "out").glob("*.html")
    text = page.read_text(encoding="utf-8")
    assert "Over time" in text
    assert "P95" in text
    assert "action category 1" in text
    assert "threshold trunk twist" in text
    assert "original1993" in text


def test_a_replayed_run_finds_the_same_static_work(tmp_path):
    """Two runs of one station: what a rule remembers is forgotten where time begins anew."""
    (tmp_path / "m.toml").write_text(MOTION)
    detect = 'detect = { from_rest = true, movement_deg = 20 }\nprofile = "original1993"\n'
    text = STATION.replace("muscle_arms = false\nmuscle_body = false\n", "")
    text = text.replace('kind = "rula"\n', f'kind = "rula"\n{detect}')
    (tmp_path / "workstation.toml").write_text(text)
    station = load(tmp_path)
    first, second = (station.run().results["rula"] for _ in range(2))
    assert len(first) > 50
    assert np.array_equal(first.values, second.values, equal_nan=True)
    assert first.reasons == second.reasons
