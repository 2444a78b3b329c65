"""From MVN's datagrams to frames of a person: the best pose that is sent, its unit, and what is doubtful.

Nothing that comes over a network ends it: what cannot be understood is counted and told once.
"""

from __future__ import annotations

import logging
import math
from collections import Counter
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np

from seerob.core.transforms import Array
from seerob.description.capture.captured import CaptureFrame, Layout, Seen
from seerob.devices.capture.xsens import anatomical, differences
from seerob.devices.live.listening import say_once
from seerob.protocols import ProtocolError
from seerob.protocols.tracking.mvn import Assembly, Items, Kind, Scale, Tags, decode
from seerob.protocols.tracking.mvn_pose import METRES, POSES, Up, looks_y_up, pose, unit_of
from seerob.protocols.tracking.mvn_segments import JOINTS, PARENTS, SEGMENTS

_log = logging.getLogger(__name__)

BETTER_GONE = 1.0
"""A kind that says more and was not heard for so long [s] is not waited for."""
MOST_CHARACTERS = 16
CHECK_EVERY = 30
"""Samples between two comparisons of joint angles."""
AGREE = math.radians(1.0)
_PAIRS = {(SEGMENTS.index(p) + 1, SEGMENTS.index(c) + 1): k for k, (_, p, c) in enumerate(JOINTS)}


class Unit(StrEnum):
    """Unit of the positions in the stream."""

    GUESS = "guess"
    """From the length of the trunk."""
    M = "m"
    CM = "cm"


@dataclass
class Character:
    """One person in the stream."""

    kind: Kind | None = None
    heard: float = -math.inf
    """When a sample of that kind was whole, on the host's clock [s]."""
    unit: str | None = None
    name: str = ""
    stature: float | None = None
    """Top of the head in the T-pose [m]."""
    time_code: int = -1
    sample: int = -1
    posed: tuple[int, Array] | None = None
    """Sample and orientations of the latest pose."""
    checks: int = 0
    off: float = 0.0
    """Largest difference of joint angles from those of the segments [rad]."""
    segments: dict[str, tuple[float, float, float]] = field(default_factory=dict)


class Frames:
    """What one connection has said so far.

    Attributes:
        characters: By number.
        kinds: Datagrams of each kind.
        refused: Datagrams that could not be understood.
        assembly: Its losses.
    """

    def __init__(self, *, unit: Unit = Unit.GUESS, up: Up = Up.Z, who: str = "mvn") -> None:
        self._unit, self._up, self._who = unit, up, who
        self.characters: dict[int, Character] = {}
        self.kinds: Counter[str] = Counter()
        self.refused = 0
        self.assembly = Assembly()
        self._layouts: dict[tuple[str, ...], Layout] = {}
        self._told: set[str] = set()

    def feed(self, data: bytes, arrived: float) -> tuple[Layout, CaptureFrame] | None:
        """The frame that a datagram completes, if it does.

        Args:
            data: The datagram.
            arrived: Host's monotonic time [s].
        """
        try:
            return self._feed(data, arrived)
        except ProtocolError as error:
            self.refused += 1
            self._tell("refused", f"a datagram is not understood: {error}; more of them are counted only")
            return None

    def _feed(self, data: bytes, arrived: float) -> tuple[Layout, CaptureFrame] | None:
        datagram = decode(data)
        header = datagram.header
        self.kinds[f"{header.kind:02d}" if header.kind is not None else "other"] += 1
        who = self._character(header.character)
        if isinstance(datagram, Tags):
            who.name = datagram.tags.get("name", who.name)[:80]
        elif isinstance(datagram, Scale):
            _scale(who, datagram)
        elif isinstance(datagram, Items):
            if header.kind is Kind.ANGLES:
                self._compare(who, datagram)
            elif header.kind in POSES:
                return self._pose(who, datagram, arrived)
        return None

    def _character(self, number: int) -> Character:
        if number not in self.characters and len(self.characters) >= MOST_CHARACTERS:
            raise ProtocolError(f"more than {MOST_CHARACTERS} characters")
        return self.characters.setdefault(number, Character())

    def _pose(self, who: Character, datagram: Items, arrived: float) -> tuple[Layout, CaptureFrame] | None:
        kind = datagram.header.kind
        assert kind is not None  # one of POSES
        if (
            who.kind is not None
            and POSES.index(kind) > POSES.index(who.kind)
            and arrived - who.heard < BETTER_GONE
        ):
            return None
        whole = self.assembly.feed(datagram)
        if whole is None:
            return None
        names, positions, turns = pose(whole, up=self._up, lengths=1.0)
        if who.kind is not kind:
            who.kind, who.unit = kind, None
        who.heard = arrived
        header = whole.header
        if who.unit is None:
            who.unit = self._decide(positions, header.character, kind)
        metres = METRES[who.unit] if who.unit is not None else math.nan
        body = turns[: len(SEGMENTS)]
        who.posed = header.sample, body
        return self._layout(names), CaptureFrame(
            t=self._time(who, header.time_code, header.sample),
            positions=metres * positions,
            orientations=turns,
            subject=str(header.character),
        )

    def _decide(self, positions: Array, character: int, kind: Kind) -> str | None:
        """The unit of a character's positions; None as long as it is not clear."""
        guessed = unit_of(positions)
        if kind is Kind.QUATERNION and self._up is Up.Z and looks_y_up(positions):
            self._tell("up", f'character {character} is upright along y: if it stands, give up = "y"')
        if self._unit is not Unit.GUESS:
            if guessed is not None and guessed != self._unit:
                text = f"in {self._unit} its trunk is no person's, in {guessed} it is"
                self._tell("unit", f"character {character}: {text}")
            return str(self._unit)
        if guessed is None:
            self._tell("unit", f"character {character}: in no unit its trunk is a person's; no positions")
        else:
            self._tell(
                "unit", f"character {character}: positions are in {guessed}, by the length of its trunk"
            )
        return guessed

    def _layout(self, names: tuple[str, ...]) -> Layout:
        if names not in self._layouts:
            parents = (*PARENTS, *(-1 for _ in names[len(SEGMENTS) :]))
            self._layouts = {names: Layout(Seen.SEGMENTS, names, "xsens", parents)}
        return self._layouts[names]

    @staticmethod
    def _time(who: Character, time_code: int, sample: int) -> float:
        """On MVN's clock [s]; NaN when that stands still, as it may when nothing is recorded."""
        stands = time_code == who.time_code and sample != who.sample
        who.time_code, who.sample = time_code, sample
        return math.nan if stands else time_code / 1000

    def _compare(self, who: Character, datagram: Items) -> None:
        """Joint angles against those of the segments, now and then."""
        who.checks += 1
        if who.posed is None or who.checks % CHECK_EVERY != 1 or who.posed[0] != datagram.header.sample:
            return
        angles = np.full((len(JOINTS), 3), np.nan)
        for (parent, child), values in zip((datagram.ids >> 8).tolist(), datagram.numbers(), strict=True):
            if (parent, child) in _PAIRS:
                angles[_PAIRS[parent, child]] = np.radians(values)
        with np.errstate(invalid="ignore"):
            off = differences(anatomical(who.posed[1]), angles)
        if np.isfinite(off).any():
            who.off = max(who.off, float(np.nanmax(off)))
        if who.off > AGREE:
            text = f"its joint angles differ from those of its segments by {math.degrees(who.off):.1f}°"
            self._tell("angles", f"character {datagram.header.character}: {text}; the segments are used")

    def _tell(self, about: str, text: str) -> None:
        if about not in self._told:
            self._told.add(about)
            level = logging.INFO if text.endswith("trunk") else logging.WARNING
            say_once(_log, level, f"{self._who}: {text}")


def _scale(who: Character, scale: Scale) -> None:
    known = {name.replace(" ", ""): position for name, position in scale.segments}
    if known:
        who.segments = known
    for point in scale.points:
        if point.name == "pTopOfHead" and "Head" in who.segments:
            body = np.array([who.segments.get(name, (math.nan,) * 3) for name in SEGMENTS])
            unit = unit_of(body)
            height = who.segments["Head"][2] + point.position[2]
            if unit is not None and math.isfinite(height):
                who.stature = METRES[unit] * height
