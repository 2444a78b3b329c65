"""NatNet on real sockets, in every version whose frames differ."""

import asyncio
import struct
from dataclasses import replace

import numpy as np
import pytest

from free_ports import free_port
from seerob.app.emulation.mvn_person import animated
from seerob.app.emulators import natnet as natnet_datagrams
from seerob.app.emulators.natnet import BONES, NatnetServer
from seerob.core.samples import Quality
from seerob.core.transforms import inverse, rotation_from_wxyz, transform, wxyz_from_rotation
from seerob.devices.sources.natnet import Coordinates, Natnet, Tracked, Transmission, _composed
from seerob.files.motion_capture.upright import world_from_file
from seerob.protocols import ProtocolError
from seerob.protocols.tracking import natnet
from seerob.protocols.tracking.natnet import Bodies, Message, models
from sources.listening import by_name, heard

VERSIONS = [(2, 0), (2, 1), (2, 3), (2, 6), (2, 7), (2, 9), (2, 11), (3, 0), (3, 1), (4, 0), (4, 1), (4, 2)]
PERSON = animated("library:reach")
PLACED = {name for name, _, _ in BONES} - {"LShoulder", "RShoulder"}
"""Where a collar bone begins is known after a calibration only (``fitted`` in the convention)."""


def server(version=(4, 1), **more):
    return NatnetServer({"Anna": PERSON}, worn={"waist": (PERSON, "Pelvis")}, version=version, port=0, **more)


def source(made, **more):
    more = {"human": "anna", "name": "cameras", "timeout": 1.0} | more
    return Natnet(host="127.0.0.1", port=made.port, transmission=Transmission.UNICAST, **more)


@pytest.mark.parametrize("version", VERSIONS)
def test_frames_and_models_come_back_as_they_were_sent(version):
    made = server(version)
    sent = made.frame(5)
    found = natnet.frame(natnet_datagrams.frame(sent, version), version)
    assert found.t == pytest.approx(sent.t, abs=1e-8)
    np.testing.assert_allclose(found.bodies[0].position, sent.bodies[0].position, atol=1e-6)
    assert found.bodies[0].tracked
    if version >= (2, 1):
        for a, b in zip(found.skeletons[0].bones, sent.skeletons[0].bones, strict=True):
            assert a.id == b.id
            np.testing.assert_allclose(a.xyzw, b.xyzw, atol=1e-6)
    assert models(natnet_datagrams.models(made.models(), version), version) == made.models()


def test_a_frame_of_3_0_byte_by_byte():
    payload = struct.pack("<i", 42) + struct.pack("<iii", 0, 0, 1)
    payload += struct.pack("<i8fH", 7, 1, 2, 3, 0, 0, 0, 1, 0.001, 1)
    payload += struct.pack("<iiii", 0, 0, 0, 0)
    payload += struct.pack("<IId3QHi", 0, 0, 12.5, 0, 0, 0, 2, 0)
    found = natnet.frame(payload, (3, 0))
    assert (found.number, found.t, found.models_changed, found.recording) == (42, 12.5, True, False)
    assert found.bodies[0].position.tolist() == [1, 2, 3]


@pytest.mark.parametrize("version", [(2, 6), (3, 1)])
def test_every_cut_is_refused(version):
    whole = natnet_datagrams.frame(server().frame(0), version)
    for size in range(len(whole) - 4):  # without the tag at the end it is still whole
        with pytest.raises(ProtocolError):
            natnet.frame(whole[:size], version)
    for size in range(len(data := natnet_datagrams.models(server().models(), version))):
        with pytest.raises(ProtocolError):
            models(data[:size], version)


@pytest.mark.parametrize("version", [(2, 6), (3, 1), (4, 1)])
def test_the_skeleton_stands_where_it_was_sent_from(version):
    with server(version, rate=60) as made:
        listened = source(made)
        samples = heard(listened, lambda s: len(s) >= 3)
        findings = asyncio.run(listened.ask())
    points = by_name(samples[-1])
    sent = made.frame(round(samples[-1].t_device * made.rate)).skeletons[0]
    for (name, _, _), bone in zip(BONES, sent.bones, strict=True):
        if name in PLACED:
            np.testing.assert_allclose(points[name].position, world_from_file("y") @ bone.position, atol=1e-6)
    assert set(points) == PLACED
    assert 0.7 < points["Hip"].position[2] < 1.1
    assert samples[-1].quality is Quality.GOOD
    text = " ".join(f.text for f in findings)
    assert "skeletons: Anna" in text
    assert "y is up" in text


def test_rigid_bodies_are_trackers():
    with server(rate=60) as made:
        samples = heard(source(made, tracked=Tracked.RIGID_BODIES), lambda s: len(s) >= 2)
    (point,) = samples[-1].points
    assert (point.name, point.bone) == ("waist", "pelvis")
    np.testing.assert_allclose(point.position, PERSON(samples[-1].t_device).positions[0], atol=1e-6)


class AlikeServer(NatnetServer):
    """Rigid bodies of one number, of which the first is hidden."""

    def models(self):
        found = super().models()
        return found._replace(bodies=tuple(body._replace(id=7) for body in found.bodies))

    def frame(self, k):
        found = super().frame(k)
        bodies = [body._replace(id=7, tracked=n > 0) for n, body in enumerate(found.bodies)]
        return replace(found, bodies=Bodies.of(bodies))


def test_of_two_rigid_bodies_with_one_number_none_is_known():
    worn = {"waist": (PERSON, "Pelvis"), "chest": (PERSON, "T8")}
    with AlikeServer({"Anna": PERSON}, worn=worn, version=(4, 1), port=0) as made:
        samples = heard(source(made, tracked=Tracked.RIGID_BODIES), lambda s: len(s) >= 2)
    assert {point.bone for point in samples[-1].points} == {"pelvis", "thorax"}
    assert all(point.position is None and point.wxyz is None for point in samples[-1].points)
    assert samples[-1].quality is Quality.INVALID


def test_a_multicast_group_is_heard():
    group = ("239.255.42.99", free_port())
    with server(rate=60, group=group) as made:
        listened = Natnet(human="anna", port=made.port, data_port=group[1], timeout=1.0)
        samples = heard(listened, lambda s: len(s) >= 2)
    assert len(samples[-1].points) == len(PLACED)


def test_nobody_answers():
    listened = Natnet(human="anna", port=free_port(), transmission=Transmission.UNICAST, timeout=1.0)
    with pytest.raises(OSError, match="no answer from"):
        asyncio.run(listened.ask())


def test_local_coordinates_are_put_together():
    made = server()
    bones = [bone._replace(id=bone.id & 0xFFFF) for bone in made.frame(9).skeletons[0].bones]
    defined = made.models().skeletons[0].bones
    poses = {b.id: transform(rotation_from_wxyz(b.xyzw[[3, 0, 1, 2]]), b.position) for b in bones}
    local = []
    for bone, model in zip(bones, defined, strict=True):
        pose = poses[bone.id] if model.parent == 0 else inverse(poses[model.parent]) @ poses[bone.id]
        turn = wxyz_from_rotation(pose[:3, :3])
        local.append(bone._replace(position=pose[:3, 3], xyzw=turn[[1, 2, 3, 0]]))
    for found, bone in zip(_composed(local, defined), bones, strict=True):
        np.testing.assert_allclose(found.position, bone.position, atol=1e-9)
    lost = [bone._replace(tracked=bone.id != 2) for bone in local]
    assert {b.id for b in _composed(lost, defined) if not b.tracked} >= {2, 3, 4, 5}
    assert Coordinates("local") is Coordinates.LOCAL


def test_server_info_with_and_without_connection():
    old = natnet.server_info(natnet_datagrams.server_info("M", (2, 9), port=1511, group=None))
    assert (old.natnet[:2], old.group, old.multicast) == ((2, 9), None, None)
    new = natnet.server_info(natnet_datagrams.server_info("M", (4, 1), port=1511, group="239.1.2.3"))
    assert (new.application, new.group, new.data_port, new.multicast) == ("M", "239.1.2.3", 1511, True)
    with pytest.raises(ProtocolError, match="cut short"):
        natnet.split(natnet.message(Message.FRAME, b"1234")[:-1])
