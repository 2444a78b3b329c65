"""What a robot's controller has in its registers while it plays a motion, by a register map."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

from seerob.app.emulation.motions import Motion
from seerob.protocols.plc.modbus import Place, Type
from seerob.protocols.plc.modbus_map import Joints, RegisterMap, SignalEntry

Program = Mapping[Place, Callable[[float], float | bool]]
"""Place → the raw value in it at a time since it was made [s]."""
Play = Callable[[float], float | bool]


def program(found: RegisterMap, motion: Motion, states: dict[str, str | bool | float]) -> Program:
    """Every register of a map: joints as the motion says, states as given, all else 0.

    Args:
        found: The map.
        motion: What the robot does.
        states: Signal → what it is, a word where the map has words, the raw number else.
    """
    played: dict[Place, Play] = {}
    for block in found.blocks:
        for k in range(block.first, block.first + block.count):
            played[Place(table=block.table, at=k, type=Type.U16)] = _nothing
    for part, joints in enumerate((found.position, found.velocity)):
        for k, place in enumerate(() if joints is None else joints.places(found.joints)):
            if joints is not None:
                played[_free(played, place)] = partial(_joint, motion, joints, part, k)
    for place in () if found.torque is None else found.torque.places(found.joints):
        played[_free(played, place)] = _nothing
    for signal in found.signals:
        raw = _raw(signal, states[signal.name]) if signal.name in states else 0.0
        played[_free(played, signal.place)] = partial(_constant, raw)
    return played


def _free(played: dict[Place, Play], place: Place) -> Place:
    """The place, once nothing else plays there."""
    for k in range(place.type.size):
        for other in [p for p in played if p.table is place.table and p.at == place.at + k]:
            if played[other] is _nothing:
                del played[other]
    return place


def _raw(signal: SignalEntry, state: str | bool | float) -> float:
    if isinstance(state, str):
        return float(next(number for number, word in signal.choices.items() if word == state))
    return float(state)


def _nothing(t: float) -> float:
    return 0.0


def _constant(value: float, t: float) -> float:
    return value


def _joint(motion: Motion, joints: Joints, part: int, k: int, t: float) -> float:
    return motion(t)[part][k] / joints.factor
