"""Worn trackers: messages, recordings, SteamVR's own interface, and a moved origin."""

import asyncio
import importlib.util
import json
import types
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest

from free_ports import free_port
from seerob.app.emulation.mvn_person import animated
from seerob.app.emulators.vive import FIVE, WORN, ViveSender, recorded, worn
from seerob.core.errors import InputError
from seerob.core.samples import Quality
from seerob.core.transforms import rotation_from_axis_angle
from seerob.description.humans import manikin
from seerob.devices.capture.worn_trackers import OriginWatch
from seerob.devices.sources.vive import Link, Vive
from seerob.devices.sources.vive_recording import ViveRecording
from seerob.files.motion_capture import tracker_file
from seerob.protocols import ProtocolError
from seerob.protocols.tracking import mvn_pose
from seerob.protocols.tracking.openvr_devices import OpenVr
from seerob.protocols.tracking.vive import Device, Devices, decode, encode, missing, plain_role
from seerob.workstation.source import Target
from sources.listening import by_name, heard

PERSON = animated("library:reach")
TRACKERS = worn(PERSON)
TOOL = Path(__file__).resolve().parents[2] / "tools/vive_sender/vive_sender.py"


def source(port, link=Link.UDP, **more):
    more = {"human": "anna", "name": "trackers", "timeout": 1.0} | more
    return Vive(host="127.0.0.1", port=port, link=link, **more)


def target():
    anna = manikin.build(name="anna", stature=1.75, mass=75.0, sex="female")
    return Target(name="anna", joints=(), units=(), lower=(), upper=(), velocity=(), description=anna)


def same(a, b):
    for x, y in zip(a.devices, b.devices, strict=True):
        assert (x.serial, x.role, x.tracking) == (y.serial, y.role, y.tracking)
        np.testing.assert_allclose(x.position, y.position, atol=1e-6)
        np.testing.assert_allclose(x.wxyz, y.wxyz, atol=1e-6)


def test_a_message_comes_back_as_it_was_sent():
    sent = TRACKERS(0.5)
    lost = replace(sent.devices[1], tracking=False, position=np.full(3, np.nan), wxyz=np.full(4, np.nan))
    sent = Devices(1.25, (sent.devices[0], lost), epoch=3)
    found = decode(encode(sent))
    assert (found.t, found.epoch) == (1.25, 3)
    same(found, sent)


@pytest.mark.parametrize(("tracking", "result"), [(False, 200), (True, 201), (True, 300), (True, 1)])
def test_what_is_not_tracked_has_no_pose(tracking, result):
    said = {"serial": "a", "tracking": tracking, "result": result, "position": [1, 2, 3]}
    message = json.dumps({"seerob": "vive/1", "t": 1.0, "devices": [said]})
    (device,) = decode(message).devices
    assert not device.tracking
    assert np.isnan(device.position).all()


def test_axes_of_openvr():
    said = {"serial": "a", "position": [1, 2, 3], "rotation": [1, 0, 0, 0]}
    (device,) = decode(json.dumps({"seerob": "vive/1", "t": 1.0, "devices": [said]})).devices
    np.testing.assert_allclose(device.position, [-3, -1, 2])  # forward is -z, left -x, up y


@pytest.mark.parametrize(
    ("role", "plain"),
    [
        ("vive_tracker_waist", "waist"),
        ("/user/vive_tracker_htcx/role/left_foot", "left_foot"),
        ("/user/hand/left", "left_hand"),
        ("Right_Elbow", "right_elbow"),
        ("", ""),
    ],
)
def test_roles_of_openvr_and_openxr_are_the_same(role, plain):
    assert plain_role(role) == plain


def test_the_least_five():
    assert missing(FIVE) == ()
    assert missing(("waist", "left_foot", "left_hand")) == ("feet", "hands or arms")


@pytest.mark.parametrize("suffix", [".jsonl", ".csv"])
def test_a_recording_is_read_back(tmp_path, suffix):
    path = tmp_path / f"trackers{suffix}"
    assert tracker_file.write(path, recorded(TRACKERS, duration=0.5, rate=30)) == 15
    found = list(tracker_file.read(path, file="f"))
    assert [x.t for x in found] == pytest.approx([k / 30 for k in range(15)])
    for k, instant in enumerate(found):
        same(instant, TRACKERS(k / 30))
    opened = ViveRecording(human="anna", file=path.name).open(tmp_path, target())
    samples = list(opened.samples)
    assert len(samples) == 15
    row = mvn_pose.SEGMENTS.index(WORN["left_hand"])
    np.testing.assert_allclose(
        by_name(samples[3])["left_hand"].position, PERSON(0.1).positions[row], atol=1e-6
    )


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.csv", "t,serial\n", "line 1: the first line is 't,serial'"),
        ("a.csv", ",".join(tracker_file.HEADER) + "\n1,a,,maybe,,,,,,,\n", "line 2"),
        ("a.csv", ",".join(tracker_file.HEADER) + "\n1,a,,1,x,,,,,,\n", "line 2"),
        ("a.csv", ",".join(tracker_file.HEADER) + "\n" + "1,a,,1,1,1,1,,,,\n" * 2, "a device twice"),
        ("a.jsonl", '{"seerob": "vive/2", "t": 1}\n', "line 1: version 'vive/2'"),
        ("a.jsonl", "", "no device"),
        ("b.jsonl", None, "No such file"),
    ],
)
def test_a_wrong_recording_says_where(tmp_path, name, text, message):
    if text is not None:
        (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match=message):
        ViveRecording(human="anna", file=name).open(tmp_path, target())


def test_one_role_for_two_is_refused(tmp_path):
    with pytest.raises(InputError, match="is worn by another one") as caught:
        ViveRecording(human="anna", file="f", trackers={"a": "waist", "b": "waist"}).open(tmp_path, target())
    assert len(caught.value.problems) == 2


@pytest.mark.parametrize("link", [Link.UDP, Link.WEBSOCKET])
def test_trackers_are_where_they_were_sent_from(link):
    port = free_port()
    to = ("127.0.0.1", port) if link is Link.UDP else None
    with ViveSender(TRACKERS, to=to, port=0, rate=60) as sender:
        listened = source(port if to else sender.port, link)
        samples = heard(listened, lambda s: len(s) >= 3)
        findings = asyncio.run(listened.ask())
    points = by_name(samples[-1])
    assert set(points) == set(FIVE)
    sent = {d.role: d for d in TRACKERS(samples[-1].t_device).devices}
    for role, point in points.items():
        np.testing.assert_allclose(point.position, sent[role].position, atol=1e-6)
    assert samples[-1].quality is Quality.GOOD
    assert "LHR-0000 (waist)" in findings[0].text


def test_a_serial_number_counts_more_than_a_role():
    port = free_port()
    listened = source(
        port, trackers={"LHR-0000": "chest", "LHR-0001": "waist"}, mapping={"LHR-0002": "right_shank"}
    )
    with ViveSender(TRACKERS, to=("127.0.0.1", port), rate=60):
        samples = heard(listened, lambda s: len(s) >= 1)
    bones = {p.name: p.bone for p in samples[0].points}
    assert bones["chest"] == "thorax"
    assert bones["waist"] == "pelvis"
    assert bones["LHR-0002"] == "right_shank"


def moved(instant, shift, turn=0.0):
    R = rotation_from_axis_angle((0, 0, 1), turn)
    devices = tuple(replace(d, position=R @ d.position + shift) for d in instant.devices)
    return replace(instant, devices=devices)


def test_a_moved_origin_is_noticed_and_a_moving_person_is_not():
    watch = OriginWatch()
    assert all(watch.trusted(TRACKERS(k / 30)) for k in range(90))
    assert not watch.trusted(moved(TRACKERS(3.0), (0.8, 0, 0), 0.5))
    assert not watch.trusted(TRACKERS(3.1))
    assert watch.moved_at == pytest.approx(3.0)
    told = OriginWatch()
    assert told.trusted(TRACKERS(0.0))
    assert not told.trusted(replace(TRACKERS(0.1), epoch=1))


def test_one_tracker_that_jumps_is_no_moved_origin():
    watch = OriginWatch()
    assert watch.trusted(TRACKERS(0.0))
    first, *others = TRACKERS(0.02).devices
    assert watch.trusted(Devices(0.02, (replace(first, position=first.position + 2), *others)))


def test_after_a_moved_origin_nothing_is_believed():
    port = free_port()

    def trackers(t):
        return moved(TRACKERS(t), (1.0, 0, 0)) if t > 1.5 else TRACKERS(t)

    with ViveSender(trackers, to=("127.0.0.1", port), rate=60):
        samples = heard(source(port), lambda s: any(x.quality is Quality.INVALID for x in s))
    assert all(p.position is None for p in samples[-1].points)


# -- SteamVR's own interface ---------------------------------------------------------------------


class FakeSystem:
    """A headset, a lighthouse, a tracker that is seen, one that is asleep, one that is lost."""

    kinds = (1, 4, 3, 3, 3)
    serials = ("HMD-1", "LHB-1", "LHR-A", "LHR-B", "LHR-C")
    events = 0

    def getDeviceToAbsoluteTrackingPose(self, universe, ahead, poses):
        for k, pose in enumerate(poses):
            pose.bDeviceIsConnected = k < 5 and k != 3
            pose.bPoseIsValid = k != 4
            pose.eTrackingResult = 200 if k != 4 else 201
            pose.mDeviceToAbsoluteTracking = np.column_stack([np.eye(3), [k, 1.0, -2.0]]).tolist()
        return poses

    def getTrackedDeviceClass(self, index):
        return self.kinds[index]

    def getStringTrackedDeviceProperty(self, index, what):
        if what == 1002:
            return self.serials[index]
        return "vive_tracker_waist" if index == 2 else "vive_tracker"

    def pollNextEvent(self, event):
        self.events, now = max(self.events - 1, 0), self.events
        event.eventType = 902
        return now > 0


def fake_openvr(system):
    vr = types.SimpleNamespace(
        VRApplication_Background=3,
        TrackingUniverseStanding=1,
        Prop_SerialNumber_String=1002,
        Prop_ControllerType_String=7000,
        VREvent_StandingZeroPoseReset=902,
        TrackedDevicePose_t=types.SimpleNamespace,
        VREvent_t=types.SimpleNamespace,
        closed=False,
    )
    vr.init = lambda kind: system
    vr.shutdown = lambda: setattr(vr, "closed", True)
    return vr


def test_steamvr_is_read():
    system = FakeSystem()
    vr = fake_openvr(system)
    with OpenVr(vr) as runtime:
        first = runtime.read()
        system.events = 1
        second = runtime.read()
    assert vr.closed
    found = {d.serial: d for d in first.devices}
    assert set(found) == {"HMD-1", "LHR-A", "LHR-C"}  # no lighthouse, nobody who sleeps
    assert (found["HMD-1"].role, found["LHR-A"].role, found["LHR-C"].role) == ("head", "waist", "")
    np.testing.assert_allclose(found["LHR-A"].position, [2, -2, 1])
    assert not found["LHR-C"].tracking
    assert (first.epoch, second.epoch) == (0, 1)


def test_without_steamvr_it_is_said():
    vr = fake_openvr(None)

    def refuse(kind):
        raise RuntimeError("VRInitError_Init_NoServerForBackgroundApp")

    vr.init = refuse
    with pytest.raises(ProtocolError, match="SteamVR cannot be reached"):
        OpenVr(vr).__enter__()


def test_the_sender_sends_and_records(tmp_path):
    spec = importlib.util.spec_from_file_location("vive_sender", TOOL)
    sender = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(sender)
    path = tmp_path / "r.jsonl"
    done = sender.main(
        ["--count", "3", "--rate", "200", "--port", str(free_port()), "--record", str(path)],
        openvr=fake_openvr(FakeSystem()),
    )
    assert done == 0
    assert [len(x.devices) for x in tracker_file.read(path, file="r")] == [3, 3, 3]


def test_a_device_of_the_tests_is_a_device():
    assert isinstance(TRACKERS(0).devices[0], Device)
    assert msgspec.json.decode(encode(TRACKERS(0)))["seerob"] == "vive/1"
