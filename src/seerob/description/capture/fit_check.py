"""How well a person's bones agree with a recording, before it is played, and which stature agrees best.

The same fit that the twin uses is made of frames spread over the recording. Markers on the skin are then
moved on their bones to where the fits have them, a few times over (marker registration, as in Delp et al.
2007), and what is still missing is told per bone: markers' places, size, mounting.

Between markers on the skin lies no bone's length. But bodies of several statures, with the usual proportions
and the markers at their nominal places, are fitted to frames of the recording; a parabola through the
smallest mean distance and its neighbours tells the stature. Parts of the recording, each by itself, tell the
spread.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np

from seerob.core.errors import InputError
from seerob.core.snapshot import Finding
from seerob.core.transforms import Array, inverse
from seerob.description.capture.calibration import SMALL, mounted_wrongly
from seerob.description.capture.captured import Captured, CaptureFrame, Seen
from seerob.description.capture.fitting import Fitter, Pulls, pulls
from seerob.description.capture.observing import OWN_PLACE, Observer, with_places
from seerob.description.description import Description
from seerob.description.humans.skeleton import without_side

FRAMES = 40
"""Looked at, spread over the recording."""
ROUNDS = 6
FARTHEST = 0.12
"""A marker is moved by no more than this [m] from its nominal place."""
NEXT_TO_NOTHING = 1e-9
"""Weight of what is compared but pulls at nothing."""
ODD = np.radians(15.0)
"""A median angle above it [rad] is looked into."""
POOR = 0.05
"""A median distance above it [m] asks for other lengths or names."""


@dataclass(frozen=True, eq=False)
class Fit:
    """What is missing between a person and a recording."""

    away: dict[str, float]
    """Device's name → median distance [m]."""
    turned: dict[str, float]
    """Device's name → median angle [rad]."""

    @property
    def median(self) -> float:
        """Median of all distances [m]; NaN when there are none."""
        return float(np.median(list(self.away.values()))) if self.away else np.nan


def spread(captured: Captured, count: int = FRAMES) -> list[CaptureFrame]:
    """Frames spread evenly over a recording."""
    step = max(1, captured.count // count)
    return list(islice(captured.frames, step // 2, None, step))[: 2 * count]


def look(
    frames: Iterable[CaptureFrame], observer: Observer, description: Description, root_from_world: Array
) -> tuple[Fit, dict[str, Array]]:
    """Fit a posture to each frame.

    Returns:
        What is missing, and by name where the fits have each thing in its bone's frame [m], (3,).
    """
    fitter = Fitter(description)
    away: dict[str, list[float]] = {}
    turned: dict[str, list[float]] = {}
    places: dict[str, list[Array]] = {}
    before: Array | None = None
    for frame in frames:
        points = [p for p in observer.points(frame) if p.position or p.wxyz]
        if not points:
            continue
        seen = pulls(points, root_from_world)
        before, error = fitter.fit(seen, before, since=1.0)
        R, p = fitter.bones(before)
        for k, name in enumerate(seen.names):
            if seen.wp[k] > 0:
                away.setdefault(name, []).append(float(np.linalg.norm(error[k, :3])))
                places.setdefault(name, []).append(_in_bone(seen, k, R, p))
            if seen.wo[k] > 0:
                turned.setdefault(name, []).append(float(np.linalg.norm(error[k, 3:])))
    fit = Fit(
        {name: float(np.median(values)) for name, values in away.items()},
        {name: float(np.median(values)) for name, values in turned.items()},
    )
    return fit, {name: np.median(values, axis=0) for name, values in places.items()}


def registered(
    captured: Captured, observer: Observer, description: Description, world_from_root: Array, subject: str
) -> tuple[Observer, tuple[Finding, ...]]:
    """The observer with markers where the recording has them, and what is missing then.

    Args:
        captured: The recording; only of markers are the places moved.
        observer: With nominal places.
        description: The person.
        world_from_root: Where its root stands, (4, 4).
        subject: Whom findings are about.
    """
    frames, root_from_world = spread(captured), inverse(world_from_root)
    observer, placed = _placed(frames, observer, description, root_from_world, subject)
    fit, found = look(frames, observer, description, root_from_world)
    findings = [*placed]
    if captured.layout.seen is Seen.MARKERS:
        nominal = {row.name: row.at for row in observer.rows}
        first = fit
        for _ in range(ROUNDS):
            moved = {}
            for name, place in found.items():
                shift = place - nominal[name]
                size = float(np.linalg.norm(shift))
                moved[name] = nominal[name] + shift * min(1.0, FARTHEST / max(size, 1e-12))
            observer = with_places(observer, moved)
            fit, found = look(frames, observer, description, root_from_world)
        text = (
            f"markers moved on their bones to where the recording has them: {1e3 * first.median:.0f} mm "
            f"median before, {1e3 * fit.median:.0f} mm after"
        )
        findings.append(Finding(level="assumed", subject=subject, text=text))
        away = {name: float(np.linalg.norm(place - nominal[name])) for name, place in found.items()}
    else:
        away = fit.away
    findings += _fit_findings(fit, subject)
    findings += _elsewhere(away, subject)
    findings += _mounts(fit, frames, observer, description, root_from_world, subject)
    return observer, tuple(findings)


def _placed(
    frames: Iterable[CaptureFrame],
    observer: Observer,
    description: Description,
    root_from_world: Array,
    subject: str,
) -> tuple[Observer, tuple[Finding, ...]]:
    """The observer with joints that devices place as they like where all others show them to be."""
    free = [row for row in observer.rows if row.fitted]
    if not free:
        return observer, ()
    # They are looked at, but pull at nothing.
    rows = tuple(replace(row, position=NEXT_TO_NOTHING) if row.fitted else row for row in observer.rows)
    fit, found = look(frames, replace(observer, rows=rows), description, root_from_world)
    near = {row.name: found[row.name] for row in free if fit.away.get(row.name, np.inf) <= OWN_PLACE}
    shifts = ", ".join(
        f"{row.name} {1e3 * float(np.linalg.norm(near[row.name] - row.at)):.0f} mm (on {row.bone})"
        for row in free
        if row.name in near
    )
    text = (
        f"joints that this device places as it likes, moved on their bones to where the recording has them: "
        f"{shifts}"
    )
    findings = (Finding(level="assumed", subject=subject, text=text),) if near else ()
    return with_places(observer, near), findings


def _in_bone(seen: Pulls, k: int, R: Array, p: Array) -> Array:
    bone = int(seen.bone[k])
    return np.asarray(R[bone].T @ (seen.position[k] - p[bone]))


def _fit_findings(fit: Fit, subject: str) -> Iterable[Finding]:
    if not fit.away and not fit.turned:
        return
    worst = sorted(fit.away, key=lambda name: -fit.away[name])[:3]
    shown = ", ".join(f"{name} {1e3 * fit.away[name]:.0f} mm" for name in worst)
    if fit.away:
        text = f"fit of the person to the recording: {1e3 * fit.median:.0f} mm median, worst {shown}"
        yield Finding(level="note", subject=subject, text=text)
    if fit.away and fit.median > POOR:
        text = (
            f"the person does not have the size of the one recorded ({1e3 * fit.median:.0f} mm median): "
            "correct stature and lengths"
        )
        yield Finding(level="warning", subject=subject, text=text)


def _elsewhere(away: dict[str, float], subject: str) -> Iterable[Finding]:
    """What is farther from where its name puts it than any place on that bone [m]."""
    far = sorted((name for name, size in away.items() if size > FARTHEST), key=lambda name: -away[name])
    if far:
        shown = ", ".join(f"{name} {1e3 * away[name]:.0f} mm" for name in far[:6])
        more = f" and {len(far) - 6} more" if len(far) > 6 else ""
        text = (
            f"not where their names put them: {shown}{more} away in most of the recording; exchanged labels "
            "(left and right?), or worn elsewhere: correct the labels, or the mapping"
        )
        yield Finding(level="warning", subject=subject, text=text)


def _mounts(
    fit: Fit,
    frames: Iterable[CaptureFrame],
    observer: Observer,
    description: Description,
    root_from_world: Array,
    subject: str,
) -> Iterable[Finding]:
    """Sensors that are turned against their bones, as all others show them."""
    odd = {name for name, angle in fit.turned.items() if angle > ODD}
    if not odd:
        return
    # They still are compared, but pull at nothing.
    rows = tuple(
        replace(row, orientation=NEXT_TO_NOTHING) if row.name in odd else row for row in observer.rows
    )
    alone, _ = look(frames, replace(observer, rows=rows), description, root_from_world)
    bones = {row.name: row.bone for row in observer.rows}
    for name in sorted(odd):
        angle = alone.turned.get(name, fit.turned[name])
        if angle > SMALL:
            how = mounted_wrongly(angle) or "wrongly"
            text = (
                f"{name} on {bones[name]} is mounted {how} ({np.degrees(angle):.0f}° off in most of the "
                "recording), or is on another bone: calibrate, or correct the mapping"
            )
            yield Finding(level="warning", subject=subject, text=text)


LEGS, UPPER = ("thigh", "shank", "foot", "toes"), ("thorax", "neck", "head", "clavicle", "upper_arm")
"""Markers on both tell how tall somebody is; on one of them they tell the size of a limb."""
STATURES = np.arange(1.40, 2.11, 0.10)
"""Tried [m]."""
FRAMES_OF_STATURE, PARTS = 12, 3
"""Looked at, and parts that each tell the stature by themselves."""
WIDEST = 0.20
"""Parts that differ by more [m] tell nothing."""

Bound = Callable[[float], tuple[Description, Observer]]
"""Stature [m] → a person of it, and the recording's markers on that person."""


@dataclass(frozen=True)
class MarkerStature:
    """What markers tell."""

    stature: float
    """[m]"""
    lowest: float
    """Lowest stature of the parts of the recording [m]."""
    highest: float
    residual: float
    """Median distance of the markers from where the best body has them [m]."""

    def finding(self, name: str) -> Finding:
        """What is told of it."""
        text = (
            f"stature {self.stature:.2f} m estimated from markers (parts of the recording say "
            f"{self.lowest:.2f} to {self.highest:.2f} m; markers {1e3 * self.residual:.0f} mm off); unusual "
            "proportions or places of the markers are not in that spread: measure, and give --stature"
        )
        return Finding(level="assumed", subject=name, text=text)


def marker_stature(captured: Captured, bound: Bound, *, name: str) -> MarkerStature:
    """Estimate the stature.

    Args:
        captured: A recording of markers.
        bound: Makes a person and binds the markers.
        name: Of the person, for messages.

    Raises:
        InputError: Markers do not span the body, or do not agree on a stature.
    """
    _, observer = bound(float(STATURES[len(STATURES) // 2]))
    bones = {without_side(row.bone) for row in observer.rows}
    if not (bones & set(LEGS) and bones & set(UPPER)):
        what = f"markers on {', '.join(sorted(bones))} alone do not tell how tall the person is"
        raise InputError.at(name, "stature", what, "give --stature in metres, such as 1.75")
    frames = spread(captured, FRAMES_OF_STATURE)
    parts = [frames[k::PARTS] for k in range(PARTS)]
    bodies = [bound(float(s)) for s in STATURES]
    off = np.array([[_off(part, *body) for body in bodies] for part in parts])
    found = [_lowest(row) for row in (off.mean(axis=0), *off)]
    if not np.isfinite(found).all() or max(found) - min(found) > WIDEST:
        shown = ", ".join(f"{value:.2f}" if np.isfinite(value) else "none" for value in found[1:])
        what = f"markers do not agree on a stature (parts of the recording say {shown} m)"
        raise InputError.at(name, "stature", what, "give --stature in metres, such as 1.75")
    best, *each = found
    residual = float(np.interp(best, STATURES, off.mean(axis=0)))
    return MarkerStature(best, min(each), max(each), residual)


def _off(frames: Sequence[CaptureFrame], description: Description, observer: Observer) -> float:
    """Root mean square over the markers of their median distances [m]."""
    fit, _ = look(frames, observer, description, np.eye(4))
    return float(np.sqrt(np.mean(np.square(list(fit.away.values()))))) if fit.away else np.nan


def _lowest(off: Array) -> float:
    """Where a parabola through the smallest value and its neighbours is lowest [m]; NaN at the ends."""
    if not np.isfinite(off).all():
        return np.nan
    k = int(off.argmin())
    if k in (0, len(off) - 1):
        return np.nan
    before, here, after = off[k - 1 : k + 2]
    step = 0.5 * (before - after) / (before - 2 * here + after)
    return float(STATURES[k] + step * (STATURES[1] - STATURES[0]))
