"""The command line as a user or a pipeline meets it: words, streams, files and exit codes."""

from __future__ import annotations

import json
import os
import random
import re
import shutil
import socket
import subprocess
import sys

import pytest
from llvmlite.binding import get_host_cpu_name
from made_cells import HUMAN, SEPARATION, make_cell, seerob
from mcap.writer import Writer

import seerob as sr
from seerob.app.cli import COMMANDS
from seerob.app.console.terminal import tell
from seerob.core.snapshot import Finding

FILES = ["report.html", "results.xlsx", "run.mcap"]


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """A cell, assessed once: its folder and the folder of its files."""
    from seerob.app.cli import main

    folder = tmp_path_factory.mktemp("recorded")
    cell = make_cell(folder / "cell")
    assert main(["assess", str(cell), "-o", str(folder / "out"), "--json"]) == 0
    return cell, folder / "out"


# -- help ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", COMMANDS)
def test_help_of_each_command_has_one_example_that_parses(capsys, name):
    from seerob.app.cli import parser

    code, out, err = seerob(capsys, name.rstrip("_").replace("_", "-"), "--help")
    assert (code, err) == (0, "")
    (example,) = [line for line in out.splitlines() if line.startswith("example: ")]
    words = example.removeprefix("example: seerob ").split("   ")[0].split()
    assert parser().parse_args(words).command == name.rstrip("_").replace("_", "-")


def test_help_needs_none_of_the_heavy_packages():
    heavy = [
        "mujoco",
        "numba",
        "trimesh",
        "scipy",
        "matplotlib",
        "openpyxl",
        "mcap",
        "starlette",
        "coacd",
        "fcl",
    ]
    script = (
        "import sys\nfrom seerob.app.cli import main\n"
        "try: main(['--help'])\nexcept SystemExit: pass\n"
        f"print('loaded', [m for m in {heavy} if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert "loaded []" in done.stdout
    assert "exit code: 0 within, 1 exceeded, 2 undecided, 3 error" in done.stdout


@pytest.mark.parametrize(
    "arguments",
    [
        [],
        ["asses", "x"],
        ["assess"],
        ["assess", "x", "--jason"],
        ["run", "x", "--port", "99999"],
        ["run", "x", "--port", "http"],
        ["run", "x", "--seconds", "nan"],
        ["run", "x", "--seconds", "-1"],
        ["run"],
        ["kinds", "robots"],
    ],
)
def test_a_wrong_call_is_an_error_and_not_an_undecided(capsys, arguments):
    code, out, err = seerob(capsys, *arguments)
    assert (code, out) == (3, "")
    assert "seerob" in err


def test_python_m_seerob_is_the_command_line():
    done = subprocess.run([sys.executable, "-m", "seerob", "--version"], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("seerob ")


# -- new, check-file, kinds, schema -------------------------------------------------------------


def test_a_command_ends_at_once_after_what_is_to_be_done_at_the_end():
    """Only who traces it, say, has the interpreter take itself apart."""
    program = (
        "import atexit, sys\n"
        "from seerob.__main__ import program\n"
        "from seerob.app import cli\n"
        "atexit.register(print, 'done at the end')\n"
        "sys.argv, asked = ['seerob', 'kinds'], cli.main\n"
        "cli.main = lambda: (asked(), sys.settrace({trace}))[0]\n"
        "program()\n"
        "print('not at once')\n"
    )
    for trace, end in (("None", "done"), ("lambda *_: None", "not at once\ndone")):
        command = [sys.executable, "-c", program.format(trace=trace)]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        kinds, _, last = done.stdout.rpartition(end)
        assert (kinds.startswith("[[sources]]"), "not at once" in kinds) == (True, False)
        assert (last, done.stderr) == (" at the end\n", "")


def test_new_makes_a_folder_that_is_fine_and_touches_nothing_that_exists(capsys, tmp_path):
    code, out, _ = seerob(capsys, "new", tmp_path / "cell")
    assert code == 0
    assert "next" in out
    names = {"workstation.toml", "motion.csv", "workstation.schema.json"}
    assert {p.name for p in (tmp_path / "cell").iterdir()} == names
    first = (tmp_path / "cell/workstation.toml").read_text().splitlines()[0]
    assert (tmp_path / "cell" / first.removeprefix("#:schema ")).is_file()
    code, out, err = seerob(capsys, "check-file", tmp_path / "cell")
    assert (code, err) == (0, "")
    assert "fine" in out
    before = (tmp_path / "cell" / "workstation.toml").read_bytes()
    code, out, err = seerob(capsys, "new", tmp_path / "cell")
    assert (code, out) == (3, "")
    assert "exists already" in err
    assert (tmp_path / "cell" / "workstation.toml").read_bytes() == before
    code, _, err = seerob(capsys, "new", tmp_path / "cell" / "motion.csv" / "x")
    assert code == 3
    assert "motion.csv" in err


def test_kinds_lists_every_kind_once(capsys):
    from seerob.core import plugin

    code, out, _ = seerob(capsys, "kinds")
    assert code == 0
    for group in ("sources", "safety", "ergonomics", "sinks"):
        for kind in plugin.kinds(group):
            assert sum(line.split()[:1] == [kind] for line in out.splitlines()) >= 1
    code, only, _ = seerob(capsys, "kinds", "safety")
    assert "separation" in only
    assert "recorder" not in only


# -- assess and report --------------------------------------------------------------------------


def test_assess_as_json_says_what_the_api_says(capsys, tmp_path):
    cell = make_cell(tmp_path / "cell", limit=0.1)
    code, out, err = seerob(capsys, "assess", cell, "-o", tmp_path / "out", "--json")
    said = json.loads(out)
    run = sr.load(cell).run()
    worst = run.results["speed"].worst()
    assert (code, err) == (1, "")
    assert said["verdict"] == run.verdict == "exceeded"
    assert said["ticks"] == run.ticks == 31
    (criterion,) = said["criteria"]
    figures = {"t": worst.t, "value": worst.value, "limit": 0.1, "interval": None}
    assert criterion["worst"] == figures | {"reason": worst.reason}
    assert said["workstation_hash"] == run.scene.workstation_hash
    assert len(said["findings"]) == len(run.scene.findings)
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == FILES


def test_exit_codes_tell_within_exceeded_and_undecided(capsys, tmp_path, monkeypatch):
    monkeypatch.setattr("seerob.app.commands.assess.sinks_of", lambda *_, **__: [])
    far = HUMAN + SEPARATION
    for name, code, word, cell in (
        ("w", 0, "within ", make_cell(tmp_path / "w")),
        ("e", 1, "EXCEEDED ", make_cell(tmp_path / "e", limit=0.01, more=far)),
        ("u", 2, "undecided ", make_cell(tmp_path / "u", more=far)),
    ):
        found, out, err = seerob(capsys, "assess", cell)
        assert (name, found, err) == (name, code, "")
        assert any(line.startswith(word) for line in out.splitlines())


def test_nothing_judged_is_undecided(capsys, tmp_path, monkeypatch):
    cell = make_cell(tmp_path / "cell")
    file = cell / "workstation.toml"
    file.write_text(file.read_text().replace("limit = 9.0\n", ""))
    folder = tmp_path / "out"
    code, out, err = seerob(capsys, "assess", cell, "-o", folder)
    assert (code, err) == (2, "")
    assert sum(line.startswith("nothing judged") for line in out.splitlines()) == 1
    code, out, _ = seerob(capsys, "report", folder / "run.mcap", "-o", tmp_path / "again", "--json")
    assert (code, json.loads(out)["verdict"]) == (2, None)
    page = ("--port", "0", "--seconds", "0.1", "--no-record")
    code, out, _ = seerob(capsys, "run", cell, *page)
    assert code == 2
    assert "nothing judged" in out


def test_nobody_near_enough_for_contact_is_not_a_missing_limit(capsys, tmp_path):
    cell = make_cell(tmp_path / "cell", more=HUMAN)
    file = cell / "workstation.toml"
    head = file.read_text().split("[[safety]]")[0]
    pfl = '[[safety]]\nkind = "power_and_force"\nname = "pfl"\nrobot = "ur5e"\nhuman = "op"\nhorizon = 0.01\n'
    file.write_text(head + HUMAN + pfl)
    code, out, _ = seerob(capsys, "assess", cell, "-o", tmp_path / "out")
    (line,) = (line for line in out.splitlines() if line.startswith("nothing judged"))
    assert code == 2
    assert "pfl: no part moves, nobody within 0.01 m of a moving part" in line
    assert "limit" not in line


@pytest.mark.parametrize("name", ["report.html", "results.xlsx"])
@pytest.mark.parametrize("command", ["assess", "report"])
def test_no_file_of_another_run_is_written_over(capsys, tmp_path, recorded, command, name):
    (tmp_path / name).write_text("mine")
    what = recorded[1] / "run.mcap" if command == "report" else recorded[0]
    code, out, err = seerob(capsys, command, what, "-o", tmp_path)
    assert (code, out, err.count("\n")) == (3, "", 1)
    assert f"{name}: exists already; give another folder with -o" in err
    assert [p.name for p in tmp_path.iterdir()] == [name]
    assert (tmp_path / name).read_text() == "mine"


@pytest.fixture
def nothing_brought(monkeypatch, tmp_path):
    """No loops are there that were compiled elsewhere, for this process and for those that it starts."""
    monkeypatch.setattr("seerob.kernels._kept_loops.BROUGHT", tmp_path / "nothing")
    monkeypatch.setenv("NUMBA_CPU_NAME", get_host_cpu_name())  # who is told a processor takes no other's


def test_loops_that_are_not_kept_are_compiled_beforehand_and_counted(
    capsys, tmp_path, monkeypatch, nothing_brought
):
    from seerob.app.console import progress
    from seerob.kernels import _beforehand, _kept_loops

    names = ["paint averaged", "paint darken", "pull along"]
    monkeypatch.setattr(_beforehand, "LOOPS", {name: _beforehand.LOOPS[name] for name in names})
    monkeypatch.setattr("seerob.app.console.progress.EVERY", 0.0)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    (folder,) = progress.cache_folders()
    folder.mkdir()
    (folder / "paint.averaged-1-0123456789abcdef.py311.nbi").write_bytes(b"")  # of another source
    assert progress.missing_loops() == names
    for processor in _kept_loops.stood_in_for():
        key = _kept_loops.key_of("paint", processor)
        brought = f"paint.darken-1-{key}.py{sys.version_info.major}{sys.version_info.minor}.nbi"
        (tmp_path / "brought").mkdir(exist_ok=True)
        (tmp_path / "brought" / brought).write_bytes(b"")
        with monkeypatch.context() as wheel:
            wheel.setattr(_kept_loops, "BROUGHT", tmp_path / "brought")
            assert progress.missing_loops() == ["paint averaged", "pull along"]
    progress.compile_loops()
    assert capsys.readouterr() == ("", "".join(f"{progress.COMPILING}: {k} of 3\n" for k in range(4)))
    assert progress.missing_loops() == []
    progress.compile_loops()
    assert capsys.readouterr() == ("", "")


def test_long_work_says_where_it_is_also_without_a_terminal(capsys, tmp_path, recorded, monkeypatch):
    monkeypatch.setattr("seerob.app.console.progress.EVERY", 1e9)
    _, _, at_once = seerob(capsys, "assess", recorded[0], "-o", tmp_path / "quick")
    monkeypatch.setattr("seerob.app.console.progress.EVERY", 0.0)
    _, _, said = seerob(capsys, "assess", recorded[0], "-o", tmp_path / "out")
    assert at_once == ""
    shares = [int(found) for found in re.findall(r"^[\d.]+ s of motion: (\d+)%$", said, re.MULTILINE)]
    assert shares == sorted(shares)
    assert {0, 100} < set(shares)
    for file in ("run.mcap", "report.html", "results.xlsx"):
        assert f"\nwriting {file}\n" in said
    assert "writing report.html: 2 of 2\n" in said or "writing report.html: 1 of 1\n" in said


def test_whoever_stops_while_loops_are_compiled_leaves_no_process(monkeypatch, tmp_path, nothing_brought):
    from seerob.app.console import progress

    started = []
    begin = progress._worker
    monkeypatch.setattr(progress, "_worker", lambda errors: started.append(begin(errors)) or started[-1])
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(progress.Queue, "get", lambda self: (_ for _ in ()).throw(KeyboardInterrupt))
    with pytest.raises(KeyboardInterrupt):
        progress.compile_loops()
    assert started
    assert all(worker.returncode is not None for worker in started)


def test_loops_of_a_process_that_ended_are_compiled_again(monkeypatch, tmp_path, nothing_brought, capsys):
    from seerob.app.console import progress

    begin, started = progress._worker, []

    def worker(errors):
        started.append(begin(errors))
        if len(started) == 1:
            started[0].kill()
        return started[-1]

    monkeypatch.setattr(progress, "_worker", worker)
    monkeypatch.setattr(progress, "MOST", 1)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    names = ["paint averaged", "paint darken"]
    progress.compile_loops(names)
    assert len(started) == 2
    assert progress.missing_loops(names) == []
    # How far it is, and no failure; a machine that takes long says it more than once.
    first, *others = capsys.readouterr().err.splitlines()
    assert first == f"{progress.COMPILING}: 0 of 2"
    assert {*others} <= {f"{progress.COMPILING}: {done} of 2" for done in (1, 2)}


def test_why_a_loop_is_not_compiled_is_told(monkeypatch, tmp_path, nothing_brought, capsys):
    from seerob.app.console import progress

    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    names = ["paint averaged", "paint there_is_none"]
    progress.compile_loops(names)
    assert progress.missing_loops(names) == ["paint there_is_none"]
    said = capsys.readouterr().err
    assert "compiled when they are called, as that failed now: paint there_is_none\n" in said
    assert "AttributeError: module 'seerob.kernels.paint' has no attribute 'there_is_none'" in said


def test_where_no_process_can_be_started_loops_are_compiled_when_they_are_called(
    monkeypatch, tmp_path, nothing_brought
):
    from seerob.app.console import progress

    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(sys, "executable", str(tmp_path / "no-python"))
    progress.compile_loops()
    assert progress.missing_loops()


@pytest.mark.parametrize("command", ["check-file", "assess", "report", "swept"])
def test_the_wait_begins_with_the_announcement(tmp_path, recorded, nothing_brought, command):
    what = recorded[1] / "run.mcap" if command == "report" else recorded[0]
    output = [] if command == "check-file" else ["-o", str(tmp_path / "out.stl")]
    with subprocess.Popen(
        [sys.executable, "-m", "seerob", command, str(what), *output],
        env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        first = process.stderr.readline()
        process.kill()
    assert re.fullmatch(r"compiling the inner loops, once: 0 of \d+\n", first)


def test_numba_keeps_what_it_compiles_where_it_is_looked_for(tmp_path):
    """Asked of Numba itself, in a process that may keep it nowhere else."""
    script = (
        "from pathlib import Path\nfrom seerob.app.console import progress\n"
        "from seerob.kernels import boxes\n"
        "kept = boxes._spread._cache.cache_path\n"
        "assert [Path(kept)] == progress.cache_folders(), (kept, progress.cache_folders())"
    )
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    subprocess.run([sys.executable, "-c", script], env=environment, check=True)


def test_assess_writes_beside_the_workstation_and_never_over_a_recording(capsys, tmp_path):
    cell = make_cell(tmp_path / "cell")
    code, out, _ = seerob(capsys, "assess", cell)
    assert code == 0
    (folder,) = (cell / "runs").iterdir()
    assert [line.split()[-1] for line in out.splitlines() if line.startswith("wrote")] == [
        str(folder / name) for name in ("run.mcap", "report.html", "results.xlsx")
    ]
    before = {p.name: p.read_bytes() for p in folder.iterdir()}
    code, out, err = seerob(capsys, "assess", cell, "-o", folder)
    assert code == 3
    assert err.count("\n") == 1
    assert "run.mcap: exists already" in err
    assert {p.name: p.read_bytes() for p in folder.iterdir()} == before


@pytest.mark.parametrize("command", ["assess", "run", "report"])
def test_a_folder_that_cannot_be_made_is_one_line(capsys, tmp_path, recorded, command):
    (tmp_path / "file").write_text("in the way")
    what = recorded[1] / "run.mcap" if command == "report" else recorded[0]
    more = ("--port", "0") if command == "run" else ()
    code, _, err = seerob(capsys, command, what, "-o", tmp_path / "file" / "out", *more)
    assert code == 3
    assert err.count("\n") == 1
    assert str(tmp_path / "file" / "out") in err


def test_what_is_computed_again_lies_beside_the_run_not_in_it(capsys, tmp_path, recorded):
    run = tmp_path / "cell" / "runs" / "first"
    run.mkdir(parents=True)
    shutil.copy(recorded[1] / "run.mcap", run)
    assert seerob(capsys, "report", run / "run.mcap", "--json")[0] == 0
    assert len(list((tmp_path / "cell" / "runs").iterdir())) == 2
    assert [path.name for path in run.iterdir()] == ["run.mcap"]


def test_equal_findings_stand_in_one_line_and_the_tenth_says_how_many_follow(capsys):
    equal = [Finding(level="assumed", subject=f"arm {k}", text="masses are guessed") for k in range(8)]
    others = [Finding(level="assumed", subject="arm", text=f"guess {k}") for k in range(12)]
    warned = [Finding(level="warning", subject="arm", text=f"odd {k}", holds=("arm",)) for k in range(12)]
    tell([*equal, *others])
    shown = capsys.readouterr().out.splitlines()
    assert "arm 0, arm 1, arm 2, arm 3, arm 4, arm 5 and 2 more: masses are guessed" in " ".join(
        shown[0].split()
    )
    assert len(shown) == 10
    assert "and 4 more assumptions" in shown[-1]
    # What holds a verdict is never among them.
    tell([*others, *warned])
    shown = capsys.readouterr().out.splitlines()
    assert [line.split(maxsplit=1)[0] for line in shown] == ["warning"] * 12 + ["and"]
    tell([*others, *warned], verbose=True)
    assert len(capsys.readouterr().out.splitlines()) == 24


def test_report_of_a_recording_repeats_it_and_a_changed_workstation_says_what_changed(
    capsys, tmp_path, recorded
):
    cell, out_folder = recorded
    recording = out_folder / "run.mcap"
    code, out, err = seerob(capsys, "report", recording, "-o", tmp_path / "same", "--json")
    same = json.loads(out)
    assert (code, err, same["changes"]) == (0, "", [])
    assert same["criteria"][0]["worst"]["value"] == sr.load(cell).run().results["speed"].worst().value
    assert sorted(p.name for p in (tmp_path / "same").iterdir()) == FILES[:2]

    other = make_cell(tmp_path / "other", limit=0.01)
    (other / "motion.csv").unlink()  # what is judged is the recording's motion
    code, out, err = seerob(
        capsys, "report", recording, "--workstation", other, "-o", tmp_path / "changed", "--json"
    )
    assert (code, err) == (1, "")
    changes = json.loads(out)["changes"]
    assert changes[0] == "the workstation is not the one that was recorded"
    assert changes[1].startswith("speed: was within, max ")
    assert changes[1].endswith("limit 9")


# -- hostile recordings -------------------------------------------------------------------------


def recordings(recorded, folder):
    """Files that call themselves recordings, by what is wrong with them."""
    good = (recorded[1] / "run.mcap").read_bytes()
    with (folder / "foreign").open("wb") as file:
        writer = Writer(file)
        writer.start()
        writer.finish()
    damaged = bytearray(good)
    chance = random.Random(1)
    for _ in range(300):
        damaged[chance.randrange(len(damaged))] ^= 255
    return {
        "empty": b"",
        "noise": chance.randbytes(4000),
        "text": b"title = 'x'\n",
        "foreign": (folder / "foreign").read_bytes(),
        "cut": good[:3000],
        "damaged": bytes(damaged),
    }


def test_what_is_no_recording_is_one_line_for_every_command_that_takes_one(capsys, tmp_path, recorded):
    for name, content in recordings(recorded, tmp_path).items():
        file = tmp_path / f"{name}.mcap"
        file.write_bytes(content)
        for command in (
            ["report", file],
            ["replay", file, "--port", "0"],
            ["run", "--replay", file, "--port", "0"],
        ):
            code, out, err = seerob(capsys, *command)
            assert (name, code, out) == (name, 3, "")
            assert err.startswith(str(file)), err
            assert err.count("\n") == 1
    assert not (tmp_path / "runs").exists()
    code, _, err = seerob(capsys, "report", tmp_path / "nothing.mcap")
    assert code == 3
    assert "nothing.mcap" in err


# -- the page -----------------------------------------------------------------------------------


def test_run_replay_is_replay(capsys, recorded):
    recording = recorded[1] / "run.mcap"
    said = []
    for command in (["replay", recording], ["run", "--replay", recording]):
        code, out, err = seerob(capsys, *command, "--port", "0", "--seconds", "0.2")
        assert (code, err) == (0, "")
        said.append([line.split("http")[0] for line in out.splitlines()])
    assert said[0] == said[1]


def test_replay_ends_with_the_verdict_that_was_recorded(capsys, recorded, tmp_path):
    def replayed(file):
        code, out, err = seerob(capsys, "replay", file, "--port", "0", "--seconds", "0.01")
        return code, out.splitlines()[-1], err

    cell = make_cell(tmp_path / "fast", limit=1e-6)
    assert seerob(capsys, "assess", cell, "-o", tmp_path / "out", "--json")[0] == 1
    assert replayed(tmp_path / "out" / "run.mcap")[0] == 1
    assert replayed(recorded[1] / "run.mcap")[0] == 0
    # Of what was cut off nobody knows the rest.
    whole = (recorded[1] / "run.mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(whole[: len(whole) * 4 // 5])
    code, last, _ = replayed(tmp_path / "cut.mcap")
    assert (code, "cut off" in last) == (2, True)


def test_a_taken_port_moves_on_and_says_so(capsys, recorded):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        code, out, _ = seerob(capsys, "replay", recorded[1] / "run.mcap", "--port", port, "--seconds", "0.1")
    assert code == 0
    assert f"port {port}: " in out


def test_other_machines_are_served_encrypted_with_tokens_that_seerob_makes(
    capsys, recorded, tmp_path, monkeypatch
):
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    asked = ("run", recorded[0], "--host", "0.0.0.0", "--port", "0", "--no-record", "--seconds", "0.1")
    code, out, _ = seerob(capsys, *asked)
    assert code in (0, 2)
    pages = [line.split("https://localhost:")[1] for line in out.splitlines() if "https://localhost:" in line]
    tokens = [page.split("?token=")[1].split()[0] for page in pages if "?token=" in page]
    assert pages[-1].split()[0].endswith("/trust")
    assert len(set(tokens)) == 3
    assert {len(token) for token in tokens} == {32}
    assert str(tmp_path / "seerob" / "tls" / "authority.pem") in out
    code, out, _ = seerob(capsys, *asked, "--clear-text")
    assert "http://localhost:" in out
    assert "unencrypted" in out
    monkeypatch.setitem(sys.modules, "cryptography", None)
    code, out, err = seerob(capsys, *asked)
    assert (code, "seerob[tls]" in err, "page " in out) == (3, True, False)


def test_live_for_a_while_writes_everything_and_ends_with_the_verdict(capsys, tmp_path):
    cell = make_cell(tmp_path / "cell", limit=0.01, more="")
    code, out, err = seerob(capsys, "run", cell, "--port", "0", "--seconds", "0.3", "-o", tmp_path / "out")
    assert (code, err) == (1, "")
    assert "http://127.0.0.1:" in out
    assert "ends at 0.3 s; what depends on it is undecided from then on" in " ".join(out.split())
    assert "goes on" not in out
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == FILES


def test_what_of_a_motion_was_not_run_is_said_beside_the_verdict(capsys, tmp_path):
    cell = make_cell(tmp_path / "cell", limit=100, more="")
    code, out, _ = seerob(capsys, "run", cell, "--port", "0", "--seconds", "0.1", "--no-record")
    assert code in (0, 2)
    assert "goes on to 0.30 s: 0.20 s of it were not evaluated" in " ".join(out.split())


def test_output_into_a_closed_pipe_is_quiet():
    reading, writing = os.pipe()
    os.close(reading)
    done = subprocess.run(
        [sys.executable, "-m", "seerob", "kinds"], stdout=writing, stderr=subprocess.PIPE, check=False
    )
    os.close(writing)
    assert (done.returncode, done.stderr) == (3, b"")
