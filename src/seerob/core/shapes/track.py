"""A way on the floor: straight pieces with arcs between them, by the length along it."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np

from seerob.core.transforms import Array

SHORTEST = 1e-6
"""Pieces below it are left out [m]."""


class Piece(NamedTuple):
    """A straight piece, or an arc."""

    start: float
    """Along the way [m]."""
    length: float
    """[m]"""
    x: float
    y: float
    """Where it begins [m]."""
    heading: float
    """There, from x about z [rad]."""
    curvature: float
    """1/m, positive to the left; 0 where it is straight."""

    def at(self, s: float) -> tuple[float, float, float]:
        """x, y [m] and heading [rad] ``s`` [m] after its begin."""
        turned = self.curvature * s
        # sin(turned / 2) / (turned / 2) keeps its digits where it hardly bends.
        chord = s * float(np.sinc(turned / 2 / math.pi))
        middle = self.heading + turned / 2
        return self.x + chord * math.cos(middle), self.y + chord * math.sin(middle), self.heading + turned


class Track(NamedTuple):
    """A way whose heading does not jump."""

    pieces: tuple[Piece, ...]

    @classmethod
    def rounded(cls, points: Sequence[tuple[float, float]], radius: float, *, closed: bool) -> Self:
        """The way along points, its corners rounded.

        Args:
            points: Corners (x, y) [m].
            radius: Of the arcs [m].
            closed: Whether the last point is followed by the first.

        Raises:
            ValueError: Two points in one place, a corner without a radius, one that turns back, or arcs that
                do not fit between their neighbours.
        """
        corners = np.array(points, float)
        n = len(corners)
        if closed and n < 3:
            raise ValueError("a closed way has three points or more")
        legs = np.roll(corners, -1, axis=0) - corners if closed else np.diff(corners, axis=0)
        lengths = np.hypot(legs[:, 0], legs[:, 1])
        if (lengths < SHORTEST).any():
            k = int(np.argmin(lengths))
            raise ValueError(f"points[{k}] and the next are in one place: remove one")
        headings = np.arctan2(legs[:, 1], legs[:, 0])
        # Corner k lies between leg k - 1 and leg k.
        turns = np.array([_turn(headings[k - 1], headings[k]) for k in range(len(legs))])
        if not closed:
            turns[0] = 0.0
        if (np.abs(turns) > math.pi - 1e-3).any():
            k = int(np.argmax(np.abs(turns)))
            raise ValueError(f"the way turns back at points[{k}]: add points for a curve")
        if radius == 0 and (np.abs(turns) > 1e-9).any():
            raise ValueError("a way with corners needs a radius that rounds them")
        cut = radius * np.tan(np.abs(turns) / 2)
        after = np.append(cut[1:], cut[0] if closed else 0.0)
        left = lengths - cut - after
        if (left < -1e-9).any():
            k = int(np.argmin(left))
            raise ValueError(f"radius = {radius:g} m does not fit between points[{k}] and the next")
        pieces: list[Piece] = []

        def add(length: float, curvature: float, begin: tuple[float, float, float]) -> None:
            if length > SHORTEST:
                start = pieces[-1].start + pieces[-1].length if pieces else 0.0
                pieces.append(Piece(start, length, *begin, curvature))

        for k, heading in enumerate(headings.tolist()):
            forth = np.array([math.cos(heading), math.sin(heading)])
            begin = corners[k] + cut[k] * forth
            add(float(left[k]), 0.0, (float(begin[0]), float(begin[1]), heading))
            turn = float(turns[(k + 1) % n]) if closed or k + 1 < len(turns) else 0.0
            end = begin + left[k] * forth
            if turn:
                bend = (float(end[0]), float(end[1]), heading)
                add(radius * abs(turn), math.copysign(1 / radius, turn), bend)
        return cls(tuple(pieces))

    @property
    def length(self) -> float:
        """From its begin to its end [m]."""
        return self.pieces[-1].start + self.pieces[-1].length

    def at(self, s: float) -> tuple[Array, Array]:
        """Where something stands that has come ``s`` [m].

        Returns:
            x, y [m] and heading [rad]; and how they change per metre, shape (3,) each.
        """
        k = max(0, bisect_right([piece.start for piece in self.pieces], s) - 1)
        piece = self.pieces[k]
        x, y, heading = piece.at(min(s - piece.start, piece.length))
        return np.array([x, y, heading]), np.array([math.cos(heading), math.sin(heading), piece.curvature])


def _turn(before: float, after: float) -> float:
    """From one heading to the next, the short way [rad]."""
    return (after - before + math.pi) % math.tau - math.pi
