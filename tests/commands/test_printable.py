"""What files, recordings and devices call things reaches neither the terminal nor the page as a command."""

import logging
import sys
import tomllib
import unicodedata

import openpyxl
import pytest
from made_cells import make_cell, seerob

from seerob.app.console.printable import PrintableLines, printable

OBEYED = "\x1b[2J\x1b]0;title\x07\x00\x9b31m\u202egnirts\u2066"
WORDS = "操作员 – Рука 🤖 ½ m²\tπ"
NAME = f"{OBEYED}\n{WORDS}"


def test_nothing_is_left_that_a_terminal_obeys_and_every_encoding_takes_it():
    everything = "".join(map(chr, range(sys.maxunicode + 1)))
    shown = printable(everything)
    left = {c for c in shown if unicodedata.category(c) in ("Cc", "Cs", "Zl", "Zp")}
    assert left == {"\t", "\n"}
    assert not any(unicodedata.bidirectional(c) in ("LRE", "RLE", "LRO", "RLO", "PDF") for c in shown)
    assert not any(unicodedata.bidirectional(c) in ("LRI", "RLI", "FSI", "PDI") for c in shown)
    shown.encode("utf-8")


def test_words_stay_as_they_are():
    assert printable(WORDS) == WORDS


def test_what_is_logged_is_printable_too():
    record = logging.makeLogRecord({"msg": "robot says: %s", "args": (OBEYED,)})
    assert PrintableLines().format(record) == f"robot says: {printable(OBEYED)}"


@pytest.fixture
def named(tmp_path):
    """A cell whose title and criterion are called so."""
    cell = make_cell(tmp_path / "cell")
    file = cell / "workstation.toml"
    toml = "".join(f"\\u{ord(c):04x}" if c in OBEYED + "\n" else c for c in NAME)
    file.write_text(file.read_text().replace('"arm"', f'"{toml}"').replace('"speed"', f'"{toml}"'))
    assert tomllib.loads(file.read_text())["title"] == NAME
    return cell


def test_a_name_is_one_line_of_words_on_the_terminal_and_in_the_files(capsys, tmp_path, named):
    code, out, err = seerob(capsys, "assess", named, "-o", tmp_path / "out")
    assert (code, err) == (0, "")
    assert not any(unicodedata.category(c) == "Cc" and c != "\n" for c in out.replace("\t", ""))
    (line,) = [line for line in out.splitlines() if line.startswith("within")]
    assert printable(OBEYED) in line
    assert "操作员" in line
    report = (tmp_path / "out" / "report.html").read_text()
    assert not any(unicodedata.category(c) == "Cc" and c not in "\n\t" for c in report)
    assert not any(unicodedata.bidirectional(c) in ("RLO", "LRI") for c in report)  # would turn what follows
    assert "操作员" in report
    book = openpyxl.load_workbook(tmp_path / "out" / "results.xlsx", read_only=True)
    assert book.sheetnames
    book.close()
