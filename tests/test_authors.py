"""What authors of criteria can forget, and what must not become green for it: the judge sees to it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from made_cell import FLOATING, TWO_R, made, person, state_at, two_r
from seerob.core.errors import InputError, NotAsked, Undecided
from seerob.core.snapshot import Result, Row, Verdict
from seerob.core.verdict import ROUNDING
from seerob.criteria.criterion import GIVEN_A_MODEL, Criterion
from seerob.criteria.judging import Judge, contradiction
from seerob.criteria.question import declared, needed
from seerob.criteria.safety.minimum_distance import MinimumDistance
from seerob.criteria.safety.velocity import Velocity
from seerob.session.run import bind
from seerob.twin.authors_view import OF_AN_INSTANT
from seerob.twin.engine import Engine

EXAMPLES = Path(__file__).parent.parent / "examples"
WITHIN, EXCEEDED, UNDECIDED = Verdict.WITHIN, Verdict.EXCEEDED, Verdict.UNDECIDED
HEAD = """
from dataclasses import dataclass
import numpy as np
from seerob.criteria.criterion import Criterion
from seerob.core.verdict import judge
from seerob.distance.least import Per
from seerob.core.snapshot import Basis, Result, Verdict

class Own(Criterion, frozen=True, kw_only=True):
    '''A rule of one's own.'''
    unit = "m"
    of: str = "arm"
    limit: float = 100.0
    def subjects(self): return (self.of,)
    def basis(self, model): return Basis(formula="as below", source="ACME")
    def result(self, value): return Result(
        name=self.name, value=float(value), limit=self.limit, verdict=judge(float(value), self.limit))
"""
BIND = """
    def bind(self, model):
        arm, frame = model.mechanisms["arm"], model.frame("arm")
        bodies = model.select("arm")
        def evaluate(state):
            {}
        return evaluate
"""
READS = {
    "pose": "return self.result(state.pose(frame)[1][0])",
    "placed": "return self.result(np.abs(state.placed(bodies)[1][list(bodies)]).max())",
    "velocities": "return self.result(np.abs(state.body_velocities(bodies)[0][list(bodies)]).max())",
    "data_of": "return self.result(state.data_of('arm').qpos[0])",
    "q": "return self.result(state.q(arm)[0])",
    "nothing": "return self.result(1.0)",
    "hearing": "return self.result(len(state.hearing('arm').heard))",
    "data": "return self.result(state.data.qpos[0])",
    "positions": "return self.result(state.positions[0, 0])",
    "rotations": "return self.result(state.rotations[0, 0, 0])",
    "quaternions": "return self.result(state.quaternions[0, 0])",
    "joint_positions": "return self.result(state.joint_positions(arm)[0])",
    "poses": "return self.result(len(state.poses()))",
    "largest_speeds": "return self.result(state.largest_speeds()[0])",
    "hearings": "return self.result(len(state.hearings['arm'].heard))",
    "signals": "return self.result(state.signals.value('x', state.t))",
}
RAW = ("data", "positions", "rotations", "quaternions", "joint_positions", "poses", "hearings", "signals",
       "largest_speeds")  # fmt: skip
OWN = '[[safety]]\nkind = "{}"\nname = "own"\n'


@pytest.fixture
def own(tmp_path, monkeypatch):
    """A workstation with an arm that nobody drives and a criterion of one's own."""
    monkeypatch.syspath_prepend(str(tmp_path))
    count = iter(range(99))

    def write(text, more="", head=HEAD, q="", engine=FLOATING):
        kind = f"own_{next(count)}_{tmp_path.name.replace('-', '_')}"
        package = tmp_path / kind
        package.mkdir()
        (package / "__init__.py").touch()
        (package / "rule.py").write_text(head + text)
        cell = engine + TWO_R + q + OWN.format(f"{kind}.rule") + more
        return made(tmp_path / f"{kind}_cell", cell, {"arm.urdf": two_r()})

    return write


def unheard(station):
    return Judge(bind(station.model))(Engine(station.model).start())[0]


def test_the_shipped_example_of_a_robot_that_nobody_ever_heard_is_undecided(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(str(EXAMPLES))
    text = '[[robots]]\nname = "ur5e"\nmodel = "library:ur5e"\n[[safety]]\nkind = "acme.work_height"\n'
    station = made(tmp_path, f'{text}name = "height"\nat = "ur5e"\nlimit = 9\n')
    found = station.run().results["height"]
    assert (found.verdict, found.worst().value) == (UNDECIDED, None)
    assert "no source drives it" in found.worst().reason


@pytest.mark.parametrize("read", READS)
def test_whatever_is_read_of_a_robot_that_nobody_heard_is_undecided(own, read):
    """By its own accessor, or because the judge required what the criterion is about, or as closed."""
    found = unheard(own(BIND.format(READS[read])))
    assert (found.verdict, found.value) == (UNDECIDED, None)
    assert "no source drives it" in found.reason


@pytest.mark.parametrize("read", READS)
def test_nothing_is_read_that_does_not_say_whether_it_may_be_relied_on(own, read):
    """Also by a criterion that forgot to say whom it is about; raw data stay closed whoever is heard."""
    text = BIND.format(READS[read]) + "    def subjects(self): return ()\n"
    found = unheard(own(text))
    if read == "nothing":
        assert found.verdict is WITHIN  # it depends on nobody
    elif read in RAW:
        assert (found.verdict, f"State.{read} does not say whether" in found.reason) == (UNDECIDED, True)
        assert "rule.py, line" not in found.reason or "NotAsked" in found.reason
    else:
        assert (found.verdict, "no source drives it" in found.reason) == (UNDECIDED, True)
    known = unheard(own(text, q="q = [0, 0]\n"))
    # Where it stands is known then; how fast it is, of which data also speak, no source says.
    assert known.verdict is (UNDECIDED if read in (*RAW, "velocities", "data_of") else WITHIN)


def test_what_was_not_asked_for_is_not_a_number(own):
    """Of bodies beside those that were named nothing is told."""
    text = BIND.format("return self.result(state.placed(bodies[:1])[1][list(bodies)].max())")
    found = unheard(own(text, q="q = [0, 0]\n"))
    assert (found.verdict, "not a finite number" in found.reason) == (UNDECIDED, True)


def test_raw_data_are_open_outside_of_a_judgement_and_closed_in_it(own):
    state = state_at(own(BIND.format(READS["q"]), q="q = [0, 0]\n"), arm=((0, 0), (0, 0)))
    assert state.positions.shape == (len(state.model.bodies), 3)
    with state.asking(), pytest.raises(NotAsked, match=r"ask State\.placed\(bodies\)"):
        _ = state.positions
    assert np.isfinite(state.rotations).all()


def test_a_person_of_whom_a_bone_is_asked_is_required(tmp_path):
    station = made(tmp_path, FLOATING + person())
    state = Engine(station.model).start()
    state.hearings["op"].given = False
    frame = station.model.frames["op/right_hand"]
    with pytest.raises(Undecided, match="op: "):
        state.pose(frame)
    assert "op" in state.asked


def test_what_is_worked_out_once_is_depended_on_by_everybody_who_takes_it(own):
    """Whoever comes second rests on the same robot as whoever came first."""
    state = state_at(own(BIND.format(READS["q"]), q="q = [0, 0]\n"), arm=((0, 0), (0, 0)))
    arm = state.model.mechanisms["arm"]
    for _ in range(2):
        with state.asking():
            state.once(("mean",), lambda: state.q(arm).mean())
        assert state.asked == {"arm"}


def test_a_link_without_a_shape_is_of_its_robot_and_what_is_none_is_of_nobody(own):
    """A criterion that says so, and asks nothing, rests on the robot all the same."""
    head = HEAD.replace('of: str = "arm"', 'of: str = "arm/tip"')
    station = own(BIND.format(READS["nothing"]), head=head, more=person("op", 3, 0, 0))
    found = unheard(station)
    assert (found.verdict, "arm: no source drives it" in found.reason) == (UNDECIDED, True)
    assert needed(station.bound[0].criterion, station.model) == (("arm",), ())
    assert declared(station.model, ["arm/tip"]) == ("arm",)
    assert declared(station.model, ["a sensor"]) == ()


# -- a criterion that is not one ----------------------------------------------------------------

NO_BASIS = HEAD.replace('    def basis(self, model): return Basis(formula="as below", source="ACME")\n', "")
GOOD = BIND.format(READS["q"])


@pytest.mark.parametrize(
    ("text", "head", "words"),
    [
        (GOOD, NO_BASIS, r"Own of own_\w+\.rule has no basis: define basis\(self, model\)"),
        ("", HEAD, r"has no compute: define compute\(self, model\)"),
        (
            "    def bind(self, model): return 1 / 0\n",
            HEAD,
            r"ZeroDivisionError: division by zero \(rule\.py",
        ),
        ("    def bind(self, model): return None\n", HEAD, "returns NoneType, not a function of State"),
        (
            GOOD + "    def basis(self, model): return 'by heart'\n",
            HEAD,
            r"returns str, not a seerob\.api\.Basis",
        ),
        (GOOD + "    def basis(self, model): return {}['x']\n", HEAD, "basis of .* fails: KeyError: 'x'"),
    ],
)
def test_a_criterion_that_is_none_is_refused_with_file_and_key(own, text, head, words):
    station = own(text, head=head)
    with pytest.raises(InputError, match=words) as error:
        _ = station.bound
    (problem,) = error.value.problems
    assert (problem.file, problem.key) == ("workstation.toml", "safety[0] (own)")


def test_subjects_are_a_tuple_of_names(own):
    with pytest.raises(
        InputError, match=r"safety\[0\]: subjects of own_\w+.rule is the text 'arm'; return a tup"
    ):
        own(GOOD + "    def subjects(self): return 'arm'\n")


@pytest.mark.parametrize(
    ("returned", "words"),
    [
        ("return 1 / 0", ".rule failed: ZeroDivisionError: division by zero (rule.py, line"),
        ("return 3.0", "returns float, not a Result"),
        ("return None", "returns NoneType, not a Result"),
        ("return Result(name='other', value=1.0, limit=2.0, verdict=Verdict.WITHIN)", "is called 'other'"),
        ("return Result(name='own', value=1.0, limit=2.0, verdict='within')", "its verdict is 'within'"),
        (
            "return Result(name='own', value=float('nan'), limit=2.0, verdict=Verdict.WITHIN)",
            "within, and nan",
        ),
        ("return Result(name='own', value=3.0, limit=2.0, verdict=Verdict.WITHIN)", "3  lies above"),
        ("return Result(name='own', value=3.0, verdict=Verdict.WITHIN)", "it is within, and has no limit"),
        ("return Result(name='own', limit=2.0, verdict=Verdict.WITHIN)", "it is within, and has no value"),
        ("return self.result(float('inf'))", "is inf, not a finite number"),
        (
            "return Result(name='own', value=1.0, limit=float('nan'), verdict=Verdict.EXCEEDED)",
            "its limit is nan, not a finite number",
        ),
        (
            "return Result(name='own', value=3.0, limit=2.0, interval=(3.0, float('inf')),"
            " verdict=Verdict.EXCEEDED)",
            "an end of its interval is inf",
        ),
        (
            "part = Result(name='a', value=1.0, limit=float('inf'), verdict=Verdict.WITHIN); "
            "return Result(name='own', value=1.0, limit=2.0, verdict=Verdict.WITHIN, parts=(part,))",
            "a: its limit is inf, not a finite number",
        ),
        (
            "return Result(name='own')",
            "says nothing, neither a figure nor a verdict: where there is nothing to",
        ),
        ("return Result(name='own', reason='no device')", "say nothing=True with a reason; no device"),
        ("return Result(name='own', limit=2.0)", "says nothing, neither a figure nor a verdict"),
        ("return Result(name='own', value=3.0, limit=2.0)", "it has a limit and no verdict"),
        ("return Result(name='own', value=3.0)", "it has a limit and no verdict"),
        ("return Result(name='own', nothing=True)", "there is nothing to judge, and not why"),
        (
            "return Result(name='own', value=1.0, limit=2.0, verdict=Verdict.WITHIN, nothing=True)",
            "within, and says",
        ),
    ],
)
def test_what_is_no_result_or_contradicts_itself_is_undecided(own, returned, words):
    found = unheard(own(BIND.format(returned), q="q = [0, 0]\n"))
    assert found.verdict is UNDECIDED
    assert words in found.reason


@pytest.mark.parametrize("words", ["nothing=True, reason='nobody is near'", "value=3.0"])
def test_nothing_to_judge_is_said_with_its_reason_and_a_figure_without_a_limit_informs(own, words):
    text, head = (
        BIND.format(f"return Result(name='own', {words})"),
        HEAD.replace("limit: float", "other: float"),
    )
    found = unheard(own(text, q="q = [0, 0]\n", head=head))
    assert (found.verdict, found.nothing) == (None, "nothing" in words)


@pytest.mark.parametrize("more", ["t=0.0", "muted=True", "t=state.t, muted=state.t > 0.05"])
def test_no_author_says_when_a_criterion_was_asked_or_that_it_did_not_apply(own, more):
    """An instant that is told again is counted once: what is exceeded later must not pass for the first."""
    value = f"value=state.t, limit=0.2, verdict=judge(state.t, 0.2), {more}"
    station = own(BIND.format(f"return Result(name='own', {value})"), q="q = [0, 0]\n")
    found = station.run(feed=iter([()] * 40)).results["own"]
    assert (found.verdict, len(found), found.times().muted) == (EXCEEDED, 40, 0.0)
    early = station.run(feed=iter([()] * 10)).results["own"]
    assert (early.verdict, early.times().open) == (UNDECIDED, 1.0)


@pytest.mark.parametrize("name", ["", "v"])
def test_two_criteria_of_one_name_are_refused(own, name):
    """The second would pass for the first, shown again."""
    lax, strict = (Velocity(name=name, at="arm", limit=limit, every=0.05) for limit in (9.0, 0.01))
    with pytest.raises(InputError, match=f"two criteria {'are called .v.' if name else 'have no name'}"):
        own(GOOD).with_criteria(lax, strict).run()
    assert own(GOOD).with_criteria(lax).run().ticks == 1


def test_a_whole_is_no_greener_than_its_parts(own):
    criterion = own(GOOD).bound[0].criterion
    within = {"value": 1.0, "limit": 2.0, "verdict": WITHIN}
    for inner in (Result(name="a", verdict=UNDECIDED), Result(name="a", verdict=EXCEEDED)):
        assert "its part a is" in contradiction(Result(name="own", parts=(inner,), **within), criterion)
    assert "its part a" in contradiction(
        Result(name="own", rows=(Row(name="a", verdict=EXCEEDED),), **within), criterion
    )
    for verdict, found in ((WITHIN, ""), (None, ""), (UNDECIDED, "its part a is undecided")):
        rows = (Row(name="a", verdict=verdict),)
        assert contradiction(Result(name="own", rows=rows, **within), criterion).endswith(found)
        assert bool(contradiction(Result(name="own", rows=rows, **within), criterion)) is bool(found)
    wide = Result(name="own", interval=(0.5, 2.5), **within)
    assert "2.5  lies above its limit" in contradiction(wide, criterion)
    low = Result(name="own", value=3.0, limit=2.0, at_most=False, interval=(1.5, 4.0), verdict=WITHIN)
    assert "1.5  lies below its limit" in contradiction(low, criterion)
    high = Result(name="own", value=3.0, limit=2.0, at_most=False, verdict=WITHIN)
    assert "from the other side" in contradiction(high, criterion)
    boundless = Result(name="own", value=3.0, limit=float("inf"), verdict=WITHIN)
    assert "its limit is inf" in contradiction(boundless, criterion)
    least = MinimumDistance(name="own", between=("arm", "op"), limit=2.0)
    assert "from the other side" in contradiction(Result(name="own", **within), least)
    for limit, off, side in (
        (0.0, ROUNDING, "but for rounding on"),
        (2e3, 1e3 * ROUNDING, "but for rounding on"),
        (1e-3, 0.5 * ROUNDING, "but for rounding on"),
        (1e-3, 1.05 * ROUNDING, "above"),
        (-2e3, 1e3 * ROUNDING, "but for rounding on"),
        (2.0, 5 * ROUNDING, "above"),
    ):
        edge = Result(name="own", value=limit + off, limit=limit, verdict=WITHIN)
        assert f"lies {side} its limit" in contradiction(edge, criterion)
    for end, at_most in ((2, True), (2.0 - 3 * ROUNDING, True), (2.0 + 3 * ROUNDING, False)):
        kept = Result(name="own", value=end, limit=2.0, at_most=at_most, verdict=WITHIN)
        assert "its limit" not in contradiction(kept, criterion)
    nested = Result(name="a", parts=(Result(name="b", verdict=EXCEEDED),))
    assert "its part b" in contradiction(Result(name="own", parts=(nested,), **within), criterion)
    assert contradiction(Result(name="own", parts=(Result(name="a"),), **within), criterion) == ""
    assert contradiction(Result(name="own", value=9.0, limit=2.0, verdict=EXCEEDED), criterion) == ""


# -- what a criterion does beside ----------------------------------------------------------------

NOBODY = "    def subjects(self): return ()\n"
GAP = "t [s],j1 [rad],j2 [rad]\n" + "".join(
    f"{k / 100},{k / 1000},{k / 500}\n" for k in range(101) if not 30 < k < 95
)
STANDS_AT_LAST = "t [s],j1 [rad],j2 [rad]\n" + "".join(
    f"{k / 100},{min(k, 20) / 1000},0\n" for k in range(31)
)
LOG = '[[sources]]\nkind = "csv"\nrobot = "arm"\nfile = "m.csv"\n'


@pytest.mark.parametrize(
    "body",
    [
        "try: kept.append(state.q(arm)[0])\n            except Exception: pass",
        "if not kept: kept.append(state.q(arm)[0])",
        "if not kept: kept.append(state.placed(bodies)[1])",
        "if not kept: kept.append(state.data_of('arm'))",
        "if not kept: kept.append(state.once(('own',), lambda: state.q(arm)[0]))",
    ],
)
@pytest.mark.parametrize("whole", ["", "    whole = False\n"])
def test_whom_it_asked_for_once_it_rests_on_though_it_hides_that(own, body, whole):
    """It says that it is about nobody, and swallows what it is told, or remembers what it once read."""
    text = BIND.format(f"{body}\n            return self.result(1.0)").replace("arm, ", "kept, arm, ", 1)
    text = text.replace('= model.mechanisms["arm"]', '= [], model.mechanisms["arm"]') + NOBODY
    station = own(text.replace("    def bind", f"{whole}    def bind", 1), LOG)
    Path(station.model.folder, "m.csv").write_text(GAP)
    found = station.run().results["own"]
    assert found.verdict is UNDECIDED
    said = dict(zip(found.t.round(3).tolist(), found.verdicts.tolist(), strict=True))
    assert (said[0.2], said[0.6]) == (0, 2)
    assert any("does not declare it (depends, variables)" in reason for reason in found.reasons)


BESIDE = {
    "touches": "state.touches",
    "where people were captured": "state.captured_qpos",
    "whose speeds": "state.speeds_asked.clear()",
    "asks again itself": "state.asking().__enter__()",
    "known masses": "state.known_masses_alone().__enter__()",
    "another author": "state.for_author('').__enter__()",
    "time": "state.t = 0.0",
    "forgets": "state.heard()",
    "another instant": "state.refresh(0.0)",
    "a state of before": "kept.append(state) or kept[0].q(arm)[0]",
    "raw data of before": "kept.append(state) or kept[0].data",
}


@pytest.mark.parametrize("what", BESIDE)
def test_what_is_the_judges_is_refused_whoever_is_heard(own, what):
    text = BIND.format(f"{BESIDE[what]}; return self.result(1.0)").replace("arm, ", "kept, arm, ", 1)
    text = text.replace('= model.mechanisms["arm"]', '= [], model.mechanisms["arm"]')
    found = own(text + NOBODY, q="q = [0, 0]\n").run(feed=iter([()] * 3)).results["own"]
    assert found.verdict is UNDECIDED
    refused = "NotAsked" in found.worst().reason or "AttributeError" in found.worst().reason
    assert refused, found.worst().reason


def test_every_name_of_a_state_is_given_or_refused(own):
    """What is new in `State` is refused until somebody lists it; what is listed is there."""
    station = own(BIND.format(READS["q"]), q="q = [0, 0]\n")
    state = state_at(station, arm=((0, 0), (0, 0)))
    names = {name for name in dir(state) if not name.startswith("_")}
    assert names > OF_AN_INSTANT
    with state.asking(), state.for_author("own") as view:
        for name in names - OF_AN_INSTANT:
            with pytest.raises(NotAsked):
                getattr(view, name)
        for name in OF_AN_INSTANT:
            getattr(view, name)
        view.require("arm")
        view.asked.clear()
        assert state.asked == {"arm"}
        with pytest.raises(AttributeError, match="State has no anything"):
            _ = view.anything
    with pytest.raises(NotAsked, match="a question was answered with it"):
        _ = view.t


OTHER = TWO_R.replace('"arm"', '"other"', 1) + "base = { position = [0, 9, 0] }\n"
OF_OTHERS = {
    "their joints": "d.qpos.sum()",
    "their speeds": "d.qvel.sum()",
    "their links": "d.xpos.sum()",
    "how they are turned": "d.xmat.sum()",
    "the common centre of mass": "d.subtree_com[0, 0]",
    "their axes": "d.xanchor.sum()",
    "their twists": "d.cvel.sum()",
    "what follows from them": "(mujoco.mj_kinematics(state.model.mj, d), d.xpos.sum())[1]",
}


@pytest.mark.parametrize("what", OF_OTHERS)
def test_mujocos_data_of_one_robot_tell_nothing_of_another(own, what):
    text = BIND.format(f"d = state.data_of('arm'); return self.result({OF_OTHERS[what]})")
    station = own(text, OTHER + LOG, head=HEAD.replace("import numpy", "import mujoco\nimport numpy"))
    Path(station.model.folder, "m.csv").write_text(GAP)
    found = station.run(feed=None).results["own"]
    assert set(found.verdicts.tolist()) == {2}
    assert "not a finite number" in found.worst().reason or "not heard" in found.worst().reason


def test_mujocos_data_of_a_robot_are_its_own(own):
    read = "float(d.qpos[:2].sum() + d.qvel[:2].sum() + np.abs(d.xpos[frame.mj]).sum())"
    text = BIND.format(f"d = state.data_of('arm'); return self.result({read})")
    station = own(text, OTHER + LOG)
    Path(station.model.folder, "m.csv").write_text(GAP)
    found = station.run().results["own"]
    assert found.verdicts[20] == 0
    assert found.values[20] == pytest.approx(0.02 + 0.04 + 0.1 + 0.2 + np.abs(tip(0.02, 0.04)).sum())


def tip(a, b):
    return np.cos(a) + np.cos(a + b), np.sin(a) + np.sin(a + b)


ALTERED = {
    "masses": "state.mass_matrix(arm)[:] *= 1e-6",
    "ellipsoid": "state.mass_ellipsoid(frame, arm).masses[:] = 0",
    "jacobian": "state.jacobian(frame, arm)[:] = 0",
    "joints": "state.q(arm)[:] = 0; state.qd(arm)[:] = 0",
    "places": "[a.fill(0) for a in state.placed(bodies)]",
    "pose": "[a.fill(0) for a in state.pose(frame)]",
    "speeds": "[a.fill(0) for a in (*state.body_velocities(bodies), *state.fastest_points(bodies))]",
    "data": "d = state.data_of('arm'); d.qvel[:] = 0; d.qpos[:] = 0; d.xpos[:] = 0; d.cvel[:] = 0",
    "what was heard": "h = state.hearing('arm'); h.timeout = 9.0; h.heard.clear(); h.given = True",
    "who rides on whom": "state.attachments.ids[:] = 0; state.attachments.roots[:] = 0",
    "columns": "state.columns['arm'].own_v[:] = 0",
    "distances": "c = state.closest_per_body(gap); c.distance[:] = 9; c.point_a[:] = 0",
    "the model": "state.model.mj.body_mass[:] = 0; state.model.mechanisms['arm'].coupling[:] = 0",
    "what was bound": "model.mj.body_mass[:] = 0; arm.coupling[:] = 0; frame.body_from_frame[:] = 0; "
    "[body.corners.fill(0) for body in model.bodies]",
}


@pytest.mark.parametrize("physics", [True, False])
@pytest.mark.parametrize("what", ALTERED)
def test_what_a_criterion_writes_into_arrays_changes_no_other_and_no_motion(own, what, physics):
    more = person("op", 2.3, 0.3, 0) + LOG
    for kind, said in (
        ("kinetic_energy", 'robot = "arm"\nlimit = 0.5'),
        ("velocity", 'of = "arm"\nlimit = 0.2'),
        ("effective_mass", 'at = "arm"\nlimit = 1.0'),
        ("minimum_distance", 'between = ["arm", "op"]\nlimit = 0.3'),
    ):
        more += f'[[safety]]\nkind = "{kind}"\nname = "{kind}"\n{said}\n'
    found = []
    for body in ("", ALTERED[what] + "; "):
        text = BIND.format(f"{body}return self.result(1.0)").replace(
            "        def eval", "        gap = model.gap(model.select('op'), bodies)\n        def eval"
        )
        station = own(text, more, engine=f"engine = {{ gravity = [0, 0, 0], physics = {physics} }}\n".lower())
        Path(station.model.folder, "m.csv").write_text(GAP)
        found.append(station.run().results)
    one, other = found
    assert np.nanmin(other["own"].values) == 1.0
    for name in one:
        np.testing.assert_array_equal(one[name].values, other[name].values, name)
        np.testing.assert_array_equal(one[name].verdicts, other[name].verdicts, name)


@pytest.mark.parametrize("method", sorted(GIVEN_A_MODEL))
def test_every_method_of_ones_own_is_given_a_model_of_its_own(own, method):
    """Also before a run: what it writes there is in nobody else's figures, shipped or not."""
    spoil = (
        "model.mj.body_mass[:] = 0; [body.corners.fill(0) for body in model.bodies]; "
        "[array.fill(0) for array in model.shapes.arrays()]; model._gaps.update({((0,), (1,)): None})"
    )
    head, text = HEAD, BIND.format("return self.result(1.0)")
    if method == "bind":
        text = text.replace("        arm,", f"        {spoil}\n        arm,")
    elif method == "basis":
        head = head.replace("model): return Basis", f"model):\n        {spoil}\n        return Basis")
    else:
        text += f"    def {method}(self, model, *more):\n        {spoil}\n"
        of_base = "None" if method == "compute" else f"Criterion.{method}(self, model, *more)"
        text += f"        return {of_base}\n"
    station = own(text, head=head)
    (rule,) = station.workstation.safety
    kept = station.model.mj.body_mass.copy(), [body.corners.copy() for body in station.model.bodies]
    shapes = station.model.shapes.copied()
    getattr(rule, method)(station.model, *([None] if method in ("falls", "lowest", "follows") else []))
    np.testing.assert_array_equal(station.model.mj.body_mass, kept[0])
    for body, corners in zip(station.model.bodies, kept[1], strict=True):
        np.testing.assert_array_equal(body.corners, corners)
    for array, before in zip(station.model.shapes.arrays(), shapes.arrays(), strict=True):
        np.testing.assert_array_equal(array, before)
    assert None not in station.model._gaps.values()


def test_every_method_that_takes_a_model_gives_ones_own_its_own():
    named = {name for name, f in vars(Criterion).items() if "model" in getattr(f, "__annotations__", {})}
    assert named == GIVEN_A_MODEL


# -- of many instants ----------------------------------------------------------------------------

STRICTER = """
from msgspec.structs import replace
from seerob.api import Verdict
from seerob.criteria.safety.velocity import Velocity
class Own(Velocity, frozen=True, kw_only=True):
    def bind(self, model):
        shipped = super().bind(model)
        return lambda state: replace(shipped(state), verdict=Verdict.UNDECIDED, reason="we do not know")
"""


def test_a_bind_on_top_of_a_shipped_criterion_is_asked_instant_by_instant(own):
    station = own("", more='at = "arm"\n', head=STRICTER)
    q = np.zeros((9, len(station.model.mechanisms["arm"].joints)))
    (column,) = station.batch({"arm": q}, {"arm": q}).values()
    assert column.verdict is Verdict.UNDECIDED
    assert "bind" in column.note


MANY = (
    BIND.format("return self.result(1.0)")
    + """
    def batch(self, model):
        from seerob.api import Answers
        arm, bodies = model.mechanisms["arm"], model.select("arm")
        def many(states):
            {}
        return many
"""
)
ALONE = "x = {}; return Answers.against(np.full(len(states), x), self.limit, at_most=True)"
RAW_OF_MANY = (
    "states.motion.q[0, 0]",
    "states.everywhere()[1][0, 0, 0]",
    "states.largest_speeds()[0, 0]",
    "len(states.invalid_reasons)",
    "states.elsewhere(None) and 1.0",
    "len(kept[0]) if kept else kept.append(states) or 1.0",
)


@pytest.mark.parametrize("read", RAW_OF_MANY)
def test_of_many_instants_nothing_is_read_that_does_not_say_whether_it_may_be_relied_on(own, read):
    text = (
        MANY.format(ALONE.format(read))
        .replace("arm, ", "kept, arm, ")
        .replace("model.mechanisms", "[], model.mechanisms")
    )
    station = own(text + NOBODY, q="q = [0, 0]\n")
    for threads in (1, 2):
        found = station.batch({"arm": np.zeros((600, 2))}, {"arm": np.zeros((600, 2))}, threads=threads)[
            "own"
        ]
        assert found.verdict is UNDECIDED
        assert found.note == ""


SPOILS = (
    "states.mass_matrix(arm)[:] *= 1e-6",
    "states.fastest_points(bodies)[0][:] = 0; states.qd(arm)[:] = 0",
    "[body.corners.fill(0) for body in states.model.bodies]; states.model.mj.body_mass[:] = 0",
    "states.closest_per_body(gap).distance[:] = 9",
)


@pytest.mark.parametrize("spoil", SPOILS)
def test_what_is_written_into_arrays_of_many_instants_changes_no_other(own, spoil):
    found = []
    for body in ("", f"{spoil}; "):
        more = person("op", 2.3, 0.3, 0)
        for kind, said in (
            ("kinetic_energy", 'robot = "arm"\nlimit = 0.5'),
            ("velocity", 'of = "arm"\nlimit = 0.2'),
            ("minimum_distance", 'between = ["arm", "op"]\nlimit = 0.3'),
        ):
            more += f'[[safety]]\nkind = "{kind}"\nname = "{kind}"\n{said}\n'
        text = MANY.format(body + ALONE.format("1.0")).replace(
            "        def many", "        gap = model.gap(model.select('op'), bodies)\n        def many"
        )
        station = own(text, more, q="q = [0, 0]\n")
        q = np.linspace(0, 0.5, 40)[:, None] * np.ones(2)
        found.append(station.batch({"arm": q}, {"arm": np.ones((40, 2))}))
    one, other = found
    assert one["own"].verdict is WITHIN is other["own"].verdict
    for name in one:
        assert one[name].note == ""
        np.testing.assert_array_equal(one[name].value, other[name].value, name)


def test_no_author_accepts_what_nobody_knows_between_instants(own):
    """The file does, in words, and a report shows these."""
    text = BIND.format("return self.result(state.q(arm)[0])") + '    instants = "accepted: by its author"\n'
    for accepted, verdict in (("", UNDECIDED), ('between_samples = "accepted: it is slow"\n', WITHIN)):
        station = own(text, accepted + LOG)
        Path(station.model.folder, "m.csv").write_text(STANDS_AT_LAST)
        assert station.run().results["own"].verdict is verdict


PARTLY = MANY.replace("    def batch", "    whole = False\n    def batch")


def test_one_that_judges_bone_by_bone_and_asks_nobody_is_not_within_while_somebody_is_not_heard(own):
    """On the road and in arrays: it would say what it said before."""
    text = PARTLY.format(ALONE.format("1.0"))
    station = own(text, LOG)
    Path(station.model.folder, "m.csv").write_text(GAP)
    run, many = station.run().results["own"], station.batch()["own"]
    for verdicts in (run.verdicts, many.answers.verdict):
        assert (verdicts[20], verdicts[60]) == (0, 2)
    assert "arm: not heard" in many.reasons[60]


@pytest.mark.parametrize("said", ["(-1.0, 0.0)", "(0.0, -1.0)", "(float('nan'), 0.0)", "1 / 0"])
def test_a_bound_of_ones_own_that_cannot_be_is_undecided_on_the_road_and_in_arrays(own, said):
    text = (
        MANY.format(ALONE.format("1.0")) + f"    def falls(self, model, points): return lambda s, m: {said}\n"
    )
    station = own(text, LOG)
    Path(station.model.folder, "m.csv").write_text(GAP)
    run, many = station.run().results["own"], station.batch()["own"]
    assert (run.verdicts[20], many.answers.verdict[20]) == (2, 2)
    assert "what bounds it between two ticks failed" in run.worst().reason


@pytest.mark.parametrize(
    ("one", "many", "verdict"),
    [("1.0", "1.0", WITHIN), ("200.0", "1.0", UNDECIDED), ("200.0", "200.0", EXCEEDED)],
)
def test_what_ones_own_says_of_many_instants_it_says_of_one(own, one, many, verdict):
    text = MANY.format(ALONE.format(many)).replace("self.result(1.0)", f"self.result({one})")
    station = own(text, q="q = [0, 0]\n")
    found = station.batch({"arm": np.zeros((30, 2))}, {"arm": np.zeros((30, 2))})["own"]
    assert (found.verdict, found.note) == (verdict, "")
    assert ("batch says within at 0 s, and bind does not" in found.reasons[0]) == (verdict is UNDECIDED)
