"""Markers that are made of many pieces."""

from __future__ import annotations

import ast
import pickle
from itertools import pairwise
from pathlib import Path

import msgspec
import numpy as np
import pytest
from msgspec.structs import replace

from seerob import criteria
from seerob.core.markers import Marker, changed, drawn, plain
from seerob.core.shapes import ear_clipping
from seerob.core.snapshot import Highlight, Label, Polyline, Prism, Rays, Result, Verdict
from seerob.core.transforms import Array


def test_an_open_line_has_a_leg_less_than_points_and_a_closed_one_as_many() -> None:
    points = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0))
    legs = Polyline(points=points).legs()
    assert legs == list(pairwise(points))
    assert Polyline(points=points, closed=True).legs() == [*legs, (points[2], points[0])]
    assert Polyline(points=()).legs() == Polyline(points=(), closed=True).legs() == []


def test_beams_start_together_or_each_where_it_says() -> None:
    ends = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    starts = ((0.0, 0.0, 1.0), (0.0, 0.0, 2.0))
    assert Rays(starts=starts[:1], ends=ends).beams() == [(starts[0], ends[0]), (starts[0], ends[1])]
    assert Rays(starts=starts, ends=ends).beams() == list(zip(starts, ends, strict=True))


def test_markers_that_are_made_when_somebody_looks_are_those_of_a_tuple_in_all_respects() -> None:
    asked = []

    def make() -> list[Marker]:
        asked.append(1)
        return [
            Label(position=(0.0, 0.0, 1.0), text="near", verdict=Verdict.WITHIN),
            Highlight(body="arm/l1"),
        ]

    eager = Result(name="d", markers=tuple(make()))
    lazy = Result(name="d", markers=drawn(make))
    changes = changed(lazy.markers, lambda m: replace(m, verdict=Verdict.UNDECIDED))
    assert len(asked) == 1
    pack = msgspec.msgpack.Encoder(enc_hook=plain).encode
    assert pack(lazy) == pack(eager)
    assert (lazy == eager, eager == lazy, hash(lazy) == hash(eager)) == (True, True, True)
    assert (lazy.markers[1], len(lazy.markers), [*lazy.markers]) == (eager.markers[1], 2, [*eager.markers])
    assert (repr(lazy), pickle.loads(pickle.dumps(lazy))) == (repr(eager), eager)
    assert type(pickle.loads(pickle.dumps(lazy)).markers) is tuple
    assert len(asked) == 2  # made once, however often they are looked at
    assert [m.verdict for m in changes] == [Verdict.UNDECIDED] * 2
    with pytest.raises(TypeError, match="unsupported"):
        msgspec.msgpack.encode(lazy)  # who does not know of them is told, and leaves none out


def _meant(given: ast.expr, within: ast.AST) -> list[ast.AST]:
    """What an argument is: itself, or the functions and values that have its name."""
    if not isinstance(given, ast.Name):
        return [given]
    found: list[ast.AST] = []
    for each in ast.walk(within):
        if isinstance(each, ast.FunctionDef) and each.name == given.id:
            found.append(each)
        elif isinstance(each, ast.Assign) and ast.unparse(each.targets[0]) == given.id:
            found.append(each.value)
    return found


def _reads_later(given: ast.AST) -> bool:
    """Whether what is called later reads ``state``; what is worked out of it now may be given."""
    if isinstance(given, ast.FunctionDef | ast.Lambda):
        return "state" in {n.id for n in ast.walk(given) if isinstance(n, ast.Name)}
    if isinstance(given, ast.Call):
        return any(map(_reads_later, given.args))
    return ast.unparse(given).partition(".")[0] == "state"


def test_nothing_that_is_drawn_later_reads_the_twin() -> None:
    """It is elsewhere then."""
    seen = together = 0
    for path in (Path(criteria.__file__).parent).rglob("*.py"):
        tree = ast.parse(path.read_text())
        for inner in ast.walk(tree):
            if not (isinstance(inner, ast.Call) and isinstance(inner.func, ast.Name)):
                continue
            # What `present` gives is passed on in `criteria/figure.py` and `criteria/plan.py`.
            name, given = inner.func.id, [ast.unparse(each) for each in inner.args]
            if path.name in ("figure.py", "plan.py") or not (
                name == "drawn" or (name == "Shown" and len(given) > 1)
            ):
                continue
            made = _meant(inner.args[name == "Shown"], tree)
            assert made, path.name
            assert not any(map(_reads_later, made)), f"{path.name}: {given} reads the state"
            seen += 1
        for one in ast.walk(tree):
            if not (isinstance(one, ast.FunctionDef) and one.name == "present" and len(one.args.args) == 5):
                continue  # of criteria that are computed together: why, draw, parts
            for said in ast.walk(one):
                if not (isinstance(said, ast.Return) and isinstance(said.value, ast.Tuple)):
                    continue
                made = _meant(said.value.elts[1], one)
                assert made, path.name
                assert not any(map(_reads_later, made)), f"{path.name}: present reads the state"
                together += 1
    assert seen > 9
    assert together > 4


def star(rng: np.random.Generator, n: int) -> Array:
    """A star-shaped, so simple, polygon around the origin, shape (n, 2)."""
    angles = np.sort(rng.uniform(0, 2 * np.pi, n) + 1e-3 * np.arange(n))
    return np.stack([np.cos(angles), np.sin(angles)], 1) * rng.uniform(0.3, 1.0, n)[:, None]


def area(corners: Array) -> float:
    x, y = corners.T
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


@pytest.mark.parametrize("seed", range(20))
def test_triangles_cover_a_concave_polygon_exactly_whichever_way_round(seed: int) -> None:
    rng = np.random.default_rng(seed)
    corners = (
        np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [2.0, 1.0], [0.0, 3.0]])
        if seed == 0
        else star(rng, 4 + seed)
    )
    for outline in (corners, corners[::-1]):
        triangles = ear_clipping(outline)
        assert len(triangles) == len(outline) - 2
        pieces = [area(outline[list(t)]) for t in triangles]
        assert min(pieces) > 0
        assert sum(pieces) == pytest.approx(abs(area(corners)), rel=1e-12)


def test_what_encloses_nothing_has_no_triangles() -> None:
    assert (
        ear_clipping(np.zeros((0, 2)))
        == ear_clipping(np.zeros((2, 2)))
        == ear_clipping(np.zeros((5, 2)))
        == []
    )


def test_a_prism_is_a_closed_solid_of_its_volume_where_its_frame_is() -> None:
    from seerob.outputs.picture.marker_shapes import prism

    outline = ((0.0, 0.0), (4.0, 0.0), (4.0, 3.0), (2.0, 1.0), (0.0, 3.0))
    marker = Prism(
        outline=outline,
        lower=-1.0,
        upper=2.0,
        position=(1.0, 2.0, 3.0),
        wxyz=(np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0),
    )
    vertices, faces, edges = prism(marker)
    volume = np.linalg.det(vertices[faces] - vertices[0]).sum() / 6
    assert volume == pytest.approx(abs(area(np.array(outline))) * 3.0, rel=1e-12)
    directed = {(int(f[i]), int(f[i - 2])) for f in faces for i in range(3)}
    assert all((b, a) in directed for a, b in directed)
    assert len(edges) == 15
    # Turned by 90° about x: its z points to −y of the world.
    assert vertices[:, 1].min() == pytest.approx(0.0)
    assert vertices[:, 1].max() == pytest.approx(3.0)
