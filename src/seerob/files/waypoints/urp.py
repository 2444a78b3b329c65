"""PolyScope programs (``.urp``): gzip'd XML whose waypoints carry joint angles; read, not executed.

The tree is gone through from top to bottom. What decides, repeats or runs code is named and refused, as the
motion behind it is not known; a main program that loops is one round. No document of the maker describes
the format: names of elements and attributes are those of programs that were looked at.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Iterator
from xml.etree.ElementTree import Element

from seerob.core.errors import InputError, Problem
from seerob.description.xml_values import parse_xml
from seerob.files.waypoints.waypoint import Move, Program, Waypoint

MAX_BYTES = 16 << 20
MAX_UNPACKED = 64 << 20
MAX_DEPTH = 60
MOVES = {"movej": Move.JOINT, "movel": Move.LINEAR, "movep": Move.PROCESS}
PASSED = frozenset(
    {
        "URProgram",
        "children",
        "MainProgram",
        "InitVariables",
        "Folder",
        "Comment",
        "SpecialSequence",
        "program",
    }
)
"""Elements that only hold others, or nothing that moves."""
QUIET = frozenset({"Set", "SetPayload", "Popup", "Comment", "Assignment", "kinematics", "InitVariablesNode"})
"""Elements that are taken to move nothing."""
REMEDY = "export the program as URScript without it, or record the motion on the controller"


def read_urp(content: bytes, file: str) -> Program:
    """The waypoints of a PolyScope program.

    Args:
        content: The file, packed or not.
        file: Its name, for messages.

    Raises:
        InputError: Not such a file, one that unpacks to too much, or with what only a controller knows.
    """
    found = _Tree(file)
    found.walk(parse_xml(_unpacked(content, file), file), None, 0)
    if not found.problems and not found.waypoints:
        found.problems.append(Problem(file, "", "no waypoint with joint angles", "give a program that moves"))
    if found.problems:
        raise InputError(found.problems[:20])
    remarks = ["joint angles of the waypoints are taken; features, tool points and their changes are not"]
    if found.left_out:
        remarks.append("taken to move nothing and left out: " + ", ".join(sorted(found.left_out)))
    if found.without_speed:
        remarks.append(f"{found.without_speed} waypoints without a speed or acceleration of their move")
    return Program(file, tuple(found.waypoints), tuple(remarks), controller=True)


def _unpacked(content: bytes, file: str) -> bytes:
    if len(content) > MAX_BYTES:
        raise InputError.at(file, "", f"{len(content)} bytes", f"at most {MAX_BYTES} are read")
    if content[:2] != b"\x1f\x8b":
        return content
    unpack = zlib.decompressobj(16 + zlib.MAX_WBITS)
    try:
        data = unpack.decompress(content, MAX_UNPACKED + 1)
    except zlib.error as error:
        raise InputError.at(file, "", f"is not gzip: {error}", "copy the file again") from error
    if len(data) > MAX_UNPACKED:
        raise InputError.at(file, "", f"unpacks to more than {MAX_UNPACKED} bytes", "is it a program?")
    if not unpack.eof:
        raise InputError.at(file, "", "is cut off", "copy the file again")
    return data


class _Tree:
    def __init__(self, file: str) -> None:
        self.file = file
        self.problems: list[Problem] = []
        self.waypoints: list[Waypoint] = []
        self.left_out: set[str] = set()
        self.without_speed = 0

    def walk(self, element: Element, move: Element | None, depth: int) -> None:
        if depth > MAX_DEPTH:
            raise InputError.at(self.file, "", f"nested deeper than {MAX_DEPTH}", "is it a program?")
        for child in element:
            tag = str(child.tag).rpartition("}")[2]
            if tag == "Move":
                self.walk(child, child, depth + 1)
            elif tag == "Waypoint":
                self._waypoint(child, move)
                self.walk(child, move, depth + 1)
            elif tag == "Wait":
                self._wait(child)
            elif tag in PASSED:
                self.walk(child, move, depth + 1)
            elif tag in QUIET:
                self.left_out.add(tag)
            elif any(True for _ in _inside(child, {"Waypoint", "Move"})) or tag in (
                "If",
                "Loop",
                "Script",
                "SubProgram",
                "CallSubProgram",
                "Thread",
                "Switch",
                "Force",
                "Pallet",
                "Seek",
                "ContributedNode",
            ):
                what = f"{tag}: what is done there only a controller knows"
                self.problems.append(
                    Problem(self.file, f"after waypoint {len(self.waypoints)}", what, REMEDY)
                )
            elif str(element.tag).rpartition("}")[2] == "children":
                self.left_out.add(tag)  # a node of the program; elsewhere it is a property of one

    def _waypoint(self, element: Element, move: Element | None) -> None:
        name = element.get("name", "")
        place = f"waypoint {len(self.waypoints) + 1}"
        angles = next(_inside(element, {"JointAngles"}), None)
        if angles is None or element.get("type", "Fixed") != "Fixed":
            what = f"{name!r} has no joint angles ({element.get('type', 'unknown type')})"
            self.problems.append(Problem(self.file, place, what, REMEDY))
            return
        q = self._numbers(angles.get("angles", ""), place)
        if q is None:
            return
        own = next(_inside(element, {"motionParameters"}), None)
        kind = MOVES.get((move.get("motionType", "") if move is not None else "").lower())
        if kind is None:
            what = f"{name!r} has no move of a known type"
            self.problems.append(Problem(self.file, place, what, "movej, movel and movep are read"))
            return
        speed, acceleration = (self._given(key, own, move, place) for key in ("speed", "acceleration"))
        self.without_speed += speed is None or acceleration is None
        self.waypoints.append(
            Waypoint(
                place=place,
                name=name,
                move=kind,
                q=q,
                speed=speed,
                acceleration=acceleration,
                blend=self._given("blendRadius", own, move, place) or 0.0,
            )
        )

    def _given(self, key: str, own: Element | None, move: Element | None, place: str) -> float | None:
        text = next((e.get(key) for e in (own, move) if e is not None and e.get(key) is not None), None)
        if text is None:
            return None
        values = self._numbers(text, place)
        return values[0] if values and 0 < values[0] < 1e4 else None

    def _wait(self, element: Element) -> None:
        time = next((e for e in element.iter() if str(e.tag) in ("waitTime", "time", "seconds")), None)
        values = (
            self._numbers((time.text or "") if time is not None else "", "Wait") if time is not None else None
        )
        if values and self.waypoints and 0 <= values[0] <= 1e5:
            self.waypoints[-1] = self.waypoints[-1].waiting(values[0])
        else:
            self.left_out.add("Wait (for something else than a time)")

    def _numbers(self, text: str, place: str) -> tuple[float, ...] | None:
        try:
            values = tuple(float(part) for part in text.split(","))
        except ValueError:
            values = (math.nan,)
        if all(map(math.isfinite, values)) and len(values) <= 12:
            return values
        self.problems.append(
            Problem(self.file, place, f"{text[:40]!r} are no numbers", "save the program again")
        )
        return None


def _inside(element: Element, tags: set[str]) -> Iterator[Element]:
    return (e for e in element.iter() if e is not element and str(e.tag).rpartition("}")[2] in tags)
