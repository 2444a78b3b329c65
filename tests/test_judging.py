"""Asking criteria: at their periods, and an answer lasts only as long as all that it rests on is heard."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np
import pytest
from msgspec.structs import replace

from made_cell import FLOATING, TWO_R, made, person, state_at, two_r
from seerob.core.markers import Label, Segment
from seerob.core.snapshot import Basis, Finding, Result, Row, Verdict
from seerob.core.verdict import judge_interval
from seerob.criteria.criterion import Claim, Criterion
from seerob.criteria.judging import Judge, undecided
from seerob.criteria.noisy_speeds import NOISE, REMEMBERS
from seerob.criteria.question import UNBOUNDED, bound_to, relied_on
from seerob.description.humans.skeleton import BONES
from seerob.recording.series import INFORMS
from seerob.session import batch
from seerob.twin.states import motion_of
from seerob.twin.validity.hearing import BonesHeard, Heard

WITHIN, EXCEEDED = Verdict.WITHIN, Verdict.EXCEEDED

TWO_ARMS = FLOATING + TWO_R + TWO_R.replace('"arm"', '"other"')
ENERGY = '[[safety]]\nkind = "kinetic_energy"\nname = "E"\nrobot = "arm"\nlimit = 4\n'
BETWEEN = '[[safety]]\nkind = "minimum_distance"\nname = "d"\nbetween = ["arm", "other"]\n'
MOVING = ((0.0, 0.0), (1.0, 0.0))


@pytest.fixture
def asked(tmp_path):
    """A criterion of two arms that stand apart, and the twin."""

    def make(criterion):
        station = made(
            tmp_path, TWO_ARMS.replace('"other"', '"other"\nbase = { position = [9, 0, 0] }') + criterion,
            {"arm.urdf": two_r()},
        )  # fmt: skip
        state = state_at(station, arm=MOVING, other=MOVING)
        return Judge(station.bound), state

    return make


@pytest.mark.parametrize("silent", ["arm", "other"])
def test_an_answer_lasts_no_longer_than_each_that_it_rests_on_is_heard(asked, silent):
    judge, state = asked(BETWEEN + "limit = 1\nevery = 10\n")
    (first,) = judge(state)
    assert first.verdict == "within"
    assert judge(state)[0] is first
    state.refresh(0.1)
    assert judge(state)[0] is first
    state.hearings[silent].given = False
    state.refresh(0.2)
    (second,) = judge(state)
    assert second.verdict == "undecided"
    assert silent in second.reason
    assert second.t == 0.2


def test_a_criterion_with_a_period_is_asked_when_it_is_due_and_not_before(asked):
    judge, state = asked(ENERGY + "every = 0.3\n")
    told = []
    for k in range(10):
        state.refresh(k * 0.1)
        told.append(judge(state)[0].t)
    # 3 · 0.1 is 0.30000000000000004, and 9 · 0.1 less than 3 · 0.3: the same instants all the same.
    assert told == pytest.approx([0, 0, 0, 0.3, 0.3, 0.3, 0.6, 0.6, 0.6, 0.9], abs=1e-12)


def test_a_criterion_without_a_period_is_asked_at_every_tick(asked):
    judge, state = asked(ENERGY)
    values = []
    for speed in (1.0, 2.0):
        state.data.qvel[:2] = speed, 0.0
        state.refresh(0.0)
        (result,) = judge(state)
        assert result.t is None
        values.append(result.value)
    # Point masses of 1 kg at 1 m and 2 m.
    assert values == pytest.approx([2.5, 10.0])
    assert result.verdict == "exceeded"


@pytest.mark.parametrize("kind", ["kinetic_energy", "minimum_distance"])
def test_what_is_undecided_keeps_its_limit_and_the_side_that_it_bounds(asked, kind):
    judge, state = asked(ENERGY if kind == "kinetic_energy" else BETWEEN + "limit = 1\n")
    state.hearings["arm"].given = False
    (result,) = judge(state)
    assert (result.verdict, result.value) == ("undecided", None)
    assert (result.limit, result.at_most) == ((4, True) if kind == "kinetic_energy" else (1, False))
    assert math.isfinite(result.limit)


def test_a_criterion_with_a_period_is_asked_at_once_when_it_is_switched(tmp_path):
    """Muted for two tenths of a second and then too fast: not only when the muted answer is due."""
    plc = '[[sources]]\nkind = "signals_csv"\nname = "plc"\nfile = "s.csv"\ntime = "t"\ntime_unit = "s"\n'
    arm = '[[sources]]\nkind = "csv"\nrobot = "arm"\nfile = "m.csv"\n'
    door = '[[variables]]\nname = "door"\nsource = "plc"\naddress = "x"\ntype = "bool"\n'
    text = 'variables = "v.toml"\n' + FLOATING + TWO_R + plc + arm + ENERGY + 'every = 10\nactive = "door"\n'
    files = {
        "v.toml": door,
        "s.csv": "t,x\n" + "".join(f"{0.1 * k:.1f},{int(k >= 2)}\n" for k in range(5)),
        "m.csv": "t [s],J1 [rad],J2 [rad]\n" + "".join(f"{0.1 * k:.1f},{0.2 * k:.1f},0\n" for k in range(5)),
        "arm.urdf": two_r(),
    }
    found = made(tmp_path, text, files).run().results["E"]
    # ½ (1 kg + 1 kg · 2²) 2² m²/s²
    assert (found.verdict, found.max()) == ("exceeded", pytest.approx(10.0, rel=1e-3))


def test_an_answer_that_is_kept_is_held_by_what_is_found_out_since(asked, monkeypatch):
    judge, state = asked(ENERGY + "every = 10\n")
    assert judge(state)[0].verdict == "within"
    found = Finding(level="warning", subject="arm", text="another tool", holds=("arm",))
    monkeypatch.setattr(judge._plausible_places, "at", lambda state: (found,))
    state.refresh(0.01)
    (result,) = judge(state)
    assert (result.verdict, result.t) == ("undecided", 0.0)
    assert "another tool" in result.reason


def test_an_answer_of_later_says_nothing_when_time_is_set_back(asked):
    judge, state = asked(ENERGY + "every = 10\n")
    state.refresh(5.0)
    judge(state)
    state.refresh(1.0)
    assert judge(state)[0].t == 1.0


# -- what findings hold -------------------------------------------------------------------------

TWO_PARTS = (
    '[[parts]]\nname = "{0}"\nshape = {{ sphere = 0.1 }}\nat = {{ position = [0, 0, {1}] }}\nmass = 1\n'
)
THREE = "".join(
    f'[[safety]]\nkind = "{kind}"\nname = "{name}"\n{rest}\nlimit = {limit}\n'
    for kind, name, rest, limit in (
        ("minimum_distance", "to post", 'between = ["arm", "post"]', 1),
        ("minimum_distance", "to wall", 'between = ["arm", "wall"]', 1),
        ("minimum_distance", "of the rest", 'between = ["post", "wall"]', 1),
        ("velocity", "point", 'at = "arm"', 9),
        ("velocity", "too fast", 'at = "arm"', 0.1),
        ("kinetic_energy", "energy", 'robot = "arm"', 9),
    )
)


@pytest.fixture(scope="module")
def surrounded(tmp_path_factory):
    """An arm between two parts, and six criteria: one is exceeded, all others are within."""
    text = FLOATING + TWO_R + TWO_PARTS.format("post", 5) + TWO_PARTS.format("wall", 9) + THREE
    return made(tmp_path_factory.mktemp("surrounded"), text, {"arm.urdf": two_r()})


@pytest.mark.parametrize(
    ("name", "kept"),
    [
        ("arm", {"of the rest"}),
        ("arm/l2", {"of the rest"}),
        ("post", {"to wall", "point", "energy"}),
        ("w*", {"to post", "point", "energy"}),
        ("*", set()),
        ("nobody", {"to post", "to wall", "of the rest", "point", "energy"}),
    ],
)
def test_nothing_is_within_of_what_a_finding_holds(surrounded, name, kept):
    """By whatever name of it the criterion speaks; what is exceeded stays so; a batch says the same."""
    holding = Finding(level="warning", subject="file", text="it may be elsewhere", holds=(name,))
    found = {r.name: r for r in Judge(surrounded.bound, [holding])(state_at(surrounded, arm=MOVING))}
    kept = kept - {"point", "energy"} if name == "arm/l2" else kept
    expected = {"to post", "to wall", "of the rest", "point", "energy"} - kept
    assert {n for n, r in found.items() if r.verdict == "undecided"} == expected
    assert {n for n, r in found.items() if r.verdict == "within"} == kept
    assert all("it may be elsewhere" in found[n].reason and found[n].value is not None for n in expected)
    assert found["too fast"].verdict == "exceeded"
    coloured = {m.verdict for n in expected for m in found[n].markers}
    assert coloured <= {None, "undecided"}

    q, v = (np.array([part]) for part in MOVING)
    motion = motion_of(surrounded.model, {"arm": q}, {"arm": v}, None)
    at_once = batch.judged(surrounded.model, surrounded.bound, motion, threads=1, findings=[holding])
    assert {n: column.verdict for n, column in at_once.items()} == {n: r.verdict for n, r in found.items()}
    assert all("it may be elsewhere" in at_once[n].reasons[0] for n in expected)


def test_what_an_answer_depended_on_is_held_like_what_it_is_about(surrounded):
    """A criterion that does not say whom it speaks of depends on them all the same."""
    bound = [b for b in surrounded.bound if b.criterion.name == "energy"]

    class Anonymous(type(bound[0].criterion), frozen=True, kw_only=True):
        def subjects(self):
            return ()

    quiet = Anonymous(name="energy", robot="arm", limit=9.0)
    about = type(bound[0])(quiet, "safety", quiet.bind(surrounded.model), bound[0].basis)
    holding = Finding(level="warning", subject="file", text="its mass is doubtful", holds=("arm",))
    (result,) = Judge([about], [holding])(state_at(surrounded, arm=MOVING))
    assert (result.verdict, result.reason.startswith("its mass is doubtful")) == ("undecided", True)


def test_what_is_taken_back_is_taken_back_whole():
    drawn = (
        Segment(start=(0, 0, 0), end=(1, 0, 0), verdict=WITHIN),
        Label(position=(0, 0, 0), text="near", verdict=EXCEEDED),
        Label(position=(0, 0, 0), text="plain"),
    )
    rows = (Row(name="Palm", verdict=WITHIN), Row(name="Skull", verdict=EXCEEDED), Row(name="Face"))
    inner = Result(name="link", value=1.0, verdict=WITHIN, parts=(Result(name="deep", verdict=WITHIN),))
    quiet = Result(name="other")
    whole = Result(name="d", value=1.0, verdict=WITHIN, reason="a ↔ b", parts=(inner, quiet), rows=rows)
    found = undecided(replace(whole, markers=drawn), "nobody knows")
    assert (found.verdict, found.reason, found.value) == ("undecided", "nobody knows; a ↔ b", 1.0)
    assert [m.verdict for m in found.markers] == ["undecided", "exceeded", None]
    assert [(r.verdict, r.reason) for r in found.rows] == [
        ("undecided", "nobody knows"),
        ("exceeded", ""),
        (None, ""),
    ]
    assert [p.verdict for p in found.parts] == ["undecided", None]
    assert found.parts[0].parts[0].verdict == "undecided"
    bad = undecided(replace(whole, verdict=EXCEEDED), "nobody knows")
    assert (bad.verdict, bad.reason, bad.parts[0].verdict) == ("exceeded", "a ↔ b", "undecided")
    figure = undecided(Result(name="d", value=1.0), "nobody knows")
    assert (figure.verdict, figure.reason) == (None, "")
    nobody = undecided(Result(name="d", reason="nobody is near", nothing=True), "nobody knows")
    assert (nobody.verdict, nobody.reason) == ("undecided", "nobody knows; nobody is near")
    assert (figure.nothing, nobody.nothing) == (False, False)


@pytest.mark.parametrize(
    ("source", "fast"),
    [("", "undecided"), ('[[sources]]\nkind = "csv"\nrobot = "arm"\nfile = "m.csv"\n', "within")],
)
def test_how_fast_a_robot_is_that_nothing_moves_is_not_within(tmp_path, source, fast):
    """Whose source was forgotten stands where the file puts it: that is a place, and no speed."""
    still = "t [s],j1 [rad],j2 [rad]\n0,0,0\n0.1,0,0\n"
    two = TWO_ARMS.replace('"arm"\n', '"arm"\nq = [0, 0]\n', 1).replace(
        '"other"\n', '"other"\nq = [0, 0]\nbase = { position = [9, 0, 0] }\n'
    )
    text = (
        two
        + ENERGY
        + BETWEEN
        + 'limit = 1\n[[safety]]\nkind = "velocity"\nname = "v"\nof = "arm"\nlimit = 1\n'
    )
    text += '[[safety]]\nkind = "velocity"\nname = "walked"\nof = "arm"\nlimit = 1\nactive = "on"\n'
    dictionary = '[[variables]]\nname = "on"\nsource = "plc"\naddress = "x"\ntype = "bool"\n'
    plc = '[[sources]]\nkind = "signals_csv"\nname = "plc"\nfile = "s.csv"\ntime = "t"\ntime_unit = "s"\n'
    files = {"arm.urdf": two_r(), "m.csv": still, "v.toml": dictionary, "s.csv": "t,x\n0,1\n0.1,1\n"}
    station = made(tmp_path, 'variables = "v.toml"\n' + text + source + plc, files)
    found = station.run().results
    wanted = {"E": fast, "d": "within", "v": fast, "walked": fast}
    assert {name: str(series.verdict) for name, series in found.items()} == wanted
    if fast == "undecided":
        assert "arm: no source says how it moves" in found["E"].worst().reason
    # In arrays, too; of who is not named among given positions nobody says how fast they are.
    many, zeros = station.batch(), np.zeros((3, 2))
    assert {name: str(many[name].verdict) for name in ("E", "d", "v")} == {
        "E": fast,
        "d": "within",
        "v": fast,
    }
    assert many["walked"].verdict != "within"
    given = station.batch({"other": zeros}, {"other": zeros}, t=[0.0, 0.01, 0.02])
    assert {str(given[name].verdict) for name in ("E", "v", "walked")} == {"undecided"}
    assert "arm: no source says how it moves" in given["v"].reasons[0]
    given = station.batch({"arm": zeros}, {"arm": zeros}, t=[0.0, 0.01, 0.02])
    assert {str(given[name].verdict) for name in ("E", "d", "v")} == {"within"}


# -- criteria of one's own ----------------------------------------------------------------------


class Turning(Criterion, frozen=True, kw_only=True):
    """How fast the first joint of an arm turns, or whatever it is told to say."""

    limit: float | None = None
    off: float = 0.0
    """How far it may be off [rad/s]."""
    remembering: bool = False
    says: Result | None = None
    looks_at: str = ""
    """A body that it asks for, and does not declare."""
    stated: tuple[Claim, ...] = ()
    """What it rests on."""

    def claims(self, model):
        return self.stated

    def remembers(self, model):
        return self.remembering

    def subjects(self):
        return ("arm",)

    def basis(self, model):
        return Basis(formula="q", source="made", inputs=(), not_modelled=())

    def bind(self, model):
        robot = model.robot("arm")

        def evaluate(state):
            if self.looks_at:
                state.placed(model.select(self.looks_at))
            if self.says is not None:
                return self.says
            value = abs(float(state.qd(robot)[0]))
            ends = (value - self.off, value + self.off)
            return Result(
                name=self.name,
                value=value,
                limit=self.limit,
                interval=ends if self.off else None,
                verdict=judge_interval(ends, self.limit),
            )

        return evaluate


class Knowing(Turning, frozen=True, kw_only=True):
    by_speed: ClassVar[bool] = True


class PartByPart(Turning, frozen=True, kw_only=True):
    whole: ClassVar[bool] = False


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    text = FLOATING + TWO_R + person("op", 9, 0, 0)
    return made(tmp_path_factory.mktemp("own"), text, {"arm.urdf": two_r()})


def said(station, criterion, state):
    (result,) = Judge([bound_to(station.model, criterion, "safety")])(state)
    return result


def test_what_noise_of_speeds_changes_is_in_the_interval_of_who_does_not_say_it_and_of_nobody_else(cell):
    def turned(kind=Turning, noise=(0.1, 0.5), **how):
        state = state_at(cell, arm=MOVING)
        state.hearings["arm"].heard[:] = [Heard(0.0, speed_error=np.array(noise))]
        state.refresh(0.0)
        return said(cell, kind(name="v", **how), state)

    assert turned(limit=1.2).interval == pytest.approx((0.9, 1.1))
    assert turned(limit=1.2).verdict == "within"
    assert turned(limit=1.2, off=0.02).interval == pytest.approx((0.88, 1.12))
    near = turned(limit=1.05)
    assert (near.verdict, near.reason[: len(NOISE)], near.value) == ("undecided", NOISE, 1.0)
    for known in (turned(limit=1.05, noise=(0.0, 0.5)), turned(limit=1.05, noise=(0.0, 0.0))):
        assert (known.verdict, known.interval) == ("within", None)
    knows = turned(Knowing, limit=1.05)
    assert (knows.verdict, knows.interval) == ("within", None)
    kept = turned(limit=1.2, remembering=True)
    assert (kept.verdict, kept.reason) == ("undecided", REMEMBERS)


def test_who_looks_at_one_bone_unsaid_rests_on_all_of_the_person_unless_it_judges_part_by_part(cell):
    state = state_at(cell, arm=MOVING)
    for seen, verdict in ((frozenset(BONES), "within"), (frozenset(BONES) - {"right_hand"}, "undecided")):
        state.hearings["op"].bones_heard[:] = [BonesHeard(0.0, observed=seen)]
        state.refresh(0.0)
        assert said(cell, Turning(name="v", limit=2.0, looks_at="op/head"), state).verdict == verdict
        assert said(cell, PartByPart(name="v", limit=2.0, looks_at="op/head"), state).verdict == "within"
    state.hearings["op"].given = False
    state.refresh(0.0)
    assert said(cell, PartByPart(name="v", limit=2.0, looks_at="op/head"), state).verdict == "undecided"


def test_what_says_nothing_is_undecided_and_not_passed_over_and_told_once(cell, caplog):
    state = state_at(cell, arm=MOVING)
    silent = Turning(name="v", says=Result(name="v", nothing=True))
    judge = Judge([bound_to(cell.model, silent, "safety")])
    for _ in range(3):
        (result,) = judge(state)
        assert (result.verdict, result.nothing) == ("undecided", False)
    assert [record.name for record in caplog.records] == ["seerob.criteria.judging"]


def test_part_by_part_something_must_be_heard_of_whoever_a_name_means(cell):
    class Of(PartByPart, frozen=True, kw_only=True):
        about: tuple[str, ...] = ()

        def subjects(self):
            return self.about

    for names, whom in ((("arm/l2",), ("arm",)), (("op", "arm"), ("op", "arm")), (("op/head",), ("op",))):
        assert relied_on(Of(name="v", about=names), cell.model) == whom
    assert relied_on(Turning(name="v"), cell.model) == ()


def test_what_nothing_bounds_says_so_and_without_a_limit_that_it_informs(cell):
    assert bound_to(cell.model, Turning(name="v", limit=1.0), "safety").between == UNBOUNDED
    assert bound_to(cell.model, Turning(name="v"), "safety").between == INFORMS
    accepted = Turning(name="v", limit=1.0, between_samples="accepted: it is slow")
    assert bound_to(cell.model, accepted, "safety").between == "accepted: it is slow"


class Steady:
    """That the arm does something until an instant."""

    def __init__(self, until, name="arm"):
        self.holds, self.until, self.asked = (name,), until, []

    def of_motion(self, motion, what=""):
        return None

    def __call__(self, state):
        self.asked.append(state.t)
        text = f"no more {self.until}"
        return (
            Finding(level="warning", subject="arm", text=text, holds=self.holds)
            if state.t >= self.until
            else None
        )


def test_what_the_twin_contradicts_holds_from_then_on_and_is_asked_no_more(cell):
    state, first, later = state_at(cell, arm=MOVING), Steady(0.02), Steady(0.04)
    bound = [bound_to(cell.model, Turning(name="v", limit=2.0, stated=(first, later)), "safety")]
    judge, told = Judge(bound), []
    for k in range(6):
        state.refresh(k / 100)
        told.append(judge(state)[0])
    assert [result.verdict for result in told] == ["within"] * 2 + ["undecided"] * 4
    assert ["0.04" in result.reason for result in told] == [False] * 4 + [True] * 2
    assert all("0.02" in result.reason for result in told[2:])
    assert (first.asked, later.asked) == ([0.0, 0.01, 0.02], [0.0, 0.01, 0.02, 0.03, 0.04])
    # What is known to be contradicted is not asked, and holds at once.
    known = Finding(level="warning", subject="file", text="never was", holds=("arm",))
    state.refresh(0.0)
    assert Judge(bound, [known])(state)[0].verdict == "undecided"
    assert first.asked[3:] == []
