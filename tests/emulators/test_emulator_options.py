"""``seerob emulate``: an emulator's options are the fields of its class, with units, defaults, mistakes."""

from __future__ import annotations

import msgspec
import pytest

from seerob.app import cli
from seerob.app.commands.emulate import PACKAGE, options_of, parser_of
from seerob.app.console.terminal import Exit
from seerob.app.emulation.options import EmulatorOptions, RobotOptions, target_of
from seerob.core.errors import InputError, UnknownName
from seerob.core.plugin import kinds, load
from seerob.workstation.conversion import described, unit_of

KINDS = kinds(PACKAGE)


@pytest.mark.parametrize("kind", KINDS)
def test_help_says_every_option_with_its_unit_and_default(kind):
    said = " ".join(parser_of(kind).format_help().split())
    for field in msgspec.structs.fields(load(PACKAGE, kind, EmulatorOptions)):
        assert f"--{field.name.replace('_', '-')}" in said
        assert described(field.type), f"{kind} {field.name} has no description"
        unit = unit_of(field.type)
        assert unit is None or f"[{unit}]" in said
        if isinstance(field.default, str | int | float) and field.default not in ("", False, True):
            shown = field.default if isinstance(field.default, str) else f"{field.default:g}"
            assert f"(default: {shown})" in said


@pytest.mark.parametrize("kind", KINDS)
def test_no_words_are_the_defaults(kind):
    assert options_of(kind, []) == load(PACKAGE, kind, EmulatorOptions)()


def test_words_are_the_values_of_the_fields():
    words = "--robot ur5 --port=7 --primary-port 0 --host localhost --seconds 2"
    asked = options_of("rtde", words.split())
    assert (asked.robot, asked.port, asked.primary_port, asked.host) == ("ur5", 7, 0, "localhost")
    assert asked.seconds == 2.0
    asked = options_of("natnet", ["--version", "3.1", "--rate", "100.5"])
    assert (asked.version, asked.rate) == ("3.1", 100.5)
    assert options_of("drfl", ["--rate", "250"]).rate == 250
    assert options_of("vive", ["--trackers", "all", "--websocket"]).trackers == "all"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("rtde --prot 3", r"--prot: unknown option; did you mean '--port'\?"),
        ("rtde --prot=3", r"--prot: unknown option; did you mean '--port'\?"),
        ("rtde --po 3", "--po: unknown option"),
        ("rtde ur10", "ur10: belongs to no option"),
        ("rtde --port x", "--port: 'x' is wrong; expected a whole number"),
        ("rtde --port 65536", "--port: 65536 is wrong; expected a whole number <= 65535"),
        ("rtde --seconds 0", r"--seconds: 0 is wrong; expected a number > 0 \[s\]"),
        ("rtde --file a.csv --waypoints b.toml", "--file and --waypoints are both given"),
        ("fri --period 0", r"--period: 0 is wrong; expected a whole number >= 1 \[ms\]"),
        ("fri --edition 3", "--edition: '3' is wrong; one of: 1, 2.5, 2.7"),
        ("drfl --rate 7", "--rate: 7 is wrong"),
        ("rtde --robot iiwa14", "--robot: iiwa14 has 7 joints, a Universal Robots arm has 6"),
    ],
)
def test_mistakes_are_named_with_what_would_be_right(words, said):
    kind, *rest = words.split()
    with pytest.raises(InputError, match=said):
        options_of(kind, rest).ready()


def test_every_mistake_is_told_at_once():
    with pytest.raises(InputError) as raised:
        options_of("fri", ["--period", "0", "--edition", "9"])
    assert [p.key for p in raised.value.problems] == ["--period", "--edition"]


def test_the_command_ends_with_an_error_and_a_near_name(capsys):
    with pytest.raises(UnknownName, match="no emulator named 'rtd'; did you mean 'rtde'"):
        options_of("rtd", [])
    assert cli.main(["emulate", "rtd"]) == Exit.ERROR
    assert cli.main(["emulate", "rtde", "--robt", "ur10"]) == Exit.ERROR
    assert "did you mean '--robot'" in capsys.readouterr().err
    with pytest.raises(SystemExit) as ended:
        cli.main(["emulate", "rtde", "--port"])
    assert ended.value.code == Exit.ERROR
    with pytest.raises(SystemExit) as ended:
        cli.main(["emulate", "rtde", "--help"])
    assert ended.value.code == Exit.WITHIN
    assert "--primary-port" in capsys.readouterr().out


def test_kinds_lists_them(capsys):
    assert cli.main(["kinds", "emulators"]) == Exit.WITHIN
    said = capsys.readouterr().out
    assert "period [ms]" in said
    assert all(f"  {kind} " in said for kind in KINDS)


def test_what_of_a_program_is_left_out_is_said(tmp_path):
    """Only a controller knows its inputs: the rest is played."""
    (tmp_path / "a.script").write_text(
        "movej([0, -1.5, 1.5, 0, 0, 0], a=1, v=1)\nif read_input():\n  movej([1, -1.5, 1.5, 0, 0, 0])\nend\n"
        "movej([0.2, -1.5, 1.5, 0, 0, 0], a=1, v=1)\n"
    )
    plays = RobotOptions(robot="ur10", waypoints=str(tmp_path / "a.script"))
    motion, what = plays.motion(target_of("ur10"))
    assert motion(60.0)[0] == pytest.approx((0.2, -1.5, 1.5, 0, 0, 0))
    assert "a.script, without line 2: " in what
