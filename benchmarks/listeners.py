"""What a process that listens to a live source takes of a core, and its memory; of every live kind in turn.

Its memory is said three times: resident, with what all processes of this Python share; its share of that
(PSS), by how many have each page; and its own alone, which is what one more listener takes, and what the goal
is of.

Its processor time, as the kernel counts it, by the time that passed, while the emulator of that kind sends at
its usual rate; so also by sample. Processor time depends on what else the machine does: the load is printed.
``--against FOLDER`` measures, in turns, the listeners of another checkout beside these, at the same load.

``--seconds`` is the length of each, ``--smoke`` a short run of one kind.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(HERE / "tests"))

from seerob.devices.live import source_process
from seerob.devices.live.source_process import SourceProcess, pickled_source
from seerob.workstation.source import Target
from soak.device_kinds import KINDS

GOAL_SHARE, GOAL_MEMORY = 3.0, 30.0
"""[% of a core] and [MB]."""
FREQUENCY = {"rtde": 125.0, "fri": 200.0}
"""[Hz]; the emulators of others send at their own."""
SETTLE = 1.0
"""Before it is measured [s]: imports, and the first connection."""
TICK = os.sysconf("SC_CLK_TCK")


def used(pid: int) -> float:
    """Processor time so far [s], finer than the kernel's ticks where it says so."""
    try:
        threads = Path(f"/proc/{pid}/task").iterdir()
        return sum(int((each / "schedstat").read_text().split()[0]) for each in threads) * 1e-9
    except OSError:
        found = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
        return (int(found[11]) + int(found[12])) / TICK


def memory(pid: int) -> tuple[float, float, float]:
    """Resident, its share of that, and its own alone [MB]."""
    lines = Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()[1:]
    kilobytes = {line.split(":")[0]: int(line.split()[1]) for line in lines}
    own = kilobytes["Private_Clean"] + kilobytes["Private_Dirty"]
    return kilobytes["Rss"] / 1e3, kilobytes["Pss"] / 1e3, own / 1e3


class Listening(SourceProcess):
    """A listening process whose number is known, out of a checkout.

    Args:
        pair: From `pickled_source`.
        root: Of the checkout.
    """

    def __init__(self, pair: bytes, root: Path) -> None:
        super().__init__("listener", pair)
        self._root = root

    def begin(self) -> None:
        """Start it, and wait until it listens."""
        kept = list(sys.path)
        sys.path[:] = [str(self._root / "src"), *(p for p in sys.path if p != str(HERE / "src"))]
        try:
            self.start()
            self.wait()
        finally:
            sys.path[:] = kept
        self.take()

    @property
    def pid(self) -> int:
        """Its process."""
        assert self._process is not None
        return self._process.pid


def measured(pair: bytes, root: Path, seconds: float) -> tuple[float, float, float, float, float]:
    """Share of a core [%], time by sample [µs], memory as `memory` says it [MB]."""
    process = Listening(pair, root)
    process.begin()
    try:
        time.sleep(SETTLE)
        heard, spent, begun = process.line.received, used(process.pid), time.monotonic()
        while time.monotonic() - begun < seconds:
            process.take()
            time.sleep(0.01)
        spent, passed = used(process.pid) - spent, time.monotonic() - begun
        time.sleep(source_process.LINE_EVERY + 0.2)
        rate = process.line.rate or 0.0
        assert process.line.received > heard, f"not heard: {process.line.word}"
        return 100 * spent / passed, 1e6 * spent / passed / max(rate, 1e-9), *memory(process.pid)
    finally:
        process.ask_to_stop()
        process.join()


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--seconds", type=float, default=8.0)
    parser.add_argument("--smoke", action="store_true")
    parser.add_argument("--kinds", nargs="*", default=[k for k in KINDS if k != "headset"])
    parser.add_argument("--against", type=Path)
    options = parser.parse_args()
    kinds, seconds = (["rtde"], 0.5) if options.smoke else (options.kinds, options.seconds)
    roots = [HERE] if options.against is None else [HERE, options.against.resolve()]
    print(f"work that waits on this machine: {os.getloadavg()[0]:.1f} of {os.cpu_count()} cores")
    print(f"{'kind':<18} {'core':>7} {'a sample':>10} {'resident':>11} {'its share':>11} {'its own':>11}")
    for kind in kinds:
        with pytest.MonkeyPatch.context() as patch:
            server, source, target = KINDS[kind](patch)
            if kind in FREQUENCY:
                source = type(source)(
                    robot="arm", host=source.host, port=source.port, frequency=FREQUENCY[kind]
                )
                target = _arm(7 if kind == "fri" else 6)
            pair = pickled_source(source, target)
            assert pair is not None, kind
            try:
                for root in roots:
                    share, each, whole, part, own = measured(pair, root, seconds)
                    which = "" if root == HERE else "  " + str(root)
                    over = " !" if share > GOAL_SHARE or own > GOAL_MEMORY else ""
                    print(
                        f"{kind:<18} {share:6.2f}% {each:7.0f} us "
                        f"{whole:8.1f} MB {part:8.1f} MB {own:8.1f} MB{over}{which}",
                        flush=True,
                    )
            finally:
                server.stop()
                getattr(server, "close", lambda: None)()


def _arm(joints: int) -> Target:
    """With limits, as a run has them."""
    return Target(
        name="arm",
        joints=tuple(map(str, range(joints))),
        units=("rad",) * joints,
        velocity=(3.0,) * joints,
        acceleration=(15.0,),
    )


if __name__ == "__main__":
    main()
