"""Who is who among the persons that a camera sees: numbers that change, persons that change numbers.

A tracker numbers persons. It gives somebody whom it lost and found again a new number, and when two
persons cross it may exchange theirs. One person is followed here, by number as long as that is believable.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np

from seerob.core.errors import InputError
from seerob.core.snapshot import Finding
from seerob.core.transforms import Array
from seerob.protocols.tracking.kinect import Body, Picture

T = TypeVar("T")

NEAR = 0.4
"""Whoever stands within this of where a person was is taken for that person [m]: half a stride."""
JUMP_SPEED = 6.0
"""Nobody's pelvis moves faster in a workplace [m/s]; a sprinter does 10."""
MEMORY = 1.0
"""For this long after the last sight it counts where a person was [s]."""
MAX_EVENTS = 1000


@dataclass(eq=False)
class Follower:
    """Follows one person from picture to picture.

    Args:
        subject: The tracker's numbers of that person, separated by commas; empty when there is only one.
    """

    subject: str = ""
    exchanged: list[float] = field(default_factory=list)
    """When it went on with another number, because that one stands where the person was [s]."""
    renamed: list[tuple[float, int]] = field(default_factory=list)
    """When the only person had a new number [s], and that number."""
    crowded: list[float] = field(default_factory=list)
    """When there were several, and nobody said which one [s]."""
    _ids: set[int] = field(default_factory=set)
    _current: int | None = None
    _place: Array | None = None
    _seen: float = -math.inf

    def __post_init__(self) -> None:
        self._ids = numbers(self.subject)

    def choose(self, picture: Picture) -> Body | None:
        """The person in this picture; None when not seen, or when nobody can say who it is."""
        bodies = {body.id: body for body in picture.bodies}
        chosen = bodies.get(self._current) if self._current is not None else None
        remembered = self._place is not None and picture.t - self._seen <= MEMORY
        if chosen is not None and remembered:
            chosen = self._believable(chosen, picture)
        if chosen is None:
            chosen = self._new(picture, remembered=remembered)
        if chosen is not None:
            self._current = chosen.id
            place = where(chosen)
            if place is not None:
                self._place, self._seen = place, picture.t
        return chosen

    def _believable(self, body: Body, picture: Picture) -> Body:
        """The body, or the one that stands where this person was when this one has jumped away."""
        assert self._place is not None
        place = where(body)
        if place is None:
            return body
        reach = max(NEAR, JUMP_SPEED * (picture.t - self._seen))
        if float(np.linalg.norm(place - self._place)) <= reach:
            return body
        other = self._nearest([b for b in picture.bodies if b.id != body.id])
        if other is None:
            return body
        _note(self.exchanged, picture.t)
        return other

    def _new(self, picture: Picture, *, remembered: bool) -> Body | None:
        wanted = [b for b in picture.bodies if not self._ids or b.id in self._ids]
        if not wanted:
            return None
        if len(wanted) > 1:
            near = self._nearest(wanted) if remembered else None
            if near is None:
                _note(self.crowded, picture.t)
            return near
        if self._current is not None and wanted[0].id != self._current:
            _note(self.renamed, (picture.t, wanted[0].id))
        return wanted[0]

    def _nearest(self, bodies: Sequence[Body]) -> Body | None:
        assert self._place is not None
        best, closest = None, NEAR
        for body in bodies:
            place = where(body)
            if place is None:
                continue
            distance = float(np.linalg.norm(place - self._place))
            if distance <= closest:
                best, closest = body, distance
        return best


def _note(events: list[T], event: T) -> None:
    if len(events) < MAX_EVENTS:
        events.append(event)


def numbers(subject: str) -> set[int]:
    """The numbers in ``1, 5``.

    Raises:
        InputError: Something else stands there.
    """
    try:
        return {int(part) for part in subject.split(",")} if subject.strip() else set()
    except ValueError:
        what = f"{subject!r} is no number of a body"
        raise InputError.at(
            "sources", "subject", what, 'give "1", or "1, 5" for one who got a new number'
        ) from None


def where(body: Body) -> Array | None:
    """Pelvis, or the middle of what is seen [m], shape (3,); None when nothing is."""
    pelvis = body.positions[0]
    if np.isfinite(pelvis).all():
        return np.asarray(pelvis)
    seen = body.positions[np.isfinite(body.positions).all(axis=1)]
    return np.asarray(seen.mean(axis=0)) if len(seen) else None


def findings(follower: Follower, *, file: str, subject: str, start: float) -> list[Finding]:
    """What is to be said of a whole recording.

    Args:
        follower: After the last picture.
        file: As messages name it.
        subject: Whom it is about.
        start: Instant of the first picture [s].
    """
    said: list[tuple[str, str]] = []
    if follower.renamed:
        list_of = ", ".join(f"{i} at {t - start:.2f} s" for t, i in follower.renamed[:8])
        more = "" if len(follower.renamed) <= 8 else f" and {len(follower.renamed) - 8} more times"
        text = f"the tracker gave the person a new number ({list_of}{more}): taken for the same one"
        said.append(("assumed", text))
    if follower.exchanged:
        list_of = ", ".join(f"{t - start:.2f} s" for t in follower.exchanged[:8])
        text = f"numbers of persons were exchanged at {list_of}: followed by place instead"
        said.append(("warning", text))
    if follower.crowded:
        count = f"{len(follower.crowded)}" + ("+" if len(follower.crowded) == MAX_EVENTS else "")
        text = f"several persons in {count} pictures, from {follower.crowded[0] - start:.2f} s, and none near"
        said.append(("warning", text + " where the person was: counts as not seen"))
    return [Finding(level=level, subject=subject, text=f"{file}: {text}") for level, text in said]


def check_one(seen: dict[int, tuple[int, float, float]], *, together: bool, subject: str, file: str) -> None:
    """Ask who is meant.

    Args:
        seen: Number of pictures, first and last instant since the start [s], by number.
        together: Whether several were ever seen at once.
        subject: What the user said.
        file: As messages name it.

    Raises:
        InputError: Several persons and nothing said, or somebody who is not there.
    """
    shown = ", ".join(
        f"{i} ({count} pictures, {a:.1f}…{b:.1f} s)"
        for i, (count, a, b) in sorted(seen.items(), key=lambda item: -item[1][0])[:12]
    )
    wanted = numbers(subject)
    if not seen:
        raise InputError.at(file, "", "nobody is seen in any picture")
    if wanted and not wanted & set(seen):
        raise InputError.at(file, "subject", f"no body {subject!r}", f"there are: {shown}")
    if not wanted and together:
        what = f"several persons at once: {shown}"
        raise InputError.at(
            file, "subject", what, 'name one: subject = "1", or "1, 5" for one of two numbers'
        )
