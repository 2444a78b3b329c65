"""A recording whose writer was killed opens in the mcap library's own seeking reader once it was repaired."""

import pytest
from mcap.exceptions import McapError
from mcap.reader import SeekingReader

from seerob.app import cli
from seerob.recording.recording import Recording
from soak.cut_short import run_and_kill, workstation


def seek(path, topic):
    with path.open("rb") as file:
        reader = SeekingReader(file, validate_crcs=True)
        assert reader.get_summary() is not None
        return [message.data for _, _, message in reader.iter_messages(topics=[topic])]


def test_a_killed_run_is_repaired_and_still_is_not_whole(tmp_path, capsys):
    folder = tmp_path / "out"
    run_and_kill(workstation(tmp_path / "cell"), folder, 1.0)
    path = folder / "run.mcap"
    before = path.read_bytes()
    with pytest.raises(McapError):
        seek(path, "/results")
    assert cli.main(["repair", str(path)]) == 2
    assert path.read_bytes() == before
    repaired = folder / "run.repaired.mcap"
    assert len(seek(repaired, "/results")) > 5
    cut, mended = Recording.open(path), Recording.open(repaired)
    assert list(mended.snapshots()) == list(cut.snapshots())
    assert list(mended.ticks()) == list(cut.ticks())
    assert mended.meshes == cut.meshes
    assert not mended.complete
    assert mended.findings
    assert cli.main(["repair", str(path)]) == 3  # it is there already
    assert "exists already" in capsys.readouterr().err
