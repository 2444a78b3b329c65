"""Source, live source and sink of a company, as docs/extending.md shows them, beside its criteria."""

import asyncio
import contextlib
import csv
import json
import math
import re
import threading
import time
from itertools import pairwise
from pathlib import Path

import pytest

import seerob as sr
from kept_run import Chapters
from seerob import api
from seerob.app.cli import main
from seerob.protocols.links.tcp_server import close_server
from seerob.recording.recording import Recording
from seerob.recording.series import CODES
from seerob.testing import sources_never_within

ROOT = Path(__file__).parents[1]
ROBOT = """
[[robots]]
name = "arm"
model = "library:ur5e"
q_deg = [0, -90, 0, -90, 0, 0]

[[safety]]
kind = "velocity"
name = "speed"
at = "arm"
limit = 2.0
"""
UP = (0.0, -math.pi / 2, 0.0, -math.pi / 2, 0.0, 0.0)


@pytest.fixture(autouse=True)
def acme(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "examples"))


def cell(folder, text):
    (folder / "workstation.toml").write_text(ROBOT + text)
    return folder


def swing(folder, seconds=1.0, period=0.008):
    with (folder / "motion.jsonl").open("w") as file:
        for k in range(round(seconds / period) + 1):
            q = [0.3 * math.sin(2 * k * period), *UP[1:]]
            file.write(json.dumps({"t": 100 + k * period, "q": q}) + "\n")


FROM_FILE = """
[[sources]]
kind = "acme.joint_lines"
robot = "arm"
file = "motion.jsonl"
"""


def test_a_source_of_ones_own_moves_the_robot(tmp_path):
    swing(tmp_path)
    run = sr.load(cell(tmp_path, FROM_FILE), allow_plugins=True).run()
    speed = run.results["speed"]
    # The tool point of the upright arm is 0.2328 m from the axis of its base (d4 + d6 of its table).
    assert speed.max() == pytest.approx(0.6 * math.hypot(0.1333 + 0.0996, 0.0), rel=0.02)
    assert speed.verdict is sr.Verdict.WITHIN


def test_it_is_never_within_when_it_lies(tmp_path):
    swing(tmp_path)
    sources_never_within(cell(tmp_path, FROM_FILE))


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ('{"t": 0}', "line 2"),
        ("[]", "line 2"),
        ('{"t": 0, "q": [1, 2]}', "6 finite numbers"),
        ('{"t": NaN, "q": [0,0,0,0,0,0]}', "line 2"),
        ("\xff", "line 2"),
    ],
)
def test_a_wrong_line_is_said_with_its_place(tmp_path, line, said):
    good = json.dumps({"t": 0.0, "q": UP})
    (tmp_path / "motion.jsonl").write_text(f"{good}\n{line}\n", encoding="latin-1")
    station = sr.load(cell(tmp_path, FROM_FILE), allow_plugins=True)
    with pytest.raises(sr.InputError, match=said):
        station.run()


class Controller:
    """The other end: a real server that sends 125 lines a second until it is told to stop."""

    def __init__(self):
        self._ready = threading.Event()
        self.silent = threading.Event()
        self._thread = threading.Thread(target=asyncio.run, args=(self._serve(),))
        self._thread.start()
        self._ready.wait()

    async def _serve(self):
        self._loop, self._over = asyncio.get_running_loop(), asyncio.Event()
        server = await asyncio.start_server(self._speak, "127.0.0.1", 0)
        self.port = server.sockets[0].getsockname()[1]
        self._ready.set()
        await self._over.wait()
        await close_server(server)

    async def _speak(self, _, writer):
        begun = time.monotonic()
        with contextlib.suppress(asyncio.CancelledError):  # the loop may end first
            while not self._over.is_set():
                t = time.monotonic() - begun
                q, qd = [0.3 * math.sin(2 * t), *UP[1:]], [0.6 * math.cos(2 * t), *[0.0] * 5]
                if not self.silent.is_set():
                    writer.write((json.dumps({"t": t, "q": q, "qd": qd}) + "\n").encode())
                await asyncio.sleep(0.008)
        writer.transport.abort()

    def stop(self):
        self._loop.call_soon_threadsafe(self._over.set)
        self._thread.join()


def test_a_live_source_of_ones_own_is_heard_and_its_silence_is_undecided(tmp_path):
    controller = Controller()
    text = f'[[sources]]\nkind = "acme.cell_controller"\nrobot = "arm"\nport = {controller.port}\n'
    station = sr.load(cell(tmp_path, text + "frequency = 125\n"), allow_plugins=True)
    fastest = 0.6 * 0.2329

    def seen_at_its_fastest(snapshot):
        (speed,) = snapshot.results
        return speed.verdict == "within" and speed.value > 0.9 * fastest

    def not_heard(snapshot):
        (speed,) = snapshot.results
        return speed.verdict == "undecided" and "not heard" in speed.reason

    story = Chapters((seen_at_its_fastest, controller.silent.set), (not_heard, lambda: None))
    try:
        run = station.run(live=True, writers=[story], stop=story.stop)
    finally:
        controller.stop()
    speed = run.results["speed"]
    verdicts = speed.verdicts
    within, undecided = (CODES[v] for v in (sr.Verdict.WITHIN, sr.Verdict.UNDECIDED))
    assert (verdicts == within).any()
    assert speed.max() == pytest.approx(fastest, rel=0.1)
    assert verdicts[-1] == undecided
    assert run.verdict is sr.Verdict.UNDECIDED


def test_a_sink_of_ones_own_writes_each_change_once(tmp_path):
    swing(tmp_path)
    text = FROM_FILE + '[[sinks]]\nkind = "acme.verdict_changes"\n'
    station = sr.load(cell(tmp_path, text), allow_plugins=True)
    station.run(folder=tmp_path / "out", sinks=station.workstation.sinks)
    with (tmp_path / "out/verdicts.csv").open(newline="") as file:
        head, *rows = csv.reader(file)
    assert head[1] == "criterion"
    assert [row[1] for row in rows].count("speed") >= 1
    assert all(a[2] != b[2] for a, b in pairwise(rows) if a[1] == b[1])


LIVE = '[[sources]]\nkind = "KIND"\nrobot = "arm"\nport = 9\n'
FILE = '[[sources]]\nkind = "KIND"\nrobot = "arm"\nfile = "motion.jsonl"\n'
SINK = '[[sinks]]\nkind = "KIND"\n'
HEIGHT = '[[safety]]\nkind = "KIND"\nrobot = "arm"\n'
LOADED = """
[[humans]]
name = "op"
stature = 1.75
mass = 75
sex = "male"
posture = "standing"
[[phases]]
load = 20
[[ergonomics]]
kind = "KIND"
human = "op"
"""
FORGOTTEN = {
    "no period": (
        "cell_controller",
        "def period",
        "def every",
        LIVE,
        "has no period: define it as LiveSource",
    ),
    "no listen": (
        "cell_controller",
        "def listen",
        "def hear",
        LIVE,
        "has no listen: define it as LiveSource",
    ),
    "no open": (
        "joint_lines",
        "def open(",
        "def read(",
        FILE,
        "has no open: define it as Source describes it",
    ),
    "no sink": ("verdict_changes", "def open(", "def begin(", SINK, "has no open: define it as Sink"),
    "no target": (
        "cell_controller",
        "def target(",
        "def robot_name(",
        LIVE,
        "drives nobody: define target, which returns the name of its robot",
    ),
    "no target of a file": ("joint_lines", "def target(", "def robot_name(", FILE, "drives nobody: define"),
    "no close": (
        "verdict_changes",
        "    def close(",
        "    def __del__(self): self._file.close()\n    def finish(",
        SINK,
        "gives _Table, which has no close: define it, to finish what it writes",
    ),
    "no unit": ("work_height", 'unit: ClassVar[str] = "m"', "", HEIGHT, "has no unit: define unit: ClassVar"),
    "no unit of a rule": (
        "bent_load",
        'unit: ClassVar[str] = "points"',
        "",
        LOADED,
        "has no unit: define unit: ClassVar",
    ),
    "no write": (
        "verdict_changes",
        "def write(",
        "def take(",
        SINK,
        "gives _Table, which has no write: derive",
    ),
    "another load": (
        "bent_load",
        "load: float | None = None",
        "lifted: float = 0.0",
        LOADED,
        r"\[\[phases\]\] has no lifted, which Handled would take for 0.0: name it as there",
    ),
}


@pytest.mark.parametrize("how", FORGOTTEN)
def test_what_a_plug_in_leaves_out_is_said_before_the_run(tmp_path, monkeypatch, how):
    example, there, instead, table, words = FORGOTTEN[how]
    package = tmp_path / "path" / f"own_{how.replace(' ', '_')}"
    package.mkdir(parents=True)
    (package / "__init__.py").touch()
    text = (ROOT / f"examples/acme/{example}.py").read_text()
    assert text.count(there) == 1
    (package / "own.py").write_text(text.replace(there, instead))
    monkeypatch.syspath_prepend(str(tmp_path / "path"))
    folder = tmp_path / "cell"
    folder.mkdir()
    swing(folder)
    cell(folder, table.replace("KIND", f"{package.name}.own"))
    with pytest.raises(sr.SeerobError, match=words):
        run_with_sinks(folder)
    assert not (folder / "out/run.mcap").exists()


def run_with_sinks(folder):
    station = sr.load(folder, allow_plugins=True)
    station.run(folder=folder / "out", sinks=station.workstation.sinks)


def test_a_plug_in_that_fails_is_no_verdict(tmp_path, monkeypatch, capfd):
    """The interpreter's own exit code of a traceback means exceeded."""
    package = tmp_path / "path" / "own_failing"
    package.mkdir(parents=True)
    (package / "__init__.py").touch()
    text = (ROOT / "examples/acme/verdict_changes.py").read_text()
    (package / "own.py").write_text(
        text.replace("for result in snapshot.results", "for result in snapshot.result")
    )
    monkeypatch.syspath_prepend(str(tmp_path / "path"))
    folder = tmp_path / "cell"
    folder.mkdir()
    swing(folder)
    cell(folder, FROM_FILE + SINK.replace("KIND", "own_failing.own"))
    assert main(["assess", str(folder), "--allow-plugins", "-o", str(tmp_path / "out")]) == 3
    said = capfd.readouterr().err
    assert "AttributeError" in said
    assert said.endswith("seerob: a fault of the program or of a plug-in, see above; nothing is judged\n")


ENDS = """
import sys

import acme.work_height as shipped


class Ends(shipped.WorkHeight, frozen=True, kw_only=True):
    def compute(self, model):
        height = super().compute(model)

        def compute(twin):
            if float(twin.t) > 0.3:
                sys.exit(0)
            return height(twin)

        return compute
"""


def test_a_plug_in_that_ends_the_program_gives_it_no_exit_code(tmp_path, monkeypatch, capfd):
    """That of ``sys.exit()`` means within, that of ``sys.exit(1)`` exceeded: nobody judged either."""
    package = tmp_path / "path" / "own_ending"
    package.mkdir(parents=True)
    (package / "__init__.py").touch()
    (package / "asked.py").write_text(ENDS)
    (package / "imported.py").write_text("import sys\n\nsys.exit(0)\n")
    monkeypatch.syspath_prepend(str(tmp_path / "path"))
    monkeypatch.syspath_prepend(str(ROOT / "examples"))
    folder = tmp_path / "cell"
    folder.mkdir()
    swing(folder)
    rule = '[[safety]]\nkind = "own_ending.KIND"\nname = "h"\nat = "arm"\nlimit = 9\n'
    cell(folder, FROM_FILE + rule.replace("KIND", "asked"))
    out = tmp_path / "out"
    assert main(["assess", str(folder), "--allow-plugins", "-o", str(out)]) == 3
    assert "end of the program (SystemExit: 0)" in capfd.readouterr().err
    assert 'class="verdict within"' not in (out / "report.html").read_text()
    assert main(["report", str(out / "run.mcap"), "-o", str(tmp_path / "again"), "--allow-plugins"]) != 0
    recording = Recording.open(out / "run.mcap")
    assert [f.holds for f in recording.check() if "end of the program" in f.text] == [("*",)]
    cell(folder, FROM_FILE + rule.replace("KIND", "imported"))
    assert main(["assess", str(folder), "--allow-plugins", "-o", str(out)]) == 3
    assert "own_ending.imported' fails when it is imported: SystemExit: 0" in capfd.readouterr().err


STANDING = """
from seerob.api import JointSample, Opened, Source


class Standing(Source, frozen=True, kw_only=True):
    human: str

    def target(self):
        return self.human

    def open(self, folder, target):
        q = (0.0,) * len(target.joints)
        samples = [JointSample(source="", seq=k, target=self.human, t=0.02 * k, q=q) for k in range(20)]
        return Opened(samples=samples, duration=0.38)
"""


def test_how_far_angles_of_a_person_may_be_off_is_asked_of_a_source_of_ones_own(tmp_path, monkeypatch):
    package = tmp_path / "path" / "own_person"
    package.mkdir(parents=True)
    (package / "__init__.py").touch()
    (package / "stands.py").write_text(STANDING)
    monkeypatch.syspath_prepend(str(tmp_path / "path"))
    folder = tmp_path / "cell"
    folder.mkdir()
    person = '[[humans]]\nname = "op"\nstature = 1.75\nmass = 75\nsex = "male"\n'
    cell(folder, f'{person}[[sources]]\nkind = "own_person.stands"\nhuman = "op"\n')
    found = [f for _, one in sr.load(folder, allow_plugins=True).sources for f in one.findings]
    text = "angles of a posture may be off that stands op captures nobody says"
    assert [f.subject for f in found if text in f.text] == ["op"]


def test_the_page_shows_each_file_as_it_is():
    page = (ROOT / "docs/extending.md").read_text()
    shown = re.findall(r"write-docs: file/(\S+)", page)
    assert {Path(name).stem for name in shown} == {
        file.stem for file in (ROOT / "examples/acme").glob("*.py") if file.stem != "__init__"
    }


def test_files_of_the_page_import_the_public_names_only():
    for file in (ROOT / "examples/acme").glob("*.py"):
        for line in file.read_text().splitlines():
            assert not re.match(r"(from|import) seerob(?!\.api import)", line), f"{file.name}: {line}"


NAMES_OF_VERSION_1 = (
    "Answers Arrow Basis BodySample Box Closing Criterion Ellipsoid Evaluate EvaluateMany Falls "
    "Finding Highlight Hull Input InputError JointSample Label LiveSource Marker Model Opened Origin "
    "Points Polyline PoseSample Prism Quality Rays Result Row Rule Sample Scene SeerobError Segment "
    "SignalSample Sink Snapshot Source Sphere State States Target Undecided UnknownName Verdict "
    "Writer approaching beyond bind_posture judge judge_interval worst "
)


def test_no_name_of_a_version_is_taken_away():
    assert api.VERSION == 1
    assert set(NAMES_OF_VERSION_1.split()) <= set(api.__all__)
    assert all(hasattr(api, name) for name in api.__all__)
