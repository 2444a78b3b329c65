"""URScript programs: the waypoints of ``movej``, ``movel``, ``movep``, ``movec`` with constants.

A program is parsed, never executed. Constants are numbers, lists, poses, names, and arithmetic on them. What
would need execution (branches, loops, variables that sensors or functions set) is named with its line and
refused, because the motion behind it is not known; statements and blocks that move nothing are left out and
counted. A program that goes round for ever is read as one round. Defaults of speed and acceleration are those
of [URScript]_.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import isfinite

import numpy as np

from seerob.core.errors import InputError, Problem
from seerob.core.transforms import wxyz_from
from seerob.files.waypoints.waypoint import MAX_WAYPOINTS, Move, Program, ToolPose, Waypoint

TOKEN = re.compile(
    r"\s*(?:(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)|(?P<text>\"[^\"]*\"|'[^']*')"
    r"|(?P<name>[A-Za-z_]\w*)|(?P<sign>[-+*/(),=\[\]]))"
)
MAX_DEPTH = 40
MAX_TOKENS = 4_000
FUNCTIONS: dict[str, Callable[[float], float]] = {
    "d2r": math.radians,
    "r2d": math.degrees,
    "sqrt": math.sqrt,
    "sin": math.sin,
    "cos": math.cos,
}


class NotConstant(Exception):
    """What stands there is not a constant; the message says what."""


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


Value = float | bool | str | tuple[float, ...] | PoseValue | Inverse


@dataclass(frozen=True)
class Call:
    """A call of a function with constants."""

    name: str
    arguments: tuple[Value, ...]
    named: Mapping[str, Value]


def tokens(text: str) -> list[str]:
    """Pieces of one statement.

    Raises:
        NotConstant: A character that is none of the language's constants, or too many pieces.
    """
    found, at = [], 0
    text = text.rstrip()
    while at < len(text):
        match = TOKEN.match(text, at)
        if match is None:
            raise NotConstant(f"{text[at:].strip()[:20]!r} is no constant")
        found.append(match[0].strip())
        at = match.end()
        if len(found) > MAX_TOKENS:
            raise NotConstant("a statement this long is not read")
    return found


class Reader:
    """Reads the pieces of one statement from left to right."""

    def __init__(self, pieces: list[str], names: Mapping[str, Value | None]) -> None:
        """Begin.

        Args:
            pieces: Of `tokens`.
            names: Values of the variables; None for one whose value is not a constant.
        """
        self._pieces, self._at, self._names, self._depth = pieces, 0, names, 0

    def call(self) -> Call:
        """The whole statement as a call."""
        found = self._called(self._take())
        self.end()
        return found

    def _called(self, name: str) -> Call:
        self._expect("(")
        arguments: list[Value] = []
        named: dict[str, Value] = {}
        while self._peek() != ")":
            if self._peek(1) == "=":
                key = self._take()
                self._take()
                named[key] = self.value()
            elif named:
                raise NotConstant("an argument without a name after one with a name")
            else:
                arguments.append(self.value())
            if self._peek() != ")":
                self._expect(",")
        self._take()
        return Call(name, tuple(arguments), named)

    def end(self) -> None:
        """Nothing may follow."""
        if self._at < len(self._pieces):
            raise NotConstant(f"{self._peek()!r} is not expected there")

    def value(self) -> Value:
        """A sum."""
        self._depth += 1
        if self._depth > MAX_DEPTH:
            raise NotConstant(f"nested deeper than {MAX_DEPTH}")
        left = self._product()
        while self._peek() in ("+", "-"):
            sign = 1.0 if self._take() == "+" else -1.0
            left = _number(left) + sign * _number(self._product())
        self._depth -= 1
        return left

    def _product(self) -> Value:
        left = self._single()
        while self._peek() in ("*", "/"):
            times = self._take() == "*"
            right = _number(self._single())
            if not times and right == 0:
                raise NotConstant("a division by zero")
            left = _number(left) * right if times else _number(left) / right
        return left

    def _single(self) -> Value:
        negative = False
        while self._peek() in ("-", "+"):
            negative ^= self._take() == "-"
        value = self._atom()
        return -_number(value) if negative else value

    def _atom(self) -> Value:
        piece = self._take()
        if piece == "(":
            value = self.value()
            self._expect(")")
            return value
        if piece == "[":
            return self._list()
        if piece == "p" and self._peek() == "[":
            self._take()
            numbers = self._list()
            if len(numbers) != 6:
                raise NotConstant(f"a pose of {len(numbers)} numbers, not 6")
            return PoseValue(numbers)
        if piece[:1] in "\"'":
            return piece[1:-1]
        if piece[:1].isdigit() or piece[:1] == ".":
            return _finite(float(piece))
        if piece in ("True", "False"):
            return piece == "True"
        if piece in FUNCTIONS and self._peek() == "(":
            self._take()
            value = _number(self.value())
            self._expect(")")
            try:
                return _finite(FUNCTIONS[piece](value))
            except ValueError as error:
                raise NotConstant(f"{piece}({value:g}) is no number") from error
        if piece == "get_inverse_kin" and self._peek() == "(":
            return _inverse(self._called(piece))
        if piece not in self._names and piece == "pi":
            return math.pi
        known = self._names.get(piece)
        if known is None:
            raise NotConstant(f"{piece!r} is not a constant that the program gives")
        return known

    def _list(self) -> tuple[float, ...]:
        numbers: list[float] = []
        while self._peek() != "]":
            numbers.append(_number(self.value()))
            if self._peek() != "]":
                self._expect(",")
        self._take()
        return tuple(numbers)

    def _peek(self, ahead: int = 0) -> str:
        at = self._at + ahead
        return self._pieces[at] if at < len(self._pieces) else ""

    def _take(self) -> str:
        piece = self._peek()
        if not piece:
            raise NotConstant("it ends too early")
        self._at += 1
        return piece

    def _expect(self, piece: str) -> None:
        if self._take() != piece:
            raise NotConstant(f"{piece!r} is missing")


def _inverse(call: Call) -> Inverse:
    given = dict(zip(("x", "qnear"), call.arguments, strict=False)) | dict(call.named)
    pose, near = given.get("x"), given.get("qnear")
    if given.get("tcp", "active_tcp") != "active_tcp":
        raise NotConstant("get_inverse_kin for another tool point is not read")
    if not isinstance(pose, PoseValue) or not isinstance(near, tuple):
        raise NotConstant("get_inverse_kin needs a constant pose and a constant qnear")
    return Inverse(pose, near)


def _number(value: Value) -> float:
    if isinstance(value, bool) or not isinstance(value, float):
        raise NotConstant("a number is expected")
    return _finite(value)


def _finite(value: float) -> float:
    if not math.isfinite(value):
        raise NotConstant("a number beyond all bounds")
    return value


MOVES = ("movej", "movel", "movep", "movec")
MOVES_OTHERWISE = re.compile(
    r"(servo[jcl]|speed[jl]|stop[jl]|force_mode|freedrive_mode|teach_mode|conveyor|track_|path_|move\w+|"
    r"teachmode|screw_driving|tool_contact|set_conveyor)"
)
"""Begin of calls that move the robot in ways that are not modelled."""
DEFINITIONS = ("thread", "def", "sec")
"""Begin of what runs beside the program, or when it is called."""
OPENING = ("if", "while", "for", "thread")
BETWEEN = ("elif", "else")
LEAVING = ("return", "break", "continue", "halt", "kill", "join")
"""What follows a block with one of these may never be reached, or not when it seems."""
ENDLESS = re.compile(r"while\s*\(?\s*True\s*\)?\s*:")
ASSIGNMENT = re.compile(r"^(?:(?:global|local)\s+)?([A-Za-z_]\w*)\s*=(?!=)\s*(.*)$")
_TEXT = re.compile(r"\"[^\"]*\"|'[^']*'")
_CALL = re.compile(r"([A-Za-z_]\w*)\s*\(")


def moving(statement: str) -> str:
    """Name of the first call in a statement that moves the robot; empty when none does."""
    calls = _CALL.findall(_TEXT.sub("", statement))
    return next((name for name in calls if name in MOVES or MOVES_OTHERWISE.match(name)), "")


class Block:
    """A block that is read past to its end.

    Args:
        line: Where it begins.
        word: What it begins with.
    """

    def __init__(self, line: int, word: str) -> None:
        self.line, self.word = line, word
        self.defines = word in DEFINITIONS
        self.names: set[str] = set()
        """What is given another value in it."""
        self.matters = False
        """Whether something in it moves the robot or its tool point, or keeps from what follows."""
        self._depth = 1

    def take(self, word: str, statement: str) -> bool:
        """The next statement; whether it was the block's last.

        Args:
            word: What the statement begins with.
            statement: Without its comment.
        """
        if statement == "end":
            self._depth -= 1
        elif statement.endswith(":") and word not in BETWEEN:
            self._depth += 1
        if (match := ASSIGNMENT.match(statement)) is not None:
            self.names.add(match[1])
        self.matters |= bool(moving(statement)) or word == "set_tcp"
        self.matters |= not self.defines and (word in LEAVING or bool(ENDLESS.fullmatch(statement)))
        return self._depth == 0


MAX_BYTES = 16 << 20
MAX_LINES = 200_000
MAX_PROBLEMS = 20
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
BLOCKS = ("elif", "else", "return", "break", "continue", "kill", "join")
DEFINITION = re.compile(r"^(def|sec)\s+[A-Za-z_]\w*\s*\(\s*\)\s*:$")
NODE = re.compile(r"\$\s*\d+\b")
"""Marks the node of PolyScope's tree that a statement comes from."""
REMEDY = "export a program without it, or record the motion on the controller"


def read_urscript(content: bytes, file: str) -> Program:
    """The waypoints of a program.

    Args:
        content: The file.
        file: Its name, for messages.

    Raises:
        InputError: With every statement whose motion is not known, by line.
    """
    if len(content) > MAX_BYTES:
        raise InputError.at(file, "", f"{len(content)} bytes", f"at most {MAX_BYTES} are read")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError.at(file, "", f"is not text: {error}", "give a .script file") from error
    lines = text.splitlines()
    if len(lines) > MAX_LINES:
        raise InputError.at(file, "", f"{len(lines)} lines", f"at most {MAX_LINES} are read")
    found = _Script(file)
    for number, line in enumerate(lines, start=1):
        statement = _bare(line)
        if statement:
            found.take(number, statement)
        if len(found.problems) >= MAX_PROBLEMS:
            break
    return found.program()


class _Script:
    def __init__(self, file: str) -> None:
        self.file = file
        self.problems: list[Problem] = []
        self._waypoints: list[Waypoint] = []
        self._names: dict[str, Value | None] = {}
        self._changing: set[str] = set()
        """Names that something beside the program gives a value."""
        self._open = self._definitions = 0
        self._tcp: ToolPose | None = None
        self._left_out: dict[str, int] = {}
        self._block: Block | None = None
        self._round: int | None = None
        """Blocks that are open around the loop that never ends; None without one."""
        self._round_line = 0
        self._after = False
        """Whether that loop has ended."""

    def take(self, line: int, statement: str) -> None:
        word = re.split(r"\W", statement, maxsplit=1)[0]
        begun = self._definitions or self._waypoints
        if self._block is not None:
            if self._block.take(word, statement):
                self._leave_out(self._block)
                self._block = None
        elif NODE.match(statement):
            pass
        elif ENDLESS.fullmatch(statement) and self._round is None and self._open == self._definitions:
            self._round, self._round_line = self._open, line
            self._open += 1
        elif statement.endswith(":") and (word in OPENING or (word in DEFINITIONS and begun)):
            self._block = Block(line, word)
        elif DEFINITION.match(statement):
            self._definitions += 1
            self._open += 1
        elif statement == "end" and self._open:
            self._open -= 1
            self._after |= self._open == self._round
        elif word in BLOCKS or statement.endswith(":") or word == "def":
            self._wrong(line, f"`{word}`", "what is done there only a controller knows")
        elif (match := ASSIGNMENT.match(statement)) is not None:
            self._assign(line, match[1], match[2])
        else:
            self._statement(line, word, statement)

    def _leave_out(self, block: Block) -> None:
        """What a block does to the names is known to a controller alone."""
        self._names |= dict.fromkeys(block.names)
        self._changing |= block.names if block.defines else set()
        if block.matters:
            self._wrong(block.line, f"`{block.word}`", "what is done there only a controller knows")
        else:
            self._left_out[block.word] = self._left_out.get(block.word, 0) + 1

    def _assign(self, line: int, name: str, text: str) -> None:
        if call := moving(text):
            self._wrong(line, f"`{call}`", "what moves the robot stands in a statement of its own")
        # A name that is no constant matters only where a waypoint needs it.
        try:
            reader = Reader(tokens(text), self._names)
            value = reader.value()
            reader.end()
        except NotConstant:
            self._names[name] = None
            return
        # A name that is given twice is the latest, as the program runs from top to bottom.
        self._names[name] = None if name in self._changing else value

    def _statement(self, line: int, name: str, statement: str) -> None:
        known = name in SIGNATURES or name in ("sleep", "set_tcp")
        try:
            call = Reader(tokens(statement), self._names).call() if known else None
            if call is None:
                started = re.fullmatch(r"run\s+\w+\s*\(\s*\)", statement)
                if not (started or re.fullmatch(r"[A-Za-z_]\w*\s*\(.*\)", statement)):
                    raise NotConstant("is no statement that is known here")
                if moving(statement):
                    raise NotConstant("moves the robot in a way that is not modelled")
                self._left_out[name] = self._left_out.get(name, 0) + 1
            elif name == "sleep":
                self._sleep(call)
            elif name == "set_tcp":
                self._set_tcp(call)
            elif self._after:
                raise NotConstant("stands behind a loop that never ends")
            else:
                self._waypoints.append(self._waypoint(line, call))
                if len(self._waypoints) > MAX_WAYPOINTS:
                    raise NotConstant(f"more than {MAX_WAYPOINTS} waypoints")
        except NotConstant as error:
            self._wrong(line, f"`{name}`", str(error))

    def _sleep(self, call: Call) -> None:
        seconds = _arguments(call, ("t",)).get("t")
        if not isinstance(seconds, float) or isinstance(seconds, bool) or not 0 <= seconds <= 1e5:
            raise NotConstant("needs a time of 0 s or more")
        if self._waypoints:
            self._waypoints[-1] = self._waypoints[-1].waiting(seconds)

    def _set_tcp(self, call: Call) -> None:
        pose = next(iter(_arguments(call, ("pose", "tcp_name")).values()), None)
        if not isinstance(pose, PoseValue):
            raise NotConstant("needs a constant pose")
        new = _pose(pose)
        if self._waypoints and self._tcp != new:
            raise NotConstant("changes the tool point after the first move; split the program there")
        self._tcp = new

    def _waypoint(self, line: int, call: Call) -> Waypoint:
        move, names = SIGNATURES[call.name]
        given = _arguments(call, names)
        goal = given.get("pose_to") if move is Move.CIRCULAR else given.get(names[0])
        q = pose = via = near = None
        if isinstance(goal, Inverse):
            pose, near = _pose(goal.pose), goal.near
        elif isinstance(goal, PoseValue):
            pose = _pose(goal)
        elif isinstance(goal, tuple):
            q = goal
        else:
            raise NotConstant("needs constant joint positions or a constant pose")
        if move is Move.CIRCULAR:
            middle = given.get("pose_via")
            if not isinstance(middle, PoseValue) or pose is None:
                raise NotConstant("via and goal must be constant poses (joint positions are not read here)")
            via = _pose(middle)
            if given.get("mode", 0.0) not in (0.0, 1.0):
                raise NotConstant("mode is 0 or 1")
            if given.get("mode") == 1.0:
                raise NotConstant("mode = 1 (orientation fixed relative to the tangent) is not modelled")
        tool = move.of_tool
        duration = _positive(given, "t", None)
        speed = _positive(given, "v", TOOL_SPEED if tool else JOINT_SPEED)
        acceleration = _positive(given, "a", TOOL_ACCELERATION if tool else JOINT_ACCELERATION)
        radius = given.get("r", 0.0)
        if isinstance(radius, bool) or not isinstance(radius, float) or not 0 <= radius <= 10:
            raise NotConstant("r is a radius of 0 m or more")
        return Waypoint(
            place=f"line {line}",
            move=move,
            q=q,
            pose=pose,
            near=near,
            via=via,
            speed=speed,
            acceleration=acceleration,
            duration=duration,
            blend=radius,
        )

    def _wrong(self, line: int, what: str, why: str) -> None:
        self.problems.append(Problem(self.file, f"line {line}", f"{what}: {why}", REMEDY))

    def program(self) -> Program:
        if self._block is not None:
            self._wrong(self._block.line, f"`{self._block.word}`", "its `end` is missing")
        if self._round is not None and not self._after:
            self._wrong(self._round_line, "`while`", "its `end` is missing")
        if not self.problems and not self._waypoints:
            self.problems.append(
                Problem(self.file, "", "no move with constants", "give a program that moves")
            )
        if self.problems:
            raise InputError(self.problems)
        remarks = [
            "parsed, not executed; speeds and accelerations that a move does not give are the defaults of "
            f"URScript: {JOINT_SPEED:g} rad/s and {JOINT_ACCELERATION:g} rad/s² of the leading joint, "
            f"{TOOL_SPEED:g} m/s and {TOOL_ACCELERATION:g} m/s² of the tool point"
        ]
        if self._round is not None:
            remarks.append("the program goes round for ever; it is read as one round")
        if self._left_out:
            each = ", ".join(f"{name} ({count})" for name, count in sorted(self._left_out.items())[:12])
            remarks.append(f"statements taken to move nothing were left out, with their waiting: {each}")
        return Program(self.file, tuple(self._waypoints), tuple(remarks), self._tcp, controller=True)


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
        raise NotConstant(f"has {len(call.arguments)} arguments, not at most {len(names)}")
    given = dict(zip(names, call.arguments, strict=False))
    for key, value in call.named.items():
        # movej is documented with q and movel with pose; both take either.
        name = names[0] if key in ("q", "pose") and names[0] in ("q", "pose") else key
        if name not in names or name in given:
            raise NotConstant(f"argument {key!r} is unknown or given twice")
        given[name] = value
    return given


def _positive(given: dict[str, Value], key: str, default: float | None) -> float | None:
    value = given.get(key, 0.0 if key == "t" else default)
    if isinstance(value, bool) or not isinstance(value, float) or not isfinite(value):
        raise NotConstant(f"{key} is no number")
    if key == "t" and value == 0:
        return None
    if not 0 < value <= 1e4:
        raise NotConstant(f"{key} = {value:g} is not above 0")
    return value


def _pose(value: PoseValue) -> ToolPose:
    x, y, z, *turn = value.numbers
    try:
        w, i, j, k = wxyz_from("rotation_vector", np.array([turn]))[0].tolist()
    except ValueError as error:
        raise NotConstant(str(error)) from error
    return ToolPose((x, y, z), (w, i, j, k))
