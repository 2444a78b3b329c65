r"""How far a bone may be from where the bones beside it tell that it is.

Between a shoulder and a wrist that a device sees the elbow is told by the lengths of two bones: it lies on a
circle about the line between them, and where on it nobody says. With P the parent's joint, C the child's,
:math:`a = |PJ|`, :math:`b = |JC|` and :math:`d = |PC|` of the twin, its height over that line is
:math:`h(d) = \sqrt{a^2 - t^2}`, :math:`t(d) = (d^2 + a^2 - b^2) / 2d`. The true P and C may be off by e
together; then the true joint is no farther from the twin's than

.. math:: h(d) + \max_{|d' - d| \le e} h(d') + e \left(1 + \frac{2a}{d} + \sup |t'|\right),

and never farther than :math:`2 \min(a, b) + e`. That the person's bones are as long as the twin's is
assumed; that is the device's and the fit's affair, ``human_uncertainty`` (Z_d).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping

import numpy as np

from seerob.core.transforms import Array
from seerob.description.humans.skeleton import PARENTS


def told_between(seen: Collection[str]) -> dict[str, tuple[str, ...]]:
    """Bones that no device sees between a parent and children that are seen: bone → those children."""
    found: dict[str, tuple[str, ...]] = {}
    for bone, parent in PARENTS.items():
        if bone not in seen and parent in seen:
            children = tuple(child for child, above in PARENTS.items() if above == bone and child in seen)
            if children:
                found[bone] = children
    return found


def told_bound(P: Array, J: Array, C: Array, e: float) -> float:
    """How far the joint between two bones may be from the twin's [m].

    Args:
        P: Joint at which the parent begins, of the twin [m], shape (3,).
        J: The joint, likewise.
        C: Joint at which the child begins, likewise.
        e: How far the true P and C may be off, together [m].
    """
    a, b, d = (float(np.linalg.norm(x)) for x in (J - P, C - J, C - P))
    most = 2 * min(a, b) + e
    if d - e <= 1e-9:
        return most
    turn = math.sqrt(abs(a * a - b * b))
    # The height rises up to `turn` and falls from there on.
    tallest = min(max(turn, d - e), d + e)
    heights = _height(a, b, d) + _height(a, b, tallest)
    steepest = 0.5 + abs(a * a - b * b) / (2 * (d - e) ** 2)
    return min(most, heights + e * (1 + 2 * a / d + steepest))


def _height(a: float, b: float, d: float) -> float:
    """Of a triangle with sides a, b over its side d; the largest that there is where there is none."""
    d = min(max(d, abs(a - b), 1e-12), a + b)
    t = (d * d + a * a - b * b) / (2 * d)
    return math.sqrt(max(a * a - t * t, 0.0))


def told_errors(
    seen: Collection[str],
    errors: Mapping[str, tuple[float | None, float | None]],
    joints: Mapping[str, Array],
) -> dict[str, float]:
    """Bounds on how far the ends of told bones may be from the twin's, by bone [m].

    Of a bone that is told, and of the one before it where no device sees how that is turned.

    Args:
        seen: Bones that a device sees.
        errors: Of those: how far the twin's is off, position [m] and angle [rad]; None where none was seen.
        joints: Where each bone of the twin begins [m], shape (3,).
    """
    found: dict[str, float] = {}
    for bone, children in told_between(seen).items():
        parent = PARENTS[bone]
        position, angle = errors.get(parent, (None, None))
        P, J = joints[parent], joints[bone]
        if angle is not None:
            bound = (position or 0.0) + angle * float(np.linalg.norm(J - P))
        else:
            ends = ((joints[child], errors.get(child, (None, None))[0] or 0.0) for child in children)
            bound = min(told_bound(P, J, C, (position or 0.0) + e) for C, e in ends)
            found[parent] = max(found.get(parent, 0.0), bound)
        own = max(errors.get(child, (None, None))[0] or 0.0 for child in children)
        found[bone] = max(bound, own)
    return found
