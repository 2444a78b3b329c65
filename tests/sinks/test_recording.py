"""What is read back is what was written, whatever happened to the file."""

import os
import struct
import subprocess
import sys
import time
import tracemalloc
from pathlib import Path
from threading import Event, Thread

import made_run
import msgspec
import numpy as np
import pytest
from mcap.exceptions import EndOfFile
from mcap.reader import NonSeekingReader, SeekingReader, make_reader
from mcap.stream_reader import StreamReader
from mcap_protobuf.decoder import DecoderFactory

import seerob
from seerob.core.errors import InputError, SeerobError
from seerob.core.snapshot import Scene, Snapshot
from seerob.outputs.mcap import McapTape
from seerob.outputs.sinks import recorder as recorder_module
from seerob.outputs.sinks.recorder import FLUSH_PERIOD, Recorder
from seerob.recording.format import END_METADATA, SAMPLES, SCENE, SNAPSHOT, VISITORS, Visitor, nanoseconds
from seerob.recording.recording import AFTER_HOLE, Recording, scan

N = 150


def record(folder, n=N, *, pause=0.0, scene=None, meshes=made_run.MESHES, files=made_run.FILES):
    with Recorder(lossless=True).open(scene or made_run.scene(), meshes, files, folder) as writer:
        for k in range(n):
            writer.write(made_run.snapshot(k), made_run.samples(k))
            time.sleep(pause)
    return folder / "run.mcap"


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return record(tmp_path_factory.mktemp("recording"))


def test_everything_comes_back_bit_for_bit(path):
    recording = Recording.open(path)
    assert recording.complete
    assert recording.findings == ()
    assert recording.scene == made_run.scene()
    assert recording.meshes == made_run.MESHES
    assert recording.files == made_run.FILES
    pack = msgspec.msgpack.encode

    def plain(k):
        return msgspec.msgpack.decode(pack(made_run.snapshot(k)), type=Snapshot)

    snapshots = list(recording.snapshots())
    assert [pack(s) for s in snapshots] == [pack(plain(k)) for k in range(N)]
    ticks = list(recording.ticks())
    assert [(tick.seq, tick.t) for tick in ticks] == [(s.seq, s.t) for s in snapshots]
    assert [tick.samples for tick in ticks] == [made_run.samples(k) for k in range(N)]
    assert (recording.start, recording.end) == (0.0, snapshots[-1].t)
    assert recording._index.metadata[END_METADATA]["ticks"] == str(N)


def test_who_looked_on_has_one_channel_that_other_recordings_lack(path, tmp_path):
    tape = McapTape(tmp_path / "run.mcap", made_run.scene(), {}, {})
    assert [nanoseconds(t) for t in (-1.0, 0.0, 0.2, 1.5)] == [0, 0, 200_000_000, 1_500_000_000]
    came = [Visitor(event=event, role="view", address="", since="") for event in ("came", "left")]
    for t, visitors in ((0.1, ()), (0.2, came[:1]), (0.3, came[1:])):
        tape.visitors(t, tuple(visitors))
    tape.finish({})
    for file, told in ((path, []), (tmp_path / "run.mcap", [(0.2, "came"), (0.3, "left")])):
        with file.open("rb") as opened:
            found = list(make_reader(opened).iter_messages(topics=[VISITORS]))
        said = [msgspec.json.decode(message.data) for *_, message in found]
        assert [(each["t"], each["event"]) for each in said] == told
        assert [(m.log_time, m.sequence) for *_, m in found] == [(nanoseconds(t), 0) for t, _ in told]
        assert len({channel.id for _, channel, _ in found}) == bool(told)


def test_seek_agrees_with_search_in_all_of_it(tmp_path, monkeypatch):
    monkeypatch.setattr(recorder_module, "FLUSH_PERIOD", 0.0)  # a chunk per few ticks
    monkeypatch.setattr(recorder_module, "TOGETHER", 1)
    recording = Recording.open(record(tmp_path, pause=2e-3))
    every = list(recording.snapshots())
    assert every == [made_run.snapshot(k) for k in range(N)]
    rng = np.random.default_rng(1)
    # Also where chunks begin and end.
    edges = [x / 1e9 for chunk in scan(recording.path).chunks[2:40:9] for x in (chunk.start, chunk.end)]
    for t in [0.0, -1.0, 99.0, *edges, *(s.t for s in every[::7]), *rng.uniform(0, N / 100, 30)]:
        before = [s for s in every if s.t <= t]
        assert recording.snapshot_at(t) == (before[-1] if before else every[0])
        for end in (t + rng.uniform(0, 0.3), float(rng.choice(edges))):
            assert list(recording.snapshots(t, end)) == [s for s in every if t <= s.t <= end]
    assert list(recording.snapshots(None, edges[4])) == [s for s in every if s.t <= edges[4]]
    assert list(recording.snapshots(edges[4])) == [s for s in every if s.t >= edges[4]]


def test_cut_anywhere_it_opens_shorter_or_says_why(path, tmp_path):
    whole = path.read_bytes()
    expected = [made_run.snapshot(k) for k in range(N)]
    cut = tmp_path / "cut.mcap"
    lengths = []
    ends, position = [], 8
    while position < len(whole) - 8:
        position += 9 + int.from_bytes(whole[position + 1 : position + 9], "little")
        ends.append(position)
    coarse = range(120, len(whole), len(whole) // 100)
    for size in sorted({*range(0, 120, 3), *coarse, *ends[:200], *(e - 1 for e in ends[:200])}):
        cut.write_bytes(whole[:size])
        try:
            recording = Recording.open(cut)
        except InputError:
            lengths.append(-1)
            continue
        snapshots = list(recording.snapshots())
        assert snapshots == expected[: len(snapshots)]
        lengths.append(len(snapshots))
    assert lengths == sorted(lengths)
    assert lengths[-1] == N


def test_a_flipped_byte_anywhere_never_invents_anything(path, tmp_path):
    whole = path.read_bytes()
    expected = {s.seq: s for s in (made_run.snapshot(k) for k in range(N))}
    bad = tmp_path / "bad.mcap"
    rng = np.random.default_rng(2)
    refused = 0
    for position in rng.integers(0, len(whole), 150):
        data = bytearray(whole)
        data[position] ^= int(rng.integers(1, 256))
        bad.write_bytes(data)
        try:
            recording = Recording.open(bad)
            for s in recording.snapshots():
                assert s == expected[s.seq]
            assert all(made_run.MESHES.get(k, v) == v for k, v in recording.meshes.items())
            recording.snapshot_at(0.7)
            list(recording.ticks())
            assert recording.scene == made_run.scene()
        except InputError:
            refused += 1
    assert refused < 150  # most of the file is data, of which the rest survives


def test_cut_off_recording_says_so_and_how_far_it_goes(path, tmp_path):
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(path.read_bytes()[:-40000] if path.stat().st_size > 80000 else path.read_bytes()[:-200])
    recording = Recording.open(cut)
    assert not recording.complete
    assert "cut off" in recording.findings[0].text
    assert f"{recording.end:.3f} s" in recording.findings[0].text


KILLED = """
import sys, time
from pathlib import Path
import made_run
from seerob.outputs.sinks.recorder import Recorder
writer = Recorder().open(made_run.scene(), made_run.MESHES, made_run.FILES, Path(sys.argv[1]))
k = 0
while True:
    time.sleep(0.01)
    writer.write(made_run.snapshot(k), made_run.samples(k))
    print(k, flush=True)
    k += 1
"""


def test_kill_9_loses_less_than_a_second(tmp_path):
    source = Path(seerob.__file__).parents[1]
    process = subprocess.Popen(
        [sys.executable, "-c", KILLED, str(tmp_path)],
        stdout=subprocess.PIPE,
        env={"PYTHONPATH": f"{source}:{Path(made_run.__file__).parent}"},
    )
    for line in process.stdout:
        if int(line) == 220:
            process.kill()
            break
    last = max([220, *map(int, process.stdout.read().split())])
    process.stdout.close()
    assert process.wait() == -9
    path = tmp_path / "run.mcap"
    recording = Recording.open(path)
    snapshots = list(recording.snapshots())
    assert not recording.complete
    assert last * 0.01 - recording.end < 1.0
    assert snapshots == [made_run.snapshot(k) for k in range(len(snapshots))]
    with path.open("rb") as file:  # a foreign reader gets as far, then finds the end missing
        messages = NonSeekingReader(file, validate_crcs=True).iter_messages(log_time_order=False)
        topics = []
        with pytest.raises((EndOfFile, struct.error)):
            topics.extend(channel.topic for _, channel, _ in messages)
    seen = topics.count(SNAPSHOT)
    assert seen == len(snapshots)


def test_a_foreign_reader_understands_every_channel(path):
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        summary = reader.get_summary()
        topics = {c.topic: c for c in summary.channels.values()}
        assert set(topics) == {SCENE, SAMPLES, SNAPSHOT, "/scene", "/markers", "/tf", "/results"}
        assert summary.statistics.attachment_count == len(made_run.MESHES) + len(made_run.FILES)
        scenes = [m.decoded_message for m in reader.iter_decoded_messages(topics=["/scene"])]
        transforms = [m.decoded_message for m in reader.iter_decoded_messages(topics=["/tf"])]
        markers = [m.decoded_message for m in reader.iter_decoded_messages(topics=["/markers"])]
        results = [msgspec.json.decode(m.data) for _, _, m in reader.iter_messages(topics=["/results"])]
        first = next(m for _, _, m in reader.iter_messages(topics=[SCENE]))
        # A second implementation of MessagePack reads ours without knowing our types.
        assert msgspec.convert(msgspec.msgpack.decode(first.data), Scene) == made_run.scene()
        attachments = {a.name: a.data for a in reader.iter_attachments()}
        # Nobody says when a file or the scene was made.
        assert {(a.create_time, a.log_time) for a in reader.iter_attachments()} == {(0, 0)}
        assert [m.sequence for *_, m in reader.iter_messages(topics=[SNAPSHOT])] == [*range(N)]
        begun = reader.iter_messages(topics=[SCENE, "/scene"])
        assert [(c.topic, m.log_time, m.sequence) for _, c, m in begun] == [(SCENE, 0, 0), ("/scene", 0, 0)]
        assert {topics[topic].schema_id for topic in (SCENE, SAMPLES, SNAPSHOT)} == {0}
    nodes = made_run.scene().nodes
    assert [e.frame_id for e in scenes[0].entities] == [n.name for n in nodes if n.mesh]
    assert scenes[0].entities[0].models[0].data == made_run.MESHES["c" * 64]
    assert {t.child_frame_id for t in transforms[0].transforms} == {n.name for n in nodes}
    assert attachments["file/workstation.toml"] == made_run.FILES["workstation.toml"]
    duration = (N - 1) * 0.01
    assert duration * 20 <= len(transforms) <= duration * 20 + 2
    assert len(markers) == len(results) == len(transforms)
    segment = markers[0].entities[0].lines[0].points
    assert [segment[0].x, segment[0].z] == [0.5, 1.3]
    assert results[0]["results"][0] == {
        "name": "separation",
        "value": made_run.snapshot(0).results[0].value,
        "limit": made_run.snapshot(0).results[0].limit,
        "unit": "m",
        "verdict": "within",
        "reason": "ur10/forearm_link ↔ operator/head",
    }


def test_checksums_are_in_the_file(path):
    with path.open("rb") as file:
        chunks = [r for r in StreamReader(file, emit_chunks=True).records if type(r).__name__ == "Chunk"]
    assert all(chunk.uncompressed_crc for chunk in chunks)


def test_what_the_index_remembers_of_hours_of_chunks_is_not_in_memory(tmp_path, monkeypatch):
    chunks, first = 800, 200
    monkeypatch.setattr("os.fsync", lambda _: None)
    tape = McapTape(tmp_path / "run.mcap", made_run.scene(), made_run.MESHES, {})
    tracemalloc.start()
    for k in range(chunks):
        if k == first:
            begun = tracemalloc.get_traced_memory()[0]
        t = k * FLUSH_PERIOD
        tape.tick(k, t, (), msgspec.structs.replace(made_run.snapshot(k % 10), seq=k, t=t))
        tape.flush()
    grown = tracemalloc.get_traced_memory()[0] - begun
    tracemalloc.stop()
    tape.finish({})
    assert grown / ((chunks - first) * FLUSH_PERIOD / 3600) < 1e6  # [byte per hour of run time]
    with (tmp_path / "run.mcap").open("rb") as file:
        reader = SeekingReader(file, validate_crcs=True)
        indexes = reader.get_summary().chunk_indexes
        assert [i.message_end_time for i in indexes[-chunks:]] == [
            nanoseconds(k * FLUSH_PERIOD) for k in range(chunks)
        ]
        late = reader.iter_messages(topics=[SNAPSHOT], starting_at=nanoseconds((chunks - 3) * FLUSH_PERIOD))
        assert [m.sequence for _, _, m in late] == [chunks - 3, chunks - 2, chunks - 1]


def test_a_slow_disk_drops_snapshots_before_samples_and_says_so(tmp_path, monkeypatch):
    from seerob.outputs.mcap import McapTape

    gate = Event()
    tick = McapTape.tick
    monkeypatch.setattr(McapTape, "tick", lambda *a: (gate.wait(), tick(*a))[1])
    writer = Recorder(queue=5).open(made_run.scene(), {}, {}, tmp_path)
    for k in range(60):
        writer.write(made_run.snapshot(k), made_run.samples(k))
    gate.set()
    writer.close()
    recording = Recording.open(tmp_path / "run.mcap")
    assert [t.samples for t in recording.ticks()] == [made_run.samples(k) for k in range(60)]
    assert 0 < len(list(recording.snapshots())) == 60 - writer.dropped < 60
    assert recording.findings[0].text.startswith(f"{writer.dropped} snapshots were dropped")
    assert recording.findings[0].holds == ()
    assert writer.findings()[0].level == "warning"


def test_what_a_disk_never_comes_to_is_lost_and_nothing_computed_again_is_within(tmp_path, monkeypatch):
    """Not more than `_BACKLOG` queues wait, so that memory does not grow for hours."""
    from seerob.outputs.mcap import McapTape

    gate, tick = Event(), McapTape.tick
    monkeypatch.setattr(McapTape, "tick", lambda *a: (gate.wait(), tick(*a))[1])
    writer = Recorder(queue=1).open(made_run.scene(), {}, {}, tmp_path)
    for k in range(60):
        writer.write(made_run.snapshot(k), made_run.samples(k))
    gate.set()
    writer.close()
    recording = Recording.open(tmp_path / "run.mcap")
    kept = len(list(recording.ticks()))
    assert 20 <= kept <= 40  # a queue's worth may have been taken before the disk was asked
    assert writer.lost == 60 - kept
    (short,) = (f for f in recording.findings if f.holds)
    assert (short.text.split(" ticks")[0], short.holds) == (str(60 - kept), ("*",))


def test_an_interrupt_while_the_thread_begins_leaves_none_and_a_whole_file(tmp_path, monkeypatch):
    begun, start = [], Thread.start

    def interrupted(thread):
        start(thread)
        begun.append(thread)
        raise KeyboardInterrupt

    monkeypatch.setattr(Thread, "start", interrupted)
    with pytest.raises(KeyboardInterrupt):
        Recorder().open(made_run.scene(), {}, {}, tmp_path)
    begun[0].join(60)
    assert not begun[0].is_alive()
    assert Recording.open(tmp_path / "run.mcap").complete


def test_lossless_waits_instead_of_dropping(tmp_path, monkeypatch):
    from seerob.outputs.mcap import McapTape

    tick = McapTape.tick
    monkeypatch.setattr(McapTape, "tick", lambda *a: (time.sleep(1e-3), tick(*a))[1])
    with Recorder(queue=1, lossless=True).open(made_run.scene(), {}, {}, tmp_path) as writer:
        for k in range(60):
            writer.write(made_run.snapshot(k), ())
    assert len(list(Recording.open(tmp_path / "run.mcap").snapshots())) == 60


def test_a_disk_that_refuses_stops_the_recording_not_the_run(tmp_path, monkeypatch):
    from seerob.outputs.mcap import McapTape

    def refuse(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(McapTape, "tick", refuse)
    writer = Recorder().open(made_run.scene(), {}, {}, tmp_path)
    for k in range(20):
        writer.write(made_run.snapshot(k), ())
    writer._thread.join(60)  # it ends by itself
    assert writer.lost == 20
    for k in range(20, 23):
        writer.write(made_run.snapshot(k), ())
    with pytest.raises(SeerobError, match="No space left"):
        writer.close()
    assert writer.lost == 23
    assert "No space left" in writer.findings()[-1].text
    assert Recording.open(tmp_path / "run.mcap").scene == made_run.scene()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="the full disk of Linux")
def test_a_full_disk_is_told_also_when_what_waits_cannot_be_written(tmp_path, monkeypatch):
    """Closing the file writes once more, and fails once more."""
    monkeypatch.setattr("seerob.outputs.sinks.recorder.FLUSH_PERIOD", 0.0)
    writer = Recorder(lossless=True).open(made_run.scene(), {}, {}, tmp_path)
    with open("/dev/full", "wb") as full:
        os.dup2(full.fileno(), writer._tape._file.fileno())
    writer.write(made_run.snapshot(0), ())
    with pytest.raises(SeerobError, match=r"run\.mcap: recording stopped early: .*No space left"):
        writer.close()
    assert writer.lost == 1
    assert "No space left" in writer.findings()[-1].text


def test_time_that_stands_still_or_turns_back_is_left_out(tmp_path):
    with Recorder(lossless=True).open(made_run.scene(), {}, {}, tmp_path) as writer:
        for k in (0, 1, 1, 0, 2):
            writer.write(made_run.snapshot(k), ())
        now, later = made_run.snapshot(2), made_run.snapshot(3)
        writer.write(msgspec.structs.replace(later, seq=now.seq), ())  # the number stands still
        writer.write(msgspec.structs.replace(later, t=now.t), ())  # and the time does
        writer.write(msgspec.structs.replace(later, t=float("nan")), ())
        writer.write(later, ())
    recording = Recording.open(tmp_path / "run.mcap")
    assert [s.seq for s in recording.snapshots()] == [0, 1, 2, 3]
    assert "5 ticks were left out" in recording.findings[0].text
    assert recording.findings[0].holds == ("*",)


@pytest.mark.parametrize("missing", [(0,), (2,), (0, 1, 4)])
def test_ticks_that_are_missing_are_silence_also_at_the_beginning(tmp_path, missing):
    """What comes after them is not relied on: on the way there nobody was heard."""
    said = made_run.samples(3)
    assert said
    assert not any(sample.reason for sample in said)
    with Recorder(lossless=True).open(made_run.scene(), {}, {}, tmp_path) as writer:
        for k in sorted(set(range(6)) - set(missing)):
            writer.write(made_run.snapshot(k), said)
    recording = Recording.open(tmp_path / "run.mcap")
    first = min(set(range(6)) - set(missing)) * 0.01
    assert (recording.start, recording.end, recording.duration) == (first, 0.05, 0.05 - first)
    heard = list(recording.heard())
    assert [k for k, samples in enumerate(heard) if not samples] == list(missing)
    for k in set(range(6)) - set(missing):
        assert {sample.reason for sample in heard[k]} == {AFTER_HOLE if k - 1 in missing else ""}


def test_numbers_of_numpy_are_recorded_as_numbers(tmp_path):
    odd = msgspec.structs.replace(
        made_run.snapshot(0),
        tracking={"ur10": np.float32(0.5)},
        joints={"ur10": (np.float64(0.1), np.int64(2))},
    )
    with Recorder(lossless=True).open(made_run.scene(), {}, {}, tmp_path) as writer:
        writer.write(odd, ())
    (back,) = Recording.open(tmp_path / "run.mcap").snapshots()
    assert (back.tracking, back.joints) == ({"ur10": 0.5}, {"ur10": (0.1, 2.0)})


def test_an_existing_recording_is_never_overwritten(path):
    before = path.read_bytes()
    with pytest.raises(InputError, match="exists already"):
        record(path.parent)
    assert path.read_bytes() == before


@pytest.mark.parametrize("name", ["../run.mcap", "run.txt", "", "a/b.mcap"])
def test_only_a_file_name_is_accepted(tmp_path, name):
    with pytest.raises(InputError, match=r"recorder\.file"):
        Recorder(file=name).open(made_run.scene(), {}, {}, tmp_path)


def test_wrong_files_are_refused_with_their_name(tmp_path):
    from mcap.writer import Writer

    foreign = tmp_path / "foreign.mcap"
    with foreign.open("wb") as file:
        writer = Writer(file)
        writer.start()
        writer.add_message(writer.register_channel("/x", "json", 0), 0, b"{}", 0)
        writer.finish()
    text = tmp_path / "text.mcap"
    text.write_text("hello")
    for wrong, what in (
        (foreign, "not one of seerob"),
        (text, "not an MCAP"),
        (tmp_path / "none", "No such file"),
    ):
        with pytest.raises(InputError, match=what) as caught:
            Recording.open(wrong)
        assert caught.value.problems[0].file == str(wrong)


def test_poses_that_do_not_fit_the_scene_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("seerob.outputs.mcap.VIEW_PERIOD", float("inf"))
    with Recorder(lossless=True).open(made_run.scene(), {}, {}, tmp_path) as writer:
        writer.write(made_run.snapshot(0), ())
        writer.write(msgspec.structs.replace(made_run.snapshot(1), poses=b"\0" * 28), ())
    with pytest.raises(InputError, match="28 bytes of poses for 6 nodes"):
        list(Recording.open(tmp_path / "run.mcap").snapshots())


def test_names_that_lead_out_of_the_folder_are_not_extracted(tmp_path):
    inner = tmp_path / "inner"
    inner.mkdir()
    path = record(tmp_path, 1, files={"a/ok.txt": b"1", "../evil.txt": b"2"})
    with pytest.raises(InputError, match="leads out"):
        Recording.open(path).extract(inner)
    assert list(inner.iterdir()) == []


def test_files_are_extracted_where_they_were(path, tmp_path):
    Recording.open(path).extract(tmp_path)
    assert {n: (tmp_path / n).read_bytes() for n in made_run.FILES} == made_run.FILES


def test_a_run_without_ticks_is_a_recording_too(tmp_path):
    recording = Recording.open(record(tmp_path, 0))
    assert (recording.complete, recording.start, recording.end) == (True, 0.0, 0.0)
    assert list(recording.snapshots()) == []
    with pytest.raises(InputError, match="no snapshot"):
        recording.snapshot_at(0)
