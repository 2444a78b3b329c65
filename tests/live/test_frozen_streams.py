"""A person who freezes under new stamps, as each device for people says so over its real wire."""

from __future__ import annotations

import time

import numpy as np
import pytest
from msgspec.structs import replace

from live_story import listening, wait_for
from seerob.app.emulation.mvn_person import Pose, animated, measured
from seerob.core.samples import BodyPoint, BodySample
from seerob.description.capture.frozen import STEPS
from seerob.devices.live.listening import STILL, Listener
from seerob.devices.sources.kinect import Kinect
from seerob.protocols.tracking.mvn_pose import SEGMENTS
from soak import device_kinds

KINDS = ("natnet", "vrpn", "mvn", "rokoko", "vive", "kinect", "headset")
TIMEOUT, LATE = 0.5, 0.25
"""Of the sources, and what a busy machine may add [s]."""
NOISE = dict.fromkeys(KINDS, 1e-5) | {"kinect": 1e-3}
"""Of who stands still [m]: less than any of these has; a depth camera's is some millimetres."""
HAND = SEGMENTS.index("RightHand")


class Switch:
    """A person whose device hangs from when it is told to.

    Args:
        person: Who moves.
        rows: Which segments hang.
    """

    def __init__(self, person, rows=slice(None)):
        self.person, self.rows = person, rows
        self.hangs, self.at, self.last = False, 0.0, None

    def __call__(self, t):
        said = self.person(t)
        if not self.hangs or self.last is None:
            self.last = said
            return said
        if isinstance(said, Pose):
            places, turns = said.positions.copy(), np.array(said.wxyz)
            places[self.rows], turns[self.rows] = self.last.positions[self.rows], self.last.wxyz[self.rows]
            return Pose(places, turns)
        return self.last

    def hang(self):
        self.hangs, self.at = True, time.monotonic()


def moving(t):
    """A person who never stands, without any noise: all that is seen goes to and fro."""
    pose = animated_once(0.0)
    return Pose(pose.positions + 0.2 * np.sin(t) * np.array([1.0, 0.5, 0.0]), pose.wxyz)


animated_once = animated("library:reach")


def standing(t):
    return animated_once(0.0)


def device(kind, person, patch):
    switch = Switch(person)
    patch.setattr(device_kinds, "person", lambda: switch)
    found = getattr(device_kinds, kind)(patch)
    if kind == "kinect":
        found.server.scene = switch = Switch(_scene(person, found.server.scene))
    return found, switch


def _scene(person, scene):
    """What the camera sees of a person who goes as that one does."""
    still = scene(0.0)

    def at(t):
        by = person(t).positions - animated_once(0.0).positions
        noisy = np.tile(by[HAND], (len(still.bodies[0].positions), 1))
        body = type(still.bodies[0])(1, still.bodies[0].positions + noisy, None, still.bodies[0].confidence)
        return type(still)(t=t, bodies=(body,), camera="emulated", up=still.up)

    return at


def bodies(heard):
    return [s for s in list(heard) if isinstance(s, BodySample)]


@pytest.mark.parametrize("kind", KINDS)
def test_a_device_that_hangs_on_its_last_picture_is_silent(kind, monkeypatch):
    found, switch = device(kind, moving, monkeypatch)
    source = replace(found.source, timeout=TIMEOUT)
    try:
        with listening(source) as heard:
            wait_for(lambda: len(bodies(heard)) > 2 * STEPS)
            switch.hang()
            # What a loaded machine heard late is doubted for that first.
            wait_for(lambda: bodies(heard)[-1].reason.endswith(STILL))
            told = bodies(heard)
    finally:
        found.server.stop()
    news = [s for s in told if not s.reason]
    assert news[-1].t < switch.at + LATE
    assert told[-1].t < switch.at + LATE  # it stays as old as it is


@pytest.mark.parametrize("kind", KINDS)
def test_who_stands_still_and_is_measured_stays_heard(kind, monkeypatch):
    found, _ = device(kind, measured(standing, NOISE[kind]), monkeypatch)
    source = replace(found.source, timeout=TIMEOUT)
    try:
        with listening(source) as heard:
            wait_for(lambda: len(bodies(heard)) > 4 * STEPS)
    finally:
        found.server.stop()
    told = bodies(heard)
    assert not [s.reason for s in told if "again and again" in s.reason]
    seen = [sum(p.position is not None for p in s.points) for s in told]
    assert min(seen[5:]) == max(seen)


@pytest.mark.parametrize("kind", ["mvn", "natnet", "rokoko", "vive"])
@pytest.mark.parametrize("noise", [0.0, 2e-4])
def test_one_limb_that_hangs_is_not_seen_any_more(kind, noise, monkeypatch):
    """Without noise, too: what is filtered has little that goes to and fro."""
    found, switch = device(kind, measured(moving, noise), monkeypatch)
    switch.rows = [HAND]
    try:
        with listening(replace(found.source, timeout=TIMEOUT)) as heard:
            wait_for(lambda: len(bodies(heard)) > 2 * STEPS)
            switch.hang()
            wait_for(lambda: bodies(heard)[-1].t > switch.at + LATE)
    finally:
        found.server.stop()
    told = bodies(heard)
    before, after = (
        {p.name for p in s.points if p.position or p.wxyz}
        for s in (max((s for s in told if s.t < switch.at - LATE), key=lambda s: s.t), told[-1])
    )
    assert {p.bone for p in told[-1].points if p.name in before - after} == {"right_hand"}


def said(k, places):
    points = tuple(BodyPoint(name=str(i), bone="head", position=(x, 0.0, 0.0)) for i, x in enumerate(places))
    return BodySample(source="", seq=0, target="op", t=k / 60, t_device=100 + k / 60, points=points)


def listened(samples):
    posted = []
    listener = Listener(Kinect(human="op", timeout=TIMEOUT), None, posted.append)
    for sample in samples:
        listener.take(sample)
    return posted


@pytest.mark.parametrize("moved", [0, 1, 10, STEPS - 1, STEPS])
def test_a_point_that_stands_while_others_move_is_not_measured(moved):
    """However little it moved before."""
    told = listened(said(k, (0.1 * np.sin(k), 0.1 * np.sin(min(k, moved)))) for k in range(3 * STEPS))
    assert [p.position is None for p in told[-1].points] == [False, True]


def test_frames_that_come_twice_are_one_frame():
    told = listened(said(k, (0.1 * np.sin(k // 2), 0.1 * np.cos(k // 2))) for k in range(4 * STEPS))
    assert len(told) == 2 * STEPS
    assert not any(p.position is None or s.reason for s in told for p in s.points)
