"""Trackers worn on the body (Vive and others of OpenVR, OpenXR): our live message, a line of a recording.

SteamVR runs on another computer as a rule, so that a small program there says what it sees. Positions and
rotations stay as OpenVR has them (x right, y up, -z forward; metres) on the wire; here z is up.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import msgspec
import numpy as np
from msgspec import Meta, Struct

from seerob.core.transforms import Array, turned
from seerob.protocols import ProtocolError
from seerob.protocols.links.live_messages import MAX_MESSAGE

WORLD_FROM_XR = np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""x forward, y left, z up from x right, y up, z backward; a rotation."""


def world_positions(positions: Array) -> Array:
    """Positions with z up [m], shape (..., 3), of a headset's [m]."""
    return np.asarray(positions @ WORLD_FROM_XR.T)


def world_turns(wxyz: Array) -> Array:
    """World (z up) from device, w first, shape (..., 4), of a headset's rotations w first."""
    return turned(WORLD_FROM_XR, wxyz)


def xr_positions(positions: Array) -> Array:
    """Inverse of `world_positions`."""
    return np.asarray(positions @ WORLD_FROM_XR)


def xr_turns(wxyz: Array) -> Array:
    """Inverse of `world_turns`."""
    return turned(WORLD_FROM_XR.T, wxyz)


PORT = 9872
"""Of our live message, UDP and WebSocket alike; not taken by anybody we know."""
VERSION = "vive/1"
MOST_DEVICES = 64
"""OpenVR's own bound."""
RUNNING_OK = 200
"""``TrackingResult_Running_OK``: any other is out of range, calibrating or rotation only."""
LEAST = ("waist", "feet", "hands or arms")
"""Without trackers there, a whole body cannot be followed (five devices)."""

_ROLE = re.compile(r"(?:^/user/vive_tracker_htcx/role/|^/user/hand/|^/user/|^vive_tracker_|^tracker_role_)")
_HANDS = {"left": "left_hand", "right": "right_hand"}
_Text = Annotated[str, Meta(max_length=128)]
_Number = float | None


class DeviceObject(Struct, kw_only=True, omit_defaults=True):
    """One device, as the message has it."""

    serial: Annotated[str, Meta(min_length=1, max_length=128)]
    role: _Text = ""
    """Role in the runtime: ``vive_tracker_waist``, ``/user/vive_tracker_htcx/role/waist``, ``waist``."""
    tracking: bool = True
    """``bPoseIsValid`` of OpenVR; the location is valid and tracked in OpenXR."""
    result: int = RUNNING_OK
    """``eTrackingResult`` of OpenVR."""
    position: tuple[_Number, _Number, _Number] | None = None
    rotation: tuple[_Number, _Number, _Number, _Number] | None = None
    """w, x, y, z."""


class MessageObject(Struct, kw_only=True, omit_defaults=True):
    """One instant, as the message has it."""

    seerob: str
    """``vive/1``."""
    t: Annotated[float, Meta(ge=0, le=1e12)]
    """On the sender's clock [s]."""
    epoch: Annotated[int, Meta(ge=0, le=2**53)] = 0
    """Counts how often the origin was set anew."""
    devices: Annotated[list[DeviceObject], Meta(max_length=MOST_DEVICES)] = []


@dataclass(frozen=True, eq=False, slots=True)
class Device:
    """One device at one instant, with z up."""

    serial: str
    role: str
    """Plain, such as ``left_foot``; empty when the runtime gives none."""
    tracking: bool
    """Whether position and rotation are measured now."""
    position: Array
    """[m], shape (3,); NaN when not tracking."""
    wxyz: Array
    """World from device, shape (4,); NaN when not tracking."""
    result: int = RUNNING_OK


@dataclass(frozen=True, eq=False, slots=True)
class Devices:
    """All devices at one instant."""

    t: float
    """[s]"""
    devices: tuple[Device, ...]
    epoch: int = 0


_messages = msgspec.json.Decoder(MessageObject)
_encode = msgspec.json.Encoder().encode


def plain_role(role: str) -> str:
    """``waist`` of ``vive_tracker_waist`` or ``/user/vive_tracker_htcx/role/waist``."""
    name = _ROLE.sub("", role.strip().lower())
    return _HANDS.get(name, name)


def decode(data: bytes | str) -> Devices:
    """One message.

    Raises:
        ProtocolError: It is not such a message.
    """
    if len(data) > MAX_MESSAGE:
        raise ProtocolError(f"a message of {len(data)} bytes, more than {MAX_MESSAGE}")
    try:
        said = _messages.decode(data)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise ProtocolError(f"not a message of trackers: {error}") from error
    except RecursionError as error:
        raise ProtocolError("not a message of trackers: nested too deep") from error
    if said.seerob != VERSION:
        raise ProtocolError(f"version {said.seerob[:40]!r}, not {VERSION!r}: sender and receiver differ")
    serials = [d.serial for d in said.devices]
    if len(set(serials)) != len(serials):
        raise ProtocolError("the same serial number twice in a message of trackers")
    return Devices(said.t, tuple(_device(d) for d in said.devices), said.epoch)


def _device(said: DeviceObject) -> Device:
    return device(
        said.serial,
        said.role,
        tracking=said.tracking,
        result=said.result,
        position=said.position,
        wxyz=said.rotation,
    )


def device(
    serial: str,
    role: str,
    *,
    tracking: bool,
    result: int,
    position: Sequence[float | None] | None,
    wxyz: Sequence[float | None] | None,
) -> Device:
    """A device of what a runtime says of it.

    Args:
        serial: Its serial number.
        role: As the runtime has it.
        tracking: Whether the runtime calls the pose valid.
        result: ``eTrackingResult`` of OpenVR.
        position: y up [m]; None when it is not known.
        wxyz: Rotation, w first, y up; None when it is not known.
    """
    place = np.array((None,) * 3 if position is None else position, float)
    turn = np.array((None,) * 4 if wxyz is None else wxyz, float)
    sees = tracking and result == RUNNING_OK and bool(np.isfinite(place).all())
    return Device(
        serial=serial,
        role=plain_role(role),
        tracking=sees,
        position=world_positions(place) if sees else np.full(3, np.nan),
        wxyz=world_turns(turn) if sees else np.full(4, np.nan),
        result=result,
    )


def encode(devices: Devices) -> bytes:
    """A message."""
    return _encode(
        MessageObject(
            seerob=VERSION, t=devices.t, epoch=devices.epoch, devices=[_object(d) for d in devices.devices]
        )
    )


def _object(d: Device) -> DeviceObject:
    known: dict[str, Any] = {}
    if d.tracking:
        known["position"] = tuple(xr_positions(d.position).tolist())
        if np.isfinite(d.wxyz).all():
            known["rotation"] = tuple(xr_turns(d.wxyz).tolist())
    return DeviceObject(serial=d.serial, role=d.role, tracking=d.tracking, result=d.result, **known)


def missing(names: Sequence[str]) -> tuple[str, ...]:
    """Places of `LEAST` where nothing is worn.

    Args:
        names: Plain roles that there are.
    """
    arms = ("hand", "wrist", "elbow", "shoulder")
    there = {
        "waist": "waist" in names,
        "feet": all(any(f"{s}_{n}" in names for n in ("foot", "ankle", "knee")) for s in ("left", "right")),
        "hands or arms": all(any(f"{s}_{n}" in names for n in arms) for s in ("left", "right")),
    }
    return tuple(name for name in LEAST if not there[name])
