"""A recording that is not what was written, all of it and in its place, is never within."""

import io
import struct
from itertools import islice
from pathlib import Path

import msgspec
import numpy as np
import pytest
import zstandard
from mcap.reader import make_reader
from mcap.writer import Writer
from msgspec.structs import replace as changed

from made_cell import TWO_R, made, two_r
from seerob.app.cli import main
from seerob.core.errors import InputError
from seerob.core.snapshot import Verdict
from seerob.criteria.judging import Judge
from seerob.outputs.mcap import mend
from seerob.outputs.sinks import recorder
from seerob.outputs.sinks.recorder import Recorder
from seerob.recording.format import END_METADATA, SAMPLES, Tick
from seerob.recording.recording import (
    ChunkPlace,
    Damaged,
    McapIndex,
    Recording,
    _record,
    read_attachment,
    read_chunk,
    scan,
)
from seerob.session import run, scene
from seerob.session.station import load, load_recorded

CELL = (
    "[engine]\nphysics = false\n"
    + TWO_R
    + """
[[sources]]
kind = "csv"
robot = "arm"
file = "motion.csv"
timeout = 2
[[safety]]
kind = "velocity"
name = "tip"
at = "arm"
limit = 3
"""
)


def motion(fast: float) -> str:
    """A second of 0.1 rad/s, one of ``fast``, one of 0.1 rad/s [rad/s]."""
    t = np.arange(0, 3.001, 0.01)
    q = np.cumsum(np.where((t > 1) & (t <= 2), fast, 0.1)) * 0.01
    rows = "".join(f"{a:.3f},{b:.9f},0\n" for a, b in zip(t, q, strict=True))
    return f"t [s],j1 [rad],j2 [rad]\n{rows}"


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("whole")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(recorder, "FLUSH_PERIOD", 0.0)  # many chunks
        station = made(folder, CELL, {"arm.urdf": two_r(), "motion.csv": motion(0.2)})
        found = station.run(folder=folder / "run", sinks=[Recorder(lossless=True)])
    assert found.verdict is Verdict.WITHIN, found.results["tip"].worst().reason
    return folder / "run" / "run.mcap"


def rewritten(path: Path, to: Path, change, file_change=lambda data: data, planted=()) -> Path:
    """A copy by the foreign library, checksums and index in order, of what is left of it."""
    with path.open("rb") as old, to.open("wb") as new:
        reader, writer = make_reader(old), Writer(new)
        writer.start()
        channels = {}
        for entry in reader.iter_metadata():
            writer.add_metadata(entry.name, entry.metadata)
        for file in reader.iter_attachments():
            writer.add_attachment(
                file.create_time, file.log_time, file.name, file.media_type, file_change(file.data)
            )
        for name, content in planted:
            writer.add_attachment(0, 0, name, "text/plain", content)
        for schema, channel, message in reader.iter_messages(log_time_order=False):
            data = change(channel.topic, message)
            if data is None:
                continue
            if channel.id not in channels:
                told = (
                    0 if schema is None else writer.register_schema(schema.name, schema.encoding, schema.data)
                )
                channels[channel.id] = writer.register_channel(channel.topic, channel.message_encoding, told)
            writer.add_message(
                channels[channel.id], message.log_time, data, message.publish_time, message.sequence
            )
        writer.finish()
    return to


def same(topic, message):
    return message.data


@pytest.mark.parametrize("how", ["another limit", "a second workstation file", "another recording behind it"])
def test_a_recording_with_other_files_or_more_behind_it_is_not_within(whole, tmp_path, how, capsys):
    """It was within by the limit that was typed into it, and by the first of two that were joined."""
    fast = made(tmp_path / "cell", CELL, {"arm.urdf": two_r(), "motion.csv": motion(2.5)})
    said = fast.run(folder=tmp_path / "run", sinks=[Recorder(lossless=True)])
    assert said.verdict is Verdict.EXCEEDED
    source, file = tmp_path / "run" / "run.mcap", tmp_path / "run.mcap"
    looser = CELL.replace("limit = 3", "limit = 7")
    if how == "another limit":
        rewritten(source, file, same, lambda data: looser.encode() if data == CELL.encode() else data)
    elif how == "a second workstation file":
        rewritten(source, file, same, planted=[("file/workstation.toml", looser.encode())])
    else:
        file.write_bytes(whole.read_bytes() + source.read_bytes())
    recording = Recording.open(file)
    again = load_recorded(recording).replay(recording)
    assert again.verdict is Verdict.UNDECIDED
    assert main(["report", str(file), "-o", str(tmp_path / "again"), "--json"]) == 2
    assert recording.findings[0].text in capsys.readouterr().out


def spoiled(whole: Path, how: str, to: Path) -> Path:
    raw, chunks = bytearray(whole.read_bytes()), [c for c in scan(whole).chunks if c.end > c.start]
    if how == "cut":
        del raw[chunks[-1].offset + 3 :]
    elif how == "damaged":
        raw[chunks[len(chunks) // 2].offset + 50] ^= 0xFF
    else:

        def change(topic, message):
            second = message.log_time // 10**9 == 1
            if how == "a second less":
                return None if second else message.data
            if how == "a micrometre less" and topic == SAMPLES and second:
                tick = msgspec.msgpack.decode(message.data, type=Tick)
                moved = [msgspec.structs.replace(s, q=(s.q[0] - 1e-6, s.q[1])) for s in tick.samples]
                return msgspec.msgpack.encode(msgspec.structs.replace(tick, samples=tuple(moved)))
            return message.data

        return rewritten(whole, to, change)
    to.write_bytes(raw)
    return to


@pytest.mark.parametrize("how", ["cut", "damaged", "a second less", "a micrometre less"])
def test_what_is_not_whole_is_not_within(whole, tmp_path, how, capsys):
    file = spoiled(whole, how, tmp_path / "run.mcap")
    recording = Recording.open(file)
    found = load_recorded(recording).replay(recording).results
    assert found.verdict is Verdict.UNDECIDED
    assert recording.findings[0].text in found["tip"].worst().reason
    assert main(["report", str(file), "-o", str(tmp_path / "again"), "--json"]) == 2
    assert recording.findings[0].text in capsys.readouterr().out
    # Nor is another workstation that plays the motion.
    text = CELL.replace(
        'kind = "csv"\nrobot = "arm"\nfile = "motion.csv"',
        'kind = "recording"\ndrives = "arm"\nfile = "run.mcap"',
    )
    assert made(tmp_path, text, {"arm.urdf": two_r()}).run().verdict is Verdict.UNDECIDED


def test_what_comes_after_a_hole_is_judged_at_its_time(tmp_path, monkeypatch):
    """The third second moves too fast: it is not lost because the second one is."""
    monkeypatch.setattr(recorder, "FLUSH_PERIOD", 0.0)
    rows = motion(0.1).splitlines(keepends=True)
    fast = "".join(
        rows[:1] + [f"{t:.3f},{0.2 * t + (max(t - 2.5, 0) * 4):.9f},0\n" for t in np.arange(0, 3.001, 0.01)]
    )
    station = made(tmp_path, CELL, {"arm.urdf": two_r(), "motion.csv": fast})
    whole = station.run(folder=tmp_path / "run", sinks=[Recorder(lossless=True)]).results
    file = spoiled(tmp_path / "run" / "run.mcap", "a second less", tmp_path / "less.mcap")
    recording = Recording.open(file)
    found = load_recorded(recording).replay(recording).results
    assert (whole.verdict, found.verdict) == (Verdict.EXCEEDED, Verdict.EXCEEDED)
    assert found.end == whole.end == 3.0
    assert found["tip"].worst().t == whole["tip"].worst().t > 2.5


def test_what_the_other_library_copies_word_for_word_is_whole(whole, tmp_path):
    file = rewritten(whole, tmp_path / "run.mcap", same)
    recording = Recording.open(file)
    assert recording.check() == ()
    assert load_recorded(recording).replay(recording).verdict is Verdict.WITHIN


def test_a_recording_that_nobody_sealed_is_not_within(whole, tmp_path, monkeypatch):
    """As of a version before seals, whose end says nothing of them."""
    file = tmp_path / "run.mcap"
    rewritten(whole, file, same)
    recording = Recording.open(file)
    del recording._index.metadata[END_METADATA]["sha256"]
    assert "does not seal" in recording.check()[0].text
    assert recording.check()[0].holds == ("*",)


def test_a_recording_that_lacks_more_than_damage_leaves_out_is_refused(whole, tmp_path):
    more = 10**6

    def far(topic, message):
        if topic != SAMPLES or message.log_time < 10**9:
            return message.data
        tick = msgspec.msgpack.decode(message.data, type=Tick)
        return msgspec.msgpack.encode(msgspec.structs.replace(tick, seq=tick.seq + more))

    recording = Recording.open(rewritten(whole, tmp_path / "most.mcap", far))
    assert next(islice(recording.heard(), 100 + more, None))
    more += 1
    recording = Recording.open(rewritten(whole, tmp_path / "run.mcap", far))
    with pytest.raises(InputError, match="follows tick 99; do not trust this recording"):
        load_recorded(recording).replay(recording)


# -- a recording that another version made ----------------------------------------------------------


@pytest.mark.parametrize("then", [Verdict.EXCEEDED, Verdict.UNDECIDED, Verdict.WITHIN])
def test_what_another_version_did_not_call_within_is_not_within_now(tmp_path, monkeypatch, then):
    """Nothing tells which of the two is right."""

    class Other(Judge):
        def __call__(self, state):
            found = super().__call__(state)
            return tuple(changed(r, verdict=then) if 1 < state.t < 1.2 else r for r in found)

    station = made(tmp_path, CELL, {"arm.urdf": two_r(), "motion.csv": motion(0.2)})
    with monkeypatch.context() as patch:
        patch.setattr(run, "Judge", Other)
        patch.setattr(scene, "version", lambda _: "0.0.9")
        station.run(folder=tmp_path / "run", sinks=[Recorder(lossless=True)])
    recording = Recording.open(tmp_path / "run" / "run.mcap")
    again = load_recorded(recording).replay(recording)
    series = again.results["tip"]
    assert again.verdict is (then if then is Verdict.WITHIN else Verdict.UNDECIDED)
    differs = (series.t > 1.0005) & (series.t < 1.1995)
    assert set(series.verdicts[~differs].tolist()) == {0}
    if then is not Verdict.WITHIN:
        assert set(series.verdicts[differs].tolist()) == {2}
        assert f"seerob 0.0.9, which recorded it, said {then} of the same samples" in series.worst().reason
    stricter = tmp_path / "cell.toml"
    stricter.write_text(CELL.replace("limit = 3", "limit = 2.5"))
    (tmp_path / "arm.urdf").write_text(two_r())
    assert load(stricter).replay(recording).verdict is Verdict.WITHIN  # another question


@pytest.mark.parametrize(
    ("size", "told"), [(2**28, "wrong checksum"), (2**28 + 1, "more than the 268435456")]
)
def test_a_chunk_of_no_more_than_256_mebibytes_is_unpacked(tmp_path, size, told):
    file = tmp_path / "a.mcap"
    file.write_bytes(b"none")
    with pytest.raises(Damaged, match=told):
        read_chunk(file, ChunkPlace(0, 1, 0, 4, size, 0, "", []))


@pytest.mark.parametrize(("size", "told"), [(2**20, "cut off"), (2**20 + 1, "too long")])
def test_a_name_of_no_more_than_a_mebibyte_is_read(size, told):
    """A record of metadata that is no longer, too."""
    name = struct.pack("<I", size)
    with pytest.raises(Damaged, match=told):
        _record(McapIndex(), io.BytesIO(name), 0x0C, 0, 2**20)
    with pytest.raises(Damaged, match="metadata is too long"):
        _record(McapIndex(), io.BytesIO(name), 0x0C, 0, 2**20 + 1)


def text(data: bytes) -> bytes:
    return struct.pack("<I", len(data)) + data


@pytest.mark.parametrize("off", [-1, 0, 1])
@pytest.mark.parametrize("what", ["chunk", "attachment", "metadata"])
def test_a_record_holds_what_it_says_that_it_holds(what, off):
    """A stretch that is longer than its record would be read from the next one; behind it lie more bytes."""
    opcode, head, data, end = {
        "chunk": (0x06, struct.pack("<QQQI", 1, 2, 3, 4) + text(b"z" * 64), b"content", b""),
        "attachment": (0x09, bytes(16) + text(b"name") + text(b"type"), b"content", b"\x01\0\0\0"),
        "metadata": (0x0C, text(b"name"), text(b"key") + text(b"value"), b""),
    }[what]
    size = struct.pack("<I" if what == "metadata" else "<Q", len(data) + off)
    record = head + size + data + end
    file, index = io.BytesIO(b"before!" + record + bytes(40)), McapIndex()
    file.seek(7)
    if off == 1 or (off and what == "attachment"):  # which alone has to fill its record
        with pytest.raises(Damaged):
            _record(index, file, opcode, 7, len(record))
        return
    _record(index, file, opcode, 7, len(record))
    at = 7 + len(head) + len(size)
    if what == "chunk":
        assert index.chunks == [ChunkPlace(1, 2, at, len(data) + off, 3, 4, "z" * 64, [])]
    elif what == "attachment":
        assert index.attachments == {"name": ("name", at, len(data), 1, 7)}
    else:
        assert index.metadata == {"name": {"key": "value"}}


def test_the_name_of_a_compression_has_no_more_than_64_characters():
    record = struct.pack("<QQQI", 1, 2, 3, 4) + text(b"z" * 65) + bytes(8)
    with pytest.raises(Damaged, match="too long"):
        _record(McapIndex(), io.BytesIO(record), 0x06, 0, len(record))


def test_a_file_that_is_cut_anywhere_is_read_up_to_its_last_whole_record(whole, tmp_path):
    """And it is finished from its end mark on, whatever of its summary is there, and whatever lies behind."""
    data, file = whole.read_bytes(), tmp_path / "cut.mcap"
    ends, chunks = [8], [0]
    while data[ends[-1]] != 0x0F:
        chunks.append(chunks[-1] + (data[ends[-1]] == 0x06))
        ends.append(ends[-1] + 9 + struct.unpack_from("<Q", data, ends[-1] + 1)[0])
    mark = ends[-1] + 9 + struct.unpack_from("<Q", data, ends[-1] + 1)[0]
    entire = scan(whole)
    assert (entire.finished, entire.unread, entire.beyond, len(entire.chunks)) == (True, 0, 0, chunks[-1])
    assert all(chunk.channels for chunk in entire.chunks)
    near = [*range(6), *range(len(ends) // 2, len(ends) // 2 + 6), *range(len(ends) - 5, len(ends))]
    cuts = {ends[k] + off for k in near for off in (-1, 0, 1, 8, 9, 10)} | {mark - 1}
    for cut in sorted(cut for cut in cuts if 8 <= cut < mark):
        file.write_bytes(data[:cut])
        found, last = scan(file), max(k for k, end in enumerate(ends) if end <= cut)
        assert (found.finished, found.unread, found.beyond) == (False, cut - ends[last], 0), cut
        assert len(found.chunks) == chunks[last], cut
        assert found.chunks[:-1] == entire.chunks[: max(chunks[last] - 1, 0)]
        # Which channels the last one has may be cut off as well.
        assert [chunk.channels for chunk in found.chunks[-1:]] == [[]] * (chunks[last] > 0)
    for more in (data[: mark + 1], data[: mark + 9], data[:-9], data[:-8], data[:-1], data):
        file.write_bytes(more)
        assert (scan(file).finished, scan(file).unread, scan(file).beyond) == (True, 0, 0)
    for behind in (b"x", b"12345678", b"123456789", data):
        file.write_bytes(data + behind)
        assert (scan(file).finished, scan(file).beyond) == (True, len(behind))
    file.write_bytes(data[:7])
    with pytest.raises(InputError, match="is not an MCAP file"):
        scan(file)


@pytest.mark.parametrize("how", ["whole", "cut", "data", "checksum", "name"])
def test_a_copy_has_what_is_whole_before_the_first_that_is_not(whole, tmp_path, how, capsys):
    """Also where a byte flipped, in a file with an end as in one without."""
    raw, file = bytearray(whole.read_bytes()), tmp_path / "run.mcap"
    chunks = [c for c in scan(whole).chunks if c.end > c.start]
    broken = chunks[len(chunks) // 2]
    at = {"data": 20, "checksum": -8 - 4 - len("zstd") - 1, "name": -8 - len("zstd")}.get(how)
    if how == "cut":
        del raw[broken.offset + 3 :]
    elif at is not None:
        raw[broken.offset + at] ^= 0xFF
    file.write_bytes(raw)
    before = list(Recording.open(whole).ticks())
    if how == "whole":
        copied = mend(file, tmp_path / "copy.mcap")
        with whole.open("rb") as one, (tmp_path / "copy.mcap").open("rb") as other:
            both = list(zip(*(make_reader(each).iter_messages() for each in (one, other)), strict=True))
            for (schema, channel, message), (of, to, repeated) in both:
                assert (schema and schema.name, channel.topic) == (of and of.name, to.topic)
                assert (message.log_time, message.data) == (repeated.log_time, repeated.data)
        assert copied == len(both)
    else:
        assert main(["repair", str(file), "-o", str(tmp_path / "copy.mcap")]) == 2
    copy = Recording.open(tmp_path / "copy.mcap")
    assert all(chunk.crc for chunk in scan(copy.path).chunks)
    assert copy.files == Recording.open(whole).files
    ticks = list(copy.ticks())
    if how == "whole":
        assert (copy.check(), copy.complete, ticks) == ((), True, before)
        assert main(["repair", str(copy.path)]) == 3
        assert "is whole" in capsys.readouterr().err
    else:
        assert ticks == [tick for tick in before if tick.t < broken.start / 1e9 - 1e-6]
        assert not copy.complete
        assert f" messages, to {copy.end:.2f} s;" in capsys.readouterr().out
        assert 0 < copy.end < before[-1].t


def test_what_is_read_is_what_the_other_library_reads(whole, tmp_path):
    index, read, topics = scan(whole), [], {}
    with whole.open("rb") as file:
        reader = make_reader(file)
        told = [(m.channel_id, m.log_time, m.data) for *_, m in reader.iter_messages(log_time_order=False)]
        named = {key: channel.topic for key, channel in reader.get_summary().channels.items()}
        attached = {each.name: each.data for each in reader.iter_attachments()}
        metadata = {each.name: each.metadata for each in reader.iter_metadata()}
    for chunk in index.chunks:
        of, messages = read_chunk(whole, chunk)
        assert {message.channel for message in messages} == set(chunk.channels)
        assert read_chunk(whole, chunk._replace(crc=0))[1] == messages
        topics |= of
        read += map(tuple, messages)
    assert sorted(read) == sorted(told)
    assert topics == named
    assert {name: read_attachment(whole, each) for name, each in index.attachments.items()} == attached
    assert index.metadata == metadata
    first = index.chunks[0]
    for damaged in (first._replace(crc=first.crc + 1), first._replace(size=first.size + 1)):
        with pytest.raises(Damaged):
            read_chunk(whole, damaged)
    # Whoever compresses as it goes does not know the size beforehand.
    stream = zstandard.ZstdCompressor().compressobj()
    record = struct.pack("<BQHHI3s", 0x04, 11, 7, 0, 3, b"one")
    raw = tmp_path / "raw"
    raw.write_bytes(stream.compress(record) + stream.flush())
    streamed = ChunkPlace(0, 0, 0, raw.stat().st_size, len(record), 0, "zstd", [])
    assert read_chunk(raw, streamed) == ({7: "one"}, [])
    with pytest.raises(Damaged, match="cannot be decompressed"):
        read_chunk(raw, streamed._replace(size=len(record) - 1))
    # Two channels without compression, whole and without their last byte.
    raw.write_bytes(record + struct.pack("<BQHHI3s", 0x04, 11, 8, 0, 3, b"two"))
    whole_one = ChunkPlace(0, 0, 0, 2 * len(record), 2 * len(record), 0, "", [])
    assert read_chunk(raw, whole_one) == ({7: "one", 8: "two"}, [])
    cut = 2 * len(record) - 1
    with pytest.raises(Damaged, match="longer than its chunk"):
        read_chunk(raw, whole_one._replace(length=cut, size=cut))
