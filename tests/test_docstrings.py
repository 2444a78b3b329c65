"""A docstring is read on hover, alone: it may not begin by pointing at another."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
POINTS_ELSEWHERE = re.compile(r"\s*(The same\b|See\b|Of what\b|As (?!many\b)|Likewise\b)")


def pointing(tree: ast.AST) -> list[str]:
    """Strings that stand as statements (docstrings of modules, classes, functions and fields) and point."""
    told = [node.value for node in ast.walk(tree) if isinstance(node, ast.Expr)]
    texts = [(t.lineno, t.value) for t in told if isinstance(t, ast.Constant) and isinstance(t.value, str)]
    return [f"{line}: {text}" for line, text in texts if POINTS_ELSEWHERE.match(text)]


@pytest.mark.parametrize(
    "text",
    [
        "The same of people.",
        "See `bind`.",
        "Of what is heard [s].",
        "As in RULA.",
        "As the device calls it.",
        "Likewise [m].",
    ],
)
def test_pointing_is_found_below_a_field_and_in_a_private_function(text: str) -> None:
    assert pointing(ast.parse(f'x = 1\n"""{text}"""')) == [f"2: {text}"]
    assert pointing(ast.parse(f'def _f():\n    """{text}"""')) == [f"2: {text}"]


def test_every_docstring_stands_alone() -> None:
    files = sorted([*(ROOT / "src").rglob("*.py"), *(ROOT / "examples").rglob("*.py")])
    assert files
    found = [f"{f.relative_to(ROOT)}:{p}" for f in files for p in pointing(ast.parse(f.read_text("utf-8")))]
    assert not found, "say it in a sentence of its own, with shape and unit:\n" + "\n".join(found)
