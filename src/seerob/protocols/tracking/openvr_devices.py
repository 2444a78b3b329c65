"""Poses of the devices of SteamVR on this computer, through the package ``openvr`` (extra ``vive``)."""

from __future__ import annotations

import time
from types import TracebackType
from typing import Any, Self

import numpy as np

from seerob.core.transforms import wxyz_from_rotation
from seerob.protocols import ProtocolError
from seerob.protocols.tracking.vive import MOST_DEVICES, Device, Devices, device

HMD, CONTROLLER, TRACKER = 1, 2, 3
"""``TrackedDeviceClass``."""
SIDES = {1: "left_hand", 2: "right_hand"}
"""``TrackedControllerRole``."""
LOOK_AGAIN = 100
"""Readings between two looks at serial numbers and roles, which change rarely."""


class OpenVr:
    """SteamVR's devices; open while used as a context.

    Args:
        openvr: The package, or something with the same functions; imported when not given.
    """

    def __init__(self, openvr: Any = None) -> None:
        self._openvr = openvr
        self._system: Any = None
        self._known: dict[int, tuple[str, str]] = {}
        self._readings = 0
        self._epoch = 0

    def __enter__(self) -> Self:
        """Connect to SteamVR.

        Raises:
            ProtocolError: The package is not installed, or SteamVR does not run.
        """
        if self._openvr is None:
            try:
                import openvr  # type: ignore[import-not-found,unused-ignore]
            except ImportError as error:
                what = 'the package openvr is not installed: pip install "seerob[vive]"'
                raise ProtocolError(what) from error
            self._openvr = openvr
        try:
            # In the background: SteamVR is not started for our sake, and nothing is drawn.
            self._system = self._openvr.init(self._openvr.VRApplication_Background)
        except Exception as error:  # its errors have no base class in all versions
            raise ProtocolError(f"SteamVR cannot be reached: {type(error).__name__} {error}") from error
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._system = None
        self._openvr.shutdown()

    def read(self) -> Devices:
        """All devices now."""
        vr = self._openvr
        self._events()
        poses = self._system.getDeviceToAbsoluteTrackingPose(
            vr.TrackingUniverseStanding, 0.0, [vr.TrackedDevicePose_t() for _ in range(MOST_DEVICES)]
        )
        if self._readings % LOOK_AGAIN == 0:
            self._known = {}
        self._readings += 1
        found: dict[str, Device] = {}
        for index in range(min(len(poses), MOST_DEVICES)):
            pose = poses[index]
            if not pose.bDeviceIsConnected:
                self._known.pop(index, None)
                continue
            serial, role = self._name(index)
            if not serial or (not role and self._system.getTrackedDeviceClass(index) != TRACKER):
                continue
            found[serial] = _device(serial, role, pose)
        return Devices(time.monotonic(), tuple(found.values()), self._epoch)

    def _name(self, index: int) -> tuple[str, str]:
        """Serial number and role; empty for lighthouses and the like."""
        if index in self._known:
            return self._known[index]
        vr, kind = self._openvr, self._system.getTrackedDeviceClass(index)
        named = "", ""
        if kind in (HMD, CONTROLLER, TRACKER):
            serial = self._text(index, vr.Prop_SerialNumber_String)
            role = "head"
            if kind == TRACKER:
                role = self._text(index, vr.Prop_ControllerType_String)
            elif kind == CONTROLLER:
                role = SIDES.get(int(self._system.getControllerRoleForTrackedDeviceIndex(index)), "")
            # A tracker without a part of the body is of that type and no more.
            named = serial, "" if role in ("vive_tracker", "vive_tracker_handed") else role
        self._known[index] = named
        return named

    def _text(self, index: int, what: int) -> str:
        try:
            said = self._system.getStringTrackedDeviceProperty(index, what)
        except Exception:  # a property that a device does not have is an error there
            return ""
        return said.decode("utf-8", "replace") if isinstance(said, bytes) else str(said)

    def _events(self) -> None:
        """Notice when the origin is set anew."""
        vr = self._openvr
        anew = {
            getattr(vr, name, -1)
            for name in (
                "VREvent_ChaperoneUniverseHasChanged",
                "VREvent_StandingZeroPoseReset",
                "VREvent_SeatedZeroPoseReset",
            )
        }
        event = vr.VREvent_t()
        for _ in range(256):
            said = self._system.pollNextEvent(event)
            if not (said[0] if isinstance(said, tuple) else said):
                return
            self._epoch += (said[1] if isinstance(said, tuple) else event).eventType in anew


def _device(serial: str, role: str, pose: Any) -> Device:
    matrix = np.array([[float(pose.mDeviceToAbsoluteTracking[i][j]) for j in range(4)] for i in range(3)])
    usable = bool(pose.bPoseIsValid) and bool(np.isfinite(matrix).all())
    return device(
        serial,
        role,
        tracking=usable,
        result=int(pose.eTrackingResult),
        position=matrix[:, 3].tolist(),
        wxyz=wxyz_from_rotation(matrix[:, :3]).tolist() if usable else None,
    )
