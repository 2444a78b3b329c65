"""Where everybody is at every tick of a feed, without physics: where samples say; and what is heard then."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import mujoco
import numpy as np
from msgspec.structs import replace as changed

from seerob.core.samples import GrabSample, SignalSample
from seerob.core.snapshot import Finding
from seerob.core.transforms import Array
from seerob.criteria.plausible_places import PlausiblePlaces
from seerob.model.model import Model
from seerob.session.known_motion import known_motion
from seerob.session.opening import coarse
from seerob.session.run import Feed, engine_of
from seerob.twin.spans import Path
from seerob.twin.state import State
from seerob.twin.states import Motion, Seen
from seerob.twin.validity.hearing import Heard, Hearing


def recorded(model: Model, feed: Feed, end: float) -> Motion:
    """Where everybody is at every tick of a feed, without physics: where the samples say.

    Args:
        model: The compiled workstation, whose sources drive it.
        feed: Samples per tick.
        end: When the motion ends, and the last tick with it [s].
    """
    station = model.workstation
    placed = changed(station, engine=changed(station.engine, physics=False))
    model = replace(model, workstation=placed)
    heard = list(feed)
    engine = engine_of(model, _PositionsAlone)
    still = frozenset(name for name in model.mechanisms if not engine.state.moved(name))
    every = (sample for samples in heard for sample in samples)
    told = {sample.target for sample in every if not isinstance(sample, SignalSample | GrabSample)}
    driven = (name for name, hearing in engine.state.hearings.items() if hearing.driven)
    unmoved = frozenset(model.mechanisms.keys() - told - {*driven})
    known = known_motion(engine, heard, end)
    if known is not None and _is_plausible(model, known):
        return replace(known, still=still, coarse=coarse(model), unmoved=unmoved)
    plausible_places, implausible = PlausiblePlaces(model), dict[Finding, None]()
    engine = engine_of(model, _PositionsAlone)
    engine.end = end
    t, q, v = [], [], []
    ways: list[Path] = []
    reasons_of: dict[str, list[str]] = {name: [] for name in engine.model.mechanisms}
    noise: dict[str, list[Array | None]] = {name: [] for name in engine.model.mechanisms}
    seen: dict[str, list[Seen]] = {name: [] for name in engine.model.mechanisms}
    for seq, samples in enumerate(heard):
        engine.take(samples)
        state = engine.tick() if seq else engine.start()
        t.append(state.t)
        q.append(state.data.qpos.copy())
        v.append(state.data.qvel.copy())
        if state.path is not None:
            ways.append(state.path)
        implausible |= dict.fromkeys(plausible_places.at(state) or ())
        for name, found in reasons_of.items():
            hearing = state.hearings[name]
            # Of bones that are in doubt `Seen` tells, and the others may be relied on.
            found.append(
                state.invalid_source_reason(name) if hearing.bones_heard else state.invalid_reason(name)
            )
            noise[name].append(hearing.speed_error(state.t))
            seen[name].append(Seen.of(hearing))
    reasons = {name: np.array(found, object) for name, found in reasons_of.items()}
    n = {name: len(mechanism.joints) for name, mechanism in engine.model.mechanisms.items()}
    errors = {
        name: np.array([np.zeros(n[name]) if one is None else one for one in every])
        for name, every in noise.items()
        if any(one is not None for one in every)
    }
    arrays = np.array(t), np.array(q), np.array(v)
    return Motion(
        *arrays,
        reasons,
        ways=tuple(ways),
        foreseen=True,
        speed_errors=errors,
        still=still,
        unmoved=unmoved,
        seen={name: every for name, every in seen.items() if any(each.once or each.said for each in every)},
        coarse=coarse(model),
        implausible=tuple(implausible),
        unforeseen=frozenset(
            machine.name
            for machine in model.workstation.machines
            if engine.state.hearings[machine.name].driven
        ),
    )


def hearings_of(model: Model, motion: Motion) -> dict[str, Hearing]:
    """Of everybody: between two instants nobody is silent, however long it is."""
    return {
        name: Hearing(
            given=False,
            driven=True,
            timeout=np.inf,
            once=name in motion.still,
            coarse=motion.coarse.get(name, ""),
        )
        for name in model.mechanisms
    }


def hear(hearings: Mapping[str, Hearing], motion: Motion, k: int) -> None:
    """Let everybody be heard as they were at an instant, and at the one before."""
    since = max(k - 1, 0)
    for name, every in motion.seen.items():
        every[k].tell(hearings[name])
    for name, hearing in hearings.items():
        said = [motion.invalid_reasons[name][i].removeprefix(f"{name}: ") for i in range(since, k + 1)]
        errors = motion.speed_errors.get(name)
        hearing.heard = [
            Heard(float(motion.t[i]), why, speed_error=None if errors is None else errors[i])
            for i, why in zip(range(since, k + 1), said, strict=True)
        ]


class _PositionsAlone(State):
    """Where everybody is, and nothing of what follows from it."""

    def refresh(self, t: float) -> None:
        """Take the instant [s] alone: nothing that follows from positions is worked out."""
        self.t = t


def _is_plausible(model: Model, motion: Motion) -> bool:
    """Whether everybody is somewhere plausible once they are heard (`seerob.criteria.plausible_places`)."""
    places, data, hearings = (
        PlausiblePlaces(model),
        mujoco.MjData(model.mj),
        hearings_of(model, motion),
    )
    state = _PositionsAlone(model, data, hearings)
    for k, t in enumerate(motion.t.tolist()):
        if not places.waits:
            return True
        data.qpos[:] = motion.q[k]
        hear(hearings, motion, k)
        state.refresh(t)
        state.heard()
        if places.at(state):
            return False
    return True
