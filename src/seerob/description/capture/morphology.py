r"""Bone lengths of a recorded person, with their spread, and the description of a person that has them.

A length is the distance of two joint centres in every frame in which both are seen well; its value is the
median over the frames and over both sides, its spread 1.4826 times the median absolute deviation, both of
which a tenth of wrong frames hardly moves (Hampel et al. 1986). Whoever does not state the stature gets the
one whose tables fit the measured chain best: the measured lengths over their share of the stature.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from seerob.core.errors import InputError
from seerob.core.snapshot import Finding
from seerob.core.transforms import Array
from seerob.description.capture.captured import CaptureFrame
from seerob.description.capture.observing import Observer
from seerob.description.humans.anthropometry import CHAIN, STATURE_RANGE, body
from seerob.description.humans.skeleton import SIDES

FEWEST = 30
"""Frames that a length needs."""
SURE = 0.5
"""Confidence that counts as seen well."""
SPREAD = 0.1
"""A spread above this share of a length is told as a warning."""
LOW_NECK = 0.02
"""The base of the neck is not so far below the shoulders [m], whose height it has."""
DEVIATION = 1.4826
"""Standard deviation of a normal distribution over its median absolute deviation."""
BETWEEN: dict[str, tuple[str, str]] = {
    "thigh": ("{side}_thigh", "{side}_shank"),
    "shank": ("{side}_shank", "{side}_foot"),
    "upper_arm": ("{side}_upper_arm", "{side}_forearm"),
    "forearm": ("{side}_forearm", "{side}_hand"),
}
"""Length → bones at whose proximal joints it begins and ends."""
TRUNK = ("pelvis", "lumbar", "thorax")
"""Scaled together, from the middle of the hips to the base of the neck: devices place joints of the spine
as they like."""


class Percentile(StrEnum):
    """Percentile of a length over the frames."""

    P5 = "P5"
    P50 = "P50"
    P95 = "P95"


@dataclass(frozen=True)
class Length:
    """One measured length."""

    value: float
    """Median [m]."""
    spread: float
    """Robust standard deviation over the frames [m]."""
    percentiles: dict[str, float]
    """``P5``, ``P50``, ``P95`` over the frames [m]."""
    frames: int
    """Both sides counted."""
    sides: float
    """Difference of both sides' medians [m]; NaN when only one is seen."""


@dataclass(frozen=True, eq=False)
class Morphology:
    """A person as it was measured."""

    stature: float
    """[m]"""
    stature_given: bool
    lengths: dict[str, float]
    """For `manikin.build` (``own_lengths``) [m]; the chain closes at the stature."""
    measured: dict[str, Length]
    """By name, ``trunk`` and ``shoulders`` among them."""
    findings: tuple[Finding, ...]


def measure(
    frames: Iterable[CaptureFrame],
    observer: Observer,
    *,
    name: str,
    sex: str,
    mass: float,
    stature: float | None = None,
    lengths: str = "drillis",
) -> Morphology:
    """Measure a person.

    Args:
        frames: Of a recording; the more and the more varied, the better.
        observer: Rows bound to bones; only those that are joint centres count.
        name: Of the person, for findings.
        sex: ``male`` or ``female``.
        mass: Body mass [kg].
        stature: [m]; estimated from the lengths when not given.
        lengths: Tables for what is not measured.

    Raises:
        InputError: No length could be measured, or the person is no plausible adult.
    """
    seen = _joint_centres(frames, observer)
    measured: dict[str, Length] = {}
    for key, ends in BETWEEN.items():
        found = _length([_distances(seen, *(end.format(side=side) for end in ends)) for side in SIDES])
        if found is not None:
            measured[key] = found
    low: tuple[Finding, ...] = ()
    hips, shoulders = (_pair(seen, bone) for bone in ("thigh", "upper_arm"))
    for key, values in (("hip_centres", _across(hips)), ("shoulders", _across(shoulders))):
        if (found := _length([values])) is not None:
            measured[key] = found
    if hips is not None and "neck" in seen:
        middle = 0.5 * (hips[0] + hips[1])
        if shoulders is not None and (below := _below(seen["neck"], middle, shoulders)) > LOW_NECK:
            text = (
                f"trunk not measured: the joint of the neck is {1e3 * below:.0f} mm below the shoulders, not "
                "at the base of the neck"
            )
            low = (Finding(level="assumed", subject=name, text=text),)
        elif (found := _length([np.linalg.norm(seen["neck"] - middle, axis=1)])) is not None:
            measured["trunk"] = found
    if not measured:
        what = f"no bone is seen well from both ends in {FEWEST} frames"
        if not seen:
            what = "no joint centres are seen but points on the skin, between which no bone's length lies"
        raise InputError.at(name, "morphology", what, "give a longer recording of joint centres")
    tall = stature if stature is not None else _stature(measured, sex, mass, lengths, name)
    usual = body(name=name, stature=tall, mass=mass, sex=sex, lengths=lengths).length
    own = {key: each.value for key, each in measured.items() if key not in ("trunk", "shoulders")}
    if "shoulders" in measured:
        own["half_shoulders"] = measured["shoulders"].value / 2
    if "trunk" in measured:
        scale = measured["trunk"].value / sum(usual[key] for key in TRUNK)
        own |= {key: usual[key] * scale for key in TRUNK}
    body(name=name, stature=tall, mass=mass, sex=sex, lengths=lengths, own_lengths=own)  # may refuse
    told = (*_length_findings(measured, tall, stature, name), *low)
    return Morphology(tall, stature is not None, own, measured, told)


def _below(neck: Array, hips: Array, shoulders: tuple[Array, Array]) -> float:
    """How far a joint mostly is below the shoulders, along the trunk [m]; 0 when nobody knows."""
    way = 0.5 * (shoulders[0] + shoulders[1]) - hips
    with np.errstate(invalid="ignore"):
        length = np.linalg.norm(way, axis=1)
        below = length - ((neck - hips) * way).sum(axis=1) / length
    below = below[np.isfinite(below)]
    return float(np.median(below)) if len(below) else 0.0


def _joint_centres(frames: Iterable[CaptureFrame], observer: Observer) -> dict[str, Array]:
    """Bone → its proximal joint in every frame [m], (n, 3); NaN where it is not seen well."""
    rows = {row.bone: row.index for row in observer.rows if row.position > 0 and not row.at.any()}
    gathered: dict[str, list[Array]] = {bone: [] for bone in rows}
    for frame in frames:
        for bone, index in rows.items():
            sure = frame.confidence is None or frame.confidence[index] >= SURE  # false for NaN
            gathered[bone].append(np.asarray(frame.positions[index], float) if sure else np.full(3, np.nan))
    return {bone: np.array(points).reshape(-1, 3) for bone, points in gathered.items()}


def _distances(seen: dict[str, Array], one: str, other: str) -> Array:
    if one not in seen or other not in seen:
        return np.empty(0)
    return np.asarray(np.linalg.norm(seen[one] - seen[other], axis=1))


def _pair(seen: dict[str, Array], bone: str) -> tuple[Array, Array] | None:
    right, left = (seen.get(f"{side}_{bone}") for side in SIDES)
    return None if right is None or left is None else (right, left)


def _across(pair: tuple[Array, Array] | None) -> Array:
    return np.empty(0) if pair is None else np.asarray(np.linalg.norm(pair[0] - pair[1], axis=1))


def _length(sides: Sequence[Array]) -> Length | None:
    good = [values[np.isfinite(values)] for values in sides]
    every = np.concatenate(good)
    if len(every) < FEWEST:
        return None
    middle = float(np.median(every))
    both = [float(np.median(values)) for values in good if len(values) >= FEWEST]
    low, high = np.percentile(every, [5, 95])
    return Length(
        value=middle,
        spread=float(DEVIATION * np.median(np.abs(every - middle))),
        percentiles={Percentile.P5: float(low), Percentile.P50: middle, Percentile.P95: float(high)},
        frames=len(every),
        sides=abs(both[0] - both[1]) if len(both) == 2 else np.nan,
    )


def _stature(measured: dict[str, Length], sex: str, mass: float, lengths: str, name: str) -> float:
    """The stature of which the measured lengths along the body have the tables' share [m]."""
    unit = body(name=name, stature=1.75, mass=mass, sex=sex, lengths=lengths).length
    keys = [key for key in ("thigh", "shank") if key in measured]
    length, share = sum(measured[k].value for k in keys), sum(unit[k] for k in keys) / 1.75
    if "trunk" in measured:
        length += measured["trunk"].value
        share += sum(unit[key] for key in TRUNK) / 1.75
    if not share:
        what = "neither legs nor trunk are seen, so the stature is not known"
        raise InputError.at(name, "stature", what, "give it")
    found = float(length / share)
    low, high = STATURE_RANGE
    if not low <= found <= high:
        what = f"the lengths are those of somebody of {found:.2f} m"
        raise InputError.at(name, "stature", what, "check the unit of the recording, or give the stature")
    return found


def _length_findings(
    measured: dict[str, Length], tall: float, given: float | None, name: str
) -> Iterable[Finding]:
    for key, each in measured.items():
        text = (
            f"{key} {1e3 * each.value:.0f} mm, spread {1e3 * each.spread:.0f} mm, P5…P95 "
            f"{1e3 * each.percentiles['P5']:.0f}…{1e3 * each.percentiles['P95']:.0f} mm, {each.frames} values"
        )
        text += "" if np.isnan(each.sides) else f", sides differ by {1e3 * each.sides:.0f} mm"
        doubtful = each.spread > SPREAD * each.value
        yield Finding(level="warning" if doubtful else "note", subject=name, text=f"measured: {text}")
    if given is None:
        text = f"stature {tall:.3f} m estimated from the measured lengths and their usual share of it"
        yield Finding(level="assumed", subject=name, text=text)
    rest = [key for key in CHAIN if key not in measured and key not in TRUNK]
    text = f"not measured but scaled so that the chain ends at the stature: {', '.join(rest)}"
    yield Finding(level="assumed", subject=name, text=text)
