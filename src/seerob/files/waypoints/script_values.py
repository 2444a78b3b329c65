"""Constants of a URScript program: numbers, lists, poses, names, and arithmetic on them; nothing runs."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass

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
