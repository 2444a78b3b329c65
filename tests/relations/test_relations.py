"""What must hold between the verdicts of two cells, whatever the truth is, on random cells.

Less, later or wider input never turns anything into WITHIN; a heavier, thicker, nearer or faster world never
relieves; names, units, order, place and time of day change nothing; nobody's verdict hangs on what else
is asked. What is said of a cell as it is, all its relations share.
"""

from __future__ import annotations

import os
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from live_cells import SPOILED, greener_than_the_truth
from random_cells import (
    ALL,
    FOUND,
    Cell,
    faster,
    heavier,
    least_margin,
    mirrored,
    nearer,
    random_cell,
    random_machine,
    said,
    station,
    thicker,
)

from seerob.core.errors import Undecided
from seerob.core.snapshot import Verdict
from seerob.recording.recording import Recording
from seerob.recording.result_log import ResultLog

CELLS = 150
"""Random cells, `short` ones; `make soak` asks all relations of those from there on, as they are."""
EACH = 1
"""Relations that are asked of a cell, by chance; of one that somebody names, all are."""
BESIDE = 0.05
"""Share of a limit by which a figure may fall beside a gap: of given speeds and slopes the larger counts, and
there are fewer slopes."""
WITHIN = 0
RANK = {Verdict.WITHIN: 0, None: 0, Verdict.UNDECIDED: 1, Verdict.EXCEEDED: 2}
NAMED = [int(seed) for seed in os.environ.get("SEEROB_CELLS", "").split()]
"""``SEEROB_CELLS="1234 5678"`` asks of these alone, as `make soak` says of what it finds."""


def short(seed: int, cell: Cell) -> Cell:
    """Half of its motion; of three cells in four, and of all robots of the library, without contacts.

    To work out where such a robot can clamp takes longer than all the rest. `make soak` asks whole cells.
    """
    dear = bool(cell.library) or np.random.default_rng([seed, 4]).random() < 0.75
    left_out = cell.left_out | {"contact", "cart contact"} if dear else cell.left_out
    return replace(cell, duration=cell.duration / 2, left_out=left_out)


def made(seed: int, *, published: bool = True) -> Cell:
    """The cell of a seed, as it is asked here."""
    cell = random_cell(seed, published=published)
    return short(seed, cell) if seed < CELLS and not NAMED else cell


def pair(folder, cell: Cell, other: Cell) -> tuple[ResultLog, ResultLog]:
    return said(cell, folder / "one"), said(other, folder / "other")


def same(one: ResultLog, other: ResultLog, *, within: float = 1e-6) -> None:
    """Every criterion says the same, but where it lies on its limit."""
    for name in set(one) & set(other):
        a, b = one[name], other[name]
        margins = least_margin(a), least_margin(b)
        if np.isnan(margins).all():
            assert a.verdict is b.verdict, name
            continue
        if not searched(name, margins):
            assert margins[0] == pytest.approx(margins[1], abs=within, rel=within), name
        if abs(margins[0]) > within:
            assert a.verdict is b.verdict, (name, a.worst(), b.worst())


def searched(name: str, margins: tuple[float, float]) -> bool:
    """Whether both are depths in an area: ends of intervals that were searched for, and not the deepest."""
    return name == "area" and max(margins) < 0


def no_relief(one: ResultLog, worse: ResultLog, *names: str, slack: float = 1e-9) -> None:
    """The second is nowhere better than the first."""
    for name in set(names or one) & set(one):
        a, b = one[name], worse[name]
        assert RANK[b.verdict] >= RANK[a.verdict], (name, a.worst(), b.worst())
        margins = least_margin(a), least_margin(b)
        if not np.isnan(margins).any() and not searched(name, margins):
            assert margins[1] <= margins[0] + slack, name


def never_greener(one: ResultLog, less: ResultLog, *, beside: tuple[float, float] = (np.inf, 0.0)) -> None:
    """At no instant that both have is the second WITHIN where the first is not.

    Between two instants, ``beside`` a gap, that holds of what is beyond its limit by `BESIDE` and more.
    """
    for name in one:
        a, b = one[name], less[name]
        beyond = np.abs(a.values - a.limits) > BESIDE * np.abs(a.limits)
        rows = zip(a.t.tolist(), a.verdicts.tolist(), beyond.tolist(), strict=True)
        known = {round(t, 6): (code, clearly) for t, code, clearly in rows}
        for t, code in zip(b.t.tolist(), b.verdicts.tolist(), strict=True):
            if code == WITHIN:
                was, clearly = known.get(round(t, 6), (WITHIN, False))
                assert was == WITHIN or (beside[0] < t < beside[1] and not clearly), (name, t)


# -- nothing changes ----------------------------------------------------------------------------

SAME = {
    "the world turned and shifted": lambda c: replace(c, world=(13.0, -7.5, 2.1)),
    "bodies renamed": lambda c: replace(c, names=("zulu", "alpha"), cart="bravo"),
    "tables in another order": lambda c: replace(c, turned_tables=True),
    "figures in other units": lambda c: replace(c, units=True),
    "links split by fixed joints": lambda c: replace(c, split=True),
    "the world in a mirror": mirrored,
    "another start time": lambda c: replace(c, start=1234.7),
}


def spoken(cell: Cell) -> bool:
    """Whether a PLC tells where its machine is."""
    return cell.machine is not None and not cell.machine.by_file


def nothing_changes(what, seed, folder):
    own = what.startswith("links") or what.endswith("mirror")
    cell = made(seed, published=not own)
    if what.endswith("mirror"):
        cell = replace(cell, machine=None, walks=False)  # a reach is of one hand
    one, other = pair(folder, cell, SAME[what](cell))
    if any("sources[0].degrees" in reason for series in other.values() for reason in series.reasons):
        no_relief(one, other)  # so small in degrees that they may be radians: it asks
        return
    # Speeds of what a PLC tells are derived as it comes: a row that rounding puts beyond a tick comes later.
    same(one, other, within=1e-3 if spoken(cell) and what == "another start time" else 1e-5)


UPRIGHT = "distance", "separation", "felt", "contact", "hand distance"
"""Criteria about people, whom a floor that leans would let fall."""


def the_world_tilted(seed, folder):
    """Arm, tool, gripper, area and post lean, and gravity with them; nobody stands there."""
    cell = made(seed)
    cell = replace(cell, machine=None, walks=False, left_out=cell.left_out | set(UPRIGHT))
    angle = float(np.random.default_rng([seed, 6]).uniform(-0.6, 0.6))
    same(*pair(folder, cell, replace(cell, tilt=angle)), within=1e-5)


CARRIED = {"cart speed", "cart energy", "cart separation"}
"""Criteria without one of which nobody asks how fast a machine is."""


def a_criterion_changes_no_other(seed, folder):
    cell = made(seed)
    rng = np.random.default_rng(seed)
    names = ["speed", "fastest", "energy", "distance", "separation", "area", "felt", "contact"]
    names += (
        ["posture"] * cell.walks
        + ["hand speed", "hand distance"] * bool(cell.gripper)
        + [name for name in ALL if name.startswith("cart")] * bool(cell.machine)
    )
    left_out = frozenset(rng.choice(names, rng.integers(1, 8), replace=False).tolist())
    one, other = pair(folder, cell, replace(cell, left_out=cell.left_out | left_out))
    for name in other:
        np.testing.assert_array_equal(one[name].values, other[name].values, name)
        # Who asks for no speed of what carries a robot is told so.
        untold = other[name].verdict is Verdict.UNDECIDED and left_out & CARRIED
        assert one[name].verdict is other[name].verdict or untold, name


def another_tick_does_not_contradict(seed, folder):
    cell = made(seed)
    one, other = pair(folder, cell, replace(cell, tick=0.002))
    for name in one:
        verdicts = one[name].verdict, other[name].verdict
        assert set(verdicts) != {Verdict.WITHIN, Verdict.EXCEEDED}, (
            name,
            one[name].worst(),
            other[name].worst(),
        )


def replayed_and_in_arrays_it_says_the_same(seed, folder):
    cell = made(seed)
    here = station(cell, folder)
    from seerob.outputs.sinks.recorder import Recorder

    run = here.run(folder=folder / "run", sinks=[Recorder()]).results
    (file,) = (folder / "run").glob("*.mcap")
    again = here.replay(Recording.open(file)).results
    same(run, again, within=0.0)
    batch = here.batch()
    for name in run:
        np.testing.assert_array_equal(batch[name].answers.verdict, run[name].verdicts, name)


# -- a worse world ------------------------------------------------------------------------------


def heavier_never_relieves(seed, folder):
    cell = made(seed, published=False)
    no_relief(*pair(folder, cell, heavier(cell)))


ELSEWHERE = "felt", "contact", "cart contact"
"""Of what is nearest, or fastest, of a part: of a thicker one that is another place, where less may move."""


def thicker_never_relieves(seed, folder):
    cell = made(seed, published=False)
    no_relief(*pair(folder, cell, thicker(cell)), *(name for name in ALL if name not in ELSEWHERE))


def faster_never_relieves(seed, folder):
    # By a table S_p is at least what is known ahead, which is less where the log is over sooner.
    cell = replace(made(seed), walks=False, brakes=())
    no_relief(*pair(folder, cell, faster(cell)), slack=1e-6)


def nearer_never_relieves(seed, folder):
    """The person, along the shortest distance at the worst instant, by less than what there is of it."""
    cell = made(seed)
    names = ["distance", "separation"] + ["cart distance", "cart separation"] * (cell.machine is not None)
    name = names[seed // 2 % len(names)]
    cell = replace(cell, left_out=frozenset(ALL) - {name})
    one, moved = nearer(cell, name, folder / "one")
    if moved is not None:
        no_relief(one, said(moved, folder / "other"), name)


LIMITED = {
    "speed": "speed", "fastest": "speed", "energy": "energy", "distance": "distance", "felt": "mass",
    "cart speed": "speed", "cart energy": "energy", "cart distance": "distance",
}  # fmt: skip
"""Criteria whose limits are given, and the name of each limit."""


def on_its_limit_nothing_is_within(seed, folder):
    """A limit that is the worst figure of the run, or off from it by its last bit."""
    cell = made(seed)
    name = list(LIMITED)[seed // 2 % (8 if cell.machine else 5)]
    cell = replace(cell, left_out=frozenset(ALL) - {name})
    log = said(cell, folder / "one")
    if name not in log or log[name].worst() is None or not np.isfinite(log[name].values).any():
        return
    worst = np.nanmax if log[name].at_most else np.nanmin
    value = float(worst(log[name].values))
    if value <= 0:
        return
    for k, limit in enumerate((value, np.nextafter(value, 0), np.nextafter(value, np.inf))):
        other = replace(cell, limits=cell.limits | {LIMITED[name]: float(limit)})
        on = station(other, folder / f"on {k}")
        assert on.run().results[name].verdict is not Verdict.WITHIN, (name, limit)
        assert on.batch()[name].verdict is not Verdict.WITHIN, (name, limit)


def asked_seldom_nothing_is_within_that_was_not(seed, folder):
    cell = made(seed)
    one, other = pair(
        folder, cell, replace(cell, every=float(np.random.default_rng(seed).uniform(0.011, 0.3)))
    )
    for name in one:
        verdicts = one[name].verdict, other[name].verdict
        assert verdicts[1] is not Verdict.WITHIN or verdicts[0] is Verdict.WITHIN, (
            name,
            one[name].worst(),
            other[name].worst(),
        )


def wider_tolerances_never_relieve(seed, folder):
    cell = made(seed)
    one, other = pair(folder, cell, replace(cell, uncertainty=0.05, mass_tolerance=0.2))
    for name in one:
        assert not (other[name].verdict is Verdict.WITHIN and one[name].verdict is not Verdict.WITHIN), name


def a_finer_tick_never_finds_a_larger_separation(seed, folder):
    """What a tick says of a motion that is known ahead holds until the next one."""
    cell = replace(made(seed), duration=0.3, walks=False, left_out=frozenset(ALL) - {"separation"})
    coarse, fine = (each["separation"] for each in pair(folder, cell, replace(cell, tick=0.002)))
    told = {round(t, 6): m for t, m in zip(coarse.t.tolist(), coarse.values - coarse.limits, strict=True)}
    compared = 0
    for t, margin in zip(fine.t.tolist(), fine.values - fine.limits, strict=True):
        if t > cell.duration - 0.1 - cell.tick:
            break  # what it does after the log nobody knows, and S_p is at least what is shown
        if round(t, 6) in told and np.isfinite(margin) and np.isfinite(told[round(t, 6)]):
            assert margin >= told[round(t, 6)] - 1e-6, t
            compared += 1
    assert compared > 10 or (cell.machine is not None and cell.machine.carries)


# -- less is known ------------------------------------------------------------------------------


def a_gap_in_the_log_is_never_greener(seed, folder):
    cell = replace(made(seed), duration=0.6, speeds=bool(seed // 2 % 2))
    known = cell.speeds or spoken(cell)
    beside = (0.2 - 1 / cell.rate, 0.5 + 1 / cell.rate) if known else (np.inf, 0.0)
    never_greener(*pair(folder, cell, replace(cell, gap=(0.2, 0.5))), beside=beside)


APART = "cart speed", "cart distance", "cart separation"
"""Of a machine that carries a robot, what does not depend on that."""


def a_robot_that_nobody_heard_is_never_within(seed, folder):
    cell = made(seed)
    log = said(replace(cell, heard=False), folder)
    carried = cell.machine is not None and cell.machine.carries
    for name in log:
        if name.startswith("cart"):  # which rests on the robot where it carries that
            assert log[name].verdict is not Verdict.WITHIN or not carried or name in APART, name
        elif name != "posture":
            assert log[name].verdict is Verdict.UNDECIDED, name


def a_machine_that_nobody_heard_is_never_within(seed, folder):
    """Nor is what it carries."""
    cell = made(seed)
    machine = cell.machine or random_machine(np.random.default_rng(seed))
    log = said(replace(cell, machine=replace(machine, heard=False, by_file=False)), folder)
    for name in log:
        if name.startswith("cart") or (machine.carries and name != "posture"):
            assert log[name].verdict is not Verdict.WITHIN, name


def a_mass_that_nobody_gave_is_never_within(seed, folder):
    cell = made(seed, published=False)
    k = seed % len(cell.links)
    links = tuple(replace(each, inertial=None) if i == k else each for i, each in enumerate(cell.links))
    one, other = pair(folder, cell, replace(cell, links=links))
    for name in {"energy", "felt", "contact"} & set(other):
        assert other[name].verdict is not Verdict.WITHIN, name
    never_greener(one, other)


def a_shape_that_nobody_gave_is_never_within(seed, folder):
    cell = made(seed, published=False)
    k = seed % len(cell.links)
    links = tuple(replace(each, shaped=False) if i == k else each for i, each in enumerate(cell.links))
    try:
        one, other = pair(folder, cell, replace(cell, links=links))
    except Undecided:
        return
    for name in {"fastest", "distance", "separation", "area", "contact"} & set(other):
        assert other[name].verdict is not Verdict.WITHIN, name
    never_greener(one, other)


def a_live_stream_is_never_greener_than_the_truth(seed, folder, what=""):
    """What happens to a stream turns nothing into within that was exceeded all the while."""
    what = what or list(SPOILED)[seed % len(SPOILED)]
    found, _ = greener_than_the_truth(what, seed, replace(made(seed), gripper=None), folder)
    assert not found, (what, found)


# -- and of which cells that is asked -----------------------------------------------------------

RELATIONS = {
    **{what: partial(nothing_changes, what) for what in SAME},
    **{
        asked.__name__.replace("_", " "): asked
        for asked in (
            the_world_tilted,
            a_criterion_changes_no_other,
            another_tick_does_not_contradict,
            replayed_and_in_arrays_it_says_the_same,
            heavier_never_relieves,
            thicker_never_relieves,
            faster_never_relieves,
            nearer_never_relieves,
            on_its_limit_nothing_is_within,
            asked_seldom_nothing_is_within_that_was_not,
            wider_tolerances_never_relieve,
            a_finer_tick_never_finds_a_larger_separation,
            a_gap_in_the_log_is_never_greener,
            a_robot_that_nobody_heard_is_never_within,
            a_machine_that_nobody_heard_is_never_within,
            a_mass_that_nobody_gave_is_never_within,
            a_shape_that_nobody_gave_is_never_within,
            a_live_stream_is_never_greener_than_the_truth,
        )
    },
}


PHYSICS = range(5000, 5060)
"""Cells, six of them in each run."""


@pytest.mark.parametrize(
    "seed", [pytest.param(s, marks=[pytest.mark.soak] * (s >= PHYSICS.start + 6)) for s in PHYSICS]
)
def test_pulled_by_the_physics_nothing_is_within_that_the_motion_itself_exceeds(seed, tmp_path):
    contacts = {"contact", "cart contact", "felt"}
    cell = random_cell(seed, published=False)
    cell = replace(cell, walks=False, left_out=cell.left_out | contacts)
    placed, pulled = pair(tmp_path, cell, replace(cell, physics=True))
    for name in placed:
        both = placed[name].verdict, pulled[name].verdict
        assert both != (Verdict.EXCEEDED, Verdict.WITHIN), (name, pulled[name].worst())


FINDS = [("paused", 5), ("noisy", 270012), ("all of that", 2026112500)]
"""What was done to a stream, and cells that showed that it made something within."""


def asked_of(seed):
    """Names of the relations that are asked of a cell."""
    if NAMED:
        return list(RELATIONS)
    if seed in FOUND:
        return [what for what in SAME if what != "the world in a mirror"]
    return np.random.default_rng([seed, 2]).choice(list(RELATIONS), EACH, replace=False).tolist()


def ask(name, seed, folder):
    """Ask a relation of a cell; what it says when it does not hold names both."""
    try:
        RELATIONS[name](seed=seed, folder=folder / name.replace(" ", "_"))
    except BaseException as error:
        error.add_note(f"cell {seed}: {name}; again: SEEROB_CELLS={seed} pytest {Path(__file__).name}")
        raise


@pytest.mark.parametrize("seed", NAMED or [*range(CELLS - len(FOUND)), *FOUND])
def test_what_must_hold_of_a_random_cell(seed, tmp_path):
    for name in asked_of(seed):
        ask(name, seed, tmp_path)


@pytest.mark.parametrize(("what", "seed"), FINDS)
def test_what_was_found_once_holds(what, seed, tmp_path):
    a_live_stream_is_never_greener_than_the_truth(seed, tmp_path, what)
