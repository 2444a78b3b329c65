"""Expressions of robots' languages: numbers, lists, names, arithmetic, conditions; worked out, never run."""

from __future__ import annotations

import math
import re
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, MutableMapping
from typing import Any, Generic, TypeVar

from seerob.files.waypoints.flow import NotKnown, Walk

TOKEN = re.compile(
    r"\s*(?:(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)|(?P<text>\"[^\"]*\"|'[^']*')"
    r"|(?P<name>\$?[A-Za-z_][\w$]*)|(?P<sign>==|!=|<>|<=|>=|:=|[-+*/%(),=\[\]{}<>:.\\#?]))"
)
V = TypeVar("V")
MAX_DEPTH = 40
MAX_TOKENS = 4_000
COMPARED = ("==", "=", "!=", "<>", "<", ">", "<=", ">=")


def tokens(text: str) -> list[str]:
    """Pieces of one statement.

    Raises:
        NotKnown: A character that is none of the languages' constants, or too many pieces.
    """
    found, at = [], 0
    text = text.rstrip()
    while at < len(text):
        match = TOKEN.match(text, at)
        if match is None:
            raise NotKnown(f"{text[at:].strip()[:20]!r} is no constant")
        found.append(match[0].strip())
        at = match.end()
        if len(found) > MAX_TOKENS:
            raise NotKnown("a statement this long is not read")
    return found


class Expression(ABC, Generic[V]):
    """Reads the pieces of one statement from left to right; values are floats, bools and those of ``V``.

    Args:
        pieces: Of `tokens`.
    """

    def __init__(self, pieces: list[str]) -> None:
        self.pieces, self.at, self._depth = pieces, 0, 0

    @abstractmethod
    def atom(self, piece: str) -> float | bool | V:
        """The value that begins with a piece, which was taken.

        Raises:
            NotKnown: It is not known.
        """

    def after(self, value: float | bool | V) -> float | bool | V:
        """A value with what stands behind it: an index, a member."""
        return value

    def joined(self, left: float | bool | V, right: float | bool | V, sign: str) -> float | bool | V:
        """Of ``+``, ``-``, ``*``, ``/``, ``%``, ``div``, ``mod``."""
        a, b = number(left), number(right)
        if sign in ("/", "div", "mod", "%") and b == 0:
            raise NotKnown("a division by zero")
        match sign:
            case "+":
                return finite(a + b)
            case "-":
                return finite(a - b)
            case "*":
                return finite(a * b)
            case "/":
                return finite(a / b)
            case "div":
                return float(math.trunc(a / b))
        return math.fmod(a, b)

    def whole(self) -> float | bool | V:
        """The value of everything."""
        value = self.value()
        self.end()
        return value

    def value(self) -> float | bool | V:
        """A condition or a sum."""
        self._depth += 1
        if self._depth > MAX_DEPTH:
            raise NotKnown(f"nested deeper than {MAX_DEPTH}")
        left = self._both()
        while (word := self.peek().lower()) in ("or", "xor", "exor"):
            self.take()
            right = truth(self._both())
            left = (truth(left) or right) if word == "or" else (truth(left) != right)
        self._depth -= 1
        return left

    def _both(self) -> float | bool | V:
        left = self._not()
        while self.peek().lower() == "and":
            self.take()
            right = truth(self._not())
            left = truth(left) and right
        return left

    def _not(self) -> float | bool | V:
        negative = False
        while self.peek().lower() == "not":
            self.take()
            negative = not negative
        value = self._compared()
        return not truth(value) if negative else value

    def _compared(self) -> float | bool | V:
        left = self.sum()
        if self.peek() in COMPARED:
            sign = self.take()
            right = self.sum()
            if type(left) is not type(right):
                raise NotKnown("what is compared is not of one kind")
            if sign in ("==", "=", "!=", "<>"):
                return (left == right) == (sign in ("==", "="))
            a, b = number(left), number(right)
            return {"<": a < b, ">": a > b, "<=": a <= b, ">=": a >= b}[sign]
        return left

    def sum(self) -> float | bool | V:
        """A sum."""
        left = self._product()
        while self.peek() in ("+", "-"):
            sign = self.take()
            left = self.joined(left, self._product(), sign)
        return left

    def _product(self) -> float | bool | V:
        left = self._single()
        while self.peek().lower() in ("*", "/", "%", "div", "mod", ":") and self.factor(self.peek()):
            sign = self.take().lower()
            left = self.joined(left, self._single(), sign)
        return left

    def factor(self, sign: str) -> bool:
        """Whether a sign joins two factors in this language."""
        return sign != ":"

    def _single(self) -> float | bool | V:
        negative = False
        while self.peek() in ("-", "+"):
            negative ^= self.take() == "-"
        value = self.after(self._of(self.take()))
        return -number(value) if negative else value

    def _of(self, piece: str) -> float | bool | V:
        if piece == "(":
            value = self.value()
            self.expect(")")
            return value
        if piece[:1].isdigit() or (piece[:1] == "." and len(piece) > 1):
            return finite(float(piece))
        if piece.lower() in ("true", "false"):
            return piece.lower() == "true"
        return self.atom(piece)

    def listed(self, close: str) -> list[float | bool | V]:
        """Values up to a bracket that closes, which is taken."""
        found: list[float | bool | V] = []
        while self.peek() != close:
            found.append(self.value())
            if self.peek() != close:
                self.expect(",")
        self.take()
        return found

    def end(self) -> None:
        """Nothing may follow."""
        if self.at < len(self.pieces):
            raise NotKnown(f"{self.peek()!r} is not expected there")

    def peek(self, ahead: int = 0) -> str:
        """The next piece, or the one after it; empty at the end."""
        at = self.at + ahead
        return self.pieces[at] if at < len(self.pieces) else ""

    def take(self) -> str:
        """The next piece."""
        piece = self.peek()
        if not piece:
            raise NotKnown("it ends too early")
        self.at += 1
        return piece

    def expect(self, piece: str) -> None:
        """The next piece has to be this one."""
        if self.take() != piece:
            raise NotKnown(f"{piece!r} is missing")


def number(value: object) -> float:
    """A number; not a truth value."""
    if isinstance(value, bool) or not isinstance(value, float):
        raise NotKnown("a number is expected")
    return finite(value)


def truth(value: object) -> bool:
    """A truth value."""
    if not isinstance(value, bool):
        raise NotKnown("a truth value is expected")
    return value


class Evaluating(Walk):
    """A walk through a language that has expressions."""

    @abstractmethod
    def evaluate(self, text: str) -> object:
        """The value of an expression.

        Raises:
            NotKnown: It is not known.
        """

    def true(self, condition: str) -> bool:
        """Whether a condition holds, see `Walk`."""
        try:
            return truth(self.evaluate(condition))
        except NotKnown as error:
            raise NotKnown(f"whether {condition[:60]} holds only a controller knows") from error

    def times(
        self, match: re.Match[str] | None, names: MutableMapping[str, Any], *, falls: bool = False
    ) -> Iterator[None]:
        """Rounds of a loop that counts.

        Args:
            match: Its variable, first and last number, and step, if any; None where it says something else.
            names: Values by name, where the variable is set before each round.
            falls: Whether it counts down where it says no step and the last number is less.

        Raises:
            NotKnown: How often it is run is not known.
        """
        if match is None:
            raise NotKnown("how often it is run is not known")
        first, last = (number(self.evaluate(match[k])) for k in (2, 3))
        step = number(self.evaluate(match[4])) if match[4] else (-1.0 if falls and last < first else 1.0)
        if step == 0:
            raise NotKnown("a step of 0")

        def rounds() -> Iterator[None]:
            x = first
            while (x <= last) if step > 0 else (x >= last):
                names[match[1].lower()] = x
                yield None
                x += step

        return rounds()


def finite(value: float) -> float:
    """A number that is none beyond all bounds."""
    if not math.isfinite(value):
        raise NotKnown("a number beyond all bounds")
    return value


def given(values: Mapping[str, float | bool | str], name: str) -> float | bool | str | None:
    """What the user gives under a name, whatever its blanks and (as KRL and RAPID have it) its case."""
    if name in values:
        return values[name]
    plain = "".join(name.split()).lower()
    return next((v for key, v in values.items() if "".join(key.split()).lower() == plain), None)
