"""A disk that is full: the verdict is there, the report elsewhere, and what is missing is said."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from seerob.recording.recording import Recording
from soak.cut_short import workstation

LIMITED = """
import resource, sys
resource.setrlimit(resource.RLIMIT_FSIZE, ({size}, {size}))
from seerob.app.cli import main
sys.exit(main(sys.argv[1:]))
"""


def limited(size, *arguments, cwd):
    """A command that may write no file of more than ``size`` bytes."""
    command = [sys.executable, "-c", LIMITED.format(size=size), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, cwd=cwd, timeout=300)


def on_a_full_disk(folder, size, *arguments, nowhere_else=False):
    """A command with a disk of its own of ``size`` mounted at a folder, which is copied away afterwards.

    Args:
        folder: Of the disk.
        size: As ``mount`` has it.
        arguments: Of the command.
        nowhere_else: Whether temporary folder and home are on it, too.
    """
    folder.mkdir()
    kept = folder.with_name("kept")
    script = 'mount -t tmpfs -o size="$1" none "$2" || exit 99; shift; d=$1; k=$2; shift 2; "$@"; c=$?; '
    script += 'cp -r "$d" "$k"; exit $c'
    command = [
        "unshare",
        "--user",
        "--map-root-user",
        "--mount",
        "sh",
        "-c",
        script,
        "sh",
        size,
        folder,
        kept,
    ]
    # The temporary folder is chosen before it is full.
    code = "import sys, tempfile; tempfile.gettempdir(); from seerob.app.cli import main; "
    command += [sys.executable, "-c", code + "sys.exit(main(sys.argv[1:]))", *arguments]
    environment = dict(os.environ)
    if nowhere_else:
        kept_loops = os.environ.get("XDG_CACHE_HOME", str(Path.home() / ".cache"))
        environment |= {"TMPDIR": str(folder), "HOME": str(folder), "XDG_CACHE_HOME": kept_loops}
    said = subprocess.run(
        list(map(str, command)), capture_output=True, text=True, timeout=300, env=environment
    )
    return said, kept


def can_mount():
    if shutil.which("unshare") is None:
        return False
    made = ["unshare", "--user", "--map-root-user", "--mount", "mount", "-t", "tmpfs", "none", "/mnt"]
    return subprocess.run(made, capture_output=True).returncode == 0


@pytest.mark.skipif(not can_mount(), reason="this system mounts no disk of one's own")
def test_a_full_disk_keeps_the_verdict_and_the_report_is_written_elsewhere(tmp_path):
    cell = workstation(tmp_path / "cell")
    out = tmp_path / "disk"
    said, kept = on_a_full_disk(out, "590k", "run", cell, "-o", out, "--port", "0", "--seconds", "12")
    assert said.returncode == 3, said.stderr
    assert "undecided    arm – post" in said.stdout
    assert f"not written  {out / 'run.mcap'}" in said.stdout
    assert "No space left" in said.stdout
    assert "Traceback" not in said.stderr + said.stdout
    for name in ("report.html", "results.xlsx"):
        written = [
            line.split()[1] for line in said.stdout.splitlines() if line.startswith("wrote") and name in line
        ]
        assert len(written) == 1, said.stdout
        file = Path(written[0])
        there = kept / name if file.parent == out else file
        assert there.stat().st_size > 1000
        if file.parent != out:
            shutil.rmtree(file.parent)
    # What is on the disk opens, and says that it is cut off.
    recording = Recording.open(kept / "run.mcap")
    assert not recording.complete
    assert recording.findings


@pytest.mark.skipif(not can_mount(), reason="this system mounts no disk of one's own")
def test_where_nothing_can_be_written_anywhere_the_verdict_is_said_and_what_is_missing(tmp_path):
    cell = workstation(tmp_path / "cell")
    out = tmp_path / "disk"
    said, kept = on_a_full_disk(
        out, "590k", "run", cell, "-o", out, "--port", "0", "--seconds", "12", nowhere_else=True
    )
    assert said.returncode == 3, said.stderr
    assert "undecided    arm – post" in said.stdout
    for name in ("run.mcap", "report.html", "results.xlsx"):
        assert f"not written  {out / name}" in said.stdout
    assert "wrote" not in said.stdout
    assert "Traceback" not in said.stderr + said.stdout
    assert sorted(file.name for file in kept.iterdir()) == ["run.mcap"]


def test_a_recording_that_may_not_grow_keeps_the_verdict(tmp_path):
    cell, out = workstation(tmp_path / "cell"), tmp_path / "out"
    said = limited(600_000, "run", cell, "-o", out, "--port", "0", "--seconds", "12", cwd=tmp_path)
    assert said.returncode == 3, said.stderr
    assert "undecided    arm – post" in said.stdout
    assert f"not written  {out / 'run.mcap'}" in said.stdout
    assert "File too large" in said.stdout
    assert (out / "report.html").stat().st_size > 1000
    assert not Recording.open(out / "run.mcap").complete
