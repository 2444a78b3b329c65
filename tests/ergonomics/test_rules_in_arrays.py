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
SECTIONS = (
    "entered = { moving_objects = 0, accessibility = 0, impulses = 0, joint_position = 0, special = 0, "
    "far_reach = 0, forces = 10, loads = 5, upper_limbs = 0 }\n"
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
    "eaws": 'kind = "eaws_posture"\ncycle = 2\nminimum_hold = 0.1\nlimit = 45\n' + SECTIONS,
    "eaws, not entered": 'kind = "eaws_posture"\ncycle = 2\nminimum_hold = 0.1\nlimit = 45',
    "eaws, off": 'kind = "eaws_posture"\ncycle = 9\nminimum_hold = 0.1\naccuracy_deg = 3\nlimit = 20\n'
    'interpolation = "step"\nphases = [{ legs = "posture", back_supported = false }, { start = 1.0 }]\n'
    + SECTIONS,
    "eaws, informs": 'kind = "eaws_posture"\ncycle = 2\nminimum_hold = 0.1\naccuracy_deg = 3',
    "eaws, seen": 'kind = "eaws_posture"\ncycle = 2\nminimum_hold = 0.1\naccuracy_deg = 3\nlimit = 50\n'
    'phases = [{ legs = "posture", back_supported = false }]\n' + SECTIONS,
    "eaws, in turns": 'kind = "eaws_posture"\ncycle = 2\nminimum_hold = 0.1\nlimit = 50\n'
    'phases = [{ legs = "posture", back_supported = true }, { start = 2.02, legs = "sitting" }, '
    "{ start = 2.03, back_supported = true }]\n" + SECTIONS,
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
        alone = "asked instant by instant: what is entered changes twice between two instants"
        assert (one.note, other.note[:15]) == (alone * (name == "eaws, in turns"), "asked instant b")
        told |= set(one.answers.verdict.tolist())
        np.testing.assert_array_equal(one.answers.verdict, other.answers.verdict, name)
        np.testing.assert_array_equal(one.value, other.value, name)
        np.testing.assert_array_equal(one.answers.limit, other.answers.limit, name)
        if other.answers.interval is not None:
            np.testing.assert_array_equal(one.answers.interval, other.answers.interval, name)
    assert told >= set(map(CODES.__getitem__, Verdict))


@pytest.mark.parametrize("threads", [1, 3])
@pytest.mark.parametrize("seed", range(3))
def test_what_is_counted_as_time_goes_on_is_counted_in_arrays_too(tmp_path, monkeypatch, seed, threads):
    """Postures that are held and left, silences, and instants at which nobody knows where the person is."""
    rules = {name: rule for name, rule in RULES.items() if name.startswith("eaws") and "turns" not in name}
    station = made(
        tmp_path,
        STANDS
        + "".join(f'[[ergonomics]]\nname = "{name}"\nhuman = "op"\n{rule}\n' for name, rule in rules.items()),
    )
    rng = np.random.default_rng(seed)
    q = random_q(70, seed, 0.5)[np.repeat(rng.permutation(70), rng.integers(1, 20, 70))]
    q[:260] = 0.0  # exact in all of a stretch, and not in the next one
    q[rng.random(len(q)) < 0.02 * seed] = np.nan
    steps = np.where(rng.random(len(q)) < 0.01 * seed, 1.5, rng.choice([0.01, 0.03, 0.05], len(q)))
    given = ({"op": q}, {"op": np.zeros_like(q)}), {"t": np.cumsum(steps), "threads": threads}
    many = station.batch(*given[0], **given[1])
    monkeypatch.setattr(Criterion, "batch", lambda *_: None)
    each = station.batch(*given[0], **given[1])
    told = {code for name in rules for code in each[name].answers.verdict.tolist()}
    silent = (steps[1:] > 1.0).any()  # after which nothing is judged
    assert told >= {CODES[verdict] for verdict in ((None, Verdict.UNDECIDED) if silent else (None, *Verdict))}
    for name in rules:
        one, other = many[name], each[name]
        assert (one.note, other.note[:15]) == ("", "asked instant b")
        for key in ("value", "limit", "verdict", "nothing"):
            np.testing.assert_array_equal(getattr(one.answers, key), getattr(other.answers, key), name)
        ends = (one.value, one.value) if other.answers.interval is None else other.answers.interval
        np.testing.assert_array_equal(one.answers.interval or (one.value, one.value), ends)
        unheard = np.isnan(q).any(axis=1)
        np.testing.assert_array_equal(one.reasons[unheard], other.reasons[unheard])


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
