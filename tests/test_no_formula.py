"""What a workstation file calls something is not computed by the spreadsheet that opens a table."""

import csv

import pytest

from seerob.outputs.tables.growing_table import FORMULA, no_formula
from seerob.session.permissible.tables import csv_bytes


@pytest.mark.parametrize("text", ["=HYPERLINK(1)", "+1", "-2+3", "@SUM(A1)", "\t=1", "\r=1"])
def test_a_text_that_begins_like_a_formula_is_marked(text):
    assert no_formula(text) == f"'{text}"
    assert not no_formula(text).startswith(FORMULA)


@pytest.mark.parametrize("text", ["separation", "a = b", "", "−0.5 m", "1-2"])
def test_others_stay_as_they_are(text):
    assert no_formula(text) == text


def test_a_table_of_permissible_speeds_keeps_numbers_and_marks_texts():
    data = csv_bytes(["t [s]", "who", "n"], iter([[-0.1, "=1+1", 2], [None, "plain", -3]])).decode()
    assert list(csv.reader(data.splitlines())) == [
        ["t [s]", "who", "n"],
        ["-0.1", "'=1+1", "2"],
        ["", "plain", "-3"],
    ]
