"""A person of whom devices see a part: the worst that is known is enough for exceeded, never for within."""

from __future__ import annotations

import pytest

from made_cell import FLOATING, TWO_R, heard, made, two_r
from seerob.description.humans.skeleton import BONES
from seerob.session.run import Judge
from seerob.twin.engine import Engine
from seerob.twin.validity.hearing import BonesHeard

CELL = """[[humans]]
name = "op"
stature = 1.75
mass = 75
sex = "male"
at = { position = [WHERE, 0, -1] }
[[areas]]
name = "zone"
shape = { box = [6, 6, 4] }
[[sensors]]
name = "curtain"
capability = 0.03
response = 0.02
source = "data sheet"
light_curtain = { ends = [[2.4, -1, -1], [2.4, 1, -1]], height = 2, pitch = 0.02 }
[[sensors]]
name = "mat"
at = { position = [2.4, 0, -1] }
response = 0.02
source = "data sheet"
pressure_mat = { corners = [[-1, -1], [1, -1], [1, 1], [-1, 1]] }
"""
SAFETY = {
    "safety_area": 'area = "zone"\nof = "op"',
    "separation_area": 'separation = "S"\nof = "op"',
    "power_and_force": 'robot = "arm"\nhuman = "op"\nhorizon = 1.2\nmass = "simplified"\n'
    'contact_area = { "arm/l1" = 1e-4, "arm/l2" = 1e-4 }\nexcluded = ["Feet"]',
    "light_curtain": 'sensor = "curtain"\nof = "op"',
    "pressure_mat": 'sensor = "mat"\nof = "op"',
}
S = (
    '[[safety]]\nkind = "separation"\nname = "S"\nbetween = ["arm", "op"]\nhuman_speed = 1.6\nintrusion = 0\n'
    "human_uncertainty = 0\nrobot_uncertainty = 0\n"
    "stop = { acceleration = 0, reaction = 0.1, stopping = 0.3 }\n"
)


def judged(folder, seen, *, x=2.4):
    """What every criterion says while a device sees some bones of the person."""
    criteria = [f'[[safety]]\nkind = "{kind}"\nname = "{kind}"\n{text}\n' for kind, text in SAFETY.items()]
    text = FLOATING + TWO_R + CELL.replace("WHERE", str(x)) + S + "".join(criteria)
    station = made(folder, text, {"arm.urdf": two_r()})
    engine = Engine(station.model, driven={"arm": 0.2})
    engine.take([heard("arm", 0.0, (0.0, 0.0), (3.0, 0.0))])
    state = engine.start()
    state.hearings["op"].bones_heard[:] = [BonesHeard(0.0, observed=frozenset(seen))]
    return {result.name: result for result in Judge(station.bound)(state)}


WITHOUT_HEAD = tuple(bone for bone in BONES if bone != "head")


def test_what_is_seen_exceeds_by_itself_in_every_criterion(tmp_path):
    whole = judged(tmp_path / "whole", BONES)
    partly = judged(tmp_path / "partly", WITHOUT_HEAD)
    for kind in SAFETY:
        assert whole[kind].verdict == "exceeded", kind
        assert partly[kind].verdict == "exceeded", kind
        assert "without op/head" in partly[kind].reason, kind
    assert partly["S"].verdict == "exceeded"
    for kind in ("safety_area", "separation_area"):
        names = {part.name for part in whole[kind].parts} - {part.name for part in partly[kind].parts}
        assert names == {"op/head"}, kind
    names = {part.name for part in partly["power_and_force"].parts}
    assert "Skull and forehead" not in names
    assert {"Skull and forehead", "Chest"} <= {part.name for part in whole["power_and_force"].parts}


@pytest.mark.parametrize("kind", [*SAFETY, "S"])
def test_what_is_seen_within_says_nothing_of_the_rest(tmp_path, kind):
    """Far from everything: never exceeded for who is seen whole, undecided for who is not."""
    whole = judged(tmp_path / "whole", BONES, x=9.0)
    partly = judged(tmp_path / "partly", WITHOUT_HEAD, x=9.0)
    assert whole[kind].verdict == (None if kind == "power_and_force" else "within")
    assert partly[kind].verdict == "undecided"
    assert "no device sees" in partly[kind].reason
