"""The table of limits: what ships, and what an own file may and may not say."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

import pytest

from seerob.core.errors import InputError
from seerob.description.norms.body_limits import FORBIDDEN, REGIONS, SHIPPED, parse, read, shipped
from seerob.description.norms.crushing_gaps import crushing_gaps
from seerob.description.norms.limit_inputs import limit_inputs

TEXT = files("seerob.description.norms").joinpath(SHIPPED).read_text("utf-8")

# number: p_s [N/cm²], written down apart from the file.
PRESSURES = [
    130, 110, 110, 140, 210, 160, 210, 120, 170, 140, 210, 190, 220, 190, 180, 180,
    300, 270, 280, 220, 200, 260, 260, 200, 190, 250, 220, 220, 210,
]  # fmt: skip
# F_s [N], k [N/mm], m_H [kg], printed energy [J]
REGION_FIGURES = {
    "Skull and forehead": (130, 150, 4.4, 0.23),
    "Face": (65, 75, 4.4, 0.11),
    "Neck": (150, 50, 1.2, 0.84),
    "Back and shoulders": (210, 35, 40, 2.5),
    "Chest": (140, 25, 40, 1.6),
    "Abdomen": (110, 10, 40, 2.4),
    "Pelvis": (180, 25, 40, 2.6),
    "Upper arms and elbow joints": (150, 30, 3, 1.5),
    "Lower arms and wrist joints": (160, 40, 2, 1.3),
    "Hands and fingers": (140, 75, 0.6, 0.49),
    "Thighs and knees": (220, 50, 75, 1.9),
    "Lower legs": (130, 60, 75, 0.52),
}


def changed(old: str, new: str, count: int = 1) -> bytes:
    assert old in TEXT
    return TEXT.replace(old, new, count).encode()


def refused(raw: bytes, *words: str) -> None:
    with pytest.raises(InputError) as caught:
        parse(raw, file="mine.toml")
    for word in ("mine.toml", *words):
        assert word in str(caught.value)


def test_all_29_areas_and_their_pressures() -> None:
    areas = sorted((a for r in shipped().regions.values() for a in r.areas), key=lambda a: a.number)
    assert [a.number for a in areas] == list(range(1, 30))
    assert [a.pressure.value / 1e4 for a in areas] == PRESSURES
    assert sum(PRESSURES) == 5750
    assert len({a.name for a in areas}) == 29


@pytest.mark.parametrize("name", REGIONS)
def test_figures_of_the_region_in_si(name: str) -> None:
    region = shipped().regions[name]
    assert region.energy is not None
    figures = (region.force.value, region.stiffness.value / 1e3, region.mass.value, region.energy.value)
    assert figures == REGION_FIGURES[name]
    found = (region.force, region.stiffness, region.mass, region.energy, region.pressure)
    assert [figure.unit for figure in found] == ["N", "N/m", "kg", "J", "Pa"]
    assert (region.multiplier.value if region.multiplier else None) == (None if name in FORBIDDEN else 2)
    assert region.permitted == (name not in FORBIDDEN)


def test_least_pressures_of_the_regions() -> None:
    least = {n: r.pressure.value / 1e4 for n, r in shipped().regions.items() if r.permitted}
    assert list(least.values()) == [140, 160, 120, 140, 210, 190, 180, 190, 220, 210]


def test_every_figure_travels_with_edition_clause_source_and_confidence() -> None:
    inputs = limit_inputs(shipped(), own=False)
    assert len(inputs) == 2 + 10 * 5 + 26
    for entry in inputs:
        assert entry.source.startswith("ISO/TS 15066:2016 ")
        assert entry.source.endswith(("(2S)", "(1S)", "(1S+M)", "(M)"))
    assert [i.value for i in inputs if "Face" in i.name] == ["contact not permitted"]


def test_one_source_areas_are_marked_so() -> None:
    weak = {a.number for r in shipped().regions.values() for a in r.areas if a.pressure.confidence != "2S"}
    assert weak == {7, 10, 11, 18, 20, 23, 27, 28, 29}


def test_an_own_file_replaces_the_table(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_bytes(changed('force = [150, "2S", "U T"]', 'force = [99, "own", "T"]'))
    neck = read(path).regions["Neck"]
    assert (neck.force.value, neck.force.confidence) == (99, "own")


def test_megapascals_are_converted() -> None:
    text = TEXT.replace('pressure = "N/cm2"', 'pressure = "MPa"')
    for p in sorted(set(PRESSURES)):
        text = text.replace(f"pressure = [{p},", f"pressure = [{p / 100},")
    ours = parse(text.encode(), file="mine.toml").regions
    for name, region in shipped().regions.items():
        assert ours[name].pressure.value == pytest.approx(region.pressure.value, rel=1e-12)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("permitted = [false,", "permitted = [true,", ("Skull", "never")),
        ('force = [130, "2S", "U T S"]', 'force = [130, "2S", "U T S"]\nmultiplier = [2, "1S", "T"]',
         ("Skull", "multiplier")),
        ('multiplier = [2,', 'multiplier = [2.5,', ("2.5", "never raised")),
        ('multiplier = [2,', 'multiplier = [0.5,', ("0.5",)),
        ('multiplier = [2, "2S", "T P K S"]\n', "", ("Neck", "multiplier", "not given")),
        ("pressure = [140,", "pressure = [1.4,", ("Neck", "1.4 N/cm2", "reviewed_by")),
        ("pressure = [140,", "pressure = [310,", ("310",)),
        ("force = [150,", "force = [-150,", ("-150", "above 0")),
        ("force = [150,", "force = [nan,", ("nan",)),
        ("force = [150,", "force = [1500,", ("1500",)),
        ('name = "Neck"', 'name = "Feet"', ("Feet", "unknown body region")),
        ('name = "Neck"', 'name = "Chest"', ("given twice",)),
        ("number = 5,", "number = 4,", ("number 4",)),
        ('"2S", "U T S"', '"3S", "U T S"', ("3S",)),
        ('"2S", "U T S"', '"2S", "U X"', ("'X'", "[sources]")),
        ('pressure = "N/cm2"', 'pressure = "N"', ("pressure",)),
        ('title = ', 'titel = ', ("titel",)),
        ("[[regions]]", "[[regions", ("TOML",)),
    ],
)  # fmt: skip
def test_what_a_file_may_not_say(old: str, new: str, words: tuple[str, ...]) -> None:
    if words[-1] == "TOML":
        refused(changed(old, new), SHIPPED)
    else:
        refused(changed(old, new), *words)


def test_every_mistake_is_reported_at_once() -> None:
    raw = changed("force = [150,", "force = [-150,").replace(b"pressure = [210,", b"pressure = [2.1,")
    with pytest.raises(InputError) as caught:
        parse(raw, file="mine.toml")
    assert len(caught.value.problems) == 1 + TEXT.count("pressure = [210,")


def test_unusual_figures_need_somebody_who_answers_for_them() -> None:
    raw = changed("pressure = [140,", "pressure = [370,")
    refused(raw, "370")
    named = raw.replace(b"title = ", b'reviewed_by = "A. Engineer"\ntitle = ', 1)
    assert parse(named, file="mine.toml").regions["Neck"].areas[0].pressure.value == 3.7e6


def test_a_file_that_is_not_there_and_one_that_is_too_large(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"cannot be read"):
        read(tmp_path / "none.toml")
    (tmp_path / "large.toml").write_bytes(b"#" * (2 << 20))
    with pytest.raises(InputError, match="larger"):
        read(tmp_path / "large.toml")


def test_every_region_has_a_gap_that_clamps_it_and_says_it_is_recollection() -> None:
    gaps, source = crushing_gaps()
    assert tuple(gaps) == REGIONS
    assert min(gaps.values()) == gaps["Hands and fingers"] == 0.1
    assert "(M)" in source
