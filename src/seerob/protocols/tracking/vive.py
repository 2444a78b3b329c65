"""Trackers worn on the body (Vive and others of OpenVR, OpenXR): our live message, a line of a recording.

SteamVR runs on another computer as a rule, so that a small program there says what it sees. Positions and
rotations stay as OpenVR has them (x right, y up, -z forward; metres) on the wire; here z is up.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Any

import msgspec
import numpy as np
from msgspec import Meta, Struct

from seerob.core.transforms import Array, left_product, multiplied, turned, wxyz_from_rotation
from seerob.protocols import ProtocolError
from seerob.protocols.links.live_messages import MAX_MESSAGE

WORLD_FROM_XR = np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""x forward, y left, z up from x right, y up, z backward; a rotation."""

_TURN = left_product(wxyz_from_rotation(WORLD_FROM_XR))


def world_positions(positions: Array) -> Array:
    """Positions with z up [m], shape (..., 3), of a headset's [m]."""
    return np.asarray(positions @ WORLD_FROM_XR.T)


def world_turns(wxyz: Array) -> Array:
    """World (z up) from device, w first, shape (..., 4), of a headset's rotations w first."""
    return multiplied(_TURN, wxyz)


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


_UNKNOWN: tuple[_Number, ...] = (None,) * 4
_messages = msgspec.json.Decoder(MessageObject)
_encode = msgspec.json.Encoder().encode


@lru_cache(256)
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
    return Devices(said.t, _devices(said.devices), said.epoch)


def _devices(said: Sequence[DeviceObject]) -> tuple[Device, ...]:
    """All of one instant; their numbers are made of as one array."""
    given = [(*(d.position or _UNKNOWN[:3]), *(d.rotation or _UNKNOWN)) for d in said]
    values = np.array(given, float).reshape(-1, 7)  # what is None becomes NaN
    finite = np.isfinite(values[:, :3]).all(axis=1).tolist()
    with np.errstate(invalid="ignore", over="ignore"):  # of what is not finite nothing is used
        places, turns = world_positions(values[:, :3]), world_turns(values[:, 3:])
    sees = [d.tracking and d.result == RUNNING_OK and known for d, known in zip(said, finite, strict=True)]
    if not all(sees):
        blind = np.logical_not(sees)
        places[blind], turns[blind] = np.nan, np.nan
    return tuple(
        [
            Device(d.serial, plain_role(d.role), seen, place, turn, d.result)
            for d, seen, place, turn in zip(said, sees, places, turns, strict=True)
        ]
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
    said = DeviceObject(serial=serial, role=role, tracking=tracking, result=result)
    said.position = None if position is None else (position[0], position[1], position[2])
    said.rotation = None if wxyz is None else (wxyz[0], wxyz[1], wxyz[2], wxyz[3])
    (found,) = _devices([said])
    return found


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
