"""The whole road: the demo recorded, replayed and recomputed from the recording alone, bit for bit."""

from __future__ import annotations

import os
import subprocess
import sys
from contextlib import nullcontext
from pathlib import Path

import msgspec
import numpy as np
import pytest
import trimesh

import seerob as sr
from kept_run import Kept
from made_cell import FLOATING, TWO_R, heard, made, two_r
from seerob.app.cli import main
from seerob.app.console.progress import Announced
from seerob.app.console.terminal import Exit
from seerob.core.errors import InputError, SimulationDiverged
from seerob.core.markers import plain
from seerob.core.snapshot import Verdict
from seerob.outputs.sink import Closing
from seerob.outputs.sinks.dossier import Dossier
from seerob.outputs.sinks.recorder import Recorder
from seerob.recording.recording import Recording
from seerob.session import run as road
from seerob.session.run import Clock, Judge, bind, engine_of, pump, ticks
from seerob.session.station import load_recorded
from seerob.twin.engine import Engine, last_tick
from seerob.workstation.source import Opened, Source

DEMO = Path(__file__).parent.parent / "workstations" / "ur10_assembly"
TICKS = 80
CSV = "t [s],j1 [rad],j2 [rad]\n" + "".join(
    f"{0.01 * k:.2f},{np.sin(0.02 * k):.9f},{0.3 + 0.004 * k:.9f}\n" for k in range(81)
)
MOVED = (
    '[[sources]]\nkind = "csv"\nrobot = "arm"\nfile = "motion.csv"\n'
    'mapping = { time = "t [s]", joints = ["j1 [rad]", "j2 [rad]"], time_unit = "s", joint_unit = "rad" }\n'
)
JUDGED = (
    '[[safety]]\nkind = "velocity"\nname = "v"\nof = "arm"\nlimit = 2.5\n'
    '[[safety]]\nkind = "kinetic_energy"\nname = "E"\nrobot = "arm"\nlimit = 4\nevery = 0.05\n'
    '[[safety]]\nkind = "minimum_distance"\nname = "d"\nbetween = ["arm", "post"]\nlimit = 0.2\n'
    '[[safety]]\nkind = "effective_mass"\nname = "m"\nat = "arm"\n'
    '[[safety]]\nkind = "manipulability"\nname = "w"\nat = "arm"\n'
)


def up_to(ticks):
    left = [ticks]

    def stop():
        left[0] -= 1
        return left[0] <= 0

    return stop


class Noted(Closing):
    """A writer that notes what it is told in a list of several."""

    def __init__(self, name, told):
        self.name, self.told = name, told

    def write(self, snapshot, samples):
        self.told.append((self.name, snapshot.seq))

    def begin(self):
        self.told.append((self.name, "begin"))

    def close(self):
        self.told.append((self.name, "close"))


def encoded(snapshots):
    """Every float, verdict, reason, basis and marker of every tick."""
    return [msgspec.msgpack.encode(snapshot, enc_hook=plain) for snapshot in snapshots]


def record(station, folder, ticks=10_000):
    station.run(folder=folder, sinks=[Recorder(lossless=True)], stop=up_to(ticks))
    return Recording.open(folder / "run.mcap")


def replayed(station, recording):
    kept = Kept()
    summary = station.run(
        feed=(tuple(tick.samples) for tick in recording.ticks()), writers=[kept], scene=station.scene()
    )
    station.replay(recording)
    return kept.snapshots, summary


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    station = sr.load(DEMO)
    folder = tmp_path_factory.mktemp("demo")
    return station, record(station, folder, TICKS)


def test_replay_of_the_demo_is_the_run(demo):
    station, recording = demo
    then = list(recording.snapshots())
    now, _ = replayed(station, recording)
    assert len(then) == TICKS
    assert all(len(s.results) == len(station.bound) for s in then)
    assert encoded(now) == encoded(then)


AGAIN = """
import sys, hashlib, msgspec
from seerob.recording.recording import Recording
from seerob.session.station import load_recorded
sys.path.insert(0, sys.argv[2])
from test_run import encoded, replayed
recording = Recording.open(sys.argv[1])
station = load_recorded(recording)
station.sources = ()
now, _ = replayed(station, recording)
print(hashlib.sha256(b"".join(encoded(now))).hexdigest())
"""


def test_a_fresh_process_recomputes_the_demo_from_the_recording_alone(demo, tmp_path):
    import hashlib

    _, recording = demo
    done = subprocess.run(
        [sys.executable, "-c", AGAIN, str(recording.path), str(Path(__file__).parent)],
        cwd=tmp_path,
        env={**os.environ, "PYTHONHASHSEED": "7"},
        capture_output=True,
        text=True,
        check=False,
    )
    then = hashlib.sha256(b"".join(encoded(recording.snapshots()))).hexdigest()
    assert done.stdout.strip() == then, done.stderr


@pytest.fixture
def meshed(tmp_path):
    """A robot of meshes with package:// and ../ paths, a part and a tool of meshes, a CSV motion."""
    urdf = two_r()
    box = '<geometry><box size="1 0.1 0.1"/></geometry>'
    urdf = urdf.replace(box, '<geometry><mesh filename="package://two_r_meshes/l.stl"/></geometry>', 1)
    urdf = urdf.replace(box, '<geometry><mesh filename="../shapes/l.obj" scale="1 2 1"/></geometry>', 1)
    link = trimesh.creation.box((1, 0.1, 0.1))
    text = (
        FLOATING
        + TWO_R.replace("arm.urdf", "robots/two_r/arm.urdf")
        + '[[tools]]\nname = "grip"\non = "arm/tip"\nmesh = "cad/grip.stl"\nunits = "mm"\nmass = 0.4\n'
        + '[[parts]]\nname = "post"\nmesh = "cad/post.stl"\n'
        + 'units = "m"\nup = "z"\nat = { position = [0, 2.6, 0] }\n'
        + MOVED
        + JUDGED
    )
    files = {
        "robots/two_r/arm.urdf": urdf,
        "robots/two_r_meshes/l.stl": link.export(file_type="stl"),
        "robots/shapes/l.obj": link.export(file_type="obj"),
        "cad/grip.stl": trimesh.creation.box((80, 40, 40)).export(file_type="stl"),
        "cad/post.stl": trimesh.creation.cylinder(0.1, 1).export(file_type="stl"),
        "motion.csv": CSV,
    }
    return made(tmp_path / "cell", text, files), tmp_path


def test_workstation_of_urdf_and_meshes_is_recomputed_from_the_recording_alone(meshed):
    import shutil

    station, folder = meshed
    recording = record(station, folder / "out")
    then = encoded(recording.snapshots())
    assert encoded(replayed(station, recording)[0]) == then
    shutil.rmtree(folder / "cell")
    again = load_recorded(recording)
    again.sources = ()
    assert encoded(replayed(again, recording)[0]) == then
    verdicts = {r.verdict for s in recording.snapshots() for r in s.results}
    assert {"within", "exceeded"} <= verdicts
    assert not any("outside/" in name for name in recording.files)


def test_a_file_outside_the_folder_is_told_not_guessed(tmp_path):
    outside = tmp_path / "elsewhere" / "arm.urdf"
    outside.parent.mkdir()
    outside.write_text(two_r())
    text = FLOATING + TWO_R.replace("arm.urdf", "../elsewhere/arm.urdf") + "q = [0, 1]\n"
    with pytest.raises(
        InputError, match=r"robots\[0\]\.model: leads to .*arm\.urdf, outside the folder.*--allow-"
    ):
        made(tmp_path / "cell", text)
    station = made(tmp_path / "cell", text, allow_outside=True)
    recording = record(station, tmp_path / "out")
    with pytest.raises(InputError, match="--workstation"):
        load_recorded(recording, allow_outside=True)
    assert replayed(station, recording)[0]


def test_a_file_that_has_changed_since_is_told(tmp_path):
    urdf = tmp_path / "arm.urdf"
    urdf.write_text(two_r())
    text = FLOATING + TWO_R.replace("arm.urdf", str(urdf)) + "q = [0, 1]\n"
    station = made(tmp_path / "cell", text, allow_outside=True)
    recording = record(station, tmp_path / "out")
    with pytest.raises(InputError, match=r"outside the folder of the workstation.*--allow-outside"):
        load_recorded(recording)
    assert load_recorded(recording, allow_outside=True).model.files == station.model.files
    urdf.write_text(two_r(masses=(1, 2)))
    with pytest.raises(InputError, match=r"other files than are found now: outside/arm/.*--workstation"):
        load_recorded(recording, allow_outside=True)


def test_robot_of_an_installed_package_is_recomputed_where_it_is_installed(tmp_path):
    name = "package:example-robot-data/double_pendulum_description/urdf/double_pendulum.urdf"
    station = made(tmp_path / "cell", FLOATING + TWO_R.replace("arm.urdf", name) + "q = [0, 0]\n")
    recording = record(station, tmp_path / "out")
    assert load_recorded(recording).model.files == station.model.files
    assert any(file.startswith("outside/arm/") for file in recording.files)


def test_workstation_file_of_another_name_is_found_in_the_recording(tmp_path):
    made(tmp_path / "cell", FLOATING + TWO_R + "q = [0, 1]\n", {"arm.urdf": two_r()})
    (tmp_path / "cell" / "workstation.toml").rename(tmp_path / "cell" / "my_cell.toml")
    station = sr.load(tmp_path / "cell" / "my_cell.toml")
    recording = record(station, tmp_path / "out")
    assert load_recorded(recording).model.files == station.model.files


def test_replay_refuses_another_tick(demo, tmp_path):
    _, recording = demo
    other = made(tmp_path, "engine = { tick = 0.004 }\n" + TWO_R, {"arm.urdf": two_r()})
    with pytest.raises(InputError, match=r"engine.tick = 0.01"):
        other.replay(recording)


# -- the loop -----------------------------------------------------------------------------------


def test_pump_hands_out_every_sample_once_and_reaches_ahead():
    samples = tuple(heard("arm", 0.002 * k, (0.0,)) for k in range(501))
    feed = list(pump([(Source(), Opened(samples=samples, duration=1.0))], 0.01))
    assert len(feed) == 101
    assert [s for tick in feed for s in tick] == list(samples)
    newest = 0.0
    for k, tick in enumerate(feed):
        newest = max([newest, *(s.t for s in tick)])
        assert newest >= min(0.01 * k, 1.0)
        assert newest <= 0.01 * k + 0.002 + 1e-9


@pytest.mark.parametrize("duration", [0.0, 0.005, 0.01, 0.999, 1.0])
def test_run_ends_with_the_last_tick_that_was_heard(duration):
    samples = (heard("arm", 0.0, (0.0,)), heard("arm", max(duration, 1e-3), (1.0,)))
    feed = list(pump([(Source(), Opened(samples=samples, duration=duration))], 0.01))
    assert (
        len(feed)
        == last_tick(duration, 0.01) + 1
        == {0.0: 1, 0.005: 2, 0.01: 2, 0.999: 101, 1.0: 101}[duration]
    )
    assert [s for tick in feed for s in tick] == list(samples)


def cell(folder, *, every="0.05", effort=1000.0):
    text = (
        FLOATING
        + TWO_R
        + (
            '[[safety]]\nkind = "velocity"\nname = "v"\nat = "arm"\nlimit = 9\n'
            '[[safety]]\nkind = "kinetic_energy"\nname = "slow"\nrobot = "arm"\n'
            f"limit = 99\nevery = {every}\n"
        )
    )
    return made(folder, text, {"arm.urdf": two_r(effort=effort)})


def moving(until=1.0, speed=2.0):
    samples = tuple(
        heard("arm", 0.01 * k, (0.01 * speed * k, 0.1), (speed, 0.0)) for k in range(int(until * 100) + 1)
    )
    return [(Source(), Opened(samples=samples, duration=1.5))]


def test_slow_criterion_speaks_of_its_own_instant(tmp_path):
    station = cell(tmp_path)
    engine = Engine(station.model, driven={"arm": 0.2})
    instants = []
    for snapshot, _ in ticks(engine, Judge(bind(station.model)), pump(moving(), 0.01)):
        if snapshot.t > 1.0:
            break
        instants.append(snapshot.results[1].t)
        assert snapshot.results[0].t is None
        assert snapshot.t - 0.05 < snapshot.results[1].t + 1e-9 <= snapshot.t + 1e-8
    assert len(set(instants)) == pytest.approx(21, abs=1)


def test_slow_criterion_does_not_outlive_what_it_rests_on(tmp_path):
    """every = 10 s, time-out 0.2 s: silence from t = 0.5 s on is UNDECIDED from 0.7 s on."""
    station = cell(tmp_path, every="10.0")
    engine = Engine(station.model, driven={"arm": 0.2})
    for snapshot, _ in ticks(engine, Judge(bind(station.model)), pump(moving(0.5, 0.0), 0.01)):
        verdict = "undecided" if snapshot.t > 0.7 + 1e-9 else "within"
        assert [r.verdict for r in snapshot.results] == [verdict, verdict], snapshot.t


def test_value_that_is_not_finite_is_undecided(tmp_path):
    from dataclasses import replace

    from seerob.core.snapshot import Result

    station = cell(tmp_path)
    (bound, _) = bind(station.model)
    for value in (np.nan, np.inf, -np.inf):
        made_up = replace(
            bound,
            evaluate=lambda _, v=value: Result(name="v", value=v, unit="m/s", limit=9.0, verdict="within"),
        )
        (result,) = Judge([made_up])(Engine(station.model, controllers=False).start())
        assert (result.verdict, result.value) == ("undecided", None)


def test_every_result_has_its_basis_in_the_scene(demo):
    _, recording = demo
    bases = {info.name: info.basis for info in recording.scene.criteria}
    results = next(iter(recording.snapshots())).results
    assert results
    for result in results:
        assert bases[result.name].formula
        assert bases[result.name].inputs


def test_every_value_of_the_demo_is_finite_or_undecided_with_a_reason(demo):
    """Standing still has no direction of motion and no limit to be judged by."""
    _, recording = demo
    for snapshot in recording.snapshots():
        for result in (part for r in snapshot.results for part in (r, *r.parts)):
            assert result.value is not None or result.reason, result.name
            assert result.value is None or np.isfinite(result.value)


def test_criteria_can_be_added_in_python(tmp_path):
    from seerob.criteria.safety.velocity import Velocity

    station = cell(tmp_path).with_criteria(Velocity(name="tight", at="arm", limit=0.1))
    engine = Engine(station.model)
    for snapshot, _ in ticks(engine, Judge(bind(station.model)), pump(moving(), 0.01)):
        assert snapshot.results[-1].name == "tight"
        if snapshot.t <= 1.0:
            assert snapshot.results[-1].verdict == "exceeded"


def test_all_names_that_are_wrong_are_told_at_once(tmp_path):
    from seerob.criteria.safety.velocity import Velocity

    station = cell(tmp_path).with_criteria(Velocity(name="a", at="x"), Velocity(name="b", of="y"))
    with pytest.raises(InputError) as error:
        bind(station.model)
    assert [p.key for p in error.value.problems] == ["safety[2] (a)", "safety[3] (b)"]


def test_a_clock_that_falls_behind_slips_by_what_was_lost():
    import time

    clock = Clock()
    time.sleep(0.3)
    clock.wait(0.01)
    assert 0.28 < clock.slipped < 60.0
    before = clock.slipped
    clock.wait(0.011)
    assert clock.slipped == before


def test_pages_are_told_how_far_a_live_run_is_behind_and_when_it_fell(tmp_path):
    station = cell(tmp_path)
    clock = Clock()
    told = []

    def progress(t):
        if t == pytest.approx(0.05):
            clock.slipped += 0.4

    class Looks:
        def __enter__(self):
            return self

        def __exit__(self, *_):
            pass

        def share(self, log):
            self.log = log

        def write(self, snapshot, samples):
            told.append(self.log.so_far(whole=False))

    road.run(
        station.model,
        pump(moving(), 0.01),
        bound=bind(station.model),
        scene=station.scene(),
        end=0.2,
        writers=[Looks()],
        clock=clock,
        progress=progress,
    )
    assert told[0].slipped < told[-1].slipped >= 0.4
    assert told[-1].slipped_at is not None
    assert told[-1].slipped_at >= 0.05


@pytest.mark.parametrize("fails", [False, True])
def test_what_takes_long_begins_when_no_tick_comes_any_more_and_before_any_writer_is_closed(tmp_path, fails):
    told = []

    def progress(t):
        if fails:
            raise ZeroDivisionError

    station = made(tmp_path, FLOATING + TWO_R + MOVED, {"arm.urdf": two_r(), "motion.csv": CSV})
    writers = [Noted("a", told), Announced(Noted("b", told), "b", lambda text: told.append(text))]
    with pytest.raises(ZeroDivisionError) if fails else nullcontext():
        station.run(writers=writers, stop=up_to(1), progress=progress)
    begins = [] if fails else [("a", "begin"), ("b", "begin")]
    assert told == [("a", 0), ("b", 0), *begins, "writing b", ("b", "close"), ("a", "close")]


@pytest.mark.parametrize(("seconds", "times"), [(0.8, 0), (12.0, 1)])
def test_memory_is_made_ready_for_a_long_motion_alone(tmp_path, monkeypatch, seconds, times):
    asked = []
    monkeypatch.setattr(road, "use_huge_pages", lambda: asked.append(1))
    motion = f"t [s],j1 [rad],j2 [rad]\n0,0,0.3\n{seconds},0.1,0.3\n"
    station = made(tmp_path, FLOATING + TWO_R + MOVED, {"arm.urdf": two_r(), "motion.csv": motion})
    station.run(stop=up_to(2))
    assert len(asked) == times


def test_a_run_that_breaks_off_is_recorded_whole_and_nothing_of_it_is_within(tmp_path):
    """Whatever came next, nobody judged it: neither report nor recording may say that all was well."""
    limit = '[[safety]]\nkind = "velocity"\nname = "v"\nof = "arm"\nlimit = 9\n'
    station = made(tmp_path, FLOATING + TWO_R + MOVED + limit, {"arm.urdf": two_r(), "motion.csv": CSV})
    assert station.run().verdict is Verdict.WITHIN

    def heard_until(t):
        for samples in pump(station.sources, 0.01):
            if any(sample.t > t for sample in samples):
                raise InputError.at("motion.csv", "row 60", "is torn", "send it again")
            yield samples

    out = tmp_path / "out"
    out.mkdir()
    sinks = [Recorder(lossless=True), Dossier(file="said.html")]
    with pytest.raises(InputError, match="is torn"):
        station.run(folder=out, sinks=sinks, feed=heard_until(0.6), end=station.duration)
    recording = Recording.open(out / "run.mcap")
    found = recording.check()
    assert recording.complete
    assert [s.t for s in recording.snapshots()] == pytest.approx(
        np.arange(len(list(recording.ticks()))) / 100
    )
    assert [f.holds for f in found] == [("*",)]
    assert "broke off" in found[0].text
    assert "motion.csv: row 60: is torn" in found[0].text
    assert main(["report", str(out / "run.mcap"), "-o", str(tmp_path / "again")]) == Exit.UNDECIDED
    page = (out / "said.html").read_text()
    assert "is torn" in page
    assert 'class="verdict undecided"' in page
    assert 'class="verdict within"' not in page


def test_a_physics_that_gives_up_ends_the_run_with_a_sentence(tmp_path):
    station = made(tmp_path, FLOATING + TWO_R + MOVED, {"arm.urdf": two_r(), "motion.csv": CSV})
    engine = engine_of(station.model)
    engine._simple = False  # where things may touch, MuJoCo is asked for whole steps
    engine.start()
    for _ in range(5):
        engine.tick()
    engine._mj.opt.integrator = 99
    with pytest.raises(
        SimulationDiverged, match=r"gave up after 0\.050 s: mj_step: invalid integrator; lower"
    ):
        engine.tick()
