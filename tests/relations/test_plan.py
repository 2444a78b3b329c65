"""What a tick's plan computes together is what each criterion says alone, byte for byte."""

from dataclasses import replace
from itertools import islice
from pathlib import Path

import msgspec
import numpy as np

from seerob.core.markers import plain
from seerob.core.snapshot import Verdict
from seerob.core.verdict import ROUNDING
from seerob.criteria.between_ticks import least_margin
from seerob.criteria.figure import Figure, verdict_of
from seerob.criteria.judging import Judge
from seerob.criteria.plan import Plan
from seerob.criteria.stopping.onset import Foreseen
from seerob.kernels.verdicts import judged_rows
from seerob.recording.series import CODES
from seerob.session.run import looks_ahead, pump
from seerob.session.station import load
from seerob.twin.engine import Engine
from seerob.twin.spans import Fall, Points, rows_of

LOST = 25
"""Tick from which one robot is not heard any more."""


def test_a_plan_says_what_each_criterion_says_alone(monkeypatch):
    cell = load(Path(__file__).parents[2] / "workstations" / "two_robots")
    period, counts = cell.workstation.engine.tick, []
    ask = Plan.__call__

    def counted(self, state):
        found = ask(self, state)
        counts.append(sum(result is not None for result in found))
        return found

    monkeypatch.setattr(Plan, "__call__", counted)
    engine = Engine(cell.model, driven={source.target(): 5 * period for source in cell.workstation.sources})
    together, encode = Judge(cell.bound), msgspec.msgpack.Encoder(enc_hook=plain).encode
    # A plan stands for what `bind` gave, and for nothing else.
    alone = Judge([replace(one, evaluate=one.criterion.bind(cell.model)) for one in cell.bound])
    undecided, exceeded = set(), set()
    for k, samples in enumerate(islice(pump(cell.sources, period, ahead=looks_ahead(cell.model)), 60)):
        engine.take([s for s in samples if k < LOST or getattr(s, "target", "") != "ur5e"])
        state = engine.tick() if k else engine.start()
        planned, each = together(state), alone(state)
        assert encode(planned) == encode(each), k
        undecided |= {result.name for result in planned if result.verdict is Verdict.UNDECIDED}
        exceeded |= {result.name for result in planned if result.verdict is Verdict.EXCEEDED}
    assert sum(count >= len(cell.bound) - 2 for count in counts) > LOST - 5, counts
    assert len(counts) < LOST + 25, "what is not heard is asked alone"
    assert {"ur5e energy", "ur5e – operator"} <= undecided
    assert not {"ur10 energy", "ur10 – racks"} & undecided
    assert exceeded


def test_what_is_asked_at_once_is_what_is_asked_in_turn():
    """A motion ahead by its samples, and what a separation loses between ticks."""
    cell = load(Path(__file__).parents[2] / "workstations" / "two_robots")
    model, period = cell.model, cell.workstation.engine.tick
    engine = Engine(model, driven={source.target(): 5 * period for source in cell.workstation.sources})
    separation = next(one for one in cell.workstation.safety if one.name == "ur5e separation")
    gap, robot = separation._gap(model), model.robot("ur5e")
    along, generally = (Foreseen(model, robot, gap, 0.1, joints=False) for _ in range(2))
    points = Points(model)
    falls, rises = separation.falls(model, points), separation.rises(model)
    people, parts = rows_of(gap.a), rows_of(gap.b)
    speeds, knots = None, 0
    for k, samples in enumerate(islice(pump(cell.sources, period, ahead=looks_ahead(model)), 25)):
        engine.take(samples)
        state = engine.tick() if k else engine.start()
        by_samples, told = along.at(state), state.foresee_samples
        state.foresee_samples = lambda name, until: None
        by_instants, state.foresee_samples = generally.at(state), told
        for scale in (1.0, 0.5):
            for one, other in zip(as_bytes(by_samples(scale)), as_bytes(by_instants(scale)), strict=True):
                assert one == other, k
        knots += len(state.knots("ur5e", state.t, state.t + 0.11))
        before, speeds = speeds, state.largest_speeds()
        if before is None:
            continue
        span = points.span(state.path, *state.path.t[[0, -1]].tolist(), state.attachments.ids, model.mj)
        span.between_speeds(before, speeds)
        nearer = span.way(people) + span.fast[parts] * span.T
        lost = falls(span, 0.0)
        assert lost.fall == np.inf
        assert lost.bend.tobytes() == np.concatenate([nearer + rises(span), nearer]).tobytes()
    assert knots > 25


def as_bytes(onset):
    return [each.tobytes() for each in (onset.v_r, onset.S_r, onset.v_s)]


def test_the_least_of_many_margins():
    rng, fall = np.random.default_rng(5), 0.2
    for n in (1, 7, 16):
        one, off, other, also, bend = rng.normal(size=(5, n))
        low = np.maximum((one + other - fall) / 2, np.minimum(one, other) - bend) - np.maximum(off, also)
        assert least_margin((one, off), (other, also), Fall(fall, bend)) == low.min()
        other[0] = np.nan
        assert np.isnan(least_margin((one, off), (other, also), Fall(fall, bend)))


def test_rows_are_judged_as_figures_are():
    rng = np.random.default_rng(7)
    n = 4000
    some = np.array([-np.inf, -1.0, 0.0, 1 - 2e-9, 1 - 5e-10, 1.0, 1 + 5e-10, 1 + 2e-9, 2.0, np.inf, np.nan])
    value, low, high, limit = rng.choice(some, (4, n))
    low, high = np.minimum(value, low), np.maximum(value, high)
    limited, at_most, exceeded = rng.random((3, n)) < [[0.8], [0.5], [0.1]]
    codes = np.empty(n, np.uint8)
    with np.errstate(invalid="ignore"):  # infinity less infinity, where Python runs it
        judged_rows(value, low, high, limit, limited, at_most, exceeded, ROUNDING, codes)
    decided = 0
    for k in range(n):
        known = np.isfinite(value[k]) and low[k] <= high[k]
        if limited[k] and np.isnan(limit[k]):
            continue  # there is none
        given = float(limit[k]) if limited[k] else None
        figure = Figure(float(value[k]), given, (float(low[k]), float(high[k])), exceeded=bool(exceeded[k]))
        said = verdict_of(figure, at_most=bool(at_most[k])) if known else Verdict.UNDECIDED
        assert codes[k] == CODES[said], (value[k], low[k], high[k], given, at_most[k], exceeded[k])
        decided += said in {Verdict.WITHIN, Verdict.EXCEEDED}
    assert decided > n / 10
