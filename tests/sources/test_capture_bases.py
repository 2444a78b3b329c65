"""What every source of captured motion does alike: options, checks, calibration, streams."""

from __future__ import annotations

import asyncio
import logging
import re
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

from seerob.core.errors import InputError
from seerob.core.quantities import Pose
from seerob.core.samples import BodySample, Quality
from seerob.core.transforms import rotation_from_axis_angle, rotation_from_wxyz, wxyz_from_rotation
from seerob.description.capture.captured import Captured, CaptureFrame, Layout, Seen
from seerob.description.capture.mapping import choose, places
from seerob.description.capture.observing import bind
from seerob.description.humans import manikin
from seerob.description.humans.posture import posture
from seerob.description.humans.skeleton import BONES, bone_poses
from seerob.devices.capture.file_source import CaptureFile
from seerob.devices.capture.options import Calibration, Mapped, Weights
from seerob.devices.capture.stream_source import CaptureStream
from seerob.session.reading import convert_workstation
from seerob.workstation.source import Target

PERSON = manikin.build(name="operator", stature=1.75, mass=75, sex="male")
LAYOUT = Layout(Seen.SEGMENTS, BONES, "seerob")
TARGET = Target(name="operator", joints=(), units=(), lower=(), upper=(), velocity=(), description=PERSON)


def frame(t, wanted="standing", shift=0.0, subject="", layout=LAYOUT):
    R, p = bone_poses(PERSON, posture(PERSON, wanted))
    wxyz = np.array([wxyz_from_rotation(r) for r in R])
    return CaptureFrame(t=t, positions=p + shift, orientations=wxyz, subject=subject)


class Recorded(CaptureFile, frozen=True, kw_only=True):
    frames: tuple[CaptureFrame, ...]
    layout: Layout = LAYOUT

    def read(self, path):
        return Captured(self.layout, self.frames, 60.0, len(self.frames))


def opened(*frames, folder=".", layout=LAYOUT, **options):
    source = Recorded(human="operator", file="f", frames=frames, layout=layout, **options)
    return source.open(Path(folder), TARGET)


def texts(opened, level):
    return " | ".join(f.text for f in opened.findings if f.level == level)


def test_samples_begin_at_zero_in_order_and_again():
    made = opened(*(frame(t) for t in (5.0, 5.1, 5.05, 5.2, np.nan, 5.3)))
    samples = list(made.samples)
    assert [s.t for s in samples] == pytest.approx([0.0, 0.1, 0.2, 0.3])
    assert [s.t_device for s in samples] == [5.0, 5.1, 5.2, 5.3]
    assert [s.seq for s in samples] == [0, 1, 2, 3]
    assert made.duration == pytest.approx(0.3)
    assert list(made.samples) == samples
    assert "2 frames whose time does not advance" in texts(made, "warning")


def test_latency_puts_samples_earlier_against_other_devices():
    made = opened(*(frame(0.1 * k) for k in range(6)), latency=0.2)
    assert [s.t for s in made.samples] == pytest.approx([0.0, 0.1, 0.2, 0.3])
    assert made.duration == pytest.approx(0.3)


def test_gaps_losses_and_changing_names_are_told():
    frames = [frame(0.1 * k, subject="7" if k < 5 else "8") for k in range(10)]
    frames[3].positions[BONES.index("head")] = np.nan
    frames[3].orientations[BONES.index("head")] = np.nan
    frames.append(frame(3.0, subject="8"))
    made = opened(*frames)
    said = texts(made, "warning")
    assert "nothing was seen for up to 2.10 s (at 0.90 s)" in said
    assert "head (9 %)" in said
    assert "changed its name of the person" in said


def test_weights_and_mapping_are_the_users():
    made = opened(
        frame(0.0),
        weights=Weights(position=2.0, orientation=0.5, bones={"head": 3.0}),
        mapping={"neck": "", "right_toes": Mapped(bone="right_foot", at=(0.1, 0, 0), position=4.0)},
    )
    points = {p.name: p for p in next(iter(made.samples)).points}
    assert "neck" not in points
    assert (points["head"].position_weight, points["head"].orientation_weight) == (6.0, 1.5)
    assert (points["right_toes"].bone, points["right_toes"].at) == ("right_foot", (0.1, 0, 0))
    assert points["right_toes"].position_weight == 8.0


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"mapping": {"heda": "head"}}, "did you mean 'head'"),
        ({"mapping": {"head": "had"}}, "did you mean 'head'"),
        ({"convention": "xens"}, "did you mean 'xsens'"),
        ({"weights": Weights(bones={"hand": 1.0})}, "no such bone"),
        ({"mapping_file": "nowhere.toml"}, "no such file"),
    ],
)
def test_mistakes_are_told(options, says, tmp_path):
    with pytest.raises(InputError, match=says):
        opened(frame(0.0), folder=tmp_path, **options)


def test_frames_of_another_size_or_none_are_input_errors():
    with pytest.raises(InputError, match="3 rows, the layout has 21"):
        opened(CaptureFrame(t=0.0, positions=np.zeros((3, 3))))
    with pytest.raises(InputError, match="no frame"):
        opened()


def turned(frames, bone, angle):
    wrong = rotation_from_axis_angle([0, 1, 0], angle)
    for each in frames:
        row = each.orientations[BONES.index(bone)]
        row[:] = wxyz_from_rotation(rotation_from_wxyz(row) @ wrong)
    return frames


def test_a_quarter_turn_is_found_without_and_mended_with_a_calibration():
    pose = {"both_elbow_pronation_deg": 90.0}
    frames = turned([frame(k / 60, pose) for k in range(90)], "right_thigh", np.pi / 2)
    blind = opened(*frames)
    assert "right_thigh on right_thigh is mounted a quarter turn" in texts(blind, "warning")
    mended = opened(*frames, calibration=Calibration(pose="npose", duration=0.5))
    assert "the calibration makes up for it" in texts(mended, "warning")
    R, _ = bone_poses(PERSON, posture(PERSON, pose))
    for point in next(iter(mended.samples)).points:
        assert rotation_from_wxyz(point.wxyz) == pytest.approx(R[BONES.index(point.bone)], abs=1e-9)


def test_markers_find_their_places():
    random = np.random.default_rng(0)
    names = ("LASI", "RASI", "LPSI", "RPSI", "C7", "CLAV", "STRN", "T10", "LKNE", "RKNE", "LANK", "RANK")
    layout = Layout(Seen.MARKERS, names, "markers")
    convention, _ = choose(layout, "p")
    rows = bind(layout, places(layout, convention, {}, file="x"), PERSON).rows
    shift = random.uniform(-0.02, 0.02, (len(names), 3))
    frames = []
    for k, wanted in enumerate(["standing", "squatting", "reach_low", "reach_high"] * 10):
        R, p = bone_poses(PERSON, posture(PERSON, wanted))
        i = [BONES.index(row.bone) for row in rows]
        places_now = p[i] + np.einsum("nij,nj->ni", R[i], np.array([row.at for row in rows]) + shift)
        frames.append(CaptureFrame(t=k / 10, positions=places_now))
    made = opened(*frames, layout=layout)
    said = texts(made, "assumed")
    before, after = map(float, re.findall(r"(\d+) mm (?:median before|after)", said))
    assert after < 0.5 * before


def test_two_sources_may_share_a_person_and_others_may_not():
    made, problems = convert_workstation(
        {
            "humans": [{"name": "operator", "stature": 1.75, "mass": 75.0, "sex": "male"}],
            "sources": [
                {"kind": "keyframes", "human": "operator", "file": "library:walk"},
                {"kind": "bvh", "human": "operator", "file": "a.bvh"},
            ],
        },
        "w.toml",
    )
    assert made is None
    assert "already driven by sources[0]" in str(problems)
    made, problems = convert_workstation(
        {
            "humans": [{"name": "operator", "stature": 1.75, "mass": 75.0, "sex": "male"}],
            "sources": [
                {"kind": "bvh", "human": "operator", "file": "a.bvh"},
                {"kind": "bvh", "human": "operator", "file": "b.bvh"},
            ],
        },
        "w.toml",
    )
    assert made is not None, problems


class Heard(CaptureStream, frozen=True, kw_only=True):
    said: tuple[CaptureFrame, ...]
    layout: Layout = LAYOUT
    pause: float = 0.0
    """After each frame [s]."""

    def period(self):
        return 1 / 60

    async def frames(self):
        for each in self.said:
            yield self.layout, each
            await asyncio.sleep(self.pause)


def heard(*frames, **options):
    async def all_of():
        source = Heard(human="operator", name="stream", said=frames, **options)
        return [sample async for sample in source.listen(TARGET)]

    return asyncio.run(all_of())


def test_a_stream_says_what_it_hears_with_both_clocks():
    samples = heard(frame(100.0), frame(100.1), latency=0.05)
    assert all(isinstance(s, BodySample) for s in samples)
    assert [s.t_device for s in samples] == [100.0, 100.1]
    assert {s.latency for s in samples} == {0.05}
    assert len(samples[0].points) == len(BONES)
    source = Heard(human="operator", said=(), latency=0.05)
    assert source.behind() == pytest.approx(1 / 60 + 0.005 + 0.05)
    assert replace(source, delay=0.03).behind() == 0.03


def test_how_well_the_place_of_a_device_is_known_is_in_every_sample():
    (exact,) = heard(frame(0.0))
    assert exact.placing is None
    (known,) = heard(frame(0.0), at=Pose(position=(1, 2, 3)), at_accuracy=0.01, at_accuracy_turn=0.02)
    assert known.placing.about == (1, 2, 3)
    wanted = np.diag([0.01**2] * 3 + [0.02**2] * 3)
    assert np.reshape(known.placing.covariance, (6, 6)) == pytest.approx(wanted)


def test_a_stream_follows_one_person_and_whoever_appears_where_that_one_was_lost():
    far = np.array([2.0, 0, 0])
    crowd = [frame(0.0, subject="1"), frame(0.0, shift=far, subject="2"), frame(0.1, subject="1")]
    # A loaded machine hears late, too.
    assert {s.subject for s in heard(*crowd, timeout=60.0)} == {"1"}
    assert {s.subject for s in heard(*crowd, subject="2", timeout=60.0)} == {"2"}
    # The same place, another name; then also the first silent for longer than the time-out.
    other = frame(0.0, subject="1"), frame(0.1, subject="9")
    assert [s.subject for s in heard(*other, timeout=60.0)] == ["1"]
    assert [s.subject for s in heard(*other, timeout=0.06, delay=0.001, pause=0.1)] == ["1", "9"]


def test_frames_of_nothing_are_invalid_and_frames_of_another_size_are_left_out():
    nothing = CaptureFrame(t=0.1, positions=np.full((21, 3), np.nan))
    short = CaptureFrame(t=0.2, positions=np.zeros((4, 3)))
    samples = heard(frame(0.0), nothing, short, frame(0.3))
    assert [s.quality for s in samples] == [Quality.GOOD, Quality.INVALID, Quality.GOOD]


def test_somebody_else_with_other_bones_leaves_a_calibration_as_it_is():
    pose = {"both_elbow_pronation_deg": 90.0}
    frames = turned([frame(k / 60, pose, subject="1") for k in range(400)], "left_hand", np.pi / 2)
    fewer = Layout(Seen.SEGMENTS, BONES[:-1], "seerob")
    whole = frame(0.0, shift=np.array([2.0, 0, 0]), subject="2")
    other = CaptureFrame(0.0, whole.positions[:-1], whole.orientations[:-1], subject="2")

    class Crowded(Heard, frozen=True, kw_only=True):
        async def frames(self):
            for each in self.said:
                await asyncio.sleep(0.001)
                yield self.layout, each
                yield fewer, other

    async def all_of():
        calibration = Calibration(pose="npose", duration=0.1)
        source = Crowded(human="operator", said=tuple(frames), calibration=calibration, timeout=60.0)
        return [sample async for sample in source.listen(TARGET)]

    _, *samples = asyncio.run(all_of())
    assert {sample.subject for sample in samples} == {"1"}
    R, _ = bone_poses(PERSON, posture(PERSON, pose))
    for sample in samples:
        hand = next(p for p in sample.points if p.bone == "left_hand")
        assert rotation_from_wxyz(hand.wxyz) == pytest.approx(R[BONES.index("left_hand")], abs=1e-9)


def test_a_stream_is_silent_while_it_is_calibrated_and_says_what_it_found(caplog):
    pose = {"both_elbow_pronation_deg": 90.0}
    frames = turned([frame(k / 60, pose) for k in range(400)], "left_hand", np.pi / 2)

    class Slow(Heard, frozen=True, kw_only=True):
        async def frames(self):
            for each in self.said:
                await asyncio.sleep(0.001)
                yield self.layout, each

    async def all_of():
        source = Slow(
            human="operator",
            name="stream",
            said=tuple(frames),
            calibration=Calibration(pose="npose", duration=0.1),
        )
        return [sample async for sample in source.listen(TARGET)]

    with caplog.at_level(logging.INFO):
        samples = asyncio.run(all_of())
    told, *samples = samples
    assert told.values["calibration left_hand turned [rad]"] == pytest.approx(np.pi / 2)
    assert told.values["calibration head off [m]"] == pytest.approx(0.0, abs=1e-9)
    assert 0 < len(samples) < 400
    assert "left_hand on left_hand is mounted a quarter turn" in caplog.text
    R, _ = bone_poses(PERSON, posture(PERSON, pose))
    hand = next(p for p in samples[0].points if p.bone == "left_hand")
    assert rotation_from_wxyz(hand.wxyz) == pytest.approx(R[BONES.index("left_hand")], abs=1e-9)
