"""A run that is stopped as a whole (SIGSTOP) and goes on: nothing old is shown as the present."""

import asyncio
import contextlib
import os
import signal
import subprocess
import sys
import time
from time import monotonic

import pytest

from seerob.app.server.client import Client
from seerob.app.server.live import OLD, Live
from seerob.app.server.serving import Server
from seerob.core.snapshot import Snapshot, Transport
from server.frames import MESHES, PATIENCE, Visitor, scene, snapshot

CHILD = """
import sys, time
sys.path.insert(0, {tests!r})
from server.frames import MESHES, scene, snapshot
from seerob.app.server.live import LiveView
with LiveView(scene=scene(), meshes=MESHES, port=0) as view:
    print(view.server.port, flush=True)
    k = 0
    while True:
        began = time.time()
        end = time.monotonic() + 0.009
        while time.monotonic() < end:  # a tick: it may be stopped in its middle
            pass
        made = snapshot(k)
        view.write(msgspec.structs.replace(made, tracking={{"began": began}}), ())
        k += 1
"""


@pytest.mark.skipif(not hasattr(signal, "SIGSTOP"), reason="this system stops no process")
def test_after_five_stops_no_page_is_shown_what_was_computed_before():
    tests = os.path.dirname(os.path.dirname(__file__))
    code = "import msgspec\n" + CHILD.format(tests=tests)
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    try:

        class Served:
            port = int(process.stdout.readline())

        with Visitor(Served) as page:
            page.of(Snapshot)
            for _ in range(5):
                end = time.monotonic() + 0.3
                while time.monotonic() < end:
                    page.read()
                process.send_signal(signal.SIGSTOP)
                with contextlib.suppress(TimeoutError):
                    while True:
                        page.read(timeout=0.5)  # what was on its way when it stopped
                resumed = time.time()
                process.send_signal(signal.SIGCONT)
                page.of(Snapshot)  # it may have been on its way: after a silence the first counts for nobody
                shown = [page.of(Snapshot, PATIENCE) for _ in range(5)]
                assert all(s.tracking["began"] >= resumed for s in shown)
    finally:
        process.kill()
        process.communicate()


def test_what_waits_to_be_sent_when_it_gets_too_old_is_not_sent():
    async def story():
        class Line:
            reads, sent = False, []

            def write(self, messages):
                self.sent.append(list(messages))

        line = Line()
        client = Client(line, patience=10.0)
        client.offer_frame(1, b"old", monotonic() - 0.01)
        client.offer("Transport", b"said")
        line.reads = True
        line.on_read()
        client.put("presences", b"there")
        client.offer_frame(2, b"new", monotonic() + PATIENCE)
        return line.sent, client.skipped, client.sent

    assert asyncio.run(story()) == ([[b"said"], [b"there", b"new"]], 1, 1)


def test_a_page_that_comes_while_a_run_hangs_is_shown_nothing_and_after_its_end_the_last_there_was():
    live = Live()
    with Server(scene=scene(), meshes=MESHES, feed=live, port=0) as server:
        with Visitor(server) as early:
            live.publish(snapshot(0))
            early.of(Snapshot)
        time.sleep(OLD + 0.05)
        with Visitor(server) as late:
            kinds = [type(late.read()) for _ in range(4)]
            with pytest.raises(TimeoutError):
                late.read(timeout=0.2)
            assert Snapshot not in kinds
            live.finish()
            assert late.of(Transport) == Transport(playing=False, t=0.0, live=True)
            assert late.of(Snapshot) == snapshot(0)
        with Visitor(server) as afterwards:
            assert afterwards.of(Transport).playing is False
            assert afterwards.of(Snapshot) == snapshot(0)
