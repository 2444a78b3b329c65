"""How far a person's surface is from where devices see it, for the intervals of distances."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from seerob.core.tolerances import Tolerance
from seerob.core.transforms import Array, rotation_from_wxyz
from seerob.description.humans.skeleton import BONES
from seerob.model.model import Model
from seerob.twin.state import State
from seerob.twin.validity.inferred_bones import told_between, told_errors


class TrackingError:
    r"""Bound on the distance of every point of bones of the twin from the same point as devices see it.

    A bone that is off by p and turned by α moves its points by no more than p + α ρ, where ρ is how far they
    are from its origin. Of a hand, foot or head of which only the joint is seen, α is not known but bounded
    by φ (`seerob.description.capture.ends`), and the chord :math:`2 ρ \sin(φ/2)` takes its place. What no
    device sees adds what the file accepts (``unseen_uncertainty``), else nothing: how wrong it is nobody
    knows, and `State.require_bodies` leaves it undecided. What is held because it was not seen just now, or
    what another device sees elsewhere, adds `Hearing.slack`. A bone between two that are seen adds how far
    the lengths of bones let its ends be (`seerob.twin.validity.inferred_bones`). Where something stops the
    twin, the way from there to where the person was captured is added to what devices are off from that.

    Args:
        model: The compiled workstation.
        bodies: Of any kind; only those of people can be off.
    """

    def __init__(self, model: Model, bodies: Sequence[int]) -> None:
        self._bones: dict[str, list[tuple[int, str, float]]] = {}
        self._n = len(bodies)
        self._accepted = model.estimates
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
        places = {body.name: body.index for body in model.bodies}
        self._joints = {
            person: {bone: places[name] for bone in BONES if (name := f"{person}/{bone}") in places}
            for person in self._bones
        }

    def none(self, state: State) -> bool:
        """Whether no device says where any of these people are, and the twin follows: nothing is off then."""
        return not any(
            state.hearing(person, strayed=True).bones or state.stray(person) for person in self._bones
        )

    def at(self, state: State) -> Array:
        """Tracking error of each body [m], shape (b,)."""
        found = np.zeros(self._n)
        if self.none(state):
            return found
        for person, bones in self._bones.items():
            hearing = state.hearing(person, strayed=True)
            stray = bool(state.stray(person))
            errors = hearing.residual if stray else hearing.bones
            unaimed = hearing.unaimed(state.t) if errors else {}
            for row, bone, reach in bones if errors else ():
                position, angle = errors.get(bone, (None, None))
                chord = 2 * reach * np.sin(unaimed.get(bone, 0.0) / 2)
                found[row] = (position or 0.0) + max((angle or 0.0) * reach, chord)
            told = self._told(state, person, errors) if errors else {}
            for row, bone, _ in bones if told else ():
                found[row] = max(found[row], told.get(bone, 0.0))
            if stray:
                away, turns = state.strayed(person, tuple(self._joints[person].values()))
                place = {bone: k for k, bone in enumerate(self._joints[person])}
                for row, bone, reach in bones:
                    k = place[bone]
                    found[row] += away[k] + 2 * reach * np.sin(turns[k] / 2)
            slack = hearing.slack(state.t) if errors else {}
            for row, bone, _ in bones if slack else ():
                found[row] += slack.get(bone, 0.0)
            if person in self._accepted:
                unseen = (*hearing.unseen(state.t), *hearing.unplaced(state.t))
                for row, bone, _ in bones if unseen else ():
                    found[row] = max(found[row], self._accepted[person] * (bone in unseen))
        return found

    def _told(
        self, state: State, person: str, errors: Mapping[str, tuple[float | None, float | None]]
    ) -> dict[str, float]:
        """Of bones between two that are seen [m], see `seerob.twin.validity.inferred_bones`."""
        where = self._joints[person]
        seen = {bone for bone, error in errors.items() if error != (None, None) and bone in where}
        if not told_between(seen):
            return {}
        _, x = state.captured(person, tuple(where.values()))
        return told_errors(seen, errors, dict(zip(where, x, strict=True)))


def tracking(error: float) -> Tolerance:
    """As the input that may decide a verdict. Error [m]."""
    return Tolerance("tracking of the person", error, "m")
