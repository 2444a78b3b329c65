"""TOML files as users write them: read whole, and every way in which they can be wrong in one line."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

from seerob.core.errors import InputError
from seerob.core.files.bounded import TooLarge, content
from seerob.core.printable import is_printable, printable_table

MAX_FILE_SIZE = 4 << 20
"""A file larger than this [byte] is none that a user wrote."""
_PART = r"(?:[\w-]++|\"[^\"\n]*+\"|'[^'\n]*+')"
_LONG_KEY = re.compile(rf"(?<![\w-]){_PART}(?:[ \t]*+\.[ \t]*+{_PART}){{100}}")
"""The time that `tomllib` takes for a key grows with the square of its dots."""

_LONG_NUMBER = re.compile(r"[0-9a-fA-F_]{17}")
"""`tomllib` takes 0x… of any length, and a message that shows it fails."""


def read_toml(path: Path) -> tuple[dict[str, Any], bytes]:
    """Content of a TOML file, parsed, with every text `printable`, and raw.

    Raises:
        InputError: Too large, not readable, not UTF-8, or not TOML; names line and column.
    """
    try:
        raw = content(path, MAX_FILE_SIZE)
    except OSError as error:
        raise InputError.at(path, "", f"cannot be read: {error.strerror}", "check its permissions") from error
    except TooLarge:
        what = f"larger than {MAX_FILE_SIZE >> 20} MiB"
        raise InputError.at(path, "", what, "give a workstation file, which is far smaller") from None
    return parsed_toml(raw, path), raw


def loads(text: str) -> dict[str, Any]:
    """Read TOML that strangers wrote, by `tomllib.loads`.

    Raises:
        tomllib.TOMLDecodeError: It is not TOML, a key has more parts than any table has levels, or a whole
            number more than 64 bits.
    """
    if found := _LONG_KEY.search(text):
        line = text.count("\n", 0, found.start()) + 1
        raise tomllib.TOMLDecodeError(f"a key of more than 100 parts (at line {line})")
    table = tomllib.loads(text)
    if _LONG_NUMBER.search(text):
        _check_whole_numbers(table)
    return table


def _check_whole_numbers(value: Any) -> None:
    if isinstance(value, dict | list):
        for item in value.values() if isinstance(value, dict) else value:
            _check_whole_numbers(item)
    elif isinstance(value, int) and value.bit_length() > 64:
        raise tomllib.TOMLDecodeError(f"a whole number of {value.bit_length()} bits")


def parsed_toml(raw: bytes, path: Path) -> dict[str, Any]:
    """Content of a TOML file that was read; raises as `read_toml` does."""
    try:
        text = raw.decode("utf-8-sig").replace("\r\n", "\n")
        table: dict[str, Any] = loads(text)
        # Only an escape writes what the text itself does not have.
        return table if "\\" not in text and is_printable(text) else printable_table(table)
    except UnicodeDecodeError as error:
        line = raw.count(b"\n", 0, error.start) + 1
        raise InputError.at(path, f"line {line}", "not UTF-8", "save it as UTF-8 text") from error
    except (tomllib.TOMLDecodeError, ValueError) as error:
        # Also what tomllib lets through: a date that does not exist, a number of 10 000 digits.
        raise InputError.at(path, "", f"not TOML: {error}", "see https://toml.io for the syntax") from error
    except RecursionError as error:
        raise InputError.at(path, "", "nested too deeply", "no table needs more than four levels") from error
