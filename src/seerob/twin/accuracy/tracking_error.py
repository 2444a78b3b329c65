r"""How far a person's surface is from where devices see it, for the intervals of distances.

The bones beside a bone that nobody sees tell where it is, to a bound.

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
from collections.abc import Collection, Mapping, Sequence

import numpy as np

from seerob.core.tolerances import Tolerance
from seerob.core.transforms import Array, rotation_from_wxyz
from seerob.description.capture.registration import bound
from seerob.description.humans.skeleton import BONES, PARENTS
from seerob.model.model import Model
from seerob.twin.state import State


def inferred_between(seen: Collection[str]) -> dict[str, tuple[str, ...]]:
    """Bones that no device sees between a parent and children that are seen: bone → those children."""
    found: dict[str, tuple[str, ...]] = {}
    for bone, parent in PARENTS.items():
        if bone not in seen and parent in seen:
            children = tuple(child for child, above in PARENTS.items() if above == bone and child in seen)
            if children:
                found[bone] = children
    return found


def inferred_bound(P: Array, J: Array, C: Array, e: float) -> float:
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


def inferred_errors(
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
    for bone, children in inferred_between(seen).items():
        parent = PARENTS[bone]
        position, angle = errors.get(parent, (None, None))
        P, J = joints[parent], joints[bone]
        if angle is not None:
            bound = (position or 0.0) + angle * float(np.linalg.norm(J - P))
        else:
            ends = ((joints[child], errors.get(child, (None, None))[0] or 0.0) for child in children)
            bound = min(inferred_bound(P, J, C, (position or 0.0) + e) for C, e in ends)
            found[parent] = max(found.get(parent, 0.0), bound)
        own = max(errors.get(child, (None, None))[0] or 0.0 for child in children)
        found[bone] = max(bound, own)
    return found


_Point = tuple[int, str, float]
"""Row of a body, the bone that it is of, and how far it reaches from where that begins [m]."""


class TrackingError:
    r"""Bound on the distance of every point of bones of the twin from the same point as devices see it.

    A bone that is off by p and turned by α moves its points by no more than p + α ρ, where ρ is how far they
    are from its origin. Of a hand, foot or head of which only the joint is seen, α is not known but bounded
    by φ (`description.capture.estimated`), and the chord :math:`2 ρ \sin(φ/2)` takes its place. What no
    device sees adds what the file accepts (``unseen_uncertainty``), else nothing: how wrong it is nobody
    knows, and `State.require_bodies` leaves it undecided. What is held because it was not seen just now, or
    what another device sees elsewhere, adds `Hearing.slack`. A bone between two that are seen adds how far
    the lengths of bones let its ends be (`seerob.twin.accuracy.tracking_error`). Where something stops the
    twin, the way from there to where the person was captured is added to what devices are off from that.
    How well a device's world is known to lie in the cell (`Hearing.placings`) adds what 95 % of its error
    stay within, farther from where it was registered more.

    What a hand holds is off as a part of that hand, and by how far its spring lets it lag (`State.lags`); so
    far only is what a gripper holds. What a hand let go stays as far off as it was then (`State.left`).

    Args:
        model: The compiled workstation.
        bodies: Of any kind; only those of people and of loose workpieces can be off.
    """

    def __init__(self, model: Model, bodies: Sequence[int]) -> None:
        self._bones: dict[str, list[_Point]] = {}
        self._n = len(bodies)
        self._model, self._accepted = model, model.estimate_uncertainty
        loose = {piece.name for piece in model.workstation.workpieces if piece.loose}
        self._pieces: dict[str, list[tuple[int, int]]] = {}
        """Loose workpiece → row and index of each of its bodies, also of what it is in a gripper."""
        bones = {body.mj: body for body in model.bodies if body.role == "human"}
        for row, index in enumerate(bodies):
            body = model.bodies[index]
            mj, corners = body.mj, body.corners
            while mj and mj not in bones and model.mj.body_weldid[mj] != mj:
                corners = corners @ rotation_from_wxyz(model.mj.body_quat[mj]).T + model.mj.body_pos[mj]
                mj = int(model.mj.body_parentid[mj])
            if mj in bones:
                reach = float(np.linalg.norm(corners, axis=1).max(initial=0.0)) + body.radius
                person = bones[mj].owner
                bone = bones[mj].name.removeprefix(f"{person}/")
                self._bones.setdefault(person, []).append((row, bone, reach))
            for piece in {body.owner, body.name.rpartition("/")[2]} & loose:
                self._pieces.setdefault(piece, []).append((row, index))
        places = {body.name: body.index for body in model.bodies}
        people = [human.name for human in model.workstation.humans] if self._pieces else self._bones
        self._joints = {
            person: {bone: places[name] for bone in BONES if (name := f"{person}/{bone}") in places}
            for person in people
        }

    def none(self, state: State) -> bool:
        """Whether no device says where any of these people are, and the twin follows: nothing is off then.

        Nor is anything held that lags, nor was let go by a hand that was off.
        """
        if any(state.lags.get(piece) or state.left.get(piece) for piece in self._pieces):
            return False
        for person in {*self._bones, *(person for person, *_ in self._hands(state))}:
            if state.hearing(person, strayed=True).bones or state.stray(person):
                return False
        return True

    def at(self, state: State) -> Array:
        """Tracking error of each body [m], shape (b,)."""
        found = np.zeros(self._n)
        if self.none(state):
            return found
        for person, bones in self._bones.items():
            found[[row for row, *_ in bones]] = self._of(state, person, bones)
        for person, bone, piece in self._hands(state):
            wrist = self._joints[person][bone]
            points = [(row, bone, self._reach(state, i, wrist)) for row, i in self._pieces[piece]]
            rows = [row for row, *_ in points]
            found[rows] = np.maximum(found[rows], self._of(state, person, points))
        for piece, bodies in self._pieces.items():
            found[[row for row, _ in bodies]] += state.lags.get(piece, 0.0) + state.left.get(piece, 0.0)
        return found

    def _hands(self, state: State) -> list[tuple[str, str, str]]:
        """Of each hand that holds one of the workpieces: the person, the bone, and what it holds."""
        return [
            (person, bone, piece)
            for piece in self._pieces
            for hand in state.held.get(piece, ())
            for person, _, bone in (hand.rpartition("/"),)
            if person in self._joints
        ]

    def _reach(self, state: State, index: int, wrist: int) -> float:
        """How far a body reaches from where another one, a hand, begins [m]."""
        body, (R, x) = (
            self._model.bodies[index],
            state.placed((index, wrist), allow_estimated=True, strayed=True),
        )
        points = body.corners @ R[index].T + x[index] - x[wrist]
        return float(np.linalg.norm(points, axis=1).max(initial=0.0)) + body.radius + body.deviation

    def _of(self, state: State, person: str, points: Sequence[_Point]) -> Array:
        """How far points of bones of a person, or of what they hold, are off [m], shape (p,)."""
        found, where = np.zeros(len(points)), self._joints[person]
        hearing = state.hearing(person, strayed=True)
        stray = bool(state.stray(person))
        errors = hearing.residual if stray else hearing.bones
        place = {bone: k for k, bone in enumerate(where)}
        if errors:
            unaimed, inferred = hearing.unaimed(state.t), self._inferred(state, person, errors)
            for k, (_, bone, reach) in enumerate(points):
                position, angle = errors.get(bone, (None, None))
                chord = 2 * reach * math.sin(unaimed[bone] / 2) if bone in unaimed else 0.0
                own = (position or 0.0) + max((angle or 0.0) * reach, chord)
                found[k] = max(own, inferred.get(bone, 0.0))
        if stray:
            away, turns = state.strayed(person, tuple(where.values()))
            for k, (_, bone, reach) in enumerate(points):
                row = place[bone]
                found[k] += away[row] + 2 * reach * np.sin(turns[row] / 2)
        if errors and (slack := hearing.slack(state.t)):
            found += [slack.get(bone, 0.0) for _, bone, _ in points]
        for placing in hearing.placings(state.t) if errors else ():
            if placing.covariance:
                _, x = state.captured(person, tuple(where.values()))
                covariance = np.array(placing.covariance).reshape(6, 6)
                at = [place[bone] for _, bone, _ in points]
                reaches = np.array([reach for *_, reach in points])
                found += bound(covariance, np.array(placing.about), x[at], reaches)
        if person in self._accepted:
            unobserved = (*hearing.unobserved(state.t), *hearing.unplaced(state.t))
            for k, (_, bone, _) in enumerate(points):
                found[k] = max(found[k], self._accepted[person] * (bone in unobserved))
        return found

    def _inferred(
        self, state: State, person: str, errors: Mapping[str, tuple[float | None, float | None]]
    ) -> dict[str, float]:
        """Of bones between two that are seen [m], see `seerob.twin.accuracy.tracking_error`."""
        where = self._joints[person]
        seen = {bone for bone, error in errors.items() if error != (None, None) and bone in where}
        if not inferred_between(seen):
            return {}
        _, x = state.captured(person, tuple(where.values()))
        return inferred_errors(seen, errors, dict(zip(where, x, strict=True)))


def tracking(error: float) -> Tolerance:
    """Tolerance, the input that may decide a verdict, of a tracking error [m]."""
    return Tolerance("tracking of the person", error, "m")
