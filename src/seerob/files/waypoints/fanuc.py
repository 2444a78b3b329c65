"""FANUC's teach pendant programs as text (``.ls``): motion statements of ``/MN`` and points of ``/POS``.

``J``, ``L`` and ``C`` to positions of the program (Cartesian in mm and W, P, R about fixed axes x, y, z, or
joints in degrees) or to position registers that are given. Frames and tools (``UFRAME[1]``, ``UTOOL[1]``) are
in no program and asked for. Jumps on conditions, calls and offsets are left out, see `flow`. [FanucLs]_
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from seerob.core.transforms import Array, rotation_from_rpy, transform
from seerob.files.waypoints.expressions import given
from seerob.files.waypoints.flow import Asked, Line, NotKnown, Walk, lines_of, waited
from seerob.files.waypoints.waypoint import Configuration, Move, Program, ToolPose, Waypoint

MOTION = re.compile(r"(?P<kind>[JLC])\s+(?P<first>PR?\[[^\]]*\])\s*(?P<second>PR?\[[^\]]*\])?\s*(?P<rest>.*)")
OTHERWISE = re.compile(r"(?:A|S)\s+PR?\[")
SPEED = re.compile(r"(?P<value>\d+(?:\.\d+)?|\.\d+|R\[\d+)[^%\s\w/.]*(?:[^\]\s]*\])?\s*"
                   r"(?P<unit>%|mm/sec|cm/min|inch/min|deg/sec|msec|sec)")  # fmt: skip
PER_SECOND = {"mm/sec": 1e-3, "cm/min": 0.01 / 60, "inch/min": 0.0254 / 60}
UNKNOWN_OPTIONS = re.compile(
    r"\b(Offset|Tool_Offset|INC|Incremental|Skip|COORD|Wjnt|CD\d+|CR\d+)\b", re.IGNORECASE
)
HARMLESS = re.compile(
    r"([A-Z]{1,2}\[|\$|WAIT\b|LBL\b|PAYLOAD|MESSAGE|TIMER|UALM|PAUSE|COL\b|Arc\b|Weave\b|MONITOR|TC_ONLINE)"
)
"""Begin of statements that are taken to move nothing."""
POINT = re.compile(r"P\[\s*(\d+)[^\]]*\]\s*\{(.*?)\};", re.DOTALL)
FIGURE = re.compile(r"\b(X|Y|Z|W|P|R|J\d|E\d)\s*=\s*([-+]?(?:\d+\.?\d*|\.\d+)|\*+)\s*(mm|deg)?")
PLACE, ANGLES = ("X", "Y", "Z"), ("W", "P", "R")


def read_fanuc(content: bytes, file: str, values: Mapping[str, float | bool | str]) -> Program:
    """The waypoints of a program.

    Args:
        content: The file.
        file: Its name, for messages.
        values: ``UFRAME[1]`` and ``UTOOL[1]`` as six numbers [mm, deg], ``R[1]`` as a number, ``PR[1]`` as
            six numbers, or as those of joints behind a ``J``; ``J23``: 1 where joint 3 of the robot's
            description counts from link 2, 0 where it counts from the horizon, as FANUC's does; ``N``: sign
            of joint 5 of the configuration N.

    Raises:
        InputError: Every value that is needed and was not given, or nothing that moves.
    """
    found = _Teach(file, values, "\n".join(lines_of(content, file)))
    found.go()
    return found.program(nothing="no motion statement in /MN")


class _Teach(Walk):
    def __init__(self, file: str, values: Mapping[str, float | bool | str], text: str) -> None:
        super().__init__(file, values)
        statements, _, points = text.partition("/POS")
        self._statements = _statements(statements.partition("/MN")[2])
        self._points = {int(m[1]): m[2] for m in POINT.finditer(points)}
        self._tool = self._frame = 0
        self._override = 1.0
        self._beside: set[tuple[str, ...]] = set()
        """Where external axes and other groups are at points that are gone to."""

    def go(self) -> None:
        """From statement to statement, and over jumps that are made always."""
        labels = {
            m[1]: k for k, s in enumerate(self._statements) if (m := re.match(r"LBL\[\s*(\d+)", s.text))
        }
        k = 0
        while k < len(self._statements):
            line = self._statements[k]
            jump = re.match(r"JMP\s+LBL\[\s*(\d+)", line.text)
            k += 1
            if jump is not None and jump[1] in labels:
                if labels[jump[1]] < k:
                    self.rounds = True
                    break
                k = labels[jump[1]]
            elif self.run([line]):
                break
        if len(self._beside) > 1:
            what = "external axes or another group move the robot, the workpiece or another robot"
            self.leave("/POS", "E1, GP2", what)
        self.remarks.append(
            "poses are in the controller's world, whose origin is at the height of axis 2, on axis 1; CNT is "
            "taken as a share of half of the shorter move, as no radius is written"
        )

    def true(self, condition: str) -> bool:
        """Conditions are not followed."""
        raise NotKnown(f"whether {condition} holds only a controller knows")

    def matters(self, statement: str) -> bool:
        """Whether a statement moves the robot."""
        return MOTION.match(statement) is not None or OTHERWISE.match(statement) is not None

    def forget(self, statement: str) -> None:
        """Nothing is remembered."""

    def do(self, line: Line) -> str:
        """Run one statement, see `Walk`."""
        text = line.text
        if (match := MOTION.match(text)) is not None:
            self.waypoints.append(self._motion(line.at, match))
        elif OTHERWISE.match(text):
            raise NotKnown("is a motion that is not modelled")
        elif match := re.match(r"(UFRAME|UTOOL)_NUM\s*=\s*(\d+)", text):
            if match[1] == "UTOOL":
                self._tool = int(match[2])
            else:
                self._frame = int(match[2])
        elif match := re.match(r"OVERRIDE\s*=\s*(\d+)\s*%", text):
            self._override = int(match[1]) / 100
        elif match := re.match(r"WAIT\s+(\d*\.?\d+)\s*\(?\s*sec", text):
            waited(self.waypoints, float(match[1]))
        elif re.match(r"(END|ABORT)\b", text):
            return "never"
        elif match := re.match(
            r"(IF|SELECT|CALL|RUN|JMP|FOR|ENDFOR|ELSE|ENDIF|UFRAME|UTOOL|OVERRIDE|PR|P)\b", text
        ):
            raise NotKnown(f"what {match[1]} does there only a controller knows")
        elif text[0] not in "!/":
            if not HARMLESS.match(text):
                raise NotKnown("what it does only a controller knows")
            self.quiet(re.split(r"\W", text, maxsplit=1)[0] or "statement")
        return ""

    def _motion(self, at: str, match: re.Match[str]) -> Waypoint:
        rest = match["rest"]
        if unknown := UNKNOWN_OPTIONS.search(rest):
            raise NotKnown(f"{unknown[1]} is not modelled")
        first = self._goal(match["first"])
        kind = {"J": Move.JOINT, "L": Move.LINEAR, "C": Move.CIRCULAR}[match["kind"]]
        goal = first
        if kind is Move.CIRCULAR:
            if match["second"] is None:
                raise NotKnown("an arc needs two points")
            goal = self._goal(match["second"])
        q, pose, tool, meant = goal
        blend = re.search(r"\bCNT\s*(\d+)", rest)
        acceleration = re.search(r"\bACC\s*(\d+)", rest)
        found = Waypoint(
            place=at,
            move=kind,
            q=q,
            pose=pose,
            via=first[1] if kind is Move.CIRCULAR else None,
            via_q=first[0] if kind is Move.CIRCULAR else None,
            blend_share=min(int(blend[1]), 100) / 100 if blend else 0.0,
            acceleration_share=int(acceleration[1]) / 100 if acceleration else 1.0,
            tool=tool,
            configuration=meant if kind is Move.JOINT else None,
        )
        return replace(found, **self._speed(rest, kind))

    def _speed(self, rest: str, kind: Move) -> dict[str, Any]:
        match = SPEED.search(rest)
        if match is None:
            name = rest.split(maxsplit=1)[0] if rest.split() else "its speed"
            value = given(self.values, name)
            if not isinstance(value, float | int) or isinstance(value, bool):
                raise Asked(name)
            return {"speed": float(value) * 1e-3 * self._override}
        text, unit = match["value"], match["unit"]
        if text.startswith("R["):
            value = given(self.values, text + "]")
            if not isinstance(value, float | int) or isinstance(value, bool):
                raise Asked(text + "]")
        else:
            value = float(text)
        if not value > 0:
            raise NotKnown("its speed is not above 0")
        if unit == "%":
            return {"share": min(value / 100, 1.0) * self._override}
        if unit in ("sec", "msec"):
            return {"duration": value * (1e-3 if unit == "msec" else 1.0) / self._override}
        if unit == "deg/sec":
            return {"turn": math.radians(value) * self._override}
        key = "speed" if kind.of_tool else "along"
        return {key: value * PER_SECOND[unit] * self._override}

    def _goal(
        self, text: str
    ) -> tuple[tuple[float, ...] | None, ToolPose | None, ToolPose | None, Configuration | None]:
        """Joint positions or pose in the world, tool point, configuration."""
        name, number = re.match(r"(PR?)\[\s*([^\]:,]*)", text).groups()  # type: ignore[union-attr]
        if not number.strip().isdigit():
            raise Asked(text) if "..." not in text else NotKnown("the position was never taught")
        if name == "PR":
            value = given(self.values, f"PR[{int(number)}]")
            if value is None:
                raise Asked(f"PR[{int(number)}]")
            joint = str(value).strip().upper().startswith("J")
            figures = _six(str(value).strip().lstrip("Jj"))
            if joint:
                return self._joints(figures), None, self._tool_point(self._tool), None
            return None, self._posed(figures, self._frame), self._tool_point(self._tool), None
        held = self._points.get(int(number))
        if held is None:
            raise NotKnown(f"P[{number}] is not in /POS")
        held, _, others = held.partition("GP2")
        written = {m[1]: m[2] for m in FIGURE.finditer(held.partition("CONFIG")[0] + _behind(held))}
        frame, tool = (_chosen(held, key, now) for key, now in (("UF", self._frame), ("UT", self._tool)))
        beside = [v for k, v in sorted(written.items()) if k[0] == "E"]
        self._beside.add((*beside, *(m[2] for m in FIGURE.finditer(others))))
        if any("*" in v for v in written.values()):
            raise NotKnown(f"P[{number}] was never taught")
        numbers = {k: float(v) for k, v in written.items()}
        if "J1" in numbers:
            joints = [numbers[k] for k in sorted(numbers) if k[0] == "J"]
            return self._joints(joints), None, self._tool_point(tool), None
        if not set(PLACE + ANGLES) <= set(numbers):
            raise NotKnown(f"P[{number}] is no position")
        pose = self._posed([numbers[k] for k in PLACE + ANGLES], frame)
        return None, pose, self._tool_point(tool), self._configuration(held)

    def _joints(self, degrees: list[float]) -> tuple[float, ...]:
        coupled = given(self.values, "J23")
        if coupled is None:
            raise Asked("J23")
        q = [math.radians(v) for v in degrees]
        if float(coupled) and len(q) > 2:
            q[2] += q[1]
        return tuple(q)

    def _frame_of(self, name: str, number: int) -> Array:
        if number == 0:
            return np.eye(4)
        value = given(self.values, f"{name}[{number}]")
        if value is None:
            raise Asked(f"{name}[{number}]")
        return _matrix(_six(str(value)))

    def _tool_point(self, number: int) -> ToolPose:
        return ToolPose.of(self._frame_of("UTOOL", number))

    def _posed(self, figures: list[float], frame: int) -> ToolPose:
        return ToolPose.of(self._frame_of("UFRAME", frame) @ _matrix(figures))

    def _configuration(self, held: str) -> Configuration | None:
        match = re.search(r"CONFIG\s*:\s*'\s*([FN])\s*([UD])\s*([TB])\s*,([^']*)'", held)
        if match is None:
            return None
        text = f"CONFIG '{match[1]} {match[2]} {match[3]},{match[4]}'"
        turns = [t.strip() for t in match[4].split(",")]
        if any(t != "0" for t in turns):
            return Configuration(text)
        once = (-math.pi, math.pi)
        sign = given(self.values, "N")
        fifth: tuple[float, float] | None = None
        if sign is not None:
            positive = (float(sign) > 0) == (match[1] == "N")
            fifth = (0.0, math.pi) if positive else (-math.pi, 0.0)
        ranges = (None, None, None, once, fifth, once)
        return Configuration(text, ranges, (0.0,) * 6, (match[3] == "T", match[2] == "U"))


def _statements(text: str) -> list[Line]:
    """Statements up to their semicolon, with their numbers."""
    found = []
    number = ""
    for piece in text.split(";"):
        numbered = re.match(r"\s*(\d+)\s*:", piece)
        number = numbered[1] if numbered else number
        bare = re.sub(r"(?:^|\n)\s*\d*\s*:", " ", piece).strip()
        if bare:
            found.append(Line(f"line {number}", " ".join(bare.split())))
    return found


def _behind(held: str) -> str:
    """What stands behind a configuration."""
    return held.partition("CONFIG")[2].partition("'")[2].partition("'")[2]


def _chosen(held: str, key: str, now: int) -> int:
    match = re.search(rf"\b{key}\s*:\s*(\d+|F)", held)
    return now if match is None or match[1] == "F" else int(match[1])


def _six(text: str) -> list[float]:
    try:
        figures = [float(part) for part in text.replace(";", ",").split(",")]
    except ValueError:
        figures = []
    if len(figures) != 6 or not all(map(math.isfinite, figures)):
        raise NotKnown(f"{text[:40]!r} are not six numbers")
    return figures


def _matrix(figures: list[float]) -> Array:
    """Of x, y, z [mm] and W, P, R [deg]."""
    return transform(rotation_from_rpy(np.radians(figures[3:])), np.array(figures[:3]) * 1e-3)
