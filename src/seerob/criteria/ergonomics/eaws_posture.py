"""Posture screening in the style of the EAWS form: sections 0 and 1, over the time of a cycle.

This is not the EAWS: its figures come from one public code and from memory, sections 2 to 4 are not public.
First lines and points of postures, then the screening over time (seconds per posture line and of an
asymmetric trunk, the points of both), then the rule. All of it is of n instants, of which a tick has one.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from enum import StrEnum
from functools import cache
from itertools import pairwise, product
from typing import Annotated, Any, NamedTuple, cast

import numpy as np
from msgspec import Meta, Struct
from msgspec.structs import asdict
from numpy.typing import ArrayLike, NDArray

from seerob.core import figures
from seerob.core.domains import number
from seerob.core.errors import UnknownName
from seerob.core.snapshot import Basis, Highlight, Input, Origin, Result, Row, RowState, Verdict
from seerob.core.transforms import Array
from seerob.core.verdict import admitted
from seerob.criteria.figure import Compute, Figure, Present, Shown, Twin
from seerob.criteria.scoring.basis import chosen, entered, posture_quality
from seerob.criteria.scoring.held_work import GAP
from seerob.criteria.scoring.measured import Accuracy, Measured
from seerob.criteria.scoring.phases import Period, Phase, Seconds, phases_of, shared_phases
from seerob.criteria.scoring.rule import PostureRule, bind_posture
from seerob.criteria.scoring.score_rows import total_row
from seerob.criteria.scoring.spans import ROUNDING, Angle, published, reached
from seerob.description.humans.angles import Angles
from seerob.model import provenance
from seerob.model.model import Model
from seerob.recording.answers import Flags
from seerob.workstation.tables.task_phase import Stance


class Interpolation(StrEnum):
    """What lies between two columns of the form."""

    LINEAR = "linear"
    """Linear between columns, proportional below the first, the last column beyond it."""
    STEP = "step"
    """The column that was reached; 0 below the first."""


class EawsThresholds(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Angles at which a posture belongs to a line."""

    bent: Angle = math.radians(20)
    """Trunk bent forward from here on [rad]."""
    far_bent: Angle = math.radians(60)
    """Trunk strongly bent forward beyond [rad]."""
    overhead: Angle = math.radians(40)
    """Elbow or wrist above the horizontal through the shoulder by more: hands above head [rad]; a choice."""
    crouching: Angle = math.radians(60)
    """Both knees bent beyond [rad]: crouching; a choice."""
    kneeling: Angle = math.radians(60)
    """Shank from the vertical beyond [rad]: kneeling; a choice."""


class Line(NamedTuple):
    """One line of the form."""

    id: str
    name: str
    position: str
    points: tuple[float, ...]
    confidence: str


@cache
def lines() -> dict[str, Line]:
    """The lines by their number."""
    rows = published("eaws_posture")["lines"]
    return {row["id"]: Line(**{**row, "points": tuple(map(float, row["points"]))}) for row in rows}


POSITIONS: Mapping[Stance, str] = {
    "sitting": "sitting",
    "standing": "standing",
    "one_leg": "standing",
    "walking": "walking",
    "both_knees_bent": "kneeling",
    "one_knee_bent": "kneeling",
    "kneeling": "kneeling",
    "lying": "lying",
    "climbing": "climbing",
}
"""How the legs are used → group of lines."""


def line_points(line: str, share: ArrayLike, interpolation: Interpolation = Interpolation.LINEAR) -> Array:
    """Points of a posture that lasts for a share of the time, 0 to 1, shape (...)."""
    if line not in lines():
        raise UnknownName("line of the form", line, lines())
    x = number("share", share, 0, 1 + _ROUNDING)
    shares, points = _columns(line)
    if Interpolation(interpolation) is Interpolation.STEP:
        return np.asarray(points[np.searchsorted(shares, x + _ROUNDING, side="right") - 1])
    return np.asarray(np.interp(x, shares, points))


@cache
def _columns(line: str) -> tuple[Array, Array]:
    """Shares and points of a line, none of both first."""
    points = np.array([0.0, *lines()[line].points])
    return np.array([0.0, *published("eaws_posture")["shares"]])[: len(points)], points


def most_points(shares: Mapping[str, ArrayLike], whole: ArrayLike) -> Array:
    """At most so many points of postures together, of which each may last for no more than its share.

    Args:
        shares: Of the time that each line may have at most, 0 to 1; together they may be more than the
            whole. Shape (...) each.
        whole: Share of the time that all of them have together, shape (...).

    Returns:
        The smaller of two bounds, shape (...): all shares at once, and the whole time given to where it
        costs most, by the least concave curves above the points of the form.
    """
    left = number("whole", whole, 0, 1 + _ROUNDING)[..., None]
    at_once = np.stack([line_points(line, share) for line, share in shares.items()], axis=-1)
    pieces = [(line, *piece) for line in shares for piece in pairwise(_above(line))]
    begin, end = (np.array([piece[k] for piece in pieces]).T for k in (1, 2))
    own = np.stack([np.asarray(shares[line], float) for line, *_ in pieces], axis=-1)
    width = np.maximum(np.minimum(end[0], own) - begin[0], 0.0)
    slope = np.broadcast_to((end[1] - begin[1]) / (end[0] - begin[0]), width.shape)
    steepest = np.lexsort((width, slope))[..., ::-1]
    slope, width = (np.take_along_axis(each, steepest, -1) for each in (slope, width))
    left = np.subtract.accumulate(np.concatenate([left, width], axis=-1), axis=-1)[..., :-1]
    return np.minimum(_summed(at_once), _summed(slope * np.minimum(width, np.maximum(left, 0.0))))


def _summed(terms: Array) -> Array:
    """Sums of the last axis, in its order: of many instants to the last bit those of one."""
    return np.asarray(np.cumsum(terms, axis=-1)[..., -1])


@cache
def _above(line: str) -> list[tuple[float, float]]:
    """Corners of the least concave curve above the points of a line: share and points."""
    points = lines()[line].points
    hull = [(0.0, 0.0)]
    for x, y in zip(published("eaws_posture")["shares"][: len(points)], points, strict=True):
        while len(hull) > 1 and (y - hull[-2][1]) * (hull[-1][0] - hull[-2][0]) >= (
            hull[-1][1] - hull[-2][1]
        ) * (x - hull[-2][0]):
            hull.pop()
        hull.append((x, y))
    return hull


def asymmetry_points(at_least: ArrayLike) -> Array:
    """Points of a trunk that is turned, or bent sideways, shape (...).

    Args:
        at_least: Share of the time at or beyond each of the form's three angles, shape (..., 3).
    """
    table = published("eaws_posture")
    shares = number("share", at_least, 0, 1 + _ROUNDING)
    reached = np.searchsorted(table["asymmetry_shares"], shares + _ROUNDING, side="right")
    points = np.array([0.0, *table["asymmetry_factors"]])[reached] * table["asymmetry_points"]
    return np.asarray(np.minimum(points.max(axis=-1), table["asymmetry_most"]), float)


def possible_lines(
    angles: Angles,
    *,
    legs: Stance | None,
    supported: bool | None,
    thresholds: EawsThresholds,
    accuracy: Accuracy = 0.0,
) -> Flags:
    """Lines that postures may belong to, of each one when it is known, shape (..., 18) as `lines` are.

    Of several that fit, a posture belongs to the one with the most points: bent or arms raised.

    Args:
        angles: Of the postures.
        legs: How they are used; ``posture`` tells standing, crouching and kneeling apart.
        supported: Whether the trunk is well supported; None when nobody said.
        thresholds: Of the lines.
        accuracy: Of each angle [rad].
    """
    t, m = thresholds, Measured(angles, accuracy)
    bent = m.graded(
        "trunk_flexion",
        lambda x: reached(x, t.bent).astype(np.int64) + reached(x, t.far_bent),
        within=(0, 2),
        neutral=-math.inf,
    )
    arms = m.graded(
        "arm_rise",
        lambda x: (x >= -ROUNDING).astype(np.int64) + reached(x, t.overhead),
        within=(0, 2),
        neutral=-math.inf,
    )
    grades = np.arange(3)
    bends, rises = (
        (low[..., None] <= grades) & (grades <= high[..., None])
        for low, high in ((bent.low, bent.high), (arms.low.max(axis=-1), arms.high.max(axis=-1)))
    )
    held = np.array([supported is not False, supported is not True])
    fits = _positions(m, legs, t)[..., None, None, None] & bends[..., None, :, None, None]
    fits = fits & rises[..., None, None, :, None] & held
    return np.asarray(fits.reshape(*bends.shape[:-1], -1) @ _belongs())


def lightest_first(possible: Flags) -> tuple[str, ...]:
    """Lines that one posture may belong to, shape (18,), by name."""
    return tuple(_names()[k] for k in _lightest() if possible[k])


_STANCES = tuple(dict.fromkeys(POSITIONS.values()))


def _positions(measured: Measured, legs: Stance | None, t: EawsThresholds) -> Flags:
    """Which of `_STANCES` are possible, shape (..., 6)."""
    found = np.zeros((*measured.angles.trunk_flexion.shape, len(_STANCES)), bool)
    if legs is None:
        found[:] = True
    elif legs != "posture":
        found[..., _STANCES.index(POSITIONS[legs])] = True
    else:
        folded = measured.beyond("knee_flexion", t.crouching)
        flat = measured.beyond("shank_tilt", t.kneeling)
        low, high = (
            (f.min(axis=-1) == 1) | (s.max(axis=-1) == 1)
            for f, s in ((folded.low, flat.low), (folded.high, flat.high))
        )
        found[..., _STANCES.index("standing")] = ~low
        found[..., _STANCES.index("kneeling")] = high
    return found


@cache
def _names() -> tuple[str, ...]:
    return tuple(lines())


@cache
def _every() -> tuple[str, ...]:
    """Line of every position, bend of the trunk, rise of the arms and support, in this order."""
    return tuple(_line(*each) for each in product(_STANCES, range(3), range(3), (True, False)))


@cache
def _belongs() -> Flags:
    """Which line each of these belongs to, shape (108, 18)."""
    return np.asarray(np.array(_every())[:, None] == np.array(_names()))


@cache
def _lightest() -> NDArray[np.int64]:
    """Lines by weight, the lightest first."""
    return np.array([_names().index(name) for name in sorted(dict.fromkeys(_every()), key=_weight)])


def _line(position: str, bent: int, arms: int, supported: bool) -> str:
    if position in ("lying", "climbing"):
        return {"lying": "15", "climbing": "16"}[position]
    if position == "sitting":
        upright = "9" if bent else "7" if supported else "8"
        return (upright, "10", "11")[arms]
    if position == "kneeling":
        upright = "13" if bent else "12"
        return upright if arms == 0 else "14"
    upright = "1" if supported or position == "walking" else "2"
    trunk = (upright, "3b" if supported else "3a", "4b" if supported else "4a")[bent]
    return max((trunk, (trunk, "5", "6")[arms]), key=_weight)


def _weight(line: str) -> float:
    return float(line_points(line, 0.66))


_ROUNDING = 1e-9


class Held(NamedTuple):
    """What has lasted until each of n instants."""

    heard: Array
    """Time that was heard [s], shape (n,)."""
    silent: Array
    """Time in which nothing was heard [s], shape (n,)."""
    seconds: Array
    """For how long each of k things was so, where that was long enough to count [s], shape (n, k)."""
    first: Array
    """When each first counted [s], shape (k,); infinity where it has not."""


class HeldTimes:
    """Seconds for which each of k things is so; they count, from its begin, once it was long enough.

    Args:
        hold: How long each must last to count [s], shape (k,).
    """

    def __init__(self, hold: ArrayLike) -> None:
        self._hold = np.asarray(hold, float) - _ROUNDING
        nothing = np.zeros_like(self._hold)
        self.t = math.nan
        """The last instant [s]."""
        self.on = nothing != 0.0
        """What is so from then on, shape (k,)."""
        self._since = nothing - np.inf
        self._so_far = Held(np.zeros(1), np.zeros(1), nothing[None], nothing + np.inf)

    def add(self, t: Array, on: Flags) -> Held:
        """What is so from each of some instants that follow on, in their order.

        Args:
            t: [s], shape (n,).
            on: Shape (n, k).
        """
        instants, so_far = np.append(self.t, number("the instant", t, unit="s")), self._so_far
        was, step = np.concatenate([self.on[None], on]), instants[1:] - instants[:-1]
        joined, silent = step <= GAP + _ROUNDING, step > GAP + _ROUNDING  # neither is the first one
        lasts = was[:-1] & joined[:, None]
        begins = np.where(on & ~lasts, t[:, None], -np.inf)
        since = np.maximum.accumulate(np.concatenate([self._since[None], begins]))
        after, before = (self._counts(each[:, None] - since[:-1]) for each in (t, instants[:-1]))
        grown = lasts & (after > before)
        terms = np.where(grown[:, None], np.stack([after, -before], axis=1), 0.0).reshape(-1, len(self.on))
        heard, quiet = (
            np.cumsum(np.append(begun[-1], np.where(where, step, 0.0)))
            for begun, where in ((so_far.heard, joined), (so_far.silent, silent))
        )
        seconds = np.cumsum(np.concatenate([so_far.seconds[-1:], terms]), axis=0)[::2]
        first = np.where(grown, t[:, None], np.inf).min(axis=0, initial=np.inf)
        self.t, self.on, self._since = float(instants[-1]), was[-1], since[-1]
        self._so_far = found = Held(heard, quiet, seconds, np.minimum(so_far.first, first))
        return Held(found.heard[1:], found.silent[1:], found.seconds[1:], found.first)

    def _counts(self, held: Array) -> Array:
        return np.where(held >= self._hold, held, 0.0)


_TURNS = ("trunk_twist", "trunk_side_bend")


class Points(NamedTuple):
    """Points so far, of n instants."""

    counted: Flags
    """Lines that have counted, shape (n, 18)."""
    lines: Array
    """Of each, shape (n, 18)."""
    turns: Array
    """Of trunk rotation and lateral bending, shape (n, 2)."""
    together: Array
    """Of all lines, shape (n,)."""

    @property
    def total(self) -> Array:
        """Points of section 1, far reach apart, shape (n,)."""
        most = float(published("eaws_posture")["asymmetry_sum_most"])
        return self.together + np.minimum(self.turns[:, 0] + self.turns[:, 1], most)

    def at(self, k: int) -> dict[str, float]:
        """By line that has counted, its points at one of the instants."""
        every = zip(lines(), self.counted[k].tolist(), self.lines[k].tolist(), strict=True)
        return {name: points for name, counted, points in every if counted}


class Screening:
    """Points of postures as time goes on, least and greatest.

    Args:
        cycle: Length of the cycle [s]; shares are of this, or of all that was heard when that is longer.
        hold: How long a posture is held to count [s].
        interpolation: Between the columns of the form.
    """

    def __init__(self, cycle: float, hold: float, interpolation: Interpolation) -> None:
        self._cycle, self._interpolation = cycle, interpolation
        self._hold = np.repeat([hold, 0.0], [2 * len(lines()), 2 * 3 * len(_TURNS)])
        """Of the lightest line, of every possible one, of turns at least and at most, column by column."""
        self._begin()

    def _begin(self) -> None:
        self._times = HeldTimes(self._hold)
        self._open = False
        """Whether some posture may have belonged to several lines."""

    def add(
        self, t: Array, possible: Flags, angles: Angles, accuracy: Accuracy
    ) -> tuple[Held, Points, Points]:
        """What was heard until each of n instants that follow [s], and the points of that.

        An earlier instant than before begins anew, the same adds nothing.

        Args:
            t: Shape (n,).
            possible: Lines of the postures, shape (n, 18).
            angles: Of the postures, shape (n,).
            accuracy: Of each angle [rad].
        """
        order, n = _lightest(), len(lines())
        least = order[possible[:, order].argmax(axis=1)][:, None] == np.arange(n)
        on = np.concatenate([least, possible, *_turned(Measured(angles, accuracy))], axis=1)
        if len(t) and t[0] < self._times.t:
            self._begin()
        if len(t) and t[0] == self._times.t:
            on[0] = self._times.on
        held = self._times.add(t, on)
        several = np.count_nonzero(on[:, n : 2 * n], axis=1) > 1
        several[:1] |= self._open
        open_ = np.logical_or.accumulate(several)
        self._open = self._open or bool(several.any())
        whole = np.maximum(self._cycle, held.heard)
        share = held.seconds / whole[:, None]
        turns = asymmetry_points(share[:, 2 * n :].reshape(-1, 2, len(_TURNS), 3))
        own = self._of_lines(share[:, :n])
        together = _summed(own[:, np.argsort(held.first[:n], kind="stable")])
        low = Points(share[:, :n] > 0.0, own, turns[:, 0], together)
        high = low._replace(turns=turns[:, 1])
        if self._open:
            # Which line a posture had may have changed, or stayed and been held, as no single guess of it is.
            may = share[:, n : 2 * n]
            shares = {_names()[k]: may[:, k] for k in np.flatnonzero(may.any(axis=0)).tolist()}
            most = most_points(shares, held.heard / whole) if shares else together
            together = np.where(open_, np.maximum(together, most), together)
            high = Points(may > 0.0, self._of_lines(may), turns[:, 1], together)
        return held, low, high

    def _of_lines(self, share: Array) -> Array:
        """Points of each line at its share of the time, shape (n, 18)."""
        points = np.zeros_like(share)
        for k in np.flatnonzero(share.any(axis=0)).tolist():
            points[:, k] = line_points(_names()[k], share[:, k], self._interpolation)
        return points


def _turned(measured: Measured) -> tuple[Flags, Flags]:
    """Angles of the form that rotation and bending of the trunk reach, at least and at most, shape (n, 6)."""
    edges = [math.radians(edge) for edge in published("eaws_posture")["asymmetry_from_deg"]]

    def passed(x: Array) -> NDArray[np.int64]:
        size = np.abs(x)
        return np.asarray(sum(reached(size, edge).astype(np.int64) for edge in edges))

    found = [measured.graded(name, passed, within=(0, len(edges))) for name in _TURNS]
    low, high = (
        np.concatenate([end[:, None] > np.arange(len(edges)) for end in ends], axis=1)
        for ends in zip(*found, strict=True)
    )
    return low, high


WHAT = "EAWS-style posture screening (sections 0-1 only)"
_BONES = ("lumbar", "thorax")


class EawsPhase(Phase, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What the lines ask and no posture shows; what is left out may be any line."""

    legs: Stance | None = None
    """How the legs are used; ``posture`` tells standing, crouching and kneeling apart."""
    back_supported: bool | None = None
    """The body or trunk is well supported: leaning, or a back rest."""


class EawsEntered(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Points that somebody with the form and the training entered."""

    moving_objects: Annotated[float, Meta(ge=0, le=15)] | None = None
    """0a: adverse effects by moving objects."""
    accessibility: Annotated[float, Meta(ge=0, le=10)] | None = None
    """0b: such as entering a vehicle."""
    impulses: Annotated[float, Meta(ge=0, le=40)] | None = None
    """0c: countershocks, impulses, vibrations."""
    joint_position: Annotated[float, Meta(ge=0, le=40)] | None = None
    """0d: especially of the wrist."""
    special: Annotated[float, Meta(ge=0, le=15)] | None = None
    """0e: other special situations."""
    far_reach: Annotated[float, Meta(ge=0, le=10)] | None = None
    """1: far reach, which is not seen in the posture."""
    forces: Annotated[float, Meta(ge=0, le=1000)] | None = None
    """2: action forces."""
    loads: Annotated[float, Meta(ge=0, le=1000)] | None = None
    """3: manual handling of materials."""
    upper_limbs: Annotated[float, Meta(ge=0, le=1000)] | None = None
    """4: upper limbs in repetitive tasks."""


OTHERS = ("forces", "loads", "upper_limbs")
"""Sections 2 to 4."""


class Screened(NamedTuple):
    """What the points of a cycle up to one instant were made from."""

    now: tuple[str, ...]
    """Lines that the posture of this instant may have, the lightest first."""
    pairs: tuple[tuple[str, float, float], ...]
    """Points of lines and turns by name, at least and at most."""
    counted: bool
    """Whether any line has."""
    ends: tuple[float, float]
    """Points with those that were entered, at least and at most."""
    missing: tuple[str, ...]
    """What nobody entered."""
    counting: bool
    """Whether the cycle is not whole."""
    heard: float
    """[s]"""
    silent: float
    """[s]"""


class EawsPosture(PostureRule, frozen=True, kw_only=True):
    """EAWS-style posture screening (sections 0-1 only); not the EAWS."""

    cycle: Period
    """Length of the cycle or task that shares of time are of [s]."""
    entered: EawsEntered = EawsEntered()
    """Points that are entered; what is left out is not assessed."""
    limit: Annotated[float, Meta(ge=0)] | None = None
    """Greatest admissible points; judged only when sections 2 to 4 are entered."""
    minimum_hold: Seconds = 4.0
    """A posture counts when it is held so long [s]; 0 counts all, as frequent dynamic postures need."""
    interpolation: Interpolation = Interpolation.LINEAR
    """What lies between the columns of the form; a choice."""
    phases: tuple[EawsPhase, ...] = ()
    """Phases of the task, each from its `start` on; without any, those of ``[[phases]]``."""
    thresholds: EawsThresholds = EawsThresholds()
    """Angles at which a posture belongs to a line."""

    def compute(self, model: Model) -> Compute:
        """Look up every name in the model once and return the function that computes the points."""
        read = bind_posture(model, self.human, self.unmeasured)
        phases = shared_phases(model, self.human, self.phases, EawsPhase.from_task)
        error = self.error(model)
        off: Accuracy = 0.0 if error is None else error
        screening = Screening(self.cycle, self.minimum_hold, self.interpolation)
        given = asdict(self.entered)
        missing = tuple(name.replace("_", " ") for name, value in given.items() if value is None)
        whole = sum(value or 0.0 for name, value in given.items() if name != "upper_limbs")
        limbs = given["upper_limbs"] or 0.0

        def compute(twin: Twin) -> Figure:
            every = read(twin)
            # Of many instants those count at which the person is heard; at one, nothing else is read.
            heard = np.atleast_1d(twin.invalid_source_reason(self.human) == "")
            angles, t = (every[heard, 0] if twin.many else every[None]), np.atleast_1d(twin.t)[heard]
            possible = np.empty((len(t), len(lines())), bool)
            for phase, where in phases_of(phases, t, EawsPhase()):
                possible[where] = possible_lines(
                    angles if where.all() else angles[where],
                    legs=phase.legs,
                    supported=phase.back_supported,
                    thresholds=self.thresholds,
                    accuracy=off,
                )
            held, least, most = screening.add(t, possible, angles, off)
            low, high = (np.maximum(points.total + whole, limbs) for points in (least, most))
            known = high - low < 1e-9
            rests = (bool(missing) | (held.silent > 0)) & (self.limit is not None)
            # Points of a cycle only grow until it is whole: what is too much already stays so.
            counting = held.heard < self.cycle - 1e-6
            exceeds = low > (math.inf if self.limit is None else admitted(self.limit))
            value, nothing = np.where(known, low, np.nan), counting & ~exceeds & ~rests
            if twin.many:
                high = np.where(known, low, high)
                value, low, high = (_spread(x, heard, np.nan) for x in (value, low, high))
                nothing, rests = (_spread(x, heard, False) for x in (nothing, rests))
                return Figure(value, self.limit, interval=(low, high), nothing=nothing, undecided=rests)
            ends = float(low[0]), float(high[0])
            return Figure(
                ends[0] if known[0] else None,
                self.limit,
                interval=None if known[0] else ends,
                nothing=bool(nothing[0]),
                undecided=bool(rests[0]),
                beside=Screened(
                    lightest_first(possible[0]),
                    tuple(_pairs(least, most)),
                    bool(least.counted[0].any()),
                    ends,
                    missing,
                    bool(counting[0]),
                    float(held.heard[0]),
                    float(held.silent[0]),
                ),
            )

        return compute

    def present(self, model: Model) -> Present:
        """Return the function that says and colours which lines hold."""
        return lambda state, figure, verdict: self._shown(figure, verdict)

    def one_by_one(self, model: Model) -> str:
        """Nothing: shares of time are counted of many instants as of one, in their order."""
        return ""

    def remembers(self, model: Model) -> bool:
        """Say that what was held before counts."""
        return True

    def _shown(self, figure: Figure, verdict: Verdict | None) -> Shown:
        found = cast("Screened", figure.beside)
        ends, missing = found.ends, found.missing
        known = figure.value is not None
        reasons = [f"{WHAT}, no rating: lower bound" if missing else "with entered sections 2-4"]
        if missing:
            reasons.append(f"not entered: {', '.join(missing)}")
        if found.silent > 0:
            coverage = found.heard / (found.heard + found.silent)
            reasons.append(f"coverage {100 * coverage:.1f} %: {found.silent:.1f} s not heard")
        if not known:
            between = figures.ends(*ends)
            reasons.append(f"the points lie between {between[0]} and {between[1]}")
        if found.counting:
            reasons.append(f"counting: {found.heard:.1f} of {self.cycle:g} s, judged after a whole cycle")
        if known and not missing and not found.counting and found.silent == 0:
            reasons.append(_rating(ends[0]))
        if verdict in (Verdict.WITHIN, Verdict.EXCEEDED):
            reasons.append("by figures of one public code and of memory, not verified (1 + M)")
        best = lines()[found.now[-1]]
        several = len(found.now) > 1
        reasons.append(f"now line {' or '.join(found.now)}" + ("" if several else f": {best.name}"))
        return Shown(
            "; ".join(reasons),
            lambda: (
                tuple(Highlight(body=f"{self.human}/{bone}", verdict=verdict) for bone in _BONES)
                if found.counted
                else ()
            ),
            parts=tuple(
                Result(name=name, value=a if abs(a - b) < 1e-9 else None, interval=None if a == b else (a, b))
                for name, a, b in found.pairs
            ),
            rows=(
                total_row("", ends, None, (0.0, 100.0), self.limit, verdict),
                *(self._row(name, a, b) for name, a, b in found.pairs),
            ),
        )

    def _row(self, name: str, low: float, high: float) -> Row:
        known = abs(high - low) < 1e-9
        key = name.removeprefix("line ")
        line = lines().get(key)
        most = published_most() if line is None else line.points[-1]
        return Row(
            name=name if line is None else f"{name}: {line.name}",
            group="section 1",
            state=RowState.JUDGED if known else RowState.NOT_ASSESSED,
            value=low if known else None,
            scale=(0.0, most),
            interval=None if known else (low, high),
            bones=tuple(f"{self.human}/{bone}" for bone in _BONES),
        )

    def basis(self, model: Model) -> Basis:
        """State the formula, its source, the inputs with their origin, and what is not modelled."""
        phases = shared_phases(model, self.human, self.phases, EawsPhase.from_task)
        return Basis(
            formula="points of each posture line at its share of the cycle, trunk rotation and lateral "
            "bending, and what was entered",
            source=f"{WHAT}: one public code and memory of the form (1 + M); the form v1.3.6, first page, "
            "for section 0 (1)",
            inputs=(
                *provenance.motion(model, self.human),
                *entered(phases, EawsPhase()),
                provenance.given("cycle", self.cycle, "s"),
                Input(
                    name="a posture counts from",
                    value=self.minimum_hold,
                    unit="s",
                    origin=Origin.STATED if self.minimum_hold == 4 else Origin.GIVEN,
                    source="static from 4 s on (1 + M); option minimum_hold",
                ),
                Input(
                    name="between columns",
                    value=Interpolation(self.interpolation).value,
                    origin=Origin.CHOICE,
                    source="option interpolation",
                ),
                Input(
                    name="line 14",
                    value="row from memory",
                    origin=Origin.CHOICE,
                    source="conflict: the one public code copies line 5, which would make kneeling with "
                    "raised arms cheaper than kneeling bent",
                ),
                *(
                    Input(
                        name=f"entered {name.replace('_', ' ')}",
                        value=value,
                        origin=Origin.MISSING if value is None else Origin.GIVEN,
                        source="option entered",
                    )
                    for name, value in asdict(self.entered).items()
                ),
                *chosen(self.thresholds, EawsThresholds()),
                *posture_quality(self.accuracy, self.joint_accuracy, self.unmeasured, model, self.human),
                *(() if self.limit is None else provenance.limit(self.limit, "")),
            ),
            not_modelled=(
                "sections 2 to 4: action forces, handling of loads, upper limbs; they are entered or missing",
                "far reach, and frequent dynamic postures shorter than the minimum hold",
                "with an accuracy or unknown support the least points are an estimate: those of the lightest "
                "line of each instant",
                "lying counts as line 15 whatever the arms do: the form has no other line for it",
            ),
        )


def published_most() -> float:
    """Most points of trunk rotation, and of lateral bending."""
    return float(published("eaws_posture")["asymmetry_most"])


def _pairs(low: Points, high: Points) -> list[tuple[str, float, float]]:
    """Points of the first instant by name, at least and at most."""
    least, most = low.at(0), high.at(0)
    names = [name for name in lines() if name in least or name in most]
    return [
        *((f"line {name}", least.get(name, 0.0), most.get(name, 0.0)) for name in names),
        *zip(
            ("trunk rotation", "lateral bending"), low.turns[0].tolist(), high.turns[0].tolist(), strict=True
        ),
    ]


def _spread(values: NDArray[Any], heard: Flags, otherwise: float | bool) -> NDArray[Any]:
    """Values of the instants at which somebody is heard, among all, shape (N,)."""
    found = np.full(len(heard), otherwise)
    found[heard] = values
    return found


def _rating(points: float) -> str:
    band = "0 to 25" if points <= 25 else "above 25, up to 50" if points <= 50 else "above 50"
    return f"{figures.rounded_up(points)} points: {band}"
