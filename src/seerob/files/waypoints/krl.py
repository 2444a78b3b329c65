"""KUKA's KRL (``.src``, beside it ``.dat`` and ``$config.dat``): PTP, LIN, CIRC and their spline forms.

Points and frames (mm, and A, B, C in degrees about z, then the new y, then the new x), inline forms with
FDAT, PDAT and LDAT, ``BAS``, ``$VEL``, ``$ACC``, ``$TOOL``, ``$BASE``, blends, subprograms of the file,
branches and loops that are known. Tools and bases that no file has are asked for; see `flow` for what is
left out.
[KukaKrl]_
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from seerob.core.errors import InputError
from seerob.core.transforms import Array, rotation_from_rpy, transform
from seerob.files.waypoints.expressions import Evaluating, Expression, given, number, tokens
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

Fields = dict[str, "Value"]
Value = float | bool | str | Fields
MOVES = {"ptp": Move.JOINT, "sptp": Move.JOINT, "lin": Move.LINEAR, "slin": Move.LINEAR,
         "circ": Move.CIRCULAR, "scirc": Move.CIRCULAR}  # fmt: skip
OTHERWISE = re.compile(r"(ptp_rel|lin_rel|circ_rel|sptp_rel|slin_rel|scirc_rel|spl|spl_rel|asypt?p|lin_\w+|"
                       r"arc_\w*|moveemi|brake|goto|interrupt)\b", re.IGNORECASE)  # fmt: skip
STILL = (
    "wait",
    "interrupt",
    "global",
    "trigger",
    "pulse",
    "continue",
    "on_error_proceed",
    "anout",
    "anin",
    "ini",
)
"""Words that begin statements that are taken to move nothing."""
HERE = ("$axis_act", "$pos_act", "$axis_for", "$pos_for")
PLACE, ANGLES = ("x", "y", "z"), ("a", "b", "c")
AXES = tuple(f"a{i}" for i in range(1, 8))
EXTERNAL = tuple(f"e{i}" for i in range(1, 7))
DECLARED = re.compile(
    r"(?:GLOBAL\s+|DECL\s+|CONST\s+|SIGNAL\s+)*(?:\w+\s+)?(\$?\w+)\s*(\[[\d,\s]*\])?\s*=\s*(.+)",
    re.IGNORECASE,
)
ASSIGNMENT = re.compile(r"(\$?\w+)\s*(\[[^\]]*\])?((?:\.\w+)*)\s*=(?!=)\s*(.+)")
DECLARATION = re.compile(
    r"(DECL|EXT|EXTFCT|ENUM|STRUC|INT|REAL|BOOL|CHAR|FRAME|POS|E6POS|E6AXIS|AXIS|SIGNAL)\b(?!.*=)",
    re.IGNORECASE,
)
NULL = np.eye(4)
STANDARD = (0.0, -math.pi / 2, math.pi / 2, 0.0, 0.0, 0.0)
"""A posture with status 2: the wrist before axis 1, the elbow up [rad]."""


def read_krl(
    content: bytes, file: str, values: Mapping[str, float | bool | str], beside: Sequence[bytes] = ()
) -> Program:
    """The waypoints of a program.

    Args:
        content: The ``.src``.
        file: Its name, for messages.
        values: What it needs and does not give, by its name there; a text is an expression of the language:
            ``"TOOL_DATA[1]" = "{X 0,Y 0,Z 150,A 0,B 0,C 0}"``.
        beside: Contents of ``$config.dat`` and of the program's ``.dat``.

    Raises:
        InputError: Every value that is needed and was not given, or nothing that moves.
    """
    found = _Krl(file, values)
    for data in beside:
        found.data(lines_of(data, file))
    found.go(lines_of(content, file))
    return found.program(nothing="no PTP, LIN or CIRC")


class _Reader(Expression[Value]):
    def __init__(self, pieces: list[str], program: _Krl) -> None:
        super().__init__(pieces)
        self._program = program

    def atom(self, piece: str) -> Value:
        """A structure, a text or a name, see `Expression`."""
        if piece == "{":
            return self._fields()
        if piece == "#":
            return "#" + self.take().lower()
        if piece[:1] == '"':
            return piece[1:-1]
        if piece[:1] == "'":
            kind, digits = piece[1:2].lower(), piece[2:-1]
            if kind in ("b", "h") and digits:
                try:
                    return float(int(digits, 2 if kind == "b" else 16))
                except ValueError as error:
                    raise NotKnown(f"{piece} is no number") from error
        if not re.match(r"\$?[A-Za-z_]", piece):
            raise NotKnown(f"{piece!r} is not expected there")
        if self.peek() == "[":
            self.take()
            index = number(self.value())
            self.expect("]")
            return self._program.value(f"{piece}[{index:g}]")
        if self.peek() == "(":
            raise Asked(piece + "()")
        return self._program.value(piece)

    def _fields(self) -> Fields:
        found: Fields = {}
        if self.peek(1) == ":":  # {E6POS: X 1, …}
            self.take()
            self.take()
        while self.peek() != "}":
            name = self.take().lower()
            if self.peek() == "[":  # POINT2[] " "
                self.take()
                self.expect("]")
            found[name] = self.value()
            if self.peek() == ",":
                self.take()
        self.take()
        return found

    def factor(self, sign: str) -> bool:
        """A colon puts one frame behind another."""
        return True

    def joined(self, left: Value, right: Value, sign: str) -> Value:
        """Numbers, or frames behind each other."""
        if sign != ":":
            return super().joined(left, right, sign)
        matrix = _frame(left) @ _frame(right)
        rest = (
            {k: v for k, v in right.items() if k in ("s", "t", *EXTERNAL)} if isinstance(right, dict) else {}
        )
        return {**_figures(matrix), **rest}

    def after(self, value: Value) -> Value:
        """A field of a structure."""
        while self.peek() == ".":
            self.take()
            name = self.take().lower()
            if not isinstance(value, dict) or name not in value:
                raise NotKnown(f"no field {name} there")
            value = value[name]
        return value


class _Krl(Evaluating):
    def __init__(self, file: str, values: Mapping[str, float | bool | str]) -> None:
        super().__init__(file, values)
        self._texts: dict[str, str] = {}
        """Of data that were declared and not looked at yet."""
        self._names: dict[str, Value | None] = {}
        self._programs: dict[str, Block] = {}
        self._external: set[tuple[float, ...]] = set()
        self._tool: Array | str | None = None
        self._base: Array | str | None = None
        self._last: Fields | None = None

    def data(self, lines: Sequence[str]) -> None:
        """Take in what a ``.dat`` declares."""
        for raw in lines:
            match = DECLARED.match(_bare(raw))
            if match is not None:
                self._texts["".join((match[1] + (match[2] or "")).split()).lower()] = match[3]

    def go(self, lines: Sequence[str]) -> None:
        """Run the first program of the file."""
        first, self._programs = _parsed(lines, self.file)
        self.run(first)
        if len(self._external) > 1:
            self.leave("E1", "E1", "external axes move the robot or the workpiece")
        self.remarks.append(
            "bases are in the world, the robot standing at its origin; axes are the robot's joints in the "
            "maker's directions and zeros; accelerations in percent are of joint_acceleration and "
            "tool_acceleration"
        )

    def value(self, name: str) -> Value:
        """What a name means.

        Raises:
            Asked: Nobody says it.
        """
        plain = name.lower()
        if plain in HERE:
            raise NotKnown(f"{name} is where the robot is")
        if plain in ("$nullframe", "$world", "$robroot") and plain not in self._names:
            return dict.fromkeys((*PLACE, *ANGLES), 0.0)
        known = self._names.get(plain)
        if known is None and plain not in self._names and plain in self._texts:
            text = self._texts.pop(plain)
            try:
                known = self._names[plain] = self.evaluate(text)
            except NotKnown:
                self._names[plain] = None
        if known is not None:
            return known
        said = given(self.values, name)
        if isinstance(said, str):
            return self.evaluate(said)
        if said is not None:
            return said if isinstance(said, bool) else float(said)
        raise Asked(name)

    def evaluate(self, text: str) -> Value:
        """The value of an expression, see `Evaluating`."""
        return _Reader(tokens(text), self).whole()

    # -- the walk -----------------------------------------------------------------------------------

    def matters(self, statement: str) -> bool:
        """Whether a statement moves or leaves, see `Walk`."""
        word = _word(statement)
        if word in ("return", "exit", "halt", "goto", "bas") or word in MOVES or OTHERWISE.match(statement):
            return True
        if re.match(r"(\$tool|\$base|\$vel|\$acc|fdat_act|pdat_act|ldat_act)\b", statement, re.IGNORECASE):
            return True
        called = re.fullmatch(r"(\w+)\s*\(.*\)", statement)
        return called is not None and not still(self.values, called[1])

    def forget(self, statement: str) -> None:
        """What a statement changes is not known, see `Walk`."""
        if (match := ASSIGNMENT.match(statement)) is not None:
            self._names["".join((match[1] + (match[2] or "")).split()).lower()] = None

    def breaks(self, statement: str) -> bool:
        """Whether a statement leaves, see `Walk`."""
        return _word(statement) in ("exit", "return", "halt", "goto")

    def counted(self, block: Block) -> Iterator[None]:
        """Rounds of ``FOR i = a TO b STEP c``."""
        match = re.fullmatch(
            r"(\w+)\s*=\s*(.+?)\s+TO\s+(.+?)(?:\s+STEP\s+(.+))?", block.arms[0][0], re.IGNORECASE
        )
        return self.times(match, self._names)

    def do(self, line: Line) -> str:
        """Run one statement, see `Walk`."""
        text, word = line.text, _word(line.text)
        if word in MOVES:
            self._move(line.at, word, text[len(word) :].strip())
        elif word in ("exit", "return", "halt"):
            return {"exit": "break", "return": "return", "halt": "never"}[word]
        elif OTHERWISE.match(text) and word != "interrupt":
            raise NotKnown("moves the robot in a way that is not modelled")
        elif match := re.match(r"BAS\s*\(\s*#(\w+)\s*(?:,\s*(.+?))?\s*\)$", text, re.IGNORECASE):
            self._bas(match[1].lower(), match[2])
        elif match := re.match(r"WAIT\s+SEC\s+(.+)", text, re.IGNORECASE):
            waited(self.waypoints, number(self.evaluate(match[1])))
        elif match := re.fullmatch(r"(\w+)\s*\((.*)\)", text):
            if still(self.values, match[1]):
                self.quiet(match[1])
                return ""
            if match[1].lower() not in self._programs or match[2].strip():
                why = "is not in this file" if match[1].lower() not in self._programs else "has arguments"
                raise NotKnown(f'what it calls {why} (if it moves nothing: "{match[1]}()" = true)')
            if self._depth >= MAX_CALLS:
                raise NotKnown(f"calls are followed {MAX_CALLS} deep")
            self._depth += 1
            end = self.run(self._programs[match[1].lower()].body)
            self._depth -= 1
            return "never" if end == "never" else ""
        elif match := ASSIGNMENT.match(re.sub(r"^(DECL\s+)?\w+\s+(?=\$?\w+\s*=)", "", text)):
            self._assign(match)
        elif word in STILL:
            self.quiet(word)
        else:
            raise NotKnown("is no statement that is known here")
        return ""

    def _assign(self, match: re.Match[str]) -> None:
        index = match[2] or ""
        if index and not re.fullmatch(r"\[\s*\d+\s*\]", index):
            try:
                index = f"[{number(self.evaluate(index[1:-1])):g}]"
            except NotKnown:
                return
        name = "".join((match[1] + index).split()).lower()
        try:
            value: Value | None = self.evaluate(match[4])
        except NotKnown:
            value = None
        if name in ("$tool", "$base") and not match[3]:
            if value is None:
                raise Asked(match[4].strip())
            if name == "$tool":
                self._tool = _frame(value)
            else:
                self._base = _frame(value)
            return
        if match[3]:
            path = match[3][1:].lower()
            if name[0] != "$":
                held = self._held(name)
                value = {**held, path: value} if held is not None and value is not None else None
            else:
                name += "." + path
        self._names[name] = value

    def _held(self, name: str) -> Fields | None:
        try:
            held = self.value(name)
        except NotKnown:
            return None
        return held if isinstance(held, dict) else None

    def _bas(self, what: str, argument: str | None) -> None:
        if what in ("tool", "base"):
            value = number(self.evaluate(argument or ""))
            if what == "tool":
                self._tool = f"TOOL_DATA[{value:g}]" if value else NULL
            else:
                self._base = f"BASE_DATA[{value:g}]" if value else NULL
        elif what in ("vel_ptp", "ptp_params"):
            self._names["vel ptp"] = self.evaluate(argument or "")
            self._taken(what, "pdat_act", "acc ptp")
        elif what in ("vel_cp", "cp_params"):
            self._names["$vel.cp"] = self.evaluate(argument or "")
            self._taken(what, "ldat_act", "acc cp")
        elif what == "acc_ptp":
            self._names["acc ptp"] = self.evaluate(argument or "")
        elif what == "acc_cp":
            self._names["$acc.cp"] = self.evaluate(argument or "")
        elif what in ("frames", "ptp_dat", "cp_dat"):
            self._frames()

    def _taken(self, what: str, active: str, acceleration: str) -> None:
        """What the active PDAT or LDAT of an inline form says."""
        if not what.endswith("params"):
            return
        held = self._held(active)
        if held is not None:
            self._names[acceleration] = held.get("acc", 100.0)
            self._names["apo " + active] = held.get("apo_dist", 0.0)
        if acceleration == "acc cp":
            self._names.pop("$acc.cp", None)
        self._frames()

    def _frames(self) -> None:
        held = self._held("fdat_act")
        if held is None:
            return
        if held.get("ipo_frame") == "#tcp":
            self._tool = self._base = None
            return
        tool, base = (held.get(k) for k in ("tool_no", "base_no"))
        if isinstance(tool, float):
            self._tool = f"TOOL_DATA[{tool:g}]" if tool > 0 else NULL
        if isinstance(base, float):
            self._base = f"BASE_DATA[{base:g}]" if base > 0 else NULL

    # -- motions ------------------------------------------------------------------------------------

    def _move(self, at: str, word: str, text: str) -> None:
        text, _, condition = re.sub(r"\bWITH\b", "\0", text, flags=re.IGNORECASE).partition("\0")
        if condition:
            self._with(condition)
        blends = re.findall(r"\bC_(?:PTP|DIS|VEL|ORI|SPL)\b", text + condition, re.IGNORECASE)
        text = re.sub(r"\bC_(?:PTP|DIS|VEL|ORI|SPL)\b", "", text, flags=re.IGNORECASE).strip()
        kind = MOVES[word]
        pieces = _parts(text)
        if kind is Move.CIRCULAR:
            if len(pieces) != 2:
                raise NotKnown("an arc of an angle (CA) is not modelled")
        elif len(pieces) != 1:
            raise NotKnown("its goal is not known")
        if pieces[0].lower() in HERE:
            self.quiet(f"{word} {pieces[0]}")
            return
        goals = [self._goal(piece) for piece in pieces]
        q, pose, meant = goals[-1]
        via = goals[0] if kind is Move.CIRCULAR else None
        tool = self._now("tool")
        speeds = self._cp() if kind.of_tool else self._ptp()
        blend = self._blend(kind, blends)
        self.waypoints.append(
            Waypoint(
                place=at,
                move=kind,
                name=pieces[-1] if re.fullmatch(r"\w+", pieces[-1]) else "",
                q=q,
                pose=pose,
                via=None if via is None else via[1],
                via_q=None if via is None else via[0],
                tool=None if tool is None else ToolPose.of(tool),
                configuration=meant if kind is Move.JOINT else None,
            )
        )
        self.waypoints[-1] = replace(self.waypoints[-1], **speeds, **blend)

    def _with(self, text: str) -> None:
        """Of a spline motion: ``WITH $VEL_AXIS[1]=SVEL_JOINT(100.0), $TOOL=STOOL2(FP1), …``."""
        for key, name in (("STOOL2?", "tool"), ("SBASE", "base")):
            match = re.search(rf"{key}\s*\(\s*(\w+)", text, re.IGNORECASE)
            if match is not None:
                held = self._held(match[1])
                if held is None:
                    raise Asked(match[1])
                if held.get("ipo_frame") == "#tcp":
                    raise NotKnown("the tool stands still and the robot holds the workpiece")
                no = held.get(f"{name}_no")
                where = f"{name.upper()}_DATA[{no:g}]" if isinstance(no, float) and no > 0 else NULL
                if name == "tool":
                    self._tool = where
                else:
                    self._base = where
        for key, name in (("SVEL_JOINT", "vel ptp"), ("SVEL_CP", "$vel.cp")):
            match = re.search(rf"{key}\s*\(\s*([-+.\w]+)", text, re.IGNORECASE)
            if match is not None:
                self._names[name] = self.evaluate(match[1])
        for key, name, apo in (("SACC_JOINT", "acc ptp", "pdat_act"), ("SACC_CP", "acc cp", "ldat_act")):
            match = re.search(rf"{key}\s*\(\s*(\w+)", text, re.IGNORECASE)
            held = None if match is None else self._held(match[1])
            if held is not None:
                self._names[name] = held.get("acc", 100.0)
                self._names["apo " + apo] = held.get("apo_dist", 0.0)
                if name == "acc cp":
                    self._names.pop("$acc.cp", None)
        for name in ("$vel.cp", "$acc.cp"):
            match = re.search(rf"{re.escape(name)}\s*=\s*([-+.\d]+)", text, re.IGNORECASE)
            if match is not None:
                self._names[name] = float(match[1])

    def _figure(self, name: str) -> float | None:
        value = self._names.get(name)
        return value if isinstance(value, float) and not isinstance(value, bool) and value > 0 else None

    def _ptp(self) -> dict[str, Any]:
        percent = self._figure("vel ptp") or self._figure("$vel_axis[1]")
        return {
            "share": min(percent or 100.0, 100.0) / 100,
            "acceleration_share": min(self._figure("acc ptp") or self._figure("$acc_axis[1]") or 100.0, 100.0)
            / 100,
        }

    def _cp(self) -> dict[str, Any]:
        found: dict[str, Any] = {"acceleration_share": min(self._figure("acc cp") or 100.0, 100.0) / 100}
        if (speed := self._figure("$vel.cp")) is not None:
            found["speed"] = speed
        if (acceleration := self._figure("$acc.cp")) is not None:
            found["acceleration"] = acceleration
        turns = [v for k in ("$vel.ori1", "$vel.ori2") if (v := self._figure(k)) is not None]
        if turns and speed is not None:
            found["turn"] = math.radians(min(turns))
        return found

    def _blend(self, kind: Move, blends: Sequence[str]) -> dict[str, Any]:
        if not blends:
            return {}
        if kind.of_tool:
            radius = self._figure("$apo.cdis") or self._figure("apo ldat_act")
            if radius is None:
                raise Asked("$APO.CDIS")
            return {"blend": min(radius, 1e4) * 1e-3}
        share = self._figure("$apo.cptp") or self._figure("apo pdat_act")
        if share is None:
            raise Asked("$APO.CPTP")
        return {"blend_share": min(share, 100.0) / 100}

    def _now(self, what: str) -> Array | None:
        held = self._tool if what == "tool" else self._base
        if held is None:
            raise Asked(f"${what.upper()}")
        if isinstance(held, str):
            return _frame(self.value(held))
        return held

    def _goal(self, text: str) -> tuple[tuple[float, ...] | None, ToolPose | None, Configuration | None]:
        value = self.evaluate(text)
        if not isinstance(value, dict):
            raise NotKnown(f"{text} is no position")
        axes = [k for k in AXES if k in value]
        if self._last is not None and self.lost < len(self.waypoints):
            keys = (*AXES,) if axes else (*PLACE, *ANGLES, "s", "t")
            value = {**{k: v for k, v in self._last.items() if k in keys}, **value}
        self._external.add(tuple(number(value.get(k, 0.0)) for k in EXTERNAL))
        if axes:
            held = [k for k in AXES if k in value]
            if held != list(AXES[: len(held)]) or len(held) < 6:
                raise NotKnown("it names some axes, and where the others are is not known")
            self._last = value
            return tuple(math.radians(number(value[k])) for k in held), None, None
        if not set(PLACE + ANGLES) <= set(value):
            raise NotKnown("it names a part of a position, and the rest is not known")
        self._last = value
        base = self._now("base")
        assert base is not None
        return None, ToolPose.of(base @ _frame(value)), _configuration(value)


def _configuration(value: Fields) -> Configuration | None:
    """Status and turn: the wrist behind axis 1, the elbow, axis 5 negative (1, 2, 4); signs of the axes."""
    if "s" not in value or "t" not in value:
        return None
    status, turn = int(number(value["s"])), int(number(value["t"]))
    text = f"S {status}, T {turn}"
    if not (0 <= status <= 7 and 0 <= turn <= 63):
        return Configuration(text)
    ranges = tuple((-math.inf, 0.0) if turn >> i & 1 else (0.0, math.inf) for i in range(6))
    return Configuration(text, ranges, STANDARD, (not status & 1, bool(status & 2)))


def _frame(value: Value) -> Array:
    """Of X, Y, Z [mm] and A, B, C [deg]."""
    if not isinstance(value, dict) or not set(PLACE + ANGLES) <= set(value):
        raise NotKnown("no frame with X, Y, Z, A, B, C")
    a, b, c = (math.radians(number(value[k])) for k in ANGLES)
    return transform(rotation_from_rpy([c, b, a]), np.array([number(value[k]) for k in PLACE]) * 1e-3)


def _figures(matrix: Array) -> Fields:
    """X, Y, Z [mm] and A, B, C [deg] of a transform."""
    r = matrix[:3, :3]
    b = math.atan2(-r[2, 0], math.hypot(r[0, 0], r[1, 0]))
    a, c = math.atan2(r[1, 0], r[0, 0]), math.atan2(r[2, 1], r[2, 2])
    if math.hypot(r[0, 0], r[1, 0]) < 1e-9:
        a, c = math.atan2(-r[0, 1], r[1, 1]), 0.0
    figures = (*(matrix[:3, 3] * 1e3).tolist(), *map(math.degrees, (a, b, c)))
    return dict(zip((*PLACE, *ANGLES), map(float, figures), strict=True))


def _word(text: str) -> str:
    return re.split(r"[^\w$]", text, maxsplit=1)[0].lower()


def _bare(line: str) -> str:
    """A line without its comment."""
    quoted = False
    for i, c in enumerate(line):
        quoted ^= c == '"'
        if c == ";" and not quoted:
            return line[:i].strip()
    return line.strip()


def _parts(text: str) -> list[str]:
    """Pieces between commas that stand in no bracket."""
    found, depth, piece = [], 0, ""
    for c in text:
        depth += {"{": 1, "(": 1, "[": 1, "}": -1, ")": -1, "]": -1}.get(c, 0)
        if c == "," and depth == 0:
            found.append(piece.strip())
            piece = ""
        else:
            piece += c
    return [*found, piece.strip()]


def _parsed(lines: Sequence[str], file: str) -> tuple[list[Item], dict[str, Block]]:
    """Statements of the first program, and all programs by name."""
    programs: dict[str, Block] = {}
    outside: list[Item] = []
    open_: list[tuple[Block | None, list[Item]]] = [(None, outside)]
    for k, raw in enumerate(lines, start=1):
        text, at = _bare(raw), f"line {k}"
        word = _word(text)
        block, items = open_[-1]
        if not text or text[0] == "&" or DECLARATION.match(text):
            continue
        if match := re.match(r"(?:GLOBAL\s+)?(DEF|DEFFCT)\s+(?:\w+\s+)?(\w+)\s*\(", text, re.IGNORECASE):
            new = Block(at, "DEF", "other", [("", [])])
            programs.setdefault(match[2].lower(), new)
            open_ = [(None, outside), (new, new.body)]
        elif word in ("end", "endfct"):
            open_ = [(None, outside)]
        elif word in ("endif", "endfor", "endwhile", "endloop", "endswitch", "endspline"):
            if len(open_) > 1:
                open_.pop()
        elif word == "until":
            if block is not None and block.kind == "until":
                block.arms[0] = (text[5:].strip(), block.arms[0][1])
                open_.pop()
        elif word == "else" and block is not None and block.kind == "if":
            block.arms.append(("", []))
            open_[-1] = (block, block.body)
        elif word in _OPENING:
            kind, pattern = _OPENING[word]
            match = re.fullmatch(pattern, text, re.IGNORECASE)
            new = Block(at, word.upper(), kind, [(match[1].strip() if match is not None else text, [])])
            items.append(new)
            open_.append((new, new.body))
        else:
            items.append(Line(at, text))
        if len(open_) > 60:
            raise InputError.at(file, at, "nested deeper than 60", "is it a program?")
    first = next(iter(programs.values()), None)
    return (outside if first is None else first.body), programs


_OPENING = {
    "if": ("if", r"IF\b(.*)\bTHEN"),
    "for": ("count", r"FOR\b(.*)"),
    "while": ("while", r"WHILE\b(.*)"),
    "loop": ("forever", r"LOOP()"),
    "repeat": ("until", r"REPEAT()"),
    "switch": ("other", r"SWITCH\b(.*)"),
    "spline": ("if", r"SPLINE()(?:\s+WITH\b.*)?"),
    "ptp_spline": ("if", r"PTP_SPLINE()(?:\s+WITH\b.*)?"),
}
"""Words that begin a block, with its kind."""
