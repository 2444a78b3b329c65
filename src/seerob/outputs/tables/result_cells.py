"""One result as cells with a title each: the figure, its parts, and its rows about places of a body."""

from __future__ import annotations

from seerob.core.snapshot import Result, Row, Verdict

Cell = str | float | None


def result_cells(result: Result) -> dict[str, Cell]:
    """Title with unit → value."""
    unit = f" [{result.unit}]" if result.unit else ""
    found: dict[str, Cell] = {
        f"value{unit}": result.value,
        f"limit{unit}": result.limit,
        "verdict": _word(result.verdict),
        "reason": result.reason,
    }
    if result.interval is not None:
        found |= {f"least{unit}": result.interval[0], f"largest{unit}": result.interval[1]}
    for part in result.parts:
        found[_titled(f"{part.name}: value", part.unit)] = part.value
        found[f"{part.name}: verdict"] = _word(part.verdict)
    for row in result.rows:
        found |= _row_cells(row)
    return found


def _row_cells(row: Row) -> dict[str, Cell]:
    name = " ".join(filter(None, (row.group, row.side, row.name)))
    found: dict[str, Cell] = {_titled(name, row.unit): row.value}
    if row.scale is not None:
        # Of a score, what it was made from.
        found |= {_titled(f"{name}, {a.name}", a.unit): a.value for a in row.aspects}
    elif row.limit is not None or row.verdict is not None:
        found |= {_titled(f"{name}, limit", row.unit): row.limit, f"{name}, verdict": _word(row.verdict)}
    return found


def _titled(name: str, unit: str) -> str:
    return f"{name} [{unit}]" if unit else name


def _word(verdict: Verdict | None) -> str:
    return "" if verdict is None else verdict.value
