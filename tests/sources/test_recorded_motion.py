import pytest
from made_motion import motion, target

from seerob.core.errors import InputError
from seerob.core.samples import JointSample, PoseSample, Quality
from seerob.core.snapshot import Scene, Snapshot
from seerob.devices.sources.recording import RecordedMotion
from seerob.outputs.sinks.recorder import Recorder

SCENE = Scene(title="t", edition="", version="0", workstation_hash="0", period=0.01, nodes=())


@pytest.fixture
def recorded(tmp_path):
    """A run of two robots and a tracker, of which the samples of one are wanted."""
    t, q, qd = motion(120)
    heard = []
    with Recorder(lossless=True).open(SCENE, {}, {}, tmp_path) as writer:
        for k in range(len(t)):
            quality = Quality.DEGRADED if k == 7 else Quality.GOOD
            common = {"seq": k, "t": float(t[k]), "quality": quality}
            own = JointSample(source="rtde", target="left", q=tuple(q[k]), qd=tuple(qd[k]), **common)
            other = JointSample(source="fri", target="right", q=(0.0,) * 7, **common)
            cart = PoseSample(source="vive", target="cart", position=(0, 0, 0), wxyz=(1, 0, 0, 0), **common)
            writer.write(Snapshot(seq=k, t=float(t[k]), poses=b""), (own, other, cart))
            heard.append(own)
    return tmp_path, heard


def test_the_samples_of_one_target_come_back_bit_for_bit_under_its_new_name(recorded):
    folder, heard = recorded
    source = RecordedMotion(drives="ur10", file="run.mcap", recorded="left")
    opened = source.open(folder, target())
    for _ in range(2):
        for ours, theirs in zip(opened.samples, heard, strict=True):
            assert (ours.source, ours.target) == ("recording ur10", "ur10")
            for name in ("seq", "t", "q", "qd", "quality"):
                assert getattr(ours, name) == getattr(theirs, name)
    assert opened.duration == heard[-1].t
    assert any("replayed from a recording" in f.text for f in opened.findings)


def test_a_name_that_was_not_recorded_is_answered_with_the_ones_that_were(recorded):
    folder, _ = recorded
    with pytest.raises(InputError, match=r"no joints of 'ur10'.*known: left, right"):
        RecordedMotion(drives="ur10", file="run.mcap").open(folder, target())


def test_it_must_fit_the_robot_that_it_drives(recorded):
    folder, _ = recorded
    with pytest.raises(InputError, match="7 joints, but 'ur10' has 6"):
        RecordedMotion(drives="ur10", file="run.mcap", recorded="right").open(folder, target())
    narrow = RecordedMotion(drives="ur10", file="run.mcap", recorded="left")
    with pytest.raises(InputError, match="its limit"):
        narrow.open(folder, target(limit=0.5))


@pytest.mark.parametrize("share", [0.05, 0.3, 0.6, 0.9, 0.99])
def test_a_recording_that_was_cut_off_gives_what_is_there_and_says_what_is_not(recorded, share):
    folder, heard = recorded
    data = (folder / "run.mcap").read_bytes()
    (folder / "cut.mcap").write_bytes(data[: int(len(data) * share)])
    source = RecordedMotion(drives="ur10", file="cut.mcap", recorded="left")
    try:
        opened = source.open(folder, target())
    except InputError:
        # Where the first part ends that a reader can use hangs on how fast it was written.
        assert share < 0.9
        return
    assert share > 0.05
    q = [s.q for s in opened.samples]
    assert q == [s.q for s in heard[: len(q)]]
    cut = any(f.level == "warning" and "cut off" in f.text for f in opened.findings)
    assert cut or len(q) == len(heard)


def test_files_that_are_no_recording_are_refused(tmp_path):
    (tmp_path / "a.mcap").write_bytes(b"hello")
    for file in ("a.mcap", "missing.mcap"):
        with pytest.raises(InputError, match="mcap"):
            RecordedMotion(drives="ur10", file=file).open(tmp_path, target())
