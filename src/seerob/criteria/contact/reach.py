"""Which body regions a part can hit by its height, where the file says how people can be there.

Without a word of the file anyone can be anywhere in any posture, and every region counts. With postures and
statures the skin of each region lies between two heights; a part that moves farther above or below than the
horizon cannot hit it. Arms and hands are held anywhere, and never left out. Nobody who is nearer than the
horizon in the twin is left out either, nor is anybody whose place is not known.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray

from seerob.core.errors import Undecided
from seerob.core.shapes.geometry import Solid
from seerob.core.snapshot import Input, Origin
from seerob.core.transforms import Array
from seerob.criteria.contact.regions import FEET, REGIONS, SENSITIVE, Person
from seerob.description.humans import manikin
from seerob.description.humans.posture import posture
from seerob.description.humans.skeleton import bone_poses, without_side
from seerob.description.humans.skin import BODY_REGION
from seerob.model.model import Mechanism, Model
from seerob.twin.spans import Span, rows_of
from seerob.twin.state import State

ANYWHERE = frozenset({"Upper arms and elbow joints", "Lower arms and wrist joints", "Hands and fingers"})
"""Regions that are moved to any height in any posture."""
INDICES = (15.0, 45.0)
"""Body mass over the square of the stature that is believed [kg/m²], see `humans.anthropometry`."""
STATURES = 3
"""So many statures between the ends of a range."""


@cache
def heights(postures: tuple[str, ...], statures: tuple[float, float]) -> dict[str, tuple[float, float]]:
    """Lowest and highest point of the skin of each body region over the floor [m].

    Over men and women, the given postures of the library, and statures and body masses between the ends.

    Args:
        postures: Names of postures.
        statures: Least and largest [m].

    Raises:
        UnknownName: No such posture.
        InputError: A stature that no adult has.
    """
    found: dict[str, list[float]] = {}
    for stature in np.linspace(*statures, STATURES).tolist():
        for sex in ("male", "female"):
            for index in INDICES:
                mass = float(np.clip(index * stature**2, 30.0, 250.0))
                person = manikin.build(name="person", stature=stature, mass=mass, sex=sex)
                for name in postures:
                    rotations, positions = bone_poses(person, posture(person, name))
                    for k, link in enumerate(person.links[1:]):
                        z = _heights(link.solids, rotations[k], positions[k])
                        for region in _regions(link.name):
                            found.setdefault(region, []).extend(z)
    return {region: (min(z), max(z)) for region, z in found.items()}


def _heights(solids: Sequence[Solid], rotation: Array, position: Array) -> list[float]:
    z = []
    for solid in solids:
        points, radius = solid.points, solid.radius
        assert points is not None
        corners = points if len(points) == 2 else np.vstack([points, points[1] + points[2] - points[0]])
        at = (corners @ rotation.T + position)[:, 2]
        z += [float(at.min() - radius), float(at.max() + radius)]
    return z


def _regions(bone: str) -> set[str]:
    of = {FEET if region is None else region for region in BODY_REGION[without_side(bone)]}
    return of | ({SENSITIVE} if bone in ("head", "neck") else set())


class HeightReach:
    """Which regions each moving body of a robot can hit, bound once.

    Args:
        model: The compiled workstation.
        robot: The robot.
        postures: In which people can be there.
        statures: Theirs, least and largest [m].
        horizon: Distance within which a part could hit a body part [m].
        floor: Height of the floor that they stand on [m].
    """

    def __init__(
        self,
        model: Model,
        robot: Mechanism,
        postures: tuple[str, ...],
        statures: tuple[float, float],
        *,
        horizon: float,
        floor: float,
    ) -> None:
        bands = heights(postures, statures)
        self._horizon, self._moving = horizon, robot.moving
        self._bodies = [model.bodies[i] for i in robot.moving]
        everywhere = -np.inf, np.inf
        band = [everywhere if name in ANYWHERE else bands.get(name, everywhere) for name in REGIONS]
        self._low, self._high = np.array(band).T + floor
        humans = [name for name, m in model.mechanisms.items() if m.role == "human"]
        self._people = (
            [Person(model, robot, name, horizon=horizon) for name in humans] if robot.moving else []
        )
        self.words = " or ".join(postures)

    def at(self, state: State, span: Span | None = None) -> NDArray[np.bool_]:
        """Per moving body and region, shape (b, len(REGIONS)); ``span`` as of `Person.near`."""
        horizon = self._horizon + (0.0 if span is None else span.way(rows_of(self._moving)))
        R, x = state.placed(self._moving)
        z = [
            (body.corners @ R[i, 2] + x[i, 2], body.radius + body.deviation)
            for i, body in zip(self._moving, self._bodies, strict=True)
        ]
        low = np.array([at.min() - r - horizon for at, r in z])[:, None]
        high = np.array([at.max() + r + horizon for at, r in z])[:, None]
        found: NDArray[np.bool_] = (low <= self._high) & (high >= self._low)
        for person in self._people:
            try:
                found |= person.near(state, 0.0, span)[0]
            except Undecided:
                return np.ones_like(found)
        return found


def reach_inputs(
    postures: tuple[str, ...], source: str, statures: tuple[float, float], floor: float
) -> tuple[Input, ...]:
    """How people can be there, and at which heights each body region is then."""
    method = f"skin of statures {statures[0]:g} to {statures[1]:g} m, {' or '.join(postures)}, on the floor"
    return (
        Input(name="postures of people", value=", ".join(postures), origin=Origin.GIVEN, source=source),
        *(
            Input(
                name=f"{name}: {end} over the ground",
                value=z + floor,
                unit="m",
                origin=Origin.COMPUTED,
                source=method,
            )
            for name, band in heights(postures, statures).items()
            if name not in ANYWHERE
            for end, z in zip(("lowest", "highest"), band, strict=True)
        ),
    )
