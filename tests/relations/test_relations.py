"""What must hold between the verdicts of two cells, whatever the truth is, on random cells.

Less, later or wider input never turns anything into WITHIN; a heavier, thicker or faster world never
relieves; names, units, order, place and time of day change nothing; nobody's verdict hangs on what else
is asked.
"""

from __future__ import annotations

import os
from dataclasses import replace

import numpy as np
import pytest
from random_cells import (
    Cell,
    faster,
    heavier,
    least_margin,
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

EACH = 17
"""Random cells that each relation is asked of."""
WITHIN = 0
RANK = {Verdict.WITHIN: 0, None: 0, Verdict.UNDECIDED: 1, Verdict.EXCEEDED: 2}
SEEDS = [int(seed) for seed in os.environ.get("SEEROB_CELLS", "").split()] or range(EACH)
"""Cells; ``SEEROB_CELLS="1234 5678"`` asks of these alone, as `make soak` says of what it finds."""
CELLS = pytest.mark.parametrize("seed", SEEDS)


def pair(tmp_path, cell: Cell, other: Cell) -> tuple[ResultLog, ResultLog]:
    return said(cell, tmp_path / "one"), said(other, tmp_path / "other")


def same(one: ResultLog, other: ResultLog, *, within: float = 1e-6) -> None:
    """Every criterion says the same, but where it lies on its limit."""
    for name in set(one) & set(other):
        a, b = one[name], other[name]
        margins = least_margin(a), least_margin(b)
        if np.isnan(margins).all():
            assert a.verdict is b.verdict, name
            continue
        if name != "area":  # whose depth is searched for within an interval
            assert margins[0] == pytest.approx(margins[1], abs=within, rel=within), name
        if abs(margins[0]) > within:
            assert a.verdict is b.verdict, (name, a.worst(), b.worst())


def no_relief(one: ResultLog, worse: ResultLog, *names: str, slack: float = 1e-9) -> None:
    """The second is nowhere better than the first."""
    for name in set(names or one) & set(one):
        a, b = one[name], worse[name]
        assert RANK[b.verdict] >= RANK[a.verdict], (name, a.worst(), b.worst())
        margins = least_margin(a), least_margin(b)
        if not np.isnan(margins).any():
            assert margins[1] <= margins[0] + slack, name


def never_greener(one: ResultLog, less: ResultLog, *, unsure: tuple[float, float] = (np.inf, 0.0)) -> None:
    """At no instant that both have, but between two, is the second WITHIN where the first is not."""
    for name in one:
        a, b = one[name], less[name]
        known = {round(t, 6): code for t, code in zip(a.t.tolist(), a.verdicts.tolist(), strict=True)}
        for t, code in zip(b.t.tolist(), b.verdicts.tolist(), strict=True):
            if code == WITHIN and not unsure[0] < t < unsure[1]:
                assert known.get(round(t, 6), WITHIN) == WITHIN, (name, t)


# -- nothing changes ----------------------------------------------------------------------------

SAME = {
    "the world turned and shifted": lambda c: replace(c, world=(13.0, -7.5, 2.1)),
    "bodies renamed": lambda c: replace(c, names=("zulu", "alpha"), cart="bravo"),
    "tables in another order": lambda c: replace(c, turned_tables=True),
    "figures in other units": lambda c: replace(c, units=True),
    "links split by fixed joints": lambda c: replace(c, split=True),
    "another start time": lambda c: replace(c, start=1234.7),
}


@CELLS
@pytest.mark.parametrize("what", SAME)
def test_nothing_changes(what, seed, tmp_path):
    cell = random_cell(seed, published=not what.startswith("links"))
    one, other = pair(tmp_path, cell, SAME[what](cell))
    # Speeds of what a PLC tells are derived as it comes: a row that rounding puts beyond a tick comes later.
    spoken = cell.machine is not None and not cell.machine.by_file
    same(one, other, within=1e-3 if spoken and what == "another start time" else 1e-5)


@CELLS
def test_a_criterion_changes_no_other(seed, tmp_path):
    cell = random_cell(seed)
    rng = np.random.default_rng(seed)
    names = ["speed", "fastest", "energy", "distance", "separation", "area", "felt", "contact"]
    names += ["cart distance", "cart contact"] * (cell.machine is not None)
    # Who asks for no speed of what carries a robot is told so.
    left_out = frozenset(rng.choice(names, rng.integers(1, 8), replace=False).tolist())
    one, other = pair(tmp_path, cell, replace(cell, left_out=left_out))
    for name in other:
        assert one[name].verdict is other[name].verdict, name
        np.testing.assert_array_equal(one[name].values, other[name].values, name)


@CELLS
def test_another_tick_does_not_contradict(seed, tmp_path):
    cell = random_cell(seed)
    one, other = pair(tmp_path, cell, replace(cell, tick=0.002))
    for name in one:
        verdicts = one[name].verdict, other[name].verdict
        # What may clamp by the next tick counts as clamped: a coarser one is stricter, and never a finer one.
        strict = "contact" in name and verdicts == (Verdict.EXCEEDED, Verdict.WITHIN)
        assert strict or set(verdicts) != {Verdict.WITHIN, Verdict.EXCEEDED}, name


@CELLS
def test_replayed_and_in_arrays_it_says_the_same(seed, tmp_path):
    cell = random_cell(seed)
    made = station(cell, tmp_path)
    from seerob.outputs.sinks.recorder import Recorder

    run = made.run(folder=tmp_path / "run", sinks=[Recorder()]).results
    (file,) = (tmp_path / "run").glob("*.mcap")
    again = made.replay(Recording.open(file)).results
    same(run, again, within=0.0)
    batch = made.batch()
    for name in run:
        np.testing.assert_array_equal(batch[name].answers.verdict, run[name].verdicts, name)


# -- a worse world ------------------------------------------------------------------------------


@CELLS
def test_heavier_never_relieves(seed, tmp_path):
    cell = random_cell(seed, published=False)
    no_relief(*pair(tmp_path, cell, heavier(cell)))


THICKNESS = "distance", "separation", "fastest", "cart distance", "cart separation", "cart speed"
SPEED = "speed", "fastest", "energy", "separation", "contact", "cart speed", "cart energy", "cart separation"


@CELLS
def test_thicker_never_relieves(seed, tmp_path):
    cell = random_cell(seed, published=False)
    no_relief(*pair(tmp_path, cell, thicker(cell)), *THICKNESS)


@CELLS
def test_faster_never_relieves(seed, tmp_path):
    cell = replace(random_cell(seed), walks=False)
    no_relief(*pair(tmp_path, cell, faster(cell)), *SPEED, "cart contact", slack=1e-6)


@CELLS
def test_wider_tolerances_never_relieve(seed, tmp_path):
    cell = random_cell(seed)
    one, other = pair(tmp_path, cell, replace(cell, uncertainty=0.05, mass_tolerance=0.2))
    for name in one:
        assert not (other[name].verdict is Verdict.WITHIN and one[name].verdict is not Verdict.WITHIN), name


@pytest.mark.parametrize("seed", range(4))
def test_a_finer_tick_never_finds_a_larger_separation(seed, tmp_path):
    """What a tick says of a motion that is known ahead holds until the next one."""
    others = {"speed", "fastest", "energy", "distance", "area", "felt", "contact", "posture"}
    cell = replace(random_cell(seed), walks=False, left_out=frozenset(others))
    coarse, fine = (each["separation"] for each in pair(tmp_path, cell, replace(cell, tick=0.002)))
    said = {round(t, 6): m for t, m in zip(coarse.t.tolist(), coarse.values - coarse.limits, strict=True)}
    compared = 0
    for t, margin in zip(fine.t.tolist(), fine.values - fine.limits, strict=True):
        if t > cell.duration - 0.1 - cell.tick:
            break  # what it does after the log nobody knows, and S_p is at least what is shown
        if round(t, 6) in said and np.isfinite(margin) and np.isfinite(said[round(t, 6)]):
            assert margin >= said[round(t, 6)] - 1e-6, t
            compared += 1
    assert compared > 10


# -- less is known ------------------------------------------------------------------------------


@CELLS
def test_a_gap_in_the_log_is_never_greener(seed, tmp_path):
    cell = replace(random_cell(seed), duration=0.6, speeds=bool(seed % 2))
    # Of given speeds and slopes the larger counts: beside the gap there are fewer slopes.
    unsure = (0.2 - 1 / cell.rate, 0.5 + 1 / cell.rate) if cell.speeds else (np.inf, 0.0)
    never_greener(*pair(tmp_path, cell, replace(cell, gap=(0.2, 0.5))), unsure=unsure)


APART = "cart speed", "cart distance", "cart separation"
"""Of a machine that carries a robot, what does not depend on that."""


@CELLS
def test_a_robot_that_nobody_heard_is_never_within(seed, tmp_path):
    cell = random_cell(seed)
    log = said(replace(cell, heard=False), tmp_path)
    carried = cell.machine is not None and cell.machine.carries
    for name in log:
        if name.startswith("cart"):  # which rests on the robot where it carries that
            assert log[name].verdict is not Verdict.WITHIN or not carried or name in APART, name
        elif name != "posture":
            assert log[name].verdict is Verdict.UNDECIDED, name


@CELLS
def test_a_machine_that_nobody_heard_is_never_within(seed, tmp_path):
    """Nor is what it carries."""
    cell = random_cell(seed)
    machine = cell.machine or random_machine(np.random.default_rng(seed))
    log = said(replace(cell, machine=replace(machine, heard=False, by_file=False)), tmp_path)
    carried = {"speed", "fastest", "distance", "separation", "area", "contact"} if machine.carries else set()
    for name in log:
        if name.startswith("cart") or name in carried:
            assert log[name].verdict is not Verdict.WITHIN, name


@CELLS
def test_a_mass_that_nobody_gave_is_never_within(seed, tmp_path):
    cell = random_cell(seed, published=False)
    k = seed % len(cell.links)
    links = tuple(replace(each, inertial=None) if i == k else each for i, each in enumerate(cell.links))
    one, other = pair(tmp_path, cell, replace(cell, links=links))
    for name in ("energy", "felt", "contact"):
        assert other[name].verdict is not Verdict.WITHIN, name
    never_greener(one, other)


@CELLS
def test_a_shape_that_nobody_gave_is_never_within(seed, tmp_path):
    cell = random_cell(seed, published=False)
    k = seed % len(cell.links)
    links = tuple(replace(each, shaped=False) if i == k else each for i, each in enumerate(cell.links))
    try:
        one, other = pair(tmp_path, cell, replace(cell, links=links))
    except Undecided:
        return
    for name in ("fastest", "distance", "separation", "area", "contact"):
        assert other[name].verdict is not Verdict.WITHIN, name
    never_greener(one, other)
