"""Short turns: asked for where the machine knows them, and nothing else of a thread changes."""

from __future__ import annotations

import os
import platform
import sys
from pathlib import Path
from threading import Thread

from seerob.devices.live import listening_process as module
from seerob.devices.live.listening_process import SLICE, wake_promptly

LINUX = sys.platform == "linux" and platform.machine() in {"x86_64", "aarch64", "riscv64"}


def in_a_thread(work):
    found = []
    thread = Thread(target=lambda: found.append(work()))
    thread.start()
    thread.join()
    return found[0]


def turn():
    """Of this thread [ns], as the kernel says; None of one that does not say."""
    said = Path("/proc/thread-self/sched")
    lines = said.read_text().splitlines() if said.exists() else []
    return next((float(line.split(":")[1]) for line in lines if line.startswith("se.slice")), None)


def test_turns_are_short_and_policy_and_priority_are_what_they_were():
    def asked():
        before = os.sched_getscheduler(0), os.getpriority(os.PRIO_PROCESS, 0)
        taken, after = wake_promptly(), turn()
        return taken, after, before, (os.sched_getscheduler(0), os.getpriority(os.PRIO_PROCESS, 0))

    taken, after, before, now = in_a_thread(asked)
    assert taken == (LINUX and before[0] == os.SCHED_OTHER)
    assert now == before
    if after is not None and tuple(map(int, platform.release().split(".")[:2])) >= (6, 12):
        assert after == SLICE


def test_a_machine_without_it_and_a_thread_with_a_policy_of_its_own_are_left_alone(monkeypatch):
    monkeypatch.setattr(platform, "machine", lambda: "odd")
    assert not in_a_thread(wake_promptly)
    monkeypatch.undo()
    monkeypatch.setattr(module.os, "sched_getscheduler", lambda process: os.SCHED_BATCH)
    assert not in_a_thread(wake_promptly)
