"""The twin at this tick, and what follows from it. Valid until the next tick.

What two criteria share has its one home here and is computed once per tick: where everything is
(`StateOfPlaces`), where people were captured (`Captured`), how fast everything is and what is known of its
motion ahead (`StateOfMotion`), what follows from masses (`Dynamics`), and distances. Accessors raise
`Undecided` when the robot or human they speak of was not heard lately, does not follow what was heard, or has
a mass that nobody gave: a stale or guessed number can never be green.

What says nothing of whether it may be relied on (`data`, `rotations`, `hearings` and so on) is for the
engine, the picture and the recorder. While a criterion is asked (`asking`) it is closed: reading it raises
`NotAsked`, so that no author of a criterion can forget to ask.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from copy import deepcopy
from functools import partial
from typing import ClassVar, cast

import mujoco
import numpy as np

from seerob.core.errors import Undecided
from seerob.core.snapshot import Event
from seerob.core.transforms import Array
from seerob.distance.least import Closest, Closests, Per, Query, Surveyor
from seerob.model.model import Frame, Gap, Model
from seerob.twin.authors_view import OF_AN_INSTANT, AuthorsView
from seerob.twin.dynamics import Dynamics
from seerob.twin.signals import Signals
from seerob.twin.validity.hearing import Hearing

MOST_DRAWN = 512
"""Points of frames that are kept from tick to tick."""
Local = tuple[Frame, int, float, float, float]
"""A frame, MuJoCo's body that it is on, and a point of it as that body has it [m]."""


class DrawnPoints:
    """Where MuJoCo's bodies were at one tick, for what is drawn later.

    Args:
        xmat: World from body, row by row, shape (m, 9).
        xpos: [m], shape (m, 3).
        local: What of the points that are drawn is the same at all ticks.
    """

    def __init__(self, xmat: Array, xpos: Array, local: dict[tuple[int, bytes], Local]) -> None:
        # MuJoCo writes through its own at the next tick.
        self._xmat, self._xpos = xmat.copy(), xpos.copy()
        self._local = local
        self._points: dict[tuple[int, bytes], tuple[Frame, Array]] = {}

    def point(self, frame: Frame, offset: Array) -> Array:
        """Where a point of a frame was [m], shape (3,): worked out once for all that draw there."""
        key = id(frame), offset.tobytes()
        kept = self._points.get(key)
        if kept is None:
            bound = self._local.get(key)
            if bound is None or bound[0] is not frame:
                ox, oy, oz = offset.tolist()
                x, y, z = (a * ox + b * oy + c * oz + d for a, b, c, d in frame.body_from_frame[:3].tolist())
                if len(self._local) >= MOST_DRAWN:
                    self._local.clear()
                bound = self._local[key] = frame, frame.mj, x, y, z
            _, body, x, y, z = bound
            a, b, c, d, e, f, g, h, i = self._xmat[body].tolist()
            px, py, pz = self._xpos[body].tolist()
            found = np.array(
                (px + (a * x + b * y + c * z), py + (d * x + e * y + f * z), pz + (g * x + h * y + i * z))
            )
            found.setflags(write=False)
            # With the frame itself: another one may get the id of one that is forgotten.
            kept = self._points[key] = frame, found
        return kept[1]


class State(Dynamics):
    """A view of the engine's `mujoco.MjData`; never keep one beyond its tick."""

    many: ClassVar[bool] = False

    def __init__(
        self, model: Model, data: mujoco.MjData, hearings: dict[str, Hearing], signals: Signals | None = None
    ) -> None:
        super().__init__(model, data, hearings, signals)
        self.events: tuple[Event, ...] = ()
        """What happened to loose workpieces since the last tick."""
        self._drawn: dict[tuple[int, bytes], Local] = {}
        """Points that are drawn."""
        self._surveyor = Surveyor(model.shapes)

    def refresh(self, t: float) -> None:
        """Take the engine's new positions and velocities; called once per tick by the engine."""
        super().refresh(t)
        self._surveyor.forget()

    @contextmanager
    def for_author(self, author: str) -> Iterator[State]:
        """While a criterion of one's own is asked: what it is given is its own, and nobody else reads it.

        For the judge: whatever an author writes into an array changes no other criterion and no motion.

        Args:
            author: Name of that criterion.

        Yields:
            What it is asked with: the accessors of this state, until it has answered.
        """
        kept = self._cache, self._places
        self._cache, self._places, self._author = {}, {}, author
        view = AuthorsView(self, OF_AN_INSTANT)
        try:
            yield cast("State", view)
        finally:
            view.answered()
            self._cache, self._places = kept
            self._author = ""

    # -- what is drawn ----------------------------------------------------------------------

    def drawn_point(self, frame: Frame, offset: Array) -> Callable[[], Array]:
        """Where a point of a frame is now [m], shape (3,): worked out when it is drawn, maybe ticks later.

        Args:
            frame: The frame.
            offset: The point in it [m], shape (3,).

        Raises:
            Undecided: As `pose`.
        """
        self._require_frame(frame)
        return partial(self._drawn_points().point, frame, offset)

    def _drawn_points(self) -> DrawnPoints:
        placed: DrawnPoints | None = self._cache.get("placed once")
        if placed is None:
            placed = self._cache["placed once"] = DrawnPoints(self._xmat, self._xpos, self._drawn)
        return placed

    def drawn_points(self) -> Callable[[Frame, Array], Array]:
        """Where points of frames are in a tick that is `clear`: as `drawn_point`, of any of them.

        Raises:
            Undecided: It is not, so that each is to be asked for.
        """
        if not self.clear or self._author:
            raise Undecided("asked alone")
        return self._drawn_points().point

    # -- distances --------------------------------------------------------------------------

    def closest(self, gap: Gap, *, allow_estimated: bool = False, strayed: bool = False) -> Closest:
        """Where two sets are nearest; ``allow_estimated`` and ``strayed`` as in `require_bodies`."""
        self._relied_on_bodies(gap.bodies, allow_estimated, strayed)
        if self._author:
            return self._distances(gap.query, Per.SETS).at(0)
        return self._surveyor.closest(gap.query, self._rotations, self._positions)

    def closest_per_body(self, gap: Gap, *, allow_estimated: bool = False, strayed: bool = False) -> Closests:
        """Where each body of ``gap.b`` is nearest to ``gap.a``, in the order of ``gap.b``."""
        self._relied_on_bodies(gap.bodies, allow_estimated, strayed)
        return self._distances(gap.query, Per.BODY)

    def nearest(self, questions: tuple[tuple[Query, Per], ...]) -> tuple[Closests, list[int]]:
        """All distances of a tick that is `clear`, and where the answers to some questions begin among them.

        Raises:
            Undecided: It is not, or they are not asked together (yet), so that each is to be asked alone.
        """
        found = None
        if self.clear and not self._author:
            found = self._surveyor.together(questions, self._rotations, self._positions)
        if found is None:
            raise Undecided("asked alone")
        return found

    def distances(self, query: Query, per: Per, *, allow_estimated: bool = False) -> Closests:
        """What a query says now; ``allow_estimated`` as in `require_bodies`."""
        self.require_bodies(query.bodies, allow_estimated=allow_estimated)
        return self._distances(query, per)

    def _distances(self, query: Query, per: Per) -> Closests:
        found = self._surveyor.ask(query, per, self._rotations, self._positions)
        return deepcopy(found) if self._author else found
