"""The map where criteria are muted or rest on inputs that may be off, and what clamps by name."""

from __future__ import annotations

import math

import mujoco
import numpy as np
import pytest
from test_methods_of_permission import maps
from test_permissible_speed import KEPT_OUT, KNOWN, LIMITS, PERSON, PFL, SOURCE, cell, turn

from made_cell import FLOATING, TWO_R, made, two_r
from seerob.core.errors import Undecided
from seerob.core.snapshot import Result
from seerob.core.verdict import Verdict
from seerob.criteria.safety.kinetic_energy import KineticEnergy
from seerob.criteria.safety.minimum_distance import MinimumDistance
from seerob.criteria.safety.power_and_force import Contacts
from seerob.criteria.safety.velocity import Velocity
from seerob.session.permissible.ceilings import By, Ceiling, Method, ceilings_of, governing
from seerob.session.permissible.witness import Posed, Witness
from seerob.twin.accuracy.tracking_error import TrackingError
from seerob.twin.state import State
from seerob.twin.validity.hearing import BonesHeard, Hearing

PLC = '[[sources]]\nkind = "signals_csv"\nname = "plc"\nfile = "s.csv"\ntime = "t"\ntime_unit = "s"\n'
GATE = '[[variables]]\nname = "gate/open"\nsource = "plc"\naddress = "x"\ntype = "bool"\n'
MUTED = KNOWN.replace('name = "S"', 'name = "S"\nactive = "gate/open"')


def gated(folder, until, *, told=1.05):
    """Asked up to an instant [s]; the gate is heard up to ``told`` [s]."""
    head = 'variables = "v.toml"\n' + FLOATING + TWO_R + LIMITS + PERSON.format(x=3.2) + SOURCE
    rows = [f"{0.05 * k:.2f},{int(0.05 * k <= until)}" for k in range(21) if 0.05 * k <= told]
    signals = {"v.toml": GATE, "s.csv": "\n".join(["t,x", *rows])}
    text = head + PLC + "timeout = 0.2\n" + MUTED
    return made(folder, text, {**signals, "arm.urdf": two_r(), "motion.csv": turn()})


def test_a_criterion_limits_nothing_where_it_is_muted_and_is_open_where_nobody_knows(tmp_path):
    always = maps(cell(tmp_path / "always", KNOWN), By.ALL)[By.ALL]
    some = maps(gated(tmp_path / "some", 0.5), By.ALL)[By.ALL]
    lost = maps(gated(tmp_path / "lost", 2.0, told=0.5), By.ALL)[By.ALL]
    early, late = some.t < 0.45, some.t > 0.75
    assert (always.share[late] < 1).any()
    np.testing.assert_allclose(some.share[early], always.share[early], rtol=1e-12)
    assert (some.share[late] >= 1).all()
    assert {c.surface.partition(":")[0] for of in always.ceilings for c in of} == {"arm/l2"}  # is nearest
    told = {c.reason for k in np.flatnonzero(late) for c in some.ceilings[k]}
    assert told == {"not asked: gate/open is false"}
    assert not any(c.asked for k in np.flatnonzero(late) for c in some.ceilings[k])
    assert all(c.asked for k in np.flatnonzero(early) for c in some.ceilings[k])
    np.testing.assert_allclose(lost.share[early], always.share[early], rtol=1e-12)
    assert np.isnan(lost.share[late]).all()


@pytest.mark.parametrize(("by", "expected"), [(By.ALL, 0.3), (By.EITHER, 0.3), (By.SSM, 1.0), (By.PFL, 0.3)])
def test_a_method_that_is_not_asked_is_not_enough_by_itself(by, expected):
    ceilings = [
        Ceiling("S", math.inf, method=Method.SSM, asked=False),
        Ceiling("F", 0.3, method=Method.PFL),
    ]
    found = governing(ceilings, by)
    assert (1.0 if found is None else found.share) == expected


@pytest.mark.parametrize("unknown", ["arm/l1", "arm/l2"])
def test_where_one_part_has_edges_that_nobody_knows_no_speed_is_permitted(tmp_path, unknown):
    known = PFL.replace(f'"{unknown}" = 1e-4', "").replace("{ ,", "{").replace(",  }", " }")
    found = maps(cell(tmp_path, known + KEPT_OUT + "horizon = 4.0\n", x=2.3), By.PFL)[By.PFL]
    ceilings = [c for k in range(len(found.t)) for c in found.ceilings[k]]
    assert len({c.region for c in ceilings}) > 5
    assert {(c.undecided, c.surface) for c in ceilings} == {(True, unknown)}


def test_what_a_stop_may_be_off_by_counts_in_full(tmp_path):
    """The map with tolerances is that of the longest times."""
    off = KNOWN.replace(
        "stopping = 0.3 ", "stopping = 0.3, tolerance = { reaction = 0.02, stopping = 0.05 } "
    )
    longest = KNOWN.replace(
        "acceleration = 0, reaction = 0.1, stopping = 0.3",
        "acceleration = 0, reaction = 0.12, stopping = 0.35",
    )
    tolerant, worst, nominal = (
        maps(cell(tmp_path / str(i), text), By.ALL)[By.ALL].permissible
        for i, text in enumerate((off, longest, KNOWN))
    )
    np.testing.assert_allclose(tolerant, worst, rtol=1e-12)
    assert (tolerant < nominal).any()


def test_what_masses_may_be_off_by_counts_in_full(tmp_path):
    """E = ½ M q̇² with masses 20 % larger: the share falls by √1.2."""
    energy = '[[safety]]\nkind = "kinetic_energy"\nname = "E"\nrobot = "arm"\nlimit = 0.5\n'
    given = maps(cell(tmp_path / "a", energy), By.ALL)[By.ALL].share
    off = "mass_tolerance = 0.2\n" + LIMITS
    tolerant = maps(cell(tmp_path / "b", energy, limits=off), By.ALL)[By.ALL].share
    limited = tolerant < 1
    assert limited.any()
    np.testing.assert_allclose(tolerant[limited], (given / np.sqrt(1.2))[limited], rtol=1e-9)


@pytest.mark.parametrize("floor", [True, False])
def test_what_clamps_on_the_floor_says_so(tmp_path, floor):
    """An arm that comes down onto the floor from 5 cm above it, and the same one without a floor."""
    turned = two_r().replace('axis xyz="0 0 1"', 'axis xyz="0 1 0"')
    text = FLOATING + TWO_R + LIMITS + "base = { position = [0, 0, 0.5] }\n" + SOURCE + PFL + KEPT_OUT
    text = text.replace("floor = false", f"floor = {str(floor).lower()}")
    station = made(tmp_path, text, {"arm.urdf": turned, "motion.csv": turn(angle=0.2)})
    (found,) = maps(station, By.ALL).values()
    contacts = {c.contact for each in found.ceilings for c in each}
    assert ("clamped on the floor" in contacts) == floor
    if floor:
        words = {c.words() for each in found.ceilings for c in each if c.region == "Chest"}
        assert any(word.startswith("F: Chest, clamped on the floor, ") for word in words)
    # The figure that is told is the one of the table: of areas that are hit alike that of the least pressure.
    of = Contacts(station.model.workstation.safety[0], station.model)
    limited = [c for each in found.ceilings for c in each if c.governs in ("force", "pressure")]
    assert {c.contact.split()[0] for c in limited} == ({"free", "clamped"} if floor else {"free"})
    for c in limited:
        region = of.arrays.regions[of.columns[c.region]]
        factor = 1 if c.contact.startswith("clamped") else of.arrays.multiplier[of.columns[c.region]]
        least = min(area.pressure.value for area in region.areas)
        assert c.limit.value == pytest.approx(
            factor * (least if c.governs == "pressure" else region.force.value)
        )


class Told(Velocity, frozen=True, kw_only=True):
    """What it is to say of any state."""

    says: dict

    def bind(self, model):
        return lambda state: Result(name=self.name, unit="m/s", limit=self.limit, **self.says)


UNDECIDED = {"verdict": Verdict.UNDECIDED, "reason": "who knows"}


@pytest.mark.parametrize(
    ("says", "share", "reason"),
    [
        ({"reason": "who knows"}, math.nan, "who knows"),
        ({}, math.nan, "V says no figure"),
        ({"value": 0.2, **UNDECIDED}, math.nan, "who knows"),  # it is the least that it may be
        ({"value": 0.2, "interval": (0.1, 0.5), **UNDECIDED}, math.nan, "who knows"),
        ({"value": 0.4, "interval": (0.3, 1.0), **UNDECIDED}, 0.5, ""),
        ({"value": 1.0, "verdict": Verdict.EXCEEDED}, 0.5, ""),
        ({"value": 0.25, "verdict": Verdict.WITHIN}, 2.0, ""),
        ({"value": 0.0, "verdict": Verdict.WITHIN}, math.inf, ""),
    ],
)
def test_a_speed_that_nobody_knows_permits_nothing(tmp_path, says, share, reason):
    model = made(tmp_path, FLOATING + TWO_R, {"arm.urdf": two_r()}).model
    ask = ceilings_of(Told(name="V", at="arm", limit=0.5, says=says), model, "arm", anywhere=False)
    (found,) = ask.ceilings(None)
    assert found.share == pytest.approx(share, rel=1e-6, nan_ok=True)
    assert found.reason == reason
    assert found.speed == pytest.approx(math.nan if reason else 0.5, nan_ok=True)
    assert found.governs == ("" if reason else "speed")


def test_only_what_limits_the_speed_of_this_robot_is_asked(tmp_path):
    both = TWO_R + TWO_R.replace('"arm"', '"two"') + "base = { position = [0, 9, 0] }\n"
    model = made(tmp_path, FLOATING + both + PERSON.format(x=4) + KNOWN, {"arm.urdf": two_r()}).model
    for kind, of in (
        (KineticEnergy, {"robot": "arm"}),
        (Velocity, {"at": "arm"}),
        (Velocity, {"of": "arm"}),
        (MinimumDistance, {"between": ("arm", "op")}),
    ):
        speed = kind is not MinimumDistance
        for limit in (0.5, None):
            asks = [
                ceilings_of(kind(name="C", limit=limit, **of), model, robot, anywhere=False)
                for robot in ("arm", "two")
            ]
            assert [ask is not None for ask in asks] == [speed and limit is not None, False]
    for by, alone, beside in ((By.ALL, True, False), (By.PFL, True, True), (By.EITHER, True, True),
                              (By.SSM, False, False), (By.BOTH, False, False)):  # fmt: skip
        asked = [by.contact_anywhere(model.workstation.safety, robot) for robot in ("two", "arm")]
        assert [by.contact_anywhere([], "arm"), *asked] == [alone, alone, beside]


def test_where_somebody_is_is_as_sure_as_in_the_run(tmp_path):
    """A person that the run had doubts of is in doubt for every question, also for that of each bone."""
    model = cell(tmp_path, KNOWN).model

    class Doubtful:
        def others(self, t):
            return np.zeros(model.mj.nq), np.zeros(model.mj.nv), {"op": "op: not heard"}

        def heard(self, t):
            return {}, {}

    state = Posed(model, model.robot("arm"), Doubtful())
    state.place(0.0, 0.0, np.zeros(2), np.zeros(2))
    gap = model.gap(model.select("op"), model.robot("arm").moving)
    with pytest.raises(Undecided, match="op: not heard"):
        state.closest_per_body(gap)


def test_a_hand_that_nobody_sees_aimed_is_as_far_off_in_the_map_as_in_the_run(tmp_path):
    """What is not known of how a hand is turned comes off its distance, wherever that is asked."""
    model = cell(tmp_path, KNOWN).model
    state = State(
        model, mujoco.MjData(model.mj), {n: Hearing(given=True, driven=False) for n in model.mechanisms}
    )
    state.hearings["op"].bones = {"right_hand": (0.01, None)}
    state.hearings["op"].bones_heard[:] = [BonesHeard(0.0, unaimed={"right_hand": 0.5})]
    witness = Witness(lambda _: ())
    state.refresh(0.0)
    witness(state)
    posed = Posed(model, model.robot("arm"), witness)
    posed.place(3.0, 0.0, np.zeros(2), np.zeros(2))
    off = TrackingError(model, model.select("op/right_hand"))
    assert off.at(state).max() > 0.02
    np.testing.assert_array_equal(off.at(posed), off.at(state))
