"""What a robot may have done while its samples were lost, by how its joints can accelerate."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np
import pytest
from msgspec.structs import replace

from live_stream import Stream
from made_cell import FLOATING, TWO_R, made, two_r
from seerob.core.samples import JointSample, PoseSample, SignalSample
from seerob.core.snapshot import Basis
from seerob.criteria.criterion import Criterion
from seerob.criteria.figure import Figure
from seerob.devices.live.listening import Listener, LiveSource
from seerob.session.station import Station
from seerob.twin.control.unheard import QUICKEST, Unheard
from seerob.twin.engine import Engine
from seerob.twin.spans import Fall, Gap, Path, Points

TIMEOUT = 0.2


def missing(*heard, acceleration=QUICKEST, numbers=None):
    """Whether samples are missing before each instant [s], of an arm whose joints accelerate so much."""
    unheard = Unheard("arm", np.array([acceleration / 2, acceleration]), TIMEOUT)
    found = []
    for k, t in enumerate(heard):
        unheard.hear(t, k if numbers is None else numbers[k], speeds=True)
        found.append(bool(unheard.ended(t)))
    return found


REGULAR = [0.008 * k for k in range(10)]


@pytest.mark.parametrize("acceleration", [QUICKEST, 8.0])
def test_what_is_missing_counts_where_a_joint_may_have_gone_away_and_come_back(acceleration):
    least = 4 * math.sqrt(0.005 / acceleration)
    for gap, found in ((0.99 * least, False), (1.01 * least, True)):
        times = [*REGULAR, REGULAR[-1] + gap, REGULAR[-1] + gap + 0.008]
        assert missing(*times, acceleration=acceleration) == [False] * 10 + [found, False]


def test_what_was_heard_and_replaced_before_a_tick_is_not_missing():
    """A run that is held up takes the newest of what came meanwhile."""
    times = [*REGULAR, REGULAR[-1] + 0.08]
    assert missing(*times)[-1]
    assert not missing(*times, numbers=[*range(10), 19])[-1]
    assert missing(*times, numbers=[*range(10), 11])[-1]


def test_what_is_heard_of_variables_makes_up_for_no_sample_of_the_robot():
    """A hundred of them had the numbers of the positions that were missing: those counted as replaced."""
    told = []
    ears = Listener(Spoken(name="plc", delay=0.0), None, told.append)
    for k in range(2000):
        t = 10 + 0.001 * k
        ears.take(SignalSample(source="", seq=0, t=t, values={"on": True}))
        if k % 8 == 0 and not 1000 < k < 1300:
            q = (0.001 * k,)
            ears.take(JointSample(source="", seq=0, t=t, target="arm", q=q))
    heard = [sample for sample in told if isinstance(sample, JointSample)]
    found = missing(*(sample.t for sample in heard), numbers=[sample.seq for sample in heard])
    assert [sample.t for sample, late in zip(heard, found, strict=True) if late] == [pytest.approx(11.304)]


class Spoken(LiveSource, frozen=True, kw_only=True):
    """A test speaks for it."""

    def target(self):
        return "arm"

    def period(self):
        return 0.008

    def listen(self, target):
        raise NotImplementedError


def test_a_slow_source_misses_nothing_that_comes_when_it_usually_does():
    slow = [0.09 * k for k in range(10)]
    assert not any(missing(*slow, slow[-1] + 0.16))
    assert missing(*slow, slow[-1] + 0.17)[-1]
    # Of three of four that are lost, the fourth tells what is usual.
    assert missing(*[0.02 * k for k in range(40) if k % 4 == 0 or k < 10])[-1]


def test_what_is_usual_is_a_quarter_of_the_intervals():
    """Of five short ones of 21 none is it; of six it is."""
    for short, found in ((5, False), (6, True)):
        times = np.cumsum([0.0, *[0.02] * short, *[0.06] * (20 - short), 0.1])
        assert missing(*times.tolist())[-1] is found


@pytest.mark.parametrize(("before", "after"), [(True, False), (False, True), (True, True), (False, False)])
def test_speeds_are_said_where_both_samples_say_them(before, after):
    unheard = Unheard("arm", np.array([QUICKEST]), TIMEOUT)
    for t in REGULAR:
        unheard.hear(t, 0, speeds=before)
    unheard.hear(REGULAR[-1] + 0.1, 0, speeds=after)
    (gap,) = unheard.ended(1.0)
    assert gap.speeds is (before and after)


def test_after_a_silence_all_begins_anew():
    assert not any(missing(0.0, 0.09, 0.18, 0.6, 0.76))
    assert missing(0.0, 0.09, 0.18, 0.57)[-1]  # which may have come before the time-out was over


def test_it_is_told_once_when_it_is_over():
    unheard = Unheard("arm", np.array([QUICKEST]), TIMEOUT)
    for t in (*REGULAR, REGULAR[-1] + 0.1):
        unheard.hear(t, 0, speeds=False)
    assert unheard.ended(REGULAR[-1] + 0.09) == ()
    (gap,) = unheard.ended(REGULAR[-1] + 0.101)
    assert (gap.name, gap.begin, gap.end, gap.speeds) == ("arm", REGULAR[-1], REGULAR[-1] + 0.1, False)
    assert unheard.ended(1.0) == ()


@pytest.fixture(scope="module")
def station(tmp_path_factory):
    return made(tmp_path_factory.mktemp("unheard"), FLOATING + TWO_R, {"arm.urdf": two_r()})


def span_of(station, T, speeds, q=(0.2, 0.4), v=(0.5, -0.8), a=6.0):
    """The bounds on an arm that goes straight on, with and without what is missing of it for T."""
    model = station.model
    ends = np.array([q, np.array(q) + T * np.array(v)])
    way = Path(np.array([0.0, T]), ends, np.array([v, v]))
    gap = Gap("arm", 0.0, T, np.full(2, a), speeds)
    ids = np.array([b.mj for b in model.bodies], np.int64)
    points = Points(model)
    loose = Path.joined([way], (gap,))
    return way, [points.span(each, 0.0, T, ids, model.mj) for each in (way, loose)]


@pytest.mark.parametrize("speeds", [True, False])
@pytest.mark.parametrize("seed", range(20))
def test_no_motion_within_its_accelerations_leaves_the_bounds(station, speeds, seed):
    """Motions that say at both ends what the straight one says, and in between are as hard as they may be."""
    chance, T, a = np.random.default_rng(seed), 0.08, 6.0
    way, (_, span) = span_of(station, T, speeds, a=a)
    s = np.linspace(0, 1, 4001)
    ends = s**2 * (1 - s) ** 2 if speeds else s * (1 - s)
    shape = ends * np.polynomial.polynomial.polyval(s, chance.normal(size=chance.integers(1, 5)))
    off = shape / np.abs(np.diff(shape, 2)).max() * (s[1] * T) ** 2 * a
    rate = np.gradient(off, s * T)
    other = off[::-1], -rate[::-1]
    q = np.array([way.at(x * T)[0] for x in s]) + np.column_stack([off, other[0]])
    v = np.array([0.5, -0.8]) + np.column_stack([rate, other[1]])
    assert (np.abs(v).max(axis=0) <= span.qd + 1e-6).all()
    tip = np.exp(1j * q[:, 0]) + np.exp(1j * q.sum(axis=1))
    speed = np.abs(np.gradient(tip, s * T))
    body = [b.name for b in station.model.bodies].index("arm/l2")
    assert speed.max() <= span.fast[body] + 1e-6
    assert np.abs(tip - tip[0]).max() <= span.way(np.array([body])) + 1e-6
    velocity = np.gradient(tip, s * T)
    straight = velocity[1] + s * (velocity[-2] - velocity[1])
    assert np.abs(velocity - straight)[2:-2].max() <= span.bend[body] + 1e-3


def test_the_bounds_are_those_of_the_hardest_way_there_and_back(station):
    """It speeds up for T/4, brakes and turns round for T/2, and brakes for T/4; no faster than its limit."""
    T = 0.08
    for a, speeds, faster, away in (
        (6.0, True, 6 * T / 4, 6 * T**2 / 16),
        (6.0, False, 6 * T / 2, 6 * T**2 / 8),
        # At its limit it is for all but the turn, where it is braked and speeds up again.
        (2000.0, True, 10 - 0.5, (10 - 0.5) * T / 2),
    ):
        _, (plain, loose) = span_of(station, T, speeds, a=a)
        assert loose.qd[0] - plain.qd[0] == pytest.approx(faster)
        assert loose.away[0] - plain.away[0] == pytest.approx(away)
        assert loose.qdd[0] == a


# -- in a run -----------------------------------------------------------------------------------

RATE, BEGAN, LASTS = 125.0, 3.0, 0.1
CELL = (
    FLOATING
    + TWO_R
    + """acceleration_limits = [20, 20]
[[sources]]
kind = "rtde"
robot = "arm"
host = "127.0.0.1"
frequency = 125
[[parts]]
name = "post"
shape = { box = [0.1, 0.1, 0.1] }
at = { position = [0, 2, 0] }
[[safety]]
kind = "velocity"
name = "speed"
at = "arm/tip"
limit = LIMIT
[[safety]]
kind = "minimum_distance"
name = "distance"
between = ["arm", "post"]
limit = APART
"""
)


def packets(lost):
    """Of an arm that stands, along x; nobody knows what it does while they are lost."""
    found = []
    for k in range(int(5 * RATE)):
        t = k / RATE
        if not (lost and BEGAN < t < BEGAN + LASTS):
            found.append((t + 0.001, 100.0 + t, (np.zeros(2), np.zeros(2))))
    return found


@pytest.mark.parametrize("lost", [True, False])
@pytest.mark.parametrize(
    ("limit", "apart", "open"),
    [(1.6, 1.5, []), (1.5, 1.5, ["speed"]), (1.6, 1.88, ["distance"]), (1.5, 1.88, ["speed", "distance"])],
)
def test_lost_packets_open_what_is_near_its_limit_and_no_more(
    tmp_path, monkeypatch, lost, limit, apart, open
):
    """Both joints may have been 0.52 rad/s faster, of 2 m and 1 m: 1.56 m/s, and 15 cm away."""
    text = CELL.replace("LIMIT", str(limit)).replace("APART", str(apart))
    live = Stream(made(tmp_path, text, {"arm.urdf": two_r()}), monkeypatch, "arm", packets(lost))
    told = [results for _, results, _ in live.ticks(450)]
    for k, name in enumerate(("speed", "distance")):
        verdicts = [results[k].verdict for results in told]
        undecided = [results[k].reason for results in told if results[k].verdict == "undecided"]
        assert set(verdicts) <= {"within", "undecided"}
        assert len(undecided) == (lost and name in open)
        assert all("samples of arm are missing from" in reason for reason in undecided)


def test_one_acceleration_limit_is_that_of_all_joints(tmp_path, monkeypatch):
    text = CELL.replace("[20, 20]", "[20]").replace("LIMIT", "1.5").replace("APART", "1.5")
    live = Stream(made(tmp_path, text, {"arm.urdf": two_r()}), monkeypatch, "arm", packets(True))
    told = [results[0].verdict for _, results, _ in live.ticks(450)]
    assert told.count("undecided") == 1


def test_poses_of_a_tool_may_be_missing_too(station):
    model = station.model
    engine = Engine(model, driven={"arm": TIMEOUT}, live={"arm"})
    gaps = []
    for k in range(60):
        t = 0.01 * k
        if not 0.3 < t < 0.39:
            pose = {"position": (1.9, 0.1, 0.0), "wxyz": (1.0, 0.0, 0.0, 0.0)}
            engine.take([PoseSample(source="test", seq=0, t=t, target="arm/tip", **pose)])
        state = engine.tick() if k else engine.start()
        gaps += [] if state.path is None else state.path.gaps
    (gap,) = gaps
    assert (gap.begin, gap.end, gap.speeds) == (pytest.approx(0.3), pytest.approx(0.39), False)


class Delicate(Criterion, frozen=True, kw_only=True):
    """A bound of one's own that is wrong of a way of several ticks."""

    unit: ClassVar[str] = "m/s"
    limit: float = 5.0

    def compute(self, model):
        at = model.select("arm/l2")
        return lambda twin: Figure(twin.fastest_speed(at), self.limit)

    def basis(self, model):
        return Basis(formula="", source="")

    def depends(self, model):
        return ("arm",)

    def falls(self, model, points):
        def fall(span, margin):
            if span.T > 0.011:
                raise RuntimeError("one tick at a time")
            return Fall(0.01)

        return fall


def test_a_bound_of_ones_own_that_fails_ends_no_run(tmp_path, monkeypatch):
    text = CELL.replace("LIMIT", "1.6").replace("APART", "1.5")
    cell = made(tmp_path, text, {"arm.urdf": two_r()})
    cell = Station(replace(cell.workstation, safety=(*cell.workstation.safety, Delicate(name="own"))))
    live = Stream(cell, monkeypatch, "arm", packets(True))
    told = [results for _, results, _ in live.ticks(450)]
    assert {each[0].verdict for each in told} == {"within"}
    own = [each[2] for each in told]
    assert [r.verdict for r in own[:300]].count("within") > 250
    assert own[-1].verdict == "undecided"
    assert "failed: RuntimeError: one tick at a time" in own[-1].reason


@pytest.mark.parametrize(("limit", "open"), [(2.85, False), (2.65, True)])
def test_a_robot_that_states_nothing_may_accelerate_as_published_arms_do(tmp_path, monkeypatch, limit, open):
    """By 35 rad/s²: 0.91 rad/s faster in 0.104 s, 2.73 m/s of the tip."""
    text = CELL.replace("acceleration_limits = [20, 20]\n", "").replace("LIMIT", str(limit))
    live = Stream(
        made(tmp_path, text.replace("APART", "1.0"), {"arm.urdf": two_r()}), monkeypatch, "arm", packets(True)
    )
    verdicts = {results[0].verdict for _, results, _ in live.ticks(450)}
    assert verdicts == ({"within", "undecided"} if open else {"within"})
