"""Of a person of whom a part is seen: what that part exceeds is exceeded, and nothing is within."""

from __future__ import annotations

import pytest

from made_cell import FLOATING, made, state_at
from seerob.human.skeleton import BONES
from seerob.judging import Judge

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
    hearing.observed[:] = [(0.0, frozenset(BONES) - frozenset(unseen))]
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
        station = made(tmp_path / str(k), text + NEAR.replace("0.01", "0.001"))
        state = state_at(station)
        hearing = state.hearings["op"]
        hearing.bones = dict.fromkeys(BONES, (0.0, 0.0))
        hearing.observed[:] = [(0.0, frozenset(BONES) - {"head"})]
        assert Judge(station.bound)(state)[0].verdict == verdict
