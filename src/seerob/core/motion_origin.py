"""What a motion is a motion of, and what whoever reads a result must know of that."""

from __future__ import annotations

from enum import StrEnum

from seerob.core.snapshot import Finding


class MotionOrigin(StrEnum):
    """What a recorded motion is a motion of; anything but the real controller is preliminary."""

    CONTROLLER = "controller"
    """Logged from the real robot's controller."""
    VENDOR_EMULATOR = "vendor_emulator"
    """The maker's own controller software without the robot (URSim, a virtual controller)."""
    SIMULATOR = "simulator"
    """A generic simulator or offline programming tool with its own motion planner."""
    PLANNED = "planned"
    """A path that nobody has executed, not even in a simulator."""
    RECORDING = "recording"
    """One of our own recordings; what fed it is written there."""


def origin_finding(origin: MotionOrigin, subject: str, file: str) -> Finding:
    """What whoever reads a result must know of where the motion comes from; points by hand are no file."""
    named = f" ({file})" if file else ""
    if origin is MotionOrigin.CONTROLLER:
        return Finding(level="note", subject=subject, text=f"motion logged from the controller{named}")
    if origin is MotionOrigin.RECORDING:
        return Finding(level="note", subject=subject, text=f"motion replayed from a recording{named}")
    what = {
        MotionOrigin.VENDOR_EMULATOR: "the maker's emulator",
        MotionOrigin.SIMULATOR: "a generic simulator",
        MotionOrigin.PLANNED: "a plan that was not executed",
    }[origin]
    text = f"motion comes from {what + named}: preliminary until it is confirmed on the controller"
    return Finding(level="assumed", subject=subject, text=text)
