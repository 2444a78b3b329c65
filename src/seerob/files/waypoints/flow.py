"""Programs of robots gone through from top to bottom: branches, loops and calls that are known are followed.

What only a controller knows (a condition on an input, a motion that a sensor ends) is left out with its
place, once: when it moves the robot or its tool, or keeps from what follows, the motion is not known and
whoever reads it says so; when it does not, what it may have changed is no longer known.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from seerob.core.errors import InputError, Problem
from seerob.files.waypoints.waypoint import MAX_WAYPOINTS, Program, Waypoint, one_tool

MAX_STEPS = 200_000
MAX_PROBLEMS = 20
MAX_CALLS = 20
MAX_NESTED = 60
"""Blocks in blocks."""


class NotKnown(Exception):
    """What stands there is no constant; the message says what."""


class Asked(NotKnown):
    """A value that the program does not give, and the user can.

    Args:
        name: As it is written in the program.
    """

    def __init__(self, name: str) -> None:
        super().__init__(f"{name} is not a constant that the program gives")
        self.name = name


@dataclass(frozen=True)
class Line:
    """One statement."""

    at: str
    """Its place: ``line 12``."""
    text: str


@dataclass
class Block:
    """Statements that are run by a condition, again and again, or when they are called."""

    at: str
    word: str
    """What it begins with, for messages."""
    kind: str
    """``if``, ``while``, ``until``, ``forever``, ``count``, or ``other`` for what is not followed."""
    arms: list[tuple[str, list[Item]]] = field(default_factory=list)
    """Condition and statements; of ``if`` one for each branch, an empty condition being always true."""

    @property
    def body(self) -> list[Item]:
        """Statements of the last arm."""
        return self.arms[-1][1]

    def lines(self) -> Iterator[str]:
        """Every statement in it, conditions too."""
        for condition, items in self.arms:
            yield condition
            for item in items:
                if isinstance(item, Block):
                    yield from item.lines()
                else:
                    yield item.text


Item = Line | Block
ENDS = ("break", "return", "never")
"""Why what follows is not run: a loop or a call is left, or a loop never ends."""


class Walk(ABC):
    """Goes through the statements of one program.

    Args:
        file: Its name, for messages.
        values: What the user gives: names as they are written in the program, values in its language.
    """

    def __init__(self, file: str, values: Mapping[str, float | bool | str]) -> None:
        self.file, self.values = file, values
        self.waypoints: list[Waypoint] = []
        self.problems: list[Problem] = []
        self.remarks: list[str] = []
        self.rounds = False
        """Whether a loop never ends, and was read as one round."""
        self._left_out: dict[str, str] = {}
        self._asked: set[str] = set()
        self._quiet: Counter[str] = Counter()
        self._steps = self._depth = 0
        self.lost = -1
        """How many waypoints there were when the robot was last moved in a way that is not known."""
        self._unsure = False
        """Whether what was left out may end the loop that it stands in."""

    # -- of each language ------------------------------------------------------------------------

    @abstractmethod
    def do(self, line: Line) -> str:
        """Run one statement; why what follows is not run, or nothing.

        Raises:
            NotKnown: A motion that is not known.
        """

    @abstractmethod
    def true(self, condition: str) -> bool:
        """Whether a condition holds.

        Raises:
            NotKnown: Only a controller knows.
        """

    @abstractmethod
    def matters(self, statement: str) -> bool:
        """Whether a statement moves the robot or its tool point, or keeps from what follows."""

    @abstractmethod
    def forget(self, statement: str) -> None:
        """What a statement may have changed is not known."""

    def counted(self, block: Block) -> Iterator[None]:
        """Run before each round of a ``count``.

        Raises:
            NotKnown: How often is not known.
        """
        raise NotKnown(f"how often `{block.word}` is run is not known")

    # -- of all -----------------------------------------------------------------------------------

    def run(self, items: Sequence[Item]) -> str:
        """Run statements; why what follows is not run, or nothing."""
        for item in items:
            self._steps += 1
            if self._steps > MAX_STEPS or len(self.waypoints) > MAX_WAYPOINTS:
                what = f"more than {MAX_STEPS} statements or {MAX_WAYPOINTS} waypoints are run"
                raise InputError.at(self.file, item.at, what, "is it a loop without an end?")
            end = self._block(item) if isinstance(item, Block) else self._line(item)
            if end:
                return end
        return ""

    def _line(self, line: Line) -> str:
        try:
            return self.do(line)
        except Asked as error:
            self.forget(line.text)
            self.ask(line.at, line.text, error)
        except NotKnown as error:
            self.forget(line.text)
            self.leave(line.at, line.text, str(error))
        return ""

    def _block(self, block: Block) -> str:
        if block.kind == "other":
            self._pass(block, "what is done there only a controller knows")
            return ""
        try:
            if block.kind == "if":
                for condition, items in block.arms:
                    if not condition or self.true(condition):
                        return self.run(items)
                return ""
            return self._loop(block)
        except NotKnown as error:
            self._pass(block, str(error))
            return ""

    def _loop(self, block: Block) -> str:
        condition, items = block.arms[0]
        if block.kind == "forever" or (block.kind == "while" and self._always(condition)):
            return self._endless(block, items)
        rounds: Iterator[object] = iter(lambda: None, 0)
        if block.kind == "count":
            rounds = self.counted(block)
        for _ in rounds:
            if block.kind == "while" and not self.true(condition):
                return ""
            if end := self.run(items):
                return "" if end == "break" else end
            if block.kind == "until" and self.true(condition):
                return ""
        return ""

    def _always(self, condition: str) -> bool:
        return condition.strip("() ").lower() == "true"

    def _endless(self, block: Block, items: Sequence[Item]) -> str:
        """A loop without a condition: as often as it takes to leave it, else one round."""
        outer, self._unsure = self._unsure, False
        try:
            while True:
                before = self._steps
                end = self.run(items)
                if end:
                    return "" if end == "break" else end
                if self._unsure or not self._leaves(block) or self._steps == before:
                    break
        finally:
            self._unsure = outer
        self.rounds = True
        return "never"

    def _leaves(self, block: Block) -> bool:
        return any(self.breaks(text) for text in block.lines())

    def breaks(self, statement: str) -> bool:
        """Whether a statement leaves the loop that it stands in."""
        return statement.strip().lower() in ("break", "exit", "return")

    def _pass(self, block: Block, why: str) -> None:
        texts = list(block.lines())
        for text in texts:
            self.forget(text)
        if any(map(self.matters, texts)) or self._stuck(block.arms):
            self._unsure |= any(map(self.breaks, texts))
            self.leave(block.at, block.word, why)
        else:
            self._quiet[block.word] += 1

    def _stuck(self, arms: Sequence[tuple[str, list[Item]]]) -> bool:
        """Whether a loop that never ends stands in a block."""
        inside = [item for _, items in arms for item in items if isinstance(item, Block)]
        return any(
            b.kind == "forever" or (b.kind == "while" and self._always(b.arms[0][0])) or self._stuck(b.arms)
            for b in inside
        )

    def leave(self, at: str, text: str, why: str) -> None:
        """A part of the motion that is left out, said once."""
        self.lost = len(self.waypoints)
        self._left_out.setdefault(at, f"{at}: `{text.strip()[:60]}` is left out: {why}")

    def quiet(self, word: str) -> None:
        """Something that moves nothing was left out."""
        self._quiet[word] += 1

    def ask(self, at: str, text: str, asked: Asked) -> None:
        """A value that a motion needs and nobody gave, asked for once."""
        if asked.name not in self._asked and len(self.problems) < MAX_PROBLEMS:
            self._asked.add(asked.name)
            what = f"`{text.strip()[:60]}` needs {asked.name}, which the program does not give"
            key = _key(asked.name)
            remedy = f"give it in the source, as the program would write it: values = {{ {key} = … }}"
            self.problems.append(Problem(self.file, at, what, remedy))

    def program(self, *, nothing: str, controller: bool = True) -> Program:
        """What was found.

        Args:
            nothing: What is said of a program without waypoints.
            controller: See `Program`.

        Raises:
            InputError: Values that nobody gave, or no waypoint.
        """
        left_out = tuple(self._left_out.values())
        if not self.problems and not self.waypoints:
            what = "; ".join((nothing, *left_out[:5]))
            self.problems.append(Problem(self.file, "", what, "give a program that moves"))
        if self.problems:
            raise InputError(self.problems[:MAX_PROBLEMS])
        remarks = list(self.remarks)
        if self.rounds:
            remarks.append("the program goes round for ever; it is read as one round")
        if self._quiet:
            each = ", ".join(f"{word} ({n})" for word, n in sorted(self._quiet.items())[:12])
            remarks.append(f"statements taken to move nothing were left out, with their waiting: {each}")
        waypoints, tool = one_tool(self.waypoints)
        return Program(self.file, waypoints, tuple(remarks), tool, controller, left_out)


def _key(name: str) -> str:
    return name if name.replace("_", "").replace("-", "").isalnum() else f'"{name}"'


def still(values: Mapping[str, float | bool | str], name: str) -> bool:
    """Whether the user says that a call moves nothing: ``"grip()" = true``."""
    return any(k.replace(" ", "").lower() == f"{name}()".lower() and v is True for k, v in values.items())


def waited(waypoints: list[Waypoint], seconds: float) -> None:
    """The robot stands where it is for ``seconds`` more.

    Raises:
        NotKnown: It is no time.
    """
    if not 0 <= seconds <= 1e5:
        raise NotKnown("needs a time of 0 s or more")
    if waypoints:
        waypoints[-1] = waypoints[-1].waiting(seconds)


def lines_of(content: bytes, file: str, *, most: int = 16 << 20) -> list[str]:
    """Lines of a program's text; UTF-8, else Latin-1, as controllers write it.

    Raises:
        InputError: It is too large, or no text.
    """
    if len(content) > most:
        raise InputError.at(file, "", f"{len(content)} bytes", f"at most {most} are read")
    if b"\0" in content:
        raise InputError.at(file, "", "is not text", "give the program as text")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = content.decode("latin-1")
    return text.splitlines()
