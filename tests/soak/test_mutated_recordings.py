"""Any file may be given to `Recording.open`: it opens, shorter or whole, or says what is wrong."""

import random

import pytest

from seerob.errors import InputError
from seerob.recording import Recording
from seerob.sinks.recorder import Recorder
from sinks import made_run

N = 60


def mutated(data, rng):
    """``data`` with one or more bytes changed, moved, cut out, doubled, or lengths blown up."""
    out = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 8))):
        at, size = rng.randrange(len(out)), rng.choice((1, 4, 8, 64, 1000))
        match rng.randrange(7):
            case 0:
                out[at] ^= 1 << rng.randrange(8)
            case 1:
                out[at : at + size] = rng.randbytes(size)
            case 2:
                del out[at : at + size]
            case 3:
                out[at:at] = out[at : at + size]
            case 4:
                out[at : at + 8] = rng.choice((0, 2**31, 2**40, 2**63, 2**64 - 1)).to_bytes(8, "little")
            case 5:
                del out[max(1, at) :]
            case 6:
                other = rng.randrange(len(out))
                out[at : at + size] = out[other : other + size]
        if len(out) < 2:
            break
    return bytes(out)


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
