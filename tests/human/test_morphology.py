"""The size of a recorded person comes back, with its spread, from joint centres that a camera jitters."""

from __future__ import annotations

import numpy as np
import pytest
from made_capture import walking

from seerob.core.errors import InputError
from seerob.description.capture.captured import CaptureFrame, Layout, Seen
from seerob.description.capture.mapping import choose, places
from seerob.description.capture.morphology import measure
from seerob.description.capture.observing import bind
from seerob.description.humans import manikin
from seerob.description.humans.anthropometry import CHAIN, body
from seerob.description.humans.skeleton import BONES, bone_poses

GIVEN = {"thigh": 0.40, "shank": 0.44, "upper_arm": 0.30, "forearm": 0.27, "hip_centres": 0.19}
WHO = {"name": "p", "sex": "female", "mass": 62.0}
PERSON = manikin.build(**WHO, stature=1.70, own_lengths=GIVEN)


def recorded(noise=0.0, wrong=0.0, seed=0):
    """A walk of the person, as joint centres with a confidence; a share of the frames is far off."""
    random = np.random.default_rng(seed)
    frames = []
    for k, q in enumerate(walking()[1]):
        p = bone_poses(PERSON, q)[1] + noise * random.normal(size=(21, 3))
        sure = np.ones(21)
        if random.random() < wrong:
            p += random.normal(size=(21, 3))
            sure[random.random(21) < 0.5] = 0.0
        frames.append(CaptureFrame(t=k / 60, positions=p, confidence=sure))
    return frames


def observer():
    layout = Layout(Seen.JOINTS, BONES, "seerob")
    convention, _ = choose(layout, "p")
    return bind(layout, places(layout, convention, {}, file="x"), PERSON, convention=convention)


def test_exact_joint_centres_give_exact_lengths_and_a_person_who_has_them():
    found = measure(recorded(), observer(), **WHO, stature=1.70)
    assert {k: found.lengths[k] for k in GIVEN} == pytest.approx(GIVEN, abs=1e-9)
    assert all(each.spread < 1e-9 for key, each in found.measured.items() if key in GIVEN)
    made = body(**WHO, stature=found.stature, own_lengths=found.lengths)
    assert sum(made.length[k] for k in CHAIN) == pytest.approx(1.70, abs=1e-12)
    assert made.offset["right_shank"] == pytest.approx([0, -0.40, 0])


@pytest.mark.parametrize("seed", range(4))
def test_noise_and_a_tenth_of_wrong_frames_hardly_matter(seed):
    found = measure(recorded(noise=0.01, wrong=0.1, seed=seed), observer(), **WHO, stature=1.70)
    for key, value in GIVEN.items():
        # Noise across a bone makes it longer by the order of its square: s² / L.
        assert found.lengths[key] == pytest.approx(value, abs=0.008)
        each = found.measured[key]
        assert each.spread == pytest.approx(0.0141, rel=0.35)
        assert each.percentiles["P5"] < each.value < each.percentiles["P95"]


def test_the_stature_follows_from_the_tables_share_when_nobody_gives_it():
    usual = manikin.build(**WHO, stature=1.62)
    frames = [CaptureFrame(t=k / 60, positions=bone_poses(usual, q)[1]) for k, q in enumerate(walking()[1])]
    found = measure(frames, observer(), **WHO)
    # The curved spine is shorter than its bones.
    assert found.stature == pytest.approx(1.62, abs=0.02)
    assert any("estimated from the measured lengths" in f.text for f in found.findings)


def test_who_is_not_seen_well_is_not_measured():
    for frames in (
        recorded()[:10],
        [CaptureFrame(f.t, f.positions, confidence=0 * f.confidence) for f in recorded()],
    ):
        with pytest.raises(InputError, match="no bone is seen well"):
            measure(frames, observer(), **WHO)
    small = [CaptureFrame(f.t, f.positions * 0.1) for f in recorded()]
    with pytest.raises(InputError, match="check the unit"):
        measure(small, observer(), **WHO)
