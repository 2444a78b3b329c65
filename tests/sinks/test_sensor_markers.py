"""Lines, prisms and beams in foreign viewers and in the report's pictures."""

from __future__ import annotations

from seerob.core.snapshot import Polyline, Prism, Rays, Result, Snapshot, Verdict
from seerob.outputs.mcap import marker_update
from seerob.outputs.picture.marker_shapes import label_of, points_of

LINE = Polyline(points=((0, 0, 0), (1, 0, 0), (1, 1, 0)), closed=True, label="field")
PRISM = Prism(outline=((0, 0), (2, 0), (2, 1), (0, 1)), lower=0.0, upper=3.0, verdict=Verdict.WITHIN)
RAYS = Rays(starts=((0, 0, 1),), ends=((1, 0, 1), (0, 1, 1), (-1, 0, 1)), hits=(1,))


def test_foreign_viewers_get_every_leg_face_and_beam() -> None:
    result = Result(name="scanner", markers=(LINE, PRISM, RAYS))
    (entity,) = marker_update(Snapshot(seq=0, t=0.0, poses=b"", results=(result,))).entities
    line, edges, hits, passing = entity.lines
    assert [len(part.points) for part in (line, edges, hits, passing)] == [6, 24, 2, 4]
    assert [(p.x, p.y, p.z) for p in hits.points] == [(0, 0, 1), (0, 1, 1)]
    assert passing.color.a < hits.color.a
    (solid,) = entity.triangles
    assert len(solid.indices) == 3 * 12
    assert {p.z for p in solid.points} == {0.0, 3.0}
    assert [text.text for text in entity.texts] == ["field"]


def test_pictures_frame_all_of_a_marker() -> None:
    assert points_of(LINE) == list(LINE.points)
    assert set(points_of(PRISM)) == {(x, y, z) for x, y in PRISM.outline for z in (0.0, 3.0)}
    assert points_of(RAYS) == [*RAYS.starts, *RAYS.ends]
    assert label_of(LINE)[0] == "field"
