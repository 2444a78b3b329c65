"""Any bytes may come as a message of a depth camera: they are understood, or refused."""

import random
from functools import cache

import numpy as np
import pytest

from seerob.app.emulators.kinect import animated
from seerob.protocols import ProtocolError
from seerob.protocols.tracking.kinect import decode_message, encode_message
from soak.mutations import mutated


@cache
def message():
    return encode_message(animated("library:reach")(0.0))


@pytest.mark.parametrize(
    "count", [pytest.param(2000, id="short"), pytest.param(100_000, id="long", marks=pytest.mark.soak)]
)
def test_mutated_messages_are_read_or_refused(count):
    rng = random.Random(3)
    refused = 0
    for _ in range(count):
        try:
            picture = decode_message(mutated(message(), rng))
        except ProtocolError:
            refused += 1
            continue
        assert np.isfinite(picture.t)
        assert all(body.positions.shape == (32, 3) for body in picture.bodies)
    assert 0 < refused < count
