"""What the picture says of who may be elsewhere is what criteria say of them."""

from __future__ import annotations

import numpy as np

from made_cell import FLOATING, TWO_R, heard, made, state_at, two_r
from seerob.core.errors import Undecided
from seerob.description.humans.skeleton import BONES
from seerob.session.run import Judge, bind, ticks
from seerob.session.scene import invalid_reasons
from seerob.twin.engine import Engine
from seerob.twin.validity.hearing import BonesHeard

PERSON = '[[humans]]\nname = "op"\nstature = 1.75\nmass = 75\nsex = "male"\n'
KNIFE = '[[tools]]\nname = "knife"\non = "op/right_hand"\nshape = { box = [0.02, 0.02, 0.2] }\nmass = 0.1\n'


def relied_on(state, body):
    try:
        state.require_bodies((body.index,))
    except Undecided:
        return False
    return True


def test_a_silent_robot_is_in_doubt_until_it_is_heard_again(tmp_path):
    station = made(tmp_path, FLOATING + TWO_R, {"arm.urdf": two_r()})
    engine = Engine(station.model, driven={"arm": 0.2})
    q = np.zeros(2)
    feed = [(heard("arm", k * 0.01, q),) if k < 10 or k == 60 else () for k in range(62)]
    told = [snapshot.doubts for snapshot, _ in ticks(engine, Judge(bind(station.model)), feed)]
    silent = [k for k, doubts in enumerate(told) if doubts]
    assert silent == list(range(30, 60))
    assert told[59] == {"arm": "arm: not heard for 0.50 s (time-out 0.2 s)"}


def test_bones_that_no_device_sees_are_named_with_what_the_person_holds(tmp_path):
    station = made(tmp_path, FLOATING + PERSON + KNIFE)
    state = state_at(station)
    assert invalid_reasons(state) == {}
    state.hearings["op"].bones = dict.fromkeys(BONES, (0.0, 0.0))
    seen = frozenset(bone for bone in BONES if not bone.startswith("right_"))
    state.hearings["op"].bones_heard[:] = [BonesHeard(0.0, observed=seen)]
    state.heard()
    doubts = invalid_reasons(state)
    assert "op" not in doubts
    assert "op/right_hand" in doubts
    for body in station.model.bodies:
        assert relied_on(state, body) == (not {body.name, body.mover} & doubts.keys()), body.name
