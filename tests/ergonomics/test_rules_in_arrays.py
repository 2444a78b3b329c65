"""Rules about postures say of many instants, in arrays, what they say of each."""

from __future__ import annotations

import numpy as np
import pytest
from made_postures import random_q

from made_cell import made, person
from seerob.core.snapshot import Verdict
from seerob.criteria.criterion import Criterion
from seerob.recording.series import CODES

N = 60
T = 0.05 * np.arange(N)
STANDS = (
    "engine = { physics = false }\n"
    + person("op", 0, 0, 1)
    + '[[confirmed]]\nkey = "humans[0].feet"\nof = "op"\nvalue = 1\nwhy = "postures of a table, wherever"\n'
)
ENTERED = (
    'load = 3, load_use = "intermittent", muscle_arms = false, muscle_body = false, '
    'supported_arms = "none", back_supported = false, legs = "posture"'
)
RULES = {
    "rula": f'kind = "rula"\naction_level = 3\nphases = [{{ {ENTERED} }}]',
    "rula, not entered": 'kind = "rula"\naction_level = 3',
    "rula, off": f'kind = "rula"\naction_level = 3\naccuracy_deg = 3\nphases = [{{ {ENTERED} }}]',
    "rula, informs": 'kind = "rula"\nunmeasured = ["right_hand"]',
    "reba": 'kind = "reba"\naction_level = 3\narm = "elevation"\nphases = [{ load = 3, shock = false, '
    'coupling = "good", supported_arms = "none", legs = "posture", static = false, repeated = false, '
    "rapid = false }]",
    "owas": 'kind = "owas"\naction_category = 2\nphases = [{ load = 3, legs = "posture" }]',
    "owas, off": 'kind = "owas"\naction_category = 3\naccuracy_deg = 3\nphases = [{ legs = "posture" }]',
    "owas, in turns": 'kind = "owas"\naction_category = 2\nphases = [{ load = 3, legs = "posture" }, '
    '{ start = 1.0, load = 30, legs = "standing" }, { start = 2.02, load = 60 }, { start = 2.03, load = 3, '
    'legs = "sitting" }]',
    "lifts": 'kind = "niosh"\nlimit = 1\nlifts = [{ load = 8, coupling = "good", control = false, '
    "per_minute = 2, origin = { horizontal = 0.3, vertical = 0.7, asymmetry = 0 }, "
    "destination = { horizontal = 0.3, vertical = 1.1, asymmetry = 0 } }]\nwork = 3000\nrecovery = 3000\n"
    "exclusions = []",
}
OWN = """
from seerob.api import Basis, Criterion, Figure, bind_posture


class Stooping(Criterion, frozen=True, kw_only=True):
    \"\"\"How far somebody stoops.\"\"\"

    unit = "rad"
    human: str
    limit: float
    between_samples: str = "accepted: postures that are looked at"

    def subjects(self):
        return (self.human,)

    def compute(self, model):
        read = bind_posture(model, self.human)

        def compute(twin):
            found = read(twin).trunk_flexion
            return Figure(found[:, 0] if twin.many else found, self.limit)

        return compute

    def one_by_one(self, model):
        return ""

    def basis(self, model):
        return Basis(formula="x", source="x")
"""
PASSED_OVER = "owas, in turns"


@pytest.fixture
def asked(tmp_path, monkeypatch):
    """What is said in arrays, and one by one."""
    tables = "".join(
        f'[[ergonomics]]\nname = "{name}"\nhuman = "op"\n{rule}\n' for name, rule in RULES.items()
    )
    station = made(tmp_path, STANDS + tables)
    q = random_q(N)
    many = station.batch({"op": q}, {"op": np.zeros_like(q)}, t=T)
    monkeypatch.setattr(Criterion, "batch", lambda *_: None)
    return many, station.batch({"op": q}, {"op": np.zeros_like(q)}, t=T)


def test_rules_say_of_many_postures_what_they_say_of_each(asked):
    many, each = asked
    told = set()
    for name in RULES:
        one, other = many[name], each[name]
        assert (one.note, other.note[:15]) == ("", "asked instant b")
        told |= set(one.answers.verdict.tolist())
        np.testing.assert_array_equal(one.answers.verdict, other.answers.verdict, name)
        np.testing.assert_array_equal(one.value, other.value, name)
        np.testing.assert_array_equal(one.answers.limit, other.answers.limit, name)
        if other.answers.interval is not None:
            np.testing.assert_array_equal(one.answers.interval, other.answers.interval, name)
    assert told >= set(map(CODES.__getitem__, Verdict))


def test_a_phase_between_two_instants_is_passed_over_in_arrays_too(asked):
    for batch in asked:
        said = batch[PASSED_OVER]
        k = int(np.searchsorted(T, 2.03))
        assert said.answers.verdict[k] == CODES[Verdict.UNDECIDED]
        assert "lies between two ticks" in said.reasons[k]
        assert set(said.answers.verdict[T < 2.0]) == {CODES[Verdict.WITHIN], CODES[Verdict.EXCEEDED]}


def test_a_score_keeps_the_limit_that_it_is_on(asked):
    many, _ = asked
    on = many["owas"].value == 2
    assert on.any()
    assert set(many["owas"].answers.verdict[on]) == {CODES[Verdict.WITHIN]}


def test_a_rule_of_ones_own_reads_the_angles_of_many_postures(tmp_path, monkeypatch):
    (tmp_path / "own_rules").mkdir()
    (tmp_path / "own_rules/stooping.py").write_text(OWN)
    monkeypatch.syspath_prepend(str(tmp_path))
    (tmp_path / "cell").mkdir()
    rule = '[[ergonomics]]\nkind = "own_rules.stooping"\nname = "own"\nhuman = "op"\nlimit = 0.2\n'
    station = made(tmp_path / "cell", STANDS + rule)
    q = random_q(N)
    many = station.batch({"op": q}, {"op": np.zeros_like(q)}, t=T)["own"]
    monkeypatch.setattr(Criterion, "batch", lambda *_: None)
    each = station.batch({"op": q}, {"op": np.zeros_like(q)}, t=T)["own"]
    assert (many.note, each.note[:15]) == ("", "asked instant b")
    np.testing.assert_allclose(many.value, each.value, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(many.answers.verdict, each.answers.verdict)
    assert set(many.answers.verdict) == {CODES[Verdict.WITHIN], CODES[Verdict.EXCEEDED]}
