"""ABB's RAPID modules (``.mod``, ``.prg``): ``MoveAbsJ``, ``MoveJ``, ``MoveL``, ``MoveC`` with known goals.

Data of the module (``robtarget``, ``jointtarget``, ``speeddata``, ``zonedata``, ``tooldata``, ``wobjdata``,
numbers), ``Offs``, ``RelTool``, procedures without arguments, branches and loops that are known. Millimetres,
degrees, quaternions w x y z. What is not in the module is asked for; see `flow` for what is left out.
[RapidReference]_
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from seerob.core.errors import InputError
from seerob.core.transforms import Array, rotation_from_rpy, rotation_from_wxyz, transform
from seerob.files.waypoints.expressions import Evaluating, Expression, given, number, tokens, truth
from seerob.files.waypoints.flow import (
    MAX_CALLS,
    Asked,
    Block,
    Item,
    Line,
    NotKnown,
    lines_of,
    still,
    waited,
)
from seerob.files.waypoints.waypoint import Configuration, Move, Program, ToolPose, Waypoint

Value = float | bool | str | tuple["Value", ...]
MOVES = {"moveabsj": Move.JOINT, "movej": Move.JOINT, "movel": Move.LINEAR, "movec": Move.CIRCULAR}
OTHERWISE = re.compile(r"(move\w+|search[lc]|trigg[ljc]\w*|arc\w+|spot\w+|paint[lc]|egm\w*|cam\w*|"
                       r"stepbwdpath|indamove|indrmove|indcmove|conf[lj]|pdisp\w*|eoffs\w*|corrcon|actunit)",
                       re.IGNORECASE)  # fmt: skip
"""Begin of instructions that move the robot, or change how it moves, in ways that are not modelled."""
HARMLESS = ("confl", "confj")
"""They change whether configurations are checked."""
STILL = re.compile(
    r"(set|reset|setdo|setao|setgo|pulsedo|wait\w+|tp\w+|ui\w+|clk\w+|incr|decr|add|clear|open|close|write\w*|"
    r"read\w*|conf[lj]|singarea|gripload|socket\w+|idelete|connect|isignal\w+|ienable|idisable|iwatch|isleep|"
    r"stop|break|errwrite|motionsup|pathresol|invertdo|load|unload|save)$",
    re.IGNORECASE,
)
"""Instructions that are taken to move nothing."""
SPEEDS = (5, 10, 20, 30, 40, 50, 60, 80, 100, 150, 200, 300, 400, 500, 600, 800, 1000, 1500, 2000, 2500,
          3000, 4000, 5000, 6000, 7000)  # fmt: skip
"""Of predefined speeddata, their name and speed of the tool point [mm/s]; they turn at 500 °/s."""
ZONES = (1, 5, 10, 15, 20, 30, 40, 50, 60, 80, 100, 150, 200)
"""Of predefined zonedata, their name and radius for the tool point [mm]."""
UNUSED = 9e8
"""An external axis with more is not there."""
IDENTITY = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))
MEMBERS = {
    "trans": 0, "rot": 1, "robconf": 2, "extax": 3, "robax": 0, "x": 0, "y": 1, "z": 2, "tframe": 1,
    "robhold": 0,
    "uframe": 3, "oframe": 4, "v_tcp": 0, "v_ori": 1, "finep": 0, "pzone_tcp": 1,
    "q1": 0, "q2": 1, "q3": 2, "q4": 3, "rax_1": 0, "rax_2": 1, "rax_3": 2, "rax_4": 3,
    "rax_5": 4, "rax_6": 5,
}  # fmt: skip
DATA = re.compile(
    r"(?:LOCAL\s+|TASK\s+)?(?:CONST|PERS|VAR)\s+\w+\s+(\w+)\s*(\{[^}]*\})?\s*(?::=\s*(.*))?",
    re.IGNORECASE | re.DOTALL,
)
ASSIGNMENT = re.compile(r"(\w+)((?:\.\w+|\{[^}]*\})*)\s*:=\s*(.*)", re.DOTALL)


def read_rapid(content: bytes, file: str, values: Mapping[str, float | bool | str]) -> Program:
    """The waypoints of a module.

    Args:
        content: The file.
        file: Its name, for messages.
        values: What it needs and does not give, by its name there; a text is an expression of the language:
            ``tGrip = "[TRUE,[[0,0,150],[1,0,0,0]],[1,[0,0,50],[1,0,0,0],0,0,0]]"``.

    Raises:
        InputError: Every value that is needed and was not given, or nothing that moves.
    """
    found = _Module(file, values)
    found.go(lines_of(content, file))
    return found.program(nothing="no Move instruction in main, or in the only procedure")


@dataclass
class _Moving:
    """Speeds of a move."""

    speed: float | None
    turn: float | None


class _Reader(Expression[Value]):
    def __init__(self, pieces: list[str], module: _Module) -> None:
        super().__init__(pieces)
        self._module = module

    def atom(self, piece: str) -> Value:
        """A list, a text, a name or a function, see `Expression`."""
        if piece == "[":
            return tuple(self.listed("]"))
        if piece[:1] == '"':
            return piece[1:-1]
        if self.peek() == "(":
            begin = self.at - 1
            if piece.lower() in ("offs", "reltool", "abs", "sqrt", "sin", "cos", "round", "trunc"):
                return self._known(piece.lower())
            depth = 0
            while True:
                depth += {"(": 1, ")": -1}.get(self.take(), 0)
                if depth == 0:
                    break
            return self._module.value("".join(self.pieces[begin : self.at]))
        if not piece.isidentifier():
            raise NotKnown(f"{piece!r} is not expected there")
        return self._module.value(piece)

    def _known(self, name: str) -> Value:
        self.take()
        arguments, turned = [], {"rx": 0.0, "ry": 0.0, "rz": 0.0}
        while self.peek() != ")":
            if self.peek() == "\\":
                self.take()
                key = self.take().lower()
                self.expect(":=")
                if key not in turned:
                    raise NotKnown(f"\\{key} is not known")
                turned[key] = number(self.value())
            else:
                arguments.append(self.value())
            if self.peek() == ",":
                self.take()
        self.take()
        if name not in ("offs", "reltool"):
            x = number(arguments[0] if arguments else None)
            angle = math.radians(x)
            if name == "sqrt" and x < 0:
                raise NotKnown(f"sqrt({x:g}) is no number")
            of = {"abs": abs(x), "sqrt": math.sqrt(abs(x)), "sin": math.sin(angle), "cos": math.cos(angle)}
            return of[name] if name in of else float(round(x) if name == "round" else math.trunc(x))
        if len(arguments) != 4 or not isinstance(arguments[0], tuple) or len(arguments[0]) < 2:
            raise NotKnown(f"{name} needs a robtarget and three numbers")
        target, shift = arguments[0], [number(v) for v in arguments[1:]]
        place, turn = _vector(target[0], 3), _vector(target[1], 4)
        if name == "offs":
            return (tuple(np.add(place, shift).tolist()), *target[1:])
        rotation = rotation_from_wxyz(np.array(turn) / np.linalg.norm(turn))
        angles = np.radians([turned["rx"], turned["ry"], turned["rz"]])
        # Turns follow each other about x, y, z of the tool as it was turned before.
        own = np.eye(3)
        for axis, angle in zip("xyz", angles, strict=True):
            own = own @ rotation_from_rpy([angle if axis == a else 0.0 for a in "xyz"])
        moved = ToolPose.of(transform(rotation @ own, np.array(place) + rotation @ np.array(shift)))
        return (moved.position, moved.wxyz, *target[2:])

    def after(self, value: Value) -> Value:
        """A member or an element of a value."""
        while self.peek() in (".", "{"):
            if self.take() == ".":
                name = self.take().lower()
                if name not in MEMBERS:
                    raise NotKnown(f".{name} is not known")
                place = MEMBERS[name]
            else:
                place = int(number(self.value())) - 1
                self.expect("}")
            if not isinstance(value, tuple) or not 0 <= place < len(value):
                raise NotKnown("no element there")
            value = value[place]
        return value


class _Module(Evaluating):
    def __init__(self, file: str, values: Mapping[str, float | bool | str]) -> None:
        super().__init__(file, values)
        self._names: dict[str, Value | None] = {}
        self._procedures: dict[str, Block] = {}
        self._external: set[tuple[float, ...]] = set()
        self._acceleration = 1.0
        self._meant = True
        """Whether joint moves go to the configuration of their goal (``ConfJ``)."""

    def go(self, lines: Sequence[str]) -> None:
        """Data first, then ``main``, else the only procedure."""
        data, self._procedures = _parsed(lines, self.file)
        for line in data:
            self._declared(line.text)
        begin = self._procedures.get("main")
        if begin is None and len(self._procedures) == 1:
            (begin,) = self._procedures.values()
        if begin is None and self._procedures:
            name = given(self.values, "main")
            begin = self._procedures.get(str(name).lower())
            if begin is None:
                self.ask("module", "PROC", Asked("main"))
        if begin is not None:
            self.run(begin.body)
        if len(self._external) > 1:
            self.leave("extax", "extax", "external axes move the robot or the workpiece")
        self.remarks.append(
            "poses are in work object and base of the module, the base being the world where nobody says "
            "more; "
            "speeds of MoveJ are taken as mean speeds of the tool point; configurations are those of the "
            "robot's joints in the maker's directions and zeros"
        )

    def _declared(self, text: str) -> None:
        match = DATA.match(text)
        if match is None:
            return
        try:
            self._names[match[1].lower()] = None if match[3] is None else self.evaluate(match[3])
        except NotKnown:
            self._names[match[1].lower()] = None

    def evaluate(self, text: str) -> Value:
        """The value of an expression, see `Evaluating`."""
        return _Reader(tokens(text), self).whole()

    def value(self, name: str) -> Value:
        """What a name means.

        Raises:
            Asked: Nobody says it.
        """
        plain = name.lower()
        if self._names.get(plain) is not None:
            return self._names[plain]  # type: ignore[return-value]
        said = given(self.values, name)
        if isinstance(said, str):
            return _Reader(tokens(said), self).whole()
        if said is not None:
            return said if isinstance(said, bool) else float(said)
        if plain not in self._names:
            if (v := re.fullmatch(r"v(\d+)", plain)) and int(v[1]) in SPEEDS:
                return (float(v[1]), 500.0, 5000.0, 1000.0)
            if plain == "z0":
                return (False, 0.3)
            if (z := re.fullmatch(r"z(\d+)", plain)) and int(z[1]) in ZONES:
                return (False, float(z[1]))
            if plain == "fine":
                return (True, 0.0)
            if plain == "tool0":
                return (True, IDENTITY)
            if plain == "wobj0":
                return (False, True, "", IDENTITY, IDENTITY)
            if plain == "pi":
                return math.pi
        raise Asked(name)

    # -- the walk -----------------------------------------------------------------------------------

    def matters(self, statement: str) -> bool:
        """Whether a statement moves or leaves, see `Walk`."""
        word = re.split(r"\W", statement, maxsplit=1)[0].lower()
        if word in ("return", "exit", "goto", "raise", "exitcycle"):
            return True
        if word in MOVES or (OTHERWISE.match(word) and word not in HARMLESS):
            return True
        if not word or ASSIGNMENT.match(statement) or DATA.match(statement) or STILL.match(word):
            return False
        return not still(self.values, word)

    def forget(self, statement: str) -> None:
        """What a statement changes is not known, see `Walk`."""
        if (match := ASSIGNMENT.match(statement)) is not None:
            self._names[match[1].lower()] = None

    def counted(self, block: Block) -> Iterator[None]:
        """Rounds of ``FOR i FROM a TO b STEP c DO``."""
        match = re.fullmatch(
            r"(\w+)\s+FROM\s+(.+?)\s+TO\s+(.+?)(?:\s+STEP\s+(.+))?", block.arms[0][0], re.IGNORECASE
        )
        return self.times(match, self._names, falls=True)

    def do(self, line: Line) -> str:
        """Run one instruction, see `Walk`."""
        text = line.text
        word = re.split(r"\W", text, maxsplit=1)[0].lower()
        if DATA.match(text):
            self._declared(text)
        elif word in MOVES:
            self.waypoints.append(self._moved(line.at, word, text))
        elif word in ("return", "exit"):
            return "return" if word == "return" else "never"
        elif word == "waittime":
            waited(self.waypoints, number(self.evaluate(text[8:].rpartition("\\")[2].removeprefix("InPos,"))))
        elif word == "confj":
            self._meant = "off" not in text.lower()
        elif word == "accset":
            first = text[6:].split(",")[0]
            self._acceleration = min(max(number(self.evaluate(first)), 20.0), 100.0) / 100
        elif word in self._procedures and ":=" not in text.partition("(")[0]:
            return self._called(word, text[len(word) :].strip())
        elif word in ("velset", "goto", "exitcycle", "raise") or (
            OTHERWISE.match(word) and word not in HARMLESS
        ):
            raise NotKnown("is an instruction that is not modelled")
        elif (match := ASSIGNMENT.match(text)) is not None:
            self._assign(match)
        elif STILL.match(word) or still(self.values, word):
            self.quiet(re.split(r"\W", text, maxsplit=1)[0])
        else:
            raise NotKnown(f'what it calls is not in this module (if it moves nothing: "{word}()" = true)')
        return ""

    def _called(self, name: str, text: str) -> str:
        """Run a procedure with its arguments, which are values: what it changes of them stays in it."""
        block = self._procedures[name]
        if self._depth >= MAX_CALLS:
            raise NotKnown(f"calls are followed {MAX_CALLS} deep")
        given_, switches = _arguments(
            text.strip("()") if text.startswith("(") and text.endswith(")") else text
        )
        names = block.arms[0][0].split()
        if len(given_) != len(names) or switches or "\\" in names:
            raise NotKnown("its arguments are not followed")
        held = {n: self._names.get(n) for n in names}
        self._names |= {n: self.evaluate(value) for n, value in zip(names, given_, strict=True)}
        self._depth += 1
        end = self.run(block.body)
        self._depth -= 1
        self._names |= held
        return "never" if end == "never" else ""

    def _assign(self, match: re.Match[str]) -> None:
        name, behind, text = match[1].lower(), match[2], match[3]
        try:
            new = self.evaluate(text)
            if behind:
                path = [
                    MEMBERS[p.lower()] if p[0].isalpha() else int(p) - 1 for p in re.findall(r"\w+", behind)
                ]
                new = _put(self._names.get(name), path, new)
        except (NotKnown, KeyError, ValueError):
            self._names[name] = None
        else:
            self._names[name] = new

    # -- motions ------------------------------------------------------------------------------------

    def _moved(self, at: str, word: str, text: str) -> Waypoint:
        arguments, switches = _arguments(text[len(word) :])
        kind = MOVES[word]
        points = arguments[: 2 if kind is Move.CIRCULAR else 1]
        rest = arguments[len(points) :]
        if len(rest) < 2 or "conc" in switches:
            raise NotKnown("its arguments are not known")
        speed, zone = (
            self.evaluate(rest[0]),
            self.evaluate(rest[1]) if rest[1].lower() != "fine" else (True, 0.0),
        )
        tool = self._tool(rest[2] if len(rest) > 2 else "tool0")
        work = self._work(switches.get("wobj", "wobj0"))
        goal = self.evaluate(points[-1])
        via = self.evaluate(points[0]) if kind is Move.CIRCULAR else None
        q, pose, meant = None, None, None
        if word == "moveabsj":
            q = tuple(math.radians(v) for v in self._axes(goal))
        else:
            pose = self._target(goal, work)
            meant = _configuration(goal)
        v_tcp, v_ori = self._speed(rest[0], speed, switches)
        duration = number(self.evaluate(switches["t"])) if "t" in switches else None
        of_tool = kind.of_tool
        most = v_tcp is None
        return Waypoint(
            place=at,
            move=kind,
            name=points[-1] if points[-1].isidentifier() else "",
            q=q,
            pose=pose,
            via=None if via is None else self._target(via, work),
            speed=v_tcp if of_tool else None,
            along=None if of_tool else v_tcp,
            share=1.0 if most and not of_tool else None,
            turn=v_ori if of_tool else None,
            duration=duration,
            blend=self._zone(zone, switches),
            acceleration_share=self._acceleration,
            tool=tool,
            configuration=meant if kind is Move.JOINT and self._meant else None,
        )

    def _speed(
        self, name: str, speed: Value, switches: Mapping[str, str]
    ) -> tuple[float | None, float | None]:
        """Of the tool point [m/s] and of its turning [rad/s]."""
        if not isinstance(speed, tuple) or len(speed) < 2:
            raise NotKnown(f"{name} is no speeddata")
        v_tcp, v_ori = number(speed[0]), number(speed[1])
        if "v" in switches:
            v_tcp = number(self.evaluate(switches["v"]))
        if not (v_tcp > 0 and v_ori > 0):
            raise NotKnown(f"{name} is not above 0")
        return v_tcp * 1e-3, math.radians(v_ori)

    def _zone(self, zone: Value, switches: Mapping[str, str]) -> float:
        if "z" in switches:
            return number(self.evaluate(switches["z"])) * 1e-3
        if not isinstance(zone, tuple) or len(zone) < 2:
            raise NotKnown("no zonedata")
        return 0.0 if truth(zone[0]) else min(max(number(zone[1]), 0.0), 1e4) * 1e-3

    def _axes(self, goal: Value) -> tuple[float, ...]:
        if not isinstance(goal, tuple) or not goal:
            raise NotKnown("no jointtarget")
        if len(goal) > 1:
            self._extra(goal[1])
        return _vector(goal[0], 6)

    def _extra(self, value: Value) -> None:
        there = _vector(value, 6)
        self._external.add(tuple(0.0 if abs(v) > UNUSED else v for v in there))

    def _target(self, goal: Value, work: Array) -> ToolPose:
        if not isinstance(goal, tuple) or len(goal) < 2:
            raise NotKnown("no robtarget")
        if len(goal) > 3:
            self._extra(goal[3])
        return ToolPose.of(work @ _frame(goal[:2]))

    def _tool(self, name: str) -> ToolPose:
        value = self.evaluate(name)
        if not isinstance(value, tuple) or len(value) < 2:
            raise NotKnown(f"{name} is no tooldata")
        if not truth(value[0]):
            raise NotKnown("the tool stands still and the robot holds the workpiece")
        return ToolPose.of(_frame(value[1]))

    def _work(self, name: str) -> Array:
        value = self.evaluate(name)
        if not isinstance(value, tuple) or len(value) != 5:
            raise NotKnown(f"{name} is no wobjdata")
        if truth(value[0]) or not truth(value[1]):
            raise NotKnown("the work object moves")
        return _frame(value[3]) @ _frame(value[4])


def _configuration(goal: Value) -> Configuration | None:
    """Quadrants of axes 1, 4, 6; cfx: behind axis 1 (4), behind the lower arm (2), axis 5 negative (1)."""
    if not isinstance(goal, tuple) or len(goal) < 3:
        return None
    figures = _vector(goal[2], 4)
    cf1, cf4, cf6, cfx = (int(v) for v in figures)
    text = f"confdata [{cf1},{cf4},{cf6},{cfx}]"
    if not 0 <= cfx <= 7:
        return Configuration(text)
    one, four, six = ((c * math.pi / 2, (c + 1) * math.pi / 2) for c in (cf1, cf4, cf6))
    fifth = (-math.inf, 0.0) if cfx & 1 else (0.0, math.inf)
    return Configuration(text, (one, None, None, four, fifth, six), (0.0,) * 6, (not cfx & 4, not cfx & 2))


def _vector(value: Value, n: int) -> tuple[float, ...]:
    if not isinstance(value, tuple) or len(value) != n:
        raise NotKnown(f"{n} numbers are expected")
    return tuple(number(v) for v in value)


def _frame(value: Value) -> Array:
    """Of a position [mm] and a quaternion."""
    if not isinstance(value, tuple) or len(value) != 2:
        raise NotKnown("no pose")
    place, turn = np.array(_vector(value[0], 3)), np.array(_vector(value[1], 4))
    length = float(np.linalg.norm(turn))
    if not 0.9 < length < 1.1:
        raise NotKnown(f"a quaternion of length {length:.3g}")
    return transform(rotation_from_wxyz(turn / length), place * 1e-3)


def _put(held: Value | None, path: Sequence[int], value: Value) -> Value:
    if not isinstance(held, tuple) or not 0 <= path[0] < len(held):
        raise NotKnown("no element there")
    items = list(held)
    items[path[0]] = value if len(path) == 1 else _put(items[path[0]], path[1:], value)
    return tuple(items)


def _arguments(text: str) -> tuple[list[str], dict[str, str]]:
    """Arguments in their order, and switches with their values."""
    found, switches, depth, piece = [], {}, 0, ""
    pieces: list[str] = []
    for c in text:
        depth += {"(": 1, "[": 1, "{": 1, ")": -1, "]": -1, "}": -1}.get(c, 0)
        if depth == 0 and c in ",\\":
            pieces.append(piece)
            piece = c if c == "\\" else ""
        else:
            piece += c
    for part in (*pieces, piece):
        bare = part.strip()
        if bare.startswith("\\"):
            key, _, value = bare[1:].partition(":=")
            switches[key.strip().lower()] = value.strip()
        elif bare:
            found.append(bare)
    return found, switches


CONTROL = re.compile(r"(IF|ELSEIF|FOR|WHILE)\b(.*?)\b(THEN|DO)\b(.*)", re.IGNORECASE | re.DOTALL)
ENDS = ("endif", "endfor", "endwhile", "endproc", "endtest", "endfunc", "endtrap", "endmodule", "endrecord")


def _parsed(lines: Sequence[str], file: str) -> tuple[list[Line], dict[str, Block]]:
    """Data of the module, and its procedures."""
    data: list[Line] = []
    procedures: dict[str, Block] = {}
    open_: list[tuple[Block | None, list[Item]]] = [(None, [])]
    for at, text in _statements(lines):
        word = re.split(r"\W", text, maxsplit=1)[0].lower()
        block, items = open_[-1]
        if word in ENDS:
            if len(open_) > 1:
                open_.pop()
        elif match := re.match(
            r"(?:LOCAL\s+)?(PROC|FUNC|TRAP|RECORD)\s+(?:\w+\s+)?(\w+)", text, re.IGNORECASE
        ):
            new = Block(at, match[1].lower(), "other", [("", [])])
            if match[1].lower() == "proc":
                name = re.match(r"(?:LOCAL\s+)?PROC\s+(\w+)", text, re.IGNORECASE)
                assert name is not None
                procedures[name[1].lower()] = new
                inside = text.partition("(")[2].rpartition(")")[0]
                # Names of its parameters, in the place of a condition; one that is changed is not followed.
                every = [p.split() for p in inside.split(",") if p.strip()]
                plain = all(re.fullmatch(r"(?:\w+ )?\w+ \w+", " ".join(p)) for p in every)
                inout = any(p[0].lower() in ("inout", "var", "pers") for p in every)
                names = [p[-1].lower() for p in every] if plain and not inout else ["\\"] * len(every)
                new.arms[0] = (" ".join(names), new.body)
            open_.append((new, new.body))
        elif word in ("error", "undo", "backward") and text.lower() == word and len(open_) > 1:
            held = Block(at, word, "if", [("FALSE", [])])
            open_[-1] = (block, held.body)  # run when something fails, not on the way
        elif word in ("elseif", "else") and block is not None and block.kind == "if":
            match = CONTROL.match(text)
            block.arms.append((match[2].strip() if match is not None else "", []))
            open_[-1] = (block, block.body)
        elif word in ("case", "default") and block is not None and block.word == "TEST":
            subject = block.arms[0][0]
            cases = (
                [c.strip() for c in text.partition(" ")[2].rstrip(":").split(",")] if word == "case" else []
            )
            block.arms.append((" OR ".join(f"({subject})=({c})" for c in cases), []))
            open_[-1] = (block, block.body)
        elif word == "test":
            new = Block(at, "TEST", "if", [(text[4:].strip(), [])])
            items.append(new)
            open_.append((new, []))
        elif match := CONTROL.match(text):
            kind = {"if": "if", "for": "count", "while": "while"}.get(word, "other")
            new = Block(at, match[1].upper(), kind, [(match[2].strip(), [])])
            items.append(new)
            open_.append((new, new.body))
        elif block is None:
            data.append(Line(at, text))
        else:
            items.append(Line(at, text))
        if len(open_) > 60:
            raise InputError.at(file, at, "nested deeper than 60", "is it a module?")
    for block in procedures.values():
        _tests(block)
    return data, procedures


def _tests(block: Block) -> None:
    """The subject of a TEST is no branch of it."""
    if block.word == "TEST":
        del block.arms[0]
        if not block.arms:
            block.arms.append(("FALSE", []))
    for _, items in block.arms:
        for item in items:
            if isinstance(item, Block):
                _tests(item)


def _statements(lines: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Instructions and heads of blocks, without comments, each with its place."""
    held, begin = "", 0
    for k, raw in enumerate(lines, start=1):
        bare = _uncommented(raw).strip()
        if bare.startswith("%%%") or (not held and re.match(r"(VERSION|LANGUAGE)\s*:", bare, re.IGNORECASE)):
            continue
        while bare:
            if not held:
                begin = k
            head = re.match(
                r"(MODULE\b.*|(?:LOCAL\s+)?(?:PROC|FUNC|TRAP)\b.*\)|(?:LOCAL\s+)?(?:TRAP|RECORD)\b.*|"
                r"(?:IF|ELSEIF)\b.*?\bTHEN\b|(?:FOR|WHILE)\b.*?\bDO\b|ELSE\b|TEST\b[^;:]*|(?:CASE|DEFAULT)\b[^:]*:|"
                r"(?:ENDIF|ENDFOR|ENDWHILE|ENDPROC|ENDTEST|ENDFUNC|ENDTRAP|ENDMODULE|ENDRECORD|ERROR|UNDO)\b)",
                bare, re.IGNORECASE,
            ) if not held else None  # fmt: skip
            if head is not None:
                if not head[0].lower().startswith("module"):
                    yield f"line {k}", head[0].strip()
                bare = bare[head.end() :].strip()
                continue
            before, semicolon, bare = bare.partition(";")
            held = f"{held} {before}".strip()
            if semicolon:
                if held:
                    yield f"line {begin}", held
                held = ""
            bare = bare.strip()


def _uncommented(line: str) -> str:
    quoted = False
    for i, c in enumerate(line):
        quoted ^= c == '"'
        if c == "!" and not quoted:
            return line[:i]
    return line
