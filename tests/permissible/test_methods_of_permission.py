"""Separation monitoring, power and force limiting, both, or either: which speed comes out."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from test_permissible_speed import KEPT_OUT, KNOWN, LIMITS, PERSON, PFL, SOURCE, cell, turn

from made_cell import FLOATING, TWO_R, made, two_r
from seerob.core.errors import InputError
from seerob.core.snapshot import Result
from seerob.core.verdict import Verdict
from seerob.recording.series import CODES, Series
from seerob.session.permissible.ceilings import By, Ceiling, Method, governing
from seerob.session.permissible.evaluation import Wish, either_permits, given_motion, witness
from seerob.session.permissible.joint_limits import joint_limits
from seerob.session.permissible.path import path_of
from seerob.session.permissible.survey import Survey

NAN = math.nan


def share(by, ssm, pfl, own=math.inf):
    ceilings = [Ceiling(m.value, s, method=m) for m, s in zip(Method, (ssm, pfl, own), strict=True)]
    found = governing(ceilings, by)
    return 1.0 if found is None else found.share


@pytest.mark.parametrize(
    ("ssm", "pfl", "expected"),
    # all, ssm, pfl, both, either
    [
        (0.2, 0.6, (0.2, 0.2, 0.6, 0.2, 0.6)),
        (0.6, 0.2, (0.2, 0.6, 0.2, 0.2, 0.6)),
        (0.0, 0.3, (0.0, 0.0, 0.3, 0.0, 0.3)),
        (math.inf, 0.3, (0.3, 1.0, 0.3, 0.3, 1.0)),
        (NAN, 0.3, (NAN, NAN, 0.3, NAN, 0.3)),
        (NAN, 0.0, (NAN, NAN, 0.0, NAN, NAN)),  # either: the unknown one might permit it
        (0.4, NAN, (NAN, 0.4, NAN, NAN, 0.4)),
        (NAN, NAN, (NAN, NAN, NAN, NAN, NAN)),
        (0.0, 0.0, (0.0, 0.0, 0.0, 0.0, 0.0)),
    ],
)
def test_what_two_methods_permit_together(ssm, pfl, expected):
    np.testing.assert_array_equal([share(by, ssm, pfl) for by in By], expected)
    # A limit of the file counts whatever is chosen.
    limited = [min(x, 0.1) for x in expected]
    np.testing.assert_array_equal([share(by, ssm, pfl, 0.1) for by in By], limited)


COARSE = Wish(spacing=0.1, verify=0.02)


def maps(station, *bys):
    """The maps alone, without a rescaled motion."""
    model, sources = station.model, station.sources
    motion, _ = given_motion(model, sources, "arm")
    seen, *_ = witness(model, sources, station.bound, station.scene().criteria, lambda what, share: None)
    path, robot = path_of(motion, tolerance=5e-4), model.robot("arm")
    limits = joint_limits(robot, acceleration=6.0, jerk=60.0)
    criteria = model.workstation.safety
    return {
        by: Survey(model, robot, motion, path, limits, seen, criteria=criteria, by=by)
        .map(spacing=0.1)
        .stations[0]
        for by in bys
    }


def test_either_is_the_larger_and_both_the_lesser_at_every_place(tmp_path):
    station = cell(tmp_path, KNOWN, PFL + KEPT_OUT)
    at = {by: stations.permissible for by, stations in maps(station, *By).items()}
    np.testing.assert_allclose(at[By.BOTH], np.minimum(at[By.SSM], at[By.PFL]), rtol=1e-12)
    np.testing.assert_allclose(at[By.ALL], at[By.BOTH], rtol=1e-12)
    np.testing.assert_allclose(at[By.EITHER], np.maximum(at[By.SSM], at[By.PFL]), rtol=1e-12)
    assert (at[By.SSM] < at[By.PFL]).any()
    assert (at[By.SSM] > at[By.PFL]).any()


def test_either_is_quicker_and_judged_together(tmp_path):
    station = cell(tmp_path, KNOWN, PFL + KEPT_OUT)
    either, both = (station.permissible_speed(wish=replace(COARSE, by=by)) for by in (By.EITHER, By.BOTH))
    assert either.rescaled.duration < both.rescaled.duration
    # Each method by itself is exceeded somewhere, the two together never.
    assert either.after.verdict == Verdict.EXCEEDED
    assert either.verified.kept
    assert either.verdict == both.verdict == Verdict.WITHIN


def test_a_method_that_a_run_takes_back_permits_nothing_alone(tmp_path):
    """The arm gets faster than the file says, which only the run finds: nothing rests on separation then."""
    text = FLOATING + TWO_R + LIMITS + PERSON.format(x=3.2) + SOURCE + KNOWN + PFL + KEPT_OUT
    station = made(tmp_path, text, {"arm.urdf": two_r(), "motion.csv": turn()})
    found = station.permissible_speed(wish=replace(COARSE, by=By.EITHER))
    assert CODES[Verdict.UNDECIDED] in found.after.results["S"].verdicts
    assert found.verified.kept
    assert found.verdict is Verdict.UNDECIDED


@pytest.mark.parametrize(
    ("S", "F", "between", "expected"),
    [
        ("wx", "xw", "accepted: looked at", Verdict.WITHIN),
        ("wx", "xx", "accepted: looked at", Verdict.EXCEEDED),
        ("wu", "xx", "accepted: looked at", Verdict.UNDECIDED),
        # Where contact has nothing to judge, the plan's own looks say whether it permits.
        ("wx", "xn", "accepted: looked at", Verdict.WITHIN),
        ("wx", "xw", "nothing bounds it", Verdict.UNDECIDED),
        ("ww", "xw", "nothing bounds it", Verdict.WITHIN),
    ],
)
def test_one_of_two_methods_has_to_permit_every_tick(S, F, between, expected):
    verdicts = {"w": Verdict.WITHIN, "x": Verdict.EXCEEDED, "u": Verdict.UNDECIDED, "n": None}
    log = {
        "S": Series(name="S", unit="m", at_most=False),
        "F": Series(name="F", unit="", at_most=True, between=between),
    }
    for name, said in (("S", S), ("F", F)):
        for k, letter in enumerate(said):
            result = Result(name=name, verdict=verdicts[letter], nothing=letter == "n")
            log[name].pass_time(result, 0.01 * k)
            log[name].append(result, 0.01 * k)
    assert either_permits(log, {"S": Method.SSM, "F": Method.PFL}) is expected


def test_contact_counts_wherever_people_are_when_it_permits_alone(tmp_path):
    """Beyond the horizon of contact nothing is judged, which must not look like permission."""
    far = PFL + KEPT_OUT + 'human = "op"\nhorizon = 0.1\n'
    station = cell(tmp_path, KNOWN, far, x=3.0)
    ssm, either = maps(station, By.SSM, By.EITHER).values()
    anyone = [c for all_of in either.ceilings for c in all_of if c.method is Method.PFL]
    assert {c.region for c in anyone} >= {"Chest", "Hands and fingers"}
    assert (either.permissible >= ssm.permissible).all()
    assert np.isfinite(either.share).all()
    assert (either.share < 1).any()


@pytest.mark.parametrize("by", [By.PFL, By.ALL])
def test_contact_alone_permits_no_more_where_the_person_is_far(tmp_path, by):
    """Nobody within the horizon is no permission by contact: nothing else keeps them away."""
    contact = PFL + KEPT_OUT + 'human = "op"\nhorizon = 0.1\n'
    near = PFL + KEPT_OUT + 'human = "op"\nhorizon = 10\nperson_speed = 0\n'
    far = maps(cell(tmp_path / "far", contact + "person_speed = 0\n", x=9.0), by)[by]
    close = maps(cell(tmp_path / "near", near, x=3.0), by)[by]
    assert (far.share < 1).any()
    np.testing.assert_allclose(far.permissible, close.permissible, rtol=1e-9)


def test_what_a_person_moves_is_taken_off_the_speed_that_contact_permits(tmp_path):
    still, moves = (
        maps(cell(tmp_path / str(v), PFL + KEPT_OUT + f"person_speed = {v}\n"), By.PFL)[By.PFL].ceilings[0]
        for v in (0, 1.6)
    )
    assert {b.speed > 0 for b in moves} == {True, False}
    for a, b in zip(still, moves, strict=True):
        assert (a.region, a.reason) == (b.region, "")
        assert b.speed == pytest.approx(max(a.speed - 1.6, 0))
        assert b.share == pytest.approx(a.share * b.speed / a.speed)
        assert b.reason == ("" if b.speed else "the person alone is faster than permitted")


@pytest.mark.parametrize(
    ("criteria", "by", "message"),
    [
        ((KNOWN,), By.PFL, "needs a criterion of kind power_and_force"),
        ((KNOWN,), By.BOTH, "needs a criterion of kind power_and_force"),
        ((PFL + KEPT_OUT,), By.SSM, "needs a criterion of kind separation"),
        ((PFL + KEPT_OUT,), By.EITHER, "needs a criterion of kind separation"),
    ],
)
def test_a_method_that_nobody_asks_for_is_refused(tmp_path, criteria, by, message):
    with pytest.raises(InputError, match=message):
        cell(tmp_path, *criteria).permissible_speed(wish=Wish(by=by))


def test_either_is_refused_where_one_method_forgets_somebody(tmp_path):
    second = PERSON.format(x=-3.2).replace('"op"', '"guest"')
    with pytest.raises(InputError, match="either: separation does not ask about guest"):
        cell(tmp_path, KNOWN, PFL + KEPT_OUT, more=second).permissible_speed(wish=Wish(by=By.EITHER))


def test_fixed_separation_keeps_the_least_distance_of_the_way(tmp_path):
    """(v + v_h)(T_r + T_s) + K = least d of each part anywhere; the run again agrees, in its own mode."""
    station = cell(tmp_path, KNOWN + 'mode = "fixed"\n')
    found = station.permissible_speed(wish=Wish(spacing=0.02, verify=0.01))
    dynamic = cell(tmp_path / "dynamic", KNOWN).permissible_speed(wish=COARSE)
    (stations,) = found.map.stations
    # The arm turns about z: what each part may do is the same everywhere but for its nearest place.
    limited = stations.permissible[stations.share < 1]
    assert np.ptp(limited) <= 1e-9
    assert limited[0] == pytest.approx(dynamic.map.stations[0].permissible.min(), rel=2e-2)
    assert limited[0] <= dynamic.map.stations[0].permissible.min() * (1 + 1e-9)
    assert found.after.results["S"].verdict == Verdict.WITHIN
    assert found.before["S"].verdict == Verdict.EXCEEDED
