"""Any file may be given to `Recording.open`: it opens, shorter or whole, or says what is wrong."""

import random

import pytest

from seerob.core.errors import InputError
from seerob.outputs.sinks.recorder import Recorder
from seerob.recording.recording import Recording
from sinks import made_run
from soak.mutations import mutated

N = 60


@pytest.mark.parametrize(
    "files", [pytest.param(300, id="short"), pytest.param(10_000, id="long", marks=pytest.mark.soak)]
)
def test_mutated_files_open_or_are_refused_and_nothing_is_made_up(tmp_path, files):
    with Recorder(lossless=True).open(made_run.scene(), made_run.MESHES, made_run.FILES, tmp_path) as writer:
        for k in range(N):
            writer.write(made_run.snapshot(k), made_run.samples(k))
    whole = (tmp_path / "run.mcap").read_bytes()
    expected = {k: made_run.snapshot(k) for k in range(N)}
    rng = random.Random(11)
    path = tmp_path / "mutated.mcap"
    opened = 0
    for _ in range(files):
        path.write_bytes(mutated(whole, rng))
        try:
            recording = Recording.open(path)
            for snapshot in recording.snapshots():
                assert snapshot == expected[snapshot.seq]
            for tick in recording.ticks():
                assert tick.samples == made_run.samples(tick.seq)
            for name, data in recording.meshes.items():
                assert made_run.MESHES.get(name, data) == data
            recording.snapshot_at(0.3)
            opened += 1
        except InputError:
            continue
    assert 0 < opened < files
