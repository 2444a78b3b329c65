"""OCRA checklist of Colombini and Occhipinti, edition of June 2006: repetitive work of the upper limbs.

Points for recovery, frequency, force, posture and additional factors are added for each arm and multiplied by
a factor of the time per day. Answers that lie between two rows of the checklist count as the worse one.
"""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta, Struct
from msgspec.structs import asdict

from seerob.core.domains import number
from seerob.core.snapshot import Basis, Input, Level, Origin, Result
from seerob.criteria.figure import Figure, Shown, verdict_of
from seerob.criteria.scoring.entered import EnteredMethod
from seerob.criteria.scoring.spans import published
from seerob.description.humans.skeleton import SIDES
from seerob.model.model import Model
from seerob.model.provenance import given, limit

Share = Annotated[float, Meta(ge=0, le=1)]
_ROUNDING = 1e-9


class OcraArm(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What one arm does in the repetitive task; shares are of the cycle, 0 to 1."""

    actions: Annotated[float, Meta(ge=0)] | None = None
    """Technical actions per minute."""
    interruptions: bool | None = None
    """Short interruptions are possible; asked where there are more than 30 actions per minute."""
    static_grip: Share | None = None
    """Share of time in which an object is held for 5 s or longer."""
    moderate_force: Share | None = None
    """Share of time with a force of 3 or 4 on Borg's CR-10 scale."""
    strong_force: Share | None = None
    """Share of time with a force of 5 to 7."""
    greatest_force: Share | None = None
    """Share of time with a force of 8 or more."""
    shoulder: Share | None = None
    """Share of time with the arm, not supported, at about the height of the shoulder."""
    arm_off_support: Share | None = None
    """Share of time with the arm, not supported, raised less than that."""
    elbow: Share | None = None
    """Share of time with wide or jerky bending or turning of the forearm."""
    wrist: Share | None = None
    """Share of time with the wrist bent to its ends."""
    hand: Share | None = None
    """Share of time in which the hand pinches, hooks or grips with the palm."""
    same_gestures: Share | None = None
    """Share of time with the same gestures of shoulder, elbow, wrist or hand."""

    def missing(self) -> tuple[str, ...]:
        """What nobody entered."""
        absent = [name for name, value in asdict(self).items() if value is None and name != "interruptions"]
        if self.interruptions is None and (self.actions or 0.0) > 30:
            absent.append("interruptions")
        return tuple(absent)


def points(arm: OcraArm) -> dict[str, float]:
    """Points of an arm of which nothing is missing: frequency, force and posture."""
    table, given_ = published("ocra_checklist"), asdict(arm)

    def of(name: str) -> float:
        return reached(float(given_[name]), table[name])

    dynamic = of("actions")
    if dynamic == 3 and not arm.interruptions:
        dynamic = 4.0
    force = of("moderate_force") + of("strong_force") + of("greatest_force")
    joints = max(of("shoulder"), of("arm_off_support"), of("elbow"), of("wrist"), of("hand"))
    return {
        "frequency": max(dynamic, of("static_grip")),
        "force": force,
        "posture": joints + of("same_gestures"),
    }


def reached(value: float, rows: list[list[float]]) -> float:
    """Points of the first row that reaches up to a value; those of the last one beyond all.

    Args:
        value: What was entered, in the unit of the rows.
        rows: Largest value and points of each row, both rising.
    """
    number("value", value, 0.0)
    return next((row[1] for row in rows if value <= row[0] + _ROUNDING), rows[-1][1])


def time_factor(daily: float) -> float:
    """Factor of the time per day of repetitive work [s], up to 24 h."""
    minutes = float(number("daily", daily, 0.0, 86400.0, "s")) / 60
    return reached(minutes, published("ocra_checklist")["minutes"])


class OcraChecklist(EnteredMethod, frozen=True, kw_only=True):
    """Score of the OCRA checklist (2006) of the worse arm; what it asks is entered."""

    right: OcraArm = OcraArm()
    """What the right arm does."""
    left: OcraArm = OcraArm()
    """What the left arm does."""
    daily: Annotated[float, Meta(gt=0, le=86400, extra={"unit": "s"})] | None = None
    """Repetitive work per day without pauses [s]."""
    recovery: Annotated[float, Meta(ge=0, le=10)] | None = None
    """Points for pauses: 0 with one of 8 to 10 min in each hour, 10 with none in 7 to 8 h; see below."""
    physical: Literal[0, 2, 3] | None = None
    """Points for vibration, gloves, impacts, cold, precision: none, most of the time, nearly all of it."""
    pace: Literal[0, 1, 2] | None = None
    """Points for the pace: one's own, the machine's with a buffer, the machine's."""
    limit: Annotated[float, Meta(gt=0)] | None = None
    """Greatest admissible score; up to 7.5 is acceptable, from 11.1 on a risk."""

    @property
    def levels(self) -> tuple[Level, ...]:
        """Bands of the checklist, the lowest first."""
        table = published("ocra_checklist")
        return tuple(Level(up_to=top, name=name) for top, name in table["bands"])

    def figure(self, model: Model) -> Figure:
        """The score of what is entered."""
        return self._figure()

    def _missing(self) -> list[str]:
        own = [name for name in ("daily", "recovery", "physical", "pace") if getattr(self, name) is None]
        arms = [f"{side}.{what}" for side in SIDES for what in getattr(self, side).missing()]
        return own + arms

    def _figure(self) -> Figure:
        if absent := self._missing():
            return Figure(None, self.limit, undecided=True, beside=Shown(f"not entered: {', '.join(absent)}"))
        assert self.daily is not None
        assert self.recovery is not None
        assert self.physical is not None
        assert self.pace is not None
        factor, parts = time_factor(self.daily), []
        shared = {"recovery": float(self.recovery), "additional factors": float(self.physical + self.pace)}
        for side in SIDES:
            rows = {**points(getattr(self, side)), **shared}
            score = factor * sum(rows.values())
            text = ", ".join(f"{name} {row:g}" for name, row in rows.items())
            parts.append(
                Result(
                    name=f"{side} arm",
                    value=score,
                    limit=self.limit,
                    verdict=verdict_of(Figure(score, self.limit), at_most=True),
                    reason=f"{text}; times {factor:g}",
                )
            )
        worst = max(parts, key=lambda part: part.value or 0.0)
        return Figure(
            worst.value, self.limit, beside=Shown(f"{worst.name}: {worst.reason}", parts=tuple(parts))
        )

    def basis(self, model: Model) -> Basis:
        """State the formula, its source, the inputs with their origin, and what is not modelled."""
        answers = {name: getattr(self, name) for name in ("daily", "recovery", "physical", "pace")}
        answers |= {f"{side}.{k}": v for side in SIDES for k, v in asdict(getattr(self, side)).items()}
        found = [
            Input(name=name.replace("_", " "), origin=Origin.MISSING, source="not entered")
            if value is None
            else given(name.replace("_", " "), float(value), "s" if name == "daily" else "")
            for name, value in answers.items()
        ]
        return Basis(
            formula="(recovery + frequency + force + posture + additional factors) · factor of the time",
            source="Colombini, Occhipinti, OCRA checklist, June 2006 (EPM): as two public implementations "
            "have it (2+); rows of shoulder, moderate force and static grip as one has them and as we "
            "remember the form (1)",
            inputs=(*found, *limit(self.limit, "")),
            not_modelled=(
                "the twin's motion: shares of time are those of the workstation file",
                "answers between two rows count as the worse one, a choice: points between are admitted",
                "the recovery multiplier of later editions",
            ),
        )
