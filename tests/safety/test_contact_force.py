"""What presses on a person in the twin: a force that closes with Newton's law, and never a green verdict."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[1] / "human"))

from made_capture import captured, frames_of, source, workstation
from msgspec.structs import replace
from test_touching import desk, pressing

from seerob.core.snapshot import Origin, Verdict
from seerob.criteria.safety.contact_force import ContactForce, pressed, regions_of
from seerob.description.norms import body_limits
from seerob.session import run as road
from seerob.session.run import Judge
from seerob.session.station import Station
from seerob.twin.engine import Engine


def made(criterion, depth=0.7, **options):
    t, q = pressing(depth=depth, seconds=1.2)
    tables = desk() | options
    return Station(replace(workstation(source(captured(frames_of(t, q))), **tables), safety=(criterion,)))


def results(criterion, depth=0.7, **options):
    stage = made(criterion, depth, **options)
    engine, judge = Engine(stage.model, driven={"operator": 0.2}), Judge(stage.bound)
    told = []
    for seq, samples in enumerate(road.pump(stage.sources, 0.01)):
        engine.take(samples)
        state = engine.tick() if seq else engine.start()
        told.append((state.t, judge(state)[0], state.touches))
    return told


def test_a_hand_pressed_on_a_desk_is_a_force_and_never_within():
    told = results(ContactForce(name="f", human="operator", area=1e-4))
    assert Verdict.WITHIN not in {r.verdict for _, r, _ in told}
    assert Verdict.WITHIN not in {p.verdict for _, r, _ in told for p in r.parts}
    before = [r for t, r, _ in told if 0 < t < 0.1]
    assert {(r.verdict, r.value) for r in before} == {(None, 0.0)}
    _, last, touches = told[-1]
    forces = [part for part in last.parts if part.unit == "N"]
    # All that the desk feels is what the person feels.
    assert sum(part.value for part in forces) == pytest.approx(sum(force for *_, force in touches))
    assert all(part.name.startswith("desk on operator/right_") for part in forces)
    pressures = [part for part in last.parts if part.unit == "Pa"]
    assert [p.value for p in pressures] == pytest.approx([1e4 * f.value for f in forces])
    assert last.verdict is Verdict.EXCEEDED
    (bound,) = made(ContactForce(name="f", human="operator", area=1e-4)).bound
    inputs = {i.name: i.origin for i in bound.basis.inputs}
    assert inputs["contact forces"] is Origin.ESTIMATED


def test_without_physics_or_contacts_nothing_is_known():
    for options in ({"engine": {"physics": False}}, {"contacts": []}):
        told = results(ContactForce(name="f", human="operator"), **options)
        assert {r.verdict for _, r, _ in told[1:]} == {Verdict.UNDECIDED}


def test_each_bone_has_the_least_limit_of_its_regions_and_a_head_none_at_all():
    table = body_limits.shipped()
    hand = regions_of("left_hand", table)
    least = min(region.force.value for region in hand)
    assert pressed("x", least * (1 - 2e-9), None, hand)[0].verdict is None
    assert pressed("x", least, None, hand)[0].verdict is Verdict.EXCEEDED
    assert pressed("x", 1e-3, None, regions_of("head", table))[0].verdict is Verdict.EXCEEDED
    foot = pressed("x", 1e5, 1e-4, regions_of("left_foot", table))
    assert {(part.verdict, part.limit) for part in foot} == {(None, None)}
    back = regions_of("lumbar", table)
    assert {region.name for region in back} == {"Abdomen", "Back and shoulders"}
