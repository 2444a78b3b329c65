"""A generated line of 2 000 parts and 10⁶ triangles: import, beside OpenCASCADE's plain reading; starts.

Processor times of this process and its children, for other programs share the machine.
"""

from __future__ import annotations

import math
import random
import resource
import runpy
import subprocess
import sys
import tempfile
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


def timed(*command: str) -> tuple[str, float, float]:
    """What a process says, its processor time [s] and the most memory of any child so far [GB]."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run([sys.executable, *command], capture_output=True, text=True, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return done.stdout, used, after.ru_maxrss / 1e6


def main() -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        file, cell, cache = folder / "line.step", folder / "cell", folder / "cache"
        file.write_text(line(), encoding="ascii")
        print(f"{file.stat().st_size / 1e6:.0f} MB of STEP")
        _, used, memory = timed("-c", PLAIN, str(file))
        print(f"plain reading    {used:6.1f} s of processor time, {memory:.2f} GB")
        said, used, memory = timed("-m", "seerob", "import", str(file), str(cell))
        print(f"seerob import    {used:6.1f} s of processor time, {memory:.2f} GB")
        print(next(text for text in said.splitlines() if text.startswith("found")))
        for which in ("first start", "second start"):
            said, used, memory = timed("-c", START, str(cell), str(cache))
            print(f"{which:16} {used:6.1f} s with imports; loading: {said.strip()}")


if __name__ == "__main__":
    main()
