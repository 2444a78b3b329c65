"""A hundred thousand broken datagrams of motion capture: an error or a flagged frame, no more."""

from __future__ import annotations

import random
import struct
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "sources"))

from made_mvnx import Q  # tests/sources

from seerob.app.emulation.mvn_person import Pose, segments
from seerob.app.emulators.mvn import datagrams
from seerob.devices.sources.mvn import Frames
from seerob.protocols import ProtocolError
from seerob.protocols.tracking.mvn import HEADER, Kind, Splitter, decode

COUNTS = [pytest.param(1000, id="short"), pytest.param(100_000, id="long", marks=pytest.mark.soak)]


def broken(rng, data):
    """Some bytes changed, cut off or put in."""
    bad = bytearray(data)
    for _ in range(rng.randint(0, 8)):
        bad[rng.randrange(len(bad))] = rng.randrange(256)
    if rng.random() < 0.3:
        at = rng.randrange(len(bad))
        bad[at : at + rng.randint(0, 40)] = rng.randbytes(rng.randint(0, 40))
    return bytes(bad[: rng.randint(0, len(bad))] if rng.random() < 0.3 else bad)


def good():
    positions, _ = segments(mvnx_person(), Q[:5])
    pose = Pose(positions[0], np.tile([1.0, 0, 0, 0], (23, 1)))
    kinds = [k for k in Kind if k not in {Kind.POINTS, Kind.TRACKERS}]
    found = [
        d for kind in kinds for n in (0, 9) for d in datagrams(kind, pose, sample=3, t=1.0, items_each=n)
    ]
    return [*found, points(), *trackers(pose)]


def trackers(pose):
    """Of motion trackers: laid out as angular kinematics, another number."""
    return [b"MXTP23" + d[6:] for d in datagrams(Kind.ANGULAR, pose, sample=3, t=1.0)]


def points():
    """Of 30 points, which nobody emulates: identifiers and places behind the header of another kind."""
    (whole,) = datagrams(Kind.MASS_CENTER, Pose(np.zeros((23, 3)), np.zeros((23, 4))), sample=3, t=1.0)
    head = bytearray(whole[:HEADER])
    payload = b"".join(struct.pack(">I3f", 256 * (k + 1) + 1, k, 1.0, 2.0) for k in range(30))
    head[:6], head[11], head[22:24] = b"MXTP03", 30, struct.pack(">H", len(payload))
    return bytes(head) + payload


def mvnx_person():
    from made_mvnx import PERSON

    return PERSON


def flagged(frame):
    seen = frame.positions[np.isfinite(frame.positions).all(axis=1)]
    turns = frame.orientations[np.isfinite(frame.orientations).all(axis=1)]
    assert not np.isinf(frame.positions).any()
    assert (np.abs(seen) <= 1e6).all()
    np.testing.assert_allclose(np.linalg.norm(turns, axis=1), 1.0, atol=1e-6)


@pytest.mark.parametrize("count", COUNTS)
def test_datagrams(count):
    rng, frames, samples = random.Random(1), Frames(), good()
    assert {decode(data).header.kind for data in samples} == set(Kind)
    heard = 0
    for k in range(count):
        if k % 1000 == 0:
            frames = Frames()
        item = frames.feed(broken(rng, rng.choice(samples)), k / 100)
        if item is not None:
            heard += 1
            flagged(item[1])
    assert 0 < heard < count


@pytest.mark.parametrize("count", COUNTS)
def test_streams(count):
    rng, samples, refused = random.Random(2), good(), 0
    for _ in range(count // 10):
        splitter = Splitter()
        try:
            for _ in range(10):
                splitter.feed(broken(rng, rng.choice(samples)))
        except ProtocolError:
            refused += 1
    assert refused > count // 20
