"""Asks every criterion at places of a path: first for the map, then of the motion that was made with it.

Between two stations of the map the lesser of their speeds counts, which is a convention. So the plan is
looked at again: at a fixed period, far shorter than the time from station to station, the twin is put where
the plan has it, with the speed that the plan has there, and every criterion that counts is asked which share
of that speed it permits. Where that is less than 1 the map gets a station, and the timing is made anew. What
is stated in the end is what was found at those instants: it is a dense sampling with a known period, not a
bound.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from seerob.core.errors import InputError
from seerob.core.transforms import Array
from seerob.criteria.criterion import Criterion
from seerob.model.model import Mechanism, Model
from seerob.session.permissible.ceilings import Ask, By, Ceiling, Method, ceilings_of, governing, require
from seerob.session.permissible.joint_limits import JointLimits
from seerob.session.permissible.path import GivenMotion, Path, Piece
from seerob.session.permissible.rescaled import Rescaled
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
        self._by = by
        # What may be closed takes what it would were it so.
        self._asks = _asks(model.closed or model, robot.name, criteria, by)
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
        methods = {name: ask.method for name, ask in self._asks.items() if ask.method is not Method.OWN}
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
        self._state.place(t, others_at, q, qd, _invalid_reason(self._motion, t))

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
        invalid_reasons, state.invalid_reasons = state.invalid_reasons, {}
        state.heard()  # What was found of its place is kept, and would be said of it again.
        J = state.jacobian(self._tip, robot)[:3]
        place = state.pose(self._tip)[1]
        state.invalid_reasons = invalid_reasons
        state.heard()
        return place, float(np.linalg.norm(J @ along))


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


def _invalid_reason(motion: GivenMotion, t: float) -> str:
    k = int(motion.interval(t))
    if motion.good[k : k + 2].all():
        return ""
    return f"{motion.target}: its source does not vouch for where it is at {t:.3f} s"


MOST = 400_000
"""Instants that are looked at."""
RESTS = 1e-3
"""Share of the permissible path speed below which the robot is taken to rest."""


@dataclass(frozen=True, eq=False)
class Verified:
    """What was found at a fixed period."""

    period: float
    """[s]"""
    asked: int
    """Instants at which the robot moves."""
    use: float
    """Largest share of a permitted speed that is used; 1 is all of it, inf where none is permitted."""
    at: float
    """When that is [s]."""
    what: str
    """What governs then."""
    undecided: int
    """Instants at which it cannot be told."""
    over: tuple[Array, ...]
    """Path coordinates of each piece where more than 1 is used."""

    @property
    def kept(self) -> bool:
        """Whether the plan keeps to the criteria at every instant looked at."""
        return self.asked > 0 and self.use <= 1 + 1e-9 and not self.undecided


def verify(
    motion: Rescaled,
    survey: Survey,
    *,
    period: float,
    progress: Callable[[float], None] = lambda _: None,
) -> Verified:
    """Look at every instant.

    Args:
        motion: The plan.
        survey: The criteria.
        period: Between two looks [s].
        progress: Told the share done; what it raises stops the work.

    Raises:
        InputError: A period that gives too many looks.
    """
    if not period > 0 or motion.duration / period > MOST:
        what = f"{period} s of a motion of {motion.duration:.3f} s"
        raise InputError.at("permissible speed", "verify", what, f"give one that is looked at {MOST} times")
    asked = undecided = 0
    use, at, what_then = 0.0, 0.0, ""
    over: list[Array] = []
    for piece, start, stations in zip(motion.pieces, motion.starts, motion.of.stations, strict=True):
        # In its middle too: whatever the period, no piece is without a look.
        t = np.union1d(np.arange(0.0, piece.duration, period), piece.duration / 2)
        moment = piece.profile.at(t)
        q, qd, _, _ = piece.at(t)
        moving = moment.speed > RESTS * stations.between(moment.s)
        given = piece.piece.when(moment.s)
        wrong = []
        for k in np.flatnonzero(moving).tolist():
            own = float(start + t[k])
            # The others do not wait: they are where they are at the plan's own time.
            ceiling = survey.share(q[k], qd[k], given=float(given[k]), others_at=own)
            asked += 1
            progress(own / motion.duration)
            if ceiling is None:
                continue
            if ceiling.undecided:
                undecided += 1
                wrong.append(moment.s[k])
                continue
            used = np.inf if ceiling.share == 0 else 1 / ceiling.share
            if used > 1:
                wrong.append(moment.s[k])
            if used > use:
                use, at, what_then = used, own, ceiling.words()
        over.append(np.array(wrong))
    return Verified(period, asked, float(use), at, what_then, undecided, tuple(over))
