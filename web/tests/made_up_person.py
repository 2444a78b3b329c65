"""Made-up contacts, scores and sensors for the page's tests: everything is a function of run time."""

from __future__ import annotations

import math

from seerob.core.snapshot import (
    Aspect,
    Basis,
    CriterionInfo,
    Input,
    Origin,
    Polyline,
    Prism,
    Rays,
    Result,
    Row,
    RowState,
    Verdict,
)

CONTACTS = Basis(
    formula="v = min(F/√(μk), pA/√(μk), √(2E/μ))",
    source="ISO/TS 15066:2016 Annex A",
    inputs=(
        Input(
            name="Hands and fingers: F_s",
            value=140.0,
            unit="N",
            origin=Origin.STATED,
            source="Table A.2 (2S)",
        ),
        Input(
            name="Hands and fingers: p_s Back of the hand (dominant)",
            value=2e6,
            unit="Pa",
            origin=Origin.STATED,
            source="Table A.2 (2S)",
        ),
    ),
    not_modelled=("larynx, eyes, ears and feet have no row in the table",),
)
RULA = Basis(formula="RULA tables A, B and C", source="McAtamney and Corlett 1993")

# area, name, region, permissible speed [m/s]; None where the contact area is not known
AREAS = (
    (8, "Sternum", "Chest", 0.9),
    (9, "Pectoral muscle", "Chest", 0.6),
    (14, "Radial bone", "Lower arms and wrist joints", None),
    (15, "Forearm muscle", "Lower arms and wrist joints", 0.5),
    (24, "Back of the hand (dominant)", "Hands and fingers", 0.5),
)


def criteria() -> tuple[CriterionInfo, ...]:
    """What this file adds to the workstation."""
    return (
        CriterionInfo(
            name="scanner",
            kind="scanner_field",
            group="safety",
            title="What a scanner sees.",
            unit="m",
        ),
        CriterionInfo(
            name="contacts",
            kind="power_and_force",
            group="safety",
            title="Power and force limiting.",
            subjects=("ur10", "operator"),
            unit="m/s",
            basis=CONTACTS,
        ),
        CriterionInfo(
            name="posture score",
            kind="rula",
            group="ergonomics",
            title="RULA grand score.",
            subjects=("operator",),
            limit=4.0,
            basis=RULA,
        ),
    )


def results(t: float, speed: float, apart: float) -> tuple[Result, ...]:
    """Results at run time ``t`` [s], with a tool at ``speed`` [m/s], ``apart`` [m] from the hand."""
    return _scanner(), _contacts(t, speed, apart), _score(t)


def _scanner() -> Result:
    beams = [math.radians(a) for a in range(-60, 61, 5)]
    return Result(
        name="scanner",
        value=1.0,
        unit="m",
        markers=(
            Polyline(
                points=((1.0, -0.8, 0.02), (1.8, -0.8, 0.02), (1.8, 0.6, 0.02), (1.0, 0.6, 0.02)), closed=True
            ),
            # Concave: the notch from (−1.2, −0.4) inwards is not part of it.
            Prism(
                outline=((-1.6, -1.0), (-0.8, -1.0), (-0.8, 0.2), (-1.2, -0.4), (-1.6, 0.2)),
                lower=0.0,
                upper=0.5,
                verdict=Verdict.WITHIN,
            ),
            Rays(
                starts=((2.4, 0.0, 0.2),),
                ends=tuple((2.4 - 0.9 * math.cos(a), 0.9 * math.sin(a), 0.2) for a in beams),
                hits=(11, 12, 13),
                filled=True,
                verdict=Verdict.EXCEEDED,
            ),
        ),
    )


UNHEARD = (10.5, 11.0)
"""When nobody knows who can be hit [s]."""


def _contacts(t: float, speed: float, apart: float) -> Result:
    if UNHEARD[0] <= t < UNHEARD[1]:
        why = f"ur10: not heard for {t - 10.2:.2f} s (time-out 0.2 s)"
        return Result(name="contacts", unit="m/s", limit=0.5, verdict=Verdict.UNDECIDED, reason=why)
    if apart > 1.1:
        return Result(name="contacts", unit="m/s", reason="nobody within 1.1 m of a moving part")
    rows = [_row(area, speed) for area in AREAS]
    rows.append(
        Row(
            name="Middle of forehead",
            group="Skull and forehead",
            state=RowState.FORBIDDEN,
            value=speed,
            unit="m/s",
            verdict=Verdict.UNDECIDED,
            reason="contact not permitted, and whether it can occur is open",
            areas=(1,),
        )
    )
    rows.append(
        Row(
            name="Feet",
            group="Feet",
            state=RowState.NO_LIMIT,
            value=speed,
            unit="m/s",
            verdict=Verdict.UNDECIDED,
            reason="no limit available",
        )
    )
    over = speed > 0.5
    return Result(
        name="contacts",
        value=speed,
        unit="m/s",
        limit=0.5,
        verdict=Verdict.EXCEEDED if over else Verdict.UNDECIDED,
        reason="Hands and fingers: force, free, wrist_3_link",
        rows=tuple(rows),
    )


def _row(area: tuple[int, str, str, float | None], speed: float) -> Row:
    number, name, region, allowed = area
    limit = 0.7 if allowed is None else allowed
    open_ = Verdict.UNDECIDED if allowed is None else Verdict.WITHIN
    side = "right" if "dominant" in name or region.startswith("Lower arms") else ""
    bones = {"Chest": "torso", "Hands and fingers": "right hand"}.get(region, "right forearm")
    return Row(
        name=name,
        group=region,
        side=side,
        value=speed,
        unit="m/s",
        limit=limit,
        verdict=Verdict.EXCEEDED if speed > limit else open_,
        reason="force, free, ur10/wrist_3_link",
        areas=(number,),
        bones=(f"operator/{bones}",),
        aspects=(
            Aspect(name="contact", band="free"),
            Aspect(name="allowed by force", value=limit, unit="m/s"),
            Aspect(name="allowed by pressure", value=None if allowed is None else 2 * limit, unit="m/s"),
            Aspect(name="allowed by energy", value=1.5 * limit, unit="m/s"),
        ),
        inputs=(f"{region}: F_s", f"{region}: p_s {name}"),
    )


def score_at(t: float) -> float:
    """Score of the right side at run time ``t`` [s]: 7 from 5 s to 6 s, 5 from 2 s to 3 s, else 3."""
    return 7.0 if 5.0 <= t < 6.0 else 5.0 if 2.0 <= t < 3.0 else 3.0


def _score(t: float) -> Result:
    right, left = score_at(t), 3.0
    verdict = Verdict.EXCEEDED if right > 4 else Verdict.WITHIN
    scale = (1.0, 7.0)
    arm = 5.0 if right == 7.0 else 2.0
    flexion = Aspect(name="shoulder flexion", value=math.radians(20 * arm), unit="rad", band="20° to 45°")
    return Result(
        name="posture score",
        value=right,
        limit=4.0,
        verdict=verdict,
        reason=f"right side: upper arm {arm:.0f}",
        rows=(
            Row(name="score", side="left", value=left, scale=scale, bones=("operator/left forearm",)),
            Row(name="score", side="right", value=right, scale=scale, bones=("operator/torso",)),
            Row(
                name="upper arm",
                side="left",
                value=1.0,
                scale=(1.0, 6.0),
                bones=("operator/left upper arm",),
                aspects=(Aspect(name="shoulder flexion", value=0.1, unit="rad", band="−20° to 20°"),),
            ),
            Row(
                name="upper arm",
                side="right",
                value=arm,
                scale=(1.0, 6.0),
                bones=("operator/right upper arm",),
                aspects=(flexion,),
            ),
            Row(name="neck", value=2.0, scale=(1.0, 6.0), bones=("operator/head",)),
            Row(
                name="wrist",
                side="right",
                state=RowState.NOT_ASSESSED,
                scale=(1.0, 4.0),
                bones=("operator/right hand",),
                aspects=(Aspect(name="wrist flexion", unit="rad"),),
            ),
        ),
    )
