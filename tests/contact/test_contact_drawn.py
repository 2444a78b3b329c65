"""What is drawn of the contact that governs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from made_cell import FLOATING, TWO_R, made, results_at, two_r
from seerob.core.snapshot import Arrow, Result, Sphere

PFL = (
    '[[safety]]\nkind = "power_and_force"\nname = "pfl"\nrobot = "arm"\nmass = "simplified"\nfloor = false\n'
)
EXCLUDED = 'excluded = ["Skull and forehead", "Face", "Larynx, eyes and ears", "Feet"]\n'
SMALL, LARGE = 0.004, 0.02


def bent(folder: Path, mesh: trimesh.Trimesh, options: str, speed: float = 0.5) -> Result:
    """At (90°, 0) the arm lies along y, with a tool of the given mesh beside its end at (0, 2, 0)."""
    tool = '[[tools]]\nname = "probe"\non = "arm/tip"\nmesh = "probe.stl"\nunits = "m"\nmass = 0.1\n'
    flat = '"arm/l1" = 1e-4, "arm/l2" = 1e-4'
    text = FLOATING + TWO_R + tool + PFL + EXCLUDED + options.replace("FLAT", flat)
    files = {"arm.urdf": two_r(), "probe.stl": mesh.export(file_type="stl")}
    return results_at(made(folder, text, files), arm=((np.pi / 2, 0.0), (speed, 0.0)))["pfl"]


def balls(result: Result) -> list[Sphere]:
    return [marker for marker in result.markers if isinstance(marker, Sphere)]


def two_balls() -> trimesh.Trimesh:
    """A small one at (0.3, 0.1, 0) and a large one at (0.3, −0.1, 0)."""
    made = [trimesh.creation.icosphere(subdivisions=3, radius=r) for r in (SMALL, LARGE)]
    made[0].apply_translation([0.3, 0.1, 0.0])
    made[1].apply_translation([0.3, -0.1, 0.0])
    return trimesh.util.concatenate(made)


def test_the_sharpest_patch_of_the_part_that_governs_is_shown_where_it_is(tmp_path: Path) -> None:
    result = bent(tmp_path, two_balls(), "contact_area = { FLAT }\n")
    assert "pressure, free, probe" in result.reason
    (ball,) = balls(result)
    assert ball.verdict == result.verdict == "exceeded"
    assert np.linalg.norm(np.subtract(ball.center, (-0.1, 2.3, 0.0))) == pytest.approx(SMALL, rel=0.02)
    assert float(ball.label.removeprefix("edge radius ").removesuffix(" mm")) == pytest.approx(4, rel=0.14)
    arrow = next(marker for marker in result.markers if isinstance(marker, Arrow))
    assert arrow.vector[0] == pytest.approx(-0.3 * 0.5 * (2.3 + LARGE), rel=0.01)


def test_an_edge_that_the_mesh_does_not_resolve_is_shown(tmp_path: Path) -> None:
    options = "contact_area = { FLAT }\nperson_speed = 0\n"
    result = bent(tmp_path, trimesh.creation.box([0.1, 0.1, 0.1]), options, speed=0.1)
    assert result.verdict == "undecided"
    assert "edge radius below mesh resolution" in result.reason
    (ball,) = balls(result)
    assert ball.label == "edge radius unknown"
    assert max(abs(np.subtract(ball.center, (0.0, 2.0, 0.0)))) == pytest.approx(0.05)


def test_an_unknown_edge_is_undecided_where_the_area_is_exceeded_by_what_is_known(tmp_path: Path) -> None:
    result = bent(tmp_path, trimesh.creation.box([0.1, 0.1, 0.1]), "contact_area = { FLAT }\n", speed=2.0)
    assert result.verdict == "exceeded"
    (ball,) = balls(result)
    assert (ball.label, ball.verdict) == ("edge radius unknown", "undecided")


@pytest.mark.parametrize(
    "given", ["contact_area = { FLAT, probe = 1e-5 }\n", "contact_radius = { probe = 0.002 }\n"]
)
def test_what_the_file_says_of_a_contact_has_no_place(tmp_path: Path, given: str) -> None:
    options = given if "contact_area" in given else given + "contact_area = { FLAT }\n"
    result = bent(tmp_path, two_balls(), options)
    assert "pressure, free, probe" in result.reason
    assert not balls(result)
