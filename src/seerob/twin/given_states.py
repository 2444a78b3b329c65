"""A motion that arrays say, instead of sources."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from seerob.core.errors import InputError, Problem
from seerob.core.transforms import Array
from seerob.model.model import Mechanism, Model
from seerob.recording.answers import Flags
from seerob.twin.spans import Path
from seerob.twin.states import Motion, Reasons

WHERE = "batch"
NOWHERE = "no motion is given and the file gives no position (q)"
NOT_FINITE = "a position or velocity that was given is not finite"


def motion_of(
    model: Model, q: Mapping[str, ArrayLike], qd: Mapping[str, ArrayLike], t: ArrayLike | None
) -> Motion:
    """The motion of those who are named; the others stand where the workstation file puts them.

    Args:
        model: The compiled workstation.
        q: Positions of the commanded joints by robot or human [rad or m], shape (N, n) each.
        qd: Likewise velocities [rad/s or m/s].
        t: Instants, increasing [s], shape (N,); a tick apart when not given.

    Raises:
        InputError: With every array that does not fit.
        UnknownName: A name that is no robot or human.
    """
    mechanisms = {name: model.mechanism(name) for name in [*q, *qd]}
    problems: list[Problem] = []
    if not q:
        problems.append(Problem(WHERE, "q", "empty", "give positions of a robot or human"))
    count = len(np.asarray(next(iter(q.values())))) if q else 0
    given: dict[str, tuple[Array, Array]] = {}
    for name, mechanism in mechanisms.items():
        arrays = []
        for key, values in (("q", q), ("qd", qd)):
            if name not in values:
                remedy = "give both; velocities of 0 where it stands still"
                problems.append(Problem(WHERE, f"{key}[{name!r}]", "missing", remedy))
                continue
            array = np.asarray(values[name], float)
            wanted = count, len(mechanism.joints)
            if array.shape != wanted:
                what = f"has the shape {array.shape}"
                joints = f"{len(mechanism.joints)} joints of {count} instants: {wanted}"
                problems.append(Problem(WHERE, f"{key}[{name!r}]", what, joints))
            arrays.append(array)
        if len(arrays) == 2:
            given[name] = arrays[0], arrays[1]
    period = model.workstation.engine.tick
    instants: Array = np.asarray(np.arange(count) * period if t is None else t, float)
    if instants.shape != (count,) or not np.isfinite(instants).all() or (np.diff(instants) <= 0).any():
        problems.append(Problem(WHERE, "t", "are not instants", f"{count} numbers that increase"))
    if problems:
        raise InputError(problems)
    motion = _placed(model, given, instants)
    if t is None:
        return motion
    pairs = [slice(k, k + 2) for k in range(count - 1)]
    return replace(motion, ways=tuple(Path(motion.t[k], motion.q[k], motion.v[k]) for k in pairs))


def _placed(model: Model, given: Mapping[str, tuple[Array, Array]], t: Array) -> Motion:
    q, v = np.tile(model.mj.qpos0, (len(t), 1)), np.zeros((len(t), model.mj.nv))
    doubts: dict[str, Reasons] = {}
    for mechanism in model.mechanisms.values():
        name = mechanism.name
        position, velocity = given.get(name) or _at_home(mechanism, len(t))
        finite: Flags = np.asarray(np.isfinite(np.hstack([position, velocity])).all(axis=1))
        # Who is lost stands somewhere, so that of everybody else something can be said.
        position = np.where(finite[:, None], position, mechanism.home)
        velocity = np.where(finite[:, None], velocity, 0.0)
        q[:, mechanism.q_address] = position @ mechanism.coupling.T + mechanism.offset
        v[:, mechanism.v_address] = velocity @ mechanism.coupling.T
        doubts[name] = np.where(finite, "", f"{name}: {NOT_FINITE}").astype(object)
        if name not in given and not mechanism.home_given:
            doubts[name][:] = f"{name}: {NOWHERE}"
    return Motion(t, q, v, doubts)


def _at_home(mechanism: Mechanism, n: int) -> tuple[Array, Array]:
    return np.tile(mechanism.home, (n, 1)), np.zeros((n, len(mechanism.home)))
