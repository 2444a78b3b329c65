"""The permissible-speed map and what comes of it: closed forms, published vectors, the same road again."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from made_cell import FLOATING, TWO_R, heard, made, meant, state_at, two_r
from seerob.app import cli
from seerob.core.errors import InputError
from seerob.core.samples import Quality
from seerob.session.permissible import evaluation
from seerob.session.permissible.ceilings import By
from seerob.session.permissible.evaluation import Wish
from seerob.session.permissible.rescaled import Rescaled

LIMITS = "acceleration_limits = [6.0, 6.0]\njerk_limits = [60.0, 60.0]\n"
PERSON = (
    '[[humans]]\nname = "op"\nstature = 1.75\nmass = 75\nsex = "male"\nat = {{ position = [{x}, 0, -1] }}\n'
)
SSM = (
    '[[safety]]\nkind = "separation"\nname = "S"\nbetween = ["arm", "op"]\nhuman_speed = 1.6\n'
    "stop = {{ acceleration = 0, reaction = 0.1, stopping = 0.3 }}\n"
    "intrusion = 0.05\nhuman_uncertainty = 0.02\n{Z_r}"
)
KNOWN = SSM.format(Z_r="robot_uncertainty = 0.01\n")
KEPT_OUT = 'excluded = ["Skull and forehead", "Face", "Larynx, eyes and ears", "Feet"]\n'
AREAS = 'contact_area = { "arm/l1" = 1e-4, "arm/l2" = 1e-4 }\nmass = "simplified"\n'
ACCEPTED = 'between_samples = "accepted: contact is asked at ticks, and by the plan between them"\n'
PFL = f'[[safety]]\nkind = "power_and_force"\nname = "F"\nrobot = "arm"\nfloor = false\n{ACCEPTED}{AREAS}'
SOURCE = '[[sources]]\nkind = "csv"\nrobot = "arm"\nfile = "motion.csv"\n'


def turn(duration=1.0, angle=0.4):
    """Joint 1 from −angle to angle, from rest to rest; joint 2 stretched out."""
    t = np.linspace(0, duration, 51)
    x = t / duration
    q = angle * (2 * (10 * x**3 - 15 * x**4 + 6 * x**5) - 1)
    qd = 2 * angle * (30 * x**2 - 60 * x**3 + 30 * x**4) / duration
    rows = [f"{a:.9g},{b:.12g},0,{c:.12g},0" for a, b, c in zip(t, q, qd, strict=True)]
    return "t [s],J1 [rad],J2 [rad],J1 velocity [rad/s],J2 velocity [rad/s]\n" + "\n".join(rows) + "\n"


def cell(folder, *criteria, x=3.2, more="", masses=(1.0, 1.0), limits=LIMITS):
    text = FLOATING + TWO_R + limits + PERSON.format(x=x) + SOURCE + more + "".join(criteria)
    return made(folder, text + meant(text), {"arm.urdf": two_r(masses=masses), "motion.csv": turn()})


COARSE = Wish(spacing=0.1, verify=0.02)

LEVER = np.hypot(2, 0.05)
"""Of the arm's farthest corner [m]."""


def test_separation_permits_the_speed_of_the_closed_form(tmp_path):
    """(v + v_h)(T_r + T_s) + K = d at the part that governs, with d of the same pose."""
    station = cell(tmp_path, KNOWN)
    found = station.permissible_speed(wish=Wish(verify=0.02))
    (stations,) = found.map.stations
    model = station.model
    gap = model.gap(model.select("op"), model.robot("arm").moving)
    q = found.path.pieces[0].at(stations.s)[0]
    seen = 0
    for k in range(0, len(stations.s), 4):
        state = state_at(
            station, arm=(q[k], (0, 0)), op=(model.human("op").home, np.zeros_like(model.human("op").home))
        )
        d = gap.query.per_body(state.rotations, state.positions).distance
        levers = np.array([np.hypot(1, 0.05), LEVER])
        v = (d - 0.08 - gap.deviation) / 0.4 - 1.6
        expected = (v / levers).min()
        if expected < 10:
            seen += 1
            assert stations.permissible[k] == pytest.approx(max(expected, 0), rel=1e-9)
            governs = stations.governing[k]
            assert governs.speed == pytest.approx(max(v[int(governs.surface[5]) - 1], 0), rel=1e-9)
    assert seen > 3


def test_contact_permits_the_published_speed_of_the_hand(tmp_path):
    """KUKA LWR4+, M = 14.4 kg, m_L = 1.441 kg, k = 75 N/mm: 1.321645 m/s by the printed energy."""
    load = '[[tools]]\nname = "load"\non = "arm/tip"\nmass = 1.441\nshape = { sphere = 0.04 }\n'
    areas = PFL.replace("}\nmass", ', "load" = 1e-4 }\nmass')
    station = cell(tmp_path, areas + KEPT_OUT, masses=(7.2, 7.2), more=load)
    found = station.permissible_speed(wish=COARSE)
    hands = [
        c for all_of in found.map.stations[0].ceilings for c in all_of if c.region == "Hands and fingers"
    ]
    assert [(round(c.speed, 6), c.governs, c.contact) for c in hands] == [(1.321645, "energy", "free")] * len(
        hands
    )
    # Path speed is that of joint 1; the farthest surface is faster by its lever.
    worst = min(found.map.stations[0].permissible)
    assert worst * np.hypot(2.04, 0) <= min(c.speed for c in hands) * 1.01


@pytest.mark.parametrize("criteria", [(PFL + KEPT_OUT,), (KNOWN,), (PFL + KEPT_OUT, KNOWN)])
def test_the_rescaled_motion_is_within_where_the_given_one_was_not(tmp_path, criteria):
    found = cell(tmp_path, *criteria).permissible_speed(wish=Wish(spacing=0.05, verify=0.02))
    assert found.rescaled is not None
    assert "exceeded" in {series.verdict for series in found.before.values()}
    assert {series.verdict for series in found.after.results.values()} == {"within"}
    assert max(vars(found.check).values()) <= 1.0
    assert sum(spent.time for spent in found.spent) == pytest.approx(found.rescaled.duration, rel=1e-6)
    t = np.arange(0, found.rescaled.duration, 1e-3)
    q = found.rescaled.at(t)[0]
    (stations,) = found.map.stations
    # One joint moves: its speed is the path speed.
    s = q[:, 0] - q[0, 0]
    v = np.diff(s) / 1e-3
    least = np.minimum(stations.between(s[1:]), stations.between(s[:-1]))
    assert (v <= least * (1 + 1e-6)).all()


def test_a_head_may_be_hit_at_no_speed(tmp_path):
    """Near a person the head is never a number: there is no motion then, and the reason is said."""
    near = PFL + 'human = "op"\nhorizon = 3.0\n'
    found = cell(tmp_path, near, x=2.6).permissible_speed(wish=COARSE)
    assert found.rescaled is None
    assert found.after is None
    assert "contact not permitted" in found.refused or "no limit available" in found.refused
    heads = {c.share for all_of in found.map.stations[0].ceilings for c in all_of if c.region == "Face"}
    assert heads == {0.0}


def test_without_a_person_what_is_open_is_no_number(tmp_path):
    """Anyone could stand there, with their head: undecided until other measures keep it out."""
    found = cell(tmp_path, PFL).permissible_speed(wish=COARSE)
    assert found.rescaled is None
    assert found.map.undecided
    assert np.isnan(found.map.stations[0].permissible).all()


def test_what_is_missing_makes_the_map_undecided(tmp_path):
    found = cell(tmp_path, SSM.format(Z_r="")).permissible_speed()
    assert np.isnan(found.map.stations[0].permissible).all()
    assert "robot_uncertainty" in found.refused
    assert found.rescaled is None


def test_criteria_that_were_not_asked_do_not_count(tmp_path):
    station = cell(tmp_path, PFL + KEPT_OUT, SSM.format(Z_r=""))
    found = station.permissible_speed(wish=Wish(by=By.PFL, spacing=0.1, verify=0.02))
    assert found.map.asked == ("F",)
    assert found.rescaled is not None
    assert found.after.results["S"].verdict in ("undecided", "exceeded")


def test_a_limit_of_a_tool_speed_is_one_more_ceiling(tmp_path):
    tip = '[[safety]]\nkind = "velocity"\nname = "V"\nat = "arm"\nlimit = 0.5\n'
    found = cell(tmp_path, tip).permissible_speed(wish=COARSE)
    np.testing.assert_allclose(found.map.stations[0].permissible, 0.25, rtol=1e-6)
    assert found.after.verdict == "within"
    assert found.after.results["V"].max() == pytest.approx(0.49, rel=1e-2)


def test_energy_falls_with_the_square_of_the_speed(tmp_path):
    """½ (1 + 4) q̇² of the point masses at 1 m and 2 m."""
    energy = '[[safety]]\nkind = "kinetic_energy"\nname = "E"\nrobot = "arm"\nlimit = 0.4\n'
    found = cell(tmp_path, energy).permissible_speed(wish=replace(COARSE, verify=9.0))
    np.testing.assert_allclose(found.map.stations[0].permissible, 0.4, rtol=1e-6)
    # A period longer than the plan: it is looked at all the same, and without a look it is not kept.
    assert (found.verified.asked, found.verified.kept) == (1, True)
    assert found.verified.use == pytest.approx(0.98, rel=1e-2)
    assert not replace(found.verified, asked=0).kept


def test_not_faster_than_given(tmp_path):
    tip = '[[safety]]\nkind = "velocity"\nname = "V"\nat = "arm"\nlimit = 9.0\n'
    station = cell(tmp_path, tip)
    free, held = (
        station.permissible_speed(wish=Wish(not_faster=x, spacing=0.1, verify=0.02)).rescaled
        for x in (False, True)
    )
    assert isinstance(free, Rescaled)
    assert isinstance(held, Rescaled)
    assert free.duration < held.duration
    t = np.arange(0, held.duration, 1e-3)
    assert np.abs(held.at(t)[1]).max() <= 1.5 + 1e-6  # 0.8 rad · 15/8 / 1 s


def test_limits_that_nobody_gave_are_asked_for(tmp_path):
    station = cell(tmp_path, KNOWN, limits="")
    with pytest.raises(InputError) as caught:
        station.permissible_speed()
    assert [p.key for p in caught.value.problems] == [
        "robots.arm.acceleration_limits",
        "robots.arm.jerk_limits",
    ]
    assert "--jerk" in str(caught.value)


@pytest.mark.parametrize("wrong", [-1.0, 0.0, float("nan"), [1.0, 2.0, 3.0]])
def test_limits_that_cannot_be(tmp_path, wrong):
    with pytest.raises(InputError, match=r"robots\.arm\.jerk_limits"):
        cell(tmp_path, KNOWN).permissible_speed(jerk=wrong)


def test_no_criterion_no_map(tmp_path):
    with pytest.raises(InputError, match="no criterion"):
        cell(tmp_path).permissible_speed()


def test_it_can_be_stopped_and_leaves_nothing(tmp_path):
    class Stop(Exception):
        pass

    def say(what, share):
        if what == "the rescaled motion" and share > 0.3:
            raise Stop

    with pytest.raises(Stop):
        cell(tmp_path / "cell", KNOWN).permissible_speed(wish=COARSE, say=say)
    assert not (tmp_path / "cell" / "runs").exists()


MOVED = (
    '[[sources]]\nkind = "csv"\nrobot = "other"\nfile = "other.csv"\n[[robots]]\nname = "other"\n'
    'model = "arm.urdf"\nbase = { position = [0, 9, 0] }\n'
)


def test_who_ends_early_stands_still_and_that_is_said(tmp_path):
    text = FLOATING + TWO_R + LIMITS + MOVED + SOURCE + PERSON.format(x=3.2) + PFL + KEPT_OUT
    # It ends at rest: who ends in motion is not known to stand.
    rows = [f"{t:.1f},{0.1 * np.sin(min(t, 0.6)):.6f},0" for t in np.arange(0, 0.95, 0.1)]
    short = "t [s],J1 [rad],J2 [rad]\n" + "\n".join(rows) + "\n"
    station = made(tmp_path, text, {"arm.urdf": two_r(), "motion.csv": turn(), "other.csv": short})
    found = station.permissible_speed("arm", wish=Wish(rounds=2, spacing=0.1, verify=0.02))
    assert "other" in {f.subject for f in found.findings if "stands still after" in f.text}
    assert found.after.verdict == "within"


def test_the_samples_of_a_given_motion():
    samples = [heard("arm", t, (t, 0.0), (1.0, 0.0)) for t in (0.0, 1.0, 2.0)]
    found = evaluation.GivenMotion.of(samples)
    np.testing.assert_allclose(found.at(np.array([0.25, 1.5]))[0][:, 0], [0.25, 1.5])
    assert not found.derived
    assert found.good.all()
    for wrong in ([*samples, samples[0]], [samples[0], samples[0]]):
        with pytest.raises(InputError, match="does not increase"):
            evaluation.GivenMotion.of(wrong)
    for few in ([], samples[:1]):
        with pytest.raises(InputError, match=f"{len(few)} samples"):
            evaluation.GivenMotion.of(few)
    assert evaluation.GivenMotion.of(samples[1:]).duration == 1.0
    # Whoever says no velocity once has none of their own: they are slopes, of what is known and is no jump.
    said = [*samples, heard("arm", 3.0, (3.0, 0.0))]
    derived = evaluation.GivenMotion.of(said)
    assert derived.derived
    np.testing.assert_allclose(derived.qd[:, 0], 1.0)
    doubts = (
        (Quality.DEGRADED, 20.0, [20.0] * 4),
        (Quality.INVALID, 20.0, [20, 20, 0, 0]),
        (Quality.GOOD, 40.0, [0] * 4),
    )
    for quality, rate, qd in doubts:
        each = [
            heard("arm", t, (rate * t, 0.0), quality=quality if t == 2 else Quality.GOOD) for t in range(4)
        ]
        found = evaluation.GivenMotion.of(each)
        np.testing.assert_allclose(found.qd[:, 0], qd, atol=1e-9)
        assert found.good.tolist() == [True, True, quality is Quality.GOOD, True]
    for t, q, qd in ((2.0, np.nan, 1.0), (2.0, 2.0, np.inf), (np.inf, 2.0, 1.0)):
        with pytest.raises(InputError, match="not finite"):
            evaluation.GivenMotion.of([*samples[:2], heard("arm", t, (q, 0.0), (qd, 0.0))])


def test_the_command(tmp_path, capsys):
    cell(tmp_path / "cell", PFL + KEPT_OUT, KNOWN)
    out = tmp_path / "out"
    words = ["permissible", str(tmp_path / "cell"), "-o", str(out), "--spacing", "0.1", "--verify", "0.02"]
    assert cli.main([*words, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["verdict"] == "within"
    assert {b["side"] for b in told["bounds"]} == {"at least", "at most"}
    names = {path.name for path in out.iterdir()}
    assert names == {
        "map.csv",
        "map_by_region.csv",
        "rescaled.csv",
        "permissible.xlsx",
        "report.html",
        "segments.csv",
    }
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "Permissible speed along the path" in page
    assert "Between the samples" in page
    assert cli.main(words) == 3
