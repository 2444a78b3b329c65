"""A run that is stopped as a whole (SIGSTOP) and goes on: nothing old is shown as the present."""

import contextlib
import os
import signal
import subprocess
import sys
import time

import pytest

from seerob.core.snapshot import Snapshot
from server.frames import PATIENCE, Visitor

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
                shown = [page.of(Snapshot, PATIENCE) for _ in range(5)]
                assert all(s.tracking["began"] >= resumed for s in shown)
    finally:
        process.kill()
        process.communicate()
