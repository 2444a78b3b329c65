"""Worn trackers as captured motion: names by serial number or role, and when their origin has moved."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping

import numpy as np

from seerob.core.errors import InputError, Problem
from seerob.core.snapshot import Finding
from seerob.core.transforms import Array
from seerob.description.capture.captured import CaptureFrame, Layout, Seen
from seerob.protocols.tracking.vive import Device, Devices, missing, plain_role

LEAP = 0.15
"""Devices that leap by more than this together, as one rigid thing [m]: the origin was set anew."""
SPEED = 10.0
"""No part of a person at work is faster [m/s]."""
RIGID, MOST_DISTANCE = 0.02, 3.0
"""Distances between devices that differ by less [m], and by less per second [m/s], changed by moving."""


class Names:
    """Which row of the frames each device is: by serial number first, by role otherwise.

    Args:
        given: Serial number → role, the user's.
        mapped: Names that the user's mapping has; a serial number among them stays one.
    """

    def __init__(self, given: Mapping[str, str], mapped: Collection[str]) -> None:
        self._given = {serial: plain_role(role) for serial, role in given.items()}
        self._mapped = frozenset(mapped)
        self.of: dict[str, str] = {s: s if s in self._mapped else role for s, role in self._given.items()}
        """Serial number → name; grows with `learn`."""
        self.doubled: dict[str, str] = {}
        """Serial number → role that another device has already."""

    def learn(self, devices: Iterable[Device]) -> None:
        """Take in the devices of an instant."""
        for device in devices:
            serial = device.serial
            if serial in self.of:
                continue
            name = serial if serial in self._mapped else device.role or serial
            if name in self.of.values():
                self.doubled[serial] = name
                name = serial
            self.of[serial] = name

    def layout(self) -> Layout:
        """Rows for what is known now."""
        return Layout(seen=Seen.TRACKERS, names=tuple(self.of.values()), convention="trackers")


def check(given: Mapping[str, str], file: str) -> None:
    """That every serial number has a role of its own.

    Raises:
        InputError: Each that has none, or another one's.
    """
    roles = [plain_role(role) for role in given.values()]
    problems = [
        Problem(
            file,
            f"trackers.{serial}",
            f"{role!r} is worn by another one, or empty",
            "give each its own, such as left_foot",
        )
        for serial, role in given.items()
        if not plain_role(role) or roles.count(plain_role(role)) > 1
    ]
    if problems:
        raise InputError(problems)


def frame(instant: Devices, serials: Mapping[str, int]) -> CaptureFrame:
    """One instant as a frame.

    Args:
        instant: Devices that are not among ``serials`` are left out.
        serials: Serial number → row.
    """
    positions = np.full((len(serials), 3), np.nan)
    turns = np.full((len(serials), 4), np.nan)
    for device in instant.devices:
        row = serials.get(device.serial)
        if row is not None and device.tracking:
            positions[row], turns[row] = device.position, device.wxyz
    return CaptureFrame(t=instant.t, positions=positions, orientations=turns)


class OriginWatch:
    """Notices when the runtime's origin was set anew: from then on nobody knows where the devices are."""

    def __init__(self) -> None:
        self._epoch: int | None = None
        self._before: Devices | None = None
        self.moved_at: float | None = None
        """When, on the device's clock [s]."""

    def trusted(self, instant: Devices) -> bool:
        """Whether positions of this instant are still those of the first origin."""
        if self._epoch is None:
            self._epoch = instant.epoch
        if self.moved_at is None and (instant.epoch != self._epoch or self._leapt(instant)):
            self.moved_at = instant.t
        if any(device.tracking for device in instant.devices):
            self._before = instant
        return self.moved_at is None

    def _leapt(self, instant: Devices) -> bool:
        if self._before is None:
            return False
        old = {d.serial: d.position for d in self._before.devices if d.tracking}
        pairs = [(old[d.serial], d.position) for d in instant.devices if d.tracking and d.serial in old]
        if len(pairs) < 2:
            return False
        since = max(instant.t - self._before.t, 0.0)
        if not max([math.dist(a.tolist(), b.tolist()) for a, b in pairs]) > LEAP + SPEED * since:
            return False
        before, now = np.array([p[0] for p in pairs]), np.array([p[1] for p in pairs])
        return bool(np.abs(_distances(now) - _distances(before)).max() < RIGID + MOST_DISTANCE * since)


def _distances(points: Array) -> Array:
    return np.asarray(np.linalg.norm(points[:, None] - points[None], axis=-1))


def remarks(names: Names, devices: Iterable[Device], subject: str) -> tuple[Finding, ...]:
    """What is to be said of the devices that there are."""
    found = {device.serial: device for device in devices}
    shown = ", ".join(
        f"{serial}{f' ({names.of[serial]})' if names.of.get(serial, serial) != serial else ''}"
        for serial in sorted(found)
    )
    said = [("note", f"devices: {shown or 'none'}")]
    lacking = missing(tuple(names.of.values()))
    if lacking:
        text = f"no tracker for {', '.join(lacking)}: those bones are estimated, not measured"
        said.append(("warning", f"{text}; a whole body needs waist, both feet and both hands or arms"))
    for serial, role in names.doubled.items():
        said.append(("warning", f"{serial} has the role {role} of another one: give trackers their roles"))
    absent = [serial for serial in names.of if serial not in found]
    if absent:
        said.append(("warning", f"not there: {', '.join(absent)} (switched off, or asleep)"))
    blind = [serial for serial, device in found.items() if not device.tracking]
    if blind:
        said.append(
            ("warning", f"not tracking: {', '.join(sorted(blind))} (out of sight of the lighthouses)")
        )
    return tuple(Finding(level=level, subject=subject, text=text) for level, text in said)
