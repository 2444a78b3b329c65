"""Keyframes as a source: samples of a person in time order."""

from __future__ import annotations

import math

import numpy as np
import pytest

from seerob.core import plugin
from seerob.core.errors import InputError
from seerob.description.humans import manikin
from seerob.description.humans.posture import lowest_sole, posture
from seerob.devices.sources.keyframes import Keyframes
from seerob.workstation.source import Source, Target

PERSON = manikin.build(name="p", stature=1.75, mass=75, sex="male")


def target(description=PERSON) -> Target:
    joints = PERSON.joints()
    return Target(
        name="operator",
        joints=tuple(j.name for j in joints),
        units=tuple("m" if j.kind == "prismatic" else "rad" for j in joints),
        lower=tuple(-math.inf if j.lower is None else j.lower for j in joints),
        upper=tuple(math.inf if j.upper is None else j.upper for j in joints),
        velocity=(None,) * len(joints),
        description=description,
    )


def test_it_is_found_by_its_kind():
    assert plugin.load("sources", "keyframes", Source) is Keyframes


def test_samples_of_a_file(tmp_path):
    (tmp_path / "squat.toml").write_text(
        'title = "squat"\nnote = "by hand"\n[[keyframes]]\nt = 2\nposture = "standing"\n'
        '[[keyframes]]\nt = 3\nposture = "squatting"\n'
    )
    source = Keyframes(human="operator", file="squat.toml", rate=50.0)
    assert source.target() == "operator"
    opened = source.open(tmp_path, target())
    samples = list(opened.samples)
    assert [s.seq for s in samples] == list(range(51))
    assert [s.t for s in samples] == pytest.approx(np.arange(51) / 50)
    assert opened.duration == samples[-1].t == 1.0
    assert {s.target for s in samples} == {"operator"}
    assert samples[0].q == pytest.approx(posture(PERSON, "standing"))
    assert samples[-1].q == pytest.approx(posture(PERSON, "squatting"))
    q = np.array([s.q for s in samples])
    assert lowest_sole(PERSON, q) == pytest.approx(0, abs=1e-12)
    # The cubic between two samples ends where the next begins: velocities belong to the positions.
    qd = np.array([s.qd for s in samples])
    middle = (q[:-1] + q[1:]) / 2 + (qd[:-1] - qd[1:]) / 50 / 8
    fine = Keyframes(human="operator", file="squat.toml", rate=100.0).open(tmp_path, target())
    assert np.array([s.q for s in fine.samples])[1::2] == pytest.approx(middle, abs=2e-4)
    assert list(opened.samples) == samples
    assert any("by hand" in f.text and f.level == "assumed" for f in opened.findings)


def test_library_motions_open(tmp_path):
    opened = Keyframes(human="operator", file="library:walk").open(tmp_path, target())
    assert opened.duration == pytest.approx(4.8)


@pytest.mark.parametrize("rate", [0.0, -1.0, 1e6, math.nan])
def test_rates_that_make_no_sense(tmp_path, rate):
    with pytest.raises(InputError, match="rate"):
        Keyframes(human="operator", file="library:walk", rate=rate).open(tmp_path, target())


def test_what_is_not_a_person_is_refused(tmp_path):
    source = Keyframes(human="robot", file="library:walk")
    for other in (None, target(None)):
        with pytest.raises(InputError, match="humans"):
            source.open(tmp_path, other)
