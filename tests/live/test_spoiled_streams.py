"""A stream that is spoiled on its way, compared tick by tick with a motion in closed form."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pytest
from msgspec.structs import replace

from live_stream import BEGIN, OFFSET, Stream
from made_cell import TWO_R, made, two_r
from seerob.core.samples import JointSample
from seerob.devices.live.device_clock import SETTLED, SLEW
from seerob.session.run import Judge, bind, engine_of, ticks
from seerob.twin.engine import NEAR

RATE = 125.0
OMEGA, SIZE = 2.0, np.array([0.5, -0.3])
FASTEST, HARDEST = 0.5 * OMEGA, 0.5 * OMEGA**2
"""Of a joint [rad/s, rad/s²]."""
WAY = 0.001
"""From the device to here [s]."""

STATION = (
    TWO_R
    + """
[[sources]]
kind = "rtde"
robot = "arm"
host = "127.0.0.1"
frequency = 125
[[safety]]
kind = "velocity"
name = "speed"
at = "arm/tip"
limit = 5.0
"""
)


def motion(t):
    """Positions and velocities at device time [s]."""
    return SIZE * math.sin(OMEGA * t), SIZE * OMEGA * math.cos(OMEGA * t)


def tip_speed(t):
    """Of the tip of both links of 1 m."""
    (a, b), (va, vb) = motion(t)
    x = -math.sin(a) * va - math.sin(a + b) * (va + vb)
    y = math.cos(a) * va + math.cos(a + b) * (va + vb)
    return math.hypot(x, y)


class Tick(NamedTuple):
    """What a run made of it."""

    t: float
    decided: bool
    off: float
    """Of a joint from where it is [rad]."""
    speed_off: float
    """Of the tip's speed from what it is [m/s]."""
    reason: str
    noise: float = 0.0
    """How far the speed may be off, as it is said [m/s]."""


TIMES = np.linspace(0, 2 * math.pi / OMEGA, 2000)
SPEEDS = np.array([tip_speed(t) for t in TIMES])
FASTEST_TIP = SPEEDS.max()
TIP = np.abs(np.diff(SPEEDS) / np.diff(TIMES)).max()
"""Fastest change of the tip's speed [m/s²]."""
SWING = NEAR * 2 * math.pi * 20 / math.e * 3 + 0.01
"""Of the tip, when both joints are pulled to where they are found to be, at 20 Hz [m/s]."""


class Spoiled(Stream):
    """A run of so many ticks of the arm; other arguments as of `Stream`."""

    def __init__(self, station, patch, packets, *, ticks=600, **more):
        super().__init__(station, patch, "arm", packets, **more)
        self.count = ticks

    def live(self):
        """Per tick: whether it is decided, how far the arm and its speed are from the truth, and why not."""
        arm = self.station.model.mechanism("arm")
        told = []
        for state, (result,), there in self.ticks(self.count):
            off = np.abs(state.joint_positions(arm) - motion(there)[0]).max()
            value = math.nan if result.value is None else result.value - tip_speed(there)
            noise = max(result.interval) - result.value if result.interval else 0.0
            told.append(Tick(state.t, result.verdict == "within", off, abs(value), result.reason, noise))
        return told


def stream(seconds=7.0, way=lambda t: WAY, device=lambda t: t, said=motion):
    """Packets at 125 Hz: arrival, device time, content; each stays in its order."""
    found, last = [], -math.inf
    for k in range(int(seconds * RATE)):
        t = k / RATE
        last = max(last, t + way(t))
        stamp = BEGIN + t + OFFSET
        found.append((last, device(stamp), said(stamp)))
    return found


@pytest.fixture(scope="module")
def station(tmp_path_factory):
    folder = tmp_path_factory.mktemp("spoiled")
    return made(folder, STATION, {"arm.urdf": two_r()})


CHANCE = 5


def jitter(scale):
    chance = np.random.default_rng(CHANCE)
    return lambda t: WAY + chance.exponential(scale)


def lossy(share):
    chance = np.random.default_rng(CHANCE)
    return [p for p in stream() if chance.random() > share]


def silent(packets):
    return [(at, device, (q, None)) for at, device, (q, _) in packets]


def looped(*, live):
    """From 3 s on the last two seconds again and again, with the live packets among them or not."""
    before = [p for p in stream() if p[0] < 3]
    again = [p for p in before if p[0] >= 1]
    loop = [(p[0] + 2 * n, *p[1:]) for n in (1, 2) for p in again]
    return sorted([*before, *loop, *([p for p in stream() if p[0] >= 3] if live else ())], key=lambda p: p[0])


def ahead(by):
    return [(at, device + by * (k == 400), said) for k, (at, device, said) in enumerate(stream())]


def shuffled():
    found = stream()
    for k in range(0, len(found) - 4, 4):
        four = found[k : k + 4]
        found[k : k + 4] = [(four[3][0], *four[j][1:]) for j in (2, 0, 3, 1)]
    return found


def burst(t):
    return WAY + 0.1 * (t % 1.0 > 0.9) * (1.0 - t % 1.0) / 0.1


def half(t):
    """Held back for 0.15 s now and then, and let through at once."""
    return WAY + max(0.0, 0.15 - t % 1.5) * (t > 1)


class Case(NamedTuple):
    """How a stream is spoiled, and what a run may make of it."""

    packets: list
    gap: float = 0.0
    """How long the twin goes without a sample that has its time, while it is decided [s]."""
    shift: float = 0.0
    """How far the device's stamps are off without anybody seeing it [s]."""
    least: float = 0.99
    """Share of the ticks that are decided: what is ordinary stays so."""
    until: float = math.inf
    """Nothing is decided from then on [s]."""
    why: str = ""
    """What a reader of some verdict is told."""
    pauses: dict | None = None
    again: tuple = ()


TIMEOUT = 0.19
"""That the run counts [s], and one tick."""
SPOILED = {
    "as it is": Case(stream()),
    "jitter of 5 ms": Case(stream(way=jitter(0.005)), gap=0.03, least=0.97),
    "jitter of 20 ms": Case(stream(way=jitter(0.02)), gap=0.1, least=0.8),
    "jitter, no velocities": Case(silent(stream(way=jitter(0.005))), gap=0.03, least=0.97),
    # 35 rad/s² hide 5 mrad within 48 ms: 20 of 600 ticks see that five samples in a row were lost.
    "half is lost": Case(lossy(0.5), gap=0.06, least=0.965),
    "nineteen of twenty are lost": Case(lossy(0.95), gap=TIMEOUT, least=0.4),
    "bursts": Case(stream(way=burst), gap=0.1),
    "held back": Case(stream(way=half), gap=0.15, least=0.98),
    "held back, no velocities": Case(silent(stream(way=half)), gap=0.15, least=0.97),
    "twice each": Case(sorted([*stream(), *stream()], key=lambda p: p[0])),
    "in another order": Case(shuffled(), gap=0.04, least=0.97),
    "delay grows": Case(stream(way=lambda t: WAY + 0.03 * t), gap=TIMEOUT, least=0.5),
    "delay grows fast": Case(
        stream(way=lambda t: WAY + 0.3 * max(t - 2, 0)), gap=TIMEOUT, least=0.3, until=2.9
    ),
    "delay of 2 s after a new connection": Case(
        stream(way=lambda t: WAY + 2.0 * (t > 2)),
        gap=TIMEOUT,
        least=0.3,
        until=2.2,
        again=(4.0,),
        why="later than at its best",
    ),
    "delay of 0.1 s after a new connection": Case(
        stream(way=lambda t: WAY + 0.1 * (t > 2)), gap=0.12, least=0.8, again=(2.1,)
    ),
    "played again": Case(looped(live=False), gap=0.02, least=0.4, until=3.05, why="says again what it said"),
    "played again, connected anew": Case(
        looped(live=False), least=0.4, until=3.05, again=(3.0, 5.0), why="a buffer on the way"
    ),
    "played again among what is live": Case(looped(live=True), least=0.4, until=3.05),
    "a stamp ahead": Case(ahead(0.15), gap=0.02, least=0.85, why="ahead of what its clock was"),
    "a stamp far ahead": Case(ahead(3.0), gap=0.02, least=0.85),
    "positions stand": Case(
        stream(said=lambda t: (motion(100.0)[0], motion(t)[1])),
        least=0,
        until=0.0,
        why="is not zero while the joint stands still",
    ),
    "velocities stand": Case(stream(said=lambda t: (motion(t)[0], (0.0, 0.0))), least=0, until=0.0),
    "half the velocities": Case(
        stream(said=lambda t: (motion(t)[0], 0.5 * motion(t)[1])), shift=math.inf, least=0, until=0.1
    ),
    "velocities a sixth low": Case(
        stream(said=lambda t: (motion(t)[0], 0.83 * motion(t)[1])),
        shift=math.inf,
        least=0.1,
        until=2.5,
        why="is off by a factor",
    ),
    "pauses of the run": Case(
        stream(), gap=TIMEOUT, least=0.85, pauses={200: 0.5, 400: 0.2}, why="run time fell behind"
    ),
    "pauses and jitter": Case(
        stream(way=jitter(0.005)),
        gap=TIMEOUT,
        least=0.6,
        pauses={100: 0.3, 200: 0.5, 300: 0.26, 400: 0.24},
        why="run time fell behind",
    ),
    "pauses, no velocities": Case(silent(stream()), gap=TIMEOUT, least=0.85, pauses={200: 0.5, 400: 0.2}),
    "a clock that is 1 % slow": Case(stream(device=lambda t: 0.99 * t), gap=0.08, shift=0.06),
    "a clock that starts again": Case(stream(device=lambda t: t - 50 * (t > 102)), gap=0.02, least=0.5),
}


LONG = {
    "twice each",
    "bursts",
    "held back, no velocities",
    "pauses, no velocities",
    "a stamp far ahead",
    "jitter of 20 ms",
}


@pytest.mark.parametrize(
    "how", [pytest.param(how, marks=[pytest.mark.soak] * (how in LONG)) for how in SPOILED]
)
def test_what_is_decided_is_true_whatever_happens_to_the_stream(station, monkeypatch, how):
    """As far as nobody knows the future: without a sample a robot goes on as it went, until the time-out."""
    case = SPOILED[how]
    told = Spoiled(station, monkeypatch, case.packets, pauses=case.pauses, again=case.again).live()
    sure = [tick for tick in told if tick.decided]
    assert len(sure) >= case.least * len(told)
    assert all(tick.t < case.until for tick in sure)
    for tick in sure:
        assert tick.off < FASTEST * (WAY + SETTLED + case.shift) + HARDEST * case.gap**2 / 2 + NEAR
        assert tick.speed_off < TIP * (
            WAY + case.gap + case.shift
        ) + SLEW * FASTEST_TIP + 0.01 + SWING * bool(case.gap)
    assert any(case.why in tick.reason for tick in told)


def test_how_late_it_is_goes_out_with_every_snapshot(station):
    q, qd = motion(0.0)
    name = station.workstation.sources[0].name
    said = JointSample(
        source=name, seq=0, target="arm", t=0.0, t_device=5.0, q=tuple(q), qd=tuple(qd), late=0.05
    )
    told = ticks(engine_of(station.model), Judge(bind(station.model)), iter([(said,), ()]))
    assert [snapshot.late for snapshot, _ in told] == [{"arm": (0.05, 0.2)}] * 2


def test_who_sends_no_time_is_as_old_as_the_file_allows(station, monkeypatch):
    """Nobody sees how late it is: undecided, or with a bound that counts as age."""
    packets = [(at, None, said) for at, _, said in stream(2.0)]
    blind = Spoiled(station, monkeypatch, packets, ticks=150)
    assert all("give a bound as delay" in tick.reason for tick in blind.live())
    bounded = Spoiled(station, monkeypatch, packets, ticks=300)
    bounded.listener._source = replace(bounded.listener._source, delay=0.05)
    told = bounded.live()
    assert [tick.decided for tick in told[10:190]] == [True] * 180
    silent = next(tick.t for tick in told if "not heard for" in tick.reason)
    last = BEGIN + packets[-1][0] - bounded.clock.start + bounded.delay
    assert silent == pytest.approx(last + 0.2 - bounded.delay - 0.05, abs=0.011)


@pytest.mark.parametrize("rates", [True, False])
@pytest.mark.parametrize("sigma", [0.0, 2e-4])
def test_speeds_that_come_from_noisy_positions_are_as_far_off_as_is_said(station, monkeypatch, sigma, rates):
    chance = np.random.default_rng(CHANCE)

    def said(t):
        q, qd = motion(t)
        return q + sigma * chance.normal(size=2), qd if rates else None

    told = Spoiled(station, monkeypatch, stream(6.0, said=said), ticks=500).live()[50:]
    sure = [tick for tick in told if tick.decided]
    assert len(sure) >= 0.99 * len(told)
    wide = [tick.noise for tick in sure]
    if not sigma:
        assert max(wide) < 0.02
    else:
        # Speeds that are said hold at the samples; between two of them the twin goes along their positions.
        assert rates or min(wide) > 0.1
        # The controllers of the twin smooth what they are pulled to.
        assert all(tick.speed_off < tick.noise + 0.02 for tick in sure)


SEEN = STATION.replace("limit = 5.0", "limit = 0.5")
HELD = 3.0, 0.15
"""When packets are held back, and for how long [s]."""


def held_back(t):
    begin, seconds = HELD
    return WAY + max(begin + seconds - t, 0.0) * (begin <= t)


def to_and_fro(size, began):
    """A joint that goes so far and comes back in 0.14 s [rad]: 1.3 m/s of the tip for 0.03 rad."""

    def said(stamp):
        s = (stamp - (BEGIN + OFFSET) - began) / 0.14
        moves = 0.0 < s < 1.0
        q = size * (1 - math.cos(2 * math.pi * s)) / 2 * moves
        qd = size * math.pi / 0.14 * math.sin(2 * math.pi * s) * moves
        return np.array([q, 0.0]), np.array([qd, 0.0])

    return said


@pytest.mark.parametrize("speeds", [True, False])
def test_what_was_done_and_undone_while_packets_were_held_back_is_not_within(tmp_path, monkeypatch, speeds):
    """Of what comes together the newest is taken, and that lies where everything lay before."""
    station, said = made(tmp_path, SEEN, {"arm.urdf": two_r()}), to_and_fro(0.03, HELD[0] + 0.002)
    for way, verdict in ((lambda t: WAY, "exceeded"), (held_back, "undecided")):
        packets = stream(way=way, said=said)
        live = Stream(station, monkeypatch, "arm", packets if speeds else silent(packets))
        results = [result for _, (result,), _ in live.ticks(600)]
        assert any(result.verdict == verdict for result in results)
    assert any("held back" in result.reason for result in results)


@pytest.mark.parametrize("pause", [0.14, 0.17])
@pytest.mark.parametrize("speeds", [True, False])
def test_what_was_done_and_undone_while_the_run_was_held_up_is_not_within(
    tmp_path, monkeypatch, speeds, pause
):
    """Every packet comes in time, and is replaced by the next before a tick has taken it."""
    station, packets = made(tmp_path, SEEN, {"arm.urdf": two_r()}), stream(said=to_and_fro(0.03, 3.0))
    live = Stream(station, monkeypatch, "arm", packets if speeds else silent(packets), pauses={294: pause})
    results = [result for _, (result,), _ in live.ticks(400)]
    assert any("held back" in result.reason for result in results)
    assert {result.verdict for result in results} == {"within", "undecided"}


@pytest.mark.parametrize("said", [motion, to_and_fro(0.002, HELD[0]), to_and_fro(0.03, 4.0)])
def test_a_motion_that_goes_on_while_packets_are_held_back_is_followed(station, monkeypatch, said):
    live = Stream(station, monkeypatch, "arm", stream(way=held_back, said=said))
    assert not [r.reason for _, (r,), _ in live.ticks(600) if "held back" in r.reason]


def test_packets_of_a_jittering_network_are_not_held_back(station, monkeypatch):
    live = Stream(station, monkeypatch, "arm", stream(way=jitter(0.03)))
    assert not [r.reason for _, (r,), _ in live.ticks(600) if "held back" in r.reason]
