"""Trackers of an OpenXR runtime, with a stand-in for one: no runtime is here to try."""

import importlib.util
import socket
import sys
from pathlib import Path

import numpy as np
import pytest

from seerob.core.transforms import rotation_from_wxyz
from seerob.protocols import ProtocolError
from seerob.protocols.tracking.openxr_session import Located, OpenXr, OpenXrSession, serials
from seerob.protocols.tracking.vive import MOST_DEVICES, decode, encode

TOOL = Path(__file__).resolve().parents[2] / "tools/vive_sender/vive_sender.py"
ROLE = "/user/vive_tracker_htcx/role/"
WAIST, FOOT, NOBODY = (f"/devices/htc/vive_trackerLHR-0000000{k}" for k in "ABC")


class FakeRuntime:
    """A waist, a foot that is out of sight, a tracker without a role."""

    def __init__(self):
        self.connected = [(WAIST, ROLE + "waist"), (FOOT, ROLE + "left_foot"), (NOBODY, "")]
        self.poses = {
            ROLE + "waist": Located(True, (1.0, 2.0, 3.0), (0.0, np.sqrt(0.5), 0.0, np.sqrt(0.5))),
            ROLE + "left_foot": Located(False, (9.0, 9.0, 9.0)),
            NOBODY: Located(True, (0.0, 1.0, 0.0)),
        }
        self.recentred = False
        self.open = False

    def begin(self):
        self.open = True

    def end(self):
        self.open = False

    def frame(self):
        assert self.open
        was, self.recentred = self.recentred, False
        return was

    def trackers(self):
        return self.connected

    def locate(self, path):
        return self.poses[path]


def test_roles_serial_numbers_axes_and_what_is_not_tracked():
    fake = FakeRuntime()
    with OpenXr(fake, clock=lambda: 7.0) as runtime:
        read = runtime.read()
    assert not fake.open
    assert read.t == 7.0
    waist, foot, nobody = read.devices
    assert [(d.serial, d.role, d.tracking) for d in read.devices] == [
        ("LHR-0000000A", "waist", True),
        ("LHR-0000000B", "left_foot", False),
        ("LHR-0000000C", "", True),
    ]
    np.testing.assert_allclose(waist.position, [-3, -1, 2])  # forward is -z, left -x, up y
    turned = rotation_from_wxyz(waist.wxyz)
    np.testing.assert_allclose(turned[:, 1], [0, 0, 1], atol=1e-12)  # its y is up
    np.testing.assert_allclose(turned[:, 2], [0, -1, 0], atol=1e-12)  # a quarter turn: its z is the right
    assert np.isnan(foot.position).all()
    np.testing.assert_allclose(nobody.position, [0, 0, 1])
    back = decode(encode(read))
    np.testing.assert_allclose(back.devices[0].wxyz, waist.wxyz)
    assert not back.devices[1].tracking


def test_a_new_origin_is_a_new_epoch():
    fake = FakeRuntime()
    with OpenXr(fake) as runtime:
        first = runtime.read()
        fake.recentred = True
        assert [first.epoch, runtime.read().epoch, runtime.read().epoch] == [0, 1, 1]


def test_of_two_with_one_role_neither_has_a_pose():
    fake = FakeRuntime()
    fake.connected.append(("/devices/htc/vive_trackerLHR-0000000D", ROLE + "waist"))
    with OpenXr(fake) as runtime:
        assert {d.serial[-1]: d.tracking for d in runtime.read().devices} == {
            "A": False, "B": False, "C": True, "D": False,
        }  # fmt: skip


def test_more_than_a_message_holds_are_left_out_and_a_pose_that_is_no_number_is_none():
    fake = FakeRuntime()
    fake.connected = [(f"/d/{k}", "") for k in range(100)]
    fake.poses = {path: Located(True, (np.nan, 0.0, 0.0)) for path, _ in fake.connected}
    with OpenXr(fake) as runtime:
        read = runtime.read()
    assert len(decode(encode(read)).devices) == MOST_DEVICES
    assert not any(d.tracking for d in read.devices)


def test_names_are_told_apart():
    assert serials(["/a/x", "/b/x", "/b/y", "/z/LHR-1A2B3C4D", "/"]) == [
        "/a/x", "/b/x", "y", "LHR-1A2B3C4D", "/",
    ]  # fmt: skip
    assert len(set(serials(["/p/" + "x" * 300, "/q/y"]))) == 2


def test_without_the_package_it_is_said(monkeypatch):
    monkeypatch.setitem(sys.modules, "xr", None)
    with pytest.raises(ProtocolError, match=r"pip install \"seerob\[openxr\]\""):
        OpenXrSession().begin()


def test_the_sender_sends_them_and_ends_when_the_runtime_does(capsys):
    spec = importlib.util.spec_from_file_location("vive_sender_of_openxr", TOOL)
    sender = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(sender)

    class Ending(FakeRuntime):
        frames = 0

        def frame(self):
            self.frames += 1
            if self.frames > 1:
                raise ProtocolError("the session has ended")
            return super().frame()

    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as heard:
        heard.bind(("127.0.0.1", 0))
        heard.settimeout(30)
        port = heard.getsockname()[1]
        assert sender.main(["--openxr", "--rate", "1000", "--port", str(port)], openxr=Ending()) == 1
        assert [d.role for d in decode(heard.recv(65536)).devices] == ["waist", "left_foot", ""]
    assert "the session has ended" in capsys.readouterr().err
