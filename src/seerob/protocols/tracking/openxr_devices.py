"""Poses of worn trackers that an OpenXR runtime on this computer sees (extra ``openxr``).

What a runtime says becomes the message of `seerob.protocols.tracking.vive`; its calls are in
`seerob.protocols.tracking.openxr_session`. Source: ``XR_HTCX_vive_tracker_interaction`` of the OpenXR
registry.
"""

from __future__ import annotations

import re
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import Protocol, Self

from seerob.protocols.tracking.vive import MOST_DEVICES, RUNNING_OK, Device, Devices, device, plain_role

ROLES = tuple(
    f"/user/vive_tracker_htcx/role/{name}"
    for name in (
        "waist", "chest", "left_foot", "right_foot", "left_knee", "right_knee",
        "left_elbow", "right_elbow", "left_shoulder", "right_shoulder",
    )
)  # fmt: skip
"""Where on a body a tracker may be worn; camera, keyboard and what is held are no part of one."""
_SERIAL = re.compile(r"LH[RB]-[0-9A-Z]{6,12}")
LONGEST = 128
"""Characters of a serial number."""


@dataclass(frozen=True)
class Located:
    """Where a tracker is, as the runtime has it."""

    tracked: bool
    """Position and orientation are valid and tracked now; a held-over pose is not."""
    position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """x right, y up, -z forward [m]."""
    xyzw: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)
    """Space from tracker; OpenXR has w last."""


class Runtime(Protocol):
    """What is needed of a runtime."""

    def begin(self) -> None:
        """Begin a session, or raise `ProtocolError`."""

    def end(self) -> None:
        """End it."""

    def frame(self) -> bool:
        """Wait for the next instant; whether the origin was set anew since the last."""

    def trackers(self) -> Sequence[tuple[str, str]]:
        """Persistent path and role path (empty without a role) of every tracker that is connected."""

    def locate(self, path: str) -> Located:
        """Where the tracker of a role path or a persistent path is at that instant."""


class OpenXr:
    """An OpenXR runtime's trackers; open while used as a context.

    Args:
        runtime: Of `seerob.protocols.tracking.openxr_session`, or something with the same functions.
        clock: Monotonic time [s].
    """

    def __init__(self, runtime: Runtime, *, clock: Callable[[], float] = time.monotonic) -> None:
        self._runtime, self._clock, self._epoch = runtime, clock, 0

    def __enter__(self) -> Self:
        """Begin.

        Raises:
            ProtocolError: The package is not installed, or the runtime has no trackers to offer.
        """
        self._runtime.begin()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._runtime.end()

    def read(self) -> Devices:
        """All trackers now."""
        self._epoch += self._runtime.frame()
        connected = list(dict(self._runtime.trackers()).items())[:MOST_DEVICES]
        names = serials([path for path, _ in connected])
        worn = Counter(role for _, role in connected if role)
        devices = [
            # One pose for a role that two trackers have: nobody knows whose it is.
            _device(
                name, role, Located(tracked=False) if worn[role] > 1 else self._runtime.locate(role or path)
            )
            for name, (path, role) in zip(names, connected, strict=True)
        ]
        return Devices(self._clock(), tuple(devices), self._epoch)


def serials(paths: Sequence[str]) -> list[str]:
    """Names of trackers by their persistent paths: as OpenVR calls them where that can be read from them.

    Runtimes are free in what a persistent path is. SteamVR's ends in the serial number, so that
    ``trackers`` of the source need not change with the interface; any other name is the path's last part,
    and the whole path where that would name two alike.
    """
    found = [m[0] if (m := _SERIAL.search(path)) else path.rstrip("/").rpartition("/")[2] for path in paths]
    times = Counter(found)
    return [
        name if name and times[name] == 1 else path[-LONGEST:]
        for name, path in zip((n[:LONGEST] for n in found), paths, strict=True)
    ]


def _device(name: str, role: str, seen: Located) -> Device:
    x, y, z, w = seen.xyzw
    return device(
        name,
        plain_role(role),
        tracking=seen.tracked,
        result=RUNNING_OK,
        position=seen.position,
        wxyz=(w, x, y, z),
    )
