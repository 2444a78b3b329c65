"""A headset in the hands of this run's own page: head, controllers or hands, and body joints.

The page (WebXR, ``local-floor``) sends what it sees over the connection it has anyway; who may connect is
the server's affair. Three points are no body: legs, pelvis and spine are estimated, and count as not
measured for ergonomics.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections import deque
from collections.abc import AsyncGenerator, Iterable
from contextlib import aclosing
from dataclasses import replace
from typing import Annotated, ClassVar

import numpy as np
from msgspec import Meta

from seerob.core.samples import Placing
from seerob.core.snapshot import Finding
from seerob.core.transforms import apply, inverse, turned
from seerob.description.capture.captured import CaptureFrame, Layout, Seen
from seerob.description.capture.mapping import conventions, plain
from seerob.devices.capture.options import placement
from seerob.devices.capture.stream_source import CaptureStream
from seerob.devices.live.headset_offers import Fit, Offer, Offers, Registering
from seerob.devices.live.listening import Contact, LiveSource, say_once
from seerob.protocols.tracking.vive import world_positions, world_turns

_log = logging.getLogger(__name__)

SILENCE = 2.0
"""Without an offer for so long, and for the source's ``timeout``, the connection counts as lost [s]."""
GATHER = 0.3
"""Names that appear later than this begin a new layout [s]."""
GUESSED = 0.3
"""Confidence of what the headset itself estimates; our choice."""
BODY = "hips"
"""Whoever sends this joint sends a body."""


class Headset(CaptureStream, frozen=True, kw_only=True):
    """A person who wears a headset that shows this run's page."""

    own_process: ClassVar[bool] = False
    """The page's server is of the run's own process."""
    frequency: Annotated[float, Meta(ge=30, le=144, extra={"unit": "Hz"})] = 72.0
    """Pictures per second of the headset [Hz]."""
    registration: Registering = Registering()
    """How its room is put in the cell, where something there is real."""

    def period(self) -> float:
        """Interval between samples that is expected [s]."""
        return 1 / self.frequency

    def contact(self) -> Contact:
        """Nobody: it comes over the page."""
        return Contact("takes what a headset sees", encrypted=None)

    async def ask(self) -> tuple[Finding, ...]:
        """What is to be said before anybody wears it."""
        text = (
            "waits for a page of this run that offers what a headset sees; with head and hands only, legs, "
            "pelvis and spine are estimated and count as not measured"
        )
        return (Finding(level="assumed", subject=self.human, text=f"headset: {text}"),)

    def taking(self, offers: Offers) -> LiveSource:
        """This source, which takes what pages of a run offer."""
        return _Taking(offers=offers, **{name: getattr(self, name) for name in self.__struct_fields__})

    def frames(self) -> AsyncGenerator[tuple[Layout, CaptureFrame], None]:
        """What the page offers; nothing without a run that has one.

        Raises:
            TimeoutError: No page offers anything.
        """
        return self._frames(Offers())

    async def _frames(self, place: Offers) -> AsyncGenerator[tuple[Layout, CaptureFrame], None]:
        layout: Layout | None = None
        known: set[str] = set()
        begun: float | None = None
        last, wearer = -1.0, 0
        async with aclosing(self._offers(place)) as offers:
            async for offer in offers:
                begun = offer.arrived if begun is None else begun
                fresh = set(offer.names) - known
                if layout is None or (BODY in fresh and BODY not in layout.names):
                    known |= set(offer.names)
                    if offer.arrived - begun < GATHER:
                        continue
                    layout = layout_of(known)
                    self._tell(layout)
                if offer.wearer != wearer:  # another page has another clock
                    last, wearer = -1.0, offer.wearer
                if offer.t <= last:
                    continue
                last = offer.t
                yield layout, self._placed(frame(offer, layout), offer)

    def _stated(self) -> Placing | None:
        """How well the file says that its ``at`` is known; None where it does not."""
        known = self.registration
        if known.at is None or known.at_turn is None:
            return None
        covariance = np.diag([known.at**2] * 3 + [known.at_turn**2] * 3)
        return Placing(covariance=tuple(covariance.ravel().tolist()), about=self.at.position)

    def _placed(self, said: CaptureFrame, offer: Offer) -> CaptureFrame:
        """What was said, so that ``at`` puts it where the room lies, and how well that is known."""
        if offer.cell_from_room is not None:
            T = inverse(placement(self.at)) @ offer.cell_from_room
            assert said.orientations is not None  # of a headset
            with np.errstate(all="ignore"):
                turns = turned(T[:3, :3], said.orientations)
                said = replace(said, positions=apply(T, said.positions), orientations=turns)
            known = offer.placing
        else:
            known = self._stated() or offer.placing
        # Whoever works at another scale is nowhere in the cell, however well the room is known to lie.
        return replace(said, placing=at_scale(offer.scale) or known)

    def _tell(self, layout: Layout) -> None:
        if BODY not in layout.names:
            text = "head and hands only: legs, pelvis and spine are estimated, not measured"
            say_once(_log, logging.WARNING, f"{self.name or f'headset {self.human}'}: {text}")

    async def _offers(self, place: Offers) -> AsyncGenerator[Offer, None]:
        loop = asyncio.get_running_loop()
        waiting: deque[Offer] = deque(maxlen=64)
        arrived = asyncio.Event()
        key = object()
        silence = max(SILENCE, self.timeout)
        # Whoever comes in late is taken at once: that nobody was there is said once.
        patience = None if place.was_silent(self.human) else silence

        def take(offer: Offer) -> None:
            waiting.append(offer)
            with contextlib.suppress(RuntimeError):  # the loop ended meanwhile
                loop.call_soon_threadsafe(arrived.set)

        place.wait(self.human, key, take, self.registration)
        try:
            while True:
                try:
                    async with asyncio.timeout(patience):
                        await arrived.wait()
                except TimeoutError as error:
                    place.silent(self.human)
                    what = f"no page offers a headset of {self.human!r}"
                    raise TimeoutError(what) from error
                arrived.clear()
                patience = silence
                while waiting:
                    yield waiting.popleft()
        finally:
            place.leave(self.human, key)


class _Taking(Headset, frozen=True, kw_only=True):
    """A headset of a run that shows pages."""

    offers: Offers

    def frames(self) -> AsyncGenerator[tuple[Layout, CaptureFrame], None]:
        return self._frames(self.offers)

    def fitted(self, said: str, taller: float | None, *, accepted: bool) -> None:
        self.offers.fit(self.human, Fit(accepted, said, taller))


def layout_of(names: Iterable[str]) -> Layout:
    """Rows for what is of use: the names that mean a bone, or all when none does."""
    every = sorted(set(names))
    places = conventions()["webxr"].places
    useful = [name for name in every if plain(name) in places] or every
    seen = Seen.JOINTS if BODY in useful else Seen.TRACKERS
    return Layout(seen=seen, names=tuple(useful), convention="webxr")


def at_scale(scale: float) -> Placing | None:
    """What is known of where somebody is who sees the twin at a scale; None of the twin's own, 1.

    Their postures are theirs, in their own metres. Where their hands are in the twin's, how fast and how
    heavy, is that of nobody whom ISO 13855 or ISO/TS 15066 speaks of.
    """
    if scale == 1:
        return None
    larger = f"{scale:g} times as large as the twin" if scale > 1 else f"{1 / scale:g} times smaller"
    what = "limits of the workstation are for people of its own scale"
    return Placing(reason=f"works at scale {scale:g}, {larger}: {what}")


def frame(offer: Offer, layout: Layout) -> CaptureFrame:
    """An offer in the rows of a layout, with z up; NaN for what is not tracked."""
    rows = {name: row for row, name in enumerate(offer.names)}
    n = len(layout.names)
    positions, turns, sure = np.full((n, 3), np.nan), np.full((n, 4), np.nan), np.zeros(n)
    for row, name in enumerate(layout.names):
        found = rows.get(name)
        if found is not None:
            positions[row], turns[row] = offer.positions[found], offer.wxyz[found]
            sure[row] = GUESSED if offer.guessed[found] else 1.0
    with np.errstate(all="ignore"):  # what is not finite is left out where it is used
        return CaptureFrame(
            t=offer.t,
            positions=world_positions(positions),
            orientations=world_turns(turns),
            confidence=sure,
            pose=offer.stands,
            wearer=offer.wearer,
        )
