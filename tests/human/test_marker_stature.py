"""Markers that span the body tell the stature to a centimetre or two; others are refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from seerob.core.errors import InputError
from seerob.description.capture.captured import Captured, CaptureFrame, Layout, Seen
from seerob.description.capture.fit_check import marker_stature
from seerob.description.capture.mapping import conventions, places, plain
from seerob.description.capture.observing import bind
from seerob.description.humans import keyframes, manikin
from seerob.description.humans.skeleton import BONES, bone_poses

PAIRS = ("ASI", "PSI", "FHD", "BHD", "SHO", "ELB", "WRA", "KNE", "ANK", "HEE", "TOE")
EVERY = ("C7", "T10", "CLAV", "STRN", *(side + name for name in PAIRS for side in "RL"))
MARKERS = conventions()["markers"]


def told(stature, names=EVERY):
    person = manikin.build(name="p", stature=stature, mass=70, sex="male")
    q = keyframes.sample(keyframes.read("library:reach", person, folder=Path()), person, 15.0).q
    R, p = bone_poses(person, q)
    random = np.random.default_rng(1)
    seen = []
    for name in names:
        place = MARKERS.places[plain(name)]
        bone = BONES.index(place.bone)
        seen.append(
            p[:, bone] + R[:, bone] @ (place.at * stature + random.uniform(-0.02, 0.02, 3) / np.sqrt(3))
        )
    layout = Layout(Seen.MARKERS, tuple(names))
    frames = [CaptureFrame(t=k / 15, positions=each) for k, each in enumerate(np.stack(seen, axis=1))]

    def bound(tall):
        somebody = manikin.build(name="p", stature=tall, mass=70, sex="male")
        return somebody, bind(layout, places(layout, MARKERS, {}, file="x"), somebody, convention=MARKERS)

    return marker_stature(Captured(layout, frames, 15.0, len(frames)), bound, name="p")


def test_markers_two_centimetres_off_tell_the_stature():
    stature = 1.62
    found = told(stature)
    assert found.stature == pytest.approx(stature, abs=0.02)
    assert found.lowest <= found.stature + 0.01
    assert found.highest >= found.stature - 0.01
    assert f"{found.stature:.2f} m" in found.finding("p").text


def test_an_arm_alone_does_not_tell_it():
    with pytest.raises(InputError, match="give --stature"):
        told(1.75, ("CLAV", "RSHO", "RELB", "RWRA"))
