"""Asks every criterion at places of a path: first for the map, then of the motion that was made with it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from seerob.core.errors import InputError
from seerob.core.transforms import Array
from seerob.criteria.criterion import Criterion
from seerob.model.model import Mechanism, Model
from seerob.session.permissible.ceilings import Ask, By, Ceiling, Method, ceilings_of, governing, require
from seerob.session.permissible.given_motion import GivenMotion
from seerob.session.permissible.joint_limits import JointLimits
from seerob.session.permissible.path import Path, Piece
from seerob.session.permissible.speed_map import SpeedMap, Stations, reference_speed
from seerob.session.permissible.witness import Clock, Posed, Witness

Progress = Callable[[float], None]
"""Told what share is done, 0 to 1; what it raises stops the work."""

SPACING = 0.02
"""Largest way between two stations in joint space [rad or m]."""
FEWEST = 5
"""Stations of a piece."""
MOST_STATIONS = 50_000


class Survey:
    """The criteria of a workstation, bound to a robot on its path."""

    def __init__(
        self,
        model: Model,
        robot: Mechanism,
        motion: GivenMotion,
        path: Path,
        limits: JointLimits,
        witness: Witness,
        *,
        criteria: Sequence[Criterion],
        by: By = By.ALL,
    ) -> None:
        """Bind.

        Args:
            model: The compiled workstation.
            robot: Whose path it is.
            motion: The motion given.
            path: Its path.
            limits: Of its joints.
            witness: Of a run of the given motion.
            criteria: Of the workstation.
            by: Which of them count.

        Raises:
            InputError: No criterion limits the speed, or not those that are asked for.
        """
        require(by, criteria, model, robot.name)
        self._robot, self._motion, self._path, self._limits = robot, motion, path, limits
        self._by, self._asks = by, _asks(model, robot.name, criteria, by)
        self._witness, self._state = witness, Posed(model, robot, witness)
        self._tip = model.frame(robot.name)

    def map(
        self, *, spacing: float = SPACING, others_at: Clock = lambda t: t, progress: Progress = lambda _: None
    ) -> SpeedMap:
        """Ask along the whole path.

        Args:
            spacing: Largest way between two stations in joint space [rad or m].
            others_at: When the others are to be seen.
            progress: See `Progress`.

        Raises:
            InputError: So many stations that it would never end.
        """
        pieces = self._path.pieces
        whole = sum(piece.length for piece in pieces)
        if not spacing > 0 or whole / spacing > MOST_STATIONS:
            what = f"{spacing} rad or m gives more than {MOST_STATIONS} stations"
            raise InputError.at("permissible speed", "spacing", what, "give a larger spacing")
        places = [
            np.linspace(0.0, piece.length, max(FEWEST, math.ceil(piece.length / spacing) + 1))
            for piece in pieces
        ]
        self._look(places, others_at)
        found, before = [], 0.0
        for piece, s in zip(pieces, places, strict=True):
            begun, length = before, piece.length

            def told(s: float, begun: float = begun) -> None:
                progress((begun + s) / whole)

            found.append(self._stations(piece, s, others_at, told))
            before += length
        methods = frozenset(name for name, ask in self._asks.items() if ask.method is not Method.OWN)
        asked = tuple(self._asks)
        return SpeedMap(self._robot.name, self._path, self._limits, tuple(found), self._by, asked, methods)

    def denser(self, found: SpeedMap, places: Sequence[Array], others_at: Clock) -> SpeedMap:
        """A map with more stations, at path coordinates of each piece."""
        both = []
        for stations, piece, s in zip(found.stations, found.path.pieces, places, strict=True):
            new = np.setdiff1d(s, stations.s)
            more = self._stations(piece, new, others_at, lambda _: None) if len(new) else None
            both.append(stations if more is None else _merged(stations, more))
        return replace(found, stations=tuple(both))

    def share(self, q: Array, qd: Array, *, given: float, others_at: float) -> Ceiling | None:
        """What governs where the robot moves as it is told; a share of 1 or more, or None, permits that.

        Args:
            q: Its joint positions [rad or m], shape (d,).
            qd: Likewise [rad/s or m/s].
            given: When the given motion was there [s].
            others_at: When the others were [s].
        """
        self._place(given, others_at, q, qd)
        return governing(self._asked(), self._by, below=math.inf)

    def _asked(self) -> tuple[Ceiling, ...]:
        return tuple(ceiling for ask in self._asks.values() for ceiling in ask.ceilings(self._state))

    def _look(self, places: Sequence[Array], others_at: Clock) -> None:
        """Show every place to criteria that judge the whole run: those of the run itself, and of the map."""
        looks = [ask.look for ask in self._asks.values() if ask.look is not None]
        if not looks:
            return
        q = self._motion.at(np.array(self._witness.t))[0]
        at = [(t, t, row) for t, row in zip(self._witness.t, q, strict=True)]
        for piece, s in zip(self._path.pieces, places, strict=True):
            rows = piece.at(s)[0]
            at += [(t, others_at(t), row) for t, row in zip(piece.when(s).tolist(), rows, strict=True)]
        for t, others, row in at:
            self._place(t, others, row, np.zeros(len(row)))
            for look in looks:
                look(self._state)

    def _place(self, t: float, others_at: float, q: Array, qd: Array) -> None:
        self._state.place(t, others_at, q, qd, _doubt(self._motion, t))

    def _stations(self, piece: Piece, s: Array, others_at: Clock, progress: Progress) -> Stations:
        t = piece.when(s)
        reference, joint = reference_speed(piece, s, self._limits)
        q, along, _, _ = piece.at(s)
        tool, lever = np.zeros((len(s), 3)), np.zeros(len(s))
        ceilings = []
        for k in range(len(s)):
            self._place(float(t[k]), others_at(float(t[k])), q[k], along[k] * reference[k])
            ceilings.append(self._asked())
            tool[k], lever[k] = self._tool(along[k])
            progress(float(s[k]))
        given = np.interp(s, piece.s, piece.speed)
        return Stations(s, t, reference, joint, given, tuple(ceilings), self._by, q, tool, lever)

    def _tool(self, along: Array) -> tuple[Array, float]:
        """Where the tool point is [m], and its speed by path speed."""
        state, robot = self._state, self._robot
        # Whether its place may be relied on is the criteria's question, not the drawing's.
        doubts, state.doubts = state.doubts, {}
        J = state.jacobian(self._tip, robot)[:3]
        state.doubts = doubts
        return state.pose(self._tip)[1], float(np.linalg.norm(J @ along))


def _asks(model: Model, robot: str, criteria: Sequence[Criterion], by: By) -> dict[str, Ask]:
    asks: dict[str, Ask] = {}
    anywhere = by.contact_anywhere(criteria, robot)
    for criterion in criteria:
        ask = ceilings_of(criterion, model, robot, anywhere=anywhere)
        if ask is not None and by.counts(ask.method):
            asks[criterion.name] = ask
    if not asks:
        what = f"no criterion of the workstation limits the speed of {robot} (asked for: {by.value})"
        remedy = 'add [[safety]] with kind = "separation" or "power_and_force"'
        raise InputError.at("permissible speed", "safety", what, remedy)
    return asks


def _merged(a: Stations, b: Stations) -> Stations:
    """In the order of the path."""
    order = np.argsort(np.concatenate([a.s, b.s]), kind="stable")
    both = {
        key: np.concatenate([getattr(a, key), getattr(b, key)])[order]
        for key in ("s", "t", "reference", "joint", "given", "q", "tool", "lever")
    }
    ceilings = (*a.ceilings, *b.ceilings)
    return Stations(**both, ceilings=tuple(ceilings[i] for i in order.tolist()), by=a.by)


def _doubt(motion: GivenMotion, t: float) -> str:
    k = int(motion.interval(t))
    if motion.good[k : k + 2].all():
        return ""
    return f"{motion.target}: its source does not vouch for where it is at {t:.3f} s"
