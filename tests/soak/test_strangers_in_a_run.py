"""Strangers who send to a run, and a run that is stopped: ``seerob run`` as a process, and what it shows.

The packets of each person come through a relay, so that its address and port are those of the first sender:
from there they are played again, beside the live ones and in their place.
"""

import json
import signal
import socket
import subprocess
import sys
import threading
import time
from contextlib import ExitStack, suppress

import pytest
from mcap.reader import make_reader

from free_ports import free_port
from seerob.app.emulation import mvn_person
from seerob.app.emulation.motions import swing
from seerob.app.emulators.kinect import KinectSender, animated, measured
from seerob.app.emulators.mvn import MvnSender
from seerob.app.emulators.rokoko import RokokoSender
from seerob.app.emulators.rtde import RtdeServer
from seerob.core.snapshot import Snapshot
from server.frames import PATIENCE, Visitor

HERE = "127.0.0.1"
SILENCE = 3.0
"""After which a source listens anew [s]."""
CELL = """
title = "Strangers"
engine = {{ physics = false }}

[[robots]]
name = "arm"
model = "library:ur10"

[[sources]]
kind = "rtde"
robot = "arm"
host = "127.0.0.1"
port = {port}

[[safety]]
kind = "velocity"
name = "arm"
at = "arm"
limit = 5.0
"""
PERSON = """
[[humans]]
name = "{kind}"
stature = 1.75
mass = 75
sex = "male"

[[sources]]
kind = "{kind}"
human = "{kind}"
port = {port}
frequency = 30
at = {{ position = [0, {y}, 0] }}

[[parts]]
name = "post_{kind}"
shape = {{ box = [0.1, 0.1, 0.1] }}
at = {{ position = [3, {y}, 0.5] }}

[[safety]]
kind = "minimum_distance"
name = "{kind}"
between = ["{kind}", "post_{kind}"]
limit = 0.05
"""


def sender(kind, port):
    if kind == "kinect":
        return KinectSender(measured(animated("library:reach"), 2e-4), to=(HERE, port), rate=30.0)
    person = mvn_person.measured(mvn_person.animated("library:reach"), 2e-4)
    if kind == "rokoko":
        return RokokoSender({"Anna": person}, to=(HERE, port), rate=30.0)
    return MvnSender({0: person}, to=(HERE, port), rate=30.0)


class Relay(threading.Thread):
    """Passes on what arrives at a port, and keeps it: the first sender that a run hears.

    Args:
        to: Port of the run.
    """

    def __init__(self, to):
        super().__init__(daemon=True)
        self._to, self._kept, self._sent, self._loop = (HERE, to), [], [], []
        self.inside, self._way = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
        self.inside.bind((HERE, 0))
        self.port = self.inside.getsockname()[1]
        self.mixed = self.muted = False
        self.heard_from = 0.0
        """What was sent before was heard by nobody: played again, it is news, as of a device that starts."""
        self.start()

    def run(self):
        k = 0
        with suppress(OSError), self.inside, self._way:
            while data := self.inside.recv(1 << 16):
                self._kept.append((time.monotonic(), data))
                if self.mixed:
                    self._way.sendto(next(d for t, d in self._kept if t > time.monotonic() - 0.7), self._to)
                if self._loop:
                    data, k = self._loop[k % len(self._loop)], k + 1
                else:
                    self._sent.append(self._kept[-1])
                if not self.muted:
                    self._way.sendto(data, self._to)

    def loop(self, seconds):
        """From now on, the newest that was heard, again and again, and nothing live."""
        self._loop = [data for t, data in self._kept if t > time.monotonic() - seconds]

    def mute(self, seconds):
        """Send nothing, until that is undone; then the newest that was sent live, again and again."""
        begins = max(self._sent[-1][0] - seconds, self.heard_from)
        self.muted, self._loop = True, [data for t, data in self._sent if t > begins]


class Watching:
    """What a page is shown, until something is so."""

    def __init__(self, page):
        self.page = page

    def next(self):
        return {r.name: r for r in self.page.of(Snapshot).results}

    def until(self, verdict, names, *reasons):
        """Shown, once all of these have the verdict, for one of the reasons."""
        end, left = time.monotonic() + PATIENCE, set(names)
        while left:
            found = self.next()
            assert time.monotonic() < end, [(r.name, r.verdict, r.reason) for r in found.values()]
            left -= {
                name
                for name in left
                if found[name].verdict == verdict
                and any(part in found[name].reason for part in reasons or ("",))
            }

    def never_within(self, names, seconds, after=0.0):
        begun = time.monotonic()
        while (passed := time.monotonic() - begun) < after + seconds:
            found = self.next()
            if passed >= after:
                assert all(found[n].verdict == "undecided" for n in names), [
                    (passed, n, found[n].verdict, found[n].reason) for n in names
                ]


@pytest.fixture(
    params=[
        pytest.param(("mvn",), id="short"),
        pytest.param(("mvn", "kinect", "rokoko"), id="long", marks=pytest.mark.soak),
    ]
)
def run(tmp_path, request):
    """A run with a robot and people, what its page shows, and who sends to it."""
    ports = {kind: free_port() for kind in request.param}
    robot = RtdeServer(swing((0, -1.5, 1.5, -1.5, -1.5, 0))).start()
    relays = {kind: Relay(port) for kind, port in ports.items()}
    senders = [sender(kind, relay.port).start() for kind, relay in relays.items()]
    cell = CELL.format(port=robot.port) + "".join(
        PERSON.format(kind=kind, port=port, y=2.0 * k) for k, (kind, port) in enumerate(ports.items(), 1)
    )
    (tmp_path / "workstation.toml").write_text(cell)
    command = [sys.executable, "-m", "seerob.app.cli", "run", tmp_path, "-o", tmp_path / "out", "--port", "0"]
    with ExitStack() as stack:
        for device in (robot, *senders):
            stack.callback(device.stop)
        process = subprocess.Popen(
            list(map(str, command)), stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
        )
        stack.enter_context(process)
        stack.callback(process.kill)
        page = next(line for line in process.stdout if line.startswith("page"))

        class Served:
            port = int(page.partition("//")[2].partition("/")[0].partition(":")[2])

        yield process, Watching(stack.enter_context(Visitor(Served))), ports, relays, robot


def test_nobody_is_within_by_what_strangers_send_or_by_what_is_old(run, tmp_path):
    process, shown, ports, relays, robot = run
    people = tuple(ports)
    shown.until("within", ("arm", *people))
    for relay in relays.values():
        relay.heard_from = time.monotonic()

    others = [sender(kind, port).start() for kind, port in ports.items()]
    shown.until("undecided", people, "too; heard is 127.0.0.1 port")
    for other in others:
        other.stop()
    shown.until("within", people)

    for relay in relays.values():
        relay.mixed = True
    shown.until("undecided", people, "played again", "went back")
    shown.never_within(people, 1.0, after=0.5)
    for relay in relays.values():
        relay.mixed = False
    shown.until("within", ("mvn",))

    for relay in relays.values():
        relay.loop(3.0)
    shown.until("undecided", people, "played again", "went back", "says again", "not heard for")
    shown.never_within(people, 3.0, after=0.5)
    shown.until("within", ("arm",))

    # What was heard, after a silence, from the same address and port: no device that starts again.
    for relay in relays.values():
        relay.mute(6.0)
    shown.until("undecided", people, "not heard for")
    time.sleep(SILENCE)
    for relay in relays.values():
        relay.muted = False
    shown.until("undecided", people, "says again", "went back")
    shown.never_within(people, 6.0)
    shown.until("undecided", people, "is a recording played to it?")

    process.send_signal(signal.SIGSTOP)
    with suppress(TimeoutError):
        while True:
            shown.page.read(timeout=0.5)  # what was on its way
    robot.stop()
    time.sleep(1.0)
    process.send_signal(signal.SIGCONT)
    shown.next()  # it may have been on its way: after a silence the first counts for nobody
    shown.never_within(("arm",), 1.0)  # whatever is said of it now is older than the stop

    process.terminate()
    process.communicate(timeout=PATIENCE)
    with (tmp_path / "out" / "run.mcap").open("rb") as file:
        told = [json.loads(m.data) for _, _, m in make_reader(file).iter_messages(topics=["/results"])]
    for kind in people:
        reasons = {r["reason"] for at in told for r in at["results"] if r["name"] == kind}
        for part in ("too; heard is 127.0.0.1 port", "went back" if kind == "kinect" else "played again"):
            assert any(part in reason for reason in reasons)
