"""Zones of a controller as safety areas: the same as areas by hand; mistakes name file, key, remedy."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from made_cell import FLOATING, made, results_at
from seerob.core.errors import InputError
from seerob.session.reading import read

BALL = '[[parts]]\nname = "ball"\nshape = { sphere = 0.1 }\nat = { position = [1.5, 0.5, 1.0] }\n'
ROBOT = """
[[robots]]
name = "ur"
model = "library:ur5e"
base = { position = [1, 0, 0], rpy_deg = [0, 0, 90] }
q = [0, 0, 0, 0, 0, 0]
"""
WATCH = '[[safety]]\nkind = "safety_area"\nname = "w"\narea = {area}\nof = "ball"\n'
HEAD = 'zones = "zones.toml"\n' + FLOATING
ZONES = """
source = "UR5e, safety checksum 1234, copied by hand"
{frame}
[[zones]]
name = "door"
polygon = [[1, 0], [2, 0], [2, 1], [1, 1]]
height_mm = [500, 1500]
[[zones]]
name = "bench"
low = [3, 3, 0]
high = [4, 4, 1]
"""


def zones(folder, text, file="zones.toml", more=""):
    return made(folder, HEAD.replace("zones.toml", file) + BALL + more, {file: text})


def test_a_zone_is_the_area_that_one_would_write(tmp_path):
    both = WATCH.format(area='["door", "bench"]')
    found = results_at(zones(tmp_path / "zones", ZONES.format(frame=""), more=both))["w"]
    by_hand = FLOATING + BALL
    for name, shape in (
        ("door", "polygon = [[1, 0], [2, 0], [2, 1], [1, 1]], height = [0.5, 1.5]"),
        ("bench", "polygon = [[3, 3], [4, 3], [4, 4], [3, 4]], height = [0, 1]"),
    ):
        by_hand += f'[[areas]]\nname = "{name}"\nshape = {{ {shape} }}\n'
    expected = results_at(made(tmp_path / "hand", by_hand + both))["w"]
    assert found.verdict == expected.verdict == "exceeded"
    assert found.value == expected.value == pytest.approx(-0.5, abs=0.01)
    assert [p.name for p in found.parts] == ["ball in door"]


def test_zones_lie_in_the_frame_of_the_robots_base(tmp_path):
    """The base is at (1, 0) and turned by 90°: x of the zone is y of the world."""
    station = zones(tmp_path, ZONES.format(frame='on = "ur/base_link"'), more=ROBOT)
    model = station.model
    door = next(b for b in model.bodies if b.name == "door")
    from made_cell import state_at

    state = state_at(station, ur=(np.zeros(6), np.zeros(6)))
    corners = door.corners @ state.rotations[door.index].T + state.positions[door.index]
    np.testing.assert_allclose(corners.min(axis=0), [0, 1, 0.5], atol=1e-6)
    np.testing.assert_allclose(corners.max(axis=0), [1, 2, 1.5], atol=1e-6)


def test_json_says_the_same_and_the_file_is_kept_with_the_workstation(tmp_path):
    import tomllib

    table = tomllib.loads(ZONES.format(frame="at = { position = [0, 0, 0.1] }"))
    raw = msgspec.json.encode(table)
    (tmp_path / "z.json").write_bytes(raw)
    (tmp_path / "z.toml").write_text(ZONES.format(frame="at = { position = [0, 0, 0.1] }"))
    found = []
    for file in ("z.json", "z.toml"):
        (tmp_path / "workstation.toml").write_text(HEAD.replace("zones.toml", file) + BALL)
        found.append(read(tmp_path))
    assert found[0].areas == found[1].areas
    assert [a.name for a in found[0].areas] == ["door", "bench"]
    assert found[0].files["z.json"] == raw


@pytest.mark.parametrize(
    ("change", "key", "words"),
    [
        (("height_mm = [500, 1500]", "height_mm = [1500, 500]"), "zones[0]", "no interval"),
        (("high = [4, 4, 1]", "high = [4, 3, 1]"), "zones[1]", "y from 3 to 3 m is no interval"),
        (("high = [4, 4, 1]", ""), "zones[1]", "low and high"),
        (("[2, 1], [1, 1]]", "[1, 1], [2, 1]]"), "zones[0]", "cross"),
        (('name = "bench"', ""), "zones[1].name", "missing"),
        (("source", "sauce"), "sauce", "unknown key"),
        (('"UR5e, safety checksum 1234, copied by hand"', '" "'), "", "source is empty"),
        (("[3, 3, 0]", "[nan, 3, 0]"), "zones[1].low", "nan"),
        (('name = "bench"', 'name = "ball"'), "areas[1].name", "taken"),
    ],
)
def test_every_mistake_names_file_key_and_remedy(tmp_path, change, key, words):
    text = ZONES.format(frame="")
    assert change[0] in text
    with pytest.raises(InputError, match=words) as error:
        zones(tmp_path, text.replace(*change))
    problem = next(p for p in error.value.problems if p.key.startswith(key) and words in str(p))
    assert problem.file.endswith("zones.toml" if "taken" not in words else "workstation.toml")


@pytest.mark.parametrize(
    ("file", "content", "words"),
    [
        ("zones.xml", "<zones/>", "no format of zones"),
        ("zones.json", "[1]", "no object"),
        ("zones.json", "{" * 100_000, "not JSON"),
        ("zones.json", '{"source": "x", "zones": []}', "0 zones"),
        ("zones.toml", "zones = 3", "zones"),
    ],
)
def test_a_hostile_file_is_refused(tmp_path, file, content, words):
    with pytest.raises(InputError, match=words):
        zones(tmp_path, content, file)


@pytest.mark.parametrize("name", ['"../zones.toml"', '"/zones.toml"', "3", '"nowhere.toml"'])
def test_a_file_elsewhere_is_refused(tmp_path, name):
    (tmp_path / "workstation.toml").write_text(f"zones = {name}\n" + BALL)
    with pytest.raises(InputError):
        read(tmp_path)
