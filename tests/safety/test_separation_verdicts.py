"""Speed and separation monitoring: which part governs, what decides, and every term and unit, by hand."""

from __future__ import annotations

import numpy as np
import pytest

from made_cell import basis_in, heard, results_at, state_at, two_r
from made_separation import BOUND, TABLE, K, V, part, separation, station, terms
from made_separation import KNOWN as TERMS
from seerob.core.errors import InputError
from seerob.core.verdict import Verdict
from seerob.criteria.judging import Judge
from seerob.criteria.stopping.models import MOVING
from seerob.description.humans.skeleton import BONES
from seerob.distance.least import Query
from seerob.twin.engine import Engine
from seerob.twin.validity.hearing import BonesHeard

KNOWN = TERMS + "human_speed = 1.6\n"
V_H, T = 1.6, 0.4
STIFF = 'acceleration = 0, reaction = 0.1, model = "simulated", brakes = [4e3, 2e3]'
"""Brakes so strong that a simulated stop takes a few milliseconds."""
AT_HOME = ((0.0, 0.0), (1.0, 0.0))
OUT = '<visual><origin xyz="0.5 0 0"/><geometry><box size="1.04 0.14 0.14"/></geometry></visual>'
"""A display mesh 20 mm larger than the links' boxes."""


def cell(folder, stop=BOUND, options=KNOWN, **more):
    return station(folder, stop, options, **more)


def found(folder, stop=BOUND, options=KNOWN, **more):
    return separation(folder, stop, options, **more)


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    return cell(tmp_path_factory.mktemp("plain"))


@pytest.fixture(scope="module")
def larger(tmp_path_factory):
    """Whose surfaces may stick out."""
    urdf = two_r().replace("</collision></link>", f"</collision>{OUT}</link>")
    return cell(tmp_path_factory.mktemp("larger"), urdf=urdf)


def test_every_figure_has_its_unit_and_its_side(plain):
    S = results_at(plain, arm=AT_HOME)["S"]
    assert (S.unit, S.at_most, S.limit) == ("m", False, pytest.approx((V + V_H) * T + K))
    units = {p.name: (p.unit, p.at_most) for p in S.parts if p.limit is not None or p.at_most is False}
    assert units == {
        "arm/l1": ("m", False), "arm/l2": ("m", False),
        "largest permissible speed": ("m/s", False), "share of the present speed": ("", False),
    }  # fmt: skip
    assert {p.unit for p in S.parts if p.name in ("S_h", "S_r", "S_s", "C", "Z_d", "Z_r")} == {"m"}


def test_the_part_that_governs_is_the_one_with_the_least_room_and_not_the_nearest(tmp_path):
    """The person stands behind the arm: l1 is a metre nearer, l2 at 5 rad/s needs two metres more."""
    S = found(tmp_path, x=-9.0, qd=(5.0, 0.0))
    near, far = (part(S, name) for name in ("arm/l1", "arm/l2"))
    assert near.value < far.value
    assert far.limit - near.limit == pytest.approx(5 * (V - np.hypot(1, 0.05)) * T)
    assert (S.value, S.limit, S.verdict) == (far.value, far.limit, Verdict.WITHIN)
    # Within: who it is, and nothing that decides.
    assert S.reason.startswith("arm/l2 ↔ op/")
    assert ": " not in S.reason


@pytest.mark.parametrize(("more", "verdict"), [(1e-8, "within"), (1e-10, "exceeded"), (-1e-10, "exceeded")])
def test_the_verdict_of_a_distance_turns_at_its_limit(tmp_path, plain, more, verdict):
    room = results_at(plain, arm=AT_HOME)["S"]
    tight = KNOWN.replace("= 0.2", f"= {0.2 + room.value - room.limit - more!r}")
    S = found(tmp_path, BOUND, tight)
    assert S.value - S.limit == pytest.approx(more, abs=1e-11)
    assert (S.verdict, part(S, "arm/l2").verdict, S.interval) == (verdict, verdict, None)


def test_what_is_not_known_counts_as_nothing_and_leaves_open_only_what_is_within(tmp_path):
    sparse = "human_speed = 1.6\n"
    far, near = found(tmp_path / "far", BOUND, sparse), found(tmp_path / "near", BOUND, sparse, x=3.0)
    assert far.limit == pytest.approx((V + V_H) * T)
    assert [part(far, name).value for name in ("C", "Z_d", "Z_r")] == [0, 0, 0]
    assert (far.verdict, part(far, "arm/l1").verdict) == (Verdict.UNDECIDED, Verdict.UNDECIDED)
    assert "not given: intrusion (C), human_uncertainty (Z_d), robot_uncertainty (Z_r)" in far.reason
    assert "decided by" not in far.reason
    assert near.verdict is Verdict.EXCEEDED


def test_where_devices_see_the_person_is_off_by_what_the_bones_are(plain):
    state = state_at(plain, arm=AT_HOME)
    (before,) = Judge(plain.bound)(state)
    assert (before.interval, part(before, "arm/l1").interval) == (None, None)
    state.hearings["op"].bones = dict.fromkeys(BONES, (0.03, 0.0))
    (after,) = Judge(plain.bound)(state)
    for was, now in ((before, after), (part(before, "arm/l1"), part(after, "arm/l1"))):
        assert now.interval == pytest.approx((was.value - 0.03, was.value + 0.03), abs=1e-12)


@pytest.mark.parametrize(
    ("intrusion", "seen", "decides"),
    [
        (0.0, 0.2, "tracking of the person ± 200 mm"),
        (0.05, 0.04, "intrusion ± 50 mm"),
        (0.05, 0.06, "tracking of the person ± 60 mm"),
    ],
)
def test_the_input_that_makes_the_interval_widest_decides(tmp_path, plain, intrusion, seen, decides):
    """± C against ± what devices are off by: both on one side."""
    room = results_at(plain, arm=AT_HOME)["S"]
    x = 6.0 - (room.value - room.limit)
    open_ = cell(tmp_path, BOUND, KNOWN + f"intrusion_tolerance = {intrusion}\n", x=x)
    state = state_at(open_, arm=AT_HOME)
    state.hearings["op"].bones = dict.fromkeys(BONES, (seen, 0.0))
    (S,) = Judge(open_.bound)(state)
    assert S.verdict is Verdict.UNDECIDED
    assert S.reason.endswith(f": decided by {decides}")
    assert S.interval == pytest.approx((S.value - seen - intrusion, S.value + seen + intrusion), abs=1e-9)


def test_an_interval_shows_what_tolerances_alone_leave_open(tmp_path):
    S = found(tmp_path, BOUND, KNOWN.replace("= 0.2", "= 0") + "intrusion_tolerance = 0.3\n")
    assert S.verdict is Verdict.WITHIN
    # C is never below 0.
    assert S.interval == pytest.approx((S.value - 0.3, S.value), abs=1e-12)
    slower = found(tmp_path / "v", BOUND, KNOWN + "human_speed_tolerance = 0.2\n")
    assert slower.interval == pytest.approx((slower.value - 0.2 * T, slower.value + 0.2 * T), abs=1e-12)
    assert [(i.name, i.value, i.unit) for i in basis_in(tmp_path / "v").inputs if "tolerance" in i.name] == [
        ("tolerance of human_speed", 0.2, "m/s")
    ]


def test_the_fixed_distance_remembers_what_each_input_made_of_it(tmp_path):
    """A fast arm that points away, then one at rest that points at the person: the fast one decides.

    2 · 0.02 s · (1.6 m/s + 3 V) = 0.3 m is more than C's 2 · 0.07 m; at rest the reaction's would be 64 mm.
    """
    stop = BOUND + ", tolerance = { reaction = 0.02 }"
    options = KNOWN + 'intrusion_tolerance = 0.07\nmode = "fixed"\n'
    at_rest = found(tmp_path / "a", stop, options, qd=(0.0, 0.0))
    x = 6.0 - at_rest.value + (3 * V + V_H) * T + K
    open_ = cell(tmp_path / "b", stop, options, x=x)
    engine = Engine(open_.model, controllers=False)
    engine.take([heard("arm", 0.0, (np.pi, 0.0), (3.0, 0.0))])
    state, judge = engine.start(), Judge(open_.bound)
    (first,) = judge(state)
    assert first.verdict is Verdict.WITHIN
    engine.take([heard("arm", 0.01, (0.0, 0.0), (0.0, 0.0))])
    state = engine.tick()
    state.data.qpos[:2], state.data.qvel[:2] = 0.0, 0.0
    state.refresh(0.01)
    (second,) = judge(state)
    assert (second.limit, second.verdict) == (pytest.approx((3 * V + V_H) * T + K), Verdict.UNDECIDED)
    assert second.reason.endswith("decided by stop.reaction ± 20 ms")
    required = open_.bound[0].criterion.required(open_.model)
    assert required(state).S_p[1] == pytest.approx(V_H * T + K)


def test_the_distance_asked_for_is_that_of_the_present_speeds_and_in_the_fixed_mode_the_largest(tmp_path):
    for mode in ("dynamic", "fixed"):
        twin = cell(tmp_path / mode, BOUND, f'{KNOWN}mode = "{mode}"\n')
        S = twin.bound[0].criterion
        assert (S.batch(twin.model) is None) == (mode == "fixed")
        required, state = S.required(twin.model), state_at(twin, arm=AT_HOME)
        first = required(state).S_p
        assert first == pytest.approx([(v + V_H) * T + K for v in (np.hypot(1, 0.05), V)])
        state.data.qvel[0] = 0.5
        state.refresh(0.0)
        halved = [(v / 2 + V_H) * T + K for v in (np.hypot(1, 0.05), V)]
        assert required(state).S_p == pytest.approx(first if mode == "fixed" else halved)
    off = cell(tmp_path / "off", BOUND, KNOWN + "intrusion_tolerance = 0.1\n")
    assert off.bound[0].criterion.batch(off.model) is None


def test_what_a_surface_may_stick_out_is_in_every_separation_distance(larger):
    """Beside C, with which it is shown, and in the speed of the fastest point."""
    out = max(body.deviation for body in larger.model.bodies)
    assert out > 0.019
    S, state = larger.bound[0].criterion, state_at(larger, arm=AT_HOME)
    (result,) = Judge(larger.bound)(state)
    wanted = (V + out + V_H) * T + K + out
    assert result.limit == pytest.approx(wanted)
    assert part(result, "C").value == pytest.approx(0.2 + out)
    of_S_p = terms(result)
    assert of_S_p[:3] == pytest.approx([V_H * T, (V + out) * 0.1, (V + out) * 0.3])
    assert sum(of_S_p) == pytest.approx(wanted)
    assert S.required(larger.model)(state).S_p[1] == pytest.approx(wanted)
    distance = np.array([part(result, name).value for name in ("arm/l1", "arm/l2")])
    S_p, (speed, share) = S.inverse(larger.model)(state, distance)
    assert S_p[1] == pytest.approx(wanted)
    assert (speed, share) == (part(result, speed.name), part(result, share.name))
    answers = larger.batch({"arm": np.zeros((1, 2))}, {"arm": np.array([[1.0, 0.0]])})["S"].answers
    assert answers.limit == pytest.approx([wanted])


@pytest.mark.parametrize("mode", ["dynamic", "fixed"])
def test_terms_of_a_person_whose_speed_is_iso_13855s_sum_to_the_distance(tmp_path, mode):
    S = found(tmp_path, BOUND, f'{KNOWN.replace("human_speed = 1.6", "")}mode = "{mode}"\n')
    of_S_p = terms(S)
    assert of_S_p == pytest.approx([V_H * T, V * 0.1, V * 0.3, 0.2, 0.1, 0.05])
    assert sum(of_S_p) == pytest.approx(S.limit)


@pytest.mark.parametrize(("accepted", "verdict"), [(0.25, "within"), (None, "undecided")])
def test_a_bone_that_no_device_sees_is_estimated_where_the_file_accepts_it(tmp_path, accepted, verdict):
    more = "" if accepted is None else f"unseen_uncertainty = {accepted}\n"
    twin = cell(tmp_path, person=more)
    state = state_at(twin, arm=AT_HOME)
    hearing = state.hearings["op"]
    hearing.bones = dict.fromkeys(BONES, (0.0, 0.0))
    hearing.bones_heard[:] = [BonesHeard(0.0, observed=frozenset(BONES) - {"right_hand"})]
    (S,) = Judge(twin.bound)(state)
    assert S.verdict == verdict
    if accepted is not None:
        hand = twin.model.select("op/right_hand")
        near = Query(twin.model.shapes, hand, twin.model.robot("arm").moving)
        apart = near.minimum(state.rotations, state.positions).distance
        # The hand may be the nearest; what is seen is where it is.
        assert S.value < apart
        assert S.interval == pytest.approx((apart - accepted, S.value))


# -- the permissible speed ------------------------------------------------------------------------


def permissible(result):
    return [(p.value, p.reason) for p in result.parts[-2:]]


def test_a_robot_at_rest_has_no_present_speed_to_compare_with(tmp_path, plain):
    speed, share = permissible(results_at(plain, arm=((0.0, 0.0), (0.0, 0.0)))["S"])
    room = results_at(plain, arm=AT_HOME)["S"].value - V_H * T - K
    assert speed == (pytest.approx(room / T), "")
    assert share == (None, "stands still: no speed to compare with")
    still = (None, "stands still: no motion to scale")
    assert permissible(found(tmp_path / "a", TABLE, qd=(0.0, 0.0))) == [still, still]
    assert permissible(found(tmp_path / "b", TABLE, qd=(MOVING / 4, 0.0)))[0] == still
    # Whatever moves, be it the outer link alone.
    (value, _), _ = permissible(found(tmp_path / "c", TABLE, qd=(0.0, 0.1)))
    assert value == pytest.approx(10 * 0.1 * np.hypot(1, 0.05))


def test_beyond_ten_times_the_present_speed_is_no_share(plain):
    now = results_at(plain, arm=((0.0, 0.0), (0.01, 0.0)))["S"]
    (speed, said), share = permissible(now)
    room = now.value - V_H * T - K
    assert (speed, said) == (pytest.approx(room / T), "")
    assert share == (None, "more than 10 times the present speed")
    one = permissible(results_at(plain, arm=AT_HOME)["S"])[1]
    assert one == (pytest.approx(room / T / V), "")


def test_a_search_that_ends_at_the_top_says_or_more(tmp_path):
    """A table is asked for ten times the speeds, a simulated stop only for those of now."""
    top = permissible(found(tmp_path / "t", TABLE, qd=(0.1, 0.0)))
    assert top == [(pytest.approx(V), "or more"), (10.0, "or more")]
    less = permissible(found(tmp_path / "l", TABLE, qd=(1.0, 0.0)))
    assert 1 < less[1][0] < 10
    assert [said for _, said in less] == ["", ""]
    now = permissible(found(tmp_path / "s", STIFF))
    assert now == [(pytest.approx(V), "or more"), (1.0, "or more")]


def test_at_given_distances_a_sensor_counts_as_in_the_result(tmp_path):
    """S_p of a curtain: 20 ms later, and C of 8 (30 mm − 14 mm) = 128 mm."""
    curtain = '[[sensors]]\nname = "curtain"\ncapability = 0.03\nresponse = 0.02\n'
    curtain += "light_curtain = { ends = [[3, -2, 0.2], [3, 2, 0.2]], height = 1.5 }\n"
    options = KNOWN.replace("intrusion = 0.2\n", 'sensor = "curtain"\n')
    twin = cell(tmp_path, BOUND, options, more=curtain)
    state = state_at(twin, arm=AT_HOME)
    (result,) = Judge(twin.bound)(state)
    distance = np.array([part(result, name).value for name in ("arm/l1", "arm/l2")])
    S_p, (speed, share) = twin.bound[0].criterion.inverse(twin.model)(state, distance)
    assert part(result, "C").value == pytest.approx(0.128)
    assert S_p[1] == pytest.approx((V + V_H) * 0.42 + 0.128 + 0.15)
    assert S_p[1] == pytest.approx(result.limit)
    assert (speed, share) == (part(result, speed.name), part(result, share.name))


# -- what a stop needs ----------------------------------------------------------------------------


def test_only_a_simulated_stop_asks_for_masses(tmp_path):
    urdf = two_r()
    start = urdf.index("<inertial>", urdf.index('name="l2"'))
    bare = urdf[:start] + urdf[urdf.index("</inertial>", start) + len("</inertial>") :]
    assert found(tmp_path / "given", urdf=bare).verdict is Verdict.WITHIN
    S = found(tmp_path / "simulated", STIFF, urdf=bare)
    assert (S.verdict, "arm/l2" in S.reason) == (Verdict.UNDECIDED, True)
    # One that cannot be is refused by whoever needs it, and by nobody else.
    nothing = two_r(masses=(1.0, 0.0))
    assert found(tmp_path / "any", urdf=nothing).verdict is Verdict.WITHIN
    with pytest.raises(InputError, match="S needs it"):
        found(tmp_path / "refused", STIFF, urdf=nothing)


@pytest.mark.parametrize("given", ["", "human_speed = 1.6\n"])
@pytest.mark.parametrize("v", [4.0, 1.0])
def test_a_person_who_is_seen_to_be_faster_counts_with_what_is_seen(tmp_path, given, v):
    """The norm's walking speed is an assumption on somebody whom nobody watches."""
    cell = station(tmp_path, BOUND, TERMS + given)
    human = cell.model.human("op")
    runs = np.zeros(len(human.joints))
    runs[1] = v  # the pelvis goes along y
    state = state_at(cell, arm=AT_HOME, op=(human.home, runs))
    (S,) = Judge(cell.bound)(state)
    wanted = (V + max(v, 1.6)) * T + K
    assert S.limit == pytest.approx(wanted, rel=1e-6)
    assert ("seen at 4 m/s" in S.reason) == (v > 1.6)
    if given:
        assert part(S, "S_h").value == pytest.approx(max(v, 1.6) * T)
    assert part(S, "largest permissible speed").value == pytest.approx(
        part(S, "share of the present speed").value * V, rel=1e-6
    )
