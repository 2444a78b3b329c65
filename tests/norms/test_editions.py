"""The edition that is named is that of the figures, whatever the file asks for."""

from __future__ import annotations

import pytest

from made_cell import FLOATING, TWO_R, made, person, two_r
from seerob.core.snapshot import Basis, Input, Origin
from seerob.description.norms.editions import editions, headline

PFL = '[[safety]]\nkind = "power_and_force"\nname = "pfl"\nrobot = "arm"\nhuman = "op"\n'
SPEED = '[[safety]]\nkind = "velocity"\nname = "v"\nat = "arm"\nlimit = 1\n'


@pytest.mark.parametrize(
    ("criteria", "asked", "said"),
    [
        (PFL, "ISO 10218-2:2025", "ISO/TS 15066:2016; ISO 10218-2:2025 is asked for, and no"),
        (PFL, "ISO/TS 15066:2016", "ISO/TS 15066:2016"),
        (SPEED, "ISO 10218-2:2025", "no norm; ISO 10218-2:2025 is asked for, and no figure here is from it"),
        (SPEED, "ISO/TS 15066:2016", "no norm"),
    ],
)
def test_the_first_page_names_the_editions_that_figures_are_from(tmp_path, criteria, asked, said):
    head = f'edition = "{asked}"\n'
    station = made(tmp_path, head + FLOATING + TWO_R + person() + criteria, {"arm.urdf": two_r()})
    assert station.scene().edition.startswith(said)
    assert ("2025" in station.scene().edition) == (asked == "ISO 10218-2:2025")


def test_what_a_figure_is_used_for_is_not_where_it_is_from():
    given = Input(
        name="limits", origin=Origin.STATED, source="ISO/TS 15066:2016; t; used for ISO 10218-2:2025; x"
    )
    basis = Basis(
        formula="", source="EN ISO 13857:2019 (1S), clause 4, and EN 1005-4:2005+A1", inputs=(given,)
    )
    found = editions([basis, None, Basis(formula="", source="a paper of 2025: so it says")])
    assert found == ("EN 1005-4:2005", "EN ISO 13857:2019", "ISO/TS 15066:2016")
    assert headline([basis], "ISO/TS 15066:2016") == ", ".join(found)
