"""Blocks of a URScript program: which of them can be left out, because nothing in them moves the robot."""

from __future__ import annotations

import re

MOVES = ("movej", "movel", "movep", "movec")
MOVES_OTHERWISE = re.compile(
    r"(servo[jcl]|speed[jl]|stop[jl]|force_mode|freedrive_mode|teach_mode|conveyor|track_|path_|move\w+|"
    r"teachmode|screw_driving|tool_contact|set_conveyor)"
)
"""Begin of calls that move the robot in ways that are not modelled."""
APART = ("thread", "def", "sec")
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
        self.apart = word in APART
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
        self.matters |= not self.apart and (word in LEAVING or bool(ENDLESS.fullmatch(statement)))
        return self._depth == 0
