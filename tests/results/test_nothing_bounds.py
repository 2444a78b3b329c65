"""What nothing bounds between two instants is within nowhere: run, batch, `assess`, report; of any kind."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from made_cell import FLOATING, TWO_R, made, person, two_r
from seerob.app.cli import main
from seerob.core import plugin
from seerob.core.snapshot import Verdict
from seerob.recording.series import CODES
from test_testing import ERGONOMICS, EXAMPLES, LEFT_OUT, PHASE, PLACES, PLC, SAFETY, TERMS, VARIABLES

WITHIN = CODES[Verdict.WITHIN]
HEAD = 'variables = "v.toml"\n' + FLOATING.replace("}", ", physics = false }")
SOURCE = '[[sources]]\nkind = "csv"\nrobot = "arm"\nfile = "m.csv"\n'
T = np.arange(0, 0.401, 0.02)
MOVED = 0.02 * (1 - np.cos(10 * np.pi * np.minimum(T, 0.2)))
"""There and back, and then it stands."""
FILES = {
    "arm.urdf": two_r(),
    "v.toml": VARIABLES,
    "s.csv": "t,x\n" + "".join(f"{t:.2f},1\n" for t in T),
    "m.csv": "t [s],J1 [rad],J2 [rad]\n"
    + "".join(f"{t:.2f},{0.3 + q:.9f},{0.4 + q:.9f}\n" for t, q in zip(T, MOVED, strict=True)),
}
ALL = SAFETY | {"contact_force": 'human = "op"\n'}


def cell(folder, monkeypatch, criteria):
    monkeypatch.syspath_prepend(str(EXAMPLES))
    text = HEAD + TWO_R + SOURCE + person("op", 6, 0, 0) + PLACES + PLC + PHASE + criteria
    return made(folder, text, FILES)


def test_whatever_ships_is_not_within_in_a_run_or_a_batch_where_nothing_bounds_it(tmp_path, monkeypatch):
    text = "".join(f'[[safety]]\nkind = "{k}"\nname = "{k}"\n{rest}' for k, rest in ALL.items())
    for kind, rest in ERGONOMICS.items():
        text += f'[[ergonomics]]\nkind = "{kind}"\nname = "{kind}"\nhuman = "op"\n{rest}'
    station = cell(tmp_path, monkeypatch, text)
    assert {*plugin.kinds("safety"), *plugin.kinds("ergonomics")} <= {*ALL, *ERGONOMICS, *LEFT_OUT}
    accepted = {one.criterion.name for one in station.bound if one.criterion.instants}
    station.bound = tuple(replace(one, watch=None) for one in station.bound)
    run, batch = station.run().results, station.batch()
    asked = [name for name in run if WITHIN in run[name].verdicts and name not in accepted]
    assert len(asked) >= 8
    for name in run:
        if name not in accepted:
            assert run[name].verdict is not Verdict.WITHIN, name
            assert batch[name].verdict is not Verdict.WITHIN, name
        if name in asked:
            assert run[name].verdict is batch[name].verdict is Verdict.UNDECIDED, name
            assert "nothing bounds it between" in run[name].worst().reason, name


CARRIED = (
    TWO_R
    + """on = "cart"
rotor_inertia = [0.1, 0.1]
base = { position = [0, 0, 0.5] }
[[machines]]
name = "cart"
at = { position = [0, 0, 0.5] }
mass = 50
slide = { along = [1, 0, 0], lower = -1, upper = 1 }
shape = { box = [0.4, 0.4, 0.2] }
[[sources]]
kind = "csv"
robot = "cart"
file = "cart.csv"
[[safety]]
kind = "velocity"
name = "cart"
of = "cart"
limit = 9
"""
)
TILTS = (
    '[[sensors]]\nname = "mat"\nresponse = 0.1\nsource = "data sheet"\non = "arm/tip"\n'
    "at = { position = [0, 0, 0.1], rpy = [0.5, 0.3, 0] }\n"
    "pressure_mat = { corners = [[0, 0], [1, 0], [1, 1], [0, 1]] }\n"
    '[[parts]]\nname = "saw"\nshape = { sphere = 0.1 }\nat = { position = [9, 9, 0] }\n'
)
TOUCH = '[[contacts]]\nbetween = ["op", "saw"]\n'
CONTACT = 'kind = "power_and_force"\nrobot = "arm"\nhuman = "op"\ncontact_area = { arm = 1e-4 }\n'
SEPARATED = f'kind = "separation"\nbetween = ["arm", "op"]\nhuman_speed = 1.6\n{TERMS}'
DEVICE = f'kind = "device_distance"\nhazard = "saw"\n{SAFETY["device_distance"].split(chr(10), 2)[2]}'
POLYTOPE = 'kind = "force_polytope"\nat = "arm"\nlimit = 1e9\n'
KINDS = {
    "contact_force": (TWO_R + TILTS + TOUCH, 'kind = "contact_force"\nhuman = "op"\n'),
    "contact of a robot that is carried": (CARRIED, CONTACT + "drive_force = 0\n"),
    "contact with tolerances": (TWO_R, CONTACT + "stiffness_tolerance = 0.1\n"),
    "simulated stop on a carrier": (
        CARRIED,
        SEPARATED + 'stop = { acceleration = 0, reaction = 0.05, model = "simulated" }\n',
    ),
    "polytope with a free moment": (TWO_R, POLYTOPE + 'definition = "free_moment"\n'),
    "box of torques": (TWO_R, POLYTOPE + 'definition = "torque_box"\n'),
    "field that tilts": (TWO_R + TILTS, DEVICE + 'sensor = "mat"\n'),
}


@pytest.mark.parametrize(
    ("what", "every"), [*((what, "") for what in KINDS), ("contact with tolerances", "every = 0.2\n")]
)
def test_what_has_no_bound_is_undecided_between_wherever_it_is_said(tmp_path, capsys, what, every):
    """Also of contacts of which there were none whenever it was asked."""
    robot, criterion = KINDS[what]
    physics = what == "contact_force"
    text = FLOATING if physics else FLOATING.replace("}", ", physics = false }")
    text += robot + SOURCE + person("op", 9, 0, 0)
    text += f'[[safety]]\nname = "c"\n{criterion}{every}[[sinks]]\nkind = "recorder"\n'
    cart = "t [s],J1 [m]\n" + "".join(f"{t:.2f},{q:.9f}\n" for t, q in zip(T, MOVED, strict=True))
    station = made(tmp_path / "cell", text, FILES | {"cart.csv": cart})
    (one,) = (one for one in station.bound if one.criterion.name == "c")
    assert one.watch is None
    found = station.run().results["c"]
    singular = "definition" in criterion
    verdict = Verdict.EXCEEDED if singular else Verdict.UNDECIDED
    assert found.verdict is station.batch()["c"].verdict is verdict

    def said(*arguments):
        code = main([*arguments, "--json"])
        told = json.loads(capsys.readouterr().out)
        return code, next(c["verdict"] for c in told["criteria"] if c["name"] == "c")

    capsys.readouterr()
    expected = (1 if singular else 2, verdict.value)
    assert said("assess", str(tmp_path / "cell"), "-o", str(tmp_path / "out")) == expected
    (file,) = (tmp_path / "out").rglob("*.mcap")
    assert said("report", str(file), "-o", str(tmp_path / "again")) == expected
