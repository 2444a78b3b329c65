"""Of a person of whom a part is seen: what that part exceeds is exceeded, and nothing is within."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from made_cell import FLOATING, made, state_at
from seerob.core.snapshot import Result, Verdict
from seerob.criteria.body_parts import seen_first
from seerob.criteria.judging import Judge
from seerob.description.humans.skeleton import BONES
from seerob.twin.validity.hearing import BonesHeard

PERSON = '[[humans]]\nname = "op"\nstature = 1.75\nmass = 75\nsex = "male"\n'
RIGHT = frozenset(bone for bone in BONES if bone.startswith("right_"))
FEET = frozenset(bone for bone in BONES if "foot" in bone or "toe" in bone or "shank" in bone)
AREA = '[[safety]]\nkind = "safety_area"\nname = "it"\narea = "zone"\nof = {of}\n'
MAT = '[[safety]]\nkind = "pressure_mat"\nname = "it"\nsensor = "mat"\nof = {of}\n'
NEAR = '[[safety]]\nkind = "minimum_distance"\nname = "it"\nbetween = ["plate", "op"]\nlimit = 0.01\n'
CELL = """
[[areas]]
name = "zone"
shape = {{ box = [4, 4, 0.1] }}
at = {{ position = [0, 0, {z}] }}
[[parts]]
name = "plate"
shape = {{ box = [4, 4, 0.1] }}
at = {{ position = [0, 0, {z}] }}
[[parts]]
name = "high"
shape = {{ box = [0.1, 0.1, 0.1] }}
at = {{ position = [9, 9, 9] }}
[[sensors]]
name = "mat"
response = 0.1
at = {{ position = [0, 0, {z}] }}
pressure_mat = {{ corners = [[-2, -2], [2, -2], [2, 2], [-2, 2]] }}
"""


@pytest.mark.parametrize("asked", [AREA, MAT, NEAR], ids=["safety_area", "pressure_mat", "minimum_distance"])
@pytest.mark.parametrize(
    ("z", "unseen", "verdict"),
    [
        # Across the ankles.
        (0.1, (), "exceeded"),
        (0.1, RIGHT, "exceeded"),
        (0.1, FEET, "undecided"),
        # Far above.
        (5.0, (), "within"),
        (5.0, RIGHT, "undecided"),
    ],
)
def test_what_is_seen_exceeds_and_what_is_not_seen_leaves_it_open(tmp_path, asked, z, unseen, verdict):
    text = FLOATING + PERSON + CELL.format(z=z) + asked.format(of='["op", "high"]')
    station = made(tmp_path, text)
    state = state_at(station)
    hearing = state.hearings["op"]
    hearing.bones = dict.fromkeys(BONES, (0.0, 0.0))
    hearing.bones_heard[:] = [BonesHeard(0.0, observed=frozenset(BONES) - frozenset(unseen))]
    (found,) = Judge(station.bound)(state)
    assert found.verdict == verdict
    if unseen and verdict == "exceeded":
        assert "without op/right_" in found.reason
        assert found.reason.endswith(" more, which may be elsewhere")
        assert not any(part.name.startswith("op/right_") for part in found.parts)


@pytest.mark.parametrize(
    ("accepted", "verdicts"), [(0.3, ["within", "undecided"]), (None, ["undecided"] * 2)]
)
def test_an_estimate_that_the_file_accepts_may_be_off_by_so_much(tmp_path, accepted, verdicts):
    """Something flat 0.35 m and 0.25 m above a person of 1.75 m, of whom no device sees the head."""
    more = "" if accepted is None else f"unseen_uncertainty = {accepted}\n"
    for k, verdict in enumerate(verdicts):
        text = FLOATING + PERSON + more + CELL.format(z=1.75 + 0.05 + 0.35 - 0.1 * k)
        station = made(tmp_path / str(k), text + NEAR.replace("0.01", "0.005"))
        state = state_at(station)
        hearing = state.hearings["op"]
        hearing.bones = dict.fromkeys(BONES, (0.0, 0.0))
        hearing.bones_heard[:] = [BonesHeard(0.0, observed=frozenset(BONES) - {"head"})]
        assert Judge(station.bound)(state)[0].verdict == verdict


def answering(verdict, reason):
    return lambda state: Result(name="it", verdict=verdict, reason=reason)


def losing(*lost):
    bodies = [SimpleNamespace(name=f"b{i}") for i in range(20)]
    return SimpleNamespace(invalid_bodies=lambda _: lost, model=SimpleNamespace(bodies=bodies))


@pytest.mark.parametrize(
    ("lost", "named"),
    [((0,), "b0"), ((0, 1, 2), "b0, b1, b2"), ((0, 1, 2, 3), "b0, b1, b2 and 1 more")],
)
@pytest.mark.parametrize("part", [Verdict.EXCEEDED, Verdict.WITHIN, Verdict.UNDECIDED, None])
def test_three_that_may_be_elsewhere_are_named_and_the_rest_counted(lost, named, part):
    whole = answering(Verdict.UNDECIDED, "whole")
    asked = seen_first(tuple(range(20)), whole, lambda _: part and answering(part, "part"))
    told = f"part; without {named}, which may be elsewhere" if part is Verdict.EXCEEDED else "whole"
    assert asked(losing(*lost)).reason == told
    assert asked(losing()).reason == "whole"


def test_a_question_is_made_once_for_each_of_the_last_sixteen_sets():
    made_for = []
    asked = seen_first((0,), answering(None, ""), made_for.append)
    for k in [*range(16), *range(16), 16, 1, 0]:
        asked(losing(k))
    assert made_for == [(k,) for k in [*range(17), 0]]


@pytest.mark.parametrize("observed", [set(), {"left_hand"}])
def test_of_whom_nothing_is_seen_nothing_is_known(tmp_path, observed):
    """Across the ankles of a person who is seen before or never: no bone is left to ask about."""
    station = made(tmp_path, FLOATING + PERSON + CELL.format(z=0.1) + NEAR)
    state = state_at(station)
    state.hearings["op"].bones_heard[:] = [
        BonesHeard(0.0, observed=frozenset(observed)),
        BonesHeard(0.1, observed=frozenset()),
    ]
    (found,) = Judge(station.bound)(state)
    assert found.verdict == "undecided"
    assert "no device sees" in found.reason
