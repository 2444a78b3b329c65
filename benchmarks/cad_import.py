"""A generated line of 2 000 parts and 10⁶ triangles: import beside OpenCASCADE, starts beside MuJoCo, a tick.

    python benchmarks/cad_import.py           # wall and processor times, memory of the whole process tree
    python benchmarks/cad_import.py --page    # pictures a second in a browser beside the run, too (CHROMIUM)

A person reaches over the line, a robot moves in it; each tick asks how far the person is from all parts and
from the robot. Goals: import 60 s by the clock and 4 GB, second start 3 s, a tick within its period.
"""

from __future__ import annotations

import argparse
import math
import os
import random
import re
import resource
import runpy
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PLAIN = """
import sys
from OCP.STEPCAFControl import STEPCAFControl_Reader
from OCP.TCollection import TCollection_ExtendedString
from OCP.TDocStd import TDocStd_Document
document = TDocStd_Document(TCollection_ExtendedString("XmlXCAF"))
reader = STEPCAFControl_Reader()
reader.SetNameMode(True)
reader.SetColorMode(True)
reader.ReadFile(sys.argv[1])
reader.Transfer(document)
"""
START = """
import sys, time
from pathlib import Path
from seerob.session.station import load
begin = time.process_time(), time.perf_counter()
station = load(Path(sys.argv[1]), cache=Path(sys.argv[2]))
used, took = time.process_time() - begin[0], time.perf_counter() - begin[1]
print(f"{len(station.model.bodies)} bodies, {used:.2f} s of processor time, {took:.1f} s by the clock")
"""
PEER = """
import sys, time
begin = time.process_time(), time.perf_counter()
import mujoco
model = mujoco.MjModel.from_xml_path(sys.argv[1])
used, took = time.process_time() - begin[0], time.perf_counter() - begin[1]
print(f"{model.nbody - 1} bodies, {used:.2f} s of processor time, {took:.1f} s by the clock")
"""
TICK = """
import sys, time
from pathlib import Path
import numpy as np
from seerob.session import run as road
from seerob.session.station import load
from seerob.twin.engine import Engine
station = load(Path(sys.argv[1]), cache=Path(sys.argv[2]))
period = station.workstation.engine.tick
engine = Engine(station.model, driven={s.target(): s.timeout for s in station.workstation.sources})
judge, took, used, least = road.Judge(station.bound), [], [], {}
with road.settled():
    feed = road.pump(station.sources, period, endless=True, ahead=road.looks_ahead(station.model))
    for seq, samples in enumerate(feed):
        begin, began = time.perf_counter(), time.thread_time()
        engine.take(samples)
        results = judge(engine.tick() if seq else engine.start())
        took.append(time.perf_counter() - begin)
        used.append(time.thread_time() - began)
        for r in results:
            assert r.value is not None, r
            least[r.name] = min(least.get(r.name, np.inf), r.value)
        if seq == 300:
            break
took, used = 1e3 * np.array(took[20:]), 1e3 * np.array(used[20:])
print(f"tick of {1e3 * period:g} ms: median {np.median(took):.2f}, p99 {np.percentile(took, 99):.2f}, "
      f"most {took.max():.2f} ms by the clock; median {np.median(used):.2f}, p99 "
      f"{np.percentile(used, 99):.2f} ms of processor time; "
      + ", ".join(f"{name} {1e3 * value:.0f} mm" for name, value in least.items()))
"""
ADDED = """
[[robots]]
name = "ur5e"
model = "library:ur5e"
base = { position = [3.0, 2.0, 0.3], rpy_deg = [0, 0, 180] }

[[humans]]
name = "operator"
stature = 1.75
mass = 75
sex = "male"
at = { position = [3.0, -0.6, 0], rpy_deg = [0, 0, 90] }

[[sources]]
kind = "csv"
robot = "ur5e"
file = "cycle.csv"
loop = true
loop_pause = 0.02

[[sources]]
kind = "keyframes"
human = "operator"
file = "library:reach"

[[safety]]
kind = "minimum_distance"
name = "person to the line"
between = ["operator", "line/*"]
limit = 0.02

[[safety]]
kind = "minimum_distance"
name = "person to the robot"
between = ["operator", "ur5e"]
limit = 0.02
"""


def line(products: int = 100, instances: int = 20, corners: int = 125) -> str:
    """STEP of gears, of which each is there several times."""
    made = runpy.run_path(str(ROOT / "scripts/make-imported-line"))
    step, place, rng = made["Step"](), made["place"], random.Random(1)
    children = []
    for number in range(products):
        r = 20 + 40 * rng.random()
        radii = [r if k % 2 else 0.9 * r for k in range(corners)]
        angles = [math.tau * k / corners for k in range(corners)]
        outline = [(a * math.cos(t), a * math.sin(t)) for a, t in zip(radii, angles, strict=True)]
        part = step.prism(f"gear_{number}", outline, 10 + 20 * rng.random(), color=(rng.random(), 0.5, 0.5))
        for _ in range(instances):
            at = len(children)
            where = place(150.0 * (at % 50), 150.0 * (at // 50), 0.0, rng.random())
            children.append((part, f"p{at}", where))
    step.assembly("line", children)
    return str(step.text())


def tree(root: int) -> Iterator[int]:
    """A process and all that it started."""
    yield root
    with suppress(OSError):
        for file in Path(f"/proc/{root}/task").glob("*/children"):
            for child in file.read_text().split():
                yield from tree(int(child))


def held(process: int) -> int:
    """Memory of a process tree, what is shared counted once [byte]; 0 where the system does not say."""
    most = 0
    for one in tree(process):
        with suppress(OSError):
            text = Path(f"/proc/{one}/smaps_rollup").read_text()
            most += int(re.search(r"^Pss:\s+(\d+)", text, re.M)[1]) << 10  # type: ignore[index]
    return most


def timed(*command: str) -> tuple[str, str]:
    """What a process says; and its time by the clock and of the processor [s], and the tree's peak [GB]."""
    before, begun = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    process = subprocess.Popen([sys.executable, *command], stdout=subprocess.PIPE, text=True)
    peak, over = [0], threading.Event()

    def watch() -> None:
        while not over.wait(0.05):
            peak[0] = max(peak[0], held(process.pid))

    watching = threading.Thread(target=watch)
    watching.start()
    said = process.communicate()[0]
    over.set()
    watching.join()
    if process.returncode:
        raise SystemExit(f"{command[0]} {command[1][:40]} ended with {process.returncode}")
    after, took = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter() - begun
    used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return said, f"{took:6.1f} s by the clock, {used:6.1f} s of the processor, {peak[0] / 1e9:.2f} GB"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--page", action="store_true", help="pictures a second in a browser, too")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        file, cell, cache = folder / "line.step", folder / "cell", folder / "cache"
        file.write_text(line(), encoding="ascii")
        print(f"{file.stat().st_size / 1e6:.0f} MB of STEP; load of the machine {os.getloadavg()[0]:.1f}")
        os.environ["XDG_CACHE_HOME"] = str(folder / "user")
        print(f"OpenCASCADE alone  {timed('-c', PLAIN, str(file))[1]}, without triangles")
        said, cost = timed("-m", "seerob", "import", str(file), str(cell))
        print(f"seerob import      {cost}")
        print(next(text for text in said.splitlines() if text.startswith("found")))
        for which in ("first start", "second start"):
            said, cost = timed("-c", START, str(cell), str(cache))
            print(f"{which:18} {cost}; loading: {said.strip()}")
        timed("-m", "seerob", "export", str(cell), "--to", "mjcf", "-o", str(folder / "mjcf"))
        said, cost = timed("-c", PEER, str(folder / "mjcf/cell.xml"))
        print(f"MuJoCo alone       {cost}; loading what was exported: {said.strip()}")
        shutil.copy(ROOT / "workstations/imported_line/motion/cycle.csv", cell)
        with (cell / "workstation.toml").open("a", encoding="utf-8") as added:
            added.write(ADDED)
        timed("-c", TICK, str(cell), str(cache))  # compiles what this processor has not kept
        print(timed("-c", TICK, str(cell), str(cache))[0].strip())
        if asked.page:
            subprocess.run(["node", str(ROOT / "web/tests/line_rate.mjs"), str(cell)], check=True)


if __name__ == "__main__":
    main()
