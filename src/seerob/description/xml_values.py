"""Reads numbers, vectors and names from XML attributes and collects what is wrong with them."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from xml.etree.ElementTree import Element

import numpy as np

from seerob.core.errors import InputError, Problem
from seerob.core.printable import obeyed
from seerob.core.snapshot import Finding
from seerob.core.transforms import Array, rotation_from_rpy, transform

MAX_BYTES = 64 * 2**20
"""Largest description accepted; meshes have their own bound."""
MAX_ELEMENTS = 200_000
HEAVIEST = 1e9
"""No mass [kg] and no moment of inertia [kg·m²] of a link is larger."""
FARTHEST, SMALLEST = 1e6, 1e-9
"""No part of a robot is farther from the next or larger than the one, and none smaller than the other [m]."""

NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")


@dataclass
class Reader:
    """One file being read: every mistake and remark about it, in order."""

    file: str
    robot: str
    problems: list[Problem] = field(default_factory=list)
    findings: list[Finding] = field(default_factory=list)

    def problem(self, key: str, what: str, remedy: str = "") -> None:
        """Something that the file cannot be used with."""
        self.problems.append(Problem(self.file, key, what, remedy))

    def finding(self, level: str, subject: str, text: str) -> None:
        """Something to know: ``note``, ``assumed`` or ``warning`` about a link or joint."""
        full = f"{self.robot}/{subject}" if subject else self.robot
        self.findings.append(Finding(level=level, subject=full, text=text))

    def numbers(self, element: Element | None, attribute: str, key: str, default: tuple[float, ...]) -> Array:
        """As many finite numbers as ``default`` has, or ``default`` when there is no such attribute."""
        text = None if element is None else element.get(attribute)
        if text is None:
            return np.array(default)
        words = text.split()
        if len(words) != len(default) or not all(map(NUMBER.fullmatch, words)):
            one = len(default) == 1
            many = "a finite number" if one else f"{len(default)} numbers separated by blanks"
            hint = "; write a decimal point, not a comma" if "," in text else ""
            self.problem(f"{key}.{attribute}", f"is {text[:80]!r}", f"must be {many}{hint}")
            return np.array(default)
        values = np.array([float(word) for word in words])
        if not np.isfinite(values).all():
            self.problem(f"{key}.{attribute}", f"is {text[:80]!r}", "must be finite")
            return np.array(default)
        return values

    def number(self, element: Element, attribute: str, key: str) -> float | None:
        """A finite number, or None when there is no such attribute or it is wrong."""
        if element.get(attribute) is None:
            return None
        before = len(self.problems)
        value = float(self.numbers(element, attribute, key, (math.nan,))[0])
        return value if len(self.problems) == before else None

    def origin(self, element: Element, key: str) -> Array:
        """The transform of an ``<origin xyz rpy>`` child, (4, 4); identity when there is none."""
        origin = element.find("origin")
        xyz = self.numbers(origin, "xyz", f"{key}.origin", (0.0, 0.0, 0.0))
        rpy = self.numbers(origin, "rpy", f"{key}.origin", (0.0, 0.0, 0.0))
        if np.abs(xyz).max() > FARTHEST:
            self.problem(f"{key}.origin.xyz", f"is {xyz.tolist()}", f"must be within {FARTHEST:g} m")
            xyz = np.zeros(3)
        return transform(rotation_from_rpy(rpy), xyz)

    def raise_problems(self) -> None:
        """Raises `InputError` with every problem so far, if there is any."""
        if self.problems:
            raise InputError(self.problems)


def parse_xml(content: bytes, file: str) -> Element:
    """The root element of an XML document.

    Raises:
        InputError: Not XML, too large, or it declares entities (which hostile files use to grow).
    """
    import defusedxml
    from defusedxml import ElementTree

    if len(content) > MAX_BYTES:
        raise InputError.at(file, "", f"has {len(content)} bytes", f"at most {MAX_BYTES} are read")
    try:
        root: Element = ElementTree.fromstring(content)
    except defusedxml.DefusedXmlException:
        raise InputError.at(file, "", "declares XML entities", "write the text where it is used") from None
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise InputError.at(file, "", f"is not XML: {error}", "check the file at that line") from None
    for count, element in enumerate(root.iter()):
        if count >= MAX_ELEMENTS:
            raise InputError.at(file, "", f"has more than {MAX_ELEMENTS} elements", "split it")
        for name, value in element.items():
            if found := obeyed(value.replace("\n", " ").replace("\t", " ")):
                what = f"holds {found}, which terminals obey or which turns the direction of reading"
                raise InputError.at(file, f"{element.tag}.{name}", what, "leave it out")
    return root
