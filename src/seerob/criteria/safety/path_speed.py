r"""Speed along a known path against its permissible-speed map, place by place."""

from __future__ import annotations

import hashlib
from itertools import pairwise
from pathlib import Path
from typing import Annotated, ClassVar, NamedTuple, cast

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from seerob.core.errors import InputError, Undecided
from seerob.core.files.bounded import TooLarge, content
from seerob.core.snapshot import Basis, Input, Origin
from seerob.core.transforms import Array
from seerob.core.verdict import Verdict
from seerob.criteria.criterion import Criterion
from seerob.criteria.figure import Compute, Figure, Present, Shown, Twin
from seerob.files.trajectories.path_map import MAX_SIZE, PathMap, Place, path_markers, read_map
from seerob.model import provenance
from seerob.model.model import Model
from seerob.twin.spans import ROUNDING, UNBOUNDED, Fall, Falls, Points, Span, down_to
from seerob.twin.state import State

SAME = 1e-3
"""Places of the path that are nearer than the nearest and this are passed at once [rad or m]."""
STANDSTILL = 1e-3
"""Below this the robot stands [rad/s or m/s]."""


class Passed(NamedTuple):
    """Where on a path a robot is."""

    distance: float
    """From the path in joint space [rad or m]."""
    legs: NDArray[np.int64]
    """Indices of the stretches, from a place to the next one, that it may be on, shape (k,)."""


def passed(q: Array, qd: Array, legs: tuple[Array, Array]) -> Passed:
    r"""Which stretches of a path a robot is on: the nearest, and of those as near the ones it follows.

    Args:
        q: Joint positions [rad or m], shape (d,).
        qd: Joint velocities [rad/s or m/s], shape (d,).
        legs: Starts and ways of the stretches [rad or m], shape (n, d) each.
    """
    distance = distances(q, legs)
    nearest = float(distance.min())
    near = np.flatnonzero(distance <= nearest + SAME)
    along = near[legs[1][near] @ qd > 0]
    return Passed(nearest, along if len(along) else near)


def distances(q: Array, legs: tuple[Array, Array]) -> Array:
    """How far joint positions (d,) are from each stretch of a path [rad or m], shape (n,); see `passed`."""
    start, way = legs
    off = q - start
    length = np.maximum((way * way).sum(axis=1), 1e-300)
    x = np.clip((off * way).sum(axis=1) / length, 0.0, 1.0)
    return np.asarray(np.linalg.norm(off - x[:, None] * way, axis=1))


class PathSpeed(Criterion, frozen=True, kw_only=True):
    """Speed of a robot along a known path against the permissible-speed map of that path."""

    unit: ClassVar[str] = ""
    by_shape: ClassVar[bool] = False

    robot: str
    """The robot."""
    map: str
    """Its map, a ``map.csv`` of `seerob permissible`; path from the folder of the workstation file."""
    tolerance: Annotated[float, Meta(gt=0, le=1, extra={"unit": "rad or m"})] = 0.02
    """Distance from the path, in joint space, beyond which the map says nothing [rad or m]."""

    def subjects(self) -> tuple[str, ...]:
        """The robot."""
        return (self.robot,)

    def _data(self, model: Model) -> bytes:
        path = Path(model.folder, self.map)
        try:
            return content(path, MAX_SIZE)
        except TooLarge:
            raise InputError.at(self.map, "", "is too large", f"at most {MAX_SIZE} bytes") from None
        except OSError as error:
            what = f"cannot be read: {error.strerror}"
            raise InputError.at(self.map, "", what, "give a map.csv of `seerob permissible`") from error

    def compute(self, model: Model) -> Compute:
        """Look up every name in the model once and return the function that computes the share."""
        robot = model.robot(self.robot)
        found = read_map(self._data(model), name=self.map, units=robot.units)
        same, legs, permitted = _legs(found)
        if not len(same):
            raise InputError.at(self.map, "piece", "no two places follow each other", "give a whole map")

        def compute(twin: Twin) -> Figure:
            state = cast("State", twin)
            qd = state.qd(robot)
            here = passed(state.q(robot), qd, legs)
            speed = float(np.linalg.norm(qd))
            if here.distance > self.tolerance:
                raise Undecided(
                    f"{self.robot} is {here.distance:.3g} rad or m off the path: the map does not say"
                )
            on = here.legs[int(permitted[here.legs].argmin())]
            limit = float(permitted[on])
            k = int(same[on])
            place = k + int(found.permissible[k + 1] < found.permissible[k])
            why = found.words[place]
            if np.isnan(limit):
                raise Undecided(f"the map is undecided here: {why}")
            if speed <= STANDSTILL:
                return Figure(0.0, 1.0, beside="stands still")
            if limit == 0:
                return Figure(None, 1.0, exceeded=True, beside=why)
            return Figure(speed / limit, 1.0, beside=why)

        return compute

    def present(self, model: Model) -> Present:
        """Return the function that says what decides there, and draws the path."""
        units = model.robot(self.robot).units
        drawn = path_markers(_places(read_map(self._data(model), name=self.map, units=units)))

        def present(state: State, figure: Figure, verdict: Verdict | None) -> Shown:
            why = "" if figure.value is not None else "moves where no speed is permitted: "
            return Shown(f"{why}{figure.beside}", lambda: drawn)

        return present

    def falls(self, model: Model, points: Points) -> Falls:
        r"""Bound the speed between instants: the fastest it may be, on the slowest stretch it may be on.

        Within a span of length T in which :math:`|\dot q| \le v`, the robot is nowhere farther than vT/2
        from where it is in the middle, and so are the distances from all stretches.
        """
        robot = model.robot(self.robot)
        found = read_map(self._data(model), name=self.map, units=robot.units)
        _, legs, permitted = _legs(found)
        own_q, own_v = robot.q_address[robot.own], robot.v_address[robot.own]

        def falls(span: Span, least: Array | float) -> Fall:
            speeds, quick = span.qd[own_v], span.qdd[own_v]
            if not np.isfinite(speeds).all():
                return UNBOUNDED
            ends = [float(np.linalg.norm(span.path.at(t)[1][own_v])) for t in (span.begin, span.end)]
            most = (ends[0] + ends[1] + float(np.linalg.norm(quick)) * span.T) / 2
            noise = float(np.linalg.norm(span.joint_noise[own_v]))
            fast = min(float(np.linalg.norm(speeds)), most) + noise + ROUNDING
            q, qd = (each[own] for each, own in zip(
                span.path.at((span.begin + span.end) / 2), (own_q, own_v), strict=True
            ))  # fmt: skip
            way = fast * span.T / 2 + ROUNDING
            distance = distances(q, legs)
            nearest = float(distance.min())
            if nearest + way > self.tolerance:
                return UNBOUNDED
            there = distance <= nearest + SAME + 2 * way
            turned = float(np.linalg.norm(quick)) * span.T / 2 + noise
            along, length = legs[1] @ qd, np.linalg.norm(legs[1], axis=1)
            # Whom it surely follows and is as near as any counts, and none that it surely does not follow.
            if (there & (along > turned * length) & (distance + 2 * way <= nearest + SAME)).any():
                there &= along > -turned * length
            least_permitted = float(permitted[there].min())
            if np.isnan(least_permitted) or (least_permitted == 0 and fast > STANDSTILL):
                return UNBOUNDED
            share = 0.0 if fast <= STANDSTILL else fast / least_permitted
            return down_to(least, 1.0 - share)

        return falls

    def basis(self, model: Model) -> Basis:
        """State the formula, its source, the inputs with their origin, and what is not modelled."""
        digest = hashlib.sha256(self._data(model)).hexdigest()
        return Basis(
            formula="|q̇| as a share of the permissible path speed at the nearest place of the path; "
            "between two places the lesser",
            source="permissible-speed map of seerob; the criteria that made it are named in it",
            inputs=(
                *provenance.motion(model, self.robot),
                Input(name="map", value=self.map, origin=Origin.COMPUTED, source=f"SHA-256 {digest}"),
                Input(
                    name="tolerance",
                    value=self.tolerance,
                    unit="rad or m",
                    origin=Origin.CHOICE if self.tolerance == 0.02 else Origin.GIVEN,
                    source="seerob" if self.tolerance == 0.02 else "workstation file",
                ),
            ),
            not_modelled=(
                "people and things that are elsewhere than when the map was made",
                "changes of the cell, tool or workpiece since the map was made",
                "how the robot gets back to the path when it is off it",
            ),
        )


def _legs(found: PathMap) -> tuple[NDArray[np.int64], tuple[Array, Array], Array]:
    """Places that another one follows, the stretches from these, and the speed permitted on each."""
    same = np.flatnonzero(found.piece[1:] == found.piece[:-1])
    legs = found.q[same], found.q[same + 1] - found.q[same]
    # Of two neighbours the lesser counts; one that is not known leaves both open.
    return same, legs, np.minimum(found.permissible[same], found.permissible[same + 1])


def _places(found: PathMap) -> list[list[Place]]:
    points = [(x, y, z) for x, y, z in found.tool.tolist()]
    rows = list(zip(points, found.tool_permissible.tolist(), found.tool_given.tolist(), strict=True))
    cuts = np.flatnonzero(np.diff(found.piece)) + 1
    ends = [0, *cuts.tolist(), len(rows)]
    return [[Place(*row) for row in rows[a:b]] for a, b in pairwise(ends)]
