"""A path between two postures by OMPL ([Sucan2012]_), every straight way of which is proven to be clear.

RRT-Connect ([Kuffner2000]_) finds it, partial short cuts make it shorter. OMPL asks `Clearance` about whole
ways, not about samples of them. Its generator of random numbers is one for the whole process: it is seeded
anew for every search, so that the same seed gives the same path whatever was searched before.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import pairwise
from threading import Lock
from typing import Any

import numpy as np

from seerob.core.errors import InputError, SeerobError
from seerob.core.transforms import Array
from seerob.session.planning.clearance import Clearance

STRIDE = 0.6
"""Largest step of a tree in joint space [rad or m]."""

_ONE_AT_A_TIME = Lock()


class NoPath(SeerobError):
    """No path was found; that there is none is not known."""


class Stopped(SeerobError):
    """It was asked to stop."""


def search(
    clearance: Clearance,
    start: Array,
    goal: Array,
    *,
    margin: float,
    seed: int,
    most: int,
    seconds: float,
    say: Callable[[int], bool],
) -> list[Array]:
    """Postures of a path whose straight ways all keep the margin.

    Args:
        clearance: The robot among everything.
        start: Joint positions, shape (n,); clear.
        goal: Likewise.
        margin: [m].
        seed: Of what is tried.
        most: Largest number of postures tried.
        seconds: Longest time; what is found before does not depend on it [s].
        say: Told how many were tried; True stops the work.

    Raises:
        InputError: OMPL is not installed.
        NoPath: None was found within ``most`` or ``seconds``.
        Stopped: ``say`` said so.
    """
    base, geometric, util = _ompl()
    if clearance.clear(start, goal, margin):
        return [start, goal]
    patience = _Patience(most, seconds, say)
    with _ONE_AT_A_TIME, _quiet(util):
        util.RNG.setSeed(seed % (2**32 - 1) + 1)
        space = _space(base, clearance, start, goal)
        setup = geometric.SimpleSetup(space)
        information = setup.getSpaceInformation()
        setup.setStateValidityChecker(lambda state: not clearance.fault(_posture(state, len(start)), margin))
        information.setMotionValidator(_validator(base, information, clearance, margin, patience))
        setup.setStartAndGoalStates(_state(space, start), _state(space, goal))
        planner = geometric.RRTConnect(information)
        planner.setRange(STRIDE)
        setup.setPlanner(planner)
        setup.solve(base.PlannerTerminationCondition(patience))
        if not setup.haveExactSolutionPath():
            raise patience.end()
        path = setup.getSolutionPath()
        found = [_posture(state, len(start)) for state in path.getStates()]
        if not patience.over():
            simplifier = geometric.PathSimplifier(information)
            simplifier.ropeShortcutPath(path)
            simplifier.partialShortcutPath(path, 60, 30)
            simplifier.reduceVertices(path)
            shorter = [_posture(state, len(start)) for state in path.getStates()]
            found = _plain(clearance, shorter, margin)
    if patience.stopped:
        raise patience.end()
    if not all(clearance.clear(a, b, margin) for a, b in pairwise(found)):
        raise NoPath("the path that was found could not be proven")
    return found


class _Patience:
    """Tells OMPL when to give up, and then why."""

    def __init__(self, most: int, seconds: float, say: Callable[[int], bool]) -> None:
        self._most, self._seconds, self._say = most, seconds, say
        self._until = time.monotonic() + seconds
        self._tried = 0
        self._stopped = False

    def __call__(self) -> bool:
        self._tried += 1
        return self.over() or self._tried > self._most

    def over(self) -> bool:
        """Whether there is no more time, or nobody wants to wait."""
        self._stopped = self._stopped or self._say(self._tried)
        return self._stopped or time.monotonic() > self._until

    @property
    def stopped(self) -> bool:
        """Whether nobody wants to wait."""
        return self._stopped

    def end(self) -> SeerobError:
        if self._stopped:
            return Stopped(f"stopped after {self._tried} postures")
        spent = f"in {self._seconds:g} s ({self._tried} postures tried)"
        if self._tried > self._most:
            spent = f"with {self._most} postures tried"
        return NoPath(f"no path was found {spent}; that there is none is not known")


def _ompl() -> tuple[Any, Any, Any]:
    try:
        from ompl import base, geometric, util
    except ImportError as error:
        remedy = 'pip install "seerob[plan]" (it exists for Linux and macOS)'
        raise InputError.at("plan", "", f"the package ompl cannot be imported ({error})", remedy) from error
    return base, geometric, util


@contextmanager
def _quiet(util: Any) -> Iterator[None]:
    """Without what OMPL writes to the terminal: that it is seeded anew, too."""
    before = util.getLogLevel()
    util.setLogLevel(util.LOG_NONE)
    try:
        yield
    finally:
        util.setLogLevel(before)


def _space(base: Any, clearance: Clearance, start: Array, goal: Array) -> Any:
    """Where postures are tried: within the limits, and where there are none half a turn around both ends."""
    robot = clearance.robot
    least, most = np.minimum(start, goal), np.maximum(start, goal)
    low = np.minimum(np.maximum(robot.lower, least - np.pi), least)
    high = np.maximum(np.minimum(robot.upper, most + np.pi), most)
    space, bounds = base.RealVectorStateSpace(len(start)), base.RealVectorBounds(len(start))
    for i, (a, b) in enumerate(zip(low.tolist(), high.tolist(), strict=True)):
        bounds.setLow(i, a)
        bounds.setHigh(i, b)
    space.setBounds(bounds)
    return space


def _validator(base: Any, information: Any, clearance: Clearance, margin: float, patience: _Patience) -> Any:
    n = len(clearance.robot.joints)

    class Proven(base.MotionValidator):  # type: ignore[misc]
        def checkMotion(self, a: Any, b: Any) -> bool:
            # OMPL asks whether to end between its steps only, each of which may be long.
            return not patience.over() and clearance.clear(_posture(a, n), _posture(b, n), margin)

    return Proven(information)


def _posture(state: Any, n: int) -> Array:
    return np.array([state[i] for i in range(n)])


def _state(space: Any, q: Array) -> Any:
    state = space.allocState()
    for i, value in enumerate(q.tolist()):
        state[i] = value
    return state


def _plain(clearance: Clearance, way: list[Array], margin: float) -> list[Array]:
    """Without postures that can be left out."""
    k = 1
    while k < len(way) - 1:
        same = np.abs(way[k] - way[k - 1]).max() < 1e-9
        if same or clearance.clear(way[k - 1], way[k + 1], margin):
            del way[k]
        else:
            k += 1
    return way
