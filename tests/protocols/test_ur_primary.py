"""The primary interface: kinematics out of a stream that is cut, dressed with other parts, or nonsense."""

from __future__ import annotations

import asyncio
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from seerob.app.emulation.motions import swing
from seerob.app.emulators.rtde import RtdeServer
from seerob.protocols import ProtocolError
from seerob.protocols.robots.ur_primary import (
    Kinematics,
    decode_kinematics,
    encode_state,
    kinematics_in,
    packages,
    read_kinematics,
)

BUILT = Kinematics(
    theta=(1e-3, 0.0, 2e-3, 0.0, 0.0, 0.0),
    a=(0.0, -0.612, -0.5723, 0.0, 0.0, 0.0),
    d=(0.1273, 300.0, -300.0, 0.163941, 0.1157, 0.0922),
    alpha=(1.57, 0.0, 0.0, 1.57, -1.57, 0.0),
    checksum=(1, 2, 3, 4, 5, 0xFFFF_FFFF),
    status=7,
)


def read(port, patience=5.0):
    return asyncio.run(read_kinematics("127.0.0.1", port, patience))


def test_the_bytes_are_those_of_the_makers_layout():
    state = encode_state(BUILT)
    length, kind = struct.unpack_from(">iB", state)
    assert (length, kind) == (len(state), 16)
    # Its second part: length, 5, checksums, theta, a, d, alpha, status.
    at = 5 + 43
    assert struct.unpack_from(">iB6I", state, at) == (225, 5, *BUILT.checksum)
    assert struct.unpack_from(">24d", state, at + 29) == (*BUILT.theta, *BUILT.a, *BUILT.d, *BUILT.alpha)
    assert struct.unpack_from(">I", state, at + 29 + 192) == (7,)


@given(st.integers(0, 600))
def test_what_is_cut_is_waited_for(cut):
    stream = encode_state(BUILT) * 2
    found = [kinematics_in(payload) for _, payload, _ in packages(stream[:cut])]
    assert found == [BUILT] * (cut // len(encode_state(BUILT)))


@given(st.binary(max_size=400))
def test_nonsense_is_an_error_and_nothing_else(data):
    try:
        for _, payload, _ in packages(data):
            kinematics_in(payload)
        decode_kinematics(data)
    except ProtocolError:
        pass


def test_what_is_not_finite_or_too_short_is_refused():
    payload = struct.pack(">6I24dI", *BUILT.checksum, *(float("nan"),) * 24, 0)
    with pytest.raises(ProtocolError, match="not finite"):
        decode_kinematics(payload)
    with pytest.raises(ProtocolError, match="where 220 belong"):
        decode_kinematics(payload[:-1])


def test_it_is_read_over_a_socket():
    with RtdeServer(swing((0.0,) * 6), kinematics=BUILT) as server:
        assert read(server.primary_port) == BUILT
        # The port of RTDE says nothing by itself.
        with pytest.raises(TimeoutError, match="does not say its kinematics"):
            read(server.port, 0.2)
    with pytest.raises(ConnectionRefusedError):
        read(server.primary_port)
