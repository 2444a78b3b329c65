r"""Moves that do not stop: how a corner is rounded off, and how fast it is passed.

A rounding is a quintic :math:`q(u)`, :math:`u = \rho t`, of which speeds grow with the rate :math:`\rho`,
accelerations with its square and jerks with its cube. It is passed at the largest rate at which none of the
three is exceeded that either of its moves has, nor what a joint may do; where a move is too short to get
to that speed or to brake from it, it is passed slower. Of slopes that a rounding may have at its ends the
one that is passed in the shortest time is taken.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from seerob.core.transforms import Array
from seerob.files.waypoints.arm import Arm
from seerob.files.waypoints.pieces import Piece, Rounding, rounding
from seerob.files.waypoints.timing import JointLimits, Limits, reachable
from seerob.files.waypoints.waypoint import Program

SLOPES = (1.2, 1.4, 1.6, 1.8, 2.0, 2.2)
"""Of a rounding at its ends, per way that is cut off; up to 2.5 it stays within the corner's triangle."""
FINE = 64
"""Places at which a rounding is looked at."""
SHARE = 0.99
"""Share of the limits that is used at those places; the rest is for what lies between them."""


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
    rounding: Rounding | None = None
    """What it is, when it is a rounding; its speeds are rates then."""


def rounded(legs: list[Leg], program: Program, arm: Arm, joints: JointLimits, doubts: list[str]) -> list[Leg]:
    """The legs with roundings between those that do not stop.

    Args:
        legs: Moves; cut where they are rounded off.
        program: Whose blend radii count.
        arm: The robot.
        joints: What they may do.
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
        if math.isinf(r):
            half = min(leg.piece.length, legs[k + 1].piece.length) / 2
            cuts[k][1], cuts[k + 1][0] = leg.piece.length - half, half
            continue
        corner = arm.posture(leg.piece.last).position
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
            each = [rounding(whole, nxt.piece, cuts[k][1], cuts[k + 1][0], slope) for slope in SLOPES]
            rates = [_rate(arm, curve, leg, nxt, joints) for curve in each]
            best = int(np.argmax(rates))
            curve, v = each[best], rates[best]
            found.append(Leg(curve.piece, leg.limits, leg.place, v0=v, v1=v, rounding=curve))
    return found


def _distance_cut(arm: Arm, piece: Piece, corner: Array, r: float, *, from_end: bool) -> tuple[float, bool]:
    """Place of a piece that is ``r`` from the corner, at most half way; and whether it was found."""
    share = np.linspace(0.0, 0.5, 201) * piece.length
    s = piece.length - share if from_end else share
    away = np.linalg.norm(arm.posture(piece.derivative(s, 0)).position - corner, axis=1)
    far = np.flatnonzero(away >= r)
    if not far.size:
        return float(s[-1]), False
    k = int(far[0])
    x = (r - away[k - 1]) / (away[k] - away[k - 1]) if k else 0.0
    return float(s[k - 1] + x * (s[k] - s[k - 1]) if k else s[0]), True


def _rate(arm: Arm, curve: Rounding, before: Leg, after: Leg, joints: JointLimits) -> float:
    """Largest rate of a rounding, within the limits of both sides and of the joints."""
    u = np.linspace(0.0, 1.0, FINE + 1)
    moved = [np.abs(curve.piece.derivative(u, order)).max(axis=0) for order in (1, 2, 3)]
    options = [joints.rate(moved)]
    for leg in (before, after):
        limits, tool = leg.limits, leg.piece.tool and not leg.piece.turning
        scale = 1.0 if leg.piece.tool else leg.piece.leading
        sizes = _of_tool(arm, curve.piece) if tool else [float(each.max()) for each in moved]
        for size, limit, order in zip(
            sizes, (limits.speed, limits.acceleration, limits.jerk), (1, 2, 3), strict=True
        ):
            options.append((limit * scale / max(size, 1e-12)) ** (1 / order))
    return SHARE * min(options)


def _of_tool(arm: Arm, piece: Piece) -> list[float]:
    """Largest derivatives of the tool point by the parameter of a rounding, first to third [m]."""
    h = 1.0 / FINE
    u = np.arange(-2, FINE + 3) * h  # a little beyond its ends, where the quintic goes on
    p = arm.posture(piece.curve(u)).position
    differences = ((p[2:] - p[:-2]) / (2 * h), np.diff(p, 2, axis=0) / h**2, np.diff(p, 3, axis=0) / h**3)
    return [float(np.linalg.norm(d, axis=1).max()) for d in differences]


def meet(legs: list[Leg]) -> None:
    """Speeds where legs meet: those of the roundings, less where a leg is too short to get there."""
    curves = {k: leg.rounding for k, leg in enumerate(legs) if leg.rounding is not None}
    rate = {k: legs[k].v0 for k in curves}
    for k, curve in curves.items():
        rate[k] = min(rate[k], legs[k - 1].limits.speed / curve.enter, legs[k + 1].limits.speed / curve.leave)
    for k, curve in curves.items():  # what the leg before allows from its begin
        before = legs[k - 1]
        begin = rate[k - 2] * curves[k - 2].leave if k - 2 in curves else 0.0
        end = reachable(begin, rate[k] * curve.enter, before.piece.length, before.limits)
        rate[k] = min(rate[k], end / curve.enter)
    for k, curve in reversed(curves.items()):  # and the leg after it to its end
        after = legs[k + 1]
        end = rate[k + 2] * curves[k + 2].enter if k + 2 in curves else 0.0
        begin = reachable(end, rate[k] * curve.leave, after.piece.length, after.limits)
        rate[k] = min(rate[k], begin / curve.leave)
    for k, curve in curves.items():
        legs[k].v0 = legs[k].v1 = rate[k]
        legs[k - 1].v1 = rate[k] * curve.enter
        legs[k + 1].v0 = rate[k] * curve.leave
