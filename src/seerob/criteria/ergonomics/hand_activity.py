r"""Hand activity and peak force against the limits of the ACGIH TLV for hand activity of 2018.

The activity from frequency and share of time after Radwin et al. 2015:
:math:`HAL = 6.56 \ln D \, F^{1.31} / (1 + 3.18 F^{1.31})`, D in percent and F in Hz. The lines in force over
activity: :math:`0.56 (10 - HAL)` for the TLV, :math:`3.6 - 0.56 HAL` for the action limit.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal, NamedTuple

import numpy as np
from msgspec import Meta
from numpy.typing import ArrayLike

from seerob.core.domains import number
from seerob.core.snapshot import Basis, Input, Level, Origin, Result
from seerob.core.transforms import Array
from seerob.criteria.figure import Figure, Shown, verdict_of
from seerob.criteria.scoring.entered import EnteredMethod
from seerob.criteria.scoring.exertions import HandWork, exertion_inputs, hand_work, hours_input
from seerob.description.humans.skeleton import SIDES
from seerob.model.model import Model
from seerob.model.provenance import given

LONGEST = 8 * 3600.0
"""For longer days the TLV says nothing [s]."""
SPREAD = 1.96 * math.sqrt(1.28)
"""How far the equation is off in 95 % of cases: 1.96 times the root mean square error on observations of
others (Akkas et al. 2015), as of errors that are normal."""
LIGHT = 1.0
"""Exertions of less than a tenth of the strength are not counted."""
ZERO = {"tlv": 5.6, "action_limit": 3.6}
"""Force at no activity [0 to 10] of each line."""


def activity(share: ArrayLike, per_second: ArrayLike) -> Array:
    """HAL, 0 to 10, of the share of time with exertions and of their frequency.

    Args:
        share: Time with exertions over all time, 0 to 1, any shape.
        per_second: Exertions [Hz], of the same shape.
    """
    D, F = number("share", share, 0.0, 1.0), number("per_second", per_second, 0.0, unit="Hz") ** 1.31
    return np.minimum(6.56 * np.log(np.maximum(100 * D, 1.0)) * F / (1 + 3.18 * F), 10.0)


def force_at(hal: ArrayLike, at_no_activity: float) -> Array:
    """Force of a line at an activity, 0 to 10; 0 where the line has ended.

    Args:
        hal: 0 to 10, any shape.
        at_no_activity: Force at an activity of 0.
    """
    start = number("at_no_activity", at_no_activity, 0.0, 10.0)
    return np.maximum(start - 0.56 * number("hal", hal, 0.0, 10.0), 0.0)


def _share_of_line(force: float, line: float) -> float:
    if force == 0:
        return 0.0
    return force / line if line > 0 else math.inf


class Hand(NamedTuple):
    """One hand's place beside the line."""

    force: float
    hal: tuple[float, float, float]
    """Its activity, 0 to 10: computed, least and greatest."""
    share: tuple[float, float, float]
    """Its force over that of the line: computed, least and greatest."""


class HandActivity(EnteredMethod, frozen=True, kw_only=True):
    """Force of the worse hand over what the ACGIH TLV or action limit for hand activity admits (2018)."""

    line: Literal["tlv", "action_limit"]
    """Which line: the TLV, or the action limit below it."""
    daily: Annotated[float, Meta(gt=0, le=86400, extra={"unit": "s"})] | None = None
    """How long the task is done per day [s]; the lines are of 4 to 8 h, a shorter day is judged as 4 h."""
    activity: Annotated[float, Meta(ge=0, le=10)] | None = None
    """Hand activity level, 0 to 10, as a trained observer rates it; of the exertions when not given."""
    limit: Annotated[float, Meta(gt=0)] | None = None
    """Greatest admissible share of the line's force; 1 is the line."""

    @property
    def levels(self) -> tuple[Level, ...]:
        """Up to the line, and beyond it."""
        return (Level(up_to=1, name=f"up to the {self.line.replace('_', ' ')}"),)

    def figure(self, model: Model) -> Figure:
        """The share of what is entered.

        Raises:
            InputError: Exertions last longer than their phase.
        """
        _, work = hand_work(model, self.human, self.name)
        return self._figure(work)

    def _figure(self, work: HandWork) -> Figure:
        absent = work.missing if self.daily is not None else (*work.missing, "daily (the time per day)")
        if absent:
            return Figure(None, self.limit, undecided=True, beside=Shown(f"not entered: {', '.join(absent)}"))
        assert self.daily is not None
        hands = [self._hand(work, side) for side in range(2)]
        worst = max(hands, key=lambda hand: hand.share[2])
        outside = self.daily > LONGEST
        value, low, high = (max(hand.share[k] for hand in hands) for k in range(3))
        parts = []
        for name, hand in zip(SIDES, hands, strict=True):
            own = self._of(hand.share, outside)
            parts.append(
                Result(
                    name=f"{name} hand",
                    value=hand.share[0] if math.isfinite(hand.share[0]) else None,
                    limit=self.limit,
                    interval=hand.share[1:] if own.interval and math.isfinite(hand.share[2]) else None,
                    verdict=verdict_of(own, at_most=True),
                    reason=f"force {hand.force:g} at an activity of {hand.hal[0]:.2f}",
                    nothing=self.limit is None and not math.isfinite(hand.share[0]),
                )
            )
        said = (
            f"force {worst.force:g} at an activity of {worst.hal[0]:.2f}, where the line admits "
            f"{float(force_at(worst.hal[0], ZERO[self.line])):.2f}"
        )
        if outside:
            said += f"; the lines are of up to 8 h a day, not of {self.daily / 3600:g} h"
        figure = self._of((value, low, high), outside)
        return Figure(
            figure.value, self.limit, interval=figure.interval, open=figure.open,
            beside=Shown(said, parts=tuple(parts)),
        )  # fmt: skip

    def _of(self, share: tuple[float, float, float], outside: bool) -> Figure:
        value, low, high = share
        unknown = math.isinf(value) and self.limit is None
        exact = low == high
        return Figure(
            None if unknown else value, self.limit, interval=None if exact else (low, high), open=outside
        )

    def _hand(self, work: HandWork, side: int) -> Hand:
        """A hand's force and activity: all that counts of what it does in a cycle."""
        counted = [each for each in work.of(side) if each.force >= LIGHT]
        force = max((each.force for each in work.of(side)), default=0.0)
        hal = (0.0, 0.0, 0.0)
        if self.activity is not None:
            hal = (self.activity,) * 3
        elif counted:
            rate = sum(each.per_minute for each in counted) / 60
            busy = sum(each.per_minute * each.time for each in counted) / 60
            found = float(activity(min(busy, 1.0), rate))
            hal = (found, max(found - SPREAD, 0.0), min(found + SPREAD, 10.0))
        shares = [_share_of_line(force, float(force_at(each, ZERO[self.line]))) for each in hal]
        return Hand(force, hal, (shares[0], shares[1], shares[2]))

    def basis(self, model: Model) -> Basis:
        """State the formula, its source, the inputs with their origin, and what is not modelled."""
        phases, _ = hand_work(model, self.human, self.name)
        rated = (
            Input(
                name="spread of the computed activity",
                value=SPREAD,
                origin=Origin.STATED,
                source="95 % of mean square error 1.28 on observations of others, Akkas et al. 2015",
            )
            if self.activity is None
            else given("activity", self.activity, "")
        )
        return Basis(
            formula="force over 0.56 · (10 - HAL), the TLV, or over 3.6 - 0.56 · HAL, the action limit; "
            "HAL = 6.56 ln D · F^1.31/(1 + 3.18 F^1.31)",
            source="ACGIH, TLV for hand activity, 2018, trademark of the ACGIH (the lines as one public "
            "implementation has them and from memory, 1); Radwin et al., Ergonomics 58(2), 2015, 173-183 "
            "(as two public abstracts have the equation, 2+)",
            inputs=(
                *exertion_inputs(phases, wrist=False),
                hours_input(self.daily),
                rated,
                *(() if self.limit is None else (given("limit", self.limit, ""),)),
            ),
            not_modelled=(
                "the twin's motion: exertions are those of the phases",
                "posture of wrist and forearm, contact stress and vibration, left to judgement by the TLV",
                "exertions below a tenth of the strength, which the TLV does not count",
            ),
        )
