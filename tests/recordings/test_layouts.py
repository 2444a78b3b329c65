"""Recordings of layouts before this one are read as they were written."""

from __future__ import annotations

from pathlib import Path

import msgspec
import pytest
from mcap.records import Message
from test_not_whole import rewritten

from seerob.core.errors import InputError
from seerob.core.markers import plain
from seerob.core.snapshot import (
    Arrow,
    Aspect,
    Box,
    Ellipsoid,
    Highlight,
    Hull,
    Label,
    Node,
    Polyline,
    Prism,
    Rays,
    Result,
    Row,
    RowState,
    Scene,
    Segment,
    Snapshot,
    Sphere,
    Verdict,
)
from seerob.outputs.sinks.recorder import Recorder
from seerob.recording.format import SNAPSHOT, VERSION, WITH_NAMES, content_hash
from seerob.recording.recording import Recording

BEFORE = Path(__file__).with_name("layout_1.mcap")
"""Recorded from `snapshots` by the last commit that wrote this layout."""
AT, TURNED = (1.0, 0.1, -3.0), (0.0, 1.0, 0.0, 0.0)
SCENE = Scene(
    title="a cell",
    edition="",
    version="0",
    workstation_hash=content_hash({}),
    period=0.01,
    nodes=(Node(name="r/a", role="robot", owner="r"),),
)


def snapshots() -> list[Snapshot]:
    """Every kind of result and marker, with and without what may be left out."""
    exceeded = Verdict.EXCEEDED
    markers = (
        Arrow(origin=AT, vector=AT),
        Arrow(origin=AT, vector=AT, label="0.15 m/s", verdict=exceeded),
        Segment(start=AT, end=AT, label="x"),
        Sphere(center=AT, radius=0.1, verdict=Verdict.WITHIN),
        Ellipsoid(center=AT, wxyz=TURNED, radii=AT),
        Box(center=AT, wxyz=TURNED, size=AT),
        Hull(vertices=(AT, AT), faces=((0, 1, 0),)),
        Polyline(points=(AT,), closed=True),
        Prism(outline=((0.0, 0.1),), lower=0.0, upper=1.0),
        Prism(outline=(), lower=0.0, upper=1.0, position=AT, wxyz=TURNED, label="x"),
        Rays(starts=(AT,), ends=(AT, AT), hits=(1,), filled=True),
        Label(position=AT, text="×"),
        Highlight(body="r/a", verdict=Verdict.UNDECIDED),
    )
    rows = (
        Row(name="row"),
        Row(
            name="Palm",
            group="hands",
            side="left",
            state=RowState.FORBIDDEN,
            value=0.1 + 0.2,
            unit="N",
            limit=0.3,
            interval=(0.1, 0.4),
            verdict=exceeded,
            areas=(20, 21),
            bones=("r/a",),
            aspects=(Aspect(name="angle"), Aspect(name="speed", value=0.1, unit="m/s", limit=0.2, band="x")),
            inputs=("a",),
        ),
        Row(name="score", scale=(1.0, 7.0), value=3.0),
    )
    parts = (
        Result(name="S_h", value=1.0186648434126802, unit="m"),
        Result(name="inner", nothing=True, reason="nobody is near", parts=(Result(name="deep"),)),
    )
    results = (
        Result(name="silent"),
        Result(name="score", value=3, limit=4.0, verdict=Verdict.WITHIN, interval=(2.0, 4.0), rows=rows),
        Result(
            name="distance",
            value=0.15,
            unit="m",
            limit=0.1501,
            at_most=False,
            verdict=exceeded,
            reason="a ↔ b",
            parts=parts,
            markers=markers,
            t=0.02,
            muted=True,
        ),
    )
    poses = bytes(range(28))
    return [
        Snapshot(seq=0, t=0.0, poses=poses),
        Snapshot(
            seq=1,
            t=0.01,
            poses=poses,
            joints={"r": (0.1, 0.2)},
            tracking={"r": 0.001},
            bones={"p": {"hand": (0.01, None)}},
            late={"r": (0.001, 0.1)},
            results=results,
            looks={"r/a": None},
            doubts={"r": "silent"},
        ),
    ]


def encoded(of) -> list[bytes]:
    """Every field of snapshots, of which not a number is that, too."""
    return [msgspec.msgpack.encode(s, enc_hook=plain) for s in of]


def test_a_recording_whose_results_have_names_says_what_it_said() -> None:
    recording = Recording.open(BEFORE)
    assert recording.metadata["layout"] == WITH_NAMES
    assert recording.complete
    assert recording.check() == ()
    assert encoded(recording.snapshots()) == encoded(snapshots())
    assert recording.snapshot_at(0.005) == snapshots()[0]


def test_what_is_written_now_is_read_back_and_has_its_layout(tmp_path: Path) -> None:
    with Recorder(lossless=True).open(SCENE, {}, {}, tmp_path) as writer:
        for snapshot in snapshots():
            writer.write(snapshot, ())
    recording = Recording.open(tmp_path / "run.mcap")
    assert recording.metadata["layout"] == VERSION
    assert encoded(recording.snapshots()) == encoded(snapshots())


def test_a_layout_that_nobody_knows_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "later.mcap"
    data = BEFORE.read_bytes()
    assert data.count(b"\x06\0\0\0layout\x01\0\0\0001") == 1
    file.write_bytes(data.replace(b"\x06\0\0\0layout\x01\0\0\0001", b"\x06\0\0\0layout\x01\0\0\0009"))
    with pytest.raises(InputError, match="is '9', this version reads '1' and '2'"):
        Recording.open(file)


def nested(depth: int) -> bytes:
    """A snapshot of a part of a part … as this layout had it."""
    head = b"\x85\xa4type\xa8snapshot\xa3seq\x00\xa1t\x00\xa5poses\xc4\x1c" + bytes(28) + b"\xa7results\x91"
    return head + b"\x82\xa4name\xa1a\xa5parts\x91" * depth + b"\x81\xa4name\xa1a"


def read(data: bytes, to: Path) -> Snapshot:
    """The first snapshot of the recording with these bytes for it."""

    def change(topic: str, message: Message) -> bytes:
        return data if topic == SNAPSHOT and message.sequence == 0 else message.data

    return next(Recording.open(rewritten(BEFORE, to / "changed.mcap", change)).snapshots())


def test_parts_may_have_parts(tmp_path: Path) -> None:
    (result,) = read(nested(200), tmp_path).results
    depth = 0
    while result.parts:
        (result,), depth = result.parts, depth + 1
    assert depth == 200


@pytest.mark.parametrize("data", [nested(5000), nested(1)[:-1], nested(1)[:-1] + b"\xff"])
def test_what_cannot_be_decoded_is_refused(data: bytes, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="is not what it should be"):
        read(data, tmp_path)


@pytest.mark.parametrize(
    "results",
    [
        {},
        [3],
        [{"value": 1.0}],
        [{"name": 1}],
        [{"name": "a", "value": "0.1"}],
        [{"name": "a", "parts": {}}],
        [{"name": "a", "parts": [{}]}],
        [{"name": "a", "rows": [{"name": "r", "aspects": [1]}]}],
        [{"name": "a", "markers": [{"type": "cloud"}]}],
        [{"name": "a", "markers": [{"type": ["arrow"]}]}],
        [{"name": "a", "markers": [{"origin": [0, 0, 0], "vector": [0, 0, 0]}]}],
        [{"name": "a", "markers": [{"type": "arrow", "origin": [0, 0, 0]}]}],
        [{"name": "a", "markers": [{"type": "sphere", "center": [0, 0], "radius": 1}]}],
    ],
)
def test_what_was_never_written_is_refused(results: object, tmp_path: Path) -> None:
    given = {"type": "snapshot", "seq": 0, "t": 0.0, "poses": bytes(28), "results": results}
    with pytest.raises(InputError, match="is not what it should be"):
        read(msgspec.msgpack.encode(given), tmp_path)
