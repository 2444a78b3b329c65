"""The harness for criteria: all that ship pass it, and one that forgets does not."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from made_cell import FLOATING, made, person, two_r
from seerob.core import plugin
from seerob.core.errors import SeerobError
from seerob.testing import never_within

EXAMPLES = Path(__file__).parent.parent / "examples"
ARM = '[[robots]]\nname = "arm"\nmodel = "arm.urdf"\nq = [0.3, 0.4]\n'
PLACES = """
[[areas]]
name = "zone"
shape = { box = [0.5, 0.5, 0.5] }
at = { position = [20, 0, 0] }
[[sensors]]
name = "scanner"
response = 0.1
capability = 0.07
source = "data sheet"
at = { position = [20, 0, 0.2] }
[sensors.laser_scanner]
range = 5
angle = 3
resolution = 0.01
fields = [{ name = "warn", corners = [[0, -1], [1, -1], [1, 1], [0, 1]] }]
[[sensors]]
name = "curtain"
response = 0.02
capability = 0.014
source = "data sheet"
at = { position = [20, 5, 0] }
light_curtain = { ends = [[-0.5, 0, 0], [0.5, 0, 0]], height = 1, pitch = 0.1 }
[[sensors]]
name = "mat"
response = 0.1
source = "data sheet"
at = { position = [20, 9, 0] }
pressure_mat = { corners = [[0, 0], [1, 0], [1, 1], [0, 1]] }
"""
VARIABLES = '[[variables]]\nname = "free"\nsource = "plc"\naddress = "x"\ntype = "bool"\n'
PLC = '[[sources]]\nkind = "signals_csv"\nname = "plc"\nfile = "s.csv"\ntime = "t"\ntime_unit = "s"\n'
TERMS = "intrusion = 0\nhuman_uncertainty = 0\nrobot_uncertainty = 0\n"
STOP = "stop = { reaction = 0.01, stopping = 0.01 }\n"
SAFETY = {
    "device_distance": 'sensor = "curtain"\nhazard = "arm"\nstopping = 0.1\nreach_over = 0\nreach_under = 0\n'
    "supplement = 0\n",
    "effective_mass": 'at = "arm"\nlimit = 100\n',
    "force_polytope": 'at = "arm"\n',
    "kinetic_energy": 'robot = "arm"\nlimit = 100\n',
    "light_curtain": 'sensor = "curtain"\nof = ["arm", "op"]\n',
    "manipulability": 'at = "arm"\n',
    "minimum_distance": 'between = ["arm", "op"]\nlimit = 0.01\n',
    "point_energy": 'at = "arm"\nlimit = 100\n',
    "power_and_force": 'robot = "arm"\nhuman = "op"\n',
    "pressure_mat": 'sensor = "mat"\nof = "op"\n',
    "safety_area": 'area = "zone"\nof = ["arm", "op"]\n',
    "scanner_field": 'sensor = "scanner"\nfield = "warn"\nof = ["arm", "op"]\n',
    "sensor_agreement": 'field = "zone"\nof = "op"\nvariable = "free"\nlimit = 1\n',
    "separation": f'between = ["arm", "op"]\n{STOP}{TERMS}',
    "separation_area": 'separation = "separation"\nof = "op"\n',
    "swept_volume": 'of = "arm"\nvoxel = 0.1\nlimit = 9\n',
    "variable": 'variable = "free"\nexpected = true\n',
    "tool_force": 'at = "arm"\n',
    "joint_torque": 'robot = "arm"\n',
    "velocity": 'of = "arm"\nlimit = 9\n',
    "acme.work_height": 'at = "arm"\nlimit = 9\n',
    "acme.tool_clearance": 'at = "arm"\nlimit = -9\n',
}
BELOW = {
    "device_distance",
    "light_curtain",
    "manipulability",
    "manual_handling",
    "minimum_distance",
    "pressure_mat",
    "safety_area",
    "scanner_field",
    "separation",
    "separation_area",
}
"""Kinds that ship and whose limit bounds from below."""
PHASE = """
[[phases]]
title = "stands"
start = 0
cycle = 10
exertion = 3
exertions = 2
exertion_time = 0.5
load = 0
muscle_arms = false
muscle_body = false
supported_arms = "none"
back_supported = false
legs = "posture"
static = false
repeated = false
rapid = false
"""
LEFT_OUT = {
    "contact_force": "is never within, and wants contacts that act",
    "niosh": "depends on nobody: lifts are entered",
    "hand_activity": "depends on nobody: exertions are entered",
    "manual_handling": "depends on nobody: loads are entered",
    "ocra_checklist": "depends on nobody: answers are entered",
    "path_speed": "needs a map of a motion",
    "waypoints": "draws, and has no limit",
    "posture_table": "is iso_11226 with a table of one's own",
}
ERGONOMICS = {
    "rula": "action_level = 4\n",
    "reba": "action_level = 4\n",
    "owas": "action_category = 4\n",
    "eaws_posture": "cycle = 60\n",
    "iso_11226": "",
    "en_1005_4": "",
    "strain_index": "daily = 14400\nlimit = 10\n",
    "back_compression": "load = 0\nslow = true\n",
    "acme.bending": "limit = 10\n",
    "acme.bent_load": "limit = 2\n",
}


@pytest.fixture(scope="module")
def everything(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(EXAMPLES))
        text = 'variables = "v.toml"\n' + FLOATING + ARM + person("op", 6, 0, 0) + PLACES + PLC + PHASE
        for kind, rest in SAFETY.items():
            text += f'[[safety]]\nkind = "{kind}"\nname = "{kind}"\n{rest}'
        for kind, rest in ERGONOMICS.items():
            text += f'[[ergonomics]]\nkind = "{kind}"\nname = "{kind}"\nhuman = "op"\n{rest}'
        # Whatever somebody scores is admissible: only what is not known keeps these from being within.
        for i, kind in enumerate(ERGONOMICS):
            if rest := ERGONOMICS[kind] if "action" in ERGONOMICS[kind] else "":
                key = f'key = "ergonomics[{i}].{rest.split()[0]}"'
                text += f'[[confirmed]]\n{key}\nof = "{kind}"\nvalue = 4\nwhy = "anything will do"\n'
        files = {"arm.urdf": two_r(), "v.toml": VARIABLES, "s.csv": "t,x\n0,1\n1,1\n"}
        yield made(tmp_path_factory.mktemp("everything"), text, files)


def test_whatever_ships_is_never_within_where_nothing_is_known(everything, caplog):
    never_within(everything, {"free": True})
    assert not [record.message for record in caplog.records if " failed: " in record.message]


def test_whatever_ships_is_asked(everything):
    for group, kinds in (("safety", SAFETY), ("ergonomics", ERGONOMICS)):
        assert set(plugin.kinds(group)) - set(LEFT_OUT) <= set(kinds)


CART = """
[[machines]]
name = "cart"
shape = { box = [0.6, 0.5, 0.3] }
mass = 50
at = { position = [0, 0, 0.15] }
vehicle = {}
"""


def test_energy_of_a_machine_depends_on_who_rides_on_it(tmp_path):
    arm = ARM + 'on = "cart"\nbase = { position = [0, 0, 0.3] }\n'
    asked = '[[safety]]\nkind = "kinetic_energy"\nname = "energy"\nrobot = "cart"\nlimit = 100\n'
    never_within(made(tmp_path, FLOATING + CART + arm + asked, {"arm.urdf": two_r()}))


# -- criteria that forget --------------------------------------------------------------------------

HEAD = """
import numpy as np
from seerob.criteria.criterion import Criterion
from seerob.core.verdict import judge
from seerob.core.snapshot import Basis, Label, Result, Verdict

class Own(Criterion, frozen=True, kw_only=True):
    '''A rule of one's own.'''
    unit = "m"
    def basis(self, model): return Basis(formula="as below", source="ACME")
    def subjects(self): return ("arm",)
    def bind(self, model):
        arm, other = model.mechanisms["arm"], model.mechanisms["other"]
        kept = []
        def evaluate(state):
            {}
            return Result(name=self.name, value=value, limit=9.0, verdict=judge(value, 9.0), markers=markers)
        return evaluate
"""
GOOD = "value, markers = float(state.q(arm)[0]), ()"
FORGETS = {
    "peeks": ("value, markers = float(state.q.__self__._data.qpos[-1]), ()", "it changes when other moves"),
    "undeclared": ("value, markers = float(state.q(arm)[0] + state.q(other)[0]), ()", "it depends on other"),
    "raw": ("value, markers = float(state.data.qpos[0]), ()", "State.data does not say whether"),
    "catches": (
        "markers = ()\n            try: value = float(state.q(other)[0])\n"
        "            except Exception: value = 0.0",
        "it depends on other",
    ),
    "keeps": (
        "kept.append(float(state.q(arm)[0])); value, markers = kept[0], ()",
        "it hangs on earlier instants, and does not say so",
    ),
    "keeps every other": (
        "kept[:] = kept[:1] + [float(state.q(arm)[0])]; value, markers = sum(kept), ()",
        "it hangs on earlier instants, and does not say so",
    ),
    "random": ("value, markers = float(np.random.default_rng().random()), ()", "when the same is said again"),
    "clock": (
        "import time; value, markers = time.perf_counter() % 1, ()",
        "when the same is said again",
    ),
    "wrong side": ("value, markers = float(state.q(arm)[0]) + 9, ()", "it is exceeded"),
    "its own verdict": (
        "state.q(arm); return Result(name=self.name, value=10.0, limit=9.0, verdict=Verdict.WITHIN)",
        "contradicts itself: it is within, and 10  lies above",
    ),
    "the other side": (
        "state.q(arm); return Result(name=self.name, value=10.0, limit=9.0, at_most=False, "
        "verdict=Verdict.WITHIN)",
        "it bounds from the other side",
    ),
    "a part": (
        "part = Result(name='a', verdict=Verdict.UNDECIDED)\n            "
        "return Result(name=self.name, value=1.0, limit=9.0, verdict=Verdict.WITHIN, parts=(part,))",
        "its part a is undecided",
    ),
    "fails": ("value = kept[3]", "failed: IndexError"),
    "not a number": ("value, markers = float('nan'), ()", "not a finite number|it is undecided"),
}


@pytest.fixture
def own(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(str(tmp_path))

    def write(line, more=""):
        package = f"forgets_{tmp_path.name}"
        (tmp_path / package).mkdir()
        (tmp_path / package / "__init__.py").touch()
        (tmp_path / package / "rule.py").write_text(HEAD.format(line) + more)
        other = ARM.replace('"arm"', '"other"') + "base = { position = [0, 9, 0] }\n"
        criterion = f'[[safety]]\nkind = "{package}.rule"\nname = "own"\n'
        return made(tmp_path / "cell", FLOATING + ARM + other + criterion, {"arm.urdf": two_r()})

    return write


def test_one_that_asks_what_it_declares_passes(own):
    never_within(own(GOOD))


@pytest.mark.parametrize("how", FORGETS)
def test_one_that_forgets_fails(own, how):
    line, words = FORGETS[how]
    with pytest.raises(AssertionError, match=words):
        never_within(own(line))


def test_one_that_says_that_it_judges_parts_and_asks_nothing_fails(own):
    """What it found when it could is worth nothing once nobody is heard."""
    line = "kept.append(1.0) if kept else kept.append(float(state.q(arm)[0])); value, markers = kept[0], ()"
    with pytest.raises(AssertionError, match="it hangs on earlier instants, and does not say so"):
        never_within(own(line, "    whole = False\n"))


def test_one_that_remembers_and_judges_parts_is_not_within_once_nobody_is_heard(own):
    """The judge sees to it."""
    line = "kept.append(1.0) if kept else kept.append(float(state.q(arm)[0])); value, markers = kept[0], ()"
    never_within(own(line, "    whole = False\n    def remembers(self, model): return True\n"))


def test_a_basis_that_is_missing_fails(own):
    with pytest.raises(SeerobError, match="has no basis"):
        never_within(own(GOOD, "Own.basis = Criterion.basis\n"))


def test_a_workstation_is_enough_for_pytest(own, tmp_path):
    """``pytest -p seerob.testing my_cell/workstation.toml``."""
    own(GOOD)
    asked = [sys.executable, "-m", "pytest", "-q", "-p", "seerob.testing", "-p", "no:cacheprovider"]
    env = {"PYTHONPATH": str(tmp_path), "PATH": "/usr/bin:/bin"}
    file = str(tmp_path / "cell" / "workstation.toml")
    done = subprocess.run([*asked, file], capture_output=True, text=True, check=False, env=env, cwd=tmp_path)
    assert (done.returncode, "1 passed" in done.stdout) == (0, True), done.stdout


# -- rules about postures that forget ----------------------------------------------------------------

RULE = """
import random, time
import numpy as np
from seerob.api import Basis, Model, Result, Rule, State, Undecided, Verdict, beyond, bind_posture, judge

class Own(Rule, frozen=True, kw_only=True):
    '''Points of a posture.'''
    unit = "m"
    limit: float = 2.5
    def basis(self, model): return Basis(formula="as below", source="ACME")
    def bind(self, model):
        read, other = bind_posture(model, self.human), bind_posture(model, "other")
        op = model.mechanisms[self.human]
        bone = {b.name.partition("/")[2]: b.index for b in model.bodies if b.owner == self.human}
        head, hand, thorax = (bone[name] for name in ("head", "right_hand", "thorax"))
        kept = []
        def evaluate(state):
            BODY
            if np.isnan(value):
                return Result(name=self.name, limit=self.limit, verdict=Verdict.UNDECIDED, reason="not seen")
            return Result(name=self.name, value=value, limit=self.limit, verdict=judge(value, self.limit))
        return evaluate
"""
GOOD_RULE = "value = float(read(state).elbow_flexion[0])"
BAD_RULES = {
    "keeps its first answer": (
        "kept.append(float(read(state).elbow_flexion[0])) if not kept else None; value = kept[0]",
        "hangs on earlier instants",
    ),
    "keeps its last answer where it knows none": (
        "try: kept.append(float(read(state).elbow_flexion[0]))\n            except Undecided: pass\n"
        "            value = kept[-1]",
        "",  # the judge takes it back, whatever it says
    ),
    "answers by chance": ("read(state); value = random.random()", "when the same is said again"),
    "answers by the clock": ("read(state); value = time.perf_counter() % 1", "when the same is said again"),
    "judges somebody else": (
        "value = float(read(state).elbow_flexion[0] + other(state).elbow_flexion[0])",
        "it depends on other",
    ),
    "swallows that somebody else is not known": (
        "value = float(read(state).elbow_flexion[0])\n"
        "            try: value += float(other(state).trunk_flexion)\n            except Undecided: pass",
        "it depends on other",
    ),
    "takes what is not seen for straight": (
        "value = float(np.nan_to_num(read(state).elbow_flexion[0])) + 0 * float(read(state).trunk_flexion)",
        "it is within although right_(upper_arm|forearm) of op is not sure, and exceeded with right_elbow",
    ),
    "takes the arm that is seen for both": (
        "angles = read(state); value = float(np.nanmax(angles.elbow_flexion))",
        "it is within although right_(upper_arm|forearm) of op is not sure, and exceeded with right_elbow",
    ),
    "judges what is known of a span": (
        "angles = read(state); bent = beyond(angles.elbow_flexion[0], 1.5)\n"
        "            value = 3.0 * float(bent.low) + 0 * float(angles.trunk_flexion)",
        "it is within although right_(upper_arm|forearm) of op is not sure",
    ),
    "writes what is no limit": (
        "read(state); return Result(name=self.name, value=1.0, limit=float('inf'), verdict=Verdict.WITHIN)",
        "its limit is inf",
    ),
}


@pytest.fixture
def own_rule(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(str(tmp_path))

    def write(body):
        package = f"rules_{tmp_path.name}"
        (tmp_path / package).mkdir()
        (tmp_path / package / "__init__.py").touch()
        (tmp_path / package / "rule.py").write_text(RULE.replace("BODY", body))
        rule = f'[[ergonomics]]\nkind = "{package}.rule"\nname = "own"\nhuman = "op"\n'
        return made(tmp_path / "cell", person("op") + person("other", 3, 0, 0) + rule)

    return write


def test_a_rule_that_asks_what_it_declares_passes(own_rule):
    never_within(own_rule(GOOD_RULE))


@pytest.mark.parametrize("how", BAD_RULES)
def test_a_rule_that_forgets_fails_or_is_taken_back(own_rule, how):
    body, words = BAD_RULES[how]
    station = own_rule(body)
    if not words:
        never_within(station)
        return
    with pytest.raises(AssertionError, match=words):
        never_within(station)


# -- bounds between ticks that forget ----------------------------------------------------------------

FALLS = """
    def bind(self, model):
        arm = model.mechanisms["arm"]
        def evaluate(state):
            value = float(np.abs(state.qd(arm)).max())
            return Result(name=self.name, value=value, limit=9.0, verdict=judge(value, 9.0))
        return evaluate
    def falls(self, model, points):
        return lambda span, margin: {}
"""
BOUNDS = {
    "generous": ("(9.0, 9.0)", ""),
    "nothing": ("(0.0, 0.0)", "own: a margin of .* between two ticks, and falls bounds it by"),
    "a gain": ("(-1.0, 0.0)", "falls says .*, and no margin falls by less than nothing"),
    "no number": ("(float('nan'), 0.0)", "falls says .*, and no margin falls by less than nothing"),
}


@pytest.mark.parametrize("how", BOUNDS)
def test_a_bound_between_ticks_that_forgets_fails(own, how):
    said, words = BOUNDS[how]
    station = own(GOOD, FALLS.format(said))
    if not words:
        never_within(station)
        return
    with pytest.raises(AssertionError, match=words):
        never_within(station)
