"""The emulated Universal Robots controller: every field, inputs, holds; against ur_rtde and Pinocchio."""

from __future__ import annotations

import json
import os
import random
import socket
import subprocess
import sys
import time

import numpy as np
import pinocchio as pin
import pytest

from live_story import wait_for
from oracles.pinocchio_oracle import pinocchio_model
from seerob.app.emulation.motions import swing
from seerob.app.emulation.ur_fields import INPUTS, OUTPUTS, ControllerState
from seerob.app.emulators.rtde import HOME, PROTECTIVE, RtdeServer
from seerob.description.robots import library
from seerob.protocols.robots.rtde import Data, Kind, Recipe, Splitter, encode_request, pack

Q, QD, QDD = np.array([0.3, -1.2, 1.4, -1.5, -1.5, 0.2]), np.linspace(-1, 1, 6), np.linspace(2, -3, 6)


@pytest.fixture(scope="module")
def said():
    return ControllerState(library.load("ur10"), tcp=0.1)


def test_torques_and_momentum_are_those_of_pinocchio(said):
    model = pinocchio_model(library.load("ur10"))
    model.gravity.linear = np.array([0, 0, -9.82])
    model.armature[:] = 0
    data = model.createData()
    expected = pin.rnea(model, data, Q, QD, QDD)
    fields = said(tuple(Q), tuple(QD), tuple(QDD))
    np.testing.assert_allclose(fields["target_moment"], expected, atol=1e-9)
    momentum = pin.computeCentroidalMomentum(model, data, Q, QD).linear
    assert fields["actual_momentum"] == pytest.approx(np.linalg.norm(momentum), rel=1e-9)
    step = 1e-6
    after = said(tuple(Q + step * QD), tuple(QD))["elbow_position"]
    before = said(tuple(Q - step * QD), tuple(QD))["elbow_position"]
    speed = (np.array(after) - np.array(before)) / (2 * step)
    np.testing.assert_allclose(fields["elbow_velocity"], speed, atol=1e-6)


def test_every_field_has_a_value_of_its_type(said):
    server = RtdeServer(swing(HOME), controller_state=said)
    values = server.at(0.5)
    assert values.keys() == OUTPUTS.keys()
    recipe = Recipe(tuple(OUTPUTS), tuple(OUTPUTS.values()), 1)
    assert recipe.unpack(recipe.pack(values))["actual_q"] == pytest.approx(swing(HOME)(0.5)[0])
    assert len(OUTPUTS) > 390
    assert {name for name in INPUTS if "register" in name} <= set(OUTPUTS)


FOREIGN = """
import json, sys, time
from rtde_receive import RTDEReceiveInterface
from rtde_io import RTDEIOInterface
heard = RTDEReceiveInterface(sys.argv[1])
said = [heard.getActualTCPPose(), heard.getTargetMoment(), heard.getPayload(), heard.getActualMomentum()]
written = RTDEIOInterface(sys.argv[1], 125.0)
taken = [written.setSpeedSlider(0.25), written.setStandardDigitalOut(2, True)]
for _ in range(500):
    if heard.getTargetSpeedFraction() == 0.25 and heard.getDigitalOutState(2):
        break
    time.sleep(0.02)
print(json.dumps([*said, taken, heard.getSpeedScaling(), heard.getDigitalOutState(2)]))
written.disconnect()
heard.disconnect()
"""


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux has a whole network of loopback addresses")
def test_ur_rtde_as_it_begins_by_itself_hears_all_and_writes(said):
    """Its default recipe, and its interface of inputs; its port is fixed, hence an address of our own."""
    pytest.importorskip("rtde_receive")
    chance = random.Random(os.getpid())
    host = f"127.{chance.randrange(1, 255)}.{chance.randrange(256)}.{chance.randrange(2, 255)}"
    with RtdeServer(swing(HOME), host=host, port=30004, controller_state=said) as server:
        done = subprocess.run(
            [sys.executable, "-c", FOREIGN, host], capture_output=True, text=True, timeout=120, check=True
        )
        wait_for(lambda: not server.writers)
    pose, moment, payload, momentum, taken, scaling, out = json.loads(
        next(line for line in done.stdout.splitlines() if line.startswith("[["))  # it talks beside
    )
    assert taken == [True, True]
    assert (payload, scaling, out) == (0.0, 0.25, True)
    assert np.linalg.norm(pose[:3]) > 0.3
    assert abs(moment[1]) > 20
    assert momentum > 0


def asked(client, *requests):
    """The next packages of the kind that answers inputs."""
    for request in requests:
        client.sendall(request)
    splitter, found = Splitter(), []
    while len(found) < len(requests):
        found += [p for p in splitter.feed(client.recv(1000)) if p.kind == Kind.INPUTS]
    return [p.payload for p in found]


def test_an_input_is_written_by_one_client_alone(said):
    with RtdeServer(swing(HOME), controller_state=said) as server:
        address = ("127.0.0.1", server.port)
        with socket.create_connection(address) as one, socket.create_connection(address) as other:
            number = pack(Kind.INPUTS, b"input_int_register_3")
            assert asked(one, number) == [b"\1INT32"]
            assert asked(other, number, pack(Kind.INPUTS, b"actual_q")) == [b"\0IN_USE", b"\0NOT_FOUND"]
            one.sendall(encode_request(Data(1, (77).to_bytes(4, "big")), 2))
            wait_for(lambda: server.at(0.0)["input_int_register_3"] == 77)
        with socket.create_connection(address) as third:
            wait_for(lambda: not server.writers)
            assert asked(third, number) == [b"\1INT32"]


def test_it_slows_down_pauses_and_stops_protectively_where_it_is(said):
    server = RtdeServer(swing(HOME), controller_state=said)
    server._begun = time.monotonic() - 2.0
    server.write({"speed_slider_mask": 1, "speed_slider_fraction": 0.5})
    now = server.now()
    (t, moved) = server._clock
    assert server.at(now + 1.0)["actual_q"] == pytest.approx(swing(HOME)(moved + 0.5 * (now + 1.0 - t))[0])
    later, here = (np.array(server.at(now + x)["actual_q"]) for x in (1.001, 0.999))
    np.testing.assert_allclose(server.at(now + 1.0)["actual_qd"], (later - here) / 0.002, atol=1e-5)
    server.hold(PROTECTIVE)
    here = server.at(server.now())
    assert server.at(server.now() + 5.0)["actual_q"] == here["actual_q"]
    assert set(here["actual_qd"]) == {0.0}
    assert (here["safety_mode"], here["safety_status_bits"], here["runtime_state"]) == (3, 0b100, 4)
    server.hold()
    assert (server.at(server.now())["safety_mode"], server.at(server.now())["robot_status_bits"]) == (1, 1)
    server.release()
    assert server.at(server.now() + 1.0)["actual_q"] != here["actual_q"]
