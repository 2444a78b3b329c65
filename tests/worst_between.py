"""How far a bound between two ticks is from the worst that is met there: ``from worst_between import …``."""

from __future__ import annotations

import numpy as np

from seerob.criteria.between_ticks import SpanResult
from seerob.session.run import Judge, engine_of, looks_ahead, pump, ticks


def one_by_one(judge):
    """Let a judge look at every criterion by itself, also at those that it is done with all at once."""
    between = judge._between
    between._others, between._plain = range(len(between._watches)), []
    return between


def worst_found(station, looks):
    """By criterion, how far the bound is from the worst that many looks between each two ticks meet."""
    engine = engine_of(station.model)
    judge = Judge(station.bound)
    between = one_by_one(judge)
    room, largest = {}, {}

    def watching(i, watch, ends, state):
        if ends[0].margin is None or ends[1].margin is None:
            return SpanResult()
        low = between._low(watch, between._way, ends, state)
        path = between._way
        instants = np.union1d(np.linspace(path.t[0], path.t[-1], looks + 2), path.t)
        met = []
        for t in instants.tolist():
            _, there, _ = between._look(i, watch, path, t, state)
            if there.margin is None:
                met.append(-1.0)
                continue
            rise = 0.0
            if watch.follows is not None and watch.follows.keeps and np.ndim(there.margin[0]):
                # The largest that was met counts, at ticks and between them.
                largest[watch] = np.maximum(largest.get(watch, 0.0), there.figure)
                rise = largest[watch] - there.figure
            met.append(np.min(there.margin[0] - rise - there.margin[1]))
        room.setdefault(watch.criterion.name, []).append(min(met) - low)
        return SpanResult()

    between._judge = watching
    ahead = looks_ahead(station.model)
    for _ in ticks(engine, judge, pump(station.sources, station.workstation.engine.tick, ahead=ahead)):
        pass
    return room
