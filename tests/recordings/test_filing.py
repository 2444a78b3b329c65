"""What a recording keeps of the files that its sources read: all of the small ones, a hash of the others."""

from hashlib import sha256

import pytest

import seerob as sr
from seerob.outputs.sinks.recorder import Recorder
from seerob.recording.format import SOURCES, source_files


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "cell" / "walk").mkdir(parents=True)
    (tmp_path / "cell" / "small.csv").write_bytes(b"t;q\n")
    (tmp_path / "cell" / "large.bag").write_bytes(bytes(200))
    (tmp_path / "beside.csv").write_bytes(b"elsewhere")
    for name in ("metadata.yaml", "walk_0.db3"):
        (tmp_path / "cell" / "walk" / name).write_bytes(name.encode())
    return tmp_path / "cell"


def line(name, content):
    return f"{sha256(content).hexdigest()}  {name}\n"


def test_a_large_file_and_a_folder_are_kept_as_the_hashes_that_sha256sum_prints(folder, monkeypatch):
    monkeypatch.setattr("seerob.recording.format.LARGEST", 100)
    named = ("small.csv", "large.bag", "walk", "../beside.csv", "none.csv", "library:walk")
    parts = [line(f"walk/{name}", name.encode()) for name in ("metadata.yaml", "walk_0.db3")]
    kept = {
        "small.csv": b"t;q\n",
        f"{SOURCES}large.bag.sha256": line("large.bag", bytes(200)).encode(),
        f"{SOURCES}walk.sha256": "".join(parts).encode(),
    }
    assert source_files(named, folder=folder) == kept
    # What is there by now counts, not what was unpacked; a file of just that size is kept.
    (folder / SOURCES).mkdir(parents=True)
    (folder / SOURCES / "large.bag.sha256").write_bytes(b"then")
    (folder / "edge.csv").write_bytes(bytes(100))
    assert source_files((*named, "edge.csv"), folder=folder) == kept | {"edge.csv": bytes(100)}
    beside = {f"{SOURCES}beside.csv.sha256": line("beside.csv", b"elsewhere").encode()}
    assert source_files(named, folder=folder, outside=True) == kept | beside


def test_a_run_from_a_large_file_is_computed_again_without_it(tmp_path, monkeypatch):
    monkeypatch.setattr("seerob.recording.format.LARGEST", 100)
    rows = "".join(f"{k / 10},{k},-90,90,-90,-90,0\n" for k in range(5))
    header = "time [s]," + ",".join(f"J{i} [deg]" for i in range(1, 7))
    (tmp_path / "motion.csv").write_text(f"{header}\n{rows}")
    (tmp_path / "workstation.toml").write_text(
        '[[robots]]\nname = "ur5e"\nmodel = "library:ur5e"\n'
        '[[sources]]\nkind = "csv"\nrobot = "ur5e"\nfile = "motion.csv"\n'
        '[[safety]]\nkind = "velocity"\nname = "speed"\nat = "ur5e"\nlimit = 1\n'
    )
    station = sr.load(tmp_path)
    run = station.run(folder=tmp_path / "out", sinks=[Recorder(lossless=True)])
    (tmp_path / "motion.csv").unlink()
    recording = sr.Recording.open(tmp_path / "out" / "run.mcap")
    again = sr.load_recorded(recording).replay(recording)
    assert again.results["speed"].values.tolist() == run.results["speed"].values.tolist()
    assert f"{SOURCES}motion.csv.sha256" in recording.files
    assert again.scene.workstation_hash == run.scene.workstation_hash
