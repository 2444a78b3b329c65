"""What live sources may yield and nobody may rest on: robots, people, variables, as three kinds hear them.

A sample goes the way it goes in a run, without the wire: `Listener`, mailbox, run time, engine, judge.
"""

from __future__ import annotations

import contextlib
import math
from types import SimpleNamespace

import numpy as np
import pytest
from msgspec.structs import replace

from made_cell import FLOATING, TWO_R, made, person, two_r
from motion_io import made_pictures
from seerob.app.emulators.kinect import measured
from seerob.core.errors import SeerobError
from seerob.core.samples import JointSample, Mailbox, SignalSample
from seerob.devices.capture.options import person as described
from seerob.devices.capture.stream_source import _Hearing
from seerob.devices.live import receivers
from seerob.devices.live.listening import Listener, delay_of
from seerob.devices.live.receivers import Clock, hear
from seerob.devices.sources.kinect import LAYOUT, frame
from seerob.session.opening import source_target
from seerob.session.run import Judge, bind, engine_of, ticks
from seerob.testing import LIVE_LIES

BEGIN, LIES_AT, END = 1000.0, 0.6, 1.4
"""Host's monotonic time of the first sample; from when it lies and until when it speaks [s]."""
OFFSET = -900.0
"""Device time less the host's [s]."""
SETTLED = 0.3
"""By when a stream that contradicts itself shows it, beside the time-out [s]."""
LIMIT = "limit = 5\nbetween_samples = 'accepted: x'\n"
VARIABLE = '[[variables]]\nname = "level"\nsource = "plc"\naddress = "x"\ntype = "number"\nunit = "1"\n'


def joints(source, target):
    """As `rtde` yields them."""
    for k in range(round(END * 125)):
        t = k / 125
        q, qd = (0.3 * math.sin(2 * t), 0.2), (0.6 * math.cos(2 * t), 0.0)
        at = BEGIN + t
        yield JointSample(source="", seq=0, target="arm", t=at, t_device=at + OFFSET, q=q, qd=qd)


def bodies(source, target):
    """As `kinect` yields them: the depth camera's pictures, bound to the person's bones."""
    hearing = _Hearing(source, described(target, "op", ""))
    seen = measured(made_pictures.scene(), 2e-4)
    for k, picture in enumerate(map(seen, np.arange(round(END * made_pictures.RATE)) / made_pictures.RATE)):
        said = frame(picture.t, picture.bodies[0], "0")
        if (sample := hearing.take(LAYOUT, said, BEGIN + k / made_pictures.RATE)) is not None:
            yield replace(sample, t_device=BEGIN + k / made_pictures.RATE + OFFSET)


def values(source, target):
    """As `opcua` yields them."""
    for k in range(round(END / 0.05)):
        yield SignalSample(source="plc", seq=0, t=BEGIN + k * 0.05, values={"level": 5.0 + k % 2})


KINDS = {
    "rtde": (
        joints,
        FLOATING + TWO_R + '[[safety]]\nkind = "velocity"\nat = "arm/tip"\n' + LIMIT
        + '[[sources]]\nkind = "rtde"\nrobot = "arm"\nhost = "127.0.0.1"\nfrequency = 125\n',
        {"arm.urdf": two_r()},
    ),
    "kinect": (
        bodies,
        "[engine]\nphysics = false\n" + person("op") + '[[safety]]\nkind = "velocity"\nof = "op"\n' + LIMIT
        + '[[sources]]\nkind = "kinect"\nhuman = "op"\nat = { position = [0, 0, 1], rpy_deg = [0, 0, 0] }\n',
        {},
    ),
    "opcua": (
        values,
        'variables = "v.toml"\n' + FLOATING + TWO_R
        + '[[safety]]\nkind = "variable"\nvariable = "level"\nunit = "1"\nlimit = 99\n'
        '[[sources]]\nkind = "opcua"\nname = "plc"\nurl = "opc.tcp://127.0.0.1:1"\ntimeout = 0.3\n',
        {"arm.urdf": two_r(), "v.toml": VARIABLE},
    ),
}  # fmt: skip


class Stream:
    """One live source of a run, what it yields, and from an instant on something else."""

    def __init__(self, station, said, patch, lie):
        self.now = BEGIN
        patch.setattr(receivers, "time", SimpleNamespace(monotonic=lambda: self.now, sleep=self._sleep))
        (self.source,) = station.workstation.sources
        self.box, self.station = Mailbox(), station
        self.listener = Listener(self.source, source_target(station.model, self.source), self.box.post)
        self.delay = delay_of([self.source])
        self._lie = lie
        self._last = None
        self._waiting = [replace(sample, seq=k) for k, sample in enumerate(said)]

    def _sleep(self, seconds):
        self.now += seconds

    def first(self):
        self.now += 0.05
        return self.take()

    def take(self):
        while self._waiting and self._waiting[0].t <= self.now:
            sample = self._waiting.pop(0)
            lies = self._lie is not None and sample.t >= BEGIN + LIES_AT
            self._last = self._last if lies else sample
            try:
                if lies:
                    sample = self._lie.said(sample, BEGIN + LIES_AT, self._last)
            except OSError:
                sample = None
            try:
                if sample is not None:
                    self.listener.take(sample)
            except (SeerobError, TypeError):  # as `Listener._session` ends, and is begun anew
                self.listener._clock.reconnect()
        return self.box.take()

    def verdicts(self):
        """By instant of the run [s]."""
        clock = Clock()
        model = self.station.model
        feed = hear(iter(lambda: (), None), self, clock)
        told = []
        with contextlib.suppress(SeerobError):  # what ends a run is no verdict
            for out, _ in ticks(engine_of(model), Judge(bind(model)), feed):
                told += [(clock.start + out.t - BEGIN - self.delay, r.verdict, r.reason) for r in out.results]
                if self.now > BEGIN + END:
                    break
                clock.wait(out.t + model.workstation.engine.tick)
        return told


@pytest.fixture(scope="module", params=KINDS)
def honest(request, tmp_path_factory):
    """A workstation with one live source, and what that yields."""
    yields, text, files = KINDS[request.param]
    station = made(tmp_path_factory.mktemp(request.param), text, files)
    (source,) = station.workstation.sources
    return station, list(yields(source, source_target(station.model, source)))


def test_a_stream_that_does_not_lie_is_within(honest, monkeypatch):
    told = Stream(*honest, monkeypatch, None).verdicts()
    assert {verdict for t, verdict, _ in told if t > 0.5} == {"within"}, told[-1]


@pytest.mark.parametrize("lie", LIVE_LIES, ids=lambda lie: lie.what)
def test_nothing_rests_on_a_stream_that_lies(honest, monkeypatch, lie):
    stream = Stream(*honest, monkeypatch, lie)
    since = LIES_AT + stream.source.timeout + SETTLED
    assert since < END - 0.1
    assert not [t for t, verdict, _ in stream.verdicts() if t > since and verdict == "within"]


def standing(said):
    """From some instant on what was said last, with new stamps."""
    last = max((s for s in said if s.t < BEGIN + LIES_AT), key=lambda s: s.t)
    return [s if s.t <= last.t else replace(last, t=s.t, t_device=s.t_device) for s in said]


def again(said, *, among=False):
    """From some instant on the last half second again and again, with or without what is live."""
    before = [s for s in said if s.t < BEGIN + LIES_AT]
    loop = [s for s in before if s.t >= BEGIN + LIES_AT - 0.5]
    after = [replace(s, t=s.t + 0.5 * n) for n in (1, 2) for s in loop]
    after += [s for s in said if s.t >= BEGIN + LIES_AT] if among else []
    return before + sorted(after, key=lambda s: s.t)


def shuffled(said):
    """Each two in another order, when the latter of them comes."""
    found = list(said)
    for k in range(0, len(found) - 1, 2):
        first, second = found[k : k + 2]
        found[k : k + 2] = [second, replace(first, t=second.t)]
    return found


SPOILED = {
    "stands": standing,
    "plays again what it said": again,
    "has what it said among what is live": lambda said: again(said, among=True),
}


@pytest.mark.parametrize(
    ("honest", "what"),
    [(kind, what) for what in SPOILED for kind in ("rtde", "kinect")],
    indirect=["honest"],
)
def test_what_stands_or_is_played_again_is_not_within(honest, monkeypatch, what):
    """Of robots and people. A variable may stand, and has no time of its own."""
    station, said = honest
    spoiled = SPOILED[what](said)
    stream = Stream(station, spoiled, monkeypatch, None)
    since = LIES_AT + stream.source.timeout + SETTLED
    told = stream.verdicts()
    assert "within" in {verdict for t, verdict, _ in told if t < LIES_AT}
    assert not [t for t, verdict, _ in told if t > since and verdict == "within"]


@pytest.mark.parametrize("honest", ["rtde", "kinect"], indirect=True)
def test_in_another_order_nobody_seems_to_fly(honest, monkeypatch):
    """Backward in time and forward again would be 5 m/s and more."""
    station, said = honest
    told = [verdict for _, verdict, _ in Stream(station, shuffled(said), monkeypatch, None).verdicts()]
    assert "within" in told
    assert "exceeded" not in told
