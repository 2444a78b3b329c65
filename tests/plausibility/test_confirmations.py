"""What the file confirms is one value of one entry, with a reason; nothing else, and nothing by chance."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from made_sensible import cell, doubted, station_of

from seerob.core.errors import InputError
from seerob.criteria.safety.velocity import Velocity
from seerob.workstation.plausibility.ranges import (
    unknown,
)
from seerob.workstation.workstation import Confirmed, Engine


def test_a_confirmation_says_why_in_words(tmp_path: Path) -> None:
    confirmed = '[[confirmed]]\nkey = "safety[0].limit"\nof = "speed"\nvalue = 250\nwhy = " "\n'
    with pytest.raises(InputError, match=r"confirmed\[0\].why"):
        station_of(tmp_path, cell(limit="limit = 250", more=confirmed))


def test_another_value_is_not_confirmed(tmp_path: Path) -> None:
    confirmed = (
        '[[confirmed]]\nkey = "safety[2].stop.reaction"\nof = "separation"\nvalue = 3\nwhy = "measured"\n'
    )
    mine, typed = ("reaction = 3, stopping = 0.35", "reaction = 30, stopping = 0.35")
    assert doubted(station_of(tmp_path, cell(stop=mine, more=confirmed))) == []
    (found,) = doubted(station_of(tmp_path, cell(stop=typed, more=confirmed)))
    assert "the file confirms 3.0, another value" in found.text


def test_a_confirmation_may_have_the_unit_of_the_file(tmp_path: Path) -> None:
    confirmed = (
        '[[confirmed]]\nkey = "safety[2].human_speed_mm_s"\nof = "separation"\nvalue = 1.6\nwhy = "a snail"\n'
    )
    station = station_of(tmp_path, cell(separation="human_speed_mm_s = 1.6", more=confirmed))
    assert doubted(station) == []


@pytest.mark.parametrize(
    "key", ["robots[1].base.rpy", "safety[0].limits", "humans[0].inside.nobody", "x", ""]
)
def test_a_confirmation_of_nothing_is_a_mistake(key: str, tmp_path: Path) -> None:
    confirmed = f'[[confirmed]]\nkey = "{key}"\nvalue = 1\nwhy = "because"\n'
    with pytest.raises(InputError, match=r"confirmed\[0\].key: .* is no quantity of this file"):
        station_of(tmp_path, cell(more=confirmed))


ORDER = """
[[robots]]
name = "{}"
model = "library:ur5"
base = {{ position = [62, 0, 0.75] }}
[[robots]]
name = "{}"
model = "library:ur5"
base = {{ position = [0, 0, 0.75] }}
"""


@pytest.mark.parametrize(
    ("names", "of", "words"),
    [
        ("ab", 'of = "a"', ""),
        (
            "ba",
            'of = "a"',
            "robots[0] is 'b', not 'a': nothing is confirmed; key = \"robots[1].base.position\"",
        ),
        ("bc", 'of = "a"', "robots[0] is 'b', not 'a': nothing is confirmed; confirm it anew"),
        ("ab", "", 'missing: nothing says which of robots it is of; of = "a", if that is meant'),
    ],
)
def test_a_confirmation_does_not_slide_onto_what_stands_in_its_place(tmp_path, names, of, words) -> None:
    word = f'[[confirmed]]\nkey = "robots[0].base.position"\n{of}\nvalue = [62, 0, 0.75]\nwhy = "a hall"\n'
    text = ORDER.format(*names) + word
    if not words:
        assert not any("base.position" in f.text for f in doubted(station_of(tmp_path, text)))
        return
    with pytest.raises(InputError, match=re.escape(f"confirmed[0].of: {words}")):
        station_of(tmp_path, text)


@pytest.mark.parametrize(("name", "told"), [("", True), ('name = "near"', False)])
def test_a_name_that_another_has_in_another_order_is_none(tmp_path, name, told) -> None:
    of = "near" if name else "minimum distance ur5 – table"
    one = '[[safety]]\nkind = "minimum_distance"\nbetween = ["ur5", "table"]\nlimit = {}\n{}\n'
    word = f'[[confirmed]]\nkey = "safety[3].limit"\nof = "{of}"\nvalue = 90\nwhy = "far"\n'
    text = cell(more=one.format(90, name) + one.format(0.1, "") + word)
    if not told:
        assert not any("limit = 90" in f.text for f in doubted(station_of(tmp_path, text)))
        return
    with pytest.raises(InputError, match=r"confirmed\[0\].of: several of safety are called"):
        station_of(tmp_path, text)


def test_a_vector_is_confirmed_by_all_its_numbers(tmp_path: Path) -> None:
    """One that is equal in some is another value."""
    said = '[[confirmed]]\nkey = "robots[0].base.position"\nof = "ur5"\nvalue = {}\nwhy = "a hall"\n'
    for value, told in (
        ("[75, 0, 0.75]", False),
        ("[75, 0, 0.5]", True),
        ("[60, 0, 0.75]", True),
        ("75", True),
    ):
        text = cell(base="position = [75, 0, 0.75]", more=said.format(value))
        found = [f for f in doubted(station_of(tmp_path, text)) if f.text.startswith("robots[0].base")]
        assert bool(found) is told
        assert {f.subject for f in found} <= {"ur5"}


def test_one_of_several_that_are_called_the_same_is_not_confirmed_by_name() -> None:
    """Nor is what stands in another file looked for in this one."""
    speeds = [Velocity(name=name, at="ur5", limit=250.0) for name in ("one", "one", "two", "three")]
    entries = {"safety": dict(enumerate(speeds))}
    said = [Confirmed(key=f"safety[{k}].limit", of=speed.name, value=250, why="fast")
            for k, speed in enumerate(speeds)]  # fmt: skip
    said.append(Confirmed(key="variables.muted.timeout", value=10, why="slow"))
    problems = unknown(dict(enumerate(said)), entries, Engine(), "w.toml", numbered=["three"])
    assert [p.key for p in problems] == [f"confirmed[{k}].of" for k in (0, 1, 3)]
    assert all("several of safety are called" in p.what for p in problems)
