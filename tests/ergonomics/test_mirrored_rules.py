"""Every rule on random postures: a mirror exchanges the sides and nothing else, heading and place nothing."""

import re

import numpy as np
import pytest
from made_postures import random_q

from made_cell import judged, made, state_at
from seerob.core.snapshot import Highlight
from seerob.description.humans.skeleton import JOINTS, mirrored

STILL = np.zeros(len(JOINTS))
"""One process says it all once."""
HUMAN = '[[humans]]\nname = "op"\nstature = 1.75\nmass = 75\nsex = "male"\n'
ARM = 'supported_arms = "left", back_supported = false, legs = "posture", load = 1'
WORK = f'{ARM}, load_use = "repeated", hand = "right", muscle_arms = true'
RULES = {
    "rula, 1993": f'kind = "rula"\nprofile = "original1993"\naction_level = 2\nphases = [{{ {WORK} }}]',
    "rula, worksheet": 'kind = "rula"\nprofile = "worksheet"\narm = "elevation"\naccuracy_deg = 4\n'
    f"phases = [{{ {WORK.replace('load = 1', 'load = 0.5')}, muscle_body = true }}]",
    "rula, detected": 'kind = "rula"\ndetect = { from_rest = true }\n'
    f"phases = [{{ {WORK.replace(', muscle_arms = true', '')} }}]",
    "reba": 'kind = "reba"\naction_level = 1\naccuracy_deg = 3\nphases = [{ load = 6, coupling = "fair", '
    'shock = false, supported_arms = "right", legs = "posture", static = false, repeated = true }]',
    "owas": 'kind = "owas"\naction_category = 2\naccuracy_deg = 5\n'
    'phases = [{ load = 12, legs = "posture" }]',
    "eaws": 'kind = "eaws_posture"\ncycle = 30\nminimum_hold = 0\naccuracy_deg = 3\n'
    'phases = [{ legs = "posture", back_supported = false }]',
    "iso": 'kind = "iso_11226"\nlimit = 1\nfrom_rest = true\nphases = [{ supported_arms = "left" }]',
    "en": 'kind = "en_1005_4"\nlimit = 1\naccuracy_deg = 2\nphases = [{ supported_arms = "right" }]',
    "table": 'kind = "posture_table"\ntable = "rules.csv"\ncombine = "sum"\nfrom_rest = true\nlimit = 3',
}
TABLE = """angle,from_deg,to_deg,score,either_way,side,per_minute
shoulder elevation,20,,1,,,
shoulder elevation,60,,3,,left,
elbow flexion,30,90,2,,right,2
elbow flexion,90,,0,,right,
elbow flexion,,30,0,,right,
neck twist,10,,1,yes,,
trunk side bend,5,,2,yes,,
knee flexion,40,,1.5,,,
"""


def swapped(text):
    """Right for left, in a name or in what is entered."""
    return re.sub("right|left", lambda m: "left" if m[0] == "right" else "right", text)


def stage(folder, change=str):
    folder.mkdir()
    (folder / "rules.csv").write_text(change(TABLE))
    rules = "".join(
        f'[[ergonomics]]\nname = "{name}"\nhuman = "op"\n{change(text)}\n' for name, text in RULES.items()
    )
    return made(folder, HUMAN + rules)


def told(stage, postures, change=str):
    """What each rule says of postures that are held for 5 s: in all, of each part, and what it marks."""
    found = {name: [] for name in RULES}
    for k, q in enumerate(postures):
        state = state_at(stage, op=(q, STILL))
        for second in range(6):
            state.t = float(6 * k + second)
            for r in judged(stage.bound, state):
                parts = {change(p.name): (p.value, p.interval, p.verdict) for p in r.parts}
                marks = {change(m.body) for m in r.markers if isinstance(m, Highlight)}
                found[r.name].append((r.value, r.interval, r.verdict, parts, marks))
    return found


@pytest.fixture(scope="module")
def said(tmp_path_factory):
    folder = tmp_path_factory.mktemp("rules")
    q = np.concatenate([random_q(3, seed=11, scale=0.3), random_q(2, seed=12, scale=0.7)])
    turned = q.copy()
    turned[:, JOINTS.index("pelvis_turn_left")] += np.random.default_rng(3).uniform(-3, 3, len(q))
    turned[:, [JOINTS.index("pelvis_x"), JOINTS.index("pelvis_y")]] += [2.0, -1.0]
    own, other = stage(folder / "own"), stage(folder / "other", swapped)
    return {
        "own": told(own, q),
        "turned": told(own, turned),
        "mirrored": told(other, mirrored(q), swapped),
    }


@pytest.mark.parametrize("name", RULES)
def test_a_mirror_exchanges_the_sides(said, name):
    assert_same(said["own"][name], said["mirrored"][name])


@pytest.mark.parametrize("name", RULES)
def test_heading_and_place_change_nothing(said, name):
    assert_same(said["own"][name], said["turned"][name])


@pytest.mark.parametrize("name", RULES)
def test_the_postures_tell_something(said, name):
    """Not every posture scores the same, and where there are sides they differ."""
    rows = said["own"][name]
    assert len({(value, interval) for value, interval, *_ in rows}) > 1
    sides = [(p, v) for *_, parts, _ in rows for p, v in parts.items() if p.startswith("right ")]
    if sides:
        assert any(v != parts[swapped(p)] for *_, parts, _ in rows for p, v in parts.items() if "right" in p)


def assert_same(one, other):
    for a, b in zip(one, other, strict=True):
        assert a[2] is b[2]
        assert a[3].keys() == b[3].keys()
        assert a[4] == b[4]
        pairs = [(a[:2], b[:2]), *((a[3][key][:2], b[3][key][:2]) for key in a[3])]
        for (value, interval), (value_2, interval_2) in pairs:
            assert (value is None, interval is None) == (value_2 is None, interval_2 is None)
            assert value is None or value == pytest.approx(value_2, abs=1e-9)
            assert interval is None or interval == pytest.approx(interval_2, abs=1e-9)
