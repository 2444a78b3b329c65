"""What people do in the twin's room: workpieces that their hands hold, controls that they pull.

The pages of a run say it over the connection they have anyway, in a headset or with a mouse; who may is the
server's affair. A page that leaves lets go of everything.
"""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections import deque
from collections.abc import AsyncGenerator
from typing import ClassVar

from seerob.core.quantities import Seconds
from seerob.core.samples import GrabSample, Sample, SignalSample
from seerob.core.snapshot import Finding, Grab, Pull
from seerob.devices.live.doings import Doing
from seerob.devices.live.headset_offers import Offers
from seerob.devices.live.listening import Contact, LiveSource
from seerob.workstation.source import Target
from seerob.workstation.tables.controls import Control, ControlKind
from seerob.workstation.variables import Kind, Value

BEAT = 0.05
"""Controls are told at least this often [s]."""
HELD = 0.5
"""An enabling switch of which nobody says for so long that it is held is let go [s]; our choice."""
MOST_WAITING = 256


class Room(LiveSource, frozen=True, kw_only=True):
    """What people do in the twin: workpieces that hands take, and ``[[controls]]`` that they pull."""

    own_process: ClassVar[bool] = False
    """The page's server is of the run's own process."""
    reads_variables: ClassVar[bool] = True
    pulled: ClassVar[bool] = True
    asked: ClassVar[bool] = True
    tells_changes: ClassVar[bool] = True
    timeout: Seconds = 1.0
    """Age at which what it said no longer counts [s], beside the time-out of each variable."""

    def period(self) -> float:
        """Interval between samples that is expected [s]."""
        return BEAT

    def behind(self) -> float:
        """Nothing: what is done counts from when it is heard."""
        return 0.0 if self.delay is None else self.delay

    def contact(self) -> Contact:
        """Nobody: it comes over the page."""
        return Contact("takes what people do in the room", encrypted=None)

    async def ask(self) -> tuple[Finding, ...]:
        """Nothing is to be said before anybody does anything."""
        return ()

    def taking(self, offers: Offers) -> LiveSource:
        """This source, which takes what visitors of a run do."""
        return _Taking(offers=offers, **{name: getattr(self, name) for name in self.__struct_fields__})

    def listen(self, target: Target | None) -> AsyncGenerator[Sample, None]:
        """Controls as they stand; nobody pulls them without a run that has pages."""
        return self._listen(target, Offers())

    async def _listen(self, target: Target | None, offers: Offers) -> AsyncGenerator[Sample, None]:
        room = _Things(() if target is None else target.controls, target)
        loop, arrived, key = asyncio.get_running_loop(), asyncio.Event(), object()

        def take(doing: Doing) -> str:
            refusal = room.take(doing)
            with contextlib.suppress(RuntimeError):  # the loop ended meanwhile
                loop.call_soon_threadsafe(arrived.set)
            return refusal

        offers.doings.wait(key, take)
        try:
            while True:
                with contextlib.suppress(TimeoutError):
                    async with asyncio.timeout(BEAT):
                        await arrived.wait()
                arrived.clear()
                for sample in room.samples(time.monotonic()):
                    yield sample
        finally:
            offers.doings.leave(key)


class _Taking(Room, frozen=True, kw_only=True):
    """The room of a run that shows pages."""

    offers: Offers

    def listen(self, target: Target | None) -> AsyncGenerator[Sample, None]:
        return self._listen(target, self.offers)


class _Things:
    """What hands hold and how controls stand.

    Args:
        controls: That people may pull.
        target: With the variables that they set.
    """

    def __init__(self, controls: tuple[Control, ...], target: Target | None) -> None:
        self._controls = {control.name: control for control in controls}
        kinds = {v.name: v.type for v in (() if target is None else target.variables)}
        self._bools = {c.name for c in controls if kinds.get(c.sets, Kind.BOOL) is Kind.BOOL}
        self._values = {control.name: control.start for control in controls}
        self._held: dict[str, tuple[object, float]] = {}
        """Control that is held → by whom, and when that was said last [s]."""
        self._hands: dict[str, object] = {}
        self._grabs: deque[tuple[str, str]] = deque(maxlen=MOST_WAITING)

    def take(self, doing: Doing) -> str:
        """Take what somebody does; why not. Called in the server's thread."""
        what = doing.what
        if what is None:
            for hand in [hand for hand, who in tuple(self._hands.items()) if who is doing.visitor]:
                del self._hands[hand]
                self._grabs.append((hand, ""))
            for name, (who, _) in tuple(self._held.items()):
                if who is doing.visitor:
                    self._let_go(name)
            return ""
        if isinstance(what, Grab):
            if what.piece:
                self._hands[what.hand] = doing.visitor
            else:
                self._hands.pop(what.hand, None)
            self._grabs.append((what.hand, what.piece))
            return ""
        return self._pull(what, doing.visitor)

    def _pull(self, what: Pull, visitor: object) -> str:
        control = self._controls.get(what.control)
        if control is None:
            return f"no control named {what.control!r}"
        if refusal := control.refusal(what.value):
            return refusal
        if control.held:
            holder = self._held.get(control.name)
            if holder is not None and holder[0] is not visitor:
                return f"{control.name}: somebody else holds it"
            if not what.value:
                self._let_go(control.name)
                return ""
            self._held[control.name] = visitor, time.monotonic()
        self._values[control.name] = what.value
        return ""

    def _let_go(self, name: str) -> None:
        self._held.pop(name, None)
        self._values[name] = 0.0

    def samples(self, now: float) -> list[Sample]:
        """What is so now, at the host's monotonic time [s]."""
        for name, (_, said) in tuple(self._held.items()):
            if self._controls[name].kind is ControlKind.ENABLING and now - said > HELD:
                self._let_go(name)
        found: list[Sample] = []
        while self._grabs:
            hand, piece = self._grabs.popleft()
            found.append(GrabSample(source="", seq=0, t=now, target=hand, piece=piece))
        values: dict[str, Value] = {
            control.sets: bool(self._values[name]) if name in self._bools else self._values[name]
            for name, control in self._controls.items()
        }
        return [*found, SignalSample(source="", seq=0, t=now, values=values)]
