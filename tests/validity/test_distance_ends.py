"""Ends of distances to people whose bones may be elsewhere, by brute force over all pairs of bodies."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from made_cell import FLOATING, TWO_R, made, state_at, two_r
from seerob.description.humans.skeleton import BONES
from seerob.distance.least import Query
from seerob.twin.accuracy.distance_ends import DistanceEnds
from seerob.twin.accuracy.tracking_error import TrackingError
from seerob.twin.validity.hearing import BonesHeard

PEOPLE = "".join(
    f'[[humans]]\nname = "{name}"\nstature = 1.75\nmass = 75\nsex = "male"\n'
    f"at = {{ position = [{x}, 0, 0] }}\n"
    for name, x in (("op", 3.0), ("other", 4.2))
)


@pytest.mark.parametrize(
    ("first", "second"), [(0.0, 0.0), (0.04, 0.0), (0.0, 0.07), (0.04, 0.07), (None, None)]
)
def test_ends_of_two_people_are_those_of_all_pairs(
    tmp_path: Path, first: float | None, second: float | None
) -> None:
    station = made(tmp_path, FLOATING + TWO_R + PEOPLE, {"arm.urdf": two_r()})
    model, rng = station.model, np.random.default_rng(2)
    state = state_at(station, arm=((0.0, 0.0), (0.0, 0.0)))
    for name, error in (("op", first), ("other", second)):
        state.hearings[name].bones = {
            bone: (float(rng.exponential(0.1)) if error is None else error, 0.0) for bone in BONES
        }
    a, b = model.human("op").bodies, model.human("other").bodies
    gap = model.gap(a, b)
    d = Query(model.shapes, a, b).per_pair(state.rotations, state.positions).distance.reshape(len(a), len(b))
    own, others = TrackingError(model, a).at(state)[:, None], TrackingError(model, b).at(state)
    ends = DistanceEnds(model, gap)
    low, high = ends.of_bodies(state, d.min(axis=0))
    np.testing.assert_allclose(low, (d - own).min(axis=0) - others, atol=1e-12)
    np.testing.assert_allclose(high, (d + own).min(axis=0) + others, atol=1e-12)
    both = ends.of_sets(state, float(d.min()))
    assert both == pytest.approx(((d - own - others).min(), (d + own + others).min()), abs=1e-12)


def test_ends_are_told_of_who_is_seen_in_part_or_held_back_where_that_is_known(tmp_path: Path) -> None:
    """A hand that nobody sees, of whom the file accepts to guess it, and a person elsewhere than captured."""
    people = PEOPLE.replace('name = "op"', 'name = "op"\nunseen_uncertainty = 0.2')
    station = made(tmp_path, FLOATING + TWO_R + people, {"arm.urdf": two_r()})
    model, state = station.model, state_at(station, arm=((0.0, 0.0), (0.0, 0.0)))
    op, other = state.hearings["op"], state.hearings["other"]
    op.bones = dict.fromkeys(BONES, (0.01, 0.0))
    op.bones_heard[:] = [BonesHeard(0.0, observed=frozenset(BONES) - {"right_hand"})]
    other.captured, other.error = state.q(model.human("other")).copy(), 9.0
    state.heard()
    assert state.stray("other")
    a, b = model.human("op").bodies, model.human("other").bodies
    d = Query(model.shapes, a, b).per_pair(*state.placed((*a, *b), allow_estimated=True, strayed=True))
    apart = d.distance.reshape(len(a), len(b))
    off = TrackingError(model, a).at(state)
    assert sorted({*off.tolist()}) == pytest.approx([0.01, 0.2])
    ends = DistanceEnds(model, model.gap(a, b))
    low, high = ends.of_bodies(state, apart.min(axis=0))
    np.testing.assert_allclose(low, (apart - off[:, None]).min(axis=0), atol=1e-12)
    np.testing.assert_allclose(high, (apart + off[:, None]).min(axis=0), atol=1e-12)
