"""Moves that do not stop: how a corner is rounded off, and the speeds at which it is passed.

A rounding is passed at a steady speed in joint space, at which neither the speed nor the acceleration of
either of its moves is exceeded; where a move is too short to get to that speed or to brake from it, it is
passed slower.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from seerob.transforms import Array
from seerob.waypoints.arm import Arm
from seerob.waypoints.pieces import Piece, rounding
from seerob.waypoints.timing import Limits, reachable
from seerob.waypoints.waypoint import Program


@dataclass(eq=False)
class Leg:
    """One piece on the way to its timing."""

    piece: Piece
    limits: Limits
    place: str
    duration: float | None = None
    """Time that it is to take [s]."""
    pause: float = 0.0
    """Time that the robot stands at its end [s]."""
    v0: float = 0.0
    """Speed along it at its begin."""
    v1: float = 0.0
    blend: bool = False
    """Whether it does not stop at its end."""
    steady: bool = False
    """Whether it is a rounding."""


def rounded(legs: list[Leg], program: Program, arm: Arm, doubts: list[str]) -> list[Leg]:
    """The legs with roundings between those that do not stop.

    Args:
        legs: Moves; cut where they are rounded off.
        program: Whose blend radii count.
        arm: The robot.
        doubts: What is done otherwise than asked is added.
    """
    radius = {w.shown: w.blend for w in program.waypoints}
    for k, leg in enumerate(legs):
        if leg.blend and (k + 1 == len(legs) or leg.pause > 0):
            leg.blend = False
        elif leg.blend and (leg.duration is not None or legs[k + 1].duration is not None):
            doubts.append(f"{leg.place}: a blend beside a given duration is not modelled: it stops there")
            leg.blend = False
    cuts = [[0.0, leg.piece.length] for leg in legs]
    for k, leg in enumerate(legs[:-1]):
        if not leg.blend:
            continue
        r = radius[leg.place]
        corner = arm.posture(leg.piece.q[-1]).position
        first, found_before = _distance_cut(arm, leg.piece, corner, r, from_end=True)
        second, found_after = _distance_cut(arm, legs[k + 1].piece, corner, r, from_end=False)
        if not (found_before and found_after):
            doubts.append(f"{leg.place}: blend of {r:g} m is cut to half of a move that is shorter")
        cuts[k][1], cuts[k + 1][0] = first, second
    found: list[Leg] = []
    for k, leg in enumerate(legs):
        whole = leg.piece
        leg.piece = whole.part(*cuts[k])
        found.append(leg)
        if leg.blend:
            nxt = legs[k + 1]
            curve = rounding(whole, nxt.piece, cuts[k][1], cuts[k + 1][0])
            v = _blend_speed(arm, curve, leg, nxt)
            found.append(Leg(curve, leg.limits, leg.place, v0=v, v1=v, steady=True))
    return found


def _distance_cut(arm: Arm, piece: Piece, corner: Array, r: float, *, from_end: bool) -> tuple[float, bool]:
    """Place of a piece that is ``r`` from the corner, at most half way; and whether it was found."""
    share = np.linspace(0.0, 0.5, 201) * piece.length
    s = piece.length - share if from_end else share
    away = np.linalg.norm(arm.posture(piece.at(s)[0]).position - corner, axis=1)
    far = np.flatnonzero(away >= r)
    if not far.size:
        return float(s[-1]), False
    k = int(far[0])
    x = (r - away[k - 1]) / (away[k] - away[k - 1]) if k else 0.0
    return float(s[k - 1] + x * (s[k] - s[k - 1]) if k else s[0]), True


def _blend_speed(arm: Arm, curve: Piece, before: Leg, after: Leg) -> float:
    """Speed in joint space of a rounding, within the speeds and accelerations of both sides."""
    h = np.diff(curve.s)
    bend = np.abs(np.diff(curve.dq, axis=0)) / h[:, None]
    posture = arm.posture(curve.q)
    tip = np.diff(posture.position, axis=0) / h[:, None]
    tip_bend = np.linalg.norm(np.diff(tip, axis=0), axis=1) / h[1:]
    options = []
    for leg in (before, after):
        scale = 1.0 if leg.piece.tool else leg.piece.leading
        v, a = leg.limits.speed * scale, leg.limits.acceleration * scale
        if leg.piece.tool and not leg.piece.turning:
            options += [v / max(float(np.linalg.norm(tip, axis=1).max()), 1e-12)]
            options += [np.sqrt(a / max(float(tip_bend.max()), 1e-12))]
        else:
            options += [v / max(float(np.abs(curve.dq).max()), 1e-12)]
            options += [np.sqrt(a / max(float(bend.max()), 1e-12))]
    return float(min(options))


def meet(legs: list[Leg]) -> None:
    """Speeds where legs meet: those of the roundings, less where a leg is too short to get there."""
    curves = [k for k, leg in enumerate(legs) if leg.steady]
    size = {
        k: (np.linalg.norm(legs[k - 1].piece.dq[-1]), np.linalg.norm(legs[k + 1].piece.dq[0])) for k in curves
    }
    speed = {k: legs[k].v0 for k in curves}
    for k in curves:
        for other, at in ((legs[k - 1], size[k][0]), (legs[k + 1], size[k][1])):
            speed[k] = min(speed[k], other.limits.speed * float(at))
    for k in curves:  # what the leg before allows from its begin
        before = legs[k - 1]
        begin = speed[k - 2] / float(size[k - 2][1]) if k - 2 in speed else 0.0
        end = reachable(begin, speed[k] / float(size[k][0]), before.piece.length, before.limits)
        speed[k] = min(speed[k], end * float(size[k][0]))
    for k in reversed(curves):  # and the leg after it to its end
        after = legs[k + 1]
        end = speed[k + 2] / float(size[k + 2][0]) if k + 2 in speed else 0.0
        begin = reachable(end, speed[k] / float(size[k][1]), after.piece.length, after.limits)
        speed[k] = min(speed[k], begin * float(size[k][1]))
    for k in curves:
        legs[k].v0 = legs[k].v1 = speed[k]
        legs[k - 1].v1 = speed[k] / float(size[k][0])
        legs[k + 1].v0 = speed[k] / float(size[k][1])
