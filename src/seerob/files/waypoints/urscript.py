"""URScript programs: the waypoints of ``movej``, ``movel``, ``movep``, ``movec`` whose goals are known.

A program is gone through, never executed: constants, variables, lists, arithmetic on numbers and poses,
functions with what they move, loops and ``if`` whose conditions are known. What needs a controller (branches
on inputs, motions that a sensor ends) is left out with its line, see `flow`; a goal that the program does
not give (``get_from_camera()``) is asked for. A program that goes round for ever is read as one round.
Defaults of speed and acceleration are those of [URScript]_.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from seerob.core.errors import InputError
from seerob.core.transforms import (
    Array,
    inverse,
    rotation_from_wxyz,
    transform,
    wxyz_from,
    wxyz_from_rotation,
)
from seerob.files.waypoints.expressions import Evaluating, Expression, finite, given, number, tokens
from seerob.files.waypoints.flow import (
    MAX_CALLS,
    MAX_NESTED,
    Asked,
    Block,
    Item,
    Line,
    NotKnown,
    lines_of,
    waited,
)
from seerob.files.waypoints.waypoint import Move, Program, ToolPose, Waypoint


@dataclass(frozen=True)
class PoseValue:
    """``p[x, y, z, rx, ry, rz]``: metres and a rotation vector."""

    numbers: tuple[float, ...]


@dataclass(frozen=True)
class Inverse:
    """``get_inverse_kin(pose, qnear)``: the joint positions that reach a pose, nearest to others."""

    pose: PoseValue
    near: tuple[float, ...]
    """[rad]"""


Value = float | bool | str | tuple["Value", ...] | PoseValue | Inverse


@dataclass(frozen=True)
class Call:
    """A call of a function with constants."""

    name: str
    arguments: tuple[Value, ...]
    named: Mapping[str, Value]


def _length(value: Value) -> float:
    if not isinstance(value, tuple):
        raise NotKnown("a list is expected")
    return float(len(value))


NUMBERS: dict[str, Callable[..., float]] = {
    "d2r": math.radians,
    "r2d": math.degrees,
    "sqrt": math.sqrt,
    "sin": math.sin,
    "cos": math.cos,
    "tan": math.tan,
    "asin": math.asin,
    "acos": math.acos,
    "atan": math.atan,
    "atan2": math.atan2,
    "pow": math.pow,
    "floor": lambda x: float(math.floor(x)),
    "ceil": lambda x: float(math.ceil(x)),
}
"""Functions of numbers."""


def _pose_trans(a: PoseValue, b: PoseValue) -> PoseValue:
    return _value(_matrix(a) @ _matrix(b))


def _pose_inv(a: PoseValue) -> PoseValue:
    return _value(inverse(_matrix(a)))


def _pose_add(a: PoseValue, b: PoseValue) -> PoseValue:
    """Positions are added, rotations follow each other."""
    turned = _matrix(a) @ transform(_matrix(b)[:3, :3])
    turned[:3, 3] = np.add(a.numbers[:3], b.numbers[:3])
    return _value(turned)


def _interpolate_pose(a: PoseValue, b: PoseValue, share: float) -> PoseValue:
    """On the line from one position to the other, turning evenly."""
    first, last = _matrix(a), _matrix(b)
    (turn,) = _vectors(first[:3, :3].T @ last[:3, :3])
    found = first @ transform(rotation_from_wxyz(wxyz_from("rotation_vector", share * turn[None])[0]))
    found[:3, 3] = (1 - share) * first[:3, 3] + share * last[:3, 3]
    return _value(found)


def _point_dist(a: PoseValue, b: PoseValue) -> float:
    return float(np.linalg.norm(np.subtract(a.numbers[:3], b.numbers[:3])))


POSES: dict[str, tuple[tuple[type, ...], Callable[..., Value]]] = {
    "pose_trans": ((PoseValue, PoseValue), _pose_trans),
    "pose_inv": ((PoseValue,), _pose_inv),
    "pose_add": ((PoseValue, PoseValue), _pose_add),
    "interpolate_pose": ((PoseValue, PoseValue, float), _interpolate_pose),
    "point_dist": ((PoseValue, PoseValue), _point_dist),
}
"""Functions of poses, with the kinds of their arguments."""
FUNCTIONS = (*NUMBERS, *POSES, "length", "get_inverse_kin")


class Reader(Expression[Value]):
    """Reads the pieces of one statement.

    Args:
        pieces: Of `tokens`.
        names: Values of the variables; None for one whose value is not known.
        script: Whose functions are called, and who knows what the user gives.
    """

    def __init__(
        self, pieces: list[str], names: Mapping[str, Value | None], script: Script | None = None
    ) -> None:
        super().__init__(pieces)
        self._names, self._script = names, script

    def call(self) -> Call:
        """The whole statement as a call."""
        found = self._called(self.take())
        self.end()
        return found

    def _called(self, name: str) -> Call:
        self.expect("(")
        arguments: list[Value] = []
        named: dict[str, Value] = {}
        while self.peek() != ")":
            if self.peek(1) == "=":
                key = self.take()
                self.take()
                named[key] = self.value()
            elif named:
                raise NotKnown("an argument without a name after one with a name")
            else:
                arguments.append(self.value())
            if self.peek() != ")":
                self.expect(",")
        self.take()
        return Call(name, tuple(arguments), named)

    def atom(self, piece: str) -> Value:
        """What begins with a piece, see `Expression`."""
        if piece == "[":
            return tuple(self.listed("]"))
        if piece == "p" and self.peek() == "[":
            self.take()
            numbers = tuple(number(v) for v in self.listed("]"))
            if len(numbers) != 6:
                raise NotKnown(f"a pose of {len(numbers)} numbers, not 6")
            return PoseValue(numbers)
        if piece[:1] in "\"'":
            return piece[1:-1]
        if self.peek() == "(":
            return self._function(piece)
        if piece not in self._names and piece == "pi":
            return math.pi
        known = self._names.get(piece)
        if known is None:
            known = None if self._script is None else self._script.given(piece)
        if known is None:
            if not piece.isidentifier():
                raise NotKnown(f"{piece!r} is not expected there")
            return self._element(piece)
        return known

    def _element(self, piece: str) -> Value:
        """What the user gives for an element of something that is not known: ``digital_in[1]``."""
        if self.peek() == "[" and self.peek(2) == "]" and self._script is not None:
            text = f"{piece}[{self.peek(1)}]"
            known = self._script.given(text)
            if known is not None:
                self.at += 3
                return known
            raise Asked(text)
        raise Asked(piece)

    def _function(self, name: str) -> Value:
        begin = self.at - 1
        if name in MOVES or MOVES_OTHERWISE.match(name):
            raise NotKnown(f"{name} moves the robot inside of another statement")
        if name in FUNCTIONS:
            return _known(self._called(name))
        if self._script is not None and self._script.defines(name):
            return self._script.returned(self._called(name))
        depth = 0
        while True:  # its arguments need not be known
            depth += {"(": 1, ")": -1}.get(self.take(), 0)
            if depth == 0:
                break
        text = "".join(self.pieces[begin : self.at])
        known = None if self._script is None else self._script.given(text)
        if known is None:
            raise Asked(text)
        return known

    def after(self, value: Value) -> Value:
        """An index behind a value."""
        while self.peek() == "[":
            self.take()
            index = number(self.value())
            self.expect("]")
            items: Sequence[Value] | None = value.numbers if isinstance(value, PoseValue) else None
            if items is None and isinstance(value, tuple):
                items = value
            if items is None or index != int(index) or not 0 <= index < len(items):
                raise NotKnown(f"no element {index:g} there")
            value = items[int(index)]
        return value


def _known(call: Call) -> Value:
    """A function that is known, worked out."""
    if call.name == "get_inverse_kin":
        return _inverse(call)
    if call.named:
        raise NotKnown(f"{call.name} with names of arguments is not read")
    if call.name == "length":
        return _length(call.arguments[0] if call.arguments else "")
    if call.name in POSES:
        kinds, function = POSES[call.name]
        if [type(v) for v in call.arguments] != list(kinds):
            raise NotKnown(f"{call.name} needs {', '.join(k.__name__ for k in kinds)}")
        return function(*call.arguments)
    numbers = [number(v) for v in call.arguments]
    try:
        return finite(NUMBERS[call.name](*numbers))
    except (ValueError, OverflowError, TypeError) as error:
        shown = ", ".join(f"{x:g}" for x in numbers)
        raise NotKnown(f"{call.name}({shown}) is no number") from error


def _inverse(call: Call) -> Inverse:
    given = dict(zip(("x", "qnear"), call.arguments, strict=False)) | dict(call.named)
    pose, near = given.get("x"), given.get("qnear")
    if given.get("tcp", "active_tcp") != "active_tcp":
        raise NotKnown("get_inverse_kin for another tool point is not read")
    if not isinstance(pose, PoseValue) or not isinstance(near, tuple):
        raise NotKnown("get_inverse_kin needs a constant pose and a constant qnear")
    return Inverse(pose, tuple(number(v) for v in near))


MOVES = ("movej", "movel", "movep", "movec")
MOVES_OTHERWISE = re.compile(
    r"(servo[jcl]|speed[jl]|stop[jl]|force_mode|freedrive_mode|teach_mode|conveyor|track_|path_|move\w+|"
    r"teachmode|screw_driving|tool_contact|set_conveyor|optimove)"
)
"""Begin of calls that move the robot in ways that are not modelled."""
HERE = ("get_actual_joint_positions()", "get_target_joint_positions()")
HERE_POSE = ("get_actual_tcp_pose()", "get_target_tcp_pose()")
LEAVING = ("return", "break", "continue", "halt", "kill", "join")
"""What follows a block with one of these may never be reached, or not when it seems."""
ASSIGNMENT = re.compile(r"^(?:(global|local)\s+)?([A-Za-z_]\w*)\s*(\[.*\])?\s*=(?!=)\s*(.*)$")
DEFINED = re.compile(r"(?:def|sec|thread)\s+([A-Za-z_]\w*)\s*\((.*)\)\s*:$")
_TEXT = re.compile(r"\"[^\"]*\"|'[^']*'")
_CALL = re.compile(r"([A-Za-z_]\w*)\s*\(")
NODE = re.compile(r"\$\s*(\d+)\s*(?:\"([^\"]*)\")?")
"""Marks the node of PolyScope's tree that a statement comes from."""
MAX_LINES = 200_000
JOINT_SPEED, JOINT_ACCELERATION = 1.05, 1.4
"""Of ``movej`` where it does not say [rad/s, rad/s²]."""
TOOL_SPEED, TOOL_ACCELERATION = 0.25, 1.2
"""Of the others [m/s, m/s²]."""
SIGNATURES = {
    "movej": (Move.JOINT, ("q", "a", "v", "t", "r")),
    "movel": (Move.LINEAR, ("pose", "a", "v", "t", "r")),
    "movep": (Move.PROCESS, ("pose", "a", "v", "r")),
    "movec": (Move.CIRCULAR, ("pose_via", "pose_to", "a", "v", "r", "mode")),
}
DEFAULTS = (
    "gone through, not executed; speeds and accelerations that a move does not give are the defaults of "
    f"URScript: {JOINT_SPEED:g} rad/s and {JOINT_ACCELERATION:g} rad/s² of the leading joint, "
    f"{TOOL_SPEED:g} m/s and {TOOL_ACCELERATION:g} m/s² of the tool point"
)


def read_urscript(
    content: bytes, file: str, values: Mapping[str, float | bool | str] | None = None
) -> Program:
    """The waypoints of a program.

    Args:
        content: The file.
        file: Its name, for messages.
        values: What it needs and does not give, by its name there; a text is an expression of the language.

    Raises:
        InputError: Every value that is needed and was not given, or nothing that moves.
    """
    script = Script(file, values or {})
    script.run_text(lines_of(content, file), main=True)
    script.remarks.append(DEFAULTS)
    return script.program(nothing="no move with constants")


class Script(Evaluating):
    """A program of URScript."""

    def __init__(self, file: str, values: Mapping[str, float | bool | str]) -> None:
        super().__init__(file, values)
        self.names: dict[str, Value | None] = {}
        self._functions: dict[str, tuple[Block, tuple[tuple[str, str], ...]]] = {}
        self._changing: set[str] = set()
        """Names that something beside the program gives a value."""
        self._locals: set[str] | None = None
        self._returned: Value | None = None
        self._calm = self._doubt = False
        """Whether what is run is a function that moves nothing; and whether it may have returned before."""
        self.tcp: ToolPose | None = None

    def run_text(self, lines: Sequence[str], *, main: bool = False, at: str = "") -> str:
        """Run a text.

        Args:
            lines: Of it.
            main: Whether the first of its functions is run when nothing else in it is.
            at: Put before the places of its lines.
        """
        if len(lines) > MAX_LINES:
            raise InputError.at(self.file, at, f"{len(lines)} lines", f"at most {MAX_LINES} are read")
        items = self._parsed(lines, at)
        if main and not any(self._acts(item) for item in items):
            first = next((i for i in items if isinstance(i, Block) and i.word == "def"), None)
            end = self.run([i for i in items if i is not first])
            return end if first is None else self.run(first.body)
        return self.run(items)

    def _acts(self, item: Item) -> bool:
        return isinstance(item, Line) and ASSIGNMENT.match(item.text) is None and not NODE.match(item.text)

    def _parsed(self, lines: Sequence[str], at: str) -> list[Item]:
        """Statements and blocks."""
        top: list[Item] = []
        open_: list[tuple[Block | None, list[Item]]] = [(None, top)]
        node = ""
        for k, text in _statements(lines):
            if (match := NODE.match(text)) is not None:
                node = f" (node {match[1]}{f' {match[2]}' if match[2] else ''})"
                continue
            place = f"{at}line {k}{node}"
            word = re.split(r"\W", text, maxsplit=1)[0]
            block, items = open_[-1]
            if text == "end":
                if len(open_) > 1:
                    open_.pop()
                continue
            if word in ("elif", "else") and text.endswith(":"):
                if block is None or block.kind != "if":
                    raise InputError.at(self.file, place, f"`{word}` without an `if`", "export it again")
                condition = text[len(word) : -1].strip() if word == "elif" else ""
                block.arms.append((condition, []))
                open_[-1] = block, block.body
                continue
            if text.endswith(":"):
                kind = {"if": "if", "while": "while"}.get(word, "other")
                condition = text[len(word) : -1].strip() if kind != "other" else text
                new = Block(place, word, kind, [(condition, [])])
                items.append(new)
                open_.append((new, new.body))
                if len(open_) > MAX_NESTED:
                    raise InputError.at(
                        self.file, place, f"nested deeper than {MAX_NESTED}", "is it a program?"
                    )
                continue
            items.append(Line(place, text))
        if len(open_) > 1 and (block := open_[-1][0]) is not None:
            raise InputError.at(
                self.file, block.at, f"`{block.word}`: its `end` is missing", "export it again"
            )
        return top

    # -- what it is told --------------------------------------------------------------------------

    def given(self, name: str) -> Value | None:
        """What the user gives under a name, or what is known of where the robot is."""
        value = given(self.values, name)
        if isinstance(value, str):
            return Reader(tokens(value), {}).whole()
        if value is not None:
            return value if isinstance(value, bool) else float(value)
        last = self.waypoints[-1] if self.waypoints else None
        if last is not None and last.blend == 0 and self.lost < len(self.waypoints):
            if name in HERE:
                return last.q
            if name in HERE_POSE and last.pose is not None and last.tool == self.tcp:
                return _value(transform(rotation_from_wxyz(last.pose.wxyz), last.pose.position))
        return None

    def defines(self, name: str) -> bool:
        """Whether the program has a function of that name."""
        return name in self._functions

    def returned(self, call: Call) -> Value:
        """What a function of the program returns; what it moves is gone to."""
        self._call(call)
        if self._returned is None:
            raise Asked(f"{call.name}()")
        return self._returned

    def evaluate(self, text: str) -> Value:
        """The value of an expression.

        Raises:
            NotKnown: It is not known.
        """
        return Reader(tokens(text), self.names, self).whole()

    # -- the walk -----------------------------------------------------------------------------------

    def matters(self, statement: str) -> bool:
        """Whether a statement moves or leaves, see `Walk`."""
        word = re.split(r"\W", statement, maxsplit=1)[0]
        bare = _TEXT.sub("", statement)
        if (word in LEAVING and not (word == "return" and self._calm)) or word == "set_tcp":
            return True
        for name in _CALL.findall(bare):
            if name in MOVES or MOVES_OTHERWISE.match(name) or name == "set_tcp":
                return True
            if name in self._functions and self._moving(name):
                return True
        return bool(re.fullmatch(r"while\s*\(?\s*True\s*\)?\s*:?", statement))

    def _moving(self, name: str, depth: int = 0) -> bool:
        """Whether a function of the program moves the robot or its tool point."""
        block = self._functions[name][0]
        calls = {n for text in block.lines() for n in _CALL.findall(_TEXT.sub("", text))}
        if any(n in MOVES or MOVES_OTHERWISE.match(n) or n == "set_tcp" for n in calls):
            return True
        inner = [n for n in calls if n in self._functions and n != name]
        return depth < MAX_CALLS and any(self._moving(n, depth + 1) for n in inner)

    def forget(self, statement: str) -> None:
        """What a statement changes is not known, see `Walk`."""
        if (match := ASSIGNMENT.match(statement)) is not None:
            self.names[match[2]] = None
        for name in _CALL.findall(_TEXT.sub("", statement)):
            if name in self._functions:
                for text in self._functions[name][0].lines():
                    if (match := ASSIGNMENT.match(text)) is not None and match[2] in self.names:
                        self.names[match[2]] = None
        if statement.startswith("set_tcp"):
            self.tcp = None
        self._doubt |= statement.startswith("return")

    def breaks(self, statement: str) -> bool:
        """Whether a statement leaves, see `Walk`."""
        return re.split(r"\W", statement, maxsplit=1)[0] in LEAVING

    def _block(self, block: Block) -> str:
        if block.word == "def" and (match := DEFINED.match(block.arms[0][0])) is not None:
            if match[1] not in self._functions:
                parameters = [p.partition("=") for p in match[2].split(",") if p.strip()]
                self._functions[match[1]] = (
                    block,
                    tuple((name.strip(), default.strip()) for name, _, default in parameters),
                )
            return ""
        if block.word in ("thread", "sec"):
            texts = list(block.lines())
            for text in texts:
                if (match := ASSIGNMENT.match(text)) is not None:
                    self._changing.add(match[2])
                    self.names[match[2]] = None
            if any(self._beside(text) for text in texts):
                self.leave(block.at, block.word, "what moves beside the program only a controller knows")
            else:
                self.quiet(block.word)
            return ""
        return super()._block(block)

    def _beside(self, text: str) -> bool:
        """Whether a statement of a thread moves the robot or its tool point."""
        calls = _CALL.findall(_TEXT.sub("", text))
        return any(n in MOVES or MOVES_OTHERWISE.match(n) or n == "set_tcp" for n in calls)

    def do(self, line: Line) -> str:
        """Run one statement, see `Walk`."""
        text = line.text
        word = re.split(r"\W", text, maxsplit=1)[0]
        if word in ("break", "return"):
            return self._leaving(word, text)
        if word == "halt":
            return "never"
        if word == "continue":
            raise NotKnown("is not followed")
        if (match := ASSIGNMENT.match(text)) is not None:
            self._assign(match)
            return ""
        if re.fullmatch(r"(run|join|kill)\s+\w+\s*(\(\s*\))?", text):
            self.quiet(word)
            return ""
        if re.fullmatch(r"\w+\.\w+\s*\(.*\)", text) and not self.matters(text):
            self.quiet(text.partition("(")[0])  # a call of another computer
            return ""
        if re.fullmatch(r"[A-Za-z_]\w*\s*\(.*\)", text) is None:
            raise NotKnown("is no statement that is known here")
        if word in self._functions:
            self._call(Reader(tokens(text), self.names, self).call())
        elif word in SIGNATURES:
            call = Reader(tokens(text), self.names, self).call()
            self.waypoints.append(_waypoint(line.at, call, self.tcp))
        elif word == "sleep":
            seconds = _arguments(Reader(tokens(text), self.names, self).call(), ("t",)).get("t")
            waited(self.waypoints, number(seconds))
        elif word == "set_tcp":
            call = Reader(tokens(text), self.names, self).call()
            pose = next(iter(_arguments(call, ("pose", "tcp_name")).values()), None)
            if not isinstance(pose, PoseValue):
                raise NotKnown("needs a constant pose")
            self.tcp = _pose(pose)
        elif self.matters(text):
            raise NotKnown("moves the robot in a way that is not modelled")
        else:
            self.quiet(word)
        return ""

    def _leaving(self, word: str, text: str) -> str:
        if word == "return":
            rest = text[6:].strip()
            self._returned = None
            if rest:
                try:
                    self._returned = self.evaluate(rest)
                except NotKnown:
                    self._returned = None
        return word

    def _assign(self, match: re.Match[str]) -> None:
        scope, name, index, text = match.groups()
        if self._locals is not None and scope != "global" and name not in self.names:
            self._locals.add(name)
        # A name that is no constant matters only where a waypoint needs it.
        try:
            value: Value | None = self.evaluate(text)
        except NotKnown:
            if self.matters(text):
                self.names[name] = None
                raise
            value = None
        if index is not None:
            value = self._changed(name, index, value)
        self.names[name] = None if name in self._changing else value

    def _changed(self, name: str, index: str, value: Value | None) -> Value | None:
        """A list or pose with one element that is another."""
        held = self.names.get(name)
        try:
            place = number(self.evaluate(index[1:-1]))
        except NotKnown:
            return None
        items = list(held.numbers if isinstance(held, PoseValue) else held if isinstance(held, tuple) else ())
        if value is None or place != int(place) or not 0 <= place < len(items):
            return None
        items[int(place)] = value
        if isinstance(held, PoseValue):
            return PoseValue(tuple(number(v) for v in items))
        return tuple(items)

    def _call(self, call: Call) -> None:
        """Run a function of the program."""
        block, parameters = self._functions[call.name]
        if self._depth >= MAX_CALLS:
            raise NotKnown(f"calls are followed {MAX_CALLS} deep")
        bound = dict(zip((p for p, _ in parameters), call.arguments, strict=False)) | dict(call.named)
        outer, held = self._locals, {p: self.names.get(p) for p, _ in parameters}
        there = {p for p, _ in parameters if p in self.names}
        for name, default in parameters:
            value = bound.get(name)
            self.names[name] = self.evaluate(default) if value is None and default else value
        self._locals, self._returned = set(), None
        state = self._calm, self._doubt
        self._calm, self._doubt = not self._moving(call.name), False
        self._depth += 1
        try:
            end = self.run(block.body)
        finally:
            for name in self._locals:
                self.names.pop(name, None)
            for name, before in held.items():
                if name in there:
                    self.names[name] = before
                else:
                    self.names.pop(name, None)
            if self._doubt:
                self._returned = None
            self._locals = outer
            self._calm, self._doubt = state
            self._depth -= 1
        if end == "never":
            raise NotKnown("a loop in it never ends")


def _waypoint(at: str, call: Call, tool: ToolPose | None) -> Waypoint:
    move, names = SIGNATURES[call.name]
    given = _arguments(call, names)
    goal = given.get("pose_to") if move is Move.CIRCULAR else given.get(names[0])
    q = pose = via = via_q = near = None
    if isinstance(goal, Inverse):
        pose, near = _pose(goal.pose), goal.near
    elif isinstance(goal, PoseValue):
        pose = _pose(goal)
    elif isinstance(goal, tuple):
        q = tuple(number(v) for v in goal)
    else:
        raise NotKnown("needs constant joint positions or a constant pose")
    if move is Move.CIRCULAR:
        middle = given.get("pose_via")
        if isinstance(middle, PoseValue):
            via = _pose(middle)
        elif isinstance(middle, tuple):
            via_q = tuple(number(v) for v in middle)
        else:
            raise NotKnown("via must be constant joint positions or a constant pose")
        if given.get("mode", 0.0) not in (0.0, 1.0):
            raise NotKnown("mode is 0 or 1")
        if given.get("mode") == 1.0:
            raise NotKnown("mode = 1 (orientation fixed relative to the tangent) is not modelled")
    of_tool = move.of_tool
    duration = _positive(given, "t", None)
    speed = _positive(given, "v", TOOL_SPEED if of_tool else JOINT_SPEED)
    acceleration = _positive(given, "a", TOOL_ACCELERATION if of_tool else JOINT_ACCELERATION)
    radius = number(given.get("r", 0.0))
    if not 0 <= radius <= 10:
        raise NotKnown("r is a radius of 0 m or more")
    return Waypoint(
        place=at,
        move=move,
        q=q,
        pose=pose,
        near=near,
        via=via,
        via_q=via_q,
        speed=speed,
        acceleration=acceleration,
        duration=duration,
        blend=radius,
        tool=tool,
    )


def _statements(lines: Sequence[str]) -> Iterator[tuple[int, str]]:
    """Statements with the number of their first line; one whose brackets are open goes on."""
    held, begin, depth = "", 0, 0
    for k, raw in enumerate(lines, start=1):
        text = _bare(raw)
        if not text:
            continue
        begin = begin if held else k
        held = f"{held} {text}" if held else text
        plain = _TEXT.sub("", text)
        depth += sum(plain.count(c) for c in "([") - sum(plain.count(c) for c in ")]")
        if depth <= 0 or k - begin > 200:
            yield begin, held
            held, depth = "", 0
    if held:
        yield begin, held


def _bare(line: str) -> str:
    """A line without its comment, which may stand behind a text that holds ``#``."""
    quote = ""
    for i, c in enumerate(line):
        if quote:
            quote = "" if c == quote else quote
        elif c in "\"'":
            quote = c
        elif c == "#":
            return line[:i].strip()
    return line.strip()


def _arguments(call: Call, names: tuple[str, ...]) -> dict[str, Value]:
    if len(call.arguments) > len(names):
        raise NotKnown(f"has {len(call.arguments)} arguments, not at most {len(names)}")
    given = dict(zip(names, call.arguments, strict=False))
    for key, value in call.named.items():
        # movej is documented with q and movel with pose; both take either.
        name = names[0] if key in ("q", "pose") and names[0] in ("q", "pose") else key
        if name not in names or name in given:
            raise NotKnown(f"argument {key!r} is unknown or given twice")
        given[name] = value
    return given


def _positive(given: dict[str, Value], key: str, default: float | None) -> float | None:
    value = given.get(key, 0.0 if key == "t" else default)
    if isinstance(value, bool) or not isinstance(value, float):
        raise NotKnown(f"{key} is no number")
    if key == "t" and value == 0:
        return None
    if not 0 < value <= 1e4:
        raise NotKnown(f"{key} = {value:g} is not above 0")
    return value


def _pose(value: PoseValue) -> ToolPose:
    x, y, z, *turn = value.numbers
    try:
        w, i, j, k = wxyz_from("rotation_vector", np.array([turn]))[0].tolist()
    except ValueError as error:
        raise NotKnown(str(error)) from error
    return ToolPose((x, y, z), (w, i, j, k))


def _matrix(value: PoseValue) -> Array:
    pose = _pose(value)
    return transform(rotation_from_wxyz(pose.wxyz), pose.position)


def _vectors(rotation: Array) -> Array:
    """Rotation vector [rad], shape (1, 3)."""
    w, *axis = wxyz_from_rotation(rotation).tolist()
    sine = math.sqrt(sum(x * x for x in axis))
    angle = 2 * math.atan2(sine, w)
    return np.array([[x * (angle / sine if sine > 1e-12 else 2.0) for x in axis]])


def _value(matrix: Array) -> PoseValue:
    turn = _vectors(matrix[:3, :3])[0]
    return PoseValue(tuple(map(float, (*matrix[:3, 3], *turn))))
