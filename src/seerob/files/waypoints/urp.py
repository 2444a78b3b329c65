"""PolyScope programs (``.urp``): gzip'd XML whose waypoints carry joint angles; gone through, not executed.

The tree is made into statements of URScript, and gone through as these are: assignments, scripts, ``If`` and
``Loop`` whose conditions are known, calls of subprograms, variable waypoints whose values are known or given.
What only a controller knows is left out with its node path, once. The maker's own description of the format
is in part [PolyScopeUrp]_; other names of elements and attributes are those of programs that were looked at.
"""

from __future__ import annotations

import math
import re
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import replace
from xml.etree.ElementTree import Element

import numpy as np

from seerob.core.errors import InputError
from seerob.core.transforms import wxyz_from
from seerob.description.xml_values import parse_xml
from seerob.files.waypoints.flow import Block, Item, Line, NotKnown
from seerob.files.waypoints.urscript import Script
from seerob.files.waypoints.waypoint import Move, Program, ToolPose, Waypoint

MAX_BYTES = 16 << 20
MAX_UNPACKED = 64 << 20
MAX_DEPTH = 60
MOVES = {"movej": Move.JOINT, "movel": Move.LINEAR, "movep": Move.PROCESS}
PASSED = frozenset({"URProgram", "children", "MainProgram", "Folder", "SpecialSequence", "program"})
"""Elements that only hold others."""
QUIET = frozenset(
    {"Set", "SetPayload", "Popup", "Comment", "Timer", "InitVariables", "InitVariablesNode", "kinematics"}
)
"""Elements that are taken to move nothing."""
MOVING = frozenset({"Force", "Pallet", "Seek", "ContributedNode", "ConveyorTracking", "Screwdriving"})
"""Elements that may move the robot even where no waypoint stands in them."""
SAID = "joint angles of fixed waypoints are taken, and the tool point beside them; features are not"
SIGNS = {ord("≟"): "==", ord("≠"): "!=", ord("≤"): "<=", ord("≥"): ">=", ord("≔"): "="}
"""Signs that PolyScope shows, and what URScript writes for them."""
FIXED = re.compile(r"waypoint #(\d+)")


def read_urp(content: bytes, file: str, values: Mapping[str, float | bool | str] | None = None) -> Program:
    """The waypoints of a PolyScope program.

    Args:
        content: The file, packed or not.
        file: Its name, for messages.
        values: What it needs and does not give, by its name there; a text is an expression of URScript.

    Raises:
        InputError: Not such a file, one that unpacks to too much, values that nobody gave, or no motion.
    """
    tree = _Tree(file, values or {}, parse_xml(_unpacked(content, file), file))
    tree.run(tree.items)
    tree.remarks.append(SAID)
    without = sum(w.speed is None or w.acceleration is None for w in tree.waypoints)
    if without:
        tree.remarks.append(f"{without} waypoints without a speed or acceleration of their move")
    return tree.program(nothing="no waypoint with joint angles")


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


class _Tree(Script):
    """A program as statements of URScript; fixed waypoints stand among them by their number."""

    def __init__(self, file: str, values: Mapping[str, float | bool | str], root: Element) -> None:
        super().__init__(file, values)
        self._parent = {child: element for element in root.iter() for child in element}
        self._root = root
        self._fixed: list[Waypoint] = []
        self.items: list[Item] = []
        self._children(root, None, "", 0, self.items)

    # -- the walk ---------------------------------------------------------------------------------

    def do(self, line: Line) -> str:
        """Run one statement, see `Walk`."""
        if (match := FIXED.fullmatch(line.text)) is not None:
            waypoint = self._fixed[int(match[1])]
            self.waypoints.append(replace(waypoint, tool=waypoint.tool or self.tcp))
            return ""
        if line.text.startswith("unknown "):
            raise NotKnown(line.text.partition(": ")[2])
        return super().do(line)

    def matters(self, statement: str) -> bool:
        """Whether a statement moves or leaves, see `Walk`."""
        return statement.startswith(("waypoint #", "unknown ")) or super().matters(statement)

    def counted(self, block: Block) -> Iterator[None]:
        """Rounds of a loop that counts, see `Walk`."""
        match = re.fullmatch(r"count (\d{1,6})", block.arms[0][0])
        if match is None:
            return super().counted(block)
        return iter([None] * int(match[1]))

    # -- from the tree -----------------------------------------------------------------------------

    def _children(
        self, element: Element, move: Element | None, path: str, depth: int, items: list[Item]
    ) -> None:
        if depth > MAX_DEPTH:
            raise InputError.at(self.file, "", f"nested deeper than {MAX_DEPTH}", "is it a program?")
        for child in element:
            self._node(child, _tag(child), move, path, depth + 1, items)

    def _node(
        self, node: Element, tag: str, move: Element | None, path: str, depth: int, items: list[Item]
    ) -> None:
        at = _path(path, node, tag)
        below = "children" if _tag(self._parent.get(node, self._root)) == "children" else ""
        if tag == "Move":
            self._children(node, node, at, depth, items)
        elif tag == "Waypoint":
            self._waypoint(node, move, at, items)
            self._children(node, move, at, depth, items)
        elif tag == "CircleMove":
            self._circle(node, move, at, items)
        elif tag == "Wait":
            seconds = next(
                (e.text or "" for e in node.iter() if _tag(e) in ("waitTime", "time", "seconds")), ""
            )
            if seconds.strip():
                items.append(Line(at, f"sleep({seconds.strip()})"))
            else:
                items.append(Block(at, "Wait (for something else than a time)", "other", [("", [])]))
        elif tag == "Script":
            items += self._script(node, at)
        elif tag == "Assignment":
            name = self._variable(node)
            items.append(
                Line(at, f"global {name} = {self._expression(node)}" if name else "unknown: no variable")
            )
        elif tag == "If":
            self._if(node, move, at, depth, items)
        elif tag == "Loop":
            items.append(self._loop_of(node, move, at, depth))
        elif tag == "Halt":
            items.append(Line(at, "halt"))
        elif tag == "CallSubProgram":
            self._called_tree(node, at, depth, items)
        elif tag == "SubProgram" or (tag == "MainProgram" and move is not None):
            return  # run where it is called
        elif tag in PASSED:
            self._children(node, move, at, depth, items)
        elif tag in QUIET:
            items.append(Block(at, tag, "other", [("", [])]))
        elif below or tag in MOVING or any(_tag(e) in ("Waypoint", "Move") for e in node.iter()):
            inside: list[Item] = [Line(at, f"unknown {tag}: it may move the robot")] if tag in MOVING else []
            self._children(node, move, at, depth, inside)
            items.append(Block(at, tag, "other", [("", inside)]))

    def _if(self, node: Element, move: Element | None, at: str, depth: int, items: list[Item]) -> None:
        kind = (node.get("type") or "If").lower().replace("_", "")
        inside: list[Item] = []
        self._children(node, move, at, depth, inside)
        if kind == "if":
            items.append(Block(at, "If", "if", [(self._expression(node) or "?", inside)]))
        elif kind in ("else", "elseif") and items and _open_if(items[-1]):
            last = items[-1]
            assert isinstance(last, Block)
            last.arms.append(("" if kind == "else" else self._expression(node) or "?", inside))
        else:
            items.append(Block(at, "If", "other", [("", inside)]))

    def _loop_of(self, node: Element, move: Element | None, at: str, depth: int) -> Block:
        kind = (node.get("type") or "").lower()
        inside: list[Item] = []
        self._children(node, move, at, depth, inside)
        count = node.get("count") or next((e.text or "" for e in node if _tag(e) == "count"), "")
        if kind in ("forever", "infinite", "always"):
            return Block(at, "Loop", "forever", [("", inside)])
        if kind in ("count", "counting", "times") and count.strip().isdigit():
            return Block(at, "Loop", "count", [(f"count {count.strip()}", inside)])
        if kind == "expression":
            return Block(at, "Loop", "while", [(self._expression(node) or "?", inside)])
        return Block(at, "Loop", "other", [("", inside)])

    def _called_tree(self, node: Element, at: str, depth: int, items: list[Item]) -> None:
        held = next((e for e in node if _tag(e) == "subprogram"), None)
        called = None if held is None else self._resolved(held)
        name = node.get("name") or ("" if called is None else called.get("name", ""))
        if called is None or not len(called):
            every = (e for e in self._root.iter() if _tag(e) in ("SubProgram", "subprogram") and len(e))
            called = next((e for e in every if name and e.get("name") == name), None)
        if called is None:
            items.append(Line(at, "unknown CallSubProgram: the subprogram is not in this file"))
            return
        self._children(called, None, at, depth + 1, items)

    def _resolved(self, element: Element) -> Element | None:
        """The element that a reference means: ``../../CallSubProgram[2]/subprogram``."""
        reference = element.get("reference")
        if reference is None:
            return element
        here: Element | None = element
        for step in reference.split("/"):
            if here is None:
                return None
            if step == "..":
                here = self._parent.get(here)
                continue
            match = re.fullmatch(r"(\w+)(?:\[(\d+)\])?", step)
            if match is None:
                return None
            same = [e for e in here if _tag(e) == match[1]]
            k = int(match[2] or 1)
            here = same[k - 1] if 0 < k <= len(same) else None
        return here

    def _variable(self, node: Element) -> str:
        found = next((e for e in node if _tag(e) == "variable"), None)
        meant = None if found is None else self._resolved(found)
        name = "" if meant is None else meant.get("name", "")
        return name if name.isidentifier() else ""

    def _expression(self, node: Element) -> str:
        """The text of an expression, whose characters, tokens and variables stand one by one."""
        held = next((e for e in node if _tag(e) == "expression"), None)
        if held is None:
            return ""
        found = []
        for part in held:
            if _tag(part) == "ExpressionChar":
                found.append(part.get("character", "?"))
            else:
                names = (
                    part.get("token"),
                    part.get("name"),
                    part.get("referencedName"),
                    self._variable(part),
                )
                found.append(next((name for name in names if name), "?"))
        return "".join(found).translate(SIGNS).strip()

    def _script(self, node: Element, at: str) -> list[Item]:
        cached = next((e for e in node if _tag(e) == "cachedContents"), None)
        text = self._expression(node) if cached is None else cached.text or ""
        if not text.strip():
            return [Line(at, "unknown Script: its text is not in this file")]
        return self._parsed(text.splitlines(), f"{at}, ")

    def _waypoint(self, node: Element, move: Element | None, at: str, items: list[Item]) -> None:
        kind = MOVES.get((move.get("motionType", "") if move is not None else "").lower())
        if kind is None:
            items.append(Line(at, "unknown Waypoint: it has no move of a known type"))
            return
        own = next((e for e in node if _tag(e) == "motionParameters"), None)
        speed, acceleration, blend = (
            self._given(name, own, move, kind, at) for name in ("speed", "acceleration", "blendRadius")
        )
        name = node.get("name", "")
        angles = next((e for e in node.iter() if _tag(e) == "JointAngles"), None)
        if node.get("type", "Fixed") == "Variable":
            figures = {"a": acceleration, "v": speed, "r": blend}
            said = "".join(f", {k}={v!r}" for k, v in figures.items() if v is not None)
            goal = self._variable(node) or self._expression(node) or "?"
            items.append(Line(at, f"move{_LETTER[kind]}({goal}{said})"))
            return
        if node.get("type", "Fixed") != "Fixed" or angles is None:
            what = f"it has no joint angles ({node.get('type', 'unknown type')})"
            items.append(Line(at, f"unknown Waypoint: {what}"))
            return
        q = _numbers(angles.get("angles", ""))
        if q is None:
            raise InputError.at(
                self.file, at, f"{angles.get('angles', '')[:40]!r} are no numbers", "save it again"
            )
        offset = next((_numbers(e.get("pose", "")) for e in node.iter() if _tag(e) == "TCPOffset"), None)
        self._fixed.append(
            Waypoint(
                place=at,
                name=name,
                move=kind,
                q=q,
                speed=speed,
                acceleration=acceleration,
                blend=blend or 0.0,
                tool=_tool(offset),
            )
        )
        items.append(Line(at, f"waypoint #{len(self._fixed) - 1}"))

    def _circle(self, node: Element, move: Element | None, at: str, items: list[Item]) -> None:
        """A via point and an end point, with joint angles both."""
        mode = (node.get("mode") or node.get("orientationMode") or "").lower()
        found: list[Item] = []
        for point in (e for e in node.iter() if _tag(e) == "Waypoint"):
            self._waypoint(point, move, at, found)
        numbers = [FIXED.fullmatch(item.text) for item in found if isinstance(item, Line)]
        fixed = [self._fixed[int(m[1])] for m in numbers if m is not None]
        if len(found) != 2 or len(fixed) != 2 or mode == "fixed":
            items.append(
                Line(at, "unknown CircleMove: its two points are not known, or its orientation is fixed")
            )
            return
        via, end = fixed
        self._fixed.append(replace(end, move=Move.CIRCULAR, via_q=via.q))
        items.append(Line(at, f"waypoint #{len(self._fixed) - 1}"))

    def _given(
        self, name: str, own: Element | None, move: Element | None, kind: Move, at: str
    ) -> float | None:
        side = "cartesian" if kind.of_tool else "joint"
        keys = (name, f"{side}{name.capitalize()}")
        every = (e.get(k) for e in (own, move) if e is not None for k in keys)
        text = next((v for v in every if v is not None), None)
        if text is None:
            return None
        values = _numbers(text)
        if values is None:
            raise InputError.at(self.file, at, f"{text[:40]!r} are no numbers", "save the program again")
        return values[0] if 0 < values[0] < 1e4 else None


_LETTER = {Move.JOINT: "j", Move.LINEAR: "l", Move.PROCESS: "p"}


def _open_if(item: Item) -> bool:
    """Whether another branch may follow."""
    return isinstance(item, Block) and item.kind == "if" and item.arms[-1][0] != ""


def _tag(element: Element) -> str:
    return str(element.tag).rpartition("}")[2]


def _path(path: str, node: Element, tag: str) -> str:
    """Names of a node and those above it."""
    if tag in ("children", "URProgram", "program"):
        return path
    name = node.get("name") or node.get("motionType") or ""
    own = f"{tag} {name!r}" if name else tag
    return f"{path} / {own}" if path else own


def _tool(offset: tuple[float, ...] | None) -> ToolPose | None:
    if offset is None or len(offset) != 6:
        return None
    x, y, z, *turn = offset
    w, i, j, k = wxyz_from("rotation_vector", np.array([turn]))[0].tolist()
    return ToolPose((x, y, z), (w, i, j, k))


def _numbers(text: str) -> tuple[float, ...] | None:
    try:
        values = tuple(float(part) for part in text.split(","))
    except ValueError:
        return None
    return values if all(map(math.isfinite, values)) and len(values) <= 12 else None
